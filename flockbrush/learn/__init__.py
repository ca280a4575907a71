"""What a designer sees of learning: from a clip to a brush, how the brush was found, and how far it can be trusted."""

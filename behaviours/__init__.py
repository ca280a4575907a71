"""Models of collective motion, one file each, and the brushes that carry their parameters."""

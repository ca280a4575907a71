"""The window over a film: look, mark, put right, sketch.  One module for each mode."""

"""The window for clips: view, mark, correct and sketch, one module for each mode."""

"""Fitting brushes to clips: trials, choice, comparison, report."""

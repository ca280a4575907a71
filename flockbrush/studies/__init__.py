"""Sweeps and experiments: every combination, every seed."""

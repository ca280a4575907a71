"""Kinds of condition, a file for each group of words (see `flockbrush.behaviours.trigger`)."""

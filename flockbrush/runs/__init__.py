"""Runs of levels: opening, stepping, recording, snapshots, words for the terminal."""

"""Runs of levels: opening, stepping, recording, snapshots, terminal output."""

"""Exports of runs: videos, tables, scenes, pages and plots."""

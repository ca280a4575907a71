"""What comes out of a run: videos, tables, USD, plots."""

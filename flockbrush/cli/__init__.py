"""The command-line interface, one file for each group of commands."""

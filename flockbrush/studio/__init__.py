"""The playground: a window in which a running herd is painted, tuned and directed."""

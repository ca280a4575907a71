"""Models of collective motion, one file each, and the brushes that carry their parameters."""

if not __name__.startswith("flockbrush."):
    raise ImportError("import flockbrush.behaviours instead of behaviours (since 0.2)")

"""The runtime: worlds, columns, schedule, clock, noise, commands, recording, grids and fields.  It knows no animals."""

if not __name__.startswith("flockbrush."):
    raise ImportError("import flockbrush.engine instead of engine (since 0.2)")

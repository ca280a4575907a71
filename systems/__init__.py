"""What happens in a tick: commands, ground, sense, decide, steer, speed, move, live, record."""

if not __name__.startswith("flockbrush."):
    raise ImportError("import flockbrush.systems instead of systems (since 0.2)")

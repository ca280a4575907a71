"""Level files made in the Tiled editor: schema, reader, writer, the Tiled project, and the shipped levels."""

if not __name__.startswith("flockbrush."):
    raise ImportError("import flockbrush.levels instead of levels (since 0.2)")

"""Level files made in the Tiled editor: schema, reader, writer, the Tiled project, and the shipped levels."""

"""The runtime: worlds, columns, schedule, clock, noise, commands, recording, grids and fields.  It knows no animals."""

"""What the columns of tables of tracks are called, in files of Flockbrush and of other programs."""

from __future__ import annotations

OURS = {"vx", "vy", "vz", "speed", "species", "role", "reference"}  # columns of exports, which are in metres
LENGTH, LENGTH_M = "length", "body-length-m"  # of animals, likewise; and in any table in metres
FLOWN = {"x_b", "y_b", "x", "y", "z"}  # of `flockbrush formation fly`, likewise
NAMES = {  # what columns are called, the first that is there is taken
    "id": ("id", "track_id", "trackid", "track", "individual", "individual-local-identifier", "tag-local-identifier",
           "animal", "animal_id", "object", "particle", "name"),
    "x": ("x", "x_bl", "x_m", "x_px", "pos_x", "position_x", "utm-easting"),
    "y": ("y", "y_bl", "y_m", "y_px", "pos_y", "position_y", "utm-northing"),
    "z": ("z", "z_bl", "z_m", "z_px", "pos_z", "position_z", "height-above-ellipsoid", "height-above-msl"),
    "frame": ("frame", "frame_number", "frame_idx"),
    "time": ("time", "time_s", "seconds", "t", "timestamp"),
    "visible": ("visible",),  # of Movebank: false for outliers
}  # fmt: skip


def columns_of(header):
    """{kind: which column of the header is of it, or None}; x and y are in one unit."""
    where = {kind: next((header.index(n) for n in names if n in header), None) for kind, names in NAMES.items()}
    for x, y in zip(NAMES["x"], NAMES["y"], strict=True):
        if x in header and y in header:
            return where | {"x": header.index(x), "y": header.index(y)}
    return where


def length_of(header):
    """What the column of lengths of animals, m, is called."""
    return LENGTH if {*OURS, LENGTH} <= set(header) else LENGTH_M

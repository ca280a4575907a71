"""Limits of everything that is read from outside: one table, checked before memory or time is spent.

A limit is a plain whole number that knows its unit and what it bounds.  ``docs/limits.md`` lists them all; the page is
made from this file by ``python -m flockbrush.engine.limits``, and a test compares the two.
"""

from __future__ import annotations

MIB = 1 << 20


class Limit(int):
    """A whole number with a unit and a sentence.

    Parameters
    ----------
    value : int
    unit : str
    of : str
        What must not exceed it.
    """

    unit: str
    of: str

    def __new__(cls, value, unit, of):
        limit = super().__new__(cls, value)
        limit.unit, limit.of = unit, of
        return limit

    @property
    def text(self) -> str:
        """The number with its unit: "64 MiB", "1,000,000 animals"."""
        if self.unit == "bytes":
            return f"{self // MIB:,} MiB" if self >= MIB else f"{int(self):,} bytes"
        return f"{int(self):,} {self.unit}"


# time ------------------------------------------------------------------------------------------

TICKS = Limit(10**9, "ticks", "a run, and the ticks named in a recording")
SILENT_TICKS = Limit(32 * 60, "ticks", "the interval between two records of a recording")

# recordings ------------------------------------------------------------------------------------

RECORDING_TEXT_BYTES = Limit(16 * MIB, "bytes", "the header or one command of a recording, unpacked")
RECORDING_VALUES = Limit(4_000_000, "values", "all commands of a recording")
RECORDING_COMMANDS_BYTES = Limit(64 * MIB, "bytes", "all commands of a recording, unpacked")
RECORDING_ASSETS_BYTES = Limit(256 * MIB, "bytes", "all files embedded in a recording, unpacked")
RECORDING_SUMS_BYTES = Limit(4 * MIB, "bytes", "the sums of one tick in a recording, unpacked")
SNAPSHOT_BYTES = Limit(1024 * MIB, "bytes", "one snapshot in a recording, unpacked")
SNAPSHOT_OTHERS_BYTES = Limit(256 * MIB, "bytes", "all data in a snapshot other than the animals")
COMMAND_DEPTH = Limit(8, "levels", "lists within lists in a command")
COMMAND_SIZE = Limit(10**15, "", "a number in a command, in its own unit")

# levels ----------------------------------------------------------------------------------------

ANIMALS = Limit(1_000_000, "animals", "a world")
LEVEL_FILE_BYTES = Limit(64 * MIB, "bytes", "one file of a level")
LEVEL_BYTES = Limit(256 * MIB, "bytes", "all files of a level")
PROGRAM_STATES = Limit(64, "states", "a program")
PROGRAM_TRIGGERS = Limit(256, "triggers", "a program")
PROGRAM_DEPTH = Limit(8, "levels", "conditions within conditions of a program")
PROGRAM_MEMORIES = Limit(8, "memories", "regions, states and neighbours that the triggers of a program remember")
LAYER_CELLS = Limit(2048 * 2048, "tiles", "one layer of a level")
LEVEL_CELLS = Limit(4 * 2048 * 2048, "tiles", "all layers of a level")
LAYERS = Limit(256, "layers", "a level")
OBJECTS = Limit(20_000, "objects", "a level")
CORNERS = Limit(2_000, "corners", "one polygon or polyline")
LEVEL_CORNERS = Limit(200_000, "corners", "all polygons and polylines of a level")
HEIGHT_PIXELS = Limit(4096 * 4096, "pixels", "the height map of a level")
ART_PIXELS = Limit(4096 * 4096, "pixels", "the picture of a map's artwork; larger artwork is drawn at a smaller scale")
ART_TILES = Limit(200_000, "tiles", "artwork tiles that do not fill exactly one cell: larger, shifted, rotated")
GROUND_RULES = Limit(100, "rules", "rules that give the tiles of a map a meaning")
TILES = Limit(65_536, "tiles", "one tileset")
JSON_DEPTH = Limit(64, "levels", "nested objects in a level file")
JSON_VALUES = Limit(1_000_000, "values", "a level file, apart from lists of numbers")
JSON_DIGITS = Limit(40, "digits", "a number in a level file")
PROPERTY_TEXT = Limit(1_000, "characters", "a string property of a level, or one of its ground rules")

# other texts -----------------------------------------------------------------------------------

TOML_BYTES = Limit(1 * MIB, "bytes", "a TOML file: brush, camera, sweep")
TOML_DEPTH = Limit(32, "levels", "nested tables in a TOML file")
MARKS_BYTES = Limit(16 * MIB, "bytes", "a table of marked birds")
MARKS_ROWS = Limit(200_000, "rows", "a table of marked birds")
FORMATION_BIRDS = Limit(2_000, "birds", "a frame of marked birds or of a formation file")
FORMATION_BYTES = Limit(16 * MIB, "bytes", "a formation file")
TRACKS_BYTES = Limit(512 * MIB, "bytes", "a table of tracks or of a flight")
TABLE_LINE = Limit(100_000, "characters", "one line of a table")
TRACK_ROWS = Limit(5_000_000, "rows", "a table of tracks or of a flight")
TRACK_FRAMES = Limit(1_000_000, "frames", "from the first to the last frame of tracks")
TRACK_ANIMALS = Limit(1_000_000, "animals", "a file of tracks")
TRACK_NUMBERS = Limit(
    20_000_000, "numbers", "tracks with one row per frame and body parts; for other formats, one frame"
)
TRACKS_UNPACKED_BYTES = Limit(256 * MIB, "bytes", "the columns read from a Parquet file of tracks, unpacked")
TRACK_CELLS = Limit(10_000_000, "", "frames times birds of tracks or of a flight")
MARKED_FILM_BYTES = Limit(8 * MIB, "bytes", "the marks of a film")

# sweeps ----------------------------------------------------------------------------------------

SCENARIOS = Limit(100_000, "scenarios", "a sweep")
SEEDS = Limit(100_000_000, "seeds", "a sweep")
JOURNAL_LINE = Limit(1 * MIB, "bytes", "one line of a sweep's journal")

# what the program keeps for itself -------------------------------------------------------------

STATE_BYTES = Limit(256 * MIB, "bytes", "the trials of an interrupted `learn`")
STATE_VALUES = Limit(4_000_000, "values", "one line of the journal of a playground session; the trials of `learn`")
STATE_LINES = Limit(1_000_000, "lines", "the journal of a playground session")
JSON_LINE_BYTES = Limit(128 * MIB, "bytes", "one line of the journal of a playground session")
SESSION_BYTES = Limit(10_000_000, "bytes", "the description of a playground session (`session.json`)")
SETTINGS_BYTES = Limit(100_000, "bytes", "the settings of the playground")

# pictures and films ----------------------------------------------------------------------------

PICTURE_BYTES = Limit(256 * MIB, "bytes", "a picture file")
PICTURE_PIXELS = Limit(51_000_000, "pixels", "a picture: photograph, mask, regions")
FILM_PIXELS = Limit(17_000_000, "pixels", "a frame of a clip")
FIELDS_BYTES = Limit(640 * MIB, "bytes", "a file of fields, unpacked")

# the live link ---------------------------------------------------------------------------------

LIVE_CLIENTS = Limit(8, "clients", "a live link")
LIVE_MESSAGE = Limit(256 << 10, "bytes", "a message of a client of the live link")
LIVE_MESSAGES = Limit(200, "messages a second", "a client of the live link; messages are read no faster")
LIVE_WAITING = Limit(256, "requests", "requests of all clients of a live link that wait for the next tick")
LIVE_ANSWERS = Limit(1_024, "messages", "messages that wait until a client of the live link reads them")
LIVE_UNDO = Limit(500, "commands", "commands that clients of a live link can undo")


def table() -> dict[str, Limit]:
    """All limits by name, in the order of this file."""
    return {name: value for name, value in globals().items() if isinstance(value, Limit)}


def page() -> str:
    """``docs/limits.md``."""
    rows = [f"| `{name}` | {limit.text.strip()} | {limit.of} |" for name, limit in table().items()]
    return "\n".join([*_HEAD, *rows, ""])


_HEAD = (
    "# Limits",
    "",
    "All data read from files is limited in size. A file beyond a limit is refused with a message that",
    "names the file and the limit, before memory is allocated. No malformed file under 100 MB needs more",
    "than 1 GB of memory before it is refused; `tests/fuzz/test_memory.py` measures this for every kind",
    "of file.",
    "",
    "The limits are declared in `engine/limits.py`; this page is generated from them by",
    "`python -m flockbrush.engine.limits > docs/limits.md`.",
    "",
    "| limit | maximum | applies to |",
    "|---|---|---|",
)


if __name__ == "__main__":
    print(page(), end="")

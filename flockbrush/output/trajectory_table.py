"""The trajectory table of a run, common to all table formats: one row per animal and frame."""

from __future__ import annotations

import hashlib
import json

import numpy as np

import flockbrush
from flockbrush.engine.files import write_text
from flockbrush.film.track_table import SCHEMA, about_file
from flockbrush.runs.catalogue import LABELS, catalogue_of
from flockbrush.runs.snapshots import Moment, words_of
from flockbrush.systems.programs import Programs

COLUMNS = (
    "frame", "time", "id", "x", "y", "z", "vx", "vy", "vz", "heading", "speed", "species", "brush", "role", "reference",
    *LABELS, "pitch", "length",
)  # fmt: skip
BANK = "bank"

ROLES = ("follower", "leader")
TEXTS = ("species", "brush", "role", *LABELS)  # columns whose values are names


def table_of(simulation, moment: Moment, frame):
    """({column: array}, {column: names}) of one moment; columns of names hold indices into these names."""
    words = {**words_of(simulation), "role": list(ROLES)}
    x, y, z = moment.xyz.T
    vx, vy, vz = moment.velocity.T
    n = len(moment)
    table = {
        "frame": np.full(n, frame, np.int32),
        "time": np.full(n, moment.time),
        "id": moment.ids,
        "x": x, "y": y, "z": z, "vx": vx, "vy": vy, "vz": vz,
        "heading": np.arctan2(moment.forward[:, 1], moment.forward[:, 0]),
        "speed": np.linalg.norm(moment.velocity, axis=1),
        "species": moment.species,
        "brush": moment.brush,
        "role": moment.leader.astype(int),
        "reference": moment.reference,
        **moment.labels,
        "pitch": np.arctan2(moment.forward[:, 2], np.hypot(moment.forward[:, 0], moment.forward[:, 1])),
        "length": moment.length,
    }  # fmt: skip
    if BANK in columns_of(simulation):
        table[BANK] = bank_of(moment.forward, moment.up)
    return table, words


def columns_of(simulation):
    """The columns of its table; that of a flight that was lifted has one more."""
    return (*COLUMNS, BANK) if getattr(simulation, "banks", False) else COLUMNS


def bank_of(forward, up):
    """(n,) how far bodies lean, radians, positive with the right wing down, of unit vectors (n, 3)."""
    right = np.cross(forward, (0.0, 0.0, 1.0))
    return np.arctan2((up * right).sum(-1), (up * np.cross(right, forward)).sum(-1))


def about_table(fps):
    """The metadata of every table in metres."""
    return {
        "schema": SCHEMA,
        "fps": fps,
        "unit": "m",
        "unit_time": "s",
        "unit_angle": "rad",
        "axes": "x east, y north, z up; heading counter-clockwise from east",
        "version": flockbrush.__version__,
    }


def write_about(path, about):
    """Write the metadata of a table beside it, where they are looked for."""
    write_text(about_file(path), json.dumps(about, indent=2) + "\n")


def metadata_of(simulation, fps):
    """The metadata of a table."""
    level = simulation.level
    first = next(iter(level.files.values()), b"")
    return about_table(fps) | {
        "level": level.name,
        "level_sha256": hashlib.sha256(first).hexdigest(),
        "width": level.width,
        "height": level.height,
        "boundary": level.boundary,
        "seed": simulation.origin["seed"],
        "dt": simulation.clock.dt,
    }


def names_in_tables(simulation):
    """What a table needs beside it to be measured as its run (`flockbrush.output.run_table`)."""
    catalogue = catalogue_of(simulation.world)
    palette = catalogue.palette
    return {
        "flying": [name for name, flies in zip(palette.names, palette.flies_free.tolist(), strict=True) if flies],
        "programs": {
            one.program.name: {name: catalogue.word("state", f"{one.program.name}/{name}") for name in one.names}
            for one in simulation.world.resource(Programs).compiled
        },
    }


def as_attribute(value):
    """A value as files with 32-bit numbers can hold it: a larger whole number becomes a text."""
    return str(value) if isinstance(value, int) and abs(value) >= 2**31 else value


def quoted(text) -> str:
    """A text as one field of a CSV."""
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in ',"\r\n') else text

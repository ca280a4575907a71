"""Formats of tracks: one function each, from a path to a `TrackTable`."""

from __future__ import annotations

import math
import re
import zipfile
import zlib
from array import array
from itertools import chain
from pathlib import Path

import numpy as np

from flockbrush.behaviours.tables import read_table
from flockbrush.engine import limits
from flockbrush.engine.files import refused
from flockbrush.engine.problems import Problem, ProblemsError, did_you_mean
from flockbrush.film.track_columns import FLOWN, LENGTH, OURS, columns_of, length_of
from flockbrush.film.track_numbers import TOLD, moment_of, number_grid, number_of, whole_frames
from flockbrush.film.track_table import (
    WRAPPED,
    TrackTable,
    begun,
    beside,
    check_rate,
    check_size,
    heights_left_out,
    known_format,
    line_word,
    metres,
    part_middle,
    placed,
    rate_of,
)  # fmt: skip

_ABOUT = b"schema", b"boundary", b"unit"  # metadata in Parquet
ROUNDED = 0.1  # frames by which times may be off a frame without being interpolated


# tables with a row for each animal in each frame --------------------------------------------------


def csv_table(path) -> TrackTable:
    """Tracks from CSV and TSV of Flockbrush, trackdf, Movebank, DeepLabCut, idtracker.ai and TRex. ProblemsError."""
    rows = read_table(path, limits.TRACKS_BYTES, limits.TRACK_ROWS)
    line, header = next(rows, (1, []))
    header = [cell.strip() for cell in header]
    lower = [cell.lower() for cell in header]
    if lower[:1] == ["scorer"]:
        return _deeplabcut(path, header, rows)
    if "x1" in lower and "y1" in lower:
        return _idtracker(path, lower, rows)
    if _trex_columns(header):
        return _of_one(path, *_of_csv(path, header, rows))
    where = columns_of(lower)
    degrees = "location-long" in lower and "location-lat" in lower and where["x"] is None
    if degrees:
        where |= {"x": lower.index("location-long"), "y": lower.index("location-lat")}
    _need(path, where, lower)
    heading = lower.index("heading") if "heading" in lower and not degrees else None
    if {"track_id", "position_x"} <= set(lower):  # TrackMate, where id is that of a spot
        where["id"], rows = lower.index("track_id"), _below_titles(rows, lower.index("position_x"))
    length = length_of(lower)
    more = {"heading": heading, LENGTH: lower.index(length) if length in lower else None}
    columns, names, animal, lines = _parsed(path, rows, where, more)
    return _long_table(path, lower, where, columns, names, animal, lines, degrees)


def _below_titles(rows, x):
    """The rows of TrackMate without the three that name its columns again and their units."""
    rows, numbers = iter(rows), False
    for line, row in rows:
        numbers = numbers or (x < len(row) and bool(re.match(r"\s*[-+.\d]", row[x])))
        if numbers or line > 4:
            yield line, row


def _need(path, where, header):
    missing = [kind for kind in ("id", "x", "y") if where[kind] is None]
    if where["frame"] is None and where["time"] is None:
        missing.append("frame")
    if missing:
        hint = did_you_mean(missing[0], header)
        needed = "a file of tracks must have the columns id, x, y, and frame or time"
        raise ProblemsError([Problem(str(path), 1, missing[0], f"there is no such column{hint}; {needed}")])


def _parsed(path, rows, where, more):
    """({name: numbers}, names, which of them each row is of, its line) of the rows; ProblemsError.

    ``more``: columns of numbers besides, by name.
    """
    problems: list[Problem] = []
    plain = {name: where[name] for name in ("x", "y", "z", "frame")} | more
    numbers = {name: array("d") for name in (*plain, "time", "visible")}
    names: dict[str, int] = {}
    animal, lines = array("q"), array("q")
    for line, row in rows:
        for name, at in plain.items():
            if at is not None:
                numbers[name].append(number_of(path, line, name, row, at, [] if name == "z" else problems))
        if where["time"] is not None:
            numbers["time"].append(moment_of(path, line, row, where["time"], problems))
        if where["visible"] is not None:
            numbers["visible"].append("".join(row[where["visible"] :][:1]).strip().lower() != "false")
        animal.append(names.setdefault(row[where["id"]].strip() if where["id"] < len(row) else "", len(names)))
        lines.append(line)
        check_size(path, 1, len(names))
        if len(problems) >= TOLD:
            break
    if problems:
        raise ProblemsError(problems)
    if not animal:
        raise refused(path, "has no rows")
    columns = {name: np.frombuffer(values) for name, values in numbers.items() if len(values)}
    return columns, list(names), np.frombuffer(animal, np.int64), np.frombuffer(lines, np.int64)


def _long_table(path, header, where, columns, names, animal, lines, degrees=False):
    """The table of rows of named animals, from any kind of file; ``lines`` says where they are."""
    named = _unit_of_name(header[where["x"]])
    about = beside(path)
    if named and about.get("unit", named) != named:  # of an earlier table with this name
        about = {}
    notes = [WRAPPED] if about.get("boundary") == "wrap" else []
    x, y = columns["x"], columns["y"]
    nameless = np.array([not name for name in names])[animal]
    hidden = columns["visible"] == 0 if "visible" in columns else np.zeros(len(x), bool)
    for gone, what in ((nameless, "without an id"), (hidden, "with visible = false")):
        if gone.any():
            first = f"the first is {line_word(path)} {lines[np.argmax(gone)]}"
            notes.append(f"{gone.sum()} rows {what} were left out; {first}")
    valid = np.isfinite(x) & np.isfinite(y) & ~nameless & ~hidden
    if where["frame"] is None:
        valid &= np.isfinite(columns["time"])
    if not valid.any():
        raise refused(path, "no row has an id and a position")
    notes += heights_left_out(columns["z"][valid]) if "z" in columns else []
    unit = about.get("unit") if about.get("unit") in ("m", "px", "bl") else None
    if degrees:
        x, y = metres(path, x, y, valid)
        unit = "m"
    else:
        unit = unit or ("m" if set(header) >= OURS or set(header) >= FLOWN else named)
    fps = about.get("fps") if isinstance(about.get("fps"), int | float) else None
    if where["frame"] is not None:
        frames = whole_frames(path, columns["frame"][valid])
        if fps:
            check_rate(path, fps, columns["frame"], columns.get("time"))
        fps = fps or rate_of(columns["frame"], columns.get("time"))
    else:
        frames, fps, off = _frames_of_times(path, columns["time"][valid], animal[valid])
    heading = None if degrees or "heading" not in columns else columns["heading"][valid]
    places, animal, lines = np.column_stack([x[valid], y[valid]]), animal[valid], lines[valid]
    if where["frame"] is None and np.abs(off).max() > ROUNDED:
        places = _on_time(places, frames, off, animal)
        notes.append(f"times of sights differ: positions are interpolated to common times, {1.0 / fps:.4g} s apart")
        one = _nearest_in_time(frames, off, animal)
        frames, places, animal, lines = frames[one], places[one], animal[one], lines[one]
        heading = None if heading is None else heading[one]
    xy, ids, numbers, turned = placed(path, frames, names, animal, places, heading, lines)
    start = begun(columns["time"][valid]) if "time" in columns else 0.0
    lengths = columns[LENGTH][valid] if LENGTH in columns else np.empty(0)
    length = float(np.median(lengths[np.isfinite(lengths)])) if np.isfinite(lengths).any() else math.nan
    return TrackTable(
        xy, ids, numbers, fps, unit, None, turned, notes, start, unit is not None, length if length > 0 else None
    )


def _unit_of_name(name):
    if name in ("utm-easting", "x_m"):
        return "m"
    return {"x_px": "px", "x_bl": "bl"}.get(name)


def _frames_of_times(path, times, animal):
    """(frame numbers, frames a second, how many frames later a sight is) of times (k,), s, of animals (k,).

    The time from frame to frame is that between the sights of one animal: clocks may differ, and be rounded.
    """
    order = np.lexsort((times, animal))
    gaps = np.diff(times[order])[np.diff(animal[order]) == 0]
    gaps = gaps[gaps > 1e-6]
    if not len(gaps):
        raise refused(path, "no animal has sights at two times")
    step = float(np.median(gaps))
    for _ in range(2):  # gaps are whole steps
        count = np.maximum(np.round(gaps / step), 1.0)
        step = float(gaps.sum() / count.sum())
    frames = (times - times.min()) / step
    whole = np.round(frames)
    return whole.astype(np.int64), 1.0 / step, frames - whole


def _on_time(places, frames, off, animal):
    """Places (k, 2) at their frames, on straight lines from each sight to the one before or after."""
    order = np.lexsort((frames + off, animal))
    at, xy, late = (frames + off)[order], places[order], off[order]
    other = np.clip(np.arange(len(order)) - np.where(late > 0, 1, -1), 0, len(order) - 1)
    step = at[other] - at
    near = (animal[order][other] == animal[order]) & (np.abs(step) > 0.1) & (np.abs(step) < 2.5)
    share = np.where(near, -late / np.where(near, step, 1.0), 0.0)
    out = np.empty_like(places)
    out[order] = xy + share[:, None] * (xy[other] - xy)
    return out


def _nearest_in_time(frames, off, animal):
    """(k,) bool: of several sights of an animal about the time of one frame the nearest, or those that are so."""
    order = np.lexsort((np.abs(off), frames, animal))
    again = (np.diff(frames[order]) == 0) & (np.diff(animal[order]) == 0) & (np.abs(np.diff(off[order])) > 1e-6)
    keep = np.ones(len(frames), bool)
    keep[order[1:][again]] = False
    return keep


def parquet_table(path) -> TrackTable:
    """Tracks from Parquet with the columns id, x, y, and frame or time. ProblemsError."""
    try:
        import pyarrow
    except ImportError:
        raise refused(path, 'reading it needs pyarrow: pip install "flockbrush[export]"') from None
    try:
        return _parquet(path)
    except pyarrow.ArrowException as error:
        raise refused(path, f"is not a readable Parquet file: {str(error)[:200]}") from None


def _parquet(path):
    import pyarrow.parquet as parquet

    with parquet.ParquetFile(path) as file:
        schema = file.schema_arrow
        stated = schema.metadata or {}
        about = known_format(path, {k.decode(): stated[k].decode() for k in _ABOUT if k in stated})
        header = [name.lower() for name in schema.names]
        where = columns_of(header)
        _need(path, where, header)
        if where["z"] is not None and not _is_number(schema.field(where["z"]).type):
            where["z"] = None
        column_names = {kind: schema.names[at] for kind, at in where.items() if at is not None}
        own = {"heading": "heading", LENGTH: length_of(header)}
        column_names |= {kind: schema.names[header.index(name)] for kind, name in own.items() if name in header}
        check_parquet(path, file.metadata, set(column_names.values()))
    with parquet.ParquetFile(path, read_dictionary=[column_names["id"]]) as file:  # long names are unpacked once
        data = file.read(columns=list(dict.fromkeys(column_names.values())))
    columns = {kind: _column(data[name]) for kind, name in column_names.items() if kind not in ("id", "visible")}
    if where["visible"] is not None:
        columns["visible"] = _seen(data[column_names["visible"]])
    coded = _coded(path, data[column_names["id"]])
    table = _long_table(path, header, where, columns, *coded, np.arange(1, len(data) + 1))
    if table.unit is None and about.get("unit") in ("m", "px", "bl"):
        table.unit = about["unit"]
    table.notes += [WRAPPED] if about.get("boundary") == "wrap" else []
    return table


def check_parquet(path, about, names):
    """ProblemsError unless the columns of these names are small enough to be unpacked."""
    groups = [about.row_group(k) for k in range(about.num_row_groups)]
    if max(about.num_rows, sum(group.num_rows for group in groups)) > limits.TRACK_ROWS:
        raise refused(path, f"has more than {limits.TRACK_ROWS:,} rows; split it into parts")
    size = 0
    for group in groups:
        parts = [group.column(k) for k in range(group.num_columns)]
        size += sum(p.total_uncompressed_size for p in parts if p.path_in_schema.split(".")[0] in names)
    if size > limits.TRACKS_UNPACKED_BYTES:
        raise refused(path, f"unpacks to more than {limits.TRACKS_UNPACKED_BYTES.text}; split it into parts")


def _coded(path, values):
    """(names, which of them each row is of) of a column of ids."""
    import pyarrow

    if not pyarrow.types.is_dictionary(values.type):
        values = values.dictionary_encode()
    values = values.unify_dictionaries().combine_chunks()
    if isinstance(values, pyarrow.ChunkedArray):  # there is no row
        raise refused(path, "has no rows")
    check_size(path, 1, len(values.dictionary))
    names = [str(name) for name in values.dictionary.to_pylist()]
    return [*names, ""], values.indices.fill_null(len(names)).to_numpy(zero_copy_only=False).astype(np.int64)


def _is_number(kind):
    from pyarrow import types

    return types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind)


def _column(values):
    import pyarrow

    if pyarrow.types.is_timestamp(values.type):
        return values.cast(pyarrow.timestamp("us")).cast(pyarrow.int64()).to_numpy().astype(float) / 1e6
    return np.asarray(values.to_numpy(zero_copy_only=False), float)


def _seen(values):
    """Whether each of a column of truth values, or of words, is not false."""
    import pyarrow
    from pyarrow import compute

    words = compute.utf8_lower(values.cast(pyarrow.string()))
    return compute.not_equal(words, "false").fill_null(True).to_numpy(zero_copy_only=False)


# tables of single programs ----------------------------------------------------------------------


def _deeplabcut(path, header, rows) -> TrackTable:
    """CSV with three or four rows of names: scorer, individuals, body parts, coords.  The mean of the parts."""
    heads: dict[str, list[str]] = {}
    first: tuple | None = (0, header)
    while first is not None and first[1] and (name := first[1][0].strip().lower()) in _HEADS and name not in heads:
        heads[name] = [cell.strip() for cell in first[1][1:]]
        first = next(rows, None)
    coords = heads.get("coords")
    if not coords or "bodyparts" not in heads or first is None:
        raise refused(
            path,
            "starts like a table of DeepLabCut, but the rows bodyparts and coords, or the rows of positions, are "
            "missing",
        )
    who = heads.get("individuals") or ["animal"] * len(coords)
    if len(who) != len(coords):
        raise refused(path, f"names {len(who)} individuals and {len(coords)} coords; it needs one of each per column")
    values = number_grid(path, chain([first], rows), range(len(coords) + 1))
    frames, values = whole_frames(path, values[:, 0]), values[:, 1:]
    parts: dict[str, list[int]] = {name: [] for name in who}
    for at, (name, coord) in enumerate(zip(who, coords, strict=True)):
        if coord == "x" and at + 1 < len(coords):
            parts[name].append(at)
    ids = [name for name in parts if parts[name]]
    if not ids:
        raise refused(path, "has no column x in its row coords")
    middles = []
    for name in ids:
        places = [values[:, at : at + 2] for at in parts[name]]
        sure = [
            values[:, at + 2] if coords[at + 2 : at + 3] == ["likelihood"] else np.ones(len(values))
            for at in parts[name]
        ]
        middles.append(part_middle(np.array(places), np.array(sure)))
    return TrackTable(np.stack(middles, 1), ids, frames, None, "px")


_HEADS = "scorer", "individuals", "bodyparts", "coords"


def _idtracker(path, header, rows) -> TrackTable:
    """CSV of idtracker.ai: a row for each frame, columns x1, y1, x2, y2 and, mostly, the time."""
    place = {name: at for at, name in enumerate(header)}
    animals = sorted(int(name[1:]) for name in place if re.fullmatch(r"x[0-9]{1,9}", name))
    time = next((place[n] for n in ("time", "seconds") if n in place), None)
    lost = [f"y{k}" for k in animals if f"y{k}" not in place or f"x{k}" not in place]
    if lost:
        raise refused(path, f"has no column {lost[0]} beside x{lost[0][1:]}")
    columns = [place[f"{axis}{k}"] for k in animals for axis in "xy"]
    values = number_grid(path, rows, [*columns, *([] if time is None else [time])])
    xy = values[:, : len(columns)].reshape(len(values), -1, 2)
    fps, start = (None, 0.0) if time is None else (rate_of(np.arange(len(xy)), values[:, -1]), begun(values[:, -1]))
    return TrackTable(xy, [str(k) for k in animals], np.arange(len(xy)), fps, "px", start=start)


# TRex: a file for each animal ---------------------------------------------------------------------


def _trex_columns(header):
    """(x, y, unit) names of TRex' columns of places; None in other tables."""
    for x in header:
        match = re.fullmatch(r"X(#wcentroid|#pcentroid|#centroid)?( \((cm|px)\))?", x)
        if match and (y := "Y" + x[1:]) in header and (match[1] or match[2]):
            return x, y, match[3] or "cm"
    return None


def trex_file(path) -> TrackTable:
    """Track of one animal from an npz of TRex. ProblemsError."""
    return _of_one(path, *_of_npz(path))


def _of_one(path, frames, xy, fps, unit):
    """The table of one animal."""
    good = np.isfinite(xy).all(1)
    if not good.any():
        raise refused(path, "no row has a position")
    places, ids, numbers, _ = placed(path, frames[good], [Path(path).stem], np.zeros(good.sum(), int), xy[good])
    return TrackTable(places, ids, numbers, fps, unit, True)


def _of_csv(path, header, rows):
    """(frames, positions, frame rate, unit) of the rows of a CSV of TRex."""
    x, y, unit = _trex_columns(header)
    names = [name for name in (x, y, "frame", "time") if name in header]
    columns = dict(zip(names, number_grid(path, rows, [header.index(name) for name in names]).T, strict=True))
    frames = whole_frames(path, columns.get("frame", np.arange(len(columns[x]))))
    return frames, np.column_stack([columns[x], columns[y]]), rate_of(frames, columns.get("time")), unit


def _of_npz(path):
    """As `_of_csv`, of an npz."""
    try:
        arrays = _trex_arrays(path)
    except (zipfile.BadZipFile, zlib.error, NotImplementedError) as error:
        raise refused(path, f"is not an npz file of tracks: {error}") from None
    columns = _trex_columns(list(arrays))
    if columns is None:
        raise refused(path, "has no X#wcentroid and Y#wcentroid, as files of TRex have")
    x, y, unit = columns
    if not len(arrays[x]):
        raise refused(path, "has no rows")
    frames = whole_frames(path, arrays.get("frame", np.arange(len(arrays[x]))))
    xy = np.column_stack([arrays[x], arrays[y]]).astype(float)
    if len(frames) != len(xy):
        raise refused(path, f"has {len(xy)} positions in {len(frames)} frames")
    if "missing" in arrays:
        xy[arrays["missing"].astype(bool)] = np.nan
    rate = arrays.get("frame_rate")
    fps = float(rate[0]) if rate is not None and len(rate) else rate_of(frames, arrays.get("time"))
    return frames, xy, fps, unit


def _trex_arrays(path):
    """{name: (n,) array} of what is needed of an npz of TRex, none longer than tracks may be."""
    with zipfile.ZipFile(path) as packed:
        sizes = {info.filename.removesuffix(".npy"): info.file_size for info in packed.infolist()}
    array_names = [
        name for name in sizes if _trex_columns([name, "Y" + name[1:]]) or _trex_columns(["X" + name[1:], name])
    ]
    array_names += [name for name in ("frame", "time", "missing", "frame_rate") if name in sizes]
    arrays = {}
    with np.load(path, allow_pickle=False) as data:
        for name in array_names[:20]:
            if sizes[name] > 8 * limits.TRACK_FRAMES + 1024:
                raise refused(path, f"{name} has more than {limits.TRACK_FRAMES.text}; split it into parts")
            values = np.ravel(data[name])
            if values.dtype.kind not in "biuf":
                raise refused(path, f"{name} must be numbers, got {values.dtype}")
            arrays[name] = values
    return arrays


def trex_files(path) -> list[Path]:
    """The files of a folder that may be tracks of TRex, one per animal."""
    return sorted(p for p in Path(path).iterdir() if p.suffix.lower() in (".npz", ".csv") and p.is_file())


def _places_in(file):
    """As `_of_csv`, of a file in a folder of TRex; None of others that it writes there, such as of postures."""
    if file.suffix.lower() == ".csv":
        rows = read_table(file, limits.TRACKS_BYTES, limits.TRACK_ROWS)
        header = [cell.strip() for cell in next(rows, (1, []))[1]]
        return _of_csv(file, header, rows) if _trex_columns(header) else None
    try:
        with zipfile.ZipFile(file) as packed:
            if _trex_columns([name.removesuffix(".npy") for name in packed.namelist()]) is None:
                return None
    except (zipfile.BadZipFile, OSError):
        pass  # reading it says what is wrong
    return _of_npz(file)


def trex_folder(path) -> TrackTable:
    """Tracks of all animals in a folder of TRex files, npz or csv. ProblemsError."""
    files = trex_files(path)
    if len(files) > 10_000:
        raise refused(path, f"has {len(files)} files; one file per animal is expected")
    found, others, size = [], [], 0
    for file in files:
        places = _places_in(file)
        good = None if places is None else np.isfinite(places[1]).all(1)
        if good is None or not good.any():  # of something else, or of an animal that was never seen
            others.append(file.name)
            continue
        frames, xy, fps, unit = places
        found.append((file.stem, frames[good], xy[good], fps, unit))
        size += xy.size
        if size > limits.TRACK_NUMBERS:
            raise refused(path, f"its files have more than {limits.TRACK_NUMBERS.text}")
    if not found:
        raise refused(path, "no file in it has positions in X#wcentroid and Y#wcentroid, as files of TRex have")
    stems, frames, xy, rates, units = zip(*found, strict=True)
    names = sorted(set(stems))
    number = {name: k for k, name in enumerate(names)}
    animal = np.repeat([number[stem] for stem in stems], [len(one) for one in frames])
    places, ids, numbers, _ = placed(path, np.concatenate(frames), names, animal, np.concatenate(xy))
    more = f" and {len(others) - 5} more" if len(others) > 5 else ""
    told = [f"files without places were left out: {', '.join(others[:5])}{more}"] if others else []
    return TrackTable(places, ids, numbers, rates[0], units[0], True, notes=told)

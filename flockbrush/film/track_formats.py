"""Formats of tracks, one function each: a path in, a `Table` of places by frame and animal out."""

from __future__ import annotations

import re
import zipfile
from datetime import datetime
from pathlib import Path

import numpy as np

from flockbrush.behaviours.tables import read_table
from flockbrush.engine import limits
from flockbrush.engine.files import refused
from flockbrush.engine.problems import Problem, ProblemsError, did_you_mean
from flockbrush.film.track_table import TrackTable, beside, placed

EARTH = 111_319.49079327358  # m of a degree at the equator
SURE = 0.6  # confidence of a body part, below which it is taken as not seen
NAMES = {  # what columns are called, the first that is there is taken
    "id": ("id", "track_id", "trackid", "track", "individual", "individual-local-identifier", "tag-local-identifier",
           "animal", "animal_id", "object", "particle", "name"),
    "x": ("x", "x_m", "x_px", "x_bl", "pos_x", "position_x", "utm-easting"),
    "y": ("y", "y_m", "y_px", "y_bl", "pos_y", "position_y", "utm-northing"),
    "frame": ("frame", "frame_number", "frame_idx"),
    "time": ("time", "time_s", "seconds", "t", "timestamp"),
}  # fmt: skip
_TOLD = 20  # problems of one file that are reported


# tables with a row for each animal in each frame --------------------------------------------------


def csv_table(path) -> TrackTable:
    """CSV and TSV: of Flockbrush, trackdf, Movebank, DeepLabCut, idtracker.ai, TRex."""
    rows = read_table(path, limits.TRACKS_BYTES, limits.TRACK_ROWS)
    line, header = next(rows, (1, []))
    header = [cell.strip() for cell in _split(header)]
    lower = [cell.lower() for cell in header]
    if lower[:1] == ["scorer"]:
        return _deeplabcut(path, [header, *(_split(row) for _, row in rows)])
    if "x1" in lower and "y1" in lower:
        return _idtracker(path, lower, rows)
    if _trex_columns(header):
        return _trex_table(path, header, [_split(row) for _, row in rows])
    where = {kind: next((lower.index(n) for n in names if n in lower), None) for kind, names in NAMES.items()}
    degrees = "location-long" in lower and "location-lat" in lower and where["x"] is None
    if degrees:
        where |= {"x": lower.index("location-long"), "y": lower.index("location-lat")}
    _need(path, where, lower)
    heading = lower.index("heading") if "heading" in lower and not degrees else None
    columns, ids = _parsed(path, rows, where, heading)
    return _long_table(path, lower, where, columns, ids, degrees)


def _split(row):
    """The cells of a row; of one separated by tabs or semicolons as well."""
    if len(row) == 1 and ("\t" in row[0] or ";" in row[0]):
        return re.split(r"[\t;]", row[0])
    return row


def _need(path, where, header):
    missing = [kind for kind in ("id", "x", "y") if where[kind] is None]
    if where["frame"] is None and where["time"] is None:
        missing.append("frame")
    if missing:
        hint = did_you_mean(missing[0], header)
        needed = "a file of tracks has id, x, y, and frame or time"
        raise ProblemsError([Problem(str(path), 1, missing[0], f"there is no such column{hint}; {needed}")])


def _parsed(path, rows, where, heading):
    """({name: numbers}, ids) of the rows; ProblemsError."""
    problems: list[Problem] = []
    numbers: dict[str, list[float]] = {name: [] for name in ("x", "y", "frame", "time", "heading")}
    ids: list[str] = []
    for line, cells in rows:
        row = _split(cells)
        for name, at in (("x", where["x"]), ("y", where["y"]), ("frame", where["frame"]), ("heading", heading)):
            numbers[name].append(np.nan if at is None else _number(path, line, name, row, at, problems))
        if where["time"] is not None:
            numbers["time"].append(_moment(path, line, row, where["time"], problems))
        ids.append(row[where["id"]].strip() if where["id"] < len(row) else "")
        if len(problems) >= _TOLD:
            break
    if problems:
        raise ProblemsError(problems)
    if not ids:
        raise refused(path, "there is no row in it")
    return {name: np.array(values) for name, values in numbers.items() if len(values)}, ids


_ABSENT = "", "nan", "na", "null", "none"


def _number(path, line, column, row, at, problems):
    cell = row[at].strip() if at < len(row) else ""
    if cell.lower() in _ABSENT:
        if column == "frame":
            problems.append(Problem(str(path), line, column, "must be a whole number, got nothing"))
        return np.nan
    try:
        value = float(cell)
    except ValueError:
        problems.append(Problem(str(path), line, column, f"must be a number, got {cell[:40]!r}"))
        return np.nan
    if column == "frame" and not (abs(value) <= 1e9 and value == int(value)):
        problems.append(Problem(str(path), line, column, f"must be a whole number, at most 1e9, got {cell[:40]!r}"))
        return np.nan
    return value


def _moment(path, line, row, at, problems):
    """Seconds of a cell that holds a number or a date with a time."""
    cell = row[at].strip() if at < len(row) else ""
    try:
        value = float(cell)
    except ValueError:
        try:
            value = datetime.fromisoformat(cell).timestamp() if not _naive(cell) else _utc(cell)
        except ValueError:
            value = np.nan
    if not abs(value) < 1e12:
        problems.append(Problem(str(path), line, "time", f"must be seconds or a date and time, got {cell[:40]!r}"))
        return np.nan
    return value


def _naive(cell):
    return datetime.fromisoformat(cell).tzinfo is None


def _utc(cell):
    return (datetime.fromisoformat(cell) - datetime(2000, 1, 1)).total_seconds()


def _long_table(path, header, where, columns, ids, degrees=False):
    """The table of rows with names, from any kind of file."""
    about, notes = beside(path), []
    x, y = columns["x"], columns["y"]
    kept = np.isfinite(x) & np.isfinite(y)
    if not kept.any():
        raise refused(path, "no row has a place")
    unit = about.get("unit") if about.get("unit") in ("m", "px", "bl") else None
    if degrees:
        x, y = _metres(path, x, y, kept)
        unit = "m"
    else:
        unit = unit or _unit_of_name(header[where["x"]])
    fps = about.get("fps") if isinstance(about.get("fps"), int | float) else None
    if where["frame"] is not None:
        frames = columns["frame"].astype(np.int64)
        fps = fps or _rate(frames, columns.get("time"))
    else:
        frames, fps, off = _frames_of_times(path, columns["time"][kept], columns["time"])
        if off > 0.25:
            notes.append(f"times were rounded to {fps:g} frames a second")
    heading = columns.get("heading") if "heading" in header and not degrees else None
    rows = kept
    xy, names, numbers, turned = placed(
        path, frames[rows], np.array(ids)[rows], np.column_stack([x, y])[rows],
        None if heading is None else heading[rows],
    )  # fmt: skip
    return TrackTable(xy, names, numbers, fps, unit, None, turned, notes)


def _unit_of_name(name):
    if name in ("utm-easting", "x_m"):
        return "m"
    return {"x_px": "px", "x_bl": "bl"}.get(name)


def _metres(path, longitude, latitude, kept):
    """Metres east and north of the middle, by a plate carrée that is true there."""
    if not ((np.abs(latitude[kept]) <= 90).all() and (np.abs(longitude[kept]) <= 360).all()):
        raise refused(path, "location-lat must be -90 to 90 and location-long -360 to 360 degrees")
    middle = np.median(longitude[kept]), np.median(latitude[kept])
    return (longitude - middle[0]) * EARTH * np.cos(np.radians(middle[1])), (latitude - middle[1]) * EARTH


def _rate(frames, times):
    """Frames a second where a table has both; None where it has no times."""
    if times is None:
        return None
    known = np.isfinite(times)
    if np.ptp(frames[known]) < 1 or not np.ptp(times[known]) > 0:
        return None
    return float(np.ptp(frames[known]) / np.ptp(times[known]))


def _frames_of_times(path, known, times):
    """(frame numbers, frames a second, largest distance to a frame in frames) of times, s."""
    steps = np.diff(np.unique(np.round(known, 6)))
    if not len(steps):
        raise refused(path, "all rows have the same time")
    step = float(np.median(steps))  # shorter and longer ones are clocks that differ, and gaps
    frames = (times - known.min()) / step
    whole = np.round(np.nan_to_num(frames)).astype(np.int64)
    return whole, float(1.0 / step), float(np.nanmax(np.abs(frames - whole)))


def parquet_table(path) -> TrackTable:
    """Parquet with the columns of the CSV of Flockbrush, or any with id, x, y and frame or time."""
    import pyarrow.parquet as parquet

    file = parquet.ParquetFile(path)
    if file.metadata.num_rows > limits.TRACK_ROWS:
        raise refused(path, f"has more than {limits.TRACK_ROWS:,} rows; cut it into parts")
    header = [name.lower() for name in file.schema_arrow.names]
    where = {kind: next((header.index(n) for n in names if n in header), None) for kind, names in NAMES.items()}
    _need(path, where, header)
    names = {kind: file.schema_arrow.names[at] for kind, at in where.items() if at is not None}
    if "heading" in header:
        names["heading"] = file.schema_arrow.names[header.index("heading")]
    data = file.read(columns=list(dict.fromkeys(names.values())))
    columns = {kind: _column(data[name]) for kind, name in names.items() if kind != "id"}
    ids = [str(value) for value in data[names["id"]].to_pylist()]
    table = _long_table(path, header, where, columns, ids)
    about = {k.decode(): v.decode() for k, v in (file.schema_arrow.metadata or {}).items() if k in (b"fps", b"unit")}
    if table.unit is None and about.get("unit") in ("m", "px", "bl"):
        table.unit = about["unit"]
    return table


def _column(values):
    import pyarrow

    if pyarrow.types.is_timestamp(values.type):
        return values.cast(pyarrow.timestamp("us")).cast(pyarrow.int64()).to_numpy().astype(float) / 1e6
    return np.asarray(values.to_numpy(zero_copy_only=False), float)


# tables of single programs ----------------------------------------------------------------------


def _deeplabcut(path, rows) -> TrackTable:
    """CSV with three or four rows of names: scorer, individuals, body parts, coords.  The mean of the parts."""
    heads = {row[0].lower(): row[1:] for row in rows[:4] if row and row[0].lower() in _HEADS}
    if "coords" not in heads or "bodyparts" not in heads:
        raise refused(path, "begins as a table of DeepLabCut, but has no rows bodyparts and coords")
    body = [row for row in rows[len(heads) :] if row]
    values = np.array([[_float(cell) for cell in row[1:]] for row in body], float)
    who = heads.get("individuals") or ["animal"] * len(heads["coords"])
    ids, parts = list(dict.fromkeys(who)), []
    for animal in ids:
        places, weights = [], []
        for at, (name, coord) in enumerate(zip(who, heads["coords"], strict=True)):
            if name == animal and coord == "x":
                places.append(values[:, at : at + 2])
                sure = heads["coords"][at + 2 : at + 3] == ["likelihood"]
                weights.append(values[:, at + 2] if sure else np.ones(len(values)))
        parts.append(_middle(np.array(places), np.array(weights)))
    return TrackTable(np.stack(parts, 1), ids, np.array([int(_float(row[0])) for row in body]), None, "px")


_HEADS = "scorer", "individuals", "bodyparts", "coords"


def _float(cell):
    try:
        return float(cell)
    except ValueError:
        return np.nan


def _middle(places, weights):
    """(T, 2) mean of body parts (k, T, 2) that are sure; NaN where none is."""
    good = (weights >= SURE) & np.isfinite(places).all(-1)
    count = good.sum(0)
    total = np.where(good[..., None], np.nan_to_num(places), 0.0).sum(0)
    return np.where(count[:, None] > 0, total / np.maximum(count, 1)[:, None], np.nan)


def _idtracker(path, header, rows) -> TrackTable:
    """CSV of idtracker.ai: a row for each frame, columns x1, y1, x2, y2 and, mostly, the time."""
    animals = sorted(int(name[1:]) for name in header if re.fullmatch(r"x\d+", name))
    where = [(header.index(f"x{k}"), header.index(f"y{k}")) for k in animals]
    body = [row for _, row in rows]
    values = np.array([[_float(cell) for cell in row] for row in body if len(row) == len(header)], float)
    if not len(values):
        raise refused(path, "there is no row in it")
    xy = np.stack([values[:, at] for at in np.array(where)], 1)
    time = next((header.index(n) for n in ("time", "seconds") if n in header), None)
    fps = None if time is None else _rate(np.arange(len(values)), values[:, time])
    return TrackTable(xy, [str(k) for k in animals], np.arange(len(values)), fps, "px")


# TRex: a file for each animal ---------------------------------------------------------------------


def _trex_columns(header):
    """(x, y, unit) names of TRex' columns of places; None in other tables."""
    for x in header:
        found = re.fullmatch(r"X(#wcentroid|#pcentroid|#centroid)?( \((cm|px)\))?", x)
        if found and (y := "Y" + x[1:]) in header and (found[1] or found[2]):
            return x, y, found[3] or "cm"
    return None


def _trex_table(path, header, rows) -> TrackTable:
    """One animal as TRex writes it in a CSV."""
    x, y, unit = _trex_columns(header)
    values = np.array([[_float(cell) for cell in row] for row in rows], float)
    frame = header.index("frame") if "frame" in header else None
    frames = np.arange(len(values)) if frame is None else values[:, frame].astype(np.int64)
    time = header.index("time") if "time" in header else None
    fps = None if time is None else _rate(frames, values[:, time])
    return _of_one(path, frames, values[:, [header.index(x), header.index(y)]], fps, unit)


def _of_one(path, frames, xy, fps, unit):
    good = np.isfinite(xy).all(1)
    if not good.any():
        raise refused(path, "no row has a place")
    places, ids, numbers, _ = placed(path, frames[good], [Path(path).stem] * int(good.sum()), xy[good])
    return TrackTable(places, ids, numbers, fps, unit, True)


def trex_file(path) -> TrackTable:
    """One animal as TRex writes it in an npz; or places of all animals in an array ``xy``."""
    try:
        with np.load(path, allow_pickle=False) as data:
            if sum(data[name].nbytes for name in data.files) > limits.TRACKS_BYTES:
                raise refused(path, "is larger, unpacked, than a table of tracks may be")
            found = {name: data[name] for name in data.files}
    except (zipfile.BadZipFile, ValueError) as error:
        raise refused(path, f"is no npz of tracks: {error}") from None
    columns = _trex_columns([name for name in found if np.ndim(found[name]) == 1])
    if columns is None:
        raise refused(path, "has no X#wcentroid and Y#wcentroid, as files of TRex have")
    x, y, unit = columns
    frames = found.get("frame", np.arange(len(found[x]))).astype(np.int64)
    xy = np.column_stack([found[x], found[y]]).astype(float)
    if "missing" in found:
        xy[found["missing"].astype(bool)] = np.nan
    rate = found.get("frame_rate")
    fps = float(np.ravel(rate)[0]) if rate is not None and np.size(rate) else _rate(frames, found.get("time"))
    return _of_one(path, frames, xy, fps, unit)


def trex_files(path) -> list[Path]:
    """The files of a folder that may be TRex' of single animals."""
    return sorted(p for p in Path(path).iterdir() if p.suffix.lower() in (".npz", ".csv") and p.is_file())


def trex_folder(path) -> TrackTable:
    """All animals of a folder of TRex files, npz or csv."""
    files = trex_files(path)
    if len(files) > 10_000:
        raise refused(path, f"has {len(files)} files; one for each animal is expected")
    tables = [(trex_file if p.suffix.lower() == ".npz" else csv_table)(p) for p in files]
    frames = np.concatenate([np.repeat(t.frames, len(t.ids)) for t in tables])
    ids = np.concatenate([np.tile(np.array(t.ids, dtype=object), len(t.frames)) for t in tables]).astype(str)
    xy = np.concatenate([t.xy.reshape(-1, 2) for t in tables])
    good = np.isfinite(xy).all(1)
    places, names, numbers, _ = placed(path, frames[good], ids[good], xy[good])
    return TrackTable(places, names, numbers, tables[0].fps, tables[0].unit, True)


# arrays ---------------------------------------------------------------------------------------------


def numpy_array(path) -> TrackTable:
    """An npy array (frames, animals, 2), NaN where an animal is not seen."""
    with open(path, "rb") as file:
        if file.read(6) != b"\x93NUMPY":
            raise refused(path, "is no npy file")
    try:
        values = np.load(path, allow_pickle=False, mmap_mode="r")
    except ValueError:
        raise refused(
            path,
            "holds Python objects, which are never unpickled here (idtracker.ai: export the trajectories as CSV)",
        ) from None
    if values.ndim != 3 or values.shape[2] != 2 or not np.issubdtype(values.dtype, np.number):
        raise refused(path, f"must be an array (frames, animals, 2) of numbers, got {values.shape} of {values.dtype}")
    if values.size // 2 > limits.TRACK_CELLS:
        raise refused(path, f"{values.shape[0]} frames of {values.shape[1]} animals are more than fit")
    return TrackTable(np.array(values, float), [str(k) for k in range(values.shape[1])], np.arange(len(values)))


def _hdf5(path):
    try:
        import netCDF4
    except ImportError:
        raise refused(path, 'reading it needs netCDF4: pip install "flockbrush[export]"') from None
    return netCDF4.Dataset(path)


def movement_netcdf(path) -> TrackTable:
    """netCDF as the package movement has it: position (time, space, [keypoints], individuals)."""
    with _hdf5(path) as data:
        if "position" not in data.variables:
            raise refused(path, "has no variable position, as files of movement have")
        position = data["position"]
        if "time" not in position.dimensions or "space" not in position.dimensions:
            raise refused(
                path, f"its position has the dimensions {', '.join(position.dimensions)}, without time or space"
            )
        if position.size > 8 * limits.TRACK_CELLS:
            raise refused(path, "its position is larger than fits; cut the file into parts")
        order = [position.dimensions.index(n) for n in ("time", "individuals", "keypoints", "space")
                 if n in position.dimensions]  # fmt: skip
        values = np.ma.filled(position[:].astype(float), np.nan).transpose(order)
        if "individuals" not in position.dimensions:
            values = values[:, None]
        if "keypoints" in position.dimensions:
            sure = np.logical_and.reduce(np.isfinite(values), axis=-1)
            middle = (
                np.where(sure[..., None], np.nan_to_num(values), 0.0).sum(2) / np.maximum(sure.sum(2), 1)[..., None]
            )
            values = np.where(sure.any(axis=2, keepdims=True), middle, np.nan)
        ids = [str(name) for name in data["individuals"][:]] if "individuals" in data.variables else \
            [str(k) for k in range(values.shape[1])]  # fmt: skip
        fps = getattr(data, "fps", None)
        if fps is None and getattr(data, "time_unit", "") == "seconds" and "time" in data.variables:
            fps = 1.0 / float(np.median(np.diff(np.asarray(data["time"][:], float))))
        unit = {"m": "m", "metre": "m", "meters": "m", "px": "px", "pixels": "px"}.get(getattr(position, "units", ""))
        heading = None
        if "heading" in data.variables and unit == "m":
            turned = np.ma.filled(data["heading"][:].astype(float), np.nan)
            heading = turned[:, 0] if turned.ndim == 3 else turned
        return TrackTable(
            values[..., :2], ids, np.arange(len(values)), None if fps is None else float(fps), unit, None, heading
        )


def sleap_hdf5(path) -> TrackTable:
    """Analysis HDF5 of SLEAP: tracks (animals, 2, parts, frames)."""
    with _hdf5(path) as data:
        if "tracks" not in data.variables or data["tracks"].ndim != 4:
            raise refused(path, "has no tracks (animals, 2, parts, frames), as analysis files of SLEAP have")
        if data["tracks"].size > 64 * limits.TRACK_CELLS:
            raise refused(path, "its tracks are larger than fits; cut the film into parts")
        tracks = np.ma.filled(data["tracks"][:].astype(float), np.nan)  # (N, 2, K, T)
    places = np.moveaxis(tracks, (2, 3, 0, 1), (0, 1, 2, 3))  # (K, T, N, 2)
    middle = np.stack([_middle(places[:, :, n], np.ones(places.shape[:2])) for n in range(places.shape[2])], 1)
    return TrackTable(middle, [str(k) for k in range(middle.shape[1])], np.arange(len(middle)), None, "px", True)

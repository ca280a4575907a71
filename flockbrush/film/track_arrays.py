"""Formats of tracks that store arrays: NumPy, netCDF of movement, analysis HDF5 of SLEAP."""

from __future__ import annotations

import numpy as np

from flockbrush.engine import limits
from flockbrush.engine.files import refused
from flockbrush.film.track_table import (
    WRAPPED,
    TrackTable,
    begun,
    check_size,
    heights_left_out,
    known_format,
    part_middle,
)

SLAB = 4_000_000  # numbers of a variable that are unpacked at once
CHUNK = 64 * limits.MIB  # bytes of a packed block; HDF5 unpacks one whole, whatever part is asked for


def numpy_array(path) -> TrackTable:
    """Tracks from an npy array (frames, animals, 2); NaN where an animal was not seen. ProblemsError."""
    with open(path, "rb") as file:
        if file.read(6) != b"\x93NUMPY":
            raise refused(path, "is not an npy file")
    try:
        values = np.load(path, allow_pickle=False, mmap_mode="r")
    except ValueError:
        raise refused(
            path,
            "contains Python objects, which are not read for security (idtracker.ai: export the trajectories as CSV)",
        ) from None
    if values.ndim != 3 or values.shape[2] != 2 or values.dtype.kind not in "biuf":
        raise refused(path, f"must be an array (frames, animals, 2) of numbers, got {values.shape} of {values.dtype}")
    check_size(path, *values.shape[:2])
    return TrackTable(np.array(values, float), [str(k) for k in range(values.shape[1])], np.arange(len(values)))


def _hdf5(path):
    try:
        import netCDF4
    except ImportError:
        raise refused(path, 'reading it needs netCDF4: pip install "flockbrush[export]"') from None
    return netCDF4.Dataset(path)


def movement_netcdf(path) -> TrackTable:
    """Tracks from netCDF of the package movement: position (time, space, [keypoints], individuals). ProblemsError."""
    with _hdf5(path) as data:
        known_format(path, {"schema": getattr(data, "schema", None)})
        if "position" not in data.variables:
            raise refused(path, "has no variable position, as files of movement have")
        position = data["position"]
        sizes = dict(zip(position.dimensions, position.shape, strict=True))
        if "time" not in sizes or sizes.get("space", 0) < 2:
            shape = ", ".join(f"{name} {size}" for name, size in sizes.items())
            raise refused(path, f"its position has the dimensions {shape}, without time or a space dimension of size 2")
        check_size(path, sizes["time"], sizes.get("individuals", 1))
        order = [position.dimensions.index(n) for n in ("time", "individuals", "keypoints", "space") if n in sizes]
        if len(order) < len(sizes):
            raise refused(path, f"its position has dimensions that are not known: {', '.join(sizes)}")
        parts = _slabs(path, position, position.dimensions.index("time"))
        xyz = np.concatenate([_of_movement(part.transpose(order), sizes) for part in parts])
        xy = xyz[..., :2]
        heading = None
        unit = {"m": "m", "metre": "m", "meters": "m", "px": "px", "pixels": "px"}.get(getattr(position, "units", ""))
        if "heading" in data.variables and unit == "m":
            heading = _headings(path, data["heading"], xy.shape[:2])
        notes = [WRAPPED] if getattr(data, "boundary", "") == "wrap" else []
        notes += heights_left_out(xyz[..., 2:])
        fps, start = _times(path, data)
        who = _individuals(path, data, xy.shape[1])
        usual = _body_length(data, xy)
        return TrackTable(xy, who, np.arange(len(xy)), fps, unit, None, heading, notes, start, body_length=usual)


def _of_movement(values, sizes):
    """(T, N, space) places of values (T, [N], [keypoints], space): the mean of those keypoints that are there."""
    if "individuals" not in sizes:
        values = values[:, None]
    if "keypoints" not in sizes:
        return values
    sure = np.isfinite(values[..., :2]).all(-1)
    total = np.where(sure[..., None], np.nan_to_num(values), 0.0).sum(2)
    return np.where(sure.any(2)[..., None], total / np.maximum(sure.sum(2), 1)[..., None], np.nan)


def _individuals(path, data, count):
    """Names of the animals, by number where there are none."""
    if "individuals" not in data.variables or data["individuals"].shape != (count,):
        return [str(k) for k in range(count)]
    names = [str(name) for name in data["individuals"][:]]
    if len(set(names)) < count:
        raise refused(path, "has two individuals with the same name")
    return names


def _body_length(data, xy):
    """m, the median of those that the file states, by how often each animal was seen; None where it states none."""
    if "body_length" not in data.variables or data["body_length"].shape != xy.shape[1:2]:
        return None
    lengths = np.ma.filled(np.ma.asarray(data["body_length"][:]).astype(float), np.nan)
    seen = np.repeat(lengths, np.isfinite(xy).all(-1).sum(0))
    seen = seen[np.isfinite(seen)]
    usual = float(np.median(seen)) if len(seen) else 0.0
    return usual if getattr(data["body_length"], "units", "") == "m" and usual > 0 else None


def _times(path, data):
    """(frames a second, as given or from the times, None if neither is known; s, time of the first frame)."""
    fps, start = getattr(data, "fps", None), 0.0
    if getattr(data, "time_unit", "") == "seconds" and "time" in data.variables:
        times = np.concatenate(list(_slabs(path, data["time"], 0)))
        step = float(np.median(np.diff(times))) if times.ndim == 1 and len(times) > 1 else 0.0
        fps, start = 1.0 / step if fps is None and step > 0 else fps, begun(times)
    return None if fps is None else float(fps), start


def _headings(path, variable, shape):
    """(T, N) headings; None where they are of another shape."""
    turned = np.concatenate(list(_slabs(path, variable, 0))) if variable.ndim in (2, 3) else np.zeros(0)
    turned = turned[:, 0] if turned.ndim == 3 and turned.shape[1] else turned
    return turned if turned.shape == shape else None


def _slabs(path, variable, axis):
    """Parts of a variable along an axis, of about `SLAB` numbers each, NaN where there is none; ProblemsError."""
    kind = np.dtype(variable.dtype) if variable.dtype is not str else np.dtype(object)
    if kind.kind not in "biuf":
        raise refused(path, f"{variable.name} must be numbers, got {kind}")
    block = variable.chunking()
    if isinstance(block, list) and np.prod(block, dtype=float) * kind.itemsize > CHUNK:
        raise refused(path, f"{variable.name} is packed in blocks of more than {CHUNK // limits.MIB} MiB")
    length, whole = variable.shape[axis], np.prod(variable.shape, dtype=float)
    if whole > 64 * limits.TRACK_CELLS or whole / max(length, 1) > limits.TRACK_NUMBERS:
        raise refused(path, f"{variable.name} is too large; split the file into parts")
    step = max(1, int(SLAB * length / max(whole, 1)))
    for start in range(0, max(length, 1), step):
        part = [slice(None)] * variable.ndim
        part[axis] = slice(start, start + step)
        yield np.ma.filled(np.ma.asarray(variable[tuple(part)]).astype(float), np.nan)


def sleap_hdf5(path) -> TrackTable:
    """Analysis HDF5 of SLEAP: tracks (animals, 2, parts, frames)."""
    with _hdf5(path) as data:
        if "tracks" not in data.variables or data["tracks"].ndim != 4 or data["tracks"].shape[1] != 2:
            raise refused(path, "has no tracks (animals, 2, parts, frames), as analysis files of SLEAP have")
        count, _, _, frames = data["tracks"].shape
        check_size(path, frames, count)
        middle = np.concatenate([_of_sleap(part) for part in _slabs(path, data["tracks"], 3)])
    return TrackTable(middle, [str(k) for k in range(count)], np.arange(len(middle)), None, "px", True)


def _of_sleap(part):
    """(T, N, 2) middles of places (N, 2, parts, T)."""
    places = np.moveaxis(part, (2, 3, 0, 1), (0, 1, 2, 3))  # (parts, T, N, 2)
    seen = np.ones(places.shape[:2])
    return np.stack([part_middle(places[:, :, n], seen) for n in range(places.shape[2])] or [np.zeros((0, 0, 2))], 1)

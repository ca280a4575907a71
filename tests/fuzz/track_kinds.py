"""Tracks of other programs, a kind for each way in which a file is built; those of missing packages are left out."""

import importlib.util
import io
from functools import cached_property

import mutations as m
import numpy as np
from kind import Kind

FRAMES, ANIMALS = 12, 3


def paths():
    """(FRAMES, ANIMALS, 2) places."""
    t, n = np.mgrid[:FRAMES, :ANIMALS]
    return np.stack([3.0 * n + 0.5 * t, 2.0 * n - 0.25 * t], -1)


def long_rows():
    """Rows of frame, id, x and y."""
    return [(t, f"a{n}", *paths()[t, n]) for t in range(FRAMES) for n in range(ANIMALS)]


def table(head, rows):
    return "\n".join([head, *(",".join(map(str, row)) for row in rows)]).encode()


class _Animals(Kind):
    share = 0.4

    def read(self, path):
        from flockbrush.film.track_files import read_trajectories

        found = read_trajectories(path, "m", 10.0)
        assert found.seen.any() and found.xy.shape[:2] == (len(found.frames), len(found.ids))


class TrackTables(_Animals):
    """CSV: of Flockbrush, trackdf, Movebank, DeepLabCut, idtracker.ai and TRex."""

    ending, share = ".csv", 1.0
    changes = staticmethod(m.changed_table)

    @cached_property
    def sound(self):
        xy, rows = paths(), long_rows()
        dates = [(f"2024-05-01 10:00:{t / 10:06.3f}", 8 + x / 1e5, 47 + y / 1e5, who) for t, who, x, y in rows]
        head = ["scorer" + ",net" * 6, "bodyparts" + ",nose,nose,nose,tail,tail,tail", "coords" + ",x,y,likelihood" * 2]
        parts = [(t, *xy[t, 0], 0.9, *xy[t, 1], 0.8) for t in range(FRAMES)]
        wide = "time," + ",".join(f"x{n + 1},y{n + 1}" for n in range(ANIMALS))
        return [
            table("frame,id,x,y,heading", [(*row, 0.5) for row in rows]),
            table("id,t,x,y", [(who, t / 10, x, y) for t, who, x, y in rows]),
            table("timestamp,location-long,location-lat,individual-local-identifier", dates),
            table("\n".join(head), parts),
            table(wide, [(t / 10, *xy[t].ravel()) for t in range(FRAMES)]),
            table("frame,X#wcentroid,Y#wcentroid (cm)".replace(" (cm)", ""), [(t, *xy[t, 0]) for t in range(FRAMES)]),
        ]


class TrexFiles(_Animals):
    """One animal of TRex: zip archives of arrays, with right checksums."""

    ending = ".npz"
    changes = staticmethod(m.changed_archive)

    @cached_property
    def sound(self):
        packed = io.BytesIO()
        places = {"X#wcentroid": paths()[:, 0, 0], "Y#wcentroid": paths()[:, 0, 1]}
        np.savez(packed, **places, frame=np.arange(FRAMES), missing=np.zeros(FRAMES), frame_rate=np.array([10.0]))
        return [packed.getvalue()]


class TrackArrays(_Animals):
    """NumPy arrays of frames by animals."""

    ending = ".npy"

    @cached_property
    def sound(self):
        return [m.array_of(paths()), m.array_of(paths().astype(np.float32))]

    def changed(self, rng, data):
        return m.changed_head(rng, data) if rng.random() < 0.6 else m.array_of(m.odd_array(rng))


class _Built(_Animals):
    """Files whose parts are changed before a library builds them: its own reading of bytes is not what is tested."""

    @cached_property
    def sound(self):
        self.folder.mkdir(parents=True, exist_ok=True)
        return [self.built(self.parts())]

    def case(self, rng):
        parts = self.parts()
        for _ in range(rng.choice([1, 1, 2])):
            self.change(rng, parts)
        return self.built(parts)


class TrackParquet(_Built):
    """Parquet with columns of odd names, types, lengths and values."""

    ending = ".parquet"

    def parts(self):
        frame, who, x, y = map(list, zip(*long_rows(), strict=True))
        return {"frame": frame, "id": who, "x": x, "y": y}

    def change(self, rng, parts):
        name, how = rng.choice(sorted(parts)), rng.randrange(7)
        if how == 0:
            del parts[name]
            parts[rng.choice([name.upper(), "time", "t", "track", "heading", "x_m"])] = [0.5] * FRAMES * ANIMALS
        elif how == 1:
            parts[name] = [m.nudged(rng, value) for value in parts[name]]
        elif how == 2:
            odd = rng.choice([None, float("nan"), float("inf"), 1e308, -1, 2**62, 0.5])
            parts[name] = [odd if rng.random() < 0.2 else value for value in parts[name]]
        elif how == 3:
            value = rng.choice([b"x", "text", True, [1.0], {"a": 1}, None, 7])
            parts[name] = [value] * len(parts[name])
        elif how == 4:
            length = rng.choice([0, 1, 9])
            for key in parts:
                parts[key] = parts[key][:length]
        elif how == 5:
            parts[name] = [rng.randrange(2**40) for _ in parts[name]]
        else:
            rng.shuffle(parts[name])

    def built(self, parts):
        import pyarrow
        import pyarrow.parquet as parquet

        columns, rows = {}, min(map(len, parts.values()))
        for name, values in parts.items():
            values = values[:rows]
            try:
                columns[name] = pyarrow.array(values)
            except (pyarrow.ArrowException, TypeError, ValueError, OverflowError):
                columns[name] = pyarrow.array([ascii(value) for value in values])
        packed = io.BytesIO()
        parquet.write_table(pyarrow.table(columns), packed)
        return packed.getvalue()


class _Hdf5(_Built):
    """Variables and dimensions of odd names, types, shapes and values: {name: (dimensions, values, attributes)}."""

    def change(self, rng, parts):
        name, how = rng.choice(sorted(parts)), rng.randrange(6)
        names, values, facts = parts[name]
        if how == 0:
            del parts[name]
            parts.setdefault(rng.choice(["time", "heading", "positions", "individuals"]), (names, values, facts))
        elif how == 1:
            order = rng.sample(range(values.ndim), values.ndim)
            parts[name] = [names[k] for k in order], values.transpose(order), facts
        elif how == 2:
            parts[name] = [rng.choice(["time", "space", "keypoints", "other"]) + n for n in names], values, facts
        elif how == 3 and values.dtype.kind == "f":
            values = values.copy()
            values.flat[:: rng.randrange(1, 9)] = rng.choice([np.nan, np.inf, 1e300, 0.0])
            parts[name] = names, values, facts
        elif how == 4:
            with np.errstate(invalid="ignore"):
                parts[name] = names, values.astype(rng.choice(["i1", "i8", "f4", "S1"])), facts
        else:
            fact = rng.choice(["fps", "units", "time_unit", "scale_factor", "add_offset", "_FillValue"])
            odd = rng.choice([0.0, -1.0, "x", "m", "seconds", 1e-300, float("nan"), [1.0, 2.0], 25])
            parts[name] = names, values, facts | {fact: odd}

    def built(self, parts):
        import netCDF4

        path = self.folder / f"built{self.ending}"
        self.folder.mkdir(parents=True, exist_ok=True)
        with netCDF4.Dataset(path, "w") as data:
            for name, (names, values, facts) in parts.items():
                names = list(names)
                for k, size in enumerate(values.shape):
                    if (names[k] in data.dimensions and len(data.dimensions[names[k]]) != size) or names[k] in names[
                        :k
                    ]:
                        names[k] = f"{name}{names[k]}{k}"
                    if names[k] not in data.dimensions:
                        data.createDimension(names[k], size)
                made = data.createVariable(name, values.dtype, names)
                made[:] = values
                for fact, value in facts.items():
                    for place in (data, made):
                        try:
                            place.setncattr(fact, value)
                        except (RuntimeError, AttributeError, ValueError, TypeError):  # the library does not take it
                            continue
        return path.read_bytes()


class TrackNetcdf(_Hdf5):
    """netCDF of movement."""

    ending = ".nc"

    def parts(self):
        position = np.stack([paths(), paths() + 1], 1).transpose(0, 3, 1, 2)  # time, space, keypoints, individuals
        names = "time", "space", "keypoints", "individuals"
        heading = (names[0], names[3]), np.zeros((FRAMES, ANIMALS)), {}
        return {
            "position": (names, position, {"units": "m", "fps": 10.0}), "heading": heading,
            "time": (("time",), np.arange(FRAMES) / 10, {}),
            "individuals": (("individuals",), np.arange(ANIMALS), {}),
        }  # fmt: skip


class TrackSleap(_Hdf5):
    """Analysis HDF5 of SLEAP."""

    ending = ".h5"

    def parts(self):
        tracks = np.stack([paths(), paths() + 1]).transpose(2, 3, 0, 1)  # animals, 2, parts, frames
        return {"tracks": (("a", "b", "c", "d"), tracks, {})}


def track_kinds():
    """The classes whose packages are there."""
    needs = {TrackParquet: "pyarrow", TrackNetcdf: "netCDF4", TrackSleap: "netCDF4"}
    built = [kind for kind, package in needs.items() if importlib.util.find_spec(package)]
    return [TrackTables, TrexFiles, TrackArrays, *built]

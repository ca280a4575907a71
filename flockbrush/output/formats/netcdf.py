"""netCDF export in the layout of the package movement, for xarray."""

from __future__ import annotations

from flockbrush.output.exporter import Exporter, exporter

BLOCK = 64  # frames in memory before they are written


@exporter(".nc")
class NetCdf(Exporter):
    """Positions (time, space, keypoints, individuals) of movement's poses, NaN where an animal is not there."""

    contents = "positions (time, space, keypoints, individuals) in the layout of movement, headings, lengths, names"
    opens_in = "movement, xarray, MATLAB, R ncdf4"
    fps = 16.0
    needs = (("netCDF4", "netCDF4"),)

    def open(self):
        import netCDF4

        self.temporary.unlink(missing_ok=True)
        self._data = data = netCDF4.Dataset(self.temporary, "w", format="NETCDF4")
        for name, size in (("time", None), ("space", 3), ("keypoints", 1), ("individuals", None)):
            data.createDimension(name, size)
        self._time = data.createVariable("time", "f8", ("time",))
        data.createVariable("space", str, ("space",))[:] = _texts("xyz")
        data.createVariable("keypoints", str, ("keypoints",))[:] = _texts(["centroid"])
        dims = ("time", "space", "keypoints", "individuals")
        packed = {"zlib": True, "complevel": 4, "fill_value": float("nan")}
        self._position = data.createVariable("position", "f8", dims, chunksizes=(BLOCK, 3, 1, 256), **packed)
        plain = {"dimensions": (dims[0], *dims[2:]), "chunksizes": (BLOCK, 1, 256), **packed}
        self._confidence = data.createVariable("confidence", "f4", **plain)
        self._heading = data.createVariable("heading", "f4", **plain)
        self._position.units, self._heading.units = "m", "rad"
        self._heading.long_name = "counter-clockwise from east"
        self._codes: dict = {}
        self._rows: dict[int, int] = {}
        self._lengths: dict[int, float] = {}  # m, of each animal when it was there last
        self._waiting: list = []

    def take(self, moment):
        for animal in moment.ids.tolist():
            self._rows.setdefault(animal, len(self._rows))
        self._lengths.update(zip(moment.ids.tolist(), moment.length.tolist(), strict=True))
        self._waiting.append(moment)
        if len(self._waiting) == BLOCK:
            self._write()

    def _write(self):
        import numpy as np

        if not self._waiting:
            return
        first, count, many = self.frames, len(self._waiting), len(self._rows)
        position = np.full((count, 3, 1, many), np.nan)
        heading, here = np.full((count, 1, many), np.nan), np.full((count, 1, many), np.nan)
        codes = {name: np.full((count, many), -1, np.int32) for name in self._codes_of(self._waiting[-1])}
        for k, moment in enumerate(self._waiting):
            columns = [self._rows[animal] for animal in moment.ids.tolist()]
            position[k, :, 0, columns] = moment.xyz
            heading[k, 0, columns] = np.arctan2(moment.forward[:, 1], moment.forward[:, 0])
            here[k, 0, columns] = 1.0
            for name, values in self._codes_of(moment).items():
                codes[name][k, columns] = values
        last = first + count
        self._time[first:last] = [moment.time for moment in self._waiting]
        self._position[first:last, :, :, :many] = position
        self._heading[first:last, :, :many] = heading
        self._confidence[first:last, :, :many] = here
        for name, values in codes.items():
            if name not in self._codes:
                self._codes[name] = self._data.createVariable(
                    name, "i4", ("time", "individuals"), zlib=True, fill_value=-1, chunksizes=(BLOCK, 256)
                )
            self._codes[name][first:last, :many] = values
        self.frames, self._waiting = last, []

    @staticmethod
    def _codes_of(moment):
        return {"species": moment.species, "brush": moment.brush, **moment.labels}

    def finish(self):
        from flockbrush.output.trajectory_table import as_attribute, metadata_of
        from flockbrush.runs.snapshots import words_of

        self._write()
        names = self._data.createVariable("individuals", str, ("individuals",))
        names[:] = _texts(f"animal_{animal}" for animal in self._rows)
        length = self._data.createVariable("body_length", "f8", ("individuals",))
        length[:], length.units = [self._lengths[animal] for animal in self._rows], "m"
        about = metadata_of(self.simulation, self.fps)
        attributes = {
            "source_software": "Flockbrush",
            "source_file": "",
            "ds_type": "poses",
            "time_unit": "seconds",
            "log": "",
        }
        self._data.setncatts(attributes | {key: as_attribute(value) for key, value in about.items()})
        for name, words in words_of(self.simulation).items():
            if name in self._codes:  # it has none where no frame was written
                self._codes[name].names = ", ".join(words)
        self._data.close()

    def let_go(self):
        self._data.close()


def _texts(words):
    import numpy as np

    return np.array(list(words), dtype=object)

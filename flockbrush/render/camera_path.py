"""Keyframed cameras: ``*.camera.toml`` files, and where their camera is at a time.

::

    schema = "flockbrush.camera/1"
    ease = "smooth"          # or "linear", "hold"
    fov = 38                 # degrees from the lowest to the highest row; a key may have its own

    [[keys]]                 # by where the eye is
    time = 0                 # s of the run
    target = [60, 20, 0]     # m: what is in the middle of the picture
    eye = [60, -30, 25]      # m

    [[keys]]                 # or by the way from target to eye
    time = 4
    target = [80, 20, 0]
    distance = 40            # m
    azimuth = 135            # degrees: where it looks, counter-clockwise from east
    elevation = 20           # degrees: how high above the target the eye is
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flockbrush.behaviours.file_library import check_schema
from flockbrush.behaviours.tomlfile import TomlFile, is_number, parse_toml, read_bytes
from flockbrush.engine.problems import Problem, ProblemsError
from flockbrush.render.orbit import OrbitCamera

SCHEMA = "flockbrush.camera/1"
EASES = ("smooth", "linear", "hold")
FOV = 38.0  # degrees
FARTHEST = 1e6  # m: numbers beyond are slips
FORMS = (("eye",), ("distance", "azimuth", "elevation"))
BOUNDS = {
    "time": (0.0, 1e6), "fov": (1.0, 150.0), "distance": (0.1, FARTHEST), "azimuth": (-36000.0, 36000.0),
    "elevation": (-80.0, 90.0),
}  # fmt: skip


@dataclass(frozen=True)
class CameraPath:
    """A camera that moves."""

    ease: str  # between keys: "smooth" (monotone cubic), "linear" or "hold"
    times: np.ndarray  # (k,); seconds, rising
    # (k, 7); target and eye (m) and field of view (degrees); or target, distance (m), azimuth and elevation (degrees),
    # and field of view
    values: np.ndarray
    orbits: bool  # whether `values` are of the second kind

    def at(self, time, size=(1280, 720), view=None, floor=0.0) -> OrbitCamera:
        """The camera at a time (s); before the first key and after the last one it stands."""
        row = self._between(float(np.clip(time, self.times[0], self.times[-1])))
        target = np.asarray(row[:3], float)
        if self.orbits:
            distance, azimuth, elevation = row[3], math.radians(row[4]), math.radians(row[5])
        else:
            distance, azimuth, elevation = orbit_of(target, row[3:6])
        view = tuple(view or (0, 0, *size))
        place = (float(target[0]), float(target[1]), float(target[2]))
        fov = math.radians(row[6])
        return OrbitCamera(place, float(distance), azimuth, elevation, tuple(size), view, fov=fov, floor=floor)

    def _between(self, time):
        if len(self.times) == 1 or self.ease == "hold":
            return self.values[np.searchsorted(self.times, time, "right") - 1]
        if self.ease == "linear":
            return np.array([np.interp(time, self.times, column) for column in self.values.T])
        from scipy.interpolate import PchipInterpolator

        return PchipInterpolator(self.times, self.values)(time)


def orbit_of(target, eye) -> tuple[float, float, float]:
    """(distance m, azimuth, elevation rad) of an eye that looks at a target."""
    away = np.asarray(eye, float) - target
    distance = float(np.linalg.norm(away))
    flat = math.hypot(away[0], away[1])
    azimuth = math.atan2(-away[1], -away[0]) if flat > 1e-9 * distance else math.pi / 2
    return distance, azimuth, math.atan2(away[2], flat)


def read_camera(path) -> CameraPath:
    """The camera of a file.

    Raises
    ------
    ProblemsError
        With everything that is wrong with it.
    """
    return _checked(parse_toml(read_bytes(path), str(path)))


def _checked(toml: TomlFile) -> CameraPath:
    data, problems = check_schema(toml, SCHEMA, needed=False), []
    problems += toml.unknown_names((), data, ("ease", "fov", "keys"))
    ease = data.get("ease", "smooth")
    if ease not in EASES:
        problems.append(toml.problem(("ease",), f"must be one of {', '.join(EASES)}, got {ease!r}"))
    problems += _numbers(toml, (), data, ("fov",))
    keys = data.get("keys")
    if not isinstance(keys, list) or not keys or not all(isinstance(key, dict) for key in keys):
        problems.append(toml.problem(("keys",), "at least one [[keys]] table is needed"))
        raise ProblemsError(problems)
    for k, key in enumerate(keys):
        problems += _wrong_with(toml, ("keys", k), key)
    forms = {"eye" in key for key in keys}
    if len(forms) > 1:
        problems.append(
            toml.problem(("keys",), "either all keys have an eye, or all have distance, azimuth, elevation")
        )
    if not problems:
        times = [key["time"] for key in keys]
        for k in range(1, len(times)):
            if times[k] <= times[k - 1]:
                at = ("keys", k, "time")
                problems.append(toml.problem(at, f"must be more than that of the key before, {times[k - 1]:g}"))
    if problems:
        raise ProblemsError(problems)
    return _made(ease, data.get("fov", FOV), keys)


def _made(ease, fov, keys):
    orbits = "eye" not in keys[0]
    rows = [
        [*key["target"], *([key[name] for name in FORMS[1]] if orbits else key["eye"]), key.get("fov", fov)]
        for key in keys
    ]
    return CameraPath(ease, np.array([key["time"] for key in keys], float), np.array(rows, float), orbits)


def _wrong_with(toml, path, key) -> list[Problem]:
    """Problems of one key."""
    form = FORMS[0] if "eye" in key else FORMS[1]
    needed = ("time", "target", *form)
    problems = toml.unknown_names(path, key, (*needed, "fov"))
    problems += [toml.problem(path, f"this key has no {name}") for name in needed if name not in key]
    problems += _numbers(toml, path, key, ("time", "fov", *(name for name in form if name != "eye")))
    points = [name for name in ("target", "eye") if name in key]
    for name in points:
        if not _is_point(key[name]):
            problems.append(
                toml.problem((*path, name), f"must be three numbers, [x, y, z] in metres, got {key[name]!r}")
            )
    if len(points) == 2 and all(_is_point(key[name]) for name in points) and math.dist(key["eye"], key["target"]) < 0.1:
        problems.append(toml.problem((*path, "eye"), "must be at least 0.1 m from the target"))
    return problems


def _numbers(toml, path, table, names):
    problems = []
    for name in names:
        low, high = BOUNDS[name]
        if name in table and not (is_number(table[name]) and low <= table[name] <= high):
            message = f"must be a number from {low:g} to {high:g}, got {table[name]!r}"
            problems.append(toml.problem((*path, name), message))
    return problems


def _is_point(value):
    return isinstance(value, list) and len(value) == 3 and all(is_number(v) and abs(v) <= FARTHEST for v in value)

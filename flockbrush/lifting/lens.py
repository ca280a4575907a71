"""The camera a flock was filmed with: from pixels to directions, and back."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator
from pydantic_core import PydanticCustomError

from flockbrush.behaviours.file_library import check_schema
from flockbrush.behaviours.tomlfile import parse_toml, read_bytes
from flockbrush.engine.files import refused
from flockbrush.engine.problems import ProblemsError, did_you_mean
from flockbrush.film.track_table import SAME_RATE

SCHEMA = "flockbrush.lens/1"
# what a camera's file may say, shown where something is missing
EXAMPLE = {"width": 1280, "height": 720, "horizontal_fov_deg": 60, "fps": 30, "mean_speed": 9, "near": 5, "far": 200}


class Camera(BaseModel):
    """A pinhole camera at the origin that looks north: x right, y forward, z up, metres.

    Written as TOML with the names below; square pixels, the optical axis in the middle of the picture.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    width: int = Field(ge=1, le=100_000, description="pixels")
    height: int = Field(ge=1, le=100_000, description="pixels")
    horizontal_fov_deg: float = Field(gt=0, lt=180, description="angle between the left and right edge, degrees")
    fps: float = Field(gt=0, le=10_000, description="frames per second")
    mean_speed: float = Field(gt=0, le=1_000, description="mean speed of the birds, m/s; sets the scale")
    near: float = Field(gt=0, description="smallest distance of a bird, m")
    far: float = Field(gt=0, description="largest distance of a bird, m")

    @field_validator("*", mode="before")
    @classmethod
    def _is_number(cls, value):
        """Whether a value of TOML is a number; true and false are not."""
        if isinstance(value, bool | str):
            raise PydanticCustomError("number_type", "must be a number")
        return value

    @model_validator(mode="after")
    def _in_order(self):
        if self.near >= self.far:
            raise ValueError(f"must be less than far, got {self.near:g} and {self.far:g} m")
        return self

    @property
    def focal(self) -> float:
        """Focal length in pixels."""
        return 0.5 * self.width / math.tan(math.radians(0.5 * self.horizontal_fov_deg))

    def rays(self, px) -> np.ndarray:
        """Unit vectors towards pixels.

        Parameters
        ----------
        px : array_like, (..., 2)
            Pixels from the upper left corner, y down.

        Returns
        -------
        (..., 3) ndarray
        """
        px = np.asarray(px, float)
        across = (px[..., 0] - 0.5 * self.width) / self.focal
        down = (px[..., 1] - 0.5 * self.height) / self.focal
        ray = np.stack([across, np.ones_like(across), -down], axis=-1)
        return ray / np.linalg.norm(ray, axis=-1, keepdims=True)

    def project(self, xyz) -> np.ndarray:
        """Pixels of points in front of the camera, (..., 2); the inverse of `rays`."""
        xyz = np.asarray(xyz, float)
        across, down = xyz[..., 0] / xyz[..., 1], -xyz[..., 2] / xyz[..., 1]
        return np.stack([0.5 * self.width + self.focal * across, 0.5 * self.height + self.focal * down], axis=-1)


def read_camera(path: str | Path) -> Camera:
    """The camera of a TOML file.

    Raises
    ------
    ProblemsError
        With file, line and name of every value that makes no sense.
    """
    file = parse_toml(read_bytes(path), str(path))
    try:
        return Camera.model_validate(check_schema(file, SCHEMA, needed=False))
    except ValidationError as error:
        raise ProblemsError([file.problem(_key(e), _said(e)) for e in error.errors()]) from None


def check_camera(path, camera: Camera, film) -> str:
    """A sentence where the film of a camera is slow motion, else ""; ProblemsError unless the two fit otherwise."""
    if (camera.width, camera.height) != tuple(film.size):
        told = f"has {camera.width} x {camera.height} pixels, but the clip has {film.size[0]} x {film.size[1]}"
        raise refused(path, told)
    times = camera.fps / film.fps
    if times < 1.0 - SAME_RATE:
        raise refused(path, f"has {camera.fps:g} frames per second, but the clip has {film.fps:g}")
    if times <= 1.0 + SAME_RATE:
        return ""
    rates = f"{path} has {camera.fps:g} frames per second and the clip {film.fps:g}"
    return f"{rates}: it is taken as slow motion, {times:.3g} times as fast in truth"


def _key(error):
    """Where in the file: the name that is wrong, or the one that is at odds with another."""
    if error["type"] == "missing":
        return ()
    return tuple(error["loc"]) or ("near",)


def _said(error):
    name = str(error["loc"][-1]) if error["loc"] else ""
    if error["type"] == "missing":
        return f"{name} is missing ({Camera.model_fields[name].description}), such as  {name} = {EXAMPLE[name]}"
    if error["type"] == "extra_forbidden":
        return f"unknown name{did_you_mean(name, list(Camera.model_fields))}"
    if not name:
        return error["msg"].removeprefix("Value error, ")
    kind = "a whole number" if name in ("width", "height") else "a number"
    text = error["msg"].replace("Input should be", "must be")
    if error["type"].endswith(("_type", "_parsing", "_from_float")):
        text = f"must be {kind}"
    return f"{text} ({Camera.model_fields[name].description}), got {error['input']!r}"

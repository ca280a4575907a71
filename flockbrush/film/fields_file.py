"""The npz files that observations are kept in: arrays by name, checked before they are unpacked."""

from __future__ import annotations

import math
import tokenize
import zipfile
import zlib
from contextlib import contextmanager
from dataclasses import fields

import numpy as np

from flockbrush.behaviours.tomlfile import check_plain
from flockbrush.engine import limits
from flockbrush.engine.file_formats import format_error
from flockbrush.engine.files import refused

SCHEMA = "flockbrush.fields/1"
_UNKNOWN = "is not a fields file"


def flat(prefix, thing, leave=()):
    """{prefix.name: array} of a dataclass; what is None is left out."""
    values = {f.name: getattr(thing, f.name) for f in fields(thing) if f.name not in leave}
    return {f"{prefix}.{name}": np.asarray(value) for name, value in values.items() if value is not None}


def part_of(data, prefix):
    """{name: value} of what begins with the prefix; arrays of one value become that value."""
    chosen = {key[len(prefix) + 1 :]: value for key, value in data.items() if key.startswith(prefix + ".")}
    return {name: value.item() if value.ndim == 0 else value for name, value in chosen.items()}


def write(path, arrays):
    if sum(array.nbytes for array in arrays.values()) > limits.FIELDS_BYTES:
        message = f"would be larger than {limits.FIELDS_BYTES.text}; use a part of the clip: --frames FIRST:LAST"
        raise refused(path, message)
    with open(path, "wb") as file:
        np.savez_compressed(file, schema=np.array(SCHEMA), **arrays)


def read(path):
    """Every array of an npz; ProblemsError."""
    check_plain(path, limits.FIELDS_BYTES)
    with damage(path), open(path, "rb") as file:
        _check_members(file)
        file.seek(0)
        return _arrays(path, file)


def _check_members(file):
    """ValueError unless the arrays of an npz are as long as they say, and not too much together."""
    with zipfile.ZipFile(file) as packed:
        if sum(info.file_size for info in packed.infolist()) > limits.FIELDS_BYTES:
            raise ValueError(f"it unpacks to more than {limits.FIELDS_BYTES.text}")
        for info in packed.infolist():
            with packed.open(info) as member:
                version = np.lib.format.read_magic(member)
                read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
                shape, _, kind = read(member)
                if info.file_size - member.tell() != math.prod(shape) * kind.itemsize:
                    raise ValueError(f"{info.filename} does not have the length given in its header")


def _arrays(path, file):
    with np.load(file, allow_pickle=False) as archive:
        if not hasattr(archive, "files") or "schema" not in archive.files:
            raise refused(path, f"{_UNKNOWN}: it has no schema; make a fields file with flockbrush fields CLIP")
        if wrong := format_error(str(archive["schema"]), SCHEMA):
            raise refused(path, f"schema {wrong}")
        return {name: archive[name] for name in archive.files}


@contextmanager
def damage(path):
    """A context in which errors of reading a file name the file."""
    try:
        yield
    except _TROUBLE as error:
        reason = str(error).replace("allow_pickle=False", "it").strip("'\"") or type(error).__name__
        raise refused(path, f"{_UNKNOWN}, or it is damaged: {reason}") from None


_TROUBLE = (
    ValueError, TypeError, LookupError, AttributeError, EOFError, OSError, RecursionError, OverflowError,
    NotImplementedError, SyntaxError, tokenize.TokenError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip


def packed(picture):
    import cv2

    return cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 92])[1].ravel()


def unpacked(path, raw):
    from flockbrush.film.media import decoded

    return decoded(raw.tobytes(), f"{path}: clip.picture")

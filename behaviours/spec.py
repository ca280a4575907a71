"""The base of what stands in asset files: frozen pydantic models with units and bounds, and the texts they hold."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, PrivateAttr


def _printable(text: str) -> str:
    if any(not character.isprintable() and character not in "\n\t" for character in text):
        raise ValueError("must not have control characters")
    return text


def _one_line(text: str) -> str:
    if "\n" in text or "\t" in text:
        raise ValueError("must be one line")
    return _printable(text)


Line = Annotated[str, AfterValidator(_one_line), Field(max_length=200)]
Text = Annotated[str, AfterValidator(_printable), Field(max_length=20_000)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


class Spec(BaseModel):
    """A table of an asset file."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class FileSpec(Spec):
    """What a file of its own holds.  The file goes along as it is, until something is changed."""

    name: str
    _source: bytes | None = PrivateAttr(None)

    @property
    def source(self) -> bytes:
        """The file it was read from, or the file it would be saved as: what a recording embeds.

        ValueError for a changed species: it has neither.
        """
        if self._source is None:
            self._source = self._as_file().encode()
        return self._source

    @property
    def sha256(self) -> str:
        """SHA-256 of `source`, in hex: what ``sha256sum`` says of the file."""
        return hashlib.sha256(self.source).hexdigest()

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        copy = super().model_copy(update=update, deep=deep)
        if update:
            copy._source = None  # the file says something else
        return copy

    def _as_file(self) -> str:
        raise ValueError(f"{self.name} was changed in Python and has no file: write one, and load that")


def spec_field(default, text: str, unit: str = "", **bounds):
    """A field with one line of meaning, a unit and bounds: checks, comments in files and docs come from it."""
    return Field(default, description=text, json_schema_extra={"unit": unit} if unit else None, **bounds)

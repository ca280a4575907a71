"""The base of what stands in asset files: frozen pydantic models with units and bounds, and the texts they hold."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field


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


def spec_field(default, text: str, unit: str = "", **bounds):
    """A field with one line of meaning, a unit and bounds: checks, comments in files and docs come from it."""
    return Field(default, description=text, json_schema_extra={"unit": unit} if unit else None, **bounds)

"""The settings of the playground, stored between sessions: theme, text size, brush size, overlays."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

from flockbrush.behaviours.validation import validated
from flockbrush.engine import limits
from flockbrush.engine.files import home, write_bytes
from flockbrush.engine.problems import ProblemsError

LISTED = ("trails", "shadows", "forces", "field_of_view")  # overlays shown at first when files listed them


class Settings(BaseModel):
    """The settings of the user.  None: the default."""

    model_config = ConfigDict(extra="forbid", strict=True, validate_assignment=True, allow_inf_nan=False)

    theme: Literal["light", "dark", "vivid"] | None = Field(default=None, description="colours of the window")
    palette: Literal["own", "okabe-ito", "tol"] | None = Field(default=None, description="colours of brushes")
    ui_scale: float | None = Field(default=None, ge=0.5, le=4, description="size of text and buttons; 1 is normal")
    brush_size: float | None = Field(default=None, gt=0, le=10_000, description="radius of the brush, m")
    overlays: dict[str, bool] = Field(default={}, description="overlays: shown or not", max_length=100)

    @field_validator("overlays", mode="before")
    @classmethod
    def _of_a_list(cls, value):
        """Earlier files list the overlays that are shown, and no later ones."""
        if not isinstance(value, (list, tuple)):
            return value
        return dict.fromkeys(LISTED, False) | dict.fromkeys(map(str, value), True)

    def shown(self, first) -> set[str]:
        """Names of the overlays that are shown, if those of ``first`` are unless the person has chosen."""
        return {name for name in {*first, *self.overlays} if self.overlays.get(name, True)}

    def save(self, path=None) -> str:
        """Keep them for the next time; returns a sentence about what went wrong, "" when nothing did."""
        path = settings_path() if path is None else Path(path)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_bytes(path, (self.model_dump_json(indent=2) + "\n").encode())
        except OSError as error:
            return f"{path}: the settings cannot be saved: {error.strerror}"
        except ProblemsError as error:
            return str(error)
        return ""


def settings_path() -> Path:
    """Where the settings of this user lie."""
    return config_folder() / "settings.json"


def config_folder() -> Path:
    """The folder for settings of this user, as the operating system wishes it; it need not be there yet."""
    own = os.environ.get("FLOCKBRUSH_CONFIG")
    return Path(own) if own else user_folder("APPDATA", "XDG_CONFIG_HOME", ".config")


def user_folder(windows, xdg, usual) -> Path:
    """The folder of Flockbrush where the operating system has a user's files of a kind.

    Parameters
    ----------
    windows, xdg : str
        Environment variables of Windows, and of Linux where ``usual`` in the home folder is the default.
    """
    if sys.platform == "win32":
        base = Path(os.environ.get(windows) or home())
    elif sys.platform == "darwin":
        base = home() / "Library" / "Application Support"
    else:
        base = Path(os.environ.get(xdg) or home() / usual)
    return base / "flockbrush"


def load_settings(path=None) -> tuple[Settings, str]:
    """The settings, and a sentence about what is wrong with their file ("" when nothing is).

    What cannot be understood is ignored: nobody is kept from working by a broken settings file.
    """
    path = settings_path() if path is None else Path(path)
    try:
        with open(path, "rb") as file:
            data = json.loads(file.read(limits.SETTINGS_BYTES).decode())
    except FileNotFoundError:
        return Settings(), ""
    except OSError as error:
        return Settings(), f"{path}: cannot be read: {error.strerror}; default settings are used"
    except (ValueError, RecursionError) as error:
        return Settings(), f"{path}: is not valid JSON ({error}); default settings are used"
    if not isinstance(data, dict):
        return Settings(), f"{path}: must be a table of settings; default settings are used"
    return _understood(path, data)


def _understood(path, data):
    """The settings that are right, and a sentence about the first one that is wrong."""
    problem = ""
    while True:
        settings, mistakes = validated(Settings, data)
        if settings is not None:
            return settings, problem
        key, message = mistakes[0]
        problem = problem or f"{path}: {key[0] if key else 'settings'}: {message}; ignored"
        wrong = {where[0] for where, _ in mistakes if where}
        data = {name: value for name, value in data.items() if name not in wrong} if wrong else {}

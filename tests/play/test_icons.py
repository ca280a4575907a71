"""Pictures of buttons: an SVG for each name that is used, drawn in one colour at any size."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pygame
import pytest

import flockbrush.studio
from flockbrush.studio.icons import FOLDER, icon

NAMES = sorted(file.stem for file in FOLDER.glob("*.svg"))


@pytest.mark.parametrize("name", NAMES)
def test_a_picture_is_its_colour_and_more_of_it_where_it_is_larger(name):
    assert ET.parse(FOLDER / f"{name}.svg").getroot().get("viewBox") == "0 0 24 24"
    inks = []
    for size in (16, 40):
        drawn = icon(name, size, (20, 40, 90))
        assert drawn.get_size() == (size, size)
        cover = pygame.surfarray.array_alpha(drawn)
        assert 0.04 < (cover / 255).mean() < 0.8
        premultiplied = pygame.surfarray.array3d(drawn) - cover[:, :, None] / 255 * (20, 40, 90)
        assert abs(premultiplied).max() < 1.01
        inks.append(cover.sum() / 255)
    assert 4 < inks[1] / inks[0] < 9  # (40 / 16)² = 6.25


def test_black_takes_white_away():
    eyes = pygame.surfarray.array_alpha(icon("predator", 48, (0, 0, 0)))
    assert eyes[18, 25] < 60 < 200 < eyes[24, 28]


def test_every_picture_is_used_by_a_button():
    room = Path(flockbrush.studio.__file__).parent
    code = "\n".join(file.read_text(encoding="utf-8") for file in room.rglob("*.py"))
    words = set(re.findall(r'"([a-z]+)"', code))
    assert set(NAMES) <= words

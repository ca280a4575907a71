"""Pictures of brushes: one sees what the animals do, in the brush's colour; they are made once."""

import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.levels.tile_pictures import brush_picture

from flockbrush.render.animal_looks import CLIPS
from flockbrush.render.mesh_bodies import LOOK_NAMES
from flockbrush.render.style import rgb
from flockbrush.studio import thumbnails
from flockbrush.studio.thumbnails import cached, draw_tile, placeholder, thumbnail


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("FLOCKBRUSH_CACHE", str(tmp_path / "kept"))
    return tmp_path / "kept"


@pytest.fixture(scope="module")
def march():
    return shipped().get("march")


def test_a_picture_is_a_disc_ringed_in_the_brushs_colour(cache, march):
    image = thumbnail(march, 64)
    assert image.shape == (64, 64, 4)
    assert (image[[0, 0, -1, -1], [0, -1, 0, -1], 3] == 0).all() and image[32, 32, 3] == 255
    assert np.abs(image[32, 3, :3].astype(int) - rgb(march.colour)).max() < 12
    inside = image[12:52, 12:52, :3].astype(int)
    animals = np.abs(inside - np.median(inside.reshape(-1, 3), axis=0)).max(axis=2) > 40
    assert 0.05 < animals.mean() < 0.8


def test_a_picture_is_made_once(cache, march, monkeypatch):
    assert cached(march, 48) is None
    first = thumbnail(march, 48)
    monkeypatch.setattr(thumbnails, "draw_thumbnail", None)
    assert np.array_equal(thumbnail(march, 48), first)
    assert np.array_equal(cached(march, 48), first)
    assert cached(march, 48, "dark") is None and cached(march, 48, colour="#097abe") is None


def test_a_changed_brush_has_another_picture(cache, march):
    from flockbrush.behaviours.brush import SpeedSpec

    thumbnail(march, 32)
    assert cached(march.model_copy(update={"speed": SpeedSpec(mean=1.0)}), 32) is None


def test_a_damaged_picture_is_made_anew(cache, march):
    first = thumbnail(march, 32)
    for damage in (b"", b"not a picture", b"\x89PNG\r\n\x1a\n"):
        (kept,) = cache.iterdir()
        kept.write_bytes(damage)
        assert np.array_equal(thumbnail(march, 32), first), damage


def test_where_nothing_can_be_kept_pictures_are_made_all_the_same(tmp_path, monkeypatch, march):
    (tmp_path / "file").write_bytes(b"")
    monkeypatch.setenv("FLOCKBRUSH_CACHE", str(tmp_path / "file" / "folder"))
    assert thumbnail(march, 32).shape == (32, 32, 4)


def test_a_placeholder_is_there_at_once(march):
    image = placeholder(march, 64, "dark")
    assert image.shape == (64, 64, 4) and np.abs(image[32, 3, :3].astype(int) - rgb(march.colour)).max() < 12


@pytest.mark.parametrize(("name", "mills"), [("mill-filled", True), ("march", False)])
def test_one_sees_whether_a_herd_mills(name, mills):
    from flockbrush.systems.measures import compute_milling

    simulation = thumbnails._settled(shipped().get(name))
    xy, forward = thumbnails._moment(simulation)
    assert (compute_milling(xy, forward) > 0.7) == mills


@pytest.mark.parametrize("name", ["march", "mill-hollow"])
def test_the_shipped_tiles_are_pictures_of_the_shipped_brushes(name):
    brush = shipped().get(name)
    told = brush_picture(name, brush.colour).astype(int)
    made = draw_tile(brush, 32)[..., [2, 1, 0, 3]].astype(int)
    assert np.abs(told - made).mean() < 2, "run python -m flockbrush.studio.thumbnails --tiles levels"


def test_a_brush_of_ones_own_that_has_a_shipped_name_keeps_its_colour():
    tile = brush_picture("march", "#00ff00")
    assert tuple(tile[16, 4, :3].astype(int)) != tuple(brush_picture("march", shipped().get("march").colour)[16, 4, :3])
    assert tile[10, 4, 1] > 180


@pytest.mark.parametrize(
    ("name", "look", "clip"),
    [("march", "beast", "walk"), ("evacuate", "person", "walk"), ("zebrafish", "fish", "swim"),
     ("starlings", "bird", "fly")],
)  # fmt: skip
def test_animals_have_the_legs_and_wings_of_their_species(name, look, clip):
    brush, moved = shipped().get(name), np.array([True, False])
    found = thumbnails._postures(thumbnails.body_of(brush), moved, thumbnails._in_the_air(brush), np.zeros(2))
    assert LOOK_NAMES[found.look[0]] == look and CLIPS[found.clip[0]] == clip
    assert CLIPS[found.clip[1]] == ("fly" if clip == "fly" else "rest")


def test_animals_look_as_the_species_of_the_level(cache, tmp_path, march):
    from flockbrush.behaviours.species import SpeciesLibrary

    (tmp_path / "crab.species.toml").write_text(
        'schema = "flockbrush.species/1"\nlook = "insect"\nmedia = ["walk"]\n[body]\n'
    )
    (tmp_path / "lost.species.toml").write_text("no species")
    fauna = SpeciesLibrary([tmp_path])
    crabs = march.model_copy(update={"made_for": ("crab",)})
    assert thumbnails.body_of(crabs, fauna) == "insect" and thumbnails.body_of(crabs) == "beast"
    assert thumbnails.body_of(march.model_copy(update={"made_for": ("lost",)}), fauna) == "beast"
    beasts = thumbnail(crabs, 96)
    assert cached(crabs, 96, body="insect") is None
    assert (thumbnail(crabs, 96, body="insect") != beasts).any()

"""What a clip tells survives a file, halves share nothing, and damaged files are refused in words."""

import numpy as np
import pytest
from flockbrush.engine.problems import ProblemsError

from flockbrush.film.observations import Evidence, Fields, Sightings
from flockbrush.film.speeds import speed_evidence


def two_sheep(frames=6):
    """Two sheep walk right at 1 and 2 BL/s over a strip of four cells of 2 BL, and never leave their cells."""
    density = np.zeros((frames, 1, 4))
    density[:, 0, [0, 2]] = 1 / 4
    velocity = np.full((frames, 1, 4, 2), np.nan)
    velocity[:, 0, 0], velocity[:, 0, 2] = (1.0, 0.0), (2.0, 0.0)
    spread = np.where(density > 0, 0.0, np.nan)
    fields = Fields(
        fps=10.0, cell=2.0, origin=np.array([-4.0, 0.0]), density=density, velocity=velocity, speed_variance=spread,
        angular_variance=spread.copy(), seen=np.ones(density.shape, bool), obstacle=np.zeros((1, 4), bool),
        region=np.zeros((1, 4), np.uint8), count=np.full(frames, 2.0), frames=np.arange(frames) + 100,
    )  # fmt: skip
    sights = Sightings(
        first=np.arange(frames + 1) * 2, xy=np.tile([(-3.0, 1.0), (1.0, 1.0)], (frames, 1)),
        forward=np.tile([(1.0, 0.0)], (2 * frames, 1)), speed=np.tile([1.0, 2.0], frames),
        turn=np.full(2 * frames, np.nan), track=np.tile([0, 1], frames),
    )  # fmt: skip
    return Evidence(
        name="two.mp4", sha256="0" * 64, fps=10.0, body_length_px=20.0, length_source="given", radius_bl=0.2,
        fields=fields, sightings=sights, speed=speed_evidence(fields, sights, 25.0), notes=["it was sunny"],
        picture=np.full((30, 40, 3), 90, np.uint8), to_pixels=np.array([[20.0, 0, 80], [0, -20.0, 40]]),
        camera=np.tile(np.eye(2, 3), (frames, 1, 1)),
    )  # fmt: skip


def test_what_was_seen_comes_back_from_its_file(tmp_path):
    seen = two_sheep()
    seen.save(tmp_path / "two.npz")
    back = Evidence.load(tmp_path / "two.npz")
    for name in ("density", "velocity", "seen", "region", "frames", "count", "speed"):
        np.testing.assert_array_equal(getattr(back.fields, name), getattr(seen.fields, name))
    np.testing.assert_array_equal(back.sightings.xy, seen.sightings.xy)
    assert back.speed == seen.speed and back.notes == seen.notes and back.length_source == "given"
    np.testing.assert_allclose(back.picture, seen.picture, atol=2)
    np.testing.assert_array_equal(back.camera, seen.camera)


def test_fields_alone_are_read_from_either_file(tmp_path):
    seen = two_sheep()
    seen.save(tmp_path / "all.npz")
    seen.fields.save(tmp_path / "fields.npz")
    for name in ("all.npz", "fields.npz"):
        np.testing.assert_array_equal(Fields.load(tmp_path / name).density, seen.fields.density)
    with pytest.raises(ProblemsError, match=r"fields\.npz: has only fields"):
        Evidence.load(tmp_path / "fields.npz")


def test_a_cell_is_found_by_where_a_sheep_stands():
    row, column, inside = two_sheep().fields.cells_of([(-3, 1), (1, 1), (9, 1)])
    assert row.tolist() == [0, 0, 0] and column.tolist() == [0, 2, 3] and inside.tolist() == [True, True, False]


def test_the_second_half_is_not_known_to_the_first():
    seen = two_sheep()
    seen.fields.speed[3:] *= 10
    first, second = seen.part(slice(0, 3)), seen.part(slice(3, None))
    assert first.fields.frames.tolist() == [100, 101, 102] and second.fields.frames.tolist() == [103, 104, 105]
    assert first.speed.mean == pytest.approx(1.5) and second.speed.mean == pytest.approx(15.0)
    assert len(second.sightings) == 3 and second.sightings.of(0) == slice(0, 2)


@pytest.mark.parametrize("content", [b"", b"not a zip", b"PK\x03\x04 broken"])
def test_a_file_of_something_else_is_refused_by_name(tmp_path, content):
    path = tmp_path / "fields.npz"
    path.write_bytes(content)
    with pytest.raises(ProblemsError, match=r"fields\.npz: is not a fields file"):
        Fields.load(path)


def test_a_file_cut_short_or_of_another_kind_is_refused(tmp_path):
    two_sheep().save(tmp_path / "two.npz")
    whole = (tmp_path / "two.npz").read_bytes()
    for cut in (50, len(whole) // 2, len(whole) - 30):
        (tmp_path / "cut.npz").write_bytes(whole[:cut])
        with pytest.raises(ProblemsError, match=r"cut\.npz"):
            Evidence.load(tmp_path / "cut.npz")
    np.savez(tmp_path / "other.npz", x=np.arange(3))
    with pytest.raises(ProblemsError, match="it has no schema"):
        Fields.load(tmp_path / "other.npz")
    np.savez(tmp_path / "pickled.npz", schema=np.array({"a": 1}, object))
    with pytest.raises(ProblemsError, match=r"pickled\.npz"):
        Fields.load(tmp_path / "pickled.npz")


def test_arrays_that_do_not_fit_together_are_told():
    fields = two_sheep().fields
    with pytest.raises(ValueError, match=r"count has shape \(5,\), density asks for \(6,\)"):
        Fields(**{**vars(fields), "count": fields.count[:5]})

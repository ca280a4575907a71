"""Paths between brushes: even steps, sweeps both ways, files that paint follows."""

import numpy as np
import pytest
from flockbrush.behaviours.brush import BrushLibrary, shipped
from flockbrush.behaviours.mixture import STEPS, load_path, mixed, path_between

from flockbrush.studies.morph import Measured, Trial, brush_at, evenly, faults, measured, sweep


def ways(polarization, milling=None, deviation=0.01):
    mean = np.column_stack([polarization, np.zeros(len(polarization)) if milling is None else milling])
    return Measured(mean, np.full(mean.shape, deviation), 3)


def test_where_behaviour_jumps_steps_are_short():
    points = np.linspace(0, 1, 101)
    values = np.column_stack([1 / (1 + np.exp(-(points - 0.1) / 0.01)), 0 * points])
    along = evenly(points, values, 8)
    reached = np.interp(along, points, values[:, 0])
    assert np.abs(np.diff(reached)).max() < 0.16 and along[0] == 0.0 and along[-1] == 1.0
    assert (np.diff(along) > 0).all()


def test_where_nothing_changes_steps_are_even():
    points = np.linspace(0, 1, 5)
    np.testing.assert_allclose(evenly(points, np.zeros((5, 2)), 4), points)


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (ways(np.linspace(0.1, 0.9, 9)), []),
        (ways(np.linspace(0.9, 0.1, 9)), []),
        (ways([0.1, 0.2, 0.9]), ["polarization changes by 0.70 in one step"]),
        (ways([0.1, 0.24, 0.1, 0.23, 0.3]), ["polarization goes back by 0.14"]),
        (
            ways([0.1, 0.1], deviation=0.3),
            ["polarization deviates by 0.30 between seeds", "milling deviates by 0.30 between seeds"],
        ),
    ],
)
def test_what_keeps_a_way_from_being_even_is_named(found, said):
    assert faults(found) == said


def test_a_detour_is_nothing_at_the_ends_and_most_half_way():
    graze, march = shipped().get("graze"), shipped().get("march")
    wander = [brush_at(graze, march, along, {"wander": 0.8}).params.wander for along in (0.0, 0.5, 1.0)]
    assert wander == pytest.approx([graze.params.wander, 0.8 + 0.5 * (graze.params.wander + march.params.wander),
                                    march.params.wander])  # fmt: skip


def test_herds_are_measured_and_swept_the_same_again():
    swarm, march = shipped().get("swarm"), shipped().get("march")
    trial = Trial(animals=20, seeds=2, seconds=3.0)

    def at(along):
        return brush_at(swarm, march, along, {})

    one, two = (measured(at, [0.0, 1.0], trial) for _ in "ab")
    np.testing.assert_array_equal(one.mean, two.mean)
    assert one.mean[1, 0] > one.mean[0, 0] + 0.2  # a march is more polarized than a swarm
    there, back = sweep(at, [0.0, 1.0], Trial(animals=20, seconds=10.0), 1)
    assert there.shape == back.shape == (2, 2) and there[1, 0] > there[0, 0]


def test_the_command_writes_a_path_that_a_library_finds(cli, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    short = ("--animals", 6, "--seeds", 2, "--steps", 2, "--seconds", 1)
    done = cli("brush", "morph", "swarm", "march", *short)
    assert done.code == 0, done.err
    assert "there and back differ by" in done.out and "wrote swarm--march.path.toml" in done.out
    file = tmp_path / "swarm--march.path.toml"
    path = load_path(file.read_bytes(), file.name)
    assert path.start == "swarm" and len(path.along) == 3 and "brush morph swarm march" in path.measured
    library = BrushLibrary([tmp_path])
    there, back = path_between(library, "swarm", "march"), path_between(library, "march", "swarm")
    assert there == path and back.along[1] == pytest.approx(1.0 - path.along[1])
    assert path_between(library, "graze", "swarm") is None


def test_pairs_with_nothing_between_are_refused(cli, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for pair, why in (
        (("graze", "starlings"), "one is herd, the other boids"),
        (("graze", "graze"), "they are the same"),
    ):
        done = cli("brush", "morph", *pair)
        assert done.code != 0 and why in done.err + done.out
    assert not list(tmp_path.iterdir())


def test_shipped_paths_lead_from_brush_to_brush():
    library = shipped()
    for folder in library.folders:
        for file in sorted(folder.glob("*.path.toml")):
            path = load_path(file.read_bytes(), file.name)
            start, end = library.get(path.start), library.get(path.end)
            assert file.name == f"{path.start}--{path.end}.path.toml" and path.measured
            for k in range(STEPS + 1):
                assert mixed(start, end, k / STEPS, path).model == start.model

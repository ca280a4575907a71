"""Tracks whose frames, clocks, ids or units are not what a reader expects: read right, noted or refused."""

import numpy as np
import pytest
from flockbrush.engine.problems import ProblemsError

import flockbrush
from flockbrush.cli.main import called
from flockbrush.film.observations import CannotObserve
from flockbrush.film.track_evidence import evidence_of_tracks
from flockbrush.film.track_files import Trajectories, read_trajectories
from flockbrush.film.track_table import evened, rounding, unevenness

FPS, ANIMALS = 10.0, 8


def marching(frames=160, speed=1.0, noise=0.0, fps=FPS, seed=4):
    """(frames, ANIMALS, 2) m of animals that walk straight on, nearly the same way."""
    rng = np.random.default_rng(seed)
    angle, begin = rng.normal(0, 0.3, ANIMALS), rng.uniform(0, 12, (ANIMALS, 2))
    step = speed / fps * np.column_stack([np.cos(angle), np.sin(angle)])
    return begin + np.arange(frames)[:, None, None] * step + noise * rng.normal(size=(frames, ANIMALS, 2))


def speeds(tracks, length=1.0):
    """(mean speed in the unit of the tracks, notes)."""
    evidence = evidence_of_tracks(tracks, length)
    return float(np.mean(evidence.sightings.speed)) * length, evidence.notes


def table(path, rows, head="time,id,x_m,y_m"):
    path.write_text(head + "\n" + "\n".join(",".join(map(str, row)) for row in rows) + "\n")
    return path


def rows_of(xy, times):
    """Rows of sights at times (frames, animals), as they are written."""
    return [(times[t][n], n, *xy[t, n]) for t in range(len(xy)) for n in range(xy.shape[1])]


@pytest.mark.parametrize("step", [5, 10])
def test_positions_of_every_nth_frame_are_smoothed_as_if_there_were_no_others(step):
    xy, ids = marching(noise=0.3, fps=2.0), tuple(map(str, range(ANIMALS)))
    sparse = np.full((step * len(xy), ANIMALS, 2), np.nan)
    sparse[::step] = xy
    plain, notes = speeds(Trajectories(xy, ids, 2.0, "m"))
    speed, others = speeds(Trajectories(sparse, ids, 2.0 * step, "m"))
    assert plain == pytest.approx(1.0, abs=0.02) and speed == pytest.approx(1.0, abs=0.02)
    noise = [
        float(note.split("noise is ")[1].split()[0])
        for notes in (notes, others)
        for note in notes
        if "noise is" in note
    ]
    assert noise == pytest.approx([0.3, 0.3], rel=0.1)


def test_a_file_with_every_nth_frame_has_so_many_frames_less(tmp_path):
    xy = marching(40)
    rows = [(6 * t, n, *xy[t, n]) for t in range(40) for n in range(ANIMALS)]
    found = read_trajectories(table(tmp_path / "a.csv", rows, "frame,id,x_m,y_m"), fps=15.0)
    assert found.fps == 2.5 and found.xy.shape == xy.shape and found.frames[1] == 6
    np.testing.assert_allclose(found.xy, xy, atol=1e-12)


@pytest.mark.parametrize(("fps", "digits"), [(60.0, 3), (120.0, 3), (30.0, 3), (28.0, 2), (60.0, 2)])
def test_rounded_times_become_the_frames_they_were(tmp_path, fps, digits):
    xy = marching(400, fps=fps)
    times = np.repeat(np.round(np.arange(400) / fps, digits)[:, None], ANIMALS, 1)
    found = read_trajectories(table(tmp_path / "a.csv", rows_of(xy, times)))
    assert (
        found.fps == pytest.approx(fps, rel=2e-3)
        and len(found) == pytest.approx(400, abs=1)
        and found.seen.mean() > 0.98
    )
    assert speeds(found)[0] == pytest.approx(1.0, rel=2e-3)


def test_each_animal_may_have_its_own_clock(tmp_path):
    """Collars take a fix every five minutes, some seconds early or late, some half a minute later than others."""
    rng, ahead = np.random.default_rng(2), 0.2 * 300
    times = 300.0 * np.arange(60)[:, None] + rng.uniform(0, ahead, ANIMALS) + rng.uniform(-5, 5, (60, ANIMALS))
    begin, way = rng.uniform(0, 50, (ANIMALS, 2)), np.array([0.1, 0.02])
    found = read_trajectories(table(tmp_path / "a.csv", rows_of(begin + times[..., None] * way, times)))
    assert found.fps == pytest.approx(1 / 300, rel=1e-3) and any(
        "interpolated to common times" in note for note in found.notes
    )
    speed = np.diff(found.xy[1:-1], axis=0) * found.fps
    np.testing.assert_allclose(speed, np.broadcast_to(way, speed.shape), rtol=2e-3)


def test_two_sights_at_the_same_time_are_named_with_their_lines(tmp_path):
    rows = rows_of(marching(20), np.repeat(np.arange(20)[:, None] / FPS, ANIMALS, 1))
    with pytest.raises(ProblemsError, match=r"animal 2 is in frame 3 twice \(lines 28 and 162\)"):
        read_trajectories(table(tmp_path / "a.csv", [*rows, rows[26]]))


def test_two_sights_of_a_parquet_file_are_named_with_their_rows(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    import pyarrow

    columns = {"frame": [0, 1, 2, 1], "id": [1, 1, 1, 1], "x": [0.0, 1.0, 2.0, 1.0], "y": [0.0] * 4}
    parquet.write_table(pyarrow.table(columns), tmp_path / "a.parquet")
    with pytest.raises(ProblemsError, match=r"animal 1 is in frame 1 twice \(rows 2 and 4\)"):
        read_trajectories(tmp_path / "a.parquet", "m", 25.0)


def test_swapped_ids_spoil_no_other_animal():
    xy, ids = marching(), tuple(map(str, range(ANIMALS)))
    xy[80:, [0, 5]] = xy[80:, [5, 0]]
    speed, notes = speeds(Trajectories(xy, ids, FPS, "m"))
    assert speed == pytest.approx(1.0, rel=1e-3) and any(
        "animals leap 2 times, first animal 0 to frame 80" in n for n in notes
    )


def test_animals_that_are_seen_once_in_the_frames_asked_for_are_too_few():
    xy = np.full((40, ANIMALS, 2), np.nan)
    xy[np.arange(ANIMALS), np.arange(ANIMALS)] = 1.0
    with pytest.raises(CannotObserve, match="animals visible for 8 frames without a gap of 1 s: 0;"):
        evidence_of_tracks(Trajectories(xy, tuple(map(str, range(ANIMALS))), FPS, "m"), 1.0)


def test_frames_that_are_asked_for_and_not_there_are_told(tmp_path):
    xy = np.random.default_rng(3).normal(0, 1, (40, 3, 2))
    tracks = Trajectories(xy, tuple("abc"), FPS, "m", frames=np.arange(5, 45))
    assert tracks.part(0, 100).notes == ("has frames 5 to 44; 0 to 4 and 45 to 100 are not there",)
    assert tracks.part(5, 100).notes == ("has frames 5 to 44; 45 to 100 are not there",)
    assert tracks.part(10, 44).notes == ()


def test_bursts_are_no_leaps():
    """Fish that rest and dart: the longest steps are many times the usual one, and are theirs."""
    rng, ids = np.random.default_rng(3), tuple(map(str, range(ANIMALS)))
    step = np.where(rng.random((300, ANIMALS)) < 0.08, 1.0, 0.01)
    angle = np.cumsum(rng.normal(0, 0.1, (300, ANIMALS)), axis=0)
    xy = (
        np.cumsum(step[..., None] * np.stack([np.cos(angle), np.sin(angle)], -1), axis=0)
        + 5.0 * np.arange(ANIMALS)[:, None]
    )
    assert not any("leap" in note for note in speeds(Trajectories(xy, ids, FPS, "m"))[1])


@pytest.mark.parametrize("scale", [1.0, 0.005])
def test_slow_and_small_animals_have_their_own_speed(scale):
    """Ants in a ring, in metres without a body length."""
    angle = 2 * np.pi * np.arange(20) / 20 + 0.3 / FPS * np.arange(200)[:, None]
    xy = 6.0 * scale * np.stack([np.cos(angle), np.sin(angle)], -1)
    evidence = evidence_of_tracks(Trajectories(xy, tuple(map(str, range(20))), FPS, "m"), 1.0)
    assert evidence.sightings.speed.mean() == pytest.approx(1.8 * scale, rel=0.01)
    round_and_round = (
        evidence.sightings.xy[:, 0] * evidence.sightings.forward[:, 1]
        - evidence.sightings.xy[:, 1] * evidence.sightings.forward[:, 0]
    )
    assert round_and_round.min() > 0.99 * 6.0 * scale


def test_headings_in_degrees_are_refused_and_others_doubted(tmp_path):
    xy, angle = marching(30), np.degrees(np.arctan2(*np.diff(marching(2), axis=0)[0].T[::-1]))
    head = "time,id,x_m,y_m,heading"
    for turned, words in ((angle + 180.0, "are these degrees"), (np.radians(90.0 - angle), "aside of their headings")):
        rows = [(t / FPS, n, *xy[t, n], turned[n]) for t in range(30) for n in range(ANIMALS)]
        path = table(tmp_path / "a.csv", rows, head)
        if "degrees" in words:
            with pytest.raises(ProblemsError, match=words):
                read_trajectories(path)
        else:
            assert any(words in note for note in speeds(read_trajectories(path))[1])


def test_headings_in_pixels_that_are_measured_as_seen_are_noticed(tmp_path):
    xy, down = marching(30), np.arctan2(*np.diff(marching(2), axis=0)[0].T[::-1])
    for heading, noticed in ((down, False), (-down, True)):
        rows = [(t / FPS, n, *xy[t, n], heading[n]) for t in range(30) for n in range(ANIMALS)]
        tracks = read_trajectories(table(tmp_path / "a.csv", rows, "time,id,x_px,y_px,heading"))
        said = [note for note in speeds(tracks)[1] if "measured the other way round they would be 0 degrees" in note]
        assert bool(said) == noticed


def test_a_rate_that_contradicts_the_times_is_refused(tmp_path):
    path = table(tmp_path / "a.csv", rows_of(marching(20), np.repeat(np.arange(20)[:, None] / FPS, ANIMALS, 1)))
    assert read_trajectories(path, fps=10.0).fps == pytest.approx(10.0)
    with pytest.raises(ProblemsError, match="its times say 10 frames per second, --fps says 25"):
        read_trajectories(path, fps=25.0)


def test_rows_without_an_id_are_left_out_and_counted(tmp_path):
    rows = [
        (t, n or "", x, y) for t, n, x, y in rows_of(marching(20), np.repeat(np.arange(20)[:, None] / FPS, ANIMALS, 1))
    ]
    found = read_trajectories(table(tmp_path / "a.csv", rows))
    assert len(found.ids) == ANIMALS - 1 and "20 rows without an id were left out; the first is line 2" in found.notes


def test_a_damaged_cell_of_a_wide_table_names_its_line(tmp_path):
    rows = [(t / FPS, t, t + 1 if t != 7 else "8px", t, t) for t in range(20)]
    with pytest.raises(ProblemsError, match=r"a\.csv:9: column 3: must be a number, got '8px'"):
        read_trajectories(table(tmp_path / "a.csv", rows, "time,x1,y1,x2,y2"))


def test_animals_that_are_never_there_together_are_not_measured(tmp_path, capsys):
    xy = marching(60)[:, :2]
    xy[30:, 0] = np.nan
    xy[:30, 1] = np.nan
    np.save(tmp_path / "apart.npy", xy)
    assert called(["measure", str(tmp_path / "apart.npy"), "--unit", "m", "--fps", "10"]) == 1
    assert "has no two animals in the same frame" in capsys.readouterr().err


@pytest.mark.parametrize("unit", ["m", None])
def test_the_length_of_a_body_is_that_of_the_brush(tmp_path, unit, hasty_learning, short_trials):
    path = table(
        tmp_path / "a.csv", rows_of(marching(40, noise=0.01), np.repeat(np.arange(40)[:, None] / FPS, ANIMALS, 1))
    )
    found = flockbrush.learn(path, unit=unit, body_length=1.5, quick=True, starts=1, model="herd")
    assert found.brush.body.length == 1.5
    with pytest.raises(ValueError, match="body_length"):
        flockbrush.learn(path, body_length=0.0)


def test_places_are_in_one_unit_where_a_table_has_several(tmp_path):
    rows = [(t, n, 99, t, n) for t in range(9) for n in range(3)]
    found = read_trajectories(table(tmp_path / "a.csv", rows, "frame,id,x_bl,x_m,y_m"), fps=FPS)
    assert found.unit == "m" and found.xy[3, 2].tolist() == [3.0, 2.0]


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_lengths_that_are_known_count_and_heights_that_are_no_numbers_do_not(tmp_path, ending):
    rows = [(t, n, t, n, "" if (t, n) == (0, 0) else 0.5, "?") for t in range(9) for n in range(3)]
    path = table(tmp_path / "a.csv", rows, "frame,id,x_m,y_m,body-length-m,z_m")
    if ending == "parquet":
        csv = pytest.importorskip("pyarrow.csv").read_csv(path)
        pytest.importorskip("pyarrow.parquet").write_table(csv, path := tmp_path / "a.parquet")
    assert read_trajectories(path, fps=FPS).body_length == 0.5


@pytest.mark.parametrize("decimals", [0, 1, 2, 3, 6])
def test_rounded_times_of_even_frames_are_even(decimals):
    even = (np.arange(90) / 30).round(decimals)
    assert unevenness(even, rounding(even)) == ""
    uneven = np.concatenate([np.arange(20) / 30, 20 / 30 + np.arange(40) / 10]).round(max(decimals, 2))
    assert "0.1 s apart" in unevenness(uneven, rounding(uneven)) and "fps=10 " in evened(uneven)


def test_what_lies_beside_a_table_of_another_unit_is_of_an_earlier_one(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("frame,id,x_px,y_px\n" + "".join(f"{t},1,{t},{2 * t}\n" for t in range(9)))
    for unit, fps in (("m", None), ("px", 50.0)):
        (tmp_path / "a.csv.json").write_text(f'{{"schema": "flockbrush.trajectory/1", "fps": 50, "unit": "{unit}"}}')
        found = read_trajectories(path, fps=fps or 25.0)
        assert (found.unit, found.fps) == ("px", fps or 25.0)

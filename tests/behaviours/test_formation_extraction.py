"""Which formation marked birds fly in."""

import os
from pathlib import Path

import cv2
import drawn_skies
import numpy as np
import pytest
from example_formations import left_of_leader, places
from flockbrush.behaviours.formation.curves import fit
from flockbrush.behaviours.formation.extraction import Marks, extract, extract_frame
from flockbrush.behaviours.formation.formation_shapes import load_formation, read_formation, to_json
from flockbrush.behaviours.formation.marked_birds import guess_heading, read_marks
from flockbrush.engine.problems import ProblemsError

from flockbrush.cli.main import called
from flockbrush.film.birds_in_sky import carry, find_birds, find_birds_and_others, mark


@pytest.mark.parametrize("kind", ["V", "U", "J", "line"])
@pytest.mark.parametrize("birds", [14, 28])
def test_a_formation_with_a_tenth_out_of_line_is_known_with_its_leader_and_outliers(kind, birds):
    right = 0
    for frame in range(5):
        x, y, leader, out = places(kind, birds, seed=11, frame=frame, outliers=round(birds / 10))
        seen = extract_frame(x + 40, y - 7)
        right += seen.kind == kind and seen.leader == leader and set(seen.outliers) >= set(out)
        assert seen.spacing[0] == pytest.approx(1.25, abs=0.1)
        assert seen.x[seen.leader] == seen.y[seen.leader] == 0
        assert seen.deviation[1] < 0.25
    assert right >= 4


def test_the_order_of_the_marks_does_not_matter():
    x, y, leader, out = places("V", 9, outliers=1)
    shuffled = np.random.default_rng(1).permutation(9)
    names = [f"goose {k}" for k in range(9)]
    one = extract_frame(x, y, birds=names)
    other = extract_frame(x[shuffled], y[shuffled], birds=[names[k] for k in shuffled])
    assert one == other
    assert one.roles == {f"goose {out[0]}": "outlier", f"goose {leader}": "leader"}


def test_ransac_says_the_same_as_all_samples():
    for frame in range(4):
        x, y, _, out = places("V", 16, seed=3, frame=frame, outliers=2)
        assert extract_frame(x, y, samples=300).outliers == extract_frame(x, y).outliers


def test_a_straggler_is_in_line_and_far_behind():
    x = np.array([-6.0, -3.6, -2.4, -1.2, 0, 1.2, 2.4, 3.6])
    seen = extract_frame(x, -0.8 * np.abs(x))
    assert seen.kind == "V"
    assert seen.outliers == ()
    assert seen.roles == {"0": "straggler", "4": "leader"}


ROW = 1.2 * np.arange(9)
FEW = np.array([0.0, 1.2, 2.4])


@pytest.mark.parametrize(
    ("x", "y", "why"),
    [
        (ROW, 0.1 * np.cos(7 * ROW), "abreast"),
        (ROW, 1.0 * np.abs(ROW - 4.8), "opens forward"),
        (ROW / 5, 3.0 * np.cos(7 * ROW), "cluster"),
        (ROW, 3.0 * np.cos(7 * ROW), "cluster"),
        (FEW, np.array([-3.0, 0.0, -3.0]), "no formation|too few|no line"),
        ([0.0], [0.0], "alone"),
        ([0.0, 1.2], [0.0, -1.0], "two birds"),
        (np.zeros(7), np.zeros(7), "one point"),
    ],
    ids=["row", "inverted V", "crowd", "scattered", "three in a V", "one", "two", "one point"],
)
def test_what_is_no_formation_is_called_none_and_why(x, y, why):
    seen = extract_frame(x, y)
    assert seen.kind == "none"
    assert seen.curve is None
    assert any(part in seen.why for part in why.split("|")), seen.why


def test_three_birds_in_a_slanted_row_are_a_line():
    assert extract_frame(FEW, -0.8 * FEW).kind == "line"


def test_random_clouds_are_rarely_taken_for_formations():
    rng = np.random.default_rng(5)
    taken = sum(extract_frame(*rng.uniform(-4, 4, (2, n))).kind != "none" for n in (6, 9, 12, 20) for _ in range(15))
    assert taken <= 3


def test_a_fit_goes_through_birds_exactly_on_a_curve():
    x = np.linspace(-5, 5, 11)
    found = fit("parabola", x, 0.3 + 0.2 * x - 0.1 * x**2)
    assert found.curve.numbers == pytest.approx((0.3, 0.2, -0.1))
    assert found.inlier.all()
    assert fit("parabola", x, x**2) is None or fit("parabola", x, x**2).cost > 5  # it may not open forward
    assert fit("v", x[:3], x[:3]) is None


# files -------------------------------------------------------------------------------


def marks_of(kind="V", birds=9, frames=2):
    x, y = np.array([places(kind, birds, frame=f)[:2] for f in range(frames)]).transpose(1, 0, 2)
    return Marks(tuple(map(str, range(frames))), tuple(map(str, range(birds))), x, y)


def test_a_formation_survives_its_file(tmp_path):
    formation = extract(marks_of(), "geese", {"from": "a test"})
    path = tmp_path / "geese.json"
    path.write_text(to_json(formation), encoding="utf-8")
    again = load_formation(path)
    assert again.kinds() == {"V": 2}
    assert again.frames[1].x == pytest.approx(formation.frames[1].x, abs=1e-6)
    assert to_json(again) == path.read_text(encoding="utf-8")


def test_a_broken_formation_file_says_where():
    frame = {"birds": ["a"], "x": [0], "y": [], "leader": 0, "outliers": []}
    good = {"schema": "flockbrush.formation/1", "frames": [frame]}
    with pytest.raises(ProblemsError, match=r"frames\[0\]: y must be 1 numbers"):
        read_formation(good, "x.json")
    with pytest.raises(ProblemsError, match="schema"):
        read_formation([], "x.json")


def written(tmp_path, text):
    path = tmp_path / "marks.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_marks_in_pixels_become_wingspans_the_way_they_fly(tmp_path):
    path = written(tmp_path, "frame,bird,x_px,y_px\n0,a,100,50\n0,b,120,70\n")
    marks, used = read_marks(path, "left", 20.0)
    assert used == {"heading_degrees": 180.0, "heading_from": "the call", "wingspan_px": 20.0}
    # a is farther left in the picture, hence ahead; b is lower in the picture, hence to the left of who flies left
    assert (marks.y[0, 0] - marks.y[0, 1]) == pytest.approx(1.0)
    assert (marks.x[0, 1] - marks.x[0, 0]) == pytest.approx(-1.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is empty"),
        ("frame,bird,x_px,y_px\n", "no birds"),
        ("frame,bird,u,v\n0,a,1,2\n", "1: needs columns x_px and y_px"),
        ("frame,bird,x_px,y_px\n0,a,1,2\n", "1: x_px: is in pixels, but the wingspan is not known"),
        ("frame,bird,x_b,y_b\n0,a,1,2\n0,b,nan,2\n", "3: x_b: must be a finite number, got nan"),
        ("frame,bird,x_b,y_b\n0,a,1,two\n", "2: y_b: must be a number, got 'two'"),
        ("frame,bird,x_b,y_b\n0,a,1,2\n0,a,3,4\n", "3: bird: bird 'a' of frame '0' is already in row 2"),
        (
            "frame,bird,x_b,y_b\n0,a,1,2\n0,b,1,2\n1,a,3,4\n",
            "4: bird: frame '1' has 1 birds, frame '0' has 2: it lacks b",
        ),
        ("frame,bird,x_b,y_b\n0,a,1\n", "2: has 3 cells, the header has 4"),
        ("frame,bird,x_px,y_px,wingspan_px\n0,a,1,2,-3\n", "2: wingspan_px: must be above 0, got -3"),
    ],
)
def test_wrong_marks_name_row_and_column(tmp_path, text, said):
    with pytest.raises(ProblemsError) as error:
        read_marks(written(tmp_path, text))
    assert said in str(error.value)


def test_the_way_a_v_flies_is_seen_from_its_arms():
    x, y, *_ = places("V", 13, deviation=0.05)
    for turn in (90, 200, 315):
        a = np.radians(turn - 90)
        points = np.c_[x, y] @ [(np.cos(a), np.sin(a)), (-np.sin(a), np.cos(a))]
        assert abs((guess_heading(points) - turn + 180) % 360 - 180) <= 10
    with pytest.raises(ProblemsError, match="give --heading left"):
        guess_heading(np.c_[ROW, -ROW])


# birds in pictures --------------------------------------------------------------------


def sky(points, size=(300, 400), wing=9):
    """A picture of dark birds on a bright, uneven sky."""
    rows, columns = np.mgrid[: size[0], : size[1]]
    image = (200 + 30 * np.sin(columns / 90) + rows / 12).astype(np.uint8)
    for x, y in points:
        cv2.ellipse(image, (round(x), round(y)), (wing, 2), 20, 0, 360, 40, -1)
        cv2.ellipse(image, (round(x), round(y)), (wing, 2), -20, 0, 360, 40, -1)
    return np.repeat(image[..., None], 3, axis=2)


FLOCK = np.array([(60, 200), (100, 160), (140, 120), (180, 160), (220, 200), (260, 240)])


def test_birds_are_found_on_an_uneven_sky_and_a_wire_is_not():
    image = sky(FLOCK)
    cv2.line(image, (300, 0), (390, 290), (40, 40, 40), 2)
    found = find_birds(image)
    assert [(p.x, p.y) for p in found] == [pytest.approx(p, abs=1.5) for p in FLOCK.tolist()]
    assert find_birds(sky([])) == []


@pytest.mark.parametrize("lamps", [1, 2])
def test_moon_and_sun_are_no_birds_and_it_is_said(tmp_path, lamps):
    image = sky(FLOCK) // 2
    for x, y in [(330, 60), (300, 250)][:lamps]:
        cv2.circle(image, (x, y), 6, (255, 255, 255), -1)
    birds, said = find_birds_and_others(image)
    assert [(p.x, p.y) for p in birds] == [pytest.approx(p, abs=1.5) for p in FLOCK.tolist()]
    assert len(said) == 1 and f"{lamps} lighter than the sky, at 3" in said[0]
    cv2.imwrite(str(tmp_path / "moon.png"), image)
    rows, _, lost = mark([tmp_path / "moon.png"])
    assert len(rows) == len(FLOCK) and lost[0].startswith("moon.png: ")


def test_pale_birds_are_found_and_a_flock_of_both_stays_whole():
    assert [(p.x, p.y) for p in find_birds(255 - sky(FLOCK))] == [pytest.approx(p, abs=1.5) for p in FLOCK.tolist()]
    image = np.where(sky(FLOCK[3:]) < 100, 220, sky(FLOCK[:3]) // 2).astype(np.uint8)
    birds, said = find_birds_and_others(image)
    assert len(birds) == len(FLOCK) and said == []


def drawn(kind, seed=1):
    """(picture, places of the birds in it, wingspan) as a camera may see them."""
    v = drawn_skies.in_a_v(9, 24, (480, 240))
    if kind == "large":
        at = np.array([(130, 130), (330, 260), (500, 120)])
        return drawn_skies.photograph(at, 170, seed), at, 170
    if kind == "over a twelfth":
        at = drawn_skies.in_a_v(5, 70, (560, 240))
        return drawn_skies.photograph(at, 70, seed), at, 70
    if kind == "pale bodies, branches":
        at = drawn_skies.in_a_v(8, 24, (330, 240), heading=90)
        return drawn_skies.branches(drawn_skies.photograph(at, 24, 2, heading=90, body="sky"), 2), at, 24
    if kind in ("pale bodies", "white bodies"):
        at = drawn_skies.in_a_v(9, 40, (560, 240))
        return drawn_skies.photograph(at, 40, seed, body="sky" if kind == "pale bodies" else 250), at, 40
    image = drawn_skies.photograph(v, 24, seed, dark=110.0 if kind == "faint, moon" else 45.0)
    if kind == "branches":
        return drawn_skies.branches(image, seed), v, 24
    return drawn_skies.moon(image, (80, 60), 55 if kind == "large moon" else 25), v, 24


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("large", None),
        ("over a twelfth", None),
        ("pale bodies", None),
        ("white bodies", None),
        ("moon", "1 larger than a bird, at 80,60, was left out: 50 pixels long"),
        ("large moon", "1 larger than a bird, at 80,60"),
        ("faint, moon", "1 larger than a bird, at 80,60"),
        ("branches", "larger than a bird"),
        ("pale bodies, branches", "than a bird"),
    ],
)
def test_each_bird_of_a_drawn_sky_is_one_bird(kind, said):
    image, at, span = drawn(kind)
    birds, lines = find_birds_and_others(image)
    apart = np.linalg.norm(at[:, None] - [(p.x, p.y) for p in birds], axis=2)
    assert len(birds) == len(at)
    assert apart.min(axis=1).max() < 0.35 * span
    assert not lines if said is None else said in lines[0]


def test_touching_birds_are_named():
    at = np.array([(100, 100), (200, 150), (300, 100), (400, 150), (403, 180)])
    birds, said = find_birds_and_others(drawn_skies.photograph(at, 34, 3))
    assert len(birds) == 4
    assert "as long as two birds" in said[0]


def test_a_drawn_v_is_known_with_a_false_bird_and_no_heading_given(tmp_path, capsys):
    at = drawn_skies.in_a_v(8, 24, (250, 300), heading=130)
    image = drawn_skies.photograph(np.vstack([at, [(120, 120)]]), 24, heading=130)
    cv2.imwrite(str(tmp_path / "v.png"), image)
    assert called(["formation", "detect", str(tmp_path / "v.png"), "-o", str(tmp_path / "v.csv")]) == 0
    assert called(["formation", "extract", str(tmp_path / "v.csv"), "--out", str(tmp_path / "v.json")]) == 0
    said = capsys.readouterr().err
    assert any(f"heading {way} degrees" in said for way in (125, 130, 135)), said
    frame = load_formation(tmp_path / "v.json").frames[0]
    assert frame.kind == "V"
    (false,) = [name for name, role in frame.roles.items() if role == "outlier"]
    rows = (tmp_path / "v.csv").read_text().splitlines()
    row = next(row.split(",") for row in rows[1:] if row.split(",")[1] == false)
    assert (float(row[2]), float(row[3])) == pytest.approx((120, 120), abs=8)


@pytest.mark.parametrize("kind", ["V", "U", "J", "line"])
def test_false_birds_change_neither_shape_nor_leader(kind):
    right = 0
    for seed in range(6):
        x, y, left, _ = places(kind, 12, seed=seed, deviation=0.1)
        false = np.random.default_rng(seed).uniform((-12, -14), (12, 8), (2, 2))
        names = [str(k) for k in range(12)] + ["false", "other"]
        seen = extract_frame(np.r_[x, false[:, 0]], np.r_[y, false[:, 1]], birds=names)
        right += seen.kind == kind and seen.birds[seen.leader] == str(left)
    assert right >= 5


def test_birds_keep_their_names_while_the_camera_pans(tmp_path):
    for k in range(4):
        cv2.imwrite(str(tmp_path / f"{k}.png"), sky(FLOCK + (9 * k, -6 * k) + np.c_[np.arange(6) % 2 * k, np.zeros(6)]))
    rows, span, lost = mark(sorted(tmp_path.glob("*.png")))
    assert lost == []
    assert len(rows) == 24
    assert 12 < span < 26
    tracks = np.array([[(p.x, p.y) for _, bird, p in rows if bird == b] for b in range(6)])
    assert np.abs(np.diff(tracks, axis=1) - (9, -6)).max() < 2.5
    assert carry([], find_birds(sky(FLOCK)), 20.0).tolist() == [-1] * 6


def test_files_without_birds_are_refused(tmp_path):
    with pytest.raises(ProblemsError, match="no such file"):
        mark([tmp_path / "none.png"])
    (tmp_path / "text.png").write_text("no picture")
    with pytest.raises(ProblemsError, match="is not a readable picture"):
        mark([tmp_path / "text.png"])
    cv2.imwrite(str(tmp_path / "sky.png"), sky([]))
    with pytest.raises(ProblemsError, match="no birds"):
        mark([tmp_path / "sky.png"])


PHOTOGRAPHS = os.environ.get("FLOCKBRUSH_DATA", "")


@pytest.mark.skipif(not PHOTOGRAPHS, reason="FLOCKBRUSH_DATA names no folder of photographs")
def test_the_photograph_of_a_v():
    folder = Path(PHOTOGRAPHS) / "v_formation"
    rows, span, _ = mark([folder / "v_18_cormorants_or_geese.jpg"])
    known, used = read_marks(folder / "bird_positions.csv", "up", 1.0)
    points = np.array([(p.x, -p.y) for _, _, p in rows])
    there = np.c_[known.x[0], known.y[0]]
    assert len(points) == len(there) == 18
    assert np.linalg.norm(points[:, None] - there, axis=2).min(axis=1).max() < 1.5  # pixels
    marks, _ = read_marks(folder / "bird_positions.csv", "left", span)
    frame = extract(marks).frames[0]
    assert frame.kind == "V"
    assert frame.roles == {"0": "leader", "17": "straggler"}
    assert left_of_leader("V", 18) - 1 <= frame.leader <= 9

"""What a person marks in a film: frames in any order, birds put right, masks, landmarks, sketches, and their files."""

import threading

import cv2
import numpy as np
import pytest
from flockbrush.behaviours.brush import name_like
from flockbrush.engine.problems import ProblemsError

from flockbrush.film import clip_layers as layers
from flockbrush.film.bird_marks import Birds, Follower
from flockbrush.film.body_marks import body_mask, colour_at
from flockbrush.film.camera_maps import back, moved_by
from flockbrush.film.clip_document import Book
from flockbrush.film.clip_frames import Film, Sky
from flockbrush.film.clip_jobs import ClipJob
from flockbrush.film.flight_sketch import FlightSketch
from flockbrush.film.landmarks import Landmark, between, followed, motion
from flockbrush.film.track_clip import table_of
from flockbrush.film.tracks import read_marks, read_tracks
from flockbrush.lifting.lens import Camera
from flockbrush.lifting.lift_solver import lift
from tests.clip_film import PLACES, STARTS, STEPS, bird_film, numbered_film

# frames ---------------------------------------------------------------------------------


def number_in(picture):
    """The number that a frame of `numbered_film` shows in stripes."""
    return sum(int(picture[20, 8 + 16 * bit].mean() > 127) << bit for bit in range(8))


@pytest.mark.parametrize("ending", ["mp4", "avi"])
def test_frames_are_the_same_whichever_way_they_are_had(tmp_path, ending):
    film = Film(numbered_film(tmp_path / f"n.{ending}", 120))
    film._most = 12  # as in a large film
    order = [*range(119, -1, -1), 3, 90, 17, 118, 0, 60, 59, 61]
    assert [number_in(film.frame(k)) for k in order] == order
    assert number_in(film.again().frame(77)) == 77
    assert (len(film), film.fps, film.time(30)) == (120, 30, pytest.approx(1.0))


@pytest.mark.parametrize(
    ("name", "said"), [("none.mp4", "no such file"), ("", "folder"), ("notes.txt", "is not a readable video")]
)
def test_what_is_no_film_is_refused_in_plain_words(tmp_path, name, said):
    (tmp_path / "notes.txt").write_text("no film")
    with pytest.raises(ProblemsError, match=said):
        Film(tmp_path / name)


# birds ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def sky_film(tmp_path_factory):
    return Film(bird_film(tmp_path_factory.mktemp("clip") / "birds.avi"))


@pytest.fixture(scope="module")
def followed_birds(sky_film):
    return Follower(sky_film).follow(Birds.none(len(sky_film)), 0)


def whose(birds, k):
    """Number of the bird at each true place of a frame, None where there is none."""
    here = birds.at(k)
    near = lambda at: [bird for bird, place in here.items() if np.hypot(*np.subtract(place, at)) < 4]  # noqa: E731
    return [(near(at) or [None])[0] for at in np.add(STARTS, np.multiply(STEPS, k))]


def test_a_bird_put_right_is_followed_on_from_there_and_not_before(sky_film, followed_birds):
    a, b = whose(followed_birds, 0)[:2]
    places = followed_birds.at(20)
    said = followed_birds.put(20, a, *places[b]).put(20, b, *places[a])
    assert said.pending == 20
    after = Follower(sky_film).follow(said, 20)
    assert after.pending is None
    assert np.array_equal(after.px[:20], followed_birds.px[:20], equal_nan=True)
    assert whose(after, 19)[:2] == [a, b] and whose(after, 21)[:2] == [b, a] and whose(after, 39)[:2] == [b, a]


def test_a_track_that_breaks_off_is_joined_to_its_other_half_with_its_corrections():
    px = np.full((60, 3, 2), np.nan)
    px[:5, 0] = px[8:, 1] = px[:, 2] = 7.0
    birds = Birds(px, (1, 2, 3), {9: {2: (7.0, 7.0, False)}})
    assert [birds.lost(k) for k in (4, 5, 34, 35)] == [{}, {1: (7.0, 7.0)}, {1: (7.0, 7.0)}, {}]
    joined = birds.join(1, 2)
    assert joined.ids == (1, 3) and joined.sights() == {1: 57, 3: 60}
    assert joined.corrections == {8: {1: (7.0, 7.0, False)}, 9: {1: (7.0, 7.0, False)}}
    with pytest.raises(ValueError, match="bird 1 and bird 3 are both seen in frame 0"):
        birds.join(1, 3)
    assert birds.remove(2, 1).lost(5) == {}  # a person took it away


def test_two_halves_that_were_joined_stay_so_when_they_are_followed_on(sky_film, followed_birds):
    bird = whose(followed_birds, 0)[0]
    px, n = followed_birds.px.copy(), followed_birds.ids.index(bird)
    px = np.concatenate([px, np.full_like(px[:, :1], np.nan)], axis=1)
    px[20:, -1], px[15:, n] = px[20:, n], np.nan
    other = max(followed_birds.ids) + 1
    joined = Birds(px, (*followed_birds.ids, other)).join(bird, other)
    after = Follower(sky_film).follow(joined, joined.pending)
    assert whose(after, 14)[0] == whose(after, 20)[0] == whose(after, 39)[0] == bird and other not in after.ids


def test_what_is_no_bird_does_not_come_back_when_it_is_followed_again(sky_film, followed_birds):
    bird = whose(followed_birds, 0)[2]
    gone = followed_birds.remove(12, bird)
    assert gone.sights()[bird] == 12
    after = Follower(sky_film).follow(gone, 12)
    assert whose(after, 11)[2] == bird and whose(after, 13)[2] is None and whose(after, 39)[2] is None
    never = Follower(sky_film).follow(followed_birds.remove(0, bird), 0)
    assert whose(never, 20)[2] is None and len(never.ids) == len(STARTS) - 1
    again = Follower(sky_film).follow(after, 25)  # from a later frame on it stays away too
    assert whose(again, 30)[2] is None


def test_a_new_bird_has_a_number_that_nobody_had(followed_birds):
    number = followed_birds.remove(0, max(followed_birds.ids)).new()
    assert number == 1 + max(followed_birds.ids)
    assert followed_birds.put(3, number, 50, 60).at(3)[number] == (50, 60)


def test_a_bird_that_cannot_be_followed_is_still_where_a_person_saw_it(sky_film, followed_birds):
    said = followed_birds.put(20, 99, 300.0, 20.0)
    assert Follower(sky_film).follow(said, 20).at(20)[99] == (300, 20)


def test_a_correction_that_neither_says_yes_nor_no_is_refused(tmp_path):
    (tmp_path / "c.csv").write_text("frame,id,x,y,gone\n1,2,3,4,maybe\n")
    with pytest.raises(ProblemsError, match=r"c.csv:2: gone: must be 1"):
        read_marks(tmp_path / "c.csv")


# landmarks and colour -------------------------------------------------------------------


def test_a_landmark_is_followed_both_ways(tmp_path):
    film = Film(numbered_film(tmp_path / "n.avi", 12))
    x, y = PLACES[6]
    boxes = followed(film, Landmark(6, x - 12, y - 12, 24, 24))
    middles = boxes[:, :2] + boxes[:, 2:] / 2
    assert np.abs(middles - np.array(PLACES)[:12]).max() < 3


def test_a_landmark_that_csrt_does_not_take_is_in_its_own_frame_alone(tmp_path, monkeypatch):
    film = Film(numbered_film(tmp_path / "n.avi", 4))
    monkeypatch.setattr("flockbrush.film.landmarks.SIDE", 24)  # as in a large film
    boxes = followed(film, Landmark(2, 60, 60, 8, 8))
    assert np.isfinite(boxes).all(1).tolist() == [False, False, True, False]


def test_two_landmarks_tell_shift_turn_and_size():
    turn = 1.2 * np.array([[0.8, -0.6], [0.6, 0.8]])
    at = np.array([[10.0, 20], [110, 60]])
    boxes = [np.array([[*a, 0, 0], [*(turn @ a + (5, 7)), 0, 0]]) for a in at]
    matrix = motion(boxes, 0, 1)
    assert np.allclose(moved_by(matrix, [[50, 50]]), [turn @ (50, 50) + (5, 7)])
    assert np.allclose(moved_by(back(matrix), moved_by(matrix, at)), at)
    assert np.allclose(motion(boxes[:1], 0, 1)[:, 2], boxes[0][1, :2] - at[0])
    assert motion([], 0, 1) is None and np.allclose(motion([], 3, 3), np.eye(2, 3))


def test_a_rectangle_is_kept_within_the_picture_and_a_click_is_none():
    assert between(3, (50, 60), (-20, 10), (320, 180)) == (3, 0, 10, 50, 50)
    assert between(3, (50, 60), (52, 61), (320, 180)) is None
    assert between(0, (0, 0), (15, 90), (2560, 1440)) is None and between(0, (0, 0), (16, 90), (2560, 1440))
    assert Landmark(3, 0, 10, 50, 50).argument == "3:0,10,50,50"


def test_the_bodys_colour_finds_the_bodies():
    picture = np.full((60, 80, 3), (60, 140, 70), np.uint8)
    cv2.circle(picture, (30, 30), 8, (210, 225, 235), -1)
    colour = colour_at(picture, 30, 30)
    assert colour == (235, 225, 210)
    mask = body_mask(picture, colour)
    assert mask[30, 30] and not mask[5, 5] and abs(mask.sum() - np.pi * 64) < 30


# masks ----------------------------------------------------------------------------------


def test_strokes_and_fills_paint_masks_that_files_bring_back(tmp_path):
    array = np.zeros((60, 80), np.uint8)
    layers.stroke(array, (10, 30), (70, 30), 3, 2)
    assert array[30, 40] == 2 and array[25, 40] == 0 and abs((array[:, 40] > 0).sum() - 6) <= 1
    layers.fill(array, (40, 5), 5)
    assert array[5, 40] == 5 and array[55, 40] == 5  # round the ends of the stroke
    layer = layers.MaskLayer.of(array)
    layers.write_regions(tmp_path / "r.png", layer)
    assert np.array_equal(layers.read_regions(tmp_path / "r.png", (80, 60)).array, array)
    layers.write_obstacles(tmp_path / "o.png", layers.MaskLayer.of(array == 2))
    assert np.array_equal(layers.read_obstacles(tmp_path / "o.png", (80, 60)).array, array == 2)
    with pytest.raises(ProblemsError, match="must have the size of the clip"):
        layers.read_obstacles(tmp_path / "o.png", (81, 60))
    cv2.imwrite(str(tmp_path / "odd.png"), np.full((60, 80, 3), (0, 0, 255), np.uint8))
    with pytest.raises(ProblemsError, match="255, 0, 0, which is not a region colour"):
        layers.read_regions(tmp_path / "odd.png", (80, 60))


# sketches -------------------------------------------------------------------------------


def test_sketched_paths_become_tracks_over_the_same_frames():
    slow_end = [(10 + 2 * k, 50, 0.01 * k**2) for k in range(60)]
    sketch = FlightSketch(frames=40, smooth=0).with_path(slow_end).with_path([(5, 5, 0), (100, 80, 0.2)])
    steps = np.hypot(*np.diff(sketch.tracks.px, axis=0).transpose(2, 0, 1))
    assert sketch.tracks.px.shape == (40, 2, 2) and np.ptp(steps, axis=0).max() < 1e-9
    drawn = FlightSketch(sketch.paths, 40, even=False, smooth=0).tracks.px
    assert drawn[1, 0, 0] - drawn[0, 0, 0] > 3 * (drawn[-1, 0, 0] - drawn[-2, 0, 0])
    assert np.allclose(drawn[[0, -1], 0], [(10, 50), (128, 50)])


def test_a_shaky_hand_is_smoothed():
    shaky = [(3 * k, 60 + 4 * (k % 2), 0.02 * k) for k in range(80)]
    bent = [
        np.abs(np.diff(FlightSketch(frames=100, smooth=s).with_path(shaky).tracks.px[:, 0, 1], 2)).max()
        for s in (0, 0.6)
    ]
    assert bent[1] < 0.1 * bent[0]


def test_a_click_is_no_path():
    assert FlightSketch().with_path([(5, 5, 0), (6, 6, 0.1)]) is None


def test_a_sketch_is_lifted_as_it_is(tmp_path):
    sketch = FlightSketch(frames=60)
    for n in range(4):
        sketch = sketch.with_path([(40 + 8 * k, 100 + 30 * n + 10 * np.sin(k / 5), 0.03 * k) for k in range(30)])
    book = Book(Sky((320, 240), 60), tmp_path)
    book.do("four birds", "sketch", 0, sketch=sketch)
    book.save()
    camera = Camera(width=320, height=240, horizontal_fov_deg=60, fps=30, mean_speed=9, near=2, far=400)
    flight = lift(read_tracks(tmp_path / "sky.sketch.csv"), camera)
    assert flight.xyz.shape == (60, 4, 3) and np.isfinite(flight.xyz).all()


# the book -------------------------------------------------------------------------------


@pytest.fixture
def book(tmp_path, sky_film):
    return Book(sky_film, tmp_path / "marks")


def marked(book):
    book.mark("landmark", "landmarks", 3, landmarks=(Landmark(3, 10, 20, 30, 40), Landmark(9, 200, 20, 30, 40)))
    book.mark("colour", "body", 3, body_colour=(1, 2, 3), body_length=14.25, first=2, last=30)
    array = np.zeros((180, 320), np.uint8)
    array[:20] = 1
    book.do("wall", "paint", 0, obstacles=layers.MaskLayer.of(array), regions=layers.MaskLayer.of(3 * array))
    book.do("paths", "sketch", 0, sketch=book.state.sketch.with_path([(0, 0, 0), (50, 50, 1)]))


def test_every_step_is_undone_and_done_again(book, followed_birds):
    first = book.state
    marked(book)
    book.do("birds", "birds", 0, birds=followed_birds)
    last = book.state
    while step := book.undo():
        assert step.label
    assert book.state is first and not book.dirty
    while book.redo():
        pass
    assert book.state is last and book.dirty


def test_what_was_saved_is_taken_up_again(book, sky_film, followed_birds):
    marked(book)
    book.do("birds", "birds", 0, birds=followed_birds.put(5, followed_birds.ids[0], 30, 40))
    names = {path.name for path in book.save()}
    parts = ("marks.toml", "obstacles.png", "regions.png", "tracks.csv", "corrections.csv", "sketch.csv")
    assert names == {f"birds.{part}" for part in parts} and not book.dirty
    again = Book(sky_film, book.folder)
    again.load()
    assert again.state.marks == book.state.marks and again.state.sketch == book.state.sketch
    assert np.array_equal(again.state.regions.array, book.state.regions.array)
    assert again.state.birds.corrections == book.state.birds.corrections and again.state.birds.pending == 5
    assert np.allclose(again.state.birds.px, book.state.birds.px, atol=1e-3, equal_nan=True)
    assert not again.dirty and again.text() == book.text()


def test_the_line_to_learn_by_says_all_that_was_marked(book):
    marked(book)
    line = book.learn_line()
    for part in ("--frames 2:30", "--landmark 3:10,20,30,40", "--landmark 9:200,20,30,40", "--body-colour 1,2,3",
                 "--body-length-px 14.2", "--obstacles", "--regions"):  # fmt: skip
        assert part in line
    assert line.startswith("flockbrush learn ") and "birds.brush.toml" in line


def test_the_line_to_learn_by_is_one_that_learn_takes(book):
    book.stem = "Mähende Schafe (Übung) 1"
    book.mark("landmark", "landmarks", 3, landmarks=(Landmark(3, 10, 20, 30, 40),))
    line = book.learn_line()
    assert "--out Mahende-Schafe-Ubung-1.brush.toml" in line and "--landmark" not in line  # which takes two
    assert [name_like(text) for text in ("a", "--x--", "Ω", "a" * 70)] == ["a", "x", "learned", "a" * 64]


def test_a_file_that_is_not_ours_is_kept_beside(book, followed_birds):
    book.folder.mkdir()
    book.place("tracks.csv").write_text("somebody's")
    book.do("birds", "birds", 0, birds=followed_birds)
    book.save()
    assert (book.folder / "birds.tracks.csv.bak").read_text() == "somebody's"
    book.do("none", "birds", 0, birds=Birds.none(40))
    book.save()
    assert not book.place("tracks.csv").exists()
    book._ours.clear()  # a second session
    book.place("tracks.csv").write_text("theirs, later")
    book.do("birds", "birds", 0, birds=followed_birds)
    book.save()
    kept = {path.name: path.read_text() for path in book.folder.glob("birds.tracks.csv.bak*")}
    assert kept == {"birds.tracks.csv.bak": "somebody's", "birds.tracks.csv.bak1": "theirs, later"}


def test_a_bird_in_a_single_frame_is_taken_up_again(book):
    for k, birds in ((5, {1: (30, 40)}), (7, {1: (35, 40), 2: (100, 90)})):
        for bird, at in birds.items():
            book.do("added", "birds", k, birds=book.state.birds.put(k, bird, *at))
        book.save()
        again = Book(book.film, book.folder)
        again.load()
        assert again.state.birds.at(k) == birds and again.state.birds.ids == book.state.birds.ids


def test_a_sketch_of_which_nothing_is_known_is_kept_beside(book):
    marked(book)
    book.save()
    book.place("marks.toml").unlink()
    sketched = book.place("sketch.csv").read_text()
    again = Book(book.film, book.folder)
    again.load()
    again.save()
    assert book.place("sketch.csv").read_text() == sketched
    again.do("path", "sketch", 0, sketch=again.state.sketch.with_path([(0, 9, 0), (90, 50, 1)]))
    again.save()
    assert (book.folder / "birds.sketch.csv.bak").read_text() == sketched


def test_saved_corrections_are_not_replaced_by_tracks_that_are_given_again(book, followed_birds, tmp_path):
    marked(book)
    book.do("birds", "birds", 0, birds=followed_birds.put(3, int(followed_birds.ids[0]), 20.0, 30.0))
    book.save()
    first = tmp_path / "t.csv"
    first.write_text(table_of(followed_birds.tracks()))
    again = Book(book.film, book.folder)
    with pytest.raises(ProblemsError, match="were saved in .*birds.tracks.csv before: leave out --tracks"):
        again.load(first)
    again.load(book.place("tracks.csv"))  # the same as those that were saved
    assert again.state.birds.corrections == book.state.birds.corrections and again.state.birds.corrections


def test_marks_and_tracks_of_another_film_of_this_name_are_refused(book, tmp_path):
    book.save()
    text = book.place("marks.toml").read_text()
    book.place("marks.toml").write_text(text.replace(book.film.name, "birds.mkv"))
    with pytest.raises(ProblemsError, match="has marks of 'birds.mkv', not of 'birds.avi'; choose another folder"):
        Book(book.film, book.folder).load()
    (tmp_path / "t.csv").write_text("frame,id,x,y\n0,7,9000,10\n1,7,9001,10\n2,7,9002,10\n")
    book.place("marks.toml").unlink()
    with pytest.raises(ProblemsError, match="frame 0: bird 7 is at 9000, 10, outside the picture of"):
        Book(book.film, book.folder).load(tmp_path / "t.csv")


def test_marks_of_another_film_are_refused(book, sky_film):
    book.folder.mkdir()
    book.place("marks.toml").write_text("[[landmark]]\nframe = 900\nbox = [1, 2, 30, 40]\n")
    with pytest.raises(ProblemsError, match="has marks in frame 900, but"):
        book.load()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("body_length_px = 'long'", r"marks.toml:1: body_length_px: must be a number, got 'long'"),
        ("\nfirst = 'x'", r"marks.toml:2: first: must be a whole number, got 'x'"),
        ("first = 1.5", "first: must be a whole number, got 1.5"),
        ("first = 9\nlast = 5", "first: must not be after last, 5, got 9"),
        ("last = 40", "last: has marks in frame 40, but birds.avi ends at frame 39"),
        ("body_colour = [300, 0, 0]", r"body_colour\[0\]: must be at most 255, got 300"),
        ("body_length_px = -4", "body_length_px: must be from 2 to 2000, got -4"),
        ("pending = -1", "pending: must be at least 0, got -1"),
        ("sketch_frames = 1000000000", "sketch_frames: must be at most 100000"),
        ("[[landmark]]\nframe = 3\nbox = [1, nan, 30, 40]", r"landmark\[0\].box\[1\]: must be a finite number"),
        ("[[landmark]]\nframe = 3\nbox = [300, 2, 30, 40]", r"marks.toml:3: landmark\[0\].box: must be a rectangle"),
        ("[[landmark]]\nframe = 'x'", r"landmark\[0\].frame: must be a whole number"),
        ("[[path]]\nbird = 1\npoints = [[1, 2, 3]]", r"path\[0\].points: must have at least 2 items"),
        ("colour = [1, 2, 3]", "colour: unknown name"),
    ],
)
def test_a_mistake_in_the_marks_is_told_with_its_line(book, text, said):
    book.folder.mkdir()
    book.place("marks.toml").write_text(text)
    with pytest.raises(ProblemsError, match=said):
        book.load()


def test_tracks_that_are_longer_than_the_film_are_refused(book, tmp_path):
    (tmp_path / "t.csv").write_text("frame,id,x,y\n" + "".join(f"{f},1,5,5\n" for f in range(60)))
    with pytest.raises(ProblemsError, match="the clip has frames 0 to 39"):
        book.load(tmp_path / "t.csv")


# jobs -----------------------------------------------------------------------------------


def waited(job):
    job._thread.join(5)
    return job.look()


def test_work_beside_the_window_hands_on_what_it_found_or_what_went_wrong():
    got = []
    assert waited(ClipJob("sum", lambda say: say(0.5) or 42, got.append)) and got == [42]
    job = ClipJob("fail", lambda say: 1 / 0, got.append)
    with pytest.raises(ZeroDivisionError):
        waited(job)
    assert job.look() and got == [42]


def test_work_that_nobody_wants_stops():
    def endless(say):
        while True:
            say(0)

    job = ClipJob("endless", endless, lambda result: pytest.fail("nobody wants it"))
    job.stop(wait=True)
    assert job.look()


def test_work_waits_for_work_that_it_replaces():
    going, free, got = threading.Event(), threading.Event(), []

    def reading(say):
        going.set()
        free.wait(5)
        got.append("old")
        say(1)

    old = ClipJob("old", reading, pytest.fail)
    assert going.wait(5)
    old.stop()
    new = ClipJob("new", lambda say: got.append("new"), lambda result: got.append("told"), old)
    assert not new.is_over(0.05) and not got
    free.set()
    assert waited(new) and got == ["old", "new", "told"]


def test_who_has_sketched_birds_is_told_how_to_lift_them(tmp_path):
    book = Book(Sky(), tmp_path)
    (tmp_path / "sky.sketch.csv").write_text("frame,id,x,y\n")
    assert book.lift_lines() == []  # nobody has described a camera yet
    (tmp_path / "sky.camera.toml").write_text("")
    (tmp_path / "mine.toml").write_text("")
    (said,) = book.lift_lines()
    assert said.startswith("flockbrush lift") and "sky.sketch.csv" in said and "sky.camera.toml" in said
    assert "mine.toml" in book.lift_lines(tmp_path / "mine.toml")[0]
    (tmp_path / "sky.tracks.csv").write_text("frame,id,x,y\n")
    assert [line.split("--out ")[1] for line in book.lift_lines()] == [
        str(tmp_path / name) for name in ("sky.flock.csv", "sky.sketch-flock.csv")
    ]

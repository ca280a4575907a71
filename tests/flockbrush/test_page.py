"""The page of a run, opened in a real browser without a network; and what notebooks show."""

import io
import shutil
import sys
import time
from dataclasses import replace

import cv2
import numpy as np
import pytest
from browser import Browser, chromium
from flockbrush.components import Heading, Position
from flockbrush.engine.recording import open_recording, state_hash

from flockbrush.output.page.coarse import coarse_triangles
from flockbrush.output.page.page_writer import PageWriter
from flockbrush.output.pictures import herd_of
from flockbrush.render.animal_looks import LOOKS, mesh_of
from flockbrush.runs.run import rebuild, start
from flockbrush.runs.snapshots import moment_of

tools = [
    pytest.mark.tools,
    pytest.mark.skipif(chromium() is None, reason="chromium is not installed (apt-get install chromium)"),
]
LIMIT = 15e6  # bytes for 300 animals and 30 s


@pytest.fixture(scope="module")
def page(shared, recording, command):
    path = shared / "pen.html"
    command("export", recording, "--to", path)
    return path


@pytest.fixture(scope="module")
def shown(page):
    """The page in a browser, loaded."""
    with Browser() as browser:
        load(browser, page)
        yield browser


def load(browser, page):
    """Open a page and wait until it is ready."""
    browser.open(page)
    until = time.monotonic() + 60
    while browser.evaluate("typeof window.flockbrush") != "object" and time.monotonic() < until:
        time.sleep(0.1)
    browser.evaluate("window.flockbrush.then(() => 0)")


def asked(browser, expression):
    return browser.evaluate(f"window.flockbrush.then(async (p) => {expression})")


def drawn(browser):
    """Wait for the next picture."""
    asked(
        browser,
        "{ const n = p.frames; p.dirty = true; while (p.frames === n) await new Promise(requestAnimationFrame); }",
    )


def test_a_page_loads_nothing_from_elsewhere(page):
    import re

    text = page.read_text(encoding="utf-8")
    visible = re.sub(r'<script type="application/octet-stream".*?</script>', "", text, flags=re.S)
    assert re.findall(r"(?:src|href)=\"(?!data:)", visible) == []
    assert "MIT License" in text or "The MIT License" in text


class TestInABrowser:
    pytestmark = tools

    def test_frames_are_drawn_and_show_the_herd(self, shown, tmp_path):
        asked(shown, "p.seek(0)")
        drawn(shown)
        assert asked(shown, "[p.frames > 0, p.run.count, p.run.times.length]") == [True, 24, 21]
        shown.picture(tmp_path / "a.png")
        with_herd = cv2.imread(str(tmp_path / "a.png")).astype(int)
        asked(
            shown,
            "{ for (const look of Object.values(p.animals.looks)) look.meshes.forEach((m) => m.layers.disableAll()); }",
        )
        drawn(shown)
        shown.picture(tmp_path / "b.png")
        without = cv2.imread(str(tmp_path / "b.png")).astype(int)
        asked(
            shown,
            "{ for (const look of Object.values(p.animals.looks)) look.meshes.forEach((m) => m.layers.enable(0)); }",
        )
        assert (np.abs(with_herd - without).max(axis=2) > 40).sum() > 500  # pixels
        assert with_herd[150:550].std() > 10  # there is a ground to see

    def test_positions_and_headings_are_those_of_the_simulation(self, shown, recording):
        run = open_recording(recording)
        simulation = rebuild(run)
        simulation.run(40)
        asked(shown, "{ p.seek(1.25); p.run.at(1.25); }")
        told = asked(shown, "['ids', 'x', 'y', 'z', 'yaw'].map((n) => [...p.run[n].subarray(0, p.run.count)])")
        assert told[0] == simulation.agents.ids.tolist()
        assert np.allclose(np.transpose(told[1:4]), simulation.agents[Position.xyz], atol=1e-3)
        forward = simulation.agents[Heading.forward]
        assert np.allclose(np.exp(1j * np.array(told[4])), forward[:, 0] + 1j * forward[:, 1], atol=1e-3)

    def test_scrubbing_moves_the_animals(self, shown, tmp_path):
        pictures = []
        for share in (0.0, 1.0):
            shown.evaluate(f"{{ const s = document.getElementById('scrub'); s.value = {share}; s.oninput(); }}")
            drawn(shown)
            shown.picture(tmp_path / "a.png")
            pictures.append(cv2.imread(str(tmp_path / "a.png")).astype(int)[100:560])
        assert (np.abs(pictures[0] - pictures[1]).max(axis=2) > 40).sum() > 500

    def test_it_plays_on_its_own(self, shown):
        asked(shown, "{ p.seek(0); p.play(true); }")
        until = time.monotonic() + 30
        while asked(shown, "p.playing") and time.monotonic() < until:
            time.sleep(0.2)
        assert asked(shown, "[p.playing, p.time]") == [False, 1.25]

    def test_a_click_on_an_animal_shows_its_card(self, shown):
        asked(shown, "{ p.view('plan'); p.seek(0.5); }")
        drawn(shown)
        x, y, animal = asked(
            shown,
            """{ const v = new THREE.Vector3(p.run.x[3], p.run.y[3], 0.4 * p.run.length[3]).project(p.camera);
               return [(v.x + 1) / 2 * innerWidth, (1 - v.y) / 2 * innerHeight, p.run.ids[3]]; }""",
        )
        shown.click(x, y)
        drawn(shown)
        card = shown.evaluate("document.getElementById('card').innerText")
        assert f"animal {asked(shown, 'p.animals.selected')}" in card
        assert asked(shown, "p.animals.selected") == animal
        for word in ("species", "sheep", "brush", "swarm", "speed", "m/s"):
            assert word in card
        asked(shown, "p.select(null)")
        drawn(shown)
        assert shown.evaluate("document.getElementById('card').hidden")

    def test_dragging_orbits_and_the_plan_looks_straight_down(self, shown):
        asked(shown, "p.view('orbit')")
        for button in ("left", "middle"):  # the middle one as in the playground
            before = asked(shown, "[p.camera.position.toArray(), p.orbit.target.toArray()]")
            shown.drag((250, 150), (350, 160), button)
            drawn(shown)
            after = asked(shown, "[p.camera.position.toArray(), p.orbit.target.toArray()]")
            away = [np.linalg.norm(np.subtract(*pair)) for pair in (before, after)]
            assert not np.allclose(before[0], after[0]) and np.allclose(before[1], after[1])
            assert np.isclose(*away, rtol=1e-6)  # as far away as before: it does not zoom
        asked(shown, "p.view('plan')")
        drawn(shown)
        way = asked(shown, "p.camera.getWorldDirection(new THREE.Vector3()).toArray()")
        assert way[2] < -0.999

    def test_small_animals_have_fewer_triangles(self, shown):
        counts = "Object.entries(p.animals.looks).map(([name, look]) => [name, look.geometry.instanceCount])"
        found = []
        for share in (0.02, 20):  # of the way from the herd to the camera
            way = f"p.camera.position.sub(p.orbit.target).multiplyScalar({share}).add(p.orbit.target)"
            asked(shown, f"{{ p.view('orbit'); p.orbit.target.copy(p.animals.middle()); {way}; p.orbit.update(); }}")
            drawn(shown)
            told = dict(asked(shown, counts))
            found.append((told["beast"] > 0, told["beast"] + told["beast coarse"]))
        assert found == [(True, 24), (False, 24)]

    def test_the_page_says_where_it_comes_from(self, shown, recording):
        import hashlib

        about = shown.evaluate("document.getElementById('about').textContent")
        run = open_recording(recording)
        for word in (
            f"{run.header['seed']}",
            run.hashes[40],
            hashlib.sha256(recording.read_bytes()).hexdigest(),
            "numba",
        ):
            assert word in about
        assert "swarm" in shown.evaluate("document.getElementById('legend').textContent")

    def test_where_an_animal_is_last_it_is_as_fast_as_it_came(self, shown):
        told = """{ const c = p.run.chunks[0], last = p.run.times.length - 1, columns = ["x", "y", "z"];
            const at = (k) => p.run.place(c, k, [0, 0, 0]), row = 2, k = row * c.frames;
            const way = (f) => Math.hypot(...at(k + f).map((part, n) => part - at(k + f - 1)[n])) * 16;
            const now = () => p.run.ids.subarray(0, p.run.count).indexOf(c.ids[row]);
            const pace = (time) => { p.run.at(time); return p.run.pace[now()]; };
            const found = [[pace(p.run.duration), way(last)]];
            c.columns.present.fill(0, k + 11, k + last + 1);  // it leaves after the frame 10
            found.push([pace(10 / 16), way(10)], [pace(9.5 / 16), way(10)]);
            c.columns.present.fill(1, k + 11, k + last + 1);
            return found; }"""
        for pace, expected in asked(shown, told):
            assert pace == pytest.approx(expected, rel=1e-4) and pace > 0.3

    def test_the_headline_counts_everybody_who_was_there_at_any_time(self, shown):
        assert shown.evaluate("document.getElementById('summary').textContent").startswith("24 animals")
        chunks = "[[1, 2], [2, 3, 4]].map((ids) => ({ frames: 1, animals: ids.length, ids }))"
        assert asked(shown, f"(({{ everybody, most }}) => [everybody, most])(new Run({chunks}, p.about))") == [4, 3]

    def test_only_marked_leaders_look_and_are_counted_so_and_the_card_tells_who_leads(self, shown):
        told, columns = [], "const { leader, marked } = p.run.chunks[0].columns;"
        for lead, mark in ((1, 0), (1, 1)):
            fill = f"leader.fill({lead}); marked.fill({mark}); p.select(2);"
            asked(shown, f"{{ {columns} [p.led, p.bore] = [[...leader], [...marked]]; {fill} }}")
            drawn(shown)
            words = [shown.evaluate(f"document.getElementById('{box}').innerText") for box in ("legend", "card")]
            heads = "Object.values(p.animals.looks).some((l) => l.geometry.instanceCount && l.paint.array[3])"
            told.append(["leaders" in words[0], "leader" in words[1], asked(shown, heads)])
            asked(shown, f"{{ {columns} leader.set(p.led); marked.set(p.bore); p.select(null); }}")
        assert told == [[False, True, False], [True, True, True]]

    @pytest.mark.parametrize("size", [(400, 700), (1400, 800)])
    def test_a_card_breaks_no_value_and_leaves_the_scene_free(self, shown, size):
        def resize(width, height):
            screen = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
            shown.ask("Emulation.setDeviceMetricsOverride", **screen)

        resize(*size)
        asked(shown, "p.select(3)")
        drawn(shown)
        sizes = "(d) => [d.clientHeight, d.scrollWidth - d.clientWidth]"
        for height, beyond in shown.evaluate(f"[...document.querySelectorAll('#card dd')].map({sizes})"):
            assert height < 30 and beyond <= 0
        box = shown.evaluate("Object.values(document.getElementById('card').getBoundingClientRect().toJSON())")
        left, top, width, height = box[:4]
        assert left + width < size[0] / 4 or top > size[1] / 2  # at the side, or in the lower half
        assert top + height <= asked(shown, "p.free()")
        asked(shown, "p.select(null)")
        resize(*shown.size)
        drawn(shown)

    def test_nothing_is_complained_of(self, shown):
        assert shown.complaints == []


@tools[0]
@tools[1]
def test_an_animal_grows_where_an_edit_says_so_and_its_size_is_that_of_each_frame(cli, recording, tmp_path):
    run = tmp_path / "pen.flock"
    shutil.copy(recording, run)
    cli("edit", run, "--ids", "2", "--look", "size=3", "--from", "0.5", "--until", "1")
    assert cli("export", run, "--to", tmp_path / "a.html").code == 0
    with Browser() as browser:
        load(browser, tmp_path / "a.html")
        sizes = {}
        for time_s in (0.0, 0.4375, 0.5, 0.9375, 1.0, 1.25):
            asked(browser, f"p.run.at({time_s})")
            told = asked(browser, "['ids', 'length', 'width'].map((n) => [...p.run[n].subarray(0, p.run.count)])")
            sizes[time_s] = dict(zip(told[0], zip(*told[1:], strict=True), strict=True))
        assert browser.complaints == []
    first = sizes[0.0]
    for time_s, now in sizes.items():
        times = {animal: 3 if animal == 2 and 0.5 <= time_s < 1 else 1 for animal in now}
        assert all(np.allclose(now[a], np.multiply(first[a], times[a]), rtol=1e-6) for a in now), time_s


def test_a_page_marks_the_leaders_that_pictures_mark(lived):
    moment, writer = moment_of(lived), PageWriter(io.BytesIO(), lived, 16, {})
    few, all_ = np.arange(len(moment)) < 3, np.ones(len(moment), bool)
    for leader, marked in ((few, few), (all_, ~all_)):
        now = replace(moment, leader=leader)
        writer.take(now)
        columns = writer.rows[-1].columns
        assert columns["leader"].tolist() == leader.tolist() and columns["marked"].tolist() == marked.tolist()
        assert herd_of(lived, now).leader.tolist() == marked.tolist()


def covered(mesh, triangles, axes):
    """Which pixels of a picture of 64 pixels a body length the triangles cover."""
    picture = np.zeros((160, 160), np.uint8)
    at = np.round(80 + 64 * mesh.points[:, axes]).astype(np.int32)
    for triangle in triangles:
        cv2.fillConvexPoly(picture, at[triangle], 1)
    return picture.astype(bool)


@pytest.mark.parametrize("look", list(LOOKS))
def test_coarse_bodies_have_all_limbs_and_the_outline_of_the_fine_ones(look):
    mesh = mesh_of(look)
    coarse = coarse_triangles(mesh)
    assert len(coarse) < 0.55 * len(mesh.triangles)
    assert set(mesh.part[coarse[:, 0]]) == set(mesh.part[mesh.triangles[:, 0]])
    for axes in ([0, 1], [0, 2]):  # from above, from the side
        fine, few = covered(mesh, mesh.triangles, axes), covered(mesh, coarse, axes)
        assert (fine & few).sum() > 0.6 * (fine | few).sum(), axes


def test_feet_stay_where_they_stand():
    from flockbrush.render.animal_looks import LOOKS, mesh_of, posed

    for look in LOOKS:
        mesh = mesh_of(look)
        for clip, stride in mesh.strides.items():
            for part in (p for p in mesh.parts if p.kind == "leg"):
                sole = np.flatnonzero(mesh.part == mesh.parts.index(part))
                sole = sole[mesh.points[sole, 2] < mesh.points[sole, 2].min() + 1e-9]
                phases = (stride.offsets[part.number] + stride.duty * np.linspace(0.02, 0.98, 12)) % 1.0
                way = stride.length * stride.duty * np.linspace(0.02, 0.98, 12)  # that the body has gone
                feet = np.array([posed(mesh, clip, phase)[sole].mean(axis=0) for phase in phases])
                assert np.ptp(feet[:, 0] + way) < 0.05 * stride.length
                assert np.ptp(feet[:, 2]) < 1e-9  # on the ground


def test_a_simulation_in_a_notebook_shows_itself_and_stays_as_it_is(level):
    from flockbrush.output import notebook

    simulation = start(level)
    before = state_hash(simulation.world)
    shown = simulation._repr_html_()
    assert shown.startswith("<iframe") and "srcdoc=" in shown and "allow-scripts" in shown
    assert state_hash(simulation.world) == before
    assert notebook.MOST > 0


def test_a_recording_in_a_notebook_is_a_page_or_a_picture_where_it_is_large(recording, monkeypatch):
    from flockbrush.output import notebook

    run = open_recording(recording)
    assert run._repr_html_().startswith("<iframe")
    monkeypatch.setattr(notebook, "MOST", 10)
    shown = run._repr_html_()
    assert shown.startswith("<img") and "flockbrush export" in shown


def test_notebooks_get_their_pictures_when_flockbrush_is_used(monkeypatch):
    import flockbrush

    monkeypatch.setitem(sys.modules, "IPython", sys)
    monkeypatch.delitem(sys.modules, "flockbrush.output.notebook", raising=False)
    assert callable(flockbrush.start)
    assert "flockbrush.output.notebook" in sys.modules


def test_three_hundred_animals_and_thirty_seconds_fit_in_fifteen_megabytes(cli, tmp_path):
    """A page grows evenly with its length, so it is enough to make two short ones."""
    sizes = []
    for seconds in (2, 6):
        path = tmp_path / f"{seconds}.html"
        assert cli("run", "sheep-pasture", "--seconds", seconds, "--export", path).code == 0
        sizes.append(path.stat().st_size)
    assert sizes[0] < sizes[1] and sizes[1] + (sizes[1] - sizes[0]) / 4 * 24 < LIMIT

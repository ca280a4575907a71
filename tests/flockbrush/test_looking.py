"""Commands to look at things: levels, brushes, measures, the doctor, the clockmaker."""

import json
import math
import re
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import cv2
import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.engine import commands, plugins
from flockbrush.engine.recording import open_recording
from pens import pen

from flockbrush.cli import doctor
from flockbrush.cli.doctor import pinned_versions
from flockbrush.cli.measure import Counts, sparkline
from flockbrush.output import preview
from flockbrush.runs.run import rebuild, shipped_levels

BRUSHES = Path(shipped().path("march")).parent


# levels --------------------------------------------------------------------------------


def test_all_shipped_levels_are_in_order(cli):
    done = cli("level", "check", *shipped_levels())
    assert (done.code, done.err) == (0, "")
    assert len(done.out.splitlines()) == len(shipped_levels()) >= 6


def test_what_is_wrong_with_levels_is_told_with_file_and_line(cli, tmp_path):
    good, bad = pen(tmp_path), pen(tmp_path, "bad")
    bad.write_text(bad.read_text().replace('"march"', '"marhc"'))
    done = cli("level", "check", good, bad, "nowhere.tmj")
    assert done.code == 1
    ok, wrong, missing = done.out.splitlines()
    assert ok == f"{good}: ok: 40 x 30 m, 24 animals"
    assert re.match(rf"{re.escape(str(bad))}:\d+: object 3 'flock' in layer 'spawns': brush: ", wrong)
    assert "did you mean 'march'?" in wrong
    assert missing == "nowhere.tmj: there is no such file"


def test_animals_that_do_not_fit_into_their_spawn_are_found_by_the_check(cli, tmp_path):
    done = cli("level", "check", pen(tmp_path, sheep=4000))
    assert done.code == 1
    assert "object 3 'flock' in layer 'spawns'" in done.out
    assert "fit" in done.out


def test_a_level_is_drawn_with_its_animals_where_they_start_or_where_they_went(cli, level, tmp_path):
    pictures = []
    for name, words in {"a.png": [], "b.png": ["--seconds", 1], "c.png": ["--theme", "dark"]}.items():
        assert cli("level", "render", level, "-o", tmp_path / name, *words).out == f"wrote {tmp_path / name}\n"
        pictures.append(cv2.imread(str(tmp_path / name)).astype(int))
    begin, later, dark = pictures
    assert begin.shape == later.shape == dark.shape
    assert np.abs(begin - later).max() > 60
    assert dark.mean() < begin.mean() - 80


def test_a_new_folder_for_levels_has_a_project_and_a_level_that_runs(cli, tmp_path):
    done = cli("level", "init", tmp_path / "designs")
    assert done.code == 0
    assert "F5 plays" in done.out
    assert (tmp_path / "designs" / "flockbrush.tiled-project").is_file()
    assert cli("level", "check", tmp_path / "designs" / "first.tmj").code == 0


def test_the_command_that_tiled_runs_is_one_we_know(cli, tmp_path, monkeypatch):
    """F5 and F6 as the project has them, with Tiled's %mapfile filled in."""
    import shlex

    cli("level", "init", tmp_path)
    project = json.loads((tmp_path / "flockbrush.tiled-project").read_text())
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    ran = []
    for command in project["commands"]:
        assert command["command"] == "flockbrush"
        words = [w.replace("%mapfile", str(tmp_path / "first.tmj")) for w in shlex.split(command["arguments"])]
        assert cli(*words, *(["--frames", "3"] if words[0] == "play" else [])).code == 0, words
        ran.append(words[0])
    assert ran == ["play", "level"]


def test_a_file_where_the_folder_should_be_is_left_alone(cli, tmp_path):
    (tmp_path / "designs").write_text("mine")
    done = cli("level", "init", tmp_path / "designs")
    assert (done.code, (tmp_path / "designs").read_text()) == (1, "mine")
    assert "this is a file; give a folder" in done.err


def test_the_list_of_levels_has_them_all(cli):
    out = cli("level", "list").out
    assert all(name in out for name in shipped_levels())


# brushes ---------------------------------------------------------------------------------


def test_the_list_of_brushes_has_them_all(cli):
    names = shipped().names()
    assert all(f" {name} " in cli("brush", "list").out for name in names)
    assert [entry["name"] for entry in json.loads(cli("brush", "list", "--json").out)] == names


def test_a_brush_shows_every_number_with_its_unit_and_where_it_is_from(cli):
    brush, out = shipped().get("march"), cli("brush", "show", "march").out
    for name in (*brush.parameters, "mean", "length", "field_of_view", "BL/s", "body lengths", brush.sha256):
        assert name in out
    assert brush.provenance.source in " ".join(out.split())
    assert json.loads(cli("brush", "show", "march", "--json").out)["params"] == pytest.approx(brush.parameters)


def test_a_learned_brush_shows_each_figure_of_its_report_on_a_line_of_its_own(cli):
    figures = shipped().get("sheep-drone").provenance.report
    lines = [line.strip() for line in cli("brush", "show", "sheep-drone").out.splitlines()]
    for figure in figures:
        assert sum(re.fullmatch(rf"{re.escape(figure)} +[-\d.e,]+", line) is not None for line in lines) == 1


def test_all_shipped_brushes_are_in_order(cli):
    done = cli("brush", "check", *sorted(BRUSHES.glob("*.toml")), "march")
    assert done.code == 0 and "graze--march.path.toml: ok: path from graze to march" in done.out


def test_what_is_wrong_with_a_path_between_brushes_is_told_with_file_and_line(cli, tmp_path):
    path = tmp_path / "graze--march.path.toml"
    path.write_text((BRUSHES / path.name).read_text().replace("along = [0,", "along = [0.01,"))
    done = cli("brush", "check", path, tmp_path / "none.path.toml")
    assert done.code == 1
    assert re.match(rf"{re.escape(str(path))}:\d+: .*'along' must rise from 0 to 1", done.out)
    assert f"{tmp_path / 'none.path.toml'}: there is no such file" in done.out


@pytest.mark.parametrize(
    ("detour", "said"),
    [
        ("wandr = [0, 0.1, 0]", "detour.wandr: model 'herd' has no parameter of this name; did you mean 'wander'?"),
        ("guided = [0, 1, 0]", "detour.guided: model 'herd' has no number of this name"),
        ("wander = [0, 99, 0]", "detour.wander[1]: makes wander 99 at step 1/2; it must be from 0 to 10"),
    ],
)
def test_what_a_path_adds_to_parameters_must_be_possible(cli, tmp_path, detour, said):
    path = tmp_path / "graze--march.path.toml"
    lines = (
        'schema = "flockbrush.path/1"',
        'start = "graze"',
        'end = "march"',
        *(f'{end}_sha256 = "{shipped().get(name).sha256}"' for end, name in (("start", "graze"), ("end", "march"))),
        "along = [0, 0.5, 1]",
        "[detour]",
        detour,
    )
    path.write_text("\n".join(lines))
    done = cli("brush", "check", path)
    assert done.code == 1 and done.out.startswith(f"{path}:8: {said}")
    path.write_text(path.read_text().replace("graze", "mine"))
    done = cli("brush", "check", path.rename(tmp_path / "mine--march.path.toml"))
    assert done.code == 0 and "there is no brush 'mine', so [detour] was not checked" in done.out
    (tmp_path / "mine.brush.toml").write_bytes((BRUSHES / "graze.brush.toml").read_bytes())
    assert said in cli("brush", "check", tmp_path / "mine--march.path.toml").out


def test_what_a_path_adds_is_cut_where_a_brush_may_have_been_changed_since(cli, tmp_path):
    path = tmp_path / "graze--march.path.toml"
    path.write_text('schema = "flockbrush.path/1"\nstart = "graze"\nend = "march"\nalong = [0, 0.5, 1]\n')
    with path.open("a") as file:
        file.write("[detour]\nwander = [0, 99, 0]\n")
    assert cli("brush", "check", path).code == 0


def test_what_is_wrong_with_brushes_is_told_with_file_and_line(cli, tmp_path):
    text = (BRUSHES / "march.brush.toml").read_text().replace("alignment_weight", "aligment_weight")
    path = tmp_path / "odd.brush.toml"
    path.write_text(text)
    line = next(k for k, words in enumerate(text.splitlines(), 1) if "aligment" in words)
    done = cli("brush", "check", path, tmp_path / "none.brush.toml")
    assert done.code == 1
    assert done.out.startswith(f"{path}:{line}: ")
    assert "did you mean 'alignment_weight'?" in done.out
    assert f"{tmp_path / 'none.brush.toml'}: there is no such file" in done.out


def test_a_preview_shows_the_herd_at_three_moments(cli, tmp_path):
    path = tmp_path / "march.png"
    done = cli("brush", "preview", "march", "-o", path, "--agents", 12, "--seconds", 1, "--start", "grid")
    assert done.code == 0
    picture = cv2.imread(str(path)).astype(int)
    assert picture.shape[1] > 2 * picture.shape[0]
    first, last = picture[80:600, 30:570], picture[80:600, -570:-30]
    assert np.abs(first - last).max() > 60


def test_a_preview_shows_the_body_of_the_species_beside_the_brush(cli, tmp_path, monkeypatch):
    for folder in ("brushes", "species"):
        (tmp_path / folder).mkdir()
    sheep = (BRUSHES.parent / "fauna" / "sheep.species.toml").read_text()
    (tmp_path / "species" / "yak.species.toml").write_text(sheep.replace("length = 1.2", "length = 3.0"))
    file = tmp_path / "brushes" / "trek.brush.toml"
    file.write_text((BRUSHES / "graze.brush.toml").read_text().replace('["herd", "grazer"]', '["yak"]'))
    previewed = []
    monkeypatch.setattr(preview, "preview", lambda brush, *options: previewed.append(brush))
    for name in (file, "march"):
        assert cli("brush", "preview", name, "-o", tmp_path / "a.png").code == 0
    assert [brush.body.length for brush in previewed] == [3.0, shipped().get("march").body.length]


# measures ------------------------------------------------------------------------------------


def test_measures_are_told_over_time(cli, recording):
    report = json.loads(cli("measure", recording, "--every", 0.25, "--json").out)
    assert report["series"]["time"] == [0, 0.25, 0.5, 0.75, 1.0, 1.25]
    assert len(report["series"]["polarization"]) == 6
    assert report["measures"]["polarization"] == report["series"]["polarization"][-1]
    assert report["mean"]["animals"] == 24
    assert "polarization" in cli("measure", recording).out


def test_who_passes_the_gate_is_counted(recording):
    run = open_recording(recording)
    simulation = rebuild(run)
    counts = Counts(simulation)
    west = counts.values()["in west"]
    from flockbrush.components import Position

    was = simulation.agents[Position.xyz][:, 0] < 12
    for _ in range(40):
        simulation.tick()
        counts.take()
    now, values = simulation.agents[Position.xyz][:, 0] < 12, counts.values()
    gate = [values[f"crossed gate to its {side}"] for side in ("left", "right")]
    assert gate[1] - gate[0] == was.sum() - now.sum() > 0  # the line goes north: east is to its right
    assert west == 24


def test_a_plot_has_a_line_in_every_panel(cli, recording, tmp_path):
    done = cli("measure", recording, "--every", 0.1, "--plot", tmp_path / "a.png")
    assert f"wrote {tmp_path / 'a.png'}" in done.out
    picture = cv2.imread(str(tmp_path / "a.png")).astype(int)
    colourful = np.ptp(picture, axis=2) > 60
    rows = np.array_split(colourful[64:], 3)
    assert all(half.sum() > 200 for row in rows for half in np.array_split(row, 2, axis=1))


def test_a_tiny_plot_goes_from_low_to_high_and_leaves_out_what_has_no_meaning():
    assert sparkline([0, 1, math.nan, 7]) == "▁▂ █"
    assert sparkline([3, 3]) == "▁▁"
    assert sparkline([math.nan]) == ""
    assert len(sparkline(range(1000))) == 24


# the rest --------------------------------------------------------------------------------------


def test_the_demo_leaves_a_video_and_tells_what_it_measured(cli, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = cli("demo", "--seconds", 0.25, "--record", "demo.flock")
    assert done.code == 0
    assert "polarization" in done.out
    assert (tmp_path / "demo.mp4").stat().st_size > 10_000
    assert cli("replay", "demo.flock", "--verify").code == 0


def test_the_doctor_finds_everything_in_its_place(cli):
    done = cli("doctor")
    assert done.code == 0, done.out
    assert "compile cache" in done.out
    findings = json.loads(cli("doctor", "--json").out)
    assert {"python", "numba", "threads", "display", "tiled", "shipped files"} <= {f["what"] for f in findings}
    assert not [f for f in findings if f["state"] == "problem"]


def test_the_doctor_names_what_is_missing(cli, monkeypatch):
    from importlib import metadata

    def without_av(name, real=metadata.version):
        if name in ("av", "pyarrow"):
            raise metadata.PackageNotFoundError(name)
        return real(name)

    monkeypatch.setattr(metadata, "version", without_av)
    monkeypatch.setattr("shutil.which", lambda name: None)
    done = cli("doctor")
    assert done.code == 1
    assert "problem  av" in done.out
    assert "warn  pyarrow" in done.out
    assert "warn  tiled" in done.out


def test_the_doctor_tells_a_broken_package_once_and_by_its_name(cli, monkeypatch):
    broken = EntryPoints([EntryPoint("cmd", "no_such_module", "flockbrush.commands")])
    monkeypatch.setattr(plugins, "entry_points", lambda **given: broken.select(**given) if given else broken)
    monkeypatch.setattr(commands, "_load_commands_of_others", lambda: plugins.load_entry_points("flockbrush.commands"))
    findings = json.loads(cli("doctor", "--json").out)
    (broken,) = [f for f in findings if f["state"] == "problem"]
    assert broken["what"] == "packages"
    assert broken["found"].startswith("an installed package: entry point cmd = no_such_module in group flockbrush.comm")


@pytest.mark.parametrize(("version", "state"), [("1.8.2", "warn"), ("1.10.0", "ok"), ("1.11.2", "ok"), ("2", "ok")])
def test_the_doctor_names_a_tiled_that_is_too_old(version, state, cli, monkeypatch):
    monkeypatch.setattr(doctor, "_first_line", lambda command: f"Tiled {version}")
    monkeypatch.setattr("shutil.which", lambda name: f"/bin/{name}")
    (tiled,) = (f for f in json.loads(cli("doctor", "--json").out) if f["what"] == "tiled")
    assert tiled["state"] == state and (state == "ok") == ("needs 1.10 or newer" not in str(tiled))


def test_versions_that_were_tested_are_read_from_the_constraints():
    assert pinned_versions("# x==1\npygame_gui==0.6.14\nnumpy==2.4.6\n") == {"pygame-gui": "0.6.14", "numpy": "2.4.6"}


def test_the_constraints_pin_everything_that_is_needed():
    from flockbrush.cli.doctor import HOUSE, OPTIONAL, _requirements

    pins = pinned_versions((HOUSE / "constraints.txt").read_text())
    assert set(_requirements()) | set(OPTIONAL) <= set(pins)


def test_the_bench_tells_milliseconds_and_systems(cli):
    report = json.loads(cli("bench", "--agents", 60, "--agents", 120, "--ticks", 3, "--threads", 1, "--json").out)
    assert [(r["agents"], r["threads"], r["ticks"]) for r in report["results"]] == [(60, 1, 3), (120, 1, 3)]
    assert all(0 < r["median"] <= r["p95"] for r in report["results"])
    assert "See" in report["results"][0]["systems"]
    assert "µs per animal" in cli("bench", "--agents", 60, "--ticks", 2, "--threads", 1).out


def test_the_scene_of_the_bench_is_the_one_that_was_promised():
    from flockbrush.components import Position, Vision

    from flockbrush.cli.bench import scene

    simulation = scene(900)
    xy = simulation.agents[Position.xyz][:, :2]
    assert len(xy) / np.prod(np.ptp(xy, axis=0)) == pytest.approx(0.25, rel=0.05)
    assert set(simulation.agents[Vision.range].tolist()) == {10.0}


def test_the_library_names_what_a_user_needs():
    import flockbrush

    for name in flockbrush.__all__:
        assert getattr(flockbrush, name)
    with pytest.raises(AttributeError, match="flockbrush has no 'biuld'; it has"):
        flockbrush.biuld  # noqa: B018

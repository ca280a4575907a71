"""The commands of formations, as people type them."""

import csv
import json

import cv2
import numpy as np
import pytest
from example_formations import places
from flockbrush.behaviours.brush import load_brush
from flockbrush.behaviours.models.line_formation import places as places_of

from flockbrush.cli.main import called
from flockbrush.lifting.flight_table import read_flight
from flockbrush.render.canvas import Canvas
from flockbrush.runs.power_savings import savings


@pytest.fixture
def marks(tmp_path):
    """Two frames of fourteen marked birds with one out of line, in wingspans."""
    path = tmp_path / "marks.csv"
    with path.open("w", newline="") as file:
        out = csv.writer(file)
        out.writerow(["frame", "bird", "x_b", "y_b"])
        for frame in range(2):
            x, y, *_ = places("V", 14, frame=frame, outliers=1)
            out.writerows([frame, k, a, b] for k, (a, b) in enumerate(zip(x, y, strict=True)))
    return path


def test_from_marks_to_a_formation_to_a_flight(marks, tmp_path, capsys):
    formation, picture = tmp_path / "v.json", tmp_path / "v.png"
    assert called(["formation", "extract", str(marks), "--out", str(formation), "--plot", str(picture), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["kinds"] == {"V": 2}
    assert len(said["frames"][0]["outliers"]) == 1
    assert cv2.imread(str(picture)).shape[2] == 3
    table = tmp_path / "flight.csv"
    assert (
        called(["formation", "fly", str(formation), "--birds", "20", "--frames", "40", "-o", str(table), "--json"]) == 0
    )
    said = json.loads(capsys.readouterr().out)
    assert said["birds"] == 20
    assert said["outside"] < 0.01
    assert len(table.read_text().splitlines()) == 1 + 20 * 40
    assert called(["formation", "extract", str(table), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["kinds"] == {"V": 40}
    flight = read_flight(table)  # what `play` opens
    assert flight.xyz.shape == (40, 20, 3)
    assert np.allclose(flight.xyz[-1, :, 1].max() - flight.xyz[0, :, 1].max(), 16.0 * 39 / 25)


@pytest.fixture
def flight(marks, tmp_path):
    """The table that `formation fly` writes: fourteen birds in twenty frames."""
    formation, table = tmp_path / "v.json", tmp_path / "flight.csv"
    assert called(["formation", "extract", str(marks), "--out", str(formation)]) == 0
    assert called(["formation", "fly", str(formation), "--birds", "14", "--frames", "20", "-o", str(table)]) == 0
    return table


def test_a_flight_is_measured_in_metres(flight, capsys):
    about = json.loads(flight.with_name("flight.csv.json").read_text())
    assert (about["unit"], about["fps"]) == ("m", 25.0)
    capsys.readouterr()
    assert called(["measure", str(flight), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["unit"] == "m" and told["measures"]["speed_mean"] == pytest.approx(16.0, abs=0.5)


def test_a_flight_is_exported_as_tables(flight, tmp_path, capsys):
    parquet = pytest.importorskip("pyarrow.parquet")
    paths = [tmp_path / "out.csv", tmp_path / "out.parquet"]
    capsys.readouterr()
    assert called(["export", str(flight), *(word for path in paths for word in ("--to", str(path))), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["frames"] == 20
    flown = [list(csv.DictReader(path.read_text().splitlines())) for path in (flight, paths[0])]
    tables = [{name: [float(row[name]) for row in rows] for name in ("time", "id", "x", "y", "z")} for rows in flown]
    exact = parquet.read_table(paths[1]).to_pydict()
    for name, values in tables[0].items():
        assert tables[1][name] == pytest.approx(values, abs=1e-6)
        assert exact[name] == pytest.approx(values, abs=1e-6)
    assert np.mean([float(row["vy"]) for row in flown[1]]) == pytest.approx(16.0, rel=0.01)
    assert np.mean(exact["heading"]) == pytest.approx(np.pi / 2, abs=0.01)


@pytest.mark.parametrize("ending", ["usda", "usdc"])
def test_a_flight_is_exported_as_a_scene(flight, tmp_path, ending):
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom

    path = tmp_path / f"out.{ending}"
    assert called(["export", str(flight), "--to", str(path)]) == 0
    stage = Usd.Stage.Open(str(path))
    assert (stage.GetEndTimeCode(), stage.GetTimeCodesPerSecond()) == (19, 25)
    herd = UsdGeom.PointInstancer(stage.GetPrimAtPath("/World/Herd"))
    rows = [row for row in csv.DictReader(flight.read_text().splitlines()) if row["frame"] == "7"]
    assert np.allclose(herd.GetPositionsAttr().Get(7), [[float(row[k]) for k in "xyz"] for row in rows], atol=1e-4)
    assert herd.GetScalesAttr().Get(7)[0][0] == pytest.approx(0.62 * 1.6, rel=0.01)  # of birds 1.6 m wide


@pytest.mark.parametrize("ending", ["glb", "html", "mp4"])
def test_what_a_flight_cannot_become_is_refused_before_anything_is_written(flight, tmp_path, ending, capsys):
    out = tmp_path / f"out.{ending}"
    capsys.readouterr()
    assert called(["export", str(flight), "--to", str(tmp_path / "out.csv"), "--to", str(out)]) == 1
    said = capsys.readouterr().err
    assert (
        said == f"{out}: the file extension of a flight must be one of .csv, .parquet, .usdc, .usda; got '.{ending}'\n"
    )
    assert not (tmp_path / "out.csv").exists() and not out.exists()
    collars = ["export", str(flight), "--to", str(tmp_path / "out.movebank.csv"), "--origin", "50,8"]
    assert called(collars) == 1 and "got '.movebank.csv'" in capsys.readouterr().err
    assert called(["export", str(flight), "--to", str(tmp_path / "out.csv"), "--fps", "10"]) == 1
    assert "applies to recordings" in capsys.readouterr().err
    walkers = tmp_path / "walkers.csv"
    walkers.write_text("frame,id,x,y,z\n0,1,0,0,0\n1,1,1,0,0\n")
    assert called(["export", str(walkers), "--to", str(tmp_path / "out.csv")]) == 1
    assert "this is not a recording" in capsys.readouterr().err


def test_a_formation_becomes_a_brush(marks, tmp_path):
    formation, made = tmp_path / "v.json", tmp_path / "mine.brush.toml"
    assert called(["formation", "extract", str(marks), "--out", str(formation)]) == 0
    assert called(["formation", "brush", str(formation), "-o", str(made), "--like", "cranes"]) == 0
    brush = load_brush(made)
    assert brush.params.shape == "V"
    assert brush.params.slope == pytest.approx(0.8, abs=0.15)
    assert brush.params.spacing == pytest.approx(1.25, abs=0.1)
    assert brush.provenance.kind == "learned"
    assert called(["formation", "brush", str(formation), "-o", str(made), "--like", str(made)]) == 1
    assert load_brush(made) == brush


def test_arms_of_unlike_slopes_stay_unlike(tmp_path):
    marked, formation, made = tmp_path / "marks.csv", tmp_path / "v.json", tmp_path / "mine.brush.toml"
    x = 1.25 * np.arange(-7, 8)
    y = np.where(x < 0, 0.40 * x, -1.31 * x)
    marked.write_text(
        "frame,bird,x_b,y_b\n" + "".join(f"0,{k},{a},{b}\n" for k, (a, b) in enumerate(zip(x, y, strict=True)))
    )
    assert called(["formation", "extract", str(marked), "--out", str(formation)]) == 0
    assert called(["formation", "brush", str(formation), "-o", str(made), "--like", "geese"]) == 0
    p = load_brush(made).params
    assert (p.slope, p.slope_right) == pytest.approx((0.40, 1.31), abs=0.01)
    x, y = places_of(p.model_copy(update={"deviation": 0.0}), 15, 1).at(0.0)
    assert y[0] / x[0] == pytest.approx(0.40, abs=0.01)
    assert y[-1] / x[-1] == pytest.approx(-1.31, abs=0.01)


def test_birds_are_found_and_marked(tmp_path, capsys):
    image = np.full((200, 300, 3), 220, np.uint8)
    for k in range(5):
        cv2.ellipse(image, (60 + 40 * k, 60 + 25 * abs(k - 2)), (8, 3), 0, 0, 360, (30, 30, 30), -1)
    cv2.imwrite(str(tmp_path / "sky.png"), image)
    out = tmp_path / "marks.csv"
    assert called(["formation", "detect", str(tmp_path / "sky.png"), "-o", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["birds"] == 5
    assert called(["formation", "extract", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["kinds"] == {"V": 1}


def test_the_table_of_initiation(tmp_path, capsys):
    out = tmp_path / "table.csv"
    assert (
        called(["formation", "initiate", "--shape", "V", "--birds", "9", "--runs", "2", "-o", str(out), "--json"]) == 0
    )
    cell = json.loads(capsys.readouterr().out)["cells"][0]
    assert (cell["runs"], cell["converged"]) == (2, 2)
    assert out.read_text().startswith("rules,shape,birds,runs,converged")


def test_a_film_of_geese_has_scale_and_units(tmp_path, monkeypatch):
    picture, written, words = tmp_path / "geese.png", [], Canvas.words
    monkeypatch.setattr(Canvas, "words", lambda self, text, *a, **k: written.append(text) or words(self, text, *a, **k))
    assert called(["formation", "film", "geese", "--seconds", "6", "-o", str(picture)]) == 0
    assert cv2.imread(str(picture)).shape == (680, 1120, 3)
    assert any(text.endswith("m; birds 1.5 times as large") for text in written)
    assert any("sum of g" in text for text in written) and {"0", "0.35"} <= set(written)


def test_a_film_takes_the_place_of_no_file_that_its_level_is_made_of(tmp_path, monkeypatch, capsys):
    from flockbrush.levels.build import Simulation

    picture = tmp_path / "hill.png"
    picture.write_bytes(b"heights")
    monkeypatch.setattr(Simulation, "inputs", lambda self, outputs=(): [picture])
    assert called(["formation", "film", "geese", "--seconds", "1", "-o", str(picture)]) == 1
    assert "hill.png: the level is made of this file; choose another name" in capsys.readouterr().err
    assert picture.read_bytes() == b"heights"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["extract", "nothing.csv"], "no such file"),
        (["fly", "nothing.json"], "no such file"),
        (["film", "geese", "-o", "geese.gif"], "the name must end in .mp4"),
        (["film", "meadow", "-o", "meadow.png"], "meadow: none of its animals fly"),
        (["detect", "nothing.png", "-o", "marks.csv"], "no such file"),
        (["detect", "a/1.png", "b/1.png", "-o", "marks.csv"], "a/1.png: another file has the same name"),
        (["detect", "nothing.png", "-o", "marks.png"], "marks.png: its name must end in .csv"),
        (["extract", "nothing.csv", "-o", "v.toml"], "v.toml: its name must end in .json"),
        (["extract", "nothing.csv", "--plot", "v.pdf"], "v.pdf: its name must end in .png"),
        (["fly", "nothing.json", "-o", "v.parquet"], "v.parquet: its name must end in .csv"),
        (["initiate", "-o", "v.parquet"], "v.parquet: its name must end in .csv"),
    ],
)
def test_what_cannot_be_done_is_said(words, said, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert called(["formation", *words]) == 1
    assert said in capsys.readouterr().err


def test_who_flies_beside_saves_and_who_is_alone_does_not():
    xyz, north = np.array([(0.0, 0.0, 0.0), (1.25, -1.0, 0.0), (40.0, 0.0, 0.0)]), np.tile([0.0, 1.0], (3, 1))
    saved = savings(xyz, north, np.ones(3))
    assert saved[1] > saved[0] > 100 * saved[2] > 0
    assert savings(xyz + [(0, 0, 0), (0, 0, 5), (0, 0, 0)], north, np.ones(3))[1] == 0  # far above
    assert np.array_equal(savings(2 * xyz, north, np.full(3, 2.0)), saved)


def test_what_birds_of_different_sizes_save_depends_only_on_where_they_are_to_one_another():
    xyz, wing = np.array([(0.0, 0.0, 0.0), (2.0, -1.6, 0.0), (4.0, -3.2, 0.0)]), np.array([1.5, 1.6, 1.7])
    north = np.tile([0.0, 1.0], (3, 1))
    saved = savings(xyz, north, wing)
    assert saved[2] > 0.1
    assert savings(xyz + (800.0, -3000.0, 50.0), north, wing) == pytest.approx(saved, rel=1e-9)


def test_what_flocks_on_different_ways_save_does_not_depend_on_the_origin():
    flock = np.array([(0.0, 0.0, 0.0), (2.0, -1.6, 0.0), (4.0, -3.2, 0.0)])
    turned = flock[:, [1, 0, 2]] * (1.0, -1.0, 1.0) + (700.0, 200.0, 0.0)  # flies east
    xyz, wing = np.concatenate([flock, turned]), np.full(6, 1.6)
    track = np.repeat([(0.0, 1.0), (1.0, 0.0)], 3, axis=0)
    saved = savings(xyz, track, wing)
    assert saved == pytest.approx(savings(xyz - (790.0, 81.0, 0.0), track, wing), rel=1e-6)
    assert saved[:3] == pytest.approx(savings(flock, track[:3], wing[:3]), abs=1e-3)

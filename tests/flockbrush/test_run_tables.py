"""Tables of runs: measured as the runs themselves, and told apart from flights."""

import importlib.util
import json

import numpy as np
import pytest
from flockbrush.components import Body
from flockbrush.engine.commands import Commands
from flockbrush.systems.animal_commands import RemoveAnimals

import flockbrush
from flockbrush.cli.main import called
from flockbrush.lifting.ground_show import GroundShow, is_flight, open_show
from flockbrush.output.export import Exports


@pytest.mark.parametrize(
    ("level", "seconds"), [("meadow", 4), ("savanna", 12), ("lake", 6), ("geese", 3), ("ridge", 4), ("merino", 8)]
)
def test_the_table_of_a_run_is_measured_as_its_recording(level, seconds, tmp_path, capsys):
    """Over time, by species, brush, group, family and state; a CSV has six decimals."""
    record, tables = tmp_path / "r.flock", [tmp_path / "r.csv"]
    tables += [tmp_path / "r.parquet"] if importlib.util.find_spec("pyarrow") else []
    exports = [word for table in tables for word in ("--export", str(table))]
    called(["run", level, "--seconds", str(seconds), "--record", str(record), *exports])
    told = []
    for file in (record, *tables):
        capsys.readouterr()
        assert called(["measure", str(file), "--every", "0.5", "--json"]) == 0
        told.append(json.loads(capsys.readouterr().out))
    for read in told[1:]:
        _assert_measured_alike(level, told[0], read)


def _assert_measured_alike(level, run, read):
    assert read["states"] == run["states"]
    for program, ways in run["transitions"].items():  # the table does not show that a state begins anew
        others = {state: {to: n for to, n in went.items() if to != state} for state, went in ways.items()}
        assert read["transitions"][program] == {state: went for state, went in others.items() if went}
    assert level != "savanna" or any(read["transitions"]["zebra"].values())
    for name in ("species", "brushes", "groups"):
        _assert_equal(read[name], run[name])
    for name in ("measures", "mean", "series"):  # lines that count and areas are in the level, not in the table
        assert "time" in read["series"]
        _assert_equal(read[name], {key: run[name][key] for key in read[name]})


def _assert_equal(one, other):
    """Parts of two reports, with the rounding of tables."""
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        for name in one:
            _assert_equal(one[name], other[name])
    elif isinstance(one, list):
        assert len(one) == len(other)
        for mine, its in zip(one, other, strict=True):
            _assert_equal(mine, its)
    else:
        assert one == (pytest.approx(other, rel=1e-4, abs=1e-6) if isinstance(other, float) else other)


def test_a_table_without_its_metadata_is_measured_as_tracks(tmp_path, capsys):
    record, table = tmp_path / "r.flock", tmp_path / "r.csv"
    called(["run", "meadow", "--seconds", "4", "--agents", "30", "--record", str(record), "--export", str(table)])
    beside = table.with_name("r.csv.json")
    about = json.loads(beside.read_text())
    capsys.readouterr()
    assert called(["measure", str(record), "--every", "1", "--json"]) == 0
    run = json.loads(capsys.readouterr().out)["mean"]
    for changed in ({**about, "flying": None}, {**about, "programs": 3}, None):
        beside.write_text(json.dumps(changed)) if changed else beside.unlink()
        more = [] if changed else ["--unit", "m"]
        assert called(["measure", str(table), "--every", "1", "--json", *more]) == 0
        tracks = json.loads(capsys.readouterr().out)
        assert "species" not in tracks
        for name in ("polarization", "milling", "nnd", "group_spread"):
            assert tracks["mean"][name] == pytest.approx(run[name], abs=0.05, rel=0.03), name


def test_a_table_has_the_lengths_of_animals_that_are_gone_at_the_end(tmp_path, capsys):
    simulation = flockbrush.start("meadow", 1, 30)
    length = simulation.agents[Body.length]
    length *= 0.25
    simulation.world.resource(Commands).submit(RemoveAnimals(0.0, 0.0, 0.0), 24)
    lived = []
    with Exports([tmp_path / "r.csv"], simulation) as exports:
        for tick in range(32):
            lived += [simulation.measures()["largest_part"]] if tick % 8 == 0 else []
            exports.take()
            simulation.tick()
    assert called(["measure", str(tmp_path / "r.csv"), "--every", "0.25", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["series"]["largest_part"]
    assert told[:3] == pytest.approx(lived[:3]) and lived[0] < 1.0


def test_a_table_without_lengths_is_measured_with_those_of_its_metadata(tmp_path, capsys):
    table, about = tmp_path / "r.csv", tmp_path / "r.csv.json"
    called(["run", "meadow", "--ticks", "4", "--agents", "30", "--export", str(table)])
    sizes = [float(line.rpartition(",")[2]) for line in table.read_text().splitlines()[1:]]
    told = []
    old = "".join(line.rpartition(",")[0] + "\n" for line in table.read_text().splitlines())
    lengths = {"body_length": {"sheep": sum(sizes) / len(sizes)}}
    for text, more in ((table.read_text(), {}), (old, lengths)):
        table.write_text(text)
        about.write_text(json.dumps(json.loads(about.read_text()) | more))
        capsys.readouterr()
        assert called(["measure", str(table), "--json"]) == 0
        told.append(json.loads(capsys.readouterr().out)["mean"])
    assert told[0] == pytest.approx(told[1])


def test_a_damaged_table_of_a_run_is_refused_in_words(tmp_path, capsys):
    table = tmp_path / "r.csv"
    called(["run", "meadow", "--seconds", "1", "--agents", "10", "--export", str(table)])
    lines = table.read_text().splitlines()
    for damaged, said in (
        (lines[3].replace("0.000000", "up", 1), "r.csv:4: time: must be a finite number, got 'up'"),
        ("1,2,3", "r.csv:4: has 3 cells, not 20"),
    ):
        table.write_text("\n".join([*lines[:3], damaged, *lines[4:]]) + "\n")
        capsys.readouterr()
        assert called(["measure", str(table)]) == 1
        assert said in capsys.readouterr().err


def test_a_damaged_parquet_of_a_run_is_refused_in_words(tmp_path, capsys):
    pa, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "r.parquet"
    called(["run", "meadow", "--seconds", "1", "--agents", "10", "--export", str(path)])
    with parquet.ParquetFile(path) as file:
        table, about = file.read(), file.metadata.metadata
    about.pop(b"ARROW:schema")
    x = table["x"].to_numpy().copy()
    x[3] = np.nan
    twice = pa.concat_tables([table, table.slice(5, 1)])
    for damaged, said in (
        (table.set_column(table.column_names.index("x"), "x", pa.array(x)), "r.parquet:4: x: must be a finite number"),
        (twice, f"r.parquet:{len(table) + 1}: animal 6 is in frame 0 twice, here and in row 6"),
    ):
        parquet.write_table(damaged.replace_schema_metadata(about), path)
        capsys.readouterr()
        assert called(["measure", str(path)]) == 1
        assert said in capsys.readouterr().err
    whole = path.read_bytes()
    path.write_bytes(whole[:-200])
    assert called(["measure", str(path)]) == 1
    assert "is not a readable Parquet file" in capsys.readouterr().err


def test_a_herd_below_birds_is_no_flight(tmp_path, capsys):
    table, about = tmp_path / "r.csv", tmp_path / "r.csv.json"
    assert called(["run", "ridge", "--ticks", "12", "--agents", "30", "--export", str(table)]) == 0
    for _ in range(2):  # the second time without metadata
        show = open_show(table)
        assert type(show) is GroundShow and show.herd(3).wings is None
        rows = [line.split(",") for line in table.read_text().splitlines()[1:]]
        heights = sorted(float(row[5]) for row in rows if row[0] == "5")
        assert max(heights) > 0.5 > min(heights) and sorted(show.herd(5).xy[:, 2]) == pytest.approx(heights)
        about.unlink(missing_ok=True)
    capsys.readouterr()
    assert called(["export", str(table), "--to", str(tmp_path / "x.csv")]) == 1
    assert "r.csv" in capsys.readouterr().err and not (tmp_path / "x.csv").exists()
    head, first, *rest = [line.rpartition(",")[0] for line in table.read_text().splitlines()]
    table.write_text("\n".join([f"{head},bank", *(f"{row},0" for row in (first, *rest))]))
    assert is_flight(table)


def test_a_run_in_which_animals_fly_is_a_flight_at_any_height(tmp_path):
    table = tmp_path / "g.csv"
    assert called(["run", "geese", "--ticks", "1", "--export", str(table)]) == 0
    rows = [line.split(",") for line in table.read_text().splitlines()]
    table.write_text("\n".join(",".join([*row[:5], row[5] if k == 0 else "0", *row[6:]]) for k, row in enumerate(rows)))
    assert is_flight(table)

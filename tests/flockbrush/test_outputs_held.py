"""While a command works, nobody else may write what it will write."""

import pytest
from flockbrush.engine.files import held, holder, refused

COMMANDS = {  # the first function that each calls in its work
    "track": ("track IN.mp4 --out OUT.csv", "film.track_clip._follow"),
    "lift": ("lift IN.csv --camera IN.toml --out OUT.csv", "cli.lift_commands.read_camera"),
    "lift's brush": (
        "lift IN.csv --camera IN.toml --out flight.csv --brush OUT.brush.toml",
        "cli.lift_commands.read_camera",
    ),
    "fields": ("fields IN.mp4 --out OUT.npz", "cli.field_commands.look_at"),
    "reenact": ("reenact IN.mp4 --brush march --export OUT.csv", "learning.reenact.look_at"),
    "learn": ("learn IN.mp4 --out OUT.brush.toml", "learning.learn.look_at"),
    "detect": ("formation detect IN.png --out OUT.csv", "film.birds_in_sky.mark"),
    "extract": ("formation extract IN.csv --out OUT.json", "cli.formation_commands.read_marks"),
    "plot": ("formation extract IN.csv --plot OUT.png", "cli.formation_commands.read_marks"),
    "fly": ("formation fly IN.json --out OUT.csv", "cli.formation_commands.load_formation"),
    "brush": ("formation brush IN.json --out OUT.brush.toml", "cli.formation_commands.load_formation"),
    "mark": ("formation mark IN.png --out OUT.csv", "studio.start_marking.PictureFilm"),
    "film": ("formation film geese --out OUT.png", "output.formation_film.start"),
    "initiate": ("formation initiate --out OUT.csv", "cli.formation_commands._cell"),
}


def words(tmp_path, command):
    """(arguments, output) of a command; its inputs are there."""
    found = [str(tmp_path / word) if word.startswith(("IN.", "OUT.", "flight.")) else word for word in command.split()]
    for word in found:
        if "/IN." in word:
            open(word, "wb").close()
    return found, next(word for word in found if "/OUT." in word)


@pytest.mark.parametrize("name", COMMANDS)
def test_an_output_is_held_while_the_command_works_and_free_afterwards(cli, tmp_path, monkeypatch, name):
    command, where = COMMANDS[name]
    arguments, out = words(tmp_path, command)
    holders = []

    def work(*given, **more):
        holders.append(holder(out))
        raise refused("here", "it goes no further")

    monkeypatch.setattr(f"flockbrush.{where}", work)
    done = cli(*arguments)
    assert (done.code, holders) == (1, ["this program is already writing it"]), done.err
    assert "here: it goes no further" in done.err
    assert holder(out) == ""
    assert {path.name.split(".")[0] for path in tmp_path.iterdir()} == ({"IN"} if "IN" in command else set())


@pytest.mark.parametrize("name", COMMANDS)
def test_an_output_that_somebody_writes_is_refused_before_the_work(cli, tmp_path, monkeypatch, name):
    command, where = COMMANDS[name]
    arguments, out = words(tmp_path, command)
    monkeypatch.setattr(f"flockbrush.{where}", lambda *given, **more: pytest.fail("it began"))
    with held(out):
        done = cli(*arguments)
    assert done.code == 1
    assert f"{out}: this program is already writing it; wait until it has ended" in done.err

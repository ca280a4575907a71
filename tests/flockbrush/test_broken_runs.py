"""A run that cannot go on says why in one line, and never shows a traceback."""

import pytest
from flockbrush.engine.commands import CommandError
from flockbrush.systems.commands import SwitchBrush
from flockbrush.systems.steer import NotFinite

from flockbrush.runs.terminal import exit_code_of


@pytest.mark.parametrize(
    "error", [CommandError(32, SwitchBrush("rnu"), "no brush 'rnu'"), NotFinite("model 'ill' gave no number")]
)
def test_it_says_what_happened_in_one_line(error, capsys):
    assert exit_code_of(error) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert err.strip().splitlines() == [str(error)]


def test_a_refused_command_names_tick_command_and_reason():
    text = str(CommandError(32, SwitchBrush("rnu"), "no brush 'rnu'"))
    assert text == "tick 32: SwitchBrush(brush='rnu', species='', x=0.0, y=0.0, radius=0.0): no brush 'rnu'"

"""The how-to page works: its examples are run as a reader would, from top to bottom."""

import re
from pathlib import Path

PAGE = Path(__file__).parent.parent / "docs" / "how-to.md"


def test_every_example_of_the_page_runs(tmp_path, monkeypatch):
    from behaviours import behaviour
    from engine import commands

    monkeypatch.chdir(tmp_path)
    behaviour.behaviours()  # all known before, so that all are known again afterwards
    monkeypatch.setattr(behaviour, "_registry", dict(behaviour._registry))
    monkeypatch.setattr(commands, "COMMANDS", dict(commands.COMMANDS))
    text = PAGE.read_text()
    session = {"__name__": "how_to"}
    monkeypatch.setitem(__import__("sys").modules, "how_to", type(__import__("sys"))("how_to"))
    examples = list(re.finditer(r"```python\n(.*?)```", text, re.DOTALL))
    assert len(examples) >= 8
    for example in examples:
        line = text[: example.start()].count("\n") + 1
        code = compile("\n" * line + example.group(1), str(PAGE), "exec")
        exec(code, session)
    assert session["sun"].model == "sunward"

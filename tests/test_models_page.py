"""The page of models says what the code says."""

from pathlib import Path

import pytest

from behaviours.behaviour import behaviours

PAGE = (Path(__file__).parent.parent / "docs" / "models.md").read_text()


@pytest.mark.parametrize("name", sorted(behaviours()))
def test_every_parameter_stands_on_the_page_as_it_is_in_the_code(name):
    for parameter, field in behaviours()[name].Params.model_fields.items():
        unit = field.json_schema_extra["unit"]
        rows = [line for line in PAGE.splitlines() if line.startswith(f"| `{parameter}` |")]
        assert rows, f"docs/models.md says nothing of {parameter}"
        said = f"| {field.default} |", f"| {unit} | {field.description} |"  # other models may have one of this name
        assert any(all(part in row for part in said) for row in rows), f"docs/models.md: {parameter}: {rows}"

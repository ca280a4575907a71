"""Text of the report on two runs that should be identical but differ."""

from __future__ import annotations

from flockbrush.runs.desync import Desync
from flockbrush.runs.terminal import print_line, show, table

NAMES = 8  # parts of the state that a line names


def show_build(apart):
    """Print the differences between the build that made the recording and this build."""
    if not apart:
        print_line("code, libraries and CPU are the same as when it was recorded")
    for what, text in apart.items():
        print_line(f"recorded {'on' if what == 'cpu' else 'with'} {text}")


def show_desync(report: Desync, names, written=()):
    """Print which system and which parts of the state differ, for which animals, with both values."""
    if report.system is not None:
        print_line(f"first system that differs: {report.system}")
    if report.parts:
        more = f" and {len(report.parts) - NAMES} more" if len(report.parts) > NAMES else ""
        print_line(f"parts that differ after tick {report.tick:,}: {', '.join(report.parts[:NAMES])}{more}")
    for note in report.notes:
        print_line(note)
    known = [d for d in report.differences if d.ids or d.one]
    if known:
        show(_values_table(known, names, f"after tick {report.tick:,}"))
    if len(known) < len(report.differences):
        several = ", ".join(d.part for d in report.differences if d not in known)
        print_line(f"several animals differ in {several}")
        print_line(
            "the recording has no snapshot of this tick; record with --keyframes 1 to have a snapshot of every tick"
        )
    if report.later is not None:
        show(_values_table(report.later_differences, names, f"in the next snapshot, after tick {report.later:,}"))
    for path in written:
        print_line(f"wrote {path}")


def _values_table(differences, names, title):
    """Table with a row for each part: number of animals that differ, largest difference, and its animal."""
    made = table("part", "animals", "largest difference", "animal", *names, title=title, right=("animals", "animal"))
    for d in differences:
        values = [_value(side[0]) if side else "-" for side in (d.one, d.other)]
        made.add_row(d.part, d.count, d.largest, str(d.ids[0]) if d.ids else "-", *values)
    return made


def _value(value):
    """A value with all its digits."""
    return ", ".join(map(_value, value)) if isinstance(value, list) else str(value)

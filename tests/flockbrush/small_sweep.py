"""A small sweep, its folder and its rows."""

import csv
from concurrent.futures import ThreadPoolExecutor

FLOCKS = """
schema = "flockbrush.sweep/1"
title = "small flocks"
experiment = "v_rules"

[seeds]
count = 6

[grid]
birds = [3, 5]
angle = [180, 170]

[fixed]
steps = 300

[[expect]]
measure = "leads"
where = { angle = 180 }
mean = [0.5, 1.5]
"""


def sweep_file(folder, text=FLOCKS, name="flocks"):
    path = folder / f"{name}.sweep.toml"
    path.write_text(text)
    return path


def here():
    """Workers that are threads of this process."""
    return ThreadPoolExecutor(2)


def rows_without_times(folder):
    with open(folder / "runs.csv", newline="") as file:
        return [{k: v for k, v in row.items() if k != "core_seconds"} for row in csv.DictReader(file)]


def rows_in(journal):
    """How many rows are whole; the first line is the build."""
    return max(0, journal.read_bytes().count(b"\n") - 1) if journal.exists() else 0

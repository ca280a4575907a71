"""Recordings as tables: `RecordedRun.to_dataframe` and `RecordedRun.to_xarray`.

Importing this file gives `RecordedRun` the two; `flockbrush.open_recording` does so.
"""

from __future__ import annotations

import importlib.util
import tempfile
import warnings
from pathlib import Path

from flockbrush.engine.recording import RecordedRun


def to_dataframe(run, fps=None):
    """The trajectories of a recording as a pandas DataFrame, one row per animal and frame.

    Parameters
    ----------
    run : RecordedRun
    fps : float, optional
        Frames per second; every tick by default.

    Raises
    ------
    ImportError
        Without pandas and pyarrow.
    """
    _needs("pandas", "pyarrow")
    import pandas

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.parquet"
        _export(run, path, fps)
        table = pandas.read_parquet(path)
    return table


def to_xarray(run, fps=None):
    """The positions of a recording as an xarray Dataset in the layout of movement.

    Parameters
    ----------
    run : RecordedRun
    fps : float, optional
        Frames per second; 16 by default.

    Raises
    ------
    ImportError
        Without xarray and netCDF4.
    """
    _needs("xarray", "netCDF4")
    import xarray

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.nc"
        _export(run, path, fps)
        with xarray.open_dataset(path) as data:
            return data.load()


def _needs(*packages):
    missing = [name for name in packages if importlib.util.find_spec(name) is None]
    if missing:
        raise ImportError(f"this needs {' and '.join(missing)}: pip install {' '.join(missing)}")


def _export(run, path, fps):
    from flockbrush.output.export import exported
    from flockbrush.runs.run import rebuild, unlike_recorded

    simulation = rebuild(run)
    exported(simulation, path, fps, run.last_tick)
    if unlike := unlike_recorded(run, simulation):
        warnings.warn(unlike, stacklevel=3)


RecordedRun.to_dataframe = to_dataframe  # type: ignore[attr-defined]
RecordedRun.to_xarray = to_xarray  # type: ignore[attr-defined]

"""Return the tables that `export` writes as pandas DataFrames, for use from Python.

pandas is optional (extra "notebook"). A frame's `attrs` hold its description, as JSON values.
"""

from __future__ import annotations

from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.export.element_fields import COLUMNS, combination_of
from chamberopt.export.formats import FrameName
from chamberopt.export.frame import MEANING, frame_of
from chamberopt.export.impacts_table import impact_table
from chamberopt.results.arrays_file import load_result_arrays
from chamberopt.results.load import load_trials
from chamberopt.search.trial_log import read_seconds, trial_rows

if TYPE_CHECKING:
    from pandas import DataFrame

    from chamberopt.common.progress import Progress
    from chamberopt.results.load import Result
    from chamberopt.results.rebuild import RebuiltChamber


def require_pandas(name: str) -> Any:
    """Return the module pandas.

    Args:
        name: name of the function that needs it, for the message.

    Raises:
        InputError: pandas is not installed.
    """
    try:
        import pandas
    except ImportError:
        text = "pandas is not installed: pip install 'chamberopt[notebook]'"
        raise InputError(f"{name}: {text}") from None
    return pandas


def impacts_frame(
    result: Result, rebuilt: RebuiltChamber, executor: Executor, *,
    frame: FrameName = "part", replicas: int | None = None, progress: Progress | None = None,
) -> DataFrame:  # fmt: skip
    """Simulate a result again and return the table of its impacts, a row for each impact.

    Raises:
        InputError: the new replicas differ from the replicas of the result, or pandas is missing.
    """
    pandas = require_pandas("impacts")
    columns, metadata, pieces = impact_table(
        result, rebuilt, executor, frame=frame, replicas=replicas, progress=progress
    )
    # The empty first piece gives the columns their types where no ball hits the part.
    empty = [np.zeros(0, column.dtype) for column in columns]
    values = [np.concatenate(one) for one in zip(empty, *pieces, strict=True)]
    names = [column.name for column in columns]
    found = pandas.DataFrame(dict(zip(names, values, strict=True)), copy=False)
    found.attrs = metadata
    return found


def fields_frame(result: Result, frame: FrameName = "part") -> DataFrame:
    """Return the values on each triangle of a result's part, in the order of part.vtp.

    The first columns are the centre of each triangle. A value that is not known is NaN.

    Raises:
        InputError: a file of the result is missing or was changed, or pandas is missing.
    """
    pandas = require_pandas("fields")
    arrays = load_result_arrays(result)
    part = arrays.chamber.part
    axes = frame_of(frame, part)
    centres = axes.positions(part.vertices[part.triangles].mean(axis=1))
    places = {f"{x}_{axes.unit}": centres[:, axis] for axis, x in enumerate("xyz")}
    index = pandas.RangeIndex(len(centres), name="triangle")
    found = pandas.DataFrame({**places, **arrays.elements}, index=index)
    known = [name for name in arrays.elements if name in COLUMNS or name.startswith("zone_")]
    found.attrs = {
        "frame": f"{axes.name}: {MEANING[axes.name]}",
        "length_unit": axes.unit,
        "columns": {name: combination_of(name)[0] for name in known},
    }
    return found


def trials_frame(folder: Path) -> DataFrame:
    """Return the evaluations that a study or sweep has so far, a row for each.

    NAME_pm is the 95 % half-width of NAME. A figure that words such as "never" stand for is NaN,
    and so is one of a failed evaluation.

    Raises:
        InputError: there are no evaluations, or pandas is missing.
    """
    pandas = require_pandas("trials")
    trials = load_trials(folder)
    found = pandas.DataFrame(trial_rows(trials, read_seconds(folder)))
    figures = {name for one in trials for name in one.metrics}
    numbers = {"objective", "half_width", "score", "seconds", *figures}
    for name in (numbers | {f"{name}_pm" for name in figures}) & set(found.columns):
        found[name] = pandas.to_numeric(found[name], errors="coerce")
    return found

"""Arrays of results that were not simulated, or that a test changes on purpose."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from chamberopt.chamber.build import Chamber
from chamberopt.coverage.field.display_mesh import DisplayField, DisplayMesh
from chamberopt.results.arrays_file import (
    ARRAYS_FILE,
    ResultArrays,
    read_result_arrays,
    save_result_arrays,
)
from tests.helpers.results.digests import accept_changes


def change_arrays(folder: Path, change: Callable[[ResultArrays], ResultArrays]) -> None:
    """Write changed arrays, as if they had been there from the start."""
    save_result_arrays(folder, change(read_result_arrays(folder / ARRAYS_FILE)))
    accept_changes(folder)


def change_elements(folder: Path, **columns: np.ndarray) -> None:
    """Write other values of the part's triangles, as if they had been there from the start."""
    change_arrays(folder, lambda one: replace(one, elements={**one.elements, **columns}))


def plain_arrays(chamber: Chamber) -> ResultArrays:
    """The arrays of a result that no shot has reached, with no column that it can do without."""
    part, area = chamber.part, 1e6 * chamber.exposed_area
    count, points = len(part.triangles), len(part.vertices)
    none, nowhere = np.zeros(count), np.zeros(points)
    elements = {
        "coverage": none, "coverage_interval": none, "impacts": none.astype(int),
        "dents": none.astype(int), "exposed_area_mm2": area, "element": part.elements,
        "target": part.target.astype(np.uint8),
    }  # fmt: skip
    upwards = np.tile([0.0, 0.0, 1.0], (points, 1))
    mesh = DisplayMesh(
        part.vertices, part.triangles, upwards, nowhere.astype(int), np.arange(count)
    )
    names = "coverage", "coverage_interval", "reachable", "resolved", "dent_density"
    return ResultArrays(chamber, elements, DisplayField(mesh, dict.fromkeys(names, nowhere)))

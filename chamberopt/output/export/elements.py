"""What each triangle of the part got -> what each element of its file got."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.geometry.triangles import areas

if TYPE_CHECKING:
    from chamberopt.geometry.mesh_io import PartMesh

# What a column of coverage.vtp is, and how triangles make an element: the sum of theirs, the largest, or a mean that
# counts each triangle by its exposed area, its impacts or its dents.
COLUMNS = {
    "coverage": ("share of the surface that is dented after the treatment, 0 to 1", "area"),
    "coverage_interval": (
        "width of coverage's 95 % interval; of several triangles their mean",
        "area",
    ),
    "dent_density": ("dented area per area after the treatment", "area"),
    "impacts_per_mm2": ("impacts per mm2 in the treatment", "area"),
    "energy_per_mm2": ("energy of impacts in the treatment, mJ/mm2", "area"),
    "mean_normal_speed": ("mean normal speed of impacts, m/s", "impacts"),
    "p90_normal_speed": (
        "90th percentile of their normal speed, m/s; of several triangles their mean",
        "impacts",
    ),
    "mean_angle_deg": ("mean angle of impacts to the surface, degrees, 90 is head on", "impacts"),
    "mean_dent_um": ("mean diameter of dents, micrometres", "dents"),
    "impacts": ("impacts that were simulated, a number", "sum"),
    "dents": ("dents that were simulated, a number", "sum"),
    "exposed_area_mm2": ("area that the shot can fly to, mm2", "sum"),
    "target": ("1: must be covered", "any"),
}


@dataclass(frozen=True)
class ElementFields:
    """numbers (e,) int64, rising, of the elements · columns: name -> (e,) float64, NaN where there is no value."""

    numbers: np.ndarray
    columns: dict[str, np.ndarray]


def of_elements(surface: Any, number: np.ndarray) -> ElementFields:
    """The columns of coverage.vtp, as pyvista reads it, for each element; number (m,): which one each triangle is of, 0
    for none.
    """
    cells = np.flatnonzero(number > 0)
    return _gathered(surface, cells, number[cells], tuple(COLUMNS))


def of_other_triangles(
    surface: Any, number: np.ndarray, filed: PartMesh, simulated: PartMesh
) -> ElementFields:
    """As of_elements, where the part was simulated in other triangles (simulated) than those of its file (filed).

    A triangle counts for the element that its middle lies in. An element without any, smaller than they are, gets what
    the triangles have that the middles of its own lie in. Sums are left out: triangles reach across elements.
    """
    cells = np.flatnonzero(number > 0)
    small = np.flatnonzero(~np.isin(filed.elements, number[cells]) & (filed.elements > 0))
    weight = np.ones(len(cells))
    if len(small):
        from sim_core import TriangleMesh, closest_points

        tags = np.zeros(len(simulated.triangles), dtype=np.uint8)
        mesh = TriangleMesh(simulated.vertices, simulated.triangles, tags)
        middles = filed.vertices[filed.triangles[small]].mean(axis=1)
        around = closest_points(mesh, middles, float(np.ptp(filed.vertices))).triangle
        share = areas(filed.vertices, filed.triangles[small]) / areas(
            simulated.vertices, simulated.triangles[around]
        )
        cells, weight = np.r_[cells, around], np.r_[weight, share]
    numbers = np.r_[number[number > 0], filed.elements[small]]
    means = tuple(name for name, (_, how) in COLUMNS.items() if how != "sum")
    return _gathered(surface, cells, numbers, means, weight)


def _gathered(
    surface: Any,
    cells: np.ndarray,
    number: np.ndarray,
    names: tuple[str, ...],
    share: np.ndarray | float = 1.0,
) -> ElementFields:
    """Columns of elements, of triangles (cells) that count for them by number, with a share of what they weigh."""
    numbers, which = np.unique(number, return_inverse=True)

    def total(values: np.ndarray) -> np.ndarray:
        return np.bincount(which, values, len(numbers))

    exposed = np.asarray(surface["exposed_area_mm2"])
    weights = {
        "area": exposed,
        "impacts": np.asarray(surface["impacts"]),
        "dents": np.asarray(surface["dents"]),
    }
    columns = {}
    for name in names:
        if name not in surface.cell_data:
            continue
        values, how = np.asarray(surface[name], dtype=np.float64)[cells], COLUMNS[name][1]
        if how == "sum":
            columns[name] = total(values)
        elif how == "any":
            columns[name] = (total(values) > 0.0).astype(np.float64)
        else:
            weight = np.where(np.isfinite(values), weights[how][cells] * share, 0.0)
            sums, whole = total(weight * np.nan_to_num(values)), total(weight)
            columns[name] = np.divide(
                sums, whole, out=np.full(len(numbers), np.nan), where=whole > 0.0
            )
    return ElementFields(numbers, columns)

"""Compute values for the elements of the part's file from the values of the part's triangles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.geometry.triangles import areas

if TYPE_CHECKING:
    from chamberopt.geometry.meshes.part_mesh import PartMesh

# Meaning of each column of part.vtp, and the combination of an element's triangles: their sum, or
# a mean weighted with exposed area, impacts or dents. Values of the field, which are measured in
# windows round each place, are means over the triangle.
COLUMNS = {
    "coverage": ("share of the surface that is dented after the treatment, 0 to 1", "area"),
    "coverage_interval": ("width of the 95 % interval of coverage at a place", "area"),
    "dent_density": ("dented area per area after the treatment", "area"),
    "dents_in_window": ("number of simulated dents in the window round a place", "area"),
    "reachable": ("share of the surface that a ball can touch, 0 to 1", "area"),
    "resolved": ("share of the surface with dents enough for its coverage, 0 to 1", "area"),
    "impacts_per_mm2": ("impacts per mm2 in the treatment", "area"),
    "energy_per_mm2": ("energy of impacts in the treatment, mJ/mm2", "area"),
    "mean_normal_speed": ("mean normal speed of impacts, m/s", "impacts"),
    "p90_normal_speed": ("90th percentile of the normal speed, m/s", "impacts"),
    "mean_angle_deg": ("mean angle of impacts to the surface, degrees, 90 is head on", "impacts"),
    "mean_dent_um": ("mean diameter of dents, micrometres", "dents"),
    "strength_um": ("peening strength, micrometres", "dents"),
    "almen_intensity_mmA": ("Almen intensity, mmA", "dents"),
    "saturation_time_s": ("saturation time of an Almen strip, s", "dents"),
    "compression_depth_um": ("estimated depth of compression, micrometres", "dents"),
    "surface_stress_MPa": ("estimated residual stress at the surface, MPa", "dents"),
    "moved_um": ("distance of the smooth surface from the facets, micrometres", "area"),
    "impacts": ("number of simulated impacts", "sum"),
    "dents": ("number of simulated dents", "sum"),
    "exposed_area_mm2": ("area inside the chamber, mm2", "sum"),
    "reachable_area_mm2": ("area that a ball can touch, mm2", "sum"),
    "target": ("1: must be covered", "any"),
}
ZONE_COLUMN = "zone_"  # start of the name of each zone's column


def combination_of(column: str) -> tuple[str, str]:
    """Return what a column of part.vtp means, and how to combine its values over triangles.

    The second text is "sum", "any" (1 if a triangle has it), or the weight of a mean: "area",
    "impacts" or "dents".
    """
    if column.startswith(ZONE_COLUMN):
        return f"1: in the zone {column.removeprefix(ZONE_COLUMN)}", "any"
    return COLUMNS[column]


def _columns(values: Mapping[str, np.ndarray]) -> tuple[str, ...]:
    zones = (name for name in values if name.startswith(ZONE_COLUMN))
    return (*COLUMNS, *zones)


WEIGHTS = {"area": "exposed_area_mm2", "impacts": "impacts", "dents": "dents"}


@dataclass(frozen=True)
class ElementFields:
    """Values for the elements of the part's file, such as coverage, by column.

    Args:
        numbers: element numbers in ascending order, shape (e,) int64.
        columns: values by name of the column, shape (e,) float64; NaN for a missing value.
    """

    numbers: np.ndarray
    columns: dict[str, np.ndarray]


def fields_of_elements(values: Mapping[str, np.ndarray], number: np.ndarray) -> ElementFields:
    """Return values for each element, combined from the part's triangles.

    Args:
        values: columns with a value for each triangle of the part.
        number: element number of each triangle, shape (m,); 0 for triangles in no element.
    """
    cells = np.flatnonzero(number > 0)
    return _combined(values, cells, number[cells], np.ones(len(cells)), _columns(values))


def fields_of_remeshed_elements(
    values: Mapping[str, np.ndarray], number: np.ndarray, original: PartMesh, simulated: PartMesh
) -> ElementFields:
    """Return values for each element of a part that was simulated in other triangles.

    The part's file then has other triangles.
    A triangle counts for the element around its centre. An element without such a centre gets the
    values of the triangles around the centres of its own triangles. Sums are left out, because
    triangles reach across elements.
    """
    cells = np.flatnonzero(number > 0)
    small = np.flatnonzero(~np.isin(original.elements, number[cells]) & (original.elements > 0))
    share = np.ones(len(cells))
    if len(small):
        from sim_core import TriangleMesh, closest_points

        tags = np.zeros(len(simulated.triangles), dtype=np.uint8)
        mesh = TriangleMesh(simulated.vertices, simulated.triangles, tags)
        centres = original.vertices[original.triangles[small]].mean(axis=1)
        around = closest_points(mesh, centres, float(np.ptp(original.vertices))).triangle
        own_area = areas(original.vertices, original.triangles[small])
        share_around = own_area / areas(simulated.vertices, simulated.triangles[around])
        cells, share = np.r_[cells, around], np.r_[share, share_around]
    numbers = np.r_[number[number > 0], original.elements[small]]
    names = tuple(name for name in _columns(values) if combination_of(name)[1] != "sum")
    return _combined(values, cells, numbers, share, names)


def _combined(
    values: Mapping[str, np.ndarray],
    cells: np.ndarray,
    number: np.ndarray,
    share: np.ndarray,
    names: tuple[str, ...],
) -> ElementFields:
    """Return values for each element, combined from its triangles.

    Args:
        cells: numbers of the triangles in `surface`, (k,).
        number: element to whose values each of these triangles contributes, (k,).
        share: share of each of these triangles that contributes, (k,).
        names: columns to combine.
    """
    numbers, element = np.unique(number, return_inverse=True)

    def total(column: np.ndarray) -> np.ndarray:
        return np.bincount(element, column, len(numbers))

    columns = {}
    for name in names:
        if name not in values:
            continue
        column = values[name].astype(np.float64)[cells]
        combination = combination_of(name)[1]
        if combination == "sum":
            columns[name] = total(column)
        elif combination == "any":
            columns[name] = (total(column) > 0.0).astype(np.float64)
        else:
            weight = values[WEIGHTS[combination]][cells] * share
            weight = np.where(np.isfinite(column), weight, 0.0)
            sums, weights = total(weight * np.nan_to_num(column)), total(weight)
            columns[name] = np.divide(
                sums, weights, out=np.full(len(numbers), np.nan), where=weights > 0.0
            )
    return ElementFields(numbers, columns)

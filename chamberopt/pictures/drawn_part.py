"""Prepare the part of a result for drawing: its target with values to colour it, and the rest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.coverage.coverage_from_impacts import coverage_from_dent_density
from chamberopt.design.shape_surface import TAG_PART
from chamberopt.geometry.triangles import area_vectors
from chamberopt.pictures.quantities import QUANTITIES, Quantity
from chamberopt.results.vtp_files import ZONE, Surface, pyvista

NEARLY_ALL = (0.01, 0.985)  # shares of the area below the ends of the colour scale
ON_BOUNDARY = 1e-4  # largest distance of a boundary, over the length of the part's surface
ROUNDS = 12  # averages over neighbours before a place is taken as resolved or not


class DrawnPart:
    """The target of a part with the values of one quantity, and the rest of the part.

    Attributes:
        whole: the whole target.
        target: the part of the target that balls can touch, with point data "shown" in the
            quantity's unit and cell data "resolved", true if the simulated dents are enough for a
            value.
        unreached: the target in the chamber that no ball can touch.
        outside: the target outside the chamber; empty if the chamber is not given.
        inside: the target inside the chamber: `target` and `unreached` together.
        surface: all of the part.
        rest: the part beside the target.
        zones: the surface of each zone by its number, from 1, and the surface in no zone as 0.
            Empty without zones.
        quantity: the quantity in "shown".

    A triangle belongs to the surface to which most of its corners belong. All surfaces have cell
    data "triangle", the number of the part's triangle, and "area" [mm²].
    """

    def __init__(
        self,
        field: Surface,
        quantity: Quantity = QUANTITIES["coverage"],
        chamber: Surface | None = None,
    ) -> None:
        corners = np.asarray(field.regular_faces)
        vectors = area_vectors(np.asarray(field.points, dtype=float), corners)
        field.cell_data["area"] = np.linalg.norm(vectors, axis=1)
        on_target = np.asarray(field["target"]) > 0
        is_reached = np.asarray(field["reachable"]) > 0.5
        is_resolved = _majority(np.asarray(field["resolved"]) > 0.5, is_reached, corners)
        reached, resolved = (one[corners].sum(axis=1) > 1 for one in (is_reached, is_resolved))
        for name in [one.column for one in QUANTITIES.values()] + ["dent_density"]:
            if name in field.point_data:
                _fill_from_neighbours(field.point_data, name, is_reached, corners)

        def cells(chosen: np.ndarray) -> Surface:
            if not chosen.any():  # PyVista drops the columns of an empty surface
                empty = pyvista().PolyData()
                for there, columns in (
                    (empty.point_data, field.point_data),
                    (empty.cell_data, field.cell_data),
                ):
                    there.update({k: one[:0] for k, one in columns.items() if one.ndim == 1})
                return empty
            return field.extract_cells(chosen).extract_surface(algorithm="dataset_surface")

        self.surface, self.whole, self.rest = field, cells(on_target), cells(~on_target)
        field.cell_data["resolved"] = resolved
        self.target = cells(on_target & reached)
        outside = on_target & ~reached
        if chamber is not None:
            outside[outside] = _is_outside(field.extract_cells(outside), chamber)
        else:
            outside[:] = False
        self.unreached, self.outside = cells(on_target & ~reached & ~outside), cells(outside)
        self.inside = cells(on_target & ~outside) if outside.any() else self.whole
        zone = np.asarray(field[ZONE]) if ZONE in field.cell_data else np.zeros(0)
        self.zones = {int(number): cells(zone == number) for number in np.unique(zone)}
        self.show(quantity)

    def show(self, quantity: Quantity, times: float = 1.0) -> None:
        """Put the values of a quantity, such as coverage, into "shown", the data to be coloured.

        Args:
            times: peening time over treatment time. It scales coverage and all other quantities
                that grow with time.
        """
        self.quantity = quantity
        if quantity.column == ZONE:  # drawn by `zones`
            return
        self.target["shown"] = self.values(quantity, times)

    def values(self, quantity: Quantity, times: float = 1.0) -> np.ndarray:
        """Return a quantity's values at the points of `target`, in the quantity's unit.

        Args:
            times: peening time over treatment time.
        """
        if quantity.name == "coverage":
            return 100.0 * coverage_from_dent_density(times * self.target["dent_density"])
        if quantity.column not in self.target.point_data:
            raise InputError(
                f"arrays.npz has no {quantity.column}: an older result; simulate again"
            )
        scale = quantity.factor * (times if quantity.grows else 1.0)
        return scale * np.asarray(self.target[quantity.column])

    def covered_to(self, share: float, times: float = 1.0) -> np.ndarray:
        """Return True for each triangle of `target` whose coverage is at least `share` [%].

        Args:
            times: peening time over treatment time.
        """
        values = self.values(QUANTITIES["coverage"], times)
        return np.asarray(values[self.target.regular_faces].mean(axis=1) >= share)


def _is_outside(surface: Surface, chamber: Surface) -> np.ndarray:
    """Return True for each triangle of a part's surface that lies outside its chamber, (c,)."""
    of_part = np.asarray(chamber["tag"]) == TAG_PART
    if not surface.n_cells or not of_part.any():
        return np.zeros(surface.n_cells, dtype=bool)
    boundary = chamber.extract_cells(of_part).extract_surface(algorithm="dataset_surface")
    middle = surface.cell_centers().points
    _, nearest = boundary.find_closest_cell(middle, return_closest_point=True)
    away = np.linalg.norm(nearest - middle, axis=1)
    return np.asarray(away > ON_BOUNDARY * boundary.length)


def _majority(marked: np.ndarray, among: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return marks of points, after each point has taken the mark of most points round it.

    So single dents do not become specks in a picture.

    Args:
        marked: marks of the points, (v,) bool.
        among: points whose marks count, (v,) bool.
        corners: points at the corners of the triangles, (c, 3).
    """
    of, to = _neighbours(corners)
    of, to = of[among[to]], to[among[to]]
    share, weight = marked.astype(float), np.maximum(np.bincount(of, minlength=len(marked)), 1)
    for _ in range(ROUNDS):
        share = np.bincount(of, share[to], len(share)) / weight
    return np.asarray(share > 0.5)


def _neighbours(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the two points of each side of each triangle, as pairs in both orders.

    Both arrays have the shape (6 c,) for c triangles.
    """
    sides = corners[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    return np.concatenate([sides[:, 0], sides[:, 1]]), np.concatenate([sides[:, 1], sides[:, 0]])


def _fill_from_neighbours(
    columns: dict[str, np.ndarray], name: str, known: np.ndarray, corners: np.ndarray
) -> None:
    """Replace unknown values of points by the mean of the known values of neighbouring points.

    Otherwise colours would fade at the edge of the surface that balls can reach.

    Args:
        columns: values of the points by name, of which `name` is changed.
        known: which values are known, (v,) bool.
        corners: points at the corners of the triangles, (c, 3).
    """
    values = np.asarray(columns[name])
    known = known & np.isfinite(values)
    of, to = _neighbours(corners)
    use = known[to] & ~known[of]
    count = np.bincount(of[use], minlength=len(values))
    sums = np.bincount(of[use], values[to[use]], len(values))
    columns[name] = np.where(count > 0, sums / np.maximum(count, 1), values)


def point_areas(surface: Surface) -> np.ndarray:
    """Return the area of the surface round each point [mm²], from the cell data "area"."""
    corners = np.asarray(surface.regular_faces)
    return np.bincount(corners.ravel(), np.repeat(surface["area"] / 3.0, 3), surface.n_points)


def colour_range(parts: Sequence[DrawnPart]) -> tuple[float, float]:
    """Return round limits around the shown values of nearly all of the area of all parts."""
    values = np.concatenate([part.target["shown"] for part in parts])
    area = np.concatenate([point_areas(part.target) for part in parts])
    known = np.isfinite(values) & (area > 0.0)
    is_share = parts[0].quantity.unit == "%"
    if not known.any():
        return (0.0, 100.0) if is_share else (0.0, 1.0)
    order = np.argsort(values[known])
    upto = np.cumsum(area[known][order])
    low, high = np.interp(np.multiply(NEARLY_ALL, upto[-1]), upto, values[known][order])
    if not is_share:
        return _round_range(low, high)
    step = 5.0 if high - low < 20.0 else 10.0
    low = min(max(0.0, step * np.floor(low / step)), 100.0 - step)
    return low, min(100.0, max(low + step, step * np.ceil(high / step)))


def beyond(parts: Sequence[DrawnPart], limits: tuple[float, float]) -> tuple[bool, bool]:
    """Return whether values that parts show are below and above the limits of the colours."""
    shown = np.concatenate([part.target["shown"] for part in parts])
    shown = shown[np.isfinite(shown)]
    return bool((shown < limits[0]).any()), bool((shown > limits[1]).any())


def _round_range(low: float, high: float) -> tuple[float, float]:
    """Return limits widened to round numbers. The lower limit becomes 0 if it is near 0."""
    span = high - low if high > low else max(abs(high), 1e-12)
    step = 10.0 ** np.floor(np.log10(span)) / 2.0
    low = 0.0 if 0.0 <= low < 0.4 * high else step * np.floor(low / step)
    return float(low), float(max(step * np.ceil(high / step), low + step))

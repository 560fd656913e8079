"""Where a ball can touch the cavity's surface when it comes from the sonotrode."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.reach.connectivity import cell_edge, find_regions
from chamberopt.chamber.reach.largest_ball import TouchPoints, find_touch_points
from chamberopt.design.shapes import TAG_PART, TAG_SONOTRODE
from chamberopt.geometry.triangles import areas, unit_normals

if TYPE_CHECKING:
    from sim_core import TriangleMesh

# Share of its radius that a ball may reach into a surface. This is what facets that turn by 8
# degrees each take from it, or by 3 in a hollow hardly rounder than the ball. Dents are deeper, and
# so are the tolerances of a gap.
TOLERATED_OVERLAP = 0.01
SPACING = 1.0 / 3.0  # of the radius: distance between touch points
MAX_POINTS = 100_000  # on the part, and as many on everything else
MIN_POINTS = 4  # on a triangle of the part, unless there are too many
MEASURED_WIDTH = 1.25  # of the largest ball: wider gaps are not measured


@dataclass(frozen=True)
class Reach:
    """What a ball reaches in a cavity."""

    mesh: TriangleMesh  # with k triangles
    diameter: float  # of the ball [m]
    touches: TouchPoints  # the p points that were checked
    fits: np.ndarray  # (p,), whether no wall is in the ball's way at the point
    reached: np.ndarray  # (p,), whether it fits and gets there from the sonotrode
    region: np.ndarray  # (p,), number of the region of its centre, -1 where it does not fit
    region_volume: np.ndarray  # of the open space in each region [m³]
    spacing: float  # largest distance between touch points [m]
    share: np.ndarray  # (k,), of each triangle of the cavity, the share that the ball can touch


def find_reach(
    mesh: TriangleMesh,
    diameter: float,
    largest: float | None = None,
    normals: np.ndarray | None = None,
) -> Reach:
    """Where a ball can touch the surface of a cavity.

    The ball is taken as smaller by TOLERATED_OVERLAP. In narrow places it is followed from point to
    point in steps of a quarter radius, so that a bent passage hardly wider than the ball may count
    as closed.

    Args:
        diameter: of the smallest ball of the shot [m].
        largest: diameter of the largest [m].
        normals: of the surface at the corners of the cavity's triangles, unit vectors into the
            cavity, shape (k, 3, 3); None where the triangles are the surface.
    """
    if normals is None:
        normals = np.repeat(-unit_normals(mesh.corners)[:, None], 3, axis=1)
    radius = 0.5 * diameter
    overlap = TOLERATED_OVERLAP * radius
    near_cell = radius + 1.01 * np.sqrt(3.0) * cell_edge(mesh, radius)
    max_radius = max(near_cell, MEASURED_WIDTH * 0.5 * (largest or diameter))
    spacing = _spacing(mesh, SPACING * radius)
    widest = float(spacing.max())
    touches = find_touch_points(mesh, normals, spacing, max_radius, overlap)
    region, volume = find_regions(mesh, touches, radius - overlap, widest)
    fits = touches.radius >= radius
    region = np.where(fits, region, -1)
    start = np.unique(region[fits & (mesh.tags[touches.triangle] == TAG_SONOTRODE)])
    reached = fits & np.isin(region, start)
    share = _share(touches.triangle, touches.area, reached, len(mesh.triangles))
    return Reach(mesh, diameter, touches, fits, reached, region, volume, widest, share)


def reached_part_share(reach: Reach, source: np.ndarray, count: int) -> np.ndarray:
    """Share (count,) that the ball can touch of each part triangle in the cavity, else 0.

    Args:
        source: part triangle that each triangle of the cavity lies on, else -1; shape (k,).
    """
    own = source >= 0
    size = areas(reach.mesh.vertices, reach.mesh.triangles)[own]
    return _share(source[own], size, reach.share[own], count)


def _share(triangle: np.ndarray, area: np.ndarray, touched: np.ndarray, count: int) -> np.ndarray:
    """Share (count,) of each triangle that is touched, from its pieces (p,) and their shares."""
    whole = np.bincount(triangle, area, count)
    part = np.bincount(triangle, touched * area, count)
    return np.divide(part, whole, out=np.zeros(count), where=whole > 0.0)


def _spacing(mesh: TriangleMesh, wanted: float) -> np.ndarray:
    """Distance [m] between touch points on each triangle (k,)."""
    size = areas(mesh.vertices, mesh.triangles)
    spacing = np.full(len(size), wanted)
    for chosen in (mesh.tags == TAG_PART, mesh.tags != TAG_PART):
        spacing[chosen] = max(wanted, float(np.sqrt(size[chosen].sum() / MAX_POINTS)))
    on_part = mesh.tags == TAG_PART
    if MIN_POINTS * on_part.sum() <= MAX_POINTS:
        spacing[on_part] = np.minimum(spacing[on_part], np.sqrt(size[on_part] / MIN_POINTS))
    return np.maximum(spacing, 1e-12)

"""Find the points at which a ball from the sonotrode can touch the cavity's surface."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from dataclasses import dataclass
from threading import Lock
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.largest_ball import TouchPoints, find_touch_points
from chamberopt.design.shape_surface import TAG_PART, TAG_SONOTRODE
from chamberopt.geometry.triangles import area_vectors, areas, connected_pieces, unit_normals

if TYPE_CHECKING:
    from chamberopt.chamber.largest_ball import TouchPoints
    from sim_core import TriangleMesh

# Regions in which a ball's centre can move.
#
# The open space is a grid of cells in which the centre may lie anywhere, refined from coarse to
# fine. Points midway between the walls continue the open space where it is too narrow for cells.
# They are the centres of the largest balls that touch the surface, and, in cells without open
# space nearby, the point farthest from all walls. Two points are linked if the ball can move
# straight from the first to the second.

MAX_CELLS = 3e6  # they take half a second; larger cells keep their number below it
HALVINGS = 3
EDGE = 0.5  # of the ball's radius
DIAGONAL = np.sqrt(3.0)
NEIGHBOURS = 8
NEARBY = 5  # cells: beside a plain wall, open space is two cells from where a centre can lie at all
PUSHES, SHORTER = 12, 0.7  # the last step is a hundredth of a cell
STEP = 0.25  # of the radius, between two checks of a straight way


class Cells(NamedTuple):
    """A grid (nx, ny, nz) of cubic cells over the cavity that marks where a ball's centre may lie.

    An open space is a connected set of cells in which the centre may lie anywhere.
    """

    low: np.ndarray  # lowest corner [m], (3,)
    edge: float  # of a cell [m]
    # Number of the open space around a cell, from 1 on. It is 0 for a cell in which a centre may
    # not lie anywhere.
    space: np.ndarray
    unsure: np.ndarray  # true if a ball's centre may lie in a part of the cell

    def middles(self, chosen: np.ndarray) -> np.ndarray:
        """Return the middles (n, 3) [m] of the cells that `chosen` (nx, ny, nz) marks."""
        return np.asarray(self.low + self.edge * (np.argwhere(chosen) + 0.5))

    def at(self, places: np.ndarray) -> np.ndarray:
        """Return the number of the open space at each point (n, 3) [m], 0 where there is none."""
        index = np.clip(
            ((places - self.low) / self.edge).astype(np.int64), 0, np.array(self.space.shape) - 1
        )
        return np.asarray(self.space[tuple(index.T)])


def cell_edge(mesh: TriangleMesh, radius: float) -> float:
    """Return the side [m] of the grid's cells for a ball of this radius [m].

    The side is large enough that there are at most about MAX_CELLS cells.
    """
    volume = float(np.prod(np.ptp(mesh.vertices, axis=0)))
    return float(max(EDGE * radius, (volume / MAX_CELLS) ** (1.0 / 3.0)))


def open_cells(mesh: TriangleMesh, radius: float) -> Cells:
    """Return a grid that marks the cells in which a ball's centre may lie anywhere.

    Cells outside the cavity and inside the part count too. No ball touches the surface there.
    """
    from scipy.ndimage import label

    from sim_core import closest_points

    low, edge = mesh.vertices.min(axis=0), cell_edge(mesh, radius)
    blocks = np.ceil(np.ptp(mesh.vertices, axis=0) / (edge * 2**HALVINGS)).astype(np.int64)
    free, unsure = np.zeros(blocks, dtype=bool), np.ones(blocks, dtype=bool)
    for halvings in range(HALVINGS, -1, -1):
        side = edge * 2**halvings
        half = 0.5 * DIAGONAL * side
        index = np.argwhere(unsure)
        found = closest_points(mesh, low + side * (index + 0.5), radius + half)
        free[tuple(index.T)] = found.triangle < 0
        unsure[tuple(index.T)] = (found.triangle >= 0) & (found.distance > radius - half)
        if halvings:
            free, unsure = (
                np.kron(cells, np.ones((2, 2, 2), dtype=bool)) for cells in (free, unsure)
            )
    return Cells(low, edge, label(free, structure=np.ones((3, 3, 3)))[0], unsure)


def find_regions(
    mesh: TriangleMesh, touches: TouchPoints, radius: float, spacing: float
) -> tuple[np.ndarray, np.ndarray]:
    """Find the separate regions in which the centre of a ball of this radius [m] can move.

    Args:
        touches: points of the surface at which the ball may touch, with the largest ball at each.
        spacing: largest distance between neighbouring touch points [m].
    Returns:
        Region of each touch point, -1 where the ball does not fit, (p,) int, and the volume [m³] of
        the open space in each region.
    """
    cells = open_cells(mesh, radius)
    spaces = int(cells.space.max())
    fits = touches.radius > radius
    centre = touches.centre[fits]
    node = cells.at(centre) - 1
    inside = np.isin(np.arange(spaces + 1), node + 1) & (np.arange(spaces + 1) > 0)
    cells = cells._replace(space=np.where(inside[cells.space], cells.space, 0))
    tight = node < 0
    node[tight] = spaces + np.arange(tight.sum())
    narrow = np.concatenate([centre[tight], _midway_points(mesh, cells, radius)])
    count = spaces + len(narrow)
    links = _links_to_spaces(mesh, cells, narrow, radius, spacing) + np.array([spaces, 0])
    region = connected_pieces(links[:, 0], links[:, 1], count)[1]
    more = _links_between(mesh, narrow, region[spaces:], radius, spacing) + spaces
    links = np.concatenate([links, more])
    region = connected_pieces(links[:, 0], links[:, 1], count)[1]
    of_touch = np.full(len(touches.point), -1)
    of_touch[fits] = region[node]
    size = np.bincount(cells.space.ravel(), minlength=spaces + 1)[1:]
    volume = np.bincount(region[:spaces], size, int(region.max(initial=-1)) + 1) * cells.edge**3
    return of_touch, volume


def _midway_points(mesh: TriangleMesh, cells: Cells, radius: float) -> np.ndarray:
    """Return points (n, 3) [m] for a ball's centre in narrow places: in cells that have no open
    space nearby, or several.

    Each point starts at its cell's middle. It moves away from the closest wall, in ever smaller
    steps, until it is midway between the walls.
    """
    from scipy.ndimage import maximum_filter, minimum_filter

    from sim_core import closest_points

    highest = maximum_filter(cells.space, size=NEARBY)
    numbers = np.where(cells.space > 0, cells.space, np.iinfo(np.int32).max)
    lowest = minimum_filter(numbers, size=NEARBY)
    place = cells.middles(cells.unsure & ((highest == 0) | (highest != lowest)))
    beside = closest_points(mesh, place, radius + DIAGONAL * cells.edge)
    outward = area_vectors(mesh.vertices, mesh.triangles)[beside.triangle]
    place = place[np.einsum("ij,ij->i", place - beside.point, outward) < 0.0]
    best, widest = place.copy(), np.zeros(len(place))
    step = 0.5 * cells.edge
    for _ in range(PUSHES):
        found = closest_points(mesh, place, radius + DIAGONAL * cells.edge)
        wider = found.distance > widest
        best[wider], widest[wider] = place[wider], found.distance[wider]
        away = place - found.point
        place = place + step * away / np.maximum(np.linalg.norm(away, axis=1), 1e-12)[:, None]
        step *= SHORTER
    return np.asarray(best[widest >= radius])


def _links_to_spaces(
    mesh: TriangleMesh, cells: Cells, centre: np.ndarray, radius: float, spacing: float
) -> np.ndarray:
    """Return index pairs (point, open space), (k, 2), between which the ball can move straight.

    An open space is a connected set of cells in which the centre may lie anywhere. Each point is
    paired at most once with each open space nearby.

    Args:
        centre: points in narrow places [m], (n, 3).
        radius: radius of the ball [m].
        spacing: largest distance between neighbouring points [m].
    """
    from scipy.ndimage import binary_erosion
    from scipy.spatial import KDTree

    free = cells.space > 0
    border_cells = free & ~binary_erosion(free, structure=np.ones((3, 3, 3)))
    if not border_cells.any() or not len(centre):
        return np.zeros((0, 2), dtype=np.int64)
    border, border_space = cells.middles(border_cells), cells.space[border_cells] - 1
    far = 3.0 * cells.edge + spacing
    most = min(NEIGHBOURS, len(border))
    away, found = KDTree(border).query(centre, k=range(1, most + 1), distance_upper_bound=far)
    linked = np.full((len(centre), most), -1)  # open spaces linked to each point
    for k in range(most):
        here = np.flatnonzero(np.isfinite(away[:, k]))
        space = border_space[found[here, k]]
        new = (linked[here, :k] != space[:, None]).all(axis=1)
        here, space = here[new], space[new]
        way = _is_way_clear(mesh, centre[here], border[found[here, k]], radius)
        linked[here[way], k] = space[way]
    start, column = np.nonzero(linked >= 0)
    return np.column_stack([start, linked[start, column]])


def _links_between(
    mesh: TriangleMesh, centre: np.ndarray, region: np.ndarray, radius: float, spacing: float
) -> np.ndarray:
    """Return index pairs (k, 2) of nearby points between which the ball can move straight.

    Only pairs of points in different regions are returned.

    Args:
        centre: points in narrow places [m], (n, 3).
        region: number of each point's region, in which it is connected already, (n,).
        radius: radius of the ball [m].
        spacing: largest distance between neighbouring points [m].
    """
    from scipy.spatial import KDTree

    if len(centre) < 2:
        return np.zeros((0, 2), dtype=np.int64)
    away, found = KDTree(centre).query(
        centre, k=min(3 * NEIGHBOURS, len(centre)), distance_upper_bound=3.0 * spacing
    )
    here, k = np.nonzero(np.isfinite(away))
    there = found[here, k]
    new = region[here] != region[there]
    here, there = here[new], there[new]
    way = _is_way_clear(mesh, centre[here], centre[there], radius)
    return np.column_stack([here[way], there[way]])


def _is_way_clear(
    mesh: TriangleMesh, start: np.ndarray, end: np.ndarray, radius: float
) -> np.ndarray:
    """Mark the pairs (n,) of start and end (n, 3) [m] between which a ball can move straight."""
    from sim_core import closest_points

    clear = np.ones(len(start), dtype=bool)
    longest = np.linalg.norm(end - start, axis=1).max(initial=0.0)
    steps = int(np.ceil(longest / (STEP * radius))) + 1
    for share in np.linspace(0.0, 1.0, steps + 1)[1:-1]:
        rows = np.flatnonzero(clear)
        found = closest_points(mesh, start[rows] + share * (end - start)[rows], radius)
        clear[rows[found.triangle >= 0]] = False
    return clear


# Depth to which a ball may reach into a surface, over its radius. Facets that turn by 8 degrees
# each take as much from a ball, and facets that turn by 3 degrees in a hollow hardly rounder than
# the ball. Dents and the tolerances of gaps are deeper.
TOLERATED_OVERLAP = 0.01
SPACING = 1.0 / 3.0  # distance between touch points, over the radius
MAX_POINTS = 100_000  # on the part, and as many on everything else
MIN_POINTS = 4  # on a triangle of the part, unless there are too many
MEASURED_WIDTH = 1.25  # widest gap that is measured, over the largest ball's diameter


@dataclass(frozen=True)
class Reach:
    """Points of a cavity's surface, and whether a ball from the sonotrode can touch each."""

    mesh: TriangleMesh  # with k triangles
    diameter: float  # of the ball [m]
    touches: TouchPoints  # the p points that were checked
    fits: np.ndarray  # (p,), true if no wall is in the ball's way at the point
    reached: np.ndarray  # (p,), true if the ball fits and gets there from the sonotrode
    region: np.ndarray  # (p,), region of the ball's centre, -1 where the ball does not fit
    region_volume: np.ndarray  # volume of the open space in each region [m³]
    spacing: float  # largest distance between touch points [m]
    share: np.ndarray  # (k,), share of each triangle of the cavity that the ball can touch


# The latest reaches, by a digest of all on which they depend. A chamber takes its own several
# times: to choose a target, to check each step, to draw, and, of a proposal, to see whether a
# target that the shot reaches is worth proposing.
MOST_KNOWN = 8
_known: OrderedDict[bytes, Reach] = OrderedDict()
_of_known = Lock()  # threads check chambers at once


def find_reach(
    mesh: TriangleMesh,
    diameter: float,
    largest: float | None = None,
    normals: np.ndarray | None = None,
) -> Reach:
    """Find the points at which a ball from the sonotrode can touch the surface of a cavity.

    The ball may reach into surfaces by TOLERATED_OVERLAP of its radius. In narrow places its way is
    followed along straight lines from point to point, and checked every quarter of a radius. So a
    bent passage hardly wider than the ball may count as closed.

    Args:
        diameter: diameter of the smallest ball of the shot [m].
        largest: diameter of the largest ball [m].
        normals: unit vectors of the surface at the corners of the cavity's triangles, into the
            cavity, shape (k, 3, 3). None if the triangles are the surface.
    """
    radius = 0.5 * diameter
    near_cell = radius + 1.01 * np.sqrt(3.0) * cell_edge(mesh, radius)
    max_radius = max(near_cell, MEASURED_WIDTH * 0.5 * (largest or diameter))
    digest = hashlib.sha256(repr((diameter, max_radius)).encode())
    for array in (mesh.vertices, mesh.triangles, mesh.tags, normals):
        if array is not None:
            digest.update(f"{array.dtype} {array.shape}".encode() + array.tobytes())
    key = digest.digest()
    with _of_known:
        found = _known.pop(key, None)
    found = found or _find_reach(mesh, diameter, max_radius, normals)
    with _of_known:
        _known[key] = found  # as the latest
        while len(_known) > MOST_KNOWN:
            _known.popitem(last=False)
    return found


def _find_reach(
    mesh: TriangleMesh, diameter: float, max_radius: float, normals: np.ndarray | None
) -> Reach:
    """Find what `find_reach` finds, with the largest ball at each point up to a radius [m]."""
    radius = 0.5 * diameter
    touches, widest = find_touches(mesh, diameter, max_radius, normals)
    overlap = TOLERATED_OVERLAP * radius
    region, volume = find_regions(mesh, touches, radius - overlap, widest)
    fits = touches.radius >= radius
    region = np.where(fits, region, -1)
    start = np.unique(region[fits & (mesh.tags[touches.triangle] == TAG_SONOTRODE)])
    reached = fits & np.isin(region, start)
    share = _share(touches.triangle, touches.area, reached, len(mesh.triangles))
    return Reach(mesh, diameter, touches, fits, reached, region, volume, widest, share)


def find_touches(
    mesh: TriangleMesh,
    diameter: float,
    max_radius: float,
    normals: np.ndarray | None = None,
    chosen: np.ndarray | None = None,
) -> tuple[TouchPoints, float]:
    """Return the points to test on a cavity's surface, and the largest distance between them [m].

    Args:
        diameter: diameter of the smallest ball [m].
        max_radius: radius [m] up to which the largest ball at each point is found.
        normals: those of `find_reach`.
        chosen: marks the triangles whose points are wanted, (k,) bool; None for all.
    """
    if normals is None:
        normals = np.repeat(-unit_normals(mesh.corners)[:, None], 3, axis=1)
    radius = 0.5 * diameter
    spacing = _spacing(mesh, SPACING * radius)
    overlap = TOLERATED_OVERLAP * radius
    found = find_touch_points(mesh, normals, spacing, max_radius, overlap, chosen)
    return found, float(spacing.max())


def reached_part_share(reach: Reach, source: np.ndarray, count: int) -> np.ndarray:
    """Return the share of each part triangle that the ball can touch, (count,).

    It is 0 for triangles outside the cavity.

    Args:
        source: part triangle under each triangle of the cavity, else -1; shape (k,).
        count: number of part triangles.
    """
    own = source >= 0
    size = areas(reach.mesh.vertices, reach.mesh.triangles)[own]
    return _share(source[own], size, reach.share[own], count)


def _share(triangle: np.ndarray, area: np.ndarray, touched: np.ndarray, count: int) -> np.ndarray:
    """Return the touched share of each triangle, (count,), from the touched shares of its pieces.

    Args:
        triangle: triangle to which each piece belongs, (p,).
        area: area of each piece [m²], (p,).
        touched: share of each piece that is touched, (p,).
    """
    whole = np.bincount(triangle, area, count)
    part = np.bincount(triangle, touched * area, count)
    return np.divide(part, whole, out=np.zeros(count), where=whole > 0.0)


def _spacing(mesh: TriangleMesh, wanted: float) -> np.ndarray:
    """Return the distance [m] between the points to test on each triangle of a cavity, (k,).

    It is the wanted distance [m], unless there would be too many points, or too few on a triangle
    of the part.
    """
    size = areas(mesh.vertices, mesh.triangles)
    spacing = np.full(len(size), wanted)
    for chosen in (mesh.tags == TAG_PART, mesh.tags != TAG_PART):
        spacing[chosen] = max(wanted, float(np.sqrt(size[chosen].sum() / MAX_POINTS)))
    on_part = mesh.tags == TAG_PART
    if MIN_POINTS * on_part.sum() <= MAX_POINTS:
        spacing[on_part] = np.minimum(spacing[on_part], np.sqrt(size[on_part] / MIN_POINTS))
    return np.asarray(np.maximum(spacing, 1e-12))

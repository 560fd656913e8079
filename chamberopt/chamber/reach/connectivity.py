"""Which places a ball can get to from which: the rooms that a ball's centre can move in.

Open space is a grid of cells in which a centre may lie anywhere, looked for from coarse to fine. Where it is too tight
for such cells, places midway between the walls lead on: the centres of the largest balls that touch, and what cells
without open space nearby hold that is farthest from all walls. The straight way from one to the next is followed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.geometry.triangles import area_vectors

if TYPE_CHECKING:
    from chamberopt.chamber.reach.largest_ball import Touches
    from sim_core import TriangleMesh

MOST_CELLS = 3e6  # half a second; beyond it cells grow
HALVINGS = 3
EDGE = 0.5  # of the ball's radius
DIAGONAL = np.sqrt(3.0)
NEIGHBOURS = 8
NEARBY = 5  # cells wide: beside a plain wall there is open space two cells from where a centre may lie at all
PUSHES, SHORTER = 12, 0.7  # the last step is a hundredth of a cell
STEP = 0.25  # of the radius: how finely a straight way is followed


class Cells(NamedTuple):
    """The grid: its ``low`` corner (3,) [m], a cell's ``edge`` [m], and the open space (nx, ny, nz) int32 that each
    belongs to, from 1 on; 0 where a centre may not lie anywhere in it. ``unsure``: there it may lie somewhere.
    """

    low: np.ndarray
    edge: float
    space: np.ndarray
    unsure: np.ndarray

    def middles(self, chosen: np.ndarray) -> np.ndarray:
        """Of the cells that are true in (nx, ny, nz), (n, 3) [m]."""
        return np.asarray(self.low + self.edge * (np.argwhere(chosen) + 0.5))

    def at(self, places: np.ndarray) -> np.ndarray:
        """The open space (n,) at each of the places (n, 3) [m]."""
        index = np.clip(
            ((places - self.low) / self.edge).astype(np.int64), 0, np.array(self.space.shape) - 1
        )
        return np.asarray(self.space[tuple(index.T)])


def cell_edge(mesh: TriangleMesh, radius: float) -> float:
    """Side [m] of the cells that suit a ball, or as many as there may be."""
    volume = float(np.prod(np.ptp(mesh.vertices, axis=0)))
    return float(max(EDGE * radius, (volume / MOST_CELLS) ** (1.0 / 3.0)))


def open_cells(mesh: TriangleMesh, radius: float) -> Cells:
    """Cells in which a ball of this radius [m] is free wherever its centre lies, and what hangs together of them.

    Also outside the cavity, and inside the part: no ball that touches is there.
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
        away = found.distance
        free[tuple(index.T)] = found.triangle < 0
        unsure[tuple(index.T)] = (found.triangle >= 0) & (away > radius - half)
        if halvings:
            free, unsure = _halved(free), _halved(unsure)
    return Cells(low, edge, label(free, structure=np.ones((3, 3, 3)))[0], unsure)


def _halved(cells: np.ndarray) -> np.ndarray:
    for axis in range(3):
        cells = np.repeat(cells, 2, axis=axis)
    return cells


def rooms(
    mesh: TriangleMesh, touches: Touches, radius: float, spacing: float
) -> tuple[np.ndarray, np.ndarray]:
    """The room (p,) int that each touch lies in, -1 where a ball of this radius [m] does not fit, and the volume [m³]
    that its centre has in each room; ``spacing`` [m] of the touches, at most.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    cells = open_cells(mesh, radius)
    spaces = int(cells.space.max())
    fits = touches.radius > radius
    centre = touches.centre[fits]
    node = cells.at(centre) - 1
    inside = np.isin(np.arange(spaces + 1), node + 1) & (np.arange(spaces + 1) > 0)
    cells = cells._replace(space=np.where(inside[cells.space], cells.space, 0))
    tight = node < 0
    node[tight] = spaces + np.arange(tight.sum())
    tights = np.concatenate([centre[tight], _midways(mesh, cells, radius)])
    count = spaces + len(tights)

    def joined(links: np.ndarray) -> np.ndarray:
        graph = coo_array(
            (np.ones(len(links), dtype=np.int8), (links[:, 0], links[:, 1])), shape=(count, count)
        )
        return np.asarray(connected_components(graph, directed=False)[1])

    links = _ways_out(mesh, cells, tights, radius, spacing) + np.array([spaces, 0])
    room = joined(links)
    room = joined(
        np.concatenate([links, _ways_on(mesh, tights, room[spaces:], radius, spacing) + spaces])
    )
    which = np.full(len(touches.point), -1)
    which[fits] = room[node]
    filled = np.bincount(cells.space.ravel(), minlength=spaces + 1)[1:]
    return which, np.bincount(room[:spaces], filled, int(room.max(initial=-1)) + 1) * cells.edge**3


def _midways(mesh: TriangleMesh, cells: Cells, radius: float) -> np.ndarray:
    """Places (n, 3) [m] where a centre may lie in cells that no open space is near, or more than one.

    From the cell's middle away from whatever is nearest, in ever smaller steps: to midway between the walls.
    """
    from scipy.ndimage import maximum_filter, minimum_filter

    from sim_core import closest_points

    highest = maximum_filter(cells.space, size=NEARBY)
    lowest = minimum_filter(
        np.where(cells.space > 0, cells.space, np.iinfo(np.int32).max), size=NEARBY
    )
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
    return best[widest >= radius]


def _ways_out(
    mesh: TriangleMesh, cells: Cells, centre: np.ndarray, radius: float, spacing: float
) -> np.ndarray:
    """Links (k, 2) from tight places to open spaces nearby, one for each of both."""
    from scipy.ndimage import binary_erosion
    from scipy.spatial import KDTree

    free = cells.space > 0
    rim = free & ~binary_erosion(free, structure=np.ones((3, 3, 3)))
    if not rim.any() or not len(centre):
        return np.zeros((0, 2), dtype=np.int64)
    border, of_border = cells.middles(rim), cells.space[rim] - 1
    far = 3.0 * cells.edge + spacing
    most = min(NEIGHBOURS, len(border))
    away, found = KDTree(border).query(centre, k=range(1, most + 1), distance_upper_bound=far)
    led = np.full((len(centre), most), -1)  # the open spaces that each is known to lead to
    for k in range(most):
        here = np.flatnonzero(np.isfinite(away[:, k]))
        space = of_border[found[here, k]]
        new = (led[here, :k] != space[:, None]).all(axis=1)
        here, space = here[new], space[new]
        way = _clear_way(mesh, centre[here], border[found[here, k]], radius)
        led[here[way], k] = space[way]
    start, column = np.nonzero(led >= 0)
    return np.column_stack([start, led[start, column]])


def _ways_on(
    mesh: TriangleMesh, centre: np.ndarray, room: np.ndarray, radius: float, spacing: float
) -> np.ndarray:
    """Links (k, 2) between tight places near each other that are not yet known to be in one room."""
    from scipy.spatial import KDTree

    if len(centre) < 2:
        return np.zeros((0, 2), dtype=np.int64)
    away, found = KDTree(centre).query(
        centre, k=min(3 * NEIGHBOURS, len(centre)), distance_upper_bound=3.0 * spacing
    )
    here, k = np.nonzero(np.isfinite(away))
    there = found[here, k]
    new = room[here] != room[there]
    here, there = here[new], there[new]
    way = _clear_way(mesh, centre[here], centre[there], radius)
    return np.column_stack([here[way], there[way]])


def _clear_way(mesh: TriangleMesh, start: np.ndarray, end: np.ndarray, radius: float) -> np.ndarray:
    """Whether a ball gets straight from each start (n, 3) [m] to its end: (n,) bool."""
    from sim_core import closest_points

    clear = np.ones(len(start), dtype=bool)
    if not len(start):
        return clear
    steps = int(np.ceil(np.linalg.norm(end - start, axis=1).max() / (STEP * radius))) + 1
    for share in np.linspace(0.0, 1.0, steps + 1)[1:-1]:
        asked = np.flatnonzero(clear)
        found = closest_points(mesh, start[asked] + share * (end - start)[asked], radius)
        clear[asked[found.triangle >= 0]] = False
    return clear

"""A uniform grid of cells, walked along the arc's chord.

Each empty cell knows how far around it all cells are empty (Amanatides & Woo, Eurographics 1987, 3,
with the leaps of a distance field). Cells are entered by the chord, so each obstacle is listed also
in the cells that lie below it by the arc's bulge.
"""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import distance_transform_cdt

from benchmarks.structures.compiled import jit, searches
from benchmarks.structures.mesh_obstacles import (
    FALL,
    PIECE,
    TINY,
    Rows,
    Shell,
    answer,
    chord_of,
    gaps,
    nearer,
    padding,
    sort_rows,
)
from sim_core.geometry.obstacles import CAPSULE
from sim_core.numerics.roots import NEVER

CELLS = 8  # per obstacle; memory grows with it and empty cells are leapt over
NUDGE = 1e-9  # m: how far past a cell's face the walk goes on; obstacles are listed this much wider
FARTHEST = 255  # cells
BATCH = (
    20_000  # obstacles listed at a time: 9 fine cells a side about a capsule make 10 million pairs
)


class UniformGrid(NamedTuple):
    """The arrays of a grid.

    ``low`` (3,) [m] is its corner, ``edge`` [m] the width of a cell, and ``shape`` (3,) the number
    of cells. ``empty`` (cells,) uint8 says within how many cells there is no obstacle; it is 0
    where there is one. Cell c lists ``items``[``starts``[c] : ``starts``[c + 1]].
    """

    low: np.ndarray
    edge: float
    shape: np.ndarray
    empty: np.ndarray
    starts: np.ndarray
    items: np.ndarray
    rows: Rows


def build(shell: Shell, cells: float = CELLS) -> UniformGrid:
    """The grid over the shell's obstacles."""
    bulge = -0.125 * PIECE**2 * np.array(FALL)
    pad = padding(shell) + 2.0 * NUDGE
    low = shell.points.min(axis=1) - shell.grow[:, None] - pad - np.maximum(bulge, 0.0)
    high = shell.points.max(axis=1) + shell.grow[:, None] + pad - np.minimum(bulge, 0.0)
    bottom, size = low.min(axis=0), np.ptp(np.concatenate([low, high]), axis=0)
    edge = float((size.prod() / (cells * len(low))) ** (1.0 / 3.0))
    shape = np.ceil(size / edge).astype(np.int64) + 1
    first, last = (((x - bottom) // edge).astype(np.int64) for x in (low, high))
    order = np.argsort(_cell(first, shape), kind="stable")
    listed = []
    for start in range(0, len(order), BATCH):
        part = order[start : start + BATCH]
        cell, item = _overlaps(first[part], last[part], shape)
        middle = bottom + edge * (np.stack(np.unravel_index(cell, shape), axis=1) + 0.5)
        keep = _touches(shell, part[item], middle, edge, pad, bulge)
        listed.append((cell[keep], start + item[keep]))
    cell, item = (np.concatenate(column) for column in zip(*listed, strict=True))
    by_cell = np.argsort(cell, kind="stable")
    counts = np.bincount(cell, minlength=int(shape.prod()))
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    empty = distance_transform_cdt((counts == 0).reshape(shape), "chessboard")
    empty = np.minimum(empty, FARTHEST).astype(np.uint8).ravel()
    return UniformGrid(
        bottom, edge, shape, empty, starts, item[by_cell].astype(np.int32), sort_rows(shell, order)
    )


def _cell(index: np.ndarray, shape: np.ndarray) -> np.ndarray:
    return (index[:, 0] * shape[1] + index[:, 1]) * shape[2] + index[:, 2]


def _overlaps(
    first: np.ndarray, last: np.ndarray, shape: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Every (cell, obstacle) whose boxes overlap."""
    width = last - first + 1
    count = width.prod(axis=1)
    item = np.repeat(np.arange(len(first)), count)
    k = np.arange(len(item)) - np.repeat(np.cumsum(count) - count, count)
    w = width[item]
    step = np.stack([k // (w[:, 1] * w[:, 2]), k // w[:, 2] % w[:, 1], k % w[:, 2]], axis=1)
    return _cell(first[item] + step, shape), item


def _touches(
    shell: Shell, item: np.ndarray, middle: np.ndarray, edge: float, pad: float, bulge: np.ndarray
) -> np.ndarray:
    """Which of these pairs stay.

    The plane of a face must cross the cell. The surface of a capsule must come within reach of the
    corners of the cell.
    """
    normal = shell.numbers[item, 0:3]
    plane = 0.5 * edge * np.abs(normal).sum(axis=1) + pad + np.abs(normal @ bulge)
    ball = 0.5 * np.sqrt(3.0) * edge + pad + np.linalg.norm(bulge)
    return np.abs(gaps(shell, item, middle)) <= np.where(shell.kinds[item] == CAPSULE, ball, plane)


@searches(UniformGrid)
def nearest(grid, ball, fall, length):  # type: ignore[no-untyped-def]
    """Delay [s] and obstacle of the first contact within ``length`` [s]."""
    chord = chord_of(ball, fall, length)
    best, found = length, -1
    wide, deep, tall = grid.shape[0], grid.shape[1], grid.shape[2]
    per_metre = 1.0 / grid.edge
    nudge = NUDGE / (abs(chord.velocity.x) + abs(chord.velocity.y) + abs(chord.velocity.z) + TINY)
    time = 0.0
    while time <= best:
        i = int((chord.origin.x + time * chord.velocity.x - grid.low[0]) * per_metre)
        j = int((chord.origin.y + time * chord.velocity.y - grid.low[1]) * per_metre)
        k = int((chord.origin.z + time * chord.velocity.z - grid.low[2]) * per_metre)
        if i < 0 or j < 0 or k < 0 or i >= wide or j >= deep or k >= tall:
            break
        cell = (i * deep + j) * tall + k
        for slot in range(grid.starts[cell], grid.starts[cell + 1]):
            best, found = nearer(grid.rows, int(grid.items[slot]), ball, fall, best, found)
        room = max(1, int(grid.empty[cell])) - 1  # cells to leap over on every side
        leave = min(
            _leave(grid, chord, 0, i, room),
            _leave(grid, chord, 1, j, room),
            _leave(grid, chord, 2, k, room),
        )
        time = max(leave, time) + nudge
    return answer(grid.rows, best, found)


@jit
def _leave(grid, chord, axis, index, room):  # type: ignore[no-untyped-def]
    """When [s] the chord has crossed this cell and ``room`` more along an axis."""
    velocity = chord.velocity[axis]
    if abs(velocity) <= TINY:
        return NEVER
    face = index + 1 + room if velocity > 0.0 else index - room
    return (grid.low[axis] + face * grid.edge - chord.origin[axis]) / velocity

"""Blocks of sixteen neighbouring balls, each with a box around its balls' paths for some time.

In the free-fall frame a path is a straight line, so that the box of a block grows only when a ball
in it is hit. Balls are sorted into blocks along a curve that keeps neighbours together. They are
sorted again before the boxes have grown much: in every time window, and more often where balls are
hit often. A ball then searches only blocks whose boxes its own path enters. Eight boxes are tested
at once, as in the tree of obstacles: first boxes around eight nodes of eight blocks each, then the
boxes of the blocks.

Source: J. Skilling, Programming the Hilbert curve, AIP Conf. Proc. 707 (2004) 381.
"""

from typing import NamedTuple

import numpy as np

from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.periodic_sides import PeriodicSides, forget_extent, note_extent, time_in_box
from sim_core.numerics.simd import BOXES, LANES

# Number of balls from which blocks pay. With fewer balls, in a chamber that the shot crosses in one
# window, no block is left out.
MIN_BALLS = 1024
BITS = 5  # bits of the curve's code along each axis
# Mean number of path changes of a ball after which balls are sorted again. With fewer changes, the
# searches that end where knowledge ends cost more. With more changes, the boxes are wider.
CHANGES = 8
FAR = np.float32(1e30)  # corner of an empty box, which no path reaches


class Blocks(NamedTuple):
    """Order of the balls in the columns of the filter, and boxes around blocks of sixteen columns.

    Times count from the start of the present time window.

    column: column of each ball, (n,) int32.
    ball: ball in each column, -1 for none, (columns,) int32.
    boxes: low x, y, z and high x, y, z of eight boxes [m], (k, 6, 8) float32, widened by
        ``margin``.
    margin: distance of two centres that touch, plus an allowance for rounding [m].
    groups: boxes around eight nodes of ``boxes`` each, in the same form.
    sorted_at: time at which the balls were sorted [s], (1,).
    until: time until which the boxes hold the paths [s], (1,).
    interval: intended time between two sorts [s], (1,).
    changes: number of path changes since the last sort, (1,) int64.
    low, scale: lowest corner of the sorting curve's grid [m], (3,), and its cells per metre [1/m].
    sides: the sides of a periodic box; None in any other chamber.
    code, starts, ray, enter: working arrays.
    """

    column: np.ndarray
    ball: np.ndarray
    boxes: np.ndarray
    groups: np.ndarray
    sorted_at: np.ndarray
    until: np.ndarray
    interval: np.ndarray
    changes: np.ndarray
    code: np.ndarray
    starts: np.ndarray
    low: np.ndarray
    scale: float
    margin: float
    sides: PeriodicSides | None
    ray: np.ndarray
    enter: np.ndarray


def new_blocks(
    balls: int,
    low: np.ndarray,
    high: np.ndarray,
    margin: float,
    window: float,
    sides: PeriodicSides | None = None,
) -> Blocks:
    """Return blocks for a number of balls, unsorted, in a room from ``low`` to ``high`` [m]."""
    columns = -(-balls // LANES) * LANES
    nodes = -(-columns // (LANES * BOXES))
    return Blocks(
        np.zeros(balls, dtype=np.int32),
        np.full(columns, -1, dtype=np.int32),
        np.full((nodes, 6, BOXES), FAR, dtype=np.float32),
        np.full((-(-nodes // BOXES), 6, BOXES), FAR, dtype=np.float32),
        np.zeros(1),
        np.zeros(1),
        np.full(1, window),
        np.zeros(1, dtype=np.int64),
        np.zeros(balls, dtype=np.int32),
        np.zeros((1 << (3 * BITS)) + 1, dtype=np.int32),
        np.array(low, dtype=np.float64),
        float((1 << BITS) / np.max(np.asarray(high) - low)),
        float(margin),
        sides,
        np.zeros(9, dtype=np.float32),
        np.zeros(BOXES, dtype=np.float32),
    )


@inlined
def column_of(blocks: Blocks | None, ball: int) -> int:
    """Return the column of a ball in the filter. Without blocks it is the ball's number."""
    if blocks is None:
        return ball
    return int(blocks.column[ball])


@inlined
def ball_in_column(blocks: Blocks | None, column: int) -> int:
    """Return the ball in a column of the filter, -1 for none.

    Without blocks it is the column's number.
    """
    if blocks is None:
        return column
    return int(blocks.ball[column])


@inlined
def blocks_are_worn(blocks: Blocks | None, time: float) -> bool:
    """Return True if the balls must be sorted into blocks again before the event at ``time``."""
    if blocks is None:
        return False
    return bool(time >= blocks.until[0] or blocks.changes[0] > 2 * CHANGES * len(blocks.column))


@jit
def sort_blocks(blocks: Blocks | None, motion: np.ndarray, time: float, window: float) -> None:
    """Put balls that are near each other at ``time`` [s] into one block, and set its box.

    The boxes hold until balls are expected to have changed their paths CHANGES times each, at most
    until the time window ends.
    """
    if blocks is None:
        return
    lasted, changes = time - blocks.sorted_at[0], blocks.changes[0]
    if lasted > 0.0:
        wanted = lasted * CHANGES * len(motion) / max(changes, 1)
        blocks.interval[0] = min(max(wanted, 0.25 * lasted), 2.0 * blocks.interval[0], window)
    blocks.sorted_at[0] = time
    blocks.until[0] = min(time + min(blocks.interval[0], time_in_box(blocks.sides)), window)
    blocks.starts[:] = 0
    for ball in range(len(motion)):
        code = _place_on_curve(
            _cell(blocks, motion, ball, 0, time),
            _cell(blocks, motion, ball, 1, time),
            _cell(blocks, motion, ball, 2, time),
        )
        blocks.code[ball] = code
        blocks.starts[code + 1] += 1
    for code in range(1, len(blocks.starts)):
        blocks.starts[code] += blocks.starts[code - 1]
    blocks.boxes[:] = FAR
    blocks.groups[:] = FAR
    forget_extent(blocks.sides)
    for ball in range(len(motion)):
        column = blocks.starts[blocks.code[ball]]
        blocks.starts[blocks.code[ball]] += 1
        blocks.column[ball] = column
        blocks.ball[column] = ball
        widen(blocks, motion, ball, time)
    blocks.changes[0] = 0


@inlined
def _cell(blocks: Blocks, motion: np.ndarray, ball: int, axis: int, time: float) -> int:
    """Return the index along ``axis`` of the grid cell that holds a ball at ``time`` [s]."""
    now = motion[ball, axis] + motion[ball, 3 + axis] * time
    return min(max(int((now - blocks.low[axis]) * blocks.scale), 0), (1 << BITS) - 1)


@jit
def _place_on_curve(x: int, y: int, z: int) -> int:
    """Return the position number of grid cell (x, y, z) along Hilbert's curve.

    The curve goes from each cell to a neighbouring cell, without a jump.
    """
    bit = 1 << (BITS - 1)
    while bit > 1:  # undo the turns of the curve, from the largest cubes to the smallest
        low = bit - 1
        if x & bit:
            x ^= low
        if y & bit:
            x ^= low
        else:
            swap = (x ^ y) & low
            x, y = x ^ swap, y ^ swap
        if z & bit:
            x ^= low
        else:
            swap = (x ^ z) & low
            x, z = x ^ swap, z ^ swap
        bit >>= 1
    y ^= x
    z ^= y
    flips, bit = 0, 1 << (BITS - 1)
    while bit > 1:
        if z & bit:
            flips ^= bit - 1
        bit >>= 1
    x, y, z = x ^ flips, y ^ flips, z ^ flips
    place = 0
    for k in range(BITS - 1, -1, -1):
        place = 8 * place + 4 * ((x >> k) & 1) + 2 * ((y >> k) & 1) + ((z >> k) & 1)
    return place


@jit
def shift_blocks(blocks: Blocks | None, window: float) -> None:
    """Subtract the window's length [s] from the time of the last sorting: a new window begins."""
    if blocks is None:
        return
    blocks.sorted_at[0] -= window


@inlined
def widen(blocks: Blocks | None, motion: np.ndarray, ball: int, time: float) -> None:
    """Widen the boxes around a ball's block so that they hold its path from ``time`` [s] on."""
    if blocks is None:
        return
    blocks.changes[0] += 1
    block = blocks.column[ball] // LANES
    node, child = block // BOXES, block % BOXES
    group, place = node // BOXES, node % BOXES
    for axis in range(3):
        start = motion[ball, axis] + motion[ball, 3 + axis] * time
        end = motion[ball, axis] + motion[ball, 3 + axis] * blocks.until[0]
        low = np.float32(min(start, end) - blocks.margin)
        high = np.float32(max(start, end) + blocks.margin)
        note_extent(blocks.sides, axis, low, high)
        _stretch(blocks.boxes, node, axis, child, low, high)
        _stretch(blocks.groups, group, axis, place, low, high)


@inlined
def _stretch(
    boxes: np.ndarray, node: int, axis: int, child: int, low: np.float32, high: np.float32
) -> None:
    if boxes[node, 3 + axis, child] == FAR:  # an empty box
        boxes[node, axis, child] = low
        boxes[node, 3 + axis, child] = high
        return
    boxes[node, axis, child] = min(low, boxes[node, axis, child])
    boxes[node, 3 + axis, child] = max(high, boxes[node, 3 + axis, child])

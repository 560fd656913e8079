"""Many balls in blocks of sixteen neighbours, each with a box around its balls' paths in a window.

In the free-fall frame a path is a straight line, so the box of a block grows only when one of its
balls is hit. Every window, balls are sorted into blocks again, along a curve that keeps neighbours
together. A ball then looks only through blocks whose boxes its own path enters, eight boxes at
once, as in the tree of obstacles.

Source: G. M. Morton, A computer oriented geodetic data base, IBM Ltd. (1966): the curve.
"""

from typing import NamedTuple

import numpy as np

from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.simd import BOXES, LANES

# Number of balls from which blocks pay. With fewer, in a chamber that the shot crosses in one
# window, no block is left out.
MIN_BALLS = 1024
BITS = 5  # of the curve's code along each axis
FAR = np.float32(1e30)  # an empty box is one that no path reaches


class Blocks(NamedTuple):
    """Which ball is in which column of the filter, and the boxes around sixteen columns each.

    column: of each ball, (n,) int32. ball: in each column, -1 for none, (columns,) int32.
    boxes: low x, y, z and high x, y, z of eight boxes [m], (k, 6, 8) float32; they are larger by
        ``margin`` [m], which is the balls' reach and the rounding.
    low, scale: where the curve begins [m], (3,), and its steps [1/m].
    code, starts, ray, enter: working space.
    """

    column: np.ndarray
    ball: np.ndarray
    boxes: np.ndarray
    code: np.ndarray
    starts: np.ndarray
    low: np.ndarray
    scale: float
    margin: float
    ray: np.ndarray
    enter: np.ndarray


def new_blocks(balls: int, low: np.ndarray, high: np.ndarray, margin: float) -> Blocks:
    """Blocks of balls in a room from ``low`` to ``high`` (3,) [m]; to be sorted before use."""
    columns = -(-balls // LANES) * LANES
    nodes = -(-columns // (LANES * BOXES))
    return Blocks(
        np.zeros(balls, dtype=np.int32),
        np.full(columns, -1, dtype=np.int32),
        np.full((nodes, 6, BOXES), FAR, dtype=np.float32),
        np.zeros(balls, dtype=np.int32),
        np.zeros((1 << (3 * BITS)) + 1, dtype=np.int32),
        np.array(low, dtype=np.float64),
        float((1 << BITS) / np.max(np.asarray(high) - low)),
        float(margin),
        np.zeros(9, dtype=np.float32),
        np.zeros(BOXES, dtype=np.float32),
    )


@inlined
def column_of(blocks: Blocks | None, ball: int) -> int:
    """The column of a ball."""
    if blocks is None:
        return ball
    return blocks.column[ball]


@inlined
def ball_in_column(blocks: Blocks | None, column: int) -> int:
    """The ball in a column."""
    if blocks is None:
        return column
    return blocks.ball[column]


@jit
def sort_blocks(blocks: Blocks | None, motion: np.ndarray, window: float) -> None:
    """Put balls that are near each other at a window's start into one block, and set its box."""
    if blocks is None:
        return
    top = (1 << BITS) - 1
    blocks.starts[:] = 0
    for ball in range(len(motion)):
        code = 0
        for axis in range(3):
            place = int((motion[ball, axis] - blocks.low[axis]) * blocks.scale)
            place = min(max(place, 0), top)
            for bit in range(BITS):
                code |= ((place >> bit) & 1) << (3 * bit + axis)
        blocks.code[ball] = code
        blocks.starts[code + 1] += 1
    for code in range(1, len(blocks.starts)):
        blocks.starts[code] += blocks.starts[code - 1]
    blocks.boxes[:] = FAR
    for ball in range(len(motion)):
        column = blocks.starts[blocks.code[ball]]
        blocks.starts[blocks.code[ball]] += 1
        blocks.column[ball] = column
        blocks.ball[column] = ball
        widen(blocks, motion, ball, 0.0, window)


@inlined
def widen(blocks: Blocks | None, motion: np.ndarray, ball: int, time: float, window: float) -> None:
    """Widen the box of the ball's block to hold its path from ``time`` [s] to the window's end."""
    if blocks is None:
        return
    block = blocks.column[ball] // LANES
    node, child = block // BOXES, block % BOXES
    empty = blocks.boxes[node, 0, child] == FAR
    for axis in range(3):
        start = motion[ball, axis] + motion[ball, 3 + axis] * time
        end = motion[ball, axis] + motion[ball, 3 + axis] * window
        low = np.float32(min(start, end) - blocks.margin)
        high = np.float32(max(start, end) + blocks.margin)
        blocks.boxes[node, axis, child] = (
            low if empty else min(low, blocks.boxes[node, axis, child])
        )
        blocks.boxes[node, 3 + axis, child] = (
            high if empty else max(high, blocks.boxes[node, 3 + axis, child])
        )

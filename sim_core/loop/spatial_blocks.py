"""Many balls in blocks of sixteen neighbours, each block with a box that holds its balls' paths for one window.

In the free-fall frame a path is a straight line, so a block's box grows only when one of its balls is hit; balls are
sorted into blocks anew every window, along a curve that keeps neighbours together (Morton, IBM Ltd. 1966). A ball
then looks only through blocks whose boxes its own path enters, eight boxes at once, as in the tree of obstacles.
"""

from typing import NamedTuple

import numpy as np

from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.simd import BOXES, LANES

# Balls from which blocks pay: with fewer, in a chamber that the shot crosses in one window, no block is left out.
MANY = 1024
BITS = 5  # of the curve's code along each axis
FAR = np.float32(1e30)  # an empty box is one no path reaches


class Blocks(NamedTuple):
    """``slot`` (n,) int32: the lane of each ball; ``ball`` (lanes,) int32: the ball in each lane, -1 none.

    ``boxes`` (k, 6, 8) float32 [m]: low x, y, z and high x, y, z of eight blocks' boxes, grown by ``grow`` [m], which
    is the balls' reach and a margin; ``code``, ``tally``, ``ray`` and
    ``enter``: working space; ``low`` (3,) [m] and
    ``scale`` [1/m]: where the curve begins, and its steps.
    """

    slot: np.ndarray
    ball: np.ndarray
    boxes: np.ndarray
    code: np.ndarray
    tally: np.ndarray
    low: np.ndarray
    scale: float
    grow: float
    ray: np.ndarray
    enter: np.ndarray


def new_blocks(balls: int, low: np.ndarray, high: np.ndarray, grow: float) -> Blocks:
    """Blocks for so many balls in a room from ``low`` to ``high`` (3,) [m]; to be sorted before use."""
    lanes = -(-balls // LANES) * LANES
    nodes = -(-lanes // (LANES * BOXES))
    return Blocks(
        np.zeros(balls, dtype=np.int32),
        np.full(lanes, -1, dtype=np.int32),
        np.full((nodes, 6, BOXES), FAR, dtype=np.float32),
        np.zeros(balls, dtype=np.int32),
        np.zeros((1 << (3 * BITS)) + 1, dtype=np.int32),
        np.array(low, dtype=np.float64),
        float((1 << BITS) / np.max(np.asarray(high) - low)),
        float(grow),
        np.zeros(9, dtype=np.float32),
        np.zeros(BOXES, dtype=np.float32),
    )


@inlined
def slot_of(blocks: Blocks | None, ball: int) -> int:
    """The lane of a ball."""
    if blocks is None:
        return ball
    return blocks.slot[ball]


@inlined
def ball_in(blocks: Blocks | None, slot: int) -> int:
    """The ball in a lane."""
    if blocks is None:
        return slot
    return blocks.ball[slot]


@jit
def sort_blocks(blocks: Blocks | None, motion: np.ndarray, window: float) -> None:
    """Put balls that are near each other at the window's start into one block, and draw the blocks' boxes."""
    if blocks is None:
        return
    top = (1 << BITS) - 1
    blocks.tally[:] = 0
    for ball in range(len(motion)):
        code = 0
        for axis in range(3):
            place = int((motion[ball, axis] - blocks.low[axis]) * blocks.scale)
            place = min(max(place, 0), top)
            for bit in range(BITS):
                code |= ((place >> bit) & 1) << (3 * bit + axis)
        blocks.code[ball] = code
        blocks.tally[code + 1] += 1
    for code in range(1, len(blocks.tally)):
        blocks.tally[code] += blocks.tally[code - 1]
    blocks.boxes[:] = FAR
    for ball in range(len(motion)):
        slot = blocks.tally[blocks.code[ball]]
        blocks.tally[blocks.code[ball]] += 1
        blocks.slot[ball] = slot
        blocks.ball[slot] = ball
        widen(blocks, motion, ball, 0.0, window)


@inlined
def widen(blocks: Blocks | None, motion: np.ndarray, ball: int, time: float, window: float) -> None:
    """Let the ball's block hold its path from ``time`` [s] to the window's end."""
    if blocks is None:
        return
    block = blocks.slot[ball] // LANES
    node, child = block // BOXES, block % BOXES
    empty = blocks.boxes[node, 0, child] == FAR
    for axis in range(3):
        start = motion[ball, axis] + motion[ball, 3 + axis] * time
        end = motion[ball, axis] + motion[ball, 3 + axis] * window
        low = np.float32(min(start, end) - blocks.grow)
        high = np.float32(max(start, end) + blocks.grow)
        blocks.boxes[node, axis, child] = (
            low if empty else min(low, blocks.boxes[node, axis, child])
        )
        blocks.boxes[node, 3 + axis, child] = (
            high if empty else max(high, blocks.boxes[node, 3 + axis, child])
        )

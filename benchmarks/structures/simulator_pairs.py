"""The product's own search, asked in mid window.

At that time the boxes of its blocks are as wide as they are on average. When the window began every
ball flew another way, and its block was drawn for that flight. Since then each ball was hit once.
"""

from typing import NamedTuple

import numpy as np

from benchmarks.gas import HEIGHT, Gas
from benchmarks.structures.compiled import jit, searches
from sim_core.loop.neighbours import (
    NeighbourFilter,
    follow,
    new_neighbour_filter,
    next_meeting,
    refresh_neighbours,
)
from sim_core.motion import WINDOW
from sim_core.numerics.roots import NEVER


class ProductPairs(NamedTuple):
    """The balls and the product's search structure for them.

    ``motion`` (n, 6) is in the free-fall frame with time 0 at the start of the window,
    ``neighbours`` is built from it, and ``now`` [s] is on the window's clock.
    """

    motion: np.ndarray
    neighbours: NeighbourFilter
    now: float


def build(gas: Gas) -> ProductPairs:
    """The balls and their crowd."""
    now = min(0.5 * WINDOW, WINDOW - gas.limit)  # no search goes past a window's end
    place, velocity = gas.motion[:, :3], gas.motion[:, 3:]
    high = np.array([0.5 * gas.width, 0.5 * gas.width, HEIGHT])
    low = np.array([-0.5 * gas.width, -0.5 * gas.width, 0.0])
    start = np.clip(place - now * np.roll(velocity, 1, axis=0), low, high)
    motion = np.concatenate([start, (place - start) / now], axis=1)
    fastest = 2.0 * float(np.abs(velocity).max())
    pairs = ProductPairs(
        motion, new_neighbour_filter(motion, low, high, gas.reach, fastest, WINDOW), now
    )
    motion[:] = np.concatenate([place - now * velocity, velocity], axis=1)
    _follow_all(pairs)
    return pairs


@jit
def _follow_all(pairs):  # type: ignore[no-untyped-def]
    for ball in range(len(pairs.motion)):
        follow(pairs.neighbours, pairs.motion, ball, pairs.now)


@searches(ProductPairs)
def search(pairs, ball, time, before):  # type: ignore[no-untyped-def]
    """Time [s] and partner of the ball's first meeting before ``before`` and the window's end."""
    time, partner = next_meeting(
        pairs.neighbours, pairs.motion, ball, pairs.now + time, pairs.now + before
    )
    return (time - pairs.now, partner) if partner >= 0 else (NEVER, -1)


@jit
def upkeep(pairs, ends, before, times, partners):  # type: ignore[no-untyped-def]
    """The work of a whole window.

    All balls are registered again. If they are in blocks, they are sorted and searched for once
    more, because no search goes past the end of a window. Then every flight begun in the window is
    followed.
    """
    balls = len(ends)
    if balls == 0:
        return 0
    refresh_neighbours(pairs.neighbours, pairs.motion, 0.0)
    for ball in range(balls if pairs.neighbours.blocks is not None else 0):
        times[ball], partners[ball] = search(pairs, ball, 0.0, before)
    flown = 0.0
    for ball in range(balls):
        flown += ends[ball]
    flights = int(balls * balls * WINDOW / flown)
    for k in range(flights):
        follow(pairs.neighbours, pairs.motion, k % balls, pairs.now)
    return flights

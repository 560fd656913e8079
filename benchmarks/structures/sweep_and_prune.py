"""Sweep and prune: the intervals of one axis that the flights of balls cover, kept sorted.

The method is from Baraff 1992 and I-COLLIDE 1995.
"""

from typing import NamedTuple

import numpy as np

from benchmarks.gas import Gas
from benchmarks.structures.compiled import jit, searches
from benchmarks.structures.pairs import sooner
from sim_core.numerics.roots import NEVER

MARGIN = 1e-9  # m: more than rounding of a coordinate


class SweepAndPrune(NamedTuple):
    """The intervals that the flights cover on the axis.

    ``low`` and ``high`` (n,) [m] are their ends, sorted by ``low``. ``names`` (n,) is the ball of
    each interval, ``place`` (n,) the interval of each ball, and ``longest`` (1,) [m] the longest
    interval.
    """

    motion: np.ndarray
    reach: float
    low: np.ndarray
    high: np.ndarray
    names: np.ndarray
    place: np.ndarray
    longest: np.ndarray


def build(gas: Gas) -> SweepAndPrune:
    """Stretches up to the gas's limit."""
    start, end = gas.motion[:, 0], gas.motion[:, 0] + gas.limit * gas.motion[:, 3]
    low = np.minimum(start, end) - 0.5 * gas.reach - MARGIN
    high = np.maximum(start, end) + 0.5 * gas.reach + MARGIN
    order = np.argsort(low)
    longest = np.array([(high - low).max()])
    return SweepAndPrune(
        gas.motion, gas.reach, low[order], high[order], order, np.argsort(order), longest
    )


@searches(SweepAndPrune)
def search(sweep, ball, time, before):  # type: ignore[no-untyped-def]
    """Time [s] and partner of the ball's first meeting before ``before``."""
    best, partner = before - time, -1
    own = sweep.place[ball]
    low, high = sweep.low[own], sweep.high[own]
    k = own - 1
    while k >= 0 and sweep.low[k] + sweep.longest[0] >= low:
        if sweep.high[k] >= low:
            best, partner = sooner(
                sweep.motion, sweep.reach, ball, sweep.names[k], time, best, partner
            )
        k -= 1
    k = own + 1
    while k < len(sweep.low) and sweep.low[k] <= high:
        best, partner = sooner(sweep.motion, sweep.reach, ball, sweep.names[k], time, best, partner)
        k += 1
    return (time + best, partner) if partner >= 0 else (NEVER, -1)


@jit
def upkeep(sweep, ends, before, times, partners):  # type: ignore[no-untyped-def]
    """Gives every ball a new interval and moves it to its place.

    Every ball flies off the other way when its flight ends.
    """
    for ball in range(len(ends)):
        turn = sweep.motion[ball, 0] + ends[ball] * sweep.motion[ball, 3]
        end = turn - before * sweep.motion[ball, 3]
        low = min(turn, end) - 0.5 * sweep.reach - MARGIN
        high = max(turn, end) + 0.5 * sweep.reach + MARGIN
        sweep.longest[0] = max(sweep.longest[0], high - low)
        k = sweep.place[ball]
        while k > 0 and sweep.low[k - 1] > low:
            _move(sweep, k - 1, k)
            k -= 1
        while k + 1 < len(ends) and sweep.low[k + 1] < low:
            _move(sweep, k + 1, k)
            k += 1
        sweep.low[k], sweep.high[k], sweep.names[k], sweep.place[ball] = low, high, ball, k
    return len(ends)


@jit
def _move(sweep, origin, target):  # type: ignore[no-untyped-def]
    sweep.low[target], sweep.high[target], sweep.names[target] = (
        sweep.low[origin],
        sweep.high[origin],
        sweep.names[origin],
    )
    sweep.place[sweep.names[origin]] = target

"""No structure: every ball asked, one after the other, in float64."""

from typing import NamedTuple

import numpy as np

from benchmarks.gas import Gas
from benchmarks.structures.compiled import jit, searches
from benchmarks.structures.pairs import sooner
from sim_core.numerics.roots import NEVER


class AllPairs(NamedTuple):
    motion: np.ndarray
    reach: float


def build(gas: Gas) -> AllPairs:
    """Nothing but the balls."""
    return AllPairs(gas.motion, gas.reach)


@searches(AllPairs)
def search(pairs, ball, time, before):  # type: ignore[no-untyped-def]
    """Time [s] and partner of the ball's first meeting before ``before``."""
    best, partner = before - time, -1
    for other in range(len(pairs.motion)):
        if other != ball:
            best, partner = sooner(pairs.motion, pairs.reach, ball, other, time, best, partner)
    return (time + best, partner) if partner >= 0 else (NEVER, -1)


@jit
def upkeep(pairs, ends, before, times, partners):  # type: ignore[no-untyped-def]
    """Nothing to do."""
    return len(ends)

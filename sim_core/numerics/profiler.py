"""Time spent in each part of the event loop. Machine code has no profiler unless requested."""

from typing import NamedTuple

import numpy as np

from sim_core.numerics.jit import inlined
from sim_core.numerics.simd import ticks

NEXT, RESOLVE, PAIRS, WALLS, SCHEDULE = 0, 1, 2, 3, 4
PARTS = ("next event", "resolve", "pairs", "walls", "event queue")


class Profiler(NamedTuple):
    """Time spent in each part of the event loop, in ticks of the processor's clock."""

    spent: np.ndarray  # time in each of PARTS, shape (parts,) int64
    last: np.ndarray  # end of the last part, shape (1,) int64


def new_profiler() -> Profiler:
    """Return a profiler with nothing recorded."""
    return Profiler(np.zeros(len(PARTS), dtype=np.int64), np.zeros(1, dtype=np.int64))


@inlined
def add_time(profiler: Profiler | None, part: int) -> None:
    """Add the time since the last call to part number ``part``.

    A negative number only starts the clock.
    """
    if profiler is None:
        return
    now = ticks()
    if part >= 0:
        profiler.spent[part] += now - profiler.last[0]
    profiler.last[0] = now

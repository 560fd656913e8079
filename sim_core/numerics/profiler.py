"""Where the event loop's time goes, part by part; absent from the machine code unless it is asked for."""

from typing import NamedTuple

import numpy as np

from sim_core.numerics.jit import inlined
from sim_core.numerics.simd import ticks

# parts of the loop
NEXT, RESOLVE, PAIRS, WALLS, SCHEDULE = 0, 1, 2, 3, 4
PARTS = ("next event", "resolve", "pairs", "walls", "calendar")


class Profiler(NamedTuple):
    """``spent`` (parts,) int64: ticks of the processor's clock in each part; ``last`` (1,): when the last one ended."""

    spent: np.ndarray
    last: np.ndarray


def new_profiler() -> Profiler:
    """A profiler that has measured nothing."""
    return Profiler(np.zeros(len(PARTS), dtype=np.int64), np.zeros(1, dtype=np.int64))


@inlined
def add_time(profiler: Profiler | None, part: int) -> None:
    """What has passed since the last lap was spent in this part; a negative part only starts the clock."""
    if profiler is None:
        return
    now = ticks()
    if part >= 0:
        profiler.spent[part] += now - profiler.last[0]
    profiler.last[0] = now

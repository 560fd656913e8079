"""No structure: every obstacle tested exactly. The reference that the others are held to."""

from typing import NamedTuple

import numpy as np

from benchmarks.structures.compiled import searches
from benchmarks.structures.mesh_obstacles import Rows, Shell, answer, nearer, sort_rows


class EveryObstacle(NamedTuple):
    rows: Rows


def build(shell: Shell) -> EveryObstacle:
    """The obstacles as they come."""
    return EveryObstacle(sort_rows(shell, np.arange(len(shell.kinds))))


@searches(EveryObstacle)
def nearest(every, ball, fall, length):  # type: ignore[no-untyped-def]
    """Delay [s] and obstacle of the first contact within ``length`` [s]."""
    best, found = length, -1
    for row in range(len(every.rows.kinds)):
        best, found = nearer(every.rows, row, ball, fall, best, found)
    return answer(every.rows, best, found)

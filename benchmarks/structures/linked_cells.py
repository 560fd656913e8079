"""Linked cells: each cell is a chain of balls.

The method is from Rapaport, Journal of Computational Physics 34 (1980) 184. Cells are wider than a
ball and lie in the free-fall frame, where flights are straight. They repeat from wall to wall, so
that a ball is never outside. Two balls that meet are then in the same or in neighbouring cells. A
ball therefore looks into 27 cells when its flight begins, and into the 9 new ones whenever it or
the other ball has crossed a border.
"""

from typing import NamedTuple

import numpy as np

from benchmarks.gas import HEIGHT, PER_BALL, Gas
from benchmarks.structures.compiled import jit, searches
from benchmarks.structures.pairs import sooner
from sim_core.loop.event_queue import EventQueue, new_event_queue, reschedule
from sim_core.numerics.roots import NEVER

HELD = 0.3  # balls a cell on average; 0.7 and 1.5 measured 15 and 30 % slower


class LinkedCells(NamedTuple):
    """The balls in their cells.

    ``edge`` [m] is the width of a cell, ``shape`` (3,) the number of cells until they repeat, and
    ``where`` (n, 3) int32 the cell of each ball, counted without repeating. ``queue`` knows when
    each ball crosses a border next. ``first`` (cells,) int32 and ``after`` and ``before`` (n,)
    int32 are the chains, with -1 at their ends.
    """

    motion: np.ndarray
    reach: float
    edge: float
    shape: np.ndarray
    where: np.ndarray
    queue: EventQueue
    first: np.ndarray
    after: np.ndarray
    before: np.ndarray


def build(gas: Gas) -> LinkedCells:
    """All balls in their cells."""
    edge = max((HELD * PER_BALL) ** (1.0 / 3.0), 1.000001 * gas.reach)
    shape = np.maximum(3, np.ceil(np.array([gas.width, gas.width, HEIGHT]) / edge)).astype(np.int64)
    where = np.floor(gas.motion[:, :3] / edge).astype(np.int32)
    first = np.full(int(shape.prod()), -1, dtype=np.int32)
    after, before = np.full((2, len(where)), -1, dtype=np.int32)
    cells = LinkedCells(
        gas.motion, gas.reach, edge, shape, where, new_event_queue(len(where)), first, after, before
    )
    _join_all(cells)
    return cells


@jit
def _cell_at(cells, x, y, z):  # type: ignore[no-untyped-def]
    """Number of the cell with these places along the axes."""
    shape = cells.shape
    return ((x % shape[0]) * shape[1] + y % shape[1]) * shape[2] + z % shape[2]


@jit
def _cell_of(cells, ball):  # type: ignore[no-untyped-def]
    where = cells.where
    return _cell_at(
        cells, np.int64(where[ball, 0]), np.int64(where[ball, 1]), np.int64(where[ball, 2])
    )


@jit
def _next_border(cells, ball):  # type: ignore[no-untyped-def]
    """When [s] the ball leaves its cell, along which axis, and which way."""
    when, chosen, way = NEVER, 0, 1
    for axis in range(3):
        velocity = cells.motion[ball, 3 + axis]
        if velocity != 0.0:
            side = 1 if velocity > 0.0 else 0
            time = (
                (cells.where[ball, axis] + side) * cells.edge - cells.motion[ball, axis]
            ) / velocity
            if time < when:
                when, chosen, way = time, axis, 2 * side - 1
    return when, chosen, way


@jit
def _join(cells, ball):  # type: ignore[no-untyped-def]
    """Put the ball into its cell's chain, and its next crossing of a border into the queue."""
    cell = _cell_of(cells, ball)
    head = cells.first[cell]
    cells.first[cell], cells.after[ball], cells.before[ball] = ball, head, -1
    if head >= 0:
        cells.before[head] = ball
    cells.queue.wall_time[ball] = _next_border(cells, ball)[0]
    reschedule(cells.queue, ball)


@jit
def _leave(cells, ball):  # type: ignore[no-untyped-def]
    after, before = cells.after[ball], cells.before[ball]
    if before >= 0:
        cells.after[before] = after
    else:
        cells.first[_cell_of(cells, ball)] = after
    if after >= 0:
        cells.before[after] = before


@jit
def _join_all(cells):  # type: ignore[no-untyped-def]
    for ball in range(len(cells.motion)):
        _join(cells, ball)


@searches(LinkedCells)
def search(cells, ball, time, before):  # type: ignore[no-untyped-def]
    """Time [s] and partner of the first meeting with a ball now in a cell near by."""
    x, y, z = cells.where[ball, 0], cells.where[ball, 1], cells.where[ball, 2]
    best, partner = before - time, -1
    for i in range(-1, 2):
        for j in range(-1, 2):
            for k in range(-1, 2):
                other = np.int64(cells.first[_cell_at(cells, x + i, y + j, z + k)])
                while other >= 0:
                    if other != ball:
                        best, partner = sooner(
                            cells.motion, cells.reach, ball, other, time, best, partner
                        )
                    other = np.int64(cells.after[other])
    return (time + best, partner) if partner >= 0 else (NEVER, -1)


@jit
def upkeep(cells, ends, before, times, partners):  # type: ignore[no-untyped-def]
    """Plays all crossings."""
    crossings, in_flight = 0, 0
    while True:
        ball = np.int64(cells.queue.winners[1])
        time = cells.queue.match_time[1]
        if (
            time >= before
        ):  # what was played past the ends of flights counts as that many flights more
            return len(ends) * max(1, crossings) / max(1, in_flight)
        crossings += 1
        if time < ends[ball]:
            in_flight += 1
        _, axis, way = _next_border(cells, ball)
        _leave(cells, ball)
        cells.where[ball, axis] += way
        x, y, z = cells.where[ball, 0], cells.where[ball, 1], cells.where[ball, 2]
        for i in range(-1, 2):
            for j in range(-1, 2):
                for k in range(-1, 2):
                    if (i, j, k)[axis] == way:  # ahead
                        _tell(
                            cells,
                            _cell_at(cells, x + i, y + j, z + k),
                            ball,
                            time,
                            before,
                            times,
                            partners,
                        )
        _join(cells, ball)


@jit
def _tell(cells, cell, ball, time, before, times, partners):  # type: ignore[no-untyped-def]
    """Enter the ball's meetings with those in a cell among the answers of both."""
    other = np.int64(cells.first[cell])
    while other >= 0:
        delay, met = sooner(cells.motion, cells.reach, ball, other, time, before - time, -1)
        if met >= 0:
            _enter(ball, other, time + delay, times, partners)
            _enter(other, ball, time + delay, times, partners)
        other = np.int64(cells.after[other])


@jit
def _enter(ball, other, time, times, partners):  # type: ignore[no-untyped-def]
    """Note a meeting with a ball that knows of none sooner."""
    if time < times[ball]:
        times[ball], partners[ball] = time, other

"""What every structure over the balls shares: the exact test of a pair, and the loop in which it is timed.

Such a structure offers ``build(gas)``; a search ``(structure, ball, time, before)``: time [s] and partner of the
ball's first meeting that it can see; and ``upkeep(structure, ends, before, times, partners)``: keeps up with the
balls, enters among the answers what it sees later, and returns how many flights, each until its end, that was worth.
"""

from benchmarks.structures.compiled import jit, search
from sim_core.detect.ball_ball import pair_delay
from sim_core.motion import free_fall_position
from sim_core.numerics.vec3 import Vec3, sub


@jit
def sooner(motion, reach, ball, other, time, best, partner):  # type: ignore[no-untyped-def]
    """The first meeting known, after ``best`` [s] from ``time``, and its partner, once this other has been looked
    at.
    """
    here, there = free_fall_position(motion, ball, time), free_fall_position(motion, other, time)
    closing = Vec3(
        motion[other, 3] - motion[ball, 3],
        motion[other, 4] - motion[ball, 4],
        motion[other, 5] - motion[ball, 5],
    )
    delay = pair_delay(sub(there, here), closing, reach)
    return (delay, other) if delay < best else (best, partner)


@jit
def ask(structure, before, times, partners):  # type: ignore[no-untyped-def]
    """The loop over all balls, now, that every structure is timed in."""
    for ball in range(len(times)):
        times[ball], partners[ball] = search(structure, ball, 0.0, before)

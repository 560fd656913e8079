"""What every structure over the balls shares: the exact test of a pair and the timed loop.

Such a structure offers three functions. ``build(gas)`` makes it. A search ``(structure, ball, time,
before)`` gives the time [s] and partner of the first meeting of the ball that the structure can
see. ``upkeep(structure, ends, before, times, partners)`` follows the balls, enters among the
answers what the structure sees only later, and returns how many flights, each to its end, that work
covers.
"""

from benchmarks.structures.compiled import jit, search
from sim_core.detect.ball_ball import pair_delay
from sim_core.motion import free_fall_position
from sim_core.numerics.vec3 import Vec3, sub


@jit
def sooner(motion, reach, ball, other, time, best, partner):  # type: ignore[no-untyped-def]
    """The first meeting known and its partner, after a look at this other ball.

    ``best`` [s] is counted from ``time``.
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

"""A ball that slides along a round side goes on in short hops.

Where restitution takes the last of its normal speed, a ball that circles in a cylinder comes to hit the side infinitely
often in finite time, and would slide on it from then on. Here it goes on leaving and meeting it at the angle HOP: no
energy comes in or goes, and friction finds the same force, m v²/R on average. Mesh sides are flat and need none of it.
"""

import math

from sim_core.geometry.obstacles import ROUND, Bore
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Vec3, along

RECONTACT_ANGLE = 1e-4  # rad: hops R HOP²/2 = 0.2 nm high; a ball of 5 m/s makes a million a second, a tenth of what is a jam


@jit
def leave_cylinder_wall(
    bore: Bore | None, kind: int, away: Vec3, relative: Vec3, change: Vec3
) -> Vec3:
    """The velocity change [m/s] that makes a ball leave the round side at no less than HOP; ``away``: its unit normal,
    ``relative`` [m/s]: the ball's velocity before, ``change``: as restitution and friction have it.
    """
    if bore is None:
        return change
    if kind != ROUND:
        return change
    x, y = relative.x + change.x, relative.y + change.y
    out = away.x * x + away.y * y
    round_it = away.x * y - away.y * x
    least = RECONTACT_ANGLE * abs(round_it)
    if out >= least:
        return change
    rate = away.x * relative.x + away.y * relative.y
    borrowed = max(least * least - rate * rate, 0.0)
    slower = math.copysign(math.sqrt(round_it * round_it - borrowed), round_it) - round_it
    return along(along(change, least - out, away), slower, Vec3(-away.y, away.x, 0.0))

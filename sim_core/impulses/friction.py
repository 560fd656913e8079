"""What friction adds to a hit: a tangential kick against the slip of the touching points, and spin.

The formulas and their source are in effects/friction.py. Velocities change per mass; a kick j on the surface of a
solid sphere of radius R, at -R n from its centre, changes its spin by -5/(2R) n x j.
"""

import math

from sim_core.effects.friction import OF_BALLS, FrictionState, law_of, spin_at
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.vec3 import Vec3, along, cross, dot, sub

STICK = (
    2.0 / 7.0
)  # of solid spheres: share of v_t that a kick has to take from the centre to stop the touching point
ALONE, PAIR = 1.0, 0.5  # m_eff over m


@inlined
def rub_surface(
    friction_state: FrictionState | None,
    ball: int,
    time: float,
    away: Vec3,
    relative: Vec3,
    change: Vec3,
    tag: int,
) -> Vec3:
    """The velocity change [m/s] of a ball at a surface, with friction; the ball's spin is changed.

    ``change`` [m/s]: that without; ``away``: any vector along the normal, from the surface to the ball; ``relative``
    [m/s]: the ball's velocity minus that of the touched point. All in the room's frame.
    """
    if friction_state is None:
        return change
    normal = _unit(away)
    slip = along(
        relative, -friction_state.radius, cross(spin_at(friction_state, ball, time), normal)
    )
    rub = _rub(slip, normal, change, law_of(friction_state, tag), ALONE)
    _turn(friction_state, ball, normal, rub)
    return along(change, 1.0, rub)


@inlined
def rub_pair(
    friction_state: FrictionState | None,
    one: int,
    two: int,
    time: float,
    apart: Vec3,
    closing: Vec3,
    change: Vec3,
) -> Vec3:
    """The same for two balls that meet: the velocity change of the first, and minus that of the second.

    ``apart`` [m], ``closing`` [m/s]: second minus first.
    """
    if friction_state is None:
        return change
    normal = _unit(apart)
    spin = along(spin_at(friction_state, one, time), 1.0, spin_at(friction_state, two, time))
    slip = along(closing, -friction_state.radius, cross(spin, normal))
    rub = _rub(slip, normal, change, law_of(friction_state, OF_BALLS), PAIR)  # on the second
    _turn(friction_state, one, normal, rub)
    _turn(friction_state, two, normal, rub)  # the opposite kick on the opposite side: the same spin
    return sub(change, rub)


@jit
def _unit(away: Vec3) -> Vec3:
    scale = 1.0 / math.sqrt(dot(away, away))
    return Vec3(scale * away.x, scale * away.y, scale * away.z)


@jit
def _rub(slip: Vec3, normal: Vec3, push: Vec3, law: tuple[float, float], mass: float) -> Vec3:
    """The tangential kick [m/s] that goes with the normal one ``push`` [m/s]."""
    mu, beta0 = law
    slip = along(slip, -dot(slip, normal), normal)
    speed = math.sqrt(dot(slip, slip))
    if speed == 0.0:
        return Vec3(0.0, 0.0, 0.0)
    share = min(mu * math.sqrt(dot(push, push)) / speed, STICK * (1.0 + beta0) * mass)
    return Vec3(-share * slip.x, -share * slip.y, -share * slip.z)


@jit
def _turn(friction_state: FrictionState, ball: int, normal: Vec3, rub: Vec3) -> None:
    """Change the spin of a ball that is kicked by ``rub`` [m/s] at -R ``normal`` from its centre."""
    torque = cross(normal, rub)
    for axis in range(3):
        friction_state.spins[ball, axis] -= 2.5 / friction_state.radius * torque[axis]

"""Friction at a collision: a tangential velocity change against the slip, and a change of spin.

effects/friction.py has the formulas and their source. Impulses are per mass, that is, velocity
changes. An impulse j on the surface of a solid sphere of radius R, at -R n from its centre, changes
the sphere's spin by -5/(2R) n x j.
"""

import math

from sim_core.effects.ball_sizes import BallSizes, radius_of_ball, share_by_mass
from sim_core.effects.friction import OF_BALLS, FrictionState, friction_of, spin_at
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.vec3 import Vec3, add_scaled, cross, dot, scaled, sub

# Share of v_t by which the centre's velocity changes when the touching point stops, for solid
# spheres.
STICK = 2.0 / 7.0
ALONE, PAIR = 1.0, 0.5  # m_eff over m


@inlined
def add_surface_friction(
    friction: FrictionState | None,
    sizes: BallSizes | None,
    ball: int,
    time: float,
    away: Vec3,
    relative: Vec3,
    change: Vec3,
    tag: int,
) -> Vec3:
    """Return ``change`` [m/s] plus friction, for a ball that hits a surface. Change its spin.

    Args:
        friction: None without the effect.
        sizes: None if all balls are alike.
        ball: number of the ball.
        time: time since the start of the present time window [s].
        away: any vector along the normal, from the surface to the ball, in the room's frame.
        relative: the ball's velocity minus the velocity of the touched point, in the room's frame
            [m/s].
        change: velocity change without friction [m/s].
        tag: tag of the surface.
    """
    if friction is None:
        return change
    normal, radius = _unit(away), radius_of_ball(sizes, friction.radius, ball)
    slip = add_scaled(relative, -radius, cross(spin_at(friction, ball, time), normal))
    tangential = _tangential_change(slip, normal, change, friction_of(friction, tag), ALONE)
    _add_spin(friction, ball, radius, normal, tangential)
    return add_scaled(change, 1.0, tangential)


@inlined
def add_pair_friction(
    friction: FrictionState | None,
    sizes: BallSizes | None,
    one: int,
    two: int,
    time: float,
    apart: Vec3,
    closing: Vec3,
    change: Vec3,
) -> Vec3:
    """Return ``change`` [m/s] plus friction, for the first of two balls. Change both spins.

    The second ball has minus the returned velocity change. For balls of unequal mass both changes
    are what they would be at equal masses, as in effects/ball_sizes.py. The spins are those of the
    true masses.

    Args:
        friction: None without the effect.
        sizes: None if all balls are alike.
        one: number of the first ball.
        two: number of the second ball.
        time: time since the start of the present time window [s].
        apart: second position minus first [m].
        closing: second velocity minus first [m/s].
        change: velocity change of the first ball without friction [m/s].
    """
    if friction is None:
        return change
    normal = _unit(apart)
    radius_one = radius_of_ball(sizes, friction.radius, one)
    radius_two = radius_of_ball(sizes, friction.radius, two)
    ratio = radius_two / radius_one
    spin = add_scaled(spin_at(friction, one, time), ratio, spin_at(friction, two, time))
    slip = add_scaled(closing, -radius_one, cross(spin, normal))
    # change of the second ball
    tangential = _tangential_change(slip, normal, change, friction_of(friction, OF_BALLS), PAIR)
    # the opposite change on the opposite side gives the first ball the same spin
    _add_spin(friction, one, radius_one, normal, share_by_mass(sizes, one, two, tangential))
    _add_spin(friction, two, radius_two, normal, share_by_mass(sizes, two, one, tangential))
    return sub(change, tangential)


@jit
def _unit(away: Vec3) -> Vec3:
    return scaled(1.0 / math.sqrt(dot(away, away)), away)


@jit
def _tangential_change(
    slip: Vec3, normal: Vec3, push: Vec3, coefficients: tuple[float, float], mass: float
) -> Vec3:
    """Return the tangential velocity change [m/s] by friction in a hit.

    Args:
        slip: relative velocity of the touching points [m/s].
        normal: unit normal of the contact.
        push: normal velocity change in the same hit [m/s].
        coefficients: mu and beta0 of the contact.
        mass: effective mass over the ball's mass, 1 at a surface and 1/2 for two balls.
    """
    mu, beta0 = coefficients
    slip = add_scaled(slip, -dot(slip, normal), normal)
    speed = math.sqrt(dot(slip, slip))
    if speed == 0.0:
        return Vec3(0.0, 0.0, 0.0)
    share = min(mu * math.sqrt(dot(push, push)) / speed, STICK * (1.0 + beta0) * mass)
    return scaled(-share, slip)


@jit
def _add_spin(
    friction: FrictionState, ball: int, radius: float, normal: Vec3, tangential: Vec3
) -> None:
    """Change a ball's spin by a hit that adds ``tangential`` [m/s] to its velocity.

    ``radius``: radius of the ball [m]. ``normal``: unit vector from the touched point to the ball's
    centre.
    """
    torque = cross(normal, tangential)
    for axis in range(3):
        friction.spins[ball, axis] -= 2.5 / radius * torque[axis]

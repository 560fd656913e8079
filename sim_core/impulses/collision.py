"""Velocity changes at a collision without friction.

The normal relative velocity is reversed and multiplied by e, the coefficient of restitution from
effects/restitution.py and, on thin parts, effects/flexure.py. The tangential velocity is kept. Two
equal balls keep their momentum here, and effects/ball_sizes.py corrects the change for unequal
balls.

A ball that circles in a cylinder and loses the last of its normal speed to restitution would hit
the wall infinitely often in finite time, and slide on it from then on. Instead it goes on leaving
and meeting the wall at a small angle. No energy comes in or goes, and friction finds the same
force, m v²/R on average. The sides of a mesh are flat and need no such angle.
"""

import math

from sim_core.effects.flexure import FlexureState, restitution_with_flexure
from sim_core.effects.restitution import RestitutionState, ball_restitution, surface_restitution
from sim_core.geometry.analytic import CylinderAxis
from sim_core.geometry.obstacles import CYLINDER_WALL
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Touch, Vec3, add_scaled, dot, scaled

# Smallest angle [rad] at which a ball leaves a cylinder wall: the ball moves R angle²/2 = 0.2 nm
# away. A ball of 5 m/s hits the wall a million times a second, a hundredth of the rate that counts
# as a jam.
RECONTACT_ANGLE = 1e-4


@jit
def pair_velocity_change(apart: Vec3, closing: Vec3, restitution: RestitutionState | None) -> Vec3:
    """Return the velocity change [m/s] of the first of two equal balls that collide.

    The second ball has minus this change.

    Dividing by |apart|² keeps the energy of an elastic collision to rounding, where a rounded unit
    normal would drift.

    Args:
        apart: second position minus first [m].
        closing: second velocity minus first [m/s].
        restitution: None for elastic balls.

    Returns:
        The change; zero if the balls separate.
    """
    rate = dot(apart, closing)
    if rate >= 0.0:
        return Vec3(0.0, 0.0, 0.0)
    square = dot(apart, apart)
    e = ball_restitution(restitution, -rate / math.sqrt(square))
    return scaled(0.5 * (1.0 + e) * rate / square, apart)


@jit
def surface_velocity_change(
    touch: Touch, restitution: RestitutionState | None, flexure: FlexureState | None, ball: int
) -> Vec3:
    """Return the velocity change [m/s] of a ball that hits a surface; zero if it moves away.

    Args:
        touch: the contact between ball and surface.
        restitution: None for an elastic ball.
        flexure: flexure of thin parts; None for rigid surfaces.
        ball: number of the ball.
    """
    away = touch.away
    rate = dot(away, touch.relative)
    if rate >= 0.0:
        return Vec3(0.0, 0.0, 0.0)
    square = dot(away, away)
    speed = -rate / math.sqrt(square)
    e = surface_restitution(restitution, touch.tag, speed)
    e = restitution_with_flexure(flexure, restitution, ball, touch.triangle, speed, e)
    return scaled(-(1.0 + e) * rate / square, away)


@jit
def leave_cylinder_wall(
    cylinder: CylinderAxis | None, kind: int, away: Vec3, relative: Vec3, change: Vec3
) -> Vec3:
    """Return ``change``, enlarged where a ball would leave a cylinder wall at too small an angle.

    The smallest angle to the wall is RECONTACT_ANGLE. If the larger normal speed needs more energy
    than the approach had, the tangential speed provides the rest.

    Args:
        cylinder: axis of the cylinder; None in a mesh.
        kind: kind of the obstacle. Other kinds than a cylinder wall return ``change``.
        away: unit normal of the wall towards the ball.
        relative: the ball's velocity before the hit [m/s].
        change: velocity change by restitution and friction [m/s].
    """
    if cylinder is None:
        return change
    if kind != CYLINDER_WALL:
        return change
    x, y = relative.x + change.x, relative.y + change.y
    departure = away.x * x + away.y * y
    tangential = away.x * y - away.y * x
    least = RECONTACT_ANGLE * abs(tangential)
    if departure >= least:
        return change
    rate = away.x * relative.x + away.y * relative.y
    # The departure may need more energy than the approach had. The tangential speed provides it.
    borrowed = max(least * least - rate * rate, 0.0)
    slower = math.sqrt(tangential * tangential - borrowed)
    lost = math.copysign(slower, tangential) - tangential
    along_wall = Vec3(-away.y, away.x, 0.0)
    return add_scaled(add_scaled(change, least - departure, away), lost, along_wall)

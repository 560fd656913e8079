"""Surfaces on which a ball stands, its supports, and the directions that they leave free to it.

Notation: n_k: unit normal of support k, towards the ball. The supports leave the cone {x: n_k x >=
0 for all k}: the directions in which the ball can move. The vector of the cone that is nearest to x
is x itself, or lies on the plane of one support, or on the planes of two supports. It is unique: it
is the projection whose multipliers all push (conditions of Kuhn and Tucker).
"""

import numpy as np

from sim_core.effects.contact_mode import FLYING, MAX_SUPPORTS, ON_BALL, ContactState, Supports
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Vec3, add_scaled, cross, dot, set_vec3

ROUNDING = 1e-12  # rounding of a projection, without unit
# Share of an inverse mass: an impulse on balls that give way by less than this does not grow any
# more.
BLOCKED = 0.01
# s. Balls that are pressed together without any speed would meet again at once. They part for this
# time, in which they rise by 50 nm.
SHORTEST_HOP = 1e-4


@jit
def support_normal(supports: Supports, ball: int, support: int) -> Vec3:
    """Return the unit normal of support number ``support`` of a ball, towards the ball."""
    normals = supports.normals
    return Vec3(normals[ball, support, 0], normals[ball, support, 1], normals[ball, support, 2])


@jit
def stands_on_ball(supports: Supports, ball: int, other: int) -> bool:
    """Return True if ``ball`` stands on the ball ``other``."""
    stands = False
    for support in range(supports.number[ball]):
        stands |= supports.obstacles[ball, support] == ON_BALL - other
    return stands


@jit
def _is_in_cone(supports: Supports, ball: int, x: Vec3, slack: float) -> bool:
    inside = True
    for support in range(supports.number[ball]):
        inside &= dot(support_normal(supports, ball, support), x) >= -slack
    return inside


@jit
def onto_cone(supports: Supports, ball: int, x: Vec3) -> Vec3:
    """Return the vector nearest to ``x`` that does not point into any support of the ball."""
    count = supports.number[ball]
    size = np.sqrt(dot(x, x))
    slack = ROUNDING * size
    if _is_in_cone(supports, ball, x, slack):
        return x
    for one in range(count):
        n = support_normal(supports, ball, one)
        push = -dot(n, x)
        y = add_scaled(x, push, n)
        if push >= -slack and _is_in_cone(supports, ball, y, slack):
            return y
    for one in range(count):
        n = support_normal(supports, ball, one)
        for two in range(one + 1, count):
            m = support_normal(supports, ball, two)
            line = cross(n, m)
            square = dot(line, line)
            if square < 1e-20:
                continue
            c = dot(n, m)
            a, b = -dot(n, x), -dot(m, x)
            loose = slack + 1e-15 * size / square
            if (a - c * b) / square < -loose or (b - c * a) / square < -loose:
                continue
            share = dot(line, x) / square
            y = Vec3(share * line.x, share * line.y, share * line.z)
            if _is_in_cone(supports, ball, y, slack):
                return y
    return Vec3(0.0, 0.0, 0.0)


@jit
def response(contact: ContactState, ball: int, push: Vec3) -> Vec3:
    """Return the velocity change of a ball that is pushed by a unit impulse per mass.

    ``push``: unit vector of the impulse. A ball on supports moves only where they leave it free.
    """
    if contact.mode[ball] == FLYING:
        return push
    return onto_cone(contact.supports, ball, push)


@jit
def drop_support(supports: Supports, ball: int, support: int) -> None:
    """Remove support number ``support`` of a ball. The numbers of later supports fall by one."""
    last = supports.number[ball] - 1
    for k in range(support, last):
        supports.obstacles[ball, k] = supports.obstacles[ball, k + 1]
        supports.ranges[ball, k] = supports.ranges[ball, k + 1]
        for axis in range(3):
            supports.normals[ball, k, axis] = supports.normals[ball, k + 1, axis]
            supports.origins[ball, k, axis] = supports.origins[ball, k + 1, axis]
    supports.obstacles[ball, last] = -1
    supports.number[ball] = last


@jit
def drop_supports_along(supports: Supports, ball: int, direction: Vec3, least: float) -> None:
    """Remove those supports of a ball from which ``direction`` leads away by more than ``least``.

    ``least`` has the unit of ``direction``, which is a velocity or an acceleration.
    """
    for support in range(supports.number[ball] - 1, -1, -1):
        if dot(support_normal(supports, ball, support), direction) > least:
            drop_support(supports, ball, support)


@jit
def add_support(
    supports: Supports, ball: int, obstacle: int, normal: Vec3, position: Vec3, reach: float
) -> None:
    """Add a support to a ball. A fifth support replaces the oldest.

    Args:
        supports: supports of all balls.
        ball: number of the ball.
        obstacle: number of the obstacle, or ON_BALL minus the number of a ball that lies still.
        normal: unit normal of the obstacle, towards the ball.
        position: position of the ball's centre [m].
        reach: distance from ``position`` up to which the support holds [m].
    """
    if supports.number[ball] == MAX_SUPPORTS:
        drop_support(supports, ball, 0)
    support = supports.number[ball]
    supports.obstacles[ball, support] = obstacle
    for axis in range(3):
        supports.normals[ball, support, axis] = normal[axis]
        supports.origins[ball, support, axis] = position[axis]
    supports.ranges[ball, support] = reach
    supports.number[ball] = support + 1


@jit
def set_mode(contact: ContactState, ball: int, mode: int) -> None:
    """Set the mode of a ball (FLYING, SLIDING, ASLEEP or JAMMED) and update the contact list.

    The contact list holds the balls that are not in flight.
    """
    contact.mode[ball] = mode
    balls, places, length = contact.contact_list
    place = places[ball]
    if mode == FLYING and place >= 0:
        length[0] -= 1
        last = balls[length[0]]
        balls[place] = last
        places[last] = place
        places[ball] = -1
    elif mode != FLYING and place < 0:
        balls[length[0]] = ball
        places[ball] = length[0]
        length[0] += 1


@jit
def forget_left_support(contact: ContactState, ball: int) -> None:
    """Delete the note of the support that a ball has just left, by setting its normal to zero."""
    set_vec3(contact.left_normal, ball, Vec3(0.0, 0.0, 0.0))

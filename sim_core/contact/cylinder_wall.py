"""Balls in contact mode at the wall of an exact upright cylinder.

Gravity is along the axis, so that the wall never bears a ball alone. It can hold a ball that leans
on other balls: such a ball has no way out and lies still, with the wall as one of its supports. The
wall is not a support of a ball that moves, because the path would have to be curved. The ball hops
along the wall, as it does without contact mode (impulses/collision.py).

A ball that leans on others and is pressed against the wall would hit it infinitely often in finite
time. Hits slower than Rest.capture therefore lose no speed there. They throw the ball back at the
speed that its acceleration takes away in SHORTEST_HOP, but at no more than Rest.capture. What this
adds to the energy per mass is less than capture²/2.

Notation: n: unit normal of the wall, towards the ball. a: acceleration of the ball on its other
supports [m/s²]; -n a presses it against the wall.
"""

import math

import numpy as np

from sim_core.contact.landing_and_lift_off import land, settle
from sim_core.contact.supports import (
    BLOCKED,
    ROUNDING,
    SHORTEST_HOP,
    add_support,
    drop_support,
    onto_cone,
    response,
)
from sim_core.effects.contact_mode import (
    ASLEEP,
    BOUNCES,
    CAUGHT,
    FLYING,
    MAX_SUPPORTS,
    ContactState,
)
from sim_core.geometry.analytic import CylinderAxis
from sim_core.geometry.bvh import Tree
from sim_core.geometry.obstacles import CYLINDER_WALL
from sim_core.impulses.collision import leave_cylinder_wall
from sim_core.motion import BallEvent, BallState
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.vec3 import Touch, Vec3, dot, scaled, vec3_at

# m: distance by which a ball that begins to move may pass the wall before the wall stops being its
# support. A tenth of the distance that counts as contact.
PASSES = 1e-14
NO_WALL = -1  # in place of BOUNCES, ROLLS or CAUGHT: the obstacle is no cylinder wall
PRESSED = 1e-9  # share of gravity: a smaller acceleration is rounding


@inlined
def land_on_surface(
    contact: ContactState | None,
    cylinder: CylinderAxis | None,
    tree: Tree,
    motion: np.ndarray,
    event: BallEvent,
    obstacle: int,
    at: BallState,
    away: Vec3,
) -> int:
    """Let a ball land on a still surface if it can, and return BOUNCES, ROLLS or CAUGHT.

    Arguments and results are those of ``land``. ``cylinder``: axis of the cylinder; None in a mesh.
    """
    landed = _lean_on_wall(cylinder, contact, tree, motion, event, obstacle, at, away)
    if landed == NO_WALL:
        landed = land(contact, tree, motion, event, obstacle, at, away)
    return landed


@inlined
def _lean_on_wall(
    cylinder: CylinderAxis | None,
    contact: ContactState | None,
    tree: Tree,
    motion: np.ndarray,
    event: BallEvent,
    obstacle: int,
    at: BallState,
    normal: Vec3,
) -> int:
    """Hold a ball still that is pressed against the wall and has no way out.

    Returns: CAUGHT, BOUNCES with nothing changed, or NO_WALL for any other obstacle.
    """
    if cylinder is None:
        return NO_WALL
    if contact is None:
        return NO_WALL
    if tree.kinds[obstacle] != CYLINDER_WALL:
        return NO_WALL
    ball, supports = event.ball, contact.supports
    approach = -dot(normal, at.velocity)
    if not _is_pressed(contact, ball, normal) or approach >= contact.capture:
        return BOUNCES
    if contact.mode[ball] >= ASLEEP or supports.number[ball] == MAX_SUPPORTS:
        return BOUNCES
    reach = math.sqrt(2.0 * tree.numbers[obstacle, 3] * PASSES)
    add_support(supports, ball, obstacle, normal, at.position, reach)
    left, way = onto_cone(supports, ball, contact.gravity), onto_cone(supports, ball, at.velocity)
    weight = math.sqrt(dot(contact.gravity, contact.gravity))
    if dot(left, left) > (PRESSED * weight) ** 2 or dot(way, way) > ROUNDING**2:
        drop_support(supports, ball, supports.number[ball] - 1)
        return BOUNCES
    settle(contact, motion, event, at)
    return CAUGHT


@jit
def _is_pressed(contact: ContactState, ball: int, normal: Vec3) -> bool:
    """Return True if a ball on supports is pressed against the wall by its own acceleration."""
    if contact.mode[ball] == FLYING:
        return False
    weight = math.sqrt(dot(contact.gravity, contact.gravity))
    return dot(normal, vec3_at(contact.acceleration, ball)) < -PRESSED * weight


@inlined
def hop_at_wall(
    cylinder: CylinderAxis | None,
    contact: ContactState | None,
    ball: int,
    touch: Touch,
    approach: float,
    change: Vec3,
) -> Vec3:
    """Return the velocity change [m/s] of a ball that hits a surface, without friction.

    It is ``change`` unless the surface is a cylinder wall.

    Args:
        cylinder: axis of the cylinder; None in a mesh.
        contact: state of contact mode.
        ball: number of the ball.
        touch: the contact. The normal of a cylinder wall is a unit vector.
        approach: speed [m/s] of the hit along the normal.
        change: velocity change [m/s] by restitution.
    """
    if cylinder is None:
        return change
    if contact is None:
        return change
    normal = touch.away
    if touch.kind != CYLINDER_WALL:
        return change
    if approach >= contact.capture or not _is_pressed(contact, ball, normal):
        # before friction, which depends on the whole change of the normal velocity
        return leave_cylinder_wall(cylinder, touch.kind, normal, touch.relative, change)
    press = -dot(normal, vec3_at(contact.acceleration, ball))
    lift = min(SHORTEST_HOP * press, contact.capture)
    give = response(contact, ball, normal)
    return scaled((approach + max(approach, lift)) / max(dot(give, normal), BLOCKED), give)

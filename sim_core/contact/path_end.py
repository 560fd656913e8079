"""Time and reason at which a ball that slides or rolls on supports needs a new path.

The path ends at the border of a face, where the ball leaves an edge, or where the ball stops.
"""

import math

import numpy as np

from sim_core.contact.landing_and_lift_off import (
    BRAKE_ENDS,
    LEAVES_SUPPORT,
    LIES_STILL,
    PATH_GOES_ON,
    RECHECK,
    RIDE_ENDS,
    WAKES,
)
from sim_core.contact.riding import seen_from_face
from sim_core.contact.supports import support_normal
from sim_core.effects.ball_sizes import radius_of_ball
from sim_core.effects.contact_mode import ASLEEP, FLYING, ContactState, Ride, Supports, rides
from sim_core.effects.friction import FrictionState
from sim_core.geometry.bvh import Tree
from sim_core.geometry.obstacles import CAPSULE, FACE
from sim_core.motion import BallEvent
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.roots import NEVER, first_approach
from sim_core.numerics.vec3 import Flight, Vec3, add_scaled, cross, dot, sub, vec3_at

# Multiple of the face overlap. A support reaches further over its border than the face does, so
# that a ball that has left the support is past the face.
OVER = 1.5
# rad. Faces that meet at a smaller angle are told apart at their border only. Such an angle moves a
# ball over a seam by 1e-13 m.
ONE_PLANE = 1e-5
# m: an edge this little in front of a support's plane counts as behind it, because of rounding
BEHIND = 2e-13
# rad. On a curved path the direction of resistance or friction is read again after this turn,
MAX_TURN = 0.1
MIN_TIME = 1e-3  # s: but not more often than this
# s. A ball without support would fall 20 um in this time, see MAX_JAM_GAP.
RECHECK_TIME = 2e-3


@inlined
def out_of_reach(
    contact: ContactState | None, tree: Tree, ball: int, position: Vec3, obstacle: int
) -> bool:
    """Return True if a ball cannot meet an obstacle while it moves along its supports' planes.

    Such an obstacle is a support itself, a face parallel to a support, or an edge behind the plane
    of a support.
    """
    if contact is None:
        return False
    if rides(contact.ride, ball):
        return False  # the ball does not move along a still plane
    supports = contact.supports
    radius = radius_of_ball(contact.sizes, tree.radius, ball)
    for support in range(supports.number[ball]):
        normal = support_normal(supports, ball, support)
        if supports.obstacles[ball, support] == obstacle or _lies_behind(
            tree, obstacle, normal, position, radius
        ):
            return True
    return False


@jit
def _lies_behind(tree: Tree, row: int, normal: Vec3, position: Vec3, radius: float) -> bool:
    numbers = tree.numbers
    one = vec3_at(numbers, row)
    if tree.kinds[row] == FACE:
        turn = cross(normal, one)
        return dot(turn, turn) < ONE_PLANE * ONE_PLANE and dot(normal, one) > 0.0
    if tree.kinds[row] != CAPSULE:  # a vibrating face, or a cylinder wall
        return False
    height = dot(normal, position) - radius + BEHIND
    two = add_scaled(one, numbers[row, 6], Vec3(numbers[row, 3], numbers[row, 4], numbers[row, 5]))
    return dot(normal, one) <= height and dot(normal, two) <= height


@inlined
def end_of_path(
    contact: ContactState | None,
    tree: Tree,
    face_overlap: float,
    event: BallEvent,
    flight: Flight,
    length: float,
) -> tuple[float, int]:
    """Return the time [s] until a ball in contact needs a new path, and the reason.

    Args:
        contact: state of contact mode.
        tree: tree of the obstacles.
        face_overlap: overlap of neighbouring faces [m].
        event: the ball and the present time.
        flight: position, velocity and acceleration of the ball now.
        length: duration of the search [s].

    Returns: (time, reason), with a time of at most ``length``. The reason is PATH_GOES_ON if the
    path holds for ``length``. For the reason LIES_STILL the time has no meaning.
    """
    if contact is None:
        return length, PATH_GOES_ON
    ball, supports = event.ball, contact.supports
    mode = contact.mode[ball]
    if mode == FLYING:
        return length, PATH_GOES_ON
    if rides(contact.ride, ball):
        return _end_of_ride(contact.ride, tree, face_overlap, event, flight, length)
    if contact.wake_pending[ball] != 0:
        wait = max(0.0, contact.stays_until[ball] - event.time_since_start)
        return (wait, WAKES) if wait <= length else (length, PATH_GOES_ON)
    if contact.jams.neighbour_count[ball] > 0:
        return RECHECK_TIME, RECHECK
    if mode >= ASLEEP:
        return length, LIES_STILL
    best, end = length, PATH_GOES_ON
    for support in range(supports.number[ball]):
        row = supports.obstacles[ball, support]
        if row < 0:
            no_line = Vec3(0.0, 0.0, 0.0)
            delay = _leaves_round(supports, ball, support, flight, no_line)
        elif tree.kinds[row] == FACE:
            delay = _leaves_face(tree.numbers, row, flight, OVER * face_overlap)
        elif tree.kinds[row] == CAPSULE:
            delay = _leaves_edge(supports, tree.numbers, ball, support, flight, OVER * face_overlap)
        else:  # a cylinder wall
            no_line = Vec3(0.0, 0.0, 0.0)
            delay = _leaves_round(supports, ball, support, flight, no_line)
        if delay < best:
            best, end = delay, LEAVES_SUPPORT - support
    delay, turns = _brake_ends(contact.friction_state, contact, event, flight)
    if delay < best:
        best, end = delay, BRAKE_ENDS
    elif turns and end == PATH_GOES_ON:
        # Without this limit the direction would turn in every piece by less than MAX_TURN,
        # unnoticed.
        end = BRAKE_ENDS
    return best, end


@inlined
def _end_of_ride(
    ride: Ride | None,
    tree: Tree,
    face_overlap: float,
    event: BallEvent,
    flight: Flight,
    length: float,
) -> tuple[float, int]:
    """Return what ``end_of_path`` returns, for a ball that moves with a vibrating face."""
    if ride is None:
        return length, PATH_GOES_ON
    face = int(np.int64(ride.face[event.ball]))
    seen = seen_from_face(ride, event.ball, event.time, flight)
    left = max(ride.until[event.ball] - event.time, 0.0)
    left = min(left, _leaves_face(tree.numbers, face, seen, OVER * face_overlap))
    return (left, RIDE_ENDS) if left <= length else (length, PATH_GOES_ON)


@jit
def _leaves_face(numbers: np.ndarray, row: int, flight: Flight, over: float) -> float:
    soonest = NEVER
    for k in range(4, 20, 4):
        inward = Vec3(numbers[row, k], numbers[row, k + 1], numbers[row, k + 2])
        inside = dot(inward, flight.position) - numbers[row, k + 3] + over
        speed, change = dot(inward, flight.velocity), 0.5 * dot(inward, flight.acceleration)
        soonest = min(soonest, first_approach(inside, speed, change, math.inf))
    return soonest


@jit
def _leaves_edge(
    supports: Supports, numbers: np.ndarray, ball: int, support: int, flight: Flight, over: float
) -> float:
    """Return the time [s] until a ball that stands on an edge leaves its support plane.

    The plane touches the tube of one ball radius round the edge. It holds for a short way across
    the edge, and along the edge up to ``over`` [m] beyond its ends.
    """
    row = supports.obstacles[ball, support]
    start = vec3_at(numbers, row)
    line = Vec3(numbers[row, 3], numbers[row, 4], numbers[row, 5])
    length = numbers[row, 6]
    place = dot(sub(flight.position, start), line)
    if not 0.0 <= place <= length:
        no_line = Vec3(0.0, 0.0, 0.0)
        return _leaves_round(supports, ball, support, flight, no_line)
    speed, change = dot(flight.velocity, line), 0.5 * dot(flight.acceleration, line)
    return min(
        first_approach(place + over, speed, change, math.inf),
        first_approach(length - place + over, -speed, -change, math.inf),
        _leaves_round(supports, ball, support, flight, line),
    )


@jit
def _leaves_round(supports: Supports, ball: int, support: int, flight: Flight, line: Vec3) -> float:
    """Return the time [s] until a ball on a round object needs a new support plane.

    The plane touches the object under the ball. It stands for the round object only up to a
    distance, ``supports.ranges``. Motion along the straight direction ``line`` of the object, a
    unit vector, does not count. ``line`` is zero if the object has no straight direction.
    """
    origins = supports.origins
    origin = Vec3(origins[ball, support, 0], origins[ball, support, 1], origins[ball, support, 2])
    gone = sub(flight.position, origin)
    gone = add_scaled(gone, -dot(gone, line), line)
    velocity = add_scaled(flight.velocity, -dot(flight.velocity, line), line)
    acceleration = flight.acceleration
    acceleration = add_scaled(acceleration, -dot(acceleration, line), line)
    left = supports.ranges[ball, support] - math.sqrt(dot(gone, gone))
    if left <= 0.0:
        return 0.0
    speed = math.sqrt(dot(velocity, velocity))
    root = speed + math.sqrt(
        speed * speed + 2.0 * left * math.sqrt(dot(acceleration, acceleration))
    )
    return 2.0 * left / root if root > 1e-12 else NEVER


@jit
def _brake_ends(
    friction_state: FrictionState | None, contact: ContactState, event: BallEvent, flight: Flight
) -> tuple[float, bool]:
    """Return the time [s] for which friction or resistance on a ball keeps its direction.

    The second value is True if the slip or the motion turns, so that the force must be set anew,
    and False if the force lasts until the slip or the motion stops.
    """
    if friction_state is not None:
        slips, ball = friction_state.slips, event.ball
        change = Vec3(slips[ball, 3], slips[ball, 4], slips[ball, 5])
        slip = add_scaled(vec3_at(slips, ball), event.time, change)
        if dot(slip, slip) + dot(change, change) > 0.0:
            return _stops(slip, change)
    if contact.resistance > 0.0:
        return _stops(flight.velocity, flight.acceleration)
    return NEVER, False


@jit
def _stops(velocity: Vec3, acceleration: Vec3) -> tuple[float, bool]:
    square = dot(velocity, velocity)
    if square == 0.0:
        return NEVER, False
    rate = dot(acceleration, velocity)
    speed = math.sqrt(square)
    across = dot(acceleration, acceleration) - rate * rate / square
    soonest = -square / rate if rate < 0.0 else NEVER
    turns = across > 1e-12 * dot(acceleration, acceleration)
    if turns:
        soonest = min(soonest, max(MIN_TIME, MAX_TURN * speed / math.sqrt(across)))
    return soonest, turns

"""When a ball in contact mode comes to the end of its path: over a face's border, off an edge, or to a stop."""

import math

import numpy as np

from sim_core.effects.contact_mode import (
    ASLEEP,
    FLYING,
    GOES_ON,
    LEAVES,
    MODE,
    NEIGHBOURS_HOLDING_JAM,
    RECHECK,
    STAYS_UNTIL,
    STILL,
    STOPS,
    SUPPORTS,
    WAKE_PENDING,
    WAKES,
    ContactState,
    support_normal,
)
from sim_core.effects.friction import FrictionState
from sim_core.effects.vibration import Wave
from sim_core.geometry.bvh import Tree
from sim_core.geometry.obstacles import FACE, VIBRATING_FACE
from sim_core.motion import BallState
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.roots import NEVER, first_approach
from sim_core.numerics.vec3 import Vec3, add_scaled, cross, dot, sub

OVER = 1.5  # seams: a foot reaches further over its border than the face does, so that a ball that left it is past it
ONE_PLANE = 1e-5  # rad: faces that meet at less are told apart at their border only; over a seam that is 1e-13 m
BEHIND = 2e-13  # m: an edge this little in front of a foot's plane is behind it but for rounding
TURN = 0.1  # rad: what resistance or friction slows while it curves has its direction read anew after so much
SHORTEST = 1e-3  # s: but not more often
RECHECK_PERIOD = 2e-3  # s: in which a ball that nothing holds any more would have fallen 20 um, see grounded.LEANING


@inlined
def out_of_reach(
    contact: ContactState | None, tree: Tree, ball: int, position: Vec3, row: int
) -> bool:
    """True for what a ball that moves along its feet's planes cannot meet: its own ground, or edges behind it."""
    if contact is None:
        return False
    for support in range(contact.marks[ball, SUPPORTS]):
        if contact.rows[ball, support] == row or _lies_behind(
            tree, row, support_normal(contact, ball, support), position
        ):
            return True
    return False


@jit
def _lies_behind(tree: Tree, row: int, normal: Vec3, position: Vec3) -> bool:
    numbers = tree.numbers
    one = Vec3(numbers[row, 0], numbers[row, 1], numbers[row, 2])
    if tree.kinds[row] == FACE:
        turn = cross(normal, one)
        return dot(turn, turn) < ONE_PLANE * ONE_PLANE and dot(normal, one) > 0.0
    if tree.kinds[row] == VIBRATING_FACE:
        return False
    height = dot(normal, position) - tree.radius + BEHIND
    two = add_scaled(one, numbers[row, 6], Vec3(numbers[row, 3], numbers[row, 4], numbers[row, 5]))
    return dot(normal, one) <= height and dot(normal, two) <= height


@inlined
def end_of_path(
    contact: ContactState | None,
    tree: Tree,
    face_overlap: float,
    wave: Wave | None,
    here: BallState,
    acceleration: Vec3,
    ball: int,
    time: float,
    time_since_start: float,
    length: float,
) -> tuple[float, int]:
    """For how long, at most ``length`` [s], the ball's path is good, and what ends it (see GOES_ON).

    ``time_since_start`` [s]: now, since the start. A ball that lies still is looked at for one swing of the slowest sonotrode:
    what does not touch it then never will.
    """
    if contact is None:
        return length, GOES_ON
    mode = contact.marks[ball, MODE]
    if mode == FLYING:
        return length, GOES_ON
    if contact.marks[ball, WAKE_PENDING] != 0:
        wait = max(0.0, contact.memory[ball, STAYS_UNTIL] - time_since_start)
        return (wait, WAKES) if wait <= length else (length, GOES_ON)
    if contact.marks[ball, NEIGHBOURS_HOLDING_JAM] > 0:
        return RECHECK_PERIOD, RECHECK
    if mode >= ASLEEP:
        return _swing(wave), STILL
    best, end = length, GOES_ON
    for support in range(contact.marks[ball, SUPPORTS]):
        row = contact.rows[ball, support]
        if row < 0:
            delay = _leaves_round(
                contact,
                ball,
                support,
                here.position,
                here.velocity,
                acceleration,
                Vec3(0.0, 0.0, 0.0),
            )
        elif tree.kinds[row] == FACE:
            delay = _leaves_face(tree.numbers, row, here, acceleration, OVER * face_overlap)
        else:
            delay = _leaves_edge(
                contact, tree.numbers, ball, support, here, acceleration, OVER * face_overlap
            )
        if delay < best:
            best, end = delay, LEAVES - support
    delay, turns = _brake_ends(
        contact.friction_state, contact, ball, time, here.velocity, acceleration
    )
    if delay < best:
        best, end = delay, STOPS
    elif turns and end == GOES_ON:  # or it would turn in every piece by less than TURN, unnoticed
        end = STOPS
    return best, end


@jit
def _swing(wave: Wave | None) -> float:
    if wave is None:
        return 0.0
    return 2.02 * math.pi / wave.omega


@jit
def _leaves_face(
    numbers: np.ndarray, row: int, here: BallState, acceleration: Vec3, over: float
) -> float:
    soonest = NEVER
    for k in range(4, 20, 4):
        inward = Vec3(numbers[row, k], numbers[row, k + 1], numbers[row, k + 2])
        inside = dot(inward, here.position) - numbers[row, k + 3] + over
        soonest = min(
            soonest,
            first_approach(
                inside, dot(inward, here.velocity), 0.5 * dot(inward, acceleration), math.inf
            ),
        )
    return soonest


@jit
def _leaves_edge(
    contact: ContactState,
    numbers: np.ndarray,
    ball: int,
    support: int,
    here: BallState,
    acceleration: Vec3,
    over: float,
) -> float:
    """On an edge the foot is a plane that touches the capsule: good for a short way across it, and to its ends."""
    row = contact.rows[ball, support]
    start = Vec3(numbers[row, 0], numbers[row, 1], numbers[row, 2])
    line = Vec3(numbers[row, 3], numbers[row, 4], numbers[row, 5])
    length = numbers[row, 6]
    place = dot(sub(here.position, start), line)
    if not 0.0 <= place <= length:
        return _leaves_round(
            contact, ball, support, here.position, here.velocity, acceleration, Vec3(0.0, 0.0, 0.0)
        )
    speed, change = dot(here.velocity, line), 0.5 * dot(acceleration, line)
    return min(
        first_approach(place + over, speed, change, math.inf),
        first_approach(length - place + over, -speed, -change, math.inf),
        _leaves_round(contact, ball, support, here.position, here.velocity, acceleration, line),
    )


@jit
def _leaves_round(
    contact: ContactState,
    ball: int,
    support: int,
    position: Vec3,
    velocity: Vec3,
    acceleration: Vec3,
    line: Vec3,
) -> float:
    """How long the plane stands for what is round under it; motion along ``line`` (unit, or zero) does not count."""
    spots = contact.spots
    gone = sub(
        position, Vec3(spots[ball, support, 0], spots[ball, support, 1], spots[ball, support, 2])
    )
    gone = add_scaled(gone, -dot(gone, line), line)
    velocity = add_scaled(velocity, -dot(velocity, line), line)
    acceleration = add_scaled(acceleration, -dot(acceleration, line), line)
    left = spots[ball, support, 3] - math.sqrt(dot(gone, gone))
    if left <= 0.0:
        return 0.0
    speed = math.sqrt(dot(velocity, velocity))
    root = speed + math.sqrt(
        speed * speed + 2.0 * left * math.sqrt(dot(acceleration, acceleration))
    )
    return 2.0 * left / root if root > 1e-12 else NEVER


@jit
def _brake_ends(
    friction_state: FrictionState | None,
    contact: ContactState,
    ball: int,
    time: float,
    velocity: Vec3,
    acceleration: Vec3,
) -> tuple[float, bool]:
    """How long the force against a ball's slip, or against its motion, keeps its direction, and whether that turns."""
    if friction_state is not None:
        slips = friction_state.slips
        change = Vec3(slips[ball, 3], slips[ball, 4], slips[ball, 5])
        slip = add_scaled(Vec3(slips[ball, 0], slips[ball, 1], slips[ball, 2]), time, change)
        if dot(slip, slip) + dot(change, change) > 0.0:
            return _stops(slip, change)
    if contact.resistance > 0.0:
        return _stops(velocity, acceleration)
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
        soonest = min(soonest, max(SHORTEST, TURN * speed / math.sqrt(across)))
    return soonest, turns

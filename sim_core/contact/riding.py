"""A ball that moves with a vibrating face: it sticks while the face presses it, and lets go.

A ball that bounces ever lower on a face that presses it bounces infinitely often in finite time. A
hit slower than capture therefore ends the bouncing: from then on the ball's velocity along the
normal is that of the face, until the face's acceleration away from the ball is more than its
weight.

Notation:
    n: unit normal of the face, towards the ball
    A, omega, angle: amplitude along n [m], angular frequency [rad/s] and phase now [rad], so that
        the face is displaced by A sin(angle) and accelerated by -A omega² sin(angle)
    w = -n g: weight per mass along the normal [m/s²], negative where gravity pulls the ball off

The face presses while sin(angle) < w / (A omega²). It lets go at angle = asin(w / (A omega²)).

Between these events the ball's path is a chain of parabolas, as the rest of the simulator takes
them. Each begins on the face with its velocity, ends on it, and is off by at most OFF between.
Along the face the ball slides freely.

Source: A. Mehta & J. M. Luck, Phys. Rev. Lett. 65 (1990) 393, for the ball that is locked to the
plate and let go; the bouncing ball as a map is in J. M. Luck & A. Mehta, Phys. Rev. E 48 (1993)
3988.
"""

import math

import numpy as np

from sim_core.contact.supports import add_support, drop_support, set_mode, support_normal
from sim_core.effects.contact_mode import (
    BOUNCES,
    CAUGHT,
    FLYING,
    ROLLS,
    SLIDING,
    ContactState,
    Ride,
)
from sim_core.effects.sonotrodes import same_sonotrode, wave_of_face
from sim_core.geometry.bvh import Tree
from sim_core.geometry.obstacles import VIBRATING_FACE, same_plane
from sim_core.motion import BallEvent, BallState, set_path, state_under
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.roots import NEVER
from sim_core.numerics.vec3 import Flight, Vec3, add_scaled, dot, set_vec3, vec3_at

OFF = 1e-11  # m: how far a parabola may be from the face; the velocity is off by some 1e-6 m/s
# rad: a ball that would be let go so soon is let go now
AT_ONCE = 1e-9
# m/s. What has no speed relative to the face leaves it as fast as this, so that rounding cannot
# make the two meet again for ever.
PARTING = 1e-12


@jit
def time_to_let_go(weight: float, strength: float, omega: float, angle: float) -> float:
    """How long [s] the face will press the ball; 0 if it does not, NEVER if it always does.

    Args:
        weight: w [m/s²].
        strength: A omega² [m/s²].
        omega, angle: of the face.
    """
    if strength <= weight:
        return NEVER
    if strength <= -weight or math.sin(angle) >= weight / strength:
        return 0.0
    last = math.asin(weight / strength)
    left = (last - angle) % (2.0 * math.pi)
    return left / omega if AT_ONCE < left <= math.pi + 2.0 * last else 0.0


@jit
def _swing(ride: Ride, face: int, normal: Vec3, time: float) -> tuple[float, float, float]:
    """A, omega and the angle of a face; A is positive."""
    wave = wave_of_face(ride.waves, ride.wave, face)
    lift = dot(normal, wave.axis)
    angle = wave.omega * time + wave.phase
    return abs(lift) * wave.amplitude, wave.omega, angle if lift >= 0.0 else angle + math.pi


@inlined
def stick(
    contact: ContactState | None,
    tree: Tree,
    motion: np.ndarray,
    event: BallEvent,
    face: int,
    at: BallState,
) -> int:
    """Result of a hit on a vibrating face: BOUNCES, or CAUGHT where the ball goes on with it.

    ROLLS where the face leaves a ball behind that has no speed relative to it: that is no impact.
    """
    if contact is None:
        return BOUNCES
    return _stick(contact.ride, contact, tree, motion, event, face, at)


@jit
def _stick(
    ride: Ride | None,
    contact: ContactState,
    tree: Tree,
    motion: np.ndarray,
    event: BallEvent,
    face: int,
    at: BallState,
) -> int:
    if ride is None:
        return BOUNCES
    ball = event.ball
    if contact.mode[ball] != FLYING:
        return BOUNCES
    normal = vec3_at(tree.numbers, face)
    amplitude, omega, angle = _swing(ride, face, normal, event.time)
    approach = amplitude * omega * math.cos(angle) - dot(normal, at.velocity)
    weight = -dot(normal, contact.gravity)
    holds = time_to_let_go(weight, amplitude * omega * omega, omega, angle) > 0.0
    if approach >= (contact.capture if holds else PARTING):
        return BOUNCES
    add_support(contact.supports, ball, face, normal, at.position, math.inf)
    ride.face[ball] = face
    ride.height[ball] = tree.numbers[face, 3]
    _go_on(ride, contact, motion, event, at, 0.0)
    return CAUGHT if holds else ROLLS


@jit
def _go_on(
    ride: Ride,
    contact: ContactState,
    motion: np.ndarray,
    event: BallEvent,
    at: BallState,
    speed: float,
) -> None:
    """Let a ball go on from ``at``: with its face, or in flight with ``speed`` [m/s] from it."""
    ball, time = event.ball, event.time
    normal = support_normal(contact.supports, ball, 0)
    amplitude, omega, angle = _swing(ride, ride.face[ball], normal, time)
    strength = amplitude * omega * omega
    weight = -dot(normal, contact.gravity)
    held = time_to_let_go(weight, strength, omega, angle)
    height, face_speed = amplitude * math.sin(angle), amplitude * omega * math.cos(angle)
    position = add_scaled(
        at.position, ride.height[ball] + height - dot(normal, at.position), normal
    )
    stays = held > 0.0 and -contact.capture < speed <= 0.0
    if not stays and speed > -contact.capture:
        speed = max(speed, PARTING)
    wanted = face_speed if stays else face_speed + speed
    velocity = add_scaled(at.velocity, wanted - dot(normal, at.velocity), normal)
    acceleration, mode = contact.gravity, FLYING
    if stays:
        # the error of a parabola through both ends is at most A omega³ t³ 4 / (6 27)
        piece = min(held, (40.5 * OFF / (strength * omega)) ** (1.0 / 3.0)) if strength else held
        mean = -strength * math.sin(angle + omega * min(piece, math.pi / omega) / 3.0)
        acceleration = add_scaled(acceleration, weight + mean, normal)
        ride.until[ball] = time + piece
        mode = SLIDING
    else:
        drop_support(contact.supports, ball, 0)
        ride.face[ball] = -1
    set_mode(contact, ball, mode)
    set_vec3(contact.acceleration, ball, acceleration)
    set_path(motion, ball, time, BallState(position, velocity), acceleration)


@inlined
def settle_on_face(
    ride: Ride | None, contact: ContactState, motion: np.ndarray, event: BallEvent, at: BallState
) -> bool:
    """Let a ball that rides go on after a hit, from ``at``; False for a ball that does not ride."""
    if ride is None:
        return False
    if ride.face[event.ball] < 0:
        return False
    normal = support_normal(contact.supports, event.ball, 0)
    before = state_under(
        motion, event.ball, event.time, vec3_at(contact.acceleration, event.ball)
    ).velocity
    _go_on(ride, contact, motion, event, at, dot(normal, at.velocity) - dot(normal, before))
    return True


@inlined
def go_on_riding(
    ride: Ride | None,
    contact: ContactState,
    motion: np.ndarray,
    event: BallEvent,
    at: BallState,
    face: int,
) -> None:
    """Let a ball go on where its parabola ends: with ``face``, or in flight where that is -1."""
    if ride is None:
        return
    if face >= 0:
        ride.face[event.ball] = face
    _go_on(ride, contact, motion, event, at, 0.0 if face >= 0 else PARTING)


@jit
def is_of_plane(ride: Ride, tree: Tree, face: int, row: int) -> bool:
    """True when an obstacle is in the plane of a face and moves with it."""
    return (
        tree.kinds[row] == VIBRATING_FACE
        and same_plane(tree.numbers, face, row)
        and same_sonotrode(ride.waves, face, row)
    )


@inlined
def moves_with_face(contact: ContactState | None, tree: Tree, ball: int, row: int) -> bool:
    """True for a ball that rides on the plane that this vibrating face is in."""
    if contact is None:
        return False
    return _is_ridden(contact.ride, tree, ball, row)


@inlined
def _is_ridden(ride: Ride | None, tree: Tree, ball: int, row: int) -> bool:
    if ride is None:
        return False
    face = int(np.int64(ride.face[ball]))
    return face >= 0 and is_of_plane(ride, tree, face, row)


@inlined
def seen_from_face(ride: Ride | None, ball: int, time: float, flight: Flight) -> Flight:
    """The ball's flight relative to the face that it rides on, which moves as it does now."""
    if ride is None:
        return flight
    wave = wave_of_face(ride.waves, ride.wave, int(np.int64(ride.face[ball])))
    angle = wave.omega * time + wave.phase
    return Flight(
        add_scaled(flight.position, -wave.amplitude * math.sin(angle), wave.axis),
        add_scaled(flight.velocity, -wave.amplitude * wave.omega * math.cos(angle), wave.axis),
        flight.acceleration,
    )


@jit
def _shift_rides(ride: Ride | None, window: float) -> None:
    if ride is None:
        return
    for ball in range(len(ride.until)):
        ride.until[ball] -= window


@inlined
def shift_contact(contact: ContactState | None, window: float) -> None:
    """Move the clock's zero forward by ``window`` [s]."""
    if contact is None:
        return
    _shift_rides(contact.ride, window)

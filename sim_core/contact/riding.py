"""Balls that move with a vibrating face: a ball sticks to it while the face presses the ball.

A ball that bounces ever lower on a face that presses it bounces infinitely often in finite time. A
hit slower than Rest.capture therefore ends the bouncing. From then on the ball's normal velocity is
the face's velocity, until the face moves away faster than gravity lets the ball follow.

Notation:
    n: unit normal of the face, towards the ball
    A, omega, angle: amplitude along n [m], angular frequency [rad/s] and present phase [rad]. The
        displacement of the face is A sin(angle), its acceleration -A omega² sin(angle)
    w = -n g: weight per mass along the normal [m/s²], negative where gravity pulls the ball off

The face presses while sin(angle) < w / (A omega²). It lets go at angle = asin(w / (A omega²)).

Between these events the ball's path is a chain of parabolas, because the rest of the simulator
takes only parabolas. Each parabola begins on the face with the face's velocity, ends on the face,
and deviates from it by at most OFF. The ball slides freely along the face.

Sources: A. Mehta & J. M. Luck, Phys. Rev. Lett. 65 (1990) 393, for a ball that is locked to the
plate and let go. J. M. Luck & A. Mehta, Phys. Rev. E 48 (1993) 3988, for the bouncing ball as a
map.
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

# m: largest distance of a parabola from the face; the velocity is off by about 1e-6 m/s
OFF = 1e-11
# rad: a ball that would be let go within this angle is let go at once
AT_ONCE = 1e-9
# m/s. A ball without speed relative to the face leaves it at this speed, so that rounding cannot
# make the two meet again for ever.
PARTING = 1e-12


@jit
def time_to_let_go(weight: float, strength: float, omega: float, angle: float) -> float:
    """Return how long [s] a vibrating face goes on pressing a ball; NEVER if it never lets go.

    The time is 0 if the face does not press the ball now.

    Args:
        weight: acceleration w with which gravity presses the ball on the face [m/s²].
        strength: largest acceleration of the face, A omega² [m/s²].
        omega: angular frequency of the face [rad/s].
        angle: present phase of the face [rad].
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
    """Return how a vibrating face moves along its own normal.

    Returns: amplitude [m], not negative, angular frequency [rad/s], and phase at ``time`` [rad].
    """
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
    """Let a ball stick to a vibrating face if it can, and return BOUNCES, ROLLS or CAUGHT.

    BOUNCES means that the ball does not stick, and nothing has been changed. CAUGHT means that the
    ball moves on with the face. ROLLS means that the face moves away from a ball that had no
    speed relative to it. The ball flies on, and this is not an impact.
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
    """Set the next path of a ball on a vibrating face: on with the face, or in flight.

    Args:
        ride: state of the balls that move with a face.
        contact: state of contact mode.
        motion: base position and velocity of each ball, shape (n, 6).
        event: the ball and the present time.
        at: position and velocity of the ball.
        speed: speed [m/s] at which the ball leaves the face. The ball stays on the face if the face
            presses it and the speed lies between -capture and 0.
    """
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
        # a parabola through both ends is off by at most A omega³ t³ 4 / (6 27)
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
    """Set the next path of a ball that moves with a vibrating face, after a hit.

    ``at``: position and velocity after the hit. Returns: False, with nothing changed, if the ball
    does not move with a face.
    """
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
    """Set the next path of a ball at the end of a piece of its path on a vibrating face.

    ``face``: number of the face with which the ball moves on, or -1 if it flies off.
    """
    if ride is None:
        return
    if face >= 0:
        ride.face[event.ball] = face
    _go_on(ride, contact, motion, event, at, 0.0 if face >= 0 else PARTING)


@jit
def is_of_plane(ride: Ride, tree: Tree, face: int, row: int) -> bool:
    """Return True if obstacle ``row`` is a face of the same plane and sonotrode as ``face``."""
    return (
        tree.kinds[row] == VIBRATING_FACE
        and same_plane(tree.numbers, face, row)
        and same_sonotrode(ride.waves, face, row)
    )


@inlined
def moves_with_face(contact: ContactState | None, tree: Tree, ball: int, row: int) -> bool:
    """Return True if the ball moves with a face in the plane of the vibrating face ``row``."""
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
    """Return a ball's flight as seen from the vibrating face with which the ball moves.

    The displacement and velocity of the face at ``time`` [s] are subtracted. The acceleration is
    kept.
    """
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
    """Rewrite the times of contact mode for a clock that starts ``window`` [s] later."""
    if contact is None:
        return
    _shift_rides(contact.ride, window)

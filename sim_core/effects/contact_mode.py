"""Contact mode: what a user chooses (Rest), and what the simulator stores of it (ContactState).

The package sim_core.contact explains contact mode and holds everything that acts on this state.
"""

import math
from typing import NamedTuple

import numpy as np

from sim_core.effects.friction import FrictionState
from sim_core.effects.gravity import Gravity, gravity_acceleration
from sim_core.effects.restitution import ELASTIC_BELOW, RestitutionState
from sim_core.effects.sonotrodes import SonotrodeWaves
from sim_core.effects.vibration import Wave
from sim_core.errors import SceneError, number
from sim_core.numerics.jit import inlined
from sim_core.numerics.vec3 import Vec3, vec3_at

# m/s. A drop from 50 nm is as fast, and the shot is ten thousand times faster. A lower value costs
# bounces: 22 for each decade at a restitution of 0.9.
CAPTURE = 1e-3
# Steel balls on steel have about this rolling resistance (assumed). Slower ones lie still.
RESISTANCE = 0.005

MAX_SUPPORTS = 4  # three hold a ball; a fourth is needed until it is decided which three

# values of ContactState.mode: how a ball moves
FLYING, SLIDING, ASLEEP, JAMMED = 0, 1, 2, 3
# results of a hit on a surface; a ball that rolls goes on as if it and the last were one
BOUNCES, ROLLS, CAUGHT = 0, 1, 2
# values of SlowHits.part_contact: what the turning part does to a ball
UNTOUCHED, TOUCHED, PRESSED = 0, 1, 2

# A support on a ball that lies still has the obstacle number ON_BALL minus the number of that ball.
ON_BALL = -2


class Rest(NamedTuple):
    """Options of contact mode.

    capture: normal speed [m/s] below which a hit on a still surface ends in contact.
    resistance: deceleration of a ball in contact, as a share of the load on its supports.
    on_vibrating: whether balls also stick to vibrating faces while these press them.
    """

    capture: float = CAPTURE
    resistance: float = RESISTANCE
    on_vibrating: bool = False


class Supports(NamedTuple):
    """The planes on which each of n balls stands, at most MAX_SUPPORTS of them.

    number: how many a ball has, (n,) int32.
    obstacles: number of the obstacle under each, or see ON_BALL, (n, 4) int32.
    normals: unit normals towards the ball, (n, 4, 3).
    origins: where the ball was when it came onto the support [m], (n, 4, 3).
    ranges: how far from there a plane stands for something round [m], (n, 4).
    """

    number: np.ndarray
    obstacles: np.ndarray
    normals: np.ndarray
    origins: np.ndarray
    ranges: np.ndarray


class SlowHits(NamedTuple):
    """Slow hits in a row of each of n balls, from which a jam is recognised.

    number: hits in the row, (n,) int32.
    position: where the row began [m], (n, 3).
    began: when it began [s since the start], (n,).
    part_contact: UNTOUCHED, TOUCHED or PRESSED by the turning part, (n,) int32.
    touched_at: when the part, or a ball that it presses, touched the ball last [s], (n,).
    """

    number: np.ndarray
    position: np.ndarray
    began: np.ndarray
    part_contact: np.ndarray
    touched_at: np.ndarray


class Jams(NamedTuple):
    """Jams of each of n balls.

    position: where the ball was held last [m], (n, 3).
    repeats: how often it was held there again, (n,) int32.
    neighbour_count: balls around it while some of them move, else 0, (n,) int32.
    neighbour_sum: sum of the numbers of these balls, which tells whether they are the same, (n,).
    """

    position: np.ndarray
    repeats: np.ndarray
    neighbour_count: np.ndarray
    neighbour_sum: np.ndarray


class ContactList(NamedTuple):
    """The balls that are not in flight.

    balls: their numbers, (n,) int32, of which the first length[0] are in use.
    places: place of each ball in the list, -1 for a ball in flight, (n,) int32.
    length: (1,) int64.
    """

    balls: np.ndarray
    places: np.ndarray
    length: np.ndarray


class Ride(NamedTuple):
    """Balls that move with a vibrating face, for n balls.

    face: number of the obstacle that a ball rides on, -1 for none, (n,) int32.
    height: of the face's plane at rest, moved by a radius [m], (n,).
    until: when the ball's present parabola along the face ends [s on the window's clock], (n,).
    wave, waves: of the only sonotrode, or of all.
    """

    face: np.ndarray
    height: np.ndarray
    until: np.ndarray
    wave: Wave
    waves: SonotrodeWaves | None


class ContactState(NamedTuple):
    """State of contact mode for n balls.

    mode: FLYING, SLIDING, ASLEEP or JAMMED, (n,) int32.
    acceleration: each ball's own [m/s²], (n, 3).
    left_normal: normal of the support left last, 0 unless the ball has just left it, (n, 3).
    still_since: when the ball came to lie still [s since the start], (n,).
    wake_pending: 1 where something under the ball has begun to move and the ball has not yet
        reacted, (n,) int32.
    stays_until: the ball is not woken before this time [s since the start], (n,).
    capture, resistance: as in Rest.
    elastic_below: balls that hit each other more slowly lose no speed [m/s].
    radius: of every ball [m]. reach: distance at which two balls touch [m], 0 where they never do.
    ride: None unless balls stick to vibrating faces.
    """

    mode: np.ndarray
    acceleration: np.ndarray
    left_normal: np.ndarray
    still_since: np.ndarray
    wake_pending: np.ndarray
    stays_until: np.ndarray
    supports: Supports
    slow_hits: SlowHits
    jams: Jams
    contact_list: ContactList
    capture: float
    resistance: float
    elastic_below: float
    radius: float
    reach: float
    gravity: Vec3
    friction_state: FrictionState | None
    ride: Ride | None = None


def checked_rest(rest: Rest | None) -> Rest | None:
    """The same with plain floats; raises SceneError for numbers out of range."""
    if rest is None:
        return None
    plain = Rest(
        number("rest.capture", rest.capture),
        number("rest.resistance", rest.resistance),
        rest.on_vibrating,
    )
    if not isinstance(plain.on_vibrating, bool):
        raise SceneError(f"rest.on_vibrating is {plain.on_vibrating!r}: give True or False")
    if not 0.0 < plain.capture < math.inf:
        raise SceneError(f"rest.capture is {plain.capture} m/s: it must be positive")
    if not 0.0 <= plain.resistance < math.inf:
        raise SceneError(f"rest.resistance is {plain.resistance}: it must be 0 or more")
    return plain


def new_contact_state(
    rest: Rest | None,
    balls: int,
    radius: float,
    reach: float,
    gravity: Gravity | None,
    restitution: RestitutionState | None,
    friction_state: FrictionState | None,
) -> ContactState | None:
    """The state with all balls in flight; None without the effect."""
    if rest is None:
        return None
    own = gravity_acceleration(gravity)

    def whole(*shape: int, value: int = 0) -> np.ndarray:
        return np.full((balls, *shape), value, dtype=np.int32)

    def real(*shape: int) -> np.ndarray:
        return np.zeros((balls, *shape))

    size = MAX_SUPPORTS
    return ContactState(
        mode=whole(),
        acceleration=np.tile(np.array(own), (balls, 1)),
        left_normal=real(3),
        still_since=real(),
        wake_pending=whole(),
        stays_until=real(),
        supports=Supports(whole(), whole(size, value=-1), real(size, 3), real(size, 3), real(size)),
        slow_hits=SlowHits(whole(), real(3), real(), whole(), real()),
        jams=Jams(real(3), whole(), whole(), real()),
        contact_list=ContactList(whole(), whole(value=-1), np.zeros(1, dtype=np.int64)),
        capture=rest.capture,
        resistance=rest.resistance,
        elastic_below=ELASTIC_BELOW if restitution is None else restitution.elastic_below,
        radius=radius,
        reach=reach,
        gravity=Vec3(*(float(x) for x in own)),
        friction_state=friction_state,
    )


def new_ride(
    rest: Rest | None, balls: int, wave: Wave | None, waves: SonotrodeWaves | None
) -> Ride | None:
    """The state of n balls of which none rides; None where none ever does."""
    if rest is None or not rest.on_vibrating or wave is None:
        return None
    face = np.full(balls, -1, dtype=np.int32)
    return Ride(face, np.zeros(balls), np.zeros(balls), wave, waves)


@inlined
def rides(ride: Ride | None, ball: int) -> bool:
    """True for a ball that moves with a vibrating face."""
    if ride is None:
        return False
    return ride.face[ball] >= 0


@inlined
def ball_acceleration(contact: ContactState | None, ball: int, gravity: Gravity | None) -> Vec3:
    """A ball's acceleration [m/s²]: gravity, or what its supports leave of it."""
    if contact is None:
        return gravity_acceleration(gravity)
    return vec3_at(contact.acceleration, ball)


@inlined
def is_flying(contact: ContactState | None, ball: int) -> bool:
    """True for a ball that is not in contact."""
    if contact is None:
        return True
    return contact.mode[ball] == FLYING


@inlined
def is_still(contact: ContactState | None, ball: int) -> bool:
    """True for a ball that sleeps or is jammed."""
    if contact is None:
        return False
    return contact.mode[ball] >= ASLEEP


@inlined
def still_surface_restitution(
    contact: ContactState | None, restitution: RestitutionState | None
) -> RestitutionState | None:
    """The law for hits on still surfaces: with contact mode they lose energy at all speeds."""
    if contact is None:
        return restitution
    if restitution is None:
        return restitution
    return RestitutionState(restitution.points, 0.0)


@inlined
def vibrating_restitution(
    contact: ContactState | None, restitution: RestitutionState | None
) -> RestitutionState | None:
    """The law for hits on vibrating faces: the same where balls stick to them."""
    if contact is None:
        return restitution
    return _where_balls_stick(contact.ride, restitution)


@inlined
def _where_balls_stick(
    ride: Ride | None, restitution: RestitutionState | None
) -> RestitutionState | None:
    if ride is None or restitution is None:
        return restitution
    return RestitutionState(restitution.points, 0.0)

"""Options (Rest) and state (ContactState) of contact mode, in which balls slide, roll and lie.

The package sim_core.contact explains contact mode and holds all code that acts on this state.
"""

import math
from typing import NamedTuple

import numpy as np

from sim_core.effects.ball_sizes import BallSizes
from sim_core.effects.friction import FrictionState
from sim_core.effects.gravity import Gravity, gravity_acceleration
from sim_core.effects.restitution import ELASTIC_BELOW, RestitutionState
from sim_core.effects.sonotrodes import SonotrodeWaves
from sim_core.effects.vibration import Wave
from sim_core.errors import SceneError, number
from sim_core.numerics.jit import inlined
from sim_core.numerics.record_addresses import passed_by_address
from sim_core.numerics.vec3 import Vec3, vec3_at

# m/s. A ball that drops from 50 nm is as fast, and the shot is ten thousand times faster. A lower
# value costs bounces: 22 for each decade at a restitution of 0.9.
CAPTURE = 1e-3
# Approximate rolling resistance of steel balls on steel (assumed). A ball whose drive is less lies
# still.
RESISTANCE = 0.005

MAX_SUPPORTS = 4  # three supports hold a ball; a fourth is needed until three of them are chosen

# values of ContactState.mode, the way a ball moves
FLYING, SLIDING, ASLEEP, JAMMED = 0, 1, 2, 3
# Results of a hit on a surface. A ball that rolls goes on as if this surface and the last one were
# one surface.
BOUNCES, ROLLS, CAUGHT = 0, 1, 2
# values of SlowHits.part_contact, the action of the turning part on a ball
UNTOUCHED, TOUCHED, PRESSED = 0, 1, 2

# A support on a ball that lies still has the obstacle number ON_BALL minus the number of that ball.
ON_BALL = -2


class Rest(NamedTuple):
    """Options of contact mode, in which balls slide, roll and lie still.

    capture: normal speed [m/s] below which a hit on a still surface ends in contact.
    resistance: deceleration of a ball in contact, as a share of the load on its supports.
    on_vibrating: True if balls also stick to vibrating faces while these faces press them.
    """

    capture: float = CAPTURE
    resistance: float = RESISTANCE
    on_vibrating: bool = False


class Supports(NamedTuple):
    """The planes on which each of n balls stands, at most MAX_SUPPORTS planes a ball.

    number: number of supports of each ball, (n,) int32.
    obstacles: obstacle number of each support, or ON_BALL minus a ball's number, (n, 4) int32.
    normals: unit normals towards the ball, (n, 4, 3).
    origins: ball positions at which the supports were added [m], (n, 4, 3).
    ranges: distance from the origin up to which a plane stands for a round object [m], (n, 4).
    """

    number: np.ndarray
    obstacles: np.ndarray
    normals: np.ndarray
    origins: np.ndarray
    ranges: np.ndarray


class SlowHits(NamedTuple):
    """The present series of slow hits of each of n balls at one place. A long series means a jam.

    number: number of hits in the series, (n,) int32.
    position: ball position at the first hit of the series [m], (n, 3).
    began: time of the first hit of the series [s since the start], (n,).
    part_contact: UNTOUCHED, TOUCHED or PRESSED by the turning part, (n,) int32.
    touched_at: last time at which the part, or a ball pressed by it, touched the ball [s], (n,).
    """

    number: np.ndarray
    position: np.ndarray
    began: np.ndarray
    part_contact: np.ndarray
    touched_at: np.ndarray


class Jams(NamedTuple):
    """Where and how often each of n balls was jammed, that is, held still by the balls round it.

    position: position at which the ball was last held [m], (n, 3).
    repeats: number of further jams at that position, (n,) int32.
    neighbour_count: number of balls around the ball while some of these move, else 0, (n,) int32.
    neighbour_sum: sum of the numbers of these balls, which shows if the neighbours change, (n,).
    """

    position: np.ndarray
    repeats: np.ndarray
    neighbour_count: np.ndarray
    neighbour_sum: np.ndarray


class ContactList(NamedTuple):
    """List of the balls that are not in flight.

    balls: ball numbers, (n,) int32. The first length[0] entries are in use.
    places: index of each ball in ``balls``, -1 for a ball in flight, (n,) int32.
    length: number of balls in the list, (1,) int64.
    """

    balls: np.ndarray
    places: np.ndarray
    length: np.ndarray


class Ride(NamedTuple):
    """State of n balls that may move with a vibrating face.

    face: number of the obstacle that a ball rides on, -1 for none, (n,) int32.
    height: distance of the face's plane at rest from the origin, plus the ball's radius [m], (n,).
    until: end of the ball's present parabola along the face [s since the start of the present time
        window], (n,).
    wave: wave of the only sonotrode.
    waves: waves of several sonotrodes.
    """

    face: np.ndarray
    height: np.ndarray
    until: np.ndarray
    wave: Wave
    waves: SonotrodeWaves | None


@passed_by_address
class ContactState(NamedTuple):
    """State of n balls that fly, slide, roll, lie still or are jammed.

    mode: FLYING, SLIDING, ASLEEP or JAMMED, (n,) int32.
    acceleration: acceleration of each ball [m/s²], (n, 3).
    left_normal: normal of the support that the ball has just left, otherwise 0, (n, 3).
    still_since: time at which the ball came to lie still [s since the start], (n,).
    wake_pending: 1 if an object under the ball has begun to move and the ball has not yet reacted,
        (n,) int32.
    stays_until: time before which the ball is not woken [s since the start], (n,).
    capture, resistance: as in Rest.
    elastic_below: speed [m/s] below which collisions of balls lose no speed.
    radius: radius of the largest balls [m].
    reach: distance of the centres at which two of the largest balls touch [m], 0 if balls never
        touch.
    ride: None unless balls stick to vibrating faces.
    sizes: None if all balls are alike.
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
    sizes: BallSizes | None = None


def checked_rest(rest: Rest | None) -> Rest | None:
    """Return the options of contact mode as plain floats.

    Raises:
        SceneError: for numbers out of range.
    """
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
    """Return a new state of contact mode, with all balls in flight.

    Args:
        rest: options of contact mode. Without them the result is None.
        balls: number of balls.
        radius: radius of the largest balls [m].
        reach: distance of the centres at which two of the largest balls touch [m], 0 if balls never
            touch.
        gravity: acceleration of the balls in flight.
        restitution: restitution of the scene.
        friction_state: friction and spins of the balls.
    """
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
    """Return a new state of balls that may move with a vibrating face, but do not yet.

    It is None if balls never stick to vibrating faces. ``balls``: number of balls.
    """
    if rest is None or not rest.on_vibrating or wave is None:
        return None
    face = np.full(balls, -1, dtype=np.int32)
    return Ride(face, np.zeros(balls), np.zeros(balls), wave, waves)


@inlined
def rides(ride: Ride | None, ball: int) -> bool:
    """Return True if a ball sticks to a vibrating face and moves with it."""
    if ride is None:
        return False
    return bool(ride.face[ball] >= 0)


@inlined
def ball_acceleration(contact: ContactState | None, ball: int, gravity: Gravity | None) -> Vec3:
    """Return a ball's acceleration [m/s²]: gravity in flight, else as contact mode has set it."""
    if contact is None:
        return gravity_acceleration(gravity)
    return vec3_at(contact.acceleration, ball)


@inlined
def is_flying(contact: ContactState | None, ball: int) -> bool:
    """Return True if a ball is in flight, as every ball is without contact mode."""
    if contact is None:
        return True
    return bool(contact.mode[ball] == FLYING)


@inlined
def is_still(contact: ContactState | None, ball: int) -> bool:
    """Return True if a ball lies still, on supports or jammed between other balls."""
    if contact is None:
        return False
    return bool(contact.mode[ball] >= ASLEEP)


@inlined
def still_surface_restitution(
    contact: ContactState | None, restitution: RestitutionState | None
) -> RestitutionState | None:
    """Return the restitution for hits on still surfaces.

    In contact mode slow hits lose speed too: the limit below which hits lose none is set to 0.
    """
    if contact is None:
        return restitution
    if restitution is None:
        return restitution
    return RestitutionState(restitution.points, 0.0)


@inlined
def vibrating_restitution(
    contact: ContactState | None, restitution: RestitutionState | None
) -> RestitutionState | None:
    """Return the restitution for hits on vibrating faces.

    If balls stick to these faces, slow hits lose speed too: the limit below which hits lose none is
    set to 0.
    """
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

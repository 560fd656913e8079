"""Balls rub and spin: mu and beta0 of Walton's hard-sphere collision, and the spins that go with them.

O. R. Walton, in Particulate Two-Phase Flow (ed. Roco, 1993) ch. 25; Foerster, Louge, Chang & Allia, Phys. Fluids 6
(1994) 1108. With the normal impulse J_n and the velocity v_t at which the touching points pass each other, spin
counted, the tangential impulse opposes v_t and is the smaller of mu J_n (the points slip throughout) and
2/7 (1 + beta0) m_eff |v_t| (they stick, and v_t turns into -beta0 v_t): m_eff is m at a surface and m/2 for a pair of
equal balls; 2/7 is that of solid spheres. beta0 = -1 is smooth, 1 perfectly rough, and both keep the energy.

In contact mode (rest.py) mu is also Coulomb's coefficient of the ball that slips, rolls or lies on a surface; see
resolve/rolling.py.
"""

import math
from typing import NamedTuple

import numpy as np

from sim_core.effects.per_surface import surface_table
from sim_core.errors import SceneError
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.vec3 import Vec3

OF_BALLS = -1  # in place of a surface's tag


class Friction(NamedTuple):
    """``surfaces``: one (mu, beta0) for each tag, by tag number; ``balls``: (mu, beta0) of ball against ball.

    mu >= 0; beta0 in [-1, 1].
    """

    surfaces: tuple[tuple[float, float], ...] | np.ndarray
    balls: tuple[float, float]


class FrictionState(NamedTuple):
    """Friction as compiled code wants it, with what it keeps of n balls; times are on the window's clock.

    ``surfaces`` (tags, 2), ``mu`` and ``beta0`` of the balls; ``radius`` [m]; ``mu_of_rows`` (m,): mu of each obstacle
    a ball can stand on. ``spins`` (n, 3) [rad/s] at time 0 and ``twists`` (n, 3) [rad/s²], their constant change while
    in contact. ``slips`` (n, 6): velocity [m/s] and acceleration of the touching points of a ball that slips in
    contact; zeros of one that rolls, lies or flies.
    """

    surfaces: np.ndarray
    mu: float
    beta0: float
    radius: float
    mu_of_rows: np.ndarray
    spins: np.ndarray
    twists: np.ndarray
    slips: np.ndarray


def checked_friction(friction: Friction, tags: int) -> Friction:
    """The same with ``surfaces`` as an array (tags, 2); raises SceneError for a missing tag or numbers out of range."""
    surfaces, of_balls = surface_table("friction", "(mu, beta0)", *friction, tags)
    pairs = [(f"surfaces[{i}]", *pair) for i, pair in enumerate(surfaces)] + [("balls", *of_balls)]
    for name, mu, beta0 in pairs:
        if not 0.0 <= mu < math.inf or not -1.0 <= beta0 <= 1.0:
            raise SceneError(
                f"friction.{name} is ({mu}, {beta0}): mu must be 0 or more and finite, beta0 lie in [-1, 1]"
            )
    return Friction(surfaces, of_balls)


def new_friction_state(
    friction: Friction, spins: np.ndarray, radius: float, tags_of_rows: np.ndarray
) -> FrictionState:
    """All balls in flight, with their spins (n, 3) [rad/s], for a checked Friction.

    ``radius`` [m]; ``tags_of_rows`` (m,): the tag of each obstacle a ball can stand on.
    """
    surfaces = np.asarray(friction.surfaces)
    return FrictionState(
        surfaces,
        *friction.balls,
        radius,
        surfaces[tags_of_rows, 0],
        spins.copy(),
        np.zeros_like(spins),
        np.zeros((len(spins), 6)),
    )


@jit
def law_of(friction_state: FrictionState, tag: int) -> tuple[float, float]:
    """mu and beta0 of a surface, or of the balls (OF_BALLS)."""
    if tag == OF_BALLS:
        return friction_state.mu, friction_state.beta0
    return friction_state.surfaces[tag, 0], friction_state.surfaces[tag, 1]


@jit
def spin_at(friction_state: FrictionState, ball: int, time: float) -> Vec3:
    """A ball's spin [rad/s] at a time of the window."""
    spins, twists = friction_state.spins, friction_state.twists
    return Vec3(
        spins[ball, 0] + time * twists[ball, 0],
        spins[ball, 1] + time * twists[ball, 1],
        spins[ball, 2] + time * twists[ball, 2],
    )


@jit
def set_spin(
    friction_state: FrictionState, ball: int, time: float, spin: Vec3, twist: Vec3
) -> None:
    """Let a ball spin on from ``spin`` [rad/s] at ``time``, changing by ``twist`` [rad/s²]; it does not slip."""
    for axis in range(3):
        friction_state.spins[ball, axis] = spin[axis] - time * twist[axis]
        friction_state.twists[ball, axis] = twist[axis]
        friction_state.slips[ball, axis] = 0.0
        friction_state.slips[ball, 3 + axis] = 0.0


@jit
def set_slip(
    friction_state: FrictionState, ball: int, time: float, slip: Vec3, change: Vec3
) -> None:
    """Its touching points pass the surface with ``slip`` [m/s] at ``time``, changing by ``change`` [m/s²]."""
    for axis in range(3):
        friction_state.slips[ball, axis] = slip[axis] - time * change[axis]
        friction_state.slips[ball, 3 + axis] = change[axis]


@inlined
def shift_spins(friction_state: FrictionState | None, window: float) -> None:
    """Move the clock's zero forward by ``window`` [s]."""
    if friction_state is None:
        return
    for ball in range(len(friction_state.spins)):
        for axis in range(3):
            friction_state.spins[ball, axis] += window * friction_state.twists[ball, axis]
            friction_state.slips[ball, axis] += window * friction_state.slips[ball, 3 + axis]

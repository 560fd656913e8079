"""Friction and spin of balls: Walton's hard-sphere collision.

Notation:
    J_n: normal impulse [kg m/s]
    v_t: relative velocity of the touching points along the surface, with spin [m/s], ``slip``
    mu: coefficient of friction [-]
    beta0: coefficient of tangential restitution [-]; -1 is smooth, 1 perfectly rough, and both keep
        the energy
    m_eff: mass m at a surface, m/2 for a pair of equal balls [kg]

The tangential impulse opposes v_t and is the smaller of two impulses. If the points slip
throughout, it is mu J_n. If they stick and v_t turns into -beta0 v_t, it is 2/7 (1 + beta0) m_eff
|v_t|, with the factor 2/7 of solid spheres. In contact mode mu is also Coulomb's coefficient of a
ball that slips, rolls or lies on a surface (contact/rolling_friction.py).

Sources: O. R. Walton, in Particulate Two-Phase Flow (ed. Roco, 1993) ch. 25; Foerster, Louge, Chang
& Allia, Phys. Fluids 6 (1994) 1108.
"""

import math
from typing import NamedTuple

import numpy as np

from sim_core.errors import SceneError, surface_table
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.vec3 import Vec3

OF_BALLS = -1  # stands for ball on ball in place of a surface's tag


class Friction(NamedTuple):
    """Coefficients of friction: mu of sliding, 0 or more, and beta0 of tangential restitution.

    beta0 lies between -1 (smooth) and 1 (perfectly rough).

    Args:
        surfaces: (mu, beta0) of each surface, by tag number.
        balls: (mu, beta0) of ball on ball.
    """

    surfaces: tuple[tuple[float, float], ...] | np.ndarray
    balls: tuple[float, float]


class FrictionState(NamedTuple):
    """Friction and spins of n balls, as numbers for compiled code.

    Time 0 is the start of the present time window.
    """

    surfaces: np.ndarray  # (mu, beta0) of each surface, shape (tags, 2)
    mu: float  # coefficient of friction of ball on ball
    beta0: float  # coefficient of tangential restitution of ball on ball
    radius: float  # radius of the balls [m]; not used for balls of several sizes
    mu_of_rows: np.ndarray  # mu of each obstacle that a ball can stand on, shape (obstacles,)
    spins: np.ndarray  # spins at time 0 [rad/s], shape (n, 3)
    twists: np.ndarray  # constant change of the spin while in contact [rad/s²], shape (n, 3)
    # Velocity [m/s] at time 0 and acceleration [m/s²] of the touching points of a ball that slips
    # in contact. Both are zero for a ball that rolls, lies or flies. Shape (n, 6).
    slips: np.ndarray


def checked_friction(friction: Friction, tags: int) -> Friction:
    """Return the coefficients of friction, as an array (tags, 2) and two floats.

    ``tags``: number of surface tags in the scene.

    Raises:
        SceneError: for numbers out of range, and for a tag without coefficients.
    """
    surfaces, of_balls = surface_table("friction", "(mu, beta0)", *friction, tags)
    pairs = [(f"surfaces[{i}]", *pair) for i, pair in enumerate(surfaces)] + [("balls", *of_balls)]
    for name, mu, beta0 in pairs:
        if not 0.0 <= mu < math.inf or not -1.0 <= beta0 <= 1.0:
            raise SceneError(
                f"friction.{name} is ({mu}, {beta0}): mu must be 0 or more and finite, "
                "beta0 lie in [-1, 1]"
            )
    return Friction(surfaces, of_balls)


def new_friction_state(
    friction: Friction, spins: np.ndarray, radius: float, tags_of_rows: np.ndarray
) -> FrictionState:
    """Return the friction and spins of balls that are all in flight.

    Args:
        friction: coefficients from checked_friction.
        spins: spins of the balls [rad/s], shape (n, 3).
        radius: radius of the balls [m].
        tags_of_rows: tag of each obstacle that a ball can stand on, shape (obstacles,).
    """
    surfaces, mu_and_beta0 = np.asarray(friction.surfaces), friction.balls
    mu_of_rows, slips = surfaces[tags_of_rows, 0], np.zeros((len(spins), 6))
    twists = np.zeros_like(spins)
    return FrictionState(surfaces, *mu_and_beta0, radius, mu_of_rows, spins.copy(), twists, slips)


@jit
def friction_of(friction: FrictionState, tag: int) -> tuple[float, float]:
    """Return mu and beta0 of the surface ``tag``, or of ball on ball if ``tag`` is OF_BALLS.

    mu is the coefficient of friction, beta0 the coefficient of tangential restitution.
    """
    if tag == OF_BALLS:
        return friction.mu, friction.beta0
    return friction.surfaces[tag, 0], friction.surfaces[tag, 1]


@jit
def spin_at(friction: FrictionState, ball: int, time: float) -> Vec3:
    """Return the spin [rad/s] of a ball at ``time`` since the start of the time window [s]."""
    spins, twists = friction.spins, friction.twists
    return Vec3(
        spins[ball, 0] + time * twists[ball, 0],
        spins[ball, 1] + time * twists[ball, 1],
        spins[ball, 2] + time * twists[ball, 2],
    )


@jit
def set_spin(friction: FrictionState, ball: int, time: float, spin: Vec3, twist: Vec3) -> None:
    """Set a ball's spin [rad/s] at ``time`` [s] and its constant change ``twist`` [rad/s²].

    The ball's slip is set to zero.
    """
    for axis in range(3):
        friction.spins[ball, axis] = spin[axis] - time * twist[axis]
        friction.twists[ball, axis] = twist[axis]
        friction.slips[ball, axis] = 0.0
        friction.slips[ball, 3 + axis] = 0.0


@jit
def set_slip(friction: FrictionState, ball: int, time: float, slip: Vec3, change: Vec3) -> None:
    """Set the slip of a ball's touching points [m/s] at ``time`` [s], and its ``change`` [m/s²]."""
    for axis in range(3):
        friction.slips[ball, axis] = slip[axis] - time * change[axis]
        friction.slips[ball, 3 + axis] = change[axis]


@inlined
def shift_spins(friction: FrictionState | None, window: float) -> None:
    """Rewrite spins and slips for a clock that starts ``window`` [s] later."""
    if friction is None:
        return
    for ball in range(len(friction.spins)):
        for axis in range(3):
            friction.spins[ball, axis] += window * friction.twists[ball, axis]
            friction.slips[ball, axis] += window * friction.slips[ball, 3 + axis]

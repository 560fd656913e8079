"""Flexure of thin parts: a hit starts flexural waves, which carry energy away from the ball.

Notation:
    R, m: radius [m] and mass [kg] of the ball
    v: speed of the ball along the normal before the hit [m/s], ``speed``
    h: thickness of the part where it is hit [m]
    E_b, E_p: E / (1 - nu²) of ball and part [Pa], for Young's modulus E and Poisson's ratio nu
    E*: contact modulus, 1 / (1 / E_b + 1 / E_p) [Pa], ``modulus``
    rho: density of the part [kg/m³]
    D: bending stiffness of a plate, E_p h³ / 12 [N m]
    Y: mobility of the part, the speed of the touched place over the force [s/kg], ``mobility``
    k: Hertz's stiffness, 4/3 E* R^(1/2) [N/m^(3/2)]; the force is F = k s^(3/2)
    s: approach of ball and part, tau = t / T: time, with T = (m / k)^(2/5) v^(-1/5) [s]
    sigma: s / (v T) [-]
    lambda: Zener's parameter of inelasticity, m Y / T = Y m^(3/5) k^(2/5) v^(1/5) [-]

A large thin plate gives way to a force like a dashpot, Y = 1 / (8 sqrt(D rho h)). With ds²/dt² =
-F / m - Y dF/dt the contact of ball and part obeys

    sigma'' + (1 + lambda d/dtau) sigma^(3/2) = 0,    sigma(0) = 0,    sigma'(0) = 1

and the ball leaves with e = -sigma' where sigma is 0 again. So e depends on lambda alone. For small
lambda e = 1 - 1.730 lambda. With the numbers of a plate put in, lambda is the form that is usual:

    lambda = pi^(3/5) / 3^(1/2) (R / h)² (v / (E_p / rho)^(1/2))^(1/5) (rho_b / rho)^(3/5)
             (E_b / (E_b + E_p))^(2/5)

The restitution of a hit is that of the law, which stands for a rigid part, times e. That is exact
where one of both is 1; docs/explanation/effects.md has its error where dents and waves take energy
together. Hits slower than elastic_below of the restitution lose nothing, here as on rigid parts.

Sources: C. Zener, Phys. Rev. 59 (1941) 669; the mobility of a plate: L. Cremer, M. Heckl & B. A. T.
Petersson, Structure-Borne Sound (2005), section 5.2.
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np

from sim_core.balls import Balls
from sim_core.effects.restitution import RestitutionState
from sim_core.errors import SceneError, number
from sim_core.numerics.jit import inlined, jit

# e is tabulated from lambda = 0 to MOST, where it is 0.003, and taken as constant above. Linear
# interpolation between POINTS values is off by 1e-5 at most, as much as a step of STEP is.
MOST, POINTS, STEP = 3.0, 769, 0.01
EXPONENT = 0.2  # of the speed in lambda


class Flexure(NamedTuple):
    """Flexure of thin parts.

    Args:
        mobility: speed of the surface over the force of a hit, for each triangle of the mesh
            [s/kg], shape (m,); 0 for a rigid one. plate_mobility gives that of a plate.
        modulus: contact modulus of balls and part [Pa].
    """

    mobility: np.ndarray
    modulus: float


class FlexureState(NamedTuple):
    """Flexure of thin parts in a scene of n balls, as numbers for compiled code."""

    mobility: np.ndarray  # of each triangle [s/kg], shape (m,)
    inertia: np.ndarray  # m^(3/5) k^(2/5) of each ball [kg (s/m)^(1/5)/s], shape (n,)
    bends: np.ndarray  # True for surface tags with a triangle that is not rigid, shape (tags,)
    curve: np.ndarray  # e at POINTS values of lambda from 0 to MOST [-]


def plate_mobility(
    thickness: float | np.ndarray, modulus: float, density: float
) -> float | np.ndarray:
    """Return the mobility of a large plate, 1 / (8 sqrt(D rho h)) [s/kg].

    Args:
        thickness: of the plate [m], any shape; the mobility is 0 where it is infinite.
        modulus: E / (1 - nu²) of the plate [Pa].
        density: of the plate [kg/m³].
    """
    plate: float | np.ndarray = 4.0 * math.sqrt(modulus * density / 3.0) * np.square(thickness)
    return 1.0 / plate


def zener_parameter(
    mobility: float | np.ndarray, modulus: float, radius: float, mass: float, speed: float
) -> float | np.ndarray:
    """Return Zener's parameter of inelasticity lambda [-] of hits on places of this mobility.

    Args:
        mobility: of the part [s/kg], any shape.
        modulus: contact modulus of ball and part [Pa].
        radius, mass: of the ball [m], [kg].
        speed: of the ball along the normal [m/s].
    """
    parameter: float | np.ndarray = mobility * _inertia(radius, mass, modulus) * speed**EXPONENT
    return parameter


def zener_restitution(parameter: float | np.ndarray) -> np.ndarray:
    """Return Zener's restitution [-] for values of his parameter lambda, of any shape."""
    grid = np.linspace(0.0, MOST, POINTS)
    return np.asarray(np.interp(parameter, grid, zener_curve()))


def _inertia(
    radius: float | np.ndarray, mass: float | np.ndarray, modulus: float
) -> float | np.ndarray:
    return mass**0.6 * (4.0 / 3.0 * modulus * np.sqrt(radius)) ** 0.4


@cache
def zener_curve() -> np.ndarray:
    """Return Zener's restitution [-] at POINTS values of lambda from 0 to MOST.

    The equation of the module docstring is solved by the classical Runge-Kutta method, for all
    values of lambda at once. Beyond the contact there is no force, so that the speed stays.
    """
    parameter = np.linspace(0.0, MOST, POINTS)

    def rates(state: np.ndarray) -> np.ndarray:
        root = np.sqrt(np.maximum(state[0], 0.0))
        force, its_rate = root**3, 1.5 * root * state[1]
        return np.asarray([state[1], -force - parameter * its_rate])

    state = np.stack([np.zeros(POINTS), np.ones(POINTS)])
    while (state[0] >= 0.0).any():
        one = rates(state)
        two = rates(state + 0.5 * STEP * one)
        three = rates(state + 0.5 * STEP * two)
        four = rates(state + STEP * three)
        state = state + STEP / 6.0 * (one + 2.0 * two + 2.0 * three + four)
    curve: np.ndarray = np.minimum(-state[1], 1.0)
    curve[0] = 1.0  # exact, so that rigid triangles of a thin part are rigid to the bit
    curve.flags.writeable = False
    return curve


def checked_flexure(flexure: Flexure | None, triangles: int) -> Flexure | None:
    """Return the flexure with the mobility as an array (m,); None for None.

    ``triangles``: number of triangles of the mesh, or of surfaces of an analytical cavity.

    Raises:
        SceneError: for a number out of range, and for a wrong number of mobilities.
    """
    if flexure is None:
        return None
    modulus = number("flexure.modulus", flexure.modulus)
    if not 0.0 < modulus < math.inf:
        raise SceneError(f"flexure.modulus is {modulus}: give a positive number of Pa")
    try:
        mobility = np.array(flexure.mobility, dtype=np.float64)
    except (TypeError, ValueError):
        raise SceneError(
            "flexure.mobility must be numbers, one for each triangle of the mesh"
        ) from None
    if mobility.shape != (triangles,):
        raise SceneError(
            f"flexure.mobility has shape {mobility.shape}, but the mesh has {triangles} triangles: "
            "give one number for each"
        )
    bad = np.flatnonzero(~((mobility >= 0.0) & (mobility < np.inf)))
    if len(bad):
        raise SceneError(
            f"flexure.mobility[{bad[0]}] is {mobility[bad[0]]}: it must be 0 or more [s/kg]"
        )
    return Flexure(mobility, modulus)


def new_flexure_state(
    flexure: Flexure | None, balls: Balls, tags: np.ndarray
) -> FlexureState | None:
    """Return the flexure of a scene for compiled code; None for rigid surfaces.

    Args:
        flexure: from checked_flexure.
        balls: the shot.
        tags: surface tag of each triangle, shape (m,).
    """
    if flexure is None:
        return None
    inertia = _inertia(0.5 * balls.diameters, balls.masses, flexure.modulus)
    bends = np.bincount(tags, flexure.mobility) > 0.0
    return FlexureState(flexure.mobility, np.asarray(inertia), bends, zener_curve())


@inlined
def restitution_with_flexure(
    flexure: FlexureState | None,
    restitution: RestitutionState | None,
    ball: int,
    triangle: int,
    speed: float,
    e: float,
) -> float:
    """Return the restitution of a hit on a part that may be thin; ``e`` where it is rigid.

    Args:
        flexure: flexure of thin parts.
        restitution: laws of restitution, of which elastic_below counts.
        ball: number of the ball.
        triangle: triangle that is hit.
        speed: speed along the normal before the hit [m/s].
        e: restitution of the same hit on a rigid part.
    """
    if flexure is None:
        return e
    if restitution is None:
        return e
    mobility = flexure.mobility[triangle]
    if mobility == 0.0 or speed < restitution.elastic_below:
        return e
    return e * _zener(flexure.curve, mobility * flexure.inertia[ball] * speed**EXPONENT)


@jit
def _zener(curve: np.ndarray, parameter: float) -> float:
    place = parameter * ((POINTS - 1) / MOST)
    if place >= POINTS - 1:
        return float(curve[POINTS - 1])
    below = int(place)
    return float(curve[below] + (place - below) * (curve[below + 1] - curve[below]))

"""Air drag: still air slows every ball in flight.

Notation:
    Re: rho_air v D / mu, Reynolds number [-]
    C_d: drag coefficient of a sphere [-], 24/Re (1 + 0.15 Re^0.687) for Re < 1000, else 0.44
    v, D, rho: speed [m/s], diameter [m] and density [kg/m³] of a ball
    rho_air, mu: density [kg/m³] and viscosity [Pa s] of the air
    c: 18 mu / (rho D²) [1/s], ``stokes``: deceleration c v (1 + 0.15 Re^0.687) for Re < 1000
    k: 3/4 C_d rho_air / (rho D) [1/m], ``quadratic``: deceleration k v² for Re >= 1000
    h: ``piece`` of a flight [s]

The closed solutions of both decelerations are used. Buoyancy and added mass, 1.5e-4 of steel's
weight and inertia, are left out. A 3 mm steel ball at 5 m/s decelerates by 0.4 m/s².

Flights stay parabolas: the air acts by impulses along the velocity, one in the middle of each piece
of a flight (half a flight, impulse, half a flight). If an event comes before the end of a piece,
the ball gets the rest of the impulse, or the excess is taken back. Velocities at events are
therefore exact to second order in h. Within a piece the path deviates from the true path by at most
a h²/8, with a the ball's deceleration: 5 µm for 0.4 m/s² and 10 ms.

Sources: Schiller & Naumann, Z. Ver. Dtsch. Ing. 77 (1935) 318; Clift, Grace & Weber, Bubbles, Drops
and Particles (1978), chapter 5; Strang, SIAM J. Numer. Anal. 5 (1968) 506.
"""

import math
from typing import NamedTuple

import numpy as np

from sim_core.errors import SceneError, number
from sim_core.numerics.jit import jit

TURBULENT = 1000.0  # Re from which C_d is NEWTON; the two laws differ by 0.3 % there
NEWTON = 0.44
INERTIA, POWER = 0.15, 0.687
# s: shorter pieces gain nothing and cost more events, and in the end look like a jam
MIN_PIECE = 1e-5
# Smallest divisor of an impulse back in time. Pieces shorter than the time in which a ball slows
# down never come near it.
MIN_DIVISOR = 0.5


class Drag(NamedTuple):
    """Options of air drag: properties of the still air, by default dry air at 20 °C and 1013 hPa.

    Args:
        density: density of the air [kg/m³].
        viscosity: viscosity of the air [Pa s].
        piece: longest time between two impulses [s].
    """

    density: float = 1.204
    viscosity: float = 1.82e-5
    piece: float = 0.01


class DragState(NamedTuple):
    """Air drag on n balls, as numbers for compiled code, in the notation of this module."""

    # time up to which the air has acted [s on the window's clock], shape (n,)
    acted_until: np.ndarray
    stokes: np.ndarray  # c [1/s], shape (n,)
    reynolds: np.ndarray  # Re at 1 m/s [s/m], shape (n,)
    quadratic: np.ndarray  # k [1/m], shape (n,)
    half: float  # half a piece [s]


def checked_drag(drag: Drag | None) -> Drag | None:
    """Return the options of air drag as plain floats.

    Raises:
        SceneError: for numbers out of range.
    """
    if drag is None:
        return None
    given = drag._asdict().items()
    plain = Drag(*(number(f"drag.{name}", value) for name, value in given))
    for name, value in plain._asdict().items():
        if not 0.0 < value < math.inf:
            raise SceneError(f"drag.{name} is {value}: it must be positive")
    if plain.piece < MIN_PIECE:
        raise SceneError(
            f"drag.piece is {plain.piece:g} s: it must be {MIN_PIECE:g} or more; "
            "the path is off by less"
        )
    return plain


def new_drag_state(
    drag: Drag | None, diameters: np.ndarray, densities: np.ndarray
) -> DragState | None:
    """Return the air drag on balls at time 0, from their diameters [m] and densities [kg/m³].

    Both arrays have the shape (n,).
    """
    if drag is None:
        return None
    return DragState(
        np.zeros(len(diameters)),
        18.0 * drag.viscosity / (densities * diameters**2),
        drag.density * diameters / drag.viscosity,
        0.75 * NEWTON * drag.density / (densities * diameters),
        0.5 * drag.piece,
    )


def drag_coefficient(reynolds: float) -> float:
    """Return the drag coefficient [-] of a sphere at a Reynolds number ``reynolds`` [-]."""
    if reynolds >= TURBULENT:
        return NEWTON
    return float(24.0 / reynolds * (1.0 + INERTIA * reynolds**POWER))


@jit
def remaining_speed(drag: DragState, ball: int, speed: float, span: float) -> float:
    """Return the share [-] of a ball's ``speed`` [m/s] that remains after ``span`` [s] in air.

    A negative span undoes drag: the share is then above 1.
    """
    reynolds = drag.reynolds[ball] * speed
    if reynolds >= TURBULENT:
        return float(1.0 / max(1.0 + drag.quadratic[ball] * speed * span, MIN_DIVISOR))
    inertial = INERTIA * reynolds**POWER
    left = (1.0 + inertial) * math.exp(POWER * drag.stokes[ball] * span) - inertial
    return float(max(left, MIN_DIVISOR) ** (-1.0 / POWER))


@jit
def shift_drag(drag: DragState | None, window: float) -> None:
    """Rewrite the times of air drag for a clock that starts ``window`` [s] later."""
    if drag is None:
        return
    for ball in range(len(drag.acted_until)):
        drag.acted_until[ball] -= window

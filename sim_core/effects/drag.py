"""Air drag: still air slows every ball in flight, by Schiller & Naumann's drag coefficient of a sphere.

C_d = 24/Re (1 + 0.15 Re^0.687) for Re < 1000 (Schiller & Naumann, Z. Ver. Dtsch. Ing. 77 (1935) 318), 0.44 beyond
(Clift, Grace & Weber, Bubbles, Drops and Particles (1978), chapter 5); Re = rho v D / mu. Both decelerations,
-c v (1 + b v^p) and -k v², have closed solutions, which are used. Buoyancy and added mass, 1.5e-4 of steel's weight and
inertia, are left out. 3 mm steel at 5 m/s: 0.4 m/s².

Flights stay parabolas: the air acts by kicks along the velocity, one in the middle of each ``piece`` h of a flight
(Strang, SIAM J. Numer. Anal. 5 (1968) 506: half a flight, kick, half a flight). A ball to which something happens
before is given what it is owed, or back what was too much, so that velocities at events hold to second order in h.
Within a piece the path is off the true one by at most a h²/8, a the ball's deceleration: 5 µm for 0.4 m/s² and 10 ms.
"""

import math
from typing import NamedTuple

import numpy as np

from sim_core.errors import SceneError, number
from sim_core.numerics.jit import jit

TURBULENT = 1000.0  # Re from which C_d is NEWTON; the two laws differ by 0.3 % there
NEWTON = 0.44
INERTIA, POWER = 0.15, 0.687
SHORTEST = 1e-5  # s: shorter ones make nothing truer, cost ever more events, and in the end are taken for a jam
LEAST = 0.5  # of what a kick back in time divides by: nothing comes near it with pieces shorter than the ball's slowing

# columns of Air.balls
UNTIL = 0  # the time [s on the window's clock] up to which the air has acted on the ball
STOKES = 1  # c = 18 mu / (rho D²) [1/s]
REYNOLDS = 2  # Re of 1 m/s [s/m]
QUADRATIC = 3  # k = 3/4 C_d rho_air / (rho D) [1/m]


class Drag(NamedTuple):
    """Still air of ``density`` [kg/m³] and ``viscosity`` [Pa s], by default dry air at 20 °C and 1013 hPa; ``piece``
    [s]: the longest time between two kicks.
    """

    density: float = 1.204
    viscosity: float = 1.82e-5
    piece: float = 0.01


class Air(NamedTuple):
    """Drag as compiled code wants it: ``balls`` (n, 4), see UNTIL and below; ``half`` of a piece [s]."""

    balls: np.ndarray
    half: float


def checked_drag(drag: Drag | None) -> Drag | None:
    """The same as plain floats; raises SceneError for numbers out of range."""
    if drag is None:
        return None
    plain = Drag(
        *(number(f"drag.{name}", value) for name, value in zip(Drag._fields, drag, strict=True))
    )
    for name, value in plain._asdict().items():
        if not 0.0 < value < math.inf:
            raise SceneError(f"drag.{name} is {value}: it must be positive")
    if plain.piece < SHORTEST:
        raise SceneError(
            f"drag.piece is {plain.piece:g} s: it must be {SHORTEST:g} or more; the path is off by less"
        )
    return plain


def new_air(drag: Drag | None, diameters: np.ndarray, densities: np.ndarray) -> Air | None:
    """For balls of these ``diameters`` [m] and ``densities`` [kg/m³], (n,) each; None without the effect."""
    if drag is None:
        return None
    balls = np.zeros((len(diameters), 4))
    balls[:, STOKES] = 18.0 * drag.viscosity / (densities * diameters**2)
    balls[:, REYNOLDS] = drag.density * diameters / drag.viscosity
    balls[:, QUADRATIC] = 0.75 * NEWTON * drag.density / (densities * diameters)
    return Air(balls, 0.5 * drag.piece)


def drag_coefficient(reynolds: float) -> float:
    """C_d of a sphere at a Reynolds number."""
    if reynolds >= TURBULENT:
        return NEWTON
    return 24.0 / reynolds * (1.0 + INERTIA * reynolds**POWER)


@jit
def slowing(air: Air, ball: int, speed: float, span: float) -> float:
    """What ``span`` [s] of air leave of a speed [m/s], as a share of it; more than all when time goes back."""
    reynolds = air.balls[ball, REYNOLDS] * speed
    if reynolds >= TURBULENT:
        return 1.0 / max(1.0 + air.balls[ball, QUADRATIC] * speed * span, LEAST)
    inertial = INERTIA * reynolds**POWER
    left = (1.0 + inertial) * math.exp(POWER * air.balls[ball, STOKES] * span) - inertial
    return max(left, LEAST) ** (-1.0 / POWER)


@jit
def shift_drag(air: Air | None, window: float) -> None:
    """Move the clock's zero forward by ``window`` [s]."""
    if air is None:
        return
    for ball in range(len(air.balls)):
        air.balls[ball, UNTIL] -= window

"""How exact Zener's theory of thin plates is, where plates are small and where balls leave dents.

    python benchmarks/thin_plates.py

Two tables. The first has the restitution of an elastic ball in the middle of a round plate, by
finite elements of the plate in time, for radii of the plate in lengths l = (D / rho h)^(1/4)
T^(1/2) of the waves of a hit of duration T. The second has an elastic-plastic ball and a large
plate: the restitution when dents and waves take energy at once, the product of the two alone that
the simulator uses, and how much smaller the dent is than on a rigid part, with the estimate of
chamberopt/coverage/dents.py. It takes two minutes.

In both the units are Zener's (sim_core/effects/flexure.py): mass of the ball over the stiffness of
the contact, speed and time T = (m / k)^(2/5) v^(-1/5) are 1.

Sources: C. Zener, Phys. Rev. 59 (1941) 669; C. Thornton, J. Appl. Mech. 64 (1997) 383, for the
elastic-plastic contact.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from benchmarks.table import print_table
from chamberopt.coverage.dents import thin_part_factor
from sim_core import zener_restitution

POISSON = 0.3
HERTZ = 3.218  # duration of the contact with a rigid body
ELEMENTS, STEP = 300, 5e-3
PARAMETERS = (0.05, 0.12, 0.3, 0.6)
RADII = (0.5, 0.7, 1.0, 1.2, 1.5, 2.0, 3.0)
SPEEDS = (3.0, 6.0, 10.0, 20.0)  # over the speed at which yielding starts
SMALL_STEP = 2e-4


def plate_matrices(radius: float, clamped: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return stiffness and mass of a round plate, for its deflection and slope at points of a
    radius. D and rho h are 1, and the rim is clamped or free.
    """
    r = np.linspace(0.0, radius, ELEMENTS + 1)
    stiffness, mass = np.zeros((2, 2 * len(r), 2 * len(r)))
    points, weights = np.polynomial.legendre.leggauss(5)
    for e, long in enumerate(np.diff(r)):
        rows = slice(2 * e, 2 * e + 4)
        for x, weight in zip(0.5 * (points + 1.0), 0.5 * weights, strict=True):
            shape = [
                1 - 3 * x**2 + 2 * x**3,
                long * (x - 2 * x**2 + x**3),
                3 * x**2 - 2 * x**3,
                long * (x**3 - x**2),
            ]
            slope = [-6 * x + 6 * x**2, long * (1 - 4 * x + 3 * x**2), 6 * x - 6 * x**2]
            bend = [-6 + 12 * x, long * (6 * x - 4), 6 - 12 * x, long * (6 * x - 2)]
            n = np.array(shape)
            along = np.array(bend) / long**2
            at = r[e] + long * x
            across = np.array([*slope, long * (3 * x**2 - 2 * x)]) / (long * at)
            area = 2.0 * np.pi * at * weight * long
            both = np.outer(along, across)
            own = np.outer(along, along) + np.outer(across, across)
            stiffness[rows, rows] += area * (own + POISSON * (both + both.T))
            mass[rows, rows] += area * np.outer(n, n)
    kept = np.ones(len(stiffness), dtype=bool)
    kept[1] = False  # no slope in the middle
    kept[-2:] = not clamped
    return stiffness[np.ix_(kept, kept)], mass[np.ix_(kept, kept)]


def small_plate(parameter: float, radius: float, clamped: bool) -> float:
    """Return the restitution in the middle of a plate of this radius [l], by Newmark's method.

    It is negative where the ball goes on with the plate.
    """
    ball = 8.0 * parameter  # lambda = m / (8 sqrt(D rho h) T)
    stiffness, mass = plate_matrices(radius * math.sqrt(HERTZ), clamped)
    quarter = 0.25 * STEP**2
    solver, stiff = splu(csc_array(mass + quarter * stiffness)), csc_array(stiffness)
    unit = solver.solve(np.eye(len(mass))[0])
    place, speed, push = np.zeros((3, len(mass)))
    ball_place, ball_speed, force, time = 0.0, 1.0, 0.0, 0.0
    while time < 1.0 or (force > 0.0 and time < 60.0):
        guess = place + STEP * speed + quarter * push
        free = -solver.solve(stiff @ guess)
        after = force
        for _ in range(40):
            there = ball_place + STEP * ball_speed - quarter * (force + after) / ball
            plate = guess[0] + quarter * (free[0] + unit[0] * after)
            after = 0.5 * (after + ball * max(there - plate, 0.0) ** 1.5)
        ball_place = there
        ball_speed -= 0.5 * STEP * (force + after) / ball
        new = free + unit * after
        speed += 0.5 * STEP * (push + new)
        place, push, force = guess + quarter * new, new, after
        time += STEP
    return -ball_speed


def plastic(parameter: float, speed: float) -> tuple[float, float]:
    """Return restitution and largest force of an elastic-plastic ball on a large plate.

    ``speed``: over the speed at which yielding starts, 0.4 s^(5/2) = 0.5 / speed² at the approach s
    where it starts. Beyond, the force grows linearly, and the unloading is that of a flatter ball.
    """
    yields = (1.25 / speed**2) ** 0.4 if speed > 0.0 else math.inf
    slope = 1.5 * math.sqrt(yields) if speed > 0.0 else 0.0
    deepest, most = 0.0, 0.0

    def force_at(s: float) -> float:
        nonlocal deepest, most
        if s >= deepest:
            deepest = s
            most = s**1.5 if s <= yields else yields**1.5 + slope * (s - yields)
            return most
        if deepest <= yields:
            return max(s, 0.0) ** 1.5
        flatter = ((2.0 * most + yields**1.5) / (2.0 * slope)) ** 1.5 / most
        recovered = (most / math.sqrt(flatter)) ** (2.0 / 3.0)
        return most * max((s - deepest + recovered) / recovered, 0.0) ** 1.5

    s, ball, time = 0.0, 1.0, 0.0
    while True:
        start = force_at(s)
        if time > 0.05 and start == 0.0:
            return -ball, most
        middle = force_at(s + 0.5 * SMALL_STEP * (ball - parameter * start))
        s += SMALL_STEP * (ball - 0.5 * SMALL_STEP * start - parameter * middle)
        ball -= SMALL_STEP * middle
        time += SMALL_STEP


def main() -> None:
    """Print both tables."""
    rows = []
    for parameter in PARAMETERS:
        large = float(zener_restitution(parameter))
        for clamped in (False, True):
            e = {f"{a:g} l": f"{small_plate(parameter, a, clamped):.2f}" for a in RADII}
            rim = "clamped" if clamped else "free"
            rows.append({"lambda": parameter, "rim": rim, **e, "large": f"{large:.2f}"})
    print_table(rows)
    rows = []
    for speed in SPEEDS:
        alone, most = plastic(0.0, speed)
        # Kirk's law, with the mean pressure of the contact as hardness: F² = 2 pi B D (1 - e²) E
        pressure = 2.0 * 1.5 * (1.25 / speed**2) ** 0.2 / math.pi
        dent = math.sqrt(4.0 * math.sqrt(pressure * (1.0 - alone**2) / math.pi) / pressure)
        for parameter in PARAMETERS:
            e, force = plastic(parameter, speed)
            hit = np.array([dent]), np.array([1.0]), np.array([parameter])
            (estimate,) = thin_part_factor(*hit, pressure)
            both = {
                "e": f"{e:.3f}",
                "product": f"{alone * float(zener_restitution(parameter)):.3f}",
                "dent diameter": f"{math.sqrt(force / most):.3f}",
                "estimate": f"{estimate:.3f}",
            }
            rows.append({"v / v_Y": speed, "lambda": parameter, **both})
    print_table(rows)


if __name__ == "__main__":
    main()

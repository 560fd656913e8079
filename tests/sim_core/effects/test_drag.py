"""Balls in still air: terminal speed, the closed solutions for a constant drag coefficient, and the
error of a piece.

With C_d = 0.44 (Re > 1000) and k = 3/4 C_d rho_air / (rho D): without gravity v = v0 exp(-k x) and
t = (exp(k x) - 1) / (k v0); falling from rest x = ln cosh(g t / V) / k and v = V tanh(g t / V), V²
= g / k.
"""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from sim_core import (
    Balls,
    Drag,
    Gravity,
    Physics,
    RandomPhase,
    Rest,
    Scene,
    SceneError,
    TriangleMesh,
    Vibration,
    simulate,
)
from sim_core.effects.drag import drag_coefficient, new_drag_state, remaining_speed
from sim_core.effects.gravity import STANDARD as G
from sim_core.scene.invariants import closest_pair, contained, energy
from tests.helpers.scenes.cavities import FLOOR, WEIGHTLESS, box, cylinder, uniform_restitution
from tests.sim_core.physics.test_conservation import gas

DIAMETER, DENSITY = 3e-3, 7800.0
RADIUS = 0.5 * DIAMETER
AIR, VISCOSITY = 1.204, 1.82e-5
THICK = Drag(
    density=1000.0 * AIR, viscosity=VISCOSITY
)  # Re > 1000 down to 5 mm/s, and 400 m/s² at 5 m/s
K = 0.75 * 0.44 * THICK.density / (DENSITY * DIAMETER)


def row(
    distances: np.ndarray, velocity: tuple[float, float, float], tall: float
) -> tuple[TriangleMesh, Balls]:
    """Balls side by side, so far above the floor or, when they fly up, below the ceiling [m]; none
    meets another.
    """
    positions = np.stack(
        [0.01 * (1.0 + np.arange(len(distances))), np.full(len(distances), 0.01), distances], axis=1
    )
    positions[:, 2] = tall - RADIUS - distances if velocity[2] > 0.0 else RADIUS + distances
    room = box((0.01 * (len(distances) + 1), 0.02, tall))
    return room, Balls(positions, np.tile(velocity, (len(distances), 1)), DIAMETER, DENSITY)


def first_hits(
    room: TriangleMesh, balls: Balls, physics: Physics, duration: float
) -> tuple[np.ndarray, np.ndarray]:
    """Time and normal speed of each ball's first impact."""
    log = simulate(Scene(room, balls, physics, duration)).impacts
    first = np.array([np.flatnonzero(log.ball == ball)[0] for ball in range(len(balls))])
    return log.time[first], log.normal_speed[first]


@pytest.mark.parametrize(
    ("diameter", "density", "tall"),
    [(3e-3, 7800.0, 1000.0), (1e-3, 500.0, 100.0)],
    ids=["steel", "light"],
)
def test_a_falling_ball_comes_to_its_terminal_speed(
    diameter: float, density: float, tall: float
) -> None:
    def pull(v: float) -> float:
        re = AIR * v * diameter / VISCOSITY
        cd = 0.44 if re >= 1000.0 else 24.0 / re * (1.0 + 0.15 * re**0.687)
        return 0.75 * cd * AIR / (density * diameter) * v * v - G

    terminal = brentq(pull, 1e-3, 100.0)
    ball = Balls(np.array([[1.0, 1.0, tall - 1.0]]), np.zeros((1, 3)), diameter, density)
    end = simulate(
        Scene(box((2.0, 2.0, tall)), ball, Physics(Gravity(), drag=Drag()), 0.7 * tall / terminal)
    ).balls
    print(f"terminal {terminal:.6f}, reached {-end.velocities[0, 2]:.6f} m/s")
    assert end.velocities[0, :2].tolist() == [0.0, 0.0]
    assert -end.velocities[0, 2] == pytest.approx(terminal, rel=2e-4)


def worst(drag: Drag, gravity: bool) -> tuple[float, float]:
    """Largest errors of place [m] and speed [m/s] at the first impact, over distances that end
    anywhere in a piece.
    """
    distances = np.linspace(0.04, 0.06, 41)
    if gravity:
        room, balls = row(distances, (0.0, 0.0, 0.0), 0.1)
        time, speed = first_hits(room, balls, Physics(Gravity(), drag=drag), 1.0)
        top = math.sqrt(G / K)
        place, exact = (
            np.log(np.cosh(G * time / top)) / K,
            top * np.sqrt(-np.expm1(-2.0 * K * distances)),
        )
    else:
        room, balls = row(distances, (0.0, 0.0, 5.0), 0.1)
        time, speed = first_hits(room, balls, Physics(WEIGHTLESS, drag=drag), 1.0)
        place, exact = np.log1p(K * 5.0 * time) / K, 5.0 * np.exp(-K * distances)
    return float(np.abs(place - distances).max()), float(np.abs(speed - exact).max())


@pytest.mark.parametrize("gravity", [False, True], ids=["weightless", "falling"])
def test_the_error_of_a_piece_is_as_stated_and_falls_with_its_square(gravity: bool) -> None:
    pieces = (1e-3, 5e-4, 2.5e-4)
    errors = [worst(THICK._replace(piece=piece), gravity) for piece in pieces]
    steepest = (
        K * 25.0 if not gravity else G
    )  # m/s²: the deceleration at 5 m/s, or at the terminal speed
    for piece, (place, _) in zip(pieces, errors, strict=True):
        print(f"{piece:g} s: {place:.3g} m of {steepest * piece**2 / 8.0:.3g}")
        assert (
            place < 1.5 * steepest * piece**2 / 8.0
        )  # the bound is of one piece; Strang's own error comes on top
    for coarse, fine in pairwise(errors):
        for one, two in zip(coarse, fine, strict=True):
            assert 3.2 < one / two < 5.0


def test_within_a_piece_the_path_is_off_by_at_most_an_eighth_of_the_square() -> None:
    """Of the deceleration: the first piece of a flight, after a hit, from wall to wall within
    it.
    """
    piece, distances = 1e-2, np.linspace(2e-3, 4.5e-2, 40)
    drag = Drag(density=50.0 * AIR, viscosity=VISCOSITY, piece=piece)
    k = K * 0.05
    room, balls = row(distances, (0.0, 0.0, 5.0), 0.05 + DIAMETER)
    log = simulate(Scene(room, balls, Physics(WEIGHTLESS, drag=drag), 0.03)).impacts
    for ball in range(len(balls)):
        one, two = np.flatnonzero(log.ball == ball)[
            :2
        ]  # ceiling, then floor: 50 mm apart, in about 10 ms
        speed = log.normal_speed[one]
        place = math.log1p(k * speed * (log.time[two] - log.time[one])) / k
        assert abs(place - 0.05) < 1.05 * k * speed**2 * piece**2 / 8.0


def test_a_small_slow_ball_is_slowed_as_its_equation_says() -> None:
    """Schiller & Naumann's range, Re 300 to 30, against Runge and Kutta."""
    diameter, density = 1e-3, 500.0
    ball = Balls(np.array([[0.1, 0.1, 0.1]]), np.array([[0.0, 0.0, 4.5]]), diameter, density)
    end = simulate(Scene(box((0.2, 0.2, 3.0)), ball, Physics(WEIGHTLESS, drag=Drag()), 1.0)).balls

    def slope(v: float) -> float:
        re = AIR * v * diameter / VISCOSITY
        return -18.0 * VISCOSITY / (density * diameter**2) * v * (1.0 + 0.15 * re**0.687)

    v, x, step = 4.5, 0.1, 1e-4
    for _ in range(10_000):
        a = slope(v)
        b = slope(v + 0.5 * step * a)
        c = slope(v + 0.5 * step * b)
        x += step * v + step * step * (a + b + c) / 6.0
        v += step * (a + 2.0 * b + 2.0 * c + slope(v + step * c)) / 6.0
    assert end.velocities[0, 2] == pytest.approx(v, rel=1e-9)
    assert end.positions[0, 2] == pytest.approx(
        x, abs=3.0 * abs(slope(4.5)) * Drag().piece ** 2 / 8.0
    )


def test_a_gas_only_loses_energy_and_its_balls_stay_apart_and_inside() -> None:
    room = cylinder(0.02, 0.02, sections=37)
    balls = gas(room, 40, 3.0, 2)
    last = energy(balls, Gravity())
    for _ in range(10):
        balls = simulate(
            Scene(room, balls, Physics(Gravity(), drag=Drag(density=100.0)), 0.05, record=())
        ).balls
        assert energy(balls, Gravity()) < last * (1.0 + 1e-12)
        last = energy(balls, Gravity())
        assert contained(room, balls.positions).all()
        assert closest_pair(balls)[0] > DIAMETER - 1e-12


def test_air_so_thin_that_it_does_nothing_changes_nothing() -> None:
    room = box((0.03, 0.03, 0.03))
    start = gas(room, 1, 3.0, 1)
    thin, none = (
        simulate(Scene(room, start, Physics(Gravity(), drag=drag), 0.2)).balls
        for drag in (Drag(density=1e-12, viscosity=1e-17), None)
    )
    np.testing.assert_allclose(thin.positions, none.positions, atol=1e-9)


@pytest.mark.long
def test_drag_goes_with_contact_mode_and_drawn_phases() -> None:
    """Heavy air over a lossy floor: shot comes to rest on the still floor, and goes on over the
    shaking one.
    """
    room = box((0.03, 0.03, 0.03))
    law = uniform_restitution(0.6, 1.0)
    physics = Physics(Gravity(), law, rest=Rest(), drag=Drag(density=50.0))
    start = gas(room, 20, 1.0, 1)
    assert len(simulate(Scene(room, start, physics, 2.0)).resting) == 20
    shaking = physics._replace(vibration=Vibration(FLOOR, 40e-6, 20e3), random_phase=RandomPhase())
    up = Balls(start.positions + np.array([0.0, 0.0, 1e-4]), start.velocities, DIAMETER)
    assert simulate(Scene(room, up, shaking, 1.0)).collisions.sonotrode > 100


@pytest.mark.long
def test_no_ball_jams_on_its_way_up_with_the_sonotrode() -> None:
    """It bounces there at ever the same 10 mm/s; kicks that took from each bounce would end in
    infinitely many.
    """
    room = cylinder(0.035, 0.04)
    law = uniform_restitution(0.91, 1.0)
    physics = Physics(Gravity(), law, Vibration(FLOOR, 25e-6, 20e3, 0.3), drag=Drag())
    start = gas(room, 200, 2.0, 1)
    up = Balls(start.positions + np.array([0.0, 0.0, 5e-5]), start.velocities, DIAMETER)
    assert simulate(Scene(room, up, physics, 30.0, record=())).collisions.sonotrode > 50_000


@pytest.mark.parametrize(
    ("drag", "said"),
    [(Drag(density=-1.0), "density"), (Drag(piece=0.0), "piece"), (Drag(piece=1e-7), "piece")],
)
def test_air_that_is_none_is_named(drag: Drag, said: str) -> None:
    with pytest.raises(SceneError, match=rf"drag\.{said} is "):
        Scene(box((0.03,) * 3), gas(box((0.03,) * 3), 1, 1.0, 1), Physics(drag=drag), 1.0)


@pytest.mark.parametrize(
    ("diameter", "density", "speed"),
    [(1e-3, 500.0, 4.5), (3e-3, 7800.0, 20.0), (2e-3, 1000.0, 0.5)],
)
def test_the_speed_that_remains_is_that_of_the_force_of_the_air(
    diameter: float, density: float, speed: float
) -> None:
    """Its deceleration is C_d rho v² A / 2 over the mass, with Reynolds numbers on either side."""
    air = Drag()
    state = new_drag_state(air, np.array([9.0, diameter]), np.array([9.0, density]))
    assert state is not None
    share = remaining_speed.py_func

    def deceleration(_: float, v: np.ndarray) -> np.ndarray:
        coefficient = drag_coefficient(float(air.density * v[0] * diameter / air.viscosity))
        force = coefficient * 0.5 * air.density * v**2 * np.pi / 4.0 * diameter**2
        return -force / (density * np.pi / 6.0 * diameter**3)

    for span in (1e-3, 0.05):
        exact = solve_ivp(deceleration, (0.0, span), [speed], rtol=1e-9).y[0, -1]
        left = share(state, 1, speed, span)
        assert speed * left == pytest.approx(exact, rel=1e-6)
        assert share(state, 1, speed * left, -span) == pytest.approx(1.0 / left)

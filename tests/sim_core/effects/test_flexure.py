"""Balls that hit thin parts: Zener's curve, its parameter, and hits in a simulation."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import beta

from sim_core import (
    Balls,
    Flexure,
    PartRotation,
    Physics,
    Restitution,
    Scene,
    SceneError,
    TriangleMesh,
    plate_mobility,
    simulate,
    zener_parameter,
    zener_restitution,
)
from sim_core.effects.flexure import new_flexure_state
from tests.helpers.scenes.cavities import CEILING, FLOOR, SIDES, WEIGHTLESS, box, box_around
from tests.helpers.scenes.turning_parts import PART, bar

STEEL = 210e9 / (1.0 - 0.3**2)  # E / (1 - nu²) [Pa]
TITANIUM = 113.8e9 / (1.0 - 0.342**2)
CONTACT = 1.0 / (1.0 / STEEL + 1.0 / TITANIUM)
RHO = 4430.0  # of titanium [kg/m³]


def solved(parameter: float) -> tuple[float, float]:
    """Restitution of Zener's equation, and the energy that the plate takes over that of the ball.

    The plate's share is the work of the force F on the speed Y F, in the units of the equation.
    """

    def rates(_: float, state: np.ndarray) -> list[float]:
        root = math.sqrt(max(state[0], 0.0))
        force = root**3
        return [
            state[1],
            -force - parameter * 1.5 * root * state[1],
            2.0 * parameter * force * force,
        ]

    def ends(_: float, state: np.ndarray) -> float:
        return float(state[0])

    ends.terminal, ends.direction = True, -1  # type: ignore[attr-defined]
    run = solve_ivp(
        rates, (0.0, 100.0), [0.0, 1.0, 0.0], "DOP853", events=ends, rtol=1e-10, atol=1e-12
    )
    return -float(run.y[1, -1]), float(run.y[2, -1])


@pytest.mark.parametrize("parameter", [0.001, 0.05, 0.25, 0.4971, 1.0, 1.7, 2.9])
def test_the_curve_solves_zeners_equation_and_keeps_energy(parameter: float) -> None:
    e, into_plate = solved(parameter)
    assert e * e + into_plate == pytest.approx(1.0, abs=1e-7)
    assert zener_restitution(parameter) == pytest.approx(e, abs=3e-5)


def test_small_losses_are_those_of_hertz() -> None:
    """With Hertz's force F the plate takes Y times the integral of F² over time.

    With sigma'² = 1 - 4/5 sigma^(5/2) that is lambda (4/5) (5/4)^(8/5) B(8/5, 1/2) m v².
    """
    slope = 0.8 * 1.25**1.6 * beta(1.6, 0.5)
    assert slope == pytest.approx(1.7302, abs=1e-4)
    lost = (1.0 - zener_restitution(1.0 / 256.0)) * 256.0
    assert lost == pytest.approx(slope, rel=0.01)
    assert zener_restitution(0.0) == 1.0
    falling = np.diff(zener_restitution(np.linspace(0.0, 3.0, 2000)))
    assert (falling < 0.0).all()


def test_the_parameter_is_the_usual_one() -> None:
    """Lambda in the numbers of ball and plate, as it is given by most."""
    radius, thickness, speed, rho = 1.5e-3, 1e-3, 5.0, 7800.0
    mass = 4.0 / 3.0 * math.pi * radius**3 * rho
    mobility = plate_mobility(thickness, TITANIUM, RHO)
    usual = (
        math.pi**0.6
        / math.sqrt(3.0)
        * (radius / thickness) ** 2
        * (speed / math.sqrt(TITANIUM / RHO)) ** 0.2
        * (rho / RHO) ** 0.6
        * (STEEL / (STEEL + TITANIUM)) ** 0.4
    )
    found = zener_parameter(mobility, CONTACT, radius, mass, speed)
    assert found == pytest.approx(usual, rel=1e-12)
    stiffness = TITANIUM * thickness**3 / 12.0
    assert mobility == pytest.approx(1.0 / (8.0 * math.sqrt(stiffness * RHO * thickness)))


@pytest.mark.parametrize(
    ("modulus", "density", "thickness", "e"),
    [(STEEL, 7800.0, 2e-3, 0.81), (STEEL, 7800.0, 1e-3, 0.45), (TITANIUM, RHO, 2e-3, 0.73)],
)
def test_a_steel_ball_on_plates(modulus: float, density: float, thickness: float, e: float) -> None:
    """A 3 mm ball at 5 m/s, to two digits."""
    mass = 4.0 / 3.0 * math.pi * 1.5e-3**3 * 7800.0
    mobility = plate_mobility(thickness, modulus, density)
    contact = 1.0 / (1.0 / STEEL + 1.0 / modulus)
    parameter = zener_parameter(mobility, contact, 1.5e-3, mass, 5.0)
    assert zener_restitution(parameter) == pytest.approx(e, abs=0.005)
    assert solved(float(parameter))[0] == pytest.approx(e, abs=0.005)


def floor_of_strips(strips: int) -> tuple[TriangleMesh, np.ndarray]:
    """A box of 0.1 m whose floor and ceiling are strips along y, and the strip of each triangle.

    Triangles of the side walls have strip -1.
    """
    x = np.linspace(0.0, 0.1, strips + 1)
    vertices = np.array([[a, b, c] for a in x for b in (0.0, 0.1) for c in (0.0, 0.1)])
    quads = []
    for k in range(strips):
        n = 4 * k
        quads += [
            ((n, n + 2, n + 6, n + 4), FLOOR, k),
            ((n + 1, n + 5, n + 7, n + 3), CEILING, k),
            ((n, n + 4, n + 5, n + 1), SIDES, -1),
            ((n + 2, n + 3, n + 7, n + 6), SIDES, -1),
        ]
    n = 4 * strips
    quads += [((0, 1, 3, 2), SIDES, -1), ((n, n + 2, n + 3, n + 1), SIDES, -1)]
    triangles = np.array([[q[i] for i in t] for q, *_ in quads for t in ((0, 1, 2), (0, 2, 3))])
    tags = np.repeat([tag for _, tag, _ in quads], 2).astype(np.uint8)
    return TriangleMesh(vertices, triangles, tags), np.repeat([k for *_, k in quads], 2)


LAW = (0.9, 1.0, 0.1)


def test_each_triangle_has_its_own_thickness() -> None:
    """Ten plates side by side in one flat face, each thicker than the one before.

    A ball is thrown straight at each, and hits nothing else.
    """
    mesh, strip = floor_of_strips(10)
    thickness = np.where(mesh.tags == FLOOR, 1e-3 * (1.0 + 0.3 * strip), np.inf)
    mobility = np.asarray(plate_mobility(thickness, TITANIUM, RHO))
    x, speeds = (np.arange(10) + 0.4) * 0.01, np.linspace(0.5, 8.0, 10)
    places = np.column_stack([x, np.full(10, 0.03), np.full(10, 1.6e-3)])
    velocities = np.column_stack([np.zeros((10, 2)), -speeds])
    law = Restitution((LAW,) * 3, LAW)
    physics = Physics(WEIGHTLESS, law, flexure=Flexure(mobility, CONTACT))
    after = simulate(Scene(mesh, Balls(places, velocities, 3e-3), physics, 3e-4)).balls.velocities
    mass = 4.0 / 3.0 * np.pi * 1.5e-3**3 * 7800.0
    for k in range(10):
        plate = plate_mobility(1e-3 * (1.0 + 0.3 * k), TITANIUM, RHO)
        parameter = zener_parameter(plate, CONTACT, 1.5e-3, mass, speeds[k])
        rigid = 0.9 * max(speeds[k], 1.0) ** -0.1
        expected = rigid * zener_restitution(parameter) * speeds[k]
        assert after[k, 2] == pytest.approx(expected, rel=1e-9)


def test_each_ball_has_its_own_size_and_mass() -> None:
    diameters, densities = np.array([2e-3, 3e-3, 3e-3]), np.array([7800.0, 7800.0, 14900.0])
    balls = Balls(np.eye(3), np.zeros((3, 3)), diameters, densities)
    flexure = Flexure(np.array([0.0, 0.05]), CONTACT)
    state = new_flexure_state(flexure, balls, np.array([0, 2], dtype=np.uint8))
    assert state is not None
    for k in range(3):
        alone = zener_parameter(0.05, CONTACT, 0.5 * diameters[k], balls.masses[k], 5.0)
        assert state.mobility[1] * state.inertia[k] * 5.0**0.2 == pytest.approx(alone)
    assert state.bends.tolist() == [False, False, True]


def test_rigid_triangles_change_no_bit_and_slow_hits_lose_nothing() -> None:
    mesh, _ = floor_of_strips(3)
    places = np.random.default_rng(1).uniform(0.01, 0.09, (20, 3))
    velocities = np.random.default_rng(2).normal(size=(20, 3))
    balls = Balls(places, velocities, 3e-3)

    def end(flexure: Flexure | None, elastic_below: float = 0.01) -> np.ndarray:
        law = Restitution((LAW,) * 3, LAW, elastic_below)
        physics = Physics(WEIGHTLESS, law, flexure=flexure)
        return simulate(Scene(mesh, balls, physics, 0.5)).balls.velocities

    count = len(mesh.triangles)
    rigid, thin = (Flexure(np.full(count, y), CONTACT) for y in (0.0, 0.05))
    np.testing.assert_array_equal(end(None), end(rigid))
    np.testing.assert_array_equal(end(None, 100.0), end(thin, 100.0))
    assert (end(thin) != end(None)).any()


@pytest.mark.long
def test_a_turning_part_can_be_thin() -> None:
    """The ball meets the part's own triangle, whose speed is that of the axis: none here."""
    mesh = box_around(bar(), 0.05)
    mobility = np.where(mesh.tags == PART, 0.05, 0.0)
    balls = Balls(np.array([[1e-4, 0.0, 0.02]]), np.array([[0.0, 0.0, -4.0]]), 3e-3)
    physics = Physics(
        restitution=Restitution((LAW,) * 3, LAW),
        part_rotation=PartRotation(PART, axis=(0.0, 0.0, 1.0), rpm=60.0),
        flexure=Flexure(mobility, CONTACT),
    )
    end = simulate(Scene(mesh, balls, physics, 0.01)).balls.velocities[0, 2]
    mass = 4.0 / 3.0 * math.pi * 1.5e-3**3 * 7800.0
    share = zener_restitution(zener_parameter(0.05, CONTACT, 1.5e-3, mass, 4.0))
    assert end == pytest.approx(4.0 * 0.9 * 4.0**-0.1 * share, rel=1e-9)


ROOM = box((0.1, 0.1, 0.1))
RIGID = np.zeros(len(ROOM.triangles))


@pytest.mark.parametrize(
    ("flexure", "told"),
    [
        (Flexure(RIGID[1:], CONTACT), "flexure.mobility has shape"),
        (Flexure(RIGID - 1.0, CONTACT), r"flexure.mobility\[0\]"),
        (Flexure(RIGID * math.nan, CONTACT), r"flexure.mobility\[0\]"),
        (Flexure(np.array(["thin"] * len(RIGID)), CONTACT), "flexure.mobility must be numbers"),
        (Flexure(RIGID, 0.0), "flexure.modulus"),
        (Flexure(RIGID, math.inf), "flexure.modulus"),
        (RIGID, "physics.flexure"),
    ],
)
def test_bad_flexure_is_refused_by_name(flexure: object, told: str) -> None:
    balls = Balls(np.array([[0.05, 0.05, 0.05]]), np.zeros((1, 3)), 3e-3)
    law = Restitution((LAW,) * 3, LAW)
    with pytest.raises(SceneError, match=told):
        Scene(ROOM, balls, Physics(restitution=law, flexure=flexure), 1.0)  # type: ignore[arg-type]


def test_flexure_needs_a_restitution_to_lower() -> None:
    balls = Balls(np.array([[0.05, 0.05, 0.05]]), np.zeros((1, 3)), 3e-3)
    with pytest.raises(SceneError, match="give a Restitution too"):
        Scene(ROOM, balls, Physics(flexure=Flexure(RIGID, CONTACT)), 1.0)

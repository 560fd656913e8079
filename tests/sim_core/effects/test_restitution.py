"""Laws of restitution against closed forms, laws that are refused, and slow bounces."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from sim_core import (
    Balls,
    Gravity,
    Physics,
    Rest,
    Restitution,
    RestitutionLaw,
    Scene,
    SceneError,
    SimulationError,
    TabulatedRestitution,
    restitution_at,
    simulate,
)
from sim_core.effects.gravity import STANDARD as G
from sim_core.effects.restitution import checked_restitution, restitution_law
from tests.helpers.scenes.cavities import WEIGHTLESS, balls_at, box, uniform_restitution

DIAMETER = 3e-3
ROOM = box((0.02, 0.02, 0.02))
BALL = balls_at(np.array([[0.01, 0.01, 0.0025]]))
ANY = (0.3, 0.1)  # of what is not hit


def of_table(speed: float) -> float:
    """TABLE by hand."""
    if speed < 1.0:
        return 0.95 if speed < 0.2 else 0.95 - 0.15 * (speed - 0.2) / 0.8
    return 0.8 - 0.15 * (speed - 1.0) if speed < 3.0 else 0.5


TABLE = TabulatedRestitution((0.2, 1.0, 3.0), (0.95, 0.8, 0.5))
LAWS: dict[str, tuple[RestitutionLaw, Callable[[float], float]]] = {
    "McNamara and Falcon": ((0.9, 0.7), lambda v: 0.9 * max(v / 0.7, 1.0) ** -0.25),
    "another exponent": ((0.9, 0.7, 0.6), lambda v: 0.9 * max(v / 0.7, 1.0) ** -0.6),
    "constant": ((0.8, 0.7, 0.0), lambda v: 0.8),
    "table": (TABLE, of_table),
    "table of one": (TabulatedRestitution([0.0], np.array([0.6])), lambda v: 0.6),
    "table that rises from 0": (
        TabulatedRestitution((0.0, 4.0), (0.0, 1.0)),
        lambda v: min(v / 4.0, 1.0),
    ),
}
SPEEDS = (0.1, 0.7, 1.0, 2.3, 5.0)  # m/s


@pytest.mark.parametrize("rest", [None, Rest()])
@pytest.mark.parametrize("law", LAWS)
def test_a_dropped_ball_rises_to_e_squared_of_its_height(law: str, rest: Rest | None) -> None:
    """In contact mode too. Its floor has the law, and walls and balls have others."""
    given, e = LAWS[law]
    floor_only = Restitution((ANY, given, ANY), ANY)
    for speed in SPEEDS:
        height = 0.5 * speed**2 / G
        room, radius = box((0.03, 0.03, height + 0.01)), 0.5 * DIAMETER
        ball = balls_at(np.array([[0.01, 0.02, height + radius]]), DIAMETER)
        at_the_top = speed / G + e(speed) * speed / G
        end = simulate(Scene(room, ball, Physics(Gravity(), floor_only, rest=rest), at_the_top))
        np.testing.assert_allclose(
            end.balls.positions[0, 2] - radius, e(speed) ** 2 * height, rtol=1e-12, atol=1e-15
        )


@pytest.mark.parametrize("law", LAWS)
def test_two_balls_part_with_e_times_the_speed_at_which_they_met(law: str) -> None:
    given, e = LAWS[law]
    room = box((0.1, 0.1, 0.1))
    places = np.array([[0.048, 0.05, 0.05], [0.052, 0.05, 0.05]])
    for speed in SPEEDS:
        velocities = np.array([[speed + 0.3, 0, 0], [0.3, 0, 0]])
        physics = Physics(WEIGHTLESS, Restitution((ANY,) * 3, given))
        shot = Balls(places, velocities, DIAMETER)
        end = simulate(Scene(room, shot, physics, 0.0011 / speed)).balls.velocities
        np.testing.assert_allclose(end[1, 0] - end[0, 0], e(speed) * speed, rtol=1e-12)
        np.testing.assert_allclose(end.sum(axis=0), velocities.sum(axis=0), atol=1e-14)


@pytest.mark.parametrize("law", LAWS)
def test_a_slow_ball_rises_from_one_that_lies_still_by_the_law_of_balls(law: str) -> None:
    """Below elastic_below a ball that lies still is a still surface."""
    given, e = LAWS[law]
    speed = 0.7
    height, radius = 0.5 * speed**2 / G, 0.5 * DIAMETER
    places = np.array([[0.01, 0.01, radius], [0.01, 0.01, 3.0 * radius + height]])
    physics = Physics(Gravity(), Restitution((ANY,) * 3, given, elastic_below=1.0), rest=Rest())
    room = box((0.02, 0.02, 0.06))
    at_the_top = (1.0 + e(speed)) * speed / G
    end = simulate(Scene(room, balls_at(places, DIAMETER), physics, at_the_top)).balls
    rise = end.positions[1, 2] - 3.0 * radius
    np.testing.assert_allclose(rise, e(speed) ** 2 * height, rtol=1e-9)


def test_each_surface_has_a_law_of_its_own_kind() -> None:
    """A table's rows of points are longer than a power law's."""
    given = Restitution([law for law, _ in LAWS.values()], (0.7, 1.0))
    points = checked_restitution(given, len(LAWS)).points
    speeds = np.concatenate([[0.0, 0.2, 3.0, 4.0, 1e300], np.geomspace(1e-3, 100.0, 200)])
    for row, (law, e) in enumerate(LAWS.values()):
        compiled = [restitution_law(points, row, speed) for speed in speeds]
        np.testing.assert_allclose(compiled, [e(speed) for speed in speeds], rtol=1e-14)
        np.testing.assert_allclose(restitution_at(speeds, law), compiled, rtol=1e-14)
    assert restitution_law(points, len(LAWS), 0.5) == 0.7


def test_a_table_is_another_law_to_a_thousandth() -> None:
    speeds = np.linspace(0.0, 20.0, 5001)
    points = np.geomspace(0.5, 20.0, 40)
    sampled = TabulatedRestitution(points, restitution_at(points, (0.91, 0.5)))
    wanted = restitution_at(speeds, (0.91, 0.5))
    np.testing.assert_allclose(restitution_at(speeds, sampled), wanted, rtol=0, atol=1e-3)

    def bizon(speed: np.ndarray) -> np.ndarray:
        """Phys. Rev. Lett. 80 (1998) 57: e0 = 0.7 above v0 = sqrt(g d), here of 3 mm balls."""
        ratio = speed / math.sqrt(G * DIAMETER)
        return 1.0 - 0.3 * np.minimum(ratio, 1.0) ** 0.75

    points = math.sqrt(G * DIAMETER) * np.linspace(0.0, 1.0, 20) ** 2
    sampled = TabulatedRestitution(points, bizon(points))
    speeds = np.linspace(0.0, 1.0, 5001)
    np.testing.assert_allclose(restitution_at(speeds, sampled), bizon(speeds), rtol=0, atol=1e-3)


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (0.9, r"is 0\.9: give \(C0, v0\), "),
        ((0.9,), r"is \(0\.9,\): give"),
        ((0.9, 1.0, 0.25, 1.0), "give"),
        ("09", "is '09': give"),
        ((1.1, 1.0), "C0 must lie in"),
        ((0.9, 0.0), "v0 be positive"),
        ((0.9, 1.0, -0.25), "an exponent be 0 or more"),
        ((0.9, 1.0, math.inf), "an exponent be 0 or more"),
        ((0.9, 1.0, math.nan), "an exponent be 0 or more"),
        (TabulatedRestitution((1.0, 2.0), (0.9,)), "2 speeds and 1 values of e"),
        (TabulatedRestitution((), ()), "give one e for each speed"),
        (TabulatedRestitution((1.0, 1.0), (0.9, 0.8)), r"speeds\[1\] is 1.0: .*ascending"),
        (TabulatedRestitution((2.0, 1.0), (0.9, 0.8)), r"speeds\[1\] is 1.0: .*ascending"),
        (TabulatedRestitution((-1.0, 1.0), (0.9, 0.8)), r"speeds\[0\] is -1.0: .*ascending"),
        (TabulatedRestitution((1.0, math.inf), (0.9, 0.8)), r"speeds\[1\] is inf: .*asc"),
        (TabulatedRestitution((1.0, math.nan), (0.9, 0.8)), r"speeds\[1\] is nan: .*asc"),
        (TabulatedRestitution((1.0, 2.0), (0.9, 1.1)), r"e\[1\] is 1.1: .*lie in \[0, 1\]"),
        (TabulatedRestitution((1.0, 2.0), (0.9, math.nan)), r"e\[1\] is nan: .*lie in \[0, 1\]"),
        (TabulatedRestitution((1.0, "2"), (0.9, 0.8)), "speeds is '2': give a number"),  # type: ignore[arg-type]
        (TabulatedRestitution(1.0, 0.9), "speeds is 1.0: give a list"),  # type: ignore[arg-type]
    ],
)
def test_a_bad_law_is_refused_by_name(law: Any, message: str) -> None:
    good = (0.9, 1.0)
    for name, restitution in {
        "surfaces[1]": Restitution((good, law, good), good),
        "balls": Restitution((good,) * 3, law),
    }.items():
        with pytest.raises(SceneError, match=message) as caught:
            Scene(ROOM, BALL, Physics(Gravity(), restitution), 0.01)
        assert str(caught.value).startswith(f"restitution.{name}")


@pytest.mark.parametrize("surfaces", [0.9, None, TABLE, (), ((0.9, 1.0),), (0.9, 1.0, 1.0)])
def test_surfaces_that_are_no_law_for_each_tag_are_refused(surfaces: Any) -> None:
    with pytest.raises(SceneError, match=r"^restitution\.surfaces.* give \(C0, v0\)"):
        Scene(ROOM, BALL, Physics(Gravity(), Restitution(surfaces, (0.9, 1.0))), 0.01)


@pytest.mark.parametrize(
    ("c0", "elastic_below"), [(True, 0.01), ("0.9", 0.01), (0.9, True), (0.9, "0.01")]
)
def test_only_numbers_are_coefficients(c0: Any, elastic_below: Any) -> None:
    for restitution in (
        Restitution(((c0, 1.0), (0.9, 1.0), (0.9, 1.0)), (0.9, 1.0), elastic_below),
        Restitution(((0.9, 1.0),) * 3, (c0, 1.0), elastic_below),
    ):
        with pytest.raises(SceneError, match=r"^restitution\..* give "):
            simulate(Scene(ROOM, BALL, Physics(Gravity(), restitution), 0.01))


def test_without_a_lower_limit_the_remedy_is_one() -> None:
    """The bounces of a ball with e = 0.5 come to an end in time, but not in number."""
    physics = Physics(Gravity(), uniform_restitution(0.5, 0.7, elastic_below=0.0))

    said = r"inelastic collapse.* Raise elastic_below .* it is 0 m/s, 0\.01 m/s is usual"
    with pytest.raises(SimulationError, match=said):
        simulate(Scene(ROOM, BALL, physics, 1.0))

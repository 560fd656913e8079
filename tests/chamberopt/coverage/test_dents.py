"""Dents of single impacts against Kirk's formula, worked out by hand."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from chamberopt.coverage.dents import (
    dent_diameter,
    dent_diameters,
    impact_angle_deg,
    thin_part_factor,
)
from chamberopt.design.flexure import plate_metals
from chamberopt.design.materials import PartMaterial
from chamberopt.design.shot import ShotSize
from sim_core import plate_mobility
from tests.helpers.synthetic import impact_log, plate_design

HB = 9.81e6


def power_law(hardness: float, c0: float, v0: float) -> PartMaterial:
    """A part with this Brinell hardness and McNamara and Falcon's law."""
    return PartMaterial(C0=c0, v0_m_s=v0, hardness_HB=hardness)


def test_dent_of_kirk() -> None:
    # 3 mm steel at 5 m/s leaves about 0.40 mm in aluminium of 120 HB, 0.22 mm in steel of 650 HB.
    # The energy balance takes all of the impact energy but e² of it; e = 0.5 is a hard impact on
    # aluminium.
    aluminium = dent_diameter(np.array([5.0]), 3e-3, 7800.0, power_law(120, 0.5, 5.0 - 1e-9))[0]
    assert aluminium == pytest.approx(0.40e-3, rel=0.03)
    # By hand: 1.278 · 3 mm · (1 - 0.8²)^¼ · (7800 · 25 / (650 · 9.81e6))^¼
    steel = dent_diameter(np.array([5.0]), 3e-3, 7800.0, power_law(650, 0.8, 5.0 - 1e-9))[0]
    assert steel == pytest.approx(
        1.278 * 3e-3 * 0.36**0.25 * (7800 * 25 / (650 * HB)) ** 0.25, rel=1e-6
    )
    assert steel == pytest.approx(0.22e-3, rel=0.05)


def test_dent_uses_the_restitution_at_its_own_speed() -> None:
    # e = C0 (v/v0)^(-1/4): at 16 v0 it is C0/2.
    c0, v0 = 0.9, 0.5
    expected = 1.278 * 2e-3 * (1 - 0.45**2) ** 0.25 * (7800 * 8.0**2 / (300 * HB)) ** 0.25
    found = dent_diameter(np.array([8.0]), 2e-3, 7800.0, power_law(300, c0, v0))[0]
    assert found == pytest.approx(expected)


@pytest.mark.parametrize(
    ("law", "e"),
    [
        ({"C0": 0.9, "exponent": 1.0}, 0.225),
        ({"C0": 0.9, "exponent": 0.0}, 0.9),
        ({"e_at_m_s": [[0.0, 1.0], [4.0, 0.8], [12.0, 0.4]]}, 0.6),
    ],
)
def test_a_dent_follows_the_parts_own_law_above_the_yield_speed(
    law: dict[str, Any], e: float
) -> None:
    """e at 8 m/s, worked out by hand; up to 2 m/s there is no dent, whatever e is there."""
    material = PartMaterial.model_validate({**law, "v0_m_s": 2.0, "hardness_HB": 300.0})
    slow, fast = dent_diameter(np.array([2.0, 8.0]), 2e-3, 7800.0, material)
    assert slow == 0.0
    lost = (1 - e**2) * 7800 * 8.0**2 / (300 * HB)
    assert fast == pytest.approx(1.278 * 2e-3 * lost**0.25)


def test_no_dent_up_to_the_yield_speed() -> None:
    speeds = np.array([0.0, 0.1, 0.5, np.nextafter(0.5, 1.0)])
    sizes = dent_diameter(speeds, 2e-3, 7800.0, power_law(300, 0.9, 0.5))
    assert (sizes[:3] == 0.0).all()
    assert sizes[3] > 0.0


def test_angle_is_from_the_surface() -> None:
    velocity = np.array([[0, 0, 2.0], [2.0, 0, 0], [1.0, 0, 1.0], [np.sqrt(3), 0, 1.0]])
    angles = impact_angle_deg(velocity, np.array([2.0, 0.0, 1.0, 1.0]))
    np.testing.assert_allclose(angles, [90, 0, 45, 30], atol=1e-6)


def test_a_dent_is_as_large_as_its_own_ball_makes_it() -> None:
    """At one speed and hardness the diameter of a dent goes with that of its ball."""
    mix = (ShotSize(diameter_mm=2.0, share=0.4), ShotSize(diameter_mm=3.0, share=0.6))
    shot = plate_design().shot.model_copy(update={"diameter_mm": None, "mix": mix})
    design = plate_design().model_copy(update={"shot": shot})
    ends = np.array([0, shot.count - 1])
    small, large = dent_diameters(
        impact_log([0, 0], np.full((2, 3), 3.0), [3.0, 3.0], ends), of_thickness(None), design
    )
    assert 0.0 < small == pytest.approx(large * 2.0 / 3.0)


def of_thickness(thickness: np.ndarray | None) -> Any:
    """What dents need of a chamber: triangles of the wall, and of a part of this thickness."""
    count = 1 if thickness is None else len(thickness)
    return SimpleNamespace(
        part=SimpleNamespace(thickness=thickness), source=np.array([*range(count), -1])
    )


def largest_force(parameter: float, power: float) -> float:
    """Largest force of Zener's equation s'' + (1 + lambda d/dtau) s^power = 0, s = 0, s' = 1."""

    def rates(_: float, state: np.ndarray) -> list[float]:
        s, speed = max(state[0], 0.0), state[1]
        its_rate = power * s ** (power - 1.0) * speed
        return [speed, -(s**power) - parameter * its_rate]

    def turns(_: float, state: np.ndarray) -> float:
        return float(state[1])

    turns.terminal = True  # type: ignore[attr-defined]
    run = solve_ivp(rates, (0.0, 50.0), [0.0, 1.0], "DOP853", events=turns, rtol=1e-10, atol=1e-12)
    return float(run.y[0, -1] ** power)


def factor(mobility: float, force: float, speed: float = 1.0) -> float:
    """Of the dent whose largest force on a thick part is this one."""
    dent = np.array([math.sqrt(4.0 * force / (math.pi * HB))])
    return float(thin_part_factor(dent, np.array([speed]), np.array([mobility]), HB)[0])


@pytest.mark.parametrize("parameter", [0.02, 0.3, 1.0, 1.9, 2.0, 2.1, 5.0])
def test_dents_on_a_thin_part_go_with_the_force_of_zeners_equation(parameter: float) -> None:
    """With a force that grows linearly, as that of a dent: m, K and v are 1, and so is F."""
    expected = math.sqrt(largest_force(parameter, 1.0))
    assert factor(parameter, 1.0) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("parameter", [0.05, 0.12, 0.3, 0.6])
def test_the_factor_hardly_depends_on_how_the_force_grows(parameter: float) -> None:
    """Hertz's force, far from that of a dent, is lowered as much within 0.02."""
    hertz = 1.25**0.6
    assert largest_force(0.0, 1.5) == pytest.approx(hertz)
    expected = math.sqrt(largest_force(parameter, 1.5) / hertz)
    assert factor(parameter, hertz) == pytest.approx(expected, abs=0.02)


def test_dents_are_smaller_on_thin_triangles_only() -> None:
    """A ball of 3 mm hits a thick triangle, one of 1 mm and the wall, and rests on the thin one."""
    design = plate_design().changed({"materials.part": "42CrMo4"})
    impacts = impact_log([0, 1, 2, 1], np.full((4, 3), 3.0), [5.0, 5.0, 5.0, 0.0])
    rigid = dent_diameters(impacts, of_thickness(np.full(2, np.inf, dtype=np.float32)), design)
    thin = of_thickness(np.array([np.inf, 1e-3], dtype=np.float32))
    found = dent_diameters(impacts, thin, design)
    assert found[0] == rigid[0] == found[2]
    assert found[3] == 0.0
    metals = plate_metals(design)
    assert metals is not None
    mobility = float(plate_mobility(1e-3, 1.0 / metals.part.compliance, metals.density))
    zeta = mobility * 300 * HB * math.pi / 4.0 * rigid[1] ** 2 / 2.0 / 5.0
    half = zeta * math.acos(zeta) / (2.0 * math.sqrt(1.0 - zeta**2))
    assert found[1] / rigid[1] == pytest.approx(math.exp(-half), rel=1e-5)
    assert 0.8 < found[1] / rigid[1] < 0.95
    without = design.changed({"effects.flexure": False})
    assert (dent_diameters(impacts, thin, without) == rigid).all()

"""Dents of single impacts against Kirk's formula, worked out by hand."""

from typing import Any

import numpy as np
import pytest

from chamberopt.coverage.dents import dent_diameter, dent_diameters, impact_angle_deg
from chamberopt.design.materials import PartMaterial
from chamberopt.design.shot import ShotSize
from tests.helpers.synthetic import impact_log, plate_design

HB = 9.81e6


def power_law(hardness: float, c0: float, v0: float) -> PartMaterial:
    """A part with this Brinell hardness and McNamara and Falcon's law."""
    return PartMaterial(C0=c0, v0_m_s=v0, hardness_HB=hardness)


def test_dent_of_kirk() -> None:
    # physics.md: 3 mm steel at 5 m/s leaves about 0.40 mm in aluminium of 120 HB, 0.26 mm in steel
    # of 650 HB. Its energy balance takes all of the impact energy but e² of it; e = 0.5 is a hard
    # impact on aluminium.
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
        impact_log([0, 0], np.full((2, 3), 3.0), [3.0, 3.0], ends), design
    )
    assert 0.0 < small == pytest.approx(large * 2.0 / 3.0)

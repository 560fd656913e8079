"""A known set of impacts has a coverage that can be worked out by hand."""

import numpy as np
import pytest

from chamberopt.coverage.coverage_from_impacts import (
    coverage_at,
    mean_speed_per_triangle,
    tally_impacts,
)
from chamberopt.coverage.dents import dent_diameter, impact_angle_deg
from chamberopt.design.shot import ShotSize
from tests.helpers.synthetic import dented, impact_log, patchwork, plate_design

HB = 9.81e6


def test_dent_of_kirk() -> None:
    # physics.md: 3 mm steel at 5 m/s leaves about 0.40 mm in aluminium of 120 HB, 0.26 mm in steel
    # of 650 HB. Its energy balance takes all of the impact energy but e² of it; e = 0.5 is a hard
    # impact on aluminium.
    aluminium = dent_diameter(np.array([5.0]), 3e-3, 7800.0, 120 * HB, 0.5, 5.0 - 1e-9)[0]
    assert aluminium == pytest.approx(0.40e-3, rel=0.03)
    # By hand: 1.278 · 3 mm · (1 - 0.8²)^¼ · (7800 · 25 / (650 · 9.81e6))^¼
    steel = dent_diameter(np.array([5.0]), 3e-3, 7800.0, 650 * HB, 0.8, 5.0 - 1e-9)[0]
    assert steel == pytest.approx(
        1.278 * 3e-3 * 0.36**0.25 * (7800 * 25 / (650 * HB)) ** 0.25, rel=1e-6
    )
    assert steel == pytest.approx(0.22e-3, rel=0.05)


def test_dent_uses_the_restitution_at_its_own_speed() -> None:
    # e = C0 (v/v0)^(-1/4): at 16 v0 it is C0/2.
    c0, v0 = 0.9, 0.5
    expected = 1.278 * 2e-3 * (1 - 0.45**2) ** 0.25 * (7800 * 8.0**2 / (300 * HB)) ** 0.25
    assert dent_diameter(np.array([8.0]), 2e-3, 7800.0, 300 * HB, c0, v0)[0] == pytest.approx(
        expected
    )


def test_no_dent_up_to_the_yield_speed() -> None:
    speeds = np.array([0.0, 0.1, 0.5, np.nextafter(0.5, 1.0)])
    sizes = dent_diameter(speeds, 2e-3, 7800.0, 300 * HB, 0.9, 0.5)
    assert (sizes[:3] == 0.0).all()
    assert sizes[3] > 0.0


def test_angle_is_from_the_surface() -> None:
    velocity = np.array([[0, 0, 2.0], [2.0, 0, 0], [1.0, 0, 1.0], [np.sqrt(3), 0, 1.0]])
    angles = impact_angle_deg(velocity, np.array([2.0, 0.0, 1.0, 1.0]))
    np.testing.assert_allclose(angles, [90, 0, 45, 30], atol=1e-6)


def test_known_impacts_give_known_coverage() -> None:
    # Triangle 0: one hit of 2 m/s; 1: two hits; 2: one too slow to dent; 3: none. All head on.
    design = plate_design()
    chamber = patchwork(np.full(4, 1e-6))
    v0 = design.materials.part.yield_speed
    speeds = np.array([2.0, 2.0, 3.0, 0.5 * v0])
    log = impact_log([0, 1, 1, 2], np.outer(speeds, [0, 0, 1]), speeds)
    got = tally_impacts(log, chamber, design)
    part, shot = design.materials.part, design.shot
    size = dent_diameter(
        speeds, shot.diameter, shot.density, part.hardness, part.restitution, part.yield_speed
    )
    area = np.pi / 4 * size**2
    np.testing.assert_array_equal(got.impacts, [1, 2, 1, 0])
    np.testing.assert_array_equal(got.dents, [1, 2, 0, 0])
    np.testing.assert_allclose(got.dented_area, [area[0], area[1] + area[2], 0, 0])
    np.testing.assert_allclose(mean_speed_per_triangle(got)[:3], [2.0, 2.5, 0.5 * v0])
    assert np.isnan(mean_speed_per_triangle(got)[3])
    simulated = design.process.accuracy.simulated_time
    expected = 1 - np.exp(-got.dented_area / (1e-6 * simulated) * 7.0)
    np.testing.assert_allclose(coverage_at(got, chamber, 7.0), expected, rtol=1e-12)


def test_a_dent_is_as_large_as_its_own_ball_makes_it() -> None:
    design, chamber = plate_design(), patchwork(np.full(2, 1e-6))
    sizes = tuple(ShotSize(diameter_mm=d, share=0.5) for d in (1.0, 2.0))
    mixed = design.model_copy(
        update={"shot": design.shot.model_copy(update={"diameter_mm": None, "mix": sizes})}
    )
    diameters = np.array(mixed.shot.diameters)
    small, large = int(diameters.argmin()), int(diameters.argmax())
    log = impact_log([0, 1], np.tile([0, 0, 3.0], (2, 1)), [3.0, 3.0], [small, large])
    area = tally_impacts(log, chamber, mixed).dented_area
    assert area[1] / area[0] == pytest.approx(4.0)


def test_avrami_at_one_area() -> None:
    # Dents that add up to the triangle's area cover 1 - 1/e of it, however long that took.
    chamber = patchwork(np.array([1e-6, 4e-6]))
    assert coverage_at(dented(np.array([1e-6, 4e-6]), 10.0), chamber, 10.0) == pytest.approx(
        1 - np.exp(-1)
    )


def test_only_part_triangles_count_and_hidden_ones_have_no_coverage() -> None:
    design = plate_design()
    chamber = patchwork(np.full(3, 1e-6), exposed=np.array([1e-6, 0.0, 5e-7]))
    chamber.source[1] = -1  # a wall triangle
    log = impact_log([0, 1, 2], np.tile([0, 0, 3.0], (3, 1)), [3.0, 3.0, 3.0])
    got = tally_impacts(log, chamber, design)
    np.testing.assert_array_equal(got.impacts, [1, 0, 1])
    coverage = coverage_at(got, chamber, 1.0)
    assert np.isnan(coverage[1])
    # Half exposed: the same dent is twice the share.
    assert np.log1p(-coverage[2]) == pytest.approx(2 * np.log1p(-coverage[0]))


def test_no_impacts_is_no_coverage() -> None:
    design, chamber = plate_design(), patchwork(np.full(3, 1e-6))
    got = tally_impacts(impact_log([], np.empty((0, 3)), []), chamber, design)
    assert (coverage_at(got, chamber, 100.0) == 0.0).all()


def test_tallies_add_and_part_again() -> None:
    one, two = dented(np.array([1.0, 2.0]), 1.0), dented(np.array([3.0, 5.0]), 2.0)
    both = one + two
    assert both.simulated_time == 3.0
    np.testing.assert_array_equal(both.dented_area, [4.0, 7.0])
    np.testing.assert_array_equal((both - two).dented_area, one.dented_area)
    np.testing.assert_array_equal((both - two).impacts, one.impacts)

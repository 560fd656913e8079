"""Values in windows and of triangles against counts by hand, and intervals that hold the truth."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.facet_invariance import cases
from chamberopt.chamber.build import build_chamber
from chamberopt.coverage.coverage_from_impacts import coverage_from_dent_density
from chamberopt.coverage.field.smooth_faces import Places
from chamberopt.coverage.field.symmetry import turn_about_axis
from chamberopt.pictures.quantities import QUANTITIES
from chamberopt.simulation.evaluation import Evaluation
from chamberopt.simulation.field_values import PartField, _quantile, density_bounds
from tests.chamberopt.coverage.field.test_symmetry import cube
from tests.helpers.synthetic import (
    ANGLE,
    SPEED,
    evaluation_of,
    no_hits,
    plane_chamber,
    plate_design,
    random_dents,
)

DESIGN = plate_design()
PLANE = plane_chamber()
DENT = 0.2e-3  # m
PER_MM2, REPLICAS = 50.0, 4


@pytest.fixture(scope="module")
def evaluation() -> Evaluation:
    rng = np.random.default_rng(1)
    mean = 1e6 * PER_MM2 / REPLICAS * PLANE.part.area
    hits = [random_dents(DESIGN, PLANE, mean, rng, DENT) for _ in range(REPLICAS)]
    return evaluation_of(DESIGN, PLANE, hits)


@pytest.fixture(scope="module")
def field(evaluation: Evaluation) -> PartField:
    return PartField(DESIGN, PLANE, evaluation)


def test_how_far_the_surface_was_moved_is_known_everywhere(tmp_path: Path) -> None:
    """Nowhere further than the largest move, and on the share of the target that was moved."""
    case = dict(cases())["block, R = 3 r"]
    case.coarse["strips of 30 degrees"](tmp_path / "part.stl")
    design = case.design.changed({"part.mesh": str(tmp_path / "part.stl"), "part.unit": "mm"})
    chamber = build_chamber(design)
    assert chamber.part.smoothing is not None
    values = PartField(design, chamber, evaluation_of(design, chamber, [no_hits()] * 3))
    moved = values.element_values()["moved_um"]
    largest = 1e6 * chamber.part.smoothing.largest_move
    assert 0.7 * largest < np.nanmax(moved) <= 1.001 * largest
    area = np.where(chamber.part.target, chamber.part.area, 0.0)
    share = area[moved > 0.01].sum() / area.sum()
    assert share == pytest.approx(chamber.part.smoothing.moved_share, abs=0.02)


def times_longer() -> float:
    """Treatment time over simulated time."""
    return DESIGN.process.treatment_time / (REPLICAS * DESIGN.process.recorded_time)


def test_values_of_an_even_rain_of_equal_dents(field: PartField) -> None:
    """Means over the plane are those of the dents; impacts follow the dented area."""
    values = field.values(field.target.gauge.windows.points)
    x = 1e6 * PER_MM2 * np.pi / 4.0 * DENT**2 * times_longer()
    energy = 0.5e3 * DESIGN.shot.ball_mass * SPEED**2  # mJ
    for name, wanted in (
        ("dent_density", x),
        ("impacts_per_mm2", PER_MM2 * times_longer()),
        ("energy_per_mm2", PER_MM2 * times_longer() * energy),
        ("dents_in_window", PER_MM2 * np.median(field.target.gauge.area) * 1e6),
    ):
        assert values[name].mean() == pytest.approx(wanted, rel=0.05), name
    for name, wanted in (
        ("mean_normal_speed", SPEED),
        ("mean_angle_deg", ANGLE),
        ("mean_dent_um", 1e6 * DENT),
        ("p90_normal_speed", SPEED),
    ):
        assert values[name] == pytest.approx(wanted, rel=0.05), name
    strength = 0.9e6 * DENT**2 / DESIGN.shot.diameter
    assert values["strength_um"] == pytest.approx(strength, rel=0.03)
    assert values["coverage"] == pytest.approx(coverage_from_dent_density(values["dent_density"]))
    assert (values["reachable"] == 1.0).all()


def test_there_is_all_that_can_be_drawn(field: PartField) -> None:
    elements = field.element_values()
    # Of designs with zones, of calibrated ones, of parts with rounds, and with [stress].
    of_others = {"zone", "almen_intensity_mmA", "moved_um", "surface_stress_MPa"}
    assert {one.column for one in QUANTITIES.values()} - of_others <= set(elements)
    assert {column.shape for column in elements.values()} == {(len(PLANE.part.triangles),)}


def test_triangles_count_their_own_impacts(field: PartField, evaluation: Evaluation) -> None:
    elements = field.element_values()
    triangle = np.concatenate([hits.triangle for hits in evaluation.hits])
    count = np.bincount(triangle, minlength=len(PLANE.part.triangles))
    np.testing.assert_array_equal(elements["impacts"], count)
    np.testing.assert_array_equal(elements["dents"], count)
    np.testing.assert_array_equal(elements["target"], PLANE.part.target)
    assert elements["exposed_area_mm2"] == pytest.approx(1e6 * PLANE.part.area)
    assert elements["reachable_area_mm2"][PLANE.part.target] == pytest.approx(
        1e6 * PLANE.part.area[PLANE.part.target]
    )


def test_the_mean_over_triangles_is_the_mean_of_the_field(
    field: PartField, evaluation: Evaluation
) -> None:
    elements, own = field.element_values(), PLANE.part.target
    mean = np.average(elements["coverage"][own], weights=PLANE.part.area[own])
    assert mean == pytest.approx(evaluation.metrics["mean_coverage"].value, abs=0.01)


def test_without_any_hit_nothing_is_known() -> None:
    evaluation = evaluation_of(DESIGN, PLANE, [no_hits()] * 3)
    seen = PartField(DESIGN, PLANE, evaluation)
    values = seen.values(seen.target.some_points(100))
    for name in ("mean_normal_speed", "p90_normal_speed", "mean_angle_deg", "mean_dent_um"):
        assert np.isnan(values[name]).all()
    assert (values["coverage"] == 0.0).all()
    assert (values["resolved"] == 0.0).all()
    assert (values["coverage_interval"] == 1.0).all()


@pytest.mark.parametrize("dents", [0.3, 2.0, 20.0])
def test_the_interval_of_a_windows_coverage_holds_the_truth(dents: float) -> None:
    """In 400 windows 95 % of the intervals hold the truth, and more where dents are few."""
    rng = np.random.default_rng(4)
    count, times = rng.poisson(dents, 400), 5.0
    point = np.repeat(np.arange(400), count)
    weight = times * np.pi / 4.0 * rng.uniform(0.05, 0.15, len(point)) ** 2
    y, v = (np.bincount(point, weight**power, 400) for power in (1, 2))
    truth = dents * times * np.pi / 4.0 * (0.01 + 0.01 / 12.0)
    low, high = density_bounds(y, v, np.full(400, times * np.pi / 4.0 * 0.15**2))
    held = np.mean((low <= truth) & (truth <= high))
    assert 0.94 <= held <= 1.0
    if dents == 20.0:  # ... and it is no wider than a normal interval is
        assert held < 0.99


def test_without_a_dent_the_interval_is_that_of_less_than_four() -> None:
    """No event: the upper end of a two-sided interval is -ln 0.025 = 3.69 of them."""
    low, high = density_bounds(np.zeros(1), np.zeros(1), np.array([0.1]))
    assert (low[0], high[0]) == (0.0, pytest.approx(0.369, abs=1e-3))


def test_the_90th_percentile_is_what_nine_of_ten_do_not_exceed() -> None:
    counts = np.zeros((3, 32))
    counts[0] = 10.0
    counts[1, :16] = 5.0
    assert _quantile(counts, 0.9)[:2] == pytest.approx([0.9, 0.45])
    assert np.isnan(_quantile(counts, 0.9)[2])


def test_a_point_tells_what_the_points_tell_to_which_turns_bring_it() -> None:
    """On a cube in a square room: to the last bit, as one window is looked at for all four."""
    chamber, design = cube(), plate_design()
    hits = random_dents(design, chamber, 5e7 * chamber.exposed_area, np.random.default_rng(3))
    seen = PartField(design, chamber, evaluation_of(design, chamber, [hits] * 3))
    assert seen.field.symmetry is not None
    points = seen.field.some_points(200)
    angle = np.repeat(np.arange(4), 200) * np.pi / 2.0
    place, normal = (turn_about_axis(np.tile(one, (4, 1)), angle) for one in points[:2])
    face = seen.field.face[seen.field.symmetry.triangles_at(place)]
    found = seen.values(Places(place, normal, face))
    assert np.ptp(found["coverage"][:200]) > 0.1
    for column in found.values():
        np.testing.assert_array_equal(column.reshape(4, 200), np.tile(column[:200], (4, 1)))

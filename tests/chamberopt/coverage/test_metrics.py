"""Averages over the exposed target, weighted with area, on parts of a few triangles."""

from dataclasses import replace

import numpy as np
import pytest

from chamberopt.common.errors import InputError
from chamberopt.coverage.metrics import METRICS, NEVER, OBJECTIVES, parse_objective
from chamberopt.design.design import validate
from chamberopt.optimize import study
from chamberopt.simulation.evaluate import estimate_metrics
from tests.helpers.synthetic import dented, equal_dents, patchwork, plate_design

MM2 = 1e-6


def coverage(share: np.ndarray, area: np.ndarray, treatment_time: float) -> np.ndarray:
    """Dented area in 1 s that gives these coverages at the treatment time."""
    return -np.log1p(-np.asarray(share)) * area / treatment_time


def goal(*case) -> float:
    """Uniform coverage as plain numbers."""
    return sum(
        weight * METRICS[name].value(*case)
        for name, weight in parse_objective("uniform_coverage").terms.items()
    )


@pytest.fixture
def case() -> tuple:
    # 1, 2, 1 mm² covered 0.9, 0.6, 0.3: mean 0.6, variance (0.09 + 0 + 0.09) / 4 = 0.045
    design = plate_design(process__treatment_time_s=50)
    area = np.array([1.0, 2.0, 1.0]) * MM2
    total = dented(coverage([0.9, 0.6, 0.3], area, 50.0), 1.0, dents=np.array([4, 2, 2]), speed=3.0)
    return total, patchwork(area), design


def test_by_hand(case: tuple) -> None:
    values = {
        name: METRICS[name].value(*case)
        for name in METRICS
        if name not in ("time_to_98_s", "intensity_uniformity")
    }
    assert values["mean_coverage"] == pytest.approx(0.6)
    assert values["std_coverage"] == pytest.approx(np.sqrt(0.045))
    assert values["impacts_per_mm2_s"] == pytest.approx(8 / 4)
    assert values["mean_normal_speed_m_s"] == pytest.approx(3.0)
    assert values["shot_count"] == case[2].shot.count
    assert goal(*case) == pytest.approx(0.6 - np.sqrt(0.045))


def test_evenly_covered_is_worth_its_mean_and_full_is_one() -> None:
    design = plate_design(process__treatment_time_s=50)
    area = np.array([1.0, 2.0, 3.0]) * MM2
    even = dented(coverage(np.full(3, 0.8), area, 50.0), 1.0)
    assert goal(even, patchwork(area), design) == pytest.approx(0.8)
    full = dented(1e3 * area, 1.0)
    assert goal(full, patchwork(area), design) == pytest.approx(1.0)


def test_fifth_percentile_of_a_ramp() -> None:
    design = plate_design(process__treatment_time_s=50)
    share = np.linspace(0.0, 0.999, 1000)
    area = np.full(1000, MM2)
    total = dented(coverage(share, area, 50.0), 1.0)
    p05 = METRICS["p05_coverage"].value(total, patchwork(area), design)
    assert p05 == pytest.approx(0.05, abs=0.001)


def test_hidden_target_counts_as_not_covered(case: tuple) -> None:
    """Else a study would lower the ceiling over whatever is hard to reach."""
    total, chamber, design = case
    whole, area = METRICS["mean_coverage"].value(total, chamber, design), chamber.part.area
    third = METRICS["mean_coverage"].value(
        total,
        replace(chamber, part=replace(chamber.part, target=np.array([False, False, True]))),
        design,
    )
    hidden = replace(chamber, exposed_area=chamber.exposed_area * [1, 1, 0])
    assert METRICS["mean_coverage"].value(total, hidden, design) == pytest.approx(
        whole - third * area[2] / area.sum()
    )


def test_what_is_not_target_does_not_count(case: tuple) -> None:
    total, chamber, design = case
    aside = replace(chamber, part=replace(chamber.part, target=np.array([True, False, False])))
    assert METRICS["mean_coverage"].value(total, aside, design) == pytest.approx(0.9)
    nothing = replace(chamber, part=replace(chamber.part, target=np.zeros(3, dtype=bool)))
    with pytest.raises(InputError, match=r"part\.target"):
        METRICS["mean_coverage"].value(total, nothing, design)


def test_nothing_hit() -> None:
    design, area = plate_design(), np.full(2, MM2)
    none = dented(np.zeros(2), 1.0, dents=np.zeros(2, dtype=int))
    found = estimate_metrics([none], patchwork(area), design)
    values = {name: metric.value for name, metric in found.items()}
    assert values.pop("shot_count") > 0
    assert values.pop("time_to_98_s") == NEVER
    assert set(values.values()) == {0.0}


def test_a_study_may_use_all_objectives_of_the_registry() -> None:
    for name, objective in OBJECTIVES.items():
        assert study.Objective(name=name).name == name
        assert set(objective.terms) <= set(METRICS)
    with pytest.raises(InputError, match="uniform_coverage"):
        parse_objective("shiny")


@pytest.mark.parametrize(
    ("old", "new"), [("coverage_p05", "p05_coverage"), ("time_to_98", "minus_time_to_98_s")]
)
def test_an_old_name_of_an_objective_is_refused_with_the_new_one(old: str, new: str) -> None:
    message = f"'{old}' is now called '{new}'"
    with pytest.raises(InputError, match=message):
        parse_objective(old)
    for table in ({"name": old}, {"pareto": ["uniform_coverage", old]}, {"sum": {old: 1.0}}):
        with pytest.raises(InputError, match=message):
            validate(study.Objective, table)


def test_a_sum_weighs_objectives_and_metrics() -> None:
    made = parse_objective("1 uniform_coverage + -0.001 time_to_98_s + 2 mean_coverage")
    assert made.terms == {"mean_coverage": 3.0, "std_coverage": -1.0, "time_to_98_s": -0.001}
    for wrong in ("1 shiny", "x mean_coverage", "mean_coverage"):
        with pytest.raises(InputError, match="not an objective"):
            parse_objective(wrong)


def test_time_to_98_is_when_the_poorest_twentieth_is_covered() -> None:
    """Dents at random at one rate: exp(-rate · time) = 0.02."""
    rng, area, size = np.random.default_rng(1), np.full(400, 4.0 * MM2), 0.02 * MM2
    design = plate_design(process__treatment_time_s=100.0)
    chamber = patchwork(area)
    per_second = 0.02  # dented area over area
    truth = np.log(50.0) / per_second
    held = []
    for _ in range(10):
        replicas = [
            equal_dents(10.0, rng.poisson(per_second * 10.0 * area / size), size) for _ in range(8)
        ]
        got = estimate_metrics(replicas, chamber, design)["time_to_98_s"]
        assert got.value == pytest.approx(truth, rel=0.1)
        held.append(got.low <= truth <= got.high)
    assert sum(held) >= 8
    unhit = [equal_dents(10.0, np.zeros(400, dtype=int), size) for _ in range(3)]
    never = estimate_metrics(unhit, chamber, design)["time_to_98_s"]
    assert never.value == NEVER


def test_intensity_uniformity_knows_places_from_scatter() -> None:
    """Half the surface is hit at 1 m/s and half at 3 m/s: the mean is 2, the deviation 1."""
    rng, area = np.random.default_rng(2), np.full(200, MM2)
    design, chamber = plate_design(), patchwork(area)

    def replicas(local: np.ndarray) -> list:
        made = []
        for _ in range(8):
            dents = rng.poisson(4.0, len(area))
            speeds = np.array(
                [
                    rng.gamma(4.0, speed / 4.0, n).sum()
                    for speed, n in zip(local, dents, strict=True)
                ]
            )
            made.append(replace(equal_dents(1.0, dents, 0.1 * MM2), speed_sum=speeds))
        return made

    for local, truth in ((np.repeat([1.0, 3.0], 100), 0.5), (np.full(200, 2.0), 1.0)):
        got = estimate_metrics(replicas(local), chamber, design)["intensity_uniformity"]
        assert abs(got.value - truth) < max(got.half_width, 0.06)
        assert got.value == pytest.approx(truth, abs=0.08)

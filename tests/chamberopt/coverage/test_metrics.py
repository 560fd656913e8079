"""The registry of metrics and objectives, and the metrics that are ratios of sums."""

from dataclasses import replace

import numpy as np
import pytest

from chamberopt.common.errors import InputError
from chamberopt.common.key_words import AIMS
from chamberopt.coverage.metrics import (
    METRICS,
    NEVER,
    OBJECTIVES,
    exposed_target,
    find_metric,
    is_number,
    metric_names,
    metric_problem,
    parse_objective,
    require_metrics,
    require_target,
)
from chamberopt.coverage.part_impacts import Hits, TargetImpacts
from chamberopt.design.design import validate
from chamberopt.search import study
from tests.helpers.synthetic import evaluation_of, no_hits, plane_chamber, plate_design

DESIGN = plate_design(process__treatment_time_s=50)


def test_by_hand() -> None:
    """8 impacts of 3 m/s in all on 4 mm² in 0.5 s."""
    other = np.ones(8, dtype=np.float32)
    hits = Hits(np.zeros(8, dtype=np.int32), np.zeros((8, 3)), 3.0 * other, other, other, other)
    sums = TargetImpacts((hits,), time=0.5, area=4e-6)
    found = {
        name: metric.of_impacts(sums, DESIGN)
        for name, metric in METRICS.items()
        if metric.of_impacts
    }
    assert found == pytest.approx(
        {"mean_normal_speed_m_s": 3.0, "impacts_per_mm2_s": 4.0, "shot_count": DESIGN.shot.count}
    )


def test_without_impacts_there_is_no_speed() -> None:
    nothing = TargetImpacts((no_hits(),), 1.0, 1e-6)
    speed, rate = (METRICS[n].of_impacts for n in ("mean_normal_speed_m_s", "impacts_per_mm2_s"))
    assert speed is not None
    assert rate is not None
    assert (speed(nothing, DESIGN), rate(nothing, DESIGN)) == (0.0, 0.0)


def test_figures_of_single_places_are_those_that_take_more_dents() -> None:
    assert {name for name, metric in METRICS.items() if not metric.of_places} == {
        "mean_coverage",
        "std_coverage",
        "mean_normal_speed_m_s",
        "impacts_per_mm2_s",
        "shot_count",
    }


def test_the_target_is_what_is_chosen_and_bounds_the_cavity() -> None:
    chamber = plane_chamber(splits=1)
    wanted = chamber.part.target
    np.testing.assert_array_equal(exposed_target(chamber), wanted)
    hidden = replace(chamber, exposed_area=np.where(wanted, 0.0, chamber.exposed_area))
    assert not exposed_target(hidden).any()
    require_target(chamber)
    with pytest.raises(InputError, match=r"part\.target: no triangle of the target"):
        require_target(hidden)


def test_a_metric_of_a_zone_is_found_by_its_name() -> None:
    of_target, of_zone = METRICS["p05_coverage"], find_metric("root.p05_coverage")
    assert find_metric("p05_coverage") is of_target
    assert of_zone is not None
    assert (of_zone.lowest, of_zone.highest, of_zone.unit) == (0.0, 1.0, "")
    assert of_zone.summary == "coverage that 95 % of the area exceeds, zone root"
    assert of_zone.of_places
    assert not of_zone.required
    for wrong in ("shiny", "root.shiny", "root.shot_count", "a b.p05_coverage", ".p05_coverage"):
        assert find_metric(wrong) is None
    asked_for = "almen", "surface_stress", "peak_stress"
    uncalibrated = tuple(name for name in METRICS if not name.startswith(asked_for))
    assert metric_names(DESIGN) == uncalibrated
    assert "no zone 'root'" in metric_problem(DESIGN, "root.p05_coverage")
    made = parse_objective("1 root.mean_coverage + -0.1 std_coverage")
    assert made.terms == {"root.mean_coverage": 1.0, "std_coverage": -0.1}
    with pytest.raises(InputError, match="no zone 'root'"):
        require_metrics(DESIGN, made.name)


def test_a_metric_that_the_design_lacks_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    lacking = replace(METRICS["p05_coverage"], name="rare", lacking=lambda _: "takes a moon")
    monkeypatch.setitem(METRICS, "rare", lacking)
    assert metric_problem(DESIGN, "rare") == "takes a moon"
    assert "rare" not in metric_names(DESIGN)
    with pytest.raises(InputError, match="rare: takes a moon"):
        require_metrics(DESIGN, "1 rare + 1 mean_coverage")


def test_nothing_hit() -> None:
    """Nothing is known of a target that nothing has hit; it is not known to be bare for ever."""
    found = evaluation_of(plate_design(), plane_chamber(), [no_hits()] * 3)
    values = {name: metric.value for name, metric in found.metrics.items()}
    assert values.pop("shot_count") > 0
    assert values.pop("time_to_98_s") == NEVER
    assert set(values.values()) == {0.0}
    for name in ("mean_coverage", "std_coverage", "p05_coverage", "intensity_uniformity"):
        assert found.metrics[name].in_words == "not resolved"
        assert found.metrics[name].half_width == np.inf
    assert found.objective.in_words == "not resolved"
    assert any("fewer than half" in note for note in found.notes)


def test_a_study_may_use_all_objectives_of_the_registry() -> None:
    for name, objective in OBJECTIVES.items():
        assert study.Objective(name=name).name == name
        assert all(term in METRICS or is_number(term) for term in objective.terms)
        assert name in AIMS
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

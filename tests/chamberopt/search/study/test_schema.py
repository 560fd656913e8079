"""Objectives and search accuracy of a study are checked when it is made."""

from pathlib import Path

import pytest

from chamberopt.search.study import Study
from tests.helpers.known_optima import GEAR, VARY


def with_search_accuracy(search_accuracy: dict, design=GEAR, **vary) -> Study:
    return Study(
        design=design,
        vary={**VARY, **vary},
        optimizer={"evaluations": 12, "confirm": 2},
        search_accuracy=search_accuracy,
    )


def test_a_weighted_sum_is_of_objectives_and_metrics(tmp_path: Path) -> None:
    study = Study(
        design=GEAR, vary=VARY, objective={"sum": {"uniform_coverage": 1.0, "time_to_98_s": -0.001}}
    )
    assert study.objective.goals == ("1 uniform_coverage + -0.001 time_to_98_s",)
    assert not study.objective.is_cost
    for wrong, said in (
        ({"sum": {"uniform_covrage": 1.0}}, "did you mean 'uniform_coverage'"),
        ({"sum": {"shot_count": 0.0}}, "all weights are 0"),
        ({"sum": {"shot_count": 1.0}, "name": "p05_coverage"}, "give one"),
        ({"pareto": ["minus_time_to_98_s", "minus_time_to_98_s"]}, "twice"),
        ({"sum": {"root.mean_coverage": 1.0}}, "no zone 'root'"),
        ({"sum": {"mean_coverage": 1e300}}, "given 1e\\+300; give 0, or a size from 1e-09 to"),
    ):
        with pytest.raises(ValueError, match=said):
            Study(design=GEAR, vary=VARY, objective=wrong)
    with pytest.raises(ValueError, match="only auto, sobol and surrogate"):
        Study(design=GEAR, vary=VARY, objective={"pareto": ["minus_time_to_98_s", "p05_coverage"]},
              optimizer={"algorithm": "LN_BOBYQA"})  # fmt: skip


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"vary": VARY}, "process.treatment_time_s is a number .* does not vary; add it"),
        ({"constraints": {}}, "nothing is asked of the simulation; give limits"),
        ({"search_accuracy": {"objective_half_width": 0.04}}, "exact, so no objective_half_width"),
        ({"objective": {"sum": {"shot.mass": -1.0}}}, "not a number of a design; did you mean"),
        ({"objective": {"sum": {"process.seed": -1.0}}}, "does not vary"),
    ],
)
def test_an_objective_of_numbers_of_the_design_needs_limits(change: dict, said: str) -> None:
    tables = {
        "vary": VARY | {"process.treatment_time_s": (60.0, 600.0)},
        "objective": {"name": "minus_treatment_time_s"},
        "constraints": {"mean_coverage": {"min": 0.9}},
    }
    study = Study(design=GEAR, **tables)
    assert study.objective.goals == ("minus_treatment_time_s",)
    assert study.objective.is_cost
    with pytest.raises(ValueError, match=said):
        Study(design=GEAR, **{**tables, **change})


@pytest.mark.parametrize(
    ("search_accuracy", "said"),
    [
        ({"replicas": 1}, r"search_accuracy.*replicas"),
        ({"replica": 3}, r"search_accuracy.*replica"),
        ({"coverage_model": "dents"}, r"search_accuracy.*coverage_model.*gauge_mm2"),
        ({"gauge_mm2": 4.0}, r"search_accuracy\.gauge_mm2: .*same for all candidates"),
        ({"facets": 2}, r"search_accuracy.*facets"),
    ],
)
def test_a_wrong_search_accuracy_is_named(search_accuracy: dict, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        with_search_accuracy(search_accuracy)


def test_how_well_a_design_is_known_is_none_of_its_choices() -> None:
    with pytest.raises(
        ValueError, match=r"process\.accuracy\.simulated_time_s.*see \[search_accuracy\]"
    ):
        with_search_accuracy({}, **{"process.accuracy.simulated_time_s": (0.5, 2.0)})


@pytest.mark.parametrize(
    ("first", "accuracy", "objective", "looks"),
    [
        (3, {"replicas": 8}, {}, 3),
        (0, {"replicas": 8}, {}, None),
        (8, {"replicas": 8}, {}, None),
        # An accuracy of the search is what each candidate gets.
        (10, {"replicas": 64, "objective_half_width": 0.01}, {}, None),
        (3, {"replicas": 8}, {"pareto": ["uniform_coverage", "minus_time_to_98_s"]}, 3),
    ],
)
def test_who_may_end_early(first: int, accuracy: dict, objective: dict, looks: int | None) -> None:
    study = Study(
        design=GEAR,
        vary=VARY,
        objective=objective,
        optimizer={"first_replicas": first},
        search_accuracy=accuracy,
    )
    assert study.first_look == looks

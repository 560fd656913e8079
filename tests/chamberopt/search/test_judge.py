"""The unit of penalties is the largest term of the start's objective."""

import math
from dataclasses import replace

import pytest

from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate
from chamberopt.search.candidate import (
    Candidate,
    Figures,
    NoPromiseError,
    RefusedError,
    evaluation_cost,
)
from chamberopt.search.judge import Judge
from chamberopt.search.study import Limits, Objective, Study
from chamberopt.search.study.parameters import ParameterSpace
from tests.helpers.results.resumable_study import study


@pytest.mark.parametrize(
    ("metrics", "unit"),
    [
        ({"mean_coverage": 0.7, "time_to_98_s": 500.0}, 5.0),  # 0.01 times 500
        ({"mean_coverage": 0.7, "time_to_98_s": 100.0}, 2.0),  # the weight of a share
        ({"mean_coverage": 0.7}, 3.0),  # 0.01 times the objective
    ],
)
def test_of_two_terms_the_larger_is_the_unit(metrics: dict[str, float], unit: float) -> None:
    objective = Objective(sum={"mean_coverage": -2.0, "time_to_98_s": -0.01})
    judge = Judge(study().model_copy(update={"objective": objective}))
    figures = {name: Estimate(value, 0.1) for name, value in metrics.items()}
    assert judge.unit_of(Figures((Estimate(-300.0, 0.1),), figures)) == pytest.approx(unit)


def judged(given: Study, **figures: Estimate) -> tuple[Judge, Candidate, Figures]:
    """A judge whose start has a score of 0.5 and a unit of 4, and figures of a candidate."""
    space = ParameterSpace(given.design, given.vary)
    judge = Judge(given)
    judge.reference, judge.unit = 0.5, 4.0
    goal = figures.pop("goal", Estimate(0.7, 0.1, (0.6, 0.8)))
    candidate = Candidate(3, "search", space.start, space)
    return judge, candidate, Figures((goal,), {"uniform_coverage": goal, **figures})


def test_a_violated_limit_costs_its_share_of_the_unit_and_is_told() -> None:
    limited = study().model_copy(update={"constraints": {"mean_coverage": Limits(min=0.5)}})
    judge, candidate, figures = judged(limited, mean_coverage=Estimate(0.4, 0.0))
    trial = judge.trial(candidate, figures)
    assert trial.penalty == pytest.approx(0.2)
    assert trial.score == pytest.approx(0.7 - 4.0 * 0.2)
    assert not trial.feasible
    assert trial.reason == "mean coverage of the target 0.4 < min 0.5"
    assert trial.metrics["uniform_coverage"].pseudovalues == ()
    assert trial.goals[0].pseudovalues == (0.6, 0.8)
    judge, candidate, figures = judged(limited, mean_coverage=Estimate(0.6, 0.0))
    kept = judge.trial(candidate, figures)
    assert (kept.score, kept.feasible, kept.penalty, kept.reason) == (0.7, True, 0.0, "")


def test_what_is_not_simulated_is_two_units_below_the_start_or_as_high_as_it_may_be() -> None:
    judge, candidate, _ = judged(study())
    failed, refused, spared = (
        judge.trial(candidate, error)
        for error in (InputError("a"), RefusedError("b"), NoPromiseError("c", 0.3))
    )
    assert [one.score for one in (failed, refused, spared)] == [-7.5, -7.5, 0.3]
    assert [one.refused for one in (failed, refused, spared)] == [False, True, True]
    assert [one.reason for one in (failed, refused, spared)] == ["a", "b", "c"]
    assert spared.highest == 0.3
    assert not any(one.feasible or one.goals for one in (failed, refused, spared))
    assert judge.cost(failed) == 0.0


def test_few_replicas_cost_their_share_and_what_all_evaluations_take() -> None:
    given = study(first_replicas=4)
    every = given.at_search_accuracy(given.design).process.accuracy.replicas
    judge, candidate, figures = judged(given)
    trial = judge.trial(candidate, figures)
    assert judge.cost(replace(trial, replicas=4)) == evaluation_cost(4, every) < 1.0
    assert judge.cost(replace(trial, replicas=every)) == 1.0
    whole, _, _ = judged(study(first_replicas=0))
    assert whole.cost(replace(trial, replicas=4)) == 1.0
    assert evaluation_cost(every, every) == pytest.approx(1.0)


def test_a_gain_counts_from_the_wanted_accuracy_or_a_hundredth_of_the_unit_on() -> None:
    judge, _, _ = judged(study())
    assert judge.counts == pytest.approx(0.04)
    both = study().model_copy(
        update={"objective": Objective(pareto=("p05_coverage", "minus_time_to_98_s"))}
    )
    assert Judge(both).counts == 0.0


def test_measured_figures_are_finite_and_none_is_missing() -> None:
    judge, _, _ = judged(study())
    (name,) = judge.names
    assert judge.measured({name: 0.4}).goals == (Estimate(0.4, 0.0),)
    assert judge.measured({name: Estimate(0.4, 0.0)}).goals == (Estimate(0.4, 0.0),)
    for wrong in (math.nan, math.inf, Estimate(math.nan, 0.1), Estimate(0.4, -0.1), "0.4"):
        with pytest.raises(InputError, match="give a finite number"):
            judge.measured({name: wrong})  # type: ignore[dict-item]
    with pytest.raises(InputError, match=f"{name} is missing"):
        judge.measured({})

"""The unit of penalties is the largest term of the start's objective."""

import pytest

from chamberopt.common.estimate import Estimate
from chamberopt.search.candidate import Figures
from chamberopt.search.judge import Judge
from chamberopt.search.study import Objective
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

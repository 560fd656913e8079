"""What a search's models learn from its trials, and what would mislead them."""

import numpy as np
import pytest

from chamberopt.common.estimate import NOT_RESOLVED, Estimate, student_quantile
from chamberopt.search.observe import FIRST_OBJECTIVE, fit_model, observe
from chamberopt.search.optimiser.domain import Axis, Domain
from chamberopt.search.optimiser.search_model import LimitedFigure
from chamberopt.search.study import Limits
from chamberopt.search.trial_log import Trial

DOMAIN = Domain([Axis(), Axis(shapes=False)])


def trial(number: int, distance: float, mass: float, reachable: float, score: float) -> Trial:
    samples = tuple(score + 0.005 * k for k in (-1, 0, 1))
    goals = (Estimate(score, 0.01, pseudovalues=samples),)
    point, common = (distance, mass), (goals, {}, 0.0, score, True, "", 3)
    return Trial(number, "search", point, {}, *common, reachable=reachable)


@pytest.fixture
def trials() -> list[Trial]:
    """Scores rise with the mass. Where the ceiling cuts off the part they fall by a half.

    By chance these are the only heavy ones.
    """
    rng = np.random.default_rng(1)
    free = [(float(x), float(m)) for x, m in rng.uniform((0.0, 0.0), (0.6, 0.5), (9, 2))]
    cut = [(0.8, 0.6), (0.85, 0.65)]
    rows = [(x, m, 0.98, 0.2 + 0.6 * m) for x, m in free]
    rows += [(x, m, 0.70, 0.1 + 0.2 * m) for x, m in cut]
    return [trial(k, *row) for k, row in enumerate(rows)]


def test_a_part_that_the_ceiling_cuts_off_tells_nothing_of_the_mass(trials: list[Trial]) -> None:
    seen = observe(trials, {}, FIRST_OBJECTIVE)
    assert np.flatnonzero(~seen.simulated).tolist() == [9, 10]
    assert seen.by_geometry
    model = fit_model(DOMAIN, trials, {})
    assert model is not None
    light, heavy = model.expected(np.array([[0.3, 0.2], [0.3, 0.8]]))[0]
    assert heavy > light + 0.2
    assert model.feasible(np.array([[0.3, 0.8]]))[0] > 0.5


def test_candidates_that_miss_as_much_as_the_best_are_learnt(trials: list[Trial]) -> None:
    assert observe([*trials, trial(11, 0.9, 0.9, 0.7, 0.9)], {}, FIRST_OBJECTIVE).simulated.all()
    few = [*trials[:2], *trials[9:]]  # fewer than a plane takes would be left
    assert observe(few, {}, FIRST_OBJECTIVE).simulated.all()


def with_figure(*figures: tuple[float, float] | None, in_words: int = -1) -> list[Trial]:
    """Trials of four replicas with this value and half-width of a figure, None if not simulated."""
    return [
        Trial(
            number, "search", (0.1 * number, 0.0), {}, () if one is None else (Estimate(1.0, 0.1),),
            {} if one is None else {
                "figure": Estimate(*one, in_words=NOT_RESOLVED if number == in_words else "")
            },
            0.0, 1.0, True, "", 4,
        )
        for number, one in enumerate(figures)
    ]  # fmt: skip


def learnt(trials: list[Trial], limits: Limits) -> LimitedFigure:
    (figure,) = observe(trials, {"figure": limits}, FIRST_OBJECTIVE).figures
    return figure


@pytest.mark.parametrize("unit", [1.0, 1000.0])
def test_a_figure_far_outside_its_limits_is_moved_to_three_times_the_usual_distance(
    unit: float,
) -> None:
    """The median distance to the limit of 10 is 2; what stands for never is moved to 16."""
    rows = [(9.0, 0.4), (8.0, 0.4), (11.0, 0.4), (12.0, 0.4), (5.0, 0.4), (1e6, 2e6)]
    trials = with_figure(*((unit * x, unit * h) for x, h in rows))
    found = learnt(trials, Limits(max=10.0 * unit))
    np.testing.assert_allclose(found.values, unit * np.array([9, 8, 11, 12, 5, 16]))
    errors = np.array([0.4 / student_quantile(3)] * 5 + [6.0])
    np.testing.assert_allclose(found.variances, (unit * errors) ** 2)
    assert (found.low, found.high) == (-np.inf, 10.0 * unit)
    mirrored = learnt(
        with_figure(*((-unit * x, unit * h) for x, h in rows)), Limits(min=-10 * unit)
    )
    np.testing.assert_allclose(mirrored.values, -found.values)
    np.testing.assert_allclose(mirrored.variances, found.variances)
    assert (mirrored.low, mirrored.high) == (-10.0 * unit, np.inf)


def test_a_figure_without_an_error_has_the_largest_and_one_not_resolved_tells_nothing() -> None:
    rows = [(9.0, 0.4), (8.0, 0.6), (11.0, 0.4), (12.0, np.inf), None, (10.5, 0.1)]
    found = learnt(with_figure(*rows, in_words=5), Limits(max=10.0))
    errors = np.sqrt(found.variances)
    usual = 0.6 / student_quantile(3)
    assert errors[:4] == pytest.approx([0.4 * usual / 0.6, usual, 0.4 * usual / 0.6, usual])
    assert found.values[4] == 0.0
    assert errors[5] == pytest.approx(3.0)  # three times the median distance

"""What a search's models learn from its trials, and what would mislead them."""

import numpy as np
import pytest

from chamberopt.common.estimate import Estimate
from chamberopt.search.observe import FIRST_OBJECTIVE, fit_model, observe
from chamberopt.search.optimiser.domain import Axis, Domain
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

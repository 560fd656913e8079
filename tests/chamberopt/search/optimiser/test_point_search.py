"""The phases of a search keep their budget, improve on the start and are reproducible."""

from collections import deque
from collections.abc import Callable

import numpy as np
import pytest

from chamberopt.common.errors import InputError
from chamberopt.search.optimiser.domain import Axis, Domain
from chamberopt.search.optimiser.point_search import PointSearch
from chamberopt.search.optimiser.search_model import Observations
from chamberopt.search.study.schema import Optimizer
from tests.helpers.known_optima import PEAK, bowl, hill

Begin = Callable[[np.ndarray], Callable[[], tuple[float, ...]]]


def one_by_one(score: Callable[[np.ndarray], float]) -> Begin:
    """Evaluations that run when their scores are waited for."""
    return lambda point: lambda: (score(point),)


def maximise(begin: Begin, *search, **more) -> list[str]:
    """Search to the end; the phases that ran."""
    points, running = PointSearch(*search, **more), deque()
    while (point := points.ask()) is not None or running:
        if point is None:
            points.tell(*running.popleft()())
        else:
            running.append(begin(point))
    assert len(points.points) == len(points.scores)
    return points.phases


def test_phases_have_their_shares_and_the_last_what_is_left() -> None:
    points: list[np.ndarray] = []
    shares = {"sobol": 0.4, "LN_SBPLX": 0.3, "surrogate": 1.0}
    phases = [{"algorithm": name, "share": share} for name, share in shares.items()]
    ran = maximise(
        one_by_one(lambda x: points.append(x) or bowl(x)),
        np.full(2, 0.5),
        Optimizer(evaluations=20, phases=phases),
    )
    assert ran == ["sobol", "LN_SBPLX", "surrogate"]
    assert len(points) == 20
    spread = np.array(points[1:8])
    assert all(np.histogram(spread[:, k], 4, (0.0, 1.0))[0].min() >= 1 for k in (0, 1))
    assert max(map(bowl, points)) > 0.79


def test_first_step_and_tolerance_are_in_units_of_the_bounds() -> None:
    def walk(**settings) -> list[np.ndarray]:
        points: list[np.ndarray] = []
        maximise(
            one_by_one(lambda x: points.append(x) or bowl(x)),
            np.full(2, 0.5),
            Optimizer(algorithm="LN_BOBYQA", evaluations=60, **settings),
        )
        return points

    assert abs(walk(initial_step=0.3)[1] - 0.5).max() == pytest.approx(0.3)
    assert len(walk(tolerance=0.2)) < len(walk(tolerance=1e-4))


@pytest.mark.parametrize("algorithm", [
    "GN_DIRECT_L", "GN_DIRECT_L_RAND", "GN_ORIG_DIRECT_L", "GN_MLSL_LDS", "GN_CRS2_LM",
    "GN_ISRES", "GN_ESCH", "GN_AGS", "LN_BOBYQA", "LN_COBYLA", "LN_SBPLX", "LN_NELDERMEAD",
    "LN_PRAXIS", "sobol", "surrogate",
])  # fmt: skip
def test_every_algorithm_improves_and_keeps_its_budget(algorithm: str) -> None:
    points: list[np.ndarray] = []

    def score(x: np.ndarray) -> float:
        assert x.min() >= 0.0
        assert x.max() <= 1.0
        points.append(x)
        return hill(x)

    start = np.array([0.4, 0.5, 0.375])
    maximise(one_by_one(score), start, Optimizer(algorithm=algorithm, evaluations=30))
    np.testing.assert_array_equal(points[0], start)
    assert len(points) <= 30
    assert len({x.tobytes() for x in points}) == len(points)
    assert max(map(hill, points)) > hill(start)


def test_same_seed_same_search() -> None:
    def walk(seed: int) -> list[bytes]:
        points: list[bytes] = []
        maximise(
            one_by_one(lambda x: points.append(x.tobytes()) or hill(x)),
            np.full(3, 0.4),
            Optimizer(evaluations=25, seed=seed),
        )
        return points

    assert walk(3) == walk(3)


def test_a_batch_is_proposed_before_the_others_have_scores() -> None:
    """Never more than three run, scores come in order, and no two of a batch are the same place."""
    points: list[np.ndarray] = []
    scored: list[int] = []

    def begin(point: np.ndarray) -> Callable[[], tuple[float, ...]]:
        number = len(points)
        assert number - len(scored) <= 2
        points.append(point)

        def wait() -> tuple[float, ...]:
            assert number == len(scored)
            scored.append(number)
            return (hill(point),)

        return wait

    maximise(begin, np.full(3, 0.4), Optimizer(evaluations=30, batch=3))
    assert len(scored) == len(points) == 30
    assert max(map(hill, points)) > PEAK - 0.005
    for i, point in enumerate(points):
        assert all(np.abs(point - other).max() >= 0.005 for other in points[max(0, i - 2) : i])


def test_what_cannot_be_simulated_costs_nothing() -> None:
    """Half of the cube cannot be simulated: there are as many evaluations as without it."""
    simulated: list[bool] = []

    def begin(point: np.ndarray) -> Callable[[], tuple[float, ...]]:
        simulated.append(bool(point[0] < 0.5))
        return lambda: (hill(point) if point[0] < 0.5 else -1.0, float(point[0] < 0.5))

    maximise(begin, np.full(3, 0.4), Optimizer(evaluations=20))
    assert sum(simulated) == 20
    assert 0 < simulated.count(False) <= 20
    simulated.clear()
    maximise(lambda x: lambda: (hill(x), float(bool(simulated.append(False)))),
             np.full(3, 0.4), Optimizer(evaluations=6))  # fmt: skip
    assert len(simulated) == 12  # nowhere: it ends


def test_what_geometry_refuses_is_pulled_back_to_the_best_point() -> None:
    """The peak lies beyond an edge: after a proposal there follow middles, up to three."""
    points: list[np.ndarray] = []
    scores: list[float] = []

    def stands(point: np.ndarray) -> bool:
        return bool(point[0] - point[1] < 0.3)

    def score(point: np.ndarray) -> float:
        return 1.0 - (point[0] - 0.9) ** 2 - (point[1] - 0.2) ** 2 if stands(point) else -1.0

    def seen() -> Observations:
        there = np.array([stands(one) for one in points[: len(scores)]])
        return Observations(np.array(scores), np.zeros(len(scores)), there, by_geometry=True)

    def begin(point: np.ndarray) -> Callable[[], tuple[float, ...]]:
        points.append(point)
        return lambda: (scores.append(score(point)) or scores[-1], float(stands(point)))

    start, settings = np.array([0.4, 0.6]), Optimizer(evaluations=16, batch=1, seed=3)
    maximise(begin, start, settings, seen)
    refused = [k for k, one in enumerate(points[:-1]) if k > 6 and not stands(one)]
    assert refused
    halved = 0
    for k in refused:
        best = max(filter(stands, points[: k + 1]), key=score)
        is_middle = np.allclose(points[k + 1], 0.5 * (points[k] + best), atol=1e-9)
        assert is_middle or halved == 3
        halved = halved + 1 if is_middle and k + 1 in refused else 0
    assert max(scores) > 0.95 * score(np.array([0.7, 0.4 + 1e-9]))


def test_what_costs_a_part_of_an_evaluation_leaves_room_for_others() -> None:
    """The sum of the costs is the budget, but for less than one evaluation."""
    costs: list[float] = []

    def begin(point: np.ndarray) -> Callable[[], tuple[float, ...]]:
        costs.append(1.0 if len(costs) % 3 == 0 else 0.4)
        cost = costs[-1]
        return lambda: (hill(point), cost)

    maximise(begin, np.full(3, 0.4), Optimizer(evaluations=20))
    assert 19.0 < sum(costs) <= 20.0
    assert len(costs) > 30


@pytest.mark.parametrize("flat", [False, True])
def test_a_search_ends_when_all_points_were_evaluated(flat: bool) -> None:
    points: list[np.ndarray] = []
    maximise(
        one_by_one(lambda x: points.append(x) or (0.0 if flat else bowl(x))),
        np.array([0.5, 1.0]),
        Optimizer(evaluations=20),
        domain=Domain([Axis(3), Axis(2)]),
    )
    assert len(points) == len(np.unique(points, axis=0)) == 6


def test_what_an_algorithm_cannot_do_is_said() -> None:
    with pytest.raises(InputError, match=r"GN_AGS cannot search 12 parameter.*auto"):
        maximise(
            one_by_one(lambda x: -float(x @ x)),
            np.full(12, 0.5),
            Optimizer(algorithm="GN_AGS", evaluations=30),
        )

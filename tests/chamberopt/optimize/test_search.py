"""Phases, constraints known by their intervals, two objectives, and what the model says: on functions whose truth is
known.
"""

from pathlib import Path

import numpy as np
import pytest

from chamberopt.common.errors import InputError
from chamberopt.common.parallel.executor import SerialExecutor
from chamberopt.coverage.statistics.confidence_interval import Estimate, estimate
from chamberopt.design.load import load_design
from chamberopt.optimize.pareto import as_csv, on_front, pareto_points
from chamberopt.optimize.run_study import run_study
from chamberopt.optimize.search.acquisition import propose_point
from chamberopt.optimize.search.gaussian_process import GaussianProcess, pool_variances
from chamberopt.optimize.search.phases import maximise
from chamberopt.optimize.search.scalarisation import scalarise
from chamberopt.optimize.sensitivity import analyse_sensitivity
from chamberopt.optimize.storage.trial_log import read_trials
from chamberopt.optimize.study import Limits, Study, load_study
from chamberopt.optimize.study.constraints import assess_feasibility, expected_violation
from chamberopt.optimize.study.schema import Optimizer
from chamberopt.output.plots.study import pareto_picture, slices_picture
from tests.helpers.synthetic import DESIGNS, judged

GEAR = load_design(DESIGNS / "gear.toml")
VARY = {"chamber.height_mm": (35.0, 60.0), "shot.mass_g": (2.0, 10.0)}
NO_FRILLS = {"first_replicas": 0, "confirm_rounds": 1}


def shares(design) -> np.ndarray:
    low, high = np.array(list(VARY.values())).T
    return (np.array([design.value(name) for name in VARY]) - low) / (high - low)


def run(folder: Path, simulator, optimizer: dict | None = None, **tables):
    settings = {
        "evaluations": 16,
        "confirm": 2,
        "confirm_replicas": 4,
        **NO_FRILLS,
        **(optimizer or {}),
    }
    return run_study(
        Study(design=GEAR, vary=VARY, optimizer=settings, **tables),
        folder,
        SerialExecutor(),
        None,
        simulator,
    )


def bowl(x: np.ndarray) -> float:
    return 0.8 - float(((x - [0.7, 0.3]) ** 2).sum())


def test_phases_have_their_shares_and_the_last_what_is_left() -> None:
    points: list[np.ndarray] = []
    shares = {"sobol": 0.4, "LN_SBPLX": 0.3, "surrogate": 1.0}
    phases = [{"algorithm": name, "share": share} for name, share in shares.items()]
    ran = maximise(
        lambda x: points.append(x) or bowl(x),
        np.full(2, 0.5),
        Optimizer(evaluations=20, phases=phases),
    )
    assert ran == "sobol, then LN_SBPLX, then surrogate"
    assert len(points) == 20
    spread = np.array(points[1:8])
    assert all(np.histogram(spread[:, k], 4, (0.0, 1.0))[0].min() >= 1 for k in (0, 1))
    assert max(map(bowl, points)) > 0.79


def test_first_step_and_tolerance_are_in_units_of_the_bounds() -> None:
    def walk(**settings) -> list[np.ndarray]:
        points: list[np.ndarray] = []
        maximise(
            lambda x: points.append(x) or bowl(x),
            np.full(2, 0.5),
            Optimizer(algorithm="LN_BOBYQA", evaluations=60, **settings),
        )
        return points

    assert abs(walk(initial_step=0.3)[1] - 0.5).max() == pytest.approx(0.3)
    assert len(walk(tolerance=0.2)) < len(walk(tolerance=1e-4))


def test_proposals_are_new_and_the_same_for_the_same_seed() -> None:
    rng = np.random.default_rng(3)
    points = np.vstack([rng.random((15, 2)), [[1.0, 0.0]]])
    model = GaussianProcess(
        points, points[:, 0] - points[:, 1]
    )  # best in the corner, which was seen
    one, two = (propose_point(model, np.random.default_rng(5)) for _ in range(2))
    np.testing.assert_array_equal(one, two)
    assert np.abs(points - one).max(axis=1).min() >= 0.005


def test_the_model_holds_the_truth_in_its_interval() -> None:
    rng = np.random.default_rng(4)
    points = rng.random((60, 2))
    scores = np.array([bowl(x) for x in points]) + rng.normal(0.0, 0.05, 60)
    model = GaussianProcess(points, scores, np.full(60, 0.05**2))
    at = rng.random((300, 2))
    mean, deviation = model(at)
    truth = np.array([bowl(x) for x in at])
    assert np.mean(np.abs(mean - truth) < 1.96 * deviation) > 0.85
    assert np.sqrt(np.mean((mean - truth) ** 2)) < 0.04
    np.testing.assert_allclose(
        np.diag(model.covariance(at[:5], at[:5])), deviation[:5] ** 2, rtol=1e-6
    )


def test_spreads_are_pooled() -> None:
    np.testing.assert_allclose(
        pool_variances(np.array([1.0, 3.0, np.nan]), np.array([2, 4, 1])), [1.0, 0.5, 2.0]
    )
    wild = pool_variances(
        np.array([1.0, 3.0, 1e9]), np.array([2, 2, 2])
    )  # must not drown the others
    np.testing.assert_allclose(wild, [1.0, 1.0, 5e8])
    assert not pool_variances(np.full(2, np.nan), np.ones(2)).any()


def test_a_constraint_is_priced_by_what_is_to_be_expected_beyond_it() -> None:
    limits = Limits(min=0.5)
    assert expected_violation(Estimate(0.4, 0.0), limits) == pytest.approx(0.2)
    assert expected_violation(Estimate(0.6, 0.0), limits) == 0.0
    # Of a normal figure at its limit: its standard error over sqrt(2 pi).
    at_limit = estimate(0.5 + np.array([-0.1, 0.1, -0.1, 0.1]))
    error = np.std(at_limit.pseudovalues, ddof=1) / 2.0
    assert expected_violation(at_limit, limits) == pytest.approx(error / np.sqrt(2.0 * np.pi) / 0.5)


@pytest.mark.parametrize(
    ("half_width", "standing"), [(0.05, "feasible"), (0.2, "not known"), (0.0, "feasible")]
)
def test_an_answer_keeps_its_limits_to_the_end_of_the_interval(
    half_width: float, standing: str
) -> None:
    constraints = {"mean_coverage": Limits(min=0.5, max=0.9)}
    assert (
        assess_feasibility(constraints, {"mean_coverage": Estimate(0.6, half_width)})[0] == standing
    )
    said, why = assess_feasibility(constraints, {"mean_coverage": Estimate(0.3, 0.1)})
    assert (said, why) == ("infeasible", "mean_coverage 0.3 ± 0.1 < min 0.5")


def test_a_number_of_the_design_can_be_a_constraint(tmp_path: Path) -> None:
    limits = {"shot.mass_g": Limits(max=4.0)}  # the best is at 4.4
    result = run(tmp_path, lambda d, s, n: judged(np.full(3, bowl(shares(d)))), constraints=limits)
    assert 3.5 < result.best.design.shot.mass_g <= 4.0
    assert result.best.feasibility == "feasible"


def test_where_no_constraint_is_surely_kept_the_answer_says_so(tmp_path: Path) -> None:
    def simulator(design, stream, replicas):
        made = judged(np.full(4, bowl(shares(design))))
        made.metrics["mean_coverage"] = estimate([0.4, 0.6, 0.5, 0.52])
        return made

    result = run(tmp_path, simulator, constraints={"mean_coverage": Limits(min=0.5)})
    assert result.best.feasibility == "not known"
    assert "mean_coverage 0.505 ± 0.13 may be < min 0.5" in result.warnings[0]


def test_scores_suit_objectives_of_any_size(tmp_path: Path) -> None:
    """Seconds instead of shares: what fails must still look worse than what does not."""

    def simulator(design, stream, replicas):
        x = shares(design)
        if x[0] > 0.9:
            raise InputError("too high")
        seconds = 1000.0 - 800.0 * bowl(x)
        made = judged(np.full(3, -seconds), time_to_98_s=seconds)
        return made

    result = run(tmp_path, simulator, objective={"name": "minus_time_to_98_s"})
    failed = [trial.score for trial in result.trials if trial.objective is None]
    assert failed
    assert max(failed) < min(trial.score for trial in result.trials if trial.objective)
    assert bowl(shares(result.best.design)) > 0.79


def test_a_weighted_sum_is_of_objectives_and_metrics(tmp_path: Path) -> None:
    study = Study(
        design=GEAR, vary=VARY, objective={"sum": {"uniform_coverage": 1.0, "time_to_98_s": -0.001}}
    )
    assert study.objective.goals == ("1 uniform_coverage + -0.001 time_to_98_s",)
    for wrong, said in (
        ({"sum": {"uniform_covrage": 1.0}}, "did you mean 'uniform_coverage'"),
        ({"sum": {"shot_count": 0.0}}, "all weights are 0"),
        ({"sum": {"shot_count": 1.0}, "name": "p05_coverage"}, "give one"),
        ({"pareto": ["minus_time_to_98_s", "minus_time_to_98_s"]}, "twice"),
    ):
        with pytest.raises(ValueError, match=said):
            Study(design=GEAR, vary=VARY, objective=wrong)
    with pytest.raises(ValueError, match="only auto, sobol and surrogate"):
        Study(design=GEAR, vary=VARY, objective={"pareto": ["minus_time_to_98_s", "p05_coverage"]},
              optimizer={"algorithm": "LN_BOBYQA"})  # fmt: skip


def test_the_front_is_who_nobody_beats() -> None:
    values = np.array([[0.0, 3.0], [1.0, 2.0], [1.0, 1.0], [2.0, 0.0], [5.0, 5.0], [0.0, 3.0]])
    among = np.array([True, True, True, True, False, True])
    assert on_front(values, among).tolist() == [True, True, False, True, False, True]
    assert on_front(values).tolist() == [False, False, False, False, True, False]
    for weight, best in (([0.999, 0.001], 3), ([0.001, 0.999], 0), ([0.5, 0.5], 1)):
        scores, _ = scalarise(values[:4], np.zeros((4, 2)), np.array(weight))
        assert scores.argmax() == best


def test_two_objectives_give_a_front(tmp_path: Path) -> None:
    """Bowls about two places: what nobody beats lies on the line between them."""
    low, high = np.array([0.2, 0.5]), np.array([0.8, 0.5])

    def simulator(design, stream, replicas):
        x = shares(design)
        one, two = (1.0 - float(((x - at) ** 2).sum()) for at in (low, high))
        return judged(one + np.linspace(-0.01, 0.01, 4), p05_coverage=one, intensity_uniformity=two)

    question = {"pareto": ["p05_coverage", "intensity_uniformity"]}
    result = run(tmp_path / "out", simulator, {"evaluations": 24, "confirm": 4}, objective=question)
    assert all(np.isfinite(goal.value) for one in pareto_points(result) for goal in one.goals)
    front = [one for one in pareto_points(result) if one.stage == "confirm" and one.on_front]
    assert len(front) >= 3
    places = np.array(
        [
            [one.parameters[name] for name in VARY]
            for one in front
            if one.parameters != result.start.parameters
        ]
    )
    places = (places - [35.0, 2.0]) / [25.0, 8.0]
    assert np.abs(places[:, 1] - 0.5).max() < 0.1
    assert np.ptp(places[:, 0]) > 0.3
    header, *table = as_csv(result).splitlines()
    assert header.startswith("stage,on_front,standing,p05_coverage,p05_coverage_pm,intensity_")
    searched = [row.split(",") for row in table if row.startswith("search,")]
    expected = [trial.goals for trial in result.trials if trial.stage == "search"]
    assert [[float(x) for x in row[3:7]] for row in searched] == [
        [number for goal in goals for number in (goal.value, goal.half_width)] for goals in expected
    ]
    assert all(np.isfinite(goal.half_width) for goals in expected for goal in goals)
    pareto_picture(tmp_path / "pareto.png", result)
    assert (tmp_path / "pareto.png").stat().st_size > 10000
    assert load_study(tmp_path / "out" / "study.toml").objective.pareto == (
        "p05_coverage",
        "intensity_uniformity",
    )


def test_flat_directions_and_effects_are_those_of_the_function(tmp_path: Path) -> None:
    points = np.random.default_rng(1).random((40, 2))
    scores = 0.8 - 4.0 * (points[:, 0] - 0.5) ** 2
    got = analyse_sensitivity(
        GaussianProcess(points, scores),
        {"a": (0.0, 10.0), "b": (-1.0, 1.0)},
        {"a": 5.0, "b": 0.0},
        noise=0.04,
    )
    steep, idle = got.slices
    assert steep.flat == pytest.approx((4.0, 6.0), abs=0.25)  # 4 (x - 0.5)² = 0.04 at 0.4 and 0.6
    assert idle.flat == pytest.approx((-1.0, 1.0))
    assert steep.share > 0.95
    assert idle.share < 0.05
    assert got.together > 0.9
    np.testing.assert_allclose(steep.mean, 0.8 - 4.0 * (steep.values / 10.0 - 0.5) ** 2, atol=0.05)
    assert "a may go from" in got.sentences()[0]


def test_a_study_says_what_its_model_found(tmp_path: Path) -> None:
    result = run(
        tmp_path / "out", lambda d, s, n: judged(bowl(shares(d)) + np.linspace(-0.01, 0.01, 4))
    )
    assert [one.name for one in result.sensitivity.slices] == list(VARY)
    slices_picture(tmp_path / "slices.png", result, result.sensitivity)
    assert (tmp_path / "slices.png").stat().st_size > 10000
    short = run(
        tmp_path / "short", lambda d, s, n: judged(np.full(3, bowl(shares(d)))), {"evaluations": 5}
    )
    assert short.sensitivity is None


def test_the_plainly_bad_get_few_replicas_and_close_calls_more(tmp_path: Path) -> None:
    asked: list[tuple[str, int | None]] = []

    def simulator(design, stream, replicas):
        asked.append((stream, replicas))
        count = replicas or design.process.accuracy.replicas
        rng = np.random.default_rng(np.frombuffer(shares(design).tobytes(), dtype=np.uint32))
        return judged(bowl(shares(design)) + rng.normal(0.0, 0.02, count))

    result = run(tmp_path, simulator, {"first_replicas": 4, "confirm_rounds": 3, "evaluations": 12})
    rows = read_trials(tmp_path)
    assert {row["replicas"] for row in rows if row["stage"] == "search"} == {4, 8}
    bar = max(t.objective.low for t in result.trials if t.stage == "search")
    few = [row for row in rows if row["stage"] == "search" and row["replicas"] == 4]
    assert all(row["objective"] < bar for row in few)
    confirmed = [replicas for stream, replicas in asked if stream == "confirm"]
    assert confirmed[:3] == [4, 4, 4]
    assert 8 in confirmed
    best, start = (one.evaluation.objective.pseudovalues for one in (result.best, result.start))
    assert len(best) == len(start) == max(confirmed)  # pair by pair, as the gain needs

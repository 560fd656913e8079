"""An evaluation does not depend on the workers and stops at the wanted accuracy or the budget."""

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import estimate, paired_difference
from chamberopt.common.parallel.executor import SerialExecutor, local_executor
from chamberopt.coverage.coverage_from_impacts import Tally
from chamberopt.coverage.metrics import METRICS, OBJECTIVES
from chamberopt.design.design import validate
from chamberopt.design.load import Design
from chamberopt.simulation.evaluate import ReplicaPlan, estimate_metrics, evaluate, weighted_sum
from chamberopt.simulation.replicas import MIN_REPLICAS_TO_STOP
from tests.helpers.synthetic import equal_dents, patchwork, plate_design

TREATMENT = 50.0
DESIGN = plate_design(process__treatment_time_s=TREATMENT)
CHAMBER = patchwork(np.full(400, 1e-6))
DENT = 0.1e-6  # m²: a tenth of a triangle
# Dents per triangle and second: the expected coverage is 1 - exp(-rate · DENT / area · 50 s), 0.5
# to 0.95.
RATE = np.random.default_rng(0).uniform(0.14, 0.6, 400)


def poisson_replicas(rng: np.random.Generator, replicas: int, seconds: float) -> list[Tally]:
    counts = rng.poisson(RATE * seconds, (replicas, len(RATE)))
    return [equal_dents(seconds, k, DENT) for k in counts]


def test_pseudovalues_of_a_mean_are_the_sample() -> None:
    # For a statistic linear in the tally the jackknife is the plain mean and its standard error:
    # s/√n · t(n-1).
    rng = np.random.default_rng(5)
    replicas = poisson_replicas(rng, 6, 10.0)
    rate = METRICS["impacts_per_mm2_s"]
    got = estimate_metrics(replicas, CHAMBER, DESIGN)["impacts_per_mm2_s"]
    each = np.array([rate.value(replica, CHAMBER, DESIGN) for replica in replicas])
    np.testing.assert_allclose(got.pseudovalues, each, rtol=1e-9)
    assert got.value == pytest.approx(each.mean())
    assert got.half_width == pytest.approx(2.570582 * each.std(ddof=1) / np.sqrt(6), rel=1e-6)


def test_what_is_made_of_a_clipped_value_agrees_with_its_interval() -> None:
    """Objective and gain do not keep the overshoot of a clipped correction in their intervals."""
    metrics = {
        "mean_coverage": estimate([0.7, 0.8, 0.75]),
        "std_coverage": estimate([0.6, 0.7, 0.62], 0.0, 0.5),
    }
    goal = weighted_sum(OBJECTIVES["uniform_coverage"], metrics)
    assert goal.value == pytest.approx(0.75 - 0.5)
    assert np.mean(goal.pseudovalues) == pytest.approx(goal.value)
    gain = paired_difference(goal, estimate([0.1, 0.12, 0.11]))
    assert np.mean(gain.pseudovalues) == pytest.approx(gain.value)


def test_evaluate_gives_the_same_numbers_on_any_number_of_workers() -> None:
    design = plate_design(
        process__accuracy__simulated_time_s=0.02, process__accuracy__warmup_time_s=0.02,
        process__accuracy__replicas=4,
    )  # fmt: skip
    chamber = build_chamber(design)
    seen: list[tuple[int, int, float | None]] = []
    serial = evaluate(design, chamber, SerialExecutor(), lambda *args: seen.append(args))
    with local_executor(3) as executor:
        threaded = evaluate(design, chamber, executor)
    assert serial.objective == threaded.objective
    assert serial.metrics == threaded.metrics
    np.testing.assert_array_equal(serial.total.dented_area, threaded.total.dented_area)
    assert seen == [(i, 4, None) for i in range(1, 5)]
    assert serial.total.impacts.sum() > 0
    assert serial.total.simulated_time == pytest.approx(0.08)
    assert serial.collisions["total"] > serial.total.impacts.sum()
    assert any("dents per target triangle" in note for note in serial.notes)
    # Replicas there are, are added to: the same as all at once.
    done: list = []
    few = evaluate(design, chamber, SerialExecutor(), plan=ReplicaPlan(3), done=done)
    assert (len(few.replicas), len(done)) == (3, 3)
    assert evaluate(design, chamber, SerialExecutor(), done=done).metrics == serial.metrics
    # Fresh draws for a confirmation.
    other = evaluate(design, chamber, SerialExecutor(), plan=ReplicaPlan(3, "confirm"))
    assert other.objective.value != serial.objective.value
    assert (other.stream, len(other.replicas)) == ("confirm", 3)


def accurate(coverage: float, most: int) -> Design:
    """The plate in short replicas, with a wanted half-width and a maximum number."""
    design = plate_design(
        process__accuracy__simulated_time_s=0.05, process__accuracy__warmup_time_s=0.02
    )
    accuracy = {
        **design.process.accuracy.model_dump(),
        "objective_half_width": coverage,
        "max_replicas": most,
    }
    return validate(
        Design,
        {**design.model_dump(), "process": {**design.process.model_dump(), "accuracy": accuracy}},
    )


def test_replicas_are_added_until_the_accuracy_holds_or_the_budget_ends() -> None:
    chamber = build_chamber(accurate(0.2, 100))
    loose = evaluate(accurate(0.2, 100), chamber, SerialExecutor())
    assert loose.stopped_by == "accuracy"
    assert loose.objective.half_width <= 0.2
    assert len(loose.replicas) >= MIN_REPLICAS_TO_STOP
    tight = evaluate(accurate(0.001, 14), chamber, SerialExecutor())
    assert (tight.stopped_by, len(tight.replicas)) == ("max_replicas", 14)
    assert tight.objective.half_width > 0.001
    assert any("max_replicas = 14" in note and "not reached" in note for note in tight.notes)
    # The same replicas at once say the same: how they were added leaves no trace.
    again = evaluate(accurate(0.001, 14), chamber, SerialExecutor(), plan=ReplicaPlan(14))
    assert again.metrics == tight.metrics
    assert again.stopped_by == "replicas"


def test_an_accuracy_that_cannot_be_is_refused() -> None:
    with pytest.raises(InputError, match=r"process\.accuracy\.max_replicas.*below replicas"):
        accurate(0.01, 5)
    with pytest.raises(InputError, match=r"process\.accuracy\.objective_half_width"):
        accurate(-0.01, 50)

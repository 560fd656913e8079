"""Intervals that hold what they promise, on Poisson models whose truth is known."""

import numpy as np
import pytest

from chamberopt.accuracy import (
    Estimate,
    _still,
    _stuck_notes,
    estimate,
    evaluate,
    independent_difference,
    jackknife,
    paired_difference,
    weighted,
)
from chamberopt.chamber import build_chamber
from chamberopt.coverage import Tally
from chamberopt.executor import SerialExecutor, local_executor
from chamberopt.objective import METRICS, OBJECTIVES
from sim_core import Resting
from tests.synthetic import patchwork, plate_design

TREATMENT = 50.0
DESIGN = plate_design(process__treatment_time_s=TREATMENT)
CHAMBER = patchwork(np.full(400, 1e-6))
DENT = 0.1e-6  # m²: a tenth of a triangle
# Dents per triangle and second: the expected coverage is 1 - exp(-rate · DENT / area · 50 s), 0.5 to 0.95.
RATE = np.random.default_rng(0).uniform(0.14, 0.6, 400)


def truth() -> float:
    share = -np.expm1(-RATE * 0.1 * TREATMENT)
    return float(share.mean() - share.std())


def uniform_coverage(replicas: list[Tally]) -> Estimate:
    """As evaluate() estimates it."""
    names = ("mean_coverage", "std_coverage")
    metrics = dict(zip(names, jackknife(replicas, [METRICS[n] for n in names], CHAMBER, DESIGN), strict=True))
    return weighted(OBJECTIVES["uniform_coverage"], metrics)


def uncorrected(replicas: list[Tally]) -> float:
    total = sum(replicas[1:], replicas[0])
    return METRICS["mean_coverage"].function(total, CHAMBER, DESIGN) - METRICS["std_coverage"].function(
        total, CHAMBER, DESIGN
    )


def poisson_replicas(rng: np.random.Generator, replicas: int, seconds: float) -> list[Tally]:
    counts = rng.poisson(RATE * seconds, (replicas, len(RATE)))
    return [Tally(seconds, k, k, DENT * k, 1.0 * k, 90.0 * k) for k in counts]


def test_pseudovalues_of_a_mean_are_the_sample() -> None:
    # For a statistic linear in the tally the jackknife is the plain mean and its standard error: s/√n ·
    # t(n-1).
    rng = np.random.default_rng(5)
    replicas = poisson_replicas(rng, 6, 10.0)
    rate = METRICS["impacts_per_mm2_s"]
    [got] = jackknife(replicas, [rate], CHAMBER, DESIGN)
    each = np.array([rate.function(replica, CHAMBER, DESIGN) for replica in replicas])
    np.testing.assert_allclose(got.pseudovalues, each, rtol=1e-9)
    assert got.value == pytest.approx(each.mean())
    assert got.half_width == pytest.approx(2.570582 * each.std(ddof=1) / np.sqrt(6), rel=1e-6)


def test_correction_takes_the_simulated_time_out_of_the_figure() -> None:
    # The chamber is the same however long it is simulated: so must be what is said of it.
    rng = np.random.default_rng(1)
    plain, corrected = {}, {}
    for seconds in (2.0, 8.0):  # 8 replicas: 6 and 24 dents per triangle
        runs = [poisson_replicas(rng, 8, seconds) for _ in range(12)]
        plain[seconds] = np.mean([uncorrected(r) for r in runs])
        corrected[seconds] = np.mean([uniform_coverage(r).value for r in runs])
    drift = abs(plain[2.0] - plain[8.0])
    assert drift > 0.05
    assert abs(corrected[2.0] - corrected[8.0]) < drift / 5
    assert corrected[8.0] == pytest.approx(truth(), abs=0.005)
    assert corrected[2.0] == pytest.approx(truth(), abs=0.02)


def test_95_percent_intervals_hold_the_truth_as_often() -> None:
    rng = np.random.default_rng(2)
    share = -np.expm1(-RATE * 0.1 * TREATMENT)
    true = {"mean_coverage": share.mean(), "std_coverage": share.std(), "uniform_coverage": truth()}
    held = dict.fromkeys(true, 0)
    for _ in range(200):
        replicas = poisson_replicas(rng, 8, 6.0)
        names = ("mean_coverage", "std_coverage")
        got = dict(zip(names, jackknife(replicas, [METRICS[n] for n in names], CHAMBER, DESIGN), strict=True))
        got["uniform_coverage"] = weighted(OBJECTIVES["uniform_coverage"], got)
        for name, value in true.items():
            held[name] += got[name].low <= value <= got[name].high
    assert all(180 <= count <= 198 for count in held.values()), held  # 90 to 99 %


def test_a_quantile_gets_a_bootstrap_interval_and_no_correction() -> None:
    rng = np.random.default_rng(6)
    p05 = METRICS["p05_coverage"]
    estimates, plains = [], []
    for _ in range(20):
        replicas = poisson_replicas(rng, 8, 20.0)
        estimates += jackknife(replicas, [p05], CHAMBER, DESIGN)
        plains.append(p05.function(sum(replicas[1:], replicas[0]), CHAMBER, DESIGN))
    assert [e.value for e in estimates] == plains
    # The half-width is t(7) standard errors: what repeating the whole study scatters by.
    assert np.mean([e.half_width for e in estimates]) / 2.3646 == pytest.approx(np.std(plains), rel=0.5)
    # Without pseudo-values a difference takes the intervals in quadrature.
    a, b = estimates[:2]
    assert paired_difference(a, b).half_width == pytest.approx(np.hypot(a.half_width, b.half_width))


def test_an_even_part_is_not_better_than_its_mean() -> None:
    # The correction can take a spread that is all noise below zero; the figures shown must still agree.
    even = patchwork(np.full(400, 1e-6))
    rng = np.random.default_rng(4)
    counts = rng.poisson(0.4, (8, 400))
    replicas = [Tally(1.0, k, k, 0.2e-6 * k, 1.0 * k, 90.0 * k) for k in counts]
    names = ("mean_coverage", "std_coverage")
    metrics = dict(zip(names, jackknife(replicas, [METRICS[n] for n in names], even, DESIGN), strict=True))
    goal = weighted(OBJECTIVES["uniform_coverage"], metrics)
    assert metrics["std_coverage"].value >= 0.0
    assert goal.value == metrics["mean_coverage"].value - metrics["std_coverage"].value <= 1.0


def test_differences() -> None:
    rng = np.random.default_rng(3)
    common = rng.normal(0.0, 1.0, 10)
    before = estimate(common)
    after = estimate(common + 0.1 + rng.normal(0, 0.01, 10))
    paired, apart = paired_difference(after, before), independent_difference(after, before)
    assert paired.value == pytest.approx(0.1, abs=0.02)
    assert paired.half_width < 0.02  # what is common to both cancels
    assert apart.half_width > 0.5  # not so when they are taken as independent
    same = paired_difference(before, before)
    assert (same.value, same.half_width) == (0.0, 0.0)
    assert independent_difference(Estimate(1.0, 0.0, (1.0, 1.0)), Estimate(0.0, 0.0, (0.0, 0.0))).half_width == 0


def test_value_stays_in_its_range_and_one_replica_has_no_interval() -> None:
    assert estimate([1.02, 1.01, 1.03], 0.0, 1.0).value == 1.0
    assert estimate([0.5], 0.0, 1.0).half_width == np.inf


def test_what_is_made_of_a_clipped_value_agrees_with_its_interval() -> None:
    """A correction that overshoots is clipped; objective and gain must not keep the overshoot in their intervals."""
    metrics = {"mean_coverage": estimate([0.7, 0.8, 0.75]), "std_coverage": estimate([0.6, 0.7, 0.62], 0.0, 0.5)}
    goal = weighted(OBJECTIVES["uniform_coverage"], metrics)
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
    # Fresh draws for a confirmation.
    other = evaluate(design, chamber, SerialExecutor(), stream="confirm", replicas=3)
    assert other.objective.value != serial.objective.value
    assert (other.stream, len(other.replicas)) == ("confirm", 3)


def test_balls_that_lie_still_are_said_in_one_line() -> None:
    nothing = np.full((2, 4), -1)
    under = nothing.copy()
    under[1, 0] = 1234
    still = Resting(
        np.array([3, 7]),
        np.array([[0.0, 0.0, 0.0], [1e-3, -2e-3, 3.5e-3]]),
        np.array([0.7, 0.41]),
        under,
        nothing,
        np.zeros(2, dtype=bool),
    )
    assert _still(still, 20) == (
        "2 of 20 balls lie still at the end, the longest since 0.41 s, that one at (1.00, -2.00, 3.50) mm "
        "on triangle 1234"
    )
    assert _stuck_notes([_still(still, 20)], 8)[0].startswith("balls came to rest in 1 of 8 replicas; in the first")
    assert _stuck_notes([], 8) == ()

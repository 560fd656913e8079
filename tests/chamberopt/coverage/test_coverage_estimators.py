"""Intervals that hold what they promise, on Poisson models whose truth is known."""

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.common.errors import InputError
from chamberopt.common.parallel.executor import SerialExecutor, local_executor
from chamberopt.coverage.coverage_estimators import (
    _max_effect_of_variance,
    few_dents_note,
    target_patches,
)
from chamberopt.coverage.coverage_from_impacts import Tally
from chamberopt.coverage.metrics import METRICS, OBJECTIVES
from chamberopt.coverage.statistics.confidence_interval import (
    Estimate,
    estimate,
    independent_difference,
    paired_difference,
)
from chamberopt.coverage.statistics.triangle_patches import patches
from chamberopt.design.design import validate
from chamberopt.design.load import Design
from chamberopt.simulation.evaluate import ReplicaPlan, estimate_metrics, evaluate, weighted_sum
from chamberopt.simulation.replicas import MIN_REPLICAS_TO_STOP, next_replica_count
from tests.helpers.synthetic import equal_dents, patchwork, plate_design

TREATMENT = 50.0
DESIGN = plate_design(process__treatment_time_s=TREATMENT)
CHAMBER = patchwork(np.full(400, 1e-6))
DENT = 0.1e-6  # m²: a tenth of a triangle
# Dents per triangle and second: the expected coverage is 1 - exp(-rate · DENT / area · 50 s), 0.5
# to 0.95.
RATE = np.random.default_rng(0).uniform(0.14, 0.6, 400)


def truth() -> float:
    share = -np.expm1(-RATE * 0.1 * TREATMENT)
    return float(share.mean() - share.std())


def uniform_coverage(replicas: list[Tally]) -> Estimate:
    """As evaluate() estimates it."""
    metrics = estimate_metrics(replicas, CHAMBER, DESIGN)
    return weighted_sum(OBJECTIVES["uniform_coverage"], metrics)


def uncorrected(replicas: list[Tally]) -> float:
    total = sum(replicas[1:], replicas[0])
    return METRICS["mean_coverage"].value(total, CHAMBER, DESIGN) - METRICS["std_coverage"].value(
        total, CHAMBER, DESIGN
    )


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
        got = estimate_metrics(replicas, CHAMBER, DESIGN)
        got["uniform_coverage"] = weighted_sum(OBJECTIVES["uniform_coverage"], got)
        for name, value in true.items():
            held[name] += got[name].low <= value <= got[name].high
    assert all(180 <= count <= 198 for count in held.values()), held  # 90 to 99 %


def test_the_poorest_twentieth_is_held_by_its_interval_however_short_the_simulation() -> None:
    share = np.sort(-np.expm1(-RATE * 0.1 * TREATMENT))
    true = np.interp(0.05, (np.arange(400) + 0.5) / 400, share)
    rng = np.random.default_rng(6)
    widths = []
    for seconds in (2.0, 8.0, 32.0):
        held, width = 0, 0.0
        for _ in range(40):
            replicas = poisson_replicas(rng, 8, seconds)
            got = estimate_metrics(replicas, CHAMBER, DESIGN)["p05_coverage"]
            held += got.low <= true <= got.high
            width += got.half_width / 40
        assert held >= 37, (
            seconds
        )  # its shape cannot be known from counts: it may be held more often than 95 %
        widths.append(width)
    assert widths[0] > widths[1] > widths[2]


def test_an_even_part_is_not_better_than_its_mean() -> None:
    # The correction can take a spread that is all noise below zero; the figures shown must still
    # agree.
    even = patchwork(np.full(400, 1e-6))
    rng = np.random.default_rng(4)
    counts = rng.poisson(0.4, (8, 400))
    replicas = [equal_dents(1.0, k, 0.2e-6) for k in counts]
    metrics = estimate_metrics(replicas, even, DESIGN)
    goal = weighted_sum(OBJECTIVES["uniform_coverage"], metrics)
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
    assert (
        independent_difference(
            Estimate(1.0, 0.0, (1.0, 1.0)), Estimate(0.0, 0.0, (0.0, 0.0))
        ).half_width
        == 0
    )


def test_value_stays_in_its_range_and_one_replica_has_no_interval() -> None:
    assert estimate([1.02, 1.01, 1.03], 0.0, 1.0).value == 1.0
    assert estimate([0.5], 0.0, 1.0).half_width == np.inf


def test_what_is_made_of_a_clipped_value_agrees_with_its_interval() -> None:
    """A correction that overshoots is clipped; objective and gain must not keep the overshoot in their intervals."""
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


# Accuracy asked for


def accurate(coverage: float, most: int) -> Design:
    """The plate in short replicas, as many as make the objective known to within this, or at most so many."""
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


def test_how_many_replicas_come_next() -> None:
    assert next_replica_count(10, 0.01, 0.01, 200) == 10  # reached
    assert (
        next_replica_count(10, 0.0101, 0.01, 200) == 13
    )  # at least a quarter more: few looks, little luck
    assert next_replica_count(10, 0.013, 0.01, 200) == 17  # as foretold
    assert (
        next_replica_count(10, 1.0, 0.01, 200) == 20
    )  # but no more than twice: what foretells is rough
    assert next_replica_count(150, 1.0, 0.01, 200) == 200
    assert next_replica_count(200, 1.0, 0.01, 200) == 200  # spent
    assert next_replica_count(10, np.inf, 0.01, 200) == 20


def test_stopping_when_it_looks_good_keeps_the_95_percent() -> None:
    rng = np.random.default_rng(8)
    held, runs = 0, 2000
    for _ in range(runs):
        sample, n, wanted = rng.normal(size=400), MIN_REPLICAS_TO_STOP, 0.45
        while (more := next_replica_count(n, estimate(sample[:n]).half_width, wanted, 400)) > n:
            n = more
        got = estimate(sample[:n])
        held += got.low <= 0.0 <= got.high
    assert 0.92 <= held / runs <= 0.98, held / runs


def test_differences_of_unequal_numbers_of_replicas_are_taken_as_independent() -> None:
    one, other = estimate([0.5, 0.6, 0.55, 0.52]), estimate([0.4, 0.3, 0.35], bias=0.1)
    gap = paired_difference(one, other)
    assert gap == independent_difference(one, other)
    assert gap.half_width > 0.1
    assert paired_difference(other, other).bias == pytest.approx(0.2)


# Figures that do not depend on how long was simulated


CLUMPED = np.where(np.arange(400) < 100, 0.0, np.linspace(0.1, 0.5, 400))  # a quarter in the shadow


def of_all_sizes(rng: np.random.Generator, seconds: float) -> list[Tally]:
    """Eight replicas of the clumped surface, its dents as unequal as real ones, larger where there are more."""
    tallies = []
    for _ in range(8):
        dents = rng.poisson(CLUMPED * seconds)
        triangle = np.repeat(np.arange(400), dents)
        area = DENT * (0.5 + CLUMPED[triangle] / 0.5) * rng.gamma(2.0, 0.5, len(triangle))
        tallies.append(
            Tally(
                seconds,
                dents,
                dents,
                np.bincount(triangle, area, 400),
                dents,
                dents,
                triangle,
                area,
            )
        )
    return tallies


@pytest.mark.parametrize("seconds", [4.0, 16.0, 64.0], ids=["1x", "4x", "16x"])
def test_figures_are_the_same_however_long_was_simulated(seconds: float) -> None:
    x = CLUMPED * (0.5 + CLUMPED / 0.5) * 0.1 * TREATMENT
    share = -np.expm1(-x)
    names, true = ("mean_coverage", "std_coverage"), (share.mean(), share.std())
    rng = np.random.default_rng(9)
    runs = [estimate_metrics(of_all_sizes(rng, seconds), CHAMBER, DESIGN) for _ in range(200)]
    for name, wanted in zip(names, true, strict=True):
        values = np.array([run[name].value for run in runs])
        assert values.mean() == pytest.approx(
            wanted, abs=3.5 * values.std() / np.sqrt(200) + 1e-3
        ), name
        held = sum(run[name].low <= wanted <= run[name].high for run in runs)
        assert 184 <= held <= 199, (name, held)


def test_few_dents_are_said_and_make_the_interval_wide() -> None:
    rng = np.random.default_rng(10)
    few, many = of_all_sizes(rng, 0.2), of_all_sizes(rng, 40.0)
    assert few_dents_note(many, target_patches(many, CHAMBER, TREATMENT)) == ()
    [note] = few_dents_note(few, target_patches(few, CHAMBER, TREATMENT))
    assert "dents per target triangle" in note
    assert "patches" in note
    rough, sharp = (estimate_metrics(replicas, CHAMBER, DESIGN) for replicas in (few, many))
    names = ("mean_coverage", "std_coverage")
    assert all(rough[name].half_width > 4 * sharp[name].half_width for name in names)
    x = CLUMPED * (0.5 + CLUMPED / 0.5) * 0.1 * TREATMENT
    true = -np.expm1(-x).mean(), np.expm1(-x).std()
    runs = [estimate_metrics(of_all_sizes(rng, 0.5), CHAMBER, DESIGN) for _ in range(60)]
    for name, wanted in zip(names, true, strict=True):
        assert sum(run[name].low <= wanted <= run[name].high for run in runs) >= 54


def test_patches_are_near_and_hold_enough() -> None:
    rng = np.random.default_rng(11)
    places, content = rng.random((3000, 3)), rng.uniform(0.0, 0.8, 3000)
    patch = patches(places, content, 2.0)
    held = np.bincount(patch, content)
    assert held.min() >= 2.0
    assert held.mean() < 4.0
    middles = np.column_stack(
        [np.bincount(patch, places[:, k]) / np.bincount(patch) for k in range(3)]
    )
    assert np.linalg.norm(places - middles[patch], axis=1).mean() < 0.1
    np.testing.assert_array_equal(patches(places, content + 2.0, 2.0), np.arange(3000))
    assert set(patches(places, 0.0 * content, 2.0)) == {0}


@pytest.mark.long
def test_real_simulations_hold_their_long_run_value() -> None:
    """200 short runs of the plate's chamber against one of all their replicas together."""
    design = plate_design(
        process__accuracy__simulated_time_s=0.1, process__accuracy__warmup_time_s=0.05
    )
    chamber = build_chamber(design)
    with local_executor() as executor:
        everything = evaluate(design, chamber, executor, plan=ReplicaPlan(1600))
    names = ("mean_coverage", "std_coverage")
    held = dict.fromkeys((*names, "uniform_coverage"), 0)
    for run in range(200):
        got = estimate_metrics(everything.replicas[8 * run : 8 * run + 8], chamber, design)
        got["uniform_coverage"] = weighted_sum(OBJECTIVES["uniform_coverage"], got)
        truth_of = {**everything.metrics, "uniform_coverage": everything.objective}
        for name in held:
            held[name] += got[name].low <= truth_of[name].value <= got[name].high
    assert all(184 <= count <= 200 for count in held.values()), held


def test_a_ball_that_bounces_on_its_spot_does_not_empty_the_mean() -> None:
    """Few dents, and in each replica forty on one triangle, another each time: what one ball did says nothing
    of how coverage varies, and the figures stay where Poisson dents alone would have them, or say
    that they may not.
    """
    rng, chamber = np.random.default_rng(3), patchwork(np.full(700, 1e-6))
    rate = 0.6 / (
        0.03 * TREATMENT
    )  # dents per triangle and second: 45 % covered, 0.03 of a triangle a dent

    def replica(spots: int) -> Tally:
        dents = rng.poisson(rate * 2.0, 700)
        dents[rng.choice(700, spots, replace=False)] += 40
        return equal_dents(2.0, dents, 0.03e-6)

    found = estimate_metrics([replica(1) for _ in range(4)], chamber, DESIGN)
    mean, std = found["mean_coverage"], found["std_coverage"]
    assert abs(mean.value + np.expm1(-0.6)) < mean.half_width + 0.02
    assert mean.value > 0.35
    assert mean.half_width < 0.15
    assert std.value < 0.3


def test_what_variance_can_take_off_the_mean_is_bounded() -> None:
    """exp(-x) of any x >= 0 has no larger mean than that of 0 or one other value with its mean and variance."""
    rng = np.random.default_rng(5)
    for _ in range(200):
        x = rng.gamma(rng.uniform(0.05, 5.0), rng.uniform(0.1, 2.0), 20)
        off, _ = _max_effect_of_variance(float(x.var()), float(np.exp(-x.mean())))
        assert np.exp(-x).mean() - np.exp(-x.mean()) <= off + 1e-12
    two = np.array([0.0, 0.0, 0.0, 1.7])
    off, more = _max_effect_of_variance(float(two.var()), float(np.exp(-two.mean())))
    assert off == pytest.approx(np.exp(-two).mean() - np.exp(-two.mean()))
    assert more == pytest.approx(np.exp(-two).var())
    assert _max_effect_of_variance(0.0, 0.5) == _max_effect_of_variance(1.0, 1.0) == (0.0, 0.0)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("dents", [0, 1, 2])
def test_a_handful_of_dents_gives_figures(dents: int) -> None:
    """So few that they all lie on one patch: the two means then move as one."""
    chamber = patchwork(np.full(50, 1e-6))
    counts = np.zeros((3, 50), dtype=int)
    counts[:dents, 7] = 1
    tallies = [equal_dents(1e-3, count, 1e-8) for count in counts]
    for found in estimate_metrics(tallies, chamber, plate_design()).values():
        assert np.isfinite(found.value)
        assert not np.isnan(found.half_width)

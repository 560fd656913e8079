"""Ranges of figures whose dependence on what is not calibrated is known."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.common.estimate import Estimate, estimate
from chamberopt.common.executor import SerialExecutor
from chamberopt.design.ranges import Unknown, UnknownNumber, unknowns
from chamberopt.documents.ranges import at_ends_text
from chamberopt.peening.range_result import RangeResult
from chamberopt.peening.ranges import (
    EndRuns,
    best_at_ends,
    find_ranges,
    replicas_at_ends,
    simulate_ends,
)
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate
from chamberopt.simulation.evaluation import Evaluation
from tests.helpers.synthetic import judged, plate_design

FACTORS = {"friction": (0.5, 1.5), "v0": (0.5, 2.0), "slopes": (0.6, 1.7)}
GROUPS = [
    Unknown(name, {"number": UnknownNumber(value=1.0, low=low, high=high)})
    for name, (low, high) in FACTORS.items()
]
POWERS = {"friction": -0.3, "v0": 0.4, "slopes": 0.2}
DOSE, REPLICAS, FEW = 0.5, 24, 4
NEVER = Estimate(1e6, 0.1, (1e6,) * FEW, in_words="never")
Noise = Callable[[int], np.ndarray]  # relative noise of so many replicas


def even(count: int) -> np.ndarray:
    """Noise that is equal in all runs and 0 on average."""
    return 0.02 * np.linspace(-1.0, 1.0, count)


def evaluated(factors: Mapping[str, float], count: int, noise: Noise) -> Evaluation:
    """A run in which dents go with powers of the factors."""
    power = np.prod([factors[name] ** POWERS[name] for name in factors])
    doses = DOSE * float(power) * (1.0 + noise(count))
    figures = {
        "mean_coverage": estimate(-np.expm1(-doses), 0.0, 1.0),
        "exposure": estimate(doses, 0.0),
        "time_to_98_s": estimate(400.0 / doses, 0.0),
        "shot_count": Estimate(30.0, 0.0, (30.0,) * count),
        "strength_um": Estimate(3.0, np.inf, in_words="not resolved"),
    }
    return replace(judged(doses), metrics=figures)


def runs_with(noise: Noise, few: int = FEW) -> EndRuns:
    at = {name: [evaluated({name: f}, few, noise) for f in ends] for name, ends in FACTORS.items()}
    ends = {name: (low, high) for name, (low, high) in at.items()}
    whole, first = evaluated({}, REPLICAS, noise), evaluated({}, few, noise)
    return EndRuns(GROUPS, [], whole, first, ends)


def test_changes_of_the_groups_add_in_quadrature() -> None:
    """All figures go with a power law of the factors, and the scales make straight lines of it."""
    runs = runs_with(lambda count: 1e-6 * even(count))
    found = find_ranges(runs)
    changes = np.array([np.sort(POWERS[name] * np.log(ends)) for name, ends in FACTORS.items()])
    low, high = -np.linalg.norm(changes[:, 0]), np.linalg.norm(changes[:, 1])
    exposure = found.figures["exposure"]
    assert exposure.low.value == pytest.approx(DOSE * np.exp(low))
    assert exposure.high.value == pytest.approx(DOSE * np.exp(high))
    mean = found.figures["mean_coverage"]
    assert mean.low.value == pytest.approx(-np.expm1(-DOSE * np.exp(low)))
    time = found.figures["time_to_98_s"]
    assert time.high.value == pytest.approx(400.0 / DOSE * np.exp(-low))
    squares = (changes**2).sum(axis=1)
    assert [*mean.shares.values()] == pytest.approx(squares / squares.sum())
    at_low = mean.effects["v0"].low.value
    assert at_low == pytest.approx(-np.expm1(-DOSE * 0.5**0.4) + np.expm1(-DOSE))
    assert found.figures.keys() == {"uniform_coverage", "mean_coverage", "exposure", "time_to_98_s"}
    assert (found.replicas, found.cost) == (FEW, pytest.approx(6 * FEW / REPLICAS))


def test_noise_is_not_sold_as_knowledge() -> None:
    """Where nothing depends on the groups, ranges are far narrower than the scatter of their runs,
    and are said to be below the noise.
    """
    resolved, widths = [], []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        noise = lambda count, rng=rng: 0.1 * rng.standard_normal(count)  # noqa: E731
        with pytest.MonkeyPatch.context() as patch:
            patch.setitem(POWERS, "friction", 0.0)
            patch.setitem(POWERS, "v0", 0.0)
            patch.setitem(POWERS, "slopes", 0.0)
            found = find_ranges(runs_with(noise)).figures["exposure"]
        resolved.append(found.is_resolved)
        widths.append(0.5 * np.log(found.high.value / found.low.value))
    scatter = 0.1 * np.sqrt(2.0 / FEW)  # standard error of one change
    assert np.mean(resolved) < 0.45  # one of six 95 % intervals that share one run
    assert np.mean(widths) < scatter * np.sqrt(3.0)


def test_the_truth_within_the_box_is_within_the_range() -> None:
    """The sum of three numbers, each as likely anywhere in its range, exceeds the root of the sum
    of their squared ends one time in twelve; the noise of the ends moves that by a little.
    """
    rng = np.random.default_rng(5)
    factors = np.array([rng.uniform(*ends, 2000) for ends in FACTORS.values()])
    powers = np.array([*POWERS.values()])[:, None]
    truth = DOSE * np.prod(factors**powers, axis=0)
    for seed in range(5):
        other = np.random.default_rng(seed)
        noise = lambda count, rng=other: 0.02 * rng.standard_normal(count)  # noqa: E731
        runs = runs_with(noise)
        one, counted = find_ranges(runs).figures["exposure"], runs.whole.metrics["exposure"]
        low, high = one.low.value - counted.half_width, one.high.value + counted.half_width
        assert np.mean((low <= truth) & (truth <= high)) > 0.85


def test_never_at_an_end_is_never() -> None:
    runs = runs_with(even)
    low, high = runs.ends["friction"]
    bare = replace(high, metrics=high.metrics | {"time_to_98_s": NEVER})
    found = find_ranges(replace(runs, ends=runs.ends | {"friction": (low, bare)}))
    time = found.figures["time_to_98_s"]
    assert (time.low.in_words, time.high.in_words) == ("", "never")
    assert time.is_resolved
    assert RangeResult.model_validate_json(found.model_dump_json()).figures.keys() == (
        found.figures.keys()
    )


def test_coverage_ends_at_0_and_1() -> None:
    runs = runs_with(even)
    low, high = runs.ends["v0"]
    full = replace(high, metrics=high.metrics | {"mean_coverage": estimate([1.0] * FEW)})
    bare = replace(low, metrics=low.metrics | {"mean_coverage": estimate([0.0] * FEW)})
    mean = find_ranges(replace(runs, ends=runs.ends | {"v0": (bare, full)})).figures[
        "mean_coverage"
    ]
    assert (mean.low.value, mean.high.value) == pytest.approx((0.0, 0.9), abs=0.15)
    assert 0.0 <= mean.low.value < mean.high.value <= 1.0


def test_a_figure_without_a_value_at_an_end_is_named() -> None:
    runs = runs_with(even)
    low, high = runs.ends["v0"]
    lost = Estimate(np.inf, np.inf, in_words="not resolved")
    without = replace(high, metrics=high.metrics | {"time_to_98_s": lost})
    found = find_ranges(replace(runs, ends=runs.ends | {"v0": (low, without)}))
    assert found.not_resolved == ["time_to_98_s"]
    assert "time_to_98_s" not in found.figures


@pytest.mark.parametrize(("replicas", "count"), [(3, 2), (8, 2), (24, 4), (1, 1)])
def test_ends_take_as_many_replicas_as_the_design(replicas: int, count: int) -> None:
    assert replicas_at_ends(replicas, 3) == count


def raised(one: Evaluation) -> Evaluation:
    return replace(one, objective=estimate(np.array(one.objective.pseudovalues) + 0.1))


def test_the_best_of_a_study_is_ranked_at_both_ends() -> None:
    best, rival = runs_with(even), runs_with(even)
    better = {name: (raised(low), raised(high)) for name, (low, high) in best.ends.items()}
    stays = best_at_ends(replace(best, ends=better), rival, "start")
    assert all(x.gain.value == pytest.approx(0.1) for x in stays.gains)
    assert at_ends_text(stays) == (
        "The best design stays better than the start at both ends of friction, the least speed "
        "that dents and slopes of the faces."
    )
    ends = better | {"v0": (better["v0"][0], rival.ends["friction"][1])}
    text = at_ends_text(best_at_ends(replace(best, ends=ends), rival, "runner-up"))
    assert (
        "the runner-up is better at the high end of the least speed that dents; the best design "
        "is better at" in text
    )
    assert "Noise hides" in at_ends_text(best_at_ends(best, rival, "start"))


SHORT = {
    "simulated_time_s": 0.3,
    "warmup_time_s": 0.02,
    "replicas": 4,
    "points": 1000,
    "gauge_mm2": 20.0,
}


def test_a_short_real_run() -> None:
    """The ends are the runs of designs that are changed by hand, bit for bit, and a design between
    them has its figures within the ranges and the intervals of counting.
    """
    design = plate_design(**{f"process__accuracy__{name}": one for name, one in SHORT.items()})
    design = design.changed({"materials.part": "42CrMo4"})  # whose v0 changes the size of dents too
    exact = {"friction": [1, 1], "slopes": [1, 1]}
    design = design.changed({"ranges": exact})
    chamber, executor, done = build_chamber(design), SerialExecutor(), []
    whole = evaluate(design, chamber, executor)
    runs = simulate_ends(design, chamber, whole, executor, lambda *at: done.append(at))
    assert runs is not None
    assert done == sorted(done)
    assert done[-1] == (4, 4, None)
    (group,) = unknowns(design)

    def by_hand(factor: float, replicas: int = 2) -> Evaluation:
        changed = design.changed({name: factor * x.value for name, x in group.numbers.items()})
        return evaluate(changed, chamber, executor, plan=ReplicaPlan(replicas))

    for one, factor in zip(runs.ends["v0"], (0.5, 2.0), strict=True):
        assert one.metrics == by_hand(factor).metrics
    found, between = find_ranges(runs), by_hand(1.5, 4)
    for name in ("mean_coverage", "impacts_per_mm2_s"):
        figure, mine = found.figures[name], between.metrics[name]
        noise = mine.half_width + whole.metrics[name].half_width
        assert figure.low.value - noise <= mine.value <= figure.high.value + noise
    assert found.figures["mean_coverage"].is_resolved

    known = design.changed({"ranges": exact | {"v0": [1, 1]}})
    assert simulate_ends(known, chamber, whole, executor) is None

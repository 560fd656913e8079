"""Mean, deviation, percentile and time from Poisson dents of a known field.

The surface is a plane of windows that do not overlap. Each window has its own x, the expected dents
by their share of it, and dents that take random shares.
"""

from collections.abc import Iterator, Sequence

import numpy as np
import pytest

from chamberopt.common.estimate import NOT_RESOLVED, Estimate, estimate, jackknife
from chamberopt.coverage.coverage_from_impacts import Batch, Footprints, in_batches, joined
from chamberopt.coverage.coverage_intervals import (
    DENTS_FOR_MEAN,
    DENTS_FOR_PLACES,
    ENOUGH,
    Resolution,
    coverage_estimates,
    find_resolution,
    mean_and_variance,
    products_without_each,
    root_of_variance,
)
from chamberopt.coverage.field.smooth_faces import Places
from chamberopt.coverage.field.surface_points import Reach
from chamberopt.coverage.field.target_field import Gauge
from chamberopt.coverage.field.windows import Windows
from chamberopt.coverage.metrics import NEVER
from chamberopt.coverage.percentile import (
    P05_COVERAGE,
    in_order,
    quantile_estimate,
    sum_dents,
    time_to_98,
    time_to_98_estimate,
)
from chamberopt.simulation.estimates import as_resolved, resolution_notes

WINDOWS = 1000
TREATMENT = 50.0  # s
REPLICAS = 8
ALONG = (np.arange(WINDOWS) + 0.5) / WINDOWS
FIELDS = {
    "even": np.full(WINDOWS, 1.0),
    "ramp": 0.6 + 1.2 * ALONG,
    "shadow": np.where(ALONG < 0.1, 0.0, 0.8 + 0.8 * ALONG),
}


def true_figures(x: np.ndarray) -> dict[str, float]:
    share = -np.expm1(-x)
    low = -np.expm1(-np.quantile(x, 0.05))
    return {"mean_coverage": share.mean(), "std_coverage": share.std(), "p05_coverage": low}


def poisson_batches(
    rng: np.random.Generator, x: np.ndarray, dents: float, replicas: int = REPLICAS
) -> list[Batch]:
    """Replicas of a field that leave so many dents in the average window together.

    The shares of the dents scatter by half of their mean.
    """
    time_ratio = replicas  # each replica simulates the treatment time over the number of replicas
    share = x.mean() / dents  # of a window that a dent takes, times scale
    batches = []
    for _ in range(replicas):
        count = rng.poisson(x / share / replicas)
        point = np.repeat(np.arange(WINDOWS), count)
        weight = share * rng.gamma(4.0, 0.25, len(point)) * replicas / time_ratio
        area = weight * 1e-6
        batches.append(Batch(1, Footprints(point, weight, area.sum(), 0.0, (area**2).sum())))
    return batches


def groups_of(name: str, dents: float, groups: int) -> Iterator[dict[str, Estimate]]:
    """Estimates of groups of replicas that simulate the whole treatment together."""
    rng, x = np.random.default_rng(1), FIELDS[name]
    for _ in range(groups):
        batches = poisson_batches(rng, x, dents)
        found = estimates_of(batches, 1.0, float(REPLICAS))
        found["time_to_98_s"] = time_to_98_estimate(found["p05_coverage"], TREATMENT)
        yield found


def estimates_of(
    batches: Sequence[Batch], reachable: float, time_ratio: float
) -> dict[str, Estimate]:
    return coverage_estimates(batches, sum_dents(batches, WINDOWS), Reach(reachable), time_ratio)


def resolution_of(
    batches: Sequence[Batch], gauge: Gauge, time_ratio: float, time: float
) -> Resolution:
    return find_resolution(batches, sum_dents(batches, WINDOWS), gauge, time_ratio, time)


def plane_gauge(area: float = 1e-6) -> Gauge:
    """Windows of one area, apart from one another."""
    place = np.zeros((WINDOWS, 3))
    place[:, 0] = np.arange(WINDOWS) * 1e-3
    points = Places(place, np.tile([0.0, 0.0, 1.0], (WINDOWS, 1)), np.zeros(WINDOWS, dtype=int))
    return Gauge(Windows(points, 0.5e-3), np.full(WINDOWS, area), None)


@pytest.mark.parametrize("dents", [5.0, 12.0, 48.0])
@pytest.mark.parametrize("field", FIELDS)
def test_mean_and_deviation_have_no_bias_and_their_intervals_hold(
    field: str, dents: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Percentiles, of which nothing is asked here, take ten times as long.
    percentiles = "chamberopt.coverage.coverage_intervals.quantile_estimate"
    monkeypatch.setattr(percentiles, lambda *_: Estimate(0.5, 0.1, (0.4, 0.6)))
    groups = list(groups_of(field, dents, 100))
    for name in ("mean_coverage", "std_coverage"):
        wanted = true_figures(FIELDS[field])[name]
        values = np.array([one[name].value for one in groups])
        held = np.mean([one[name].low <= wanted <= one[name].high for one in groups])
        bias, noise = abs(values.mean() - wanted), values.std(ddof=1) / np.sqrt(len(groups))
        assert 0.9 <= held <= 1.0, (name, held)
        # Where a dent takes half a window, single products end at 0; and no deviation is below 0.
        if (name == "mean_coverage" or dents > 10.0) and wanted > 1e-6:
            assert bias < 3.5 * noise + 1e-3, (name, bias)


@pytest.mark.parametrize("dents", [25.0, pytest.param(60.0, marks=pytest.mark.long)])
@pytest.mark.parametrize("field", [pytest.param("even", marks=pytest.mark.long), "ramp"])
def test_percentile_and_time_are_right_from_25_dents_on(field: str, dents: float) -> None:
    groups = list(groups_of(field, dents, 100))
    low, x = true_figures(FIELDS[field])["p05_coverage"], FIELDS[field]
    for name, wanted, close in (
        ("p05_coverage", low, 0.02),
        ("p95_coverage", -np.expm1(-np.quantile(x, 0.95)), 0.02),
        ("exposure", x.mean() / np.log(50.0), 0.002),
        ("p95_exposure", np.quantile(x, 0.95) / np.log(50.0), 0.02),
        ("time_to_98_s", TREATMENT * np.log(50.0) / -np.log1p(-low), 10.0),
    ):
        values = np.array([one[name].value for one in groups])
        held = np.mean([one[name].low <= wanted <= one[name].high for one in groups])
        assert abs(values.mean() - wanted) < close, (name, values.mean(), wanted)
        assert 0.9 <= held <= 1.0, (name, held)


@pytest.mark.parametrize("replicas", [2, 3, 5])
def test_few_replicas_give_the_same_percentile(replicas: int) -> None:
    """What is left of the scatter is taken from parts of the replicas, also where they are few."""
    rng, x = np.random.default_rng(10), FIELDS["ramp"]
    wanted, values, held = true_figures(x)["p05_coverage"], [], 0
    for _ in range(20):
        batches = poisson_batches(rng, x, 60.0, replicas)
        found = estimates_of(batches, 1.0, float(replicas))["p05_coverage"]
        held += found.low <= wanted <= found.high
        values.append(found.value)
    assert held >= 17
    assert np.mean(values) == pytest.approx(wanted, abs=0.015)


@pytest.mark.long
def test_the_figures_do_not_depend_on_how_long_was_simulated() -> None:
    """Without the products, few dents would make the surface uneven and less covered."""
    plain, found = {}, {}
    for dents in (4.0, 64.0):
        rng, x = np.random.default_rng(2), FIELDS["ramp"]
        runs = [poisson_batches(rng, x, dents) for _ in range(40)]
        sums = [sum_dents(run, WINDOWS).share.sum(axis=0) for run in runs]
        plain[dents] = np.mean([-np.expm1(-one).mean() for one in sums])
        found[dents] = np.mean(
            [estimates_of(run, 1.0, float(REPLICAS))["mean_coverage"].value for run in runs]
        )
    assert plain[64.0] - plain[4.0] > 0.03
    assert abs(found[64.0] - found[4.0]) < 0.003


@pytest.mark.parametrize("dents", [25.0, 100.0])
def test_a_tenth_in_the_shadow_leaves_the_percentile_bare_and_the_time_open(dents: float) -> None:
    """Balls could get there but do not. More than so much time is all that is known."""
    unit = FIELDS["shadow"].mean() / dents  # x of one dent
    for one in groups_of("shadow", dents, 5):
        low, time = one["p05_coverage"], one["time_to_98_s"]
        assert low.value < 0.005
        assert low.low <= 0.0
        assert low.high == pytest.approx(-np.expm1(-3.0 * unit), abs=0.01)
        soonest = TREATMENT * np.log(50.0) / -np.log1p(-low.high)
        assert (time.half_width, time.in_words) == (np.inf, f"more than {soonest:,.0f} s")


def test_what_is_out_of_reach_counts_as_bare_exactly() -> None:
    """A tenth of the target is out of reach; the windows are over the rest."""
    rng, x = np.random.default_rng(3), FIELDS["ramp"]
    true = true_figures(np.concatenate([x, np.zeros(WINDOWS // 9)]))
    for dents in (5.0, 50.0):
        batches = poisson_batches(rng, x, dents)
        found = estimates_of(batches, 0.9, float(REPLICAS))
        for name in ("mean_coverage", "std_coverage"):
            gap = abs(found[name].value - true[name])
            assert gap < 2.0 * found[name].half_width + 2e-3, name
        low = found["p05_coverage"]
        assert (low.value, low.half_width) == (0.0, 0.0)
        never = time_to_98_estimate(low, TREATMENT)
        assert (never.value, never.half_width, never.in_words) == (NEVER, 0.0, "never")
        # What follows from places out of reach needs no dents.
        nothing = Resolution(1.0, 3.0, 25.0, 1.0)
        assert as_resolved("p05_coverage", low, nothing) == low
        assert as_resolved("time_to_98_s", never, nothing).in_words == "never"


def test_up_to_5_percent_out_of_reach_move_the_percentile_down_the_rest() -> None:
    """With 2 % out of reach it is the quantile of 3/98 of the windows that can be reached."""
    rng, x = np.random.default_rng(4), FIELDS["ramp"]
    found = estimates_of(poisson_batches(rng, x, 400.0), 0.98, float(REPLICAS))
    wanted = -np.expm1(-np.quantile(x, 0.03 / 0.98))
    low = found["p05_coverage"]
    assert abs(low.value - wanted) < low.half_width + 0.01


def test_one_batch_has_no_interval() -> None:
    batches = poisson_batches(np.random.default_rng(5), FIELDS["ramp"], 50.0, replicas=1)
    found = estimates_of(batches, 1.0, 1.0)
    assert all(one.half_width == np.inf for one in found.values())
    assert all(np.isfinite(one.value) for one in found.values())
    assert time_to_98_estimate(found["p05_coverage"], TREATMENT).half_width == np.inf
    bare = estimates_of(batches, 0.9, 1.0)["p05_coverage"]
    assert (bare.value, bare.half_width) == (0.0, np.inf)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("dents", [0, 1, 2])
def test_a_handful_of_dents_gives_numbers_that_are_not_resolved(dents: int) -> None:
    prints = [
        Footprints(
            np.array([7] * (i < dents), dtype=int), np.array([0.01] * (i < dents)), 1e-8, 0.0, 1e-16
        )
        for i in range(3)
    ]
    batches = [Batch(1, one) for one in prints]
    found = estimates_of(batches, 1.0, 3.0)
    found["time_to_98_s"] = time_to_98_estimate(found["p05_coverage"], TREATMENT)
    resolution = resolution_of(batches, plane_gauge(), 3.0, 1.0)
    assert not resolution.has_mean
    assert not resolution.has_places
    for name, one in found.items():
        assert np.isfinite(one.value)
        assert not np.isnan(one.half_width)
        assert as_resolved(name, one, resolution).in_words in (NOT_RESOLVED, "never")


# Resolution


def test_what_is_needed_is_three_dents_for_each_unit_of_x() -> None:
    """Equal dents of a hundredth of a window: 100 dents for each unit of x."""
    point = np.repeat(np.arange(WINDOWS), 5)
    print_ = Footprints(
        point, np.full(len(point), 0.01), 1e-8 * len(point), 0.0, 1e-16 * len(point)
    )
    batches = [Batch(1, print_)] * 4
    found = resolution_of(batches, plane_gauge(), time_ratio=10.0, time=0.5)
    assert found.dents == 20.0
    assert found.simulated_time == 2.0
    # x = 20 · 0.01 · 10 / 4 = 0.5 at the treatment time; so 1.5 dents would do.
    assert found.needed_for_mean == pytest.approx(DENTS_FOR_MEAN * 0.5)
    assert found.needed_for_places == DENTS_FOR_PLACES
    assert found.has_mean
    assert not found.has_places
    assert found.time_for(25.0) == pytest.approx(ENOUGH * 2.5)
    # In windows of four times the area there is four times as much of a unit.
    wide = resolution_of(batches, plane_gauge(4e-6), time_ratio=10.0, time=0.5)
    assert wide.needed_for_mean == pytest.approx(DENTS_FOR_MEAN * 0.5 / 4.0)


def test_needs_grow_with_the_ratio_of_the_times_and_with_unequal_dents() -> None:
    rng = np.random.default_rng(6)
    [one] = poisson_batches(rng, FIELDS["even"], 20.0, replicas=1)
    short = resolution_of([one], plane_gauge(), time_ratio=10.0, time=1.0)
    long = resolution_of([one], plane_gauge(), time_ratio=40.0, time=1.0)
    assert long.needed_for_mean == pytest.approx(4.0 * short.needed_for_mean)
    same = one.footprints._replace(squares=one.footprints.area**2 / len(one.footprints.point))
    equal = resolution_of([Batch(1, same)], plane_gauge(), time_ratio=10.0, time=1.0)
    assert short.needed_for_mean == pytest.approx(1.25 * equal.needed_for_mean, rel=0.02)


def test_too_few_dents_are_not_resolved_and_the_notes_say_what_would_do() -> None:
    known = estimate([0.4, 0.5, 0.45])
    few = Resolution(dents=2.0, needed_for_mean=6.0, needed_for_places=25.0, simulated_time=4.0)
    some = Resolution(dents=10.0, needed_for_mean=6.0, needed_for_places=25.0, simulated_time=4.0)
    many = Resolution(dents=30.0, needed_for_mean=6.0, needed_for_places=25.0, simulated_time=4.0)
    for name, resolved in (
        ("mean_coverage", (False, True, True)),
        ("std_coverage", (False, True, True)),
        ("p05_coverage", (False, False, True)),
        ("time_to_98_s", (False, False, True)),
        ("intensity_uniformity", (False, False, True)),
        ("impacts_per_mm2_s", (True, True, True)),
    ):
        for resolution, is_known in zip((few, some, many), resolved, strict=True):
            shown = as_resolved(name, known, resolution)
            assert shown.value == known.value
            assert shown == known if is_known else shown.in_words == NOT_RESOLVED
            assert (shown.half_width == np.inf) != is_known
    [note] = resolution_notes(few)
    assert "2.0 dents after 4 s" in note
    assert "mean and standard deviation take 6 (about 14 s of all replicas)" in note
    assert "5th percentile, times and intensity take 25 (about 60 s of all replicas)" in note
    [note] = resolution_notes(some)
    assert "mean and standard deviation" not in note
    assert "process.accuracy.simulated_time_s" in note
    assert resolution_notes(many) == ()
    [note] = resolution_notes(Resolution(0.0, 3.0, 25.0, 4.0))
    assert "fewer than half of the windows of the target were hit" in note
    assert Resolution(0.0, 3.0, 25.0, 4.0).time_for(25.0) == np.inf


# Small pieces


def test_products_over_the_others_are_those_of_all_by_each() -> None:
    products = np.random.default_rng(7).uniform(0.1, 1.0, (5, 6, 2))
    found = products_without_each(products)
    assert found == pytest.approx(products.prod(axis=0) / products)
    products[2, 3] = 0.0  # where a division would fail
    found = products_without_each(products)
    assert found[2, 3] == pytest.approx(np.delete(products[:, 3], 2, axis=0).prod(axis=0))
    assert (found[[0, 1, 3, 4], 3] == 0.0).all()


def test_mean_and_variance_follow_from_two_means_of_exponentials() -> None:
    x = np.random.default_rng(8).gamma(2.0, 0.5, 1000)
    uncovered = np.array([np.exp(-x).mean(), np.exp(-2.0 * x).mean()])
    share = -np.expm1(-x)
    assert mean_and_variance(uncovered, 1.0) == pytest.approx((share.mean(), share.var()))
    with_bare = np.concatenate([share, np.zeros(250)])
    mean, variance = mean_and_variance(uncovered, 0.8)
    assert (mean, variance) == pytest.approx((with_bare.mean(), with_bare.var()))


def test_the_jackknife_of_a_mean_is_the_sample_itself() -> None:
    sample = np.random.default_rng(9).normal(size=6)
    without = (sample.sum() - sample) / 5.0
    assert jackknife(np.array([sample.mean(), *without])) == pytest.approx(sample)
    assert jackknife(np.array([0.3, 0.7])) == pytest.approx([0.3])


def test_a_deviation_keeps_the_interval_of_its_variance() -> None:
    variance = estimate([0.09, 0.11, 0.10, 0.10])
    far = root_of_variance(variance)
    assert far.value == pytest.approx(np.sqrt(0.10))
    assert far.half_width == pytest.approx(0.5 * variance.half_width / far.value, rel=0.05)
    near = root_of_variance(estimate([0.0, 0.02, 0.01, -0.01]))
    assert near.low <= 0.0
    assert near.value == pytest.approx(np.sqrt(0.005))
    assert root_of_variance(Estimate(0.0, 0.0, (0.0,) * 3)).half_width == 0.0


def test_time_to_98_by_avrami() -> None:
    """A coverage of 1 - 1/e has x = 1 at the treatment time: it takes ln 50 of them."""
    share = 1.0 - np.exp(-1.0)
    known = estimate(share + np.array([-1e-3, 1e-3, 0.0]), shared=(1e-4, -2e-4))
    found = time_to_98_estimate(known, TREATMENT)
    assert found.value == pytest.approx(TREATMENT * np.log(50.0))
    assert found.in_words == ""
    slope = TREATMENT * np.log(50.0) * np.exp(1.0)  # of the time over the coverage, at x = 1
    assert found.half_width == pytest.approx(slope * known.half_width, rel=0.02)
    assert found.shared == pytest.approx((-1e-4 * slope, 2e-4 * slope), rel=0.02)  # less time
    wide = time_to_98_estimate(estimate([0.3, 0.1, 0.2]), TREATMENT)
    soonest = TREATMENT * np.log(50.0) / -np.log1p(-estimate([0.3, 0.1, 0.2]).high)
    assert wide.in_words == f"more than {soonest:,.0f} s"
    assert wide.half_width == np.inf
    assert time_to_98_estimate(Estimate(1.0, 0.0, (1.0,) * 3), TREATMENT).value < TREATMENT


def test_the_time_does_not_depend_on_how_long_the_treatment_is() -> None:
    """After hours of peening the coverage is 1 to the last digit; the time is what it was."""
    batches = poisson_batches(np.random.default_rng(3), FIELDS["even"], 100.0)
    sums, found = sum_dents(batches, WINDOWS), []
    for times_as_long in (1.0, 30.0, 1e5):
        ratio = times_as_long * REPLICAS
        p05 = quantile_estimate(P05_COVERAGE, sums, Reach(1.0), ratio)
        found.append(time_to_98(p05, sums, Reach(1.0), ratio, times_as_long * TREATMENT))
    first = found[0]
    assert p05.value == 1.0
    for one in found:
        assert one.value == pytest.approx(first.value, rel=0.05)
        assert one.half_width == pytest.approx(first.half_width, rel=0.5)


def test_batches_of_unequal_sizes_have_intervals_like_equal_ones() -> None:
    """With 60 replicas 20 batches are of two and 20 of one; 40 and 80 are in equal batches."""
    rng = np.random.default_rng(5)

    def replica() -> Footprints:
        dents = rng.poisson(10.0 * WINDOWS)
        return Footprints(rng.integers(0, WINDOWS, dents), np.full(dents, 0.02), 1.0, 0.0, 1.0)

    replicas = [replica() for _ in range(80)]
    widths = {}
    for count in (40, 60, 80):
        run = [Batch(len(part), joined(part)) for part in in_batches(replicas[:count])]
        assert len({one.replicas for one in run}) == (2 if count == 60 else 1)
        found = estimates_of(run, 1.0, 5.0)["mean_coverage"]
        assert abs(found.value + np.expm1(-1.0)) < 3.0 * found.half_width
        widths[count] = found.half_width * np.sqrt(count)
    assert widths[60] == pytest.approx(0.5 * (widths[40] + widths[80]), rel=0.35)


def test_percentiles_that_the_corrections_exchange_are_one() -> None:
    low, high = Estimate(0.8, 0.1), Estimate(0.7, 0.2)
    assert in_order(high, low, "{}_a") == {"p05_a": high, "p95_a": low}
    middle = in_order(low, high, "{}_a")
    assert [one.value for one in middle.values()] == [0.75, 0.75]
    # Their old values are still within.
    assert [one.half_width for one in middle.values()] == pytest.approx([0.15, 0.25])

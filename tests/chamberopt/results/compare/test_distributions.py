"""Histograms hold all of the area and all impacts, in bins that are the same for all results."""

from types import SimpleNamespace

import numpy as np
import pytest

from chamberopt.results.compare.distributions import BINS, Distributions, distributions


def surface(seed: int, lowest: float, highest: float) -> SimpleNamespace:
    rng = np.random.default_rng(seed)
    area = rng.random(500)
    hits = SimpleNamespace(speed=rng.rayleigh(1.0, 300), angle=rng.uniform(0.0, 90.0, 300))
    coverage = rng.uniform(lowest, highest, 500)
    return SimpleNamespace(area=area / area.sum(), coverage=coverage, hits=hits)


def of(*surfaces: SimpleNamespace) -> Distributions:
    return distributions(surfaces)  # type: ignore[arg-type]


def test_all_area_and_all_impacts_are_in_the_bins() -> None:
    one, other = surface(1, 0.221, 0.43), surface(2, 0.31, 0.684)
    found = of(one, other)
    for histogram in (found.coverage, found.speed, found.angle):
        assert [share.sum() for share in histogram.shares] == pytest.approx([1.0, 1.0])
        assert np.ptp(np.diff(histogram.edges)) < 1e-9
    assert (found.coverage.edges[0], found.coverage.edges[-1]) == (20.0, 70.0)  # steps of 5 %
    assert len(found.coverage.edges) == BINS + 1
    each = np.full(len(one.hits.angle), 1.0 / len(one.hits.angle))
    for histogram, values, weight in (
        (found.coverage, 100.0 * one.coverage, one.area),
        (found.angle, one.hits.angle, each),
    ):
        middles = 0.5 * (histogram.edges[1:] + histogram.edges[:-1])
        step = histogram.edges[1] - histogram.edges[0]
        assert abs(histogram.shares[0] @ middles - weight @ values) < 0.5 * step


def test_one_coverage_everywhere_has_bins_of_five_per_cent_together() -> None:
    flat = surface(3, 0.5, 0.5)
    edges = of(flat).coverage.edges
    assert (edges[0], edges[-1]) == (50.0, 55.0)


def test_the_order_of_the_results_changes_nothing_but_the_order() -> None:
    one, other = surface(1, 0.2, 0.4), surface(2, 0.3, 0.6)
    there, back = of(one, other), of(other, one)
    np.testing.assert_array_equal(there.speed.edges, back.speed.edges)
    for a, b in zip(there.coverage.shares, back.coverage.shares[::-1], strict=True):
        np.testing.assert_array_equal(a, b)
    assert there.mean_speed == back.mean_speed[::-1]

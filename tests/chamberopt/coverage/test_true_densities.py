"""Percentiles of dent densities without the scatter of counting, against known densities."""

import numpy as np
import pytest
from scipy.special import ndtri

from chamberopt.coverage.true_densities import (
    CountedRoots,
    TrueDensities,
    count_roots,
    true_densities,
)

BATCHES, WINDOWS = 8, 20_000
WEIGHT = 0.01  # share of a window that a dent takes


def found_from(density: np.ndarray, clusters: np.ndarray | float = 1.0) -> TrueDensities:
    """The densities that are found where dents fall at random, `clusters` of them at a time.

    Args:
        density: true dent density of each window, per replica, (p,).
    """
    return true_densities(counted_from(density, clusters))


def counted_from(density: np.ndarray, clusters: np.ndarray | float = 1.0) -> CountedRoots:
    rng = np.random.default_rng(1)
    mean = density / (WEIGHT * clusters)
    shares = WEIGHT * clusters * rng.poisson(mean, (BATCHES, len(density)))
    return count_roots(shares, np.ones(BATCHES, dtype=int))


def test_an_even_surface_has_the_same_density_at_all_percentiles() -> None:
    found = found_from(np.full(WINDOWS, 0.125))  # 100 dents in all, whose counts scatter by 10 %
    assert [found.at(share) for share in (0.05, 0.5, 0.95)] == pytest.approx([0.125] * 3, rel=0.03)


def test_counting_explains_all_variance_of_an_even_surface() -> None:
    counted = counted_from(np.full(WINDOWS, 0.125))
    assert counted.variance is not None
    # A root of a sum of n dents has the variance of one dent over 4 n: w / 4 per replica.
    assert counted.variance.mean() == pytest.approx(WEIGHT / 4.0 / BATCHES, rel=0.03)
    assert counted.true_variance == pytest.approx(0.0, abs=0.04 * counted.variance.mean())


def test_more_variance_draws_the_percentiles_apart() -> None:
    counted = counted_from(np.full(WINDOWS, 0.125))
    even, wider = true_densities(counted), true_densities(counted, more=0.02**2)
    assert wider.at(0.05) < 0.97 * even.at(0.05)
    assert wider.at(0.95) > 1.03 * even.at(0.95)


def test_wider_dents_scale_all_densities() -> None:
    root, variance = counted_from(np.linspace(0.1, 0.2, WINDOWS))
    assert variance is not None
    one = true_densities(CountedRoots(root, variance))
    scaled = true_densities(CountedRoots(2.0 * root, 4.0 * variance))  # no rounding
    for share in (0.05, 0.5, 0.95):
        assert scaled.at(share) == pytest.approx(4.0 * one.at(share))


def test_a_normal_distribution_of_roots_is_found() -> None:
    # Normal roots that are counted with a normal scatter are normal, and their variances add.
    counted = 0.5 + 0.05 * ndtri((np.arange(WINDOWS) + 0.5) / WINDOWS)
    found = true_densities(CountedRoots(counted, np.full(WINDOWS, 0.03**2)))
    for share in (0.05, 0.3, 0.5, 0.95):
        assert np.sqrt(found.at(share)) == pytest.approx(0.5 + 0.04 * ndtri(share), abs=6e-4)


def test_mirrored_roots_have_mirrored_percentiles() -> None:
    root = np.random.default_rng(3).gamma(9.0, 0.02, WINDOWS) + 0.2
    variance = np.full(WINDOWS, 0.0004)
    one = true_densities(CountedRoots(root, variance))
    other = true_densities(CountedRoots(2.0 - root, variance))
    for share in (0.05, 0.4, 0.95):
        mirrored = 2.0 - np.sqrt(other.at(1.0 - share))
        assert np.sqrt(one.at(share)) == pytest.approx(mirrored, abs=1e-6)


def test_a_small_dense_part_does_not_move_the_rest() -> None:
    # Roots that are moved towards their mean in proportion would have the 5th percentile at 0.107,
    # hardly above that of the counted roots, 0.106.
    density = np.where(np.arange(WINDOWS) < 0.8 * WINDOWS, 0.125, 0.5)
    found = found_from(density)
    assert found.at(0.05) == pytest.approx(0.125, rel=0.07)
    assert found.at(0.95) == pytest.approx(0.5, rel=0.04)


def test_dents_that_fall_in_clusters_scatter_more_where_they_do() -> None:
    dense = np.arange(WINDOWS) >= 0.8 * WINDOWS
    found = found_from(np.where(dense, 0.5, 0.125), clusters=np.where(dense, 4.0, 1.0))
    assert found.at(0.05) == pytest.approx(0.125, rel=0.07)
    assert found.at(0.95) == pytest.approx(0.5, rel=0.06)


def test_counts_without_scatter_are_taken_as_they_are() -> None:
    density = np.linspace(0.1, 0.2, 2001)
    shares = np.tile(density, (BATCHES, 1))
    found = true_densities(count_roots(shares, np.ones(BATCHES, dtype=int)))
    assert found.at(0.25) == pytest.approx(0.125, rel=0.003)
    single = true_densities(count_roots(shares[:1], np.ones(1, dtype=int)))
    assert single.at(0.25) == pytest.approx(0.125, rel=0.003)


def test_a_target_without_dents_has_no_density() -> None:
    found = true_densities(count_roots(np.zeros((BATCHES, 50)), np.ones(BATCHES, dtype=int)))
    assert found.at(0.95) == 0.0

"""An elastic gas forgets how it started: every ball's velocity comes to have Maxwell's
distribution.
"""

import numpy as np
import pytest
from scipy.stats import beta, kstest, norm

from tests.helpers.scenes.gas import SURE, jackknife, lattice_gas, played

# collisions a ball between samples: what a ball then still remembers is below noise (checked)
APART = 12.0
UNLIKELY = 1e-4  # chance of a false alarm


def sampled(per_side: int, packing: float, samples: int) -> np.ndarray:
    """Velocities over sqrt(kT), shape (samples, balls, 3), of a gas whose balls all started equally
    fast.
    """
    gas = lattice_gas(per_side, packing, seed=3)
    pieces = played(gas, samples, APART, record=())
    return np.array([result.balls.velocities for result, _ in pieces]) / np.sqrt(gas.kt)


def memory(samples: np.ndarray) -> float:
    """Correlation of a ball's kinetic energy in one sample with that in the next."""
    energy = (samples**2).sum(axis=2)
    energy -= energy.mean()
    return float((energy[1:] * energy[:-1]).mean() / (energy**2).mean())


def fourth_moment(samples: np.ndarray) -> tuple[float, float]:
    """<v⁴>/<v²>² and its error; <v²> is known, so the samples' own is not divided by."""
    fourth = (samples**2).sum(axis=2) ** 2 / 9.0
    return jackknife(lambda row: float(row.mean()), fourth)


def test_many_balls_have_maxwells_distribution() -> None:
    """N balls of fixed energy: v lies evenly on a sphere of 3N dimensions, so <v⁴>/<v²>² = 5/3 x
    3N/(3N + 2).
    """
    samples = sampled(5, 0.1, 300)
    count = 3 * samples.shape[1]
    assert abs(memory(samples)) < SURE / np.sqrt(samples[1:, :, 0].size) + 1.0 / samples.shape[1]
    for axis in range(3):
        result = kstest(samples[:, :, axis].ravel(), norm.cdf)
        print(f"component {axis}: KS {result.statistic:.5f}, p {result.pvalue:.3f}")
        assert result.pvalue > UNLIKELY
    ratio, error = fourth_moment(samples)
    expected = 5.0 / 3.0 * count / (count + 2)
    print(f"<v^4>/<v^2>^2 {ratio:.5f} +- {error:.5f}, expected {expected:.5f}")
    assert abs(ratio - expected) < SURE * error


@pytest.mark.parametrize("samples", [1_000, pytest.param(100_000, marks=pytest.mark.long)])
def test_eight_balls_have_the_distribution_of_few(samples: int) -> None:
    """A component of a point spread evenly on a sphere in 24 dimensions: (1 + v/R)/2 has a beta
    distribution.

    With eight balls the difference from Maxwell's is plain: <v_x⁴>/<v_x²>² is 3 x 24/26 = 2.77, not
    3.
    """
    velocities = sampled(2, 0.05, samples)
    count = 3 * velocities.shape[1]
    law = beta(
        0.5 * (count - 1), 0.5 * (count - 1), loc=-np.sqrt(count), scale=2.0 * np.sqrt(count)
    )
    one = velocities[:, 0]  # one ball of the eight, whose samples do not know of each other
    for axis in range(3):
        result = kstest(one[:, axis], law.cdf)
        print(f"component {axis}: KS {result.statistic:.5f}, p {result.pvalue:.3f}")
        assert result.pvalue > UNLIKELY
    ratio, error = jackknife(lambda row: float(row.mean()), velocities**4)
    print(f"<v_x^4>/<v_x^2>^2 {ratio:.4f} +- {error:.4f}, expected {3.0 * count / (count + 2):.4f}")
    assert abs(ratio - 3.0 * count / (count + 2)) < SURE * error
    assert abs(ratio - 3.0) > SURE * error

"""What measurements tell, with straight lines for models: true ones, and one that is wrong."""

import numpy as np
import pytest
from scipy.special import chdtri

from chamberopt.design.calibration import Parameter
from chamberopt.peening.posterior import (
    Data,
    Figures,
    Model,
    Prior,
    explaining_posterior,
    find_posterior,
    fit_surface,
)

NAMES: tuple[Parameter, ...] = ("amplitude", "v0", "K")
PRIOR = Prior(NAMES, np.zeros(3), np.array([0.1, 0.7, 0.9]))
SLOPES = {"arc heights": [[1.0, -0.1, 1.0]] * 5, "coverage": [[1.5, 0.3, 0.0]] * 8}
ERROR, ANYWHERE = 0.03, (np.full(3, -np.inf), np.full(3, np.inf))
CASES = 100


def line(rows: np.ndarray) -> Model:
    noise = np.zeros((len(rows), len(rows)))
    return lambda theta: Figures(rows @ np.array([theta[name] for name in NAMES]), noise)


def shares(wrong: float) -> tuple[float, float, float]:
    """Of cases: intervals that hold with larger errors and without, and coverage not explained.

    Args:
        wrong: by how much the coverage scatters more than its errors.
    """
    rng, cases = np.random.default_rng(0), []
    for _ in range(CASES):
        truth, data = PRIOR.sd * rng.standard_normal(3), []
        for kind, slopes in SLOPES.items():
            rows = np.array(slopes)
            sd = ERROR + (wrong if kind == "coverage" else 0.0)
            y = rows @ truth + sd * rng.standard_normal(len(rows))
            errors = ERROR**2 * np.eye(len(rows))
            data.append(Data(kind, "", np.arange(len(rows)), y, errors, line(rows)))
        wider, plain = (
            find(data, PRIOR, PRIOR.mean, ANYWHERE)
            for find in (explaining_posterior, find_posterior)
        )
        rate = line(np.array(SLOPES["coverage"][:1]))
        held = [
            abs(rate(one.values).values[0] - SLOPES["coverage"][0] @ truth) < 1.96 * one.sd(rate)[0]
            for one in (wider, plain)
        ]
        cases.append((*held, wider.misfits[1].error_scale > 1.0))
    return tuple(np.mean(cases, axis=0).tolist())


def test_a_true_model_is_hardly_ever_called_wrong() -> None:
    wider, _, unexplained = shares(wrong=0.0)
    assert wider >= 0.9  # one time in 75 fewer of 100 hold
    assert unexplained <= 0.12  # one time in 200 more


def test_intervals_hold_where_data_scatter_more_than_their_errors() -> None:
    wider, plain, unexplained = shares(wrong=0.12)
    assert wider > 0.82  # of 4 values, whose scatter tells less, fewer
    assert plain < 0.6
    assert unexplained > 0.9


@pytest.mark.parametrize(("chance", "is_explained"), [(0.052, True), (0.048, False)])
def test_errors_grow_where_less_than_one_case_in_twenty_scatters_so(
    chance: float, is_explained: bool
) -> None:
    """A machine that is known, with four values off by as much each."""
    known = Prior(NAMES, np.zeros(3), np.full(3, 1e-6))
    chi2 = float(chdtri(4, chance))
    y, errors = np.full(4, ERROR * np.sqrt(chi2 / 4.0)), ERROR**2 * np.eye(4)
    rows = np.array([[1.0, 0.5, 0.0]] * 4)
    found = explaining_posterior(
        [Data("arc heights", "", np.arange(4), y, errors, line(rows))], known, known.mean, ANYWHERE
    )
    (one, _) = found.misfits
    assert one.chi2 == pytest.approx(chi2, rel=1e-3)
    assert one.values == 4
    assert one.error_scale == pytest.approx(1.0 if is_explained else np.sqrt(chi2 / 4.0), rel=1e-3)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_quadratic_polynomial_is_fitted_as_it_is_where_there_is_no_noise(count: int) -> None:
    rng = np.random.default_rng(count)
    centre, slope = rng.normal(size=count), rng.normal(size=count)
    bend = rng.normal(size=(count, count))

    def value(place: np.ndarray) -> float:
        off = place - centre
        return float(2.0 + slope @ off + off @ bend @ off)

    places = centre + rng.normal(0.0, 0.1, (40, count))
    exact = fit_surface(places, centre, noise=1e-4)
    for place in centre + rng.normal(0.0, 0.1, (5, count)):
        found = exact.weights(place) @ [value(one) for one in places]
        assert found == pytest.approx(value(place), abs=1e-3)


def test_the_noise_of_many_runs_at_one_place_is_that_of_their_mean() -> None:
    """The polynomial's weights there are equal."""
    centre = np.zeros(2)
    near = fit_surface(np.zeros((25, 2)), centre, noise=0.1)
    assert near.weights(centre) == pytest.approx(np.full(25, 0.04), rel=1e-2)
    assert near.noise(centre) == pytest.approx(0.04, rel=1e-2)

"""Find a machine's most probable parameters from its measurements, and their covariance.

Notation
    theta   natural logarithms of the parameters, (p,)
    m, P    mean and covariance of theta before measuring: independent, log-normal
    y, R    logarithms of measured figures and the covariance of their errors
    f, N    the model's values for y, and their covariance by the noise of simulations
    J       df/dtheta at the most probable theta
    C       covariance of theta after measuring

The most probable theta makes (y - f)' (R + N)^-1 (y - f) + (theta - m)' P^-1 (theta - m) least, and
C = (J' (R + N)^-1 J + P^-1)^-1, Laplace's approximation. A figure g of theta then has the standard
deviation sqrt(g' C g), and a further measurement with J+ and R+ leaves
C - C J+' (J+ C J+' + R+)^-1 J+ C, whatever it gives.

Where the model does not explain the figures of a kind of measurement, the stated errors of these
figures, or of the model, are too small. The errors are then multiplied by sqrt(chi² / nu) (R. T.
Birge, Phys. Rev. 40 (1932) 207), and all is fitted again, until chance allows chi² of every kind.
nu is the number of the kind's values less the trace of (R + N)^-1 J C J', which the fit has taken,
and at least 1. Parameters that explain all may still be far from the priors. The least sum above
has as many degrees of freedom as y has values. Where the sum is too large, C is multiplied by their
ratio.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np

from chamberopt.design.calibration import Misfit, Parameter
from chamberopt.peening.probes import Probe, Reading

# Simulated figures as a smooth function of the parameters that a simulation takes.
#
# Notation
#     x     logarithms of these parameters, less the logarithms of the centre, (k,)
#     X     x of all runs, (r, k)
#     f, Y  logarithms of the figures of a run, (n,), and of all runs, (r, n)
#     p(x)  1, x_i, x_i x_j: the terms of a quadratic polynomial, (q,)
#     s     standard deviation of a figure by the noise of one run
#     f(x) = p(x) M Y,  with an error covariance of c(x) times the covariance of one run
#
# Coefficients have priors, narrow for the curvatures alone, so that few runs suffice. A run far
# from the centre counts less, because of cubic terms. So every run serves, and near runs most.

CONSTANT, SLOPE, CURVATURE = 10.0, 3.0, 0.3  # prior standard deviations of coefficients
CUBIC = 0.1  # standard deviation of the coefficient of a cubic term


class Surface(NamedTuple):
    """A quadratic polynomial in k parameters, fitted to the values of a figure in r simulations.

    Its value at a point is a sum of the runs' values, each with a weight that depends on the point.

    Attributes:
        centre: logarithms of the parameters about which the polynomial is expanded, (k,).
        matrix: gives the q coefficients when multiplied by the runs' values, (q, r).
        spread: covariance of the coefficients over the variance of a run's value, (q, q).
    """

    centre: np.ndarray
    matrix: np.ndarray
    spread: np.ndarray

    def weights(self, place: np.ndarray) -> np.ndarray:
        """Return the weights (r,) of the runs' values in the polynomial's value at a point.

        Args:
            place: logarithms of the parameters at the point, (k,).
        """
        return np.asarray(_terms(place - self.centre)[0] @ self.matrix)

    def noise(self, place: np.ndarray) -> float:
        """Return the polynomial's variance at a point over the variance of a single run's value.

        Args:
            place: logarithms of the parameters at the point, (k,).
        """
        terms = _terms(place - self.centre)[0]
        return float(terms @ self.spread @ terms)


def fit_surface(places: np.ndarray, centre: np.ndarray, noise: float) -> Surface:
    """Fit a quadratic polynomial in the parameters to simulation runs, and return it.

    Args:
        places: logarithms of the parameters of each run, (r, k).
        centre: logarithms of the parameters at the centre of the polynomial, (k,).
        noise: standard deviation of a figure by the noise of one run.
    """
    x = places - centre
    terms = _terms(x)
    distance = np.linalg.norm(x, axis=1)
    weight = noise**2 / (noise**2 + (CUBIC * distance**3) ** 2)
    count = x.shape[1]
    prior = np.array([CONSTANT] + [SLOPE] * count + [CURVATURE] * (terms.shape[1] - count - 1))
    spread = np.linalg.inv((terms.T * weight) @ terms + np.diag((noise / prior) ** 2))
    return Surface(centre, spread @ (terms.T * weight), spread)


def _terms(x: np.ndarray) -> np.ndarray:
    """Return the terms (1, x_i, x_i x_j) of a quadratic polynomial at each point x, (r, q)."""
    x = np.atleast_2d(x)
    pairs = combinations_with_replacement(range(x.shape[1]), 2)
    return np.column_stack([np.ones(len(x)), x, *(x[:, i] * x[:, j] for i, j in pairs)])


DIFFERENCE = 1e-4  # difference in theta by which slopes are found
PASSES = 2  # fits, each with the noise of simulations where the fit before it ended
TOGETHER = "measurements and priors"  # the kind of the Misfit of all data
BY_CHANCE = 0.05  # probability of a larger chi² below which errors are multiplied


class Figures(NamedTuple):
    """Logarithms of predicted figures (n,), and their covariance by simulation noise (n, n)."""

    values: np.ndarray
    noise: np.ndarray


class Prior(NamedTuple):
    """What is known of a machine's parameters before measuring: independent, log-normal values.

    Attributes:
        names: names of the parameters, (p,).
        mean: means of their logarithms, (p,).
        sd: standard deviations of their logarithms, (p,).
    """

    names: tuple[Parameter, ...]
    mean: np.ndarray
    sd: np.ndarray

    def values(self, theta: np.ndarray) -> dict[Parameter, float]:
        """Return the logarithms of the parameters, theta (p,), by name of the parameter."""
        return dict(zip(self.names, map(float, theta), strict=True))


Model = Callable[[Mapping[Parameter, float]], Figures]
"""Gives f and N from the logarithms by name."""


class SimulatedModel:
    """A function that predicts the figures of a measurement from simulation runs of its set-up.

    Its argument is the logarithms of all parameters by name. It returns the logarithms of the
    figures and their noise.

    Args:
        probe: reads the figures off the impacts of a run.
        simulated: names of the parameters that differ from run to run.
    """

    def __init__(self, probe: Probe, simulated: Sequence[Parameter]) -> None:
        self._slopes = probe.slopes
        self._simulated = tuple(simulated)
        self._readings: list[Reading] = []
        self._places: list[np.ndarray] = []
        self._surface: Surface | None = None
        self._noise = np.zeros((0, 0))

    def add(self, place: np.ndarray, reading: Reading) -> None:
        """Add a simulation run to the runs from which the figures are predicted.

        Args:
            place: logarithms of the simulated parameters in this run, (k,).
            reading: figures of the run.
        """
        self._places.append(place)
        self._readings.append(reading)

    def centre_at(self, centre: np.ndarray) -> None:
        """Fit the quadratic polynomial that predicts the figures, expanded about a point.

        Args:
            centre: logarithms of the simulated parameters at this point, (k,).
        """
        self._noise = np.mean([one.noise for one in self._readings], axis=0)
        sd = float(np.sqrt(np.diag(self._noise).mean()))
        self._surface = fit_surface(np.array(self._places), centre, max(sd, 1e-6))

    def __call__(self, theta: Mapping[Parameter, float]) -> Figures:
        assert self._surface is not None
        place = np.array([theta[name] for name in self._simulated])
        log_beta = theta.get("beta", 0.0)
        rows = np.array([one.at(log_beta) for one in self._readings])
        values = self._surface.weights(place) @ rows
        exact = [
            sum(slope * theta.get(name, 0.0) for name, slope in slopes.items())
            for slopes in self._slopes
        ]
        return Figures(values + np.array(exact), self._surface.noise(place) * self._noise)


@dataclass(frozen=True)
class Data:
    """Measured figures of one kind, with their errors and the function that predicts them.

    Args:
        kind: kind of measurement in words for messages, such as "arc heights".
        label: what tells these data from other data of this kind, such as the amplitude.
        at: times [s] or other positions of the figures in a picture, (n,).
        y: logarithms of the measured figures, (n,).
        covariance: covariance of the errors of y, (n, n).
        model: function that predicts y from the parameters.
        drawn: further times, and a function that predicts the figures at these times, for a
            picture.
    """

    kind: str
    label: str
    at: np.ndarray
    y: np.ndarray
    covariance: np.ndarray
    model: Model
    drawn: tuple[np.ndarray, Model] | None = None


@dataclass(frozen=True)
class Posterior:
    """What is known of a machine's parameters after measuring: most probable values, covariance."""

    prior: Prior
    mean: np.ndarray  # most probable theta, (p,)
    covariance: np.ndarray  # C, (p, p)
    misfits: tuple[Misfit, ...] = ()

    @property
    def values(self) -> dict[Parameter, float]:
        """Logarithms of the most probable parameters by name."""
        return self.prior.values(self.mean)

    def slopes(self, model: Model) -> np.ndarray:
        """Return the slopes (n, p) of predicted figures by the logarithms of the parameters.

        The slopes hold at the most probable parameters.
        """
        return slopes(model, self.prior, self.mean)

    def sd(self, model: Model, covariance: np.ndarray | None = None) -> np.ndarray:
        """Return the standard deviations (n,) of the logarithms of predicted figures.

        Args:
            covariance: covariance of the logarithms of the parameters, (p, p); by default the
                covariance after measuring.
        """
        rows = self.slopes(model)
        spread = self.covariance if covariance is None else covariance
        return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", rows, spread, rows)))

    def after(self, rows: np.ndarray, errors: np.ndarray) -> np.ndarray:
        """Return the covariance (p, p) of the parameters' logarithms after a further measurement.

        Args:
            rows: slopes of the measured figures by the logarithms of the parameters, (n, p).
            errors: covariance of the errors of the measured figures, (n, n).
        """
        gain = self.covariance @ rows.T @ np.linalg.inv(rows @ self.covariance @ rows.T + errors)
        return np.asarray(self.covariance - gain @ rows @ self.covariance)


def slopes(model: Model, prior: Prior, theta: np.ndarray) -> np.ndarray:
    """Return the slopes (n, p) of predicted figures by the logarithms of the parameters.

    Args:
        theta: logarithms of the parameters where the slopes hold, (p,).
    """
    columns = []
    for k in range(len(theta)):
        step = np.zeros(len(theta))
        step[k] = DIFFERENCE
        up, down = (model(prior.values(theta + sign * step)).values for sign in (1.0, -1.0))
        columns.append((up - down) / (2.0 * DIFFERENCE))
    return np.array(columns).T


def find_posterior(
    data: Sequence[Data],
    prior: Prior,
    start: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    scales: Mapping[str, float] | None = None,
) -> Posterior:
    """Find the most probable parameters, their covariance, and how well each kind of data fits.

    Args:
        start: logarithms of the parameters where the search begins, (p,).
        bounds: least and largest logarithms that the parameters may have, (p,) each.
        scales: factor on the errors of each kind of data; None: 1 for all.
    """
    from scipy.linalg import block_diag, solve_triangular
    from scipy.optimize import least_squares

    y = np.concatenate([one.y for one in data])
    theta = np.clip(start, *bounds)
    scales = scales or dict.fromkeys((one.kind for one in data), 1.0)
    for _ in range(PASSES):
        values = prior.values(theta)
        errors = block_diag(
            *(scales[one.kind] ** 2 * (one.covariance + one.model(values).noise) for one in data)
        )
        whiten = np.linalg.cholesky(errors)

        def residuals(x: np.ndarray, whiten: np.ndarray = whiten) -> np.ndarray:
            values = prior.values(x)
            f = np.concatenate([one.model(values).values for one in data])
            of_data = solve_triangular(whiten, y - f, lower=True)
            return np.concatenate([of_data, (x - prior.mean) / prior.sd])

        theta = least_squares(residuals, theta, bounds=bounds, x_scale=prior.sd).x
    rows = np.concatenate([slopes(one.model, prior, theta) for one in data])
    information = rows.T @ np.linalg.solve(errors, rows) + np.diag(prior.sd**-2.0)
    covariance = np.linalg.inv(information)
    found = Posterior(prior, theta, 0.5 * (covariance + covariance.T))
    return replace(found, misfits=_misfits(data, found, scales))


def explaining_posterior(
    data: Sequence[Data], prior: Prior, start: np.ndarray, bounds: tuple[np.ndarray, np.ndarray]
) -> Posterior:
    """Find the most probable parameters, with errors so large that the model explains all data.

    The errors of each kind of data, and then the covariance of the parameters, are enlarged until
    chance allows the misfit. `find_posterior` has the same arguments.
    """
    from scipy.special import chdtrc

    found = find_posterior(data, prior, start, bounds)
    scales = dict.fromkeys((one.kind for one in data), 1.0)
    while (wanted := {one.kind: one.error_scale for one in found.misfits}) != scales:
        scales = wanted
        found = find_posterior(data, prior, found.mean, bounds, scales)
    chi2 = float((((found.mean - prior.mean) / prior.sd) ** 2).sum())
    chi2 += sum(one.chi2 / one.error_scale**2 for one in found.misfits)
    values = sum(one.values for one in found.misfits)
    scale = math.sqrt(chi2 / values) if chdtrc(values, chi2) < BY_CHANCE else 1.0
    all_of_it = Misfit(kind=TOGETHER, chi2=chi2, values=values, error_scale=scale)
    return replace(
        found, covariance=scale**2 * found.covariance, misfits=(*found.misfits, all_of_it)
    )


def _misfits(
    data: Sequence[Data], found: Posterior, scales: Mapping[str, float]
) -> tuple[Misfit, ...]:
    """Return how far each kind of data is from the model, and by which factor its errors must grow.

    Args:
        scales: factor by which the errors of each kind of data are multiplied already.
    """
    from scipy.special import chdtrc

    misfits = []
    for kind, scale in scales.items():
        chi2, freedom, count = 0.0, 0.0, 0
        for one in (some for some in data if some.kind == kind):
            f, rows = one.model(found.values), found.slopes(one.model)
            left, errors = one.y - f.values, one.covariance + f.noise
            chi2 += float(left @ np.linalg.solve(errors, left))
            taken = np.linalg.solve(scale**2 * errors, rows @ found.covariance @ rows.T)
            freedom += len(left) - float(np.trace(taken))
            count += len(left)
        freedom = max(freedom, 1.0)
        if chdtrc(freedom, chi2 / scale**2) < BY_CHANCE:
            scale = math.sqrt(chi2 / freedom)
        misfits.append(Misfit(kind=kind, chi2=chi2, values=count, error_scale=scale))
    return tuple(misfits)

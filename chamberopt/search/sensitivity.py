"""Compute how the score depends on each parameter near the best design, by the search's model.

The model gives the main effect of a parameter (the mean score over all values of the other
parameters), slices (the score with the other parameters as in the best design), and the range in
which each parameter may change without loss.

A range counts what the model does not know. The mean alone would promise too much: of its ranges
56 % kept what they promise, of those here 96 % (benchmarks/flat_ranges.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from chamberopt.common.estimate import Estimate
from chamberopt.design.design import SHAPE
from chamberopt.search.optimiser.gaussian_process import GaussianProcess, one_thread
from chamberopt.search.optimiser.search_model import SearchModel
from chamberopt.search.study.parameters import NONE, ParameterSpace

NORMAL_95 = 1.96  # standard deviations of a 95 % interval
SLICE_POINTS = 41
SAMPLE_EXPONENT = 9  # main effects are means over 2^9 points of the other parameters
RANGE_POINTS = 201


@dataclass(frozen=True)
class Slice:
    """The score that the model predicts at k values of one parameter; arrays have the shape (k,).

    If the parameter is a choice of texts, the arrays have an entry for each text.
    """

    name: str
    values: np.ndarray  # of the parameter in the unit of the file; positions of texts
    mean: np.ndarray  # score with the other parameters as in the best design
    half_width: np.ndarray  # half-width of its 95 % interval
    or_worse: np.ndarray  # bool, where the model has no more than an upper limit
    effect: np.ndarray  # score averaged over all values of the other parameters
    share: float  # of this effect in the variance of the score over the bounds
    # Values for which the best design, with this parameter alone changed, loses no more than noise,
    # with 95 % confidence: from, to; or all of these texts.
    flat: tuple[float | str, ...]
    texts: tuple[str, ...] = ()  # that it may be

    def scaled(self, factor: float) -> Slice:
        """The same of the score times a factor, such as -1 for what is the better the smaller."""
        return replace(
            self,
            mean=factor * self.mean,
            half_width=abs(factor) * self.half_width,
            effect=factor * self.effect,
        )


@dataclass(frozen=True)
class Sensitivity:
    """How the score depends on each parameter near the best design: a slice for each parameter."""

    slices: tuple[Slice, ...]
    noise: float  # loss that counts as none
    expected: Estimate  # the model's score of the best design
    together: float  # share of the designs within all flat ranges that lose no more than the noise


def analyse_sensitivity(
    search: SearchModel, space: ParameterSpace, best: Mapping[str, float | str], noise: float
) -> Sensitivity:
    """Work out how the score depends on each parameter near the best design, by the model.

    The ranges without loss end where the limits are probably not met.

    Args:
        search: model of the score by the trials of the search.
        best: values of the best design by parameter, in the units of the file.
        noise: loss of score that counts as no loss. It is raised to the least loss that the model
            can tell.
    """
    from scipy.stats.qmc import Sobol

    model, at = search.score, space.point_of(best)
    sample = Sobol(len(at), seed=1).random_base2(SAMPLE_EXPONENT)
    slices, within = [], np.empty_like(sample)
    with one_thread():
        top, deviation_at_top = (float(one[0]) for one in model(at[None]))
        noise = max(noise, NORMAL_95 * deviation_at_top)  # less, the model cannot tell
        whole_variance = float(model(sample)[0].var())
        for i, name in enumerate(space.names):
            if best[name] == NONE:
                continue
            texts = space.varied[i].texts
            steps = np.linspace(0.0, 1.0, len(texts) or SLICE_POINTS)
            # The ends of numbers stand for half a step each; with whole ones, effects would have a
            # larger variance than all parameters together.
            inside = (steps > 0.0) & (steps < 1.0)
            weights = np.where(inside | bool(texts), 1.0, 0.5)
            line = np.repeat(at[None], len(steps), axis=0)
            line[:, i] = steps
            if name == SHAPE:
                line = _with_best_of_its_own(search, line, at, sample)
            mean, deviation = model(line)
            effect = _main_effect(model, sample, i, steps)
            main = float(np.cov(effect, ddof=0, aweights=weights))
            share = main / whole_variance if whole_variance > 0.0 else 0.0
            values, width = space.values_on(i, steps), NORMAL_95 * deviation
            if texts:
                good = steps[_loses_little(search, at, line, noise)]
                within[:, i] = good[np.floor(sample[:, i] * len(good)).astype(int)]
                flat = tuple(texts[round(place)] for place in space.values_on(i, good))
            else:
                begin, end = flat_range(search, at, i, noise)
                within[:, i] = begin + sample[:, i] * (end - begin)
                flat = tuple(space.values_on(i, np.array([begin, end])).tolist())
            worse = mean - width < search.floor
            slices.append(
                Slice(name, values, mean, width, worse, effect, min(1.0, share), flat, texts)
            )
        within = space.domain.snap(within)
        together = float((model(within)[0] >= top - noise).mean())
    expected = Estimate(top, NORMAL_95 * deviation_at_top)
    return Sensitivity(tuple(slices), noise, expected, together)


def is_supported(search: SearchModel, one: Slice) -> np.ndarray:
    """Return where evaluations support the model's curve of a slice, (k,) bool.

    There they explain at least three quarters of the variance that the score has from place to
    place, and the model has more than an upper limit.
    """
    variance = (one.half_width / NORMAL_95) ** 2
    supported: np.ndarray = (variance <= 0.25 * search.score.signal) & ~one.or_worse
    return supported


def _with_best_of_its_own(
    search: SearchModel, line: np.ndarray, at: np.ndarray, sample: np.ndarray
) -> np.ndarray:
    """Return points (k, d), one for each chamber shape, with the best values for this shape.

    A parameter that the best design has keeps the value of the best design. Parameters that only
    this shape has get the values with the best score by the model.

    Args:
        line: points that differ in their shape alone, (k, d).
        at: point of the best design, (d,).
        sample: points among which the best values are looked for, (n, d).
    """
    domain, found = search.domain, []
    own = domain.has(domain.snap(at[None]))[0]
    for point in line:
        tried = domain.snap(np.where(own, point, sample))
        found.append(tried[int(np.argmax(search.score(tried)[0]))])
    return np.array(found)


def _main_effect(
    model: GaussianProcess, sample: np.ndarray, i: int, steps: np.ndarray
) -> np.ndarray:
    """Return the mean score at each value of parameter i, over all values of the other parameters.

    Args:
        sample: points with evenly spread values of the other parameters, (n, d).
        i: position of the parameter.
        steps: values of the parameter, as shares of its bounds.
    """
    moved, means = sample.copy(), []
    for step in steps:
        moved[:, i] = step
        means.append(float(model(moved)[0].mean()))
    return np.array(means)


def flat_range(search: SearchModel, at: np.ndarray, i: int, noise: float) -> tuple[float, float]:
    """Return the lowest and highest value of parameter i without loss, as shares of its bounds.

    Args:
        at: point of the best design, (d,).
        i: position of the parameter.
        noise: loss of score that counts as no loss.
    """
    ends = []
    for bound in (0.0, 1.0):
        line = np.repeat(at[None], RANGE_POINTS, axis=0)
        line[:, i] = np.linspace(at[i], bound, RANGE_POINTS)
        line = search.domain.snap(line)
        worse = np.flatnonzero(~_loses_little(search, at, line, noise))
        ends.append(float(line[max(0, worse[0] - 1) if len(worse) else -1, i]))
    return ends[0], ends[1]


def _loses_little(
    search: SearchModel, at: np.ndarray, points: np.ndarray, noise: float
) -> np.ndarray:
    """Return at which points (k, d) the score is surely no lower than at the best, but for noise.

    Surely means that the upper end of the loss's 95 % interval is no larger than the noise. The
    limits are probably met there.

    Args:
        at: point of the best design, (d,).
        noise: loss of score that counts as no loss.
    """
    model, best = search.score, at[None]
    (mean, deviation), (top, of_top) = model(points), model(best)
    variance = deviation**2 + of_top**2 - 2.0 * model.covariance(points, best)[:, 0]
    most = top - mean + NORMAL_95 * np.sqrt(np.maximum(variance, 0.0))
    # A point beside the best differs from it by rounding alone.
    good: np.ndarray = (most <= noise * (1.0 + 1e-9)) & (search.feasible(points) >= 0.5)
    return good

"""Fit the models of a search to its trials: to their scores, and to figures with limits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.estimate import (
    CONFIDENCE,
    NOT_RESOLVED,
    Estimate,
    normal_quantile,
    student_quantile,
)
from chamberopt.search.optimiser.gaussian_process import moderate_variances
from chamberopt.search.optimiser.scalarisation import scalarise
from chamberopt.search.optimiser.search_model import (
    POINTS_PER_PARAMETER,
    LimitedFigure,
    Observations,
    SearchModel,
)
from chamberopt.search.study.constraints import Limits, exact

if TYPE_CHECKING:
    from chamberopt.search.optimiser.domain import Domain
    from chamberopt.search.trial_log import Trial

# A figure counts as at most so many times as far outside its limit as the median candidate is away
# from it.
MAX_OUTSIDE = 3.0
# Share of the target that a candidate may reach less than the best one, for a smooth model.
LOST = 0.05
FIRST_OBJECTIVE = np.array([1.0, 0.0])  # weights of two objectives


def observe(
    trials: Sequence[Trial], constraints: Mapping[str, Limits], weight: np.ndarray
) -> Observations:
    """Return what the models of a search learn from its trials: scores, and figures with limits.

    Args:
        weight: weights of two objectives in the score, (2,); not used if there is one objective.
    """
    simulated, cut_off = np.array([bool(trial.goals) for trial in trials]), _cut_off(trials)
    spared = cut_off | np.array([trial.highest is not None for trial in trials])
    some = next(trial.goals for trial in trials if trial.goals)
    rows = [trial.goals or some for trial in trials]
    values = np.array([[goal.value for goal in goals] for goals in rows])
    variances = np.array([_variances([goals[k] for goals in rows]) for k in range(len(some))]).T
    score, variance = values[:, 0], variances[:, 0]
    if len(some) > 1 and weight is not FIRST_OBJECTIVE:
        score, variance = scalarise(values, variances, weight, simulated)
    score = np.where(spared, [trial.score for trial in trials], score)
    # A limited number of the design that does not vary is the same in all trials, and not in them.
    known = next(trial.metrics.keys() | trial.parameters.keys() for trial in trials if trial.goals)
    limited = ((name, limits) for name, limits in constraints.items() if name in known)
    figures = (_limited_figure(name, limits, trials) for name, limits in limited)
    simulated &= ~cut_off
    by_geometry = all(trial.refused or trial.goals for trial in trials)
    return Observations(score, variance, simulated, tuple(figures), spared, by_geometry=by_geometry)


def _cut_off(trials: Sequence[Trial]) -> np.ndarray:
    """Return which candidates miss so much of the target that the best one reaches, (n,) bool.

    Their scores fall by a step, where a ceiling cuts off the part or balls no longer get above it.
    A smooth model would take the step for the effect of another parameter, such as the mass of the
    shot. None is left out where fewer points than a plane takes would be left.
    """
    reach = np.array([np.nan if one.reachable is None else one.reachable for one in trials])
    known: np.ndarray = np.isfinite(reach)
    if not known.any():
        return known
    best = np.argmax(np.where(known, [one.score for one in trials], -np.inf))
    found = np.asarray(reach < reach[best] - LOST)
    left = (known & ~found).sum()
    return found if left > len(trials[0].point) else np.zeros_like(found)


def fit_model(
    domain: Domain,
    trials: Sequence[Trial],
    constraints: Mapping[str, Limits],
    weight: np.ndarray = FIRST_OBJECTIVE,
    learns_bounds: bool = False,
) -> SearchModel | None:
    """Return a model of the score, fitted to the trials of a search.

    Return None if the points are too few, or if all their scores are equal.

    Args:
        domain: which values each parameter can have.
        weight: weights of two objectives in the score, (2,).
        learns_bounds: whether the model also learns the largest possible score of candidates that
            were not simulated.
    """
    if not any(trial.goals for trial in trials):
        return None
    seen, points = observe(trials, constraints, weight), np.array([one.point for one in trials])
    scores = seen.scores[seen.simulated]
    if len(scores) < POINTS_PER_PARAMETER * points.shape[1] or np.ptp(scores) == 0.0:
        return None
    return SearchModel(domain, points, seen, learns_bounds=learns_bounds)


def _limited_figure(name: str, limits: Limits, trials: Sequence[Trial]) -> LimitedFigure:
    """Return the values of a figure with limits in all trials, as a model learns them.

    A value from too few dents gets so large an error that it tells next to nothing. A value far
    outside the limits, such as a time that stands for never, is moved nearer to its limit. How far
    outside it is decides nothing, and would bend the model.
    """
    figures = [(trial.metrics | exact(trial.parameters)).get(name) for trial in trials]
    known = np.array([one.value if one else np.nan for one in figures])
    errors = np.array([_error(one, trial) for one, trial in zip(figures, trials, strict=True)])
    unresolved = np.array([one is not None and one.in_words == NOT_RESOLVED for one in figures])
    low = -np.inf if limits.min is None else limits.min
    high = np.inf if limits.max is None else limits.max
    outside = np.maximum(np.maximum(low - known, known - high), 0.0)
    inside = float(np.nanmedian(np.minimum(np.abs(known - low), np.abs(known - high))))
    far = MAX_OUTSIDE * (inside or 1.0)
    values = np.clip(known, low - far, high + far)
    usual = errors[np.isfinite(errors) & (outside < far)]
    errors = np.where(np.isfinite(errors), errors, usual.max() if len(usual) else 0.0)
    errors = np.where(unresolved, far, np.minimum(errors, far))
    return LimitedFigure(np.nan_to_num(values), errors**2, low, high)


def _error(figure: Estimate | None, trial: Trial) -> float:
    """Return the standard error of a figure, from its half-width; NaN if it has no half-width."""
    if figure is None or not math.isfinite(figure.half_width):
        return math.nan
    if trial.replicas is None:  # measured, or not varied by chance
        return figure.half_width / normal_quantile(CONFIDENCE)
    return figure.half_width / student_quantile(max(1, trial.replicas - 1))


def _variances(goals: list[Estimate]) -> np.ndarray:
    """Return the squared standard errors (n,) of one objective of n candidates.

    They come from the scatter of each candidate's replicas, and are drawn towards the errors of all
    candidates. If the objective was measured, they come from the half-width of its interval.
    """
    samples = [goal.pseudovalues for goal in goals]
    spreads = [float(np.var(one, ddof=1)) if len(one) > 1 else np.nan for one in samples]
    counts = np.array([max(1, len(one)) for one in samples])
    told = np.array([np.nan if goal.pseudovalues else goal.half_width for goal in goals])
    variances = moderate_variances(np.array(spreads), counts)
    return np.where(np.isfinite(told), (told / normal_quantile(CONFIDENCE)) ** 2, variances)

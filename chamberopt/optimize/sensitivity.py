"""How the score depends on each parameter near the best design, by the model of the search.

The model gives main effects (means over the other parameters), slices through the best design,
and the range in which each parameter may change without loss.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from chamberopt.common.estimate import Estimate
from chamberopt.optimize.search.gaussian_process import GaussianProcess, one_thread

NORMAL_95 = 1.96  # standard deviations of a 95 % interval
SLICE_POINTS = 41
SAMPLE_EXPONENT = 9  # main effects are means over 2^9 points of the other parameters
RANGE_POINTS = 201


@dataclass(frozen=True)
class Slice:
    """The score over one parameter, by the model; arrays have the shape (k,)."""

    name: str
    values: np.ndarray  # of the parameter in the unit of the file
    mean: np.ndarray  # score with the other parameters as in the best design
    half_width: np.ndarray  # half-width of its 95 % interval
    effect: np.ndarray  # score averaged over all values of the other parameters
    share: float  # of this effect in the variance of the score over the bounds
    # Values for which the best design, with this parameter alone changed, loses no more than noise.
    flat: tuple[float, float]


@dataclass(frozen=True)
class Sensitivity:
    """One slice for each parameter."""

    slices: tuple[Slice, ...]
    noise: float  # loss that counts as none
    expected: Estimate  # the model's score of the best design
    together: float  # share of the designs within all flat ranges that lose no more than the noise

    def sentences(self) -> list[str]:
        """What a designer may change: one sentence for each parameter, and one for all."""
        loss = f"without losing more than the noise, {self.noise:.2g}"
        flat = ((one.name, *one.flat) for one in self.slices)
        ranges = [f"{name} may go from {low:.4g} to {high:.4g} {loss}" for name, low, high in flat]
        share = f"{self.together:.0%}"
        return [*ranges, f"of all designs within these ranges {share} lose no more than that"]

    def as_json(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "noise": self.noise,
            "expected": self.expected.interval_json(),
            "together": self.together,
            "parameters": {
                one.name: {
                    "flat": list(one.flat),
                    "share_of_variance": one.share,
                    "values": one.values.tolist(),
                    "mean": one.mean.tolist(),
                    "half_width": one.half_width.tolist(),
                    "main_effect": one.effect.tolist(),
                }
                for one in self.slices
            },
        }


def analyse_sensitivity(
    model: GaussianProcess,
    vary: Mapping[str, tuple[float, float]],
    best: Mapping[str, float],
    noise: float,
) -> Sensitivity:
    """Sensitivity of the model's score near the best design.

    Bounds (low, high) and best values are in the units of the file; a loss below `noise` is none.
    """
    from scipy.stats.qmc import Sobol

    low, high = np.array(list(vary.values()), dtype=float).T
    at = (np.array([best[name] for name in vary]) - low) / (high - low)
    sample = Sobol(len(at), seed=1).random_base2(SAMPLE_EXPONENT)
    steps = np.linspace(0.0, 1.0, SLICE_POINTS)
    slices, ranges = [], []
    with one_thread():
        top, deviation_at_top = (float(one[0]) for one in model(at[None]))
        whole_variance = float(model(sample)[0].var())
        for i, name in enumerate(vary):
            line = np.repeat(at[None], SLICE_POINTS, axis=0)
            line[:, i] = steps
            mean, deviation = model(line)
            effect = _main_effect(model, sample, i, steps)
            share = float(effect.var()) / whole_variance if whole_variance > 0.0 else 0.0
            ranges.append(_flat_range(model, at, i, top - noise))
            values, flat = (low[i] + np.array(k) * (high[i] - low[i]) for k in (steps, ranges[-1]))
            width = NORMAL_95 * deviation
            ends_of_flat = tuple(flat.tolist())
            slices.append(Slice(name, values, mean, width, effect, min(1.0, share), ends_of_flat))
        begin, end = np.array(ranges).T
        within = begin + sample * (end - begin)
        together = float((model(within)[0] >= top - noise).mean())
    expected = Estimate(top, NORMAL_95 * deviation_at_top)
    return Sensitivity(tuple(slices), noise, expected, together)


def _main_effect(
    model: GaussianProcess, sample: np.ndarray, i: int, steps: np.ndarray
) -> np.ndarray:
    """Mean score over the other parameters at each step of parameter i."""
    moved, means = sample.copy(), []
    for step in steps:
        moved[:, i] = step
        means.append(float(model(moved)[0].mean()))
    return np.array(means)


def _flat_range(
    model: GaussianProcess, at: np.ndarray, i: int, threshold: float
) -> tuple[float, float]:
    """How far parameter i may go down and up, in shares of the bounds, above the threshold."""
    ends = []
    for bound in (0.0, 1.0):
        line = np.repeat(at[None], RANGE_POINTS, axis=0)
        line[:, i] = np.linspace(at[i], bound, RANGE_POINTS)
        below = np.flatnonzero(model(line)[0] < threshold)
        ends.append(float(line[max(0, below[0] - 1) if len(below) else -1, i]))
    return ends[0], ends[1]

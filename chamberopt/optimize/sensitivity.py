"""What a whole search tells of its best design: main effects, slices through it, and which way it is flat."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from chamberopt.coverage.statistics.confidence_interval import Estimate
from chamberopt.optimize.search.gaussian_process import GaussianProcess, one_thread

NORMAL = 1.96  # standard deviations of a 95 % interval
STEPS = 41  # of a slice
SAMPLE = 9  # main effects are means over 2^SAMPLE points of the other parameters


@dataclass(frozen=True)
class Slice:
    """The score over one parameter, in the file's units, as the model has it.

    values (k,) of the parameter · mean (k,), half_width (k,): with the others as in the best design, 95 % · effect
    (k,): mean over all values of the others · share: of the score's variance over the bounds that this effect is ·
    flat: from where to where the best design may go, this parameter alone, without losing more than the noise.
    """

    name: str
    values: np.ndarray
    mean: np.ndarray
    half_width: np.ndarray
    effect: np.ndarray
    share: float
    flat: tuple[float, float]


@dataclass(frozen=True)
class Sensitivity:
    """One slice a parameter; noise: what counts as no loss · expected: the model's own score of the best design ·
    together: share of the designs with every parameter within its flat range that lose no more than the noise.
    """

    slices: tuple[Slice, ...]
    noise: float
    expected: Estimate
    together: float

    def sentences(self) -> list[str]:
        """What a designer may change, one sentence a parameter."""
        said = [
            f"{one.name} may go from {one.flat[0]:.4g} to {one.flat[1]:.4g} without losing more than the noise, "
            f"{self.noise:.2g}"
            for one in self.slices
        ]
        return [
            *said,
            f"of all designs within these ranges {self.together:.0%} lose no more than that",
        ]

    def as_json(self) -> dict[str, Any]:
        """As plain JSON values."""
        return {
            "noise": self.noise,
            "expected": {"value": self.expected.value, "half_width": self.expected.half_width},
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
    model: GaussianProcess | None,
    vary: Mapping[str, tuple[float, float]],
    best: Mapping[str, float],
    noise: float,
) -> Sensitivity | None:
    """What the model says about a best design, by dotted name in the file's units; None without a model."""
    from scipy.stats.qmc import Sobol

    if model is None:
        return None
    low, high = np.array(list(vary.values()), dtype=float).T
    at = (np.array([best[name] for name in vary]) - low) / (high - low)
    cloud = Sobol(len(at), seed=1).random_base2(SAMPLE)
    steps = np.linspace(0.0, 1.0, STEPS)
    slices, ranges = [], []
    with one_thread():
        top, doubt = (float(one[0]) for one in model(at[None]))
        whole = float(model(cloud)[0].var())
        for i, name in enumerate(vary):
            line = np.repeat(at[None], STEPS, axis=0)
            line[:, i] = steps
            mean, deviation = model(line)
            effect = _main_effect(model, cloud, i, steps)
            ranges.append(_flat(model, at, i, top - noise))
            slices.append(
                Slice(
                    name=name,
                    values=low[i] + steps * (high[i] - low[i]),
                    mean=mean,
                    half_width=NORMAL * deviation,
                    effect=effect,
                    share=min(1.0, float(effect.var()) / whole) if whole > 0.0 else 0.0,
                    flat=tuple((low[i] + np.array(ranges[-1]) * (high[i] - low[i])).tolist()),
                )
            )
        ends = np.array(ranges)
        within = ends[:, 0] + cloud * (ends[:, 1] - ends[:, 0])
        together = float((model(within)[0] >= top - noise).mean())
    return Sensitivity(tuple(slices), noise, Estimate(top, NORMAL * doubt), together)


def _main_effect(
    model: GaussianProcess, cloud: np.ndarray, i: int, steps: np.ndarray
) -> np.ndarray:
    """Mean score over the other parameters at each step of parameter i."""
    means = []
    for step in steps:
        moved = cloud.copy()
        moved[:, i] = step
        means.append(float(model(moved)[0].mean()))
    return np.array(means)


def _flat(model: GaussianProcess, at: np.ndarray, i: int, least: float) -> tuple[float, float]:
    """How far parameter i may move down and up, in shares of the bounds, with the model's mean at `least` or above."""
    ends = []
    for bound in (0.0, 1.0):
        line = np.repeat(at[None], 201, axis=0)
        line[:, i] = np.linspace(at[i], bound, 201)
        bad = np.flatnonzero(model(line)[0] < least)
        ends.append(float(line[max(0, bad[0] - 1) if len(bad) else -1, i]))
    return ends[0], ends[1]

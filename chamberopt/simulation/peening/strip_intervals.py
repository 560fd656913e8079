"""Figures of a virtual strip with their intervals.

Each figure comes from all replicas, from all but each (jackknife), and from halves of them: h of a
cell with few dents is too small, the step from halves to all shows by how much, it is made once
more, and the interval includes it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.common.estimate import Estimate, estimate, jackknife
from chamberopt.simulation.peening.strip import StripCurve, StripDents, strip_curve

if TYPE_CHECKING:
    from collections.abc import Iterable

SPLITS = 3  # into halves
MULTIPLES = 0.25, 0.5, 1.0, 2.0, 4.0  # of T: the times at which a shop measures


class StripSaturation(NamedTuple):
    """S [m] and T [s] of a virtual strip."""

    strength: Estimate
    time: Estimate


def strip_saturation(dents: StripDents) -> StripSaturation:
    """S and T of the curve, its largest root of h(2 T) = 1.1 h(T)."""

    def saturated(curve: StripCurve) -> np.ndarray:
        time = curve.saturation_time()
        return np.array([float(curve.at(time)), time])

    return StripSaturation(*corrected(dents, saturated))


def heights(dents: StripDents, times: Iterable[float]) -> list[Estimate]:
    """h [m] after each of these times [s]."""
    when = np.array(list(times))
    return corrected(dents, lambda curve: curve.at(when))


def corrected(dents: StripDents, figures: Callable[[StripCurve], np.ndarray]) -> list[Estimate]:
    """Estimates of some figures.

    Args:
        figures: function of a curve that gives them, (n,).
    """
    count = len(dents.parts)
    whole = figures(strip_curve(dents))
    if count < 2:
        return [estimate([value]) for value in whole]
    rests = ~np.eye(count, dtype=bool)
    without = np.array([figures(strip_curve(dents, one)) for one in rests])
    size, rng = count // 2, np.random.default_rng(0)
    of_halves = [
        figures(strip_curve(dents, order[start : start + size]))
        for order in (rng.permutation(count) for _ in range(SPLITS))
        for start in (0, size)
    ]
    # What is left of a bias that falls as one over the number of replicas.
    step = (whole - np.mean(of_halves, axis=0)) * size / (count - size)
    return [
        estimate(_moved(whole[k], without[:, k], step[k]), 0.0, bias=abs(float(step[k])))
        for k in range(len(whole))
    ]


def _moved(value: float, without: np.ndarray, step: float) -> Sequence[float]:
    return [float(one) for one in jackknife(np.array([value, *without])) + step]

"""Fit saturation curves to measured arc heights, as peening shops do.

Notation
    h  arc height after the peening time t
    two parameters    h = a (1 - exp(-b t))
    three parameters  h = a (1 - exp(-b t^c))
    T  saturation time, h(2 T) = 1.1 h(T)

Source: D. Kirk, "Almen saturation curve solver program", The Shot Peener, 2005.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.common.estimate import Estimate, estimate, jackknife
from chamberopt.coverage.strength import SATURATED
from chamberopt.peening.strip import StripCurve, StripDents, strip_curve

if TYPE_CHECKING:
    from collections.abc import Iterable


@dataclass(frozen=True)
class KirkFit:
    """A saturation curve fitted to arc heights, a (1 - exp(-b t^c)).

    The curve with two parameters has c = 1.
    """

    a: float
    b: float  # [1/s^c]
    c: float = 1.0

    def at(self, times: np.ndarray | float) -> np.ndarray:
        """Return the arc height after each of these peening times [s]."""
        return np.asarray(-self.a * np.expm1(-self.b * np.asarray(times) ** self.c))

    @property
    def saturation_time(self) -> float:
        """Saturation time T of the curve [s]: twice this time gives a tenth more arc height."""
        from scipy.optimize import brentq

        # x = b T^c is the only root above 0 of h(2 T) - 1.1 h(T).
        power = 2.0**self.c
        x = brentq(lambda u: SATURATED * math.expm1(-u) - math.expm1(-power * u), 1e-9, 50.0)
        return float((x / self.b) ** (1.0 / self.c))

    @property
    def intensity(self) -> float:
        """Arc height at the saturation time, in the unit of the fitted heights."""
        return float(self.at(self.saturation_time))


MIN_C, MAX_C = 0.2, 5.0  # h(2 T) = 1.1 h(T) has no root below c = 0.14


def kirk_fits(times: np.ndarray, heights: np.ndarray) -> tuple[KirkFit, KirkFit]:
    """Fit curves with two and with three parameters to arc heights, and return both.

    Args:
        times: peening times [s], (n,) with n >= 4, ascending.
        heights: arc heights after these times, in any unit, above 0, (n,).
    """
    from scipy.optimize import curve_fit

    # In units of the middle time and the last height all parameters are about 1.
    t0, h0 = float(times[len(times) // 2]), float(heights[-1])
    t, h = np.asarray(times) / t0, np.asarray(heights) / h0

    def curve(t: np.ndarray, a: float, b: float, c: float = 1.0) -> np.ndarray:
        return np.asarray(-a * np.expm1(-b * t**c))

    low, high = [0.0, 0.0], [np.inf, np.inf]
    two, _ = curve_fit(curve, t, h, [1.0, 2.0], bounds=(low, high))
    three, _ = curve_fit(curve, t, h, [*two, 1.0], bounds=([*low, MIN_C], [*high, MAX_C]))

    def in_units(a: float, b: float, c: float = 1.0) -> KirkFit:
        return KirkFit(float(a) * h0, float(b) / t0**c, float(c))

    return in_units(*two), in_units(*three)


# Figures of a virtual strip with their intervals.
#
# Each figure comes from all replicas, from all but each (jackknife), and from halves of them. h of
# a cell with few dents is too small, and the step of a figure from halves to all replicas shows by
# how much. So this step is added to the figure once more, and the interval includes the step.

SPLITS = 3  # splits of the replicas into halves
MULTIPLES = 0.25, 0.5, 1.0, 2.0, 4.0  # times at which a shop measures, in units of T


class StripSaturation(NamedTuple):
    """Arc strength [m] of a virtual strip at its saturation time, and this time [s]."""

    strength: Estimate
    time: Estimate


def strip_saturation(dents: StripDents) -> StripSaturation:
    """Return the saturation time T of a strip, and its arc strength at this time, with intervals.

    T is the longest time after which twice the time gives exactly a tenth more arc strength.
    """

    def saturated(curve: StripCurve) -> np.ndarray:
        time = curve.saturation_time()
        return np.array([float(curve.at(time)), time])

    return StripSaturation(*corrected(dents, saturated))


def heights(dents: StripDents, times: Iterable[float]) -> list[Estimate]:
    """Return the arc strength [m] of a strip after each of these times [s], with intervals."""
    when = np.array(list(times))
    return corrected(dents, lambda curve: curve.at(when))


def corrected(dents: StripDents, figures: Callable[[StripCurve], np.ndarray]) -> list[Estimate]:
    """Return figures of a strip with intervals, corrected for the few dents in each of its cells.

    Args:
        figures: function that works out the figures (n,) from a saturation curve.
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
    # The bias that is left, if it falls as one over the number of replicas.
    step = (whole - np.mean(of_halves, axis=0)) * size / (count - size)
    return [
        estimate(_moved(whole[k], without[:, k], step[k]), 0.0, bias=abs(float(step[k])))
        for k in range(len(whole))
    ]


def _moved(value: float, without: np.ndarray, step: float) -> Sequence[float]:
    return [float(one) for one in jackknife(np.array([value, *without])) + step]

"""The fits that a shop puts through measured arc heights.

Notation
    h  arc height after the peening time t
    two parameters    h = a (1 - exp(-b t))
    three parameters  h = a (1 - exp(-b t^c))
    T  saturation time, h(2 T) = 1.1 h(T)

Source: D. Kirk, "Almen saturation curve solver program", The Shot Peener, 2005.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from chamberopt.coverage.strength import SATURATED


@dataclass(frozen=True)
class KirkFit:
    """A fitted curve; c is 1 in that of two parameters."""

    a: float
    b: float  # [1/s^c]
    c: float = 1.0

    def at(self, times: np.ndarray | float) -> np.ndarray:
        """h after these times [s]."""
        return np.asarray(-self.a * np.expm1(-self.b * np.asarray(times) ** self.c))

    @property
    def saturation_time(self) -> float:
        """T [s]."""
        from scipy.optimize import brentq

        # x = b T^c is the only root above 0 of what twice the time gives beyond a tenth more.
        power = 2.0**self.c
        x = brentq(lambda u: SATURATED * math.expm1(-u) - math.expm1(-power * u), 1e-9, 50.0)
        return float((x / self.b) ** (1.0 / self.c))

    @property
    def intensity(self) -> float:
        """h(T), in the unit of the heights."""
        return float(self.at(self.saturation_time))


MIN_C, MAX_C = 0.2, 5.0  # h(2 T) = 1.1 h(T) has no root below c = 0.14


def kirk_fits(times: np.ndarray, heights: np.ndarray) -> tuple[KirkFit, KirkFit]:
    """The fits of two and of three parameters.

    Args:
        times: [s], (n,) with n >= 4, ascending.
        heights: in any unit, above 0, (n,).
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

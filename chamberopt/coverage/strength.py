"""Peening strength at a point of the part: the reading of an Almen strip there.

Notation
    window  disc of the surface round a point of the target, in which dents are counted
    d, D    diameters of a dent on the strip and of its ball [m]
    s       strength of one impact, d² / D: eight times dent volume over dent area [m]
    L(s)    rate of dents stronger than s [1/s]: sum of their areas in a window over the window's
            area and the time
    h(t)    strength in a window after a time t, if each spot keeps its strongest dent [m]
    T       saturation time: the largest time with h(2 T) = 1.1 h(T) [s]
    S       peening strength, h(T) [m]

    h(t) = integral over s of 1 - exp(-L(s) t)

A strip's arc height saturates like h. SAE J443 calls it saturated if twice the time adds 10 %. The
arc height is proportional to d²/D as long as the strip's in-plane stretch, and not its yielding,
limits it. For equal impacts h is the curve a (1 - exp(-b t)) of D. Kirk, "Almen saturation curve
solver program", The Shot Peener, 2005. The Almen intensity is S times a constant that a set of
strips calibrates. The impacts are those on the part, and the dents are the dents that these impacts
would leave in the strip's steel. The same sum with s = d, on the part's own metal, gives the depth
of compression and the residual stress (stress_profile.py).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from chamberopt.coverage.dents import dent_diameter

if TYPE_CHECKING:
    from chamberopt.coverage.field.smooth_faces import Places
    from chamberopt.coverage.field.windows import Windows
    from chamberopt.coverage.part_impacts import Hits
    from chamberopt.design.materials import PartMaterial

LEVELS = 32  # levels of s; twice as many levels change S by less than 0.3 %
SATURATED = 1.1  # SAE J443
NEWTON_STEPS = 3  # the relative error of S is a quarter of the saturation time's
HALVINGS = 12


def ball_diameter(hits: Hits, density: float) -> np.ndarray:
    """Return the diameter [m] of the ball of each impact, (k,), from its energy, or 0 for a ball at
    rest.

    Args:
        density: density of the balls [kg/m³].
    """
    speed = hits.speed.astype(float)
    mass = np.divide(2.0 * hits.energy, speed**2, out=np.zeros(len(hits)), where=speed > 0.0)
    return np.asarray((6.0 / np.pi * mass / density) ** (1.0 / 3.0))


def strip_dents(hits: Hits, density: float, strip: PartMaterial) -> tuple[np.ndarray, np.ndarray]:
    """Return the diameter [m] of the dent that each impact would leave on an Almen strip, (k,), and
    the strength of the impact, dent diameter² over ball diameter [m], (k,).

    Both are 0 if the impact leaves no dent.

    Args:
        density: density of the balls [kg/m³].
        strip: material of the strip.
    """
    ball = ball_diameter(hits, density)
    dent = dent_diameter(hits.speed.astype(float), ball, density, strip)
    return dent, np.divide(dent**2, ball, out=np.zeros(len(hits)), where=ball > 0.0)


def area_of_dent(diameter: np.ndarray) -> np.ndarray:
    """Return the area [m²] of dents of these diameters [m]."""
    return np.asarray(np.pi / 4.0 * diameter**2)


def levels(values: np.ndarray, highest: float) -> np.ndarray:
    """Return the number, from 0 to LEVELS - 1, of the step in which each value lies.

    The range from 0 to `highest` is divided into LEVELS equal steps.

    >>> levels(np.array([0.0, 0.5, 1.0]), highest=1.0)
    array([ 0, 16, 31])
    """
    return np.minimum(LEVELS * values / max(highest, 1e-300), LEVELS - 1).astype(np.int64)


def strength_histogram(
    windows: Windows, area: np.ndarray, contacts: Places, dent: np.ndarray, level: np.ndarray
) -> np.ndarray:
    """Return the dented area over the area of each window, by level of strength, (p, LEVELS).

    Args:
        area: areas of the windows [m²], (p,).
        contacts: positions of the dents.
        dent: diameter of each dent [m], (k,).
        level: number of the step of strength in which each dent lies, (k,).
    """
    from chamberopt.coverage.field.windows import add_to_levels

    sums, size = np.zeros((len(area), LEVELS)), area_of_dent(dent)
    for pair in windows.pairs(contacts):
        add_to_levels(*pair, size, level, sums)
    return np.asarray(sums / area[:, None])


def saturated_strength(histogram: np.ndarray, highest: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the peening strength [m] and the saturation time of each window (disc of the target),
    (p,) each.

    Both are 0 in a window without dents. The unit of time is the time in which the dents fell.

    Args:
        histogram: dented area over area of each window, by level (step) of strength, (p, LEVELS).
        highest: strength at the upper end of the levels [m].
    """
    rate = dent_rates(histogram)
    time = saturation_time(rate)
    return strength_at(rate, time, highest), time


def saturation_time(rate: np.ndarray) -> np.ndarray:
    """Return the saturation time of each window, (p,): the last time after which as much time again
    adds 10 % of strength.

    The unit of time is the time in which the dents fell.

    Args:
        rate: rates of dents stronger than each level of strength, (p, n).
    """
    # T lies between these times. For equal dents it is ln 10 over their rate.
    top = rate.max(axis=1)
    some = top > 0.0
    low = np.divide(0.1, top, out=np.zeros_like(top), where=some)
    weakest = np.where(rate > 0.0, rate, np.inf).min(axis=1)
    high = np.where(some, 5.0 / weakest, 0.0)
    for _ in range(HALVINGS):
        middle = np.sqrt(low * high)
        grows = _doubling_adds(rate, middle)
        low, high = np.where(grows, middle, low), np.where(grows, high, middle)
    return np.asarray(low)


def time_near(rate: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Return the saturation time of each window, (p,), by a search that begins near `time` (p,).

    Args:
        rate: rates of dents stronger than each level of strength, (p, n).
    """
    for _ in range(NEWTON_STEPS):
        gain, slope = _gain(rate, time)
        step = np.divide(gain, slope, out=np.zeros_like(gain), where=slope < 0.0)
        time = np.clip(time - step, 0.5 * time, 2.0 * time)
    return time


def dent_rates(histogram: np.ndarray) -> np.ndarray:
    """Return the rate of dents stronger than the middle of each level, in each window, (p, LEVELS).

    A level is a step of strength. The rate is dented area over the window's area and the time, in
    units of the time in which the dents fell.

    Args:
        histogram: dented area over area of each window, by level of strength, (p, LEVELS).
    """
    down = np.cumsum(histogram[:, ::-1], axis=1)[:, ::-1]
    return np.asarray(down - 0.5 * histogram)


def _gain(rate: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return h(2 T) - 1.1 h(T) and its derivative by T, (p,) each, for the strength h after a time.

    The first is 0 at the saturation time. The unit of h is a level (step) of strength.

    Args:
        rate: rates of dents stronger than each level, (p, n).
        time: the time T of each window, (p,).
    """
    left = np.exp(-rate * time[:, None])
    square = left**2
    gain = (1.0 - square).sum(axis=1) - SATURATED * (1.0 - left).sum(axis=1)
    slope = (rate * (2.0 * square - SATURATED * left)).sum(axis=1)
    return gain, slope


def _doubling_adds(rate: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Return where twice the time T adds more than 10 % of strength, h(2 T) > 1.1 h(T), (p,).

    With l = exp(-L T), the part of h(2 T) - 1.1 h(T) at a level is 1 - l² - 1.1 (1 - l), which is
    (1 - l) (l - 0.1).

    Args: as of `_gain`.
    """
    left = np.exp(rate * -time[:, None])
    return np.asarray(np.einsum("pn,pn->p", 1.0 - left, left - (SATURATED - 1.0)) > 0.0)


def strength_at(rate: np.ndarray, time: np.ndarray, highest: float) -> np.ndarray:
    """Return the strength [m] of each window, (p,), after a peening time (p,).

    The unit of time is the time in which the dents fell.

    Args:
        rate: rates of dents stronger than each level of strength, (p, LEVELS).
        highest: strength at the upper end of the levels [m].
    """
    return np.asarray(-np.expm1(-rate * time[:, None]).sum(axis=1) * highest / LEVELS)

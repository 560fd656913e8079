"""Normal restitution that falls with impact speed.

Notation:
    v: relative speed along the normal [m/s], ``speed``
    e: coefficient of restitution [-]: e = C0 for v < v0, and C0 (v / v0)^(-1/4) above
    C0, v0: coefficients [-] and [m/s], ``c0`` and ``v0``

Source: Badreddine et al., "CAD based simulation of ultrasonic shot peening", eq. 2, after McNamara
& Falcon, Phys. Rev. E 71 (2005) 031302.

Impacts slower than ``elastic_below`` lose nothing. Without such a limit a ball that comes to rest
bounces infinitely often in finite time; with it the number of bounces is bounded, and what is
neglected is below v²/2 per impact. This is the idea of the TC model of Luding & McNamara, Granular
Matter 1 (1998) 113, with a speed in place of a time.
"""

import math
from typing import NamedTuple

import numpy as np

from sim_core.errors import SceneError, number, surface_table
from sim_core.numerics.jit import jit

# m/s: a thousandth of the shot's speed. Mean speeds change by less than 3 % between 1 and 100 mm/s.
# Lower values spend events on chatter: 2 % of the impacts on the sonotrode here, 20 % at 1 mm/s.
ELASTIC_BELOW = 0.01


class Restitution(NamedTuple):
    """Coefficients of restitution.

    Args:
        surfaces: (C0, v0) of each surface, by tag number; C0 at most 1, v0 in m/s.
        balls: (C0, v0) of ball on ball.
        elastic_below: impacts slower than this lose nothing [m/s].
    """

    surfaces: tuple[tuple[float, float], ...] | np.ndarray
    balls: tuple[float, float]
    elastic_below: float = ELASTIC_BELOW


def checked_restitution(restitution: Restitution, tags: int) -> Restitution:
    """The coefficients as an array (tags, 2) and floats; raises SceneError if one is bad."""
    surfaces, of_balls = surface_table("restitution", "(C0, v0)", *restitution[:2], tags)
    pairs = [(f"surfaces[{i}]", *pair) for i, pair in enumerate(surfaces)] + [("balls", *of_balls)]
    for name, c0, v0 in pairs:
        if not 0.0 <= c0 <= 1.0 or not 0.0 < v0 < math.inf:
            raise SceneError(
                f"restitution.{name} is ({c0}, {v0}): C0 must lie in [0, 1] and v0 be positive "
                "[m/s]"
            )
    elastic_below = number("restitution.elastic_below", restitution.elastic_below)
    if not 0.0 <= elastic_below < math.inf:
        raise SceneError(
            f"restitution.elastic_below is {elastic_below}: it must be 0 or more [m/s]"
        )
    return Restitution(surfaces, of_balls, elastic_below)


@jit
def restitution_law(speed: float, c0: float, v0: float) -> float:
    """e at a relative normal speed [m/s]."""
    if speed < v0:
        return c0
    return c0 / math.sqrt(math.sqrt(speed / v0))


@jit
def surface_restitution(restitution: Restitution | None, tag: int, speed: float) -> float:
    """e of a ball on a surface; 1 without the effect."""
    if restitution is None:
        return 1.0
    if speed < restitution.elastic_below:
        return 1.0
    surfaces: np.ndarray = restitution.surfaces  # type: ignore[assignment]
    return restitution_law(speed, surfaces[tag, 0], surfaces[tag, 1])


@jit
def ball_restitution(restitution: Restitution | None, speed: float) -> float:
    """e of ball on ball; 1 without the effect."""
    if restitution is None:
        return 1.0
    if speed < restitution.elastic_below:
        return 1.0
    return restitution_law(speed, restitution.balls[0], restitution.balls[1])


def restitution_at(speed: np.ndarray, c0: float, v0: float) -> np.ndarray:
    """The same law on an array of speeds [m/s] of any shape."""
    speed = np.asarray(speed, dtype=np.float64)
    return np.asarray(c0 / np.sqrt(np.sqrt(np.maximum(speed / v0, 1.0))))

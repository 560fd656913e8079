"""Smallest lengths of a cavity, and errors that name the largest value that still makes one."""

import math
from collections.abc import Iterable

from chamberopt.common.toml_errors import CrossCheckError, Problem

# Shorter sides and smaller radii count as 0 [m]: a fiftieth of usual shot, far above the grid that
# solids are rounded to.
MIN_LENGTH = 5e-5
MIN_LENGTH_MM = 1e3 * MIN_LENGTH


def refuse_above(key: str, given: float, limit: float, why: str) -> None:
    """Raise CrossCheckError if the value of a key [mm or degrees] exceeds a limit of its sign."""
    if abs(given) > abs(limit):
        fits = math.trunc(limit * 1e3) / 1e3  # rounded towards 0, so that this value does fit
        text = f"given {given:g}, {why}; {fits:.7g} is the furthest that fits"
        raise CrossCheckError([Problem(key, text)])


def refuse_meeting_walls(slope: float, limits: Iterable[float], inclination_deg: float) -> None:
    """Raise CrossCheckError if walls lean in so far that they meet below the ceiling.

    Slope is the tangent of the inclination, outward; `limits` has the least that each wall allows.
    """
    least = max(limits, default=-math.inf)
    if slope < least:
        why, limit_deg = "with which walls meet below the ceiling", math.degrees(math.atan(least))
        refuse_above("inclination_deg", inclination_deg, limit_deg, why)

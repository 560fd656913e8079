"""How a value that makes no cavity is refused: the key, and the value furthest along that does."""

import math
from collections.abc import Iterable

from chamberopt.common.toml_errors import CrossCheckError, Problem

LEAST = 5e-5  # m: shorter sides and smaller radii are none; a fiftieth of usual shot, far above the grid of solids
LEAST_MM = 1e3 * LEAST


def refuse_beyond(key: str, given: float, most: float, why: str) -> None:
    """CrossCheckError for a key [mm or degrees] given beyond the most (of its sign) that fits."""
    if abs(given) > abs(most):
        fits = math.trunc(most * 1e3) / 1e3  # towards 0: what is said to fit does
        raise CrossCheckError(
            [Problem(key, f"given {given:g}, {why}; {fits:.7g} is the furthest that fits")]
        )


def refuse_inward(slope: float, slopes: Iterable[float], inclination_deg: float) -> None:
    """CrossCheckError for walls that lean in more than the steepest (least) slope allowed by any of ``slopes``."""
    least = max(slopes, default=-math.inf)
    if slope < least:
        most = math.degrees(math.atan(least))
        refuse_beyond(
            "inclination_deg", inclination_deg, most, "with which walls meet below the ceiling"
        )

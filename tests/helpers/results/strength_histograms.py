"""Windows whose dents have known strengths and rates."""

import numpy as np

from chamberopt.coverage.strength import LEVELS


def level_of(strength: float, highest: float) -> int:
    return min(int(LEVELS * strength / highest), LEVELS - 1)


def histogram_of(*impacts: tuple[float, float], highest: float = 1.0) -> np.ndarray:
    """One window, (1, LEVELS), from pairs of strength and rate."""
    found = np.zeros((1, LEVELS))
    for strength, rate in impacts:
        found[0, level_of(strength, highest)] += rate
    return found

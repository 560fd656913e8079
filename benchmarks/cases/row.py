"""One line of docs/explanation/validation.md: a figure that was simulated beside its reference."""

import math
from typing import NamedTuple

import numpy as np

ERRORS_EACH_SIDE = 2.0  # standard errors to either side: a 95 % interval


class Row(NamedTuple):
    """A quantity of a case.

    Args:
        case: name of the case.
        conditions: what tells this row from the others of the case.
        quantity: what is compared, with its unit.
        reference: what theory or publication says; NaN where it gives no number.
        allowed: how far the reference itself may be off: the theory's own error, or the precision
            with which a measurement was published.
        found: what is simulated.
        half_width: of its 95 % interval, or of the bracket that a search ended with.
    """

    case: str
    conditions: str
    quantity: str
    reference: float
    allowed: float
    found: float
    half_width: float

    @property
    def agrees(self) -> bool | None:
        """Whether the two agree within what is known of both; None without a reference."""
        if math.isnan(self.reference):
            return None
        return abs(self.found - self.reference) <= self.allowed + self.half_width


def mean_and_half_width(samples: np.ndarray) -> tuple[float, float]:
    """Mean of independent samples (n,) and the half-width of its 95 % interval (Student's t)."""
    from scipy.stats import t

    error = np.std(samples, ddof=1) / np.sqrt(len(samples))
    return float(np.mean(samples)), float(t.ppf(0.975, len(samples) - 1) * error)

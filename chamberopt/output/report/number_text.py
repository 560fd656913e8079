"""Numbers of the report as text, and the label and unit of each metric and objective.

An interval is given to one or two digits, and its value to the same decimals.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from chamberopt.common.errors import InputError
from chamberopt.common.estimate import ZERO_TOLERANCE
from chamberopt.coverage.metrics import METRICS, parse_objective

if TYPE_CHECKING:
    from chamberopt.common.estimate import Estimate

THIN_SPACE = "\u202f"  # between thousands; no line breaks there


@dataclass(frozen=True)
class Label:
    """Text of a metric or an objective.

    Args:
        text: name in plain words.
        unit: of the number shown.
        factor: number shown over number stored; negative for an objective that is minus a metric.
        meaning: explanation, where the text needs one.
    """

    text: str
    unit: str = ""
    factor: float = 1.0
    meaning: str = ""

    @property
    def with_unit(self) -> str:
        """Such as "mean coverage [%]"."""
        return f"{self.text} [{self.unit}]" if self.unit else self.text

    def format(self, estimate: Estimate, sign: bool = False) -> str:
        """The estimate with its interval, in the unit shown."""
        return with_interval(**self.scale(estimate), unit=self.unit, sign=sign)

    def scale(self, estimate: Estimate) -> dict[str, float]:
        """Value and half-width in the unit shown."""
        return {
            "value": self.factor * estimate.value,
            "half_width": abs(self.factor) * estimate.half_width,
        }


def metric_label(name: str) -> Label:
    """The label of a metric; shares of the surface are shown in per cent."""
    metric = METRICS.get(name)
    if metric is None:
        return Label(name.replace("_", " "))
    if metric.highest <= 1.0:
        return Label(metric.summary, "%", 100.0)
    return Label(metric.summary, "" if metric.unit == "balls" else metric.unit)  # "number of balls"


def objective_label(name: str) -> Label:
    """The label of an objective: the metric's label where it is plus or minus a metric."""
    try:
        objective = parse_objective(name)
    except InputError:  # written by another version of the program
        return Label(name.replace("_", " "))
    (metric, weight), *others = objective.terms.items()
    if not others and abs(weight) == 1.0:
        label = metric_label(metric)
        return Label(label.text, label.unit, weight * label.factor)
    return Label(name.replace("_", " "), meaning=objective.summary)


def plain(value: float, digits: int = 4) -> str:
    """The number to a number of significant digits, without an exponent if it is of usual size."""
    if not math.isfinite(value):
        return "not known"
    if abs(value) < ZERO_TOLERANCE:
        return "0"
    if not 1e-4 <= abs(value) < 1e9:
        return f"{value:.{digits - 1}g}"
    text = f"{value:.{max(0, digits - 1 - math.floor(math.log10(abs(value))))}f}"
    return _grouped(text.rstrip("0").rstrip(".") if "." in text else text)


def with_unit(value: float, unit: str = "") -> str:
    """The number to two significant digits, with its unit."""
    return f"{plain(value, 2)} {unit}".rstrip()


def with_interval(value: float, half_width: float, unit: str = "", sign: bool = False) -> str:
    """Such as "0.809 ± 0.004 mm": both to the decimals of the half-width; exact values stand alone.

    Args:
        sign: put a plus before positive values.
    """
    unit = f"{THIN_SPACE if unit == '°' else ' '}{unit}" if unit else ""
    if not math.isfinite(value):
        return "not known"
    plus = "+" if sign and value > ZERO_TOLERANCE else ""
    if abs(half_width) < ZERO_TOLERANCE:
        return f"{plus}{plain(value)}{unit}"
    if not math.isfinite(half_width):
        return f"{plus}{plain(value)} ± not known{unit}"
    # Two digits for half-widths from 1.0 to 2.9, one from 3 to 9; negative: tens, hundreds.
    magnitude = math.floor(math.log10(half_width))
    decimals = value_decimals = (1 if half_width / 10.0**magnitude < 2.95 else 0) - magnitude
    shown = 0.0 if abs(value) < ZERO_TOLERANCE else value
    if decimals < 0 and 0.0 < abs(shown) < 0.5 * 10.0**-decimals:
        # 4000 ± 500 000 says more than 0 ± 500 000.
        value_decimals = -math.floor(math.log10(abs(shown)))
    return f"{plus}{_rounded(shown, value_decimals)} ± {_rounded(half_width, decimals)}{unit}"


def per_cent(value: float) -> str:
    """A share in whole per cent."""
    return f"{100.0 * value:.0f} %"


def _rounded(value: float, decimals: int) -> str:
    text = f"{round(value, decimals):.{max(0, decimals)}f}"
    return _grouped(text.removeprefix("-") if not float(text) else text)


def _grouped(text: str) -> str:
    """The number with gaps between thousands from 10 000 on, and a minus as long as a plus."""
    whole, point, decimals = text.partition(".")
    if len(whole.lstrip("-")) > 4:
        whole = f"{int(whole):,}".replace(",", THIN_SPACE)
    return (whole + point + decimals).replace("-", "−")

"""Numbers as a reader wants them: an interval to one or two digits, and its value to the same decimals."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from chamberopt.coverage.statistics.confidence_interval import ZERO_TOLERANCE

if TYPE_CHECKING:
    from chamberopt.coverage.statistics.confidence_interval import Estimate

GAP = "\u202f"  # between thousands; narrow, and no line breaks there


def plain(value: float, digits: int = 4) -> str:
    """So many digits that count, without exponents where people would not write one."""
    if not math.isfinite(value):
        return "not known"
    if abs(value) < ZERO_TOLERANCE:
        return "0"
    if not 1e-4 <= abs(value) < 1e9:
        return f"{value:.{digits - 1}g}"
    text = f"{value:.{max(0, digits - 1 - math.floor(math.log10(abs(value))))}f}"
    return _grouped(text.rstrip("0").rstrip(".") if "." in text else text)


def with_unit(value: float, unit: str = "") -> str:
    """Two digits that count, and the unit."""
    return f"{plain(value, 2)} {unit}".rstrip()


def with_interval(value: float, half_width: float, unit: str = "", sign: bool = False) -> str:
    """ "0.809 ± 0.004": both to the decimals that the half-width deserves; what is exact stands alone."""
    unit = f"{GAP if unit == '°' else ' '}{unit}" if unit else ""
    if not math.isfinite(value):
        return "not known"
    mark = "+" if sign and value > ZERO_TOLERANCE else ""
    if abs(half_width) < ZERO_TOLERANCE:
        return f"{mark}{plain(value)}{unit}"
    if not math.isfinite(half_width):
        return f"{mark}{plain(value)} ± not known{unit}"
    decimals = fine = _decimals(half_width)
    shown = 0.0 if abs(value) < ZERO_TOLERANCE else value
    if (
        decimals < 0 and 0.0 < abs(shown) < 0.5 * 10.0**-decimals
    ):  # 4000 ± 500 000 says more than 0 ± 500 000
        fine = -math.floor(math.log10(abs(shown)))
    return f"{mark}{_rounded(shown, fine)} ± {_rounded(half_width, decimals)}{unit}"


def share(value: float) -> str:
    """A share as whole per cent."""
    return f"{100.0 * value:.0f} %"


def estimated(estimate: Estimate, factor: float = 1.0, unit: str = "", sign: bool = False) -> str:
    """An estimate, in the unit shown."""
    return with_interval(factor * estimate.value, abs(factor) * estimate.half_width, unit, sign)


def _decimals(half_width: float) -> int:
    """Two digits of 1.0 to 2.9, one of 3 to 9; negative: tens, hundreds."""
    tens = math.floor(math.log10(half_width))
    return (1 if half_width / 10.0**tens < 2.95 else 0) - tens


def _rounded(value: float, decimals: int) -> str:
    text = f"{round(value, decimals):.{max(0, decimals)}f}"
    return _grouped(text.removeprefix("-") if not float(text) else text)


def _grouped(text: str) -> str:
    """With gaps between thousands from 10 000 on, and a minus as long as a plus."""
    whole, point, rest = text.partition(".")
    if len(whole.lstrip("-")) > 4:
        whole = f"{int(whole):,}".replace(",", GAP)
    return (whole + point + rest).replace("-", "−")

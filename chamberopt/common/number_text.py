"""Write numbers and estimates as text, alike in console, pictures, tables and reports.

The half-width of an interval has one or two digits, and its value has the same decimals.
"""

from __future__ import annotations

import math
import re

from chamberopt.common.estimate import ZERO_TOLERANCE, Estimate

NEARLY_ALL = 1e-3  # words replace shares that are closer to 1
MOST_NINES = 6
ALIKE = 1e-4  # distance of the ends of a range over their size, below which they are told alike
THIN_SPACE = "\u202f"  # gap between thousands, at which no line breaks
NO_BREAK = "\u00a0"  # a blank at which no line breaks
# Blanks of an interval, and between a number and its unit.
_TOGETHER = r" (?=±|%)|(?<=±) |(?<=\d) (?=(?:[µmc]?m[²³]?|mmA|k?g|s|k?Hz|HB|MPa)(?!\w))"


def estimate_text(
    estimate: Estimate, factor: float = 1.0, unit: str = "", sign: bool = False
) -> str:
    """Return an estimate as text: value ± half-width, or the words that replace its number.

    Args:
        factor: number shown over number stored.
        unit: unit of the number shown.
        sign: True to put a plus before positive values.
    """
    if estimate.in_words:
        return estimate.in_words
    return with_interval(factor * estimate.value, abs(factor) * estimate.half_width, unit, sign)


def share_in_words(share: Estimate) -> str:
    """Return words such as "more than 99.9 %" for a share that is nearly 1, "" for other shares.

    The words have as many nines as the interval of the share allows.
    """
    least = 1.0 - share.low
    if not least < NEARLY_ALL:
        return ""
    nines = min(math.floor(-math.log10(max(least, 1e-300))), MOST_NINES)
    return f"more than {100.0 * (1.0 - 10.0**-nines):.{nines - 2}f} %"


def plain(value: float | str, digits: int = 4) -> str:
    """Return a number as text with `digits` significant digits.

    Numbers below 1e-4 and from 1e9 on in size have an exponent and one digit less. A text is
    returned as it is.
    """
    if isinstance(value, str):
        return value
    if not math.isfinite(value):
        return "not known"
    if abs(value) < ZERO_TOLERANCE:
        return "0"
    if not 1e-4 <= abs(value) < 1e9:
        return f"{value:.{digits - 1}g}"
    text = f"{value:.{max(0, digits - 1 - math.floor(math.log10(abs(value))))}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def rounded(value: float, digits: int) -> str:
    """Return a number rounded to some digits, also before the point: 2800 for 2805 to two."""
    return f"{float(f'{value:.{digits}g}'):g}"


def counted(count: float, noun: str) -> str:
    """Return a number of things with two digits, such as "1 dent" or "27 dents".

    >>> counted(1.04, "dent")
    '1 dent'
    """
    number = plain(count, 2)
    return f"{number} {noun}" if number == "1" else f"{number} {noun}s"


def percent(share: float, sign: bool = False) -> str:
    """Return a share as text in per cent with two digits, such as "48 %" or "0.24 %".

    Shares from 99.5 % on have the decimals that tell them from all.

    Args:
        sign: True to put a plus before positive shares.
    """
    value = 100.0 * share
    text = plain(value, 2)
    if 99.5 <= value < 100.0:
        text = plain(min(value, 99.9), 3)
    return f"{'+' if sign and share > ZERO_TOLERANCE else ''}{text} %"


def with_interval(value: float, half_width: float, unit: str = "", sign: bool = False) -> str:
    """Return a value with its half-width as text such as "0.809 ± 0.004 mm".

    Both have the decimals of the half-width. A value with half-width 0 stands alone.

    Args:
        sign: True to put a plus before positive values.
    """
    unit = f" {unit}" if unit else ""
    if not math.isfinite(value):
        return "not known"
    plus = "+" if sign and value > ZERO_TOLERANCE else ""
    if abs(half_width) < ZERO_TOLERANCE:
        return f"{plus}{plain(value)}{unit}"
    if not math.isfinite(half_width):
        return f"{plus}{plain(value)} ± not known{unit}"
    decimals = value_decimals = _decimals(half_width)
    shown = 0.0 if abs(value) < ZERO_TOLERANCE else value
    if decimals < 0 and 0.0 < abs(shown) < 0.5 * 10.0**-decimals:
        # 4000 ± 500 000 says more than 0 ± 500 000.
        value_decimals = -math.floor(math.log10(abs(shown)))
    return f"{plus}{_rounded(shown, value_decimals)} ± {_rounded(half_width, decimals)}{unit}"


def _decimals(half_width: float) -> int:
    """Return the number of decimals of a value with this half-width; below 0 are tens, hundreds.

    A half-width from 1.0 to 2.9 has two digits, from 3 to 9 one.
    """
    magnitude = math.floor(math.log10(half_width))
    return (1 if half_width / 10.0**magnitude < 2.95 else 0) - magnitude


def _rounded(value: float, decimals: int) -> str:
    text = f"{round(value, decimals):.{max(0, decimals)}f}"
    return text if float(text) else text.removeprefix("-")


def typeset_plain(value: float | str, digits: int = 4) -> str:
    """Return the number as `plain` does, with the gaps and the minus of `typeset`."""
    return typeset(plain(value, digits))


def typeset(text: str) -> str:
    """Return a text with its numbers as in a printed book.

    Numbers from 10 000 on have gaps between thousands, and the minus sign is as long as a plus.
    """

    def grouped(number: re.Match[str]) -> str:
        return f"{int(number[0]):,}".replace(",", THIN_SPACE)

    text = re.sub(r"(?<![\d.,e])\d{5,}(?!e)", grouped, text).replace(" °", f"{THIN_SPACE}°")
    return re.sub(r"(?<!\w)-(?=\d)", "−", text)


def held_together(text: str) -> str:
    """Return a text in which no line ends within an interval, or before the unit of a number."""
    return re.sub(_TOGETHER, NO_BREAK, text)


def range_text(low: float, high: float, unit: str = "") -> str:
    """Return the ends of a range as text such as "0.70 to 0.83 s".

    Both have the decimals that the half of their distance would have as an interval.
    """
    half_width = 0.5 * abs(high - low)
    least = max(ZERO_TOLERANCE, ALIKE * max(abs(low), abs(high)))
    if not math.isfinite(half_width) or half_width < least:
        ends = [plain(low), plain(high)]
    else:
        decimals = _decimals(half_width)
        ends = [_rounded(one, decimals) for one in (low, high)]
    text = ends[0] if ends[0] == ends[1] else f"{ends[0]} to {ends[1]}"
    return f"{text} {unit}".rstrip()

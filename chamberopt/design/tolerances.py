"""Tolerances of a design: largest deviations of its numbers in production.

[tolerances]
amplitude_pv_um = 4                      # 4 µm more or less than given
"shot.mass_g" = ["-10 %", "0 %"]         # the loss until shot is added
"process.treatment_time_s" = "2 %"

A design without the table is simulated over the usual tolerance of the amplitude (USUAL).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Protocol

from pydantic import PlainValidator
from pydantic.fields import FieldInfo

from chamberopt.common import toml_errors
from chamberopt.common.errors import InputError
from chamberopt.common.toml_errors import CrossCheckError, Problem
from chamberopt.common.toml_fields import allowed_range

SHORT_NAMES = {key: f"sonotrode.{key}" for key in ("amplitude_um", "amplitude_pv_um")}
# A design gives one of the two. Peak to valley is twice zero-to-peak.
TWINS = {"amplitude_um": ("amplitude_pv_um", 2.0), "amplitude_pv_um": ("amplitude_um", 0.5)}
# SAE AMS 2580A, Table 1, sonotrode vibration amplitude: 0.00016 in (0.004 mm) more or less. Read as
# SONATS quotes it, who says that it is peak to valley ("Importance of key parameters", on the pages
# of sonats-et.com). The standard itself was not read, and no other tolerance of it.
USUAL = {"amplitude_pv_um": 4.0}
USUAL_IN_WORDS = "± 4 µm peak to valley (SAE AMS 2580A, Table 1, as SONATS quotes it)"
# Permissible deviations of lengths, ISO 2768-1 class m: up to a nominal size, and either way [mm].
# By heart: the standard could not be read here.
ISO_2768_M = ((6.0, 0.1), (30.0, 0.2), (120.0, 0.3), (400.0, 0.5), (1000.0, 0.8), (2000.0, 1.2))
FORM = 'a number, a share such as "2 %", or [low, high] of these, such as ["-10 %", "0 %"]'


def iso_2768_m(length: float) -> float:
    """Return the permissible deviation of a length by ISO 2768-1 class m, both in mm.

    A length above all of the table has the last one.
    """
    return next((off for most, off in ISO_2768_M if length <= most), ISO_2768_M[-1][1])


def _deviation(side: object) -> tuple[float, bool]:
    """Return a deviation as a number, and True if it was given in per cent, such as "-10 %".

    Raises ValueError if it is neither a number nor a percentage.
    """
    if isinstance(side, str) and (found := re.fullmatch(r"\s*([-+]?[\d.]+)\s*%\s*", side)):
        return float(found[1]), True
    if isinstance(side, bool) or not isinstance(side, (int, float)) or not math.isfinite(side):
        raise ValueError
    return float(side), False


def _checked(given: Any) -> object:
    """Return a tolerance as its file gives it, after a check.

    A tolerance is one deviation up and down, or a pair of a lower and an upper deviation.
    """
    several = isinstance(given, (list, tuple))
    shown = list(given) if several else given
    try:
        if several:
            low, high = (_deviation(side)[0] for side in given)
        else:
            high = _deviation(given)[0]
            low = -high
    except ValueError:
        remedy = f"allowed: {FORM}"
        if isinstance(given, dict):
            remedy = 'put the whole name in quotes, such as "shot.mass_g" = "2 %"'
        raise CrossCheckError([Problem("", f"given {shown!r}; {remedy}")]) from None
    if not low <= 0.0 <= high or low == high:
        text = "give how far the number may lie off: "
        text += "low below 0 or 0, high above it" if several else "more than 0"
        raise CrossCheckError([Problem("", f"given {shown!r}; {text}")])
    return tuple(given) if several else given


Tolerance = Annotated[Any, PlainValidator(_checked)]  # a side, or a tuple of two


class ToleratedDesign(Protocol):
    """The properties and methods of Design that this module uses."""

    @property
    def tolerances(self) -> dict[str, Tolerance] | None: ...
    def value(self, name: str) -> float: ...
    def why_fixed(self, name: str) -> str: ...
    def changed(self, values: Mapping[str, object]) -> object: ...


def tolerance_box(design: ToleratedDesign) -> dict[str, tuple[float, float]]:
    """Return the lowest and highest value of each number with a tolerance, by its dotted name, such
    as shot.mass_g.

    The values are in the units of the file, for the key that the design gives.
    """
    box = {}
    for key, tolerance in (design.tolerances or {}).items():
        name, factor = _number_of(design, key)
        box[name] = _range(design.value(name), tolerance, factor)
    return box


def require_tolerances(design: ToleratedDesign) -> None:
    """Raise InputError unless the design is valid at both ends of the range of each number."""
    for name, ends in tolerance_box(design).items():
        for end in ends:
            try:
                design.changed({name: end, "tolerances": None})
            except InputError as error:
                text = f"the design cannot have {name} = {end:g}: {error}"
                raise InputError(f"tolerances.{name}: {text}") from None


def tolerance_problems(
    design: ToleratedDesign, fields: Mapping[str, FieldInfo]
) -> Iterator[Problem]:
    """Yield a problem for each tolerance that names no number of the design, or whose range is
    empty or goes beyond the values allowed for the number.

    Args:
        fields: fields of every number of the design, by dotted name.
    """
    seen: set[str] = set()
    for key, tolerance in (design.tolerances or {}).items():
        place = f"tolerances.{key}"
        name, factor = _number_of(design, key)
        if reason := design.why_fixed(name):
            yield Problem(place, reason)
            continue
        if name in seen:
            yield Problem(place, f"{name} has a tolerance already; keep one of the two")
        seen.add(name)
        value = design.value(name)
        low, high = _range(value, tolerance, factor)
        if low == high:
            text = f"given {tolerance!r} of {name} = 0, which is no range; give it without %"
            yield Problem(place, text)
        if any(not _is_allowed(fields[name], end) for end in (low, high)):
            allowed = toml_errors.describe_allowed(fields[name])
            text = f"given {tolerance!r}, so that {name} is {low:g} to {high:g}"
            yield Problem(place, f"{text}; allowed: {allowed}; narrow it")


def _number_of(design: ToleratedDesign, key: str) -> tuple[str, float]:
    """Return the dotted name of the number that a key of [tolerances] means, and a factor.

    The tolerance at the key, times the factor, is the tolerance of the number. The factor is 2 if
    the key is the zero-to-peak amplitude and the design gives peak-to-valley, 1/2 in the opposite
    case, and 1 otherwise.
    """
    name = SHORT_NAMES.get(key, key)
    table, _, last = name.rpartition(".")
    if last in TWINS and design.why_fixed(name):
        other, size = TWINS[last]
        if not design.why_fixed(f"{table}.{other}"):
            return f"{table}.{other}", size
    return name, 1.0


def _range(value: float, tolerance: Any, factor: float) -> tuple[float, float]:
    several = isinstance(tolerance, tuple)
    ends = []
    for sign, side in zip(
        (-1.0, 1.0), tolerance if several else (tolerance, tolerance), strict=True
    ):
        size, is_share = _deviation(side)
        size *= 1.0 if several else sign
        ends.append(value + size * (0.01 * abs(value) if is_share else factor))
    return ends[0], ends[1]


def _is_allowed(field: FieldInfo, value: float) -> bool:
    low, high = allowed_range(field)
    return bool(low <= value <= high)

"""How well the numbers of a design are known that nobody has measured on the machine.

[ranges]                     # factors; [1, 1] is known exactly
friction = [0.5, 1.5]        # of all coefficients of friction
v0 = [0.5, 2]                # of the speeds v0 that the catalogue computed
slopes = [0.6, 1.7]          # of the rms slopes of rough faces

A group of numbers has one pair of factors, because its numbers are wrong for the same reason: the
state of all faces, or the formula. A speed v0 that the design gives counts as measured. What a
calibration has fitted is in the intervals of the figures already, and has no range.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from chamberopt.common.errors import InputError
from chamberopt.common.toml_errors import Problem, numeric_fields
from chamberopt.common.toml_fields import Pair, allowed_range, list_field
from chamberopt.design.effects import FrictionTable
from chamberopt.design.table_base import FileTable

# The factors where a design gives none.
# Coefficients of friction of dry metals scatter between tables and with the state of the faces by
# about a half of their value.
FRICTION = (0.5, 1.5)
# v0 goes with the 5/2nd power of the dynamic yield pressure, which Johnson's formula takes from the
# hardness: about a factor of two (docs/physics.md).
V0 = (0.5, 2.0)
# Rms slopes of peened faces are 2 to 5 degrees, about 3 times or over 1.7.
SLOPES = (0.6, 1.7)
USUAL = {"friction": FRICTION, "v0": V0, "slopes": SLOPES}
# Name of the calibrated parameter that tells a group of numbers.
CALIBRATED = {"friction": "mu", "v0": "v0"}
WIDEST = 100.0
FORM = f"two factors [low, high], 1/{WIDEST:g} <= low <= 1 <= high <= {WIDEST:g}"


class Ranges(FileTable):
    """Factors by which numbers may lie off that are not calibrated; [1, 1] is known exactly."""

    friction: Pair | None = list_field(
        FORM, f"of all coefficients of friction; absent: {list(FRICTION)}", None
    )
    v0: Pair | None = list_field(
        FORM, f"of the speeds v0 that the catalogue computed; absent: {list(V0)}", None
    )
    slopes: Pair | None = list_field(
        FORM, f"of the rms slopes of rough faces; absent: {list(SLOPES)}", None
    )

    def _problems(self) -> Iterator[Problem]:
        for name in USUAL:
            given = getattr(self, name)
            if given and not 1.0 / WIDEST <= given[0] <= 1.0 <= given[1] <= WIDEST:
                yield Problem(name, f"given {list(given)}; allowed: {FORM}")


class Unknown(NamedTuple):
    """A group of numbers of a design that are known only to lie between two factors of themselves.

    numbers: the numbers as designed, by dotted name.
    """

    name: str
    low: float
    high: float
    numbers: dict[str, float]


def unknowns(design: Any) -> list[Unknown]:
    """Return the groups of numbers of a Design that are not known exactly, and not calibrated."""
    left_out = calibrated(design)
    found = []
    for name, usual in USUAL.items():
        low, high = getattr(design.ranges, name, None) or usual
        numbers = dict(_numbers(design, name))
        if numbers and low < high and name not in left_out:
            found.append(Unknown(name, low, high, numbers))
    return found


def calibrated(design: Any) -> list[str]:
    """Return the groups of numbers of a Design that its calibration has fitted."""
    fitted = design.calibration.parameters if design.calibration else ()
    return [
        name
        for name, parameter in CALIBRATED.items()
        if parameter in fitted and dict(_numbers(design, name))
    ]


def variants(design: Any) -> dict[str, tuple[Any, Any]]:
    """Return copies of a Design with each unknown group at its low and at its high end, by name.

    A number ends at the bound of what designs may have. Raises InputError if the design cannot
    have an end.
    """
    fields = dict(numeric_fields(design))

    def at(one: Unknown, factor: float) -> Any:
        values = {}
        for name, value in one.numbers.items():
            least, most = allowed_range(fields[name])
            values[name] = min(max(_times(name, value, factor), least), most)
        try:
            return design.changed({**values, **_no_longer_computed(values)})
        except InputError as error:
            raise InputError(f"ranges.{one.name}: {factor:g}: {error}; narrow it") from None

    return {one.name: (at(one, one.low), at(one, one.high)) for one in unknowns(design)}


def _numbers(design: Any, group: str) -> Iterator[tuple[str, float]]:
    """Yield dotted name and value of each number of a group. Zeros are no unknown numbers."""
    for name, _ in numeric_fields(design):
        table, _, key = name.rpartition(".")
        if group == "friction":
            belongs = table == "effects.friction" and key in FrictionTable.COEFFICIENTS
        elif group == "slopes":
            belongs = table.startswith("effects.roughness")
        else:
            belongs = table.startswith("materials.") and key == "v0_m_s"
        value = _value(design, name) if belongs else None
        if value and (group != "v0" or _value(design, f"{table}.v0_for")):
            yield name, float(value)


def _value(design: Any, name: str) -> Any:
    """Return the value at a dotted name; None if it, or a table on the way, is not set."""
    for step in name.split("."):
        design = getattr(design, step, None)
    return design


def _times(name: str, value: float, factor: float) -> float:
    """Return a number times a factor. The factor of an angle is that of its tangent, the slope."""
    if not name.endswith("_deg"):
        return value * factor
    return math.degrees(math.atan(factor * math.tan(math.radians(value))))


def _no_longer_computed(values: Mapping[str, float]) -> dict[str, None]:
    """Return the keys that would say that changed speeds v0 are the catalogue's, to remove them."""
    of_v0 = (name for name in values if name.endswith(".v0_m_s"))
    return {f"{name.removesuffix('v0_m_s')}v0_for": None for name in of_v0}

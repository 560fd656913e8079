"""How well the numbers of a design are known that nobody has measured on the machine.

[ranges]                     # factors; [1, 1] is known exactly
friction = [0.5, 1.5]        # of all coefficients of friction
v0 = [0.5, 2]                # of the speeds v0 that the catalogue computed
slopes = [0.6, 1.7]          # of the rms slopes of rough faces

Where a design gives no factors, a number from the catalogue lies between the bounds that it has
there (materials/friction.toml), and a number of the design's own between the usual factors. The
numbers of a group are wrong for the same reason, the state of all faces or the formula: all are at
their low ends at once, or all at their high ends. A speed v0 that the design gives counts as
measured. What a calibration has fitted is in the intervals of the figures already, and has no
range.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from chamberopt.common.errors import InputError
from chamberopt.common.record_types import Positive, Table
from chamberopt.common.toml_errors import Problem, numeric_fields
from chamberopt.common.toml_fields import Pair, allowed_range, list_field
from chamberopt.design.effects import FrictionTable
from chamberopt.design.materials import surface_pairs, treatment
from chamberopt.design.table_base import FileTable

# The usual factors, of numbers whose bounds the catalogue does not have.
# Coefficients of friction of dry metals scatter between tables and with the state of the faces by
# about a half of their value.
FRICTION = (0.5, 1.5)
# v0 goes with the 5/2nd power of the dynamic yield pressure, which Johnson's formula takes from the
# hardness: about a factor of two (docs/reference/physics.md).
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
        FORM,
        f"of all coefficients of friction; absent: the catalogue's bounds, {list(FRICTION)} of "
        "numbers that it does not have",
        None,
    )
    v0: Pair | None = list_field(
        FORM, f"of the speeds v0 that the catalogue computed; absent: {list(V0)}", None
    )
    slopes: Pair | None = list_field(
        FORM,
        f"of the rms slopes of rough faces; absent: the catalogue's bounds of the treatment, "
        f"{list(SLOPES)} of numbers that it does not have",
        None,
    )

    def _problems(self) -> Iterator[Problem]:
        for name in USUAL:
            given = getattr(self, name)
            if given and not 1.0 / WIDEST <= given[0] <= 1.0 <= given[1] <= WIDEST:
                yield Problem(name, f"given {list(given)}; allowed: {FORM}")


class UnknownNumber(Table):
    """A number as designed, and between what it lies."""

    value: Positive
    low: Positive
    high: Positive


class Unknown(NamedTuple):
    """A group of numbers of a design that are not known exactly, by dotted name."""

    name: str
    numbers: dict[str, UnknownNumber]


def unknowns(design: Any) -> list[Unknown]:
    """Return the groups of numbers of a Design that are not known exactly, and not calibrated.

    A number ends at the bound of what designs may have.
    """
    left_out, fields = calibrated(design), dict(numeric_fields(design))
    found = []
    for group, usual in USUAL.items():
        given, numbers = getattr(design.ranges, group, None), {}
        for name, value, bounds in _numbers(design, group):
            least, most = allowed_range(fields[name])
            if given or bounds is None:
                low, high = given or usual
                bounds = _times(name, value, low), _times(name, value, high)
            low, high = (min(max(one, least), most) for one in bounds)
            if low < high:
                numbers[name] = UnknownNumber(value=value, low=low, high=high)
        if numbers and group not in left_out:
            found.append(Unknown(group, numbers))
    return found


def calibrated(design: Any) -> list[str]:
    """Return the groups of numbers of a Design that its calibration has fitted."""
    fitted = design.calibration.parameters if design.calibration else ()
    return [
        name
        for name, parameter in CALIBRATED.items()
        if parameter in fitted and any(_numbers(design, name))
    ]


def variants(design: Any) -> dict[str, tuple[Any, Any]]:
    """Return copies of a Design with each unknown group at its low and at its high end, by name.

    Raises InputError if the design cannot have an end.
    """

    def at(one: Unknown, end: str) -> Any:
        values = {name: getattr(number, end) for name, number in one.numbers.items()}
        try:
            return design.changed({**values, **_no_longer_computed(values)})
        except InputError as error:
            raise InputError(f"ranges.{one.name}: at the {end} end: {error}; narrow it") from None

    return {one.name: (at(one, "low"), at(one, "high")) for one in unknowns(design)}


Number = tuple[str, float, tuple[float, float] | None]


def _numbers(design: Any, group: str) -> Iterator[Number]:
    """Yield dotted name, value and the catalogue's bounds of each number of a group.

    The bounds are None of a number that the catalogue does not have. Zeros are no unknown numbers.
    """
    of_group = {"friction": _friction, "v0": _v0, "slopes": _slopes}[group]
    yield from (one for one in of_group(design) if one[1])


def _friction(design: Any) -> Iterator[Number]:
    table = design.effects.friction
    if table is None:
        return
    if not table.pairs:
        yield from _own(table, "effects.friction", FrictionTable.COEFFICIENTS)
        return
    # Surfaces whose mu is the same may have other bounds.
    for key, pair in surface_pairs(dict(design.materials), design.shot.material).items():
        own = getattr(table, key)
        mu = table.mu if own is None else own
        yield f"effects.friction.{key}", mu, pair.mu_range if mu == pair.mu else None


def _v0(design: Any) -> Iterator[Number]:
    for name, table in design.materials:
        if table.v0_for and table.v0_m_s is not None:
            yield f"materials.{name}.v0_m_s", table.v0_m_s, None


def _slopes(design: Any) -> Iterator[Number]:
    table = design.effects.roughness
    if table is None:
        return
    named = treatment(table.treatment) if table.treatment else None
    for name, value, _ in _own(table, "effects.roughness", table.SLOPES):
        bounds = named.slope_range if named and value == named.slope_deg else None
        yield name, value, bounds


def _own(table: Any, name: str, keys: Iterable[str]) -> Iterator[Number]:
    """Yield the numbers of a table that are set."""
    for key in keys:
        if (value := getattr(table, key)) is not None:
            yield f"{name}.{key}", value, None


def _times(name: str, value: float, factor: float) -> float:
    """Return a number times a factor. The factor of an angle is that of its tangent, the slope."""
    if not name.endswith("_deg"):
        return value * factor
    return math.degrees(math.atan(factor * math.tan(math.radians(value))))


def _no_longer_computed(values: Mapping[str, float]) -> dict[str, None]:
    """Return the keys that would say that changed speeds v0 are the catalogue's, to remove them."""
    of_v0 = (name for name in values if name.endswith(".v0_m_s"))
    return {f"{name.removesuffix('v0_m_s')}v0_for": None for name in of_v0}

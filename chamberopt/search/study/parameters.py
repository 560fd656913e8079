"""The parameters that a study varies: their values, and their coordinates in the unit cube.

A search works on points of the unit cube [0, 1]^d, where d is the number of parameters in [vary];
0 and 1 are the bounds of each. Numbers are rounded before they are simulated, to about a thousandth
of the distance between the bounds, because a shop cannot set more decimals.

If `chamber.shape` varies, some shapes may have a key of the chamber that other shapes lack. The key
is then a parameter of candidates with these shapes; other candidates have the value NONE.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, model_serializer

from chamberopt.common import toml_errors
from chamberopt.common.errors import InputError
from chamberopt.common.toml_errors import CrossCheckError, Problem
from chamberopt.common.toml_fields import list_field
from chamberopt.design.design import SHAPE, Design
from chamberopt.design.materials import balls, find
from chamberopt.design.table_base import FileTable
from chamberopt.design.tolerances import tolerance_box
from chamberopt.search.optimiser.domain import Axis, Domain

# Parameters that change no shape, beside those of the tables process and materials.
OF_SHOT_AND_DRIVE = {
    "shot.mass_g",
    "sonotrode.amplitude_um",
    "sonotrode.amplitude_pv_um",
    "sonotrode.frequency_khz",
}
ON_BOUND = 1e-3  # share of the bounds' distance
NEAR = 1e-9  # of a step: how far a value may be from its place
MAX_LEVELS = 1000
NONE = "none"  # in the place of a value that a candidate's shape does not have
CATALOGUE = "catalogue"  # in the place of a list: the sizes in which balls are sold


class Varied(FileTable):
    """The values that a varied parameter may have: any number between bounds, steps, or a list."""

    low: float | None = Field(default=None, description="lower bound")
    high: float | None = Field(default=None, description="upper bound")
    step: float | None = Field(default=None, description="from one value to the next")
    choose: Annotated[tuple[float | str, ...], Field(strict=False)] = list_field(
        "a list of numbers, or of texts",
        'the only values that it may have, instead of bounds; for shot.diameter_mm "catalogue" too',
        (),
    )

    def _problems(self) -> Iterator[Problem]:
        if bool(self.choose) == (self.low is not None or self.high is not None):
            yield Problem("", "give low and high, or choose with a list of values")
        elif self.choose and (self.step is not None or len(set(self.choose)) < 2):
            yield Problem("choose", "give two different values or more, and no step")
        elif len({isinstance(one, str) for one in self.choose}) > 1:
            yield Problem("choose", "give a list of numbers, or of texts, not both")
        elif not self.choose and (self.low is None or self.high is None):
            yield Problem("", "give both low and high")
        elif not self.choose and self.low >= self.high:  # type: ignore[operator]
            text = f"given [{self.low:g}, {self.high:g}]; low must be below high"
            yield Problem("", text)
        elif self.step is not None and not self._fits(self.high - self.low):  # type: ignore[operator]
            text = f"given {self.step:g}; give a step that fits 1 to {MAX_LEVELS - 1} times"
            yield Problem("step", f"{text} between {self.low:g} and {self.high:g}")

    def _fits(self, width: float) -> bool:
        """Return whether steps of this size give two or more, but not too many values.

        Args:
            width: distance between the bounds.
        """
        step = self.step or 0.0
        return 0.0 < step <= width * (1.0 + NEAR) and width < MAX_LEVELS * step

    @model_serializer
    def _as_written(self) -> object:
        """Return the shortest form in which a study file can write these values."""
        if self.choose:
            return {"choose": list(self.choose)}
        if self.step is None:
            return [self.low, self.high]
        return {"low": self.low, "high": self.high, "step": self.step}

    @property
    def texts(self) -> tuple[str, ...]:
        """The texts that the parameter may be; empty if it is a number."""
        return tuple(dict.fromkeys(one for one in self.choose if isinstance(one, str)))

    @property
    def ends(self) -> tuple[float | str, ...]:
        """All texts that the parameter may be, or the two bounds of a number."""
        return self.texts or self.bounds

    def place(self, value: float | str) -> float:
        """Return the number that stands for a value of the parameter, on an axis or in a search.

        It is the value itself, or the position of a text among `texts`. It is the least number for
        NONE, the value of candidates that lack the parameter.
        """
        if value == NONE and NONE not in self.texts:
            return self.bounds[0]
        return float(self.texts.index(value) if isinstance(value, str) else value)

    @property
    def bounds(self) -> tuple[float, float]:
        """Least and largest value in the unit of the file; for texts, first and last position."""
        if self.choose:
            places = self.values(False)
            return places[0], places[-1]
        if self.step is not None:
            values = self.values(False)
            return values[0], values[-1]
        assert self.low is not None
        assert self.high is not None
        return self.low, self.high

    def values(self, is_whole: bool) -> tuple[float, ...]:
        """Return all values of the parameter in order; for texts, their positions in `texts`.

        The result is empty if the parameter may be any number between the bounds.

        Args:
            is_whole: whether the parameter can only be a whole number.
        """
        if self.choose:
            return tuple(sorted({self.place(one) for one in self.choose}))
        if self.step is None and not is_whole:
            return ()
        assert self.low is not None
        assert self.high is not None
        low, high, step = self.low, self.high, self.step or 1.0
        count = math.floor((high - low) / step + NEAR) + 1
        return tuple(float(f"{low + k * step:.12g}") for k in range(count))


def _from_list(given: object) -> object:
    """Return a list [low, high] of a study file as a table; any other value stays as it is."""
    if isinstance(given, (list, tuple)) and len(given) == 2:
        return {"low": given[0], "high": given[1]}
    return given


Vary = Annotated[Varied, BeforeValidator(_from_list)]


def from_catalogue(vary: Mapping[str, Any], material: str | None) -> dict[str, Any]:
    """Return the table [vary] with "catalogue" replaced by the diameters in which balls are sold.

    Materials of balls that have several names get their first name.

    Args:
        material: shot.material of the design. If [vary] varies it, a diameter counts only if balls
            of all these materials are sold in it.
    Raises:
        CrossCheckError: the material of the balls is not given, or fewer than two diameters are
            sold between the bounds.
    """
    read = dict(vary)
    others = vary.get("shot.material")
    chosen = others.get("choose") if isinstance(others, Mapping) else None
    if isinstance(others, Mapping) and isinstance(chosen, (list, tuple)):
        known = [(one, find(one, balls())) for one in chosen]
        names = [one if found is None else found.name for one, found in known]
        read["shot.material"] = {**others, "choose": names}
    for name, given in vary.items():
        wanted = isinstance(given, Mapping) and given.get("choose") == CATALOGUE
        if not (wanted and name.startswith("shot.") and name.endswith("diameter_mm")):
            continue
        among = chosen if isinstance(chosen, (list, tuple)) else [material]
        sold = [set(one.sizes_mm) for one in balls() if one in [find(m, balls()) for m in among]]
        if not sold:
            text = 'given "catalogue", which takes a shot.material; give a list of numbers'
            raise CrossCheckError([Problem(f"vary.{name}.choose", text)])
        low, high = given.get("low", 0.0), given.get("high", math.inf)
        sizes = sorted(set.intersection(*sold))
        if not all(isinstance(one, int | float) and not math.isnan(one) for one in (low, high)):
            read[name] = {**given, "choose": sizes}  # only the bound is reported
            continue
        rest = {key: one for key, one in given.items() if key not in ("choose", "low", "high")}
        sizes = [one for one in sizes if low <= one <= high]
        if len(sizes) < 2:
            text = "fewer than two sizes are sold between low and high, see chamberopt shot"
            raise CrossCheckError([Problem(f"vary.{name}.choose", text)])
        read[name] = {**rest, "choose": sizes}
    return read


def has_key(design: Design, name: str) -> bool:
    """Return whether a design has a key, as not every chamber shape has all keys of the chamber.

    Args:
        name: dotted name of the key. All designs have the keys outside the table of the chamber.
    """
    key = name.removeprefix("chamber.").split(".")[0]
    return not name.startswith("chamber.") or key in type(design.chamber).model_fields


def setting(design: Design, name: str) -> float | str:
    """Return the design's value of a parameter that a study varies.

    The value is NONE if the design's chamber shape does not have the parameter. Raises InputError
    if the design has no value for it.
    """
    return design.setting(name) if has_key(design, name) else NONE


def designs_by_shape(design: Design, vary: Mapping[str, Varied]) -> dict[str, Design]:
    """Return copies of the design in each chamber shape that it may have, its own shape first.

    Parameters that the design's own shape lacks have their first value in the copies. Raises
    InputError if the design cannot have a shape.
    """
    own = design.chamber.shape
    found = {own: design}
    added = {name: one.ends[0] for name, one in vary.items() if not has_key(design, name)}
    for shape in vary[SHAPE].texts if SHAPE in vary else ():
        if shape == own:
            continue
        is_whole = design.chamber_keys(shape)
        values = {
            name: int(one) if is_whole[name] and not isinstance(one, str) else one
            for name, one in added.items()
            if name in is_whole
        }
        try:
            found[shape] = design.changed({SHAPE: shape, **values})
        except InputError as error:
            text = f"the design cannot have chamber.shape = {shape!r}: {error}; vary what it lacks"
            raise InputError(text) from None
    return found


def vary_problems(design: Design, name: str, varied: Varied) -> list[Problem]:
    """Return the reasons why a parameter of the design cannot vary as [vary] says.

    Args:
        name: dotted name of the parameter.
        varied: bounds, steps or values that [vary] gives it.
    """
    field = f"vary.{name}"
    if name in design.choices():
        return [Problem(field, text) for text in _choice_problems(design, name, varied)]
    is_whole = name in design.whole_numbers()
    if not is_whole and (reason := design.why_fixed(name)):
        return [Problem(field, reason)]
    if varied.texts:
        return [
            Problem(field, f"given {varied.texts[0]!r}; it is a number: give a list of numbers")
        ]
    start = design.value(name)
    low, high = varied.bounds
    if is_whole and high - low >= MAX_LEVELS:
        return [Problem(field, f"given [{low:g}, {high:g}]; give fewer than {MAX_LEVELS} values")]
    values = varied.values(is_whole)
    if is_whole and not all(float(one).is_integer() for one in values):
        return [Problem(field, "it is a whole number; give whole bounds, steps and values")]
    if not low <= start <= high:
        text = f"given [{low:g}, {high:g}], but the design starts at {start:g}"
        return [Problem(field, f"{text}; widen the bounds or change the design")]
    if values and start not in values:
        near = min(values, key=lambda one: abs(one - start))
        text = f"the design starts at {start:.12g}, which is none of its values; change the design,"
        return [Problem(field, f"{text} to {near:.12g} for example, or the values")]
    problems = []
    for bound in (low, high):
        try:
            design.changed({name: bound})
        except InputError as error:
            problems.append(Problem(field, f"the design cannot have {name} = {bound:g}: {error}"))
    return problems


def _choice_problems(design: Design, name: str, varied: Varied) -> Iterator[str]:
    """Yield the reasons why a parameter that is a text cannot vary as [vary] says."""
    allowed, start = design.choices()[name], design.setting(name)
    unknown = [one for one in varied.texts if one not in allowed]
    if not varied.texts:
        yield f"it is a text; give {{ choose = [...] }} with some of {', '.join(allowed)}"
    elif unknown:
        yield f"given {unknown[0]!r}; {toml_errors.did_you_mean(unknown[0], allowed)}"
    elif start not in varied.texts:
        yield f"the design starts at {start!r}, which is none of its values; add it"
    for one in varied.texts if not unknown and name != SHAPE else ():
        try:
            laws = design.changed({name: one}).materials
        except InputError as error:
            yield f"the design cannot have {name} = {one!r}: {error}"
            continue
        own = [key for key, law in laws if law.v0_for is None]
        if name == "shot.material" and own:
            text = f"materials.{own[0]} has numbers that are those of one material of balls"
            yield f"{text}; name an alloy there, without C0 and v0_m_s, or leave shot.material out"
            return


def _misses(designs: Mapping[str, Design], vary: Mapping[str, Varied], side: int) -> np.ndarray:
    """Return by how much a shop may miss each parameter at its lower or upper bound, shape (2, d).

    The two rows are the largest misses downward and upward by the design's tolerances, in the units
    of the file.

    Args:
        designs: a design that has the parameter, for each parameter.
        side: 0 for the lower bound, 1 for the upper bound.
    """
    ends = []
    for name, varied in vary.items():
        value, design = varied.bounds[side], designs[name]
        tolerated = design.tolerances and not varied.texts
        box = tolerance_box(design.changed({name: value})) if tolerated else {}
        ends.append(np.subtract(box.get(name, (value, value)), value))
    return np.array(ends).T


def with_key(by_shape: Mapping[str, Design], name: str) -> Design | None:
    """Return the first of the designs by chamber shape that has a key; None if none has it."""
    return next((one for one in by_shape.values() if has_key(one, name)), None)


def _where(
    by_shape: Mapping[str, Design], vary: Mapping[str, Varied], name: str
) -> tuple[int, frozenset[int]] | None:
    """Return the chamber shapes with which candidates have a parameter; None if all have it.

    The result is the position of `chamber.shape` among the parameters, and the positions of these
    shapes among its values.
    """
    if SHAPE not in vary or all(has_key(one, name) for one in by_shape.values()):
        return None
    shapes = vary[SHAPE].texts
    levels = (k for k, shape in enumerate(shapes) if has_key(by_shape[shape], name))
    return list(vary).index(SHAPE), frozenset(levels)


def _shapes(name: str) -> bool:
    """Return whether a parameter may change the chamber's shape or what balls can touch in it."""
    return name not in OF_SHOT_AND_DRIVE and not name.startswith(("process.", "materials."))


class ParameterSpace:
    """Converts values of a study's varied parameters to points of the unit cube, and back.

    `start` is the design of the study as a point (d,), `domain` says which values each coordinate
    can have, and `bounds` are low and high (d, 2) in the units of the file.

    Args:
        counts_worst: whether the worst score over the design's tolerances counts in the search,
            instead of the mean score.
    """

    def __init__(
        self, design: Design, vary: Mapping[str, Varied], counts_worst: bool = False
    ) -> None:
        self.names, self._design, self.varied = tuple(vary), design, tuple(vary.values())
        by_shape = designs_by_shape(design, vary)
        self._whole = {name for one in by_shape.values() for name in one.whole_numbers()}
        self._levels = [np.array(one.values(name in self._whole)) for name, one in vary.items()]
        self.bounds = np.array([one.bounds for one in vary.values()], dtype=float)
        low, high = self.bounds.T
        designs = {name: with_key(by_shape, name) or design for name in vary}
        misses = np.array([_misses(designs, vary, side) for side in (0, 1)]) / (high - low)
        axes = [
            Axis(len(levels), not one.texts, _where(by_shape, vary, name), _shapes(name))
            for levels, (name, one) in zip(self._levels, vary.items(), strict=True)
        ]
        self.domain = Domain(axes, misses, counts_worst)
        start = self.point_of({name: setting(design, name) for name in vary})
        self.start = self.domain.snap(start[None])[0]

    def point_of(self, values: Mapping[str, float | str]) -> np.ndarray:
        """Return the point (d,) of the unit cube for values in the units of the file."""
        places = [
            one.place(values[name]) for name, one in zip(self.names, self.varied, strict=True)
        ]
        return np.array([self._share(k, place) for k, place in enumerate(places)])

    def values_on(self, k: int, shares: np.ndarray) -> np.ndarray:
        """Return values of parameter k at coordinates of the unit cube, in the unit of the file.

        Texts are given by their positions. A coordinate between two allowed values gives a number
        between these values.

        Args:
            shares: coordinates of the unit cube, (n,).
        """
        levels, (low, high) = self._levels[k], self.bounds[k]
        if len(levels):
            return np.asarray(np.interp(shares, np.linspace(0.0, 1.0, len(levels)), levels))
        # BOBYQA can leave the bounds by rounding.
        values: np.ndarray = np.clip(low + shares * (high - low), low, high)
        return values

    def values_at(self, point: np.ndarray) -> dict[str, float | str]:
        """Return the values of the parameters at a point (d,) by name, in the units of the file."""
        # The start has the numbers of its file: the way through the unit cube could round them.
        if np.array_equal(point, self.start):
            return {name: setting(self._design, name) for name in self.names}
        values: dict[str, float | str] = {}
        snapped = self.domain.snap(point[None])
        there = self.domain.has(snapped)[0]
        for k, (name, share) in enumerate(zip(self.names, snapped[0], strict=True)):
            levels = self._levels[k]
            if not there[k]:
                values[name] = NONE
            elif texts := self.varied[k].texts:
                values[name] = texts[round(share * (len(levels) - 1))]
            elif len(levels):  # looked up: between levels, 7 could be 6.999999999999999
                values[name] = float(levels[round(share * (len(levels) - 1))])
            else:
                place = float(self.values_on(k, np.array([share]))[0])
                values[name] = self._rounded(k, place)
        return values

    def design_at(self, point: np.ndarray) -> Design:
        values = {name: one for name, one in self.values_at(point).items() if one != NONE}
        whole = {name: int(values[name]) for name in self._whole & values.keys()}
        return self._design.changed(values | whole)

    def _share(self, k: int, value: float) -> float:
        levels, (low, high) = self._levels[k], self.bounds[k]
        if len(levels):
            return float(np.interp(value, levels, np.linspace(0.0, 1.0, len(levels))))
        return float((value - low) / (high - low))

    def _rounded(self, k: int, value: float) -> float:
        low, high = self.bounds[k]
        decimals = 3 - math.floor(math.log10(high - low))
        return min(max(round(value, decimals), float(low)), float(high))


def bound_at(value: float | str, ends: Sequence[float | str]) -> str:
    """Return which bound of its parameter a number is at, "lower" or "upper"; else "".

    A number is at a bound if it differs from it by at most a thousandth of the bounds' distance. A
    text gives "".
    """
    if isinstance(value, str):
        return ""
    low, high = (float(end) for end in ends)
    near = ON_BOUND * (high - low)
    return "lower" if abs(value - low) < near else "upper" if abs(value - high) < near else ""

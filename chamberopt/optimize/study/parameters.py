"""The parameters that a study varies: which may vary, and their place in the unit cube.

A search works on points of the unit cube [0, 1]^d, where d is the number of parameters in [vary];
0 and 1 are the bounds of each. Whole numbers, such as a number of facets or replicas, cannot vary,
because the search needs scores that change gradually.
"""

from collections.abc import Mapping
from typing import Annotated

import numpy as np
from pydantic import Field

from chamberopt.common import toml_errors
from chamberopt.common.errors import InputError
from chamberopt.common.toml_errors import Problem
from chamberopt.design.design import Design

Bounds = Annotated[tuple[float, float], Field(strict=False)]  # (low, high) in the file's unit


def bound_problems(design: Design, name: str, bounds: tuple[float, float]) -> list[Problem]:
    """Reasons why a parameter of the design cannot vary between these bounds."""
    field, (low, high), numbers = f"vary.{name}", bounds, design.numbers()
    try:
        start = design.value(name)
    except InputError as error:
        if name in numbers:
            return [Problem(field, str(error).removeprefix(f"{name}: "))]
        return [Problem(field, f"unknown; {toml_errors.did_you_mean(name, numbers)}")]
    if name.startswith("process.accuracy."):
        text = "a setting of the simulation, not of the chamber; it cannot vary, see "
        return [Problem(field, f"{text}[search_accuracy]")]
    if name not in numbers:
        return [Problem(field, "a whole number cannot vary; leave it out")]
    if low >= high:
        return [Problem(field, f"given [{low:g}, {high:g}]; low must be below high")]
    if not low <= start <= high:
        text = f"given [{low:g}, {high:g}], but the design starts at {start:g}"
        return [Problem(field, f"{text}; widen the bounds or change the design")]
    problems = []
    for bound in bounds:
        try:
            design.changed({name: bound})
        except InputError as error:
            problems.append(Problem(field, f"the design cannot have {name} = {bound:g}: {error}"))
    return problems


class ParameterSpace:
    """The varied parameters of a design, mapped to the unit cube.

    Args:
        design: the start of the search, which is the point `start` of the cube, shape (d,).
        vary: bounds (low, high) in the units of the file, by dotted name, in the cube's order.
    """

    def __init__(self, design: Design, vary: Mapping[str, tuple[float, float]]) -> None:
        self.names, self._design = tuple(vary), design
        self._low, self._high = np.array(list(vary.values()), dtype=float).T
        values = np.array([design.value(name) for name in vary], dtype=float)
        self.start: np.ndarray = (values - self._low) / (self._high - self._low)

    def values_at(self, point: np.ndarray) -> dict[str, float]:
        """Values of the parameters at a point (d,), in the units of the file."""
        # The start has the numbers of its file: the way through the unit cube could round them.
        if np.array_equal(point, self.start):
            return {name: self._design.value(name) for name in self.names}
        # BOBYQA can leave the bounds by rounding.
        values = np.clip(self._low + point * (self._high - self._low), self._low, self._high)
        return dict(zip(self.names, values.tolist(), strict=True))

    def design_at(self, point: np.ndarray) -> Design:
        return self._design.changed(self.values_at(point))

"""What a design's tolerances do to its figures, as it is computed, recorded and read.

documents/tolerances.py shows every interval of a figure.
"""

from __future__ import annotations

from typing import Self

from pydantic import model_validator

from chamberopt.common.estimate import Estimate
from chamberopt.common.record_types import KnownInterval, Table


class ToleratedRange(Table):
    """A number of the design with its tolerance, and the changed value that was also simulated."""

    low: int | float
    nominal: int | float
    high: int | float
    changed_to: int | float


class EffectEnds(Table):
    """Changes of a figure at the low and at the high end of one number's tolerance."""

    low: KnownInterval
    high: KnownInterval

    @property
    def is_resolved(self) -> bool:
        """True if a change at either end is larger than its half-width."""
        return any(abs(one.value) > one.half_width for one in (self.low, self.high))


class InCorner(Table):
    """A figure in the worst corner: to first order, and as simulated there.

    agrees: True if both differ by no more than noise, or than a tenth of the change.
    """

    predicted: KnownInterval
    simulated: KnownInterval
    agrees: bool


class ToleratedFigure(Table):
    """A figure of a design over all values that the tolerances allow (their box).

    Each field that is an interval is shown as a column, by its name, in the terminal, on the page,
    on the process sheet and in the CSV table, unless documents/tolerances.py gives it words or
    leaves it out.

    nominal: value of the design as it is.
    q05, q95: values below which the figure is in 5 % and in 95 % of the box.
    lowest, highest: values in the corners of the box that are extreme to first order.
    effects: changes of the figure by each number alone.
    corner: values in the worst corner; None where it could not be simulated.
    """

    nominal: KnownInterval
    q05: KnownInterval
    q95: KnownInterval
    lowest: KnownInterval
    highest: KnownInterval
    effects: dict[str, EffectEnds]
    corner: InCorner | None

    @property
    def intervals(self) -> dict[str, Estimate]:
        """All intervals of the figure, by the names of their fields; those in the corner last."""
        own = {name: value for name, value in self if isinstance(value, Estimate)}
        if self.corner:
            own["worst_corner_simulated"] = self.corner.simulated
            own["worst_corner_predicted"] = self.corner.predicted
        return own


class ToleranceResult(Table):
    """How figures vary while all toleranced numbers of the design vary within their tolerances.

    Args:
        box: the toleranced numbers with their ranges, by dotted name.
        worst_for: figure that is lowest in the worst corner. Empty if no figure is resolved.
        corner: values of the numbers in the worst corner.
        figures: each figure's spread, by name.
    """

    box: dict[str, ToleratedRange]
    worst_for: str
    corner: dict[str, int | float]
    figures: dict[str, ToleratedFigure]
    notes: list[str]

    @model_validator(mode="after")
    def _is_of_one_box(self) -> Self:
        of_numbers = [set(one.effects) for one in self.figures.values()]
        of_numbers += [set(self.corner)] if self.corner else []
        if not self.box or any(one != set(self.box) for one in of_numbers):
            raise ValueError("other numbers than those of the box")
        if self.worst_for and self.worst_for not in self.figures:
            raise ValueError(f"worst_for: {self.worst_for!r} is none of the figures")
        return self

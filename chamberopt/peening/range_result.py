"""How far the figures of a design may be off because of numbers that nobody has measured.

These are typed values as they are computed, recorded and read. documents/ranges.py says them.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, Self

from pydantic import model_validator

from chamberopt.common.record_types import KnownInterval, Positive, Table
from chamberopt.design.ranges import UnknownNumber
from chamberopt.peening.tolerance_result import EffectEnds, ToleranceResult

NEVER_IN_WORDS = "never"


class RangedFigure(Table):
    """The range of a figure, such as mean coverage, over all groups that are not calibrated.

    low, high: ends of the range. Their half-width is the noise of the runs at the ends of the
        groups. Words take the place of a number that does not exist, such as never.
    effects: change of the figure at the low and at the high end of each group alone.
    shares: share of each group in the squared width of the range; empty if there is none.
    """

    low: KnownInterval
    high: KnownInterval
    effects: dict[str, EffectEnds]
    shares: dict[str, Positive]

    @property
    def is_resolved(self) -> bool:
        """True if an end of a group changes the figure by more than the noise of the runs."""
        return bool(self.words) or any(one.is_resolved for one in self.effects.values())

    @property
    def words(self) -> list[str]:
        """Words that take the place of an end's number: of neither, of one or of both ends."""
        return [one.in_words for one in (self.low, self.high) if one.in_words]

    @property
    def noise(self) -> float:
        """The change that the runs at the ends of the groups can surely tell from noise."""
        ends = (end for one in self.effects.values() for end in (one.low, one.high))
        return max((end.half_width for end in ends if not end.in_words), default=0.0)


class RangeResult(Table):
    """Ranges of a design's figures over all groups of its numbers that are not calibrated.

    groups: the numbers of each group, by their dotted names.
    calibrated: names of the groups that the design's calibration has fitted. The intervals of the
        figures hold their errors.
    replicas: number of replicas at each end of a group.
    cost: simulated time of all ends over that of the figures themselves.
    figures: the range of each figure by its name; that of the objective too.
    not_resolved: names of the figures that the runs at the ends do not resolve.
    """

    groups: dict[str, dict[str, UnknownNumber]]
    calibrated: list[str]
    replicas: int
    cost: Positive
    figures: dict[str, RangedFigure]
    not_resolved: list[str]

    @model_validator(mode="after")
    def _is_of_its_groups(self) -> Self:
        if not self.groups or not all(self.groups.values()):
            raise ValueError("groups: there are none, or one is empty")
        for name, one in self.figures.items():
            if set(one.effects) != set(self.groups) or not set(one.shares) <= set(self.groups):
                raise ValueError(f"figures.{name}: other groups than those of the result")
        return self


class GainAtEnd(Table):
    """Objective of a study's best design less that of another, at one end of a group."""

    group: str
    end: Literal["low", "high"]
    gain: KnownInterval


class RivalAtEnds(Table):
    """How a study's best design compares with another at the ends of each group."""

    rival: Literal["start", "runner-up"]
    gains: list[GainAtEnd]


class Spreads(NamedTuple):
    """What is told beside the figures of a design; None where it was not simulated."""

    tolerances: ToleranceResult | None = None
    ranges: RangeResult | None = None


class StudyRanges(NamedTuple):
    """Ranges of a study's best and start designs, and comparisons of the best at their ends."""

    best: RangeResult
    start: RangeResult
    rivals: list[RivalAtEnds]

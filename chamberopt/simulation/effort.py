"""How many replicas a question needs, by what the next ones would bring.

Notation
    n    number of replicas so far
    h    half-width of a figure's interval from these replicas               (figure.half_width)
    c    part of h that all replicas share: the choice of the points         (shared_half_width)
    w    half-width that is wanted: of a share, or of another figure as a share of its value

Replicas narrow what they do not share: h² - c² falls as 1 / n. Where c is nearly all of h, more
replicas bring nothing. Where a figure has no interval yet, as its windows (discs of the target)
have too few dents, the dents so far tell how many replicas it takes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from chamberopt.common.estimate import Estimate, shared_half_width
from chamberopt.design.process import MAX_POINTS

if TYPE_CHECKING:
    from chamberopt.design.design import Design
    from chamberopt.design.process import Accuracy

LITTLE = 1.0 / 8.0  # share of a half-width that is not worth more replicas
MUCH = 0.7  # share of a wanted half-width that is too much for what replicas do not narrow
# Replicas that are added until an interval is narrow enough leave it too narrow by chance. If that
# begins with 10 replicas and adds a quarter or more each time, a 95 % interval still holds the
# truth in 94 % of cases (normal replicas; 92 % from 5 on, 90 % from 3 on:
# docs/explanation/accuracy.md).
MIN_REPLICAS_TO_STOP = 10
MIN_GROWTH, MAX_GROWTH = 1.25, 2.0
MIN_GROWTH_OF_DENTS = 1.05  # while a figure has no interval, there is none to be lucky with

Reason = Literal["replicas", "accuracy", "max_replicas", "points", "user"]
"""Why a simulation ended: its number of replicas was given; the wanted accuracy was reached; the
largest number was; more replicas bring nothing, as the error is in the choice of the points; or the
user stopped it."""


Scale = Literal["quick", "thorough"]
"""How much is simulated instead of what a design asks for."""

SCALES: dict[Scale, float] = {"quick": 0.25, "thorough": 4.0}  # times the simulated time
MOST_TIME_S = 1e4  # of a replica in a design


def scaled(design: Design, scale: Scale | None) -> Design:
    """Return a design that is simulated for a part or a multiple of the time that it asks for.

    A quick one takes no more replicas than it begins with. None leaves the design as it is.
    """
    if scale is None:
        return design
    time = SCALES[scale] * design.process.accuracy.simulated_time_s
    values: dict[str, Any] = {
        "process.accuracy.simulated_time_s": float(f"{min(time, MOST_TIME_S):.4g}")
    }
    if scale == "quick":
        values["process.accuracy.objective_half_width"] = None
    return design.changed(values)


def narrows(figure: Estimate) -> bool:
    """Return whether more replicas, however many, would narrow a figure's interval by an eighth."""
    return shared_half_width(figure.shared) < (1.0 - LITTLE) * figure.half_width


class Step(NamedTuple):
    """What follows from a look at the replicas so far.

    Attributes:
        replicas: how many to have at the next look; those that there are at the end.
        stopped_by: why it ends; None if it goes on.
        note: sentence for the user at the end, "" if there is nothing to say.
        for_dents: whether the next replicas are for a figure that has no interval yet.
    """

    replicas: int
    stopped_by: Reason | None = None
    note: str = ""
    for_dents: bool = False


@dataclass(frozen=True)
class Effort:
    """The replicas that a question may take.

    first: number of replicas before the first look at the interval.
    most: largest number of replicas.
    points: number of windows in which coverage is measured.
    wanted: half-width of the interval to reach, in units of the figure; None if the number of
        replicas was given.
    """

    first: int
    most: int
    points: int
    wanted: float | None = None

    @property
    def begin(self) -> Step:
        """The first replicas."""
        return Step(self.first)

    @classmethod
    def of(cls, accuracy: Accuracy, count: int | None = None) -> Effort:
        """Return the effort that a design asks for, or that takes `count` replicas."""
        wanted, first = accuracy.objective_half_width, count or accuracy.replicas
        if count is not None or wanted is None:
            return cls(first, first, accuracy.points)
        most = accuracy.max_replicas
        return cls(min(max(first, MIN_REPLICAS_TO_STOP), most), most, accuracy.points, wanted)

    def after(
        self, done: int, figure: Estimate, growth: float, last: Step, unit: float = 1.0
    ) -> Step:
        """Return how many replicas the next look takes, or why there is none.

        Nothing but the results of the replicas decides, so that it is the same on all computers.

        Args:
            done: number of replicas so far.
            figure: the figure whose interval is to be narrow, from these replicas.
            growth: factor on the replicas that gives the figure the dents that it needs; 1 or less
                if it has them, infinite if this cannot be told.
            last: the step that led to these replicas.
            unit: what the wanted half-width counts in: 1 for a share, else the size of the figure.
        """
        if self.wanted is None:
            return Step(done, "replicas")
        wanted = self.wanted * (unit if math.isfinite(unit) else 1.0)
        width, shared = figure.half_width, shared_half_width(figure.shared)
        is_known = math.isfinite(width)
        if width <= wanted:
            return Step(done, "accuracy", _reached(done, wanted, width, last))
        if is_known:
            growth = _growth(width, shared, wanted)
            if done * growth > self.most and not narrows(figure):
                return Step(done, "points", self._by_points(done, wanted, width, shared))
        if done >= self.most:
            return Step(done, "max_replicas", self._missed(done, wanted, figure, done * growth))
        if is_known:
            if narrows(figure):  # no further than to where more replicas bring little
                growth = min(growth, _growth(width, shared, shared / (1.0 - LITTLE)))
            growth = min(max(growth, MIN_GROWTH), MAX_GROWTH)
        else:
            growth = max(growth, MIN_GROWTH_OF_DENTS) if 1.0 < growth < math.inf else MAX_GROWTH
        return Step(min(self.most, math.ceil(done * growth)), for_dents=not is_known)

    def _by_points(self, done: int, wanted: float, width: float, shared: float) -> str:
        remedy = points_remedy(self.points, shared, wanted)
        return (
            f"the wanted accuracy of ± {wanted:.3g} was not reached: after {done} replicas it is "
            f"± {width:.2g}, of which ± {shared:.2g} come from the choice of the points of the "
            f"windows, so that more replicas bring nothing; {remedy}"
        )

    def _missed(self, done: int, wanted: float, figure: Estimate, needed: float) -> str:
        width, shared = figure.half_width, shared_half_width(figure.shared)
        reached, remedy = "", "process.accuracy.max_replicas or simulated_time_s"
        if math.isfinite(width):
            reached = f" with ± {width:.2g}"
            if shared > MUCH * wanted:
                reached += f", of which ± {shared:.2g} come from the choice of the windows' points"
                remedy += " and process.accuracy.points"
            elif done < needed < math.inf:
                reached += f", and about {math.ceil(needed)} replicas would be needed"
        return (
            f"the wanted accuracy of ± {wanted:.3g} was not reached: the simulation stopped at "
            f"process.accuracy.max_replicas = {done}{reached}; raise {remedy}"
        )


def points_remedy(points: int, shared: float, wanted: float) -> str:
    """Return what to do if the choice of so many points is too much for a wanted half-width."""
    enough = points * (shared / ((1.0 - LITTLE) * wanted)) ** 2
    if enough > MAX_POINTS:
        return f"not even {MAX_POINTS:,} points would give it"
    rounded = float(f"{enough:.2g}")
    return f"raise process.accuracy.points from {points:,} to about {rounded:,.0f}"


def _growth(width: float, shared: float, wanted: float) -> float:
    """Return the factor on the replicas that narrows an interval to a wanted half-width.

    It is infinite if what the replicas share is as wide.
    """
    left = wanted**2 - shared**2
    return (width**2 - shared**2) / left if left > 0.0 else math.inf


def _reached(done: int, wanted: float, width: float, last: Step) -> str:
    reached = f"the wanted accuracy of ± {wanted:.3g} was reached after {done} replicas"
    if not last.for_dents:
        return reached
    return (
        f"{reached}, with ± {width:.2g}: so many were needed for enough dents in the windows, not "
        "for the accuracy; a larger process.accuracy.gauge_mm2 takes fewer"
    )

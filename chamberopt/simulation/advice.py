"""Advice on one physical effect of a design, from the changes that it makes.

Pilot runs find these changes, or an estimate bounds them.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from chamberopt.common.estimate import Estimate
from chamberopt.common.number_text import estimate_text, percent

MEASURED = SPEED, NEARER, FARTHER = (
    "mean normal speed",
    "coverage of the target's half nearer to the sonotrode",
    "coverage of its farther half",
)


@dataclass(frozen=True)
class Advice:
    """The changes by one physical effect, such as gravity, and the advice that follows."""

    effect: str
    on: bool  # whether the design has it on
    reason: str  # its importance by a dimensionless group
    # Change of each figure in MEASURED when the effect is switched on, with its 95 % interval. A
    # speed changes by a share of itself, a coverage by a difference.
    changes: dict[str, Estimate]
    accuracy: float  # changes below do not matter
    estimated: bool = False  # whether the changes are bounds by an estimate, without a pilot run

    @property
    def verdict(self) -> str:
        return verdict_on(self.changes, self.accuracy)

    @property
    def largest_change(self) -> float:
        return max(abs(change.value) for change in self.changes.values())

    def __str__(self) -> str:
        """Return the advice as a sentence for the user."""
        name, largest = max(self.changes.items(), key=lambda item: abs(item[1].value))
        at = f"at {percent(self.accuracy)}"
        advice = {
            ("matters", True): "needed",
            ("matters", False): "switch it on",
            ("makes no difference", True): f"off is safe {at}",
            ("makes no difference", False): f"off is safe {at}",
            ("undecided", True): f"not decided {at}: keep it",
            ("undecided", False): f"not decided {at}: on is the safe side",
        }[self.verdict, self.on]
        state = "on" if self.on else "off"
        if self.estimated:
            found = (
                f"by this estimate speed and coverage change by less than "
                f"{percent(largest.half_width)}, so that no pilot run was made"
            )
        else:
            change = estimate_text(largest, 100.0, unit_of_change(name), sign=True)
            found = f"pilot runs: it changes the {name} by {change}"
        return f"{self.effect} is {state}: {advice} ({self.reason}; {found})"


def unit_of_change(name: str) -> str:
    """Return the unit of a change, times 100, of a figure in MEASURED."""
    return "% of itself" if name == SPEED else "percentage points"


def verdict_on(changes: Mapping[str, Estimate], accuracy: float) -> str:
    """Return whether changes matter at an accuracy: "matters", "makes no difference" or
    "undecided".
    """
    if all(abs(one.value) + one.half_width <= accuracy for one in changes.values()):
        return "makes no difference"
    if any(abs(one.value) - one.half_width > accuracy for one in changes.values()):
        return "matters"
    return "undecided"

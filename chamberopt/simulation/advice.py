"""Advice on one physical effect of a design, from the changes that pilot runs found."""

from collections.abc import Mapping
from dataclasses import dataclass

from chamberopt.common.estimate import Estimate


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

    @property
    def verdict(self) -> str:
        return verdict_on(self.changes, self.accuracy)

    @property
    def largest_change(self) -> float:
        return max(abs(change.value) for change in self.changes.values())

    def __str__(self) -> str:
        """Return the advice as a sentence for the user."""
        name, largest = max(self.changes.items(), key=lambda item: abs(item[1].value))
        change = f"{100 * largest.value:+.2g} ± {100 * largest.half_width:.1g} %"
        at = f"at {100 * self.accuracy:g} %"
        advice = {
            ("matters", True): "needed",
            ("matters", False): "switch it on",
            ("makes no difference", True): f"off is safe {at}",
            ("makes no difference", False): f"off is safe {at}",
            ("undecided", True): f"not decided {at}: keep it",
            ("undecided", False): f"not decided {at}: on is the safe side",
        }[self.verdict, self.on]
        state = "on" if self.on else "off"
        return (
            f"{self.effect} is {state}: {advice} "
            f"({self.reason}; pilot runs: it changes the {name} by {change})"
        )


def verdict_on(changes: Mapping[str, Estimate], accuracy: float) -> str:
    """Return whether changes matter at an accuracy: "matters", "makes no difference" or
    "undecided".
    """
    if all(abs(one.value) + one.half_width <= accuracy for one in changes.values()):
        return "makes no difference"
    if any(abs(one.value) - one.half_width > accuracy for one in changes.values()):
        return "matters"
    return "undecided"

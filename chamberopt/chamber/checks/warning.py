"""A warning of a design: its kind, what it is about, and its words, which are never read back."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import StrEnum, auto


class WarningKind(StrEnum):
    """What is wrong with a design."""

    JAM = auto()  # a gap in which balls jam
    NARROW_GAP = auto()  # a gap narrower than a ball
    POCKET = auto()  # room for a ball, and no way in
    REST = auto()  # balls come to rest on a level face or in a gutter
    CONTACT = auto()  # part and sonotrode may hit each other
    TURNING_GAP = auto()  # a ball may be jammed between the turning part and the sonotrode
    NARROW_FLOOR = auto()  # narrower than the sonotrodes side by side
    WIDE_FLOOR = auto()  # wider than any sonotrode
    PACKING = auto()  # so many balls that they hinder each other
    HIDDEN = auto()  # some of the target or a zone is outside the chamber
    UNTOUCHED = auto()  # some of the target or a zone is touched by no ball
    MASK = auto()  # covers some of the target
    SIDE_WALL = auto()  # the part goes out through it
    WALL_IN_HOLE = auto()  # a piece of it would stand by itself in a hole of the part
    COLLISIONS = auto()  # of balls are left out, though there would be many
    PART_TURN = auto()  # takes longer than what is simulated
    CHARGE = auto()  # its mass is rounded to whole balls
    FILLET = auto()  # small for the balls
    SLOT = auto()  # narrow for the balls
    FACETS = auto()  # coverage is that of facets in place of the curved surface
    CALIBRATION = auto()  # may not hold for the design
    TO_SETTLE = auto()  # a matter to be settled before the chamber is built


# Some of the target or of a zone is not peened at all.
UNPEENED = frozenset({WarningKind.HIDDEN, WarningKind.UNTOUCHED})


@dataclass(frozen=True)
class DesignWarning:
    """A value or shape of a design that is allowed but probably not intended, with a remedy."""

    kind: WarningKind
    message: str  # what is wrong, where, and the remedy
    about: tuple[str, ...] = ()  # the surfaces beside it, or which of several values
    step: str = ""  # the one step of several in which it holds

    @property
    def subject(self) -> tuple[WarningKind, tuple[str, ...]]:
        """What is the same for a warning at another place or in another step."""
        return self.kind, self.about

    @property
    def text(self) -> str:
        """The message after the name of its step, if it has one."""
        return f"step {self.step}: {self.message}" if self.step else self.message

    @property
    def beginning(self) -> str:
        """The message up to its first comma or place, to be told in another sentence."""
        return re.split(r",| (?:at|around) \(", self.message)[0]

"""What inspect shows of its results: every option and every key is a change of one ViewState."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

from chamberopt.common.errors import InputError
from chamberopt.simulation.triangle_fields import QUANTITIES

Vector = tuple[float, float, float]

# What a plane across an axis cuts away: the side that faces the eye.
CUT_AWAY: dict[str, Vector] = {"X": (1.0, 0.0, 0.0), "Y": (0.0, -1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
FROM: Vector = (1.0, -1.6, 0.35)
SHORT = 1e-6  # of a direction; a picture of a longer or shorter one would be empty
THRESHOLDS = (98.0, 90.0, 75.0, 50.0)  # % of coverage, one after the other by the key b

KEYS = f"""1 to {len(QUANTITIES)}   the quantity
click    a triangle's numbers and its impact speeds
u        forget the triangle
b        only coverage below {", ".join(f"{one:g}" for one in THRESHOLDS)} %; all
c        cut the chamber open; drag the plane
x        cut the part too
g        chamber on, off
r        everything as at first
h        these keys on, off
q        quit"""


@dataclass(frozen=True)
class ViewState:
    """What is shown, and how.

    quantity: its name · time_s: of the coverage, None: each treatment's · below [%]: triangles covered so far or
    farther are pale · cut: the normal of a plane, into what is cut away, and a point of it [mm], None: the chamber's
    middle · cut_part: the part too, not only the chamber · chamber: whether it is drawn · triangle: whose numbers are
    shown, in one `view` or (None) in all · eye: where it is seen from, None: we choose · keys: whether they are listed.
    """

    quantity: str = "coverage"
    time_s: float | None = None
    below: float | None = None
    cut: tuple[Vector, Vector | None] | None = None
    cut_part: bool = False
    chamber: bool = True
    triangle: int | None = None
    view: int | None = None
    eye: Vector | None = None
    keys: bool = False

    def __post_init__(self) -> None:
        if self.quantity not in QUANTITIES:
            raise InputError(f"--quantity {self.quantity}: not known; {_meant(self.quantity)}")
        if self.time_s is not None and not 0.0 <= self.time_s < math.inf:
            raise InputError(f"--time-s {self.time_s:g}: give a time in s, 0 or more")
        if self.below is not None and not 0.0 < self.below <= 100.0:
            raise InputError(f"--below {self.below:g}: give a coverage above 0 and up to 100 %")
        if self.time_s is not None and self.quantity == "interval":
            raise InputError(
                "--time-s: not supported for the interval, which is known at the treatment time"
            )
        if self.cut_part and self.cut is None:
            raise InputError("--cut-part: say where with --clip X, Y or Z")

    @staticmethod
    def from_json(values: dict[str, Any]) -> ViewState:
        """From a drawing job: its lists are vectors."""
        return ViewState(
            **{name: _tuples(values[name]) for name in (field.name for field in fields(ViewState))}
        )


def parse_clip(text: str) -> tuple[Vector, Vector | None]:
    """What --clip says: X, Y or Z, and where [mm] on that axis: Z=12.5."""
    found = re.fullmatch(r"([xyzXYZ])(?:=([-+]?\d*\.?\d+))?", text.strip())
    if not found:
        raise InputError(
            f"--clip {text}: give an axis and, if not the chamber's middle, where in mm: X, Y=3 or Z=12.5"
        )
    axis, at = found.groups()
    normal = CUT_AWAY[axis.upper()]
    if at is None:
        return normal, None
    return normal, tuple(float(at) * abs(one) for one in normal)  # type: ignore[return-value]


def parse_view(text: str) -> Vector:
    """What --view says: three numbers, the direction from the part to the eye."""
    try:
        x, y, z = (float(number) for number in text.split(","))
    except ValueError:
        x = y = z = 0.0
    if not SHORT < math.hypot(x, y, z) < 1.0 / SHORT:
        raise InputError(
            f"--view {text}: give the direction from the part to the eye as X,Y,Z, such as 1,-1.4,-0.8"
        )
    return x, y, z


def pressed(look: ViewState, key: str, first: ViewState, offered: Sequence[str]) -> ViewState:
    """The look after a key; `first`: the look it began with; offered: quantities that all results have."""
    names = list(QUANTITIES)
    if key.isdigit() and 0 < int(key) <= len(names) and names[int(key) - 1] in offered:
        name = names[int(key) - 1]
        return replace(look, quantity=name, time_s=None if name == "interval" else look.time_s)
    if key == "b":
        rest = (*(one for one in THRESHOLDS if look.below is None or one < look.below), None)
        return replace(look, below=rest[0])
    if key == "c":
        return replace(
            look, cut=(CUT_AWAY["Y"], None) if look.cut is None else None, cut_part=False
        )
    if key == "x":
        return replace(look, cut=look.cut or (CUT_AWAY["Y"], None), cut_part=not look.cut_part)
    if key == "g":
        return replace(look, chamber=not look.chamber)
    if key == "u":
        return replace(look, triangle=None, view=None)
    if key == "h":
        return replace(look, keys=not look.keys)
    return first if key == "r" else look


def _meant(name: str) -> str:
    close = difflib.get_close_matches(name, QUANTITIES, 1, 0.5)
    return f"did you mean {close[0]}?" if close else f"there are {', '.join(QUANTITIES)}"


def _tuples(value: Any) -> Any:
    return tuple(_tuples(one) for one in value) if isinstance(value, list) else value

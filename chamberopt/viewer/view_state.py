"""Read the options and keys of `chamberopt inspect`, which change what its views show."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from chamberopt.common.errors import InputError
from chamberopt.pictures.camera import Vector
from chamberopt.pictures.quantities import OTHER_NAMES, QUANTITIES

Plane = tuple[Vector, Vector | None]
"""Normal of a cutting plane, towards what is cut away, and a point of it [mm]; None: the middle."""

# Normals of the cutting planes. The side towards the default view is cut away.
CUT_NORMALS: dict[str, Vector] = {"X": (1.0, 0.0, 0.0), "Y": (0.0, -1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
DEFAULT_VIEW: Vector = (1.0, -1.6, 0.35)
MIN_LENGTH = (
    1e-6  # of a view direction; a shorter or a very long direction leaves the picture empty
)
THRESHOLDS = (98.0, 90.0, 75.0, 50.0)  # % of coverage, in the order of key b

KEYS = f"""1 to {len(QUANTITIES)}   the quantity
click    a triangle's numbers and its impact speeds
u        deselect the triangle
b        only coverage below {", ".join(f"{one:g}" for one in THRESHOLDS)} %; all
c        cut the chamber open; drag the plane
x        cut the part too
g        chamber on, off
r        reset to the first view
h        these keys on, off
q        quit"""


@dataclass(frozen=True)
class ViewState:
    """What the viewer shows: quantity, time, cut, chosen triangle and so on.

    Attributes:
        quantity: name of the quantity that colours the part, a key of QUANTITIES.
        time_s: peening time [s] after which quantities that grow with time are shown. None: the
            treatment time of each result.
        below: coverage [%] from which triangles are pale; None for no threshold.
        cut: plane that cuts the chamber open; None for no cut.
        cut_part: true if the part is cut too.
        chamber: true if the chamber is drawn.
        triangle: number of the triangle whose values are shown; None for no triangle.
        view: number of the result in which the triangle's values are shown; None for all results.
        eye: direction from the part to the eye; None for a direction that shows the target.
        keys: true if the list of keys is shown.
    """

    quantity: str = "coverage"
    time_s: float | None = None
    below: float | None = None
    cut: Plane | None = None
    cut_part: bool = False
    chamber: bool = True
    triangle: int | None = None
    view: int | None = None
    eye: Vector | None = None
    keys: bool = False

    def __post_init__(self) -> None:
        if self.quantity not in QUANTITIES:
            close = difflib.get_close_matches(self.quantity, QUANTITIES, 1, 0.5)
            close = [OTHER_NAMES[self.quantity]] if self.quantity in OTHER_NAMES else close
            hint = f"did you mean {close[0]}?" if close else f"there are {', '.join(QUANTITIES)}"
            raise InputError(f"--quantity {self.quantity}: not known; {hint}")
        if self.time_s is not None and not 0.0 <= self.time_s < math.inf:
            raise InputError(f"--time-s {self.time_s:g}: give a time in s, 0 or more")
        if self.below is not None and not 0.0 < self.below <= 100.0:
            raise InputError(f"--below {self.below:g}: give a coverage above 0 and up to 100 %")
        if self.time_s is not None and self.quantity == "interval":
            raise InputError(
                "--time-s: not supported for the interval, which is known at the treatment time "
                "only; leave --time-s out"
            )
        if self.cut_part and self.cut is None:
            raise InputError("--cut-part: add --clip X, Y or Z to say where")


def parse_clip(text: str) -> Plane:
    """Return the cutting plane that the option --clip asks for, as normal and point.

    The text is X, Y or Z, the axis along the normal, and optionally the coordinate on it in mm.

    >>> parse_clip("Z=12.5")
    ((0.0, 0.0, 1.0), (0.0, 0.0, 12.5))
    """
    found = re.fullmatch(r"([xyzXYZ])(?:=([-+]?\d*\.?\d+))?", text.strip())
    if not found:
        raise InputError(
            f"--clip {text}: give an axis and, if not the chamber's middle, a place in mm: X, Y=3 "
            "or Z=12.5"
        )
    axis, place = found.groups()
    normal = CUT_NORMALS[axis.upper()]
    if place is None:
        return normal, None
    x, y, z = (float(place) * abs(one) for one in normal)
    return normal, (x, y, z)


def parse_view(text: str) -> Vector:
    """Return the direction from the part to the eye, which the option --view gives as X,Y,Z."""
    try:
        x, y, z = (float(number) for number in text.split(","))
    except ValueError:
        x = y = z = 0.0
    if not MIN_LENGTH < math.hypot(x, y, z) < 1.0 / MIN_LENGTH:
        raise InputError(
            f"--view {text}: give the direction from the part to the eye as X,Y,Z, such as "
            "1,-1.4,-0.8"
        )
    return x, y, z


def state_after_key(
    state: ViewState, key: str, first: ViewState, quantities: Sequence[str]
) -> ViewState:
    """Return what the views show after a key was pressed.

    Args:
        state: what the views showed before.
        first: the state to which key r returns.
        quantities: names of the quantities that all results have.
    """
    names = list(QUANTITIES)
    if key.isdigit() and 0 < int(key) <= len(names) and names[int(key) - 1] in quantities:
        name = names[int(key) - 1]
        return replace(state, quantity=name, time_s=None if name == "interval" else state.time_s)
    if key == "b":
        lower = [one for one in THRESHOLDS if state.below is None or one < state.below]
        return replace(state, below=lower[0] if lower else None)
    if key == "c":
        opened = (CUT_NORMALS["Y"], None) if state.cut is None else None
        return replace(state, cut=opened, cut_part=False)
    if key == "x":
        cut = state.cut or (CUT_NORMALS["Y"], None)
        return replace(state, cut=cut, cut_part=not state.cut_part)
    if key == "g":
        return replace(state, chamber=not state.chamber)
    if key == "u":
        return replace(state, triangle=None, view=None)
    if key == "h":
        return replace(state, keys=not state.keys)
    return first if key == "r" else state

"""A round chamber with any profile: steps, a dome, a cone, a groove.

     ______       [0 or r, z]     ceiling: flat from the last point to the axis
    /      \\
   |___   __|     [r, z]          shoulders may jut in or out
     |     |
     |_____|      [r, 0]          floor: sonotrode
"""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator

from chamberopt.common.toml_errors import CrossCheckError, Problem
from chamberopt.common.toml_fields import Pair, Several, list_field
from chamberopt.design.shapes.base import RoundChamber
from chamberopt.design.shapes.outlines import MIN_LENGTH, MIN_LENGTH_MM, find_contact


class Revolve(RoundChamber):
    """A round chamber whose side wall is a line of points turned about the axis."""

    ceiling_key: ClassVar[str] = "profile_mm"

    shape: Literal["revolve"]
    profile_mm: Annotated[Several[Pair], Field(min_length=2, max_length=200)] = list_field(
        "2 to 200 points [[r, z], ...] in mm, the first at z = 0, none beyond 2000",
        "the wall from the sonotrode's rim up to the ceiling; r = 0 at its end: on the axis",
    )

    @field_validator("profile_mm")
    @classmethod
    def _goes_up_from_the_sonotrode(cls, points: tuple[Pair, ...]) -> tuple[Pair, ...]:
        fault = _find_fault(points)
        if fault:
            raise CrossCheckError([Problem("", fault)])
        return points

    def upright(self) -> np.ndarray:
        """Return the profile's points (radius, height) [m], (n, 2), continued to the axis."""
        return _to_the_axis(self.profile_mm)

    def widths_mm(self) -> dict[str, float]:
        """Return the largest diameter or the height [mm], whichever is smaller, by its key."""
        r, z = np.array(self.profile_mm).T
        return {"profile_mm": float(min(2.0 * r.max(), z.max()))}


def _to_the_axis(points: tuple[Pair, ...]) -> np.ndarray:
    """Return points (radius, height) given in mm as an array in metres that ends on the axis.

    A flat ceiling gets one more point, its middle.
    """
    line = 1e-3 * np.array(points)
    return line if line[-1, 0] == 0.0 else np.r_[line, [[0.0, line[-1, 1]]]]


def _find_fault(points: tuple[Pair, ...]) -> str | None:
    """Return why the points (radius, height) [mm] cannot be a profile; None if they can."""
    if points[0][1] != 0.0:
        return f"begins at z = {points[0][1]:g}; the rim is on the sonotrode, at z = 0"
    for number, (r, z) in enumerate(points):
        is_first, is_last = number == 0, number == len(points) - 1
        r_allowed = MIN_LENGTH_MM <= r <= 2000 or (is_last and r == 0)
        if not (r_allowed and (MIN_LENGTH_MM <= z <= 2000 or is_first)):
            return (
                f"given {[r, z]} as point {number}; allowed: [r, z] from {MIN_LENGTH_MM:g} to "
                "2000 mm, z = 0 for the first alone, r = 0 for the last alone"
            )
    line = _to_the_axis(points)
    short = np.flatnonzero(np.hypot(*np.diff(line, axis=0).T) < MIN_LENGTH)
    if short.size:
        next_to = f"is on or next to point {short[0]}, the first being point 0"
        return f"point {short[0] + 1} {next_to}; leave it out"
    contact = find_contact(line)
    if contact is not None:
        place = np.round(1e3 * contact, 6).tolist()
        return f"crosses, touches or folds back on itself by the point {place}"
    return None

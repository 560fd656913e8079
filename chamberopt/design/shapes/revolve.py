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
from chamberopt.common.toml_fields import Pair, list_field
from chamberopt.design.shapes.construction.limits import LEAST, LEAST_MM
from chamberopt.design.shapes.construction.profile import crossing
from chamberopt.design.shapes.round import RoundChamber


class Revolve(RoundChamber):
    """Round, the side wall a line of points turned about the axis."""

    ceiling_key: ClassVar[str] = "profile_mm"

    shape: Literal["revolve"]
    profile_mm: Annotated[tuple[Pair, ...], Field(strict=False, min_length=2, max_length=200)] = (
        list_field(
            "2 to 200 points [[r, z], ...] in mm, the first at z = 0, none beyond 2000",
            "the wall from the sonotrode's rim up to the ceiling; r = 0 at its end: on the axis",
        )
    )

    @field_validator("profile_mm")
    @classmethod
    def _goes_up_from_the_sonotrode(cls, profile: tuple[Pair, ...]) -> tuple[Pair, ...]:
        wrong = _fault(profile)
        if wrong:
            raise CrossCheckError([Problem("", wrong)])
        return profile

    def upright(self) -> np.ndarray:
        """The points, to the axis."""
        return _line(self.profile_mm)

    def widths_mm(self) -> dict[str, float]:
        """Across or up, whichever is less."""
        r, z = np.array(self.profile_mm).T
        return {"profile_mm": float(min(2.0 * r.max(), z.max()))}


def _line(profile: tuple[Pair, ...]) -> np.ndarray:
    """Points (r, z) m with the middle of the ceiling, if it is flat."""
    line = 1e-3 * np.array(profile)
    return line if line[-1, 0] == 0.0 else np.r_[line, [[0.0, line[-1, 1]]]]


def _fault(profile: tuple[Pair, ...]) -> str | None:
    """Why the points are no profile."""
    if profile[0][1] != 0.0:
        return f"begins at z = {profile[0][1]:g}; the rim is on the sonotrode, at z = 0"
    for number, (r, z) in enumerate(profile):
        first, last = number == 0, number == len(profile) - 1
        if not (LEAST_MM <= r <= 2000 or (last and r == 0)) or not (LEAST_MM <= z <= 2000 or first):
            allowed = f"[r, z] from {LEAST_MM:g} to 2000 mm, z = 0 for the first alone, r = 0 for the last alone"
            return f"given {[r, z]} as point {number}; allowed: {allowed}"
    line = _line(profile)
    short = np.flatnonzero(np.hypot(*np.diff(line, axis=0).T) < LEAST)
    if short.size:
        return f"point {short[0] + 1} is on or next to point {short[0]}, the first being point 0; leave it out"
    where = crossing(line)
    if where is not None:
        return f"crosses, touches or folds back on itself by the point {np.round(1e3 * where, 6).tolist()}"
    return None

"""Find the Almen intensity that is usual for the metal and the thickness under a target."""

from __future__ import annotations

from typing import TYPE_CHECKING

from chamberopt.design.intensity import THIN_MM, WantedIntensity, usual_intensity
from chamberopt.design.materials import alloys, find
from chamberopt.geometry.thickness import depth_below

if TYPE_CHECKING:
    from chamberopt.chamber.part import Part
    from chamberopt.design.design import Design

DEEPEST = 10e-3  # m that is measured under a target


def thickness_under_target(part: Part) -> float:
    """Return the thickness [m] by which an intensity is usual for the target of a part.

    It is that of the middle of its area, unless a quarter of it is too thin for any usual one.
    """

    def depth(share: float) -> float:
        return depth_below(part.vertices, part.triangles, part.target, share, DEEPEST)

    thin = depth(0.25)
    return thin if 1e3 * thin < THIN_MM else depth(0.5)


def usual_for_target(design: Design, part: Part) -> WantedIntensity | None:
    """Return the range that is usual for the target of a design; None if none is known.

    Args:
        part: the part of the design, as it stands in the chamber.
    """
    name = design.materials.part.alloy
    metal = find(name, alloys()) if name else None
    return None if metal is None else usual_intensity(metal, thickness_under_target(part))

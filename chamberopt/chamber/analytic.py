"""Chamber -> analytical cavity: exact planes and a true circle, where the chamber is a cylinder, box or prism.

The paper's first system beside its second: the same chamber without facets, in the same event loop. Possible where the
part is the lid and nothing reaches in.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.build import TAG_PART, TAG_SONOTRODE, TAG_WALL
from chamberopt.common.errors import InputError
from chamberopt.design.shapes.cylinder import Cylinder
from chamberopt.geometry.triangles import area_vectors, areas, tetrahedron_volumes

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from sim_core import AnalyticCavity, ImpactLog

FLAT = 1e-7  # m: a corner this near a plane is in it; CAD files round to a tenth of that, dents are a thousand times it
UPRIGHT = 1e-6  # of a side's normal along z
SAME_VOLUME = 1e-6  # relative: by which the chamber may fall short of the convex prism about it
NO_AREA = 1e-15  # m²: a triangle smaller than this has no direction
REMEDY = "simulate without the analytical cavity"


def analytic_cavity(design: Design, chamber: Chamber) -> AnalyticCavity:
    """The exact cavity that a design's chamber stands for: a true circle for the shape "cylinder", else its polygon.

    Raises InputError, naming what is in the way, where the chamber is no cylinder, box or prism with the part for its
    lid, or an effect is asked for that is not supported there.
    """
    from sim_core import cylinder_cavity, prism_cavity

    for name in ("part_turn", "rest"):
        if getattr(design.effects, name):
            raise InputError(
                f"effects.{name}: not supported with an analytical cavity; leave it out, or {REMEDY}"
            )
    bottom, top = (float(z) for z in (chamber.vertices[:, 2].min(), chamber.vertices[:, 2].max()))
    _require_plain(chamber, bottom, top)
    outline = _outline(chamber, bottom, top)
    tags = (TAG_SONOTRODE, TAG_PART, TAG_WALL)
    if not isinstance(design.chamber, Cylinder):
        return prism_cavity(outline, bottom, top, tags)
    off = float(np.abs(np.linalg.norm(outline, axis=1) - 0.5 * design.chamber.diameter).max())
    if off > FLAT:
        raise _refused(f"its side is not a circle of chamber.diameter_mm, by {1e3 * off:.3g} mm")
    return cylinder_cavity(design.chamber.diameter, bottom, top, tags)


def cavity_note(cavity: AnalyticCavity) -> str:
    """A note for the result: what was simulated in place of the chamber's triangles."""
    what = "cylinder" if cavity.radius is not None else f"prism of {len(cavity.outline)} sides"
    return f"simulated in an analytical cavity, an exact {what} of {1e6 * cavity.volume:.5g} cm³, not the mesh"


def impacts_on_chamber(impacts: ImpactLog, chamber: Chamber) -> ImpactLog:
    """The impacts on the ceiling of an analytical cavity, booked on the chamber's triangles under them."""
    from sim_core import find_triangles

    ceiling = np.flatnonzero(chamber.tags == TAG_PART)
    corners = chamber.vertices[chamber.triangles[ceiling]]
    return replace(
        impacts, triangle=ceiling[find_triangles(corners, impacts.position)].astype(np.int32)
    )


def _refused(why: str) -> InputError:
    return InputError(f"the chamber is no cylinder, box or prism: {why}; {REMEDY}")


def _require_plain(chamber: Chamber, bottom: float, top: float) -> None:
    """InputError for a surface that is neither the sonotrode below, nor the part above, nor an upright wall."""
    area = areas(chamber.vertices, chamber.triangles)
    heights = chamber.vertices[chamber.triangles][:, :, 2]
    along = area_vectors(chamber.vertices, chamber.triangles)[:, 2]
    floor, ceiling = heights.max(axis=1) < bottom + FLAT, heights.min(axis=1) > top - FLAT
    upright = np.abs(along) <= UPRIGHT * np.linalg.norm(
        area_vectors(chamber.vertices, chamber.triangles), axis=1
    )
    seen = area > NO_AREA
    for tag, own, name, wanted in (
        (TAG_PART, ceiling, "the part reaches into the cavity", "a flat ceiling"),
        (TAG_SONOTRODE, floor, "the sonotrode is not flat", "a flat floor"),
        (TAG_WALL, upright & ~floor & ~ceiling, "the wall is not upright", "upright sides"),
    ):
        wrong = np.flatnonzero(seen & (chamber.tags == tag) & ~own)
        if len(wrong):
            z = float(heights[wrong].mean(axis=1)[area[wrong].argmax()])
            raise _refused(f"{name} at z = {1e3 * z:.4g} mm, where {wanted} is needed")


def _outline(chamber: Chamber, bottom: float, top: float) -> np.ndarray:
    """The convex outline (n, 2) [m], anticlockwise; InputError where the chamber does not fill the prism over it."""
    from scipy.spatial import ConvexHull

    floor = np.unique(chamber.triangles[chamber.tags == TAG_SONOTRODE])
    hull = ConvexHull(chamber.vertices[floor, :2])
    outline = _without_straight_corners(hull.points[hull.vertices])
    missing = 1.0 - float(tetrahedron_volumes(chamber.vertices, chamber.triangles).sum()) / (
        hull.volume * (top - bottom)
    )
    if abs(missing) > SAME_VOLUME:
        raise _refused(
            f"its sides are not convex: it lacks {missing:.2g} of the volume between its floor and ceiling"
        )
    return outline


def _without_straight_corners(outline: np.ndarray) -> np.ndarray:
    """The corners (n, 2) at which the outline turns: cutting leaves some in the middle of a side."""
    before, after = np.roll(outline, 1, axis=0), np.roll(outline, -1, axis=0)
    chord = after - before
    off = chord[:, 0] * (outline - before)[:, 1] - chord[:, 1] * (outline - before)[:, 0]
    return np.asarray(outline[np.abs(off) > FLAT * np.hypot(*chord.T)])

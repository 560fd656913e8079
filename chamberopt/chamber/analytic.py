"""Analytical cavity of a chamber: exact planes and a true circle for a cylinder, box or prism.

It describes the same chamber without a mesh of triangles, and the same event loop simulates it. The
part must be the chamber's lid, and nothing may reach into the chamber.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.design.shape_surface import TAG_PART, TAG_SONOTRODE, TAG_WALL
from chamberopt.design.shapes.straight import Cylinder
from chamberopt.geometry.triangles import area_vectors, tetrahedron_volumes

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from sim_core import AnalyticCavity, ImpactLog

# Distance [m] within which a corner counts as in a plane. CAD files round to a tenth of this
# distance. Dents are a thousand times as large.
FLATNESS = 1e-7
MAX_NORMAL_Z = 1e-6  # share of an upright side's normal along z
VOLUME_TOLERANCE = 1e-6  # relative difference allowed between the chamber and its convex prism
MIN_AREA = 1e-15  # m²: the direction of a smaller triangle is not checked
REMEDY = "simulate without the analytical cavity"


def analytic_cavity(design: Design, chamber: Chamber) -> AnalyticCavity:
    """Return the exact cavity of a chamber, whose walls are not made of triangles.

    In plan it is a true circle for the shape "cylinder" and a polygon for other shapes.

    Raises:
        InputError: the chamber is not a cylinder, box or prism with the part as its lid, or the
            part turns.
    """
    from sim_core import cylinder_cavity, prism_cavity

    if design.effects.part_turn is not None:
        why = "not supported with an analytical cavity"
        raise InputError(f"effects.part_turn: {why}; leave it out, or {REMEDY}")
    bottom, top = float(chamber.vertices[:, 2].min()), chamber.height
    _require_flat_or_upright(chamber, bottom, top)
    outline = _outline(chamber, bottom, top)
    tags = (TAG_SONOTRODE, TAG_PART, TAG_WALL)
    if not isinstance(design.chamber, Cylinder):
        return prism_cavity(outline, bottom, top, tags)
    off = float(np.abs(np.linalg.norm(outline, axis=1) - 0.5 * design.chamber.diameter).max())
    if off > FLATNESS:
        raise _refused(f"its side is not a circle of chamber.diameter_mm, by {1e3 * off:.3g} mm")
    return cylinder_cavity(design.chamber.diameter, bottom, top, tags)


def cavity_note(cavity: AnalyticCavity) -> str:
    """Return a note that names the analytical cavity that is simulated in place of the mesh."""
    what = "cylinder" if cavity.radius is not None else f"prism of {len(cavity.outline)} sides"
    volume = f"{1e6 * cavity.volume:.5g} cm³"
    return f"simulated in an analytical cavity, an exact {what} of {volume}, not the mesh"


def impacts_on_chamber(impacts: ImpactLog, chamber: Chamber) -> ImpactLog:
    """Return impacts on an analytical cavity's ceiling as impacts on the triangles of the part.

    Args:
        impacts: recorded impacts, all on the ceiling, which is the part.
    """
    from sim_core import find_triangles

    ceiling = np.flatnonzero(chamber.tags == TAG_PART)
    found = find_triangles(chamber.vertices[chamber.triangles[ceiling]], impacts.position)
    return replace(impacts, triangle=ceiling[found].astype(np.int32))


def _refused(why: str) -> InputError:
    return InputError(f"the chamber is not a cylinder, box or prism: {why}; {REMEDY}")


def _require_flat_or_upright(chamber: Chamber, bottom: float, top: float) -> None:
    """Raise InputError unless sonotrode and part are flat, and the wall between them upright.

    Args:
        bottom, top: heights of the floor and of the ceiling [m].
    """
    vectors = area_vectors(chamber.vertices, chamber.triangles)
    area = np.linalg.norm(vectors, axis=1)
    heights = chamber.vertices[chamber.triangles][:, :, 2]
    floor, ceiling = heights.max(axis=1) < bottom + FLATNESS, heights.min(axis=1) > top - FLATNESS
    upright = np.abs(vectors[:, 2]) <= MAX_NORMAL_Z * area
    checked = area > MIN_AREA
    for tag, own, name, wanted in (
        (TAG_PART, ceiling, "the part reaches into the cavity", "a flat ceiling"),
        (TAG_SONOTRODE, floor, "the sonotrode is not flat", "a flat floor"),
        (TAG_WALL, upright & ~floor & ~ceiling, "the wall is not upright", "upright sides"),
    ):
        wrong = np.flatnonzero(checked & (chamber.tags == tag) & ~own)
        if len(wrong):
            z = float(heights[wrong].mean(axis=1)[area[wrong].argmax()])
            raise _refused(f"{name} at z = {1e3 * z:.4g} mm, where {wanted} is needed")


def _outline(chamber: Chamber, bottom: float, top: float) -> np.ndarray:
    """Return the convex outline (n, 2) [m] of the floor.

    Raises InputError if the chamber is not the straight prism over this outline.

    Args:
        bottom, top: heights of the floor and of the ceiling [m].
    """
    from scipy.spatial import ConvexHull

    floor = np.unique(chamber.triangles[chamber.tags == TAG_SONOTRODE])
    hull = ConvexHull(chamber.vertices[floor, :2])
    volume = float(tetrahedron_volumes(chamber.vertices, chamber.triangles).sum())
    missing = 1.0 - volume / (hull.volume * (top - bottom))
    if abs(missing) > VOLUME_TOLERANCE:
        raise _refused(
            f"its sides are not convex: it lacks {missing:.2g} of the volume between its floor and "
            "ceiling"
        )
    outline = hull.points[hull.vertices]
    before, after = np.roll(outline, 1, axis=0), np.roll(outline, -1, axis=0)
    chord, arm = (after - before).T, (outline - before).T
    turns = np.abs(chord[0] * arm[1] - chord[1] * arm[0]) > FLATNESS * np.hypot(*chord)
    return np.asarray(outline[turns])  # cutting leaves corners within a straight side too

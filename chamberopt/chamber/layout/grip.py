"""Tell by what an end of a part is gripped: flat faces that jaws close on, and its metal."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.checks.openings import find_openings, walls_end_at
from chamberopt.chamber.layout.end import DEEP
from chamberopt.chamber.layout.target import area_in_mm2, nearest_axis
from chamberopt.chamber.matters import MatterKind
from chamberopt.common.number_text import plain
from chamberopt.geometry.cut import cut_at_box, facets
from chamberopt.geometry.faces import Faces
from chamberopt.geometry.outline import (
    convex_hull,
    distances_in_plan,
    fitted_circle,
    frame_along,
    narrowest_rectangle,
)
from chamberopt.geometry.thickness import depth_below
from chamberopt.geometry.triangles import centre_of_mass, unit_normals
from sim_core import computed_once

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber

FLAT_DEG = 1.0  # largest angle in a flat face: fillets beside it are no part of it
# Flat faces looked at for jaws; least area of each [m²]; of two, share of all that stands out, and
# how far apart they are over the part's size: no vice takes a shaft by its ends.
MOST_FLAT, LEAST_JAW, LEAST_OF_ALL, JAWS_OPEN = 20, 30e-6, 0.15, 0.8
SEEN_OUT = 1e-3  # m by which a part stands out of a side
# Of a round face: how far its corners may be off a circle, over its radius, the sum of its area
# vectors over its area, and the least share of its area that looks along any way across its axis.
# Half of it does of a full round, and 0.38 where two flats opposite leave four fifths of its girth.
OFF_ROUND, ALL_WAYS, EACH_WAY = 0.02, 0.2, 0.38
# Faces that are looked at for it, which end where they turn by so much; cosine up to which a face
# is a side; and least share of a round's surface that a keyway and facets leave.
MOST_FACES, CREASE_DEG, LEVEL, SLOTTED = 8, 30.0, 0.02, 0.8
# An end is too thin to hold a part by if half of the metal between the jaws is thinner than this,
# [m] or over the part's least size, and the centre of mass lies further beyond them than so many
# lengths of the grip. Metal is measured to so much [m]; sides of an end lean by less than a cosine.
THIN_METAL, THIN_SHARE, FAR_OUT, THICK, SIDEWAYS = 4e-3, 0.15, 3.0, 20e-3, 0.7


ON_WALLS = "clamps above it that press it down on the walls, on which it lies"


class Clamp(NamedTuple):
    """What a part is clamped by outside of its chamber."""

    text: str  # empty if nothing is named
    is_shallow: bool = False  # true if jaws reach less deep than they need
    # Along which jaws press on flat faces, a unit vector in the frame of the vertices.
    way: tuple[float, float, float] | None = None


def flat_jaws(
    vertices: np.ndarray,
    triangles: np.ndarray,
    outside: np.ndarray,
    least_of_all: float = LEAST_OF_ALL,
) -> Clamp:
    """Return the largest two flat faces, back to back, that stand out of a chamber.

    The text is empty where there are none as large as jaws take.

    Args:
        vertices, triangles: the posed part [m].
        outside: area of each triangle that may be clamped [m²], (m,).
        least_of_all: share of all that stands out that both have at least.
    """
    faces = Faces(vertices, triangles, FLAT_DEG)
    free = np.where(
        faces.are_flat(FLAT_DEG), np.bincount(faces.of_triangle, outside, faces.count), 0.0
    )
    largest = np.argsort(-free, kind="stable")[:MOST_FLAT]
    best, found = (False, LEAST_JAW), Clamp("")
    longest = float(np.ptp(vertices, axis=0).max())
    for k, one in enumerate(largest):
        for other in largest[k + 1 :]:
            pair = [int(one), int(other)]
            area = float(min(free[one], free[other]))
            ways = faces.normal(int(one)), faces.normal(int(other))
            is_little = free[one] + free[other] < least_of_all * outside.sum()
            is_small = is_little or area <= LEAST_JAW
            if is_small or ways[0] @ ways[1] > -np.cos(np.radians(FLAT_DEG)):
                continue
            places = faces.place(int(one)), faces.place(int(other))
            apart_by = ways[0] @ (places[0] - places[1])
            if not 0.0 < apart_by < JAWS_OPEN * longest:  # the sides of a slot, or its far ends
                continue
            out = [vertices[triangles[(faces.of_triangle == k) & (outside > 0.0)]] for k in pair]
            depth = min(_depth(*each) for each in zip(out, ways, free[pair], strict=True))
            is_shallow = depth < DEEP
            if (not is_shallow, area) <= best:
                continue
            best = not is_shallow, area
            text = "jaws on its flat faces that look to " + " and ".join(
                f"{nearest_axis(way)} ({area_in_mm2(float(free[face]))} of it)"
                for way, face in zip(ways, pair, strict=True)
            )
            if is_shallow:
                is_told = f"{1e3 * depth:.2g} mm of these faces: jaws need {1e3 * DEEP:g} mm"
                text += f"; {MatterKind.SHALLOW_GRIP}, {is_told}"
            x, y, z = ways[0].tolist()
            found = Clamp(text, is_shallow, (x, y, z))
    return found


def _depth(corners: np.ndarray, way: np.ndarray, area: float) -> float:
    """Return how deep jaws reach over a piece of a flat face on the average [m].

    Args:
        corners: of its triangles, (k, 3, 3) [m].
        way: normal of the face, (3,).
        area: of the piece [m²].
    """
    hull = convex_hull(corners.reshape(-1, 3) @ frame_along(way)[:2].T)
    if hull is None:
        return 0.0
    long, short = narrowest_rectangle(hull)[1]
    return float(min(short, area / long))


def sides_out(chamber: Chamber) -> list[str]:
    """Return the sides at which a part stands out of its chamber, such as "+x", sorted."""
    part = chamber.part
    low, high = (end(chamber.vertices, axis=0) for end in (np.min, np.max))
    beyond = high - part.vertices.max(axis=0), part.vertices.min(axis=0) - low
    signs = zip(("+", "-"), beyond, strict=True)
    return sorted(
        f"{sign}{'xyz'[k]}" for sign, room in signs for k in range(3) if room[k] < -SEEN_OUT
    )


def free_outside(chamber: Chamber) -> np.ndarray:
    """Return what of each triangle of a part stands out of its chamber and may be clamped [m²].

    What is buried in another body of the part, or under a mask, is not outside.
    """
    part = chamber.part
    low, high = (end(chamber.vertices, axis=0) for end in (np.min, np.max))
    corners = part.vertices[part.triangles]
    is_beyond = ((corners < low) | (corners > high)).any(axis=(1, 2))
    return np.where(is_beyond & ~part.target, part.area - chamber.exposed_area, 0.0)


@computed_once(4)
def outside_clamp(chamber: Chamber, turns: bool = False) -> Clamp:
    """Return what a part that stands out of its chamber is clamped by there, by its form.

    A part that lies on the walls is pressed down on them. For others it is two flat faces that jaws
    reach far over, or else the largest round, or else any two flat faces, as the sides of a blade's
    platform: its airfoil is no place for jaws. The text is empty if there is none of them.

    Args:
        turns: a drive turns the part, so that a round is taken by what turns with it.
    """
    if walls_end_at(find_openings(chamber)) is not None:
        return Clamp(ON_WALLS, way=(0.0, 0.0, 1.0))
    part, outside = chamber.part, free_outside(chamber)
    jaws = flat_jaws(part.vertices, part.triangles, outside)
    if jaws.text and not jaws.is_shallow:
        return jaws
    axes = {"xyz".index(side[-1]) for side in sides_out(chamber)}
    if radius := _round_end(part.vertices, part.triangles, outside, axes):
        by = "a collet or chuck, such as" if turns else "a collet or vee blocks"
        return Clamp(f"{by} round its diameter of {plain(2e3 * radius)} mm")
    if jaws.text:
        return jaws
    return flat_jaws(part.vertices, part.triangles, outside, least_of_all=0.0)


def _round_end(
    vertices: np.ndarray, triangles: np.ndarray, outside: np.ndarray, axes: Iterable[int]
) -> float:
    """Return the radius [m] of the largest round that stands out of a chamber; 0 without any.

    Args:
        vertices, triangles: the part, (n, 3) [m] and (m, 3).
        outside: area of each triangle that may be clamped [m²], (m,).
        axes: numbers of the axes along which it stands out.
    """
    faces, corners = Faces(vertices, triangles, CREASE_DEG), vertices[triangles]
    normals, found = unit_normals(corners), [(0.0, 0.0)]
    for axis in axes:
        aside = np.where(np.abs(normals[:, axis]) < LEVEL, outside, 0.0)
        areas = np.bincount(faces.of_triangle, aside, faces.count)
        for face in np.argsort(-areas, kind="stable")[:MOST_FACES]:
            own = np.where(faces.of_triangle == face, aside, 0.0)
            found.append((float(areas[face]), _round_radius(corners, own, axis)))
    return max((one for one in found if one[1] > 0.0), default=(0.0, 0.0))[1]


def _round_radius(corners: np.ndarray, outside: np.ndarray, axis: int) -> float:
    """Return the radius [m] of what stands out if it is a round about an axis; 0 if it is none.

    All of it is as far from the axis, its flat sides too, it goes all round, it is no bore, and it
    is long enough for a clamp. The four edges of a slab are as far from its axis, and so are the
    ends of the sides of a rectangle with rounded corners: neither is a round.

    Args:
        corners: of all triangles of the part [m], (m, 3, 3).
        outside: area of each that belongs to the surface and may be clamped [m²], (m,).
        axis: number of the axis.
    """
    own = outside > 0.0
    if not own.any():
        return 0.0
    across = np.delete(corners[own], axis, axis=2).reshape(-1, 2)
    middle, radius = fitted_circle(across)
    off = np.abs(np.linalg.norm(across - middle, axis=1) - radius).max()
    inner = distances_in_plan(across.reshape(-1, 3, 2), middle).min()
    is_near = inner < (math.cos(math.radians(0.5 * CREASE_DEG)) - OFF_ROUND) * radius
    normal, area = np.delete(unit_normals(corners[own]), axis, axis=1), outside[own]
    least = float(np.linalg.eigvalsh((normal.T * area) @ normal)[0])
    is_even = np.linalg.norm(area @ normal) < ALL_WAYS * area.sum() and (
        least > EACH_WAY * area.sum()
    )
    aside = np.delete(corners[own].mean(axis=1), axis, axis=1) - middle
    is_outer = float(area @ (normal * aside).sum(axis=1)) > 0.0
    is_long = float(area.sum()) >= 2.0 * math.pi * radius * DEEP * SLOTTED
    is_round = off < OFF_ROUND * radius and not is_near and is_even
    return radius if is_round and is_outer and is_long else 0.0


class ThinGrip(NamedTuple):
    """A grip on an end that is too thin for the part that stands out of it."""

    metal: float  # thickness of half of the metal between the jaws at most [m]
    overhang: float  # of the centre of mass beyond the jaws [m]

    @property
    def text(self) -> str:
        """What is to be settled."""
        return (
            f"{MatterKind.THIN_GRIP}, on {1e3 * self.metal:.2g} mm of metal, with the centre of "
            f"mass {1e3 * self.overhang:.2g} mm beyond the jaws: hold the part by another end, or "
            "take a target that leaves one free (--target)"
        )


class Gripped(NamedTuple):
    """An end between jaws, seen along the axis in which it points, divided where they end."""

    vertices: np.ndarray  # of the whole part [m], (n, 3), the last coordinate along the axis
    triangles: np.ndarray  # (m, 3)
    sides: np.ndarray  # marks those of the end's sides between the jaws, (m,)
    level: float  # place of the jaws' lower end [m]


def gripped(posed: np.ndarray, triangles: np.ndarray, axis: np.ndarray, grip: float) -> Gripped:
    """Return the end of a part that points along an axis, between jaws.

    Args:
        posed, triangles: the part in its pose, (n, 3) [m] and (m, 3).
        axis: unit vector in the chamber's frame, (3,).
        grip: length of the end between the jaws [m].
    """
    seen = posed @ frame_along(axis).T
    low, high = seen.min(axis=0) - 1e-3, seen.max(axis=0) + 1e-3
    level = float(seen[:, 2].max()) - grip
    low[2] = level
    beyond = seen[triangles][..., 2].max(axis=1) > level
    cut = cut_at_box(facets(seen, triangles), np.array([low, high]), beyond)
    corners = cut.vertices[cut.triangles]
    inside = corners[..., 2].mean(axis=1) > level
    aside = np.abs(unit_normals(corners)[:, 2]) < SIDEWAYS
    return Gripped(cut.vertices, cut.triangles, inside & aside, level)


def thin_grip(
    posed: np.ndarray, triangles: np.ndarray, axis: np.ndarray, grip: float
) -> ThinGrip | None:
    """Return how thin the end is that a holder grips, if it is too thin for the part; else None.

    Args:
        posed, triangles, axis, grip: those of _gripped.
    """
    beyond = float((posed @ axis).max()) - grip - float(centre_of_mass(posed, triangles) @ axis)
    if beyond <= FAR_OUT * grip:
        return None
    end = gripped(posed, triangles, axis, grip)
    metal = depth_below(end.vertices, end.triangles, end.sides, 0.5, THICK)
    least = max(THIN_METAL, THIN_SHARE * float(np.ptp(posed, axis=0).min()))
    return ThinGrip(metal, beyond) if metal < least else None

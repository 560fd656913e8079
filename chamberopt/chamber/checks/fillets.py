"""Warnings about shot that is large for the fillets and slots of the target and the zones.

Shot larger than half a fillet's radius, or a quarter of a slot's width, peens the fillet or slot
less than the surface beside it, even if it touches everything.

Source: ASTM B851, as quoted in docs/how_to/drawing.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.checks.jams import MAX_COSINE
from chamberopt.chamber.checks.place_names import one_of
from chamberopt.chamber.checks.warning import DesignWarning, WarningKind
from chamberopt.chamber.reach import TOLERATED_OVERLAP
from chamberopt.design.shape_surface import TAG_PART
from chamberopt.geometry.smoothing.fillets import face_at, faces_of, fillets_of
from chamberopt.geometry.triangles import area_vectors, edge_keys, sides_of

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.chamber.part import Part
    from chamberopt.chamber.reach import Reach
    from chamberopt.design.design import Design

LEAST_SHARE = 0.01  # share of the target's area that is worth a warning
# degrees: facets that turn by less look 10 degrees aside of their round at most, so that a ball
# strikes them square with 1.5 % less of its speed.
FAR_TURN = 20.0


def facets_are_left(part: Part) -> bool:
    """True if coarse facets take so much of the target that they decide its coverage."""
    return part.smoothing is not None and part.smoothing.coarse_share >= LEAST_SHARE


def radii_of_target(design: Design, part: Part) -> list[float]:
    """Return the radii [m] of the fillets that are the target, the widest first.

    There are none if anything but fillets is chosen, or by other means than a place on each.
    """
    chosen, file = design.part.target.faces, part.file
    if file is None or not chosen or any(isinstance(one.border, float) for one in chosen):
        return []
    mesh, found = file.as_read, set[float]()
    fillets = fillets_of(mesh)
    for one in chosen:
        faces = faces_of(mesh, one.border)
        face, _ = face_at(mesh, faces, one.border, 1e-3 * np.array(one.at_mm))
        # Found by curvature, it may lack triangles at the border of the file's own face.
        numbers, each = np.unique(
            fillets.of_triangle[faces.of_triangle == face], return_counts=True
        )
        number = int(numbers[each.argmax()])
        if number < 0:
            return []
        found.add(float(f"{1.0 / fillets.curvature[number]:.3g}"))
    return sorted(found, reverse=True)


def facet_warnings(part: Part, ball: float, reachable: float) -> list[DesignWarning]:
    """Return a warning if the simulated target has coarse facets in place of its curved surface.

    There is none where they hide nothing from the balls and turn little, as coverage stands then.

    Args:
        ball: diameter of the smallest ball [m].
        reachable: share of the target that the ball can touch between the facets.
    """
    facts = part.smoothing
    if facts is None or not facets_are_left(part):
        return []
    by_curvature, turn = touched_by_curvature(part, ball), np.degrees(facts.coarse_turn)
    is_alike = f"{reachable:.1%}" == f"{by_curvature:.1%}"
    if is_alike and turn <= FAR_TURN:
        return []
    noisy = facts.noisy_share >= max(facts.crossing_share, LEAST_SHARE)
    if noisy:
        why = "which fit no round, as on a scan or on bevels, and were left as they are"
        remedy = "if rounds are meant, smooth the scan or give a mesh with finer facets"
    elif facts.crossing_share >= LEAST_SHARE:
        why = "which would cross others if they were divided"
        remedy = "give a mesh with finer facets"
    else:
        why = "which were left as they are"
        remedy = "give a mesh with finer facets, or change part.smoothing"
    if is_alike:
        harm = (
            f"they look up to {0.5 * turn:.2g} degrees aside of a round in their place, and are "
            "dented otherwise where balls strike it aslant"
        )
    else:
        harm = (
            "in their hollows a ball lies across two of them: by facets a ball of "
            f"{1e3 * ball:g} mm touches {reachable:.1%} of the target, by the curvature of its "
            f"rounds up to {by_curvature:.1%}, and what it does not touch is not covered"
        )
    text = (
        f"coverage is that of facets: they turn by {turn:.2g} degrees on {facts.coarse_share:.0%} "
        f"of the target, {why}; {harm}; {remedy}"
    )
    return [DesignWarning(WarningKind.FACETS, text)]


def touched_by_curvature(part: Part, ball: float) -> float:
    """Return the share of the target's area with no hollow too sharp for a ball.

    Args:
        ball: diameter of the ball [m].
    """
    if part.hollow is None:
        return 1.0
    fits = part.hollow * 0.5 * ball <= 1.0 + TOLERATED_OVERLAP
    area = part.area[part.target]
    return float(area[fits[part.target]].sum() / area.sum())


OF_FILLET, OF_SLOT = 0.5, 0.25  # largest shot, over the fillet's radius and the slot's width
AS_DRAWN = 0.98  # of a drawn radius, which is that of facets to so much
LEAST_TURN, SHARP = 1.0, 60.0  # least and largest turn at an inner edge of a fillet [degrees]
FOLD = 15.0  # degrees: an inner edge that turns by more is a fillet, even with a single facet
HOLLOW = 1.0 / 3.0  # least inward less outward turn near an edge of a fillet, over the whole turn
# What is narrower than the rest of a fillet, as a curl at its end, does not count below this share
# of the area of all fillets that are up to so many times as wide as the shot takes.
CURL, FILLETS_ALIKE = 0.01, 10.0
SMALLEST = 0.05  # share of the area beside inner edges, or of the slots', that may be smaller
MAX_POINTS = 5000  # surface points at which slots are searched


def fillet_warnings(reach: Reach, chamber: Chamber, largest: float) -> list[DesignWarning]:
    """Return warnings about fillets and slots of target and zones too small for the largest ball.

    Args:
        largest: diameter of the largest ball [m].
    """
    part = chamber.part
    chosen = np.any([part.target, *part.zones.values()], axis=0) & (chamber.exposed_area > 0.0)
    return [*_fillets(chamber, chosen, largest), *_slots(reach, chamber, chosen, largest)]


class InnerEdges(NamedTuple):
    """Inner edges between triangles, which are the edges of fillets."""

    middle: np.ndarray  # [m], (e, 3)
    length: np.ndarray  # [m], (e,)
    radius: np.ndarray  # of the fillet there [m], (e,); 0 at an edge without a fillet
    triangles: np.ndarray  # on both sides, (e, 2)
    # Whether each of these lies in the fillet, (e, 2): one beside it may be a whole flat face. Both
    # do where the surface behind the triangles is not known.
    in_fillet: np.ndarray


def inner_edges(
    vertices: np.ndarray,
    triangles: np.ndarray,
    chosen: np.ndarray,
    hollow: np.ndarray | None = None,
) -> InnerEdges:
    """Find the inner edges between chosen triangles, which are the edges of fillets.

    Facets of a height L that turn by an angle a at each edge touch a circle of the radius L / (2
    tan(a / 2)). The radius is 0 at edges that turn by more than SHARP. Triangles of a shaft or a
    cone turn inwards at some edges too, so an edge counts only if the surface round it turns
    inwards on the whole (see HOLLOW). Facets of a surface that bends both ways fold inwards here
    and there, so the radius comes from the curvature behind the facets where it is known.

    Args:
        vertices: vertices of the part [m], shape (n, 3).
        triangles: triangles of the part, normals outward, shape (m, 3).
        chosen: marks the triangles to look at, shape (m,).
        hollow: curvature of the surface behind the triangles [1/m], 0 where unknown, shape (m,).
    """
    sides, triangle = sides_of(triangles), np.repeat(np.arange(len(triangles)), 3)
    keys = edge_keys(triangles)
    order = np.argsort(keys, kind="stable")
    same = np.flatnonzero(keys[order][1:] == keys[order][:-1])
    one, two = order[same], order[same + 1]
    both = chosen[triangle[one]] & chosen[triangle[two]]
    one, two = one[both], two[both]
    normal = area_vectors(vertices, triangles)
    size = np.linalg.norm(normal, axis=1)
    unit = normal / np.maximum(size, 1e-300)[:, None]
    a, b = unit[triangle[one]], unit[triangle[two]]
    turn = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))
    ends = vertices[sides[one]]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    # The surface turns inwards where the second triangle rises over the plane of the first.
    over = vertices[triangles[triangle[two]]].mean(axis=1) - ends[:, 0]
    inwards = np.where(np.einsum("ij,ij->i", over, a) > 0.0, turn, -turn)
    around = sides[one], ends[:, 1] - ends[:, 0]
    goes_in = _turn_across(*around, inwards) > HOLLOW * _turn_across(*around, turn)
    inner = (inwards > np.radians(LEAST_TURN)) & (goes_in | (turn > np.radians(SHARP)))
    # Mean height of the two triangles over their edge; `size` is an area.
    height = (size[triangle[one]] + size[triangle[two]]) / np.maximum(length, 1e-300)
    turn = turn[inner]
    radius = height[inner] / (2.0 * np.tan(0.5 * turn))
    if hollow is not None:
        curvature = np.maximum(hollow[triangle[one]], hollow[triangle[two]])[inner]
        known = (curvature > 0.0) | (turn < np.radians(FOLD))
        radius[known] = 1.0 / np.maximum(curvature[known], 1e-9)
    radius[turn > np.radians(SHARP)] = 0.0
    beside = np.c_[triangle[one], triangle[two]][inner]
    in_fillet = np.ones(beside.shape, dtype=bool)
    if hollow is not None:
        is_hollow = hollow[beside] > 0.0
        in_fillet = is_hollow | ~is_hollow.any(axis=1, keepdims=True)
    return InnerEdges(ends.mean(axis=1)[inner], length[inner], radius, beside, in_fillet)


def too_narrow(edges: InnerEdges, area: np.ndarray, ball: float) -> np.ndarray:
    """Return which inner edges are too narrow for a ball, (e,): their fillets, or without one.

    Fillets do not count that are a tiny share of the area of all.

    Args:
        area: of the part's triangles [m²], (m,).
        ball: diameter of the ball [m].
    """
    limit = AS_DRAWN * ball / OF_FILLET
    small, is_round = edges.radius < limit, edges.radius > 0.0

    def area_beside(rows: np.ndarray) -> float:
        return float(area[np.unique(edges.triangles[rows])].sum())

    alike = is_round & (edges.radius < FILLETS_ALIKE * limit)
    if area_beside(small & is_round) < CURL * area_beside(alike):
        return small & ~is_round
    return small


def _turn_across(ends: np.ndarray, way: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Return how much the surface turns across each edge [m rad], summed over edges at its ends.

    Each of these edges counts by its turn, its length and its squared cosine to the given edge.
    Sharp edges, at which a fillet ends, do not count.

    Args:
        ends: vertices of each edge, shape (e, 2).
        way: vector from the first to the second vertex [m], shape (e, 3).
        turns: angle by which the surface turns at each edge [rad], shape (e,).
    """
    length = np.maximum(np.linalg.norm(way, axis=1), 1e-300)
    along = way / length[:, None]
    turned = np.where(np.abs(turns) > np.radians(SHARP), 0.0, turns) * length
    each = (turned[:, None, None] * along[:, :, None] * along[:, None, :]).reshape(-1, 9)
    places = ends.ravel()
    around = np.column_stack(  # sum at each vertex
        [np.bincount(places, np.repeat(column, 2)) for column in each.T]
    )
    both = (around[ends].sum(axis=1) - each).reshape(-1, 3, 3)  # the sum has the edge itself twice
    across: np.ndarray = np.einsum("ei,eij,ej->e", along, both, along)
    return across


def _fillets(chamber: Chamber, chosen: np.ndarray, largest: float) -> list[DesignWarning]:
    part = chamber.part
    edges = inner_edges(part.vertices, part.triangles, chosen, part.hollow)
    middle, length, radius, *_ = edges
    small = too_narrow(edges, part.area, largest)
    if length[small].sum() < largest:  # a fillet is longer than a ball
        return []
    beside = part.area[edges.triangles].sum(axis=1)
    smallest = _low_quantile(radius[small], beside[small])
    fillet = f"fillets of about {1e3 * smallest:.2g} mm" if smallest else "inner edges without one"
    where = f"{one_of(middle[small], length[small])} in the chamber's frame"
    text = (
        f"shot of {1e3 * largest:g} mm is larger than half the radius of the target's smallest "
        f"fillets ({fillet}, e.g. at {where}): the shot peens them less than what is beside them; "
        "use smaller balls, or give them a zone of their own (docs/how_to/drawing.md)"
    )
    return [DesignWarning(WarningKind.FILLET, text)]


def _slots(
    reach: Reach, chamber: Chamber, chosen: np.ndarray, largest: float
) -> list[DesignWarning]:
    """Return a warning if faces of the part face each other less than four balls apart.

    Args:
        chosen: marks part triangles on the target or a zone, (m,).
        largest: diameter of the largest ball [m].
    """
    from sim_core import largest_balls

    mesh, touches = reach.mesh, reach.touches
    source = chamber.source[touches.triangle]
    own = np.flatnonzero((source >= 0) & chosen[np.maximum(source, 0)])
    step = max(1, -(-len(own) // MAX_POINTS))
    own = own[::step]
    widest = largest / OF_SLOT
    overlap = TOLERATED_OVERLAP * 0.5 * reach.diameter
    points, normals = touches.point[own], touches.normal[own]
    radius, obstacle, cosine = largest_balls(mesh, points, normals, 0.5 * widest, overlap)
    facing = (obstacle >= 0) & (cosine < MAX_COSINE) & (mesh.tags[obstacle] == TAG_PART)
    area = step * touches.area[own]
    if not facing.any() or area[facing].sum() < largest**2:
        return []
    width = 2.0 * _low_quantile(radius[facing], area[facing])
    where = f"{one_of(points[facing], area[facing])} in the chamber's frame"
    text = (
        f"shot of {1e3 * largest:g} mm is larger than a quarter of the target's narrowest slot, "
        f"about {1e3 * width:.3g} mm wide, e.g. at {where}: few balls get to its bottom, and "
        "slowly; use smaller balls, or give it a zone of its own (docs/how_to/drawing.md)"
    )
    return [DesignWarning(WarningKind.SLOT, text)]


def _low_quantile(values: np.ndarray, weight: np.ndarray) -> float:
    """Return the value below which only the share SMALLEST of the total weight lies."""
    order = np.argsort(values)
    upto = np.cumsum(weight[order])
    return float(values[order][np.searchsorted(upto, SMALLEST * upto[-1])])

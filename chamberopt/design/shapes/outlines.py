"""Profiles of round cavities and outlines of cavities seen from above, and their rounding.

A profile is a line of points (r, z) [m], shape (n, 2), from the sonotrode's edge to the axis.

    axis
     :______ (0, z)
     :      \\
     :       |   the wall
    _:_______|   floor: from the axis to the first point, at z = 0
"""

import math
from collections.abc import Iterable

import numpy as np

from chamberopt.common.toml_errors import CrossCheckError, Problem
from chamberopt.design.shape_surface import ShapeSurface, lofted

# Smallest lengths of a cavity, and errors that name the largest value that still makes a cavity.

# Shorter sides and smaller radii count as 0 [m]: a fiftieth of usual shot, far above the grid that
# solids are rounded to.
MIN_LENGTH = 5e-5
MIN_LENGTH_MM = 1e3 * MIN_LENGTH


def refuse_above(key: str, given: float, limit: float, why: str) -> None:
    """Raise CrossCheckError if the value of a key [mm or degrees] is larger than a limit.

    The signs of both are ignored.

    Args:
        why: what is wrong with a larger value, for the message.
    """
    if abs(given) > abs(limit):
        fits = math.trunc(limit * 1e3) / 1e3  # rounded towards 0, so that this value does fit
        text = f"given {given:g}, {why}; {fits:.7g} is the furthest that fits"
        raise CrossCheckError([Problem(key, text)])


def refuse_meeting_walls(slope: float, limits: Iterable[float], inclination_deg: float) -> None:
    """Raise CrossCheckError if walls lean in so far that they meet below the ceiling.

    Args:
        slope: tangent of the walls' outward inclination.
        limits: least slope with which each wall does not meet another.
        inclination_deg: the given inclination, for the message.
    """
    least = max(limits, default=-math.inf)
    if slope < least:
        why, limit_deg = "with which walls meet below the ceiling", math.degrees(math.atan(least))
        refuse_above("inclination_deg", inclination_deg, limit_deg, why)


# Convex outlines in plan: move their sides, round their corners.
#
# An outline is an array of corners (n, 2) [m], counter-clockwise.


def corner_angles(outline: np.ndarray) -> np.ndarray:
    """Return the angle [rad] by which a closed outline turns left at each corner, (n,)."""
    before, after = _directions(outline)
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.asarray(np.arctan2(cross, np.einsum("ij,ij->i", before, after)))


def move_sides(outline: np.ndarray, distance: float) -> np.ndarray:
    """Return an outline's corners (n, 2) [m] after its sides moved outward by a distance [m]."""
    before, after = _directions(outline)
    outward = np.c_[before[:, 1] + after[:, 1], -before[:, 0] - after[:, 0]]
    return np.asarray(
        outline + distance * outward / (1.0 + np.einsum("ij,ij->i", before, after))[:, None]
    )


def largest_inward_move(outline: np.ndarray) -> float:
    """Return the largest distance [m] by which all sides of an outline can be moved inward.

    At this distance the shortest side has the length MIN_LENGTH.
    """
    tangent = np.tan(corner_angles(outline) / 2.0)
    length = np.hypot(*(np.roll(outline, -1, axis=0) - outline).T)
    return max(0.0, float(((length - MIN_LENGTH) / (tangent + np.roll(tangent, -1))).min()))


def area_inside(outline: np.ndarray, distance: float = 0.0) -> float:
    """Return the area [m²] inside an outline after its sides moved outward by a distance [m]."""
    (x, y), (xn, yn) = outline.T, np.roll(outline, -1, axis=0).T
    around = np.hypot(xn - x, yn - y).sum()
    corners = np.tan(corner_angles(outline) / 2.0).sum()
    area = 0.5 * (x * yn - y * xn).sum() + distance * around + distance * distance * corners
    return float(area)


def corner_arcs(outline: np.ndarray, facets: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the corner (k,) of each point of a rounded outline, and the direction (k, 2) from the
    corner to the point.

    The positions of the corners plus a radius times the directions are the outline grown by the
    radius. Each corner has a fan of directions, from the normal of one side to the normal of the
    next, in steps of at most a full turn / facets. A corner that turns by less than half a step has
    a single direction, longer than 1, which moves both sides by the radius.
    """
    before, _ = _directions(outline)
    turn = corner_angles(outline)
    steps = facets * turn / (2.0 * np.pi)
    count = np.where(steps < 0.5, 0, np.ceil(steps - 1e-9)).astype(int)
    corner = np.repeat(np.arange(len(outline)), count + 1)
    step = np.concatenate([np.arange(n + 1) for n in count])
    share = np.where(count[corner] > 0, step / np.maximum(count[corner], 1), 0.5)
    angle = np.arctan2(-before[:, 0], before[:, 1])[corner] + share * turn[corner]
    size = np.where(count > 0, 1.0, 1.0 / np.cos(turn / 2.0))[corner]
    return corner, size[:, None] * np.c_[np.cos(angle), np.sin(angle)]


def _directions(outline: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return unit vectors (n, 2) along the side before and along the side after each corner."""
    after = np.roll(outline, -1, axis=0) - outline
    after /= np.hypot(*after.T)[:, None]
    return np.roll(after, 1, axis=0), after


def turn_angles(line: np.ndarray) -> np.ndarray:
    """Return the angle [rad] by which an open line turns left at each of its points, (n,).

    It is 0 at both ends of the line.
    """
    along = np.diff(line, axis=0)
    before, after = along[:-1], along[1:]
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.asarray(np.r_[0.0, np.arctan2(cross, np.einsum("ij,ij->i", before, after)), 0.0])


def largest_corner_radius(line: np.ndarray) -> float:
    """Return the largest radius [m] to which all corners of a line can be rounded.

    The arc of radius r begins r tan(angle / 2) from its corner. Two arcs must not meet.
    """
    tangent = np.tan(np.abs(turn_angles(line)) / 2.0)
    length = np.hypot(*np.diff(line, axis=0).T)
    with np.errstate(divide="ignore"):
        return max(0.0, float(((length - MIN_LENGTH) / (tangent[:-1] + tangent[1:])).min()))


def round_corners(line: np.ndarray, radius: float, facets: int) -> np.ndarray:
    """Return a line with an arc of this radius [m] in place of each corner.

    An arc has steps of at most a full turn / facets. Its ends lie on the line. A corner that turns
    by less than half a step stays as it is.
    """
    if radius <= MIN_LENGTH:
        return line
    points = [line[:1]]
    for corner, before, after, turn in zip(
        line[1:-1], line[:-2], line[2:], turn_angles(line)[1:-1], strict=True
    ):
        steps = facets * abs(turn) / (2.0 * np.pi)
        if steps < 0.5:
            points.append(corner[None])
            continue
        arriving, leaving = _unit(corner - before), _unit(after - corner)
        centre = corner + radius / np.cos(turn / 2.0) * _unit(leaving - arriving)
        begin = corner - radius * np.tan(abs(turn) / 2.0) * arriving - centre
        angle = turn * np.linspace(0.0, 1.0, int(np.ceil(steps - 1e-9)) + 1)[:, None]
        across = np.array([-begin[1], begin[0]])
        points.append(centre + np.cos(angle) * begin + np.sin(angle) * across)
    return np.concatenate([*points, line[-1:]])


def find_contact(line: np.ndarray) -> np.ndarray | None:
    """Return a point (2,) [m] where a line folds back or comes nearer to itself than MIN_LENGTH.

    Return None if there is no such point.
    """
    sharp = np.abs(turn_angles(line)) > np.pi - 1e-3
    if sharp.any():
        return np.asarray(line[np.argmax(sharp)])
    start, end = line[:-1], line[1:]
    i, j = np.triu_indices(len(start), 2)
    ends = ((i, j), (i + 1, j), (j, i), (j + 1, i))
    apart = np.min([_distance(line[k], start[m], end[m]) for k, m in ends], axis=0)
    near = (apart < MIN_LENGTH) | _cross(start[i], end[i], start[j], end[j])
    return start[i[np.argmax(near)]] if near.any() else None


def crosses_itself(line: np.ndarray) -> bool:
    """True if two straight pieces of a line that are not neighbours cross."""
    start, end = line[:-1], line[1:]
    i, j = np.triu_indices(len(start), 2)
    return bool(_cross(start[i], end[i], start[j], end[j]).any())


def revolved_volume(line: np.ndarray) -> float:
    """Return the volume [m³] inside a profile turned about the axis, a sum of truncated cones."""
    (r0, r1), rise = (line[:-1, 0], line[1:, 0]), np.diff(line[:, 1])
    return float(np.pi / 3.0 * (rise * (r0 * r0 + r0 * r1 + r1 * r1)).sum())


def revolve(line: np.ndarray, facets: int) -> ShapeSurface:
    """Return the surface of the cavity that a profile makes when turned about the axis.

    A full turn has `facets` flat sides, whose corners lie on the profile.
    """
    angle = 2.0 * np.pi * np.arange(facets) / facets
    circle = np.c_[np.cos(angle), np.sin(angle)]
    rings = [np.c_[r * circle, np.full(facets, z)] for r, z in line[:-1]]
    flat = line[-1, 1] == line[-2, 1]
    return lofted(rings, None if flat else np.array([0.0, 0.0, line[-1, 1]]))


def _unit(vector: np.ndarray) -> np.ndarray:
    return np.asarray(vector / np.hypot(*vector))


def _distance(point: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the distance [m] of each point (k, 2) from its own straight piece, (k,).

    Args:
        start, end: ends of the pieces [m], (k, 2) each.
    """
    along = end - start
    share = np.einsum("ij,ij->i", point - start, along) / np.einsum("ij,ij->i", along, along)
    return np.asarray(np.hypot(*(point - start - np.clip(share, 0.0, 1.0)[:, None] * along).T))


def _cross(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return True where the straight lines from a to b and from c to d cross, (k,) bool."""

    def side(p: np.ndarray, q: np.ndarray, x: np.ndarray) -> np.ndarray:
        return np.asarray(np.sign((q - p)[:, 0] * (x - p)[:, 1] - (q - p)[:, 1] * (x - p)[:, 0]))

    return np.asarray((side(a, b, c) * side(a, b, d) < 0.0) & (side(c, d, a) * side(c, d, b) < 0.0))

"""Profiles of round cavities: rounded at their corners and turned about the axis.

A profile is a line of points (r, z) [m], shape (n, 2), from the sonotrode's edge to the axis.

    axis
     :______ (0, z)
     :      \\
     :       |   the wall
    _:_______|   floor: from the axis to the first point, at z = 0
"""

import numpy as np

from chamberopt.design.shapes.construction.limits import MIN_LENGTH
from chamberopt.design.shapes.construction.surface import ShapeSurface, lofted


def turn_angles(line: np.ndarray) -> np.ndarray:
    """Angle [rad] by which the line turns left at each of its points, (n,); 0 at both ends."""
    along = np.diff(line, axis=0)
    before, after = along[:-1], along[1:]
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.r_[0.0, np.arctan2(cross, np.einsum("ij,ij->i", before, after)), 0.0]


def largest_corner_radius(line: np.ndarray) -> float:
    """Largest radius [m] to which all corners can be rounded.

    The arc of radius r begins r tan(angle / 2) from its corner; two arcs must not meet.
    """
    tangent = np.tan(np.abs(turn_angles(line)) / 2.0)
    length = np.hypot(*np.diff(line, axis=0).T)
    with np.errstate(divide="ignore"):
        return max(0.0, float(((length - MIN_LENGTH) / (tangent[:-1] + tangent[1:])).min()))


def round_corners(line: np.ndarray, radius: float, facets: int) -> np.ndarray:
    """The line with arcs in place of its corners, in steps of at most a full turn / facets.

    The ends of arcs lie on the line. A corner of less than half a step stays as it is.
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
    """A point (2,) [m] where the line folds back or comes nearer to itself than MIN_LENGTH."""
    sharp = np.abs(turn_angles(line)) > np.pi - 1e-3
    if sharp.any():
        return line[np.argmax(sharp)]
    start, end = line[:-1], line[1:]
    i, j = np.triu_indices(len(start), 2)
    ends = ((i, j), (i + 1, j), (j, i), (j + 1, i))
    apart = np.min([_distance(line[k], start[m], end[m]) for k, m in ends], axis=0)
    near = (apart < MIN_LENGTH) | _cross(start[i], end[i], start[j], end[j])
    return start[i[np.argmax(near)]] if near.any() else None


def crosses_itself(line: np.ndarray) -> bool:
    """Whether two sides of the line that are not neighbours cross."""
    start, end = line[:-1], line[1:]
    i, j = np.triu_indices(len(start), 2)
    return bool(_cross(start[i], end[i], start[j], end[j]).any())


def revolved_volume(line: np.ndarray) -> float:
    """Volume [m³] inside the line turned about the axis: a sum of truncated cones."""
    (r0, r1), rise = (line[:-1, 0], line[1:, 0]), np.diff(line[:, 1])
    return float(np.pi / 3.0 * (rise * (r0 * r0 + r0 * r1 + r1 * r1)).sum())


def revolve(line: np.ndarray, facets: int) -> ShapeSurface:
    """The cavity under the line: `facets` flat sides for a full turn, their corners on the line."""
    angle = 2.0 * np.pi * np.arange(facets) / facets
    circle = np.c_[np.cos(angle), np.sin(angle)]
    rings = [np.c_[r * circle, np.full(facets, z)] for r, z in line[:-1]]
    flat = line[-1, 1] == line[-2, 1]
    return lofted(rings, None if flat else np.array([0.0, 0.0, line[-1, 1]]))


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.hypot(*vector)


def _distance(point: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Distance [m] of points (k, 2) from straight pieces, one each."""
    along = end - start
    share = np.einsum("ij,ij->i", point - start, along) / np.einsum("ij,ij->i", along, along)
    return np.hypot(*(point - start - np.clip(share, 0.0, 1.0)[:, None] * along).T)


def _cross(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Whether pieces ab and cd cross, (k,) bool."""

    def side(p: np.ndarray, q: np.ndarray, x: np.ndarray) -> np.ndarray:
        return np.sign((q - p)[:, 0] * (x - p)[:, 1] - (q - p)[:, 1] * (x - p)[:, 0])

    return (side(a, b, c) * side(a, b, d) < 0.0) & (side(c, d, a) * side(c, d, b) < 0.0)

"""Extension of the walls, and of the edges where two walls meet, beneath a vibrating face.

A ball's centre is a radius R from the face. On a face lowered by A the centre is R - A above the
lower end of a wall that rises at a right angle. The centre is beneath this end if A > R, and beside
gentle slopes at smaller A already. Walls and their edges are therefore extended down as far as the
face goes. The face is extended under gentle slopes, because a ball on such a slope could otherwise
get below the raised face. Where the faces would part all the same, the amplitude is too large.

             ball's centre meets     ....... raised face, extended under the slope
             one or the other  ....--''
        --------------------''~~~ slope, extended under the lowered face

Notation: n normal of the vibrating face, m of a wall beside it, both towards the shot.
run = n m, cosine of the angle by which the wall rises: 0 upright, negative where it leans over.
rise = |n x m|, sine of this angle.
"""

from typing import NamedTuple

import numpy as np

from sim_core.errors import SceneError
from sim_core.geometry.flat_faces import SurfaceTriangles
from sim_core.geometry.mesh import TriangleMesh, normals_towards_shot

LEVEL = 1e-9  # cosine or sine that is rounding


class _Beside(NamedTuple):
    """The k edges between vibrating faces and still walls, with run and rise of each wall."""

    edge: np.ndarray  # directed edge 3 t + k of the still triangle, shape (k,)
    face: np.ndarray  # vibrating triangle, shape (k,)
    run: np.ndarray  # shape (k,)
    rise: np.ndarray  # shape (k,)


class SonotrodeBorder(NamedTuple):
    """Extensions of faces, walls and edges, for balls that get beneath a wall's lower end."""

    overhang: float  # extension of the vibrating faces over their borders [m]
    # The walls beneath the ends of the faces: four corners of each [m], wound like the mesh, shape
    # (k, 4, 3), and the triangle above, shape (k,)
    walls: np.ndarray
    above: np.ndarray
    # The edges beneath the ends of the faces: both ends of each [m], shape (j, 2, 3), and the
    # triangles on both sides, shape (j, 2)
    edges: np.ndarray
    sides: np.ndarray


def find_border(surface: SurfaceTriangles, radius: float) -> SonotrodeBorder:
    """Find the extensions that balls of one radius [m] meet beneath the lower ends of walls.

    Raises:
        SceneError: where the amplitude is so large that a face would part from a wall.
    """
    beside = _beside(surface.mesh.partners, surface.normals, surface.vibrating)
    reached = radius * (1.0 - beside.run) < surface.amplitude[beside.face]
    beside = _Beside(*(x[reached] for x in beside))
    face, run, rise = beside.face, beside.run, beside.rise
    amplitude, limit = surface.amplitude[face], _largest_amplitude(run, rise, radius)
    over = np.flatnonzero(amplitude > limit)
    if len(over):
        k = over[0]
        angle = np.degrees(np.arctan2(rise[k], run[k]))
        raise SceneError(
            f"beside the vibrating triangle {face[k]} the surface of triangle "
            f"{beside.edge[k] // 3} {_leaning(angle)}, and a face that swings by "
            f"{amplitude[k]:.3g} m would come out of it: a moving edge is not supported yet; let "
            "steep walls rise from the sonotrode all round, or lower the amplitude to "
            f"{limit[k]:.3g} m"
        )
    return SonotrodeBorder(
        float((amplitude * run / rise).max(initial=0.0)), *_beneath(surface, beside, radius)
    )


def largest_amplitude(mesh: TriangleMesh, tag: int, radius: float) -> tuple[float, np.ndarray, str]:
    """Return the largest amplitude that the walls beside a vibrating surface allow.

    Args:
        mesh: the cavity.
        tag: tag of the vibrating surface.
        radius: radius of the balls [m].

    Returns:
        Zero-to-peak amplitude [m], inf where every wall is upright; the point [m] beside the wall
        that limits it, shape (3,); and the slope of this wall, in words.
    """
    normals, _ = normals_towards_shot(mesh.corners)
    beside = _beside(mesh.partners, normals, mesh.tags == tag)
    limit = _largest_amplitude(beside.run, beside.rise, radius)
    if not np.isfinite(limit).any():
        return float("inf"), mesh.middle, ""
    k = int(limit.argmin())
    angle = float(np.degrees(np.arctan2(beside.rise[k], beside.run[k])))
    edge = beside.edge[k]
    ends = mesh.corners[edge // 3, [edge % 3, (edge % 3 + 1) % 3]]
    return float(limit[k]), ends.mean(axis=0), _leaning(angle)


def _beside(two: np.ndarray, normals: np.ndarray, vibrating: np.ndarray) -> _Beside:
    """Return the edges between vibrating faces and others, from the partners of all edges."""
    edge = two[np.repeat(vibrating, 3) & ~vibrating[two // 3]]
    face = two[edge] // 3
    one, other = normals[face], normals[edge // 3]
    run = np.einsum("ij,ij->i", one, other)
    return _Beside(edge, face, run, np.linalg.norm(np.cross(one, other), axis=1))


def _largest_amplitude(run: np.ndarray, rise: np.ndarray, radius: float) -> np.ndarray:
    """Return the amplitude [m], shape (k,), beyond which a face and the wall beside it part.

    ``run``, ``rise``: cosine and sine of the angle by which each wall rises, shape (k,). Beside a
    slope that rises outwards, the raised face comes out of the slope. Under a wall that leans over
    the face, a ball on the lowered face gets past the face's border.
    """
    limit = np.full(len(run), np.inf)
    out, over = run > LEVEL, run < -LEVEL
    limit[out] = radius * rise[out] / run[out]
    limit[over] = radius * (1.0 - 1.0 / run[over])
    limit[(run == 0.0) & (rise == 0.0)] = radius  # beside a triangle without area
    return limit


def _leaning(angle: float) -> str:
    """Return the slope of a wall in words, by its angle [degrees] to the face's plane."""
    if angle < 90.0:
        return f"lies flat or rises by only {angle:.3g} degrees"
    return f"leans over it by {angle - 90.0:.3g} degrees"


def _beneath(
    surface: SurfaceTriangles, beside: _Beside, radius: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return walls and edges beneath vibrating faces, as the last four fields of SonotrodeBorder.

    A wall is extended down in its plane, to the line where this plane meets the next wall's plane.
    If the corner of the two walls is convex towards the shot, this line is an edge. A concave
    corner is behind both walls, which may go on past it, as where a cone ends in a point.
    """
    corners, normals, two = surface.corners, surface.normals, surface.mesh.partners
    walls: list[list[np.ndarray]] = []
    edges: dict[tuple[int, ...], tuple[np.ndarray, tuple[int, int]]] = {}
    for e, moving in zip(beside.edge.tolist(), beside.face.tolist(), strict=True):
        here, ends = e // 3, corners[e // 3, [e % 3, (e % 3 + 1) % 3]]
        along, down = ends[1] - ends[0], -normals[moving] * surface.amplitude[moving]
        # vector away from the triangle, which is wound clockwise
        straight = np.cross(normals[here], along)
        straight *= down @ down / (straight @ down)
        drops = []
        for last in (0, 1):
            there, other = _next_wall(two, surface.vibrating, e, last)
            line = np.cross(normals[here], normals[there])
            turn, facing = np.linalg.norm(line), normals[here] @ normals[there]
            is_plane = turn * radius < LEVEL and facing >= 0.0
            back = corners[there, (other + last) % 3] - ends[last]
            convex = not is_plane and (normals[here] @ back < 0.0 or turn < LEVEL)
            fall = line @ down
            drop = down if turn < LEVEL else line * (down @ down / fall) if fall else straight
            if convex:
                key = (surface.mesh.triangles[here, (e + last) % 3], *sorted((here, there)))
                edges.setdefault(key, (np.stack([ends[last], ends[last] + drop]), (here, there)))
            elif is_plane or ((drop - straight) @ along > 0.0) != last:
                drop = straight
            drops.append(drop)
        walls.append([ends[1], ends[0], ends[0] + drops[0], ends[1] + drops[1]])
    both = list(edges.values())
    return (
        np.array(walls).reshape(-1, 4, 3),
        beside.edge // 3,
        np.array([place for place, _ in both]).reshape(-1, 2, 3),
        np.array([pair for _, pair in both], dtype=np.int64).reshape(-1, 2),
    )


def _next_wall(
    partners: np.ndarray, vibrating: np.ndarray, edge: int, last: int
) -> tuple[int, int]:
    """Find the wall beside the next edge of a vibrating face's border, round one end of ``edge``.

    ``last``: 0 for the first end of the edge, 1 for its last end.

    Returns:
        The wall's triangle, and the number of this triangle's side on the border.
    """
    step = 1 if last else 2
    while True:
        edge = edge - edge % 3 + (edge + step) % 3
        if vibrating[partners[edge] // 3]:
            return edge // 3, edge % 3
        edge = int(partners[edge])


def require_room_at_joints(surface: SurfaceTriangles, radius: float) -> None:
    """Raise SceneError for sonotrodes that meet in an edge so blunt that balls get through.

    A ball of this radius [m] that touches both sonotrodes has its centre at the distance radius (1
    - cos) / sin from the ends of their moved faces. The cosine and sine are of the angle between
    the faces' normals. The vibrations reduce the numerator by at most the sum of their amplitudes.
    """
    normals, amplitude, tags = surface.normals, surface.amplitude, surface.mesh.tags
    two = surface.mesh.partners
    one = np.flatnonzero(np.arange(len(two)) < two)
    face, other = one // 3, two[one] // 3
    cosine = np.einsum("ij,ij->i", normals[face], normals[other])
    room = radius * (1.0 - cosine) - amplitude[face] - amplitude[other]
    joint = surface.vibrating[face] & surface.vibrating[other] & (tags[face] != tags[other])
    tight = np.flatnonzero(joint & (room < 0.0))
    if len(tight):
        a, b = face[tight[0]], other[tight[0]]
        raise SceneError(
            f"the vibrating triangles {a} and {b}, of tags {tags[a]} and {tags[b]}, meet in an "
            "edge so blunt that a ball could touch the edge of one beside the other: a moving edge "
            "is not supported yet; let a steep wall part them"
        )

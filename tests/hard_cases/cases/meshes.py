"""Meshes that are legal but difficult, and some that are not a closed surface."""

import math

import numpy as np
import trimesh
from scipy.spatial import Delaunay

from sim_core import Balls, Gravity, Physics, Scene, TriangleMesh
from tests.hard_cases.cases.drops import DROP, EXACT, HALF, RADIUS, G, one_ball
from tests.hard_cases.outcome import Case, Claim, Outcome, named, near, outcome_of, play, refusal
from tests.helpers.scenes.cavities import CEILING, FLOOR, SIDES, box, box_around
from tests.helpers.scenes.fuzzed_chambers import Chamber

SIDE = 0.03  # m
TINY = 1e-9  # m: width of slivers and of steps that are almost none


def floor_with(
    points: list[tuple[float, float, float]], below: list[list[int]] | None = None
) -> TriangleMesh:
    """A box on z = 0 whose floor is triangulated through its corners and further points (x, y, z)
    [m]: as ``below`` says, or as it comes.
    """
    corners = [(0.0, 0.0, 0.0), (SIDE, 0.0, 0.0), (SIDE, SIDE, 0.0), (0.0, SIDE, 0.0)]
    floor = np.array([*corners, *points])
    if below is None:
        below = Delaunay(
            floor[:, :2], qhull_options="QJ Pp"
        ).simplices  # joggled: loses no point that is near another
    below = np.array(below)
    turn = np.cross(
        floor[below[:, 1]] - floor[below[:, 0]], floor[below[:, 2]] - floor[below[:, 0]]
    )[:, 2]
    below = np.where(
        turn[:, None] > 0.0, below[:, ::-1], below
    )  # the cavity is above: normals point down
    top = len(floor)
    vertices = np.concatenate([floor, np.array(corners) + np.array([0.0, 0.0, SIDE])])
    lid = [(top, top + 1, top + 2), (top, top + 2, top + 3)]
    sides = []
    for k in range(4):
        one, two = k, (k + 1) % 4
        sides += [(one, two, top + two), (one, top + two, top + one)]
    tags = [FLOOR] * len(below) + [CEILING] * 2 + [SIDES] * 8
    return TriangleMesh(vertices, np.concatenate([below, lid, sides]), np.array(tags))


def _bounces_as_on_a_plane(
    room: TriangleMesh, at: tuple[float, float], off: float, expected: str
) -> Outcome:
    """Dropped at (x, y) [m]: comes up again straight, as high, as if the floor were plane but for
    ``off`` [m].
    """
    seen = play(
        Chamber(room, one_ball((*at, RADIUS + DROP), (0.0, 0.0, 0.0)), Physics(Gravity())), 0.4
    )
    fall = math.sqrt(2.0 * DROP / G)
    times = fall * np.arange(1.0, 0.4 / fall, 2.0)
    number = len(times)
    return outcome_of(
        seen,
        expected,
        near("times of the bounces [s]", seen.time, times, EXACT + number * off / (G * fall)),
        near("sideways [m]", seen.end.positions[0, :2], at, 0.0 if off == 0.0 else 1e-3),
    )


def floor_with_a_sliver() -> Outcome:
    """A triangle a nanometre wide across the floor, in its plane: the ball falls right on it."""
    left, right, top = 4, 5, 6
    triangles = [[left, right, top], [top, 2, 3], [left, top, 3], [top, right, 2]]
    triangles += [[0, 1, right], [0, right, left], [0, left, 3], [1, 2, right]]
    room = floor_with(
        [(0.005, 0.015, 0.0), (0.025, 0.015, 0.0), (0.015, 0.015 + TINY, 0.0)], triangles
    )
    return _bounces_as_on_a_plane(
        room, (0.014, 0.015), 0.0, "a sliver a nanometre wide is not felt"
    )


def floor_with_near_duplicate_corners() -> Outcome:
    """Corners a nanometre apart: triangles that are almost points, and almost duplicates of their
    neighbours.
    """
    room = floor_with([(0.015, 0.015, 0.0), (0.015 + TINY, 0.015, 0.0), (0.015, 0.015 + TINY, 0.0)])
    return _bounces_as_on_a_plane(
        room, (0.015, 0.015), 0.0, "corners a nanometre apart are not felt"
    )


def floor_with_a_pimple() -> Outcome:
    """A nanometre high on a base of millimetres: the ball falls on its tip and goes straight up
    again.
    """
    height = TINY
    room = floor_with(
        [(0.015, 0.015, height), (0.013, 0.013, 0.0), (0.017, 0.013, 0.0), (0.015, 0.018, 0.0)]
    )
    return _bounces_as_on_a_plane(
        room, (0.015, 0.015), 2.0 * height, "a nanometre's pimple is a nanometre's pimple"
    )


def plate_of_a_nanometre() -> Outcome:
    """Two faces almost in one place, back to back: balls on either side bounce off their own, none
    goes through.
    """
    plate = trimesh.creation.box((2.0 * HALF - 1e-3, 2.0 * HALF - 1e-3, TINY))
    room = box_around(plate, HALF)
    place = RADIUS + 0.5 * TINY + DROP
    positions = np.array([[0.001, 0.002, place], [-0.004, -0.005, -place]])
    balls = Balls(positions, np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]), 2.0 * RADIUS)
    seen = play(Chamber(room, balls, Physics()), 0.5)
    way = HALF - RADIUS - (RADIUS + 0.5 * TINY)
    times = DROP + np.arange(0.0, 0.5, way)
    times = times[times < 0.5]
    return outcome_of(
        seen,
        "each stays on its own side",
        near("times of the upper [s]", seen.time[seen.ball == 0], times, EXACT),
        near("times of the lower [s]", seen.time[seen.ball == 1], times, EXACT),
    )


def sliver_of_a_tetrahedron() -> Outcome:
    """Four corners almost in one plane, a nanometre's rise in the middle: met from above and
    below.
    """
    corners = np.array(
        [[-0.01, -0.01, 0.0], [0.01, -0.01, 0.0], [0.0, 0.014, 0.0], [0.0, 0.0, TINY]]
    )
    body = trimesh.Trimesh(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], process=False)
    room = box_around(body, HALF)
    positions = np.array([[0.0, 0.0, RADIUS + TINY + DROP], [0.001, 0.001, -RADIUS - DROP]])
    balls = Balls(positions, np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]), 2.0 * RADIUS)
    seen = play(Chamber(room, balls, Physics()), 0.02)
    return outcome_of(
        seen,
        "comes back from either side",
        near("times [s]", seen.time, [DROP, DROP], EXACT),
        near("velocities [m/s]", seen.end.velocities[:, 2], [1.0, -1.0], 1e-9),
    )


def _open_box() -> TriangleMesh:
    return box((SIDE, SIDE, SIDE))


def t_junction() -> Outcome:
    """A corner of one triangle in the middle of its neighbour's edge: closed to the eye, open to
    whoever follows edges; refused with the place.
    """
    mesh = _open_box()
    vertices, triangles = mesh.vertices, mesh.triangles
    one, two, three = triangles[0]
    middle = len(vertices)
    split = np.concatenate([[[one, middle, three], [middle, two, three]], triangles[1:]])
    points = np.concatenate([vertices, [0.5 * (vertices[one] + vertices[two])]])
    where = r"not closed: 3 open edge\(s\), the first on triangle \d+ at \[.*\] m"
    return refusal(lambda: TriangleMesh(points, split, np.zeros(len(split), dtype=int)), where)


def unmerged_corners() -> Outcome:
    """Each triangle with corners of its own, as STL has it."""
    mesh = _open_box()
    soup = mesh.corners.reshape(-1, 3)
    triangles = np.arange(len(soup)).reshape(-1, 3)
    return refusal(
        lambda: TriangleMesh(soup, triangles, mesh.tags),
        "not closed: 36 open .* merge duplicate vertices",
    )


def missing_triangle() -> Outcome:
    """A hole."""
    mesh = _open_box()
    return refusal(
        lambda: TriangleMesh(mesh.vertices, mesh.triangles[1:], mesh.tags[1:]),
        "not closed: 3 open edge",
    )


def triangle_given_twice() -> Outcome:
    """An exact duplicate."""
    mesh = _open_box()
    triangles = np.concatenate([mesh.triangles, mesh.triangles[:1]])
    return refusal(
        lambda: TriangleMesh(mesh.vertices, triangles, np.zeros(len(triangles), dtype=int)),
        "triangles 0 and 12 run along a shared edge the same way",
    )


def flipped_triangle() -> Outcome:
    """One triangle wound the wrong way round."""
    mesh = _open_box()
    triangles = np.concatenate([mesh.triangles[:1, ::-1], mesh.triangles[1:]])
    return refusal(
        lambda: TriangleMesh(mesh.vertices, triangles, mesh.tags), "triangles 0 and .* the same way"
    )


def inside_out_chamber() -> Outcome:
    """All triangles wound the wrong way round."""
    mesh = _open_box()
    return refusal(
        lambda: TriangleMesh(mesh.vertices, mesh.triangles[:, ::-1], mesh.tags), "inside out"
    )


def inside_out_island() -> Outcome:
    """A body in the chamber wound like the chamber: its faces would let balls in and not out."""
    room = trimesh.creation.box((2 * HALF,) * 3)
    body = trimesh.creation.box((0.01,) * 3)
    vertices = np.concatenate([room.vertices, body.vertices])
    triangles = np.concatenate([room.faces, body.faces + len(room.vertices)])
    ball = one_ball((0.0, 0.0, 0.02), (0.0, 0.0, -1.0))
    return refusal(
        lambda: Scene(
            TriangleMesh(vertices, triangles, np.zeros(24, dtype=int)), ball, Physics(), 1.0
        ),
        r"triangle \d+ .*inside out|inside out.* triangle \d+",
    )


def flat_chamber() -> Outcome:
    """A box squeezed to no height."""
    mesh = _open_box()
    return refusal(
        lambda: TriangleMesh(mesh.vertices * [1.0, 1.0, 0.0], mesh.triangles, mesh.tags),
        "inside out or flat",
    )


def triangle_without_area() -> Outcome:
    """Three corners on a line, at the foot of a wall: no face, and no hole either."""
    mesh = _open_box()
    vertices, triangles = mesh.vertices, mesh.triangles
    floor = np.flatnonzero(mesh.tags == FLOOR)[0]
    partner = None
    for k in range(3):  # the edge of a floor triangle that a side wall has too
        one, two = triangles[floor, k], triangles[floor, (k + 1) % 3]
        behind = np.flatnonzero(((triangles == one) | (triangles == two)).sum(axis=1) == 2)
        behind = behind[behind != floor]
        if mesh.tags[behind[0]] == SIDES:
            partner = k
    assert partner is not None
    one, two, three = np.roll(triangles[floor], -partner)
    middle = len(vertices)
    # the floor's edge is split, the wall's is not: a triangle without area fills what would be a
    # T-junction
    new = [[one, middle, three], [middle, two, three], [one, two, middle]]
    kept = np.delete(triangles, floor, axis=0)
    tags = np.concatenate([np.delete(mesh.tags, floor), [FLOOR, FLOOR, SIDES]])
    points = np.concatenate([vertices, [0.5 * (vertices[one] + vertices[two])]])
    room = TriangleMesh(points, np.concatenate([kept, new]), tags)
    seen = play(Chamber(room, one_ball((0.01, 0.012, 0.02), (0.7, 0.8, -1.0)), Physics()), 2.0)
    way = SIDE - 2.0 * RADIUS
    crossings = [
        math.floor((2.0 * v + s) / way)
        for v, s in ((0.7, 0.0085), (0.8, 0.0105), (1.0, way - 0.0185))
    ]
    return outcome_of(
        seen,
        "bounces in the box as if it were not there",
        near("hits", len(seen.time), sum(crossings), 0),
        Claim(
            bool(np.allclose(np.abs(seen.end.velocities[0]), [0.7, 0.8, 1.0], rtol=1e-15)),
            "speeds changed",
        ),
    )


CASES = [
    named(floor_with_a_sliver),
    named(floor_with_near_duplicate_corners),
    named(floor_with_a_pimple),
    named(plate_of_a_nanometre),
    named(sliver_of_a_tetrahedron),
    named(triangle_without_area),
    Case("T-junction", t_junction),
    named(unmerged_corners),
    named(missing_triangle),
    named(triangle_given_twice),
    named(flipped_triangle),
    named(inside_out_chamber),
    named(inside_out_island),
    named(flat_chamber),
]

"""One ball dropped or thrown at a face, an edge, a corner: exact bounce-back or deflection, by
symmetry.
"""

import math

import numpy as np
import trimesh

from sim_core import Balls, Gravity, Physics, TriangleMesh
from sim_core.effects.gravity import STANDARD as G
from tests.hard_cases.outcome import Claim, Outcome, named, near, outcome_of, play
from tests.helpers.scenes.cavities import box, box_around
from tests.helpers.scenes.fuzzed_chambers import Chamber
from tests.sim_core.loop.test_containment import TOUCH

RADIUS = 1.5e-3  # m
HALF = 0.03  # m: of the room about a body
DROP = 0.01  # m: from the start down to where a ball right above would touch
EXACT = 1e-12  # s, m/s: rounding of times below 1 s and of speeds below 10 m/s, a thousandfold
TURN = (
    TOUCH / RADIUS
)  # [-]: an edge is taken for met TOUCH early, which turns the line to the centre by this at most


def one_ball(position: tuple[float, float, float], velocity: tuple[float, float, float]) -> Balls:
    """A steel ball of 3 mm."""
    return Balls(np.array([position]), np.array([velocity]), 2.0 * RADIUS)


def ball_on_a_face() -> Outcome:
    """It comes back to where it was dropped, every 2 sqrt(2 h/g)."""
    start = one_ball((0.011, 0.013, RADIUS + DROP), (0.0, 0.0, 0.0))
    seen = play(Chamber(box((0.03, 0.03, 0.03)), start, Physics(Gravity())), 1.0)
    fall = math.sqrt(2.0 * DROP / G)
    times = fall * np.arange(1.0, 1.0 / fall, 2.0)
    return outcome_of(
        seen,
        "bounces for ever to the height it fell from",
        near("times of the bounces [s]", seen.time, times, EXACT),
        near("speeds [m/s]", seen.normal_speed, np.full(len(times), G * fall), EXACT),
        near("sideways [m]", seen.end.positions[0, :2], start.positions[0, :2], 0.0),
    )


def _ridge() -> TriangleMesh:
    """A room with a square bar in it, an edge of it on top, along y, at z = 0; its ends do not
    show.
    """
    bar = trimesh.creation.box((0.01, 0.02, 0.01))
    bar.apply_transform(trimesh.transformations.rotation_matrix(math.pi / 4.0, [0.0, 1.0, 0.0]))
    bar.apply_translation([0.0, 0.0, -0.005 * math.sqrt(2.0)])
    vertices = np.asarray(bar.vertices)
    vertices[np.abs(vertices) < 1e-15] = (
        0.0  # the top edge is where the formula has it, without rounding
    )
    return box_around(trimesh.Trimesh(vertices, bar.faces, process=False), HALF)


def _tip(slope: float) -> TriangleMesh:
    """A room with a four-sided pyramid in it, its tip on top at the origin; ``slope`` [-]: height
    over half width.
    """
    wide = 0.01 / slope
    corners = [
        [0.0, 0.0, 0.0],
        [wide, 0, -0.01],
        [0, wide, -0.01],
        [-wide, 0, -0.01],
        [0, -wide, -0.01],
    ]
    faces = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1], [1, 3, 2], [1, 4, 3]]
    return box_around(trimesh.Trimesh(corners, faces, process=False), HALF)


def _deflected(room: TriangleMesh, off: tuple[float, float], what: str) -> Outcome:
    """A ball falls on an edge along y or a tip at the origin, ``off`` (x, y) [m] beside it.

    It is touched where the centre is r from the edge or tip; there its velocity is mirrored at the
    normal, exactly.
    """
    start = one_ball((off[0], off[1], RADIUS + DROP), (0.0, 0.0, 0.0))
    aside = np.array([off[0], 0.0 if "edge" in what else off[1]])
    height = math.sqrt(RADIUS**2 - float(aside @ aside))
    speed = math.sqrt(2.0 * G * (RADIUS + DROP - height))
    normal = np.array([*aside, height]) / RADIUS
    after = np.array([0.0, 0.0, -speed]) + 2.0 * speed * normal[2] * normal
    hit = speed / G
    seen = play(Chamber(room, start, Physics(Gravity())), hit + 1e-3)
    at = np.array([off[0], off[1], height])
    fall = np.array([0.0, 0.0, -G])
    later = at + 1e-3 * after + 0.5e-6 * fall
    return outcome_of(
        seen,
        f"{what}: the velocity is mirrored at the line to the centre",
        near("time of the hit [s]", seen.time, [hit], EXACT),
        near("velocity [m/s]", seen.end.velocities[0], after + 1e-3 * fall, EXACT + TURN),
        near("place [m]", seen.end.positions[0], later, EXACT + TURN * 1e-3),
    )


def ball_on_an_edge() -> Outcome:
    """Right above it: straight back, by symmetry."""
    return _deflected(_ridge(), (0.0, 1e-3), "edge met in the middle")


def ball_bouncing_on_an_edge() -> Outcome:
    """A hundred times on one edge, right above it: each time at the same height, none deeper than
    the one before.
    """
    drop = 1e-4
    start = one_ball((0.0, 1e-3, RADIUS + drop), (0.0, 0.0, 0.0))
    seen = play(Chamber(_ridge(), start, Physics(Gravity())), 1.0)
    fall = math.sqrt(2.0 * drop / G)
    times = fall * np.arange(1.0, 1.0 / fall, 2.0)
    return outcome_of(
        seen,
        f"comes down {len(times)} times on the edge",
        near("times [s]", seen.time, times, len(times) * (EXACT + 4.0 * TOUCH / (G * fall))),
        near("sideways [m]", seen.end.positions[0, :2], [0.0, 1e-3], 0.0),
    )


def ball_beside_an_edge() -> Outcome:
    """Half a radius beside it: at 60 degrees to the side, cos θ = sqrt(3)/2."""
    return _deflected(_ridge(), (0.5 * RADIUS, 1e-3), "edge met half a radius off")


def ball_grazing_an_edge() -> Outcome:
    """A thousandth of a radius short of passing the edge (the bar's face falls away below it)."""
    return _deflected(_ridge(), (0.7 * RADIUS, 1e-3), "edge met near its face")


def ball_on_a_vertex() -> Outcome:
    """Right above a pyramid's tip: straight back."""
    return _deflected(_tip(1.0), (0.0, 0.0), "tip met in the middle")


def ball_beside_a_vertex() -> Outcome:
    """Beside it, over a face: the line to the tip decides, not the face's normal."""
    return _deflected(_tip(2.0), (0.3 * RADIUS, 0.2 * RADIUS), "tip met a third of a radius off")


def ball_on_a_needle() -> Outcome:
    """A needle 2 µm wide at its foot and 10 mm high: a tip like any other."""
    return _deflected(_tip(1e4), (0.3 * RADIUS, 0.2 * RADIUS), "needle met a third of a radius off")


def ball_along_a_shared_edge() -> Outcome:
    """It hops along the diagonal that two triangles of the floor share: that edge is not there."""
    room = box((0.03, 0.03, 0.03))
    start = one_ball((0.003, 0.003, RADIUS + 1e-4), (0.1, 0.1, 0.0))
    seen = play(Chamber(room, start, Physics(Gravity())), 0.2)
    fall = math.sqrt(2e-4 / G)
    return outcome_of(
        seen,
        "hops straight on along the diagonal",
        near("times of the hops [s]", seen.time, fall * np.arange(1.0, 0.2 / fall, 2.0), EXACT),
        near("speed along the floor [m/s]", seen.end.velocities[0, :2], [0.1, 0.1], 0.0),
        near("place along the floor [m]", seen.end.positions[0, :2], [0.023, 0.023], 1e-15),
    )


def ball_sliding_along_a_shared_edge() -> Outcome:
    """It touches the floor all along and does not approach it: nothing happens until it comes to
    the corner.
    """
    room = box((0.03, 0.03, 0.03))
    start = one_ball((0.003, 0.003, RADIUS), (0.1, 0.1, 0.0))
    seen = play(Chamber(room, start, Physics()), 0.2)
    return outcome_of(
        seen,
        "slides straight on, not hit once",
        near("hits", len(seen.time), 0, 0),
        near("velocity [m/s]", seen.end.velocities[0], [0.1, 0.1, 0.0], 0.0),
    )


def ball_into_a_corner() -> Outcome:
    """Three walls at right angles at once: straight back, in whatever order they come."""
    room = box((0.03, 0.03, 0.03))
    start = one_ball((0.01, 0.01, 0.01), (-1.0, -1.0, -1.0))
    seen = play(Chamber(room, start, Physics()), 0.015)
    return outcome_of(
        seen,
        "comes straight back out of the corner",
        near("hits", len(seen.time), 3, 0),
        near("velocity [m/s]", seen.end.velocities[0], [1.0, 1.0, 1.0], 1e-15),
    )


def ball_along_a_row_of_corners() -> Outcome:
    """Thrown along a row of coplanar triangles over all their corners: no hit but the far
    walls'.
    """
    room = box((0.03, 0.03, 0.03))
    fine = room
    for _ in range(3):
        vertices, triangles, index = trimesh.remesh.subdivide(
            fine.vertices, fine.triangles, return_index=True
        )
        origin = np.empty(len(triangles), dtype=int)
        for old, new in index.items():
            origin[new] = old
        fine = TriangleMesh(vertices, triangles, fine.tags[origin])
    line = 0.03 / 8.0  # a row of corners
    start = one_ball((0.01, line, RADIUS), (1.0, 0.0, 0.0))
    seen = play(Chamber(fine, start, Physics()), 1.0)
    way = 0.03 - 2.0 * RADIUS
    first = 0.03 - RADIUS - 0.01
    times = first + way * np.arange(0.0, (1.0 - first) / way)
    return outcome_of(
        seen,
        "meets the end walls alone",
        near("times [s]", seen.time, times, EXACT),
        Claim(bool((np.abs(seen.end.velocities[0]) == [1.0, 0.0, 0.0]).all()), "kicked aside"),
    )


CASES = [
    named(ball_on_a_face),
    named(ball_on_an_edge),
    named(ball_bouncing_on_an_edge),
    named(ball_beside_an_edge),
    named(ball_grazing_an_edge),
    named(ball_on_a_vertex),
    named(ball_beside_a_vertex),
    named(ball_on_a_needle),
    named(ball_along_a_shared_edge),
    named(ball_sliding_along_a_shared_edge),
    named(ball_into_a_corner),
    named(ball_along_a_row_of_corners),
]

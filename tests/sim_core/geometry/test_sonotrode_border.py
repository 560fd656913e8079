"""Balls at the border of a vibrating face.

They come onto it from a gentle slope, or out of a pit beside it; or are beneath the end of the
walls, where a face that swings wider than a ball's radius lets them get.
"""

import numpy as np
import pytest
from shapely.geometry import Polygon
from trimesh.creation import triangulate_polygon

from sim_core import (
    Balls,
    Gravity,
    ImpactLog,
    Physics,
    Scene,
    SceneError,
    TriangleMesh,
    Vibration,
    largest_amplitude,
    simulate,
)
from sim_core.scene.invariants import clearance
from tests.helpers.scenes.cavities import CEILING, ELASTIC, FLOOR, WEIGHTLESS

SWING = 25e-6  # m
RADIUS = 1.5e-3  # m


def trough(right: list[tuple[float, float]], left: float = 0.0) -> TriangleMesh:
    r"""A prism 4 cm deep. The left half of its floor vibrates; the right half has these corners (x,
    z) [m]; its left wall is at x = ``left`` [m].

    z=2cm  ___________________
          |                   |
          |              ___--|
          |_________-----
         x=0   floor  2cm    4cm
    """
    outline = np.array([(left, 0.0), (0.02, 0.0), *right, (0.04, 0.02), (left, 0.02)])
    n = len(outline)
    front, back = (
        np.column_stack([outline[:, 0], np.full(n, y), outline[:, 1]]) for y in (0.0, 0.04)
    )
    walls = [(k, k + n, (k + 1) % n) for k in range(n)] + [
        ((k + 1) % n, k + n, (k + 1) % n + n) for k in range(n)
    ]
    cap = np.array(triangulate_polygon(Polygon(outline), engine="manifold")[1])
    if np.linalg.det(np.diff(outline[cap[0]], axis=0)) < 0.0:
        cap = cap[:, ::-1]
    triangles = np.concatenate([walls, cap, cap[:, ::-1] + n])
    tags = np.full(len(triangles), CEILING)
    tags[[0, n]] = FLOOR
    return TriangleMesh(np.concatenate([front, back]), triangles, tags)


@pytest.mark.parametrize("phase", np.linspace(np.pi, 2.0 * np.pi, 12))
def test_a_ball_from_a_gentle_slope_does_not_pass_into_the_face(phase: float) -> None:
    """It starts over the slope, 16 µm from touching the plane of the face at rest, which swings by
    25 µm.
    """
    room = trough([(0.04, 0.02 * np.tan(np.radians(5.0)))])
    start = Balls(
        np.array([[0.0201, 0.02, RADIUS + 16e-6]]), np.array([[-1.0, 0.0, -0.08]]), 2.0 * RADIUS
    )
    end = simulate(
        Scene(
            room, start, Physics(WEIGHTLESS, ELASTIC, Vibration(FLOOR, SWING, 20e3, phase)), 0.003
        )
    ).balls
    assert clearance(room.corners, end.positions, 4.0 * RADIUS)[0] > RADIUS - SWING - 1e-9


@pytest.mark.parametrize("phase", np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False))
def test_a_ball_out_of_a_pit_comes_down_on_the_face(phase: float) -> None:
    """It starts within the swing of the face's plane, which it meets where no face is; over a
    ridge, it falls on it.
    """
    room = trough([(0.021, 1e-4), (0.022, -3e-3), (0.04, -3e-3)])
    start = Balls(
        np.array([[0.026, 0.02, RADIUS - 10e-6]]), np.array([[-3.3, 0.0, 0.6]]), 2.0 * RADIUS
    )
    physics = Physics(Gravity(0.0, 0.0, -500.0), ELASTIC, Vibration(FLOOR, SWING, 20e3, phase))
    log = simulate(Scene(room, start, physics, 0.003)).impacts
    assert room.tags[log.triangle[0]] == FLOOR
    assert log.time[0] == pytest.approx(2 * 0.6 / 500, rel=0.05)


def test_a_surface_flush_with_the_sonotrode_is_refused() -> None:
    flush = trough([(0.04, 1e-6)])
    ball = Balls(np.array([[0.01, 0.02, 0.01]]), np.zeros((1, 3)), 2.0 * RADIUS)
    with pytest.raises(
        SceneError, match=r"of triangle \d+ lies flat or rises by only 0.00286 degrees"
    ):
        simulate(Scene(flush, ball, Physics(vibration=Vibration(FLOOR, SWING, 20e3)), 0.001))


WIDE = 5.0 * RADIUS  # m: a swing
LOWERED = Vibration(FLOOR, WIDE, 1e-3, 1.5 * np.pi)  # as good as still, at its lowest


def first_impact(room: TriangleMesh, place: list[float], velocity: list[float]) -> ImpactLog:
    """Of a ball that flies over the lowered face."""
    start = Balls(np.array([place]), np.array([velocity]), 2.0 * RADIUS)
    return simulate(Scene(room, start, Physics(WEIGHTLESS, ELASTIC, LOWERED), 0.02)).impacts


def prism(outline: list[tuple[float, float]]) -> TriangleMesh:
    """A room 2 cm high over an outline (x, y) [m], anticlockwise; its floor vibrates."""
    n = len(outline)
    low, high = (np.column_stack([outline, np.full(n, z)]) for z in (0.0, 0.02))
    walls = [(k, (k + 1) % n, k + n) for k in range(n)] + [
        ((k + 1) % n, (k + 1) % n + n, k + n) for k in range(n)
    ]
    cap = np.array(triangulate_polygon(Polygon(outline), engine="manifold")[1])
    if np.linalg.det(np.diff(np.array(outline)[cap[0]], axis=0)) < 0.0:
        cap = cap[:, ::-1]
    triangles = np.concatenate([walls, cap[:, ::-1], cap + n])
    tags = np.repeat([CEILING, FLOOR, CEILING], [2 * n, len(cap), len(cap)])
    return TriangleMesh(np.concatenate([low, high]), triangles, tags)


BENEATH = -3.0 * RADIUS  # m: height of a centre, beneath the walls' ends by more than a radius
SQUARE = [(0.0, 0.0), (0.04, 0.0), (0.04, 0.04), (0.0, 0.04)]
# a corner juts in at (0.02, 0.02)
ELL = [(0.0, 0.0), (0.04, 0.0), (0.04, 0.02), (0.02, 0.02), (0.02, 0.04), (0.0, 0.04)]


@pytest.mark.parametrize("y", [0.005, 0.02, 0.0371])
def test_a_wall_goes_on_beneath_its_end_as_far_as_the_face_swings(y: float) -> None:
    log = first_impact(prism(SQUARE), [0.02, y, BENEATH], [3.0, 0.0, 0.0])
    np.testing.assert_allclose(log.position[0], [0.04 - RADIUS, y, BENEATH], atol=1e-12)
    np.testing.assert_allclose(log.time[0], (0.02 - RADIUS) / 3.0, rtol=1e-12)
    assert log.triangle[0] in (1, 5)  # of that wall


@pytest.mark.parametrize("aside", [-0.5, 0.0, 0.9])
def test_an_edge_that_juts_in_goes_on_beneath_its_end(aside: float) -> None:
    """A ball flies at the edge along the bisector, ``aside`` radii beside it."""
    way, across = np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0), np.array([-1.0, 1.0, 0.0]) / np.sqrt(2)
    corner = np.array([0.02, 0.02, BENEATH])
    miss = aside * RADIUS * across
    if abs(aside) < np.sqrt(0.5):  # it meets the edge itself
        reach = np.sqrt(1.0 - aside**2) * RADIUS
    else:  # it meets the face beside it
        reach = (np.sqrt(2.0) - abs(aside)) * RADIUS
    log = first_impact(prism(ELL), list(corner + miss - 0.01 * way), list(2.0 * way))
    np.testing.assert_allclose(log.position[0], corner + miss - reach * way, atol=1e-12)


@pytest.mark.parametrize("lean", [-0.003, 0.003])
def test_a_leaning_wall_goes_on_in_its_own_plane(lean: float) -> None:
    """At the height h a ball touches a wall of slope s = dy/dz at y = s h + R sqrt(1 + s²)."""
    room, slope = prism(SQUARE), -lean / 0.02
    vertices = room.vertices.copy()
    vertices[4:6, 1] -= lean  # the top of the wall at y = 0
    log = first_impact(
        TriangleMesh(vertices, room.triangles, room.tags), [0.02, 0.02, BENEATH], [0.0, -2.0, 0.0]
    )
    expected = slope * BENEATH + RADIUS * np.sqrt(1.0 + slope**2)
    np.testing.assert_allclose(log.position[0], [0.02, expected, BENEATH], atol=1e-12)


@pytest.mark.parametrize(
    ("lean", "limit"),
    [
        pytest.param(0.0, np.inf, id="upright"),
        pytest.param(0.02, RADIUS, id="rises outwards by 45 degrees: R tan"),
        pytest.param(-0.02, RADIUS * (1.0 + np.sqrt(2.0)), id="leans over by 45: R (1 + 1 / cos)"),
    ],
)
def test_the_largest_amplitude_is_where_face_and_wall_part(lean: float, limit: float) -> None:
    room = prism(SQUARE)
    vertices = room.vertices.copy()
    vertices[4:6, 1] -= lean  # the top of the wall at y = 0
    room = TriangleMesh(vertices, room.triangles, room.tags)
    found, place, _ = largest_amplitude(room, FLOOR, RADIUS)
    assert found == pytest.approx(limit, rel=1e-9)
    if np.isfinite(limit):
        np.testing.assert_allclose(place, [0.02, 0.0, 0.0], atol=1e-12)
        start = Balls(np.array([[0.02, 0.02, 0.012]]), np.zeros((1, 3)), 2.0 * RADIUS)
        swing = Vibration(FLOOR, 0.999 * limit, 1.0)
        simulate(Scene(room, start, Physics(WEIGHTLESS, ELASTIC, swing), 1e-3))
        swing = Vibration(FLOOR, 1.001 * limit, 1.0)
        with pytest.raises(SceneError, match=r"come out of it.* or lower the amplitude to 0\.0"):
            simulate(Scene(room, start, Physics(WEIGHTLESS, ELASTIC, swing), 1e-3))

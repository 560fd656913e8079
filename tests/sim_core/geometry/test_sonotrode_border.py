"""Balls that come onto the vibrating face over its border: from a gentle slope, or out of a pit
beside it.
"""

import numpy as np
import pytest
from shapely.geometry import Polygon
from trimesh.creation import triangulate_polygon

from sim_core import Balls, Gravity, Physics, Scene, SceneError, TriangleMesh, Vibration, simulate
from sim_core.scene.invariants import clearance
from tests.helpers.scenes.cavities import CEILING, FLOOR

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
        Scene(room, start, Physics(vibration=Vibration(FLOOR, SWING, 20e3, phase)), 0.003)
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
    physics = Physics(Gravity(0.0, 0.0, -500.0), None, Vibration(FLOOR, SWING, 20e3, phase))
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

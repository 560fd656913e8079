"""The lowest point of a surface over an outline, against bodies of which it is known."""

import math

import numpy as np
import pytest
import trimesh

from chamberopt.geometry.heights import INSIDE, lowest_over, points_up_to

SQUARE = 5e-3 * np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]], dtype=float)
NEAR = 4.0 * INSIDE


def _over(body: trimesh.Trimesh, outline: np.ndarray = SQUARE) -> float:
    return lowest_over(np.asarray(body.vertices), np.asarray(body.faces), outline)


@pytest.mark.parametrize("turn", range(0, 360, 30))
@pytest.mark.parametrize("lean", [0.0, 0.3])
def test_of_a_plate_wider_than_the_outline_a_corner_counts(turn: int, lean: float) -> None:
    """A plate that leans by a slope is lowest over the corner of the outline that is farthest down;
    no vertex of it is there."""
    plate = trimesh.creation.box((0.1, 0.1, 0.002))
    plate.vertices[:, 2] += lean * plate.vertices[:, 0]
    turned = np.radians(turn)
    plate.apply_transform(trimesh.transformations.rotation_matrix(turned, (0, 0, 1)))
    down = np.array([np.cos(turned), np.sin(turned)])
    expected = -1e-3 + lean * float((SQUARE @ down).min())
    assert _over(plate) == pytest.approx(expected, abs=NEAR)


def test_a_leg_outside_of_the_outline_does_not_count() -> None:
    """A bar across the outline has a leg beside it, which hangs lower and whose face lies in the
    wall that stands there."""
    bar = trimesh.creation.box(bounds=[(-8e-3, -1e-3, 2e-3), (8e-3, 1e-3, 3e-3)])
    leg = trimesh.creation.box(bounds=[(5e-3, -1e-3, -30e-3), (8e-3, 1e-3, 3e-3)])
    both = trimesh.util.concatenate([bar, leg])
    assert both.vertices[:, 2].min() == -30e-3
    assert _over(both) == pytest.approx(2e-3, abs=NEAR)
    assert _over(leg) == math.inf


def test_of_a_ball_the_rim_counts_or_its_lowest_point() -> None:
    ball = trimesh.creation.icosphere(5, 10e-3)
    assert _over(ball) == ball.vertices[:, 2].min()
    beside = ball.copy()
    beside.apply_translation((8e-3, 0.0, 0.0))  # the outline ends 3 mm before its middle
    assert _over(beside) == pytest.approx(-math.sqrt(1e-4 - 9e-6), abs=2e-5)


@pytest.mark.parametrize("level", [-0.4, 0.0, 0.3])
def test_of_a_cone_what_is_below_a_level_is_a_frustum(level: float) -> None:
    """Its radius falls by half of the height, from 1 at -1 to 0 at 1."""
    cone = trimesh.creation.cone(1.0, 2.0, sections=64)
    cone.apply_translation((0.0, 0.0, -1.0))
    points = points_up_to(np.asarray(cone.vertices), np.asarray(cone.faces), level)
    assert points[:, 2].max() == pytest.approx(level)
    assert points[:, 2].min() == pytest.approx(-1.0)
    rim = points[np.isclose(points[:, 2], level)]
    assert len(rim) == 64
    assert np.hypot(*rim.T[:2]) == pytest.approx(0.5 * (1.0 - level))
    whole = points_up_to(np.asarray(cone.vertices), np.asarray(cone.faces), 1.0)
    np.testing.assert_array_equal(whole, cone.vertices)

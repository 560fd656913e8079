"""Outlines of faces seen along an axis: circles, and distances of triangles."""

import numpy as np
import pytest

from chamberopt.geometry.outline import (
    centroid,
    convex_hull,
    distances_in_plan,
    fitted_circle,
    narrowest_rectangle,
    radii,
)


def test_a_circle_is_fitted_to_an_arc() -> None:
    """The outline of a bore with a keyway lacks a part of the circle."""
    angle = np.radians(np.arange(20.0, 341.0, 5.0))
    points = [3.0, -1.0] + 2.0 * np.c_[np.cos(angle), np.sin(angle)]
    middle, radius = fitted_circle(points)
    assert [*middle, radius] == pytest.approx([3.0, -1.0, 2.0])


def test_distances_of_triangles_also_edge_on() -> None:
    corners = np.array([
        [[1, -1], [1, 1], [3, 0]],  # a side faces the point
        [[1, 1], [2, 1], [1, 2]],  # a corner does
        [[2, 1], [3, 1], [2.5, 1]],  # edge on, beyond its end
        [[-1, -1], [2, -1], [0, 2]],  # holds the point
    ], dtype=float)  # fmt: skip
    for one in (corners, corners[:, ::-1]):
        found = distances_in_plan(one, np.zeros(2))
        assert found == pytest.approx([1.0, np.sqrt(2), np.sqrt(5), 0.0])


TRAPEZE = np.array([[0.0, 0.0], [6.0, 0.0], [4.0, 3.0], [1.0, 3.0]])


def turned(points: np.ndarray, degrees: float) -> np.ndarray:
    """Points turned about the origin, then moved."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return points @ np.array([[c, s], [-s, c]]) + [5.0, -7.0]


@pytest.mark.parametrize("degrees", [0.0, 30.0, 200.0])
def test_the_centroid_of_a_hull_is_that_of_its_triangles(degrees: float) -> None:
    """Of areas 9 and 4.5 about the means of their corners."""
    a, b, c, d = hull = turned(TRAPEZE, degrees)
    expected = (9.0 * (a + b + c) / 3.0 + 4.5 * (a + c + d) / 3.0) / 13.5
    assert centroid(hull) == pytest.approx(expected)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 200.0])
def test_a_square_has_half_a_side_and_half_a_diagonal_as_radii(degrees: float) -> None:
    square = turned(2.0 * np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]), degrees)
    middle = square.mean(axis=0)
    assert radii(square, middle) == pytest.approx((1.0, np.sqrt(2.0)))
    aside = middle + 0.25 * (square[1] - square[0]) / 2.0
    assert radii(square, aside) == pytest.approx((0.75, np.hypot(1.25, 1.0)))


@pytest.mark.parametrize("degrees", [0.0, 30.0, 110.0, 200.0])
@pytest.mark.parametrize("sides", [(5.0, 2.0), (2.0, 5.0)])
def test_the_narrowest_rectangle_is_the_rectangle_itself(
    degrees: float, sides: tuple[float, float]
) -> None:
    corners = turned(np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]) * sides, degrees)
    ends = [0.7 * corners[3] + 0.3 * corners[2], 0.5 * (corners[0] + corners[3])]
    cut = np.vstack([corners[:3], *ends])  # without a corner
    for hull in (corners, cut):
        middle, found, axes = narrowest_rectangle(convex_hull(hull))
        assert found == pytest.approx([5.0, 2.0])
        assert middle == pytest.approx(corners.mean(axis=0))
        assert axes @ axes.T == pytest.approx(np.eye(2))
        assert np.linalg.det(axes) == pytest.approx(1.0)
        long = corners[1] - corners[0] if sides[0] == 5.0 else corners[2] - corners[1]
        assert abs(axes[0] @ long) == pytest.approx(5.0)


def test_points_on_a_line_have_no_hull() -> None:
    assert convex_hull(np.array([[0.0, 0], [1, 1], [2, 2]])) is None

"""Outlines of faces seen along an axis: circles, and distances of triangles."""

import numpy as np
import pytest

from chamberopt.geometry.outline import distances_in_plan, fitted_circle


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

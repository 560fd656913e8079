"""Geometry of triangles against areas, volumes and points that are known."""

import numpy as np
import pytest

from chamberopt.geometry.triangles import closest_points


@pytest.mark.parametrize("size", [1.0, 5e-4, 5e-5])
def test_contact_is_the_nearest_point_of_the_triangle(size: float) -> None:
    """However small the triangle: a library's fixed tolerance once moved the contact by tenths of a millimetre."""
    corners = np.tile(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), (4, 1, 1))
    balls = np.array([[0.2, 0.2, 0.5], [0.5, -0.3, 0.4], [-1.0, -1.0, 0.1], [0.7, 0.01, 1.0]])
    contacts = np.array([[0.2, 0.2, 0], [0.5, 0, 0], [0, 0, 0], [0.7, 0.01, 0]])
    np.testing.assert_allclose(
        closest_points(size * corners, size * balls), size * contacts, atol=1e-12 * size
    )

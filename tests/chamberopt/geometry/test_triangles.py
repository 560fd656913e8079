"""Geometry of triangles against areas, volumes and points that are known."""

import numpy as np
import pytest
import trimesh

from chamberopt.geometry.triangles import (
    centre_of_mass,
    closest_on_each,
    find_shells,
    in_small_pieces,
    winding_number,
)


@pytest.mark.parametrize("size", [1.0, 5e-4, 5e-5])
def test_contact_is_the_nearest_point_of_the_triangle(size: float) -> None:
    """Also for small triangles: a library's tolerance once moved contacts by 0.1 mm."""
    corners = np.tile(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), (4, 1, 1))
    balls = np.array([[0.2, 0.2, 0.5], [0.5, -0.3, 0.4], [-1.0, -1.0, 0.1], [0.7, 0.01, 1.0]])
    contacts = np.array([[0.2, 0.2, 0], [0.5, 0, 0], [0, 0, 0], [0.7, 0.01, 0]])
    np.testing.assert_allclose(
        closest_on_each(size * corners, size * balls), size * contacts, atol=1e-12 * size
    )


def test_pieces_of_a_surface_and_their_volumes() -> None:
    a, b = trimesh.creation.box((1, 1, 1)), trimesh.creation.box((2, 2, 2))
    vertices = np.r_[a.vertices, b.vertices + 5.0]
    triangles = np.r_[a.faces, np.asarray(b.faces)[:, ::-1] + len(a.vertices)]

    shells, volumes = find_shells(vertices, triangles)

    assert (np.bincount(shells) == 12).all()
    assert sorted(volumes) == pytest.approx([-8.0, 1.0])


def test_the_centre_of_mass_is_that_of_the_solid() -> None:
    """A cube of 8 m³ about the origin and one of 1 m³ about (5, 0, 0), however finely meshed."""
    a = trimesh.creation.box((2, 2, 2))
    b = trimesh.creation.box((1, 1, 1)).subdivide().apply_translation([5, 0, 0])
    both = trimesh.util.concatenate([a, b]).apply_translation([0, 7, 0])
    middle = centre_of_mass(np.asarray(both.vertices), np.asarray(both.faces))
    np.testing.assert_allclose(middle, [5 / 9, 7, 0], atol=1e-12)


def test_small_pieces_are_those_connected_by_their_corners() -> None:
    """Squares of 1 m²: two that touch at a corner are one piece of 2 m², a third is alone."""
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    halves = np.array([[0, 1, 2], [0, 2, 3]])
    away = np.array([[0.0, 0, 0], [1, 1, 0], [5, 0, 0]])
    vertices = (away[:, None] + square).reshape(-1, 3)
    touching = halves + 4
    touching[touching == 4] = 2
    triangles = np.concatenate([halves, touching, halves + 8])
    marked = np.ones(6, dtype=bool)
    alone = np.array([0, 0, 0, 0, 1, 1], dtype=bool)
    np.testing.assert_array_equal(in_small_pieces(vertices, triangles, marked, 1.5), alone)
    assert not in_small_pieces(vertices, triangles, marked, 0.9).any()
    assert not in_small_pieces(vertices, triangles, ~marked, 9.0).any()
    marked[1] = marked[2] = False  # half of a square each, still connected
    assert not in_small_pieces(vertices, triangles, marked, 0.99).any()


def test_the_winding_number_tells_inside_from_outside() -> None:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=1.0)
    points = np.array([[0.0, 0.0, 0.0], [0.7, 0.1, 0.0], [1.5, 0.0, 0.0], [0.0, -9.0, 3.0]])

    assert winding_number(points, ball.vertices[ball.faces]) == pytest.approx(
        [1, 1, 0, 0], abs=1e-12
    )

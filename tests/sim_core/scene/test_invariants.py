"""The independent checks are themselves checked against libraries."""

import numpy as np
import trimesh

from sim_core import TriangleMesh
from sim_core.scene.invariants import (
    RAYS,
    TurnedSurface,
    clearance,
    closest_pair,
    contained,
    enclosed,
    triangles_near,
)
from tests.helpers.scenes.cavities import balls_at, box, box_around, cylinder


def test_containment_agrees_with_what_the_shape_says() -> None:
    rng = np.random.default_rng(1)
    points = rng.uniform(-0.06, 0.06, (20_000, 3))
    inside_box = (np.abs(points) < 0.05).all(axis=1)
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.03)
    planes = np.einsum("ij,pj->pi", ball.face_normals, points) - np.einsum(
        "ij,ij->i", ball.face_normals, ball.triangles[:, 0]
    )
    inside_body = (planes < 0.0).all(axis=1)
    np.testing.assert_array_equal(
        contained(box_around(ball, 0.05), points), inside_box & ~inside_body
    )


def test_a_point_in_line_with_edges_and_corners_is_judged_by_another_ray() -> None:
    room = box((1.0, 1.0, 1.0))
    middle = np.array([0.5, 0.5, 0.5])
    through_corner = np.array([1.0, 1.0, 1.0]) - 0.4 * RAYS[0]
    through_edge = np.array([1.0, 1.0, 0.6]) - 0.3 * RAYS[0]
    points = np.array([middle, through_corner, through_edge, through_edge + np.array([0.9, 0, 0])])
    np.testing.assert_array_equal(contained(room, points), [True, True, True, False])


def test_clearance_agrees_with_trimesh() -> None:
    room = cylinder(0.035, 0.04, sections=24)
    points = np.random.default_rng(2).uniform(-0.03, 0.03, (300, 3)) + np.array([0, 0, 0.02])
    expected = [
        np.linalg.norm(
            trimesh.triangles.closest_point(room.corners, np.tile(p, (len(room.corners), 1))) - p,
            axis=1,
        ).min()
        for p in points
    ]
    np.testing.assert_allclose(
        clearance(room.corners, points, 0.01), np.minimum(expected, 0.01), atol=1e-12
    )


def test_the_closest_pair_is_found() -> None:
    balls = balls_at(np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0.02, 0], [0, 0.5, 0]]))
    assert closest_pair(balls) == (0.02, 1, 2)
    assert closest_pair(balls_at(np.zeros((1, 3)))) == (np.inf, -1, -1)


def test_a_mesh_of_many_triangles_is_judged_as_when_every_triangle_is_asked() -> None:
    """Cells only leave out triangles that are too far to matter, whatever their sizes."""
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.03)
    slab = trimesh.creation.box((0.002, 0.09, 0.09))  # large triangles beside small ones
    for shape in (ball, trimesh.util.concatenate([ball, slab.apply_translation((0.06, 0.0, 0.0))])):
        mesh = TriangleMesh(shape.vertices, shape.faces, np.zeros(len(shape.faces), dtype=int))
        points = np.random.default_rng(3).uniform(-0.035, 0.07, (500, 3))
        inside = np.linalg.norm(points, axis=1) < 0.03 * 0.99
        outside = (np.linalg.norm(points, axis=1) > 0.03) & (points[:, 0] < 0.058)
        found = contained(mesh, points)
        assert found[inside].all()
        assert not found[outside].any()
        np.testing.assert_array_equal(found, contained(mesh, points, mesh.corners))
        for reach in (1e-4, 3e-3, 0.05):
            near = triangles_near(mesh, points[:20], reach)
            of_near = clearance(mesh.corners[near], points[:20], reach)
            np.testing.assert_array_equal(of_near, clearance(mesh.corners, points[:20], reach))
    assert len(triangles_near(mesh, points[:1], 1e-3)) < 0.1 * len(mesh.triangles)


def test_a_turned_surface_encloses_what_its_solid_angle_says() -> None:
    """Also where a ray leaves by a slit of 1 µm, as between a turned part and a wall."""
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.03)
    mesh = box_around(ball, 0.05)
    corners = mesh.corners.copy()
    turn = trimesh.transformations.rotation_matrix(0.3, [0.2, 0.5, 1.0])[:3, :3]
    of_ball = np.abs(corners).max(axis=(1, 2)) < 0.04
    corners[of_ball] = corners[of_ball] @ turn.T
    ceiling = (corners[..., 2] > 0.049).all(axis=1)
    corners[ceiling, :, 0] *= 1.0 - 2e-5  # slits beside the walls at x = -50 and 50 mm
    slit = np.array([0.05 - 0.5e-6, 0.01, 0.05])
    beneath = slit - 0.005 * RAYS[0] / np.linalg.norm(RAYS[0])
    points = np.random.default_rng(4).uniform(-0.06, 0.06, (2000, 3))
    points = np.concatenate([points, [beneath]])
    surface = TurnedSurface(mesh, corners)
    expected = enclosed(corners, points)
    assert expected[-1]
    assert 0.3 < expected.mean() < 0.7
    np.testing.assert_array_equal(surface.encloses(points), expected)
    near = corners[surface.near(points[:20], 3e-3)]
    assert len(near) < 0.5 * len(corners)
    np.testing.assert_array_equal(
        clearance(near, points[:20], 3e-3), clearance(corners, points[:20], 3e-3)
    )

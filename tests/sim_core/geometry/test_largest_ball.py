"""The largest ball at a point, against all triangles in turn and against what no ball may cross."""

import numpy as np
import pytest
import trimesh

from sim_core import TriangleMesh, largest_balls
from sim_core.scene.invariants import clearance
from tests.helpers.scenes.cavities import box_around

LIMIT = 3e-3


def cavity(seed: int) -> tuple[TriangleMesh, np.ndarray, np.ndarray]:
    """A room of 20 mm round a lumpy ball, 400 points of all its surface, and the normals there."""
    rng = np.random.default_rng(seed)
    blob = trimesh.creation.icosphere(subdivisions=2, radius=5e-3)
    blob.vertices += rng.normal(0.0, 3e-4, blob.vertices.shape)
    mesh = box_around(blob, 10e-3)
    surface = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
    point, triangle = trimesh.sample.sample_surface(surface, 400, seed=seed)
    return mesh, point, -surface.face_normals[triangle]


@pytest.mark.parametrize("overlap", [1e-9, 2e-5])
def test_it_reaches_the_surface_by_the_overlap_and_no_larger_one_does_not(overlap: float) -> None:
    mesh, point, normal = cavity(1)
    radius, obstacle, _ = largest_balls(mesh, point, normal, LIMIT, overlap)
    away = clearance(mesh.corners, point + radius[:, None] * normal, 2.0 * LIMIT)
    limited = obstacle >= 0
    assert (away >= radius - overlap - 1e-11).all()
    np.testing.assert_allclose(away[limited], (radius - overlap)[limited], atol=1e-11)
    np.testing.assert_array_equal(radius[~limited], LIMIT)
    assert 40 < limited.sum() < 360
    wider = (radius * 1.01)[limited]
    away = clearance(mesh.corners, (point[limited] + wider[:, None] * normal[limited]), 2.0 * LIMIT)
    assert (away < wider - overlap).all()


def test_its_obstacle_is_the_triangle_that_it_meets_at_the_cosine_of_both_normals() -> None:
    mesh, point, normal = cavity(2)
    radius, obstacle, cosine = largest_balls(mesh, point, normal, LIMIT, 1e-9)
    for k in np.flatnonzero(obstacle >= 0):
        centre = point[k] + radius[k] * normal[k]
        own = mesh.corners[obstacle[k]]
        assert clearance(own[None], centre[None], 1.0)[0] == pytest.approx(radius[k], abs=1e-8)
    np.testing.assert_array_equal(cosine[obstacle < 0], 0.0)
    assert (np.abs(cosine) <= 1.0 + 1e-6).all()


def test_it_does_not_matter_how_large_the_ball_is_that_shrinks_or_how_large_all_is() -> None:
    mesh, point, normal = cavity(3)
    radius, obstacle, cosine = largest_balls(mesh, point, normal, LIMIT, 1e-6)
    wide = largest_balls(mesh, point, normal, 2.0 * LIMIT, 1e-6)
    np.testing.assert_allclose(np.minimum(wide[0], LIMIT), radius, atol=1e-14)
    large = TriangleMesh(1e3 * mesh.vertices, mesh.triangles, mesh.tags)
    as_large = largest_balls(large, 1e3 * point, normal, 1e3 * LIMIT, 1e-3)
    np.testing.assert_allclose(as_large[0], 1e3 * radius, rtol=1e-9)
    np.testing.assert_array_equal(as_large[1] >= 0, obstacle >= 0)
    np.testing.assert_allclose(as_large[2], cosine, atol=1e-4)


def test_a_ball_of_the_overlap_alone_is_what_is_left_where_nothing_fits() -> None:
    """In a corner: the neighbouring wall is at the point itself."""
    mesh = box_around(trimesh.creation.icosphere(radius=1e-3), 10e-3)
    corner = np.array([[-10e-3, -10e-3, 0.0]])
    radius, _, _ = largest_balls(mesh, corner, np.array([[1.0, 0, 0]]), LIMIT, 1e-5)
    assert radius == pytest.approx(1e-5)

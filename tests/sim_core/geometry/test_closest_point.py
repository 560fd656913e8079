"""The closest surface point, against every triangle in turn and against closed forms."""

import numpy as np
import pytest
import trimesh

from sim_core import SceneError, TriangleMesh, closest_on_each, closest_points
from sim_core.scene.invariants import clearance
from tests.helpers.scenes.cavities import CEILING, FLOOR, box, box_around


def test_it_is_the_nearest_of_all_triangles() -> None:
    rng = np.random.default_rng(1)
    blob = trimesh.creation.icosphere(subdivisions=2, radius=4e-3)
    blob.vertices += rng.normal(0.0, 3e-4, blob.vertices.shape)
    mesh = box_around(blob, 10e-3)
    places = rng.uniform(-12e-3, 12e-3, (2000, 3))
    for reach in (1.0, 2e-3):
        found = closest_points(mesh, places, reach)
        np.testing.assert_allclose(
            found.distance, clearance(mesh.corners, places, reach), rtol=0, atol=1e-15
        )
        hit = found.triangle >= 0
        assert hit.all() == (reach == 1.0)
        np.testing.assert_allclose(
            np.linalg.norm(found.point - places, axis=1)[hit], found.distance[hit], atol=1e-15
        )
        own = mesh.corners[found.triangle[hit]]
        on_it = [clearance(own[[k]], found.point[hit][[k]], 1.0)[0] for k in range(50)]
        assert max(on_it) < 1e-15
        np.testing.assert_array_equal(found.distance[~hit], reach)
        np.testing.assert_allclose(found.point[~hit], places[~hit], atol=1e-15)


def test_each_place_has_its_own_reach_and_a_tag_can_be_asked_for() -> None:
    mesh = box((10e-3, 20e-3, 30e-3))
    place = np.array([[1e-3, 8e-3, 14e-3]] * 2)
    found = closest_points(mesh, place, np.array([0.9e-3, 1.1e-3]))
    assert found.triangle[0] == -1
    np.testing.assert_allclose(found.point[1], [0.0, 8e-3, 14e-3], atol=1e-18)
    for tag, away in ((FLOOR, 14e-3), (CEILING, 16e-3)):
        asked = closest_points(mesh, place, 1.0, tag)
        np.testing.assert_allclose(asked.distance, away)
        assert (mesh.tags[asked.triangle] == tag).all()
    with pytest.raises(SceneError, match="no triangle of tag 7"):
        closest_points(mesh, place, 1.0, 7)


def test_a_needle_is_no_worse_than_a_line() -> None:
    """A triangle without area, as rounding leaves them, counts as its longest side."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0, 0], [0.5, 0.5, 1.0]])
    triangles = [
        [1, 0, 2],
        [2, 0, 3],
        [0, 4, 5],
        [4, 1, 5],
        [0, 1, 4],
        [1, 2, 5],
        [2, 3, 5],
        [3, 0, 5],
    ]
    mesh = TriangleMesh(corners, np.array(triangles), np.zeros(8))
    found = closest_points(mesh, np.array([[0.3, -2.0, 0.0]]), 10.0)
    np.testing.assert_allclose(found.distance, 2.0)


@pytest.mark.parametrize("size", [1.0, 5e-4, 5e-5])
def test_contact_is_the_nearest_point_of_the_triangle(size: float) -> None:
    """Also for small triangles: a library's tolerance once moved contacts by 0.1 mm."""
    corners = np.tile(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), (4, 1, 1))
    balls = np.array([[0.2, 0.2, 0.5], [0.5, -0.3, 0.4], [-1.0, -1.0, 0.1], [0.7, 0.01, 1.0]])
    contacts = np.array([[0.2, 0.2, 0], [0.5, 0, 0], [0, 0, 0], [0.7, 0.01, 0]])
    np.testing.assert_allclose(
        closest_on_each(size * corners, size * balls), size * contacts, atol=1e-12 * size
    )


def test_each_triangle_is_asked_about_its_own_place() -> None:
    """As a search in a mesh of this triangle alone, in any order of its corners."""
    rng = np.random.default_rng(2)
    corners, places = rng.normal(0.0, 3e-3, (40, 3, 3)), rng.normal(0.0, 6e-3, (40, 3))
    found = closest_on_each(corners, places)
    for own, place, point in zip(corners, places, found, strict=True):
        away = clearance(own[None], place[None], 1.0)[0]
        assert np.linalg.norm(point - place) == pytest.approx(away, abs=1e-15)
        assert clearance(own[None], point[None], 1.0)[0] < 1e-15
    np.testing.assert_allclose(closest_on_each(corners[:, [2, 0, 1]], places), found, atol=1e-15)
    assert closest_on_each(corners[:0], places[:0]).shape == (0, 3)

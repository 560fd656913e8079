"""From where a chosen part of a surface is seen best: boxes, and a box below a roof."""

import numpy as np
import pytest
import trimesh

from chamberopt.geometry.sight import POINTS, _share, _spread, _way, way_to_see


@pytest.mark.parametrize(
    ("normal", "height"), [([0, 0, -1], -40.0), ([0, 0, 1], 40.0), ([1, 0, 0], 20.0)]
)
def test_a_face_of_a_box_is_seen(normal: list[float], height: float) -> None:
    box = trimesh.creation.box([2.0, 2.0, 2.0])
    way = way_to_see(box.vertices, box.faces, box.face_normals @ normal > 0.9)
    assert np.linalg.norm(way) == pytest.approx(1.0)
    assert np.degrees(np.arcsin(way[2])) == pytest.approx(height)
    assert way @ normal > 0.5


def test_what_a_roof_hides_is_seen_from_below() -> None:
    """The top of a small box is near to a wide roof, through which it cannot be seen."""
    box = trimesh.creation.box([4.0, 4.0, 1.0])
    roof = trimesh.creation.box([9.0, 9.0, 0.1])
    roof.apply_translation([0.0, 0.0, 4.0])
    both = trimesh.util.concatenate(box, roof)
    chosen = np.arange(len(both.faces)) < len(box.faces)
    top = chosen & (both.face_normals[:, 2] > 0.9)
    assert 0.0 < way_to_see(both.vertices, both.faces, top)[2] < 0.5  # below the roof's border
    roof.apply_translation([0.0, 0.0, -3.0])  # close above
    near = trimesh.util.concatenate(box, roof)
    assert way_to_see(near.vertices, near.faces, chosen & (near.face_normals[:, 2] < -0.9))[2] < 0


def test_without_a_target_the_eye_is_at_the_usual_place() -> None:
    box = trimesh.creation.box()
    usual = way_to_see(box.vertices, box.faces, np.zeros(len(box.faces), dtype=bool))
    assert usual == pytest.approx([0.497, -0.798, 0.342], abs=1e-3)


def test_points_are_spread_by_area_over_triangles_that_they_know() -> None:
    """Squares of 1 and 3 m², of which the second looks down."""
    one = trimesh.creation.box((1.0, 1.0, 1.0))
    corners = one.triangles[one.face_normals[:, 2] > 0.5]
    both = np.concatenate([corners, corners[:, ::-1] * (3.0, 1.0, -1.0) + (9.0, 0.0, 0.0)])
    place, normal = _spread(both, np.array([0.5, 0.5, 1.5, 1.5]))
    assert len(place) == len(normal) == POINTS
    first = place[:, 0] < 1.0
    assert first.mean() == pytest.approx(0.25, abs=1e-3)
    np.testing.assert_allclose(normal[:, 2], np.where(first, 1.0, -1.0))
    np.testing.assert_allclose(place[:, 2], np.where(first, 0.5, -0.5))
    assert place[first].mean(axis=0) == pytest.approx([0.0, 0.0, 0.5], abs=0.02)
    assert place[~first].mean(axis=0) == pytest.approx([9.0, 0.0, -0.5], abs=0.05)
    assert [len(part) for part in _spread(both[:0], np.zeros(0))] == [0, 0]


@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_what_is_seen_is_as_oblique_as_it_is_and_hidden_by_what_is_nearer(unit: float) -> None:
    grid = (np.arange(40) + 0.5) / 40.0
    x, y = (one.ravel() for one in np.meshgrid(grid, grid))
    lower, up = np.c_[x, y, 0.0 * x], np.tile([0.0, 0.0, 1.0], (1600, 1))
    wanted, width = np.ones(1600, dtype=bool), 0.1 * unit
    for height in (90.0 - 1e-6, 60.0, 30.0):
        way = _way(np.array([0.7]), height)[0]
        share = _share(unit * lower, up, wanted, way, width)
        assert share == pytest.approx(np.sin(np.radians(height)), rel=1e-6)
        assert _share(unit * lower, -up, wanted, way, width) == 0.0
    above = np.c_[x, y, 0.0 * x + 1.0]
    covered = x < 0.5
    place, normal = np.concatenate([lower, above[covered]]), np.concatenate([up, up[covered]])
    way = _way(np.array([0.7]), 90.0 - 1e-6)[0]
    among = np.arange(len(place)) < 1600
    assert _share(unit * place, normal, among, way, width) == pytest.approx(0.5, abs=0.08)


def test_another_unit_and_place_change_no_view() -> None:
    shape = trimesh.creation.annulus(1.0, 2.0, 0.5)
    chosen = (shape.face_normals[:, 0] > 0.5) & (np.hypot(*shape.triangles_center.T[:2]) < 1.5)
    view = way_to_see(shape.vertices, shape.faces, chosen)
    assert view @ [1.0, 0.0, 0.0] > 0.3  # into the bore, on the side that looks so
    for moved in (1e-3 * shape.vertices, np.add(shape.vertices, [5.0, -3.0, 7.0])):
        assert way_to_see(moved, shape.faces, chosen) == pytest.approx(view)

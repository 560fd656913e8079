"""Geometry of triangles against areas, volumes and points that are known."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from chamberopt.geometry.triangles import (
    angles_between,
    areas,
    border_edges,
    centre_of_mass,
    count_up,
    facet_normals,
    find_shells,
    find_unwalled_border,
    heights,
    in_small_pieces,
    interpolate,
    on_triangles,
    rotation_matrix,
    sharp_edges,
    shell_winding,
    side_pairs,
    sides_of,
    swept,
    tetrahedron_volumes,
    unique_rows,
    winding_number,
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


def test_two_shells_are_one_in_the_other_or_beside_it() -> None:
    boxes = [trimesh.creation.box((size,) * 3).subdivide() for size in (1, 3, 1)]
    boxes[2].apply_translation((2.5, 0, 0))
    whole = trimesh.util.concatenate(boxes)
    shells, volumes = find_shells(np.asarray(whole.vertices), np.asarray(whole.faces))
    assert volumes == pytest.approx([1, 27, 1])
    for outer, inner, number in ((1, 0, 1), (0, 1, 0), (0, 2, 0), (1, 2, 0)):
        assert shell_winding(whole.vertices, whole.faces, shells, outer, inner) == pytest.approx(
            number, abs=1e-9
        )


def test_equal_rows_are_one_set() -> None:
    rows = np.random.default_rng(0).integers(0, 3, (200, 3)).astype(float)
    _, first, which = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    found = unique_rows(rows)
    np.testing.assert_array_equal(found[0], first)
    np.testing.assert_array_equal(found[1], which.reshape(-1))
    assert count_up(np.array([3, 0, 2])).tolist() == [0, 1, 2, 0, 1]


def test_the_two_sides_at_an_edge_run_against_each_other() -> None:
    ball = trimesh.creation.icosphere(2)
    sides, pairs = sides_of(np.asarray(ball.faces)), side_pairs(np.asarray(ball.faces))
    assert sorted(pairs.ravel()) == list(range(3 * len(ball.faces)))
    np.testing.assert_array_equal(sides[pairs[:, 0]], sides[pairs[:, 1], ::-1])
    assert len(border_edges(np.asarray(ball.faces))) == 0
    half = np.asarray(ball.faces)[ball.triangles_center[:, 2] > 0.0]
    border = border_edges(half)
    assert sorted(border[:, 0]) == sorted(border[:, 1])  # it closes
    taken = {tuple(one) for one in sides_of(half).tolist()}
    assert {(int(b), int(a)) for a, b in border}.isdisjoint(taken)


@pytest.mark.parametrize("way", [(0.0, 0.0, -2.0), (0.3, -0.4, -2.0)])
def test_a_swept_piece_encloses_its_area_times_the_way_along_its_normal(
    way: tuple[float, float, float],
) -> None:
    square = trimesh.creation.box((3.0, 2.0, 1.0)).subdivide()
    own = np.asarray(square.faces)[square.face_normals[:, 2] > 0.5]
    for each in (np.array(way), np.tile(way, (len(square.vertices), 1))):
        vertices, triangles = swept(np.asarray(square.vertices), own, each)
        assert len(side_pairs(triangles)) * 2 == 3 * len(triangles)
        assert triangles.min() >= 0
        assert tetrahedron_volumes(vertices, triangles).sum() == pytest.approx(12.0)


@pytest.mark.parametrize(("degrees", "count"), [(29.0, 36), (31.0, 24), (89.0, 24), (91.0, 0)])
def test_edges_are_sharp_beyond_their_angle(degrees: float, count: int) -> None:
    """A prism of twelve sides: they turn by 30 degrees, and by 90 at the two rims."""
    prism = trimesh.creation.cylinder(1.0, 2.0, sections=12)
    found = sharp_edges(np.asarray(prism.vertices), np.asarray(prism.faces), degrees)
    assert len(found) == count
    length = np.linalg.norm(np.subtract(*prism.vertices[found.T]), axis=1)
    side = 2.0 * np.sin(np.radians(15.0))
    assert sorted(length) == pytest.approx([side] * min(count, 24) + [2.0] * max(count - 24, 0))


def test_without_an_angle_edges_are_sharp_beyond_thirty_degrees() -> None:
    for sections, is_sharp in ((11, True), (13, False)):
        prism = trimesh.creation.cylinder(1.0, 2.0, sections=sections)
        found = sharp_edges(np.asarray(prism.vertices), np.asarray(prism.faces))
        assert len(found) == (2 + is_sharp) * sections


def test_a_floor_has_walls_all_round_unless_what_is_beside_it_is_level() -> None:
    room = trimesh.creation.box((2.0, 2.0, 1.0)).subdivide()
    vertices, triangles = np.asarray(room.vertices), np.asarray(room.faces)
    floor = room.face_normals[:, 2] < -0.5
    assert find_unwalled_border(vertices, triangles, floor) is None
    found = find_unwalled_border(
        vertices, triangles, floor & (vertices[triangles, 0] <= 1e-9).all(axis=1)
    )
    assert found is not None
    assert found[[0, 2]] == pytest.approx([0.0, -0.5])
    # A tent over a floor of two metres, whose sides rise by little.
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0, 0, 1]])
    tent = np.array([[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    for rise, is_open in ((2e-3, False), (0.5e-3, True)):
        found = find_unwalled_border(corners * (1, 1, rise), tent, np.arange(6) < 2)
        assert (found is not None) == is_open


def test_the_height_of_a_triangle_is_that_over_its_longest_side() -> None:
    """Sides of 3, 4 and 5: twice the area of 6 over 5; a needle and a point have none."""
    vertices = np.array([[0.0, 0, 0], [3, 0, 0], [0, 4, 0], [6, 0, 0]])
    triangles = np.array([[0, 1, 2], [2, 0, 1], [1, 2, 0], [0, 1, 3], [1, 1, 1]])
    assert heights(vertices, triangles) == pytest.approx([2.4, 2.4, 2.4, 0.0, 0.0])
    assert areas(vertices, triangles) == pytest.approx([6.0, 6.0, 6.0, 0.0, 0.0])


def test_normals_are_across_their_triangles_by_the_right_hand() -> None:
    corners = np.random.default_rng(5).normal(size=(30, 3, 3))
    normals, (a, b, c) = facet_normals(corners), corners.swapaxes(0, 1)
    for k in range(3):
        one = normals[:, k]
        assert np.linalg.norm(one, axis=1) == pytest.approx(1.0)
        for side in (b - a, c - b):
            assert np.einsum("ij,ij->i", one, side) == pytest.approx(0.0, abs=1e-12)
        assert (np.einsum("ij,ij->i", one, np.cross(b - a, c - b)) > 0.0).all()
    assert not facet_normals(corners[:, [0, 0, 1]]).any()


def test_what_is_linear_is_interpolated_exactly_wherever_a_point_lies() -> None:
    rng = np.random.default_rng(1)
    corners, slope = rng.normal(size=(40, 3, 3)), rng.normal(size=(3, 2))
    weights = rng.normal(0.5, 1.0, (40, 2))  # also outside of the triangle
    weights = np.c_[weights, 1.0 - weights.sum(axis=1)]
    places = np.einsum("pk,pki->pi", weights, corners)
    beside = places + rng.normal(size=(40, 1)) * facet_normals(corners)[:, 0]
    for one in (places, beside):
        np.testing.assert_allclose(interpolate(corners @ slope, corners, one), places @ slope)
    values, needle = rng.normal(size=(1, 3, 2)), np.array([[[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]])
    np.testing.assert_allclose(interpolate(values, needle, needle[:, 0]), values.mean(axis=1))


def test_an_even_spread_on_the_square_is_even_on_triangles() -> None:
    corners = np.random.default_rng(2).normal(size=(5, 3, 3))
    step = (np.arange(20) + 0.5) / 20
    u, v = (np.repeat(one.reshape(-1, 1), 5, axis=1) for one in np.meshgrid(step, step + 1e-3))
    found = on_triangles(corners, u, v)
    np.testing.assert_allclose(on_triangles(corners, 1.0 - u, 1.0 - v), found)
    np.testing.assert_allclose(found.mean(axis=0), corners.mean(axis=1), atol=0.02)
    a, b, c = corners.swapaxes(0, 1)
    own = np.tile(np.eye(3), (2000, 1, 1))  # of each corner its share at a point
    assert interpolate(own, np.tile(corners, (400, 1, 1)), found.reshape(-1, 3)).min() > -1e-12
    np.testing.assert_allclose(on_triangles(corners, np.ones(5), np.zeros(5)), b)
    np.testing.assert_allclose(on_triangles(corners, np.zeros(5), np.ones(5)), c)
    np.testing.assert_allclose(on_triangles(corners, np.zeros(5), np.zeros(5)), a)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, 2.0, np.pi])
def test_the_angle_between_vectors_is_exact_however_small(angle: float) -> None:
    one, two = np.array([[1.0, 0, 0]]), np.array([[np.cos(angle), np.sin(angle), 0]])
    assert angles_between(one, two)[0] == pytest.approx(angle, rel=1e-6)


def test_rotations_are_about_fixed_axes_and_exact_for_quarter_turns() -> None:
    rng = np.random.default_rng(3)
    for degrees in rng.uniform(-400.0, 400.0, (20, 3)):
        np.testing.assert_allclose(
            rotation_matrix(tuple(degrees)),
            Rotation.from_euler("xyz", degrees, degrees=True).as_matrix(),
            atol=1e-12,
        )
    for quarters in rng.integers(-5, 6, (20, 3)):
        matrix = rotation_matrix(tuple(90.0 * quarters))
        np.testing.assert_array_equal(matrix, matrix.round())

"""The mesh that the field is drawn on."""

from collections.abc import Callable

import numpy as np
import pytest
from trimesh.creation import box

from chamberopt.coverage.field import display_mesh
from chamberopt.coverage.field.display_mesh import DisplayMesh
from chamberopt.coverage.field.smooth_faces import Places, find_faces
from chamberopt.geometry.triangles import areas

SIDE = 0.02  # m, of a cube
GAUGE = 1e-6  # m²
DIAMETER = 2.0 * np.sqrt(GAUGE / np.pi)


def cube_mesh(
    coverage: Callable[[Places], np.ndarray], shown: int = 12, one_face: bool = False
) -> DisplayMesh:
    """The display mesh of a cube, of which the field is drawn on the first triangles only."""
    return mesh_and_numbers(coverage, shown, one_face)[0]


def mesh_and_numbers(
    coverage: Callable[[Places], np.ndarray], shown: int = 12, one_face: bool = False
) -> tuple[DisplayMesh, np.ndarray]:
    cube = box([SIDE] * 3)
    drawn = np.arange(12) < shown
    face = find_faces(cube.vertices, cube.faces, drawn)[0].of_triangle * (not one_face)
    normals = np.repeat(cube.face_normals[:, None], 3, axis=1)
    return display_mesh.display_mesh(
        np.asarray(cube.vertices), np.asarray(cube.faces), normals, drawn, face, GAUGE, coverage
    )


def even(places: Places) -> np.ndarray:
    return np.full(len(places.place), 0.4)


def step_across_middle(places: Places) -> np.ndarray:
    return np.where(places.place[:, 0] > 1e-4, 0.9, 0.1)


def edge_lengths(mesh: DisplayMesh) -> np.ndarray:
    corners = mesh.vertices[mesh.triangles]
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)


@pytest.mark.parametrize(("field", "shown"), [(even, 12), (step_across_middle, 12), (even, 3)])
def test_triangles_fill_those_of_the_part_and_meet_at_whole_edges(
    field: Callable[[Places], np.ndarray], shown: int
) -> None:
    mesh = cube_mesh(field, shown)
    of_part = np.bincount(mesh.part_triangle, areas(mesh.vertices, mesh.triangles), 12)
    assert of_part == pytest.approx(np.full(12, 0.5 * SIDE**2))
    # The same points as one mesh: every edge has a triangle on either side.
    points, point = np.unique(mesh.vertices.round(12), axis=0, return_inverse=True)
    corner = point.reshape(-1)[mesh.triangles]
    sides = corner[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    assert len(np.unique(sides, axis=0)) == len(sides)
    assert {tuple(side) for side in sides} == {tuple(side[::-1]) for side in sides}
    assert len(points) - len(sides) // 2 + len(corner) == 2  # Euler: no vertex hangs on an edge


def test_the_number_of_each_vertex_leads_to_what_was_asked_there() -> None:
    asked: list[Places] = []

    def field(places: Places) -> np.ndarray:
        asked.append(places)
        return step_across_middle(places)

    mesh, numbers = mesh_and_numbers(field)
    place, normal, face = (np.concatenate(one) for one in zip(*asked, strict=True))
    np.testing.assert_array_equal(place[numbers], mesh.vertices)
    np.testing.assert_array_equal(normal[numbers], mesh.normal)
    np.testing.assert_array_equal(face[numbers], mesh.face)
    assert len(np.unique(numbers)) == len(numbers)


def test_an_even_field_needs_few_triangles() -> None:
    mesh = cube_mesh(even)
    assert edge_lengths(mesh).max() <= display_mesh.MAX_EDGE * DIAMETER
    assert len(mesh.triangles) < 1000


def test_edges_across_a_step_are_no_longer_than_half_a_gauge() -> None:
    mesh = cube_mesh(step_across_middle)
    value = step_across_middle(mesh.places)[mesh.triangles]
    across = np.ptp(value, axis=1) > 0.0
    assert across.any()
    assert (edge_lengths(mesh)[across].min(axis=1) <= display_mesh.MIN_EDGE * DIAMETER).all()
    assert len(mesh.triangles) < 20_000


def test_places_without_a_value_are_told_from_all_others() -> None:
    def only_half(places: Places) -> np.ndarray:
        return np.where(places.place[:, 0] > 0.0, np.nan, 0.0)

    assert len(cube_mesh(only_half).triangles) > 2 * len(cube_mesh(even).triangles)


@pytest.mark.parametrize("one_face", [False, True])
def test_a_vertex_belongs_to_one_side_of_an_edge(one_face: bool) -> None:
    """Also where a face that is smooth elsewhere meets itself at a sharp edge."""
    mesh = cube_mesh(even, one_face=one_face)
    assert (mesh.face[mesh.triangles] == mesh.face[mesh.triangles[:, :1]]).all()
    normal = np.cross(*(np.diff(mesh.vertices[mesh.triangles], axis=1).transpose(1, 0, 2)))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    assert mesh.normal[mesh.triangles] == pytest.approx(np.repeat(normal[:, None], 3, axis=1))


def test_triangles_are_no_thinner_than_those_of_the_part() -> None:
    mesh = cube_mesh(step_across_middle)
    height = 2.0 * areas(mesh.vertices, mesh.triangles) / edge_lengths(mesh).max(axis=1)
    assert (height / edge_lengths(mesh).max(axis=1)).min() >= 0.2  # 0.5 in the cube itself


def test_only_the_target_and_what_borders_on_it_are_divided() -> None:
    mesh = cube_mesh(even, shown=1)
    count = np.bincount(mesh.part_triangle, minlength=12)
    assert count[0] == count.max()
    assert count.min() == 1


def test_the_number_of_triangles_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    def noise(places: Places) -> np.ndarray:
        return np.sin(1e7 * places.place).sum(axis=1)

    monkeypatch.setattr(display_mesh, "MAX_TRIANGLES", 3000)
    assert len(cube_mesh(noise).triangles) <= 3000

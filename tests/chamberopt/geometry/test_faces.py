"""Faces of the gear: which of them are alike."""

import numpy as np
import pytest
import trimesh
from manifold3d import CrossSection, JoinType, Manifold
from shapely import Polygon

from chamberopt.geometry.faces import Faces
from chamberopt.geometry.meshes.part_mesh import read_part
from tests.chamberopt.design.test_shipped_parts import PARTS


def test_the_flanks_of_a_gear_are_alike_and_mirrored() -> None:
    gear = read_part(PARTS / "gear.stl", "mm")
    faces = Faces(gear.vertices, gear.triangles, 30.0)
    kinds = {tuple(np.flatnonzero(faces.alike(k))) for k in range(faces.count)}
    assert sorted(map(len, kinds)) == [1, 1, 1, 1, 20, 20, 40]
    for face in range(faces.count):
        place = faces.place(face)
        assert faces.at(place)[0] == face


@pytest.mark.parametrize(("rounding", "is_facet"), [(0.0, False), (4.0, False), (9.9, True)])
def test_a_facet_is_no_flat_face_with_rounded_edges(rounding: float, is_facet: bool) -> None:
    """The flat sides of a bar of 20 mm, rounded by some mm: of them 0.2 mm are left in the end."""
    core = CrossSection.square((20.0 - 2.0 * rounding,) * 2, center=True)
    outline = core.offset(rounding, JoinType.Round, circular_segments=64)
    made = Manifold.extrude(outline, 30.0).to_mesh()
    faces = Faces(np.asarray(made.vert_properties), np.asarray(made.tri_verts), 1.0)
    side = next(k for k in range(faces.count) if faces.normal(k)[0] > 0.9999)
    assert faces.is_facet(side, 25.0) == is_facet


def faces_of(body: trimesh.Trimesh, border: float = 30.0) -> Faces:
    return Faces(np.asarray(body.vertices), np.asarray(body.faces), border)


@pytest.mark.parametrize(("degrees", "count"), [(29.0, 14), (31.0, 3), (91.0, 1)])
def test_a_surface_is_parted_where_it_turns_by_more_than_an_angle(
    degrees: float, count: int
) -> None:
    """A prism of twelve sides, which turn by 30 degrees from one to the next."""
    prism = trimesh.creation.cylinder(1.0, 2.0, sections=12)
    faces = faces_of(prism, degrees)
    assert faces.count == count
    assert faces.area.sum() == pytest.approx(prism.area)
    by_number = Faces(np.asarray(prism.vertices), np.asarray(prism.faces), faces.of_triangle)
    np.testing.assert_array_equal(by_number.of_triangle, faces.of_triangle)
    for face in range(count):
        normal, own = faces.normal(face), prism.face_normals[faces.of_triangle == face]
        if count == 14:
            assert np.abs(own - normal).max() < 1e-9
        elif np.abs(own[:, 2]).max() < 0.5 or count == 1:  # all round
            assert not normal.any()
    flat = [bool(one) for one in faces.are_flat(1.0)]
    assert sum(flat) == {14: 14, 3: 2, 1: 0}[count]
    vectors = prism.face_normals * prism.area_faces[:, None]
    expected = [vectors[faces.of_triangle == face].sum(axis=0) for face in range(count)]
    np.testing.assert_allclose(faces.area_vectors, expected, atol=1e-12)


def test_the_face_at_a_point_is_the_closest_one() -> None:
    box = trimesh.creation.box((0.02, 0.03, 0.04))
    faces = faces_of(box)
    for axis, half in enumerate((0.01, 0.015, 0.02)):
        for sign in (1.0, -1.0):
            out = sign * np.eye(3)[axis]
            face, away = faces.at((half + 1e-3) * out)
            assert faces.normal(face) == pytest.approx(out)
            assert away == pytest.approx(1e-3)
            place = faces.place(face)
            assert place @ out == pytest.approx(half)
            assert faces.place_mm(face) == pytest.approx(1e3 * place, abs=5e-4)
            marked = box.face_normals @ out > 0.5
            assert faces.free_of(marked).tolist() == [k != face for k in range(6)]


@pytest.mark.parametrize(("side", "are_alike"), [(2.0, True), (2.02, True), (2.1, False)])
def test_faces_are_alike_up_to_two_per_cent_of_their_lengths(side: float, are_alike: bool) -> None:
    """A prism over a trapeze: two of its sides are as long as one another, or not."""
    outline = Polygon([(0, 0), (5, 0), (5, side), (0, 2.0)])
    prism = trimesh.creation.extrude_polygon(outline, 3.0)
    faces = faces_of(prism, 10.0)
    left, right = (
        next(k for k in range(faces.count) if sign * faces.normal(k)[0] > 0.99) for sign in (-1, 1)
    )
    assert bool(faces.alike(left)[right]) is are_alike
    assert faces.alike(left)[left]
    base = next(k for k in range(faces.count) if faces.normal(k)[2] < -0.99)
    assert not faces.alike(left)[base]


def test_facets_are_what_a_coarse_surface_is_made_of() -> None:
    fine, coarse = trimesh.creation.icosphere(3), trimesh.creation.icosphere(1)
    assert faces_of(fine, 1.0).are_facets.all()
    assert not faces_of(coarse, 1.0).are_facets.any()  # of 80 none is tiny
    assert not faces_of(trimesh.creation.box()).are_facets.any()


def test_an_angle_cuts_no_face_that_is_to_stay_whole() -> None:
    """Six sides of a prism of twelve are one face; each other side, of no number, is its own."""
    prism = trimesh.creation.cylinder(1.0, 2.0, sections=12)
    vertices, triangles = np.asarray(prism.vertices), np.asarray(prism.faces)
    sides = np.abs(prism.face_normals[:, 2]) < 0.5
    uncut = np.where(sides & (prism.triangles_center[:, 0] > 0.0), 5, -1)
    faces = Faces(vertices, triangles, 29.0, uncut)
    assert faces.count == 2 + 1 + 6
    assert len(np.unique(faces.of_triangle[uncut == 5])) == 1

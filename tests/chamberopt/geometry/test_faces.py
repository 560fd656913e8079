"""Faces of the gear: which of them are alike."""

import numpy as np
import pytest
from manifold3d import CrossSection, JoinType, Manifold

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

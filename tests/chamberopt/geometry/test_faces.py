"""Faces of the gear: which of them are alike."""

import numpy as np

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

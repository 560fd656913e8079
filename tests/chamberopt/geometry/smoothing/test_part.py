"""A smoothed part as the mesh of a part."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh

from chamberopt.geometry.meshes.part_mesh import read_part
from chamberopt.geometry.smoothing.part import Rule, smooth


def test_another_mesh_of_as_many_triangles_is_not_the_files(tmp_path: Path) -> None:
    trimesh.creation.box((10, 20, 30)).export(tmp_path / "box.stl")
    mesh = read_part(tmp_path / "box.stl", "mm")
    every = np.ones(len(mesh.triangles), dtype=bool)
    made = smooth(mesh, Rule(every, False, np.radians(6.0), 6e-5, np.inf), [])
    assert made.of_part(mesh) is mesh
    turned = replace(made, triangles=made.triangles[::-1], origin=made.origin[::-1])
    assert (turned.of_part(mesh).elements == mesh.elements[::-1]).all()

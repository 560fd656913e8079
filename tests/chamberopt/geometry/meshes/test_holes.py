"""Small holes and cracks are closed, large holes are refused."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from chamberopt.geometry.meshes.part_mesh import read_part
from chamberopt.geometry.meshes.surface_error import SurfaceError
from chamberopt.geometry.triangles import tetrahedron_volumes
from tests.helpers.mesh_files import ball_corners, box_corners, write_ascii_stl, write_stl


def test_a_small_hole_is_closed_and_its_place_noted(tmp_path: Path) -> None:
    corners = ball_corners(5)
    gone = np.linalg.norm(corners.mean(axis=1) - [0, 0, 10], axis=1).argsort()[:2]

    part = read_part(write_stl(tmp_path / "ball.stl", np.delete(corners, gone, axis=0)), "mm")

    mesh = trimesh.Trimesh(part.vertices, part.triangles, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 1e-6, rel=5e-3)
    assert len(part.triangles) == len(
        corners
    )  # as many as were missing, or the hole would not be closed
    assert len(part.notes) == 1
    assert "closed 1 small hole, the widest 0." in part.notes[0]
    assert ", 9.99" in part.notes[0]


def test_a_crack_is_closed_however_long_and_a_large_hole_is_not(tmp_path: Path) -> None:
    """An edge is divided on one side only: there is no gap, but the sides are not neighbours."""
    corners = box_corners()
    a, b = corners[0, 0], corners[0, 1]
    middle = (a + b) / 2 + [1e-6, 0, 0]
    halves = np.array([[a, middle, corners[0, 2]], [middle, b, corners[0, 2]]])
    split = np.r_[corners[1:], halves]

    part = read_part(write_ascii_stl(tmp_path / "box.stl", split, digits=12), "mm")

    assert tetrahedron_volumes(part.vertices, part.triangles).sum() == pytest.approx(8e-6, rel=1e-5)
    assert any("closed 1 crack less than" in note for note in part.notes)
    with pytest.raises(SurfaceError, match="3 open edges in 1 hole") as caught:
        read_part(write_ascii_stl(tmp_path / "open.stl", corners[1:]), "mm")
    assert caught.value.edges.shape == (3, 2, 3)
    assert caught.value.corners.shape == (11, 3, 3)

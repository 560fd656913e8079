"""Healing: what is put right with a note, and that it is put right."""

from pathlib import Path

import numpy as np
import pytest

from chamberopt.geometry.mesh_io.part_mesh import read_part
from chamberopt.geometry.triangles import tetrahedron_volumes
from tests.helpers.mesh_files import box_corners, write_ascii_stl, write_stl


def test_an_inside_out_part_is_turned_with_a_note(tmp_path: Path) -> None:
    part = read_part(write_stl(tmp_path / "box.stl", box_corners()[:, ::-1]), "mm")

    assert tetrahedron_volumes(part.vertices, part.triangles).sum() == pytest.approx(8e-6)
    assert "inside out" in part.notes[0]


def test_one_inside_out_body_of_two_is_turned_and_a_void_is_not(tmp_path: Path) -> None:
    beside = np.r_[box_corners(), box_corners(at=(50, 0, 0))[:, ::-1]]
    hollow = np.r_[box_corners(), box_corners(10)[:, ::-1]]

    two = read_part(write_stl(tmp_path / "two.stl", beside), "mm")
    shell = read_part(write_stl(tmp_path / "hollow.stl", hollow), "mm")

    assert tetrahedron_volumes(two.vertices, two.triangles).sum() == pytest.approx(16e-6)
    assert "body 2 of 2" in two.notes[0]
    assert tetrahedron_volumes(shell.vertices, shell.triangles).sum() == pytest.approx(7e-6)
    assert shell.notes == ()


def test_single_triangles_facing_the_wrong_way_are_turned_and_counted(tmp_path: Path) -> None:
    corners = box_corners()
    corners[[3, 7]] = corners[[3, 7], ::-1]

    part = read_part(write_stl(tmp_path / "box.stl", corners), "mm")

    assert tetrahedron_volumes(part.vertices, part.triangles).sum() == pytest.approx(8e-6)
    assert "turned 2 triangles" in part.notes[0]


def test_triangles_without_area_and_copies_are_dropped_with_a_note(tmp_path: Path) -> None:
    corners = box_corners()
    flat = corners[:1, [0, 1, 1]]

    part = read_part(write_stl(tmp_path / "box.stl", np.r_[corners, flat, corners[:2]]), "mm")

    assert len(part.triangles) == 12
    assert "dropped 1 triangles without area, the first is triangle 13" in part.notes[0]
    assert "dropped 2 triangles that were there twice" in part.notes[1]


def test_vertices_apart_by_rounding_are_merged_with_a_note(tmp_path: Path) -> None:
    noise = np.random.default_rng(2).uniform(-2e-6, 2e-6, (12, 3, 3))

    part = read_part(write_ascii_stl(tmp_path / "box.stl", box_corners() + noise, digits=12), "mm")

    assert len(part.vertices) == 8
    assert "merged" in part.notes[0]

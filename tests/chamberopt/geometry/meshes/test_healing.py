"""Healing: what is put right with a note, and that it is put right."""

from pathlib import Path

import numpy as np
import pytest

from chamberopt.geometry.meshes.part_mesh import read_part
from chamberopt.geometry.meshes.surface_error import OpenSurfaceError
from chamberopt.geometry.triangles import tetrahedron_volumes
from tests.helpers.mesh_files import ball_corners, box_corners, write_ascii_stl, write_stl


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


@pytest.mark.parametrize("hold", ["nothing", "a corner", "an edge"])
def test_stray_facets_are_dropped_with_a_note_and_their_place(tmp_path: Path, hold: str) -> None:
    corners = ball_corners(2)
    a, b, _ = corners[40]
    up = 1.3 * a
    fin = {"nothing": [1.1 * a, 1.1 * b, up], "a corner": [a, 1.1 * b, up], "an edge": [a, b, up]}
    strays = np.array([fin[hold], [fin[hold][1], fin[hold][2], 1.3 * b]])  # two that share a side

    plain = read_part(write_stl(tmp_path / "ball.stl", corners), "mm")
    part = read_part(
        write_stl(tmp_path / "stray.stl", np.insert(corners, 100, strays, axis=0)), "mm"
    )

    assert (part.vertices == plain.vertices).all()
    assert len(part.triangles) == len(corners)
    assert part.elements[99:101].tolist() == [100, 103]  # the others keep their numbers
    assert (
        "dropped 2 stray triangles of no closed surface, the first is triangle 101 at ("
        in (part.notes[0])
    )


def test_a_sheet_that_is_no_small_thing_is_not_dropped_but_located(tmp_path: Path) -> None:
    sheet = np.array([[[0.0, 0.0, 30.0], [20.0, 0.0, 30.0], [0.0, 20.0, 30.0]]])

    with pytest.raises(OpenSurfaceError, match="3 open edges in 1 hole, the first from") as caught:
        read_part(write_stl(tmp_path / "box.stl", np.r_[box_corners(), sheet]), "mm")

    assert caught.value.edges[..., 2] == pytest.approx(0.03)

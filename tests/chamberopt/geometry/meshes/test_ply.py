"""PLY files: colours as groups."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from chamberopt.common.errors import InputError
from chamberopt.geometry.meshes.part_mesh import read_part
from chamberopt.geometry.meshes.ply import ply_content
from tests.helpers.mesh_files import SIDES, TOP_AREA, assert_box, named_area


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
@pytest.mark.parametrize("painted", ["faces", "corners"])
def test_a_painted_ply_names_its_colours(tmp_path: Path, encoding: str, painted: str) -> None:
    box = trimesh.creation.box(SIDES)
    top = box.face_normals[:, 2] > 0.5
    if painted == "faces":
        box.visual.face_colors = np.where(
            top[:, None], [255, 0, 0, 255], [200, 200, 200, 255]
        ).astype(np.uint8)
    else:
        upper = box.vertices[:, 2] > 0
        box.visual.vertex_colors = np.where(
            upper[:, None], [255, 0, 0, 255], [200, 200, 200, 255]
        ).astype(np.uint8)
    box.export(tmp_path / "box.ply", encoding=encoding)

    part = read_part(tmp_path / "box.ply", "mm")

    assert_box(part)
    assert named_area(part, "#ff0000") == pytest.approx(TOP_AREA)
    assert part.groups["#c8c8c8"].sum() == (10 if painted == "faces" else 2)


@pytest.mark.parametrize("unit", ["mm", "in"])
def test_what_is_written_is_read_to_the_last_bit(tmp_path: Path, unit: str) -> None:
    ball = trimesh.creation.icosphere(1)
    vertices = np.asarray(ball.vertices) * np.pi
    path = tmp_path / "ball.ply"
    path.write_bytes(ply_content(vertices, np.asarray(ball.faces), unit))
    read = trimesh.load(path, process=False)
    np.testing.assert_array_equal(read.vertices, vertices)
    np.testing.assert_array_equal(read.faces, ball.faces)
    part = read_part(path)
    assert part.unit == unit
    np.testing.assert_allclose(
        part.vertices[part.triangles], vertices[ball.faces] * {"mm": 1e-3, "in": 0.0254}[unit]
    )


def test_a_truncated_text_file_is_refused_and_blank_lines_count_nothing(tmp_path: Path) -> None:
    path = tmp_path / "box.ply"
    trimesh.creation.box(SIDES).export(path, encoding="ascii")
    lines = path.read_text().splitlines()
    path.write_text("\n".join(lines) + "\n\n")
    assert_box(read_part(path, "mm"))
    for lost in (1, 5):
        path.write_text("\n".join(lines[:-lost]) + "\n" * lost)
        with pytest.raises(InputError, match=f"counts 20 lines and {20 - lost} are there"):
            read_part(path, "mm")


def test_as_many_colours_as_a_photograph_has_are_no_groups(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(1)
    for colours in (64, 65):
        shade = np.arange(len(ball.faces)) % colours
        ball.visual.face_colors = np.c_[shade, 0 * shade, 0 * shade, 0 * shade + 255].astype("u1")
        ball.export(tmp_path / "ball.ply")
        assert len(read_part(tmp_path / "ball.ply", "mm").groups) == (64 if colours == 64 else 0)

"""PLY files: colours as groups."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from chamberopt.geometry.meshes.part_mesh import read_part
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

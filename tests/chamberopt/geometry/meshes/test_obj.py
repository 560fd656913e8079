"""OBJ files: quadrilaterals, groups and materials."""

from pathlib import Path

import pytest

from chamberopt.geometry.meshes.part_mesh import read_part
from tests.helpers.mesh_files import (
    OBJ_HEAD,
    QUADS,
    TOP,
    TOP_AREA,
    assert_box,
    named_area,
    obj_face,
    written,
)


def test_an_objs_quadrilaterals_groups_and_materials(tmp_path: Path) -> None:
    rest = "".join(obj_face(quad, shift=-8) for quad in QUADS[1:])  # counted from the last vertex
    text = (
        OBJ_HEAD + "g crown upper\nusemtl red steel\n" + obj_face(TOP) + "g\nusemtl grey\n" + rest
    )

    part = read_part(written(tmp_path / "box.obj", text), "mm")

    assert_box(part)
    for name in ("crown", "upper", "red steel"):
        assert named_area(part, name) == pytest.approx(TOP_AREA)
    assert part.groups["grey"].sum() == 10

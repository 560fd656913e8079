"""OBJ files: quadrilaterals, groups and materials."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

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


@pytest.mark.parametrize("stated", [80, 50, 0])
def test_corners_have_the_normals_that_the_file_states_or_those_of_their_facets(
    tmp_path: Path, stated: int
) -> None:
    """A ball, of which the first triangles have radial normals, counted from either end."""
    ball = trimesh.creation.icosphere(1)
    count = len(ball.vertices)
    text = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in (10.0 * ball.vertices).tolist())
    text += "".join(f"vn {x!r} {y!r} {z!r}\n" for x, y, z in ball.vertices.tolist() if stated)
    for k, corners in enumerate(ball.faces.tolist()):
        facing = [one + 1 if k % 2 else one - count for one in corners]
        own = [f"//{n}" if k < stated else "" for n in facing]
        words = [f"{one + 1}{n}" for one, n in zip(corners, own, strict=True)]
        text += f"f {' '.join(words)}\n"
    part = read_part(written(tmp_path / "ball.obj", text), "mm")
    if not stated:
        assert part.normals is None
        return
    wanted = np.where(
        np.arange(80)[:, None, None] < stated, ball.triangles, ball.face_normals[:, None]
    )
    np.testing.assert_allclose(part.normals, wanted, atol=1e-12)

"""Gmsh files of both versions: physical groups."""

from pathlib import Path

import numpy as np
import pytest

from chamberopt.geometry.meshes.part_mesh import read_part
from tests.helpers.mesh_files import (
    CORNERS,
    GMSH_4,
    QUADS,
    TOP,
    TOP_AREA,
    assert_box,
    gmsh_2,
    named_area,
    written,
)


@pytest.mark.parametrize("binary", [True, False])
def test_gmsh_2s_physical_groups_are_names(tmp_path: Path, binary: bool) -> None:
    elements = [
        (1, (0, 1), np.array([0, 1])),
        *((3, (7 if q is TOP else 8, 1), np.array(q)) for q in QUADS),
    ]
    path = tmp_path / "box.msh"
    path.write_bytes(gmsh_2(CORNERS, elements, binary))

    part = read_part(path, "mm")

    assert_box(part)
    assert named_area(part, "crown") == pytest.approx(TOP_AREA)
    assert part.groups["physical 8"].sum() == 10


def test_gmsh_4s_physical_groups_are_names(tmp_path: Path) -> None:
    points = "".join(f"{x} {y} {z}\n" for x, y, z in CORNERS)
    quads = "".join(
        f"{n + 2} {' '.join(str(k + 1) for k in quad)}\n" for n, quad in enumerate(QUADS[1:])
    )

    part = read_part(written(tmp_path / "box.msh", GMSH_4.format(points=points, quads=quads)), "mm")

    assert_box(part)
    assert named_area(part, "crown") == pytest.approx(TOP_AREA)

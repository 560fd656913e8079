"""STL files: names of solids, and bytes that exporters append."""

from pathlib import Path

import pytest
import trimesh

from chamberopt.geometry.meshes.part_mesh import read_part
from tests.helpers.mesh_files import (
    CORNERS,
    QUADS,
    TOP_AREA,
    assert_box,
    box_corners,
    named_area,
    write_ascii_stl,
    written,
)


def test_a_text_stls_solids_are_named(tmp_path: Path) -> None:
    text = ""
    for name, quads in (("crown", QUADS[:1]), ("rest", QUADS[1:])):
        text += f"solid {name}\n"
        for a, b, c, d in quads:
            for triangle in ((a, b, c), (a, c, d)):
                rows = "".join(f"   vertex {x} {y} {z}\n" for x, y, z in CORNERS[list(triangle)])
                text += f" facet normal 0 0 0\n  outer loop\n{rows}  endloop\n endfacet\n"
        text += f"endsolid {name}\n"

    part = read_part(written(tmp_path / "box.stl", text), "mm")

    assert_box(part)
    assert named_area(part, "crown") == pytest.approx(TOP_AREA)


def test_an_ascii_stl_is_read_too(tmp_path: Path) -> None:
    part = read_part(write_ascii_stl(tmp_path / "box.stl", box_corners()), "mm")

    assert part.size == pytest.approx([0.02] * 3)
    assert part.notes == ()


def test_what_an_exporter_put_behind_a_binary_stl_is_ignored(tmp_path: Path) -> None:
    plain, longer = tmp_path / "plain.stl", tmp_path / "longer.stl"
    trimesh.creation.box((20, 20, 20)).export(plain)
    longer.write_bytes(plain.read_bytes() + bytes(40))
    assert (read_part(longer, "mm").vertices == read_part(plain, "mm").vertices).all()

"""Abaqus input files: sets, surfaces, parts and instances."""

from pathlib import Path

import pytest

from chamberopt.geometry.meshes.part_mesh import read_part
from tests.helpers.mesh_files import (
    CORNERS,
    QUADS,
    TOP_AREA,
    assert_box,
    named_area,
    nodes_text,
    volume,
    written,
)


def test_abaqus_shells_with_sets_of_elements_and_nodes(tmp_path: Path) -> None:
    text = "*HEADING\na box\n** a comment\n*NODE, NSET=all\n" + nodes_text(CORNERS)
    text += "*ELEMENT, TYPE=S4R, ELSET=crown\n1, 5, 6, 7, 8\n*ELEMENT, TYPE=S4R, ELSET=sides\n"
    text += "".join(
        f"{n + 2}, {', '.join(str(k + 1) for k in quad)}\n" for n, quad in enumerate(QUADS[1:])
    )
    text += (
        "*ELSET, ELSET=both, GENERATE\n1, 2, 1\n*ELSET, ELSET=again\ncrown,\n*NSET, NSET=upper\n"
        "5, 6, 7, 8\n"
    )
    text += "*ELEMENT, TYPE=T3D2, ELSET=wire\n90, 1, 2\n"

    part = read_part(written(tmp_path / "box.inp", text), "mm")

    assert_box(part)
    for name in ("crown", "again", "upper"):
        assert named_area(part, name) == pytest.approx(TOP_AREA)
    assert named_area(part, "both") == pytest.approx(2 * TOP_AREA)
    assert any("left out 1 T3D2" in note for note in part.notes)


def test_abaqus_instances_are_put_where_they_stand_and_their_surfaces_named(tmp_path: Path) -> None:
    """Two instances of one solid; the second is moved 50 mm along x, then turned by 90° about z."""
    text = (
        "*Part, name=Block\n*Node\n" + nodes_text(CORNERS) + "*Element, type=C3D8R, elset=body\n1, "
    )
    text += (
        ", ".join(str(k + 1) for k in range(8))
        + "\n*Surface, type=ELEMENT, name=crown\nbody, S2\n*End Part\n"
    )
    text += (
        "*Assembly, name=A\n*Instance, name=one, part=Block\n*End Instance\n"
        "*Instance, name=two, part=Block\n"
    )
    text += "50., 0., 0.\n0., 0., 0., 0., 0., 1., 90.\n*End Instance\n"
    text += (
        "*Elset, elset=_s, internal, instance=two\n1,\n*Surface, type=ELEMENT, name=second\n"
        "_s, S1\n*End Assembly\n"
    )

    part = read_part(written(tmp_path / "two.inp", text), "mm")

    assert volume(part) == pytest.approx(48e-6)
    assert part.vertices.min(axis=0) == pytest.approx([-0.03, 0, 0])
    assert part.vertices.max(axis=0) == pytest.approx([0.02, 0.07, 0.04])
    assert named_area(part, "crown") == pytest.approx(2 * TOP_AREA)
    assert part.vertices[part.triangles[part.groups["crown"]]][..., 2] == pytest.approx(0.04)
    second = part.vertices[
        part.triangles[part.groups["second"]]
    ]  # the underside of the one that was moved
    assert second[..., 2] == pytest.approx(0.0)
    assert second[..., 0].max() <= 1e-12
    assert named_area(part, "second") == pytest.approx(TOP_AREA)

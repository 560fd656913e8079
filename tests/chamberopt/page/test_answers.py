"""What the page is told of a part, in the bytes that it takes apart."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from manifold3d import CrossSection, Manifold

from chamberopt.chamber.layout.target import find_surface, surfaces
from chamberopt.chamber.part import preview_part
from chamberopt.common.errors import InputError
from chamberopt.design.design import Design
from chamberopt.geometry.faces import Faces
from chamberopt.geometry.meshes.part_mesh import read_part
from chamberopt.geometry.triangles import unit_normals
from chamberopt.page.answers import (
    check_answers,
    face_names,
    packed,
    part_answer,
    picked_answer,
    shape_answer,
    step_texts,
    surface_answer,
    surfaces_answer,
)
from chamberopt.page.picking import Picked
from tests.chamberopt.chamber.layout.test_arbor import part_of
from tests.chamberopt.chamber.test_target import design_of

FIR_TREE = Path(__file__).resolve().parents[3] / "designs/parts/fir_tree.step"


def test_each_triangle_has_the_number_of_its_name(tmp_path: Path) -> None:
    design = design_of(tmp_path, {})
    answer = part_answer(preview_part(design).mesh)
    begin = 4 + int.from_bytes(answer[:4], "little")
    head = json.loads(answer[4:begin])
    kind, count = head["arrays"]["surface"]
    assert (kind, count, list(head["arrays"])[-1]) == ("<u4", 12, "surface")
    numbers = np.frombuffer(answer, "<u4", count, len(answer) - 4 * count)
    marks = preview_part(design).mesh.groups
    for name in ("Top", "bottom", "left", "right", "ends"):
        assert (np.array(head["groups"])[numbers[marks[name]]] == name).all()


def test_faces_have_the_names_of_surfaces_that_hold_them(tmp_path: Path) -> None:
    """Each side of the box is in one surface, or in several, of which the first counts."""
    mesh = preview_part(design_of(tmp_path, {})).mesh
    faces = Faces(mesh.vertices, mesh.triangles, 30.0)
    names = face_names(mesh, faces.of_triangle)
    assert sorted(names) == [*range(6)]
    for k, name in names.items():
        own = faces.of_triangle == k
        assert name == next(one.name for one in surfaces(mesh) if one.triangles[own].all())


def test_one_of_several_faces_alike_has_its_number(tmp_path: Path) -> None:
    """Of a box of 10 x 20 x 30 mm without names, each face and its like are a surface."""
    trimesh.creation.box((10, 20, 30)).export(tmp_path / "plain.stl")
    mesh = read_part(tmp_path / "plain.stl", "mm")
    faces = Faces(mesh.vertices, mesh.triangles, 30.0)
    singles = [f"face {k}.{one}" for k in (1, 2, 3) for one in (1, 2)]
    names = face_names(mesh, faces.of_triangle)
    assert sorted(names.values()) == singles
    known = surfaces(mesh)
    whole = [Picked("", (0.0, 0.0, 0.0), one.triangles) for one in known]
    each = [Picked("", (0.0, 0.0, 0.0), faces.of_triangle == k) for k in names]
    answer = picked_answer(mesh, [*whole, *each])
    head = json.loads(answer[4 : 4 + int.from_bytes(answer[:4], "little")])
    alike = [f"{one.name}, all alike" for one in known]
    assert [row["name"] for row in head["rows"]] == [*alike, *names.values()]
    for name in singles:  # that --target takes
        assert find_surface(mesh, known, name).triangles.sum() == 2


def test_a_click_on_each_face_means_a_surface_that_can_be_peened(tmp_path: Path) -> None:
    """Also the fillet of a step, and each face of a box."""
    trimesh.creation.box((10, 20, 30)).export(tmp_path / "plain.stl")
    for mesh in (read_part(tmp_path / "plain.stl", "mm"), read_part(FIR_TREE, "stated")):
        answer = surfaces_answer(mesh)
        head = json.loads(answer[4 : 4 + int.from_bytes(answer[:4], "little")])
        assert [row[0] for row in head["rows"]] == [one.name for one in surfaces(mesh)]
        assert head["arrays"]["face"][1] == len(mesh.triangles)
        for name in set(head["names"].values()):
            found = find_surface(mesh, surfaces(mesh), name)
            assert found.triangles.any()
            assert head["sizes"][name] == found.text


def test_a_surface_holds_whole_faces_of_a_cad_file() -> None:
    """The back of a vane goes on round its edge, a strip of 1 mm, over which it turns sharply."""
    outline = [[0, 0], [20, -3], [40, -0.5], [40, 0.5], [20, 3]]
    mesh, body = part_of(Manifold.extrude(CrossSection([outline]), 30.0))
    looks = body.face_normals
    back, strip = looks[:, 1] > 0.5, looks[:, 0] > 0.9
    cad_face = np.select([looks[:, 2] > 0.5, looks[:, 2] < -0.5, back | strip], [0, 1, 2], 3)
    assert 2 not in face_names(mesh, cad_face)  # a crease parts the strip from the back
    mesh = replace(mesh, numbering=replace(mesh.numbering, cad_face=cad_face))
    names = face_names(mesh, mesh.faces(None).of_triangle)
    assert len(names) == mesh.faces(None).count == 4
    for one in surfaces(mesh):
        for face in range(4):
            assert len(np.unique(one.triangles[cad_face == face])) == 1
    answer = surfaces_answer(mesh)
    head = json.loads(answer[4 : 4 + int.from_bytes(answer[:4], "little")])
    assert len(head["names"]) == 4


def test_the_triangles_of_a_surface_are_those_of_its_name(tmp_path: Path) -> None:
    """A name of the file, one face of the box between sharp edges, and no name."""
    mesh = preview_part(design_of(tmp_path, {})).mesh
    for name, count in (("Top", 2), ("face 1.1", 2)):
        answer = surface_answer(mesh, name)
        found = np.frombuffer(answer, "<u4", count, len(answer) - 4 * count)
        normals = unit_normals(mesh.vertices[mesh.triangles[found]])
        np.testing.assert_allclose(normals, normals[[0, 0]], atol=1e-12)
    with pytest.raises(InputError, match="face 99"):
        surface_answer(mesh, "face 99")


def test_each_step_has_its_pose_and_its_share_of_the_time(tmp_path: Path) -> None:
    steps = [{"name": "up"}, {"name": "down", "time_share": 3, "part": {"rotate_deg": [180, 0, 0]}}]
    design = Design.model_validate(design_of(tmp_path, {}).model_dump() | {"steps": steps})
    whole = design.process.treatment_time
    assert step_texts(design) == [
        f"up: {0.25 * whole:g} s, 25 % of the time",
        f"down: {0.75 * whole:g} s, 75 % of the time",
    ]
    for step, turned in enumerate((1.0, -1.0)):
        answer = shape_answer(design, step)
        head = json.loads(answer[4 : 4 + int.from_bytes(answer[:4], "little")])
        np.testing.assert_allclose(
            np.diag(np.reshape(head["rotation"], (3, 3))), [1, turned, turned]
        )


def test_what_is_outside_the_chamber_stands_before_other_warnings(tmp_path: Path) -> None:
    design = design_of(tmp_path, {})
    for height, count in ((design.chamber.height_mm, 0), (25.0, 1)):
        low = design.changed({"chamber.height_mm": height})
        answer = next(iter(check_answers(low)))
        head = json.loads(answer[4 : 4 + int.from_bytes(answer[:4], "little")])
        assert len(head["unpeened"]) == count, (head["unpeened"], head["warnings"])
        assert all(one not in head["warnings"] for one in head["unpeened"])


def test_the_openings_of_a_chamber_are_told(tmp_path: Path) -> None:
    """The box of 10 x 20 x 30 mm hangs 15 mm over the sonotrode, so that its top is at 45 mm."""
    design = design_of(tmp_path, {})
    for height, told in ((60.0, []), (40.0, [["the ceiling", "10 × 20 mm"]])):
        answer = next(iter(check_answers(design.changed({"chamber.height_mm": height}))))
        head = json.loads(answer[4 : 4 + int.from_bytes(answer[:4], "little")])
        assert head["openings"] == told


@pytest.mark.parametrize("text", ["", "a", "ab", "abc"])
def test_packed_arrays_begin_at_words_and_are_read_as_the_page_does(text: str) -> None:
    given = {
        "marks": np.array([1, 2, 3], dtype=np.uint8),
        "places": np.array([[0.5, -1.5], [2.0, 1e-3]]),
        "numbers": np.array([7, 8, 2**31], dtype=np.int64),
        "none": np.zeros((0, 3)),
    }
    content = packed({"text": text}, **given)
    length = int.from_bytes(content[:4], "little")
    assert length % 4 == 0
    head = json.loads(content[4 : 4 + length])
    assert head["text"] == text
    at = 4 + length
    for name, values in given.items():
        kind, count = head["arrays"][name]
        found = np.frombuffer(content, np.dtype(kind), count, at)
        assert found == pytest.approx(values.ravel())
        at += -(-found.nbytes // 4) * 4
    assert at == len(content)


@pytest.mark.parametrize(
    ("changes", "awaited"),
    [
        ({}, []),
        ({"holder": {"kind": "rod"}}, ["holder"]),
        (
            {"mask": {"thickness_mm": 1.0, "at": {"direction": (0, 0, 1), "angle_deg": (0, 30)}}},
            ["mask"],
        ),
    ],
)
def test_holder_and_mask_are_drawn_once_the_chamber_is_built(
    tmp_path: Path, changes: dict[str, object], awaited: list[str]
) -> None:
    answer = shape_answer(design_of(tmp_path, {}).changed(changes))
    head = json.loads(answer[4 : 4 + int.from_bytes(answer[:4], "little")])
    assert head["awaited"] == awaited

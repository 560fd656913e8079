"""The target by names of the part's file, alone and with other conditions; its elements."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from pydantic import ValidationError

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.checks.facts import describe
from chamberopt.chamber.part import named_surface
from chamberopt.common.errors import InputError
from chamberopt.design.load import Design, load_design, save_design
from chamberopt.geometry.meshes.part_mesh import read_part_cached
from chamberopt.geometry.triangles import area_vectors

GEAR = Path(__file__).resolve().parents[3] / "designs" / "gear.toml"


def design_of(folder: Path, target: dict[str, Any], unit: str = "guess") -> Design:
    """The shipped gear's chamber round a box of 10 x 20 x 30 mm whose six faces have names."""
    box = trimesh.creation.box((10, 20, 30))
    names = {(0, 0, 1): "Top", (0, 0, -1): "bottom", (1, 0, 0): "right", (-1, 0, 0): "left"}
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in box.vertices)
    for normal, face in zip(
        box.face_normals.round().astype(int).tolist(), box.faces + 1, strict=True
    ):
        text += f"g {names.get(tuple(normal), 'ends')}\nf {' '.join(map(str, face))}\n"
    (folder / "box.obj").write_text(text)
    data = load_design(GEAR).model_dump()
    data["chamber"]["height_mm"] = 60.0
    data["part"] = {"mesh": str(folder / "box.obj"), "unit": unit, "target": target}
    return Design.model_validate(data)


def target_area_mm2(chamber: Chamber) -> float:
    return float(chamber.part.area[chamber.part.target].sum() * 1e6)


@pytest.mark.parametrize(
    ("target", "area"),
    [
        ({}, 2200.0),
        ({"surface": "all"}, 2200.0),
        ({"surface": "bottom"}, 200.0),
        ({"surface": "top"}, 200.0),  # the file's "Top"
        ({"surface": ["left", "right"]}, 1200.0),
        ({"surface": ["left", "bottom"], "direction": (0, 0, -1), "angle_deg": (0, 10)}, 200.0),
        ({"surface": "ends", "box_mm": ((-99, 0, -99), (99, 99, 99))}, 300.0),
        ({"surface": "left", "box_mm": ((-99, -3, 3.3), (99, 99, 99)), "cut": True}, 13 * 11.7),
        ({"box_mm": ((-99, -99, 3.3), (99, 99, 99)), "cut": True, "element_mm": 2}, 902.0),
    ],
)
def test_names_choose_and_the_other_conditions_narrow(
    tmp_path: Path, target: dict[str, Any], area: float
) -> None:
    assert target_area_mm2(build_chamber(design_of(tmp_path, target))) == pytest.approx(area)


@pytest.mark.parametrize(
    ("surface", "said"),
    [
        (
            "botom",
            r"part\.target\.surface: 'botom' is not a name in the part's file; did you mean "
            r"'bottom'\?",
        ),
        (["left", "xyz"], r"'xyz' is not a name .*allowed: all, .*bottom"),
    ],
)
def test_a_name_that_the_file_does_not_have_is_refused_with_those_it_has(
    tmp_path: Path, surface: Any, said: str
) -> None:
    with pytest.raises(InputError, match=said):
        build_chamber(design_of(tmp_path, {"surface": surface}))


def test_each_triangle_has_the_name_of_its_surface(tmp_path: Path) -> None:
    part = build_chamber(design_of(tmp_path, {})).part
    up = area_vectors(part.vertices, part.triangles)[:, 2] > 0.99 * part.area
    assert {part.surface_name(k) for k in np.flatnonzero(up)} == {"Top"}
    assert {part.surface_name(k) for k in range(12)} == {"Top", "bottom", "left", "right", "ends"}


def test_of_several_names_the_closest_is_taken(tmp_path: Path) -> None:
    """As a STEP file has them: a body's name and colour, a name and an alias of a surface in it."""
    mesh = read_part_cached(design_of(tmp_path, {}).part.mesh_path, "mm")
    groups = {"BODY": range(12), "#9999a6": range(3, 12), "ROOT_2": [2, 3], "ROOT": [2, 3]}
    marks = {name: np.isin(np.arange(12), own) for name, own in groups.items()}
    found = named_surface(replace(mesh, groups=marks))
    assert found.tolist() == [-1, -1, 3, 3, *[1] * 8]
    assert named_surface(replace(mesh, groups={"BODY": marks["BODY"]})) is None


def test_a_file_without_names_says_so() -> None:
    data = load_design(GEAR).model_dump()
    data["part"]["target"]["surface"] = "flank"

    with pytest.raises(
        InputError, match="'flank' is not a name in the part's file; its file names none: 'all'"
    ):
        build_chamber(Design.model_validate(data))


def test_check_says_unit_and_names_and_a_design_keeps_them(tmp_path: Path) -> None:
    design = design_of(tmp_path, {"surface": ["left", "right"], "element_mm": 2.0})

    facts = describe(design, build_chamber(design))
    save_design(design, tmp_path / "kept.toml")

    assert facts["part"]["unit"] == "mm"
    assert set(facts["part"]["names"]) == {"Top", "bottom", "right", "left", "ends"}
    assert any("unit guessed as 'mm'" in note for note in facts["notes"])
    assert load_design(tmp_path / "kept.toml") == design


def test_elements_are_made_in_the_target_alone_and_cover_it_exactly(tmp_path: Path) -> None:
    plain = build_chamber(design_of(tmp_path, {"surface": "bottom"}))
    meshed = build_chamber(design_of(tmp_path, {"surface": "bottom", "element_mm": 1.0}))

    assert target_area_mm2(meshed) == pytest.approx(target_area_mm2(plain), rel=1e-9)
    assert meshed.volume == pytest.approx(plain.volume, rel=1e-9)
    assert 300 < meshed.part.target.sum() < 900  # 200 mm² in triangles of 0.43 mm² when equilateral
    assert plain.part.target.sum() == 2
    normals = area_vectors(meshed.part.vertices, meshed.part.triangles)[meshed.part.target]
    assert (normals[:, 2] < 0).all()
    assert np.abs(normals[:, :2]).max() < 1e-5 * np.abs(normals[:, 2]).min()
    assert any(
        "target.element_mm = 1: the target's 2 triangles became" in note for note in meshed.notes
    )


def test_too_small_elements_are_refused_with_a_size_that_fits(tmp_path: Path) -> None:
    with pytest.raises(
        InputError,
        match=r"part\.target\.element_mm: given 0\.01.*million triangles.*at least 0\.13",
    ):
        build_chamber(design_of(tmp_path, {"element_mm": 0.01}))


def test_a_cut_takes_a_box(tmp_path: Path) -> None:
    with pytest.raises(ValidationError, match=r"given without box_mm"):
        design_of(tmp_path, {"surface": "top", "cut": True})


def test_a_cut_box_that_holds_nothing_is_told_as_any_other(tmp_path: Path) -> None:
    nowhere = {"box_mm": ((50, 50, 50), (60, 60, 60)), "cut": True}
    with pytest.raises(InputError, match=r"part\.target: chooses none of the 12 triangles"):
        build_chamber(design_of(tmp_path, nowhere))


def with_reachable(reachable: bool, **values: float) -> Design:
    design = load_design(GEAR).changed(
        {name.replace("__", "."): value for name, value in values.items()}
    )
    target = design.part.target.model_copy(update={"reachable": reachable})
    return design.model_copy(update={"part": design.part.model_copy(update={"target": target})})


@pytest.mark.long
def test_what_the_shot_cannot_touch_can_be_left_out_of_the_target() -> None:
    """Tooth roots less round than the balls are left out, and more of them for larger balls.

    The other conditions on the target still hold.
    """
    whole = build_chamber(with_reachable(False))
    small, large = (build_chamber(with_reachable(True, shot__diameter_mm=d)) for d in (2.2, 3.0))
    assert (small.part.target <= whole.part.target).all()
    assert (large.part.target <= small.part.target).all()
    areas = [target_area_mm2(one) for one in (large, small, whole)]
    assert areas[0] < 0.8 * areas[1] < 0.8 * areas[2]
    roots = (
        np.linalg.norm(whole.part.vertices[whole.part.triangles].mean(axis=1)[:, :2], axis=1)
        < 17.6e-3
    )
    assert not small.part.target[roots].all()
    (note,) = (note for note in small.notes if note.startswith("target.reachable: "))
    left = target_area_mm2(whole) - target_area_mm2(small)
    assert float(note.split("(")[1].split(" mm²")[0]) == pytest.approx(left, rel=0.01)
    assert "a study keeps this target for all its candidates" in note
    facts = describe(with_reachable(True, shot__diameter_mm=2.2), small)
    assert facts["reach"]["target_reachable_share"] > 0.93
    assert not any("set part.target.reachable" in one.text for one in facts["warnings"])


@pytest.mark.long
def test_a_target_can_be_given_to_a_chamber() -> None:
    """As a study does, which keeps that of its start."""
    design = with_reachable(True, shot__diameter_mm=3.0)
    given = build_chamber(with_reachable(True)).part.target
    chamber = build_chamber(design, given)
    np.testing.assert_array_equal(chamber.part.target, given)
    assert any(
        "the target is what the shot reaches in the study's start" in note for note in chamber.notes
    )


def test_a_target_that_no_ball_touches_is_refused(tmp_path: Path) -> None:
    """The box's upper side, 1 mm under the ceiling."""
    data = design_of(tmp_path, {"surface": "top", "reachable": True}).model_dump()
    data["chamber"]["height_mm"] = 46.0
    with pytest.raises(
        InputError,
        match=r"part\.target\.reachable: a ball of 1\.5 mm touches nothing of the target",
    ):
        build_chamber(Design.model_validate(data))


def test_a_face_is_named_by_a_place_on_it(tmp_path: Path) -> None:
    top = {"faces": [{"at_mm": [0, 0, 15]}]}
    assert target_area_mm2(build_chamber(design_of(tmp_path, top))) == pytest.approx(200.0)
    alike = {"faces": [{"at_mm": [0, 0, 15], "alike": True}, {"at_mm": [5, 0, 0]}]}
    assert target_area_mm2(build_chamber(design_of(tmp_path, alike))) == pytest.approx(1000.0)
    whole = {"faces": [{"at_mm": [0, 0, 15], "crease_deg": 91}]}
    assert target_area_mm2(build_chamber(design_of(tmp_path, whole))) == pytest.approx(2200.0)


def test_a_place_beside_the_part_is_refused(tmp_path: Path) -> None:
    target = {"faces": [{"at_mm": [0, 0, 17]}]}
    with pytest.raises(InputError, match=r"part\.target\.faces\.0\.at_mm: .* 2 mm beside the part"):
        build_chamber(design_of(tmp_path, target))

"""Saving a design from the page: one line differs, and nothing is written that would not load."""

import difflib
import tomllib
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from chamberopt.common.errors import InputError
from chamberopt.page.edited_file import EditedFile, design_fields
from chamberopt.page.structure import restructured, with_added_step, without_step
from tests.helpers.mesh_files import write_stl
from tests.hunt.base import write_base


@pytest.fixture
def file(tmp_path: Path) -> EditedFile:
    write_base(tmp_path)
    design = tmp_path / "design.toml"
    design.write_text(design.read_text().replace("height_mm = 30", "height_mm = 30   # to try"))
    return EditedFile(design, trusted=False)


def differing(before: str, after: str) -> list[str]:
    lines = difflib.unified_diff(before.splitlines(), after.splitlines(), lineterm="", n=0)
    return [line for line in lines if line[0] in "+-" and line[:3] not in ("+++", "---")]


def test_one_number_is_one_line(file: EditedFile) -> None:
    before = file.path.read_text()
    changed = file.with_changes({"chamber.height_mm": 31.5})
    file.save({"chamber.height_mm": 31.5})
    after = ["-height_mm = 30   # to try", "+height_mm = 31.5   # to try"]
    assert differing(before, file.path.read_text()) == after
    assert changed.value("chamber.height_mm") == 31.5
    assert EditedFile(file.path, False).design == changed


def test_the_reason_of_a_changed_number_says_of_what_it_was(file: EditedFile) -> None:
    """In a proposed design the comments are reasons; in others they stay as they are."""
    text = file.path.read_text().replace("# to try", "# room for two balls")
    file.path.write_text(f"# A first chamber, proposed by `chamberopt new`: rules.\n{text}")
    for height, comment in (
        (40, "changed by you; proposed was 30: room for two balls"),
        (42, "changed by you; proposed was 30: room for two balls"),
        (30, "room for two balls"),
    ):
        EditedFile(file.path, False).save({"chamber.height_mm": height})
        assert f"height_mm = {height}   # {comment}\n" in file.path.read_text()
        rows = {one["name"]: one for one in design_fields(EditedFile(file.path, False))}
        assert rows["chamber.height_mm"]["reason"] == [comment]


def test_the_proposed_intensity_is_told_while_the_numbers_are_those(file: EditedFile) -> None:
    text = file.path.read_text().replace("# to try", "# room for two balls")
    head = "# A first chamber, proposed by `chamberopt new`: rules.\n"
    line = "\n# Almen intensity: expected 0.4 mmA; 0.3-0.41A are usual; to aim at it: ask\n"
    file.path.write_text(head + text + line)
    proposed = EditedFile(file.path, False)
    assert proposed.proposed_intensity == ["expected 0.4 mmA", "0.3-0.41A are usual"]
    proposed.save({"chamber.height_mm": 40})
    assert EditedFile(file.path, False).proposed_intensity == []


def test_what_is_to_be_settled_says_which_values_it_was_told_of(file: EditedFile) -> None:
    """What was changed is said once, until all is settled; the accuracy decides none of it."""
    text = 'to_settle = [\n  "NOT MASKED: ask",\n  "LONG",\n]\n' + file.path.read_text()
    file.path.write_text(text)
    EditedFile(file.path, False).save({"chamber.height_mm": 31})
    assert EditedFile(file.path, False).design.to_settle == ("NOT MASKED: ask", "LONG")
    file.path.write_text(f"# A first chamber, proposed by `chamberopt new`: rules.\n{text}")
    EditedFile(file.path, False).save({"process.accuracy.max_replicas": 9})
    assert EditedFile(file.path, False).design.to_settle == ("NOT MASKED: ask", "LONG")
    faces = [{"at_mm": [0, 0, -8]}]
    for changes, words in (
        ({"chamber.height_mm": 31, "to_settle": ["LONG"]}, "height of the chamber"),
        ({"part.target.faces": faces}, "height of the chamber, target of the part"),
        ({"chamber.height_mm": 32}, "height of the chamber, target of the part"),
    ):
        EditedFile(file.path, False).save(changes)
        said, other = EditedFile(file.path, False).design.to_settle
        assert said.startswith(f"CHANGED SINCE IT WAS PROPOSED: {words}; settle what")
        assert other == "LONG"
    EditedFile(file.path, False).save({"shot.mass_g": 2, "to_settle": [said]})
    design = EditedFile(file.path, False).design
    assert design.to_settle == ()
    today = f"{date.today():%Y-%m-%d}"
    kept = [f"{one} (marked as settled on {today})" for one in ("NOT MASKED: ask", "LONG")]
    assert list(design.settled) == kept


@pytest.mark.parametrize(
    ("changes", "written"),
    [
        ({"part.rotate_deg.2": 12.5}, ["-rotate_deg = [0, 0, 10]", "+rotate_deg = [0, 0, 12.5]"]),
        ({"sonotrode.phase_deg": 3}, None),
        ({"chamber.shape": "shape.py"}, None),
        ({"part.mesh": "/etc/hosts"}, None),
        ({"calibration": "/etc/hosts"}, None),
        ({"part.rotate_deg.-1": 3}, None),
        ({"part.rotate_deg.1": None}, None),
        ({"zones.0.name": "x"}, None),
        ({"steps.0": {"name": "a", "holder": {"kind": "rod"}}}, None),
        ({"steps.0": {"name": "a", "chamber": {"shape": "shape.py"}}}, None),
        ({"steps.1.part.mesh": "/x", "steps.0": {"name": "a"}, "steps.1": {"name": "b"}}, None),
        ({"process.accuracy.max_replicas": 9}, ["+max_replicas = 9"]),
        ({"effects.friction.mu": 0.2, "effects.friction.beta0": 0.3},
         ["+[effects.friction]", "+mu = 0.2", "+beta0 = 0.3"]),
        ({"part.target.direction": None, "part.target.angle_deg": None},
         ["-direction = [0, 0, -1]", "-angle_deg = [0, 10]"]),
        ({"part.target.faces": [{"at_mm": [0, 0, -8]}]}, ["+faces = [{at_mm = [0, 0, -8]}]"]),
        ({"zones.0": {"name": "side", "target": {"faces": [{"at_mm": [8, 0, 0]}]}}},
         ["+", "+[[zones]]", '+name = "side"', "+target = {faces = [{at_mm = [8, 0, 0]}]}"]),
    ],
)  # fmt: skip
def test_keys_are_changed_added_and_taken_out(
    file: EditedFile, changes: dict[str, Any], written: list[str] | None
) -> None:
    before = file.path.read_text()
    if written is None:  # not a number or choice of the page
        with pytest.raises(InputError, match=f"{next(iter(changes))}: (not changed on|nothing)"):
            file.save(changes)
        assert file.path.read_text() == before
        return
    file.save(changes)
    assert [one for one in differing(before, file.path.read_text()) if one != "+"] == [
        one for one in written if one != "+"
    ]


def test_what_would_not_load_is_not_written(file: EditedFile) -> None:
    before = file.path.read_text()
    with pytest.raises(InputError, match=r"design.toml:15: chamber.height_mm: given -3"):
        file.save({"chamber.height_mm": -3})
    assert file.path.read_text() == before


def test_a_file_changed_elsewhere_is_not_replaced(file: EditedFile) -> None:
    other = file.path.read_text().replace("mass_g = 3", "mass_g = 2.5")
    file.path.write_text(other)
    with pytest.raises(InputError, match="changed on disk since this page read it"):
        file.save({"chamber.height_mm": 31})
    assert file.path.read_text() == other
    fresh = EditedFile(file.path, False)
    fresh.save({"chamber.height_mm": 31})
    assert EditedFile(file.path, False).design.value("shot.mass_g") == 2.5


def test_numbers_of_a_catalogues_metal_are_shown_and_not_changed(file: EditedFile) -> None:
    text = file.path.read_text().replace("wall = { C0 = 0.91, v0_m_s = 0.44 }", 'wall = "42CrMo4"')
    file.path.write_text(text)
    file = EditedFile(file.path, False)
    rows = {row["name"]: row for row in design_fields(file)}
    assert rows["materials.wall.C0"]["fixed"]
    assert not rows["materials.part.C0"]["fixed"]
    assert rows["effects.friction.mu"]["fixed"]  # absent from the file: the catalogue's
    with pytest.raises(InputError, match=r"materials\.wall: given '42CrMo4'"):
        file.save({"materials.wall.C0": 0.8})


def test_every_number_has_its_bounds_unit_and_description(file: EditedFile) -> None:
    rows = {row["name"]: row for row in design_fields(file)}
    assert rows["chamber.height_mm"] == {
        "name": "chamber.height_mm", "value": 30.0, "least": 2.0, "most": 2000.0, "unit": "mm",
        "text": ["inner height, sonotrode to ceiling"], "whole": False, "varies": True,
        "fixed": False, "reason": ["to try"], "table": "chamber", "group": "Chamber",
        "label": "Height", "in_full": "Chamber height [mm]",
    }  # fmt: skip
    assert rows["part.offset_mm.0"]["value"] == 1.0
    assert rows["sonotrode.motion"]["choices"] == [
        ("sinusoidal", "sinusoidal"),
        ("random_phase", "random phase"),
    ]
    assert rows["part.offset_mm.0"]["in_full"] == "Part offset, x [mm]"
    assert rows["process.accuracy.replicas"]["group"] == "Accuracy of the process"
    assert rows["chamber.facets"]["group"] == "Accuracy of the process"
    for name in file.design.numbers():
        tables = ("effects.part_turn", "sonotrode.amplitude_profile", "sonotrode.face")
        absent = name.startswith(tables) and name[-1].isdecimal()
        if not absent and not name.startswith(
            ("part.target", "zones", "tolerances", "holder.", "mask.")
        ):
            assert name in rows


def test_a_study_of_the_page_varies_process_and_geometry(file: EditedFile) -> None:
    rows = design_fields(file)
    varied = {str(row["name"]) for row in rows if row.get("varies")}
    assert {"chamber.height_mm", "part.rotate_deg.2", "part.offset_mm.0"} < varied
    assert {"shot.diameter_mm", "shot.mass_g", "sonotrode.amplitude_um"} < varied
    assert "process.treatment_time_s" in varied
    others = ("process.accuracy", "materials", "effects.friction", "part.smoothing", "shot.density")
    assert not [name for name in varied if name.startswith(others)]


def test_how_the_file_says_it_is_kept_or_refused_in_words(file: EditedFile) -> None:
    """Dotted keys, inline tables and lists of them are TOML too."""
    text = file.path.read_text()
    friction = {"effects.friction.mu": 0.2, "effects.friction.beta0": 0.3}
    for old, new in (
        ("[effects]\ngravity = true\nrest = false", "effects = { gravity = true, rest = false }"),
        ("[effects]\ngravity = true\nrest = false", 'effects = "auto"'),
    ):
        head, _, rest = text.partition("[part]")
        file.path.write_text(new + "\n" + (head + "[part]" + rest).replace(old, ""))
        with pytest.raises(InputError, match=r"the page cannot change it|no table"):
            EditedFile(file.path, False).save(friction)


def test_a_file_keeps_its_mode(file: EditedFile) -> None:
    file.path.chmod(0o600)
    file.save({"chamber.height_mm": 31})
    assert file.path.stat().st_mode & 0o777 == 0o600
    file.path.chmod(0o400)
    with pytest.raises(InputError, match="read-only"):
        EditedFile(file.path, False).save({"chamber.height_mm": 32})


def restructured_by(file: EditedFile, changes: dict[str, Any], name: str, wanted: str) -> Any:
    return restructured(file.design, changes, name, wanted, file.with_changes)


def test_another_shape_has_its_own_keys_and_the_files_own_come_back(file: EditedFile) -> None:
    """The part is 16 mm wide, turned by 10 degrees and 1 mm beside the axis; `new` leaves 15 mm."""
    before = file.path.read_text()
    moved = {"chamber.height_mm": 31, "chamber.diameter_mm": 44}
    box = restructured_by(file, moved, "chamber.shape", "box")
    half_x, half_y = 8 * (np.cos(np.radians(10)) + np.sin(np.radians(10))) + np.array([1, 0])
    lengths = {"length_mm": np.ceil(2 * (half_x + 15)), "width_mm": np.ceil(2 * (half_y + 15))}
    plan = {f"chamber.{key}": length for key, length in lengths.items()}
    dropped = {"chamber.diameter_mm": None}
    assert box == {"chamber.height_mm": 31, "chamber.shape": "box", **dropped, **plan}
    names = {row["name"]: row for row in design_fields(file.changed(box))}
    assert names["chamber.shape"]["value"] == "box"
    assert names["chamber.length_mm"]["value"] == lengths["length_mm"]
    assert "chamber.diameter_mm" not in names
    prism = restructured_by(file, box | {"chamber.length_mm": 50}, "chamber.shape", "prism")
    assert file.with_changes(prism).value("chamber.sides") == 6
    again = restructured_by(file, prism, "chamber.shape", "cylinder")
    assert again == {"chamber.height_mm": 31}
    file.save(box)
    assert differing(before, file.path.read_text()) == [
        '-shape = "cylinder"', "-diameter_mm = 40", "-height_mm = 30   # to try",
        '+shape = "box"', "+height_mm = 31   # to try",
        f"+length_mm = {lengths['length_mm']}", f"+width_mm = {lengths['width_mm']}",
    ]  # fmt: skip


def test_where_the_part_goes_out_through_the_walls_the_shape_is_round_the_target(
    file: EditedFile,
) -> None:
    """A bar of 60 mm in a cylinder of 40 mm, whose target is the 16 mm in the middle."""
    bar = trimesh.creation.box((60, 16, 16)).subdivide_to_size(4.0)
    write_stl(file.folder / "box.stl", bar.vertices[bar.faces])
    changes = restructured_by(EditedFile(file.path, False), {}, "chamber.shape", "prism")
    assert 2 * (8 * np.sqrt(2) + 15) < changes["chamber.across_mm"] < 60


def test_a_holder_is_put_in_changed_and_taken_out(file: EditedFile) -> None:
    before = file.path.read_text()
    rod = restructured_by(file, {}, "holder.kind", "rod")
    assert rod == {"holder.kind": "rod"}
    names = {row["name"]: row for row in design_fields(file.changed(rod))}
    assert names["holder.axis.2"]["value"] == 1.0
    assert "holder.diameter_mm" in names
    assert "holder.grip_mm" not in names  # of a collar
    file.save({**rod, "holder.diameter_mm": 6})
    assert differing(before, file.path.read_text())[-3:] == [
        "+[holder]", '+kind = "rod"', "+diameter_mm = 6",
    ]  # fmt: skip
    held = EditedFile(file.path, False)
    bore = restructured_by(held, {"holder.diameter_mm": 7}, "holder.kind", "bore")
    assert bore == {"holder.kind": "bore", "holder.diameter_mm": None}
    assert restructured_by(held, bore, "holder.kind", "rod") == {}
    held.save(restructured_by(held, bore, "holder.kind", ""))
    assert EditedFile(file.path, False).design == file.design


def test_a_shape_that_is_not_offered_is_refused(file: EditedFile) -> None:
    """A shape may be a Python file, which would be run; an arbor needs a hole's walls."""
    for name, wanted in (
        ("chamber.shape", "own.py"), ("chamber.shape", "imported"),
        ("holder.kind", "arbor"), ("part.mesh", "x"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=f"{name}: given {wanted}; allowed: "):
            restructured_by(file, {}, name, wanted)
        with pytest.raises(InputError, match=f"{name}: not changed on the page"):
            file.save({name: wanted})
    with pytest.raises(InputError, match=r"holder\.at: not changed on the page"):
        file.save({"holder.at": {"surface": "all"}})


def test_a_step_is_added_as_a_copy_whose_numbers_are_then_changed(file: EditedFile) -> None:
    """The first step is the design itself; the copy turns, and is copied with its turn."""
    before = file.path.read_text()
    once = with_added_step(file.design, {}, "turned", 0)
    once |= {"steps.1.part.rotate_deg.0": 180.0, "steps.1.time_share": 3.0}
    twice = with_added_step(file.with_changes(once), once, "again", 1)
    assert [one.name for one in file.with_changes(once).steps or ()] == ["first", "turned"]
    file.save(twice)
    design = EditedFile(file.path, False).design
    first, turned, again = design.in_steps.values()
    assert first.part.rotate_deg == (0.0, 0.0, 10.0)
    assert turned.part.rotate_deg == again.part.rotate_deg == (180.0, 0.0, 10.0)
    assert turned.shot == first.shot
    assert turned.process.treatment_time == pytest.approx(3 * first.process.treatment_time)
    assert not [one for one in differing(before, file.path.read_text()) if one[0] == "-"]


@pytest.mark.parametrize(
    ("words", "name"), [("second side", "second_side"), ("2. Rückseite", "step_2_Ruckseite")]
)
def test_a_step_gets_its_name_from_words(file: EditedFile, words: str, name: str) -> None:
    changes = with_added_step(file.design, {}, words, 0)
    design = file.with_changes(changes)
    assert [*design.in_steps] == ["first", name]
    for taken in ("first", words):
        with pytest.raises(InputError, match="name of the step: there is a step"):
            with_added_step(design, changes, taken, 0)


def test_a_step_is_removed_from_the_file_or_from_the_changes(file: EditedFile) -> None:
    """Numbers of later steps move up; the first step alone is the design without steps."""
    three = with_added_step(file.design, {}, "turned", 0)
    three = with_added_step(file.with_changes(three), three, "again", 1)
    three |= {"steps.2.part.rotate_deg.0": 90.0}
    two = without_step(file.design, three, 3, 1)
    assert [*file.with_changes(two).in_steps] == ["first", "again"]
    assert file.with_changes(two).in_steps["again"].part.rotate_deg[0] == 90.0
    assert without_step(file.design, two, 2, 1) == {}

    before = file.path.read_text()
    file.save(three)
    saved = EditedFile(file.path, False)
    two = without_step(saved.design, {"steps.2.shot.mass_g": 1.5}, 3, 1)
    assert saved.with_changes(two).in_steps["again"].shot.mass_g == 1.5
    two = with_added_step(saved.with_changes(two), two, "last", 1)
    assert [*saved.with_changes(two).in_steps] == ["first", "again", "last"]
    one = without_step(saved.design, without_step(saved.design, two, 3, 2), 2, 1)
    saved.save(one)
    assert tomllib.loads(file.path.read_text()) == tomllib.loads(before)
    with pytest.raises(InputError, match="step: given 0"):
        without_step(saved.design, {}, 3, 0)


def test_an_alloy_is_named_and_its_numbers_follow(file: EditedFile) -> None:
    text = file.path.read_text()
    numbers = "part = { C0 = 0.91, v0_m_s = 0.17, hardness_HB = 120 }"
    assert not file.alloys()  # numbers alone
    file.path.write_text(text.replace(numbers, 'part = "42CrMo4"'))
    named = EditedFile(file.path, False)
    (row,) = [one for one in design_fields(named) if "suggestions" in one]
    assert row["name"] == "materials.part"
    assert row["value"] == "42CrMo4"
    assert ("Ti-6Al-4V", "titanium") in row["suggestions"]
    other = named.changed({"materials.part": "Ti-6Al-4V"})
    assert other.design.value("materials.part.hardness_HB") == 334
    assert 'part = "Ti-6Al-4V"' in other.text
    with pytest.raises(InputError, match=r"materials\.part: .*did you mean 'Ti-6Al-4V'"):
        named.with_changes({"materials.part": "Ti-6Al-4W"})

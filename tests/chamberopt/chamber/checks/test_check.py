"""Facts and warnings of `check`: resting places, the part's rotation, parts outside the chamber."""

import math
import tomllib
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from manifold3d import CrossSection, Manifold

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.checks.check import shot_reach, warnings
from chamberopt.chamber.checks.facts import describe
from chamberopt.chamber.checks.gaps import find_ledges, gutter_warnings, surface_warnings
from chamberopt.chamber.checks.place_names import CEILING, PART, PART_SIDE, SIDE_WALL, UPPER_SIDE
from chamberopt.chamber.checks.warning import WarningKind
from chamberopt.chamber.matters import MatterKind
from chamberopt.chamber.reach import find_reach
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.design.design import Design, validate
from chamberopt.design.load import load_design
from chamberopt.design.shapes import TAG_SONOTRODE
from sim_core import SceneError
from tests.chamberopt.chamber.checks.test_openings import chamber_of, design_of

DESIGNS = Path(__file__).resolve().parents[4] / "designs"


@cache
def made(name: str, **values: float) -> tuple[Design, Chamber]:
    design = load_design(DESIGNS / f"{name}.toml").changed(
        {k.replace("__", "."): v for k, v in values.items()}
    )
    return design, build_chamber(design)


def texts_of(kind: WarningKind, design: Design, chamber: Chamber) -> list[str]:
    return [one.text for one in warnings(design, chamber) if one.kind is kind]


def without_gravity(design: Design) -> Design:
    return design.model_copy(
        update={"effects": design.effects.model_copy(update={"gravity": False})}
    )


@pytest.fixture(scope="module")
def gear() -> tuple[Design, Chamber]:
    return made("gear")


def test_a_level_top_is_warned_of_with_area_place_and_remedy(gear: tuple[Design, Chamber]) -> None:
    """The gear's upper face: a toothed disc between radius 20 and 22 mm, less the shaft."""
    design, chamber = gear
    (said,) = texts_of(WarningKind.REST, design, chamber)
    assert "come to rest on the part, which neither vibrates nor turns" in said
    assert "around (0.0, 0.0, 25.0) mm in the chamber's frame, at z = 25 mm" in said
    assert "effects.part_turn" in said
    area = float(said.split("turns: ")[1].split(" mm²")[0])
    shaft = math.pi * 8**2
    assert 0.5 * math.pi * 22**2 - shaft < area < math.pi * 22**2 - shaft / 2
    (ledge,) = find_ledges(design, chamber)
    assert (ledge.name, ledge.level) == (PART, True)
    assert not find_ledges(without_gravity(design), chamber)


def test_a_design_without_friction_says_what_that_means(gear: tuple[Design, Chamber]) -> None:
    design, chamber = gear

    def notes(effects: Any, design: Design = design) -> list[str]:
        found = describe(design.changed({"effects": effects}), chamber)["notes"]
        return [text for text in found if "friction" in text]

    assert not notes({})  # the catalogue has it
    (said,) = notes({"friction": "none"})
    assert "so the balls are smooth" in said
    assert 'effects.friction = "catalogue"' in said
    assert not notes({"friction": {"mu": 0.3, "beta0": 0.2}})
    assert not notes("auto")  # pilot runs decide
    mix = [{"diameter_mm": 1.5, "share": 0.5}, {"diameter_mm": 1.4, "share": 0.5}]
    mixed = design.changed({"shot.diameter_mm": None, "shot.mix": mix})
    assert notes({"rest": False, "friction": "none"}, mixed) == [said]
    friction = {"mu": 0.3, "beta0": 0.2}
    assert not notes({"rest": False, "friction": friction}, mixed)


def test_slopes_are_a_note_and_no_warning() -> None:
    """A gutter round the wall holds balls; the blade's slopes and leaning walls do not."""
    design, chamber = made("blade")
    assert not find_ledges(design, chamber)
    data = design.model_dump()
    data["chamber"] = {
        "shape": "prism",
        "sides": 6,
        "across_mm": 50.0,
        "height_mm": 57.0,
        "inclination_deg": 10.0,
    }
    leaning = validate(
        Design, {**data, "chamber": {**data["chamber"], "sonotrode_distance_mm": 15.0}}
    )
    assert not find_ledges(leaning, build_chamber(leaning))
    profile = [[24, 0], [24, 12], [28, 8], [32, 12], [32, 57]]
    data["chamber"] = {"shape": "revolve", "profile_mm": profile, "sonotrode_distance_mm": 15.0}
    gutter = validate(Design, data)
    (found,) = find_ledges(gutter, build_chamber(gutter))
    assert not found.level
    assert "in hollows of the wall" in found.message
    assert "none level" in found.message
    assert "z = 8 to 12 mm" in found.message


@pytest.mark.parametrize(
    ("slope", "room", "turned", "length"),
    [(45, 40, 0, 60), (4, 40, 0, 60), (45, 40, 180, 0), (0.5, 40, 0, 0), (45, 80, 0, 0)],
)
def test_balls_rest_in_a_gutter_between_a_roof_and_the_wall(
    tmp_path: Path, slope: float, room: float, turned: float, length: float
) -> None:
    """A roof of 60 x 60 mm whose eaves go out through two walls, or end before them; one lies on
    its back. Its ridge is along y, and both gutters are as long as it.
    """
    rise = 30.0 * math.tan(math.radians(slope))
    outline = CrossSection([[(-30, 0), (30, 0), (30, 4), (0, 4 + rise), (-30, 4)]])
    made = Manifold.extrude(outline, 60.0).rotate([90, 0, 0]).to_mesh()
    trimesh.Trimesh(made.vert_properties, made.tri_verts).export(tmp_path / "roof.stl")
    data = tomllib.loads((DESIGNS / "plate.toml").read_text())
    data["part"] = {"mesh": str(tmp_path / "roof.stl"), "unit": "mm"}
    facing = {"direction": [0, 0, 1 if turned else -1], "angle_deg": [0, 60]}
    data["part"] |= {"rotate_deg": [turned, 0, 0], "target": facing}
    room_mm = {"length_mm": room, "width_mm": 80, "height_mm": 80, "sonotrode_distance_mm": 20}
    data["chamber"] = {"shape": "box", **room_mm}
    if room < 60:
        data["holder"] = {"kind": "bore", "clearance_mm": 0.2}
    design = validate(Design, data)
    chamber = build_chamber(design)
    found = gutter_warnings(design, chamber, shot_reach(design, chamber))
    assert bool(found) == bool(length)
    for one in found:
        assert one.subject == (WarningKind.REST, (PART, SIDE_WALL))
        assert "come to rest on the part in the gutter between it and the wall" in one.text
        told = float(one.text.split("about ")[1].split(" mm")[0])
        assert told == pytest.approx(2 * length, rel=0.1)
    assert not gutter_warnings(without_gravity(design), chamber, shot_reach(design, chamber))


def test_nothing_comes_to_rest_under_a_lid_or_on_a_part_that_turns() -> None:
    for name in ("plate", "gear_turning"):
        assert not find_ledges(*made(name)), name


def test_a_turning_part_is_described_in_the_chambers_frame() -> None:
    design, chamber = made("gear_turning")
    turn = describe(design, chamber)["part_turn"]
    assert turn["rpm"] == 30.0
    assert turn["axis"] == pytest.approx([0.0, -1.0, 0.0], abs=1e-12)
    assert turn["through_mm"][0] == pytest.approx(0.0, abs=1e-3)
    assert turn["through_mm"][2] == pytest.approx(15.0 + 22.0, abs=0.1)
    assert "part_turn" not in describe(*made("plate"))


def test_what_is_to_be_settled_is_warned_of_until_it_is_taken_out(
    gear: tuple[Design, Chamber],
) -> None:
    design, chamber = gear
    matter = "CHOSEN BY SIZE ALONE: confirm it"
    open_one = design.changed({"to_settle": [matter]})
    (new,) = set(warnings(open_one, chamber)) - set(warnings(design, chamber))
    assert (new.kind, new.text) == (WarningKind.TO_SETTLE, f"to be settled: {matter}")
    assert open_one.changed({"to_settle": []}) == design


def test_a_part_through_the_side_wall_is_warned_of(gear: tuple[Design, Chamber]) -> None:
    """No warning for a shaft through the ceiling, a lid, or a shaft that turns in the wall."""
    assert not texts_of(WarningKind.SIDE_WALL, *gear)
    for name in ("plate", "gear_turning"):
        assert not texts_of(WarningKind.SIDE_WALL, *made(name)), name
    narrow = made("gear", chamber__diameter_mm=42.0, shot__diameter_mm=4.0)
    (said,) = texts_of(WarningKind.SIDE_WALL, *narrow)
    assert "goes out through the side wall between z = 15 and 25 mm" in said
    assert "chamber.diameter_mm" in said


def test_a_part_that_turns_down_to_the_sonotrode_is_warned_of() -> None:
    """The gear turned about a line 6.9 mm below its own axis comes down to 1.2 mm."""
    eccentric = {"effects.part_turn.through_mm.1": -6.9}
    design, chamber = made("gear_turning")
    (said,) = texts_of(WarningKind.TURNING_GAP, design.changed(eccentric), chamber)
    assert (
        "the gap between turning part and sonotrode is 1.16 mm, narrower than a ball of 1.5 mm"
        in said
    )
    assert not texts_of(WarningKind.TURNING_GAP, design, chamber)
    # 5 degrees to each side, a point 22 mm under the gear's axis hardly gets lower than at rest
    swings = design.changed(eccentric)
    motion = swings.effects.part_turn.model_copy(
        update={"rpm": None, "angle_deg": 5.0, "frequency_hz": 1.0}
    )  # type: ignore[union-attr]
    swings = swings.model_copy(
        update={"effects": swings.effects.model_copy(update={"part_turn": motion})}
    )
    assert not texts_of(WarningKind.TURNING_GAP, swings, chamber)


def test_balls_that_would_meet_but_are_let_through_each_other_are_warned_of() -> None:
    design, chamber = made("gear")
    through = design.model_copy(
        update={"effects": design.effects.model_copy(update={"ball_collisions": False})}
    )
    (said,) = texts_of(WarningKind.COLLISIONS, through, chamber)
    assert "effects.ball_collisions is false" in said
    assert not texts_of(WarningKind.COLLISIONS, design, chamber)
    alone = through.changed({"shot.mass_g": 1e-3 * round(1e6 * design.shot.ball_mass)})
    assert not texts_of(WarningKind.COLLISIONS, alone, chamber)


def test_what_a_ball_can_touch_is_a_fact_and_what_it_cannot_a_warning() -> None:
    design, chamber = made("gear", shot__diameter_mm=2.5)
    facts = describe(design, chamber)
    reach = facts["reach"]
    assert reach["ball_mm"] == 2.5
    assert reach["target_reachable_mm2"] == pytest.approx(
        reach["target_reachable_share"] * facts["target"]["exposed_area_mm2"], rel=1e-3
    )
    (warning,) = (one for one in facts["warnings"] if one.kind is WarningKind.UNTOUCHED)
    said = warning.text
    assert "cannot be touched by a ball of 2.5 mm" in said
    share = 100.0 * (1.0 - reach["target_reachable_share"])
    assert float(said.split("%")[0]) == pytest.approx(share, abs=0.1)
    assert 5.0 < share < 35.0  # the roots of the teeth
    assert "part.target.reachable = true" in said
    assert not texts_of(WarningKind.UNTOUCHED, *made("plate"))


def test_a_gap_too_low_for_a_ball_is_warned_of_with_its_place_and_width() -> None:
    low, narrow = (
        [one for one in warnings(*made("gear", **size)) if one.kind is WarningKind.NARROW_GAP]
        for size in ({"chamber__height_mm": 26.0}, {"chamber__diameter_mm": 46.0})
    )
    assert [one.about for one in (*low, *narrow)] == [(CEILING, UPPER_SIDE), (PART_SIDE, SIDE_WALL)]
    said = low[0].text
    assert "the gap between the ceiling and the part's upper side at (" in said
    assert ", 25.5) mm in the chamber's frame is 1 to 1.0" in said
    assert (
        "narrower than a ball of 1.5 mm: no ball gets in there; raise the ceiling or close "
        "the gap" in said
    )
    said = narrow[0].text
    assert said.startswith("each of 20 gaps between the part's side and the wall, one at (")
    assert "no ball gets in there; enlarge the chamber" in said


def test_a_chamber_that_leaks_is_refused_with_the_place(gear: tuple[Design, Chamber]) -> None:
    design, chamber = gear
    assert describe(design, chamber)["chamber"]["closed"] == "yes"
    gone = int((chamber.tags == TAG_SONOTRODE).argmax())
    columns = {
        name: np.delete(getattr(chamber, name), gone, axis=0)
        for name in ("triangles", "tags", "source")
    }
    corners = chamber.vertices[chamber.triangles[gone]]
    with pytest.raises(
        SceneError, match=r"mesh is not closed: 3 open edge\(s\), the first on triangle"
    ) as refused:
        describe(design, replace(chamber, **columns))
    place = np.array(
        [float(x) for x in str(refused.value).split("at [")[1].split("]")[0].split(",")]
    )
    middles = 0.5 * (corners + np.roll(corners, -1, axis=0))
    assert np.linalg.norm(middles - place, axis=1).min() < 2e-6


def test_a_sonotrode_that_comes_near_the_part_is_warned_of(gear: tuple[Design, Chamber]) -> None:
    """A design is kept ten amplitudes away; a cavity made elsewhere may be nearer."""
    design, chamber = gear
    assert describe(design, chamber)["chamber"]["sonotrode_clearance_mm"] == pytest.approx(15.0)
    floor = np.unique(chamber.triangles[chamber.tags == TAG_SONOTRODE])
    vertices = chamber.vertices.copy()
    vertices[floor, 2] = 14.7e-3
    quick = design.changed({"shot.diameter_mm": 4.0})  # what large balls reach is found sooner
    (said,) = texts_of(WarningKind.CONTACT, quick, replace(chamber, vertices=vertices))
    assert "part and sonotrode are only 0.3 mm apart, less than ten amplitudes of 40 µm" in said
    assert "chamber.sonotrode_distance_mm" in said


@pytest.mark.parametrize(("wide", "deep", "what"), [(1.0, 6.0, "gaps"), (20.0, 4.0, "corners")])
def test_it_is_said_whether_gaps_or_corners_keep_balls_out(
    wide: float, deep: float, what: str, tmp_path: Path
) -> None:
    """A groove of 1 mm takes no ball of 2.5 mm, and one of 20 mm all but in its two corners."""
    groove = trimesh.creation.box((wide, 40.0, 2.0 * deep))
    groove.apply_translation((0.0, 0.0, -6.0))
    block = trimesh.creation.box((30.0, 30.0, 12.0))
    body = trimesh.boolean.difference([block, groove], engine="manifold")
    inside = {"box_mm": [[-10.1, -15.1, -6.1], [10.1, 15.1, 5.9]]}
    chamber = chamber_of(tmp_path, body, target=inside)
    (one,) = surface_warnings(find_reach(chamber_mesh(chamber), 2.5e-3), chamber)
    assert f"most of it in {what}" in one.text


def test_a_piece_of_the_ceiling_in_a_bore_of_the_part_is_warned_of(tmp_path: Path) -> None:
    """The ceiling at z = 40 mm crosses a tube; below a higher one the whole tube hangs."""
    tube = trimesh.creation.annulus(6.0, 8.0, 60.0, sections=64)
    design = design_of(tmp_path, tube)
    (said,) = texts_of(WarningKind.WALL_IN_HOLE, design, build_chamber(design))
    assert said.startswith(
        "the wall goes across 1 hole of the part, of 12 mm in the ceiling at (0.0, 0.0, 40.0) mm:"
    )
    assert "plug it (mask.plugs = true" in said
    assert said.endswith("or change chamber.height_mm")
    higher = design.changed({"chamber.height_mm": 80.0})
    assert not texts_of(WarningKind.WALL_IN_HOLE, higher, build_chamber(higher))
    large = design.changed({"shot.diameter_mm": 14.0, "shot.mass_g": 100.0})
    assert not texts_of(WarningKind.WALL_IN_HOLE, large, build_chamber(large))
    told = design.model_copy(update={"to_settle": (f"{MatterKind.HOLE}, not plugged",)})
    assert not texts_of(WarningKind.WALL_IN_HOLE, told, build_chamber(told))

"""What `chamberopt new` proposes to hold a part with: bodies whose best place to hold is known."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
import trimesh
from manifold3d import CrossSection, Manifold, OpType

from chamberopt.chamber.layout.arbor import find_bores
from chamberopt.chamber.layout.end import bare_end, held_end
from chamberopt.chamber.layout.holder import NOT_FIXED, HolderChoice, end_holder, holder_choices
from chamberopt.chamber.layout.target import WHOLE, Surface, Target, apart
from chamberopt.chamber.propose import first_design
from chamberopt.chamber.propose.first_design import propose
from chamberopt.chamber.propose.held_proposal import _not_held, is_firm, is_held_thinly
from chamberopt.chamber.propose.proposal import Proposal, Wanted
from chamberopt.chamber.propose.proposed_mask import find_left_out
from chamberopt.chamber.propose.text import clauses, design_text
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.meshes.raw_mesh import number_by_position
from tests.chamberopt.chamber.layout.test_grip import blade_on_root, solid
from tests.helpers.eight_parts.surfaces import closed_tube
from tests.helpers.mesh_files import write_stl

BALL = 1e-3


def choices_of(body: trimesh.Trimesh, target: np.ndarray) -> list[HolderChoice]:
    """The choices for a body in mm, as drawn, with balls of 1 mm."""
    count = len(body.faces)
    assert len(target) == count
    triangles = body.faces.astype(np.int32)
    mesh = PartMesh(1e-3 * body.vertices, triangles, number_by_position(count), (), "", {})
    return holder_choices(mesh, target, (0.0, 0.0, 0.0), BALL)


def test_a_plate_is_held_by_a_rod_opposite_to_its_target() -> None:
    """The rod has 0.8 of the widest circle in the face, from 0.5 mm to 0.5 mm."""
    plate = trimesh.creation.box((60, 41, 5))
    first = choices_of(plate, plate.face_normals[:, 2] < -0.5)[0]
    assert (first.keys["kind"], first.keys["diameter_mm"]) == ("rod", 32.5)
    assert first.keys["at"]["faces"][0]["at_mm"][2] == pytest.approx(2.5)
    assert "axis" not in first.keys  # to the ceiling
    assert "looks up" in first.reason
    assert NOT_FIXED in first.reason


def test_bolts_through_a_hole_hold_a_rod_without_further_words() -> None:
    plate = Manifold.cube((60, 41, 5)).translate([-30, -20.5, -2.5])
    hole = Manifold.cylinder(10, 3, circular_segments=48).translate([8, 4, -5])
    body = solid(plate - hole)
    mesh = PartMesh(
        1e-3 * body.vertices,
        body.faces.astype(np.int32),
        number_by_position(len(body.faces)),
        (),
        "",
    )
    down = body.face_normals[:, 2] < -0.5
    bores = find_bores(mesh, down, for_arbor=False)
    reason = holder_choices(mesh, down, (0.0, 0.0, 0.0), BALL, bores)[0].reason
    assert "hole of 6 mm hold" in reason
    assert NOT_FIXED not in reason


def test_a_target_on_top_leaves_the_sides() -> None:
    """A rod keeps from the edges of the target: 0.3 of the 10 mm to the edge, above two balls."""
    block = trimesh.creation.box((60, 40, 20))
    up = np.abs(block.face_normals[:, 2]) > 0.5
    found = choices_of(block, up)
    assert {one.keys["kind"] for one in found} == {"rod"}
    assert all(abs(one.keys["axis"][2]) < 1e-9 for one in found)
    assert [one.keys["diameter_mm"] for one in found] == [16.0] * 4
    assert not choices_of(block, np.ones(len(up), dtype=bool))


@pytest.mark.parametrize(
    ("wide", "y", "holds"), [(20.0, 0.0, True), (20.0, 45.0, False), (2.5, 0.0, False)]
)
def test_no_rod_stands_on_a_narrow_face_or_far_from_the_middle(
    wide: float, y: float, holds: bool
) -> None:
    """A plate of 200 x 120 x 4 mm with a rib on it: balls peen all but the rib's top."""
    plate = Manifold.cube((200, 120, 4)).translate([-100, -60, 0])
    body = solid(plate + Manifold.cube((100, wide, 20)).translate([-50, y - 0.5 * wide, 0]))
    assert bool(choices_of(body, body.triangles_center[:, 2] < 19.0)) == holds


@pytest.mark.parametrize(("sides", "holds"), [(8, True), (32, False)])
def test_no_rod_stands_on_a_facet_of_a_round(sides: int, holds: bool) -> None:
    """A bar of 80 mm across whose lower half is peened: of 8 sides, or round but for its facets."""
    bar = Manifold.cylinder(60, 40, circular_segments=sides).rotate([0, 0, 180 / sides])
    body = solid(bar.rotate([90, 0, 0]))
    aside = np.abs(body.face_normals[:, 1]) > 0.5
    up = body.face_normals[:, 2] > 0.9
    assert bool(choices_of(body, aside | ~up)) == holds


def test_a_shaft_gets_a_collar_up_to_where_it_widens() -> None:
    """A disc of 60 x 10 mm on whose top a shaft of 12 x 20 mm stands: 0.4 of 30 mm are enclosed."""
    body = solid(
        Manifold.cylinder(10, 30, circular_segments=64)
        + Manifold.cylinder(30, 6, circular_segments=64)
    )
    below = body.triangles_center[:, 2] < 1e-6
    first, second = choices_of(body, below)[:2]
    assert (first.keys["kind"], first.keys["grip_mm"]) == ("collar", 12.0)
    assert first.keys["diameter_mm"] == pytest.approx(12 + 2 * 5)  # walls of 5 mm
    assert second.keys["kind"] == "rod"
    # With the flank of the disc's top as the target, the collar ends two balls above it.
    short = solid(
        Manifold.cylinder(10, 30, circular_segments=64)
        + Manifold.cylinder(16, 6, circular_segments=64)
    )
    level = (np.abs(short.triangles_center[:, 2] - 10) < 1e-6) & (short.face_normals[:, 2] > 0.5)
    (grip,) = (one.keys["grip_mm"] for one in choices_of(short, level)[:1])
    assert grip == pytest.approx(6 - 2, abs=0.11)


def test_a_root_is_held_by_a_block_round_its_widest_place() -> None:
    """A dovetail that is 10 mm wide at its end and 16 mm below it, 40 mm long, on a blade."""
    outline = [(-2, 0), (2, 0), (2, 40), (8, 44), (8, 46), (5, 60), (-5, 60), (-8, 46), (-8, 44)]
    outline.append((-2, 40))
    blade = Manifold.extrude(CrossSection([outline]), 40.0).rotate([90, 0, 0])
    body = solid(blade)
    first = choices_of(body, body.triangles_center[:, 2] < 40.0)[0]
    assert first.keys["kind"] == "plate"
    assert first.keys["size_mm"] == [50.0, 26.0]
    assert first.keys["grip_mm"] == pytest.approx(60 - 40 - 2, abs=0.11)
    assert "the target begins 2 mm beyond it" in first.reason


def test_a_rod_covers_the_hole_of_its_face() -> None:
    ring = solid(
        Manifold.cylinder(5, 20, circular_segments=96)
        - Manifold.cylinder(5, 17, circular_segments=96)
    )
    first = choices_of(ring, ring.face_normals[:, 2] < -0.5)[0]
    assert 34.0 < first.keys["diameter_mm"] < 40.0
    narrow = solid(
        Manifold.cylinder(5, 20, circular_segments=96)
        - Manifold.cylinder(5, 19.5, circular_segments=96)
    )
    assert not choices_of(narrow, narrow.face_normals[:, 2] < -0.5)


def test_where_nothing_can_hold_the_part_the_reason_is_said(tmp_path: Path) -> None:
    part = tmp_path / "box.stl"
    trimesh.creation.box((20, 20, 30)).export(part)
    made = propose(part, Wanted("mm"), lambda _: ["all"])
    assert made.design.holder is None
    assert made.reasons["chamber.height_mm"].endswith(
        "NOTHING HOLDS THE PART: all of it is to be peened; leave out of [part.target] the face to "
        "hold it by"
    )
    assert any("held in the air" in note for note in made.chamber.notes)


def test_a_holder_that_does_harm_is_told_with_what_to_do() -> None:
    keys = {"kind": "arbor", "at": {"faces": []}, "axis": [1.0, 0.0, 0.0], "both_sides": True}
    one = HolderChoice(keys, "an arbor through the bore of 16 mm, which is not peened; flanges lie")
    told = _not_held(one, "balls can come to rest on the holder", 3)
    assert told.startswith(
        "an arbor through the bore of 16 mm, which is not peened, was tried, but then balls can "
        "come to rest on the holder, and 2 further ways to hold it do harm too. Take another pose"
    )
    keys_in_words = 'kind = "arbor", axis = [1.0, 0.0, 0.0], both_sides = true, at these faces'
    assert f"([holder] {keys_in_words})" in told


def test_a_thin_plate_is_held_by_a_block_on_its_end() -> None:
    """A plate of 100 x 5 x 40 mm, upright, with peened broad sides: 0.8 of its end carries it."""
    plate = trimesh.creation.box((100, 5, 40))
    first = next(
        one
        for one in choices_of(plate, np.abs(plate.face_normals[:, 1]) > 0.5)
        if abs(one.keys.get("axis", (0, 0, 1))[0]) > 0.5
    )
    assert (first.keys["kind"], sorted(first.keys["size_mm"])) == ("plate", [4.0, 32.0])


def test_a_jaw_holds_an_end_of_any_form_beside_the_target() -> None:
    """A bar with a round end: a jaw grips 0.4 of its length, or up to two balls from the target."""
    bar = Manifold.cube((60, 20, 10)) + Manifold.cylinder(10, 10, circular_segments=64).translate(
        [60, 10, 0]
    )
    body = solid(bar).subdivide_to_size(4.0)
    x = body.triangles_center[:, 0]
    for reach in (10.0, 50.0):
        target = x < reach
        edge = body.triangles[target][..., 0].max()
        (jaw,) = (one for one in choices_of(body, target) if one.is_round_an_end)
        assert (jaw.keys["kind"], jaw.keys["axis"]) == ("plate", [1.0, 0.0, 0.0])
        assert jaw.keys["grip_mm"] == pytest.approx(min(28, 70 - edge - 2), abs=0.11)
        assert jaw.keys["size_mm"] == [30.0, 20.0]
        (low, _), (high, _) = (one[:2] for one in jaw.keys["at"]["box_mm"])
        assert low == pytest.approx(70 - jaw.keys["grip_mm"], abs=0.11)
        assert high > 70.0


@pytest.mark.long
def test_a_leaf_is_held_by_an_end_left_out_of_its_target(tmp_path: Path) -> None:
    """Broad sides reach both ends: a block on the edge of the upper one alone holds no leaf."""
    trimesh.creation.box((170, 5, 36)).subdivide_to_size(20.0).export(tmp_path / "leaf.stl")
    made = propose(tmp_path / "leaf.stl", Wanted("mm"), lambda _: [])
    assert made.design.holder is not None
    assert made.design.holder.grip_mm is not None
    assert "to hold it by" in made.reasons["part.target"]
    assert made.design.part.target.box_mm is not None


def test_the_room_is_told_wall_by_wall(tmp_path: Path) -> None:
    """What is told beside a block is what its box and its sizes in the chamber give."""
    trimesh.creation.box((60, 40, 20)).export(tmp_path / "block.stl")
    made = propose(tmp_path / "block.stl", Wanted("mm", shape="box"), lambda _: [])
    long, wide = (made.tables["chamber"][key] for key in ("length_mm", "width_mm"))
    sizes = np.ptp(1e3 * made.chamber.part.vertices, axis=0)
    x, y = (f"{0.5 * (one - own):.3g} mm" for one, own in ((long, sizes[0]), (wide, sizes[1])))
    told = made.reasons["chamber.length_mm"]
    assert told.startswith(f"leaves {x} at -x, {x} at +x, {y} at -y, {y} at +y beside the part;")


@pytest.mark.parametrize(
    ("metal", "told"),
    [
        ("S355", ""),
        ("316L", ""),
        ("Ti-6Al-4V", ""),
        ("51CrV4", "it decides which intensity is usual"),
        ("16MnCr5", "it decides the balls"),
    ],
)
def test_a_hardness_that_a_name_does_not_tell_is_to_be_settled(
    tmp_path: Path, metal: str, told: str
) -> None:
    trimesh.creation.box((30, 20, 10)).export(tmp_path / "block.stl")
    made = propose(tmp_path / "block.stl", Wanted("mm", alloy=metal), lambda _: [])
    settle = [one.sentence for one in clauses(made.reasons["materials.part"])[1]]
    assert [told in one for one in settle] == [True] * bool(told)


def test_a_part_that_is_all_target_is_held_by_its_slimmer_end() -> None:
    """A rod of 10 x 60 mm with a ball of 20 mm at its upper end, which is turned down."""
    body = solid(
        Manifold.cylinder(60, 5, circular_segments=48)
        + Manifold.sphere(10, circular_segments=48).translate([0, 0, 60])
    ).subdivide_to_size(4.0)
    count = len(body.faces)
    triangles = body.faces.astype(np.int32)
    mesh = PartMesh(1e-3 * body.vertices, triangles, number_by_position(count), (), "", {})
    whole = Target(WHOLE, np.ones(count, dtype=bool), "all")
    end = held_end(mesh, whole, (0.0, 0.0, 0.0))
    assert end is not None
    assert end.turns == (180.0, 0.0, 0.0)
    middle = body.triangles_center[:, 2]
    assert (end.triangles == (middle < 6 + 7.5)).all()  # in the chamber, and what jaws need
    assert (end.target.triangles == ~end.triangles).all()
    assert end.target.keys["box_mm"][0][2] == end.at["box_mm"][1][2] == 13.5
    holder = end_holder(mesh, end.target.triangles, end.turns, BALL, end.triangles)
    assert holder is not None
    assert (holder.keys["kind"], holder.keys["diameter_mm"]) == ("collar", 20.0)
    assert 11.5 < holder.keys["grip_mm"] <= 13.5 - 1e3 * BALL
    assert held_end(mesh, end.target, (0.0, 0.0, 0.0)) is None  # not all of it is target
    assert held_end(mesh, whole, (30.0, 0.0, 0.0)) is None  # no axis of the file is upright


@pytest.mark.parametrize(("prongs", "is_end"), [(1, True), (2, False)])
def test_an_end_in_several_pieces_is_no_end(prongs: int, is_end: bool) -> None:
    """Prongs of 40 x 10 x 10 mm along x, 30 mm apart, as the coils of a spring that lies."""
    prong = Manifold.cube((40, 10, 10)).translate([-20, -5, -5])
    both = [prong.translate([0, 30 * k, 0]) for k in range(prongs)]
    body = solid(Manifold.batch_boolean(both, OpType.Add)).subdivide_to_size(3.0)
    count = len(body.faces)
    triangles = body.faces.astype(np.int32)
    mesh = PartMesh(1e-3 * body.vertices, triangles, number_by_position(count), (), "", {})
    whole = Target(WHOLE, np.ones(count, dtype=bool), "all")
    assert (held_end(mesh, whole, (0.0, 90.0, 0.0)) is not None) == is_end
    part = Target(WHOLE, body.triangles_center[:, 0] < 0.0, "")
    assert (bare_end(mesh, part, (0.0, 90.0, 0.0)) is not None) == is_end


def test_a_part_whose_end_is_not_held_keeps_its_whole_target(tmp_path: Path) -> None:
    """A ball, which has no end that jaws enclose."""
    trimesh.creation.icosphere(subdivisions=3, radius=12.0).export(tmp_path / "ball.stl")
    made = propose(tmp_path / "ball.stl", Wanted("mm"), lambda _: [])
    assert "NOTHING HOLDS THE PART" in made.reasons["chamber.height_mm"]
    assert "box_mm" not in made.tables["part.target"]
    assert made.chamber.part.target.all()


@pytest.mark.parametrize("side", ["FLANGE", "BORE"])
def test_what_is_seldom_peened_is_named_or_masked(tmp_path: Path, side: str) -> None:
    """A flange may be peened beside the target; a bore must not be, and gets a mask."""
    box = trimesh.creation.box((20, 20, 30))
    lines = [f"v {x} {y} {z}" for x, y, z in box.vertices]
    for (a, b, c), (x, _, z) in zip(box.faces + 1, box.face_normals, strict=True):
        name = "PEENED" if z < -0.5 else side if x > 0.5 else "SIDES"
        lines += [f"g {name}", f"f {a} {b} {c}"]
    part = tmp_path / "box.obj"
    part.write_text("\n".join(lines) + "\n")
    made = propose(part, Wanted("mm"), lambda _: [])
    assert made.design.part.target.surface == ("PEENED",)
    left_out = find_left_out(made)
    text = design_text(made, tmp_path, left_out)
    if side == "BORE":
        assert made.design.mask is not None
        assert made.design.mask.at.surface == ("BORE",)
        rows = made.chamber.part.corner_normals[:, :, 0].min(axis=1) > 0.5  # those of the bore
        assert made.chamber.exposed_area[rows].sum() == 0.0
        assert not any("BORE" in one.text for one in left_out)
        assert "[mask]\nthickness_mm = 1  # a cap on BORE: not to be peened" in text
        return
    sharp, said = left_out
    assert "mm in the chamber: 80 mm of the target's outer edges" in sharp.text
    assert made.design.mask is None
    assert said.text.startswith(
        "NOT MASKED: the shot also meets SIDES (1080 mm² of it), FLANGE (360 mm² of it);"
    )
    assert said.text in tomllib.loads(text)["to_settle"]


def test_the_rest_of_a_body_is_met_beside_a_target_that_is_a_face_of_it(tmp_path: Path) -> None:
    """A fillet of a shaft is peened: the shot meets the shaft's journals too."""
    box = trimesh.creation.box((20, 20, 30))
    lines = [f"v {x} {y} {z}" for x, y, z in box.vertices]
    for (a, b, c), (x, _, _) in zip(box.faces + 1, box.face_normals, strict=True):
        lines += [f"g {'KEY' if x > 0.5 else 'SHAFT'}", f"f {a} {b} {c}"]
    part = tmp_path / "box.obj"
    part.write_text("\n".join(lines) + "\n")
    made = propose(part, Wanted("mm"), lambda _: ["face 2.1"])
    _, said = (one.text for one in find_left_out(made) if not one.keys)
    assert said.startswith(
        "NOT MASKED: the shot also meets the rest of SHAFT (1080 mm² of it), KEY (360 mm² of it);"
    )
    named = propose(part, Wanted("mm"), lambda _: ["SHAFT"])
    assert not any("SHAFT" in one.text for one in find_left_out(named) if not one.keys)


def test_a_body_is_not_named_beside_its_faces() -> None:
    def surface(name: str) -> Surface:
        return Surface(name, {"surface": [name]}, np.ones(4, bool), "")

    area = np.array([4.0, 3.0, 2.0, 1.0])
    rows = {"BODY": [0, 1, 2], "FRONT": [0], "#ff0000": [0, 3], "REAR": [1]}
    each = {name: np.where(np.isin(np.arange(4), one), area, 0.0) for name, one in rows.items()}
    told = [(surface(name), float(one.sum()), one) for name, one in each.items()]
    assert [(one.name, size) for one, size in apart(told)] == [("FRONT", 4.0), ("REAR", 3.0)]
    assert apart([]) == []


@pytest.mark.parametrize(("thick", "long"), [(2.0, 60.0), (3.0, 70.0)])
def test_the_thin_end_of_a_blade_gives_way_to_its_root(
    thick: float, long: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its foot is peened. As it lies what holds it is taken for thin, and it stands instead."""
    body = blade_on_root(thick, long).subdivide_to_size(8.0)
    z = body.triangles_center[:, 2]
    foot = (z > -3.0) & (z < 8.0)
    lines = [f"v {x} {y} {z}" for x, y, z in body.vertices]
    for name, rows in (("FILLET", foot), ("OTHERS", ~foot)):
        lines += [f"g {name}", *(f"f {a} {b} {c}" for a, b, c in body.faces[rows] + 1)]
    part = tmp_path / "blade.obj"
    part.write_text("\n".join(lines) + "\n")
    monkeypatch.setattr(first_design, "propose_pose", lambda *_: ((0.0, 90.0, 0.0), "lying"))
    found: list[bool] = []

    def is_thin_at_first(made: Proposal) -> bool:
        found.append(is_held_thinly(made) if found else True)
        return found[-1]

    monkeypatch.setattr(first_design, "is_held_thinly", is_thin_at_first)
    made = propose(part, Wanted("mm"), lambda _: [])
    assert found == [True, False]
    assert made.design.part.rotate_deg[:2] == (180.0, 0.0)  # its root up
    assert is_firm(made)
    assert not is_held_thinly(made)
    # The way that was found is taken at once for balls of other sizes.
    assert made.thick_pose is not None
    found_so = Wanted("mm", may_leave_end=False, thick_pose=made.thick_pose)
    again = propose(part, found_so, lambda _: [])
    assert len(found) == 2
    assert again.design == made.design


@pytest.mark.parametrize(
    ("wide", "walls"), [(12.0, [5.0, 2.0]), (32.0, [8.0, 5.0, 2.0]), (60.0, [10.0, 5.0, 2.0])]
)
def test_the_walls_round_an_end_are_thick_where_there_is_room(
    wide: float, walls: list[float]
) -> None:
    """Those of a collar on a shaft that stands on a disc; thinner ones are tried where it jams."""
    shaft = Manifold.cylinder(wide, 0.5 * wide, circular_segments=64)
    body = solid(shaft.translate([0, 0, 10]) + Manifold.cylinder(10, 2 * wide))
    first = choices_of(body, body.triangles_center[:, 2] < 1e-6)[0]
    widths = [one["diameter_mm"] for one in (first.keys, *first.thinner)]
    assert [0.5 * (one - wide) for one in widths] == pytest.approx(walls, abs=0.3)
    assert all(one["at"] == first.keys["at"] for one in first.thinner)


@pytest.mark.parametrize("larger", [1.0, 2.0])
@pytest.mark.parametrize(("is_turned", "has_jaws"), [(False, True), (True, False)])
def test_flat_sides_of_an_end_that_narrows_are_for_jaws(
    is_turned: bool, has_jaws: bool, larger: float
) -> None:
    """A wedge, 20 mm thick, narrows to a third of its width; as a cone it has no flat sides."""
    if is_turned:
        end = Manifold.cylinder(30, 18, 6, circular_segments=64)
    else:
        end = Manifold.extrude(CrossSection([[(-18, 0), (18, 0), (6, 30), (-6, 30)]]), 20.0)
        end = end.rotate([90, 0, 0]).translate([0, 10, 0])
    made = end + Manifold.cube((80, 60, 20)).translate([-40, -30, -20])
    body = solid(made.refine_to_length(4.0).scale([larger] * 3))
    first = choices_of(body, body.triangles_center[:, 2] < -1e-6)[0]
    assert first.is_round_an_end
    assert first.narrows
    assert ("jaws on its flat faces that look to" in first.reason) == has_jaws
    assert ("NO STRAIGHT END TO CLAMP" in first.reason) != has_jaws


@pytest.mark.long
def test_a_spring_that_nothing_holds_as_it_lies_is_held_on_end(tmp_path: Path) -> None:
    """Eight coils of 4 mm wire on 30 mm, the outer ones closed: lying, no end is one piece."""
    angle = np.linspace(0.0, 16.0 * np.pi, 193)
    pitch = np.interp(angle / (2.0 * np.pi), [0, 1, 1.5, 6.5, 7, 8], [4.1, 4.1, 9, 9, 4.1, 4.1])
    rise = np.r_[0.0, np.cumsum(pitch[1:] * np.diff(angle) / (2.0 * np.pi))]
    out = np.c_[np.cos(angle), np.sin(angle), 0.0 * angle]
    middle = 15.0 * out + np.c_[0.0 * rise, 0.0 * rise, rise]
    along = np.gradient(middle, axis=0)
    up = np.cross(out, along / np.linalg.norm(along, axis=1)[:, None])
    turn = np.linspace(0.0, 2.0 * np.pi, 13)[:-1]
    ways = np.cos(turn)[:, None] * out[:, None] + np.sin(turn)[:, None] * up[:, None]
    (points, triangles), _ = closed_tube(middle[:, None] + 2.0 * ways)
    path = write_stl(tmp_path / "spring.stl", points[triangles])
    made = propose(path, Wanted("mm", ball_mm=1.2), lambda _: [])
    assert made.design.holder is not None
    assert made.design.holder.kind == "collar"
    assert "on end, as it is held by an end then" in made.reasons["part.rotate_deg"]


def test_a_bar_that_is_too_long_to_stand_is_peened_a_strip_at_a_time(tmp_path: Path) -> None:
    """A channel of 450 mm, of which the bottom is peened: on end little shot gets to its top."""
    outline = [(-25, 0), (25, 0), (25, 20), (20, 20), (20, 5), (-20, 5), (-20, 20), (-25, 20)]
    body = solid(Manifold.extrude(CrossSection([outline]), 450.0))
    body.export(tmp_path / "channel.stl")
    made = propose(tmp_path / "channel.stl", Wanted("mm", ball_mm=2.5), lambda _: [])
    assert made.strips is not None
    assert made.settings > 3
    assert made.chamber.vertices[:, 2].max() < 0.1


def test_a_lug_on_a_base_hangs_by_its_base(tmp_path: Path) -> None:
    """With the base down only a rod on it, between wall and lug, would hold the part."""
    base = Manifold.cube([50, 40, 20]).translate([-25, -20, 0])
    lug = Manifold.cube([36, 8, 40]).translate([-18, -4, 20])
    solid(base + lug).export(tmp_path / "lug.stl")
    made = propose(tmp_path / "lug.stl", Wanted("mm", ball_mm=2.0), lambda _: ["face 1"])
    assert is_firm(made)
    assert made.design.part.rotate_deg[0] == 180.0
    assert "this end down, so that the other one is held firmly" in made.reasons["part.rotate_deg"]

"""Ends that a clamp holds outside, and faces of a part that close its chamber."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold, Mesh

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.layout.end import (
    LocalRoom,
    Shape,
    bare_end,
    can_be_clamped,
    closing_faces,
    cut_shape,
    held_end,
    local_room,
    root_out,
    strip,
)
from chamberopt.chamber.layout.sizes import Sizes, propose_sizes
from chamberopt.chamber.layout.target import Surface, Target
from chamberopt.chamber.propose import proposed_mask
from chamberopt.chamber.propose.first_design import propose
from chamberopt.chamber.propose.held_proposal import rests
from chamberopt.chamber.propose.proposal import Wanted, nested
from chamberopt.chamber.propose.proposed_mask import (
    find_left_out,
    in_setting,
    rows_of,
    unlike_settings,
)
from chamberopt.common.errors import InputError
from chamberopt.design.design import Design, validate
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.triangles import areas
from chamberopt.workflows.propose import _settings_beside
from tests.chamberopt.chamber.layout.test_arbor import drum, part_of
from tests.helpers.eight_parts import EIGHT_PARTS

UPRIGHT = (0.0, 0.0, 0.0)
WEB = 6.0  # thickness [mm]


def crank(apart: float, web: float = 60.0) -> Manifold:
    """Two square webs [mm] with a pin of 16 mm across between them, along z, about its middle."""
    plate = Manifold.cube((web, web, WEB)).translate([-0.5 * web, -0.5 * web, 0.5 * apart])
    return (
        drum(8, apart + 0.1).translate([0, 0, -0.5 * apart - 0.05])
        + plate
        + plate.mirror((0, 0, 1))
    )


@pytest.mark.parametrize("apart", [12.0, 20.0])
def test_webs_close_a_chamber_where_the_target_ends(apart: float) -> None:
    mesh, body = part_of(crank(apart))
    radius = np.linalg.norm(body.triangles_center[:, :2], axis=1)
    pin = (radius < 8.01) & (np.abs(body.face_normals[:, 2]) < 0.1)
    found = closing_faces(mesh.vertices, mesh.triangles, pin, 2e-3)
    assert 1e3 * found[1, 2] == pytest.approx(0.5 * apart)
    assert np.isnan(found[:, :2]).all()
    lying = mesh.vertices[:, [0, 2, 1]] * [1, -1, 1] + [0, 0, 30e-3]  # the pin along y
    found = closing_faces(lying, mesh.triangles, pin, 2e-3)
    assert 1e3 * found[:, 1] == pytest.approx([-0.5 * apart, 0.5 * apart])
    assert np.isnan(found[:, [0, 2]]).all()
    sizes = propose_sizes(lying, 38e-3, 1e-3, "box", 1.0, lying[np.unique(mesh.triangles[pin])])
    room = local_room(lying, mesh.triangles, pin, sizes, None)
    assert room.sizes.closed == ("-y", "y")
    assert room.sizes.is_fixed
    assert apart + 0.4 <= room.sizes.plan["width_mm"] < apart + 0.9
    assert 1e3 * room.middle(room.sizes) == pytest.approx([0.0, 0.0], abs=1e-6)
    # The webs reach 22 mm below the pin: they may come nearer to the sonotrode than it.
    assert room.sizes.distance < sizes.distance
    assert room.sizes.height - room.sizes.distance == pytest.approx(sizes.height - sizes.distance)


def test_a_web_is_the_lid_of_a_round_chamber_whose_sides_stay_open() -> None:
    """The lower web, 6 mm thick, hangs in the room: it is the lowest there."""
    mesh, body = part_of(crank(20.0))
    pin = np.linalg.norm(body.triangles_center[:, :2], axis=1) < 8.01
    pin &= np.abs(body.face_normals[:, 2]) < 0.1
    posed = mesh.vertices + np.array([5e-3, 0.0, 16e-3])
    around = posed[np.unique(mesh.triangles[pin])]
    sizes = propose_sizes(posed, 26e-3, 1e-3, "cylinder", 1.0, around)
    room = local_room(posed, mesh.triangles, pin, sizes, None)
    assert room.sizes.closed == ("z",)
    assert room.sizes.plan == sizes.plan
    assert room.lowest == pytest.approx(0.0)
    assert 1e3 * room.middle(room.sizes) == pytest.approx([5.0, 0.0])
    wide = replace(room.sizes, plan={"diameter_mm": 50.0})
    outline = 1e3 * room.plan(wide) - [5.0, 0.0]
    assert np.linalg.norm(outline, axis=1) == pytest.approx(25.0)
    # The wall ends a fifth of a millimetre behind the web, and is as high as a shop makes it.
    assert 1e3 * (room.sizes.height - room.sizes.distance) == pytest.approx(26.2)
    assert 2e3 * room.sizes.height == pytest.approx(round(2e3 * room.sizes.height))


def test_small_or_far_faces_close_no_chamber() -> None:
    for web, far in ((60.0, 0.0), (17.0, 0.0), (60.0, 5.0)):
        mesh, body = part_of(crank(20.0, web))
        body = trimesh.Trimesh(1e3 * mesh.vertices, mesh.triangles, process=False)
        pin = np.linalg.norm(body.triangles_center[:, :2], axis=1) < 8.01
        pin &= np.abs(body.face_normals[:, 2]) < 0.1
        raised = mesh.vertices.copy()  # webs away from the pin's end, which is the target's
        moved = np.unique(mesh.triangles[~pin])
        raised[moved, 2] += 1e-3 * far * np.sign(raised[moved, 2])
        shared = np.unique(mesh.triangles[pin])
        raised[shared] = mesh.vertices[shared]
        is_wall = np.isfinite(closing_faces(raised, mesh.triangles, pin, 2e-3)[1, 2])
        assert is_wall == (web == 60.0 and far == 0.0)


def test_a_face_beyond_the_wall_of_a_strip_closes_no_chamber() -> None:
    """Webs close a chamber where the whole pin is peened, and not that of its middle 10 mm."""
    mesh, body = part_of(crank(30.0))
    radius = np.linalg.norm(body.triangles_center[:, :2], axis=1)
    pin = (radius < 8.01) & (np.abs(body.face_normals[:, 2]) < 0.1)
    lying = mesh.vertices[:, [2, 0, 1]] + [0, 0, 30e-3]  # the pin along x
    box = [[-31.0, -31.0, -5.0], [31.0, 31.0, 5.0]]
    middle = cut_shape(mesh, pin, {"box_mm": box})
    for shape, at_wall, closed in (
        (Shape(mesh.vertices, mesh.triangles, pin), 3e-3, ("-x", "x")),
        (middle, 3e-3, ()),
        (middle, 12e-3, ("-x", "x")),
    ):
        posed = shape.vertices[:, [2, 0, 1]] + [0, 0, 30e-3]
        on_target = posed[np.unique(shape.triangles[shape.target])]
        sizes = propose_sizes(lying, 38e-3, 5e-3, "box", 1.0, on_target)
        assert sizes.gap > 10e-3
        room = local_room(posed, shape.triangles, shape.target, sizes, at_wall)
        assert room.sizes.closed == closed


def test_a_wall_at_a_face_stays_there_as_the_floor_grows() -> None:
    """A blade on a platform of 30 x 30 mm, which is its wall along x."""
    blade = Manifold.cube((40, 3, 20)).translate([-40, -1.5, -10])
    mesh, body = part_of(blade + Manifold.cube((15, 30, 30)).translate([0, -15, -15]))
    target = body.triangles_center[:, 0] < 0.0
    around = mesh.vertices[np.unique(mesh.triangles[target])]
    sizes = propose_sizes(mesh.vertices, 10e-3, 1e-3, "box", 1.0, around)
    room = local_room(mesh.vertices, mesh.triangles, target, sizes, 2e-3)
    assert room.sizes.closed == ("x",)
    assert not room.sizes.is_fixed
    for longer in (0.0, 7.0, -3.0):
        plan = {**room.sizes.plan, "length_mm": room.sizes.plan["length_mm"] + longer}
        other = propose_sizes(mesh.vertices, 10e-3, 1e-3, "box")
        middle = room.middle(type(other)("box", plan, 0.0, 0.0, 0.0, False, 0.0))
        assert 1e3 * middle[0] + 0.5 * plan["length_mm"] == pytest.approx(0.2)
        assert middle[1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("closed", [(), ("z",)])
@pytest.mark.parametrize("lower_mm", [0.0, 3.0, 7.25])
def test_a_part_that_reaches_lower_gets_as_much_more_height(
    closed: tuple[str, ...], lower_mm: float
) -> None:
    plan = {"length_mm": 40.0, "width_mm": 30.0}
    sizes = Sizes("box", plan, 8e-3, 31e-3, 5e-3, bool(closed), 20e-3, closed)
    room = LocalRoom(sizes, np.zeros((2, 2)), np.zeros((2, 2), bool), 4e-3)
    found = room.as_low_as(sizes, 4e-3 - 1e-3 * lower_mm)
    higher_mm = 1e3 * (found.height - sizes.height)
    if closed:  # up to the lid, in half millimetres, for which the part is raised
        assert higher_mm == pytest.approx(math.ceil(2.0 * lower_mm) / 2.0)
        raised_mm = higher_mm - lower_mm
    else:
        assert higher_mm == pytest.approx(math.ceil(lower_mm))
        raised_mm = 0.0
    assert 1e3 * (found.distance - sizes.distance) == pytest.approx(raised_mm)
    assert 1e3 * (found.top - sizes.top) == pytest.approx(lower_mm)


@pytest.mark.parametrize(("begins", "wall"), [(-60.0, -22.0), (-21.0, -30.0)])
def test_both_ends_go_out_near_the_target_where_the_part_is_long_enough(
    begins: float, wall: float
) -> None:
    """A bar up to x = 60 mm, peened from -20 to 20 mm, in a box with 10 mm of room beside it."""
    low, mid, high = (
        Manifold.cube((end - begin, side, side)).translate([begin, -0.5 * side, -0.5 * side])
        for begin, end, side in ((begins, -20.0, 6.0), (-20.0, 20.0, 10.0), (20.0, 60.0, 6.0))
    )
    mesh, body = part_of(low + mid + high)
    target = np.abs(body.triangles_center[:, 0]) < 19.9
    around = mesh.vertices[np.unique(mesh.triangles[target])]
    sizes = replace(propose_sizes(mesh.vertices, 5e-3, 1e-3, "box", 1.0, around), gap=10e-3)
    room = local_room(mesh.vertices, mesh.triangles, target, sizes, 2e-3)
    assert 1e3 * room.walls[:, 0] == pytest.approx([wall, 22.0])
    assert room.kept[:, 0].tolist() == [wall == -22.0, True]


def test_a_straight_end_is_clamped_and_a_dome_is_not() -> None:
    """A rod of 12 mm whose end is flat, or a half ball: 9 mm of it must be straight."""
    for length, dome, holds in ((9.5, 0, True), (8.5, 0, False), (9.5, 6, False), (16, 6, True)):
        body = drum(6, 30 + length - dome)
        if dome:
            body += Manifold.sphere(6, circular_segments=64).translate([0, 0, 30 + length - dome])
        mesh, _ = part_of(body)
        assert can_be_clamped(mesh.vertices, mesh.triangles, 2, 30e-3) == holds


@pytest.mark.parametrize(("long", "holds"), [(10.0, False), (17.0, True)])
def test_a_root_beside_the_target_is_an_end_to_hold(long: float, holds: bool) -> None:
    root = Manifold.cube((40, 20, long)).translate([-20, -10, -long])
    mesh, body = part_of(root + Manifold.cube((36, 3, 60)).translate([-18, -1.5, 0]))
    target = body.triangles_center[:, 2] > 0.0
    end = bare_end(mesh, Target({}, target, ""), UPRIGHT)
    assert (end is not None) == holds
    if end is not None:
        assert end.axis.tolist() == [0.0, 0.0, -1.0]
        assert (end.target.triangles == target).all()
        assert not (end.triangles & target).any()


def test_a_blade_on_edge_goes_out_by_its_root(tmp_path: Path) -> None:
    """Its platform is the wall: no level top stays in the chamber, and one sonotrode does."""
    root = Manifold.cube((40, 20, 17)).translate([-20, -10, -17])
    _, body = part_of(root + drum(18, 60).scale([1, 0.3, 1]))
    lines = [f"v {x} {y} {z}" for x, y, z in body.vertices]
    for name, of_name in (("ROOT", False), ("BLADE", True)):
        rows = body.faces[(body.triangles_center[:, 2] > 0.0) == of_name] + 1
        lines += [f"g {name}", *(f"f {a} {b} {c}" for a, b, c in rows)]
    part = tmp_path / "blade.obj"
    part.write_text("\n".join(lines) + "\n")
    made = propose(part, Wanted("mm", pose="on-edge"), lambda _: [])
    assert made.design.holder is not None
    assert made.design.holder.kind == "bore"
    assert made.design.mask is None
    assert not made.chamber.pieces_in_air
    assert not rests(made)
    inside = made.chamber.exposed_area > 0.0
    assert inside[made.chamber.part.target].all()
    assert "the part itself is the wall" in made.reasons["chamber.length_mm"]


@pytest.mark.parametrize(("long", "share"), [(71.0, 0.25 * 43.0 / 71.0 + 0.04), (200.0, 0.15)])
def test_of_a_stubby_part_as_much_is_left_bare_as_a_holder_grips(long: float, share: float) -> None:
    mesh, _ = part_of(drum(21.5, long))
    whole = Target({"surface": ["all"]}, np.ones(len(mesh.triangles), dtype=bool), "all")
    end = held_end(mesh, whole, UPRIGHT)
    assert end is not None
    cut = end.target.keys["box_mm"][1][2] if end.axis[2] > 0.0 else end.target.keys["box_mm"][0][2]
    left = long - cut if end.axis[2] > 0.0 else cut
    assert left / long == pytest.approx(share, abs=1e-3)


def of_area(mesh: PartMesh, target: np.ndarray, box: list[list[float]] | None) -> float:
    """Area [mm²] of a target that is cut at a box."""
    cut = cut_shape(mesh, target, {"box_mm": box})
    return 1e6 * float(areas(cut.vertices, cut.triangles)[cut.target].sum())


def ends_of(mesh: PartMesh) -> list[int]:
    """Numbers of the vertices with the least and the largest x."""
    return [int(mesh.vertices[:, 0].argmin()), int(mesh.vertices[:, 0].argmax())]


@pytest.mark.parametrize("step", [0.0, 200.0, 300.0])
def test_what_lies_across_a_strips_end_is_in_a_strip(step: float) -> None:
    """The bar's end faces, and a step across it in the plane between two strips."""
    bar = Manifold.cube((400.0, 40.0, 20.0))
    if step:
        bar += Manifold.cube((step, 40.0, 30.0))
    mesh, body = part_of(bar)
    wanted = body.face_normals[:, 2] > -0.9
    one = strip(mesh, Target({"faces": []}, wanted, "all but its bottom"), UPRIGHT, 150e-3)
    assert one is not None
    assert one.strips is not None
    assert one.strips.settings > 2
    each = [of_area(mesh, wanted, one.strips.box_mm(mesh, k)) for k in range(one.strips.settings)]
    assert sum(each) == pytest.approx(body.area_faces[wanted].sum(), rel=1e-6)
    assert 1e6 * np.array(one.strips.areas) == pytest.approx(each)
    assert one.strips.are_alike == (min(each) > 0.95 * max(each))


@pytest.mark.parametrize("finer", [0, 2])
@pytest.mark.parametrize(("longest", "count"), [(60.0, 7), (200.0, 2), (399.0, 2)])
def test_strips_of_a_target_are_equal_however_it_is_divided(
    finer: int, longest: float, count: int
) -> None:
    """Those of a bar's broad sides, of 400 by 40 mm, each have as much of them."""
    body = trimesh.creation.box((400.0, 40.0, 20.0))
    for _ in range(finer):
        body = body.subdivide()
    made = Mesh(body.vertices.astype(np.float32), body.faces.astype(np.uint32))
    mesh, body = part_of(Manifold(made))
    sides = np.abs(body.face_normals[:, 1]) > 0.9
    one = strip(mesh, Target({"faces": []}, sides, "sides"), UPRIGHT, 1e-3 * longest)
    assert one is not None
    assert one.strips is not None
    assert one.strips.settings == count
    assert np.abs(one.axis).argmax() == 0
    box = one.target.keys["box_mm"]
    low, high = np.clip([box[0][0], box[1][0]], *(1e3 * mesh.vertices[:, 0].take(ends_of(mesh))))
    assert high - low == pytest.approx(400.0 / count, abs=2e-3)
    assert of_area(mesh, sides, None) == pytest.approx(2 * 400.0 * 20.0)
    assert of_area(mesh, sides, box) == pytest.approx(2 * 400.0 * 20.0 / count, rel=1e-4)
    assert f"in {count} settings" in one.target.reason
    each = [of_area(mesh, sides, one.strips.box_mm(mesh, k)) for k in range(count)]
    assert sum(each) == pytest.approx(2 * 400.0 * 20.0, rel=1e-4)


def test_a_target_without_a_level_long_axis_or_that_fits_has_no_strip() -> None:
    mesh, body = part_of(Manifold.cube((20.0, 40.0, 400.0)))
    sides = np.abs(body.face_normals[:, 1]) > 0.9
    target = Target({"faces": []}, sides, "sides")
    assert strip(mesh, target, UPRIGHT, 60e-3) is None
    assert strip(mesh, target, (0.0, 45.0, 0.0), 60e-3) is None
    assert strip(mesh, target, (0.0, 90.0, 0.0), 401e-3) is None
    assert strip(mesh, target, (0.0, 90.0, 0.0), 399e-3) is not None


def test_what_no_sonotrode_carries_is_peened_a_strip_at_a_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The edges of a plate of 600 mm: it goes out of a chamber on one sonotrode at both ends."""
    part = tmp_path / "plate.stl"
    trimesh.creation.box((600.0, 110.0, 50.0)).export(part)
    made = propose(part, Wanted("mm", alloy="2024-T351"), lambda _: ["face 2"])
    whole = 2 * 600.0 * 50.0
    assert made.settings > 5
    assert made.sonotrode_count == 1
    assert made.design.holder is not None
    assert made.design.holder.kind == "bore"
    assert not made.jams
    posed = made.chamber.part
    inside = made.chamber.exposed_area[posed.target].sum()
    assert 1e6 * inside * made.settings == pytest.approx(whole, rel=1e-3)
    assert "A STRIP AT A TIME" in made.reasons["part.target"]
    # A plate is alike in all settings; of its ends it goes out of no wall that is closed.
    assert made.strips is not None
    assert unlike_settings(made, made.strips) == ""
    assert not any("direction" in one.keys for one in find_left_out(made))  # of 12 triangles
    texts = _settings_beside(made, tmp_path, [])
    chosen = made.strips.chosen
    assert [*texts] == [f"setting_{k + 1}.toml" for k in range(made.settings) if k != chosen]
    assert texts["setting_1.toml"].startswith(f"# Setting 1 of {made.settings}, beside design.toml")
    for number in (0, made.settings - 1):
        other = in_setting(made, made.strips, number)
        assert validate(Design, nested(other.tables)).part == other.design.part
        chamber = build_chamber(other.design)
        own = chamber.part
        assert 1e6 * chamber.exposed_area[own.target].sum() == pytest.approx(
            whole / made.settings, rel=1e-3
        )
        along = own.vertices[own.triangles[own.target], 0]
        assert along.min() + along.max() == pytest.approx(0.0, abs=1e-4)

    def no_plug(_: object) -> None:
        raise InputError("mask.at: it touches none of these faces inside the room; give others")

    monkeypatch.setattr(proposed_mask, "build_chamber", no_plug)
    said = unlike_settings(made, made.strips)
    assert said.endswith(
        "a chamber of their own: the wall crosses other holes of the part, which need plugs"
    )


def test_a_setting_whose_strip_hangs_otherwise_is_named(tmp_path: Path) -> None:
    """Of a plate with a foot under its end, the last setting needs another distance."""
    plate = Manifold.cube((600.0, 110.0, 50.0)) + Manifold.cube((40.0, 110.0, 90.0)).translate(
        (0.0, 0.0, -40.0)
    )
    part = tmp_path / "plate.stl"
    part_of(plate)[1].export(part)

    def of_plate(known: Sequence[Surface]) -> list[str]:
        return [min(known, key=lambda one: abs(one.keys["faces"][0]["at_mm"][1])).name]

    made = propose(part, Wanted("mm", alloy="2024-T351"), of_plate)
    assert made.strips is not None
    said = unlike_settings(made, made.strips)
    assert said.startswith(f"SETTINGS 1 of {made.settings} need")


@pytest.mark.long
def test_a_crank_pin_gets_a_chamber_between_its_webs(tmp_path: Path) -> None:
    """The webs are 36 mm apart, from fillet to fillet."""
    made = propose(EIGHT_PARTS["crank_pin"].write(tmp_path), Wanted(), lambda _: [])
    lengths = [made.tables["chamber"][key] for key in ("length_mm", "width_mm")]
    assert 36.4 <= min(lengths) < 36.9
    assert "the part itself is the wall" in made.reasons["chamber.length_mm"]
    assert "a plate that fits between the faces" in made.reasons["chamber.height_mm"]
    assert made.design.holder is not None
    assert (made.design.holder.kind, made.design.holder.clearance_mm) == ("bore", 0.2)
    assert not made.jams
    # The pin runs in a bearing: a sleeve covers all of its 30 mm but one and a half ball each end.
    sleeve, margin = made.chamber.fixtures["mask"], made.tables["mask"]["margin_mm"]
    assert (sleeve.kind, margin) == ("shell", 0.5 * math.ceil(3.0 * made.design.shot.diameter_mm))
    around = 1e6 * made.chamber.part.area[rows_of(made.design, {"surface": ["PIN"]})].sum() / 30.0
    assert 1e6 * sleeve.covered == pytest.approx((30.0 - 2.0 * margin) * around, rel=1e-3)
    assert sleeve.covered_target == 0.0
    assert "a sleeve on PIN" in made.reasons["mask.margin_mm"]
    assert "MANY BALLS" not in made.reasons["shot.diameter_mm"]  # 949, and 3,445 under all of it


@pytest.mark.parametrize(("deep", "is_held"), [(12.0, True), (9.0, False)])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_root_goes_out_of_a_room_round_all_the_rest(
    deep: float, is_held: bool, way: float
) -> None:
    """A blade along x on a root of so many mm, peened where they meet."""
    blade = Manifold.cube((60, 3, 15)).translate([-60, -1.5, -7.5])
    body = blade + Manifold.cube((deep, 25, 30)).translate([0, -12.5, -15])
    mesh, drawn = part_of(body if way > 0.0 else body.mirror((1, 0, 0)))
    places = way * drawn.triangles_center[:, 0]
    target = Target({}, np.abs(places) < 1e-6, "")
    end = root_out(mesh, target, UPRIGHT, 2e-3)
    assert (end is not None) == is_held
    if end is not None:
        assert end.goes_out
        assert end.axis.tolist() == [way, 0.0, 0.0]
        inside = np.array(end.room_mm)[:, 0]
        assert sorted(way * inside) == pytest.approx([-61.0, 0.0])
    standing = (0.0, 90.0, 0.0)
    assert root_out(mesh, target, standing, 2e-3) is None

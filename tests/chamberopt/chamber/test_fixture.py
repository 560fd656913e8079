"""A holder and a mask take their volume out of the cavity, and nothing of the target."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from shapely import Polygon

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.checks.check import first_warnings, surface_names, warnings
from chamberopt.chamber.checks.gaps import find_ledges, resting_on_holder
from chamberopt.chamber.checks.warning import WarningKind
from chamberopt.chamber.fixture import size_in_words
from chamberopt.chamber.part import turning_axis
from chamberopt.chamber.scene import build_scene, chamber_mesh, part_rotation, require_turnable
from chamberopt.common.errors import InputError
from chamberopt.design.design import Design, validate
from chamberopt.design.fixture import TIGHT_GAP, WIDEST_GAP, opening_cut
from chamberopt.design.load import load_design
from chamberopt.design.shapes import TAG_PART, TAG_WALL
from chamberopt.geometry.triangles import area_vectors, areas

DESIGNS = Path(__file__).resolve().parents[3] / "designs"
BOX, ROOM = (20.0, 12.0, 8.0), (60.0, 50.0, 40.0)  # mm
DISTANCE = 15.0
ABOVE = ROOM[2] - DISTANCE - BOX[2]  # between box and ceiling
RADIUS, LONG = 6.0, 60.0  # of a shaft through the ceiling
DOWN = {"direction": (0, 0, -1), "angle_deg": (0, 30)}
UP = {"direction": (0, 0, 1), "angle_deg": (0, 30)}
NOT_DOWN = {"direction": (0, 0, 1), "angle_deg": (0, 100)}
ROUND = {"direction": (0, 0, 1), "angle_deg": (80, 100)}
SUNK = 1e-3  # mm: depth of a holder's end in the part


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("parts")
    trimesh.creation.box(BOX).export(folder / "box.stl")
    trimesh.creation.cylinder(RADIUS, LONG, sections=64).export(folder / "shaft.stl")
    holes = [trimesh.creation.cylinder(2.0, 20.0, sections=64) for _ in range(2)]
    holes[0].apply_translation((-5.0, 0.0, 0.0))
    holes[1].apply_translation((5.0, 0.0, 10.0))  # blind: it ends in the middle of the box
    drilled = trimesh.boolean.difference([trimesh.creation.box(BOX), *holes], engine="manifold")
    drilled.export(folder / "drilled.stl")
    return folder


def design(parts: Path, mesh: str = "box", **tables: Any) -> Design:
    """A box or a shaft over the sonotrode in a room of 60 x 50 x 40 mm; its underside is peened."""
    data = load_design(DESIGNS / "gear.toml").model_dump()
    part = {"mesh": str(parts / f"{mesh}.stl"), "unit": "mm", "target": DOWN, "smoothing": "off"}
    sizes = dict(zip(("length_mm", "width_mm", "height_mm"), ROOM, strict=True))
    chamber = {"shape": "box", **sizes, "sonotrode_distance_mm": DISTANCE}
    part.update(tables.pop("part", {}))
    chamber.update(tables.pop("chamber", {}))
    return validate(Design, {**data, "part": part, "chamber": chamber, **tables})


def polygon(diameter: float) -> float:
    """Area of the 64-sided polygon in a circle."""
    return 32 * (diameter / 2) ** 2 * np.sin(2 * np.pi / 64)


def sound(chamber: Chamber) -> None:
    """Closed, of the volume that it says; triangles of the part lie on the part's triangles."""
    mesh = trimesh.Trimesh(chamber.vertices, chamber.triangles, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert chamber.volume == pytest.approx(mesh.volume, rel=1e-9)
    own = chamber.tags == TAG_PART
    assert ((chamber.source >= 0) == own).all()
    part, pieces = chamber.part, chamber.vertices[chamber.triangles[own]]
    sources = part.vertices[part.triangles[chamber.source[own]]]
    normal = np.cross(sources[:, 1] - sources[:, 0], sources[:, 2] - sources[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    assert np.abs(np.einsum("tki,ti->tk", pieces - sources[:, :1], normal)).max() < 2e-9
    for one in chamber.fixtures:
        assert (chamber.tags[chamber.on_fixture(one)] == TAG_WALL).all()


def taken(chamber: Chamber, mesh: str) -> float:
    """Volume [mm³] that the room lacks, beside that of the part."""
    of_part = np.prod(BOX) if mesh == "box" else polygon(2 * RADIUS) * (ROOM[2] - DISTANCE)
    return np.prod(ROOM) - of_part - 1e9 * chamber.volume


PLATE, FACE = 20 * 12, 25 * 15  # mm²: a plate on the box, and one a quarter larger round it
CASES: dict[str, tuple[str, dict[str, Any], float, float]] = {
    # part, tables, volume taken [mm³], area of the part covered [mm²]
    "rod": ("box", {"holder": {"kind": "rod"}}, polygon(9.6) * ABOVE, polygon(9.6)),
    "thin rod": (
        "box",
        {"holder": {"kind": "rod", "at": UP, "diameter_mm": 6.0}},
        polygon(6) * ABOVE,
        polygon(6),
    ),
    "plate": ("box", {"holder": {"kind": "plate"}}, PLATE * ABOVE, PLATE),
    "plate on a rod": (
        "box",
        {"holder": {"kind": "plate", "size_mm": (30.0, 20.0), "thickness_mm": 5.0}},
        600 * 5 + polygon(16) * (ABOVE - 5),
        PLATE,
    ),
    "block round a root": (
        "box",
        {"holder": {"kind": "plate", "grip_mm": 3.0}},
        FACE * ABOVE + 3 * (FACE - PLATE),
        PLATE + 3 * 64,
    ),
    "collar in the air": (
        "box",
        {"holder": {"kind": "collar", "grip_mm": 3.0, "diameter_mm": 30.0}},
        polygon(30) * (ABOVE + 3) - 3 * PLATE,
        PLATE + 3 * 64,
    ),
    "collar of a shaft": (
        "shaft",
        {"holder": {"kind": "collar", "at": ROUND, "grip_mm": 4.0}},
        4 * (polygon(15) - polygon(12)),
        4 * 64 * 12 * np.sin(np.pi / 64),
    ),
    "bore": ("shaft", {"holder": {"kind": "bore", "clearance_mm": 0.1}}, 0.0, 0.0),
    "mask of a face": ("box", {"mask": {"at": UP, "thickness_mm": 2.0}}, 2 * PLATE, PLATE),
    "mask like a cap": (
        "box",
        {"mask": {"at": NOT_DOWN}},
        22 * 14 * 9 - np.prod(BOX),
        PLATE + 8 * 64,
    ),
    "mask that keeps a margin": (
        "box",
        {"mask": {"at": ROUND, "thickness_mm": 1.0, "margin_mm": 3.0}},
        (22 * 14 - 20 * 12) * (8 - 3),
        64 * (8 - 3),
    ),
    "mask of a shaft with a margin": (
        "shaft",
        {"mask": {"at": ROUND, "thickness_mm": 2.0, "margin_mm": 4.0}},
        21 * 64 * np.tan(np.pi / 64) * ((RADIUS * np.cos(np.pi / 64) + 2) ** 2) - 21 * polygon(12),
        21 * 64 * 12 * np.sin(np.pi / 64),
    ),
    "mask up to the wall": (
        "box",
        {"mask": {"at": UP, "axis": (0.0, 0.0, 1.0)}},
        PLATE * ABOVE,
        PLATE,
    ),
    "mask of a shaft": (
        "shaft",
        {"mask": {"at": ROUND, "thickness_mm": 2.0}},
        # the flat sides move out by 2 mm: the apothem of the polygon grows by that
        25 * 64 * np.tan(np.pi / 64) * ((RADIUS * np.cos(np.pi / 64) + 2) ** 2) - 25 * polygon(12),
        25 * 64 * 12 * np.sin(np.pi / 64),
    ),
    "both": (
        "box",
        {"holder": {"kind": "rod"}, "mask": {"at": UP, "thickness_mm": 2.0}},
        polygon(9.6) * (ABOVE - 2) + 2 * PLATE,
        PLATE,
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_volumes_and_areas_are_those_of_closed_forms(parts: Path, case: str) -> None:
    mesh, tables, volume, covered = CASES[case]

    chamber = build_chamber(design(parts, mesh, **tables))

    sound(chamber)
    rel = 1e-3 if "margin" in case else 0.0  # edges are not divided close to their ends
    assert taken(chamber, mesh) == pytest.approx(volume, abs=SUNK * 500.0, rel=rel)
    covered_mm2 = 1e6 * sum(one.covered for one in chamber.fixtures.values())
    assert covered_mm2 == pytest.approx(covered, abs=SUNK * 70.0, rel=rel)
    part, target = chamber.part, chamber.part.target
    # Nothing of the target is covered: its triangles in the cavity have all of its area.
    assert chamber.exposed_area[target] == pytest.approx(part.area[target], rel=1e-9)
    own = areas(chamber.vertices, chamber.triangles)
    assert own[chamber.on_target].sum() == pytest.approx(part.area[target].sum(), rel=1e-9)
    assert all(one.covered_target == 0.0 for one in chamber.fixtures.values())
    is_held = "holder" in tables or mesh == "shaft" or case == "mask up to the wall"
    assert chamber.pieces_in_air == (0 if is_held else 1)
    assert any("without a holder" in note for note in chamber.notes) != is_held
    for one in chamber.fixtures.values():
        body = trimesh.Trimesh(one.vertices, one.triangles, process=False)
        assert body.is_watertight
    bodies = sum(
        trimesh.Trimesh(1e3 * one.vertices, one.triangles).volume
        for one in chamber.fixtures.values()
    )
    assert bodies == pytest.approx(taken(chamber, mesh), abs=1e-3)


def test_a_tilted_part_with_rod_and_mask_is_closed(parts: Path) -> None:
    """Faces that touch off the grid leave no gap, and no slivers."""
    tables = {
        "part": {"rotate_deg": (34.0, 20.0, 10.0)},
        "holder": {"kind": "rod", "at": UP, "axis": (0.3, -0.2, 1.0)},
        "mask": {"at": {"direction": (1, 0, 0), "angle_deg": (0, 10)}},
    }

    chamber = build_chamber(design(parts, **tables))

    sound(chamber)
    assert chamber.pieces_in_air == 0
    assert not any("rounding" in note or "cuts off" in note for note in chamber.notes)
    assert 1e6 * chamber.fixtures["mask"].covered == pytest.approx(12 * 8, rel=1e-4)
    body = chamber.fixtures["mask"]
    volume = trimesh.Trimesh(1e3 * body.vertices, body.triangles).volume
    assert volume == pytest.approx(12 * 8 * 1, rel=1e-4)


def test_a_rod_up_to_a_domes_tip_closes_nothing(parts: Path) -> None:
    profile = {"shape": "revolve", "profile_mm": [[30, 0], [30, 30], [0, 50]]}
    tables = design(parts, holder={"kind": "rod", "diameter_mm": 6}).model_dump()
    tables["chamber"] = {**profile, "sonotrode_distance_mm": DISTANCE}

    chamber = build_chamber(validate(Design, tables))

    sound(chamber)
    assert not any("closes the chamber" in note for note in chamber.notes)


def test_a_holder_that_leans_from_the_turning_axis_is_told_the_angle(parts: Path) -> None:
    turn = {"axis": (0, 0, 1), "through_mm": (0, 0, 0), "rpm": 60}
    side = {"direction": (1, 0, 0), "angle_deg": (0, 10)}
    effects = {**design(parts).model_dump()["effects"], "part_turn": turn}
    tables = {"holder": {"kind": "rod", "at": side, "axis": (1, 0, 0)}, "effects": effects}
    with pytest.raises(InputError, match=r"leans by 90° from that of effects\.part_turn"):
        build_chamber(design(parts, **tables))


def test_a_plate_lies_as_its_face_does(parts: Path) -> None:
    """The plate of a part that is turned by 30 degrees about z is turned with it."""
    chamber = build_chamber(
        design(parts, part={"rotate_deg": (0.0, 0.0, 30.0)}, holder={"kind": "plate"})
    )

    sound(chamber)
    assert 1e3 * np.array(chamber.fixtures["holder"].size) == pytest.approx([20, 12])
    assert taken(chamber, "box") == pytest.approx(PLATE * ABOVE, rel=1e-5)


@pytest.mark.parametrize("facing", [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0)])
def test_a_rod_may_come_from_a_side_wall(parts: Path, facing: tuple[float, ...]) -> None:
    at = {"direction": facing, "angle_deg": (0, 10)}
    chamber = build_chamber(design(parts, holder={"kind": "rod", "at": at, "axis": facing}))

    sound(chamber)
    along = int(np.abs(facing).argmax())
    way = 0.5 * (ROOM[along] - BOX[along])
    assert taken(chamber, "box") == pytest.approx(polygon(0.8 * 8) * way, rel=1e-5)
    assert 1e3 * chamber.fixtures["holder"].length == pytest.approx(way)


@pytest.mark.parametrize(
    ("mesh", "tables", "message"),
    [
        ("box", {"holder": {"kind": "rod"}, "part": {"target": UP}},
         r"holder\.at: the holder covers 72\.3 mm² of the target, most on triangle \d+ near"),
        ("box", {"holder": {"kind": "rod", "at": DOWN}}, r"holder\.at: .* do not look along"),
        ("box", {"holder": {"kind": "rod", "at": DOWN, "axis": (0.0, 0.0, -1.0)},
                 "part": {"target": UP}}, r"holder: the face of \[sonotrode\] would hit it"),
        ("box", {"holder": {"kind": "rod", "at": {"box_mm": ((90, 0, 0), (91, 1, 1))}}},
         r"holder\.at: chooses none of the 12 triangles"),
        ("box", {"holder": {"kind": "bore"}}, r"holder\.kind: given \"bore\", but .* no wall"),
        ("shaft", {"holder": {"kind": "rod"}}, r"holder\.axis: from \(0, 0, 75\) mm in .* no wall"),
        ("box", {"holder": {"kind": "collar"}}, r"holder\.grip_mm: missing: .* level"),
        ("box", {"holder": {"kind": "rod", "grip_mm": 3.0}}, r'holder\.grip_mm: not of kind "rod"'),
        ("box", {"holder": {"kind": "plate", "size_mm": (0.0, 5.0)}}, r"holder\.size_mm: given"),
        ("box", {"holder": {"kind": "plate", "diameter_mm": 5.0}}, r"diameter_mm: .* give both"),
        ("box", {"holder": {"kind": "plate", "thickness_mm": 300.0}},
         r"holder\.thickness_mm: given 300, but the wall is"),
        ("box", {"holder": {"kind": "rod", "at": {}}}, r"at: given without a key: this is"),
        ("box", {"holder": {"kind": "rod", "axis": (0.0, 0.0, 0.0)}}, r"axis: given \[0, 0, 0\]"),
        ("shaft", {"holder": {"kind": "bore", "clearance_mm": 0.4}},
         r"clearance_mm: given 0\.4; allowed: at most 0\.375 for balls of 1\.5 mm"),
        ("box", {"mask": {}}, r"mask\.at: missing"),
        ("box", {"mask": {"at": {"surface": ("all",)}}},
         r"mask\.at: the mask covers all of the target"),
        ("box", {"mask": {"at": NOT_DOWN, "axis": (0.0, 0.0, -1.0)}}, r"mask\.axis: given .* none"),
        ("box", {"mask": {"at": UP, "axis": (0.0, 0.0, 1.0), "thickness_mm": 1.0}},
         r"mask\.thickness_mm: given beside axis"),
        ("box", {"mask": {"at": UP, "axis": (0.0, 0.0, 1.0), "margin_mm": 1.0}},
         r"mask\.margin_mm: given beside axis"),
        ("box", {"mask": {"at": ROUND, "margin_mm": 9.0}},
         r"mask\.margin_mm: all faces of mask\.at are nearer than 9 mm"),
        ("box", {"mask": {"at": UP}, "effects": {"part_turn": {"rpm": 30.0}}},
         r"mask: given for a part that turns"),
        ("box", {"holder": {"kind": "plate"}, "effects": {"part_turn": {"rpm": 30.0}}},
         r"holder\.kind: given \"plate\" for a part that turns"),
        ("shaft", {"holder": {"kind": "collar", "at": ROUND, "grip_mm": 4.0},
                   "effects": {"part_turn": {"rpm": 30.0, "through_mm": (1.0, 0.0, 0.0)}}},
         r"holder: its axis is 1 mm beside that of effects\.part_turn"),
    ],
)  # fmt: skip
def test_what_cannot_be_held_or_masked_is_refused(
    parts: Path, mesh: str, tables: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        build_chamber(design(parts, mesh, **tables))


def test_plugs_fill_holes_to_their_rims(parts: Path) -> None:
    """The room is that round the box without its holes, through or blind; bottoms stay covered."""
    wall = {"box_mm": [[-8, -3, -4.1], [8, 3, 4.1]], "direction": (0, 0, 1), "angle_deg": (80, 100)}
    made = build_chamber(design(parts, "drilled", mask={"at": wall, "plugs": True}))
    sound(made)
    assert 1e9 * made.volume == pytest.approx(np.prod(ROOM) - np.prod(BOX), abs=0.1)
    mask = made.fixtures["mask"]
    assert mask.kind == "plugs"
    assert 1e6 * mask.covered == pytest.approx(12 * 64 * 4 * np.sin(np.pi / 64) + polygon(4), 1e-3)
    sides = {"direction": (0, 0, 1), "angle_deg": (80, 100)}
    with pytest.raises(InputError, match=r"mask.plugs: the faces of mask.at near .* no walls of a"):
        build_chamber(design(parts, "drilled", mask={"at": sides, "plugs": True}))
    with pytest.raises(InputError, match="given beside plugs"):
        design(parts, "drilled", mask={"at": wall, "plugs": True, "thickness_mm": 1.0})


def test_a_shell_that_crosses_itself_is_refused(parts: Path) -> None:
    """The walls of a groove of 4 mm meet under shells of 3 mm each."""
    groove = trimesh.boolean.difference(
        [trimesh.creation.box((20, 12, 8)), trimesh.creation.box((4, 20, 6), translate(0, 0, 4))]
    )
    groove.export(parts / "groove.stl")
    inside = {"box_mm": ((-2.1, -7, 0), (2.1, 7, 4.1)), **NOT_DOWN}
    with pytest.raises(InputError, match=r"mask\.thickness_mm: a shell of 3 mm crosses itself"):
        build_chamber(design(parts, "groove", mask={"at": inside, "thickness_mm": 3.0}))
    chamber = build_chamber(design(parts, "groove", mask={"at": inside, "thickness_mm": 1.0}))
    sound(chamber)


def translate(x: float, y: float, z: float) -> np.ndarray:
    return trimesh.transformations.translation_matrix((x, y, z))


def test_balls_hardly_sink_into_a_tight_gap_and_wedge_in_no_allowed_one() -> None:
    """On the edges of a gap a ball is 0.01 of its radius deep, or at 30 degrees from its middle."""
    radius = 0.5
    for gap, depth in ((TIGHT_GAP, 0.01 * radius), (WIDEST_GAP, 0.067)):
        sunk = radius - np.sqrt(radius**2 - 0.25 * gap**2)
        assert sunk == pytest.approx(depth, abs=5e-5)
    assert np.degrees(np.arcsin(WIDEST_GAP)) == pytest.approx(30.0)


def test_an_opening_has_a_tolerance_in_which_no_ball_wedges_and_the_part_goes_in() -> None:
    """All the play on one side is at most half a ball, and a sharp corner is free of a round."""
    for clear, ball, told in (
        (0.15, 1.2, "+0.1/0"),
        (0.1, 0.5, "+0.05/−0.05"),
        (0.1, 0.4, "+0/−0.1"),
        (0.2, 3.0, "+0.1/0"),
    ):
        cut = opening_cut(clear, ball)
        assert cut.limits_in_words == told
        assert 2.0 * clear + cut.most_mm <= 0.5 * ball + 1e-9
        assert 2.0 * clear + cut.least_mm > 0.0
        r = cut.corner_mm
        assert r - (r - clear) * math.sqrt(2.0) > 0.5 * clear
    assert opening_cut(0.0, 1.2).limits_in_words == ""


def test_a_round_holder_on_the_axis_turns_with_the_part(parts: Path) -> None:
    turning = design(
        parts,
        "shaft",
        holder={"kind": "collar", "at": ROUND, "grip_mm": 4.0},
        effects={"part_turn": {"rpm": 30.0}},
    )
    chamber = build_chamber(turning)

    require_turnable(turning, chamber_mesh(chamber), turning_axis(turning, chamber.part))


THROUGH = {"box_mm": ((-7.1, -2.1, -3.9), (-2.9, 2.1, 3.9))}  # the walls of the box's hole
END = {"box_mm": ((9.9, -7.0, -5.0), (11.0, 7.0, 5.0))}
FLANGES = {"diameter_mm": 5.0, "thickness_mm": 2.0}


def around(diameter: float) -> float:
    """Area of the 64-sided polygon round a circle [mm²]."""
    return 64 * (diameter / 2) ** 2 * np.tan(np.pi / 64)


@pytest.mark.parametrize(
    ("turns", "axis", "both", "outside", "flanges"),
    [
        ((0, 0, 0), (0, 0, 1), False, ABOVE, 1),
        ((90, 0, 0), (0, 1, 0), False, 0.5 * (ROOM[1] - BOX[2]), 1),
        ((90, 0, 0), (0, -1, 0), True, ROOM[1] - BOX[2], 2),
    ],
)
# The rims of cups go into the part here, whose ends are flat.
@pytest.mark.parametrize("given", [{}, FLANGES, {**FLANGES, "grip_mm": 1.5}])
def test_an_arbor_fills_its_hole_and_goes_out(
    parts: Path,
    turns: tuple[float, ...],
    axis: tuple[float, ...],
    both: bool,
    outside: float,
    flanges: int,
    given: dict[str, float],
) -> None:
    """The room with an arbor lacks the hole, the shaft from the part to the wall, and flanges.

    The hole and the shaft that fills it are 64-sided polygons in and round a circle of 4 mm. A
    shaft without flanges is within the sides of the hole outside of it.
    """
    holder = {"kind": "arbor", "at": THROUGH, "axis": axis, "both_sides": both, **given}
    where = {"rotate_deg": turns, "target": END}
    free = build_chamber(design(parts, "drilled", part=where))
    chamber = build_chamber(design(parts, "drilled", part=where, holder=holder))

    sound(chamber)
    assert chamber.pieces_in_air == 0
    shaft = around(4.0 + 2 * SUNK) if given else polygon(4.0 * np.cos(np.pi / 64))
    wide = polygon(5.0) - shaft if given else 0.0
    expected = 8 * polygon(4.0) + outside * shaft + 2 * flanges * wide
    assert 1e9 * (free.volume - chamber.volume) == pytest.approx(expected, rel=2e-3)
    one = chamber.fixtures["holder"]
    assert one.size == pytest.approx((4.002e-3,), rel=1e-6)
    assert 1e3 * one.length == pytest.approx(8 + outside, abs=2 * SUNK)


def test_an_arbor_without_flanges_covers_nothing_beside_its_hole(parts: Path) -> None:
    """The target is the top of the box, and begins at the rim of its hole, which has 12 sides."""
    drill = trimesh.creation.cylinder(2.0, 20.0, sections=12)
    drill.apply_translation((-5.0, 0.0, 0.0))
    body = trimesh.boolean.difference([trimesh.creation.box(BOX), drill], engine="manifold")
    body.export(parts / "coarse.stl")
    top = {"direction": (0, 0, 1), "angle_deg": (0, 10)}
    holder = {"kind": "arbor", "at": THROUGH, "axis": (0, 0, 1)}
    chamber = build_chamber(design(parts, "coarse", part={"target": top}, holder=holder))
    assert chamber.fixtures["holder"].covered_target == 0.0


def test_an_arbor_turns_with_the_part_about_its_own_axis(parts: Path) -> None:
    holder = {"kind": "arbor", "at": THROUGH, "axis": (0, 1, 0), "both_sides": True}
    for through, why in ((-5.0, None), (0.0, r"holder: its axis is 5 mm beside that of effects")):
        given = design(
            parts,
            "drilled",
            part={"rotate_deg": (90, 0, 0), "target": END},
            holder=holder,
            effects={"part_turn": {"rpm": 30.0, "through_mm": (through, 0, 0)}},
        )
        if why:
            with pytest.raises(InputError, match=why):
                build_chamber(given)
            continue
        chamber = build_chamber(given)
        mesh, axis = chamber_mesh(chamber), turning_axis(given, chamber.part)
        require_turnable(given, mesh, axis)
        turn = part_rotation(given, axis)
        assert turn is not None
        (tag,) = turn.with_part
        assert (mesh.tags == tag).tolist() == chamber.on_fixture("holder").tolist()
        assert (chamber.tags[mesh.tags == tag] == TAG_WALL).all()  # it is of the wall's metal
        laws = build_scene(given, mesh, 1, axis).physics.restitution
        assert laws is not None
        assert laws.surfaces[tag] == laws.surfaces[TAG_WALL]


@pytest.mark.parametrize(
    ("holder", "message"),
    [
        ({"at": UP}, r"holder\.at: these faces are no walls of a hole along holder\.axis"),
        ({"at": ROUND}, r"holder\.at: these faces are no walls of a hole"),
        ({"at": THROUGH, "axis": (1, 0, 0)}, r"holder\.at: these faces are no walls of a hole"),
        ({"at": THROUGH, "axis": (0, 0, -1)}, r"holder: the face of \[sonotrode\] would hit it"),
        ({}, r"holder\.at: missing: an arbor needs to know its hole"),
        ({"at": THROUGH, "diameter_mm": 6.0}, r"holder\.diameter_mm: given alone: the flanges"),
        ({"at": THROUGH, "grip_mm": 6.0}, r"holder\.grip_mm: given without flanges"),
    ],
)
def test_an_arbor_needs_a_hole(parts: Path, holder: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        build_chamber(
            design(parts, "drilled", part={"target": END}, holder={"kind": "arbor", **holder})
        )


def test_checks_name_holder_and_mask(parts: Path) -> None:
    """A plate below the ceiling has a ledge; the mask of some of the target is a warning."""
    plate = {"kind": "plate", "size_mm": (30.0, 20.0), "thickness_mm": 5.0}
    whole = {"direction": (0, 0, -1), "angle_deg": (0, 100)}  # underside and sides
    side = {"direction": (1, 0, 0), "angle_deg": (0, 10)}
    given = design(parts, holder=plate, mask={"at": side}, part={"target": whole})
    chamber = build_chamber(given)

    names = surface_names(chamber)
    assert {"the holder", "the mask", "the ceiling", "the wall"} <= set(names)
    up = -area_vectors(chamber.vertices, chamber.triangles)[:, 2] > 0.0
    assert up[names == "the holder"].any()
    ledges = [one.message for one in find_ledges(given, chamber)]
    assert any("on the holder" in text and "holder.thickness_mm" in text for text in ledges)
    level = 30.0 * 20.0 - np.pi * 8.0**2  # mm², beside the rod of 0.8 x 20 mm that carries it
    count = level / (1e3 * given.shot.diameter) ** 2
    assert resting_on_holder(given, chamber) == pytest.approx(count, rel=0.01, abs=1.0)
    assert resting_on_holder(given.changed({"effects.gravity": False}), chamber) == 0
    (mask,) = (
        one
        for one in first_warnings(given, chamber, chamber_mesh(chamber))
        if one.kind is WarningKind.MASK
    )
    share = 12 * 8 / (PLATE + 8 * 64)
    assert f"the mask covers {share:.1%} of the target (96 mm²)" in mask.text
    assert not any(one.kind is WarningKind.SIDE_WALL for one in warnings(given, chamber))


@pytest.mark.parametrize(
    ("name", "holder"),
    [
        ("blade_conformal", {"kind": "bore"}),
        ("gear", {"kind": "collar", "at": {"radius_mm": (7, 9)}, "grip_mm": 3.0}),
        ("plate_imported", {"kind": "rod", "at": {"surface": "PART"}, "axis": (0.0, 0.0, 1.0)}),
    ],
)
def test_holders_in_chambers_of_other_shapes(name: str, holder: dict[str, Any]) -> None:
    """A part drawn as a piece of the wall has no face towards the wall: it is held already."""
    data = load_design(DESIGNS / f"{name}.toml").model_dump()
    data["part"]["smoothing"] = "off"
    held = validate(Design, {**data, "holder": holder})
    if name == "plate_imported":
        with pytest.raises(InputError, match=r"holder\.(at|axis): "):
            build_chamber(held)
        return
    chamber = build_chamber(held)
    sound(chamber)
    assert chamber.pieces_in_air == 0


def test_sizes_in_words() -> None:
    assert size_in_words("rod", [12.0]) == "Ø 12 mm"
    assert size_in_words("plate", [20.0, 12.5]) == "20 × 12.5 mm"
    assert size_in_words("shell", [1.0]) == "1 mm thick"
    assert size_in_words("filled", []) == ""


def test_a_crease_beside_a_mask_is_no_pocket(parts: Path) -> None:
    """A fin leans away from a mask by a degree: a ball sinks into that crease by 0.2 %."""
    outline = [(-10, 0), (10, 0), (10, 4), (2, 4), (1.83, 14), (-2, 14), (-2, 4), (-10, 4)]
    fin = trimesh.creation.extrude_polygon(Polygon(outline), 12.0)
    fin.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (1, 0, 0)))
    fin.export(parts / "fin.stl")
    at = {"faces": [{"at_mm": (6.0, -6.0, 4.0)}]}
    chamber = build_chamber(design(parts, "fin", mask={"at": at, "thickness_mm": 2.0}))
    assert chamber.fixtures["mask"].covered > 0.0
    found = warnings(design(parts, "fin"), chamber)
    assert not [one for one in found if one.kind is WarningKind.POCKET]

"""What `chamberopt new` proposes: a charge and ranges that a study takes, the target, the text."""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from manifold3d import CrossSection, Manifold
from shapely import Polygon

from chamberopt.chamber.checks.warning import WarningKind
from chamberopt.chamber.layout.pose import pose_in_words
from chamberopt.chamber.layout.shot_material import choose_shot, choose_walls, iron_of_walls
from chamberopt.chamber.layout.target import Surface, propose_target, surfaces
from chamberopt.chamber.propose import proposed_room
from chamberopt.chamber.propose.first_design import propose
from chamberopt.chamber.propose.held_proposal import is_firm
from chamberopt.chamber.propose.proposal import Wanted, touched_share
from chamberopt.chamber.propose.proposed_steps import turned_over
from chamberopt.chamber.propose.text import design_text
from chamberopt.chamber.shop import StockBalls, usual_shop
from chamberopt.common.errors import InputError
from chamberopt.geometry.meshes.part_mesh import PartMesh, read_part
from chamberopt.geometry.meshes.raw_mesh import number_by_position
from chamberopt.geometry.triangles import area_vectors


def test_the_inside_of_a_tube_is_no_back_of_its_outside(tmp_path: Path) -> None:
    """Its faces are as large to a tenth, as are those of a plate, of which both are the target."""
    trimesh.creation.annulus(29.0, 30.0, 100.0, sections=64).export(tmp_path / "tube.stl")
    trimesh.creation.box((40, 30, 5)).subdivide().export(tmp_path / "plate.stl")
    for name, radius in (("tube", 29.9e-3), ("plate", 0.0)):
        mesh = read_part(tmp_path / f"{name}.stl", "mm")
        target = propose_target(mesh, surfaces(mesh), [])
        middle = mesh.vertices[mesh.triangles[target.triangles]].mean(axis=1)
        assert np.hypot(*middle[:, :2].T).min() > radius - 1e-4
    assert {-1.0, 1.0} == {*np.sign(middle[:, 2])}


FEW_BALLS = {"": SimpleNamespace(shot=SimpleNamespace(count=100, diameter=1e-3))}


def bosses(ring: bool, wide_mm: float = 6.0) -> PartMesh:
    """A block of 100 x 100 x 10 mm with twelve bosses on it, in a ring or in two rows."""
    turns = 2.0 * np.pi / 12.0 * np.arange(12)
    places = 35.0 * np.c_[np.cos(turns), np.sin(turns)]
    if not ring:
        places = np.array([(16.0 * k - 40.0, y) for y in (-15.0, 15.0) for k in range(6)])
    block = trimesh.creation.box((100, 100, 10))
    for x, y in places:
        one = trimesh.creation.cylinder(0.5 * wide_mm, 12.0, sections=36)
        block = trimesh.boolean.union([block, one.apply_translation((x, y, 10.0))])
    triangles = block.faces.astype(np.int32)
    numbering = number_by_position(len(triangles))
    return PartMesh(1e-3 * block.vertices, triangles, numbering, (), "", {})


@pytest.mark.parametrize(("ring", "wide_mm", "said"), [
    (True, 10.0, "faces that repeat round the part, such as those of teeth"),
    (False, 10.0, "the largest between sharp edges"),  # they stand round no axis
    (True, 2.0, "the largest between sharp edges"),  # too small a share of the part
])  # fmt: skip
def test_what_repeats_is_a_target_if_it_is_a_large_ring(
    ring: bool, wide_mm: float, said: str
) -> None:
    mesh = bosses(ring, wide_mm)
    reason = propose_target(mesh, surfaces(mesh), []).reason
    assert said in reason
    assert "; TARGET CHOSEN BY S" in reason


def box_with(names: dict[str, int | tuple[int, ...]]) -> PartMesh:
    """A box of 20 x 20 x 30 mm whose sides 0 to 5 have names: -x, +x, -y, +y, -z, +z."""
    box = trimesh.creation.box((0.02, 0.02, 0.03))
    side = 2 * np.abs(box.face_normals).argmax(axis=1) + (box.face_normals.sum(axis=1) > 0)
    groups = {name: np.isin(side, sides) for name, sides in names.items()}
    triangles = box.faces.astype(np.int32)
    return PartMesh(box.vertices, triangles, number_by_position(12), (), "", groups)


ALL = (0, 1, 2, 3, 4, 5)


@pytest.mark.parametrize(
    ("names", "wanted", "target"),
    [
        ({"Flank": 0, "FLANK": 1, "flank": 4}, ["flank"], ["flank"]),
        ({"Flank": 0, "FLANK": 1, "flank": 4}, ["Flank"], ["Flank"]),
        ({"Flank": 0}, ["FLANK"], ["Flank"]),
        ({}, ["ALL", "face 1"], ["all"]),
        ({"A": 0}, ["A", "a"], ["A"]),
        ({"Face 1": 4}, ["face 1"], ["Face 1"]),
        # A colour marks a face that has a name too; of several the reddest, not that of a body.
        ({"SLOT": 4, "SIDE": 0, "#ff0000": 4, "#008000": 5, "#9999a6": (0, 1)}, [], ["SLOT"]),
        ({"SIDE": 0, "#ff2010": ALL}, [], ["SIDE"]),
        ({"PEEN_ME": 4, "SIDE": 0, "#ff0000": 0}, [], ["PEEN_ME"]),
        ({"UNPEENED": 0, "FREE": 4}, [], ["FREE"]),
        ({"Created by Gmsh": (0, 1, 2, 3), "FREE": 4}, [], ["FREE"]),
        ({"do not peen": 0, "NOT_TO_PEEN": 1, "no target": 2, "mask": 3, "FREE": 4}, [], ["FREE"]),
        ({"nicht zu strahlen": 0, "ungestrahlt": 1, "Strahlen": 4}, [], ["Strahlen"]),
        ({"No. 5 target": 4, "SIDE": 0}, [], ["No. 5 target"]),
        # What is usually peened; a root is of a gear more than of a blade.
        ({"WEBS": (0, 1), "PIN": 2, "FILLETS": 4}, [], ["FILLETS"]),
        ({"BASE": (0, 1), "WEB": 2, "WELD": 4, "ENDS": 5}, [], ["WELD"]),
        (
            {"ROOT": (0, 1), "SUCTION_SIDE": 2, "Pressure side": 4},
            [],
            ["SUCTION_SIDE", "Pressure side"],
        ),
        ({"BORES": (0, 1), "BIG_END": (2, 3), "RODS": 4}, [], ["RODS"]),
        # The largest named surface, unless it is the whole part or says that it is the rest.
        ({"COILS": (0, 1, 2, 3), "LEGS": 4, "ENDS": 5}, [], ["COILS"]),
        ({"BODY_1": (0, 1, 2, 3), "LEGS": 4, "PART": ALL}, [], ["LEGS"]),
    ],
)
def test_the_target_is_what_is_named_or_marked(
    names: dict[str, int | tuple[int, ...]], wanted: list[str], target: list[str]
) -> None:
    mesh = box_with(names)
    assert propose_target(mesh, surfaces(mesh), wanted).keys == {"surface": target}


def test_a_target_is_named_with_those_that_come_after_it() -> None:
    mesh = box_with({"COILS": (0, 1, 2, 3), "LEGS": 4})
    reason = propose_target(mesh, surfaces(mesh), []).reason
    assert reason == "COILS: by its name, as such are usually peened; after it LEGS (400 mm²)"


@pytest.mark.parametrize(
    ("turns", "words"),
    [
        ((0.0, 0.0, 0.0), "as drawn"),
        ((180.0, 0.0, 0.0), "the file's +z down, face 3 level facing up"),
        (
            (0.0, -90.0, 30.0),
            "the file's -x down, face 4 level facing down, turned by 30 degrees about the vertical",
        ),
        ((45.0, 0.0, 0.0), "face 3 tilted by 45 degrees"),
    ],
)
def test_a_pose_is_said_as_a_fixture_gives_it(
    turns: tuple[float, float, float], words: str
) -> None:
    """A block with a step: face 3 is its bottom, face 4 its end at -x, and others are alike."""
    step = trimesh.creation.extrude_polygon(
        Polygon([(0, 0), (40, 0), (40, 30), (30, 30), (30, 20), (0, 20)]), 15
    )
    step.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (1, 0, 0)))
    mesh = PartMesh(1e-3 * step.vertices, step.faces, number_by_position(20), (), "", {})
    known = surfaces(mesh)
    assert pose_in_words(mesh, known, turns) == words
    tilted = (30.0, -20.0, 0.0)  # of a part without a flat face
    assert (
        pose_in_words(mesh, [], tilted) == "turned by 30 degrees about x, then -20 degrees about y"
    )


@pytest.mark.parametrize(
    ("wanted", "part", "stock", "material"),
    [
        ("", "42CrMo4", "", "steel"),
        ("", "16MnCr5", "", "tungsten_carbide"),  # as hard as steel balls
        ("", "16MnCr5", "steel", "steel"),  # the shop has no others
        ("steel", "16MnCr5", "", "steel"),
        ("zirconia", "7075-T6", "", "zirconia"),
        ("", "CoCrMo", "", "zirconia"),  # of implants
        ("", "7075-T6", "", "zirconia"),  # steel leaves iron on it
        ("", "17-4PH", "", "zirconia"),  # likewise
        ("", "7075-T6", "steel", "steel"),
    ],
)
def test_balls_are_harder_than_the_part(wanted: str, part: str, stock: str, material: str) -> None:
    own = (StockBalls(material=stock, diameters_mm=(1.0,)),) if stock else ()
    found, reason = choose_shot(wanted, part, usual_shop().model_copy(update={"balls": own}))
    assert found == material
    assert ("LEAVES IRON" in reason) is (part == "7075-T6" and material == "steel")
    assert bool(reason) is ("LEAVES IRON" in reason or (not wanted and material != "steel"))


@pytest.mark.parametrize("part", ["7075-T6", "Ti-6Al-4V ELI", "17-4PH", "CoCrMo"])
def test_steel_balls_leave_iron_on_what_rusts_or_is_implanted(part: str) -> None:
    assert "LEAVES IRON" in choose_shot("steel", part, usual_shop())[1]
    assert not choose_shot("zirconia", part, usual_shop())[1]


@pytest.mark.parametrize(
    ("part", "walls", "is_told"),
    [
        ("Ti-6Al-4V", "100Cr6", True), ("7075-T6", "100Cr6", True), ("316L", "100Cr6", True),
        ("316L", "AISI 304", False), ("Ti-6Al-4V", "7075-T6", False), ("S355", "100Cr6", False),
        ("", "100Cr6", False), ("Ti-6Al-4V", "", False),
    ],
)  # fmt: skip
def test_walls_of_steel_beside_a_metal_that_iron_spoils_are_told(
    part: str, walls: str, is_told: bool
) -> None:
    assert iron_of_walls(part, walls).startswith("IRON FROM THE WALLS") is is_told


@pytest.mark.parametrize(
    ("part", "shot", "walls"),
    [
        ("Ti-6Al-4V", "zirconia", "Ti-6Al-4V"), ("7075-T6", "zirconia", "Ti-6Al-4V"),
        ("316L", "zirconia", "17-4PH"), ("CoCrMo", "zirconia", "Ti-6Al-4V"),
        ("Ti-6Al-4V", "steel", "100Cr6"), ("42CrMo4", "steel", "100Cr6"),
        ("IN718", "tungsten_carbide", "100Cr6"),
    ],
)  # fmt: skip
def test_walls_leave_no_iron_where_the_balls_leave_none(part: str, shot: str, walls: str) -> None:
    found, reason = choose_walls(part, shot)
    assert found == walls
    assert reason.startswith("hardened" if walls == "100Cr6" else "leaves no iron on ")
    assert not iron_of_walls(part, found) or shot == "steel"


def _lowest(known: Sequence[Surface]) -> list[str]:
    """Name the face whose place is the lowest in the part's file."""
    return [min(known, key=lambda one: one.keys["faces"][0]["at_mm"][2]).name]


def test_a_small_target_of_a_large_part_gets_a_chamber_of_its_own(tmp_path: Path) -> None:
    """The part goes out through its walls, and its target is in the middle of one sonotrode."""
    plate = trimesh.creation.box((0.2, 0.06, 0.01))
    pad = trimesh.creation.box((0.02, 0.02, 0.006))
    pad.apply_translation((0.05, 0.0, -0.008))
    whole = trimesh.boolean.union([plate, pad], engine="manifold")
    whole.export(tmp_path / "plate.stl")
    made = propose(tmp_path / "plate.stl", Wanted(unit="m"), _lowest)
    part, chamber = made.design.part, made.chamber
    assert made.sonotrode_count == 1
    assert part.offset_mm == (-50.0, 0.0)
    assert np.ptp(chamber.vertices[:, :2], axis=0).max() < 0.08
    target = chamber.part.vertices[chamber.part.triangles[chamber.part.target]]
    assert np.abs(target[..., :2].mean(axis=(0, 1))).max() < 1e-6
    assert chamber.pieces_in_air == 0
    assert made.tables["holder"]["kind"] == "bore"  # its own ends, outside the walls
    assert not [one for one in made.warnings if one.kind is WarningKind.SIDE_WALL]


@pytest.mark.parametrize(("near", "farther"), [(0.095, 0.0), (0.04, 0.03)])
def test_legs_outside_of_the_walls_hang_beside_the_sonotrode_or_stay_above_it(
    tmp_path: Path, near: float, farther: float
) -> None:
    """Legs hang below the pad that is peened. Over the face they stay a millimetre above it, which
    takes a larger distance."""
    plate = trimesh.creation.box((0.2, 0.06, 0.01))
    pad = trimesh.creation.box((0.02, 0.06, 0.006))
    pad.apply_translation((0.0, 0.0, -0.008))
    solid = [plate, pad]
    for x in (-near, near):
        leg = trimesh.creation.box((0.01, 0.06, 0.03 if farther else 0.09))
        leg.apply_translation((x, 0.0, -0.5 * np.ptp(leg.vertices[:, 2])))
        solid.append(leg)
    whole = trimesh.boolean.union(solid, engine="manifold")
    whole.export(tmp_path / "table.stl")
    bare = trimesh.boolean.union(solid[:2], engine="manifold")
    bare.export(tmp_path / "bare.stl")

    def pad_of(known: Sequence[Surface]) -> list[str]:
        return [min(known, key=lambda one: abs(one.keys["faces"][0]["at_mm"][2] + 11.0)).name]

    found, alone = (
        propose(tmp_path / f"{name}.stl", Wanted(unit="m"), pad_of) for name in ("table", "bare")
    )
    distances = [one.design.chamber.sonotrode_distance for one in (found, alone)]
    assert all(one.sonotrode_count == 1 for one in (found, alone))
    lowest = found.chamber.part.vertices[:, 2].min()
    if farther:
        # What is over a millimetre brings the plate, its own lid, to half millimetres.
        assert 1e-3 - 1e-6 <= lowest < 1.5e-3
        assert "above the rim of the sonotrode" in found.reasons["chamber.sonotrode_distance_mm"]
    else:
        assert distances[0] == pytest.approx(distances[1], abs=2e-3)  # of a higher part
        assert lowest < -0.05


def _fillet(middle: tuple[float, float], radius: float) -> list[tuple[float, float]]:
    """Corners of a hollow quarter round, from its right to its lower end."""
    angle = np.linspace(np.pi, 1.5 * np.pi, 9)
    x, y = middle
    return [(x + radius * np.cos(one), y + radius * np.sin(one)) for one in angle]


def test_a_flange_is_the_lid_of_a_round_chamber_for_its_fillet(tmp_path: Path) -> None:
    """A hub of 50 mm on a flange of 124 mm, which needs four sonotrodes, takes one of 80 mm."""
    fillet = _fillet((0.030, 0.015), 0.005)
    profile = [(0, 0), (0.062, 0), (0.062, 0.010), *fillet[::-1], (0.025, 0.06), (0, 0.06)]
    trimesh.creation.revolve(profile, sections=64).export(tmp_path / "flange.stl")
    made = propose(tmp_path / "flange.stl", Wanted(unit="m", ball_mm=2.0), lambda _: [])
    chamber = made.tables["chamber"]
    assert made.tables["part.target"]["faces"][0]["fillet"]
    assert (chamber["shape"], chamber["diameter_mm"]) == ("cylinder", 80.0)
    assert (made.sonotrode_count, made.closed) == (1, ("z",))
    assert made.tables["holder"]["kind"] == "bore"
    assert touched_share(made) > 0.99
    assert not made.jams
    level = made.chamber.vertices[:, 2].max() - made.design.chamber.sonotrode_distance
    assert level == pytest.approx(0.05, abs=1e-5)  # the flange's own face


def test_the_weld_of_a_plate_is_peened_on_fewer_sonotrodes_than_the_plate(tmp_path: Path) -> None:
    """The web of a T of 120 mm hangs from its plate, which is the lid of a narrow box."""
    right = _fillet((0.007, 0.010), 0.002)
    left = [(-x, y) for x, y in right]
    outline = [(-0.045, 0), (0.045, 0), (0.045, 0.008), *right[::-1], (0.005, 0.06)]
    outline += [(-0.005, 0.06), *left, (-0.045, 0.008)]
    mesh = Manifold.extrude(CrossSection([1e3 * np.array(outline)]), 120.0).to_mesh()
    body = trimesh.Trimesh(1e-3 * mesh.vert_properties, mesh.tri_verts)
    body.export(tmp_path / "joint.stl")
    made = propose(tmp_path / "joint.stl", Wanted(unit="m"), lambda _: [])
    assert made.tables["chamber"]["shape"] == "box"
    assert made.sonotrode_count == 2
    assert "z" in made.closed
    lid = made.chamber.part.vertices[:, 2].max() - 0.008  # the plate's lower face
    assert 0.0 <= made.chamber.height - lid < 0.25e-3
    assert made.design.shot.diameter <= 1e-3


def test_a_fillet_that_looks_aslant_leaves_the_part_square_where_that_holds_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An angle of 60 x 120 mm whose fillet looks at 45 degrees: tilted, nothing clamps it.

    Under a low ceiling it would be clamped.
    """
    monkeypatch.setattr(proposed_room, "LOW", ())
    fillet = _fillet((0.011, 0.011), 0.004)
    outline = [(0, 0), (0.06, 0), (0.06, 0.007), *fillet[::-1], (0.007, 0.12), (0, 0.12)]
    mesh = Manifold.extrude(CrossSection([1e3 * np.array(outline)]), 40.0).to_mesh()
    body = trimesh.Trimesh(1e-3 * mesh.vert_properties, mesh.tri_verts)
    body.export(tmp_path / "angle.stl")
    made = propose(tmp_path / "angle.stl", Wanted(unit="m"), lambda _: [])
    assert made.tables["part.target"]["faces"][0]["fillet"]
    assert not np.remainder(made.design.part.rotate_deg, 90.0).any()
    assert is_firm(made)
    assert touched_share(made) > 0.99


def test_no_ball_gets_over_a_roof_between_two_walls(tmp_path: Path) -> None:
    """An angle with its fillet down, both legs out through walls to which its upper sides slope."""
    fillet = _fillet((0.015, 0.014), 0.006)
    outline = [(0, 0), (0.062, 0), (0.062, 0.008), *fillet[::-1], (0.009, 0.036), (0, 0.036)]
    mesh = Manifold.extrude(CrossSection([1e3 * np.array(outline)]), 30.0).to_mesh()
    body = trimesh.Trimesh(1e-3 * mesh.vert_properties, mesh.tri_verts)
    body.export(tmp_path / "angle.stl")
    made = propose(tmp_path / "angle.stl", Wanted(unit="m", ball_mm=2.0), lambda _: [])
    assert made.sonotrode_count == 1
    assert "rattles over the part" in made.reasons["chamber.height_mm"]
    assert not [one for one in made.warnings if one.kind is WarningKind.REST]
    assert touched_share(made) > 0.99
    assert [*made.bounds] == ["shot.mass_g"]  # no study raises the ceiling again


@pytest.mark.long
def test_a_second_pose_keeps_the_target_below_the_ceiling(tmp_path: Path) -> None:
    """A shaft with a collar: turned over, its other fillet would come to lie in the ceiling."""
    low, high = _fillet((0.018, 0.057), 0.003), _fillet((0.0195, 0.087), 0.002)
    profile = [(0, 0), (0.015, 0), *[(x, 0.114 - y) for x, y in low]]
    profile += [(0.025, 0.060), (0.025, 0.085), *high[::-1], (0.0175, 0.151), (0, 0.151)]
    trimesh.creation.revolve(profile, sections=64).export(tmp_path / "shaft.stl")
    made = propose(tmp_path / "shaft.stl", Wanted(unit="m", ball_mm=1.0), lambda _: [])
    two = turned_over(made)
    for step in two.chamber.steps:
        top = step.part.vertices[step.part.triangles[step.part.target], 2].max()
        assert step.vertices[:, 2].max() - top > 1.9e-3
    assert "high enough for both poses" in two.reasons["chamber.height_mm"]


def test_faces_do_not_take_a_name_of_the_file() -> None:
    mesh = box_with({"Face 1": 4, "face 3": 5})
    found = [one.name for one in surfaces(mesh)]
    assert found == ["Face 1", "face 3", "face 2", "face 4"]


def test_names_cannot_write_into_the_design(tmp_path: Path) -> None:
    """Line breaks and control characters of names and files stay in their comments."""
    bad = "a\n[shot]\nmass_g = 1\r\x00\x07\x7f\u202e"
    mesh = box_with({bad: 4})
    known = surfaces(mesh)
    target = propose_target(mesh, known, [bad])
    tables = {"part": {"mesh": str(tmp_path / f"{bad}.stl")}, "part.target": target.keys}
    reasons = {"part.target": target.reason}
    design = SimpleNamespace(in_steps=FEW_BALLS)
    made = SimpleNamespace(
        tables=tables, reasons=reasons, known=known, design=design, trials=(), poses=(), warnings=()
    )
    text = design_text(made, tmp_path)
    written = {"part": {"mesh": f"{bad}.stl", "target": {"surface": [bad]}}}
    assert tomllib.loads(text) == written
    choices = [line for line in text.splitlines() if line.startswith("# surface = ")]
    assert tomllib.loads(choices[0].removeprefix("# ")) == {"surface": [bad]}


def test_one_of_several_faces_alike_is_a_target_of_its_own(tmp_path: Path) -> None:
    """The broad sides of a plate: one looks up, the other down."""
    trimesh.creation.box((40, 30, 5)).export(tmp_path / "plate.stl")
    mesh = read_part(tmp_path / "plate.stl", "mm")
    known = surfaces(mesh)
    broad = next(one for one in known if one.name == "face 1")
    assert "face 1.1 looks to " in broad.alone
    singles = [propose_target(mesh, known, [f"face 1.{k}"]) for k in (1, 2)]
    assert not (singles[0].triangles & singles[1].triangles).any()
    np.testing.assert_array_equal(singles[0].triangles | singles[1].triangles, broad.triangles)
    for one, way in zip(singles, broad.alone.split(", "), strict=True):
        normals = area_vectors(mesh.vertices, mesh.triangles)[one.triangles]
        assert way.endswith("+z" if normals[0, 2] > 0.0 else "-z")
        assert "alike" not in one.keys["faces"][0]
    for name in ("face 1.3", "face 1.0", "face 99.1"):
        with pytest.raises(InputError, match="--target"):
            propose_target(mesh, known, [name])

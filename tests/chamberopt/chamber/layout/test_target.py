"""At which edges a part is parted into faces, from which its target is chosen."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from manifold3d import CrossSection, Manifold

from chamberopt.chamber.layout.sizes import Sizes, propose_sizes
from chamberopt.chamber.layout.target import (
    BY_SHAPE,
    BY_SIZE,
    CREASE_DEG,
    Surface,
    Target,
    _around,
    crease_deg,
    fewer_fillets,
    propose_target,
    surfaces,
)
from chamberopt.chamber.part import posed_part
from chamberopt.chamber.propose.first_design import propose
from chamberopt.chamber.propose.proposal import Wanted
from chamberopt.common.errors import InputError
from chamberopt.geometry.meshes.part_mesh import PartMesh
from tests.chamberopt.chamber.layout.test_arbor import drum, part_of
from tests.helpers.turned_parts import stepped_shaft

FLUTES = 1300


def fluted(turn_deg: float) -> Manifold:
    """A drum of 10 mm radius whose facets turn by so much to and fro."""
    angle = 2.0 * np.pi * np.arange(2 * FLUTES) / (2 * FLUTES)
    deep = 0.5 * np.tan(np.radians(0.5 * turn_deg)) * np.pi * 10.0 / FLUTES
    radius = 10.0 + deep * np.where(np.arange(2 * FLUTES) % 2, 1.0, -1.0)
    outline = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    return Manifold.extrude(CrossSection([outline]), 20.0)


@pytest.mark.parametrize(("turn_deg", "crease"), [(20.0, 30.0), (40.0, 45.0), (55.0, 60.0)])
def test_a_side_of_facets_that_turn_is_one_face(turn_deg: float, crease: float) -> None:
    mesh, body = part_of(fluted(turn_deg))
    assert crease_deg(mesh) == crease
    known = surfaces(mesh)
    assert len(known) == 2
    target = propose_target(mesh, known, [])
    side = np.abs(body.face_normals[:, 2]) < 0.5
    assert (target.triangles == side).all()
    assert target.keys["faces"][0]["crease_deg"] == crease


def test_facets_that_turn_too_much_for_any_face_are_not_listed() -> None:
    """They are no surface to choose; both ends are, alike."""
    mesh, _ = part_of(fluted(80.0))
    assert crease_deg(mesh) == 60.0
    (ends,) = surfaces(mesh)
    assert ends.text.startswith("2 faces alike")


def test_sharp_edges_part_a_plain_part() -> None:
    mesh, _ = part_of(drum(10.0, 20.0))
    assert crease_deg(mesh) == CREASE_DEG


def rim(count: int, deep: float) -> np.ndarray:
    """Corners of the outline of a wheel of 10 mm radius with rounded teeth, (60 count, 2)."""
    angle = 2.0 * np.pi * np.arange(60 * count) / (60 * count)
    radius = 10.0 + deep * np.cos(count * angle)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def toothed(count: int, deep: float) -> Manifold:
    """A wheel whose rim of teeth, 8 mm wide, is one face, on a hub whose side is larger."""
    wheel = Manifold.extrude(CrossSection([rim(count, deep)]), 8.0)
    return wheel + Manifold.cylinder(60.0, 4.0, 4.0, 90)


@pytest.mark.parametrize("count", [7, 24])
@pytest.mark.parametrize("turn", [[0.0, 0.0, 0.0], [35.0, 70.0, 10.0]])
def test_a_rim_of_teeth_is_chosen_though_the_hub_is_larger(count: int, turn: list[float]) -> None:
    mesh, body = part_of(toothed(count, 0.5).rotate(turn))
    known = surfaces(mesh)
    largest = propose_target(mesh, known, ["face 1"])
    target = propose_target(mesh, known, [])
    assert f"it repeats {count} times round an axis, as teeth do" in target.reason
    assert target.reason.endswith(BY_SHAPE)
    assert not (target.triangles & largest.triangles).any()
    corners = rim(count, 0.5)
    length = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).sum()
    assert body.area_faces[target.triangles].sum() == pytest.approx(8.0 * length, rel=1e-4)


@pytest.mark.parametrize(("count", "deep"), [(5, 0.5), (24, 0.05)])
def test_few_lobes_or_shallow_waves_are_no_teeth(count: int, deep: float) -> None:
    mesh, _ = part_of(toothed(count, deep))
    assert propose_target(mesh, surfaces(mesh), []).reason.endswith(BY_SIZE)


def flanged(chamfer: float, top: float = 6.0) -> Manifold:
    """A shaft of 60 mm that stands on a target of 30 mm, with a flange above it [mm]."""
    side = 20.0 + np.array([0.0, top - chamfer, top])
    outline = [[0, 0], [10, 0], [10, 20], [25, side[0]], [25, side[1]], [25 - chamfer, side[2]]]
    return Manifold.revolve(CrossSection([[*outline, [8, side[2]], [8, 60], [0, 60]]]), 60)


def sized(body: Manifold, target_mm: float, ball_mm: float) -> Sizes:
    mesh, _ = part_of(body)
    ends = 1e-3 * target_mm, 1e-3 * ball_mm
    return propose_sizes(mesh.vertices, *ends, "box", triangles=mesh.triangles)


@pytest.mark.parametrize("target_mm", [18.0, 19.0, 19.5, 21.0, 22.0, 23.0])
@pytest.mark.parametrize("chamfer", [0.2, 1.0])
def test_a_ceiling_is_off_the_faces_and_chamfers_of_a_part(
    target_mm: float, chamfer: float
) -> None:
    """Its height has a tolerance of 0.3 mm (ISO 2768-m), of which it keeps two."""
    sizes = sized(flanged(chamfer), target_mm, 1.0)
    assert sizes.through_ceiling
    ceiling = 1e3 * (sizes.height - sizes.distance)
    for face in (20.0, 26.0 - chamfer, 26.0):
        assert abs(ceiling - face) >= 0.59
        assert not 0.0 < ceiling - face < 1.99 or face == 20.0  # no narrow gap over the flange
    assert ceiling >= target_mm + 2.99


def test_a_ceiling_in_no_face_stays() -> None:
    sizes = sized(flanged(0.2, 20.0), 25.0, 1.0)
    assert 1e3 * (sizes.height - sizes.distance) == pytest.approx(30.0)


@pytest.mark.parametrize("begins", [26.0, 27.0, 35.0])
def test_room_is_left_beside_what_is_below_the_ceiling(begins: float) -> None:
    """A bar of 30 x 10 mm whose wide head begins at the ceiling or over it [mm]."""
    bar = Manifold.cube((30, 10, 100)).translate([-15, -5, 0])
    head = Manifold.cube((80, 10, 100 - begins)).translate([-40, -5, begins])
    sizes = sized(bar + head, 21.0, 1.0)
    assert sizes.plan["length_mm"] == 30.0 + 2.0 * 5.0
    assert 1e3 * (sizes.height - sizes.distance) < begins - 0.5


def test_a_long_side_is_cut_where_it_meets_the_ceiling() -> None:
    """A wedge without corners between its ends is 40 mm wide below and 120 mm above."""
    wedge = Manifold.hull_points(
        [[x, y, 0.0] for x in (-20, 20) for y in (-5, 5)]
        + [[x, y, 200.0] for x in (-60, 60) for y in (-5, 5)]
    )
    sizes = sized(wedge, 20.0, 1.0)
    wide = 40.0 + 80.0 * 1e3 * (sizes.height - sizes.distance) / 200.0
    assert sizes.plan["length_mm"] == pytest.approx(wide + 2e3 * sizes.gap, abs=1.0)


@pytest.mark.parametrize("root_up", [False, True])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_fillets_near_the_heavier_end_are_left_out_first(count: int, root_up: bool) -> None:
    """A bar on a block of the same length: bands round it stand for fillets of several radii."""
    body = Manifold.cube((40, 40, 30)).translate([-20, -20, -30])
    body += Manifold.cube((10, 10, 60)).translate([-5, -5, 0])
    drawn_as = body.rotate([180, 0, 0]) if root_up else body
    mesh, drawn = part_of(drawn_as.refine_to_length(4.0))
    places = drawn.triangles_center[:, 2] * (-1.0 if root_up else 1.0)
    fillets = [
        Surface(
            f"fillets of {k} mm", {"faces": [{"k": k}]}, abs(places - 20.0 * k) < 6.0, f"no {k}"
        )
        for k in range(count)
    ]
    marked = np.any([one.triangles for one in fillets], axis=0)
    found = fewer_fillets(mesh, Target({}, marked, "", tuple(fillets[::-1])))
    assert len(found) == count - 1
    for out, one in enumerate(found, start=1):
        assert (one.triangles == np.any([x.triangles for x in fillets[out:]], axis=0)).all()
        assert all(f'--target "{x.name}"' in one.reason for x in fillets[:out])
        assert not any(f'--target "{x.name}"' in one.reason for x in fillets[out:])


@pytest.mark.parametrize(("wide", "is_told"), [(5.0, True), (0.3, False)])
def test_the_surfaces_in_which_fillets_lie_are_named(wide: float, is_told: bool) -> None:
    """A fillet of 1 mm² lies in two faces, each so many times as large."""
    area = np.array([0.5, 0.5, wide, wide, 30.0])

    def surface(name: str, *rows: int) -> Surface:
        return Surface(name, {}, np.isin(np.arange(5), rows), "")

    faces = [surface("face 1", 4), surface("face 2", 0, 2), surface("face 3", 1, 3)]
    words = _around([surface("fillets", 0, 1)], faces, area)
    assert words.endswith('--target "face 2" --target "face 3"') == is_told
    assert "face 1" not in words
    assert is_told or not words


def tee(wide: float, long: float) -> Manifold:
    """A T of plates with a bevel at 45 degrees in each corner, so wide along both plates [mm]."""
    half = [[0, 0], [60, 0], [60, 10], [5 + wide, 10], [5, 10 + wide], [5, 60], [0, 60]]
    outline = CrossSection([np.array(half, dtype=float)])
    return Manifold.extrude(outline + outline.mirror((1.0, 0.0)), long)


@pytest.mark.parametrize(("wide", "count"), [(7.0, 2), (0.0, 0), (30.0, 0)])
def test_the_welds_of_a_joint_are_chosen(wide: float, count: int) -> None:
    """Two bevels at 45 degrees in the corners of a T, 60 mm long; too wide ones are none."""
    mesh, body = part_of(tee(wide, 60.0))
    known = surfaces(mesh)
    welds = [one for one in known if one.name == "bevels"]
    assert len(welds) == (count > 0)
    if welds:
        target = propose_target(mesh, known, [])
        assert (target.triangles == welds[0].triangles).all()
        assert target.reason.endswith(BY_SHAPE)
        area = body.area_faces[target.triangles].sum()
        assert area == pytest.approx(count * 60.0 * wide * np.sqrt(2.0))
        asked = select_triangles_of(mesh, welds[0])
        assert (asked == target.triangles).all()


def select_triangles_of(mesh: PartMesh, one: Surface) -> np.ndarray:
    """Mark the triangles that the keys of a surface choose by their places, (m,)."""
    faces = mesh.faces(one.keys["faces"][0]["crease_deg"])
    numbers = [faces.at(1e-3 * np.array(key["at_mm"]))[0] for key in one.keys["faces"]]
    return np.isin(faces.of_triangle, numbers)


def test_the_sides_of_a_socket_are_no_bevels() -> None:
    """Each side of a hexagon meets two others in hollow edges that turn by 60 degrees."""
    mesh, _ = part_of(drum(20, 10) - Manifold.cylinder(5.0, 8.0, 8.0, 6).translate([0, 0, 5]))
    assert not [one for one in surfaces(mesh) if one.raises_stress]


def test_flat_sides_of_a_root_are_not_peened_with_those_of_a_blade() -> None:
    """The round back of a blade is 2 % larger than the two flat sides of its root."""
    angle = np.linspace(0.0, np.pi, 60)
    back = np.column_stack([10.0 * np.cos(angle), 10.0 * np.sin(angle)])
    blade = Manifold.extrude(CrossSection([back]), 40.0)
    size = 40.0 * 10.0 * np.pi / 1.02 / 2.0
    root = Manifold.cube((20.0, 5.0, size / 20.0)).translate([-10.0, 1.0, -size / 20.0])
    mesh, body = part_of(blade + root)
    target = propose_target(mesh, surfaces(mesh), [])
    assert target.reason.startswith("face 1: the largest")
    assert body.triangles_center[target.triangles, 2].min() > 0.0


def test_what_no_ball_touches_of_a_coarse_weld_is_left_out(tmp_path: Path) -> None:
    """Both edges of a bevel at 45 degrees keep a ball of radius r off by r tan(22.5 degrees).

    The file has two triangles for each bevel: smaller ones are asked for to tell them apart.
    """
    part_of(tee(7.0, 60.0))[1].export(tmp_path / "joint.stl")
    wanted = Wanted(unit="mm", ball_mm=2.0, alloy="S355")
    made = propose(tmp_path / "joint.stl", wanted, lambda _: ())
    assert made.tables["part.target"]["reachable"] is True
    part, wide = made.chamber.part, 7.0 * np.sqrt(2.0)
    left = float(part.area[part.target].sum())
    off = np.tan(np.radians(22.5))
    within = wide - 2.0 * off
    within += 2.0 * (7.0 - off)  # of the plates, as far as the leg reaches
    assert made.tables["part.target"]["beside_mm"] == 7.0
    assert "with 7 mm of the faces beside the toes" in made.reasons["part.target"]
    assert "ROOTS ARE SHARP IN THE FILE" in made.reasons["part.target.reachable"]
    assert 1e6 * left == pytest.approx(2.0 * 60.0 * within, rel=0.02)


@pytest.mark.parametrize("wide", [7.0, 3.2])
def test_a_target_takes_a_strip_beside_its_hollow_edges(tmp_path: Path, wide: float) -> None:
    """Both plates beside each weld, not the ends of the joint, nor what lies behind the plates.

    Of a joint whose triangles are as long as its welds, the strips end straight.
    """
    part_of(tee(wide, 60.0))[1].export(tmp_path / "joint.stl")
    made = propose(
        tmp_path / "joint.stl", Wanted(unit="mm", ball_mm=2.0, alloy="S355"), lambda _: ()
    )
    design = made.design.changed({"part.target.reachable": False, "part.target.beside_mm": 2.0})
    part = posed_part(design)[0]
    area = 1e6 * float(part.area[part.target].sum())
    assert area == pytest.approx(2.0 * 60.0 * (wide * np.sqrt(2.0) + 2.0 * 2.0), rel=1e-3)
    body = trimesh.Trimesh(part.vertices, part.triangles, process=False)
    assert body.is_watertight
    with pytest.raises(InputError, match="no face goes on from the target"):
        posed_part(design.changed({"part.target.faces": (), "part.target.surface": ("all",)}))


@pytest.mark.parametrize(("fillet", "sides"), [(2.0, 96), (3.0, 144)])
def test_a_fillet_is_peened_with_a_strip_beside_it(
    tmp_path: Path, fillet: float, sides: int
) -> None:
    """By its radius, at most 2 mm, on journal and shoulder, and not over the shoulder's edge.

    The shoulder goes on beyond the fillet by less: all of it is taken.
    """
    journal, collar = 15.0, 15.0 + 1.6 * fillet
    body = stepped_shaft([(journal, 60.0), (collar, 30.0)], fillet, sides)
    part_of(body)[1].export(tmp_path / "shaft.stl")
    made = propose(tmp_path / "shaft.stl", Wanted(unit="mm", ball_mm=1.0), lambda _: ())
    assert made.tables["part.target"]["beside_mm"] == 2.0
    assert "so that it runs out" in made.reasons["part.target"]
    design = made.design.changed({"part.target.reachable": False})
    part = posed_part(design)[0]
    area = 1e6 * float(part.area[part.target].sum())
    middle = journal + fillet - 2.0 / np.pi * fillet  # of the arc, by Pappus
    round_ = 2.0 * np.pi * middle * 0.5 * np.pi * fillet
    shoulder = np.pi * (collar**2 - (journal + fillet) ** 2)
    strip = 2.0 * np.pi * journal * 2.0
    assert area == pytest.approx(round_ + shoulder + strip, rel=0.03)
    assert trimesh.Trimesh(part.vertices, part.triangles, process=False).is_watertight


@pytest.mark.parametrize(("thick", "ball_mm"), [(5.0, 0.8), (8.0, 2.0)])
def test_a_ceiling_lies_just_above_a_platform_under_which_the_target_ends(
    thick: float, ball_mm: float
) -> None:
    """Twice its tolerance of 0.2 mm (ISO 2768-m up to 30 mm), in whole mm: the platform is out."""
    body = Manifold.cube((20, 40, 16)).translate([-10, -20, 0])
    body += Manifold.cube((36, 54, thick)).translate([-18, -27, 16])
    body += Manifold.cube((4, 40, 80)).translate([-2, -20, 16])
    under = sized(body, 16.0, ball_mm)
    assert under.through_ceiling
    assert 0.4 <= 1e3 * (under.height - under.distance) - 16.0 <= 1.0
    below = sized(body, 12.0, ball_mm)  # its room goes on above it
    assert 1e3 * (below.height - below.distance) >= 12.0 + 0.6 * 5.0 * ball_mm - 1e-6

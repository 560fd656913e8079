"""Bores that take an arbor, and parts that turn about one: bodies whose bores are known."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold, OpType

from chamberopt.chamber.layout.arbor import arbor_through, find_bores, way_through
from chamberopt.chamber.layout.holder import holder_choices
from chamberopt.chamber.layout.target import Surface
from chamberopt.chamber.propose.first_design import propose
from chamberopt.chamber.propose.proposal import Proposal, Wanted
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.meshes.raw_mesh import number_by_position
from tests.helpers.more_parts import MORE_PARTS

BALL = 1e-3


def part_of(body: Manifold) -> tuple[PartMesh, trimesh.Trimesh]:
    """A body in mm as a part, and as a mesh of trimesh."""
    made = body.to_mesh()
    mesh = trimesh.Trimesh(made.vert_properties, made.tri_verts, process=False)
    numbering = number_by_position(len(mesh.faces))
    vertices = 1e-3 * np.asarray(mesh.vertices)
    return PartMesh(vertices, mesh.faces.astype(np.int32), numbering, (), "", {}), mesh


def drum(radius: float, height: float, sides: int = 64) -> Manifold:
    return Manifold.cylinder(height, radius, circular_segments=sides)


def ring(outer: float, inner: float, height: float) -> Manifold:
    """A drum with a hole through its middle, which goes on beyond both ends."""
    return drum(outer, height) - drum(inner, 3 * height).translate([0, 0, -height])


@pytest.mark.parametrize("reaches", [False, True])
def test_no_head_of_a_bolt_lies_on_the_target(reaches: bool) -> None:
    """Of a plate with two holes that open in its lower face, which is the target or half of it."""
    plate = Manifold.cube((100, 40, 8)).translate([-50, -20, 0])
    plate += Manifold.cube((50, 40, 1)).translate([0, -20, -1])  # half of it is thicker
    for x in (-20, 20):
        plate -= drum(5, 30).translate([x, 0, -10])
    mesh, body = part_of(plate)
    target = body.face_normals[:, 2] < -0.5
    target &= reaches | (body.triangles_center[:, 2] > -0.5)
    holes = find_bores(mesh, target)
    assert len(holes) == 2
    for one in holder_choices(mesh, target, (0.0, 0.0, 0.0), BALL, holes):
        if "hole" in one.reason:
            break
    assert one.keys["kind"] == "plate"
    in_target = [hole.wall for hole in holes if reaches or hole.point[0] < 0.0]
    assert [*one.pins] == in_target
    assert ("bolts through its hole of 10 mm hold it" in one.reason) != reaches
    count = "holes of 10, 10" if reaches else "hole of 10"
    assert f"expanding pins, drawn from behind, in its {count} mm hold it, flush" in one.reason


def test_bores_are_round_free_and_go_through() -> None:
    """Of a plate: a hole of 8 mm counts; a blind, a square, a thin and a blocked one do not."""
    plate = Manifold.cube((120, 40, 10))
    plate -= drum(4, 30).translate([20, 20, -10])
    plate -= drum(4, 8).translate([40, 20, 5])  # blind
    plate -= Manifold.cube((8, 8, 30)).translate([56, 16, -10])
    plate -= drum(1, 30).translate([80, 20, -10])
    plate -= drum(5, 30).translate([100, 20, -10])
    plate += Manifold.cube((20, 2, 2)).translate([90, 19, 20])  # in the way of the last
    plate += Manifold.cube((2, 2, 22)).translate([89, 19, 0])
    mesh, _ = part_of(plate)
    nothing = np.zeros(len(mesh.triangles), dtype=bool)

    (bore,) = find_bores(mesh, nothing)
    assert bore.radius == pytest.approx(4e-3, rel=1e-3)
    assert 1e3 * bore.point == pytest.approx([20, 20, 5], abs=1e-3)
    assert np.abs(bore.axis) == pytest.approx([0, 0, 1])
    assert find_bores(mesh, bore.triangles) == []  # it is to be peened
    every = find_bores(mesh, nothing, for_arbor=False)  # a plug fills any but the square one
    assert [round(1e3 * one.radius, 2) for one in every] == [5.0, 4.0, 4.0, 1.0]


@pytest.mark.parametrize(
    ("turns", "axis"), [((0, 0, 0), None), ((90, 0, 0), 1), ((0, 90, 0), 0), ((40, 0, 0), ())]
)
def test_an_arbor_goes_up_or_aside(turns: tuple[float, ...], axis: int | tuple[()] | None) -> None:
    """Flanges of 1.6 bores, but a ball away from the target; none for an axis that leans."""
    mesh, body = part_of(ring(30, 10, 12))
    outside = np.hypot(*body.triangles_center[:, :2].T) > 29.0
    (bore,) = find_bores(mesh, outside)
    made = arbor_through(bore, mesh, outside, turns, BALL)
    if axis == ():
        assert made is None
        return
    assert made is not None
    keys, _ = made
    assert (keys["kind"], keys["diameter_mm"], keys["thickness_mm"]) == ("arbor", 32.0, 2.0)
    assert keys.get("both_sides", False) == (axis is not None)
    if axis is not None:
        assert abs(keys["axis"][axis]) == 1.0
    beside = arbor_through(bore, mesh, ~bore.triangles, turns, BALL)  # no room for flanges
    assert beside is not None
    assert "diameter_mm" not in beside[0]


@pytest.mark.parametrize(("x", "holds"), [(0, True), (20, True), (30, False)])
def test_an_arbor_goes_through_a_bore_near_the_middle(x: float, holds: bool) -> None:
    """Of a bar of 100 x 30 x 10 mm: one near its end would not carry it."""
    bar = Manifold.cube((100, 30, 10)).translate([-50, -15, 0])
    mesh, body = part_of(bar - drum(6, 30).translate([x, 0, -10]))
    side = np.abs(body.face_normals[:, 1]) > 0.99
    side &= np.abs(body.triangles_center[:, 1]) > 14.0
    (bore,) = find_bores(mesh, side)
    assert (arbor_through(bore, mesh, side, (0, 0, 0), BALL) is not None) == holds


@pytest.mark.parametrize("hub", [12.0, 16.0, 30.0])
def test_flanges_are_cups_that_close_on_a_web_beside_its_hub(hub: float) -> None:
    """A disc of 12 mm with a hub as long or longer. Flanges end two balls from the rim's target, or
    half as far as they stand out of the web.
    """
    mesh, body = part_of(ring(40, 10, 12) + ring(18, 10, hub).translate([0, 0, 6 - 0.5 * hub]))
    rim = np.hypot(*body.triangles_center[:, :2].T) > 39.0
    rim &= np.abs(body.face_normals[:, 2]) < 0.5
    bore = find_bores(mesh, rim)[0]
    made = arbor_through(bore, mesh, rim, (90, 0, 0), BALL, with_cups=True)
    assert made is not None
    keys, reason = made
    least, depth = 40.0 * np.cos(np.pi / 64), 0.5 * (hub - 12.0)  # the first of the flat sides
    room = max(2.0, 0.5 * (depth + 2.0))
    assert keys["diameter_mm"] == pytest.approx(2.0 * (least - room), abs=0.51)
    if depth:
        assert keys["grip_mm"] == pytest.approx(depth, abs=1e-6)
    assert ("cups" if depth else "mask the ends") in reason
    uneven = mesh.vertices.copy()  # the web leans
    uneven[:, 2] += 0.05 * mesh.vertices[:, 0]
    leaning = replace(mesh, vertices=uneven)
    assert arbor_through(bore, leaning, rim, (90, 0, 0), BALL, with_cups=True) is None


@pytest.mark.long
def test_cups_leave_nothing_of_a_hub_to_the_shot(tmp_path: Path) -> None:
    disc = ring(40, 10, 12) + ring(18, 10, 24).translate([0, 0, -6])
    _, body = part_of(disc)
    radius = np.hypot(*body.triangles_center[:, :2].T)
    rim = (radius > 39.0) & (np.abs(body.face_normals[:, 2]) < 0.5)
    hub = (radius < 18.1) & (radius > 10.1)
    lines = [f"v {x} {y} {z}" for x, y, z in body.vertices]
    for name, rows in (("PEENED", rim), ("HUB", hub), ("WEB", ~rim & ~hub)):
        lines += [f"g {name}", *(f"f {a} {b} {c}" for a, b, c in body.faces[rows] + 1)]
    part = tmp_path / "disc.obj"
    part.write_text("\n".join(lines) + "\n")
    made = propose(part, Wanted("mm"), lambda _: [])
    turns_on_an_arbor(made)
    assert made.design.holder is not None
    assert made.design.holder.grip_mm == pytest.approx(6.0)
    rows = np.zeros(len(made.chamber.part.triangles), dtype=bool)
    for one in made.known:
        if one.name == "HUB":
            rows |= one.triangles
    assert rows.any()
    assert made.chamber.exposed_area[rows].sum() < 1e-3 * made.chamber.part.area[rows].sum()


def turns_on_an_arbor(made: Proposal) -> None:
    turn, holder = made.design.effects.part_turn, made.design.holder
    assert turn is not None
    assert holder is not None
    assert (holder.kind, holder.both_sides) == ("arbor", True)
    assert abs(holder.axis[2]) < 1e-6
    assert not made.warnings


@pytest.mark.long
def test_a_ring_is_proposed_to_turn_on_an_arbor(tmp_path: Path) -> None:
    """Its outside is a target alike all round; at rest balls would lie on its upper face."""
    trimesh.creation.annulus(10.0, 30.0, 12.0, sections=24).export(tmp_path / "ring.stl")

    def outside(known: Sequence[Surface]) -> list[str]:
        return [max(known, key=lambda one: np.hypot(*one.keys["faces"][0]["at_mm"][:2])).name]

    turns_on_an_arbor(propose(tmp_path / "ring.stl", Wanted("mm"), outside))
    for kept in (Wanted("mm", pose="lying"), Wanted("mm", may_turn=False)):
        assert propose(tmp_path / "ring.stl", kept, outside).design.effects.part_turn is None


@pytest.mark.long
def test_a_disc_on_whose_web_balls_would_lie_turns_on_an_arbor(tmp_path: Path) -> None:
    part = MORE_PARTS["turbine_disc"].write(tmp_path)
    made = propose(part, Wanted("m"), lambda _: [])
    turns_on_an_arbor(made)
    assert made.sonotrode_count == 2  # lying it takes four


def coil(mean: float, wire: float, pitch: float, turns: int) -> Manifold:
    """A compression spring along z, of pieces of 10 degrees, which are turned and raised."""
    angles = np.arange(36 * turns) * 10.0
    ball = Manifold.sphere(wire / 2, 16).translate([mean / 2, 0, 0])
    balls = [ball.rotate([0, 0, one]).translate([0, 0, pitch * one / 360]) for one in angles]
    pieces = [Manifold.batch_hull(pair) for pair in pairwise(balls)]
    return Manifold.batch_boolean(pieces, OpType.Add)


@pytest.mark.parametrize(
    ("body", "way"),
    [
        (ring(20.0, 12.0, 5.0), ("z", 24.0)),
        (coil(26.0, 4.0, 6.0, 3), ("z", 22.0)),
        (ring(20.0, 12.0, 5.0) - Manifold.cube([30, 14, 20], True).translate([15, 0, 0]), None),
        (Manifold.cube([10, 10, 10]), None),
        (ring(20.0, 1.5, 5.0), None),  # too thin for a rod
    ],
)
def test_a_part_that_goes_round_a_free_way_is_hung_on_a_rod(
    body: Manifold, way: tuple[str, float] | None
) -> None:
    """The way of a coil is as wide as its mean diameter less its wire."""
    found = way_through(part_of(body)[0])
    assert (found is None) == (way is None)
    if found and way:
        assert found[0] == way[0]
        assert 1e3 * found[1] == pytest.approx(way[1], abs=0.6)

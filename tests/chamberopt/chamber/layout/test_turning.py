"""Axes about which parts turn: bodies whose axis is known, and ends by which they cannot."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold, OpType

from chamberopt.chamber.layout.arbor import find_bores
from chamberopt.chamber.layout.holder import holder_choices
from chamberopt.chamber.layout.target import Surface
from chamberopt.chamber.layout.turning import (
    SLENDER,
    Spindle,
    find_spindle,
    slenderness,
    turning_bore,
    turning_pose,
)
from chamberopt.chamber.propose.first_design import propose
from chamberopt.chamber.propose.proposal import Wanted
from chamberopt.common.errors import InputError
from chamberopt.geometry.triangles import rotation_matrix
from tests.chamberopt.chamber.layout.test_arbor import BALL, drum, part_of, ring
from tests.helpers.turned_parts import stepped_shaft


def test_a_ring_of_alike_teeth_turns_about_its_bore() -> None:
    """A toothed disc turns; with half of its teeth as target, or none outside, it does not.

    It turns for both of its sides, and for one alone it does not.
    """
    teeth = [
        Manifold.cube((6, 3, 12)).translate([28, -1.5, 0]).rotate([0, 0, 360 / 16 * k])
        for k in range(16)
    ]
    gear = Manifold.batch_boolean([ring(30, 10, 12), *teeth], OpType.Add)
    mesh, body = part_of(gear)
    middle = body.triangles_center
    outside = (np.hypot(*middle[:, :2].T) > 29.0) & (np.abs(body.face_normals[:, 2]) < 0.5)
    bores = find_bores(mesh, outside)
    bore = turning_bore(bores, mesh, outside)
    assert bore is not None
    assert turning_bore(bores, mesh, outside & (middle[:, 0] > 0.0)) is None
    boss, of_boss = part_of(ring(60, 10, 12) + ring(20, 10, 20))
    inside = of_boss.triangles_center[:, 2] > 12.5
    inside &= np.hypot(*of_boss.triangles_center[:, :2].T) > 19.0
    assert inside.any()
    assert turning_bore(find_bores(boss, inside), boss, inside) is None

    sides = (np.hypot(*middle[:, :2].T) > 11.0) & (np.abs(body.face_normals[:, 2]) > 0.9)
    assert turning_bore(bores, mesh, sides) is not None
    assert turning_bore(bores, mesh, sides & (body.face_normals[:, 2] > 0.0)) is None

    turns, turn = turning_pose(bore, mesh)
    level = rotation_matrix(turns) @ bore.axis
    assert np.abs(level) == pytest.approx([0, 1, 0], abs=1e-6)  # across the room's length
    assert np.abs(turn["axis"]) == pytest.approx([0, 0, 1])
    assert turn["through_mm"][:2] == pytest.approx([0, 0], abs=1e-3)
    first = holder_choices(mesh, outside, turns, BALL, bores)[0]
    assert first.keys["kind"] == "arbor"
    assert first.keys["both_sides"]


def collar_on_a_bar(bar: Manifold, aside: float = 0.0) -> Manifold:
    """A bar of 100 mm along z, and in the middle of it a collar of 40 x 10 mm, aside of it."""
    collar = drum(20, 10, 72).translate([aside, 0, 45])
    return bar + collar


def flanks(body: trimesh.Trimesh) -> np.ndarray:
    """Mark the flat sides of the collar."""
    heights = body.triangles_center[:, 2]
    return (np.abs(body.face_normals[:, 2]) > 0.9) & (heights > 10.0) & (heights < 90.0)


@pytest.mark.parametrize("turns", [(0.0, 0.0, 0.0), (90.0, 0.0, 0.0), (31.0, -47.0, 113.0)])
@pytest.mark.parametrize("cut_at", [0.0, 37.0])
def test_the_axis_of_a_collar_is_found_wherever_it_is(
    turns: tuple[float, float, float], cut_at: float
) -> None:
    """Its cone is divided unevenly, so that the middle of its triangles is off the axis."""
    cone = Manifold.cylinder(10, 20, 12, circular_segments=90)
    cone = cone.trim_by_plane([0, 0, 1], 2) if cut_at else cone
    body = (cone + drum(8, 100, 90).translate([0, 0, -45])).transform(
        np.c_[rotation_matrix(turns), [30.0, -20.0, 11.0]]
    )
    mesh, _ = part_of(body)
    axis = rotation_matrix(turns)[:, 2]
    shifted = 1e3 * mesh.vertices - [30.0, -20.0, 11.0]
    middles = shifted[mesh.triangles].mean(axis=1)
    along = middles @ axis
    away = np.linalg.norm(middles - along[:, None] * axis, axis=1)
    target = (along > 2.01) & (along < 9.99) & (away > 10.0)
    found = find_spindle(mesh, target)
    assert found is not None
    assert abs(found.axis @ axis) == pytest.approx(1.0, abs=1e-5)
    off = 1e3 * found.point - [30.0, -20.0, 11.0]
    assert np.linalg.norm(off - (off @ axis) * axis) < 0.02
    half = target & (middles @ rotation_matrix(turns)[:, 0] > 0.0)
    assert find_spindle(mesh, half) is None


def test_a_shaft_turns_by_its_ends(tmp_path: Path) -> None:
    """The room is round the flanks of its collar; its ends go out through drilled walls."""
    _, body = part_of(collar_on_a_bar(drum(10, 100, 72)))
    part = tmp_path / "shaft.stl"
    body.export(part)

    def both(known: Sequence[Surface]) -> list[str]:
        return [one.name for one in known if flanks(body)[one.triangles].mean() > 0.9]

    made = propose(part, Wanted("mm", ball_mm=1.0, pose="turning"), both)
    turn = made.design.effects.part_turn
    assert turn is not None
    assert np.abs(turn.axis) == pytest.approx([0, 0, 1])
    # Beside the bar is a sharp corner, into which no ball gets: it is left out.
    assert not made.warnings
    assert "ROOTS ARE SHARP IN THE FILE" in made.reasons["part.target.reachable"]
    assert made.sonotrode_count == 1
    assert made.tables["holder"]["kind"] == "bore"
    half = 5e-4 * made.tables["chamber"]["length_mm"]
    ends = made.chamber.part.vertices[:, 0]
    assert ends.max() > half + 20e-3
    assert ends.min() < -half - 20e-3


SQUARE = Manifold.cube((15, 15, 100)).translate([-7.5, -7.5, 0])


@pytest.mark.parametrize(
    ("body", "told"),
    [
        (collar_on_a_bar(SQUARE), "not round about that axis where it goes out"),
        (collar_on_a_bar(drum(10, 100, 72), aside=4.0), "not round about that axis"),
        (collar_on_a_bar(drum(10, 14, 72).translate([0, 0, 43])), "none of its ends"),
    ],
)
def test_what_cannot_turn_by_its_ends_is_told(body: Manifold, told: str, tmp_path: Path) -> None:
    _, mesh = part_of(body)
    part = tmp_path / "part.stl"
    mesh.export(part)
    outside = np.hypot(*(mesh.triangles_center[:, :2] - [mesh.bounds[1, 0] - 20.0, 0.0]).T) > 19.0

    def rim(known: Sequence[Surface]) -> list[str]:
        return [one.name for one in known if outside[one.triangles].mean() > 0.9]

    with pytest.raises(InputError, match=f"--pose: given turning, but .*{told}"):
        propose(part, Wanted("mm", ball_mm=1.0, pose="turning"), rim)


BOTH_SIDES = [(12.0, 40.0), (20.0, 20.0), (12.0, 40.0)]


@pytest.mark.parametrize(("length", "sides"), [(40.0, 72), (15.0, 96)])
def test_a_part_is_slender_by_its_length_unless_its_target_looks_to_one_end(
    length: float, sides: int
) -> None:
    """A collar of 40 mm on a journal: (2 length + 20) / 40. One fillet looks one way."""
    body = stepped_shaft([(12.0, length), (20.0, 20.0), (12.0, length)], 2.0, sides)
    mesh, seen = part_of(body)
    aside = np.hypot(*seen.triangles_center[:, :2].T)
    fillets = (aside > 12.01) & (aside < 14.0) & (np.abs(seen.face_normals[:, 2]) < 0.999)
    axis = Spindle(np.zeros(3), np.array([0.0, 0.0, 1.0]))
    expected = (2.0 * length + 20.0) / 40.0
    assert slenderness(mesh, fillets, axis) == pytest.approx(expected, rel=1e-3)
    assert (expected >= SLENDER) == (length > 20.0)
    one = fillets & (seen.triangles_center[:, 2] < length + 1.0)
    assert one.any()
    assert slenderness(mesh, one, axis) == 0.0


@pytest.mark.parametrize(("scale", "sides"), [(1.0, 72), (1.5, 96)])
def test_a_slender_shaft_with_fillets_all_round_turns_first(
    scale: float, sides: int, tmp_path: Path
) -> None:
    body = stepped_shaft([(scale * r, scale * long) for r, long in BOTH_SIDES], 2.0, sides)
    part = tmp_path / "shaft.stl"
    part_of(body)[1].export(part)
    made = propose(part, Wanted("mm", ball_mm=1.0), lambda _: [])
    assert made.design.effects.part_turn is not None
    told = made.reasons["part.rotate_deg"]
    assert "as shops turn a part 2.5 times as long as wide, peened all round" in told
    assert not made.warnings
    assert made.tables["holder"]["kind"] == "bore"
    still = propose(part, Wanted("mm", ball_mm=1.0, may_turn=False), lambda _: [])
    assert still.design.effects.part_turn is None

"""Balls that `new` proposes: by fillets, slots, and gaps in which they would jam."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from shapely import Polygon

from chamberopt.chamber.layout.balls import SizeFit, charge_of, fit_sizes, propose_ball
from chamberopt.chamber.part import Part
from chamberopt.chamber.propose.first_design import propose
from chamberopt.chamber.propose.proposal import Wanted, sonotrode_area
from chamberopt.chamber.propose.proposed_intensity import with_thin_places
from chamberopt.chamber.propose.text import clauses, to_settle
from chamberopt.geometry.triangles import areas


def part_of(mesh: trimesh.Trimesh, target: np.ndarray) -> Part:
    """A part of a mesh in metres, some of whose triangles are the target."""
    vertices, triangles = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    return Part(vertices, triangles, areas(vertices, triangles), target, "a part")


def block_with_slot(width_mm: float) -> trimesh.Trimesh:
    """A block of 20 mm with a slot 5 mm deep, whose middle is at x = 11 mm."""
    low, high = 11.0 - 0.5 * width_mm, 11.0 + 0.5 * width_mm
    outline = [(0, 0), (22, 0), (22, 10), (high, 10), (high, 5), (low, 5), (low, 10), (0, 10)]
    block = trimesh.creation.extrude_polygon(Polygon(outline), 20)
    block.apply_scale(1e-3)
    return block


def walls_of_slot(block: trimesh.Trimesh, width_mm: float) -> np.ndarray:
    middle = 1e3 * block.triangles_center
    aside = np.abs(middle[:, 0] - 11.0) < 0.5 * width_mm + 0.01
    return np.asarray(aside & (middle[:, 1] > 5.01) & (middle[:, 1] < 9.99))


def test_a_ball_touches_what_its_radius_lets_it() -> None:
    """A slot of 2 mm with square corners: balls above 2 mm touch none of its walls."""
    block = block_with_slot(2.0)
    part = part_of(block, walls_of_slot(block, 2.0))
    fits = fit_sizes(part, (1e-3, 1.9e-3, 2.1e-3))
    # The corner at the bottom keeps a ball half its diameter away.
    assert [one.touched for one in fits] == pytest.approx([0.9, 0.81, 0.0], abs=0.01)
    # Four balls do not fit across; beside the corner it is the slot's bottom that is in the way.
    assert max(one.served for one in fits) < 0.15


@pytest.mark.parametrize("long_mm", [30.0, 90.0])
def test_flat_faces_beside_a_fillet_are_no_part_of_it(long_mm: float) -> None:
    """Two legs with a fillet of 1 mm, of two triangles each, which balls of 2 mm serve."""
    turns = np.radians(np.linspace(0.0, 90.0, 16))
    arc = 1.0 - np.c_[np.sin(turns), np.cos(turns)] + 2.0
    legs = trimesh.creation.extrude_polygon(
        Polygon([(0, 0), (long_mm, 0), (long_mm, 2), *arc, (2, long_mm), (0, long_mm)]), 20
    )
    legs.apply_scale(1e-3)
    middle, normal = 1e3 * legs.triangles_center, legs.face_normals
    inner = (middle[:, :2] > 2.0 - 1e-6).all(axis=1) & (np.abs(normal[:, 2]) < 0.5)
    inner &= (normal[:, :2] > -1e-6).all(axis=1) & (middle[:, :2].max(axis=1) < long_mm - 0.1)
    in_arc = inner & (middle[:, :2] < 3.01).all(axis=1)
    hollow = np.where(in_arc, 1e3, 0.0).astype(np.float32)
    (fit,) = fit_sizes(replace(part_of(legs, inner), hollow=hollow), (2e-3,))
    share = 1.0 - legs.area_faces[in_arc].sum() / legs.area_faces[inner].sum()
    assert fit.served == pytest.approx(share, abs=0.02)


@pytest.mark.parametrize(("radius_mm", "serves"), [(4.0, True), (3.8, False)])
def test_balls_of_half_a_fillets_radius_serve_it(radius_mm: float, serves: bool) -> None:
    """Two legs with a fillet of 6 degree facets, whose radius is that of the arc, to rounding."""
    turns = np.radians(np.linspace(0.0, 90.0, 16))
    arc = radius_mm * (1.0 - np.c_[np.sin(turns), np.cos(turns)]) + 2.0
    legs = trimesh.creation.extrude_polygon(
        Polygon([(0, 0), (30, 0), (30, 2), *arc, (2, 30), (0, 30)]), 20
    )
    legs.apply_scale(1e-3)
    middle = 1e3 * legs.triangles_center
    inside = (middle[:, :2].min(axis=1) > 1.99) & (middle[:, :2].max(axis=1) < 2.0 + radius_mm)
    fillet = inside & (np.abs(legs.face_normals[:, 2]) < 0.5)
    (fit,) = fit_sizes(part_of(legs, fillet), [2e-3])
    assert (fit.served > 0.9) is serves


def test_what_a_size_serves_does_not_depend_on_the_sizes_beside_it() -> None:
    """On a round shaft in coarse facets, a ball reaches over edges by a hundredth of its radius."""
    shaft = trimesh.creation.annulus(4.0, 20.0, 10.0, sections=36)
    shaft.apply_scale(1e-3)
    part = part_of(shaft, np.ones(len(shaft.faces), dtype=bool))
    alone = fit_sizes(part, [3e-3])
    for beside in ([0.4e-3], [1e-3, 2e-3]):
        assert fit_sizes(part, [*beside, 3e-3])[-1] == alone[0]
    assert alone[0].touched > 0.95


@pytest.mark.parametrize(
    ("width_mm", "chosen", "said"),
    [
        (1.988, 1.5, "2 mm would jam in gaps of the part"),  # the gap of the spring
        (6.2, 1.5, "a quarter of its slots"),
        (30.0, 3.0, "touches"),
    ],
)
def test_balls_suit_a_slot_and_jam_in_none(width_mm: float, chosen: float, said: str) -> None:
    block = block_with_slot(min(width_mm, 20.0))
    target = np.ones(len(block.faces), dtype=bool)
    if width_mm > 20.0:
        block = trimesh.creation.box((0.03, 0.02, 0.01))
        target = block.face_normals[:, 2] > 0.5
    diameter, reason = propose_ball(fit_sizes(part_of(block, target), (1.5e-3, 2e-3, 3e-3)))
    assert 1e3 * diameter == pytest.approx(chosen)
    assert said in reason


def test_what_serves_the_most_is_proposed_where_no_size_serves_all() -> None:
    fits = [
        SizeFit(1e-3, 0.95, 0.90, False, 0.0, 100),
        SizeFit(2e-3, 0.94, 0.89, False, 0.0, 100),
        SizeFit(3e-3, 0.93, 0.70, False, 0.0, 100),
    ]
    diameter, reason = propose_ball(fits)
    assert diameter == 2e-3
    assert reason.startswith("NO SIZE SUITS ALL of the target. Missed are 10% by balls of 1 mm, ")
    assert "11% by balls of 2 mm (taken), 30% by balls of 3 mm: these places are out" in reason
    jams = [SizeFit(1e-3, 1.0, 1.0, True, 0.0, 100), SizeFit(2e-3, 1.0, 1.0, True, 1.988e-3, 100)]
    assert propose_ball(jams)[0] == 1e-3
    assert "BALLS JAM in gaps of 1.988 mm" in propose_ball(jams[1:])[1]


def test_fewer_balls_are_proposed_where_they_serve_nearly_as_much() -> None:
    small = SizeFit(0.5e-3, 1.0, 1.0, True, 0.0, 4000)
    others = [SizeFit(1e-3, 1.0, 0.97, False, 0.0, 1000), SizeFit(2e-3, 1.0, 0.6, False, 0.0, 250)]
    diameter, reason = propose_ball([small, *others])
    assert diameter == 1e-3
    assert "0.5 mm would suit 100%, but take 4 times as many" in reason
    assert propose_ball([small, others[1]])[0] == 0.5e-3


def test_balls_get_into_the_fillets_of_the_target() -> None:
    """A stud whose fillet under the head, of 1.2 mm, is 4 % of what is to be peened.

    A ball of less than 2.4 mm touches all of it, one of 3 mm its edges alone.
    """
    angle = np.linspace(0.0, 0.5 * np.pi, 31)
    fillet = np.c_[7.2 - 1.2 * np.cos(angle), 58.8 + 1.2 * np.sin(angle)]
    profile = np.r_[[[0.0, 0.0], [6.0, 0.0]], fillet, [[10.0, 60.0], [10.0, 68.0], [0.0, 68.0]]]
    stud = trimesh.creation.revolve(1e-3 * profile, sections=90)
    x, y, z = stud.triangles_center.T
    target = (np.hypot(x, y) < 7.3e-3) & (z > 1e-6) & (z < 60.5e-3)
    fits = fit_sizes(part_of(stud, target), (0.5e-3, 1.5e-3, 2e-3, 3e-3))
    of_size = {round(1e3 * one.diameter, 3): one.fillets for one in fits}
    assert of_size[2.0] > 0.9
    assert of_size[3.0] < 0.5
    diameter, reason = propose_ball(fits)
    assert diameter == 2e-3
    assert "larger ones do not get into its fillets" in reason


@pytest.mark.parametrize(("thick_mm", "most_mm"), [(0.6, 0.9), (1.0, 1.5), (20.0, 3.0)])
def test_balls_are_small_beside_thin_metal(thick_mm: float, most_mm: float, tmp_path: Path) -> None:
    """A sheet is bent by large balls; a block takes the largest that are proposed."""
    trimesh.creation.box((60, 40, thick_mm)).export(tmp_path / "sheet.stl")
    made = propose(tmp_path / "sheet.stl", Wanted("mm"), lambda _: [])
    assert 0.6 * most_mm < 1e3 * made.design.shot.diameter <= most_mm
    is_told = "THIN PLACES" in with_thin_places(made).reasons["shot.diameter_mm"]
    assert is_told is (thick_mm < 2.0)


@pytest.mark.parametrize(
    ("width_mm", "nearly"), [(0.62, True), (0.66, True), (0.70, False), (0.42, True), (0.36, False)]
)
def test_a_gap_may_be_off_by_its_tolerance(width_mm: float, nearly: bool) -> None:
    """Balls of 0.5 mm jam from 0.45 to 0.575 mm: a slot is 15 % off, and 0.1 mm at most."""
    block = block_with_slot(width_mm)
    (fit,) = fit_sizes(part_of(block, np.ones(len(block.faces), dtype=bool)), [0.5e-3])
    assert fit.jam == 0.0
    assert bool(fit.nearly_jam) is nearly
    if nearly:
        assert 1e3 * fit.play == pytest.approx(width_mm - 0.5, abs=0.02)


@pytest.mark.parametrize("scale", [1.0, 2.0])
@pytest.mark.parametrize(
    ("served", "chosen", "said"),
    [(0.80, 1.5, "0.5 mm may jam in a gap of"), (0.60, 0.5, "which suit 60%")],
)
def test_a_size_that_may_jam_gives_way_to_one_that_serves_nearly_as_much(
    served: float, chosen: float, said: str, scale: float
) -> None:
    may_jam = SizeFit(0.5e-3 * scale, 1.0, 0.9, False, 0.0, 900, nearly_jam=0.6e-3 * scale)
    sizes = [SizeFit(k * 1e-3, 1.0, 0.9, False, k * 1e-3, 100) for k in np.linspace(1.05, 1.4, 6)]
    free = SizeFit(1.5e-3 * scale, served, served, False, 0.0, 100)
    diameter, reason = propose_ball([may_jam, *sizes, free])
    assert 1e3 * diameter == pytest.approx(chosen * scale)
    assert said.replace("0.5 mm", f"{0.5 * scale:g} mm") in reason
    assert "all sizes from 1.05 mm to 1.4 mm would jam" in reason
    play = [one.sentence for one in clauses(reason)[1] if one.sentence.startswith("PLAY OF")]
    assert len(play) == (chosen == 0.5)


@pytest.mark.parametrize(("ball_mm", "is_cut"), [(0.2, True), (1.0, False)])
def test_a_charge_that_is_cut_for_the_simulation_is_told_in_full(
    ball_mm: float, is_cut: bool, tmp_path: Path
) -> None:
    trimesh.creation.box((50, 40, 10)).export(tmp_path / "block.stl")
    made = propose(tmp_path / "block.stl", Wanted("mm", ball_mm=ball_mm), lambda _: [])
    assert sonotrode_area(made.chamber) > 1e-3
    told = [one.sentence for one in to_settle(made, []) if one.sentence.startswith("CHARGE IS CUT")]
    assert len(told) == made.is_capped == is_cut
    if is_cut:
        full = charge_of(sonotrode_area(made.chamber), 1e-3 * ball_mm)
        assert f"half a layer is {round(full):,} balls" in told[0]
        assert made.design.shot.count < 0.7 * full

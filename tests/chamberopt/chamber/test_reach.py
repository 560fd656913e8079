"""The reach of a ball agrees with closed forms, and no impact falls out of its reach."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.checks.gaps import gap_warnings, pocket_warnings, surface_warnings
from chamberopt.chamber.checks.place_names import PART, PART_SIDE
from chamberopt.chamber.checks.warning import WarningKind
from chamberopt.chamber.part import Part
from chamberopt.chamber.reach import TOLERATED_OVERLAP, Reach, find_reach, reached_part_share
from chamberopt.chamber.scene import build_scene, chamber_mesh
from chamberopt.coverage.field.surface_points import ball_fits
from chamberopt.design.load import load_design
from chamberopt.design.shapes import TAG_PART, TAG_SONOTRODE, TAG_WALL
from chamberopt.geometry.triangles import area_vectors, areas, unit_normals, unit_vectors
from sim_core import TriangleMesh, largest_balls, simulate

DESIGNS = Path(__file__).resolve().parents[3] / "designs"
BALL = 3e-3
R = BALL / 2.0


def block(low: tuple[float, ...], high: tuple[float, ...]) -> trimesh.Trimesh:
    """A box between two corners [mm]."""
    return trimesh.creation.box(bounds=np.array([low, high], dtype=float))


def prism(outline_mm: list[tuple[float, float]], length_mm: float) -> trimesh.Trimesh:
    """A convex outline in x and z [mm], drawn along y from 0."""
    return trimesh.convex.convex_hull([(x, y, z) for x, z in outline_mm for y in (0.0, length_mm)])


ROOM = block((-10, 0, 0), (10, 20, 10))


def cavity(*pieces: trimesh.Trimesh, above_mm: float = 10.0) -> Chamber:
    """The pieces as one cavity over a sonotrode at z = 0.

    All of its surface above a height is the target.
    """
    whole = trimesh.boolean.union(pieces, engine="manifold")
    vertices, triangles = 1e-3 * np.asarray(whole.vertices), np.asarray(whole.faces)
    z = vertices[triangles][..., 2]
    tags = np.full(len(triangles), TAG_WALL, dtype=np.uint8)
    tags[(z > 1e-3 * above_mm + 1e-9).any(axis=1)] = TAG_PART
    tags[(z < 1e-9).all(axis=1)] = TAG_SONOTRODE
    own = np.flatnonzero(tags == TAG_PART)
    source = np.full(len(triangles), -1)
    source[own] = np.arange(len(own))
    area = areas(vertices, triangles[own])
    out_of_part = triangles[own][:, ::-1]
    part = Part(vertices, out_of_part, area, np.ones(len(own), dtype=bool), "niche")
    return Chamber(vertices, triangles, tags, source, 1e-9 * whole.volume, part, area, ())


def reached(chamber: Chamber, ball: float = BALL) -> Reach:
    return find_reach(chamber_mesh(chamber), ball)


def reached_area_mm2(found: Reach, chosen: np.ndarray) -> float:
    """Of the touches chosen (p,)."""
    return 1e6 * float(found.touches.area[chosen & found.reached].sum())


def facing_x(found: Reach) -> np.ndarray:
    """Touches of the part's faces that are square to x."""
    own = found.mesh.tags[found.touches.triangle] == TAG_PART
    return own & (np.abs(found.touches.normal[:, 0]) > 0.999)


def slot(width_mm: float, deep_mm: float = 6.0) -> Chamber:
    return cavity(ROOM, block((-width_mm / 2, 0, 10), (width_mm / 2, 20, 10 + deep_mm)))


@pytest.mark.parametrize("wider", [1.02, 1.1, 1.5])
def test_of_a_slot_wider_than_the_ball_all_but_its_corners_is_touched(wider: float) -> None:
    found = reached(slot(3.0 * wider))
    r = 1.5 * (1.0 - TOLERATED_OVERLAP)  # a ball may reach so much less far into a square corner
    walls = 2 * (20 - 2 * r) * (6 - r)
    assert reached_area_mm2(found, facing_x(found)) == pytest.approx(walls, rel=0.02)


def test_of_a_slot_narrower_than_the_ball_nothing_is_touched_and_it_is_said() -> None:
    chamber = slot(2.4)
    found = reached(chamber)
    assert reached_area_mm2(found, facing_x(found)) == 0.0
    (said,) = gap_warnings(found, chamber, [BALL])
    assert said.subject == (WarningKind.NARROW_GAP, (PART_SIDE, PART_SIDE))
    assert "2.4 mm wide, narrower than a ball of 3 mm: no ball gets in there" in said.text
    assert "the gap of the part's side" in said.text
    (said,) = surface_warnings(found, chamber)
    assert said.text.startswith("100.0% of the target in the chamber (")
    (said,) = surface_warnings(found, chamber, "zone root")
    assert said.subject == (WarningKind.UNTOUCHED, ("zone root",))
    assert said.text.startswith("100.0% of zone root in the chamber (")
    assert said.text.endswith("; or narrow the target of zone root")
    assert not gap_warnings(reached(slot(3.6)), slot(3.6), [BALL])


@pytest.mark.parametrize("half_angle", [12.0, 35.0, 60.0])
def test_a_groove_is_touched_down_to_where_the_ball_lies_on_both_flanks(half_angle: float) -> None:
    """The ball of radius r touches r / tan(a) from the apex, along the flank."""
    a = np.radians(half_angle)
    flank = 1.5 / np.tan(a) + 4.0
    deep, half = flank * np.cos(a), flank * np.sin(a)
    groove = prism([(-half, 10.0), (half, 10.0), (0.0, 10.0 + deep)], 20.0)
    chamber = cavity(ROOM, groove)
    found = reached(chamber)
    flanks = (found.mesh.tags[found.touches.triangle] == TAG_PART) & (
        np.abs(found.touches.normal[:, 1]) < 0.5
    )
    # A reach of TOLERATED_OVERLAP r into the other flank lets the ball sink further by that much /
    # sin(2a).
    first = 1.5 / np.tan(a) - TOLERATED_OVERLAP * 1.5 / np.sin(2 * a)
    wide = 20.0 - 2 * 1.5 * (1.0 - TOLERATED_OVERLAP)
    assert reached_area_mm2(found, flanks) == pytest.approx(2 * wide * (flank - first), rel=0.02)
    touched = found.touches.point[flanks & found.reached]
    lowest = (10.0 + deep - 1e3 * touched[:, 2].max()) / np.cos(a)
    assert lowest == pytest.approx(first, abs=0.1)
    wedges = gap_warnings(found, chamber, [BALL])
    assert any(one.kind is WarningKind.JAM for one in wedges) == (half_angle == 12.0)


def pocket(neck_mm: float) -> Chamber:
    """A room of 8 x 20 x 8 mm above, through a square neck 2 mm long."""
    n = neck_mm / 2
    return cavity(
        ROOM,
        block((-n, 10 - n, 9), (n, 10 + n, 13)),
        block((-4, 0, 12), (4, 20, 20)),
        above_mm=12.5,
    )


@pytest.mark.parametrize(("neck", "open_"), [(2.9, False), (3.05, True), (3.6, True)])
def test_a_pocket_is_reached_through_a_neck_wider_than_the_ball(neck: float, open_: bool) -> None:
    chamber = pocket(neck)
    found = reached(chamber)
    ceiling = (found.touches.normal[:, 2] < -0.9) & (found.touches.point[:, 2] > 19e-3)
    r = 1.5 * (1 - TOLERATED_OVERLAP)
    expected = (8 - 2 * r) * (20 - 2 * r) if open_ else 0.0
    assert reached_area_mm2(found, ceiling) == pytest.approx(expected, rel=0.03)
    said = pocket_warnings(found, chamber)
    assert len(said) == (0 if open_ else 1)
    if said:
        assert said[0].subject == (WarningKind.POCKET, ("a ledge of the wall", PART))
        assert said[0].beginning == "a pocket"
        assert said[0].text.startswith("a pocket around (0.0, 10.0, 16")
        assert "would hold a ball of 3 mm but has no way in" in said[0].text


@pytest.mark.parametrize("radius", [1.2, 1.45, 1.6, 2.5])
def test_a_round_groove_is_touched_if_it_is_rounder_than_the_ball(radius: float) -> None:
    """Half round, 20 mm long: all but a ball's radius at both ends."""
    angle = np.radians(np.arange(0.0, 360.0, 2.5))
    groove = prism([(radius * np.cos(a), 10.0 + radius * np.sin(a)) for a in angle], 20.0)
    chamber = cavity(ROOM, groove, above_mm=10.0 + 1e-3)
    found = reached(chamber)
    own = (found.touches.point[:, 2] > 10.01e-3) & (np.abs(found.touches.normal[:, 1]) < 0.5)
    whole = np.pi * radius * 20.0
    assert 1e6 * found.touches.area[own].sum() == pytest.approx(whole, rel=0.03)
    expected = (20.0 - 3.0 * (1.0 - TOLERATED_OVERLAP)) / 20.0 if radius > 1.5 else 0.0
    assert reached_area_mm2(found, own) / whole == pytest.approx(expected, abs=0.02)


def rounded(sides: int, radius_mm: float, high_mm: float) -> trimesh.Trimesh:
    """A regular prism along y from 0 to 20 mm, whose axis is so high."""
    angle = 2.0 * np.pi * (np.arange(sides) + 0.5) / sides
    return prism([(radius_mm * np.cos(a), high_mm + radius_mm * np.sin(a)) for a in angle], 20.0)


def with_round_normals(
    whole: trimesh.Trimesh, high_mm: float, sign: float
) -> tuple[TriangleMesh, np.ndarray, Callable[[np.ndarray], np.ndarray]]:
    """A cavity, its normals, and the round normal at points of it.

    The normals are round on the facets less than 4 mm from the axis of a prism.

    Args:
        sign: 1 for normals that point away from the axis, -1 for the others.
    """
    vertices, triangles = 1e-3 * np.asarray(whole.vertices), np.asarray(whole.faces)
    sonotrode = (vertices[triangles][..., 2] < 1e-9).all(axis=1)
    tags = np.where(sonotrode, TAG_SONOTRODE, TAG_PART).astype(np.uint8)
    mesh = TriangleMesh(vertices, triangles, tags)

    def off_axis(points: np.ndarray) -> np.ndarray:
        return np.asarray(sign * (points - (0.0, 0.0, 1e-3 * high_mm)) * (1.0, 0.0, 1.0))

    flat = np.repeat(-unit_normals(mesh.corners)[:, None], 3, axis=1)
    off = off_axis(mesh.corners)
    is_round = (np.linalg.norm(off, axis=2) < 4e-3).all(axis=1) & (np.abs(flat[:, 0, 1]) < 0.5)
    normals = np.where(is_round[:, None, None], unit_vectors(off), flat)
    return mesh, normals, lambda points: unit_vectors(off_axis(points))


@pytest.mark.parametrize("sides", [15, 90])
def test_a_convex_edge_of_coarse_facets_is_touched_all_over(sides: int) -> None:
    """Normals of the round surface lean by 12 degrees from the coarse facets at their sides.

    A ball along them would dip into its own facet by 2 % of its radius, though nothing is in the
    way. Balls reach all of the column but for its two ends, by their radius.
    """
    ball = 1e-3  # less than the facets' width, so that its lowest point is over its own facet
    whole = ROOM.difference(rounded(sides, 1.0, 5.0), engine="manifold")
    mesh, normals, smooth = with_round_normals(whole, 5.0, 1.0)
    found = find_reach(mesh, ball, normals=normals)
    touches = found.touches
    own = (normals != normals[:, :1]).any(axis=(1, 2))[touches.triangle]
    share = touches.area[own & found.reached].sum() / touches.area[own].sum()
    assert share == pytest.approx((20.0 - 1.0 + TOLERATED_OVERLAP) / 20.0, abs=0.01)
    middle = own & (np.abs(touches.point[:, 1] - 10e-3) < 8e-3)
    assert found.reached[middle].all()
    assert ball_fits(mesh, touches.point[middle], smooth(touches.point[middle]), 0.5 * ball).all()


@pytest.mark.parametrize("sides", [16, 90])
def test_a_hollow_of_coarse_facets_sharper_than_the_ball_is_not_touched(sides: int) -> None:
    """Half round, and open below: no ball gets in along the round normals nor along the facets'."""
    whole = trimesh.boolean.union([ROOM, rounded(sides, 1.3, 10.0)], engine="manifold")
    mesh, normals, smooth = with_round_normals(whole, 10.0, -1.0)
    found = find_reach(mesh, BALL, normals=normals)
    own = (normals != normals[:, :1]).any(axis=(1, 2))[found.touches.triangle]
    assert own.any()
    assert not found.reached[own].any()
    place = found.touches.point[own]
    assert not ball_fits(mesh, place, smooth(place), R).any()


def test_a_half_sphere_smaller_than_the_ball_is_not_touched() -> None:
    hollow = trimesh.creation.icosphere(subdivisions=3, radius=1.2)
    hollow.vertices += (0.0, 10.0, 10.0)
    found = reached(cavity(ROOM, hollow, above_mm=10.0 + 1e-3))
    own = found.touches.point[:, 2] > 10.01e-3
    assert 1e6 * found.touches.area[own].sum() == pytest.approx(2 * np.pi * 1.2**2, rel=0.03)
    assert reached_area_mm2(found, own) == 0.0


def test_the_largest_ball_at_a_place_is_the_inscribed_one() -> None:
    """The radius is 3 mm in the middle of a 6 mm wide box, and 1 mm at 1 mm from a corner."""
    mesh = chamber_mesh(cavity(block((-3, 0, 0), (3, 40, 40)), above_mm=39.0))
    point = 1e-3 * np.array([[-3.0, 20, 20], [-3.0, 1, 20], [0.0, 20, 0]])
    normal = np.array([[1.0, 0, 0], [1, 0, 0], [0, 0, 1]])
    radius, against, opposite = largest_balls(mesh, point, normal, 10e-3, 1e-9)
    np.testing.assert_allclose(1e3 * radius, [3.0, 1.0, 3.0], rtol=1e-5)
    np.testing.assert_allclose(opposite, [-1.0, 0.0, 0.0], atol=1e-2)
    assert (against >= 0).all()
    radius, against, _ = largest_balls(mesh, point[:1], normal[:1], 2e-3, 1e-9)
    assert radius[0] == 2e-3
    assert against[0] == -1


@pytest.mark.long
def test_smaller_balls_reach_more_of_a_gear() -> None:
    chamber = build_chamber(load_design(DESIGNS / "gear.toml"))
    mesh = chamber_mesh(chamber)
    count = len(chamber.part.triangles)
    target = chamber.part.target
    shares = [
        reached_part_share(find_reach(mesh, d), chamber.source, count)[target]
        for d in (1.5e-3, 2.2e-3, 4e-3)
    ]
    weights = chamber.exposed_area[target]
    means = [np.average(share, weights=weights) for share in shares]
    assert all(more > less + 0.02 for more, less in pairwise(means)), means
    assert means[0] > 0.99  # the fillets of its roots have a radius of 0.76 mm
    assert means[-1] < 0.5


@pytest.mark.long
def test_no_impact_falls_where_no_ball_is_said_to_reach() -> None:
    values = {"process.accuracy.simulated_time_s": 0.1, "process.accuracy.warmup_time_s": 0.02}
    design = load_design(DESIGNS / "gear.toml").changed(values)
    mesh = chamber_mesh(build_chamber(design))
    found = find_reach(mesh, design.shot.diameter)
    impacts = simulate(build_scene(design, mesh, 1)).impacts
    assert len(impacts) > 300
    normal = -area_vectors(mesh.vertices, mesh.triangles)[impacts.triangle]
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    radius = 0.5 * design.shot.diameter
    contact = impacts.position - radius * normal
    reached = found.touches.point[found.reached]
    # Points are as far apart as the spacing on average. On an edge a ball touches beside `contact`.
    assert KDTree(reached).query(contact)[0].max() < 2.0 * found.spacing
    largest = largest_balls(mesh, contact, normal, 2 * radius, TOLERATED_OVERLAP * radius)[0]
    assert (largest >= radius).all()

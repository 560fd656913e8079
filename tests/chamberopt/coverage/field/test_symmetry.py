"""Places that turns about the axis bring to one another are found, and looked at together."""

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.coverage.coverage_from_impacts import find_footprints
from chamberopt.coverage.field import target_field
from chamberopt.coverage.field.smooth_faces import Places
from chamberopt.coverage.field.symmetry import Symmetry, find_symmetry, turn_about_axis
from chamberopt.coverage.field.target_field import WindowSetting, find_target_field
from chamberopt.design.load import load_design
from tests.helpers.synthetic import DESIGNS, chamber_round, plate_design, random_dents

SIDE = 0.02  # m
SETTING = WindowSetting(1e-6, 4000, 2e-3, 0.6e-3)


def cube(symmetric: bool = True, target: np.ndarray | None = None) -> Chamber:
    mesh = trimesh.creation.box((SIDE, SIDE, SIDE))
    for _ in range(3):
        mesh = mesh.subdivide()
    up = mesh.face_normals[:, 2] > 0.5
    return chamber_round(mesh, ~up if target is None else target, symmetric=symmetric)


def copies_of(chamber: Chamber) -> int:
    found = find_symmetry(chamber, chamber_mesh(chamber))
    return found.copies if found else 1


class TestFound:
    def test_are_the_turns_of_part_and_room_together(self) -> None:
        assert copies_of(cube()) == 4
        assert copies_of(cube(symmetric=False)) == 1

    def test_a_target_on_one_side_has_none(self) -> None:
        right = trimesh.creation.box((SIDE, SIDE, SIDE)).subdivide().subdivide().subdivide()
        assert copies_of(cube(target=right.face_normals[:, 0] > 0.5)) == 1
        assert copies_of(cube(target=np.abs(right.face_normals[:, 0]) > 0.5)) == 2

    @pytest.mark.parametrize(("facets", "copies"), [(80, 20), (64, 4), (63, 1)])
    def test_the_gear_has_those_of_teeth_and_facets(self, facets: int, copies: int) -> None:
        gear = load_design(DESIGNS / "gear.toml").changed({"chamber.facets": facets})
        assert copies_of(build_chamber(gear)) == copies

    def test_a_part_beside_the_axis_has_none(self) -> None:
        beside = plate_design().changed({"part.offset_mm.0": 1.0})
        assert copies_of(build_chamber(beside)) == 1


@pytest.mark.parametrize("copies", [2, 3, 7, 20])
def test_each_place_comes_into_the_sector_once_and_near_it_as_often_as_it_is(copies: int) -> None:
    """Against all turns of all places, and distances to many points of the sector."""
    rng = np.random.default_rng(copies)
    chamber = cube()
    symmetry = Symmetry(copies, chamber_mesh(chamber), chamber.source)
    place, margin = rng.uniform(-0.01, 0.01, (300, 3)), 2e-3
    row, turn = symmetry.into_sector(place, margin)
    now = symmetry.turned(place[row], turn)
    half = np.pi / copies
    assert np.array_equal(row[:300], np.arange(300))
    assert (np.abs(np.arctan2(now[:300, 1], now[:300, 0])) <= half + 1e-9).all()
    assert len(np.unique(row * copies + turn)) == len(row)
    found = set(zip(row.tolist(), turn.tolist(), strict=True))
    angle, radius = rng.uniform(-half, half, 4000), rng.uniform(0.0, 0.015, 4000)
    sector = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    for one in range(copies):
        turned = turn_about_axis(place, 2.0 * np.pi * one / copies)[:, :2]
        nearest = np.linalg.norm(turned[:, None] - sector, axis=2).min(axis=1)
        for number in np.flatnonzero(nearest < 0.8 * margin):
            assert (number, one) in found
        for number in np.flatnonzero(nearest > 1.5 * margin):
            assert (number, one) not in found


def test_dents_are_as_dense_and_their_windows_have_as_many_times_more() -> None:
    """On the faces and the edges of a cube, by windows with and without symmetry."""
    chamber, design = cube(), plate_design()
    rng = np.random.default_rng(3)
    hits = random_dents(design, chamber, 2e8 * chamber.exposed_area, rng, 0.3e-3)
    density, dents = {}, {}
    for symmetric in (False, True):
        setting = SETTING._replace(symmetric=symmetric)
        field = find_target_field(chamber, chamber_mesh(chamber), setting)
        found = find_footprints(field, field.gauge, hits)
        points = len(field.gauge.area)
        density[symmetric] = np.bincount(found.point, found.weight, points)
        dents[symmetric] = np.median(np.bincount(found.point, minlength=points))
    assert dents[True] == pytest.approx(4.0 * dents[False], rel=0.05)
    assert density[True].mean() == pytest.approx(density[False].mean(), rel=0.01)
    assert density[True].mean() == pytest.approx(2e8 * np.pi / 4.0 * 0.3e-3**2, rel=0.02)
    assert density[True].std() < 0.6 * density[False].std()  # half, of counts alone


def test_windows_are_as_large_without_the_surface_beyond_their_sector(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """All of the cube can be touched, so no share of a piece is measured at places drawn anew."""
    chamber = cube()
    mesh, setting = chamber_mesh(chamber), SETTING._replace(symmetric=True)
    near = find_target_field(chamber, mesh, setting)
    monkeypatch.setattr(target_field, "_near_windows", lambda _, chosen, *rest: chosen)
    everywhere = find_target_field(chamber, mesh, setting)
    assert len(near.surface.area) < 0.5 * len(everywhere.surface.area)
    for one, other in ((near.gauge, everywhere.gauge), (near.wide, everywhere.wide)):
        np.testing.assert_array_equal(one.area, other.area)


@pytest.mark.parametrize("copies", [2, 5, 16])
def test_triangles_that_reach_the_sector_are_as_many_in_each_turn(copies: int) -> None:
    """A triangle in the sector, or within the margin of it, is never left out."""
    chamber, rng = cube(), np.random.default_rng(copies)
    symmetry, margin = Symmetry(copies, chamber_mesh(chamber), chamber.source), 1e-3
    corners = rng.uniform(-0.01, 0.01, (400, 1, 3)) + rng.normal(0.0, 5e-4, (400, 3, 3))
    reaches = symmetry.reaches_sector(corners, margin)
    shares = rng.dirichlet(np.ones(3), (400, 50))
    places = np.einsum("kps,ksx->kpx", shares, corners)
    angle, radius = np.arctan2(places[..., 1], places[..., 0]), np.hypot(*places[..., :2].T).T
    beyond = np.clip(np.abs(angle) - np.pi / copies, 0.0, np.pi / 2)
    inside = (radius * np.sin(beyond) < margin).any(axis=1)
    assert reaches[inside].all()
    assert inside.sum() > 20
    assert (~reaches).any()


def test_a_pattern_that_has_the_symmetry_stays_as_it_is() -> None:
    """More dents in the middle of each side: the values at places do not move."""
    chamber, design = cube(), plate_design()
    middle = chamber.part.vertices[chamber.part.triangles].mean(axis=1)
    beside = np.sort(np.abs(middle), axis=1)[:, 1]  # the larger of two distances from the middle
    mean = 2e8 * chamber.exposed_area * (beside < 0.25 * SIDE)
    hits = random_dents(design, chamber, mean, np.random.default_rng(4), 0.3e-3)
    field = find_target_field(chamber, chamber_mesh(chamber), SETTING._replace(symmetric=True))
    on_side = [[x, y, 0.0] for x, y in ((0.01, 0.0), (0.0, 0.01), (-0.01, 0.0), (0.0, -0.01))]
    far = [[x, y, 0.007] for x, y, _ in on_side]
    place = np.array([*on_side, *far])
    normal = place * [1.0, 1.0, 0.0] / 0.01
    triangle = np.linalg.norm(middle[None] - place[:, None], axis=2).argmin(axis=1)
    gauge = field.gauge_round(Places(place, normal, field.face[triangle]), field.radius)
    found = find_footprints(field, gauge, hits)
    density = np.bincount(found.point, found.weight, len(place))
    assert density[:4] == pytest.approx(np.full(4, 2e8 * np.pi / 4.0 * 0.3e-3**2), rel=0.1)
    assert np.allclose(density[:4], density[0])
    assert np.allclose(density[4:], 0.0)


def test_points_that_turns_bring_to_one_another_are_one_point() -> None:
    """And no others: not with their normals the other way, and none without symmetry."""
    chamber = cube()
    field = find_target_field(chamber, chamber_mesh(chamber), SETTING._replace(symmetric=True))
    points = field.some_points(300)
    angle = np.repeat(np.arange(4), 300) * np.pi / 2.0
    turned = [turn_about_axis(np.tile(one, (4, 1)), angle) for one in points[:2]]
    face = field.face[field.symmetry.triangles_at(turned[0])] if field.symmetry else points.face
    rows, which = field.distinct(Places(*turned, face))
    assert 300 <= len(rows) <= 303  # one at a border of two sectors, or of two cells, is not seen
    assert (which.reshape(4, 300) == which[:300]).mean() > 0.99
    np.testing.assert_array_equal(which[rows], np.arange(len(rows)))
    opposite = Places(turned[0], np.r_[turned[1][:300], -turned[1][300:]], face)
    assert 600 <= len(field.distinct(opposite)[0]) <= 606

    plain = find_target_field(chamber, chamber_mesh(chamber), SETTING._replace(symmetric=False))
    assert len(plain.distinct(Places(*turned, face))[0]) == 1200

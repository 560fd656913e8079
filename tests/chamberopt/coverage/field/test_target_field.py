"""A chamber's target in windows: what can be touched, and what is out of reach."""

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.errors import InputError
from chamberopt.coverage.field import target_field
from chamberopt.coverage.field.target_field import (
    PIECES_PER_WINDOW,
    TargetField,
    WindowSetting,
    _longest_side,
    find_target_field,
    require_narrow_gauge,
    require_wide_gauge,
    with_whole_part,
)
from chamberopt.geometry.triangles import areas
from tests.helpers.synthetic import chamber_round, plane_chamber

BALL = 3e-3  # m


def setting(
    gauge_mm2: float = 1.0, points: int = 20_000, ball: float = BALL, dent: float = 0.5e-3
) -> WindowSetting:
    return WindowSetting(1e-6 * gauge_mm2, points, ball, dent)


def field_of(chamber, **values: float) -> TargetField:  # type: ignore[no-untyped-def]
    return find_target_field(chamber, chamber_mesh(chamber), setting(**values))


def test_an_open_plane_is_all_in_reach_and_its_windows_have_the_gauges_area() -> None:
    chamber = plane_chamber()
    field = field_of(chamber)
    assert field.reachable == 1.0
    assert field.surface.area.sum() == pytest.approx(225e-6)
    for gauge, radius in ((field.gauge, field.radius), (field.wide, 2.0 * field.radius)):
        place = np.abs(gauge.windows.points.place[:, :2]).max(axis=1)
        inner, border = place < 7.5e-3 - radius, place > 7.5e-3 - 0.05e-3
        assert gauge.area[inner] == pytest.approx(np.pi * radius**2, rel=1e-9)
        assert np.median(gauge.area[border]) == pytest.approx(0.5 * np.pi * radius**2, rel=0.08)
        assert gauge.band is None
    assert field.radius == pytest.approx(np.sqrt(1e-6 / np.pi))


@pytest.mark.parametrize("gauge_mm2", [0.1, 1.0, 10.0])
def test_pieces_are_not_wider_than_a_window(gauge_mm2: float) -> None:
    field = field_of(plane_chamber(), gauge_mm2=gauge_mm2, points=1000)
    sides = field.surface.corners - np.roll(field.surface.corners, 1, axis=1)
    assert np.linalg.norm(sides, axis=2).max() <= 2.0 * field.radius
    assert len(field.surface.area) < 3 * PIECES_PER_WINDOW * 225.0 / gauge_mm2
    assert len(field.gauge.area) == 1000
    assert len(field.wide.area) == 125


def test_a_gauge_too_small_for_the_target_is_refused_with_the_least_that_is_possible() -> None:
    chamber = plane_chamber()
    with pytest.raises(InputError, match=r"process\.accuracy\.gauge_mm2: given 0\.0001") as refused:
        require_wide_gauge(chamber, setting(gauge_mm2=1e-4))
    least = float(str(refused.value).rsplit(" ", 1)[-1])
    assert least == pytest.approx(PIECES_PER_WINDOW * 225.0 / target_field.MAX_PIECES, rel=0.05)
    assert "225 mm²" in str(refused.value)


def test_a_gauge_as_wide_as_the_target_is_refused_with_the_most_that_is_possible() -> None:
    chamber = plane_chamber()
    require_narrow_gauge(chamber, setting(gauge_mm2=112.0))
    for given in (113.0, 225.0, 1e6):
        with pytest.raises(InputError, match=r"process\.accuracy\.gauge_mm2.*at most 112\.5"):
            require_narrow_gauge(chamber, setting(gauge_mm2=given))


def test_of_wide_windows_a_few_tell_all() -> None:
    """The default of 20,000 would make pairs with all dents of the target, without bound."""
    field = field_of(plane_chamber(), gauge_mm2=50.0)
    assert len(field.gauge.area) == 4000
    assert len(field.wide.area) == 1000
    assert len(field_of(plane_chamber(), gauge_mm2=5.0).gauge.area) == 20_000


def hollow_corner(turn: float) -> tuple[trimesh.Trimesh, np.ndarray]:
    """A block with a long valley between two flat sides, and which triangles are its sides."""
    slope, half, deep = np.radians(0.5 * turn), 8e-3, 4e-3
    rise = half * np.tan(slope)
    outline = [(-half, rise), (-half, -deep), (half, -deep), (half, rise), (0.0, 0.0)]
    corners = np.array([(x, y, z) for y in (0.0, 0.04) for x, z in outline])
    quads = [(i, (i + 1) % 5, (i + 1) % 5 + 5, i + 5) for i in range(5)]
    sides = [t for a, b, c, d in quads for t in ((a, c, b), (a, d, c))]
    ends = [(0, 1, 4), (1, 2, 4), (2, 3, 4)]
    ends += [(a + 5, c + 5, b + 5) for a, b, c in ends]
    mesh = trimesh.Trimesh(corners, [*sides, *ends], process=False)
    if mesh.volume < 0.0:
        mesh.invert()
    valley = np.isclose(np.abs(mesh.face_normals[:, 0]), np.sin(slope)) & (
        mesh.face_normals[:, 2] > 0.0
    )
    assert mesh.is_watertight
    return mesh, valley


@pytest.mark.parametrize("turn", [30.0, 70.0, 90.0, 120.0])
def test_beside_a_hollow_corner_two_strips_are_out_of_reach(turn: float) -> None:
    """Each is R tan(turn / 2) wide, less what a ball may overlap."""
    mesh, valley = hollow_corner(turn)
    field = field_of(chamber_round(mesh, valley), points=50_000)
    width = 8e-3 / np.cos(np.radians(0.5 * turn))
    dead = 0.5 * BALL * np.tan(np.radians(0.5 * turn))
    overlap = 0.01 * 0.5 * BALL / np.sin(np.radians(turn))
    assert field.reachable == pytest.approx(1.0 - (dead - 0.5 * overlap) / width, abs=0.003)
    # What cannot be touched is in no window.
    place = field.touched.place
    assert np.hypot(place[:, 0], place[:, 2]).min() >= dead - 1.1 * overlap
    # Smooth valleys are one face, sharp ones two.
    assert len(set(field.drawn_face[valley])) == (1 if turn < 60.0 else 2)


def test_windows_beside_what_is_out_of_reach_are_no_larger_than_what_they_hold() -> None:
    mesh, valley = hollow_corner(90.0)
    field = field_of(chamber_round(mesh, valley), points=50_000)
    gauge = field.gauge
    away = np.hypot(gauge.windows.points.place[:, 0], gauge.windows.points.place[:, 2])
    edge = away < away.min() + 0.02e-3
    full = np.pi * field.radius**2
    middle = np.abs(gauge.windows.points.place[:, 1] - 0.02) < 0.015
    assert np.median(gauge.area[edge & middle]) == pytest.approx(0.5 * full, rel=0.1)
    assert np.median(gauge.area[(away > 3e-3) & (away < 8e-3) & middle]) == pytest.approx(
        full, rel=0.02
    )


def test_a_smaller_ball_reaches_more() -> None:
    mesh, valley = hollow_corner(90.0)
    chamber = chamber_round(mesh, valley)
    shares = [field_of(chamber, ball=ball).reachable for ball in (4e-3, 2e-3, 1e-3)]
    assert shares[0] < shares[1] < shares[2] < 1.0
    assert (1.0 - shares[0]) / (1.0 - shares[2]) == pytest.approx(4.0, rel=0.05)


@pytest.mark.parametrize("splits", [0, 1, 2])
def test_a_box_has_bands_along_its_edges_however_it_is_divided(splits: int) -> None:
    mesh = trimesh.creation.box((8e-3, 10e-3, 12e-3))
    for _ in range(splits):
        mesh = mesh.subdivide()
    field = field_of(chamber_round(mesh))
    band = field.gauge.band
    assert field.reachable == 1.0
    assert band is not None
    # A strip of the dent's radius on both sides of 120 mm of edges, less the corners twice.
    radius = 0.25e-3
    strips = 2.0 * 0.12 * radius - 24 * radius**2
    rows = len(np.unique(band.point)) / len(field.gauge.area) * mesh.area
    assert rows == pytest.approx(strips, rel=0.06)
    assert band.height.max() < radius
    assert len(set(field.creases.line[0, field.pieces.edge])) == 12
    assert field.pieces.length.sum() == pytest.approx(0.12)


def test_creases_where_no_ball_fits_have_no_pieces() -> None:
    """A box with a wall 1 mm beside it: the edges on that side are out of reach."""
    mesh = trimesh.creation.box((8e-3, 8e-3, 8e-3))
    near = chamber_round(mesh, gap=1e-3)
    assert len(field_of(near, ball=3e-3).pieces.edge) == 0
    assert field_of(near, ball=3e-3).reachable == 0.0
    assert field_of(near, ball=0.9e-3).pieces.length.sum() == pytest.approx(12 * 8e-3)


def test_points_of_the_rest_of_the_part_are_for_pictures_alone() -> None:
    chamber = plane_chamber()
    field = field_of(chamber)
    whole = with_whole_part(field, chamber, chamber_mesh(chamber))
    rest = areas(chamber.part.vertices, chamber.part.triangles)[~chamber.part.target].sum()
    assert whole.surface.area.sum() == pytest.approx(225e-6 + rest)
    count = len(field.surface.area)
    np.testing.assert_array_equal(whole.surface.corners[:count], field.surface.corners)
    assert not set(whole.surface.face[count:]) & set(field.surface.face)
    assert whole.reachable == field.reachable
    every = chamber_round(trimesh.creation.box((8e-3,) * 3))
    alone = field_of(every)
    assert with_whole_part(alone, every, chamber_mesh(every)) is alone


def test_some_points_are_spread_over_all() -> None:
    field = field_of(plane_chamber())
    some = field.some_points(500)
    assert len(some.place) == 500
    counts, _, _ = np.histogram2d(some.place[:, 0], some.place[:, 1], bins=5)
    assert counts.std() < 4.5  # 20 on average: at random 4.5
    assert len(field.some_points(10**7).place) == len(field.touched.place)


def test_windows_of_other_dents_are_the_same_and_their_bands_those_of_a_new_field() -> None:
    chamber = chamber_round(trimesh.creation.box((0.01, 0.01, 0.01)))
    dents, wider = 0.2e-3, 0.5e-3
    field, new = (field_of(chamber, points=2000, dent=dent) for dent in (dents, wider))
    measured = field.gauge
    other = field.with_largest_dent(wider).gauge
    assert np.array_equal(other.area, new.gauge.area)
    assert np.array_equal(other.area, measured.area)
    bands = [one.band for one in (measured, other, new.gauge)]
    assert all(bands)
    before, now, wanted = bands
    assert len(now.point) > len(before.point)
    for column in ("point", "height", "length"):
        assert np.array_equal(getattr(now, column), getattr(wanted, column))
    assert field.with_largest_dent(dents) is field


def test_a_piece_is_as_long_as_a_window_or_a_ball_unless_there_are_too_many() -> None:
    for gauge, ball in ((np.pi * 1e-6, 9e-3), (np.pi * 1e-4, 2e-3)):
        setting = WindowSetting(gauge, 100, ball, 1e-3)
        assert _longest_side(setting, 1e-9, 1e9) == pytest.approx(2e-3)
        # Twice the count needs half the area each; a window has six pieces at most.
        few = _longest_side(setting, 1.0, 1000.0)
        assert np.pi * (0.5 * few) ** 2 == pytest.approx(PIECES_PER_WINDOW * 1e-3)
        assert _longest_side(setting, 1.0, 4000.0) == pytest.approx(0.5 * few)


@pytest.mark.parametrize("count", [1, 2, 7, 10_000])
def test_some_points_go_from_the_first_to_the_last(count: int) -> None:
    field = field_of(plane_chamber(), points=1000)
    found = field.some_points(count).place
    there = field.touched.place
    assert len(found) == min(count, len(there))
    np.testing.assert_array_equal(found[0], there[0])
    np.testing.assert_array_equal(found[-1], there[-1 if count > 1 else 0])

"""Windows against all pairs by brute force, and areas that are known."""

import numpy as np
import pytest
import trimesh

from chamberopt.coverage.field import windows as windows_module
from chamberopt.coverage.field.windows import (
    Places,
    Windows,
    add_columns,
    add_powers,
    add_to_levels,
    multiply_products,
)

UP = np.array([0.0, 0.0, 1.0])


def on_plane(rng: np.random.Generator, count: int, faces: int = 1) -> Places:
    """Random places on a square of side 10, on faces that they belong to at random."""
    place = np.column_stack([rng.uniform(0.0, 10.0, (count, 2)), np.zeros(count)])
    return Places(place, np.tile(UP, (count, 1)), rng.integers(0, faces, count))


def found_pairs(windows: Windows, contacts: Places) -> set[tuple[int, int]]:
    pairs = [
        (int(point), int(contact))
        for some in windows.pairs(contacts)
        for point, contact in zip(*some, strict=True)
    ]
    assert len(set(pairs)) == len(pairs)
    return set(pairs)


@pytest.mark.parametrize("radius", [0.3, 1.7, 20.0])
def test_pairs_on_a_plane_are_those_nearer_than_the_radius_on_the_same_face(radius: float) -> None:
    rng = np.random.default_rng(1)
    points, contacts = on_plane(rng, 300, faces=2), on_plane(rng, 200, faces=2)
    gap = np.linalg.norm(points.place[:, None] - contacts.place, axis=2)
    inside = (gap < radius) & (points.face[:, None] == contacts.face)
    wanted = set(zip(*(index.tolist() for index in np.nonzero(inside)), strict=True))
    assert found_pairs(Windows(points, radius), contacts) == wanted


def test_pairs_come_in_pieces_that_bound_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(2)
    points, contacts = on_plane(rng, 100), on_plane(rng, 100)
    whole = found_pairs(Windows(points, 3.0), contacts)
    monkeypatch.setattr(windows_module, "PAIRS_AT_ONCE", 150)
    windows = Windows(points, 3.0)
    assert found_pairs(windows, contacts) == whole
    assert len(list(windows.pairs(contacts))) > len(whole) // 150


def test_a_coarse_grid_finds_the_same_pairs(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(8)
    points, contacts = on_plane(rng, 100, faces=3), on_plane(rng, 100, faces=4)
    fine = found_pairs(Windows(points, 0.5), contacts)
    monkeypatch.setattr(windows_module, "MAX_CELLS", 10)
    assert found_pairs(Windows(points, 0.5), contacts) == fine


@pytest.mark.parametrize("at_once", [150, 100_000])
def test_shares_are_sizes_over_areas_of_the_windows(
    at_once: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(windows_module, "PAIRS_AT_ONCE", at_once)
    rng = np.random.default_rng(9)
    points, contacts = on_plane(rng, 100), on_plane(rng, 100)
    size, area = rng.uniform(1.0, 2.0, 100), rng.uniform(3.0, 4.0, 100)
    windows = Windows(points, 3.0)
    point, share = windows.shares(contacts, size, area)
    wanted = [(p, size[c] / area[p]) for p, c in found_pairs(windows, contacts)]
    assert sorted(zip(point.tolist(), share.tolist(), strict=True)) == sorted(wanted)
    none = windows.shares(contacts.select(slice(0, 0)), size[:0], area)
    assert [len(one) for one in none] == [0, 0]


def test_powers_levels_and_columns_are_added_to_their_points() -> None:
    point, contact = np.array([1, 0, 1], dtype=np.int32), np.array([0, 1, 1], dtype=np.int32)
    powers = np.zeros((2, 3))
    add_powers(point, np.array([0.5, 2.0, 3.0]), powers)
    assert powers.tolist() == [[1.0, 2.0, 4.0], [2.0, 3.5, 9.25]]
    columns = np.zeros((2, 2))
    add_columns(point, contact, np.array([[1.0, 10.0], [2.0, 20.0]]), columns)
    assert columns.tolist() == [[2.0, 20.0], [3.0, 30.0]]
    histogram = np.zeros((2, 3))
    add_to_levels(point, contact, np.array([5.0, 7.0]), np.array([2, 0]), histogram)
    assert histogram.tolist() == [[7.0, 0.0, 0.0], [7.0, 0.0, 5.0]]


def test_contacts_outside_the_grid_of_the_points_are_in_their_windows_too() -> None:
    points = Places(np.zeros((1, 3)), UP[None], np.zeros(1, dtype=int))
    angle = np.linspace(0.0, 2.0 * np.pi, 50)
    ring = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    normal, face = np.tile(UP, (50, 1)), np.zeros(50, dtype=int)
    windows = Windows(points, 1.0)
    assert len(found_pairs(windows, Places(0.999 * ring, normal, face))) == 50
    assert not found_pairs(windows, Places(1.001 * ring, normal, face))


def test_the_two_sides_of_a_thin_plate_do_not_see_each_other() -> None:
    rng = np.random.default_rng(3)
    above = on_plane(rng, 200)
    below = Places(above.place - [0.0, 0.0, 0.01], -above.normal, above.face)
    windows = Windows(above, 1.0)
    assert len(found_pairs(windows, above)) > 200
    assert not found_pairs(windows, below)


@pytest.mark.parametrize("turn", [10.0, 35.0, 90.0, 150.0, -55.0])
def test_distance_round_an_edge_is_that_of_the_unfolded_surface(turn: float) -> None:
    """Two half-planes meet in the y axis; unfolded they are one plane."""
    rng = np.random.default_rng(4)
    flat = rng.uniform(-2.0, 2.0, (400, 2))
    beyond = flat[:, 0] > 0.0
    angle = np.where(beyond, np.radians(turn), 0.0)
    bent = np.stack([flat[:, 0] * np.cos(angle), flat[:, 1], -flat[:, 0] * np.sin(angle)], axis=1)
    normal = np.stack([np.sin(angle), 0.0 * angle, np.cos(angle)], axis=1)
    places = Places(bent, normal, np.zeros(400, dtype=int))
    gap = np.linalg.norm(flat[:, None] - flat, axis=2)
    wanted = set(zip(*(index.tolist() for index in np.nonzero(gap < 0.8)), strict=True))
    assert found_pairs(Windows(places, 0.8), places) == wanted


def test_windows_round_a_faceted_cylinder_are_those_of_the_round_one() -> None:
    """All distances are within a few percent of the way along the surface."""
    rng = np.random.default_rng(5)
    facets, radius = 24, 1.0
    at, z = rng.uniform(0.0, 2.0 * np.pi, 800), rng.uniform(-2.0, 2.0, 800)
    middle = (np.floor(at / (2.0 * np.pi) * facets) + 0.5) * 2.0 * np.pi / facets
    normal = np.stack([np.cos(middle), np.sin(middle), 0.0 * z], axis=1)
    along = np.stack([-np.sin(middle), np.cos(middle), 0.0 * z], axis=1)
    place = normal * radius + np.tan(at - middle)[:, None] * along + z[:, None] * [0.0, 0.0, 1.0]
    places = Places(place, normal, np.zeros(800, dtype=int))
    turned = np.abs(np.angle(np.exp(1j * (at[:, None] - at))))
    gap = np.hypot(radius * turned, z[:, None] - z)
    pairs = np.zeros((800, 800), dtype=bool)
    pairs[tuple(zip(*found_pairs(Windows(places, 0.5), places), strict=True))] = True
    assert not pairs[gap > 0.515].any()
    assert pairs[gap < 0.485].all()


def test_a_window_in_a_plane_has_its_own_area_and_at_a_border_half_of_it() -> None:
    side = np.arange(0.0125, 10.0, 0.025)
    u, v = (grid.ravel() for grid in np.meshgrid(side, side))
    quadrature = Places(
        np.stack([u, v, 0.0 * u], axis=1), np.tile(UP, (len(u), 1)), np.zeros(len(u), dtype=int)
    )
    middles = np.array([[5.0, 5.0, 0.0], [4.321, 6.789, 0.0], [0.0, 5.0, 0.0], [0.0, 0.0, 0.0]])
    points = Places(middles, np.tile(UP, (4, 1)), np.zeros(4, dtype=int))
    area = Windows(points, 0.7).sums(quadrature, np.full(len(u), 0.025**2))
    full = np.pi * 0.7**2
    assert area == pytest.approx([full, full, full / 2, full / 4], rel=0.02)


def test_sums_add_the_values_of_all_contacts() -> None:
    rng = np.random.default_rng(6)
    points, contacts = on_plane(rng, 50), on_plane(rng, 60)
    values = rng.normal(size=60)
    inside = np.linalg.norm(points.place[:, None] - contacts.place, axis=2) < 2.0
    assert Windows(points, 2.0).sums(contacts, values) == pytest.approx(inside @ values)


def test_without_points_or_contacts_there_are_no_pairs() -> None:
    some = on_plane(np.random.default_rng(7), 5)
    none = some.select(slice(0, 0))
    assert not found_pairs(Windows(none, 1.0), some)
    assert not found_pairs(Windows(some, 1.0), none)


def test_windows_follow_the_mesh_of_a_sphere_closely_enough() -> None:
    """The share of an icosphere's points in a window is that of a cap of the same radius."""
    sphere = trimesh.creation.icosphere(subdivisions=4)
    middles, normals = sphere.triangles_center, sphere.face_normals
    places = Places(middles, np.asarray(normals), np.zeros(len(middles), dtype=int))
    area = Windows(places, 0.4).sums(places, np.asarray(sphere.area_faces))
    assert area.mean() == pytest.approx(2.0 * np.pi * (1.0 - np.cos(0.4)), rel=0.03)
    assert area.std() < 0.03 * area.mean()


def test_products_take_each_dent_once_and_never_turn_negative() -> None:
    products = np.ones((3, 2))
    point, weight = np.array([0, 0, 2, 2]), np.array([0.1, 0.2, 0.5, 0.9])
    multiply_products(products, point, weight, np.array([1.0, 2.0]))
    assert products == pytest.approx(np.array([[0.9 * 0.8, 0.8 * 0.6], [1.0, 1.0], [0.05, 0.0]]))

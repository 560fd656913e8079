"""Points are spread evenly, and balls fit where geometry says so."""

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.reach import TOLERATED_OVERLAP
from chamberopt.coverage.field.surface_points import ball_fits, spread_points, spread_within
from chamberopt.geometry.triangles import areas, unit_normals
from sim_core import TriangleMesh

R = 1.5e-3  # m, of the ball


def graded_sheet() -> trimesh.Trimesh:
    """A square of side 1 whose triangles are 1,000 times as large on one side as on the other."""
    x = np.linspace(0.0, 1.0, 31) ** 3
    grid = np.array([(a, b, 0.0) for a in x for b in x])
    corner = np.array([31 * i + j for i in range(30) for j in range(30)])
    lower = np.stack([corner, corner + 31, corner + 1], axis=1)
    upper = np.stack([corner + 1, corner + 31, corner + 32], axis=1)
    return trimesh.Trimesh(grid, np.concatenate([lower, upper]), process=False)


def prism(outline: list[tuple[float, float]], length: float) -> TriangleMesh:
    """A convex cavity: an outline in x and z [m], drawn along y from 0."""
    hull = trimesh.convex.convex_hull([(x, y, z) for x, z in outline for y in (0.0, length)])
    return TriangleMesh(hull.vertices, hull.faces, np.zeros(len(hull.faces), dtype=np.uint8))


def test_every_triangle_has_as_many_points_as_its_area_asks_for() -> None:
    sheet = graded_sheet()
    area = areas(sheet.vertices, sheet.faces)
    found = spread_points(np.asarray(sheet.vertices), np.asarray(sheet.faces), area, 5000)
    count = np.bincount(found.triangle, minlength=len(area))
    assert len(found.place) == count.sum() == 5000
    assert np.abs(count - 5000 * area / area.sum()).max() <= 1.0
    assert np.allclose(found.normal, [0.0, 0.0, 1.0])


def test_points_are_spread_more_evenly_than_at_random() -> None:
    """In each of 100 cells there are 50 points; at random they would scatter by 7."""
    sheet = graded_sheet()
    vertices, triangles = np.asarray(sheet.vertices), np.asarray(sheet.faces)
    found = spread_points(vertices, triangles, areas(vertices, triangles), 5000)
    counts, _, _ = np.histogram2d(
        found.place[:, 0], found.place[:, 1], bins=10, range=[[0.0, 1.0], [0.0, 1.0]]
    )
    assert counts.mean() == 50.0
    assert counts.std() < 3.5


def test_points_are_within_their_triangles_and_the_same_every_time() -> None:
    ball = trimesh.creation.icosphere(subdivisions=1)
    vertices, triangles = np.asarray(ball.vertices), np.asarray(ball.faces)
    area = areas(vertices, triangles)
    found = spread_points(vertices, triangles, area, 800)
    a, b, c = vertices[triangles[found.triangle]].transpose(1, 0, 2)
    inside = trimesh.triangles.points_to_barycentric(np.stack([a, b, c], axis=1), found.place)
    assert inside.min() >= -1e-9
    assert np.abs(inside @ np.ones(3) - 1.0).max() < 1e-9
    again = spread_points(vertices, triangles, area, 800)
    np.testing.assert_array_equal(found.place, again.place)
    # What has no area gets no point.
    half = np.where(ball.triangles_center[:, 2] > 0.0, area, 0.0)
    upper = spread_points(vertices, triangles, half, 300)
    assert (half[upper.triangle] > 0.0).all()
    assert len(upper.place) == 300


def test_each_triangle_has_a_point_of_its_own_and_more_if_it_is_large() -> None:
    sheet = graded_sheet()
    vertices, triangles = np.asarray(sheet.vertices), np.asarray(sheet.faces)
    area = areas(vertices, triangles)
    found = spread_within(vertices, triangles, area, 1e-4, 100_000)
    count = np.bincount(found.triangle, minlength=len(area))
    np.testing.assert_array_equal(count, 1 + (area / 1e-4).astype(int))
    small = np.flatnonzero(count == 1)
    first = found.place[np.searchsorted(found.triangle, small)]
    assert np.allclose(first, vertices[triangles[small]].mean(axis=1))
    few = spread_within(vertices, triangles, area, 1e-9, 1000)
    assert len(few.place) <= len(area) + 1000
    none = spread_within(vertices, triangles, 0.0 * area, 1e-4, 1000)
    assert len(none.place) == 0


@pytest.mark.parametrize("turn", [30.0, 60.0, 90.0, 120.0, 150.0])
def test_the_strip_beside_a_hollow_corner_is_as_wide_as_the_ball_touches_both_walls(
    turn: float,
) -> None:
    """Where a surface turns by an angle towards the ball, R tan(turn / 2) stays out of reach."""
    angle = np.radians(180.0 - turn)  # between the walls
    far = 0.05
    cavity = prism([(0.0, 0.0), (far, 0.0), (far * np.cos(angle), far * np.sin(angle))], far)
    x = np.linspace(1e-6, 8.0 * R, 20_001)
    places = np.stack([x, np.full_like(x, 0.5 * far), 0.0 * x], axis=1)
    fits = ball_fits(cavity, places, np.tile([0.0, 0.0, 1.0], (len(x), 1)), R)
    strip = x[fits][0]
    exact = R * np.tan(np.radians(0.5 * turn))
    assert exact - TOLERATED_OVERLAP * R / np.sin(angle) - 1e-6 <= strip <= exact + 1e-6
    beyond = x < 2.0 * exact
    assert (fits[beyond] == (x[beyond] >= strip)).all()


def test_in_a_slot_narrower_than_the_ball_it_touches_no_wall() -> None:
    for width, there in ((2.1 * R, True), (1.9 * R, False)):
        slot = prism([(0.0, 0.0), (width, 0.0), (width, 0.02), (0.0, 0.02)], 0.02)
        place, normal = np.array([[0.0, 0.01, 0.01]]), np.array([[1.0, 0.0, 0.0]])
        assert ball_fits(slot, place, normal, R)[0] == there


def test_places_that_are_not_on_the_surface_of_the_cavity_never_fit() -> None:
    """The plane of the ceiling goes on outside: a ball there is at any distance from a wall."""
    room = prism([(0.0, 0.0), (0.04, 0.0), (0.04, 0.02), (0.0, 0.02)], 0.04)
    x = 0.04 + R * np.concatenate([np.linspace(0.0, 3.0, 3001)[1:], [0.991, 0.995, 0.999]])
    ceiling = np.stack([x, np.full_like(x, 0.02), np.full_like(x, 0.02)], axis=1)
    for z in (-1.0, 1.0):
        assert not ball_fits(room, ceiling, np.tile([0.0, 0.0, z], (len(x), 1)), R).any()
    inside = np.random.default_rng(1).uniform(
        [0.004, 0.004, 0.004], [0.036, 0.036, 0.016], (500, 3)
    )
    assert not ball_fits(room, inside, np.tile([0.0, 0.0, 1.0], (500, 1)), R).any()


def test_whether_a_ball_fits_does_not_depend_on_the_order_of_triangles() -> None:
    """In a box of twelve triangles a ball fits at the middle of each, whichever of them is first.

    A place off the surface is nowhere near, and a ball larger than the room fits nowhere.
    """
    room = prism([(0.0, 0.0), (8 * R, 0.0), (8 * R, 8 * R), (0.0, 8 * R)], 8 * R)
    for first in range(len(room.triangles)):
        order = np.roll(np.arange(len(room.triangles)), first)
        mesh = TriangleMesh(room.vertices, room.triangles[order], room.tags)
        middle, into = mesh.corners.mean(axis=1), -unit_normals(mesh.corners)
        assert ball_fits(mesh, middle, into, R).all()
        assert not ball_fits(mesh, middle + 0.1 * R * into, into, R).any()
        assert not ball_fits(mesh, middle, into, 4.1 * R).any()

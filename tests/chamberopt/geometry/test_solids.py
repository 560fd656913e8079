"""Solids against closed volumes, and the traps of the library underneath."""

import numpy as np
import pytest
import trimesh

from chamberopt.common.errors import InputError
from chamberopt.geometry.slivers import MIN_HEIGHT, remove_slivers
from chamberopt.geometry.solids import (
    GRID_MM,
    Solid,
    SolidSurface,
    find_cavities,
    make_solid,
    snap_to_grid,
    subtract,
    unite,
)
from chamberopt.geometry.triangles import find_shells, heights, tetrahedron_volumes, winding_number


def box(
    size: tuple[float, float, float], at: tuple[float, float, float] = (0, 0, 0), name: str = "box"
) -> Solid:
    mesh = trimesh.creation.box(size)
    return make_solid(mesh.vertices + np.asarray(at), np.asarray(mesh.faces), name)


def test_a_box_less_a_box_knows_where_each_triangle_comes_from() -> None:
    outer, inner = box((0.04, 0.04, 0.04)), box((0.01, 0.01, 0.1))

    surface = subtract(outer, inner).surface()

    assert set(np.unique(surface.solid)) == {outer.label, inner.label}
    volume = tetrahedron_volumes(surface.vertices, surface.triangles).sum()
    assert volume == pytest.approx(0.04**3 - 0.01 * 0.01 * 0.04, rel=1e-12)
    hole = surface.select(surface.solid == inner.label)
    assert np.allclose(
        np.abs(hole.vertices[:, :2]).max(axis=1), 0.005, atol=1e-12
    )  # on the inner box's sides
    assert len(np.unique(hole.source)) == 8


def test_making_a_solid_keeps_every_triangle_of_the_user() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.01)

    surface = make_solid(mesh.vertices, np.asarray(mesh.faces), "ball").surface()

    assert sorted(surface.source) == list(range(len(mesh.faces)))


def test_the_grid_moves_nothing_by_more_than_half_a_nanometre() -> None:
    points = np.random.default_rng(1).uniform(-0.1, 0.1, (1000, 3))

    assert np.abs(snap_to_grid(points) - points).max() <= 0.5001 * GRID_MM * 1e-3
    assert (snap_to_grid(snap_to_grid(points)) == snap_to_grid(points)).all()


def test_an_inside_out_solid_is_refused_because_subtracting_it_would_add() -> None:
    mesh = trimesh.creation.box((0.01, 0.01, 0.01))

    with pytest.raises(InputError, match="inside out"):
        make_solid(mesh.vertices, np.asarray(mesh.faces)[:, ::-1], "knob.stl")


def test_an_open_surface_is_refused_and_not_taken_for_nothing() -> None:
    mesh = trimesh.creation.box((0.01, 0.01, 0.01))

    with pytest.raises(InputError, match=r"knob\.stl.*closed"):
        make_solid(mesh.vertices, np.asarray(mesh.faces)[1:], "knob.stl")


def test_overlapping_bodies_count_once() -> None:
    whole = box((0.1, 0.1, 0.1))
    cross = unite([box((0.02, 0.01, 0.01)), box((0.01, 0.02, 0.01))], "cross")

    assert cross.volume == pytest.approx(3e-6, rel=1e-12)
    assert subtract(whole, cross).volume == pytest.approx(1e-3 - 3e-6, rel=1e-12)


def test_a_wall_cuts_a_room_in_two_and_an_island_stays_with_its_room() -> None:
    whole = box((0.04, 0.04, 0.04))
    wall_and_island = unite(
        [box((0.1, 0.1, 0.002), (0, 0, 0.005)), box((0.004, 0.004, 0.004), (0, 0, -0.008))], "two"
    )

    surface = subtract(whole, wall_and_island).surface()
    rooms = find_cavities(surface)

    volumes = [
        tetrahedron_volumes(surface.vertices, surface.triangles[room]).sum() for room in rooms
    ]
    low, high, island = 0.04**2 * 0.024, 0.04**2 * 0.014, 0.004**3
    assert volumes == pytest.approx([low - island, high], rel=1e-9)
    assert np.sum(rooms) == len(surface.triangles)


def test_pieces_of_a_surface_and_their_volumes() -> None:
    a, b = trimesh.creation.box((1, 1, 1)), trimesh.creation.box((2, 2, 2))
    vertices = np.r_[a.vertices, b.vertices + 5.0]
    triangles = np.r_[a.faces, np.asarray(b.faces)[:, ::-1] + len(a.vertices)]

    shells, volumes = find_shells(vertices, triangles)

    assert (np.bincount(shells) == 12).all()
    assert sorted(volumes) == pytest.approx([-8.0, 1.0])


def test_the_winding_number_tells_inside_from_outside() -> None:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=1.0)
    points = np.array([[0.0, 0.0, 0.0], [0.7, 0.1, 0.0], [1.5, 0.0, 0.0], [0.0, -9.0, 3.0]])

    assert winding_number(points, ball.vertices[ball.faces]) == pytest.approx(
        [1, 1, 0, 0], abs=1e-12
    )


def split_box(apex: float) -> SolidSurface:
    """A unit box [cm] with one triangle split in three around a point `apex` [m] off its longest edge."""
    mesh = trimesh.creation.box((0.01, 0.01, 0.01))
    triangles = np.asarray(mesh.faces)
    a, b, c = triangles[0]
    sides = [(a, b, c), (b, c, a), (c, a, b)]
    a, b, c = max(
        sides, key=lambda side: np.linalg.norm(mesh.vertices[side[1]] - mesh.vertices[side[0]])
    )
    corners = mesh.vertices[[a, b, c]]
    middle = 0.4 * corners[0] + 0.6 * corners[1]
    towards = corners[2] - middle
    new = len(mesh.vertices)
    vertices = np.r_[mesh.vertices, [middle + apex * towards / np.linalg.norm(towards)]]
    triangles = np.r_[[(a, b, new), (b, c, new), (c, a, new)], triangles[1:]].astype(np.int32)
    source = np.r_[[0, 0, 0], np.arange(1, 12)].astype(np.int32)
    return SolidSurface(vertices, triangles, np.ones(14, dtype=np.int64), source)


@pytest.mark.parametrize("apex", [0.0, 1e-13, 5e-10])
def test_a_cap_is_handed_to_its_neighbour_without_opening_the_surface(apex: float) -> None:
    surface = split_box(apex)
    assert (heights(surface.vertices, surface.triangles) < MIN_HEIGHT).sum() == 1

    cleaned, found, left = remove_slivers(surface)

    mesh = trimesh.Trimesh(cleaned.vertices, cleaned.triangles, process=False)
    assert (found, left) == (1, 0)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(1e-6, rel=1e-6)
    assert heights(cleaned.vertices, cleaned.triangles).min() > 1e-3
    for source in range(12):  # still as much of every face's surface
        assert mesh.area_faces[cleaned.source == source].sum() == pytest.approx(5e-5, rel=1e-6)


def test_a_needle_is_closed_by_merging_its_short_edge() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=0.01)
    vertices, triangles = np.asarray(mesh.vertices).copy(), np.asarray(mesh.faces)
    a, b = triangles[0][:2]
    vertices[b] = vertices[a] + [1e-13, 0, 0]
    surface = SolidSurface(
        vertices, triangles, np.ones(len(triangles), np.int64), np.arange(len(triangles))
    )

    cleaned, found, left = remove_slivers(surface)

    closed = trimesh.Trimesh(cleaned.vertices, cleaned.triangles, process=False)
    assert (found, left) == (2, 0)
    assert closed.is_watertight
    assert len(closed.faces) == len(triangles) - 2
    assert closed.volume == pytest.approx(
        trimesh.Trimesh(vertices, triangles, process=False).volume, rel=1e-9
    )


def test_a_surface_without_slivers_is_left_alone() -> None:
    surface = box((0.01, 0.01, 0.01)).surface()

    assert remove_slivers(surface) == (surface, 0, 0)

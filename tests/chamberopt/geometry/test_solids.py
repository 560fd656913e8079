"""Solids against known volumes, and known traps of manifold3d."""

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold

from chamberopt.common.errors import InputError
from chamberopt.geometry.solids import (
    GRID_MM,
    Solid,
    find_cavities,
    make_solid,
    passes_opening,
    snap_to_grid,
    subtract,
    unite,
)
from chamberopt.geometry.triangles import tetrahedron_volumes


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


@pytest.mark.parametrize("larger", [1.0, 5.0])
@pytest.mark.parametrize(
    ("low", "high", "aside", "passes"),
    [
        (4.0, 10.0, 0.0, (True, False)),  # a pin under a head, which goes in from above
        (10.0, 4.0, 0.0, (False, True)),  # a lid goes over a pin that stands on a foot
        (10.0, 10.0, 0.0, (False, False)),
        (5.0, 5.2, 0.0, (True, True)),  # by its clearance
        (4.0, 4.0, 3.0, (False, False)),  # as wide, but not below each other
    ],
)
def test_what_is_beside_an_opening_does_not_pass_it(
    low: float, high: float, aside: float, passes: tuple[bool, bool], larger: float
) -> None:
    """A round of 5 mm radius in the opening, and other ones below and above it [mm]."""
    body = Manifold.cylinder(10, 5, circular_segments=64)
    body += Manifold.cylinder(10, low, circular_segments=64).translate([aside, 0, -9])
    body += Manifold.cylinder(10, high, circular_segments=64).translate([-aside, 0, 9])
    mesh = body.to_mesh()
    vertices = 1e-3 * larger * mesh.vert_properties.astype(float)
    found = passes_opening(vertices, mesh.tri_verts, 5e-3 * larger, 0.3e-3 * larger)
    assert found == passes

"""Slivers are removed, and the surface stays closed with the same volume and area."""

import numpy as np
import pytest
import trimesh

from chamberopt.geometry.slivers import MIN_HEIGHT, remove_slivers
from chamberopt.geometry.solids import SolidSurface, make_solid
from chamberopt.geometry.triangles import heights


def slivers(surface: SolidSurface) -> int:
    """Number of triangles lower than MIN_HEIGHT."""
    return int((heights(surface.vertices, surface.triangles) < MIN_HEIGHT).sum())


def split_box(apex: float) -> SolidSurface:
    """A box of 1 cm with one of its triangles split in three.

    The common corner of the three is a point ``apex`` [m] away from the longest edge of the
    triangle.
    """
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
    assert slivers(surface) == 1

    cleaned = remove_slivers(surface)

    mesh = trimesh.Trimesh(cleaned.vertices, cleaned.triangles, process=False)
    assert slivers(cleaned) == 0
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

    cleaned = remove_slivers(surface)

    closed = trimesh.Trimesh(cleaned.vertices, cleaned.triangles, process=False)
    assert (slivers(surface), slivers(cleaned)) == (2, 0)
    assert closed.is_watertight
    assert len(closed.faces) == len(triangles) - 2
    assert closed.volume == pytest.approx(
        trimesh.Trimesh(vertices, triangles, process=False).volume, rel=1e-9
    )


def test_a_surface_without_slivers_is_left_alone() -> None:
    mesh = trimesh.creation.box((0.01, 0.01, 0.01))
    surface = make_solid(mesh.vertices, np.asarray(mesh.faces), "box").surface()

    assert remove_slivers(surface) is surface

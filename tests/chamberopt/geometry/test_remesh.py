"""Remeshing keeps the surface, reaches the wanted size and makes no slivers."""

import numpy as np
import pytest
import shapely
import trimesh

from chamberopt.geometry.remesh import remesh, triangle_quality


def plate_with_hole() -> trimesh.Trimesh:
    """A plate 60 x 40 x 10 with a hole of 24 flat sides, in long thin triangles as from CAD."""
    outline = shapely.box(0, 0, 60, 40).difference(shapely.Point(20, 20).buffer(6.0, quad_segs=6))
    rings = [np.array(ring.coords)[:-1] for ring in (outline.exterior, *outline.interiors)]
    points = np.concatenate(rings)
    triangles = []
    for piece in shapely.constrained_delaunay_triangles(outline).geoms:
        corners = np.array(piece.exterior.coords)[:3]
        row = [int(np.argmin(np.linalg.norm(points - corner, axis=1))) for corner in corners]
        a, b, c = points[row]
        triangles.append(
            row if np.cross(np.append(b - a, 0), np.append(c - a, 0))[2] > 0 else row[::-1]
        )
    n, top = len(points), np.array(triangles)
    faces = [*top + n, *top[:, ::-1]]
    start = 0
    for ring in rings:
        at = start + np.arange(len(ring))
        after = np.roll(at, -1)
        signed = shapely.LinearRing(ring).is_ccw == (start == 0)
        a, b = (at, after) if signed else (after, at)
        faces += [*np.stack([a, b, b + n], axis=1), *np.stack([a, b + n, a + n], axis=1)]
        start += len(ring)
    solid = np.concatenate([np.c_[points, np.zeros(n)], np.c_[points, np.full(n, 10.0)]])
    mesh = trimesh.Trimesh(solid, np.array(faces), process=False)
    trimesh.repair.fix_normals(mesh)
    return mesh


BOX = trimesh.creation.box((20, 30, 40))
SHAPES = {
    "box": (BOX, 3.0, 0.6),
    "cylinder of strips": (trimesh.creation.cylinder(10, 50, sections=48), 2.0, 0.5),
    "plate with a hole": (plate_with_hole(), 2.0, 0.3),
}


@pytest.mark.parametrize("name", list(SHAPES))
def test_the_surface_stays_and_the_triangles_get_the_size(name: str) -> None:
    mesh, size, worst = SHAPES[name]
    everything, one = np.ones(len(mesh.faces), dtype=bool), np.zeros(len(mesh.faces), dtype=int)

    vertices, triangles, source = remesh(mesh.vertices, mesh.faces, everything, one, size)

    made = trimesh.Trimesh(vertices, triangles, process=False)
    assert made.is_watertight
    assert made.is_winding_consistent
    assert made.volume == pytest.approx(mesh.volume, rel=1e-12)
    assert made.area == pytest.approx(mesh.area, rel=1e-12)
    sides = np.linalg.norm(made.triangles - np.roll(made.triangles, 1, axis=1), axis=2)
    assert sides.max() <= 4 / 3 * size * (1 + 1e-12)
    assert triangle_quality(vertices, triangles).min() > min(
        worst, triangle_quality(mesh.vertices, mesh.faces).min() * 0.99 + worst
    )
    agree = np.einsum("ij,ij->i", made.face_normals, mesh.face_normals[source])
    assert agree.min() > 1 - 1e-12  # each triangle lies in the plane of the one it says it is of


def test_small_triangles_become_larger_ones() -> None:
    fine = BOX.subdivide().subdivide().subdivide()
    everything, one = np.ones(len(fine.faces), dtype=bool), np.zeros(len(fine.faces), dtype=int)

    vertices, triangles, _ = remesh(fine.vertices, fine.faces, everything, one, 8.0)

    made = trimesh.Trimesh(vertices, triangles, process=False)
    assert len(triangles) < len(fine.faces) / 2
    assert made.volume == pytest.approx(24000, rel=1e-12)
    assert made.is_watertight


def test_only_the_target_is_meshed_and_it_keeps_its_border() -> None:
    """The target is the upper half of a finely divided box; the lower half stays as it was."""
    mesh = BOX.subdivide().subdivide()
    target = mesh.triangles_center[:, 2] > 0
    area = mesh.area_faces[target].sum()

    vertices, triangles, source = remesh(mesh.vertices, mesh.faces, target, target.astype(int), 1.5)

    made = trimesh.Trimesh(vertices, triangles, process=False)
    chosen = target[source]
    assert made.area_faces[chosen].sum() == pytest.approx(area, rel=1e-12)
    assert (
        made.triangles_center[chosen][:, 2].min() > 0 > made.triangles_center[~chosen][:, 2].max()
    )
    far = mesh.triangles[(mesh.triangles[..., 2] < -6).all(axis=1)]
    there = {tuple(map(tuple, corners)) for corners in made.triangles.round(9)}
    assert all(
        any(tuple(map(tuple, np.roll(t, k, axis=0))) in there for k in range(3))
        for t in far.round(9)
    )


def test_the_same_mesh_comes_out_again() -> None:
    mesh, size, _ = SHAPES["plate with a hole"]
    everything, one = np.ones(len(mesh.faces), dtype=bool), np.zeros(len(mesh.faces), dtype=int)

    first, second = (remesh(mesh.vertices, mesh.faces, everything, one, size) for _ in range(2))

    assert all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))


def test_a_size_larger_than_the_part_changes_nothing_that_shapes_it() -> None:
    everything, one = np.ones(12, dtype=bool), np.zeros(12, dtype=int)

    vertices, triangles, _ = remesh(BOX.vertices, BOX.faces, everything, one, 1000.0)

    assert trimesh.Trimesh(vertices, triangles, process=False).volume == pytest.approx(
        24000, rel=1e-12
    )
    assert len(triangles) == 12

"""A ball of no size without gravity is a ray of light: embree must find the same first hit."""

import numpy as np
import pytest
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

from sim_core import TriangleMesh
from sim_core.geometry.obstacle_set import build_obstacle_set
from tests.helpers.contacts import calls
from tests.helpers.contacts.cases import units
from tests.helpers.contacts.reference import columns, dot, from_segments

SIZE = 0.05  # m
RADIUS = 1e-9  # m: below a float32 step of the coordinates, 4e-9 m
SINGLE = (
    float(np.finfo(np.float32).eps) * SIZE
)  # m, 6e-9: nearer to an edge embree's float32 cannot decide
CHUNK = 100_000


def bumpy_chamber(rng: np.random.Generator) -> TriangleMesh:
    """A sphere of 20,480 triangles with bumps that hide parts of it from other parts."""
    ball = trimesh.creation.icosphere(subdivisions=5, radius=1.0)
    waves = ball.vertices @ (8.0 * units(rng, 12)).T + rng.uniform(0.0, 2.0 * np.pi, 12)
    vertices = ball.vertices * SIZE * (1.0 + 0.08 * np.sin(waves).sum(axis=1, keepdims=True))
    return TriangleMesh(vertices, ball.faces, np.zeros(len(ball.faces), dtype=int))


def from_border(
    mesh: TriangleMesh, triangle: np.ndarray, origin: np.ndarray, direction: np.ndarray
) -> np.ndarray:
    """How far [m] rays pass from the nearest border of the triangle they hit, in its plane."""
    a, b, c = np.moveaxis(mesh.corners[triangle], 1, 0)
    normal = np.cross(b - a, c - a)
    time = np.einsum("nd,nd->n", a - origin, normal) / np.einsum("nd,nd->n", direction, normal)
    at = columns(origin + time[:, None] * direction)
    rest = [from_segments(at, columns(s), columns(e)) for s, e in ((a, b), (b, c), (c, a))]
    return np.asarray(np.sqrt(np.stack([dot(r, r) for r in rest]).min(axis=0)), dtype=float)


@pytest.mark.parametrize("count", [CHUNK, pytest.param(10 * CHUNK, marks=pytest.mark.long)])
def test_the_first_triangle_on_a_ray_is_the_one_embree_sees(count: int) -> None:
    rng = np.random.default_rng(8)
    mesh = bumpy_chamber(rng)
    embree = RayMeshIntersector(trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False))
    surfaces = build_obstacle_set(mesh, (RADIUS,))
    different = 0
    for _ in range(count // CHUNK):
        origin = 0.3 * SIZE * units(rng, CHUNK) * rng.uniform(size=(CHUNK, 1))
        direction = units(rng, CHUNK)
        flights = np.concatenate([origin - mesh.middle, direction], axis=1)
        found, triangle = calls.contacts(surfaces, flights, None, None, 0.0, np.full(CHUNK, 1.0))
        assert np.isfinite(found).all(), "a ray has left a closed chamber"
        seen = embree.intersects_first(origin, direction)
        other = np.flatnonzero(triangle != seen)
        different += len(other)
        ray = origin[other], direction[other]
        known = np.minimum(
            from_border(mesh, triangle[other], *ray), from_border(mesh, seen[other], *ray)
        )
        assert (seen[other] >= 0).all()
        assert known.max(initial=0.0) <= SINGLE, (
            f"embree sees another triangle, {known.max():.3g} m inside its borders"
        )
    assert different <= 1e-4 * count, (
        f"{different} of {count} rays pass undecidably near an edge: too many"
    )

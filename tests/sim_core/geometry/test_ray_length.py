"""Rays through closed bodies, against closed forms and a brute-force search."""

import numpy as np
import trimesh

from sim_core import ray_lengths


def test_chords_of_a_sphere() -> None:
    """A chord at an angle to the normal has the length 2 R cos(angle)."""
    ball = trimesh.creation.icosphere(6, 0.01)
    rng = np.random.default_rng(1)
    rows = rng.integers(len(ball.faces), size=500)
    starts, normals = ball.triangles_center[rows], ball.face_normals[rows]
    ways = -normals + rng.uniform(-0.5, 0.5, (500, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    expected = -2.0 * 0.01 * np.einsum("ij,ij->i", ways, normals)
    # a facet of 0.3 mm lies 1 µm inside the sphere, and rays cross it at angles to 60 degrees
    np.testing.assert_allclose(ray_lengths(ball.triangles, starts, ways, 1.0), expected, atol=2e-5)


def test_rays_against_every_triangle() -> None:
    """In a body with a hole, far from the origin, the nearest crossing from inside counts."""
    ring = trimesh.creation.annulus(0.004, 0.01, 0.003, sections=40)
    corners = np.asarray(ring.triangles) + 3.0
    rng = np.random.default_rng(2)
    rows = rng.integers(len(corners), size=300)
    share = rng.dirichlet(np.ones(3), 300)
    starts = np.einsum("kj,kji->ki", share, corners[rows])
    ways = -np.asarray(ring.face_normals)[rows] + 0.6 * rng.uniform(-1.0, 1.0, (300, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(ab, ac)
    expected = []
    for start, way in zip(starts, ways, strict=True):
        rate = normal @ way
        with np.errstate(divide="ignore", invalid="ignore"):
            length = np.einsum("ij,ij->i", a - start, normal) / rate
            offset = start + length[:, None] * way - a
            square = np.einsum("ij,ij->i", normal, normal)
            u = np.einsum("ij,ij->i", np.cross(offset, ac), normal) / square
            v = np.einsum("ij,ij->i", np.cross(ab, offset), normal) / square
        out = (rate > 0.0) & (length > 1e-9) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
        expected.append(length[out].min())
    np.testing.assert_allclose(ray_lengths(corners, starts, ways, 1.0), expected, atol=1e-9)


def test_lengths_beyond_the_reach_are_infinite() -> None:
    box = trimesh.creation.box((0.03, 0.02, 0.01))
    top = np.array([[0.001, 0.002, 0.005], [0.014, 0.0, 0.005]])
    down = np.tile([0.0, 0.0, -1.0], (2, 1))
    np.testing.assert_allclose(ray_lengths(box.triangles, top, down, 0.011), 0.01)
    assert np.isinf(ray_lengths(box.triangles, top, down, 0.009)).all()

"""Rooms with a landscape for a floor: closed meshes over a grid, a flat ceiling, four walls."""

import numpy as np

from sim_core import TriangleMesh

CEILING, SIDES, GROUND = 0, 1, 2


def terrain(
    x: np.ndarray,
    y: np.ndarray,
    height: np.ndarray,
    top: float,
    rng: np.random.Generator | None = None,
    tags: int = 1,
) -> TriangleMesh:
    """A room over heights (nx, ny) [m] at x (nx,), y (ny,) [m], up to ``top`` [m].

    With ``rng`` each square is cut along a diagonal drawn by lot, and the ground's triangles get
    one of ``tags`` tags by lot from GROUND on, so that the simulator may not join those that lie in
    one plane.
    """
    nx, ny = len(x), len(y)
    floor = np.stack([*np.meshgrid(x, y, indexing="ij"), height], axis=-1).reshape(-1, 3)
    roof = floor.copy()
    roof[:, 2] = top
    number = np.arange(nx * ny).reshape(nx, ny)
    a, b, c, d = (
        number[i : nx - 1 + i, j : ny - 1 + j].ravel() for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))
    )
    flip = np.zeros(len(a), dtype=bool) if rng is None else rng.random(len(a)) < 0.5
    one = np.where(flip[:, None], np.stack([a, b, d], 1), np.stack([a, b, c], 1))
    two = np.where(flip[:, None], np.stack([b, c, d], 1), np.stack([a, c, d], 1))
    up = np.concatenate([one, two])
    rim = np.concatenate([number[:, 0], number[-1, 1:], number[-2::-1, -1], number[0, -2:0:-1]])
    after = np.roll(rim, -1)
    shift = nx * ny
    walls = np.concatenate(
        [np.stack([rim, after, after + shift], 1), np.stack([rim, after + shift, rim + shift], 1)]
    )
    triangles = np.concatenate([up[:, ::-1], up + shift, walls])
    lot = np.zeros(len(up), dtype=int) if rng is None else rng.integers(tags, size=len(up))
    tag = np.concatenate([GROUND + lot, np.full(len(up), CEILING), np.full(len(walls), SIDES)])
    return TriangleMesh(np.concatenate([floor, roof]), triangles, tag)


def profile(x: np.ndarray, z: np.ndarray, half_width: float, top: float) -> TriangleMesh:
    """The same with heights z (n,) [m] over x (n,) [m] alone, between walls at y = ± ``half_width``
    [m].
    """
    y = np.array([-half_width, half_width])
    return terrain(x, y, np.repeat(z[:, None], 2, axis=1), top)

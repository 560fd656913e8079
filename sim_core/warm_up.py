"""Compiling ahead of time, so that a program can say what takes so long the first time."""

import time

import numpy as np

from sim_core._compile import CACHE_FOLDER
from sim_core.balls import Balls
from sim_core.physics import Physics
from sim_core.scene import Scene
from sim_core.simulate import simulate
from sim_core.surfaces.mesh import TriangleMesh


def is_compiled() -> bool:
    """True when the event loop has been compiled before, for some set of effects, by this version of the sources."""
    return any(CACHE_FOLDER.rglob("events.advance-*.nbc"))


def compile_simulator(physics: Physics) -> float:
    """Compiles (or loads from the cache) what a scene with these effects needs; returns the seconds it took."""
    start = time.perf_counter()
    tag = physics.vibration.tag if physics.vibration is not None else 0
    vertices = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    floor = (vertices[triangles][:, :, 2] == 0.0).all(axis=1)
    tags = np.where(floor, tag, 1 if tag == 0 else 0)
    if physics.restitution is not None:
        tags = np.minimum(tags, len(physics.restitution.surfaces) - 1)
    balls = Balls(np.array([[0.3, 0.5, 0.5], [0.7, 0.5, 0.5]]), np.array([[1.0, 0.1, 0.0], [-1.0, 0.0, 0.1]]), 0.1)
    simulate(Scene(TriangleMesh(vertices, triangles, tags), balls, physics, duration=0.01))
    return time.perf_counter() - start

"""Embree's batch ray, a yardstick: straight and without thickness, so less than is asked of us."""

from typing import Any

import numpy as np


def build(corners: np.ndarray) -> Any | None:
    """Embree's scene of these triangles (m, 3, 3) [m]; None where embreex is not installed."""
    try:
        from embreex import rtcore_scene
        from embreex.mesh_construction import TriangleMesh
    except ImportError:
        return None
    scene = rtcore_scene.EmbreeScene()
    TriangleMesh(scene, corners.astype(np.float32))
    ask(scene, np.zeros((1, 3)), np.ones((1, 3)))  # the first ray builds its tree
    return scene


def ask(scene: Any, positions: np.ndarray, velocities: np.ndarray) -> np.ndarray:
    """First triangle on each ray (n, 3), -1 for none."""
    return np.asarray(
        scene.run(
            positions.astype(np.float32, copy=False), velocities.astype(np.float32, copy=False)
        )
    )

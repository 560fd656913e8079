"""Cavities that tests simulate in, and what goes into them.

Tags: 0 ceiling (the part's place), 1 floor (the sonotrode's), 2 sides.
"""

import numpy as np
import trimesh

from sim_core import Balls, Friction, Gravity, Restitution, TriangleMesh
from sim_core.effects.restitution import ELASTIC_BELOW

CEILING, FLOOR, SIDES = 0, 1, 2
WEIGHTLESS = Gravity(0.0, 0.0, 0.0)  # the same machine code as with gravity


def tagged(vertices: np.ndarray, triangles: np.ndarray) -> TriangleMesh:
    """Tags triangles by where they lie: highest, lowest, or between."""
    z = vertices[triangles][:, :, 2]
    tags = np.full(len(triangles), SIDES)
    tags[(z == z.max()).all(axis=1)] = CEILING
    tags[(z == z.min()).all(axis=1)] = FLOOR
    return TriangleMesh(vertices, triangles, tags)


def uniform_restitution(c0: float, v0: float, elastic_below: float = ELASTIC_BELOW) -> Restitution:
    """The same restitution (C0, v0) of all three surfaces and of ball on ball."""
    return Restitution(((c0, v0),) * 3, (c0, v0), elastic_below)


# the same bits as without a law, and the same machine code as with losses; for up to eight tags
ELASTIC = Restitution(((1.0, 1e9),) * 8, (1.0, 1e9))
SMOOTH = Friction(((0.0, -1.0),) * 8, (0.0, -1.0))  # the same bits as without friction


def box(
    sides: tuple[float, float, float], centre: tuple[float, float, float] | None = None
) -> TriangleMesh:
    """A box [m], from the origin up unless a centre is given."""
    mesh = trimesh.creation.box(sides)
    middle = 0.5 * np.array(sides) if centre is None else np.array(centre)
    return tagged(np.asarray(mesh.vertices) + middle, np.asarray(mesh.faces))


def cylinder(
    radius: float, height: float, sections: int = 64, subdivisions: int = 0
) -> TriangleMesh:
    """A cylinder [m] standing on z = 0."""
    mesh = trimesh.creation.cylinder(radius=radius, height=height, sections=sections)
    vertices, triangles = (
        np.asarray(mesh.vertices) + np.array([0.0, 0.0, 0.5 * height]),
        np.asarray(mesh.faces),
    )
    for _ in range(subdivisions):
        vertices, triangles = trimesh.remesh.subdivide(vertices, triangles)
    return tagged(np.round(vertices, 15), triangles)


def box_around(obstacle: trimesh.Trimesh, half: float) -> TriangleMesh:
    """A cube of half side ``half`` [m] about the origin with a solid body in it."""
    room = trimesh.creation.box((2 * half, 2 * half, 2 * half))
    vertices = np.concatenate([room.vertices, obstacle.vertices])
    triangles = np.concatenate([room.faces, obstacle.faces[:, ::-1] + len(room.vertices)])
    tags = np.concatenate([np.full(len(room.faces), SIDES), np.full(len(obstacle.faces), CEILING)])
    return TriangleMesh(vertices, triangles, tags)


def balls_at(positions: np.ndarray, diameter: float = 3e-3) -> Balls:
    """Balls at rest."""
    return Balls(positions, np.zeros_like(positions, dtype=float), diameter)

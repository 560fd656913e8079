"""Named scenes: the paper's cylinder at any fineness, and the shipped gear's chamber.

Surfaces carry the tags that a chamber gives them.
"""

from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial import Delaunay

from sim_core import (
    Balls,
    Gravity,
    Physics,
    Restitution,
    Scene,
    TriangleMesh,
    Vibration,
    pack_balls,
)

PART, SONOTRODE, WALL = 0, 1, 2
DIAMETER = 3e-3  # m
STEEL = (0.91, 1.0)  # C0 and v0 [m/s], for every surface
PHYSICS = Physics(
    Gravity(), Restitution((STEEL,) * 3, STEEL), Vibration(SONOTRODE, 25e-6, 20e3, 0.3)
)
ROOT = Path(__file__).parents[1]


def cylinder(radius: float, height: float, triangles: int) -> TriangleMesh:
    """An upright cylinder [m] of about so many even triangles.

    They form rings on the ends and rows around the side.
    """
    area = 2.0 * np.pi * radius * (radius + height)
    edge = np.sqrt(2.0 * area / triangles)
    around = max(12, round(2.0 * np.pi * radius / edge))
    rings, rows = max(1, round(radius / edge)), max(1, round(height / edge))
    disc = [np.zeros((1, 2))]
    for ring in range(1, rings + 1):
        count = around if ring == rings else max(6, round(around * ring / rings))
        angle = 2.0 * np.pi * np.arange(count) / count
        disc.append(radius * ring / rings * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    plane = np.concatenate(disc)
    ends = Delaunay(plane).simplices
    one, two = plane[ends[:, 1]] - plane[ends[:, 0]], plane[ends[:, 2]] - plane[ends[:, 0]]
    turn = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    flat = np.abs(turn) <= 1e-9 * radius**2  # slivers along the rim
    ends, turn = ends[~flat], turn[~flat]
    ends[turn < 0.0] = ends[turn < 0.0][:, ::-1]
    inner, rim = len(plane), np.arange(len(plane) - around, len(plane))
    vertices = [np.column_stack([plane, np.zeros(inner)])]
    layers, offset = [rim], inner
    for row in range(1, rows):
        vertices.append(np.column_stack([plane[rim], np.full(around, height * row / rows)]))
        layers.append(offset + np.arange(around))
        offset += around
    vertices.append(np.column_stack([plane, np.full(inner, height)]))
    layers.append(offset + rim)
    faces = [ends[:, ::-1], ends + offset]
    for low, high in pairwise(layers):
        next_low, next_high = np.roll(low, -1), np.roll(high, -1)
        faces += [
            np.column_stack([low, next_low, next_high]),
            np.column_stack([low, next_high, high]),
        ]
    points, shell = np.concatenate(vertices), np.concatenate(faces)
    z = points[shell][:, :, 2]
    tags = np.full(len(shell), WALL)
    tags[(z == height).all(axis=1)], tags[(z == 0.0).all(axis=1)] = PART, SONOTRODE
    return TriangleMesh(points, shell, tags)


def gear(subdivisions: int) -> TriangleMesh:
    """The chamber of designs/gear.toml on the facets of its file, each split in four so many times.

    So its triangles are as many as before surfaces were divided, and versions can be compared.
    """
    from chamberopt.chamber.build import build_chamber
    from chamberopt.design.load import load_design

    design = load_design(ROOT / "designs" / "gear.toml").changed({"part.smoothing": "off"})
    chamber = build_chamber(design)
    vertices, triangles, tags = chamber.vertices, chamber.triangles, chamber.tags
    for _ in range(subdivisions):
        vertices, triangles, index = trimesh.remesh.subdivide(
            vertices, triangles, return_index=True
        )
        origin = np.empty(len(triangles), dtype=int)
        for old, new in index.items():
            origin[new] = old
        tags = tags[origin]
    return TriangleMesh(vertices, triangles, tags)


MESHES = {  # and the balls in them: how many, and their diameter [m]
    "cylinder-30-1k": (lambda: cylinder(0.035, 0.015, 1_000), 30, DIAMETER),
    "cylinder-200-1k": (lambda: cylinder(0.035, 0.04, 1_000), 200, DIAMETER),
    "cylinder-200-10k": (lambda: cylinder(0.035, 0.04, 10_000), 200, DIAMETER),
    "cylinder-200-100k": (lambda: cylinder(0.035, 0.04, 100_000), 200, DIAMETER),
    "wide-2000-10k": (lambda: cylinder(0.35, 0.04, 10_000), 2_000, DIAMETER),
    "gear-200-10k": (lambda: gear(0), 200, DIAMETER),
    "gear-200-100k": (lambda: gear(2), 200, DIAMETER),
    "gear-363-10k": (lambda: gear(0), 363, 1.5e-3),  # the shot of its studies: 5 and 10 g
    "gear-725-10k": (lambda: gear(0), 725, 1.5e-3),
}


@lru_cache(maxsize=2)
def mesh(name: str) -> TriangleMesh:
    """The scene's mesh; its true number of triangles is in the tables."""
    return MESHES[name][0]()


def scene(name: str, duration: float = 1.0, seed: int = 1) -> Scene:
    """A named scene, its balls packed low with 2 m/s a component; not yet in steady state."""
    rng = np.random.default_rng(seed)
    _, count, diameter = MESHES[name]
    positions = pack_balls(mesh(name), count, diameter, rng, clear=50e-6)
    return Scene(
        mesh(name), Balls(positions, rng.normal(0.0, 2.0, (count, 3)), diameter), PHYSICS, duration
    )

"""All surfaces of a scene, prepared once as obstacles for the centres of balls of given radii."""

from typing import NamedTuple

import numpy as np

from sim_core.effects.part_rotation import RotationAxis
from sim_core.geometry.analytic import (
    UNBOUNDED,
    AnalyticCavity,
    CylinderAxis,
    build_analytic_table,
    periods_of,
)
from sim_core.geometry.bvh import Tree, build_tree, join_trees
from sim_core.geometry.flat_faces import LONE, FlatFaces, surface_triangles
from sim_core.geometry.mesh import TriangleMesh
from sim_core.geometry.obstacles import build_obstacle_table, face_overlap_of
from sim_core.geometry.triangle_lookup import TriangleLookup, build_lookup
from sim_core.geometry.turning_part import PartTree, build_part_tree, part_rows, select_rows
from sim_core.numerics.record_addresses import passed_by_address


@passed_by_address
class ObstacleSet(NamedTuple):
    """All obstacles of a scene, with coordinates relative to the middle of the mesh or cavity.

    In an analytical cavity the "triangles" are its surfaces.
    """

    tree: Tree  # obstacles that do not turn
    lookup: TriangleLookup  # search for the triangle of a flat face at a point
    tags: np.ndarray  # surface tag of each triangle, shape (m,)
    face_overlap: float  # overlap of neighbouring faces for the largest balls [m]
    part: PartTree | None  # the turning part, whose obstacles are not in ``tree``; None without it
    roots: np.ndarray  # nodes of the tree where the obstacles of each radius begin, shape (radii,)
    cylinder: CylinderAxis | None  # axis of an analytical cylinder
    # lowest and highest corner of the room that holds the balls, with the motion of its surfaces
    # [m], shape (2, 3)
    bounds: np.ndarray


def build_obstacle_set(
    mesh: TriangleMesh | AnalyticCavity,
    radii: tuple[float, ...],
    vibrating_tags: tuple[int, ...] = (),
    amplitudes: tuple[float, ...] = (),
    axis: RotationAxis | None = None,
) -> ObstacleSet:
    """Build the obstacles of a scene for the centres of its balls.

    Args:
        mesh: the cavity.
        radii: radii of the balls [m], ascending.
        vibrating_tags: tags of the surfaces that vibrate.
        amplitudes: zero-to-peak amplitude of each of ``vibrating_tags`` [m].
        axis: axis of the turning part.
    """
    overlap = face_overlap_of(radii[-1])
    bounds = _swept_bounds(mesh, max(amplitudes, default=0.0), axis)
    if isinstance(mesh, AnalyticCavity):
        tag, amplitude = next(zip(vibrating_tags, amplitudes, strict=True), (-1, 0.0))
        tables = [build_analytic_table(mesh, r, tag, amplitude) for r in radii]
        tree, roots = join_trees([build_tree(*pair) for pair in zip(tables, radii, strict=True)])
        count = len(mesh.tags)
        none = np.zeros(0, dtype=np.int32)
        lone = FlatFaces(np.full(count, LONE, dtype=np.int32), none, np.zeros((0, 3, 3)), [])
        lookup = build_lookup(np.zeros((count, 3, 3)), lone, overlap)
        return ObstacleSet(tree, lookup, mesh.tags, overlap, None, roots, mesh.axis, bounds)
    surface = surface_triangles(mesh, vibrating_tags, amplitudes)
    lookup = build_lookup(surface.corners, surface.flat_faces, overlap)
    tables = [build_obstacle_table(surface, r) for r in radii]
    part = None
    if axis is not None:
        turns = [part_rows(*pair, mesh, axis) for pair in zip(tables, radii, strict=True)]
        own = [select_rows(table, rows) for table, rows in zip(tables, turns, strict=True)]
        part = build_part_tree(own, radii, mesh, axis)
        tables = [select_rows(table, ~rows) for table, rows in zip(tables, turns, strict=True)]
    tree, roots = join_trees([build_tree(*pair) for pair in zip(tables, radii, strict=True)])
    return ObstacleSet(tree, lookup, mesh.tags, overlap, part, roots, None, bounds)


def _swept_bounds(
    mesh: TriangleMesh | AnalyticCavity, amplitude: float, axis: RotationAxis | None
) -> np.ndarray:
    """Return the box (2, 3) [m], relative to the mesh's middle, round all that surfaces sweep."""
    low, high = mesh.bounds - mesh.middle
    periodic = periods_of(mesh) > 0.0
    low[periodic], high[periodic] = -UNBOUNDED, UNBOUNDED
    if axis is not None and isinstance(mesh, TriangleMesh):
        point = np.array(axis.point) - mesh.middle
        own = mesh.corners[axis.turns(mesh.tags)] - mesh.middle
        reach = np.linalg.norm(own - point, axis=2).max(initial=0.0)
        low, high = np.minimum(low, point - reach), np.maximum(high, point + reach)
    return np.stack([low - amplitude, high + amplitude])

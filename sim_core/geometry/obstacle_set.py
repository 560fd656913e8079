"""All that stands still in a scene, or turns as a whole, prepared once for balls of one radius."""

from typing import NamedTuple

import numpy as np

from sim_core.effects.part_rotation import Axle
from sim_core.geometry.analytic import AnalyticCavity
from sim_core.geometry.analytic_obstacles import analytic_obstacles, bore_of
from sim_core.geometry.bvh import Tree, build_tree, joined
from sim_core.geometry.flat_faces import LONE, Flats, edge_partners, find_flats, in_plane
from sim_core.geometry.mesh import TriangleMesh
from sim_core.geometry.obstacles import Bore, build_obstacles, seam
from sim_core.geometry.triangle_lookup import Locator, build_locator
from sim_core.geometry.turning_part import PartTree, chosen, part_of, part_tree


class Ground(NamedTuple):
    """The tree of obstacles, which triangle of a flat is where, each triangle's tag, and how far faces overlap [m].

    Coordinates are relative to the middle of the mesh. ``part``: what turns, if anything does; its obstacles are not
    in ``tree``. ``roots`` (k,): the nodes of the tree where the obstacles of each radius begin. ``bore``: of an
    analytical cylinder; in an analytical cavity the "triangles" are its surfaces.
    """

    tree: Tree
    locator: Locator
    tags: np.ndarray
    seam: float
    part: PartTree | None
    roots: np.ndarray
    bore: Bore | None


def build_ground(
    mesh: TriangleMesh | AnalyticCavity,
    radius: float | tuple[float, ...],
    waving_tag: int | tuple[int, ...] = (),
    swing: float | tuple[float, ...] = (),
    axle: Axle | None = None,
) -> Ground:
    """The ground for balls of this radius [m], or these radii, ascending; triangles of ``waving_tag``, or of each of
    several, vibrate by ``swing`` [m] zero-to-peak, those of the ``axle``'s tag turn.
    """
    if isinstance(mesh, AnalyticCavity):
        floor = next(zip(np.atleast_1d(waving_tag), np.atleast_1d(swing), strict=True), (-1, 0.0))
        return _analytic_ground(mesh, radius, int(floor[0]), float(floor[1]))
    corners = mesh.corners - mesh.middle
    flats = find_flats(corners, edge_partners(mesh.triangles), mesh.tags, in_plane(mesh.vertices))
    radii = radius if isinstance(radius, tuple) else (radius,)
    waving, swings = np.zeros(len(corners), dtype=np.bool_), np.zeros(len(corners))
    for tag, widest in zip(np.atleast_1d(waving_tag), np.atleast_1d(swing), strict=True):
        waving |= mesh.tags == tag
        swings[mesh.tags == tag] = widest
    overlap = seam(radii[-1])
    locator = build_locator(corners, flats, overlap)
    if axle is None:
        trees = [build_tree(build_obstacles(mesh, r, waving, swings, flats), r) for r in radii]
        tree, roots = joined(trees)
        return Ground(tree, locator, mesh.tags, overlap, None, roots, None)
    (radius,) = radii  # a turning part and several sizes are not supported together
    obstacles = build_obstacles(mesh, radius, waving, swings, flats)
    turns = part_of(obstacles, mesh, axle, radius)
    part = part_tree(chosen(obstacles, turns), mesh, axle, radius)
    return Ground(
        build_tree(chosen(obstacles, ~turns), radius),
        locator,
        mesh.tags,
        overlap,
        part,
        np.zeros(1, np.int64),
        None,
    )


def _analytic_ground(
    cavity: AnalyticCavity, radius: float | tuple[float, ...], waving_tag: int, swing: float
) -> Ground:
    radii = radius if isinstance(radius, tuple) else (radius,)
    trees = [build_tree(analytic_obstacles(cavity, r, waving_tag, swing), r) for r in radii]
    tree, roots = joined(trees)
    count, overlap = len(cavity.tags), seam(radii[-1])
    lone = Flats(
        np.full(count, LONE, dtype=np.int32), np.zeros(0, dtype=np.int32), np.zeros((0, 3, 3)), []
    )
    locator = build_locator(np.zeros((count, 3, 3)), lone, overlap)
    return Ground(tree, locator, cavity.tags, overlap, None, roots, bore_of(cavity))

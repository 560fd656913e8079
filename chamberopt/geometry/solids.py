"""Make solids of closed surfaces, and unite, subtract, sweep and project them.

This is the only file that imports manifold3d. Each triangle of a result remembers the solid that it
comes from, and the triangle of that solid on which it lies. manifold3d keeps these numbers only for
meshes with reserved ids. A Mesh64 without such an id loses them (its original_id() is -1).

Internal lengths are millimetres on a grid of 2^-20 mm (1 nm). Faces that coincide in the design
then coincide exactly, and leave no needles 1e-10 mm high between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.triangles import find_shells, shell_winding, swept

if TYPE_CHECKING:
    from manifold3d import CrossSection, Manifold

# 1 nm: a thousandth of the finest surface roughness, yet 1e7 steps of a double at 100 mm.
GRID_MM = 2.0**-20
# Largest distance of a vertex from its plane: the rounding of a file's 32-bit numbers.
PLANE_MM, PLANE_OF_SIZE = 1e-5, 3e-7
# Relative. A failed boolean is off by whole triangles, and rounding by 1e-13.
SAME_VOLUME = 1e-9
# Share of an opening's area by which what passes it may stand over it, and facets of a round.
THROUGH, ROUND_FACETS = 1e-3, 64


@dataclass(frozen=True)
class SolidSurface:
    """Closed surface of a solid, whose triangles remember the solid they come from."""

    vertices: np.ndarray  # (n, 3) float64 [m]
    triangles: np.ndarray  # (k, 3) int32, rows of the vertices; normals point outward
    solid: np.ndarray  # (k,) int64, label of the solid that each triangle comes from
    source: np.ndarray  # (k,) int32, index in that solid of the triangle on which it lies

    def select(self, keep: np.ndarray) -> SolidSurface:
        """Return the surface of the triangles marked by `keep` (k,), without unused vertices."""
        used, renumbered = np.unique(self.triangles[keep], return_inverse=True)
        triangles = renumbered.reshape(-1, 3).astype(np.int32)
        return SolidSurface(self.vertices[used], triangles, self.solid[keep], self.source[keep])


@dataclass(frozen=True)
class Solid:
    """Closed body that can be united with other bodies, or cut out of them."""

    body: Manifold
    label: int  # label of its own triangles; -1 for the result of an operation
    name: str  # for messages

    @property
    def volume(self) -> float:
        """Volume that the solid encloses [m³]."""
        return float(self.body.volume()) * 1e-9

    def surface(self) -> SolidSurface:
        """Return the surface [m], each triangle with the solid and triangle that it comes from."""
        mesh = self.body.to_mesh64()
        ends = np.asarray(mesh.run_index, dtype=np.int64)
        runs: np.ndarray = (ends[1:] - ends[:-1]) // 3
        solid = np.repeat(np.asarray(mesh.run_original_id, dtype=np.int64), runs)
        vertices = np.asarray(mesh.vert_properties)[:, :3] * 1e-3
        triangles = np.asarray(mesh.tri_verts).astype(np.int32)
        return SolidSurface(vertices, triangles, solid, np.asarray(mesh.face_id).astype(np.int32))


def snap_to_grid(vertices: np.ndarray) -> np.ndarray:
    """Return positions (n, 3) [m] rounded to the grid of the solids, by at most 0.5 nm per axis."""
    return _grid_mm(vertices) * 1e-3


def make_solid(
    vertices: np.ndarray, triangles: np.ndarray, name: str, only: np.ndarray | None = None
) -> Solid:
    """Make a solid of a closed surface (n, 3) [m], (m, 3) whose normals point outward.

    Args:
        only: indices of the triangles to use, such as one body of several. The sources of the
            solid's triangles still count in the whole list.

    Raises:
        InputError: if the surface does not enclose a body.
    """
    from manifold3d import Manifold, Mesh64

    chosen = np.arange(len(triangles)) if only is None else only
    used, numbers = np.unique(triangles[chosen], return_inverse=True)
    label = int(Manifold.reserve_ids(1))
    mesh = Mesh64(
        np.ascontiguousarray(_grid_mm(vertices[used])),
        np.ascontiguousarray(numbers.reshape(-1, 3), dtype=np.uint64),
        run_index=np.array([0, 3 * len(chosen)], dtype=np.uint64),
        run_original_id=np.array([label], dtype=np.uint32),
        face_id=chosen.astype(np.uint64),
    )
    solid = Solid(_checked(Manifold(mesh), f"{name}: cannot be made a solid"), label, name)
    if solid.volume <= 0.0:  # subtracting such a solid would ADD material, without an error
        why = "the surface is inside out or encloses nothing"
        raise InputError(f"{name}: {why}; make its normals point outward")
    return solid


def simplify_planes(
    vertices: np.ndarray, triangles: np.ndarray, label: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a closed surface without the vertices that its planes do not need.

    These vertices lie inside a plane, or inside a straight border of a plane.

    Args:
        vertices: vertex positions [m], shape (n, 3).
        triangles: vertex indices, shape (m, 3).
        label: label of each triangle, from 0 on, shape (m,). Borders between labels stay.

    Returns:
        Vertices [m], triangles (k, 3) and the label of each triangle, shape (k,).
    """
    from manifold3d import Manifold, Mesh64

    order = np.argsort(label, kind="stable")
    ends = np.searchsorted(label[order], np.arange(int(label.max()) + 2))
    first = int(Manifold.reserve_ids(len(ends) - 1))
    mesh = Mesh64(
        np.ascontiguousarray(_grid_mm(vertices)),
        np.ascontiguousarray(triangles[order], dtype=np.uint64),
        run_index=(3 * ends).astype(np.uint64),
        run_original_id=(first + np.arange(len(ends) - 1)).astype(np.uint32),
    )
    far = max(PLANE_MM, PLANE_OF_SIZE * 1e3 * float(np.linalg.norm(np.ptp(vertices, axis=0))))
    body = _checked(Manifold(mesh), "the part cannot be made a solid").simplify(far)
    found = Solid(body, -1, "the part").surface()
    return found.vertices, found.triangles, found.solid - first


def split_bodies(vertices: np.ndarray, triangles: np.ndarray, name: str) -> tuple[list[Solid], int]:
    """Return a solid for each body of a surface, and the number of voids, which are filled.

    The solids must be united before use: a mesh of bodies that overlap would be subtracted wrongly,
    without an error. The source of a solid's triangle is its index in the whole list of triangles.
    """
    shells, volumes = find_shells(vertices, triangles)
    if len(volumes) == 1:
        return [make_solid(vertices, triangles, name)], 0
    solids = [
        make_solid(vertices, triangles, name, only=np.flatnonzero(shells == k))
        for k in np.flatnonzero(volumes > 0.0)
    ]
    return solids, int((volumes < 0.0).sum())


def sweep_face(face: SolidSurface, way: np.ndarray, name: str) -> Solid:
    """Return the prism that a flat face sweeps when it moves by `way` (3,) [m].

    The normals of the face must point away from the prism.
    """
    return make_solid(*swept(face.vertices, face.triangles, way), name)


def unite(solids: list[Solid], name: str) -> Solid:
    """Unite solids, which may overlap, into one body."""
    from manifold3d import Manifold, OpType

    if len(solids) == 1:
        return solids[0]
    body = Manifold.batch_boolean([one.body for one in solids], OpType.Add)
    return Solid(_checked(body, f"{name}: its bodies cannot be united"), -1, name)


def subtract(whole: Solid, taken: Solid) -> Solid:
    """Cut `taken` out of `whole`.

    Raises:
        InputError: if the volumes do not add up, because a surface crosses itself.
    """
    rest = _checked(whole.body - taken.body, f"{taken.name}: cannot be cut out of {whole.name}")
    common = _checked(
        whole.body ^ taken.body, f"{taken.name}: cannot be intersected with {whole.name}"
    )
    gap = rest.volume() - (whole.body.volume() - common.volume())
    if abs(gap) > SAME_VOLUME * abs(whole.body.volume()):
        raise InputError(
            f"{taken.name}: cutting it out of {whole.name} leaves {rest.volume():.6g} mm³, "
            f"{gap:+.3g} mm³ off what the volumes say; its surface probably crosses itself: "
            "heal it in the CAD program"
        )
    return Solid(rest, -1, f"{whole.name} without {taken.name}")


@dataclass(frozen=True)
class Outline:
    """Area seen from above, which may have several pieces and holes."""

    section: CrossSection

    def offset(self, by: float, facets: int) -> Outline:
        """Return the area grown by a distance `by` [m] all round, or shrunk if it is negative.

        Its round corners are parts of circles with `facets` sides.
        """
        from manifold3d import JoinType

        return Outline(self.section.offset(1e3 * by, JoinType.Round, circular_segments=facets))

    def hull(self, tolerance: float) -> np.ndarray:
        """Return the corners (n, 2) [m] of the convex hull, counter-clockwise.

        Corners that matter by less than `tolerance` [m] are left out.
        """
        return _corners(self.section.hull().simplify(1e3 * tolerance))[0]

    def without_holes(self, tolerance: float) -> list[np.ndarray]:
        """Return the corners (n, 2) [m] of each piece, counter-clockwise, with its holes filled.

        Corners that matter by less than `tolerance` [m] are left out.
        """
        from manifold3d import CrossSection

        outer = []
        for piece in self.section.to_polygons():
            (x, y), (xn, yn) = piece.T, np.roll(piece, -1, axis=0).T
            # the corner order is counter-clockwise; holes run in the other direction
            if (x * yn - y * xn).sum() > 0.0:
                outer.append(piece)
        return _corners(CrossSection(outer).simplify(1e3 * tolerance))


def plan_outline(vertices: np.ndarray, triangles: np.ndarray, below: float) -> Outline:
    """Return the area, seen from above, of all that closed bodies have below a height [m].

    The normals of the surface point outward.
    """
    from manifold3d import CrossSection, OpType

    sections = [
        CrossSection(one.body.trim_by_plane((0.0, 0.0, -1.0), -1e3 * below).project().to_polygons())
        for one in split_bodies(vertices, triangles, "the part")[0]
    ]
    return Outline(CrossSection.batch_boolean(sections, OpType.Add))


def passes_opening(
    vertices: np.ndarray, triangles: np.ndarray, level: float, clear: float
) -> tuple[bool, bool]:
    """Return whether all below a level, and all above it, fit through the section of bodies there.

    The normals of the surface point outward.

    Args:
        level: height of the section [m].
        clear: room round the section [m].
    """
    from manifold3d import CrossSection, OpType

    bodies = [one.body for one in split_bodies(vertices, triangles, "the part")[0]]

    def joined(sections: list[CrossSection]) -> CrossSection:
        own = [CrossSection(one.to_polygons()) for one in sections]
        return CrossSection.batch_boolean(own, OpType.Add)

    opening = Outline(joined([one.slice(1e3 * level) for one in bodies]))
    wide = opening.offset(clear, ROUND_FACETS).section
    least = THROUGH * opening.section.area()
    below, above = (
        joined([one.trim_by_plane((0.0, 0.0, up), 1e3 * up * level).project() for one in bodies])
        for up in (-1.0, 1.0)
    )
    return (below - wide).area() <= least, (above - wide).area() <= least


def extrude(outline: np.ndarray, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the prism over an outline (n, 2) [m] from z = 0 to a height [m].

    It is given by its vertices [m] and triangles.
    """
    from manifold3d import CrossSection

    mesh = CrossSection([1e3 * outline]).extrude(1e3 * height).to_mesh64()
    vertices = 1e-3 * np.asarray(mesh.vert_properties)[:, :3]
    return vertices, np.asarray(mesh.tri_verts).astype(np.int32)


def intersect(one: Solid, two: Solid, name: str) -> Solid:
    """Return the body that two solids have in common. It may be empty."""
    text = f"{one.name} and {two.name} cannot be intersected"
    return Solid(_checked(one.body ^ two.body, text), -1, name)


def overlap_volume(one: Solid, two: Solid) -> float:
    """Return the volume [m³] that two solids have in common."""
    return intersect(one, two, "what they share").volume


def find_cavities(surface: SolidSurface) -> list[np.ndarray]:
    """Return marks (k,) of the triangles of each separate cavity, the largest cavity first.

    A cavity consists of its outer shell and the islands that stand in it.
    """
    shells, volumes = find_shells(surface.vertices, surface.triangles)
    outer = sorted(np.flatnonzero(volumes > 0.0).tolist(), key=lambda shell: -volumes[shell])
    cavities = {shell: shells == shell for shell in outer}
    for island in np.flatnonzero(volumes <= 0.0).tolist():
        for shell in reversed(outer):  # an island stands in the smallest shell around it
            if shell_winding(surface.vertices, surface.triangles, shells, shell, island) > 0.5:
                cavities[shell] |= shells == island
                break
    return list(cavities.values())


def _corners(section: CrossSection) -> list[np.ndarray]:
    return [1e-3 * np.asarray(polygon) for polygon in section.to_polygons()]


def _grid_mm(vertices: np.ndarray) -> np.ndarray:
    return np.round(np.asarray(vertices, dtype=np.float64) * (1e3 / GRID_MM)) * GRID_MM + 0.0


def _checked(body: Manifold, what: str) -> Manifold:
    """Return the body, or raise InputError, which begins with `what`, if manifold3d rejects it."""
    from manifold3d import Error

    if body.status() != Error.NoError:
        raise InputError(
            f"{what}: manifold3d says {body.status().name}; "
            "the mesh must be closed, each edge shared by two triangles"
        )
    return body

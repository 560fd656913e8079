"""Solids and what can be done with them. The only file that imports manifold3d.

Every triangle of a result remembers which solid it comes from and which triangle of that solid it lies on: an
unlabelled Mesh64 would lose both (manifold3d reports original_id() == -1), so ids are reserved and passed.

Inside, lengths are millimetres on a grid of 2^-20 mm (1 nm): faces that coincide in the design then coincide
exactly, instead of leaving needles 1e-10 mm high between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.triangles import border_edges, find_shells, winding_number

if TYPE_CHECKING:
    from manifold3d import CrossSection, Manifold

GRID_MM = (
    2.0**-20
)  # 1 nm: a thousandth of the finest surface roughness, yet 1e7 steps of a double at 100 mm
SAME_VOLUME = (
    1e-9  # relative; a boolean that went wrong is off by whole triangles, rounding by 1e-13
)


@dataclass(frozen=True)
class SolidSurface:
    """The closed surface of a solid.

    vertices (n, 3) float64 m · triangles (k, 3) int32, normals outward · solid (k,) int64 the label of the
    solid each triangle comes from · source (k,) int32 its triangle's index there.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    solid: np.ndarray
    source: np.ndarray

    def select(self, keep: np.ndarray) -> SolidSurface:
        """The triangles where keep (k,) is true, with just the vertices they use."""
        used, renumbered = np.unique(self.triangles[keep], return_inverse=True)
        triangles = renumbered.reshape(-1, 3).astype(np.int32)
        return SolidSurface(self.vertices[used], triangles, self.solid[keep], self.source[keep])


@dataclass(frozen=True)
class Solid:
    """A closed body. label: the id its own triangles carry; -1 for the result of an operation."""

    body: Manifold
    label: int
    name: str

    @property
    def volume(self) -> float:
        """Enclosed volume [m³]."""
        return float(self.body.volume()) * 1e-9

    def surface(self) -> SolidSurface:
        """The solid's surface, each triangle with its origin."""
        mesh = self.body.to_mesh64()
        ends = np.asarray(mesh.run_index, dtype=np.int64)
        runs: np.ndarray = (ends[1:] - ends[:-1]) // 3
        solid = np.repeat(np.asarray(mesh.run_original_id, dtype=np.int64), runs)
        vertices = np.asarray(mesh.vert_properties)[:, :3] * 1e-3
        triangles = np.asarray(mesh.tri_verts).astype(np.int32)
        return SolidSurface(vertices, triangles, solid, np.asarray(mesh.face_id).astype(np.int32))


def snap_to_grid(vertices: np.ndarray) -> np.ndarray:
    """Positions [m], shape (n, 3), moved to the grid that solids live on (by at most 0.5 nm per axis)."""
    return _grid_mm(vertices) * 1e-3


def make_solid(
    vertices: np.ndarray, triangles: np.ndarray, name: str, only: np.ndarray | None = None
) -> Solid:
    """A solid from a closed surface: vertices (n, 3) m, triangles (m, 3), outward.

    only: indices of the triangles to use (one body of several); sources still count in the whole list.
    Raises InputError when the surface does not enclose a body.
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
    made = Solid(_checked(Manifold(mesh), f"{name}: cannot be made a solid"), label, name)
    if made.volume <= 0.0:  # subtracting it would ADD material, without an error
        raise InputError(
            f"{name}: the surface is inside out or encloses nothing; make its normals point outward"
        )
    return made


def split_bodies(vertices: np.ndarray, triangles: np.ndarray, name: str) -> tuple[list[Solid], int]:
    """The solids of a surface of several bodies, (n, 3) m and (m, 3), and how many closed voids in them were filled.

    Sources count in the whole list of triangles. Unite them before use: bodies that overlap in one mesh would be
    subtracted wrongly, without an error.
    """
    shells, volumes = find_shells(vertices, triangles)
    if len(volumes) == 1:
        return [make_solid(vertices, triangles, name)], 0
    each = [np.flatnonzero(shells == k) for k in np.flatnonzero(volumes > 0.0)]
    return [make_solid(vertices, triangles, name, only=body) for body in each], int(
        (volumes < 0.0).sum()
    )


def sweep(face: SolidSurface, way: np.ndarray, name: str) -> Solid:
    """The room over a flat face, whose normals point away from it, up to as far as ``way`` (3,) [m]."""
    count, (a, b) = len(face.vertices), border_edges(face.triangles).T
    walls = np.concatenate([np.c_[b, a, a + count], np.c_[b, a + count, b + count]])
    triangles = np.concatenate([face.triangles, face.triangles[:, ::-1] + count, walls])
    return make_solid(np.concatenate([face.vertices, face.vertices + way]), triangles, name)


def unite(solids: list[Solid], name: str) -> Solid:
    """All of them as one body; where they overlap, once."""
    from manifold3d import Manifold, OpType

    if len(solids) == 1:
        return solids[0]
    body = Manifold.batch_boolean([one.body for one in solids], OpType.Add)
    return Solid(_checked(body, f"{name}: its bodies cannot be united"), -1, name)


def subtract(whole: Solid, taken: Solid) -> Solid:
    """whole without taken; the volumes are checked against those of their intersection.

    Raises InputError when they disagree: the surfaces cross themselves.
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
    """An area in plan, perhaps in several pieces and with holes."""

    section: CrossSection

    def offset(self, by: float, facets: int) -> Outline:
        """The area within ``by`` [m] of this one, round corners in ``facets`` flat sides to a turn; below 0: shrunk."""
        from manifold3d import JoinType

        return Outline(self.section.offset(1e3 * by, JoinType.Round, circular_segments=facets))

    def hull(self, tolerance: float) -> np.ndarray:
        """Corners (n, 2) m of the convex hull, counter-clockwise; those within the tolerance [m] of a line left out."""
        return _corners(self.section.hull().simplify(1e3 * tolerance))[0]

    def without_holes(self, tolerance: float) -> list[np.ndarray]:
        """Corners of the pieces, as those of the hull, their holes left out."""
        from manifold3d import CrossSection

        outer = [piece for piece in self.section.to_polygons() if _signed_area(piece) > 0.0]
        return _corners(CrossSection(outer).simplify(1e3 * tolerance))


def plan_outline(vertices: np.ndarray, triangles: np.ndarray, below: float) -> Outline:
    """What a closed surface, vertices (n, 3) m and triangles (m, 3) outward, covers in plan, below a height [m]."""
    from manifold3d import CrossSection, OpType

    shells, volumes = find_shells(vertices, triangles)
    bodies = [
        make_solid(vertices, triangles, "the part", only=np.flatnonzero(shells == k))
        for k in np.flatnonzero(volumes > 0.0)
    ]
    sections = [
        CrossSection(one.body.trim_by_plane((0.0, 0.0, -1.0), -1e3 * below).project().to_polygons())
        for one in bodies
    ]
    return Outline(CrossSection.batch_boolean(sections, OpType.Add))


def extrude(outline: np.ndarray, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (k, 3) m and triangles (m, 3) of the prism from z = 0 up over an outline (n, 2) m, convex or not."""
    from manifold3d import CrossSection

    mesh = CrossSection([1e3 * outline]).extrude(1e3 * height).to_mesh64()
    return 1e-3 * np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(
        np.int32
    )


def overlap_volume(one: Solid, two: Solid) -> float:
    """The volume [m³] that both have in common."""
    common = one.body ^ two.body
    return (
        float(_checked(common, f"{one.name} and {two.name} cannot be intersected").volume()) * 1e-9
    )


def find_cavities(surface: SolidSurface) -> list[np.ndarray]:
    """The separate rooms of a surface, largest first: masks (k,) of an outer shell and the islands in it."""
    shells, volumes = find_shells(surface.vertices, surface.triangles)
    outer = sorted(np.flatnonzero(volumes > 0.0), key=lambda shell: -volumes[shell])
    rooms = {int(shell): shells == shell for shell in outer}
    for island in np.flatnonzero(volumes <= 0.0):
        points = surface.vertices[surface.triangles[shells == island]].mean(axis=1)
        points = points[:: max(1, len(points) // 8)]
        for shell in reversed(outer):  # the smallest room around it is the one it stands in
            outline = surface.vertices[surface.triangles[shells == shell]]
            if np.median(winding_number(points, outline)) > 0.5:
                rooms[int(shell)] |= shells == island
                break
    return list(rooms.values())


def _corners(section: CrossSection) -> list[np.ndarray]:
    return [1e-3 * np.asarray(polygon) for polygon in section.to_polygons()]


def _signed_area(polygon: np.ndarray) -> float:
    (x, y), (xn, yn) = polygon.T, np.roll(polygon, -1, axis=0).T
    return float(0.5 * (x * yn - y * xn).sum())


def _grid_mm(vertices: np.ndarray) -> np.ndarray:
    return np.round(np.asarray(vertices, dtype=np.float64) * (1e3 / GRID_MM)) * GRID_MM + 0.0


def _checked(body: Manifold, what: str) -> Manifold:
    """The body, unless manifold3d says that it failed: every later result would be empty without a word."""
    from manifold3d import Error

    if body.status() != Error.NoError:
        raise InputError(
            f"{what}: manifold3d says {body.status().name}; the mesh must be closed, each edge shared by two triangles"
        )
    return body

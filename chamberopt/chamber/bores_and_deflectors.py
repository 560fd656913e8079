"""Add holes, wells of further sonotrodes and deflectors to the cavity of a chamber's shape.

A hole and a well are both round bores from a bottom to the room, the inside of the chamber. The tag
of the bottom (the number for its kind of surface) tells them apart: wall or sonotrode.

         room        |        the bore is followed from its bottom to where it enters the room,
    ___         _____|        whatever the wall looks like there; its end lies inside the room and
       |       |              vanishes as the two are united
       |_______|  <- bottom
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.design.shape_surface import (
    TAG_PART,
    TAG_SONOTRODE,
    TAG_WALL,
    ShapeSurface,
    further_sonotrode_tag,
    is_sonotrode,
    lofted,
)
from chamberopt.geometry.meshes.part_mesh import read_part_cached
from chamberopt.geometry.meshes.surface_error import SurfaceError, format_point
from chamberopt.geometry.solids import (
    Solid,
    SolidSurface,
    make_solid,
    overlap_volume,
    split_bodies,
    subtract,
    sweep_face,
    unite,
)
from chamberopt.geometry.triangles import area_vectors, areas, rotation_matrix

if TYPE_CHECKING:
    from chamberopt.design.design import Design
    from chamberopt.design.shapes.hole_and_deflector_tables import Deflector, Hole

SIDES = 64  # flat sides of a round rod or bore, their corners on the circle


class DeflectorMesh(NamedTuple):
    """Closed surface of a deflector, a body placed in the chamber to redirect balls."""

    name: str  # in the design
    at_mm: tuple[float, float, float]  # its middle in the design, for messages
    vertices: np.ndarray  # [m], (n, 3)
    triangles: np.ndarray  # (m, 3), normals outward
    notes: list[str]  # what was assumed and repaired in its file


def read_deflectors(design: Design) -> list[DeflectorMesh]:
    """Return all deflectors of a design as closed surfaces in the chamber.

    Raises InputError if the mesh file of a deflector cannot be used.
    """
    deflectors = []
    for k, one in enumerate(design.chamber.deflectors):
        name = f"chamber.deflectors.{k}"
        vertices, triangles, notes = _mesh_about_its_middle(one, name)
        vertices = vertices @ rotation_matrix(one.rotate_deg).T + np.array(one.at)
        deflectors.append(DeflectorMesh(name, one.at_mm, vertices, triangles, notes))
    return deflectors


def _mesh_about_its_middle(
    deflector: Deflector, name: str
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Return vertices [m] and triangles of a deflector, and notes on its mesh file.

    The deflector is not yet rotated, and its middle is at the origin.
    """
    import trimesh

    if deflector.kind == "mesh":
        try:
            mesh = read_part_cached(deflector.mesh_path, deflector.unit)
        except SurfaceError:
            raise
        except InputError as error:  # its message is about a part
            raise InputError(f"{name}.mesh: {str(error).replace('part.unit', 'unit')}") from None
        middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2.0
        notes = [
            note.replace("part.unit", f"{name}.unit").replace("the part measures", "it measures")
            for note in mesh.notes
        ]
        return mesh.vertices - middle, mesh.triangles, notes
    if deflector.kind == "ball":
        ball = trimesh.creation.icosphere(subdivisions=3, radius=deflector.diameter / 2.0)
        return np.asarray(ball.vertices), np.asarray(ball.faces), []
    if deflector.kind == "plate":
        box = trimesh.creation.box(deflector.size)
        return np.asarray(box.vertices), np.asarray(box.faces), []
    angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
    circle = deflector.diameter / 2.0 * np.c_[np.cos(angle), np.sin(angle)]
    half = deflector.length / 2.0
    rod = lofted([np.c_[circle, np.full(SIDES, -half)], np.c_[circle, np.full(SIDES, half)]])
    return rod.vertices, rod.triangles, []


DEPTH_IN_ROOM = 1e-4  # m: how far a bore continues into the room
WALL_TOLERANCE = 1e-6  # m: a point this close to a wall is on it
AREA_TOLERANCE = 1e-6  # relative area change of a face that stays whole; rounding makes 1e-12
TAG_END = 255  # tag of a bore's end, which must vanish


class TriangleProperties(NamedTuple):
    """Properties of a surface's triangles: tag (number for part, wall or sonotrode), direction,
    part triangle under each, and fitting (hole, deflector, holder or mask).
    """

    tags: np.ndarray  # (k,), uint8
    facing: np.ndarray  # area vector out of the cavity [m²], (k, 3)
    source: np.ndarray  # part triangle under each triangle, else -1; (k,)
    fitting: np.ndarray  # its index in `fitting_names`, -1 for none; (k,)


def triangle_properties(
    facing: np.ndarray, tags: np.ndarray | int, source: np.ndarray | None = None, fitting: int = -1
) -> TriangleProperties:
    """Return the properties of triangles that belong to one hole or deflector, or to none.

    Args:
        facing: area vectors out of the cavity [m²], (k, 3).
        tags: number for the kind of surface, one for all triangles or one for each, (k,).
        source: part triangle under each triangle, (k,); None if they are not on the part.
        fitting: index of the fitting in `fitting_names`, -1 for none.
    """
    count = len(facing)
    return TriangleProperties(
        np.broadcast_to(np.asarray(tags, dtype=np.uint8), count),
        facing,
        np.full(count, -1) if source is None else np.asarray(source, dtype=np.int64),
        np.full(count, fitting, dtype=np.int32),
    )


def fitting_names(design: Design) -> list[str]:
    """Return the names of holes and deflectors, such as chamber.holes.0, then holder and mask."""
    counts = {"holes": len(design.chamber.holes), "deflectors": len(design.chamber.deflectors)}
    names = [f"chamber.{kind}.{k}" for kind, count in counts.items() for k in range(count)]
    given = {"holder": design.holder is not None, "mask": design.mask is not None}
    return names + [name for name, is_given in given.items() if is_given]


def on_deflectors(design: Design, fitting: np.ndarray) -> np.ndarray:
    """Return True for triangles on a deflector, by their indices into `fitting_names`, (k,)."""
    first = len(design.chamber.holes)
    return (fitting >= first) & (fitting < first + len(design.chamber.deflectors))


@dataclass(frozen=True)
class CavitySolid:
    """The cavity as a solid, and the solids from which it was made.

    `pieces` has, by the label of such a solid, what surface its triangles become.
    """

    body: Solid
    pieces: Mapping[int, TriangleProperties]

    def trace(self, surface: SolidSurface) -> TriangleProperties:
        """Return the properties of each triangle of a surface that was cut from these solids."""
        some = next(iter(self.pieces.values()))
        traced = TriangleProperties(
            *(np.zeros((len(surface.solid), *one.shape[1:]), one.dtype) for one in some)
        )
        for label, piece in self.pieces.items():
            rows = surface.solid == label
            for one, values in zip(traced, piece, strict=True):
                one[rows] = values[surface.source[rows]]
        return traced

    def without(self, body: Solid, pieces: Mapping[int, TriangleProperties]) -> CavitySolid:
        """Return the cavity after a body was cut out of it.

        Args:
            body: the solid to cut out.
            pieces: triangle properties of the solids of the body, by label.
        """
        return CavitySolid(subtract(self.body, body), {**self.pieces, **pieces})


class Bore(NamedTuple):
    """A round bore from its bottom into the room, the inside of the chamber."""

    name: str  # in the design
    bottom: np.ndarray  # middle of its bottom [m], shape (3,)
    axis: np.ndarray  # unit vector into the room, shape (3,)
    diameter: float  # [m]
    tag: int  # of the bottom
    amplitude: float = 0.0  # [m], of a bottom that is a sonotrode
    fitting: int = -1  # index of a hole into `fitting_names`


def cavity_solid(
    design: Design, shape: ShapeSurface, deflectors: Sequence[DeflectorMesh]
) -> CavitySolid:
    """Return the solid cavity of a shape with its holes and wells, and without its deflectors.

    Raises InputError if a hole, a well of a further sonotrode or a deflector is out of place.
    """
    shell = make_solid(shape.vertices, shape.triangles, "the chamber")
    facing = area_vectors(shape.vertices, shape.triangles)
    own = triangle_properties(facing, shape.tags, shape.source)
    cavity = CavitySolid(shell, {shell.label: own})
    for k, hole in enumerate(design.chamber.holes):
        cavity = _with_bore(cavity, _bore_of_hole(cavity, hole, k))
    for k, one in enumerate(design.sonotrodes):
        at, axis, tag = np.array(one.at), np.array(one.direction), further_sonotrode_tag(k)
        well = Bore(f"sonotrodes.{k}", at, axis, one.diameter, tag, one.largest_amplitude)
        cavity = _with_bore(cavity, well)
    return _without_deflectors(cavity, design, deflectors) if deflectors else cavity


def swept_faces(design: Design, cavity: CavitySolid) -> list[tuple[str, Solid]]:
    """Return the name of each sonotrode and the solid that its face sweeps as it vibrates."""
    surface = cavity.body.surface()
    tags, sweeps = cavity.trace(surface).tags, []
    for name, tag, axis, amplitude in (
        ("sonotrode", TAG_SONOTRODE, (0.0, 0.0, 1.0), design.sonotrode.largest_amplitude),
        *(
            (f"sonotrodes.{k}", further_sonotrode_tag(k), one.direction, one.largest_amplitude)
            for k, one in enumerate(design.sonotrodes)
        ),
    ):
        way = np.array(axis) * amplitude
        sweeps.append((name, sweep_face(surface.select(tags == tag), way, f"sweep of {name}")))
    return sweeps


def _bore_of_hole(cavity: CavitySolid, hole: Hole, k: int) -> Bore:
    """Return the bore of hole `k`. Its bottom lies beyond the wall by the depth of the hole.

    Raises InputError if the hole's axis does not lead out of the room.
    """
    name, at, out = f"chamber.holes.{k}", np.array(hole.at), np.array(hole.direction)
    distance, entering = first_crossings(cavity.body.surface(), at[None], out, -WALL_TOLERANCE)
    if entering[0] or not np.isfinite(distance[0]):
        raise InputError(
            f"{name}.at_mm: from {format_point(at)} the axis does not lead out of the room; give a "
            "point in the room, in the chamber's frame (z = 0: the sonotrode), and the way out as "
            "axis"
        )
    bottom = at + (distance[0] + hole.depth) * out
    return Bore(name, bottom, -out, hole.diameter, TAG_WALL, fitting=k)


def _with_bore(cavity: CavitySolid, bore: Bore) -> CavitySolid:
    """Return the cavity united with a bore.

    Raises InputError if the bore does not enter the room all round, comes out of it again, or cuts
    into a sonotrode's face or the part.
    """
    axis, bottom = bore.axis, bore.bottom
    aside = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    aside /= np.linalg.norm(aside)
    angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
    rim = bottom + bore.diameter / 2.0 * (
        np.outer(np.cos(angle), aside) + np.outer(np.sin(angle), np.cross(axis, aside))
    )
    distance = _length_to_room(cavity, bore, rim)
    made = lofted([rim, rim + (distance + DEPTH_IN_ROOM) * axis])
    counts = [SIDES, 2 * SIDES, SIDES]
    tags = np.repeat(np.array([bore.tag, TAG_WALL, TAG_END], dtype=np.uint8), counts)
    solid = make_solid(made.vertices, made.triangles, bore.name)
    facing = area_vectors(made.vertices, made.triangles)
    body = unite([cavity.body, solid], f"the chamber with {bore.name}")
    own = triangle_properties(facing, tags, fitting=bore.fitting)
    united = CavitySolid(body, {**cavity.pieces, solid.label: own})

    after, before = _area_by_tag(united), _area_by_tag(cavity)
    if after[TAG_END] > 0.0:
        raise InputError(
            f"{bore.name}.at_mm: its bore comes out of the room again; the room is too narrow "
            "there, or its walls too slanted: move it or make it narrower"
        )
    if bore.tag != TAG_WALL:
        before[bore.tag] += np.linalg.norm(facing[:SIDES], axis=1).sum()
    whole = [tag for tag in range(TAG_END) if tag == TAG_PART or is_sonotrode(np.array(tag))]
    if (np.abs(after - before)[whole] > AREA_TOLERANCE * before[whole]).any():
        raise InputError(
            f"{bore.name}.at_mm: its bore cuts into a sonotrode's face or the part; move it"
        )
    return united


def _length_to_room(cavity: CavitySolid, bore: Bore, rim: np.ndarray) -> float:
    """Return the length [m] at which a bore has its whole circumference inside the chamber's room.

    Raises InputError if the bore does not lead into the room.

    Args:
        rim: points on the edge of the bore's bottom [m], (p, 3).
    """
    starts = np.r_[rim, bore.bottom[None]]
    distance, entering = first_crossings(cavity.body.surface(), starts, bore.axis, 0.0)
    if not (entering & np.isfinite(distance) & (distance > bore.amplitude)).all():
        remedy = (
            "raise depth_mm"
            if bore.tag == TAG_WALL
            else "move at_mm back along the axis, by its amplitude at least"
        )
        direction = [float(f"{k + 0.0:.3g}") for k in bore.axis]
        raise InputError(
            f"{bore.name}.at_mm: a bore of {1e3 * bore.diameter:g} mm from "
            f"{format_point(bore.bottom)} along {direction} does not lead into the room all round: "
            f"where its bottom is in the room, {remedy}; where it passes by the room, move it or "
            "make it narrower"
        )
    return float(distance.max())


def _without_deflectors(
    cavity: CavitySolid, design: Design, deflectors: Sequence[DeflectorMesh]
) -> CavitySolid:
    """Return the cavity after all deflectors were cut out of it.

    All are cut out together, because each cut divides triangles of the surface. Raises InputError
    if a deflector is outside the room, or a sonotrode would hit it.
    """
    sweeps, solids, pieces = swept_faces(design, cavity), [], {}
    for k, deflector in enumerate(deflectors, start=len(design.chamber.holes)):
        own = split_bodies(deflector.vertices, deflector.triangles, deflector.name)[0]
        body = unite(own, own[0].name)
        given = f"{deflector.name}.at_mm: given {list(deflector.at_mm)}"
        if overlap_volume(cavity.body, body) <= 0.0:
            raise InputError(
                f"{given}, where none of it is in the room; positions count from the middle of the "
                "sonotrode's face (z = 0)"
            )
        for sonotrode, swept in sweeps:
            if overlap_volume(swept, body) > 0.0:
                raise InputError(f"{given}, where the face of [{sonotrode}] hits it; move it away")
        facing = -area_vectors(deflector.vertices, deflector.triangles)
        properties = triangle_properties(facing, TAG_WALL, fitting=k)
        solids += own
        pieces.update({solid.label: properties for solid in own})
    return cavity.without(unite(solids, "the deflectors"), pieces)


def first_crossings(
    surface: SolidSurface, points: np.ndarray, direction: np.ndarray, beyond: float
) -> tuple[np.ndarray, np.ndarray]:
    """Find where each line first crosses a surface. A line along an edge counts as a crossing.

    Args:
        points: starts of the lines [m], shape (p, 3).
        direction: unit vector of all lines, shape (3,).
        beyond: smallest distance of a crossing that counts [m].
    Returns:
        Distance [m], inf without a crossing, (p,), and marks of crossings from outside in, (p,).
    """
    a, b, c = (surface.vertices[surface.triangles[:, k]] for k in range(3))
    normal = 2.0 * area_vectors(surface.vertices, surface.triangles)
    slope = normal @ direction
    across = np.flatnonzero(np.abs(slope) > 1e-9 * np.linalg.norm(normal, axis=1))
    a, b, c, normal, slope = a[across], b[across], c[across], normal[across], slope[across]
    distance = (np.einsum("ij,ij->i", a, normal) - points @ normal.T) / slope
    hit = points[:, None] + distance[..., None] * direction
    # Barycentric weights of the hit in each triangle: none is negative inside it.
    weights = [
        np.einsum("pij,ij->pi", np.cross(v - u, hit - u), normal)
        / np.einsum("ij,ij->i", normal, normal)
        for u, v in ((a, b), (b, c), (c, a))
    ]
    inside = (np.array(weights) >= -1e-9).all(axis=0)
    distance = np.where(inside & (distance > beyond), distance, np.inf)
    first = distance.argmin(axis=1)
    return distance[np.arange(len(points)), first], slope[first] < 0.0


def _area_by_tag(cavity: CavitySolid) -> np.ndarray:
    """Return the area [m²] of each kind of surface of the cavity (part, wall ...), by its tag."""
    surface = cavity.body.surface()
    tags = cavity.trace(surface).tags
    return np.bincount(tags, areas(surface.vertices, surface.triangles), TAG_END + 1)

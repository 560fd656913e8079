"""What is added to the cavity of a shape and taken from it: holes and wells of further sonotrodes, then deflectors.

A hole and a well are the same: a round bore from its bottom to the room. What tells them apart is the bottom's tag.

         room        |        the bore's rim is followed from the bottom to where it enters the room, whatever
    ___         _____|        the wall looks like there; its end lies inside the room and vanishes as they unite
       |       |
       |_______|  <- bottom: wall of a hole, face of a sonotrode
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.design.shapes import (
    TAG_PART,
    TAG_SONOTRODE,
    TAG_WALL,
    ShapeSurface,
    further_sonotrode_tag,
    is_sonotrode,
)
from chamberopt.design.shapes.construction.surface import lofted
from chamberopt.geometry.mesh_io import SurfaceError, format_point, read_part_cached
from chamberopt.geometry.solids import (
    Solid,
    SolidSurface,
    make_solid,
    overlap_volume,
    split_bodies,
    subtract,
    sweep,
    unite,
)
from chamberopt.geometry.triangles import area_vectors, areas, rotation_matrix

if TYPE_CHECKING:
    from chamberopt.design.design import Design
    from chamberopt.design.shapes.hole_and_deflector_tables import Deflector, Hole

ROUND = 64  # flat sides of a round bore or rod, their corners on the circle
INSIDE = 1e-4  # m: how far a bore goes on in the room
AT_WALL = 1e-6  # m: a point so near to a wall is on it
INTACT = 1e-6  # of a face's area; cutting it into triangles changes 1e-12
END = 255  # tag of a bore's end, which must vanish


@dataclass(frozen=True)
class Piece:
    """A solid whose triangles bound the cavity: its label, and of each of its triangles the tag, the area vector
    [m²] out of the cavity, the part triangle it lies on, else -1, and the fitting it is of (`fitting_names`), else -1.
    """

    label: int
    tags: np.ndarray
    facing: np.ndarray
    source: np.ndarray
    fitting: np.ndarray


def piece(
    label: int,
    tags: np.ndarray | int,
    facing: np.ndarray,
    source: np.ndarray | None = None,
    fitting: int = -1,
) -> Piece:
    """One whose triangles have these tags, (k,) or one of all, and are of this fitting."""
    none = np.full(len(facing), -1, dtype=np.int32)
    each = np.broadcast_to(np.asarray(tags, dtype=np.uint8), len(facing))
    return Piece(
        label, each, facing, none if source is None else source, np.full_like(none, fitting)
    )


def fitting_names(design: Design) -> list[str]:
    """The holes of a chamber, then its deflectors, as the design names them."""
    holes, deflectors = len(design.chamber.holes), len(design.chamber.deflectors)
    return [
        *(f"chamber.holes.{k}" for k in range(holes)),
        *(f"chamber.deflectors.{k}" for k in range(deflectors)),
    ]


@dataclass(frozen=True)
class Cavity:
    """The room before the part is cut out, and where its surface comes from."""

    body: Solid
    pieces: tuple[Piece, ...]

    def traced(self, surface: SolidSurface, part: Piece) -> Piece:
        """Tag, facing, part triangle and fitting of each triangle of a surface; of none of the pieces is the part's."""
        taken = [
            np.zeros((len(surface.solid), *column.shape[1:]), column.dtype)
            for column in _columns(part)
        ]
        left = np.ones(len(surface.solid), dtype=bool)
        for one in self.pieces:
            rows = surface.solid == one.label
            left &= ~rows
            for column, values in zip(taken, _columns(one), strict=True):
                column[rows] = values[surface.source[rows]]
        for column, values in zip(taken, _columns(part), strict=True):
            column[left] = values[surface.source[left]]
        return Piece(-1, *taken)


def _columns(one: Piece) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    return one.tags, one.facing, one.source, one.fitting


NOTHING = piece(-1, 0, np.zeros((0, 3)))


def fitted(design: Design, shape: ShapeSurface) -> Cavity:
    """The shape with all that the design bores into it and puts in it, but the part.

    Raises InputError, by the fitting's name, for one that is out of place.
    """
    shell = make_solid(shape.vertices, shape.triangles, "the chamber")
    own = piece(
        shell.label, shape.tags, area_vectors(shape.vertices, shape.triangles), shape.source
    )
    cavity = Cavity(shell, (own,))
    for k, hole in enumerate(design.chamber.holes):
        cavity = _with_hole(cavity, hole, f"chamber.holes.{k}", k)
    for k, one in enumerate(design.sonotrodes):
        at, axis = np.array(one.at), np.array(one.direction)
        cavity = _with_bore(
            cavity,
            at,
            axis,
            one.diameter,
            further_sonotrode_tag(k),
            f"sonotrodes.{k}",
            one.amplitude,
        )
    return _without(cavity, design) if design.chamber.deflectors else cavity


def swept_faces(design: Design, cavity: Cavity) -> list[tuple[str, Solid]]:
    """The room that each sonotrode needs for its swing, by the sonotrode's name in the design."""
    surface = cavity.body.surface()
    tags = cavity.traced(surface, NOTHING).tags
    faces = [("sonotrode", TAG_SONOTRODE, (0.0, 0.0, 1.0), design.sonotrode.amplitude)]
    faces += [
        (f"sonotrodes.{k}", further_sonotrode_tag(k), s.direction, s.amplitude)
        for k, s in enumerate(design.sonotrodes)
    ]
    return [
        (
            name,
            sweep(surface.select(tags == tag), np.array(axis) * amplitude, f"the swing of {name}"),
        )
        for name, tag, axis, amplitude in faces
    ]


def _with_hole(cavity: Cavity, hole: Hole, name: str, fitting: int) -> Cavity:
    at, out = np.array(hole.at), np.array(hole.direction)
    reach, entering = _crossings(cavity.body.surface(), at[None], out, -AT_WALL)
    if entering[0] or not np.isfinite(reach[0]):
        raise InputError(
            f"{name}.at_mm: from {format_point(at)} the axis does not lead out of the room; give a point in the room, "
            "in the chamber's frame (z = 0: the sonotrode), and the way out as axis"
        )
    bottom = at + (reach[0] + hole.depth) * out
    return _with_bore(cavity, bottom, -out, hole.diameter, TAG_WALL, name, 0.0, fitting)


def _with_bore(
    cavity: Cavity, bottom: np.ndarray, axis: np.ndarray, diameter: float, tag: int, name: str, swing: float,
    fitting: int = -1,
) -> Cavity:  # fmt: skip
    """United with a bore from its bottom (3,) [m] along its axis (3,) into the room."""
    aside = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    aside /= np.linalg.norm(aside)
    angle = 2.0 * np.pi * np.arange(ROUND) / ROUND
    rim = bottom + diameter / 2.0 * (
        np.outer(np.cos(angle), aside) + np.outer(np.sin(angle), np.cross(axis, aside))
    )
    room = cavity.body.surface()
    reach, entering = _crossings(room, np.r_[rim, bottom[None]], axis, 0.0)
    if not (entering & np.isfinite(reach) & (reach > swing)).all():
        moves = (
            "raise depth_mm"
            if tag == TAG_WALL
            else "move at_mm back along the axis, by its amplitude at least"
        )
        raise InputError(
            f"{name}.at_mm: a bore of {1e3 * diameter:g} mm from {format_point(bottom)} along {_shown(axis)} does not "
            f"lead into the room all round: where its bottom is in the room, {moves}; where it passes by the room, "
            "move it or make it narrower"
        )
    made = lofted([rim, rim + (reach.max() + INSIDE) * axis])
    tags = np.repeat(np.array([tag, TAG_WALL, END], dtype=np.uint8), [ROUND, 2 * ROUND, ROUND])
    bore = make_solid(made.vertices, made.triangles, name)
    facing = area_vectors(made.vertices, made.triangles)
    body = unite([cavity.body, bore], f"the chamber with {name}")
    after = Cavity(body, (*cavity.pieces, piece(bore.label, tags, facing, None, fitting)))
    now = _area_by_tag(after)
    if now[END] > 0.0:
        raise InputError(
            f"{name}.at_mm: its bore comes out of the room again; the room is too narrow there, or its walls too "
            "slanted: move it or make it narrower"
        )
    was = _area_by_tag(cavity)
    was[tag] += np.linalg.norm(facing[:ROUND], axis=1).sum() if tag != TAG_WALL else 0.0
    kept = [other for other in range(END) if other == TAG_PART or is_sonotrode(np.array(other))]
    if (np.abs(now - was)[kept] > INTACT * was[kept]).any():
        raise InputError(
            f"{name}.at_mm: its bore cuts into a sonotrode's face or the part; move it"
        )
    return after


def _without(cavity: Cavity, design: Design) -> Cavity:
    """Without all deflectors at once: one after the other would take as many cuts through an ever finer surface."""
    swings, standing, pieces = swept_faces(design, cavity), [], []
    for k, deflector in enumerate(design.chamber.deflectors):
        vertices, triangles = _body_of(deflector, f"chamber.deflectors.{k}")
        vertices = vertices @ rotation_matrix(deflector.rotate_deg).T + np.array(deflector.at)
        own = split_bodies(vertices, triangles, f"chamber.deflectors.{k}")[0]
        _refuse_out_of_place(deflector, unite(own, own[0].name), cavity, swings)
        facing = -area_vectors(vertices, triangles)
        standing += own
        pieces += [
            piece(one.label, TAG_WALL, facing, None, len(design.chamber.holes) + k) for one in own
        ]
    return Cavity(
        subtract(cavity.body, unite(standing, "the deflectors")), (*cavity.pieces, *pieces)
    )


def _refuse_out_of_place(
    deflector: Deflector, body: Solid, cavity: Cavity, swings: Sequence[tuple[str, Solid]]
) -> None:
    name = body.name
    if overlap_volume(cavity.body, body) <= 0.0:
        raise InputError(
            f"{name}.at_mm: given {list(deflector.at_mm)}, where none of it is in the room; positions count from the "
            "middle of the sonotrode's face (z = 0)"
        )
    for whose, swing in swings:
        if overlap_volume(swing, body) > 0.0:
            raise InputError(
                f"{name}.at_mm: given {list(deflector.at_mm)}, where the face of [{whose}] hits it; move it away"
            )


def notes_on_files(design: Design) -> list[str]:
    """What was guessed and healed in the files of deflectors."""
    return [
        note.replace("part.unit", f"chamber.deflectors.{k}.unit").replace(
            "the part measures", "it measures"
        )
        for k, deflector in enumerate(design.chamber.deflectors)
        if deflector.mesh is not None
        for note in read_part_cached(deflector.mesh_path, deflector.unit).notes
    ]


def _body_of(deflector: Deflector, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Vertices [m] and triangles of a deflector about its middle, not yet turned."""
    import trimesh

    if deflector.kind == "mesh":
        try:
            mesh = read_part_cached(deflector.mesh_path, deflector.unit)
        except SurfaceError:
            raise
        except InputError as error:  # told of a part
            raise InputError(f"{name}.mesh: {str(error).replace('part.unit', 'unit')}") from None
        return mesh.vertices - (
            mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)
        ) / 2.0, mesh.triangles
    if deflector.kind == "ball":
        ball = trimesh.creation.icosphere(subdivisions=3, radius=deflector.diameter / 2.0)
        return np.asarray(ball.vertices), np.asarray(ball.faces)
    if deflector.kind == "plate":
        box = trimesh.creation.box(deflector.size)
        return np.asarray(box.vertices), np.asarray(box.faces)
    angle = 2.0 * np.pi * np.arange(ROUND) / ROUND
    circle = deflector.diameter / 2.0 * np.c_[np.cos(angle), np.sin(angle)]
    half = deflector.length / 2.0
    rod = lofted([np.c_[circle, np.full(ROUND, -half)], np.c_[circle, np.full(ROUND, half)]])
    return rod.vertices, rod.triangles


def _crossings(
    surface: SolidSurface, points: np.ndarray, way: np.ndarray, beyond: float
) -> tuple[np.ndarray, np.ndarray]:
    """How far [m] from points (p, 3) along the unit vector ``way`` the surface is crossed first, farther than
    ``beyond``; inf where it is not; and whether from outside in, (p,) each. A line along an edge crosses it.
    """
    a, b, c = (surface.vertices[surface.triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    slope = normal @ way
    facing = np.flatnonzero(np.abs(slope) > 1e-9 * np.linalg.norm(normal, axis=1))
    a, b, c, normal, slope = a[facing], b[facing], c[facing], normal[facing], slope[facing]
    t = (np.einsum("ij,ij->i", a, normal) - points @ normal.T) / slope
    hit = points[:, None] + t[..., None] * way
    weights = [
        np.einsum("pij,ij->pi", np.cross(v - u, hit - u), normal)
        / np.einsum("ij,ij->i", normal, normal)
        for u, v in ((a, b), (b, c), (c, a))
    ]
    t = np.where((np.array(weights) >= -1e-9).all(axis=0) & (t > beyond), t, np.inf)
    first = t.argmin(axis=1)
    return t[np.arange(len(points)), first], slope[first] < 0.0


def _area_by_tag(cavity: Cavity) -> np.ndarray:
    surface = cavity.body.surface()
    tags = cavity.traced(surface, NOTHING).tags
    return np.bincount(tags, areas(surface.vertices, surface.triangles), END + 1)


def _shown(axis: np.ndarray) -> str:
    return str([float(f"{k + 0.0:.3g}") for k in axis])

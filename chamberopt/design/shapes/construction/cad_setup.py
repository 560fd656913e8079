"""A file's triangles -> Setup: the room that the shot flies in, its sonotrode's face down, and the part in it.

The part is either a closed body, to be cut out of the room like any other, or the piece of its surface that bounds
the room. The room is the one that the sonotrode's face belongs to, whichever way its triangles face.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.design.shapes.construction.surface import (
    TAG_PART,
    TAG_SONOTRODE,
    TAG_WALL,
    ShapeSurface,
)
from chamberopt.geometry.mesh_io import (
    OpenSurfaceError,
    PartMesh,
    TriangleSoup,
    close_surface,
    format_point,
    read_triangles,
    select_triangles,
)
from chamberopt.geometry.solids import Solid, make_solid, overlap_volume, snap_to_grid, unite
from chamberopt.geometry.triangles import area_vectors, find_shells, find_unwalled_border

FLAT = 2e-6  # m: what rounding in a text file may lift a sonotrode's corners by
ALONG = 1e-6  # rad: a direction so near to an axis of the file is meant to be that axis
SAME = 1e-6  # of a volume
SAME_WAY = 1e-3  # of an area that is lost to triangles that do not face as the others


@dataclass(frozen=True)
class Setup:
    """The set-up as drawn, the face of its sonotrode at z = 0 and looking up.

    room: without a part that is a body of its own · part: its mesh in the file's frame, normals out of the part, and
    the notes on the whole; a piece of the room's surface unless it is a body · turn (3, 3), then shift (3,) [m]: from
    the file's frame · distance [m] from the sonotrode to the lowest point of the part.
    """

    room: ShapeSurface
    part: PartMesh
    turn: np.ndarray
    shift: np.ndarray
    distance: float


def read_setup(path: Path, unit: str, part: tuple[str, ...], sonotrode: tuple[str, ...]) -> Setup:
    """The set-up in a file, once as long as it does not change; ``part`` and ``sonotrode``: names of its groups.

    Raises InputError for names that are not there, a room that is not closed, and a sonotrode that is not flat.
    """
    try:
        stamp = path.stat()
    except OSError:
        read_triangles(path, unit)  # says what is wrong
        raise
    return _read_once(path, unit, part, sonotrode, stamp.st_mtime_ns, stamp.st_size)


@lru_cache(maxsize=4)
def _read_once(
    path: Path,
    unit: str,
    part: tuple[str, ...],
    sonotrode: tuple[str, ...],
    _changed: int,
    _size: int,
) -> Setup:
    read = read_triangles(path, unit)
    of_part, of_face = (
        _chosen(read, names, f"chamber.{key}")
        for key, names in (("part", part), ("sonotrode", sonotrode))
    )
    if (of_part & of_face).any():
        raise InputError(
            f"chamber.part: {(of_part & of_face).sum()} of its triangles are the sonotrode's too"
        )
    body, whole = _bodies(read, of_part)
    mesh, left = _room_of_sonotrode(whole, sonotrode)
    own = select_triangles(mesh.groups, part, len(mesh.triangles), "chamber.part")
    face = select_triangles(mesh.groups, sonotrode, len(mesh.triangles), "chamber.sonotrode")
    turn, shift, said = _upright(mesh, face)
    vertices = snap_to_grid(mesh.vertices @ turn.T + shift)
    vertices[np.unique(mesh.triangles[face]), 2] = 0.0
    rim = find_unwalled_border(vertices, mesh.triangles, face)
    if rim is not None:
        raise InputError(
            f"chamber.sonotrode: its face has a free rim at {format_point(turn.T @ (rim - shift))}: walls must rise from "
            "it all round, as a moving edge is not supported"
        )
    tags = np.select([face, own], [TAG_SONOTRODE, TAG_PART], TAG_WALL).astype(np.uint8)
    source = None
    if body is None:
        body, source = _piece(mesh, own), np.where(own, np.cumsum(own) - 1, -1).astype(np.int32)
    notes = tuple(dict.fromkeys((*body.notes, *mesh.notes, *left, *said)))
    lowest = snap_to_grid(body.vertices @ turn.T + shift)[:, 2].min()
    room = ShapeSurface(vertices, mesh.triangles, tags, source)
    return Setup(room, replace(body, notes=notes), turn, shift, float(lowest))


def _chosen(read: TriangleSoup, names: tuple[str, ...], field: str) -> np.ndarray:
    chosen = select_triangles(read.groups, names, len(read.corners), field)
    if not chosen.any() or chosen.all():
        what = "none" if not chosen.any() else "all"
        raise InputError(f"{field}: {list(names)} are {what} of the triangles of {read.path.name}")
    return chosen


def _bodies(read: TriangleSoup, own: np.ndarray) -> tuple[PartMesh | None, PartMesh]:
    """The part as a closed body, and the closed surface of the rest; None and everything where only a piece of the
    part's surface is drawn.
    """
    try:
        body = close_surface(read, own)
    except OpenSurfaceError:
        return None, close_surface(read)
    try:
        return body, close_surface(read, ~own)
    except OpenSurfaceError as error:
        said = error
    try:
        return None, close_surface(read)  # only healing had made a body of a piece
    except OpenSurfaceError:
        why = "chamber.part is a closed body, so that what is around it must be closed without it"
        raise OpenSurfaceError(f"{said}; {why}", said.corners, said.edges) from None


def _piece(mesh: PartMesh, own: np.ndarray) -> PartMesh:
    """The part as the piece of the room's surface that it bounds, in the order of the room's triangles."""
    if not own.any():
        raise InputError(
            "chamber.part: none of it bounds the room over the sonotrode; check the groups of the file"
        )
    used, numbers = np.unique(mesh.triangles[own][:, ::-1], return_inverse=True)
    triangles = numbers.reshape(-1, 3).astype(np.int32)
    groups = {name: mask[own] for name, mask in mesh.groups.items() if mask[own].any()}
    numbering = mesh.numbering.of(own)
    return replace(
        mesh, vertices=mesh.vertices[used], triangles=triangles, numbering=numbering, groups=groups
    )


def _room_of_sonotrode(mesh: PartMesh, sonotrode: tuple[str, ...]) -> tuple[PartMesh, list[str]]:
    """The closed piece that the sonotrode is on, facing out of the room, with what stands in it; and notes.

    What lies around it, as the outside of a chamber with thick walls does, is left out.
    """
    face = select_triangles(mesh.groups, sonotrode, len(mesh.triangles), "chamber.sonotrode")
    facing = area_vectors(mesh.vertices, mesh.triangles[face])
    if np.linalg.norm(facing.sum(axis=0)) < (1.0 - SAME_WAY) * np.linalg.norm(facing, axis=1).sum():
        raise InputError(
            "chamber.sonotrode: its triangles are not flat, they face different ways; name one flat face"
        )
    shells, volumes = find_shells(mesh.vertices, mesh.triangles)
    of_face = np.unique(shells[face])
    if len(of_face) != 1:
        raise InputError(
            f"chamber.sonotrode: its triangles are on {len(of_face)} separate closed surfaces; name the one flat face "
            "that is the floor of the room"
        )
    outward = np.where((volumes < 0.0)[shells][:, None], mesh.triangles[:, ::-1], mesh.triangles)
    bodies = [
        make_solid(
            mesh.vertices,
            outward,
            f"closed surface {k + 1} of the set-up",
            only=np.flatnonzero(shells == k),
        )
        for k in range(len(volumes))
    ]
    first = int(of_face[0])
    inside = [k for k in range(len(volumes)) if k != first and _is_inside(bodies[k], bodies[first])]
    if inside and unite([bodies[k] for k in inside], "").volume < (1.0 - SAME) * sum(
        bodies[k].volume for k in inside
    ):
        raise InputError(
            "the set-up: closed surfaces that stand in its room overlap; unite them in the CAD program"
        )
    triangles = np.where(np.isin(shells, inside)[:, None], outward[:, ::-1], outward)
    rows = np.isin(shells, [first, *inside])
    used, numbers = np.unique(triangles[rows], return_inverse=True)
    groups = {name: mask[rows] for name, mask in mesh.groups.items()}
    kept = numbers.reshape(-1, 3).astype(np.int32)
    numbering = mesh.numbering.of(rows)
    room = replace(
        mesh, vertices=mesh.vertices[used], triangles=kept, numbering=numbering, groups=groups
    )
    left = len(volumes) - 1 - len(inside)
    return room, [
        f"{left} closed surfaces that are not in the room over the sonotrode are left out"
    ] if left else []


def _is_inside(body: Solid, room: Solid) -> bool:
    """Whether a body stands in the room; false where it is beside or around it. InputError where they cross."""
    common = overlap_volume(body, room)
    if SAME * body.volume < common < (1.0 - SAME) * min(body.volume, room.volume):
        raise InputError(
            f"the set-up: {body.name}, {1e9 * body.volume:.4g} mm³, crosses the wall of the room over the sonotrode; "
            "unite them in the CAD program, or name it in chamber.part"
        )
    return common >= (1.0 - SAME) * body.volume


def _upright(mesh: PartMesh, face: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Matrix (3, 3) and shift (3,) [m] that put the flat face at z = 0, looking up; and a note where it turns."""
    up = -area_vectors(mesh.vertices, mesh.triangles[face]).sum(axis=0)
    up /= np.linalg.norm(up)
    nearest = np.round(up)
    up = nearest if np.abs(up - nearest).max() < ALONG else up
    heights = mesh.vertices[np.unique(mesh.triangles[face])] @ up
    if np.ptp(heights) > FLAT:
        raise InputError(
            f"chamber.sonotrode: its triangles are not flat, they reach from {1e3 * heights.min():.6g} to "
            f"{1e3 * heights.max():.6g} mm along their mean normal; name the peening face alone"
        )
    turn = _to_z(up)
    shift, told = (
        np.array([0.0, 0.0, -(heights.min() + heights.max()) / 2.0]),
        np.round(up, 4) + 0.0,
    )
    return (
        turn,
        shift,
        [] if up[2] == 1.0 else [f"turned so that what is along {told.tolist()} in the file is up"],
    )


def _to_z(up: np.ndarray) -> np.ndarray:
    """The least turn (3, 3) that takes a unit vector to (0, 0, 1); about x where it points down."""
    x, y, z = up
    if z < -1.0 + ALONG:
        return np.diag([1.0, -1.0, -1.0])
    cross = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])
    return np.asarray(np.eye(3) + cross + cross @ cross / (1.0 + z))

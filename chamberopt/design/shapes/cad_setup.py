"""Read a CAD set-up, in which chamber, sonotrode and part are drawn together in one file.

The result is the room over the sonotrode, moved so that the sonotrode's face is at z = 0. The room
is bounded by the closed surface to which the sonotrode's face belongs, whose triangles may face
either way in the file. The part is either a separate closed body, which is cut out of the room
later, or a piece of the room's surface.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.design.shape_surface import TAG_PART, TAG_SONOTRODE, TAG_WALL, ShapeSurface
from chamberopt.geometry.meshes.part_mesh import (
    PartMesh,
    TriangleSoup,
    close_surface,
    read_triangles,
    select_triangles,
)
from chamberopt.geometry.meshes.surface_error import OpenSurfaceError, format_point
from chamberopt.geometry.solids import Solid, make_solid, overlap_volume, snap_to_grid, unite
from chamberopt.geometry.triangles import area_vectors, find_shells, find_unwalled_border

FLATNESS = 2e-6  # m: rounding in a text file may lift a sonotrode's corners by this much
AXIS_TOLERANCE = 1e-6  # rad: a direction this close to an axis of the file is taken as the axis
VOLUME_TOLERANCE = 1e-6  # relative
FACING_TOLERANCE = 1e-3  # share of the area that triangles facing another way may take away


@dataclass(frozen=True)
class Setup:
    """Set-up: chamber and part as drawn in one file, moved so that the sonotrode's face is at z = 0
    and faces up.
    """

    room: ShapeSurface  # without the part if the part is a separate body
    # The part in the file's frame, normals out of the part, with the notes on the whole set-up. It
    # is a piece of the room's surface unless it is a separate body.
    part: PartMesh
    turn: np.ndarray  # rotation from the file's frame, shape (3, 3), applied before the shift
    shift: np.ndarray  # [m], shape (3,)
    distance: float  # distance from the sonotrode to the lowest point of the part [m]


def read_setup(path: Path, unit: str, part: tuple[str, ...], sonotrode: tuple[str, ...]) -> Setup:
    """Return the set-up (chamber, part and sonotrode) in a file, read again only if it has changed.

    Raises InputError if a name is not in the file, the room is not closed, or the sonotrode's face
    is not flat.

    Args:
        part, sonotrode: names of the file's groups for the part and for the sonotrode's face.
    """
    try:
        stamp = path.stat()
    except OSError:
        read_triangles(path, unit)  # the error of this call names the fault
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
    in_part = _select_some(read, part, "chamber.part")
    in_face = _select_some(read, sonotrode, "chamber.sonotrode")
    if count := (in_part & in_face).sum():
        raise InputError(f"chamber.part: {count} of its triangles are the sonotrode's too")
    body, whole = _separate_part(read, in_part)
    mesh, room_notes = _room_over_sonotrode(whole, sonotrode)
    in_part = select_triangles(mesh.groups, part, len(mesh.triangles), "chamber.part")
    in_face = select_triangles(mesh.groups, sonotrode, len(mesh.triangles), "chamber.sonotrode")
    turn, shift, turn_notes = _pose(mesh, in_face)
    vertices = snap_to_grid(mesh.vertices @ turn.T + shift)
    vertices[np.unique(mesh.triangles[in_face]), 2] = 0.0
    border = find_unwalled_border(vertices, mesh.triangles, in_face)
    if border is not None:
        place = format_point(turn.T @ (border - shift))
        why = "walls must rise from it all round, as a moving edge is not supported"
        raise InputError(f"chamber.sonotrode: its face has a free edge at {place}: {why}")
    tags = np.select([in_face, in_part], [TAG_SONOTRODE, TAG_PART], TAG_WALL).astype(np.uint8)
    source = None
    if body is None:
        body = _piece_of_part(mesh, in_part)
        source = np.where(in_part, np.cumsum(in_part) - 1, -1).astype(np.int32)
    notes = tuple(dict.fromkeys((*body.notes, *mesh.notes, *room_notes, *turn_notes)))
    lowest = snap_to_grid(body.vertices @ turn.T + shift)[:, 2].min()
    room = ShapeSurface(vertices, mesh.triangles, tags, source)
    return Setup(room, replace(body, notes=notes), turn, shift, float(lowest))


def _select_some(read: TriangleSoup, names: tuple[str, ...], field: str) -> np.ndarray:
    """Mark the triangles (m,) of the named groups. Raises InputError if none or all are marked.

    Args:
        field: name of the design's key that gives the names, for messages.
    """
    chosen = select_triangles(read.groups, names, len(read.corners), field)
    if not chosen.any() or chosen.all():
        what = "all" if chosen.any() else "none"
        raise InputError(f"{field}: {list(names)} are {what} of the triangles of {read.path.name}")
    return chosen


def _separate_part(read: TriangleSoup, in_part: np.ndarray) -> tuple[PartMesh | None, PartMesh]:
    """Return the part as a closed body, and the closed surface of all the rest.

    If only a piece of the part's surface is drawn, return None and the whole surface instead.

    Args:
        in_part: marks the triangles of the part, (m,).
    """
    try:
        body = close_surface(read, in_part)
    except OpenSurfaceError:
        return None, close_surface(read)
    try:
        return body, close_surface(read, ~in_part)
    except OpenSurfaceError as error:
        open_rest = error
    try:
        return None, close_surface(read)  # the piece was a closed body only because it was healed
    except OpenSurfaceError:
        why = "chamber.part is a closed body, so that what is around it must be closed without it"
        message = f"{open_rest}; {why}"
        raise OpenSurfaceError(message, open_rest.corners, open_rest.edges) from None


def _pick(mesh: PartMesh, triangles: np.ndarray, rows: np.ndarray) -> PartMesh:
    """Return a mesh of the marked triangles only, with their vertices, groups and numbers.

    Args:
        mesh: mesh that has the vertices and groups.
        triangles: the triangles of the mesh, or these with other directions, (m, 3).
        rows: marks the triangles to keep, (m,) bool.
    """
    used, numbers = np.unique(triangles[rows], return_inverse=True)
    return replace(
        mesh,
        vertices=mesh.vertices[used],
        triangles=numbers.reshape(-1, 3).astype(np.int32),
        numbering=mesh.numbering.select(rows),
        groups={name: mask[rows] for name, mask in mesh.groups.items()},
    )


def _piece_of_part(mesh: PartMesh, in_part: np.ndarray) -> PartMesh:
    """Return the piece of the room's surface that belongs to the part, with normals out of it.

    Its triangles are in the order of the room's triangles.
    """
    if not in_part.any():
        text = "none of it bounds the room over the sonotrode; check the groups of the file"
        raise InputError(f"chamber.part: {text}")
    piece = _pick(mesh, mesh.triangles[:, ::-1], in_part)
    return replace(piece, groups={name: own for name, own in piece.groups.items() if own.any()})


def _room_over_sonotrode(mesh: PartMesh, sonotrode: tuple[str, ...]) -> tuple[PartMesh, list[str]]:
    """Return the surface of the room over the sonotrode, and notes on what was left out.

    It consists of the closed surface with the sonotrode's face and of the surfaces of bodies inside
    it, with normals out of the room. Surfaces around it, such as the outside of thick walls, are
    left out.

    Args:
        sonotrode: names of the file's groups for the sonotrode's face.
    """
    face = select_triangles(mesh.groups, sonotrode, len(mesh.triangles), "chamber.sonotrode")
    facing = area_vectors(mesh.vertices, mesh.triangles[face])
    total_area = np.linalg.norm(facing, axis=1).sum()
    if np.linalg.norm(facing.sum(axis=0)) < (1.0 - FACING_TOLERANCE) * total_area:
        text = "its triangles are not flat, they face different ways; name one flat face"
        raise InputError(f"chamber.sonotrode: {text}")
    shells, volumes = find_shells(mesh.vertices, mesh.triangles)
    face_shells = np.unique(shells[face])
    if len(face_shells) != 1:
        where = f"on {len(face_shells)} separate closed surfaces"
        remedy = "name the one flat face that is the floor of the room"
        raise InputError(f"chamber.sonotrode: its triangles are {where}; {remedy}")
    outward = np.where((volumes < 0.0)[shells][:, None], mesh.triangles[:, ::-1], mesh.triangles)
    bodies = []
    for k in range(len(volumes)):
        name, only = f"closed surface {k + 1} of the set-up", np.flatnonzero(shells == k)
        bodies.append(make_solid(mesh.vertices, outward, name, only=only))
    first = int(face_shells[0])
    inside = [k for k in range(len(volumes)) if k != first and _is_inside(bodies[k], bodies[first])]
    least = (1.0 - VOLUME_TOLERANCE) * sum(bodies[k].volume for k in inside)
    if inside and unite([bodies[k] for k in inside], "").volume < least:
        text = "closed surfaces that stand in its room overlap; unite them in the CAD program"
        raise InputError(f"the set-up: {text}")
    triangles = np.where(np.isin(shells, inside)[:, None], outward[:, ::-1], outward)
    room = _pick(mesh, triangles, np.isin(shells, [first, *inside]))
    left = len(volumes) - 1 - len(inside)
    note = f"{left} closed surfaces that are not in the room over the sonotrode are left out"
    return room, [note] if left else []


def _is_inside(body: Solid, room: Solid) -> bool:
    """True if a body stands wholly in the room. Raises InputError if it crosses the room's wall."""
    common = overlap_volume(body, room)
    smaller = min(body.volume, room.volume)
    if VOLUME_TOLERANCE * body.volume < common < (1.0 - VOLUME_TOLERANCE) * smaller:
        raise InputError(
            f"the set-up: {body.name}, {1e9 * body.volume:.4g} mm³, crosses the wall of the room "
            "over the sonotrode; unite them in the CAD program, or name it in chamber.part"
        )
    return common >= (1.0 - VOLUME_TOLERANCE) * body.volume


def _pose(mesh: PartMesh, face: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Return the motion that puts the sonotrode's face at z = 0, facing up, and notes on it.

    The motion is a rotation (3, 3), then a shift (3,) [m]. Raises InputError if the face is not
    flat.

    Args:
        face: marks the triangles of the face, (m,).
    """
    up = -area_vectors(mesh.vertices, mesh.triangles[face]).sum(axis=0)
    up /= np.linalg.norm(up)
    axis = np.round(up)
    up = axis if np.abs(up - axis).max() < AXIS_TOLERANCE else up
    heights = mesh.vertices[np.unique(mesh.triangles[face])] @ up
    if np.ptp(heights) > FLATNESS:
        raise InputError(
            "chamber.sonotrode: its triangles are not flat, they reach from "
            f"{1e3 * heights.min():.6g} to {1e3 * heights.max():.6g} mm along their mean normal; "
            "name the peening face alone"
        )
    shift = np.array([0.0, 0.0, -(heights.min() + heights.max()) / 2.0])
    direction = (np.round(up, 4) + 0.0).tolist()
    note = f"turned so that the direction {direction} in the file is up"
    return _rotation_to_z(up), shift, [] if up[2] == 1.0 else [note]


def _rotation_to_z(up: np.ndarray) -> np.ndarray:
    """Return the smallest rotation (3, 3) that turns a unit vector to (0, 0, 1).

    For (0, 0, -1), where many rotations are equally small, it is the half turn about x.
    """
    x, y, z = up
    if z < -1.0 + AXIS_TOLERANCE:
        return np.diag([1.0, -1.0, -1.0])
    cross = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])
    return np.asarray(np.eye(3) + cross + cross @ cross / (1.0 + z))

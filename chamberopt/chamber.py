"""Design -> Chamber: the closed cavity that the shot flies in, each triangle knowing what it belongs to.

The cavity is the shape without the part. One subtraction covers a part that hangs freely, one whose shaft
goes out through the ceiling, and one that closes the chamber like a lid; of what is left, the room over the
sonotrode counts.

Frame: metres, z up, mean sonotrode face at z = 0, chamber axis x = y = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.errors import InputError
from chamberopt.mesh_io import PartMesh, box_text, read_part
from chamberopt.shapes import TAG_PART, TAG_SONOTRODE, TAG_WALL, ShapeSurface, shape_surface
from chamberopt.slivers import THINNEST, without_slivers
from chamberopt.solids import Solid, Surface, cavities, snapped, solid, subtract, united
from chamberopt.triangles import area_vectors, areas, shells_of, tetrahedron_volumes

if TYPE_CHECKING:
    from chamberopt.config import Design

CROOKED = 1e-3  # rad: turns a ball's path by less than the facets of a round wall do, by a hundred times

__all__ = ["TAG_PART", "TAG_SONOTRODE", "TAG_WALL", "Chamber", "Part", "build_chamber"]


@dataclass(frozen=True)
class Part:
    """The user's own triangles, in the file's order, posed in the chamber.

    vertices (n, 3) m · triangles (m, 3) int32 · area (m,) m² · target (m,) bool: what must be covered · name ·
    sha256 of the mesh file as it was read.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    area: np.ndarray
    target: np.ndarray
    name: str
    sha256: str = ""


@dataclass(frozen=True)
class Chamber:
    """The cavity of one design.

    vertices (n, 3) float64 m · triangles (k, 3) int32, closed, normals pointing out of the cavity · tags
    (k,) uint8 · source (k,) int32: the part triangle that a TAG_PART triangle lies on, else -1 · volume m³
    · part · exposed_area (m,) m² of each part triangle that bounds the cavity · notes: what was done on the
    user's behalf.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    tags: np.ndarray
    source: np.ndarray
    volume: float
    part: Part
    exposed_area: np.ndarray
    notes: tuple[str, ...]


def build_chamber(design: Design) -> Chamber:
    """The chamber of a design.

    Raises InputError when the part's mesh cannot be used, when the part is outside the cavity or touches the
    sonotrode, when nothing of the target faces the shot, or when the part leaves no room over the sonotrode.
    """
    mesh = _mesh(design.part.mesh_path, design.part.unit)
    part = _posed(mesh, design)
    notes = list(mesh.notes)
    shape = shape_surface(design)
    _refuse_misplaced(part, shape.vertices, design)

    body, voids = _body(part)
    notes += [f"{part.name}: {voids} closed voids inside the part are left out"] if voids else []
    shell = solid(shape.vertices, shape.triangles, "the chamber")
    whole = subtract(shell, body).surface()
    if not (whole.solid != shell.label).any():
        raise InputError(
            f"{part.name}: no part of it is inside the chamber; change part.offset_mm, "
            "chamber.diameter_mm or chamber.height_mm"
        )
    room, room_notes = _room_over_sonotrode(whole, shell, shape.tags, design)
    room = without_slivers(room)[0]
    on_part = room.solid != shell.label
    tags = np.where(on_part, TAG_PART, shape.tags[np.where(on_part, 0, room.source)]).astype(np.uint8)
    source = np.where(on_part, room.source, -1).astype(np.int32)
    exposed = np.bincount(source[on_part], areas(room.vertices, room.triangles)[on_part], len(part.triangles))
    notes += _hidden_target_note(part, exposed)
    notes += room_notes + _crooked_note(room, on_part, part, shape) + _hold_note(room, on_part, part.name)
    volume = float(tetrahedron_volumes(room.vertices, room.triangles).sum())
    return Chamber(room.vertices, room.triangles, tags, source, volume, part, exposed, tuple(notes))


def _mesh(path: Path, unit: str) -> PartMesh:
    """The part's mesh, read once per file: a study builds a hundred chambers around the same part."""
    try:
        stamp = path.stat()
    except OSError:
        return read_part(path, unit)  # says what is wrong
    return _mesh_once(path, unit, stamp.st_mtime_ns, stamp.st_size)


@lru_cache(maxsize=4)
def _mesh_once(path: Path, unit: str, _changed: int, _size: int) -> PartMesh:
    return read_part(path, unit)


def _posed(mesh: PartMesh, design: Design) -> Part:
    """The part turned about the file's x, then y, then z, its box centred on the axis, then moved.

    Sideways by the offset, up or down so that its lowest point is at the sonotrode distance.
    """
    rotation, shift = _pose(mesh, design)
    vertices = snapped(mesh.vertices @ rotation.T + shift)
    target = _target(mesh, design)
    area = areas(vertices, mesh.triangles)
    return Part(vertices, mesh.triangles, area, target, design.part.mesh_path.name, mesh.sha256)


def _pose(mesh: PartMesh, design: Design) -> tuple[np.ndarray, np.ndarray]:
    """From the part file's frame to the chamber's: matrix (3, 3), then shift (3,) [m]."""
    rotation = _rotation(design.part.rotate_deg)
    vertices = mesh.vertices @ rotation.T
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    centre = (low + high) / 2.0
    x, y = design.part.offset
    return rotation, np.array([x - centre[0], y - centre[1], design.chamber.sonotrode_distance - low[2]])


def turning_axis(design: Design) -> tuple[np.ndarray, np.ndarray]:
    """Point [m] and direction, (3,) each, of the axis that effects.part_turn names, in the chamber's frame."""
    turn = design.effects.part_turn
    if turn is None:
        raise ValueError("nothing turns in this design")
    rotation, shift = _pose(_mesh(design.part.mesh_path, design.part.unit), design)
    return rotation @ np.array(turn.through) + shift, rotation @ np.array(turn.axis)


def _rotation(degrees: tuple[float, float, float]) -> np.ndarray:
    """Matrix (3, 3) of turns about the fixed axes x, then y, then z; exact for quarter turns."""
    matrix = np.eye(3)
    for axis, angle in enumerate(degrees):
        turns, rest = divmod(angle, 90.0)
        s, c = np.sin(np.radians(rest)), np.cos(np.radians(rest))
        for _ in range(int(turns) % 4):
            s, c = c, -s
        i, j = (axis + 1) % 3, (axis + 2) % 3
        turn = np.eye(3)
        turn[i, i], turn[i, j], turn[j, i], turn[j, j] = c, -s, s, c
        matrix = turn @ matrix
    return matrix


def _target(mesh: PartMesh, design: Design) -> np.ndarray:
    """Which triangles (m,) must be covered, chosen in the file's own frame; the conditions intersect."""
    chosen, wanted = np.ones(len(mesh.triangles), dtype=bool), design.part.target
    if wanted.direction is not None and wanted.angle_deg is not None:
        normal = area_vectors(mesh.vertices, mesh.triangles)
        direction = np.asarray(wanted.direction) / np.linalg.norm(wanted.direction)
        # atan2 of sine and cosine: acos alone is a hundred times coarser near 0 and 180 degrees
        angle = np.degrees(np.arctan2(np.linalg.norm(np.cross(normal, direction), axis=1), normal @ direction))
        low, high = wanted.angle_deg
        chosen &= (angle >= low) & (angle <= high)
    if wanted.box_mm is not None:
        centroid_mm = mesh.vertices[mesh.triangles].mean(axis=1) * 1e3
        low_corner, high_corner = np.asarray(wanted.box_mm)
        chosen &= ((centroid_mm >= low_corner) & (centroid_mm <= high_corner)).all(axis=1)
    if not chosen.any():
        low_text, high_text = _corner(mesh.vertices.min(axis=0)), _corner(mesh.vertices.max(axis=0))
        raise InputError(
            f"part.target: chooses none of the {len(chosen)} triangles; in its own file the part goes from "
            f"{low_text} to {high_text} mm: widen box_mm or angle_deg"
        )
    return chosen


def _corner(point: np.ndarray) -> str:
    return str([float(f"{1e3 * value:.6g}") for value in point])


def _refuse_misplaced(part: Part, shape: np.ndarray, design: Design) -> None:
    """A part that can be seen to be outside, or too low, before anything is cut."""
    distance, amplitude = design.chamber.sonotrode_distance, design.sonotrode.amplitude
    if distance <= amplitude:
        raise InputError(
            f"chamber.sonotrode_distance_mm: given {1e3 * distance:g}, not above the amplitude of "
            f"{1e6 * amplitude:g} µm: the sonotrode would hit the part; raise it"
        )
    low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
    wall_low, wall_high = shape.min(axis=0), shape.max(axis=0)
    if low[2] >= wall_high[2]:
        raise InputError(
            f"chamber.height_mm: given {1e3 * wall_high[2]:g}, but the part begins {1e3 * low[2]:g} mm above "
            "the sonotrode, above the ceiling; raise height_mm or lower chamber.sonotrode_distance_mm"
        )
    if (low[:2] >= wall_high[:2]).any() or (high[:2] <= wall_low[:2]).any():
        raise InputError(
            f"part.offset_mm: given {[1e3 * value for value in design.part.offset]}: the part "
            f"({box_text(high - low)}) is beside the chamber ({box_text(wall_high - wall_low)}); "
            "bring it nearer to the axis"
        )


def _body(part: Part) -> tuple[Solid, int]:
    """The part as one solid, and how many closed voids in it were filled: no shot can get there."""
    shells, volumes = shells_of(part.vertices, part.triangles)
    if len(volumes) == 1:
        return solid(part.vertices, part.triangles, part.name), 0
    # Overlapping bodies in one mesh would be subtracted wrongly, without an error: unite them first. Each
    # keeps the whole list of triangles' numbering through the index below.
    bodies = [np.flatnonzero(shells == k) for k in np.flatnonzero(volumes > 0.0)]
    solids = [solid(part.vertices, part.triangles, part.name, only=body) for body in bodies]
    return united(solids, part.name), int((volumes < 0.0).sum())


def _room_over_sonotrode(
    whole: Surface, shell: Solid, shape_tags: np.ndarray, design: Design
) -> tuple[Surface, list[str]]:
    """The room that has the sonotrode for its floor, and notes on what was cut off."""
    rooms = cavities(whole)
    floor = (whole.solid == shell.label) & (
        shape_tags[np.where(whole.solid == shell.label, whole.source, 0)] == TAG_SONOTRODE
    )
    over = [room for room in rooms if (room & floor).any()]
    if not over:
        raise InputError("the part leaves no room over the sonotrode; raise chamber.sonotrode_distance_mm")
    kept = max(over, key=lambda room: areas(whole.vertices, whole.triangles[room & floor]).sum())
    notes = []
    rest = [whole.only(room) for room in rooms if room is not kept]
    volumes = [float(tetrahedron_volumes(room.vertices, room.triangles).sum()) for room in rest]
    room = whole.only(kept)
    if rest:
        biggest = rest[int(np.argmax(volumes))]
        low, high = 1e3 * biggest.vertices[:, 2].min(), 1e3 * biggest.vertices[:, 2].max()
        what = "a closed room" if len(rest) == 1 else f"{len(rest)} closed rooms, the largest"
        notes.append(
            f"the part cuts off {what} of {1e6 * max(volumes):.3g} cm³ between z = {low:.4g} and {high:.4g} "
            "mm: no shot gets there, it is left out"
        )
    top = float(room.vertices[:, 2].max())
    if top < design.chamber.height - THINNEST:
        notes.append(f"the part closes the chamber at z = {1e3 * top:.4g} mm: more chamber.height_mm has no effect")
    return room, notes


def _hidden_target_note(part: Part, exposed: np.ndarray) -> list[str]:
    """How much of the target no ball can reach, because it lies outside the cavity. InputError when it is all."""
    if not (exposed[part.target] > 0.0).any():
        raise InputError(
            f"part.target: none of its {int(part.target.sum())} triangles bounds the cavity, so no shot "
            "reaches it; check part.rotate_deg (which side faces the sonotrode), chamber.height_mm and "
            "chamber.diameter_mm"
        )
    hidden = 1.0 - exposed[part.target].sum() / part.area[part.target].sum()
    if hidden < 1e-3:
        return []
    return [
        f"{hidden:.1%} of the target's area is outside the cavity and counts as not covered; narrow [part.target] "
        "to what is to be peened, or enlarge the chamber"
    ]


def _crooked_note(room: Surface, on_part: np.ndarray, part: Part, shape: ShapeSurface) -> list[str]:
    """Triangles that do not face as the surface they were cut from: rounding made them, not the design."""
    facing = area_vectors(room.vertices, room.triangles)
    wanted = area_vectors(shape.vertices, shape.triangles)[np.where(on_part, 0, room.source)]
    of_part = -area_vectors(part.vertices, part.triangles)
    wanted[on_part] = of_part[room.source[on_part]]
    across = np.linalg.norm(np.cross(facing, wanted), axis=1)
    crooked = np.arctan2(across, np.einsum("ij,ij->i", facing, wanted)) > CROOKED
    if not crooked.any():
        return []
    area_mm2 = 1e6 * np.linalg.norm(facing[crooked], axis=1).sum()
    return [
        f"{crooked.sum()} triangles ({area_mm2:.2g} mm² together) are so thin that rounding turned "
        "them: the part nearly touches a wall there; a slightly different diameter or offset avoids it"
    ]


def _hold_note(room: Surface, on_part: np.ndarray, name: str) -> list[str]:
    """A piece of the part that reaches no wall is taken as held by something that takes no room."""
    shells, volumes = shells_of(room.vertices, room.triangles)
    floating = [k for k in range(len(volumes)) if on_part[shells == k].all()]
    if not floating:
        return []
    what = "the part reaches" if len(floating) == 1 else f"{len(floating)} pieces of the part reach"
    return [f"{name}: {what} no wall: simulated as held in the air, without a holder"]

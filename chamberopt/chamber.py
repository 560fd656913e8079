"""Design -> Chamber: the closed cavity that the shot flies in, each triangle knowing what it belongs to.

The cavity is the shape without the part. One subtraction covers a part that hangs freely, one whose shaft
goes out through the ceiling, and one that closes the chamber like a lid; of what is left, the room over the
sonotrode counts.

Frame: metres, z up, mean sonotrode face at z = 0, chamber axis x = y = 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.errors import InputError
from chamberopt.mesh_io import box_text
from chamberopt.part import Part, posed_part, turning_axis
from chamberopt.reach import part_share, reach
from chamberopt.shapes import TAG_PART, TAG_SONOTRODE, TAG_WALL, ShapeSurface
from chamberopt.slivers import THINNEST, without_slivers
from chamberopt.solids import Solid, Surface, cavities, solid, subtract, united
from chamberopt.triangles import area_vectors, areas, shells_of, tetrahedron_volumes

if TYPE_CHECKING:
    from chamberopt.config import Design

KEPT = "target.reachable: the target is what the shot reaches in the study's start"
CROOKED = 1e-3  # rad: turns a ball's path by less than the facets of a round wall do, by a hundred times

__all__ = ["TAG_PART", "TAG_SONOTRODE", "TAG_WALL", "Chamber", "Part", "build_chamber", "turning_axis"]


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

    @property
    def height(self) -> float:
        """From the sonotrode to the highest point of the cavity [m]."""
        return float(self.vertices[:, 2].max())


def build_chamber(design: Design, target: np.ndarray | None = None) -> Chamber:
    """The chamber of a design.

    ``target`` (m,) bool takes the place of the target that the design chooses: a study keeps that of its start.
    Raises InputError when the part's mesh cannot be used, when the part is outside the cavity or touches the
    sonotrode, when nothing of the target faces the shot, or when the part leaves no room over the sonotrode.
    """
    part, notes = posed_part(design)
    part = part if target is None else replace(part, target=target)
    notes += design.chamber.notes(design.shot.diameter)
    shape = design.chamber.surface(part.vertices, part.triangles)
    _refuse_misplaced(part, shape.vertices, design)

    body, voids = _body(part)
    notes += [f"{part.name}: {voids} closed voids inside the part are left out"] if voids else []
    shell = solid(shape.vertices, shape.triangles, "the chamber")
    whole = subtract(shell, body).surface()
    if not (whole.solid != shell.label).any():
        raise InputError(
            f"{part.name}: no part of it is inside the chamber; change part.offset_mm or the sizes in [chamber]"
        )
    room, room_notes = _room_over_sonotrode(whole, shell, shape, design.chamber.ceiling_key)
    room = without_slivers(room)[0]
    on_part = room.solid != shell.label
    tags = np.where(on_part, TAG_PART, shape.tags[np.where(on_part, 0, room.source)]).astype(np.uint8)
    source = np.where(on_part, room.source, -1).astype(np.int32)
    exposed = np.bincount(source[on_part], areas(room.vertices, room.triangles)[on_part], len(part.triangles))
    if design.part.target.reachable:
        part, told = _only_reachable(part, room, tags, source, design) if target is None else (part, KEPT)
        notes.append(told)
    notes += _hidden_target_note(part, exposed)
    notes += room_notes + _crooked_note(room, on_part, part, shape) + _hold_note(room, on_part, part.name)
    volume = float(tetrahedron_volumes(room.vertices, room.triangles).sum())
    return Chamber(room.vertices, room.triangles, tags, source, volume, part, exposed, tuple(notes))


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
    ceiling = design.chamber.ceiling_key
    if low[2] >= wall_high[2]:
        raise InputError(
            f"chamber.{ceiling}: given {1e3 * wall_high[2]:g}, but the part begins {1e3 * low[2]:g} mm above "
            f"the sonotrode, above the ceiling; raise {ceiling} or lower chamber.sonotrode_distance_mm"
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


def _room_over_sonotrode(whole: Surface, shell: Solid, shape: ShapeSurface, ceiling: str) -> tuple[Surface, list[str]]:
    """The room that has the sonotrode for its floor, and notes on what was cut off."""
    rooms = cavities(whole)
    floor = (whole.solid == shell.label) & (
        shape.tags[np.where(whole.solid == shell.label, whole.source, 0)] == TAG_SONOTRODE
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
    if top < shape.vertices[:, 2].max() - THINNEST:
        notes.append(f"the part closes the chamber at z = {1e3 * top:.4g} mm: more chamber.{ceiling} has no effect")
    return room, notes


def _only_reachable(
    part: Part, room: Surface, tags: np.ndarray, source: np.ndarray, design: Design
) -> tuple[Part, str]:
    """The part with what the shot can touch of its target, and a note on the rest. InputError when that is all."""
    from sim_core import TriangleMesh

    ball = min(design.shot.diameters)
    mesh = TriangleMesh(room.vertices, room.triangles, tags)
    target = part.target & (part_share(reach(mesh, ball), source, len(part.triangles)) > 0.5)
    if not target.any():
        raise InputError(
            f"part.target.reachable: a ball of {1e3 * ball:g} mm touches nothing of the target; use smaller balls, "
            "check part.rotate_deg, or leave it out: check says what is in the way"
        )
    whole, left = part.area[part.target].sum(), part.area[part.target & ~target].sum()
    return replace(part, target=target), (
        f"target.reachable: {left / whole:.1%} of the target ({1e6 * left:.3g} mm²) is left out, where a ball of "
        f"{1e3 * ball:g} mm from over the sonotrode touches less than half of a triangle; a study keeps this "
        "target for all its candidates"
    )


def _hidden_target_note(part: Part, exposed: np.ndarray) -> list[str]:
    """How much of the target no ball can reach, because it lies outside the cavity. InputError when it is all."""
    if not (exposed[part.target] > 0.0).any():
        raise InputError(
            f"part.target: none of its {int(part.target.sum())} triangles bounds the cavity, so no shot "
            "reaches it; check part.rotate_deg (which side faces the sonotrode) and the sizes in [chamber]"
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

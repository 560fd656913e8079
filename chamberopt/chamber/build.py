"""Design -> Chamber: the closed cavity that the shot flies in, each triangle knowing what it belongs to.

The cavity is the shape, with what is bored into it and stands in it, without the part. One subtraction covers a part
that hangs freely, one whose shaft goes out through the ceiling, and one that closes the chamber like a lid; of what is
left, the room over the sonotrode counts. A part that is drawn with its chamber may be a piece of its surface already.

Frame: metres, z up, mean sonotrode face at z = 0, chamber axis x = y = 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.bores_and_deflectors import (
    Cavity,
    Piece,
    fitted,
    notes_on_files,
    piece,
    swept_faces,
)
from chamberopt.chamber.part import Part, posed_part, turning_axis
from chamberopt.chamber.reach.reach import part_share, reach
from chamberopt.common.errors import InputError
from chamberopt.design.shapes import (
    TAG_PART,
    TAG_SONOTRODE,
    TAG_WALL,
    further_sonotrode_tag,
    is_sonotrode,
)
from chamberopt.geometry.mesh_io import format_box, format_point
from chamberopt.geometry.slivers import MIN_HEIGHT, remove_slivers
from chamberopt.geometry.solids import (
    Solid,
    SolidSurface,
    find_cavities,
    overlap_volume,
    split_bodies,
    subtract,
    unite,
)
from chamberopt.geometry.triangles import (
    area_vectors,
    areas,
    find_shells,
    find_unwalled_border,
    tetrahedron_volumes,
)

if TYPE_CHECKING:
    from chamberopt.design.load import Design

KEPT = "target.reachable: the target is what the shot reaches in the study's start"
CROOKED = (
    1e-3  # rad: turns a ball's path by less than the facets of a round wall do, by a hundred times
)

__all__ = [
    "TAG_PART",
    "TAG_SONOTRODE",
    "TAG_WALL",
    "Chamber",
    "Part",
    "build_chamber",
    "turning_axis",
]


@dataclass(frozen=True)
class Chamber:
    """The cavity of one design.

    vertices (n, 3) float64 m · triangles (k, 3) int32, closed, normals pointing out of the cavity · tags
    (k,) uint8 · source (k,) int32: the part triangle that a TAG_PART triangle lies on, else -1 · volume m³
    · part · exposed_area (m,) m² of each part triangle that bounds the cavity · notes: what was done on the
    user's behalf · fitting (k,) int32: the hole or deflector that a TAG_WALL triangle is of, by its place in
    `fittings.fitting_names`, else -1; None where that is not known.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    tags: np.ndarray
    source: np.ndarray
    volume: float
    part: Part
    exposed_area: np.ndarray
    notes: tuple[str, ...]
    fitting: np.ndarray | None = None

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

    cavity = fitted(design, shape)
    notes += notes_on_files(design)
    own = piece(
        -1, TAG_PART, -area_vectors(part.vertices, part.triangles), np.arange(len(part.triangles))
    )
    whole = cavity.body.surface()
    if (
        shape.source is None
    ):  # else the part is drawn as what it bounds: there is nothing to cut out
        solids, voids = split_bodies(part.vertices, part.triangles, part.name)
        body = unite(solids, part.name)
        notes += (
            [f"{part.name}: {voids} closed voids inside the part are left out"] if voids else []
        )
        _refuse_in_swing(design, cavity, body)
        whole = subtract(cavity.body, body).surface()
    if not (cavity.traced(whole, own).tags == TAG_PART).any():
        drawn = design.chamber.setup() is not None
        remedy = (
            "check the groups in [chamber]"
            if drawn
            else "change part.offset_mm or the sizes in [chamber]"
        )
        raise InputError(f"{part.name}: no part of it is inside the chamber; {remedy}")
    ceiling = float(shape.vertices[:, 2].max()) if design.chamber.setup() is None else None
    room, room_notes = _room_over_sonotrode(
        whole, cavity.traced(whole, own).tags, ceiling, design.chamber.ceiling_key
    )
    room = remove_slivers(room)[0]
    traced = cavity.traced(room, own)
    on_part = traced.tags == TAG_PART
    _refuse_rims(design, room, traced.tags)
    area = areas(room.vertices, room.triangles)
    exposed = np.bincount(traced.source[on_part], area[on_part], len(part.triangles))
    if design.part.target.reachable:
        found = (part, KEPT) if target is not None else _only_reachable(part, room, traced, design)
        part, notes = found[0], [*notes, found[1]]
    notes += _hidden_target_note(part, exposed)
    notes += room_notes + _crooked_note(room, traced.facing) + _hold_note(room, on_part, part.name)
    volume = float(tetrahedron_volumes(room.vertices, room.triangles).sum())
    return Chamber(
        room.vertices,
        room.triangles,
        traced.tags,
        traced.source,
        volume,
        part,
        exposed,
        tuple(notes),
        traced.fitting,
    )


def _refuse_misplaced(part: Part, shape: np.ndarray, design: Design) -> None:
    """A part that can be seen to be outside, or too low, before anything is cut."""
    distance, amplitude = design.chamber.sonotrode_distance, design.sonotrode.amplitude
    if distance <= amplitude:
        drawn = design.chamber.sonotrode_distance_mm is None
        raise InputError(
            f"chamber.sonotrode_distance_mm: {'drawn as' if drawn else 'given'} {1e3 * distance:g}, not above the "
            f"amplitude of {1e6 * amplitude:g} µm: the sonotrode would hit the part; "
            + ("give one, or check the groups in [chamber]" if drawn else "raise it")
        )
    if design.chamber.setup() is not None:  # the part is where the file has it
        if design.shot.diameter >= distance - amplitude:
            raise InputError(
                f"shot.diameter_mm: given {1e3 * design.shot.diameter:g}, but the part is drawn {1e3 * distance:.4g} mm"
                " above the sonotrode: no ball fits under it; use smaller balls or give chamber.sonotrode_distance_mm"
            )
        return
    low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
    wall_low, wall_high = shape.min(axis=0), shape.max(axis=0)
    ceiling = design.chamber.ceiling_key
    if low[2] >= wall_high[2]:
        raise InputError(
            f"chamber.{ceiling}: with a ceiling at {1e3 * wall_high[2]:g} mm, but the part begins {1e3 * low[2]:g} mm "
            "above the sonotrode, above the ceiling; raise the ceiling or lower chamber.sonotrode_distance_mm"
        )
    if (low[:2] >= wall_high[:2]).any() or (high[:2] <= wall_low[:2]).any():
        raise InputError(
            f"part.offset_mm: given {[1e3 * value for value in design.part.offset]}: the part "
            f"({format_box(high - low)}) is beside the chamber ({format_box(wall_high - wall_low)}); "
            "bring it nearer to the axis"
        )


def _refuse_in_swing(design: Design, cavity: Cavity, body: Solid) -> None:
    """A part in the way of a further sonotrode; of the first the distance has been asked."""
    for name, swing in swept_faces(design, cavity)[1:] if design.sonotrodes else ():
        if overlap_volume(swing, body) > 0.0:
            raise InputError(
                f"{name}.at_mm: its face would hit the part; move it back along its axis, or the part"
            )


def _refuse_rims(design: Design, room: SolidSurface, tags: np.ndarray) -> None:
    """A sonotrode without a room, or one that walls do not rise from all round: a moving edge."""
    for k in range(len(design.sonotrodes)):
        if not (tags == further_sonotrode_tag(k)).any():
            raise InputError(
                f"sonotrodes.{k}.at_mm: the part cuts its face off from the room; move one of them"
            )
    rim = find_unwalled_border(room.vertices, room.triangles, is_sonotrode(tags))
    if rim is not None:
        raise InputError(
            f"sonotrode: its face has a free rim at {format_point(rim)}: walls must rise from it all round, as a moving "
            "edge is not supported; let it fill the floor of the room, or of a well, from wall to wall"
        )


def _room_over_sonotrode(
    whole: SolidSurface, tags: np.ndarray, ceiling: float | None, key: str
) -> tuple[SolidSurface, list[str]]:
    """The room that has the sonotrode for its floor, and notes on what was cut off; ``ceiling`` [m]: if its ``key`` of
    the chamber's table can move it.
    """
    rooms = find_cavities(whole)
    floor = tags == TAG_SONOTRODE
    over = [room for room in rooms if (room & floor).any()]
    if not over:
        raise InputError(
            "the part leaves no room over the sonotrode; raise chamber.sonotrode_distance_mm"
        )
    kept = max(over, key=lambda room: areas(whole.vertices, whole.triangles[room & floor]).sum())
    notes = []
    rest = [whole.select(room) for room in rooms if room is not kept]
    volumes = [float(tetrahedron_volumes(room.vertices, room.triangles).sum()) for room in rest]
    room = whole.select(kept)
    if rest:
        biggest = rest[int(np.argmax(volumes))]
        low, high = 1e3 * biggest.vertices[:, 2].min(), 1e3 * biggest.vertices[:, 2].max()
        what = "a closed room" if len(rest) == 1 else f"{len(rest)} closed rooms, the largest"
        notes.append(
            f"the part cuts off {what} of {1e6 * max(volumes):.3g} cm³ between z = {low:.4g} and {high:.4g} "
            "mm: no shot gets there, it is left out"
        )
    top = float(room.vertices[:, 2].max())
    if ceiling is not None and top < ceiling - MIN_HEIGHT:
        notes.append(
            f"the part closes the chamber at z = {1e3 * top:.4g} mm: "
            + (
                "a higher ceiling has no effect"
                if key == "shape"
                else f"more chamber.{key} has no effect"
            )
        )
    return room, notes


def _only_reachable(
    part: Part, room: SolidSurface, traced: Piece, design: Design
) -> tuple[Part, str]:
    """The part with what the shot can touch of its target, and a note on the rest. InputError when that is all."""
    from sim_core import TriangleMesh

    ball = min(design.shot.diameters)
    mesh = TriangleMesh(room.vertices, room.triangles, traced.tags)
    target = part.target & (part_share(reach(mesh, ball), traced.source, len(part.triangles)) > 0.5)
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


def hidden_share(part: Part, exposed: np.ndarray) -> float:
    """The share of the target's area that is outside the cavity; exposed (m,) m²: what of each triangle is not."""
    return float(1.0 - exposed[part.target].sum() / part.area[part.target].sum())


def _hidden_target_note(part: Part, exposed: np.ndarray) -> list[str]:
    """How much of the target no ball can reach, because it lies outside the cavity. InputError when it is all."""
    if not (exposed[part.target] > 0.0).any():
        raise InputError(
            f"part.target: none of its {int(part.target.sum())} triangles bounds the cavity, so no shot "
            "reaches it; check part.rotate_deg (which side faces the sonotrode) and the sizes in [chamber]"
        )
    hidden = hidden_share(part, exposed)
    if hidden < 1e-3:
        return []
    return [
        f"{hidden:.1%} of the target's area is outside the cavity and counts as not covered; narrow [part.target] "
        "to what is to be peened, or enlarge the chamber"
    ]


def _crooked_note(room: SolidSurface, wanted: np.ndarray) -> list[str]:
    """Triangles that do not face as the surface they were cut from, (k, 3): rounding made them, not the design."""
    facing = area_vectors(room.vertices, room.triangles)
    across = np.linalg.norm(np.cross(facing, wanted), axis=1)
    crooked = np.arctan2(across, np.einsum("ij,ij->i", facing, wanted)) > CROOKED
    if not crooked.any():
        return []
    area_mm2 = 1e6 * np.linalg.norm(facing[crooked], axis=1).sum()
    return [
        f"{crooked.sum()} triangles ({area_mm2:.2g} mm² together) are so thin that rounding turned "
        "them: the part nearly touches a wall there; a slightly different diameter or offset avoids it"
    ]


def _hold_note(room: SolidSurface, on_part: np.ndarray, name: str) -> list[str]:
    """A piece of the part that reaches no wall is taken as held by something that takes no room."""
    shells, volumes = find_shells(room.vertices, room.triangles)
    floating = [k for k in range(len(volumes)) if on_part[shells == k].all()]
    if not floating:
        return []
    what = "the part reaches" if len(floating) == 1 else f"{len(floating)} pieces of the part reach"
    return [f"{name}: {what} no wall: simulated as held in the air, without a holder"]

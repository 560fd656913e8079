"""Build the chamber of a design: the closed cavity that the shot flies in.

The cavity is the shape with its bores and deflectors, less the part and what holds and masks it.
The same subtraction serves a part that hangs freely, a part whose shaft goes out through the
ceiling, and a part that closes the chamber like a lid. Of the rooms that are left, only the room
over the sonotrode is kept. A part that is drawn with its chamber may already be a piece of the
chamber's surface. All files are read before solids are cut.

Frame: metres, z up, mean sonotrode face at z = 0, chamber axis at x = y = 0.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from chamberopt.chamber.bores_and_deflectors import (
    TriangleProperties,
    cavity_solid,
    read_deflectors,
    swept_faces,
    triangle_properties,
)
from chamberopt.chamber.fixture import Fixture, with_fixtures
from chamberopt.chamber.part import Part, posed_part
from chamberopt.chamber.reach import find_reach, reached_part_share
from chamberopt.common.errors import InputError
from chamberopt.design.shape_surface import (
    TAG_PART,
    TAG_SONOTRODE,
    further_sonotrode_tag,
    is_sonotrode,
)
from chamberopt.geometry.heights import lowest_over
from chamberopt.geometry.meshes.surface_error import SurfaceError, format_box, format_point
from chamberopt.geometry.slivers import MIN_HEIGHT, remove_slivers
from chamberopt.geometry.solids import (
    SolidSurface,
    find_cavities,
    overlap_volume,
    split_bodies,
    unite,
)
from chamberopt.geometry.triangles import (
    area_vectors,
    areas,
    find_shells,
    find_unwalled_border,
    in_small_pieces,
    sharp_edges,
    tetrahedron_volumes,
)

if TYPE_CHECKING:
    from chamberopt.design.load import Design
    from chamberopt.design.shape_surface import ShapeSurface
    from sim_core import TriangleMesh

T = TypeVar("T", bound=Hashable)

# Rotation of a triangle by rounding [rad] that is worth a note. The facets of a round wall turn a
# ball's path a hundred times as much.
MAX_ROTATION = 1e-3
MIN_ROOM = 1e-13  # [m³], a fifth of the smallest ball: less is rounding, and worth no note
# Area over that of a ball's square: a disc of half its diameter. A smaller piece that no ball
# touches is a facet's, as on scans, and stays in the target.
SPECK = math.pi / 16.0
NOTED_HIDDEN = 1e-3  # share of a surface outside the cavity from which on it is told
TARGET = "the target"
OF_FIRST = "pictures and files show part and chamber as in the first"


@dataclass(frozen=True)
class Chamber:
    """The closed cavity of one design, its surface in triangles, and the part in it."""

    vertices: np.ndarray  # [m], shape (n, 3), float64
    triangles: np.ndarray  # (k, 3) int32; closed, normals pointing out of the cavity
    tags: np.ndarray  # (k,) uint8
    source: np.ndarray  # (k,), part triangle under a TAG_PART triangle, else -1
    volume: float  # [m³]
    part: Part  # in the chamber's frame, with m triangles
    exposed_area: np.ndarray  # (m,), area of each part triangle that bounds the cavity [m²]
    notes: tuple[str, ...]  # what was assumed, repaired or left out
    # (k,), hole, deflector, holder or mask of a TAG_WALL triangle as an index into
    # `bores_and_deflectors.fitting_names`, else -1. None where the fittings are not known.
    fitting: np.ndarray | None = None
    shape_sha256: str = ""  # of the Python file that a user's own shape was run from
    fixtures: dict[str, Fixture] = field(default_factory=dict)  # "holder" and "mask", if any
    holder_tag: int | None = None  # in `mesh`, of a holder that turns with the part
    # The chambers of all steps of a design with steps. The chamber then is that of the first step,
    # but for the area that is exposed in any of them.
    steps: tuple[Chamber, ...] = ()

    @property
    def height(self) -> float:
        """Height of the cavity's highest point over the sonotrode [m]."""
        return float(self.vertices[:, 2].max())

    @property
    def lowest_of_part(self) -> float:
        """Height of the lowest point of the part in the cavity over the sonotrode [m]."""
        return float(self.vertices[self.triangles[self.tags == TAG_PART], 2].min())

    @cached_property
    def mesh(self) -> TriangleMesh:
        """The surface in the simulator's form, whose search tree is built once."""
        from sim_core import TriangleMesh

        tags = self.tags
        if self.holder_tag is not None:
            tags = np.where(self.on_fixture("holder"), np.uint8(self.holder_tag), tags)
        return TriangleMesh(self.vertices, self.triangles, tags)

    @cached_property
    def normals(self) -> np.ndarray:
        """Unit normals into the cavity at the corners of its triangles, (k, 3, 3).

        On the part they are normals of the curved surface behind its facets.
        """
        return self.part.normals_in_cavity(self.vertices, self.triangles, self.source)

    @property
    def pieces_in_air(self) -> int:
        """Number of pieces of the part that reach no wall, and so have no holder."""
        floating = (self.tags == TAG_PART) | self.on_fixture("mask")
        return _pieces_in_air(self.vertices, self.triangles, floating)

    def on_fixture(self, name: str) -> np.ndarray:
        """Return True for each triangle of the cavity on the holder or the mask, (k,)."""
        if name not in self.fixtures or self.fitting is None:
            return np.zeros(len(self.tags), dtype=bool)
        return np.asarray(self.fitting == self.fixtures[name].number)

    @property
    def on_target(self) -> np.ndarray:
        """Return True for each triangle of the cavity on the target (the surface to peen), (k,)."""
        # A source of -1, off the part, reads the appended False.
        return np.asarray(np.append(self.part.target, False)[self.source])

    def on_zone(self, zone: str) -> Chamber:
        """Return the same chamber with the named zone of the part as its target."""
        return replace(self, part=replace(self.part, target=self.part.zones[zone]))

    def with_notes(self, more: Iterable[str]) -> Chamber:
        """Return the same chamber, and the same `mesh`, with more notes."""
        noted = copy(self)
        object.__setattr__(noted, "notes", (*self.notes, *more))
        return noted

    def surfaces(self) -> dict[str, Chamber]:
        """Return the chamber with its own target, then with each zone as its target.

        The keys are names for messages: "the target", "zone NAME".
        """
        return {TARGET: self, **{f"zone {name}": self.on_zone(name) for name in self.part.zones}}


def build_chamber(design: Design, target: np.ndarray | None = None) -> Chamber:
    """Build and return the chamber of a design.

    With steps it is the chamber of the first step, which holds those of all steps. Its exposed area
    is, on each triangle, that of the step that exposes most of it.

    Args:
        target: part triangles to cover, (m,) bool, in place of the design's own choice. A study
            keeps the target of its start.
    Raises:
        InputError: the part's mesh cannot be used, the part is outside the cavity or touches the
            sonotrode, no target triangle faces the shot, there is no room over the sonotrode, or
            the holder or the mask is out of place.
    """
    if not design.steps:
        chamber = _build_one(design, target)
    else:
        names = list(design.in_steps)
        steps = [_build_step(name, one, target) for name, one in design.in_steps.items()]
        in_any = np.any([one.part.target for one in steps], axis=0)  # some may reach less of it
        steps = [replace(one, part=replace(one.part, target=in_any)) for one in steps]
        found = found_in_steps(dict(zip(names, (one.notes for one in steps), strict=True)))
        notes = [f"step {name}: {note}" if name else note for name, note in found]
        chamber = replace(
            steps[0],
            exposed_area=np.max([one.exposed_area for one in steps], axis=0),
            notes=(*notes, f"peened in steps, {', '.join(names)}: {OF_FIRST}"),
            steps=tuple(steps),
        )
    _refuse_hidden_zones(chamber.part, chamber.exposed_area)
    return chamber.with_notes(_hidden_notes(chamber))


def found_in_steps(found: Mapping[str, Sequence[T]]) -> list[tuple[str, T]]:
    """Return what was found in steps, each with the step's name, or with "" if all steps have it.

    Args:
        found: by name of the step.
    """
    of_all = set.intersection(*(set(own) for own in found.values()))
    named = (("" if one in of_all else name, one) for name, own in found.items() for one in own)
    return list(dict.fromkeys(named))


def _build_step(name: str, design: Design, target: np.ndarray | None) -> Chamber:
    """Build the chamber of one step. Raise InputError, which names the step, if that fails."""
    try:
        return _build_one(design, target)
    except SurfaceError as error:
        raise SurfaceError(f"step {name}: {error}", error.corners, error.edges) from None
    except InputError as error:
        raise InputError(f"step {name}: {error}") from None


def _build_one(design: Design, target: np.ndarray | None) -> Chamber:
    """Build the chamber of a design without steps, with no notes on what is outside it."""
    part, notes = posed_part(design)
    deflectors = read_deflectors(design)
    part = part if target is None else replace(part, target=target)
    notes += design.chamber.notes(design.shot.diameter)
    shape = design.chamber.surface(part.vertices, part.triangles)
    _refuse_misplaced_part(part, shape, design)
    notes += _beside_sonotrode(part, design)

    cavity = filled = cavity_solid(design, shape, deflectors)
    notes += [note for one in deflectors for note in one.notes]
    if shape.source is None:  # otherwise the part is already a piece of the cavity's surface
        solids, voids = split_bodies(part.vertices, part.triangles, part.name)
        body = unite(solids, part.name)
        if voids:
            notes.append(f"{part.name}: {voids} closed voids inside the part are left out")
        # The distance to the first sonotrode is checked in `_refuse_misplaced_part`.
        for name, swept in swept_faces(design, cavity)[1:] if design.sonotrodes else ():
            if overlap_volume(swept, body) > 0.0:
                raise InputError(
                    f"{name}.at_mm: its face would hit the part; move it back along its axis, or "
                    "the part"
                )
        facing = -area_vectors(part.vertices, part.triangles)
        own = triangle_properties(facing, TAG_PART, np.arange(len(facing)))
        cavity = cavity.without(body, {solid.label: own for solid in solids})
    cavity, fixtures = with_fixtures(design, part, filled, cavity)
    is_drawn = design.chamber.setup() is not None
    whole = cavity.body.surface()
    traced = cavity.trace(whole)
    tags = traced.tags
    if not (tags == TAG_PART).any():
        text = f"{part.name}: no part of it is inside the chamber; "
        raise _misplaced(part, shape, text + _where_to_look(is_drawn))

    bodies = f"the part or its {' or '.join(fixtures)}" if fixtures else "the part"
    closing = {
        _in_words(name, design): traced.fitting == one.number for name, one in fixtures.items()
    }
    room, room_notes = _room_over_sonotrode(whole, tags, bodies, closing)
    ceiling = float(shape.vertices[:, 2].max())
    at_ceiling = shape.vertices[shape.triangles, 2] >= ceiling - MIN_HEIGHT
    is_level = at_ceiling.all(axis=1).any()  # a holder may hide the tip of a dome, at any height
    if not is_drawn and (is_level or "holder" not in fixtures):
        room_notes += _ceiling_notes(room, ceiling, design.chamber.ceiling_key, bodies)
    room = remove_slivers(room)
    traced = cavity.trace(room)
    on_part = traced.tags == TAG_PART
    _refuse_free_edges(design, room, traced.tags)
    _refuse_bare_floor(design, room, traced.tags)
    area = areas(room.vertices, room.triangles)
    exposed = np.bincount(traced.source[on_part], area[on_part], len(part.triangles))
    if design.part.target.reachable and target is None:
        part, note = _only_reachable(part, room, traced, design)
        notes.append(note)
    elif design.part.target.reachable:
        notes.append("target.reachable: the target is what the shot reaches in the study's start")
    if not (exposed[part.target] > 0.0).any():
        text = f"part.target: none of its {int(part.target.sum())} triangles bounds the cavity, so "
        turn = "" if is_drawn else "check part.rotate_deg (which side faces the sonotrode); "
        raise _misplaced(part, shape, f"{text}no shot reaches it; {turn}{_where_to_look(is_drawn)}")
    notes += [*room_notes, *_notes_on_rounding(room, traced, bodies)]
    volume = float(tetrahedron_volumes(room.vertices, room.triangles).sum())
    surface = room.vertices, room.triangles, traced.tags, traced.source
    origin = tuple(notes), traced.fitting, design.chamber.sha256
    chamber = Chamber(*surface, volume, part, exposed, *origin, fixtures, design.turning_holder_tag)
    _refuse_wide_swings(design, chamber.mesh)
    _refuse_idle_bore(design, chamber)
    return chamber.with_notes(_holding_notes(chamber))


def _misplaced(part: Part, shape: ShapeSurface, text: str) -> SurfaceError:
    """Return an error with this text and a picture of the part and the chamber's edges."""
    edges = shape.vertices[sharp_edges(shape.vertices, shape.triangles)]
    return SurfaceError(text, part.vertices[part.triangles], edges)


def _where_to_look(is_drawn: bool) -> str:
    """Return a remedy for a part in the wrong place, which names the design's keys to change.

    Args:
        is_drawn: True if the part is drawn with its chamber in one file.
    """
    if is_drawn:
        return "check the groups in [chamber]"
    return (
        "the middle of the part's box is on the chamber's axis unless part.offset_mm moves it: "
        "change that, or the sizes in [chamber]"
    )


def _refuse_misplaced_part(part: Part, shape: ShapeSurface, design: Design) -> None:
    """Raise InputError if the part is outside the chamber, or so low that the sonotrode hits it.

    The error is also raised if the part is drawn with its chamber and no ball fits under the part.
    """
    distance, amplitude = design.chamber.sonotrode_distance, design.sonotrode.largest_amplitude
    if distance <= amplitude:
        drawn = design.chamber.sonotrode_distance_mm is None
        remedy = "give one, or check the groups in [chamber]" if drawn else "raise it"
        raise InputError(
            f"chamber.sonotrode_distance_mm: {'drawn as' if drawn else 'given'} "
            f"{1e3 * distance:g}, not above the amplitude of {1e6 * amplitude:g} µm: the sonotrode "
            f"would hit the part; {remedy}"
        )
    if design.chamber.setup() is not None:  # the part is where the file has it
        if design.shot.diameter >= distance - amplitude:
            raise InputError(
                f"shot.diameter_mm: given {1e3 * design.shot.diameter:g}, but the part is drawn "
                f"{1e3 * distance:.4g} mm above the sonotrode: no ball fits under it; use smaller "
                "balls or give chamber.sonotrode_distance_mm"
            )
        return
    low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
    wall_low, wall_high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
    if low[2] >= wall_high[2]:
        raise _misplaced(
            part,
            shape,
            f"chamber.{design.chamber.ceiling_key}: with a ceiling at {1e3 * wall_high[2]:g} mm, "
            f"but the part begins {1e3 * low[2]:g} mm above the sonotrode, above the ceiling; "
            "raise the ceiling or lower chamber.sonotrode_distance_mm",
        )
    if (low[:2] >= wall_high[:2]).any() or (high[:2] <= wall_low[:2]).any():
        raise _misplaced(
            part,
            shape,
            f"part.offset_mm: given {[1e3 * value for value in design.part.offset]}: the part "
            f"({format_box(high - low)}) is beside the chamber "
            f"({format_box(wall_high - wall_low)}); bring it nearer to the axis",
        )


def _beside_sonotrode(part: Part, design: Design) -> list[str]:
    """Return a note on a part that reaches below the sonotrode's face outside of the walls.

    Raises InputError if it reaches so low over a face that is larger than the floor.
    """
    lowest, amplitude = float(part.vertices[:, 2].min()), design.sonotrode.largest_amplitude
    if lowest > amplitude:
        return []
    face, near = design.sonotrode.face, ""
    if face is not None:
        over = lowest_over(part.vertices, part.triangles, face.outline)
        if over <= amplitude:
            raise InputError(
                f"sonotrode.face: {face.in_words} is larger than the floor, and outside of the "
                f"walls the part reaches down to {1e3 * over:.3g} mm over it, so that it would be "
                "hit; take a smaller sonotrode, or turn or move the part"
            )
        if math.isfinite(over):
            near = f" beside it, and comes down to {1e3 * over:.3g} mm over its rim"
    return [
        f"{part.name}: outside of the walls it reaches {-1e3 * lowest:.3g} mm below the "
        f"sonotrode's face{near}: nothing of the machine may be there"
    ]


def _refuse_free_edges(design: Design, room: SolidSurface, tags: np.ndarray) -> None:
    """Raise InputError if a sonotrode is cut off from the room or has an edge without a wall.

    Args:
        room: surface of the cavity.
        tags: kind of surface of its triangles (part, sonotrode or wall), (k,).
    """
    for k in range(len(design.sonotrodes)):
        if not (tags == further_sonotrode_tag(k)).any():
            raise InputError(
                f"sonotrodes.{k}.at_mm: the part cuts its face off from the room; move one of them"
            )
    border = find_unwalled_border(room.vertices, room.triangles, is_sonotrode(tags))
    if border is not None:
        raise InputError(
            f"sonotrode: its face has a free edge at {format_point(border)} in the chamber's "
            "frame: walls must rise from it all round, as a moving edge is not supported; let it "
            "fill the floor of the room, or of a well, from wall to wall"
        )


def floor_sides_mm(vertices: np.ndarray, triangles: np.ndarray, tags: np.ndarray) -> np.ndarray:
    """Return the sides [mm] along x and y, (2,), of what the floor needs about the axis.

    Args:
        vertices, triangles, tags: surface of the cavity, and the kind of surface of its triangles.
    """
    floor = 1e3 * vertices[np.unique(triangles[tags == TAG_SONOTRODE]), :2]
    return np.asarray(2.0 * np.abs(floor).max(axis=0))


def _refuse_bare_floor(design: Design, room: SolidSurface, tags: np.ndarray) -> None:
    """Raise InputError if the floor is larger than the face on which the chamber stands.

    Args:
        room: surface of the cavity.
        tags: kind of surface of its triangles (part, sonotrode or wall), (k,).
    """
    face = design.sonotrode.face
    if face is None:
        return
    if face.size_mm is None:
        floor = room.vertices[np.unique(room.triangles[tags == TAG_SONOTRODE]), :2]
        needed = np.full(2, 2e3 * np.linalg.norm(floor, axis=1).max())
    else:
        needed = floor_sides_mm(room.vertices, room.triangles, tags)
    if (needed > np.array(face.sides_mm) + 2e3 * MIN_HEIGHT).any():
        size = " × ".join(f"{one:.4g}" for one in dict.fromkeys(needed))
        raise InputError(
            f"sonotrode.face: {face.in_words}, but the floor needs {size} mm about the axis; give "
            "a larger one, or more blocks, or a smaller floor"
        )


def _refuse_wide_swings(design: Design, mesh: TriangleMesh) -> None:
    """Raise InputError if a sonotrode's amplitude is too large for the walls beside its face.

    Args:
        mesh: surface of the cavity.
    """
    from sim_core import largest_amplitude

    ball = min(design.shot.diameters)
    for k, one in enumerate((design.sonotrode, *design.sonotrodes)):
        tag = further_sonotrode_tag(k - 1) if k else TAG_SONOTRODE
        limit, place, leaning = largest_amplitude(mesh, tag, 0.5 * ball)
        if one.amplitude > limit:
            most = math.floor(1e7 * limit * one.per_amplitude) / 10.0
            given = one.amplitude * one.per_amplitude
            raise InputError(
                f"{f'sonotrodes.{k - 1}' if k else 'sonotrode'}.{one.amplitude_key}: given "
                f"{1e6 * given:g}, but at {format_point(place)} in the chamber's frame the wall "
                f"{leaning}, where balls of {1e3 * ball:g} mm allow at most {most:g}: a "
                "moving edge is not supported; lower it, use larger balls, or let the "
                "wall rise more steeply"
            )


def _room_over_sonotrode(
    whole: SolidSurface, tags: np.ndarray, bodies: str, closing: Mapping[str, np.ndarray]
) -> tuple[SolidSurface, list[str]]:
    """Return the surface of the room over the sonotrode, and a note on rooms that were left out.

    Args:
        whole: surface of all closed rooms into which the part divides the chamber.
        tags: kind of surface of its triangles (part, sonotrode or wall), (k,).
        bodies: what stands in the chamber, for the note: "the part or its holder".
        closing: marks of the triangles on each holder or mask, (k,), by its name in words.
    """
    rooms = find_cavities(whole)
    floor = tags == TAG_SONOTRODE
    with_floor = [room for room in rooms if (room & floor).any()]
    if not with_floor:
        raise InputError(
            "the part leaves no room over the sonotrode; raise chamber.sonotrode_distance_mm"
        )
    kept = max(
        with_floor, key=lambda room: areas(whole.vertices, whole.triangles[room & floor]).sum()
    )
    left_out = [room for room in rooms if room is not kept]
    rest = [whole.select(room) for room in left_out]
    if not rest:
        return whole.select(kept), []
    volumes = [float(tetrahedron_volumes(room.vertices, room.triangles).sum()) for room in rest]
    if max(volumes) < MIN_ROOM:
        return whole.select(kept), []
    largest = rest[int(np.argmax(volumes))]
    low, high = 1e3 * largest.vertices[:, 2].min(), 1e3 * largest.vertices[:, 2].max()
    number, marked = len(rest), np.any(left_out, axis=0)
    size = f"{1e6 * max(volumes):.3g} cm³ between z = {low:.4g} and {high:.4g} mm"
    covers = np.any([*closing.values(), np.zeros(len(tags), dtype=bool)], axis=0)
    if (marked & covers).any() and not (marked & ~covers & (tags != TAG_PART)).any():
        by = " and ".join(name for name, rows in closing.items() if (rows & marked).any())
        hollows = "a hollow" if number == 1 else f"{number} hollows"
        which = "" if number == 1 else ", the largest"
        note = f"closed by {by}: {hollows} of the part{which} of {size}"
    else:
        closed = "a closed room" if number == 1 else f"{number} closed rooms, the largest"
        note = f"{bodies} cuts off {closed} of {size}"
    return whole.select(kept), [f"{note}: no shot gets there, it is left out"]


def _in_words(name: str, design: Design) -> str:
    """Return a holder or a mask in words, by that of it which may close a hollow of the part."""
    holder = design.holder
    if name != "holder" or holder is None or holder.kind != "arbor":
        return f"the {name}"
    return "the arbor" if holder.thickness_mm is None else "the flanges of the arbor"


def _ceiling_notes(room: SolidSurface, ceiling: float, key: str, bodies: str) -> list[str]:
    """Return a note if the part closes the chamber below its ceiling, else an empty list.

    Args:
        ceiling: height of the ceiling [m].
        key: key of [chamber] that sets this height.
        bodies: what stands in the chamber, as in `_room_over_sonotrode`.
    """
    top = float(room.vertices[:, 2].max())
    if top >= ceiling - MIN_HEIGHT:
        return []
    higher = "a higher ceiling" if key == "shape" else f"more chamber.{key}"
    return [f"{bodies} closes the chamber at z = {1e3 * top:.4g} mm: {higher} has no effect"]


def _only_reachable(
    part: Part, room: SolidSurface, traced: TriangleProperties, design: Design
) -> tuple[Part, str]:
    """Return the part with its target narrowed to the triangles that a ball can touch, and a note.

    Raises InputError if balls touch nothing of the target.

    Args:
        room: surface of the cavity.
        traced: properties of its triangles, such as the part triangle under each.
    """
    from sim_core import TriangleMesh

    ball = min(design.shot.diameters)
    mesh = TriangleMesh(room.vertices, room.triangles, traced.tags)
    normals = part.normals_in_cavity(room.vertices, room.triangles, traced.source)
    reach = find_reach(mesh, ball, normals=normals)
    share = reached_part_share(reach, traced.source, len(part.triangles))
    hidden = part.target & (share <= 0.5)
    if hidden[part.target].all():
        raise InputError(
            f"part.target.reachable: a ball of {1e3 * ball:g} mm touches nothing of the target; "
            "use smaller balls, check part.rotate_deg, or leave it out: check says what is in the "
            "way"
        )
    target = part.target & ~without_specks(part, hidden, ball)
    whole, left = part.area[part.target].sum(), part.area[part.target & ~target].sum()
    return replace(part, target=target), (
        f"target.reachable: {left / whole:.1%} of the target ({1e6 * left:.3g} mm²) is left out, "
        f"where a ball of {1e3 * ball:g} mm from over the sonotrode touches less than half of a "
        "triangle, and such triangles make a piece larger than a disc of half its diameter; a "
        "study keeps this target for all its candidates"
    )


def without_specks(part: Part, hidden: np.ndarray, ball: float) -> np.ndarray:
    """Return marks (m,) of triangles that no ball touches, without specks smaller than the ball.

    Args:
        hidden: marks of all triangles that no ball touches, (m,).
        ball: diameter of the ball [m].
    """
    least = SPECK * ball * ball
    return np.asarray(hidden & ~in_small_pieces(part.vertices, part.triangles, hidden, least))


def selection_of(surface: str) -> str:
    """Return the name of the design's table that chooses the target or a zone, for messages.

    Args:
        surface: "the target" or "zone NAME".
    """
    return "[part.target]" if surface == TARGET else f"the target of {surface}"


def hidden_share(chamber: Chamber) -> float:
    """Return the share of the target's area that is outside the cavity, where no balls fly."""
    part = chamber.part
    return float(1.0 - chamber.exposed_area[part.target].sum() / part.area[part.target].sum())


def _refuse_hidden_zones(part: Part, exposed: np.ndarray) -> None:
    """Raise InputError for a zone of the part that has no area inside the cavity.

    Args:
        exposed: area of each part triangle that is inside the cavity [m²], (m,).
    """
    for name, zone in part.zones.items():
        if not (exposed[zone] > 0.0).any():
            raise InputError(
                f"zones: {name}: none of its {int(zone.sum())} triangles bounds the cavity, so no "
                "shot reaches it; leave the zone out, or move the part or the walls"
            )


def _hidden_notes(chamber: Chamber) -> list[str]:
    """Return a note on each surface, target or zone, that is not wholly inside the cavity."""
    shares = {name: hidden_share(one) for name, one in chamber.surfaces().items()}
    return [
        f"{hidden:.1%} of the area of {name} is outside the cavity and counts as not covered; "
        f"narrow {selection_of(name)} to what is to be peened, or enlarge the chamber"
        for name, hidden in shares.items()
        if hidden >= NOTED_HIDDEN
    ]


def _pieces_in_air(vertices: np.ndarray, triangles: np.ndarray, floating: np.ndarray) -> int:
    """Return the number of pieces of the part that reach no wall of the cavity.

    Args:
        floating: marks the triangles of the part and of its mask, (k,).
    """
    shells, volumes = find_shells(vertices, triangles)
    return sum(bool(floating[shells == k].all()) for k in range(len(volumes)))


def _refuse_idle_bore(design: Design, chamber: Chamber) -> None:
    """Raise InputError if the part should be held in a bore, but does not go out of the room."""
    if design.holder is not None and design.holder.kind == "bore" and chamber.pieces_in_air:
        raise InputError(
            'holder.kind: given "bore", but the part goes out through no wall; lower the ceiling '
            f'(chamber.{design.chamber.ceiling_key}), or give "rod", "collar" or "plate"'
        )


def _holding_notes(chamber: Chamber) -> Iterator[str]:
    """Yield a note on pieces of the part that nothing holds."""
    if count := chamber.pieces_in_air:
        what = "the part reaches" if count == 1 else f"{count} pieces of the part reach"
        yield (
            f"{chamber.part.name}: {what} no wall: simulated as held in the air, without a holder; "
            "[holder] gives it one"
        )


def _notes_on_rounding(
    room: SolidSurface, traced: TriangleProperties, bodies: str
) -> Iterator[str]:
    """Yield a note on triangles turned by rounding.

    Args:
        room: surface of the cavity.
        traced: properties of its triangles, such as their directions before rounding.
        bodies: what stands in the chamber, as in `_room_over_sonotrode`.
    """
    own = area_vectors(room.vertices, room.triangles)
    across = np.linalg.norm(np.cross(own, traced.facing), axis=1)
    turned = np.arctan2(across, np.einsum("ij,ij->i", own, traced.facing)) > MAX_ROTATION
    if turned.any():
        area_mm2 = 1e6 * np.linalg.norm(own[turned], axis=1).sum()
        yield (
            f"{turned.sum()} triangles ({area_mm2:.2g} mm² together) are so thin that rounding "
            f"turned them: {bodies} nearly touches another surface there; a slightly different "
            "diameter or offset avoids it"
        )

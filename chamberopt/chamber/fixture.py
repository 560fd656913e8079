"""Cut what holds and what masks the part out of the cavity of its chamber.

A holder is a prism along the holder's axis, which points out of the room: round (rod, collar,
arbor) or rectangular (plate). It ends inside the wall. A mask is what faces of the part sweep,
either along their own normals by the thickness of a shell, or along an axis into the wall; or it is
plugs, the convex hulls of the walls of holes.

      ======= wall ======
         |  holder  |         ^ axis      z: along the axis, from the origin of the chamber's frame
         |__________|  start  |
      ___|  part    |___                  start: the lowest place of the clamped faces under it

Both are walls, and do not count as part; a holder turns with a part that turns. The part's faces
under them are not in the cavity any more.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.bores_and_deflectors import (
    DEPTH_IN_ROOM,
    SIDES,
    WALL_TOLERANCE,
    CavitySolid,
    TriangleProperties,
    first_crossings,
    fitting_names,
    swept_faces,
    triangle_properties,
)
from chamberopt.chamber.part import chosen_on_part, chosen_triangles, turning_axis
from chamberopt.common.errors import InputError
from chamberopt.common.number_text import typeset_plain
from chamberopt.design.shape_surface import TAG_PART, TAG_WALL, lofted
from chamberopt.geometry.cut import piece_beyond
from chamberopt.geometry.face_shapes import is_hole
from chamberopt.geometry.meshes.self_intersection import crossing_pairs
from chamberopt.geometry.meshes.surface_error import format_point
from chamberopt.geometry.outline import (
    centroid,
    convex_hull,
    fitted_circle,
    frame_along,
    narrowest_rectangle,
    radii,
)
from chamberopt.geometry.solids import intersect, overlap_volume, split_bodies, unite
from chamberopt.geometry.triangles import (
    area_vectors,
    areas,
    connected_pieces,
    side_pairs,
    swept,
    unit_vectors,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from chamberopt.chamber.part import Part
    from chamberopt.design.design import Design
    from chamberopt.design.fixture import Mask

SINK = 1e-6  # m: depth of a holder's end in the part, so that rounding leaves no gap between them
FARTHEST = 1e-3  # share of the part's extent: what reaches farthest, without `holder.at`
OF_FACE = 0.8  # diameter of a rod, over that of the widest circle in its face
ROUND_FACE = 1.25  # diameter of a collar, over that of the narrowest circle round its faces
ACROSS = 0.2  # largest mean cosine between the axis of an arbor and the normals of its hole's walls
ON_AXIS = 1e-5  # m: a holder this close to the axis about which the part turns is on it
# Longest way of a vertex of a shell over its thickness: the shell is cut off over sharper edges.
MITRE = 2.0
FAR = 20.0  # distances from the target that are told apart, over the margin of a mask
# Smallest spread of normals at a vertex that counts as an edge, as a share of their mean square.
CREASE = 0.01


@dataclass(frozen=True)
class Fixture:
    """A holder or a mask as it stands in the room, without what is in the part or in the wall."""

    kind: str  # as in the design; of a mask "shell", "plugs", or "filled" up to the wall
    size: tuple[float, ...]  # [m]: a diameter, two sides, or the thickness of a shell
    length: float  # along its axis, from its end at the part to the wall [m]; 0 for a shell
    # Of a holder: middle of its end at the part, in the chamber's frame [m], (3,).
    place: tuple[float, ...] | None
    number: int  # index into `fitting_names`
    covered: float  # area of the part under it [m²]
    covered_target: float  # of this area, on the target [m²]
    vertices: np.ndarray  # of its closed surface [m], (n, 3)
    triangles: np.ndarray  # (k, 3) int32, normals outward


def size_in_words(kind: str, size_mm: Sequence[float], unit: str = " mm") -> str:
    """Return the size of a fixture of a kind as text, such as "Ø 12 mm"; empty if it has none."""
    if not size_mm:
        return ""
    text = " × ".join(map(typeset_plain, size_mm)) + unit
    if kind == "shell":
        return f"{text} thick"
    return f"Ø {text}" if len(size_mm) == 1 else text


class _Made(NamedTuple):
    """The surfaces of a holder or mask, which may overlap, and what `Fixture` says of it."""

    surfaces: list[tuple[np.ndarray, np.ndarray]]  # closed: vertices [m] and triangles of each
    clamped: np.ndarray  # (m,), the part's triangles to touch
    kind: str
    size: tuple[float, ...]
    length: float  # as in `Fixture`
    place: tuple[float, ...] | None = None  # likewise


def with_fixtures(
    design: Design, part: Part, filled: CavitySolid, cavity: CavitySolid
) -> tuple[CavitySolid, dict[str, Fixture]]:
    """Return the cavity without the design's holder and mask, and these by their names.

    Args:
        filled: the cavity before the part was cut out of it.
        cavity: the cavity without the part.
    Raises:
        InputError: one of them is out of place, or the holder covers some of the target.
    """
    made = {}
    if design.holder is not None and design.holder.kind != "bore":
        made["holder"] = _holder(design, part, filled)
    if design.mask is not None:
        made["mask"] = _mask(design, part, filled)
    sweeps = swept_faces(design, cavity) if made else []
    sides = np.diff(part.vertices[part.triangles][:, [0, 1, 2, 0]], axis=1)
    least = 2.0 * SINK * np.linalg.norm(sides, axis=2).max(axis=1)  # what the sunk end may cover
    fixtures = {}
    for name, one in made.items():
        number = fitting_names(design).index(name)
        pieces: dict[int, TriangleProperties] = {}
        solids = []
        for surface in one.surfaces:
            properties = triangle_properties(-area_vectors(*surface), TAG_WALL, fitting=number)
            own = split_bodies(*surface, name)[0]
            pieces |= {solid.label: properties for solid in own}
            solids += own
        body = unite(solids, name)
        for sonotrode, sweep in sweeps:
            if overlap_volume(sweep, body) > 0.0:
                raise InputError(
                    f"{name}: the face of [{sonotrode}] would hit it; give other faces, or another "
                    f"{name}.axis"
                )
        before, cavity, room = cavity, cavity.without(body, pieces), cavity.body
        left = _exposed(cavity, part)
        covered = _exposed(before, part) - left
        covered[covered < least] = 0.0
        _require_touch(name, covered, left, one.clamped, part)
        inside = intersect(room, body, name).surface()
        fixtures[name] = Fixture(
            kind=one.kind,
            size=one.size,
            length=one.length,
            place=one.place,
            number=number,
            covered=float(covered.sum()),
            covered_target=float(covered[part.target].sum()),
            vertices=inside.vertices,
            triangles=inside.triangles,
        )
    return cavity, fixtures


def _exposed(cavity: CavitySolid, part: Part) -> np.ndarray:
    """Return the area of each triangle of the part that bounds the cavity [m²], (m,)."""
    surface = cavity.body.surface()
    traced = cavity.trace(surface)
    own, area = traced.tags == TAG_PART, areas(surface.vertices, surface.triangles)
    return np.bincount(traced.source[own], area[own], len(part.triangles))


def _require_touch(
    name: str, covered: np.ndarray, left: np.ndarray, clamped: np.ndarray, part: Part
) -> None:
    """Raise InputError if a holder or mask touches none of its faces, or covers the target.

    A holder must cover nothing of the target, and a mask must not cover all of it.

    Args:
        covered: area of each triangle of the part under it [m²], (m,).
        left: area of each triangle of the part that is still in the room [m²], (m,).
        clamped: marks the triangles of the faces that it is to touch, (m,).
    """
    if not covered[clamped].any():
        raise InputError(
            f"{name}.at: it touches none of these faces inside the room; give faces that are in "
            f"the room, and look along {name}.axis"
        )
    on_target = np.where(part.target, covered, 0.0)
    if name == "mask" and on_target.any() and not left[part.target].any():
        raise InputError(
            "mask.at: the mask covers all of the target in the room; leave the faces to be peened "
            "out of it"
        )
    if name == "holder" and on_target.any():
        first = int(on_target.argmax())
        place = format_point(part.vertices[part.triangles[first]].mean(axis=0))
        raise InputError(
            f"holder.at: the holder covers {1e6 * on_target.sum():.3g} mm² of the target, most on "
            f"triangle {part.elements[first]} near {place} in the chamber's frame; clamp "
            "other faces, make the holder smaller, or leave these faces out of [part.target]"
        )


def _holder(design: Design, part: Part, filled: CavitySolid) -> _Made:
    holder = design.holder
    assert holder is not None
    axis = np.array(holder.direction)
    frame = frame_along(axis)
    clamped = _clamped(design, part, axis)
    faces = part.vertices[part.triangles[clamped]] @ frame.T
    hull = convex_hull(faces.reshape(-1, 3)[:, :2])
    if hull is None:
        raise InputError(
            "holder.at: seen along holder.axis these faces have no area; give faces that look "
            "along it, or that go round it"
        )
    if holder.kind == "arbor":
        return _arbor(design, part, filled, frame, hull, clamped)
    if holder.kind == "plate":
        middle, sides, turn = narrowest_rectangle(hull)
        usual = sides if holder.grip_mm is None else ROUND_FACE * sides
        size = tuple(usual if holder.size_mm is None else 1e-3 * np.array(holder.size_mm))
        corners = 0.5 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * size
        outline = middle + corners @ turn
    else:
        middle = centroid(hull)
        inner, outer = radii(hull, middle)
        radius = ROUND_FACE * outer if holder.kind == "collar" else OF_FACE * inner
        given = holder.diameter_mm
        size = (2.0 * radius if given is None else 1e-3 * given,)
        outline = _circle(middle, size[0])
    _refuse_off_axis(design, part, axis, frame.T[:, :2] @ middle)
    heights = _heights_under(outline, faces)
    collar = holder.kind == "collar"
    low = float(faces[..., 2].min() if collar or not heights.size else heights.min())
    wall, end = (low + way for way in _way_out(filled, frame, middle, outline, low))
    top = min(float(faces[..., 2].max() if collar or not heights.size else heights.max()), wall)
    start = low if holder.grip_mm is None else top - 1e-3 * holder.grip_mm
    if collar and start > top - SINK:
        raise InputError(
            "holder.grip_mm: missing: the clamped faces are level, so that the collar encloses "
            "nothing; give the length of the part that it encloses"
        )
    if holder.thickness_mm is not None and top + 1e-3 * holder.thickness_mm > wall:
        raise InputError(
            f"holder.thickness_mm: given {holder.thickness_mm:g}, but the wall is "
            f"{1e3 * (wall - top):.4g} mm from the clamped faces: give less, or leave it out, so "
            "that the plate goes up to the wall"
        )
    solids = []
    plate_top = end if holder.thickness_mm is None else top + 1e-3 * holder.thickness_mm
    if plate_top < wall:
        rod_mm = holder.diameter_mm
        rod = OF_FACE * min(size) if rod_mm is None else 1e-3 * rod_mm
        solids.append(_prism(frame, _circle(middle, rod), plate_top - SINK, end))
    solids.append(_prism(frame, outline, start - SINK, min(plate_top, end)))
    place = tuple(map(float, np.array([*middle, start]) @ frame))
    return _Made(solids, clamped, holder.kind, tuple(map(float, size)), wall - start, place)


def _arbor(
    design: Design,
    part: Part,
    filled: CavitySolid,
    frame: np.ndarray,
    hull: np.ndarray,
    clamped: np.ndarray,
) -> _Made:
    """Return a shaft that fills a hole of the part and goes on to the wall, perhaps with flanges.

    Raises InputError if the clamped faces are no walls of a hole along the holder's axis.

    Args:
        frame: two axes across the holder's, and this, (3, 3).
        hull: corners of the hole's section [m], (n, 2).
        clamped: marks the triangles of the hole's walls, (m,).
    """
    holder = design.holder
    assert holder is not None
    walls = part.triangles[clamped]
    vectors = area_vectors(part.vertices, walls)
    along = np.abs(vectors @ frame[2]).sum() / np.linalg.norm(vectors, axis=1).sum()
    if along > ACROSS or not is_hole(part.vertices, walls):
        raise InputError(
            "holder.at: these faces are no walls of a hole along holder.axis = "
            f"{list(holder.axis)}; give the walls of one hole, and its axis in the chamber's frame"
        )
    middle = fitted_circle(hull)[0]
    within, radius = radii(hull, middle)
    radius += SINK
    outline = _circle(middle, 2.0 * radius / np.cos(np.pi / SIDES))
    _refuse_off_axis(design, part, frame[2], frame.T[:, :2] @ middle)
    places = part.vertices[walls] @ frame[2]
    low, high = float(places.min()), float(places.max())
    wall, end = (high + way for way in _way_out(filled, frame, middle, outline, high))
    start = bottom = low
    if holder.both_sides:
        other = frame * [[1.0], [1.0], [-1.0]]
        start, bottom = (low - way for way in _way_out(filled, other, middle, outline, -low))
    if holder.thickness_mm is None:
        # The target may begin at the rims of the hole: none of it is covered. The shaft is within
        # the hole's sides, and what fills its corners ends below the rims.
        shaft = _circle(middle, 2.0 * within)
        fill = _prism(frame, outline, low + SINK, high - SINK)
        solids = [fill, _prism(frame, shaft, bottom, end)]
    else:
        solids = [_prism(frame, outline, bottom, end)]
    if holder.diameter_mm is not None and holder.thickness_mm is not None:
        flange, thick = _circle(middle, 1e-3 * holder.diameter_mm), 1e-3 * holder.thickness_mm
        sink = SINK + 1e-3 * (holder.grip_mm or 0.0)
        solids.append(_prism(frame, flange, high - sink, min(high + thick, end)))
        if holder.both_sides:
            solids.append(_prism(frame, flange, max(low - thick, bottom), low + sink))
    place = tuple(map(float, np.array([*middle, start]) @ frame))
    return _Made(solids, clamped, holder.kind, (2.0 * radius,), wall - start, place)


def _clamped(design: Design, part: Part, axis: np.ndarray) -> np.ndarray:
    """Mark the triangles (m,) of the part that the holder clamps.

    Raises InputError if a rod or plate would stand on faces that look the other way.
    """
    holder = design.holder
    assert holder is not None
    if holder.at is not None:
        chosen = chosen_on_part(design, holder.at, "holder.at")
    else:
        height = (part.vertices @ axis)[part.triangles]
        near = height > height.max() - FARTHEST * np.ptp(height)
        chosen = near.all(axis=1) if near.all(axis=1).any() else near.any(axis=1)
    facing = area_vectors(part.vertices, part.triangles[chosen]).sum(axis=0) @ axis
    if holder.kind in ("rod", "plate") and facing <= 0.0:
        raise InputError(
            f"holder.at: these faces do not look along holder.axis = {list(holder.axis)}, the way "
            "out of the room in the chamber's frame; give other faces, or another axis"
        )
    return chosen


def _refuse_off_axis(design: Design, part: Part, axis: np.ndarray, middle: np.ndarray) -> None:
    """Raise InputError if the part turns about another axis than that of its holder.

    Args:
        axis: unit vector along the holder, (3,).
        middle: a point on the holder's axis [m], (3,).
    """
    line = turning_axis(design, part)
    if line is None:
        return
    point, direction = line[0], line[1] / np.linalg.norm(line[1])
    aside = np.linalg.norm(np.cross(middle - point, direction))
    lean = float(np.linalg.norm(np.cross(axis, direction)))
    length = float(np.linalg.norm(np.ptp(part.vertices, axis=0)))
    if lean * length > ON_AXIS or aside > ON_AXIS:
        off = f"leans by {np.degrees(np.arcsin(min(lean, 1.0))):.3g}° from"
        if lean * length <= ON_AXIS:
            off = f"is {1e3 * aside:.3g} mm beside"
        raise InputError(
            f"holder: its axis {off} that of effects.part_turn: a holder turns with the part only "
            "about its own axis; clamp faces round that axis"
        )


def _way_out(
    filled: CavitySolid, frame: np.ndarray, middle: np.ndarray, outline: np.ndarray, low: float
) -> tuple[float, float]:
    """Return how far the wall is along the axis, and from where all of the holder is in the wall.

    Both are lengths from the start [m]. Raises InputError if the axis does not lead out.

    Args:
        middle: place of the axis across it [m], (2,).
        outline: corners of the holder's section [m], (n, 2).
        low: start of the axis [m].
    """
    starts = np.c_[np.r_[middle[None], outline], np.full(len(outline) + 1, low)] @ frame
    surface = filled.body.surface()
    distance, entering = first_crossings(surface, starts, frame[2], WALL_TOLERANCE)
    leaving = np.isfinite(distance) & ~entering
    if not leaving[0]:
        place = format_point(np.round(starts[0], 9) + 0.0)
        raise InputError(
            f"holder.axis: from {place} in the chamber's frame, in the middle of the faces that it "
            "clamps, no wall is met along this way; give faces inside the room, and the way out of "
            "it in that frame"
        )
    return float(distance[0]), float(distance[leaving].max()) + DEPTH_IN_ROOM


def _prism(
    frame: np.ndarray, outline: np.ndarray, low: float, high: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices [m] and triangles of a prism between two places along an axis [m].

    Args:
        frame: axes of the prism, the last along it, (3, 3).
        outline: corners of its section [m], counter-clockwise, (n, 2).
    """
    made = lofted([np.c_[outline, np.full(len(outline), z)] @ frame for z in (low, high)])
    return made.vertices, made.triangles


def _circle(middle: np.ndarray, diameter: float) -> np.ndarray:
    angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
    return np.asarray(middle + 0.5 * diameter * np.c_[np.cos(angle), np.sin(angle)])


def _heights_under(outline: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return heights of faces (k, 3, 3) [m] at the corners of an outline and at vertices inside.

    Their least and largest are those of the faces inside the convex outline (n, 2), up to what
    curves between its corners.
    """
    corners = faces.reshape(-1, 3)
    along = np.roll(outline, -1, axis=0) - outline
    offset = corners[:, None, :2] - outline
    inside = (along[:, 0] * offset[..., 1] - along[:, 1] * offset[..., 0] >= 0.0).all(axis=1)
    a, b, c = faces.swapaxes(0, 1)
    twice = _cross(b - a, c - a)
    flat = np.abs(twice) > 0.0
    a, b, c, twice = a[flat], b[flat], c[flat], twice[flat]
    p = np.c_[outline, np.zeros(len(outline))][:, None]
    weights = np.stack([_cross(v - u, p - u) / twice for u, v in ((b, c), (c, a), (a, b))])
    row, face = np.nonzero((weights >= -1e-9).all(axis=0))
    z = np.stack([a[face, 2], b[face, 2], c[face, 2]])
    return np.concatenate([corners[inside, 2], (weights[:, row, face] * z).sum(axis=0)])


def _cross(one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Return the component along z of the cross product of vectors (..., 3)."""
    return np.asarray(one[..., 0] * two[..., 1] - one[..., 1] * two[..., 0])


def _mask(design: Design, part: Part, filled: CavitySolid) -> _Made:
    mask = design.mask
    assert mask is not None
    chosen = chosen_on_part(design, mask.at, "mask.at")
    if mask.plugs:
        return _Made(_plugs(part, chosen), chosen, "plugs", (), 0.0)
    axis = None if mask.axis is None else unit_vectors(np.array(mask.axis, dtype=float))
    covered = chosen
    if axis is not None:
        covered = chosen & (area_vectors(part.vertices, part.triangles) @ axis > 0.0)
        if not covered.any():
            raise InputError(
                f"mask.axis: given {list(mask.axis or ())}, along which none of the faces of "
                "mask.at looks; give the way from them to the wall, in the chamber's frame"
            )
    used, numbers = np.unique(part.triangles[covered], return_inverse=True)
    triangles, vertices = numbers.reshape(-1, 3), part.vertices[used]
    length, size = 0.0, (mask.thickness,) if axis is None else ()
    if axis is None:
        way = _offsets(vertices, triangles, mask.thickness)
        if mask.margin > 0.0:
            vertices, triangles, way = _away_from_target(part, vertices, triangles, way, mask)
    else:
        far = float((filled.body.surface().vertices @ axis).max())
        length = far - float((vertices @ axis).min())
        way = axis * (length + DEPTH_IN_ROOM)
    surface = swept(vertices, triangles[:, ::-1], way)
    inner, outer = (area_vectors(one, triangles) for one in (vertices, vertices + way))
    turned = (np.einsum("ij,ij->i", inner, outer) <= 0.0).any()
    if turned or crossing_pairs(*surface).shape[1]:
        remedy = "give a thinner one, or fewer faces" if axis is None else "give fewer faces"
        what = f"a shell of {1e3 * mask.thickness:g} mm" if axis is None else "the mask"
        field = "mask.thickness_mm" if axis is None else "mask.axis"
        raise InputError(
            f"{field}: {what} crosses itself, in hollows of these faces or where they lie over "
            f"each other; {remedy}"
        )
    return _Made([surface], covered, "shell" if axis is None else "filled", size, length)


def _away_from_target(
    part: Part, vertices: np.ndarray, triangles: np.ndarray, way: np.ndarray, mask: Mask
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what of a piece of the part's surface keeps the mask's margin, and its ways.

    It is sunk into the part, because its own border divides the part's triangles.

    Args:
        way: way of each vertex through the shell [m], (n, 3).
    Raises:
        InputError: all of the piece is too near to the target.
    """
    from sim_core import TriangleMesh, closest_points

    surface = TriangleMesh(part.vertices, part.triangles, part.target.astype(np.uint8))
    margin = mask.margin

    def distance(places: np.ndarray) -> np.ndarray:
        return closest_points(surface, places, FAR * margin, tag=1).distance

    vertices, triangles, way = piece_beyond(vertices, triangles, distance, margin, way)
    if not len(triangles):
        raise InputError(
            f"mask.margin_mm: all faces of mask.at are nearer than {1e3 * margin:g} mm to the "
            "target; give less, or other faces"
        )
    sunk = SINK / mask.thickness * way
    return vertices - sunk, triangles, way + sunk


def _plugs(part: Part, chosen: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the surfaces of plugs that fill holes of the part to their rims.

    Raises InputError if some of the chosen faces are no walls of a hole.
    """
    import trimesh

    plugs = []
    for piece in pieces_of(part.triangles, chosen):
        used, numbers = np.unique(part.triangles[piece], return_inverse=True)
        triangles, vertices = numbers.reshape(-1, 3), part.vertices[used]
        if not is_hole(vertices, triangles):
            first = part.elements[piece[0]]
            raise InputError(
                f"mask.plugs: the faces of mask.at near {format_point(vertices.mean(axis=0))} in "
                f"the chamber's frame (triangle {first}) are no walls of a hole; leave them out, "
                "or give mask.thickness_mm"
            )
        hull = trimesh.convex.convex_hull(vertices - _offsets(vertices, triangles, SINK))
        plugs.append((np.asarray(hull.vertices), np.asarray(hull.faces)))
    return plugs


class Plug(NamedTuple):
    """A plug that fills a hole of the part from rim to rim."""

    diameter: float  # of the narrowest circle about its axis round it [m]
    depth: float  # from rim to rim, along its axis [m]


def plugs_of(design: Design, part: Part) -> list[Plug]:
    """Return the plugs of a design's mask, the widest first.

    There are none where the mask is none of plugs, or is on surfaces that the part's file names,
    of which a result keeps no names.
    """
    mask, file = design.mask, part.file
    if mask is None or not mask.plugs or mask.at.surface != ("all",) or file is None:
        return []
    mesh = file.as_read
    plugs = []
    for piece in pieces_of(mesh.triangles, chosen_triangles(mesh, mask.at, "mask.at")):
        walls = mesh.triangles[piece]
        vectors = area_vectors(mesh.vertices, walls)
        normals = unit_vectors(vectors)
        # No wall of a hole looks along its axis.
        spread = (normals * np.linalg.norm(vectors, axis=1)[:, None]).T @ normals
        frame = frame_along(np.linalg.eigh(spread)[1][:, 0])
        places = mesh.vertices[np.unique(walls)] @ frame.T
        hull = convex_hull(places[:, :2])
        if hull is not None:
            radius = radii(hull, fitted_circle(hull)[0])[1]
            plugs.append(Plug(2.0 * float(radius), float(np.ptp(places[:, 2]))))
    return sorted(plugs, reverse=True)


def plugs_in_words(plugs: Sequence[Plug]) -> str:
    """Return number and sizes of plugs as text, such as "in 2 holes of Ø 40 × 3 mm"."""
    sizes = [
        f"Ø {typeset_plain(round(1e3 * one.diameter, 1))} × "
        f"{typeset_plain(round(1e3 * one.depth, 1))} mm"
        for one in plugs
    ]
    several = ((sizes.count(one), one) for one in dict.fromkeys(sizes))
    text = ", ".join(f"{count} hole{'s' if count > 1 else ''} of {one}" for count, one in several)
    return f"in {text} deep"


def pieces_of(triangles: np.ndarray, chosen: np.ndarray) -> list[np.ndarray]:
    """Return the rows of the triangles of each connected piece of those chosen, (m,) bool."""
    rows = np.flatnonzero(chosen)
    one, two = (side_pairs(triangles) // 3).T
    inside = chosen[one] & chosen[two]
    number = np.cumsum(chosen) - 1
    piece = connected_pieces(number[one[inside]], number[two[inside]], len(rows))[1]
    return [rows[piece == k] for k in range(piece.max() + 1)] if len(rows) else []


def _offsets(vertices: np.ndarray, triangles: np.ndarray, thickness: float) -> np.ndarray:
    """Return the way of each vertex (n, 3) [m] that moves its triangles outward by a thickness [m].

    The way d solves n d = thickness for the normals n of the triangles round a vertex by least
    squares. So edges stay sharp. Over edges of less than some 60 degrees the shell is cut off.
    """
    normal = unit_vectors(area_vectors(vertices, triangles))
    squares = np.zeros((len(vertices), 3, 3))
    sums = np.zeros((len(vertices), 3))
    for k in range(3):
        np.add.at(squares, triangles[:, k], np.einsum("ij,ik->ijk", normal, normal))
        np.add.at(sums, triangles[:, k], normal)
    size, axes = np.linalg.eigh(squares)
    inverse = np.where(size > CREASE * size[:, -1:], 1.0 / np.maximum(size, 1e-30), 0.0)
    way = thickness * np.einsum("nij,nj,nkj,nk->ni", axes, inverse, axes, sums)
    length = np.linalg.norm(way, axis=1, keepdims=True)
    return np.asarray(way * np.minimum(1.0, MITRE * thickness / np.maximum(length, 1e-30)))

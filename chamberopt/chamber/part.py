"""Read the part of a design, choose and mesh its target, and pose it in the chamber."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.thin_part import thickness_to_simulate
from chamberopt.common.errors import InputError
from chamberopt.common.number_text import plain
from chamberopt.geometry.cut import cut_at_box, with_beside
from chamberopt.geometry.faces import Border, Faces
from chamberopt.geometry.heights import lowest_over
from chamberopt.geometry.meshes.part_mesh import (
    PartMesh,
    keep_part,
    read_part_cached,
    select_triangles,
)
from chamberopt.geometry.remesh import remesh, triangle_quality
from chamberopt.geometry.smoothing.divide import Surface
from chamberopt.geometry.smoothing.fillets import face_at, faces_of
from chamberopt.geometry.smoothing.part import SmoothingFacts, smooth
from chamberopt.geometry.solids import snap_to_grid
from chamberopt.geometry.triangles import (
    area_vectors,
    areas,
    facet_normals,
    interpolate,
    rotation_matrix,
    unit_normals,
    unit_vectors,
)

if TYPE_CHECKING:
    from chamberopt.design.design import Design
    from chamberopt.design.part import FaceAt, Selection, SmoothingTable, Target
    from chamberopt.design.zones import Zone

NEAR = 0.01  # share of the part's diagonal: a place further off the surface is a mistake


def chosen_triangles(mesh: PartMesh, wanted: Selection, field: str = "part.target") -> np.ndarray:
    """Mark the triangles (m,) of a part that meet all conditions of a selection.

    Args:
        field: name of the design's key with the selection, for messages.
    Raises:
        InputError: no triangle meets all conditions.
    """
    chosen = select_triangles(mesh.groups, wanted.surface, len(mesh.triangles), f"{field}.surface")
    if wanted.faces:
        chosen &= _on_faces(mesh, wanted.faces, field)
    if wanted.direction is not None and wanted.angle_deg is not None:
        normal = area_vectors(mesh.vertices, mesh.triangles)
        direction = np.asarray(wanted.direction) / np.linalg.norm(wanted.direction)
        # atan2 of sine and cosine: acos is a hundred times coarser near 0 and 180 degrees
        angle = np.degrees(
            np.arctan2(np.linalg.norm(np.cross(normal, direction), axis=1), normal @ direction)
        )
        low, high = wanted.angle_deg
        chosen &= (angle >= low) & (angle <= high)
    if wanted.radius_mm is not None:
        centroid_mm = mesh.vertices[mesh.triangles].mean(axis=1) * 1e3
        radius, (low, high) = np.hypot(*centroid_mm.T[:2]), wanted.radius_mm
        chosen &= (radius >= low) & (radius <= high)
    if wanted.box_mm is not None:
        chosen &= _in_box(mesh, wanted.box_mm)
    if not chosen.any():
        low_text, high_text = _corner(mesh.vertices.min(axis=0)), _corner(mesh.vertices.max(axis=0))
        raise InputError(
            f"{field}: chooses none of the {len(chosen)} triangles; in its own file the part "
            f"goes from {low_text} to {high_text} mm: widen box_mm, radius_mm or angle_deg"
        )
    return chosen


def _on_faces(mesh: PartMesh, wanted: Sequence[FaceAt], field: str) -> np.ndarray:
    """Mark the triangles (m,) on any of the wanted faces.

    Raises InputError if the point that selects a face is off the part's surface, or the file has no
    faces of its own where these are wanted.
    """
    found: dict[Border, Faces] = {}
    chosen = np.zeros(len(mesh.triangles), dtype=bool)
    for k, one in enumerate(wanted):
        place = np.array(one.at_mm) * 1e-3
        try:
            faces = found.setdefault(one.border, faces_of(mesh, one.border))
            face, away = face_at(mesh, faces, one.border, place)
        except InputError as error:
            raise InputError(f"{field}.faces.{k}.{one.border}: {error}") from None
        if away > NEAR * np.linalg.norm(mesh.size):
            raise InputError(
                f"{field}.faces.{k}.at_mm: given {list(one.at_mm)}, {1e3 * away:.3g} mm beside the "
                f"part, which goes from {_corner(mesh.vertices.min(axis=0))} to "
                f"{_corner(mesh.vertices.max(axis=0))} mm in its own file; give a place on the face"
            )
        numbers = np.flatnonzero(faces.alike(face)) if one.alike else [face]
        chosen |= np.isin(faces.of_triangle, numbers)
    return chosen


def _in_box(mesh: PartMesh, box_mm: Box) -> np.ndarray:
    """Mark the triangles (m,) whose centroids are in a box."""
    centroid_mm = mesh.vertices[mesh.triangles].mean(axis=1) * 1e3
    low_corner, high_corner = np.asarray(box_mm)
    return np.asarray(((centroid_mm >= low_corner) & (centroid_mm <= high_corner)).all(axis=1))


def _corner(point: np.ndarray) -> str:
    return str([float(f"{1e3 * value:.6g}") for value in point])


Axis = tuple[np.ndarray, np.ndarray]
Box = Sequence[Sequence[float]]  # low and high corner

LEAST_MOVED = 1e-3  # share of the target's area that is worth a note
MAX_ELEMENTS = 3e5  # makes a few minutes of meshing, and slow steps after it


@dataclass(frozen=True)
class PartOfFile:
    """Data on the part's file that a result keeps: triangles, and their pose in the chamber."""

    simulated: PartMesh  # in the file's frame
    original: PartMesh | None  # the file's own triangles, if other triangles are simulated
    rotation: np.ndarray  # from the file's frame to the chamber's, (3, 3), applied before the shift
    shift: np.ndarray  # [m], (3,)

    @property
    def as_read(self) -> PartMesh:
        """The file's own triangles, in its frame."""
        return self.simulated if self.original is None else self.original


@dataclass(frozen=True)
class Part:
    """The part as it stands in the chamber, with its target and zones.

    Its triangles are the file's, in the file's order, unless curved surfaces are divided or
    target.element_mm asks for other triangles. Its surface is closed, unless its file draws it as
    a piece of the chamber's surface.
    """

    vertices: np.ndarray  # [m], (n, 3)
    triangles: np.ndarray  # (m, 3) int32
    area: np.ndarray  # [m²], (m,)
    target: np.ndarray  # (m,), true for triangles that must be covered
    name: str
    sha256: str = ""  # of the mesh file as it was read
    unit: str = ""  # of the numbers in the file
    names: tuple[str, ...] = ()  # of the file's groups
    # Number in `names` of the surface that the file names there, -1 for none, (m,) int32. None if
    # the file names no surface of its own.
    surface: np.ndarray | None = None
    file: PartOfFile | None = None  # None only for parts without a file
    zones: dict[str, np.ndarray] = field(default_factory=dict)  # triangles of each zone, (m,) bool
    # Unit normals outward of the surface behind the triangles, at their corners, (m, 3, 3) float32.
    # None if the triangles are the surface.
    normals: np.ndarray | None = None
    hollow: np.ndarray | None = None  # largest hollow curvature of that surface [1/m], (m,)
    smoothing: SmoothingFacts | None = None  # None where there is nothing to smooth
    # Thickness of each triangle [m], (m,) float32; inf where it is no thin plate. None if the part
    # counts as rigid everywhere.
    thickness: np.ndarray | None = None

    @property
    def corner_normals(self) -> np.ndarray:
        """Unit normals of the surface at the corners of the triangles, (m, 3, 3)."""
        if self.normals is not None:
            return self.normals
        return facet_normals(self.vertices[self.triangles])

    @property
    def corners_with_normals(self) -> np.ndarray:
        """Return the triangles' corners [m] and unit normals of the surface there, (m, 3, 6)."""
        return np.concatenate([self.vertices[self.triangles], self.corner_normals], axis=2)

    def surface_name(self, triangle: int) -> str:
        """Return how the file names the surface at a triangle, or "" if it does not."""
        number = -1 if self.surface is None else int(self.surface[triangle])
        return self.names[number] if number >= 0 else ""

    def normals_in_cavity(
        self, vertices: np.ndarray, triangles: np.ndarray, source: np.ndarray
    ) -> np.ndarray:
        """Return unit normals into a cavity at the corners of the cavity's triangles, (k, 3, 3).

        On the part they are normals of the curved surface behind its facets.

        Args:
            vertices: vertices of the cavity [m], shape (n, 3).
            triangles: triangles of the cavity, normals outward, shape (k, 3).
            source: part triangle under each triangle of the cavity, else -1, shape (k,).
        """
        corners = vertices[triangles]
        normals = -facet_normals(corners)
        own = np.flatnonzero(source >= 0)
        at = self.normals_at(np.repeat(source[own], 3), corners[own].reshape(-1, 3))
        normals[own] = at.reshape(-1, 3, 3)
        return normals

    def normals_at(self, triangle: np.ndarray, place: np.ndarray) -> np.ndarray:
        """Return unit normals (p, 3) out of the part at points (p, 3) [m] on its triangles (p,)."""
        corners = self.vertices[self.triangles[triangle]]
        if self.normals is None:
            return unit_normals(corners)
        return unit_vectors(interpolate(self.normals[triangle], corners, place))

    @property
    def elements(self) -> np.ndarray:
        """Number that the part's file gives to the element of each triangle, (m,) int64.

        Without a file the triangles are numbered from 1 on.
        """
        if self.file is None:
            return np.arange(1, len(self.triangles) + 1)
        return self.file.simulated.elements


def posed_part(design: Design) -> tuple[Part, list[str]]:
    """Return the part as it stands in the chamber, and notes on its file.

    The part is turned about the file's x, then y, then z. Its bounding box is centred on the
    chamber's axis and moved sideways by part.offset_mm. The part is raised or lowered until its
    lowest point within the walls is chamber.sonotrode_distance_mm above the sonotrode: what goes
    out through the walls may be lower. A part that is drawn with its chamber stays as drawn.

    Raises:
        InputError: the file cannot be used, or the target is empty.
    """
    given, table = _part_of_file(design), design.part
    zones = {
        zone.name: _chosen(given, zone.target, f"zones.{k}.target")
        for k, zone in enumerate(design.zones)
    }
    # What the shot reaches is asked later, and of the same triangles.
    surface = table.target.model_copy(update={"reachable": False})
    found = _simulated(given, surface, table.smoothing, design.zones, _is_wall(design))
    mesh, origin = found.mesh, found.origin
    turn, shift = _pose(given, mesh, design)
    vertices = snap_to_grid(mesh.vertices @ turn.T + shift)
    thickness: np.ndarray | None = None
    thin_notes: list[str] = []
    if not _is_wall(design):
        chosen = {"the target": found.target}
        chosen |= {f"zone {name}": zone[origin] for name, zone in zones.items()}
        thickness, thin_notes = thickness_to_simulate(design, mesh, chosen)
    part = Part(
        vertices=vertices,
        triangles=mesh.triangles,
        area=areas(vertices, mesh.triangles),
        target=found.target,
        name=table.mesh_path.name,
        sha256=mesh.sha256,
        unit=mesh.unit,
        names=tuple(mesh.groups),
        surface=named_surface(mesh),
        file=PartOfFile(
            simulated=replace(mesh, groups={}, notes=(), normals=None),
            original=None if mesh is given else replace(given, groups={}, notes=(), normals=None),
            rotation=turn,
            shift=shift,
        ),
        zones={name: zone[origin] for name, zone in zones.items()},
        normals=None if found.normals is None else (found.normals @ turn.T).astype(np.float32),
        hollow=None if found.hollow is None else found.hollow.astype(np.float32),
        smoothing=found.facts,
        thickness=thickness,
    )
    return part, [*mesh.notes, *_smoothing_notes(part), *thin_notes]


def named_surface(mesh: PartMesh) -> np.ndarray | None:
    """Return the number of the group that names the surface at each triangle, -1 for none, (m,).

    Of several groups with a triangle it is that of the fewest triangles, and of equal ones that
    with the shortest name. A colour counts only where no other group is, and the group of all
    triangles nowhere. Return None if no group is left.
    """
    size = {name: int(marked.sum()) for name, marked in mesh.groups.items()}
    last_first = sorted(
        (name for name, count in size.items() if 0 < count < len(mesh.triangles)),
        key=lambda name: (not name.startswith("#"), -size[name], -len(name)),
    )
    found, number = np.full(len(mesh.triangles), -1, np.int32), {n: k for k, n in enumerate(size)}
    for name in last_first:
        found[mesh.groups[name]] = number[name]
    return found if last_first else None


def _smoothing_notes(part: Part) -> list[str]:
    """Return a note on how far facets of curved surfaces were moved to the surface behind them.

    Return an empty list if nothing worth a note was moved.
    """
    facts = part.smoothing
    if facts is None or facts.moved_share < LEAST_MOVED:
        return []
    return [
        f"{part.name}: rounds of the target have facets that turn by up to "
        f"{np.degrees(facts.facet_turn):.2g} degrees; {facts.moved_share:.0%} of the target was "
        f"divided along the surface behind them, at most {1e3 * facts.largest_move:.2g} mm away "
        f"({facts.given_triangles:,} triangles became {len(part.triangles):,}); "
        'part.smoothing = "off" keeps the facets' + _sharp_edges(facts.blunt_creases)
    ]


def _sharp_edges(count: int) -> str:
    """Return the end of a note on edges that are taken for sharp, though the surface turns little.

    Args:
        count: number of such edges. The text is empty for 0.
    """
    if not count:
        return ""
    return (
        f"; {count:,} edges of the part that turn by no more than such facets do are taken for "
        "sharp, as at chamfers: if the drawing has none, give a mesh with finer facets"
    )


@dataclass(frozen=True)
class PartPreview:
    """The part with the triangles of its file, and the pose, target and zones of a design."""

    mesh: PartMesh  # with the file's own triangles (m, 3), in the file's frame
    rotation: np.ndarray  # from the file's frame to the chamber's, (3, 3), applied before the shift
    shift: np.ndarray  # [m], (3,)
    target: np.ndarray  # (m,)
    zones: dict[str, np.ndarray]  # (m,) bool each

    @property
    def vertices(self) -> np.ndarray:
        """Vertices in the chamber's frame [m], (n, 3)."""
        return np.asarray(self.mesh.vertices @ self.rotation.T + self.shift)


def preview_part(design: Design) -> PartPreview:
    """Return the part, its target and its zones on the triangles of the file, for a quick view.

    In contrast to `posed_part`, curved surfaces are not divided, and target.element_mm and
    target.beside_mm have no effect, which saves time.

    Raises:
        InputError: the file cannot be used, or target or zone are empty.
    """
    mesh, table = _part_of_file(design), design.part
    target = of_target(mesh, table.target)
    zones = {
        one.name: _chosen(mesh, one.target, f"zones.{k}.target")
        for k, one in enumerate(design.zones)
    }
    return PartPreview(mesh, *_pose(mesh, mesh, design), target, zones)


def chosen_on_part(design: Design, wanted: Selection, field: str) -> np.ndarray:
    """Mark the triangles (m,) of the part of `posed_part` that meet a further selection.

    Args:
        field: name of the design's key with the selection, for messages.
    Raises:
        InputError: no triangle meets all conditions.
    """
    given, table = _part_of_file(design), design.part
    # What the shot reaches is asked later, and of the same triangles.
    surface = table.target.model_copy(update={"reachable": False})
    found = _simulated(given, surface, table.smoothing, design.zones, _is_wall(design))
    return np.asarray(_chosen(given, wanted, field)[found.origin])


def turning_axis(design: Design, part: Part) -> Axis | None:
    """Return the axis about which the part turns: a point [m] and a direction, (3,) each.

    They are in the chamber's frame. Return None for a part that does not turn.
    """
    turn, file = design.effects.part_turn, part.file
    if turn is None or file is None:
        return None
    point = file.rotation @ np.array(turn.through) + file.shift
    return point, file.rotation @ np.array(turn.axis)


def _part_of_file(design: Design) -> PartMesh:
    """Return the part as its file has it. A file is read once for all chambers built from it."""
    part, setup = design.part, design.chamber.setup()
    if setup is not None:
        return setup.part
    return read_part_cached(part.mesh_path, part.unit, part.limits)


def keep_part_of(design: Design, mesh: PartMesh) -> None:
    """Take this mesh for the part of a design, which another process has read from its file."""
    part = design.part
    keep_part(mesh, part.mesh_path, part.unit, part.limits)


def _is_wall(design: Design) -> bool:
    """True if the part is drawn as a piece of the chamber's surface, and so cannot be divided."""
    setup = design.chamber.setup()
    return setup is not None and setup.room.source is not None


@lru_cache(maxsize=16)
def _chosen(mesh: PartMesh, wanted: Selection, field: str) -> np.ndarray:
    return chosen_triangles(mesh, wanted, field)


def of_target(mesh: PartMesh, target: Target) -> np.ndarray:
    """Mark the triangles (m,) of a part's file that the target is, or a part of it.

    Of a triangle that is cut at the target's box, what is in the box belongs to the target.
    """
    if not target.cut:
        return np.asarray(_chosen(mesh, target, "part.target"))
    surface = target.model_copy(update={"box_mm": None, "cut": False})
    corners, box = mesh.vertices[mesh.triangles], 1e-3 * np.asarray(target.box_mm)
    meets = ((corners.max(axis=1) >= box[0]) & (corners.min(axis=1) <= box[1])).all(axis=1)
    chosen = _chosen(mesh, surface, "part.target") & meets
    # If none is there, the message is that of triangles that are not cut.
    return np.asarray(chosen if chosen.any() else _chosen(mesh, target, "part.target"))


class _Simulated(NamedTuple):
    """The mesh of the part as it is simulated, in the file's frame.

    `origin` is the file's triangle from which each triangle comes, and `target` marks those of the
    target, (k,), whatever of it the shot reaches. `normals` are unit normals, at
    the corners of the triangles, of the smooth surface behind them, and `hollow` is the largest
    hollow curvature of this surface on each triangle [1/m]. `facts` says what was smoothed. The
    last three are None where nothing was smoothed.
    """

    mesh: PartMesh
    origin: np.ndarray
    target: np.ndarray
    normals: np.ndarray | None
    hollow: np.ndarray | None
    facts: SmoothingFacts | None


@lru_cache(maxsize=4)
def _simulated(
    mesh: PartMesh,
    target: Target,
    smoothing: SmoothingTable,
    zones: tuple[Zone, ...],
    is_wall: bool,
) -> _Simulated:
    """Return the part with facets of curved surfaces divided and triangles of the wanted size.

    Args:
        mesh: the part as its file has it.
        is_wall: True if the part is a piece of the chamber's surface, which is not divided.
    """
    chosen = of_target(mesh, target)
    rules = [
        (zone.smoothing or smoothing).rule(_chosen(mesh, zone.target, f"zones.{k}.target"))
        for k, zone in enumerate(zones)
    ]
    found = _Simulated(mesh, np.arange(len(mesh.triangles)), chosen, None, None, None)
    if not is_wall:
        made = smooth(mesh, smoothing.rule(chosen), rules)
        origin = made.origin
        of_surface = made.normals, made.hollow, made.facts
        found = _Simulated(made.of_part(mesh), origin, chosen[origin], *of_surface)
    if is_wall and (target.cut or target.beside_mm is not None):
        key = "cut" if target.cut else "beside_mm"
        text = "the part is drawn with its chamber, and its triangles are not divided"
        raise InputError(f"part.target.{key}: {text}; leave it out")
    if target.beside_mm is not None:
        found = _with_beside(found, 1e-3 * target.beside_mm)
        if target.box_mm is not None and not target.cut:
            found = found._replace(target=found.target & _in_box(found.mesh, target.box_mm))
    if target.cut and target.box_mm is not None:
        found = _cut(found, target.box_mm)
    size = target.element
    return found if size is None else _remeshed(found, size)


def _cut(found: _Simulated, box_mm: Box) -> _Simulated:
    """Return the part with the triangles of its target divided at a box, which narrows it."""
    box = 1e-3 * np.asarray(box_mm)
    cut = _divided(found, cut_at_box(_surface_of(found), box, found.target))
    return cut._replace(target=cut.target & _in_box(cut.mesh, box_mm))


def _with_beside(found: _Simulated, beside: float) -> _Simulated:
    """Return the part whose target takes what lies near on the faces that go on from it.

    Args:
        beside: how near [m].
    """
    made, is_near = with_beside(_surface_of(found), found.target, beside)
    cut = _divided(found, made)
    if (is_near & ~cut.target).any():
        return cut._replace(target=is_near)
    text = "no face goes on from the target, smoothly or over a hollow edge; leave it out"
    raise InputError(f"part.target.beside_mm: {text}")


def _surface_of(found: _Simulated) -> Surface:
    """Return the part as a surface whose triangles can be divided."""
    mesh, normals, count = found.mesh, found.normals, len(found.mesh.triangles)
    if normals is None:
        normals = facet_normals(mesh.vertices[mesh.triangles])
    own, of_crease = np.arange(count), np.zeros((count, 3), dtype=bool)
    return Surface(mesh.vertices, mesh.triangles, own, normals, of_crease, np.zeros(count))


def _divided(found: _Simulated, made: Surface) -> _Simulated:
    """Return the part with the triangles of a surface into which its own were divided."""
    rows = made.parent
    return found._replace(
        mesh=found.mesh.divided(made.vertices, made.triangles, rows),
        origin=found.origin[rows],
        target=found.target[rows],
        normals=None if found.normals is None else made.normals,
        hollow=None if found.hollow is None else found.hollow[rows],
    )


def _remeshed(found: _Simulated, size: float) -> _Simulated:
    """Return the part with its target in new triangles whose sides are about `size` [m].

    Raises InputError if the triangles would be too many.

    Args:
        found: the part, perhaps with smoothed rounds.
    """
    mesh, target = found.mesh, found.target
    area = float(areas(mesh.vertices, mesh.triangles)[target].sum())
    count = area / (np.sqrt(3.0) / 4.0 * size * size)
    if count > MAX_ELEMENTS:
        fits = 1e3 * size * np.sqrt(count / MAX_ELEMENTS)
        raise InputError(
            f"part.target.element_mm: given {1e3 * size:g}, which makes some "
            f"{plain(1e-6 * count, 3)} million triangles of the target's {plain(1e6 * area)} mm²; "
            f"give at least {plain(fits, 2)}"
        )
    vertices, triangles, source = remesh(
        mesh.vertices, mesh.triangles, target, target.astype(np.int64), size
    )
    chosen = target[source]
    sides = vertices[triangles[chosen]]
    longest = np.linalg.norm(sides - np.roll(sides, 1, axis=1), axis=2).max(axis=1)
    shape = triangle_quality(vertices, triangles[chosen])
    note = (
        f"target.element_mm = {1e3 * size:g}: the target's {target.sum()} triangles became "
        f"{chosen.sum()}, longest sides {1e3 * np.median(longest):.3g} mm in the middle and "
        f"{1e3 * longest.max():.3g} mm at most, shape {shape.min():.2f} at worst (1: equilateral)"
    )
    origin = _find_origin(mesh, vertices[triangles], source)
    meshed = replace(mesh.divided(vertices, triangles, origin), notes=(*mesh.notes, note))
    normals = found.normals
    if normals is not None:
        corners = np.repeat(mesh.vertices[mesh.triangles[origin]], 3, axis=0)
        of_corners = np.repeat(normals[origin], 3, axis=0)
        places = vertices[triangles].reshape(-1, 3)
        normals = unit_vectors(interpolate(of_corners, corners, places)).reshape(-1, 3, 3)
    hollow = None if found.hollow is None else found.hollow[origin]
    own = found.origin[origin], target[origin], normals, hollow
    return _Simulated(meshed, *own, found.facts)


def _find_origin(mesh: PartMesh, corners: np.ndarray, source: np.ndarray) -> np.ndarray:
    """Return the triangle of a mesh under the middle of each new triangle, (k,).

    Args:
        corners: corners of the new triangles [m], shape (k, 3, 3).
        source: a triangle of the mesh in the same flat face, shape (k,). It is the result where
            it has the same corners as the new triangle.
    """
    from sim_core import TriangleMesh, closest_points

    moved = np.flatnonzero((corners != mesh.vertices[mesh.triangles[source]]).any(axis=(1, 2)))
    tags = np.zeros(len(mesh.triangles), dtype=np.uint8)
    surface, far = TriangleMesh(mesh.vertices, mesh.triangles, tags), float(np.ptp(mesh.vertices))
    origin = source.copy()
    origin[moved] = closest_points(surface, corners[moved].mean(axis=1), far).triangle
    return origin


def _pose(given: PartMesh, mesh: PartMesh, design: Design) -> tuple[np.ndarray, np.ndarray]:
    """Return the rotation (3, 3), then shift (3,) [m], from the part file's frame to the chamber's.

    Args:
        given: the part as its file has it. The middle of its bounding box comes onto the axis.
        mesh: the part as it is simulated. Its lowest point counts, because vertices on a round may
            reach a little further than its facets.
    """
    setup, distance = design.chamber.setup(), design.chamber.sonotrode_distance
    if setup is not None:
        return setup.turn, setup.shift + np.array([0.0, 0.0, distance - setup.distance])
    turn = rotation_matrix(design.part.rotate_deg)
    of_file = given.vertices @ turn.T
    low, high = of_file.min(axis=0), of_file.max(axis=0)
    middle = (low[:2] + high[:2]) / 2.0
    aside = np.array(design.part.offset) - middle
    posed, plan = mesh.vertices @ turn.T, design.chamber.plan()
    lowest = math.inf if plan is None else lowest_over(posed, mesh.triangles, plan - aside)
    if not math.isfinite(lowest):  # a part beside the chamber is refused when it is built
        lowest = float(posed[:, 2].min())
    return turn, np.array([*design.part.offset, distance]) - np.r_[middle, lowest]

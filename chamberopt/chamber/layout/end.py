"""Find the end by which a part is held outside its chamber, and the faces that close the chamber.

A part without names and without sharp edges, such as a scan or an implant, has one face. Its target
is all of it, and no fixture could hold it: an end of it is left out. The broad sides of a leaf
spring reach both of its ends. The root of a blade is such an end already.

A flat face of the part that ends the target is a wall of the chamber: a platform, a base plate, the
webs of a crank. The wall that is built goes round that face, a little behind it.

                 |  | wall, behind the face
      target     |__|
    =============|  root, clamped outside
                 |__|
                 |  |
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from chamberopt.chamber.layout.pose import Turns, turns_down
from chamberopt.chamber.layout.sizes import Sizes, middle_in_plan
from chamberopt.chamber.layout.target import Keys, Target
from chamberopt.chamber.matters import MatterKind
from chamberopt.design.shapes.outlines import area_inside
from chamberopt.geometry.cut import cut_at_box, facets, with_beside
from chamberopt.geometry.heights import lowest_over
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.outline import convex_hull
from chamberopt.geometry.triangles import (
    area_vectors,
    areas,
    in_small_pieces,
    rotation_matrix,
    sides_of,
)

NEARLY_ALL = 0.95  # share of the part's area from which on its target is all of it
END, LONG_END = 0.15, 0.25  # length of the end over the part's, the latter if no end is straight
# Of a stubby part, a holder grips this share of its width, and ends this share of its length before
# the target.
STUBBY, BESIDE = 0.25, 0.04
ONE_PIECE = 0.95  # least share of an end's area in one connected piece, which leaves out specks
TIP, STRAIGHT = 0.25, 0.8  # of an end: near its tip, and width there over that where it begins
# Difference of that from which on it decides which end is held; relative one of areas of strips.
ALIKE = 0.05
UPRIGHT = 0.999  # cosine from which on an axis of the part's file is one of the chamber's
LEVEL = 1e-3  # cosine to the vertical below which it is level
# A face within SAME_PLANE [m] of a plane lies in it; so many places beside it are tried.
SAME_PLANE, MOST_SHIFTS = 5e-5, 40
LARGE = 0.5  # least area of the strip that is proposed over the largest one's
SLIMMER = 0.8  # area of the lower end over the upper one's, below which the part is turned over
MARGIN_MM = 1.0  # of boxes round the part
# Of an end that is clamped outside: length over its width, or [m], the shorter one, and what of it
# may stand in the chamber [m]. It is straight as far as it is wider than STRAIGHT of its width;
# jaws have the form of a root, which is wider than ROOT of it.
CLAMPED, LONG_ENOUGH, INSIDE, ROOT = 0.75, 10e-3, 6e-3, 0.5
DEEP = 7.5e-3  # m that jaws reach over a part, so that it does not tilt in them
# Of a face that closes a chamber: cosine, share of the rectangle round the target, and how far it
# may lie before the target's end [m]. The wall is that far behind it [m].
FACING, CLOSES, BEFORE, BEHIND = 0.999, 0.5, 1e-5, 0.2e-3
# What stands into the chamber by no more than INTO [m], such as the rim of such a face, may come
# nearer to the sonotrode: share of the distance that is left.
NEAREST, INTO = 0.25, 0.5e-3
CORNERS = 90  # of a circle's outline


class Strips(NamedTuple):
    """Equal strips of a target across an axis of the part's file, each peened in its own setting.

    Attributes:
        axis: number of the axis.
        low: where the first one begins [m].
        pitch: length of each [m].
        areas: area of the target in each [m²].
        chosen: number of the proposed one, from 0.
    """

    axis: int
    low: float
    pitch: float
    areas: tuple[float, ...]
    chosen: int

    @property
    def settings(self) -> int:
        """How many there are."""
        return len(self.areas)

    @property
    def are_alike(self) -> bool:
        """Whether the target's areas in them differ by little."""
        return min(self.areas) > (1.0 - ALIKE) * max(self.areas)

    def box_mm(self, mesh: PartMesh, number: int) -> list[list[float]]:
        """Return the box [mm], as designs have it, round one of them.

        The first and the last go beyond the part, so that they have what lies in its end faces.
        """
        low, high = (1e3 * (self.low + k * self.pitch) for k in (number, number + 1))
        corners = box_beyond(mesh, self.axis, True, low)
        beyond = box_beyond(mesh, self.axis, False, high)
        if number == 0:
            corners[0] = beyond[0]
        if number < self.settings - 1:
            corners[1] = beyond[1]
        return corners


class HeldEnd(NamedTuple):
    """An end of a part that is left out of its target, and a pose in which the part is held by it.

    The end points up in the pose, or goes out through the wall at +x. Of a target that is peened a
    strip at a time, all beside the strip is left out.
    """

    target: Target  # the rest
    turns: Turns
    axis: np.ndarray  # unit vector of the part's file along which the end points, (3,)
    at: dict[str, Any]  # keys that choose the end
    triangles: np.ndarray  # marks those of the end, (m,)
    goes_out: bool = False
    strips: Strips | None = None  # in which the target is peened, if this is one of them
    # Box [mm] round what the room encloses, if it is not the target alone.
    room_mm: list[list[float]] | None = None


class Shape(NamedTuple):
    """Vertices (n, 3) [m] and triangles (m, 3) of a part, and marks of its target's, (m,)."""

    vertices: np.ndarray
    triangles: np.ndarray
    target: np.ndarray


def held_end(mesh: PartMesh, target: Target, turns: Turns, of_any: bool = False) -> HeldEnd | None:
    """Return the straighter or slimmer end of a part, if all of it would be peened, else None.

    What lies beyond a cut is an end only if it is one piece. It is not across the coils of a spring
    that lies.

    Args:
        target: the target that was proposed.
        of_any: true to return it also if not all of the part would be peened.
        turns: the pose that was proposed for it [degrees]. No end is chosen where no axis of the
            part's file is upright in it.
    """
    area, up = areas(mesh.vertices, mesh.triangles), rotation_matrix(turns)[2]
    axis = int(np.abs(up).argmax())
    is_whole = area[target.triangles].sum() > NEARLY_ALL * area.sum()
    if not (is_whole or of_any) or abs(up[axis]) < UPRIGHT:
        return None
    places = mesh.vertices[:, axis] * np.sign(up[axis])
    length = float(np.ptp(places))

    def straight(way: float, share: float) -> float:
        """Width of an end near its tip over that where it begins, from 0 to 1."""
        tip = float((way * places).max())
        near, far = (
            _width(mesh.vertices, mesh.triangles, way * places, tip - part * share * length, axis)
            for part in (TIP, 1.0)
        )
        return min(near / far, 1.0) if far > 0.0 else 0.0

    def size(way: float) -> float:
        """Area of an end as it is seen along the axis [m²]."""
        inside = way * places > (way * places).max() - END * length
        hull = convex_hull(np.delete(mesh.vertices[inside], axis, axis=1))
        return 0.0 if hull is None else area_inside(hull)

    # A straight end is held better than one that narrows to its tip, and a slim one better still.
    share = END if max(straight(1.0, END), straight(-1.0, END)) > STRAIGHT else LONG_END
    across = float(np.ptp(np.delete(mesh.vertices, axis, axis=1), axis=0).min())
    least = max(STUBBY * across / length + BESIDE, (INSIDE + DEEP) / length)
    share = max(share, min(least, LONG_END))
    upper, lower = (straight(way, share) for way in (1.0, -1.0))
    slimmer = size(-1.0) < SLIMMER * size(1.0)
    if slimmer if abs(upper - lower) < ALIKE else lower > upper:
        up = -up
        turns = turns_down(-np.sign(up[axis]) * np.eye(3)[axis])
    is_top, own = bool(up[axis] > 0.0), mesh.vertices[:, axis]
    cut = 1e3 * float(own.max() - share * length if is_top else own.min() + share * length)
    middle = 1e3 * mesh.vertices[mesh.triangles].mean(axis=1)[:, axis]
    of_end = middle > cut if is_top else middle < cut
    if not _is_one_piece(mesh, of_end):
        return None
    box = box_beyond(mesh, axis, not is_top, cut)
    keys = {**target.keys, "box_mm": box, "cut": True}
    bare = float(area[of_end & target.triangles].sum() / area[target.triangles].sum())
    reason = (
        f"{target.reason}; {MatterKind.END_LEFT}, {share:.0%} of its length, {bare:.0%} of the "
        "target, to hold it by, in a "
        "soft lining where it is a finished seat: accept it, or peen it in a second setup, end for "
        "end"
    )
    left = Target(keys, target.triangles & ~of_end, reason)
    points = np.eye(3)[axis] * (1.0 if is_top else -1.0)
    return HeldEnd(left, turns, points, {"box_mm": box_beyond(mesh, axis, is_top, cut)}, of_end)


def bare_end(mesh: PartMesh, target: Target, turns: Turns) -> HeldEnd | None:
    """Return the longer end of a part that its target does not reach, if a clamp holds it outside.

    Args:
        turns: a pose in which the axis of the part's file along which the ends point is upright.
    """
    up = rotation_matrix(turns)[2]
    axis = int(np.abs(up).argmax())
    own = mesh.vertices[:, axis]
    on_target = own[np.unique(mesh.triangles[target.triangles])]
    is_top = own.max() - on_target.max() > on_target.min() - own.min()
    way = 1.0 if is_top else -1.0
    cut = float((way * on_target).max()) + INSIDE
    if abs(up[axis]) < UPRIGHT or not can_be_clamped(
        way * mesh.vertices, mesh.triangles, axis, cut, ROOT
    ):
        return None
    of_end = (way * own[mesh.triangles]).min(axis=1) > cut
    if not _is_one_piece(mesh, (way * own[mesh.triangles]).mean(axis=1) > cut):
        return None
    return HeldEnd(target, turns, way * np.eye(3)[axis], {}, of_end)


def root_out(mesh: PartMesh, target: Target, turns: Turns, clear: float) -> HeldEnd | None:
    """Return the end by which a part is held outside of a room that encloses all the rest.

    It is the wider end of a part that lies, if the target leaves enough of it free.

    Args:
        turns: the pose [degrees].
        clear: distance from the target of the wall through which it goes out [m].
    """
    axis = int(np.ptp(mesh.vertices, axis=0).argmax())
    if abs(rotation_matrix(turns)[2, axis]) > LEVEL or "box_mm" in target.keys:
        return None
    own = mesh.vertices[:, axis]
    on_target = own[np.unique(mesh.triangles[target.triangles])]

    def wide_at(way: float, place: float) -> float:
        return _width(mesh.vertices, mesh.triangles, way * own, place, axis)

    wall = {way: float((way * on_target).max()) + clear for way in (1.0, -1.0)}
    way = max(wall, key=lambda one: wide_at(one, wall[one]))
    places, cut = way * own, wall[way]
    out = float(places.max()) - cut
    is_straight = wide_at(way, cut + (1.0 - TIP) * out) > ROOT * wide_at(way, cut) > 0.0
    if out < DEEP or not is_straight:
        return None
    if not _is_one_piece(mesh, places[mesh.triangles].mean(axis=1) > cut):
        return None
    of_end = places[mesh.triangles].min(axis=1) > cut
    inside = box_beyond(mesh, axis, way < 0.0, 1e3 * way * (cut - clear))
    return HeldEnd(target, turns, way * np.eye(3)[axis], {}, of_end, True, None, inside)


def strip(mesh: PartMesh, target: Target, turns: Turns, longest: float) -> HeldEnd | None:
    """Return a strip of a target, whose part goes out through the walls at the strip's ends.

    The strips are equally long, across the axis of the part's file along which the part is longest.
    The one nearest to the middle is taken that has much of the target. It is None where one strip
    is all of the target, or the axis is not level in the pose.

    Args:
        turns: the pose [degrees].
        longest: largest length of a strip [m].
    """
    axis = int(np.ptp(mesh.vertices, axis=0).argmax())
    on_target = mesh.vertices[np.unique(mesh.triangles[target.triangles]), axis]
    extent, low = float(np.ptp(on_target)), float(on_target.min())
    count = math.ceil(extent / longest - 1e-9) if longest > 0.0 else 0
    is_level = abs(rotation_matrix(turns)[2, axis]) < LEVEL
    if count < 2 or not is_level or "box_mm" in target.keys:
        return None
    pitch = extent / count
    shift = _off_faces(mesh, target.triangles, axis, low + pitch * np.arange(1, count))
    strips = Strips(axis, low + shift, pitch, (0.0,) * count, 0)

    def area_in(number: int) -> float:
        cut = cut_shape(
            mesh, target.triangles, {**target.keys, "box_mm": strips.box_mm(mesh, number)}
        )
        return float(areas(cut.vertices, cut.triangles)[cut.target].sum())

    each = tuple(area_in(k) for k in range(count))
    like = [k for k in range(count) if each[k] > LARGE * max(each)]
    chosen = min(like, key=lambda k: abs(2 * k + 1 - count))
    strips = strips._replace(areas=each, chosen=chosen)
    low_mm, high_mm = (corner[axis] for corner in strips.box_mm(mesh, chosen))
    places = 1e3 * mesh.vertices[mesh.triangles][..., axis]
    inside = (places.max(axis=1) >= low_mm) & (places.min(axis=1) <= high_mm)
    is_even = count == 2 and strips.are_alike
    over = ", or turned end for end if its halves are alike" if is_even else ""
    reason = (
        f"{target.reason}; {MatterKind.STRIPS}, in {count} settings: it is moved along the "
        f"{'xyz'[axis]} of its file by {1e3 * pitch:.3g} mm of {1e3 * extent:.3g} mm between them"
        f"{over}, and each takes its treatment time (setting_N.toml); where the part ends, a plate "
        "closes the chamber"
    )
    keys = {**target.keys, "box_mm": strips.box_mm(mesh, chosen), "cut": True}
    of_strip = Target(keys, target.triangles & inside, reason)
    return HeldEnd(of_strip, turns, np.eye(3)[axis], {}, ~inside, True, strips)


def _off_faces(mesh: PartMesh, target: np.ndarray, axis: int, places: np.ndarray) -> float:
    """Return by how much planes across an axis are moved so that no face of a target is in one [m].

    Such a face would belong to neither of the strips beside the plane.

    Args:
        target: marks the triangles of the target, (m,).
        places: of the planes [m], (k,).
    """
    corners = mesh.vertices[mesh.triangles[target]][..., axis]
    flat = corners.mean(axis=1)[np.ptp(corners, axis=1) < SAME_PLANE]
    for shift in (0.0, *(sign * k * SAME_PLANE for k in range(2, MOST_SHIFTS) for sign in (1, -1))):
        if not (np.abs(flat[:, None] - (places + shift)) < SAME_PLANE).any():
            return shift
    return 0.0


def cut_shape(mesh: PartMesh, target: np.ndarray, keys: Keys) -> Shape:
    """Return a part with its target, which takes what lies beside it and is cut at a box.

    Args:
        mesh, target: the part, and marks of the triangles that its target's surfaces have, (m,).
        keys: those of the target, of which `beside_mm` and `box_mm` count.
    """
    made = facets(mesh.vertices, mesh.triangles)
    if beside_mm := keys.get("beside_mm"):
        made, target = with_beside(made, target, 1e-3 * beside_mm)
    if (box_mm := keys.get("box_mm")) is not None:
        box = 1e-3 * np.array(box_mm)
        rows = np.arange(len(made.triangles))
        cut = cut_at_box(replace(made, parent=rows), box, target)
        middle = cut.vertices[cut.triangles].mean(axis=1)
        inside = ((middle > box[0]) & (middle < box[1])).all(axis=1)
        made, target = cut, target[cut.parent] & inside
    return Shape(made.vertices, made.triangles, target)


def _is_one_piece(mesh: PartMesh, of_end: np.ndarray) -> bool:
    """Return whether the marked triangles (m,) of a part are connected, up to specks."""
    least = ONE_PIECE * float(areas(mesh.vertices, mesh.triangles)[of_end].sum())
    small = in_small_pieces(mesh.vertices, mesh.triangles, of_end, least)
    return bool((of_end & ~small).any())


def can_be_clamped(
    vertices: np.ndarray, triangles: np.ndarray, axis: int, cut: float, straight: float = STRAIGHT
) -> bool:
    """Return whether what of a part lies beyond a cut is long and straight enough for a clamp.

    Args:
        vertices, triangles: those of the part, (n, 3) [m] and (m, 3).
        axis: the axis along which the end points.
        cut: place of the cut along it [m].
        straight: least width where the clamp ends, over that at the cut.
    """
    places = vertices[:, axis]
    if places.max() <= cut:
        return False
    width = _width(vertices, triangles, places, cut, axis)
    needed = min(CLAMPED * width, LONG_ENOUGH)
    end = _width(vertices, triangles, places, cut + needed, axis)
    return bool(places.max() > cut + needed and end > straight * width > 0.0)


def closing_faces(
    posed: np.ndarray, triangles: np.ndarray, target: np.ndarray, beyond: float
) -> np.ndarray:
    """Return where flat faces of a part end its target along -x and -y, and x, y and z, (2, 3) [m].

    They are a platform, a base plate or the webs of a crank, which close a chamber round the target
    there. It is nan where there is none, and below.

    Args:
        posed: vertices of the part in its pose [m], (n, 3).
        triangles: its triangles, (m, 3).
        target: marks the triangles of the target, (m,).
        beyond: how far from the target such a face may be [m].
    """
    vectors, corners = area_vectors(posed, triangles), posed[triangles]
    area, found = np.linalg.norm(vectors, axis=1), np.full((2, 3), np.nan)
    sides = np.ptp(corners[target].reshape(-1, 3), axis=0)
    for k, way in [*product(range(2), (-1.0, 1.0)), (2, 1.0)]:
        places = way * corners[..., k]
        end = float(places[target].max())
        inward = ~target & (way * vectors[:, k] < -FACING * area)
        inward &= (places.min(axis=1) > end - BEFORE) & (places.max(axis=1) < end + beyond)
        if not inward.any():
            continue
        place = float(places[inward].min())
        level = inward & (places.max(axis=1) < place + BEFORE)
        if area[level].sum() > CLOSES * np.delete(sides, k).prod():
            found[int(way > 0.0), k] = way * place
    return found


class LocalRoom(NamedTuple):
    """A box or cylinder round a target, out of which the part goes through the walls."""

    sizes: Sizes
    walls: np.ndarray  # places of its walls along -x and -y, and along x and y, in the pose [m]
    kept: np.ndarray  # marks those that stay there if the box becomes longer or shorter, (2, 2)
    lowest: float  # height of the part's lowest point within the walls, in the pose [m]

    def as_low_as(self, sizes: Sizes, lowest: float) -> Sizes:
        """Return sizes for walls within which the part's lowest point is another one [m]."""
        more = self.lowest - lowest
        if more and "z" in sizes.closed:
            return replace(_under_lid(sizes, sizes.height + more), top=sizes.top + more)
        height = 1e-3 * math.ceil(1e3 * (sizes.height + more) - 1e-6)
        return replace(sizes, height=height, top=sizes.top + more) if more else sizes

    def plan(self, sizes: Sizes) -> np.ndarray:
        """Return the outline (k, 2) [m] of the room in the pose if it gets other sizes."""
        walls = self.middle(sizes) + 0.5 * _lengths(sizes) * np.array([[-1.0], [1.0]])
        return _outline(sizes.shape, walls)

    def middle(self, sizes: Sizes) -> np.ndarray:
        """Return the middle in plan (2,) [m] of the room if it gets other sizes."""
        longer = 0.5 * (_lengths(sizes) - np.ptp(self.walls, axis=0))
        shift = self.kept[0] * 1.0 - self.kept[1]
        return np.asarray(self.walls.mean(axis=0) + shift * longer)


def local_room(
    posed: np.ndarray,
    triangles: np.ndarray,
    target: np.ndarray,
    sizes: Sizes,
    at_wall: float | None,
) -> LocalRoom:
    """Return the room round a target that ends where faces of the part are its walls.

    A face closes a cylinder as its lid, and a box also at its sides.

    Args:
        posed, triangles, target: as of closing_faces.
        sizes: those of a box or cylinder with the usual room beside and above the target.
        at_wall: distance from the target of the wall through which an end goes out along x [m]. The
            wall at the other end is as near, if the part goes out through it too.
    """
    on_target = posed[np.unique(triangles[target])]
    faces = closing_faces(posed, triangles, target, sizes.gap) + BEHIND * np.array([[-1.0], [1.0]])
    is_box = sizes.shape == "box"
    if not is_box:
        faces[:, :2] = np.nan
    if at_wall is not None:  # a wall of its own is nearer than such a face
        ends = np.array([on_target.min(axis=0)[0], on_target.max(axis=0)[0]])
        faces[np.abs(faces[:, 0] - ends) > at_wall, 0] = np.nan
    walls = np.array([on_target.min(axis=0) - sizes.gap, on_target.max(axis=0) + sizes.gap])
    near = np.zeros(2, dtype=bool)  # walls along x through which an end goes out
    if at_wall is not None:
        near[:] = float(posed[:, 0].min()) < walls[0, 0], True
        walls[:, 0] += near * (at_wall - sizes.gap) * np.array([-1.0, 1.0])
    if not is_box:
        walls[:, :2] = middle_in_plan(on_target) + 0.5 * _lengths(sizes) * np.array([[-1.0], [1.0]])
    closes = np.isfinite(faces)
    walls, kept = np.where(closes, faces, walls)[:, :2], np.array(closes[:, :2])
    kept[:, 0] |= near
    plan = dict(sizes.plan)
    for k, key in enumerate(("length_mm", "width_mm")):
        if kept[:, k].any():
            plan[key] = _up_half_mm(walls[1, k] - walls[0, k])
    lowest, inner = (
        lowest_over(
            posed, triangles, _outline(sizes.shape, walls + into * np.array([[1.0], [-1.0]]))
        )
        for into in (0.0, INTO)
    )
    if not math.isfinite(inner):
        lowest = inner = 0.0  # refused when it is built
    distance = max(sizes.distance - (inner - lowest), NEAREST * sizes.distance)
    names = np.array([["-x", "-y", "-z"], ["x", "y", "z"]])
    sizes = replace(
        sizes,
        plan=plan,
        closed=tuple(map(str, names[closes])),
        distance=1e-3 * math.ceil(1e3 * distance - 1e-6),
        height=1e-3 * math.ceil(1e3 * (sizes.height - sizes.distance + distance - lowest) - 1e-6),
        top=sizes.top - lowest,
    )
    if closes[1, 2]:
        sizes = _under_lid(sizes, float(sizes.distance + faces[1, 2] - lowest))
        top = float(faces[1, 2] - lowest - BEHIND)
        sizes = replace(sizes, through_ceiling=True, top=top)
    return LocalRoom(sizes, walls, kept, lowest)


def _under_lid(sizes: Sizes, height: float) -> Sizes:
    """Return sizes of at least a height [m] up to the part's own lid, in half millimetres.

    The part is as much higher, so that the wall ends at the lid without a slot.
    """
    half = 1e-3 * _up_half_mm(height)
    return replace(sizes, height=half, distance=round(sizes.distance + half - height, 6))


def _lengths(sizes: Sizes) -> np.ndarray:
    """Return the length and width [m] of a box or cylinder, (2,)."""
    keys = ("length_mm", "width_mm") if sizes.shape == "box" else ("diameter_mm",) * 2
    return 1e-3 * np.array([sizes.plan[key] for key in keys], dtype=float)


def _outline(shape: str, walls: np.ndarray) -> np.ndarray:
    """Return the outline (k, 2) of a box or cylinder between walls (2, 2), counter-clockwise."""
    if shape == "box":
        (left, front), (right, back) = walls
        return np.array([[left, front], [right, front], [right, back], [left, back]])
    angle = np.linspace(0.0, 2.0 * np.pi, CORNERS, endpoint=False)[:, None]
    half = 0.5 * np.ptp(walls, axis=0)
    return np.asarray(walls.mean(axis=0) + half * np.hstack([np.cos(angle), np.sin(angle)]))


def _up_half_mm(length: float) -> float:
    """Return a length given in m in half millimetres, rounded up."""
    return 0.5 * math.ceil(2e3 * length - 1e-6)


def box_beyond(mesh: PartMesh, axis: int, is_top: bool, cut: float) -> list[list[float]]:
    """Return the box [mm], as designs have it, round what of a part lies beyond a cut.

    Args:
        axis: axis of the part's file across which the cut goes.
        is_top: whether what has larger coordinates lies beyond it.
        cut: its coordinate [mm].
    """
    box = 1e3 * np.array([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])
    box += MARGIN_MM * np.array([[-1.0], [1.0]])
    box[1 - int(is_top), axis] = cut
    return [[float(x) for x in corner] for corner in np.round(box, 3)]


def _width(
    vertices: np.ndarray, triangles: np.ndarray, places: np.ndarray, at: float, axis: int
) -> float:
    """Return the width [m] of the section of a part in a plane across an axis.

    Args:
        vertices, triangles: those of the part, (n, 3) [m] and (m, 3).
        places: place of each vertex along the axis [m], (n,).
        at: place of the plane [m].
    """
    one, two = sides_of(triangles).T
    cut = (places[one] < at) & (places[two] >= at)
    one, two = one[cut], two[cut]
    share = ((at - places[one]) / (places[two] - places[one]))[:, None]
    points = vertices[one] + share * (vertices[two] - vertices[one])
    return float(np.ptp(np.delete(points, axis, axis=1), axis=0).min()) if len(points) else 0.0

"""Propose what holds a part in its chamber: a holder on faces that are not to be peened.

An end or a root is enclosed, where it points up or aside. A bore takes an arbor. Where neither is
free, a flat face that does not look down carries a rod along its normal, to the ceiling or to the
side wall, or a block if it is long and a rod would be slim. Such a face is no facet of a round, is
not narrow and lies near the part's centre of mass.

       |   holder   |
       |   _______  |         ^ axis
       |  |  end  | |         grip: down to where the part widens, or near the target
       |__|       |_|
     _____|       |_____
    |       part        |
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from chamberopt.chamber.fixture import OF_FACE
from chamberopt.chamber.layout.arbor import Bore, arbor_through, carries
from chamberopt.chamber.layout.end import UPRIGHT, box_beyond
from chamberopt.chamber.layout.grip import FLAT_DEG, flat_jaws, gripped, thin_grip
from chamberopt.chamber.matters import MatterKind
from chamberopt.common.number_text import plain
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.outline import (
    centroid,
    convex_hull,
    distances_in_plan,
    fitted_circle,
    frame_along,
    narrowest_rectangle,
    radii,
)
from chamberopt.geometry.triangles import area_vectors, areas, rotation_matrix

ROUND_DEG = 25.0  # to the facets of a round beside one of them
MOST_FACES = 40  # flat faces that are looked at, the largest
UP, LEVEL = 0.98, -0.1  # upward component of the normal of a face on top, and of one at the side
HIGHER = 1e-4  # m: what is higher than a face by more stands in the way of a rod on it
# Ball diameters between a holder and the target, so that balls get there, and between it and the
# target on an end that is left bare for it, which it grips as far as it can.
CLEAR, BESIDE_END = 2.0, 1.0
# Of an end that is enclosed: how much wider it may get, over its outermost face; least length over
# its width; most length over the part's.
WIDER, SHORTEST, LONGEST = 2.0, 0.25, 0.4
# An end narrows if its outer TIP, a share of the grip, is slimmer than STRAIGHT of the whole grip.
TIP, STRAIGHT = 0.1, 0.8
PINS = "expanding pins, drawn from behind, in its"
NOT_FIXED = f"{MatterKind.NOT_FIXED}: say what holds the part to it, such as a clamp"
POTTED = f"{MatterKind.POTTED}: give jaws its form, or cast it into the block with polyurethane"
# Thickness of a collar's or block's walls round an end: a share of its width, within [m], and where
# there is no room for that, as thick as jaws with screws may be, and as a cap that is drilled.
OF_WIDTH, THICKEST, WALLS = 0.25, 10e-3, (5e-3, 2e-3)
THINNEST, SLIM = 2e-3, 0.15  # of a rod: m, and over the part's width: slim ones come last
# Over the radius of a face: least seat of a rod round a hole in it, and least edge beside a target.
SEAT, EDGE = 0.05, 0.3
# Least width of a face that carries a part: m, or over the part's width.
WIDE, WIDE_SHARE = 5e-3, 0.1
# A block stands on a face of at least this length over its width, which fills its rectangle.
LONG_FACE, FILLED = 1.6, 0.9
OPPOSITE = 0.5  # cosine from which on a face is opposite to the target
ALONG = 0.02  # largest mean cosine between the walls of a bore and its axis


class HolderChoice(NamedTuple):
    """A holder that may be proposed: its keys of [holder], and the reason for it."""

    keys: dict[str, Any]
    reason: str
    pins: tuple[dict[str, Any], ...] = ()  # entries of `faces`: walls of holes that pins fill
    is_thin: bool = False  # whether it grips metal too thin for what stands out of it
    narrows: bool = (
        False  # whether the end narrows so much to its tip that a bore does not clamp it
    )
    # Its keys with thinner walls round an end, the thickest first, for where room is scarce.
    thinner: tuple[dict[str, Any], ...] = ()

    @property
    def is_round_an_end(self) -> bool:
        """Whether it encloses an end of the part."""
        return "grip_mm" in self.keys

    def with_keys(self, keys: dict[str, Any]) -> HolderChoice:
        """Return the holder with further keys, whatever its walls are."""
        thinner = tuple({**one, **keys} for one in self.thinner)
        return self._replace(keys={**self.keys, **keys}, thinner=thinner)


class _Seen(NamedTuple):
    """The part as it is seen along the normal of one of its flat faces."""

    corners: np.ndarray  # of all triangles [m], (m, 3, 3), the last coordinate along the normal
    face: np.ndarray  # marks those of the face, (m,)
    target: np.ndarray  # (m,)
    hull: np.ndarray  # of the face [m], (n, 2)
    # The narrowest rectangle round the hull: middle, sides and axes.
    rectangle: tuple[np.ndarray, np.ndarray, np.ndarray]
    clear: float  # least distance from the target [m]
    where: str  # "up" or "aside"

    @property
    def level(self) -> float:
        """Place of the face along its normal [m]."""
        return float(self.corners[self.face][..., 2].max())

    @property
    def highest(self) -> np.ndarray:
        """Place along the normal of the highest corner of each triangle [m], (m,)."""
        return np.asarray(self.corners[..., 2].max(axis=1))


def holder_choices(
    mesh: PartMesh,
    target: np.ndarray,
    turns: tuple[float, float, float],
    ball: float,
    bores: Sequence[Bore] = (),
) -> list[HolderChoice]:
    """Return the holders that may hold a part, the best first; none if nothing can carry one.

    What encloses an end that points up comes first, then arbors, what encloses an end at the side,
    what encloses an end of thin metal, and rods on the highest faces. Then come rods at the side,
    of these first on faces opposite to the target, then the thickest. Slim holders come last.

    Args:
        target: marks the triangles to be peened, (m,).
        turns: turns of the part in the chamber [degrees].
        ball: diameter of a ball [m].
        bores: bores of the part that may take an arbor, the best first.
    """
    turn = rotation_matrix(turns)
    posed = mesh.vertices @ turn.T
    away = -area_vectors(posed, mesh.triangles)[target].sum(axis=0)
    width = float(np.sort(np.ptp(posed, axis=0))[1])
    found: list[tuple[tuple[float, ...], HolderChoice]] = []

    def offer(one: HolderChoice, *order: float, thick: float) -> None:
        up = "axis" not in one.keys
        place = 1.0 if one.keys["kind"] == "arbor" else 0.0 if up else 2.0
        if place != 1.0 and not one.is_round_an_end:
            place = 4.0 + float(not up)
        elif one.is_thin:
            place = 3.0
        slim = one.keys["kind"] in ("rod", "arbor") and thick < SLIM * width
        found.append(((slim, place, *order, -thick), one))

    for bore in bores:
        for with_cups in (True, False):
            if made := arbor_through(bore, mesh, target, turns, ball, with_cups):
                offer(HolderChoice(*made), thick=2.0 * bore.radius)
    on_faces = list(_on_flat_faces(mesh, target, turn, ball, bores))
    closed = [one.axis for one in on_faces if one.choice.is_round_an_end]
    for axis in np.array([[0, 0, 1], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]], dtype=float):
        if any(axis @ other > UPRIGHT for other in closed):
            continue
        if (jaw := _jaw(mesh, target, turn, axis, CLEAR * ball)) is not None:
            jaw = _told(jaw, posed, mesh.triangles, axis)
            opposite = axis @ away > OPPOSITE * np.linalg.norm(away)
            offer(jaw, float(not opposite), 1.0, thick=0.0)
    for one in on_faces:
        keys = one.choice.keys
        thick = 1e-3 * keys.get("diameter_mm", min(keys.get("size_mm", [0.0])))
        opposite = one.axis @ away > OPPOSITE * np.linalg.norm(away)
        order = (-one.level_mm, 0.0) if "axis" not in keys else (float(not opposite), 0.0)
        offer(one.choice, *order, thick=thick)
    return [one for _, one in sorted(found, key=lambda one: one[0])]


def _told(
    choice: HolderChoice, posed: np.ndarray, triangles: np.ndarray, axis: np.ndarray
) -> HolderChoice:
    """Return the choice of a holder round an end with what is said of its grip.

    Args:
        posed, triangles, axis: those of gripped.
    """
    grip, words = 1e-3 * choice.keys["grip_mm"], [choice.reason]
    if choice.narrows:
        end = gripped(posed, triangles, axis, grip)
        area = np.where(end.sides, areas(end.vertices, end.triangles), 0.0)
        jaws = flat_jaws(end.vertices @ frame_along(axis), end.triangles, area)
        words.append(jaws.text if jaws.text and not jaws.is_shallow else POTTED)
    thin = thin_grip(posed, triangles, axis, grip)
    words += [thin.text] if thin is not None else []
    return choice._replace(reason="; ".join(words), is_thin=thin is not None)


class _OnFace(NamedTuple):
    """A holder on a flat face, which looks along the axis (3,) at some level along it [mm]."""

    choice: HolderChoice
    axis: np.ndarray
    level_mm: float


def _on_flat_faces(
    mesh: PartMesh, target: np.ndarray, turn: np.ndarray, ball: float, bores: Sequence[Bore]
) -> Iterator[_OnFace]:
    """Yield holders on the flat faces of a part that look up or aside.

    Args:
        target, ball, bores: those of holder_choices.
        turn: rotation of the part into its pose, (3, 3).
    """
    posed = mesh.vertices @ turn.T
    faces = mesh.faces(FLAT_DEG)
    sums = faces.area_vectors @ turn.T
    usable = np.flatnonzero(
        faces.are_flat(FLAT_DEG) & faces.free_of(target) & (sums[:, 2] > LEVEL * faces.area)
    )
    width = float(np.sort(np.ptp(posed, axis=0))[1])
    for face in usable[np.argsort(-faces.area[usable], kind="stable")][:MOST_FACES]:
        normal = np.round(sums[face] / np.linalg.norm(sums[face]), 4) + 0.0
        up = bool(normal[2] > UP)
        axis = np.array([0.0, 0.0, 1.0]) if up else normal
        along = axis / np.linalg.norm(axis)
        own = faces.of_triangle == face
        seen_along = posed @ frame_along(along).T
        of_face = seen_along[mesh.triangles[own]].reshape(-1, 3)
        hull = convex_hull(of_face[:, :2])
        if hull is None:
            continue
        rectangle, level = narrowest_rectangle(hull), float(of_face[:, 2].max())
        middle = np.r_[centroid(hull), level] @ frame_along(along) @ turn
        is_wide = rectangle[1].min() >= min(WIDE, WIDE_SHARE * width) and not faces.is_facet(
            face, ROUND_DEG
        )
        stands = is_wide and carries(mesh, middle, along @ turn)
        if not stands and seen_along[:, 2].max() > level + HIGHER:  # it closes no end either
            continue
        where, corners = "up" if up else "aside", seen_along[mesh.triangles]
        seen = _Seen(corners, own, target, hull, rectangle, CLEAR * ball, where)
        place = {"at_mm": faces.place_mm(face), "crease_deg": FLAT_DEG}
        at: dict[str, Any] = {"at": {"faces": [place]}}
        at |= {} if up else {"axis": axis.tolist()}
        holes = _holes(seen, axis, posed, mesh.triangles, bores)
        area = float(faces.area[face])
        on_face = _on_face(seen, area, holes, SLIM * width) if stands else None
        for made in (_around_end(seen), on_face):
            if made is not None:
                bolts = [] if made.is_round_an_end else _bolts(seen, made, holes)
                fixed = _in_words(bolts) if made.is_round_an_end or bolts else f"; {NOT_FIXED}"
                reason = f"{made.reason}{fixed}"
                pins = tuple(one.wall for one in bolts if one.is_in_target)
                choice = made.with_keys(at)._replace(reason=reason, pins=pins)
                if made.is_round_an_end:
                    choice = _told(choice, posed, mesh.triangles, along)
                yield _OnFace(choice, axis, float(round(1e3 * seen.level)))


def _on_face(seen: _Seen, area: float, holes: Sequence[_Hole], slim: float) -> HolderChoice | None:
    """Return a rod or a block on a face, whichever is firmer; None if there is no room for one.

    Args:
        area: of the face [m²].
        holes: those that open in it.
        slim: diameter of a rod [m] below which a block is taken.
    """
    rod = _rod(seen, area)
    if rod is None or 1e-3 * rod.keys["diameter_mm"] < slim:
        return _block(seen, area, LONG_FACE) or rod
    if holes and (block := _block(seen, area, 1.0)) is not None:
        return block if len(_bolts(seen, block, holes)) > len(_bolts(seen, rod, holes)) else rod
    return rod


class _Hole(NamedTuple):
    """A hole that opens in a flat face, as it is seen along the normal of the face."""

    middle: np.ndarray  # (2,) [m]
    radius: float  # [m]
    wall: dict[str, Any]  # as an entry of `faces`
    is_in_target: bool  # whether it opens in the target too, on which no head may lie


def _holes(
    seen: _Seen, axis: np.ndarray, posed: np.ndarray, triangles: np.ndarray, bores: Sequence[Bore]
) -> list[_Hole]:
    """Return the bores that open in a flat face.

    Args:
        axis: unit normal of the face in the chamber's frame, (3,).
        posed: the part's vertices in its pose [m], (n, 3), of which its triangles are made, (m, 3).
    """
    found = []
    for bore in bores:
        walls = area_vectors(posed, triangles[bore.triangles])
        across = np.abs(walls @ axis).sum() < ALONG * np.linalg.norm(walls, axis=1).sum()
        corners = seen.corners[bore.triangles].reshape(-1, 3)
        if across and corners[:, 2].max() > seen.level - HIGHER:
            rim = np.isin(triangles[seen.target], triangles[bore.triangles]).any()
            found.append(_Hole(*fitted_circle(corners[:, :2]), bore.wall, bool(rim)))
    return found


def _bolts(seen: _Seen, holder: HolderChoice, holes: Sequence[_Hole]) -> list[_Hole]:
    """Return those holes of a face over which a rod or block stands, so that bolts hold it."""
    if holder.keys["kind"] == "rod":
        middle, reach = centroid(seen.hull), 5e-4 * holder.keys["diameter_mm"]
        return [h for h in holes if np.linalg.norm(h.middle - middle) + h.radius < reach]
    middle, _, axes = seen.rectangle
    half = 5e-4 * np.array(holder.keys["size_mm"])
    return [h for h in holes if (np.abs(axes @ (h.middle - middle)) + h.radius < half).all()]


def _in_words(bolts: Sequence[_Hole]) -> str:
    """Return words for bolts or pins that hold a rod or block; empty if there are none."""
    words = ""
    for is_in_target, what in ((False, "bolts through its"), (True, PINS)):
        sizes = [plain(2e3 * one.radius, 3) for one in bolts if one.is_in_target == is_in_target]
        if sizes:
            words += (
                f"; {what} hole{'s' if len(sizes) > 1 else ''} of {', '.join(sizes)} mm hold it"
            )
            words += ", flush with the target: no heads lie on it" if is_in_target else ""
    return words


def _jaw(
    mesh: PartMesh, target: np.ndarray, turn: np.ndarray, axis: np.ndarray, clear: float
) -> HolderChoice | None:
    """Return a jaw round the end of a part that points along an axis; None if the target is there.

    The end is chosen by a box, so that it may have any form. The axis must be one of the file's.

    Args:
        target: that of holder_choices.
        turn: rotation of the part into its pose, (3, 3).
        axis: unit vector in the chamber's frame, (3,).
        clear: least distance from the target [m].
    """
    of_file = turn.T @ axis
    k = int(np.abs(of_file).argmax())
    if abs(of_file[k]) < UPRIGHT:
        return None
    corners = (mesh.vertices @ turn.T @ frame_along(axis).T)[mesh.triangles]
    heights = corners[..., 2]
    top = float(heights.max())
    cut = max(float(heights[target].max()) + clear, top - LONGEST * float(np.ptp(heights)))
    up = bool(axis[2] > UP)
    end, where = heights.mean(axis=1) > cut, "up" if up else "aside"
    made = _of_end(corners, end, target, clear, where) if end.any() else None
    if made is None:
        return None
    box = box_beyond(mesh, k, of_file[k] > 0.0, 1e3 * cut * np.sign(of_file[k]))
    return made.with_keys({"at": {"box_mm": box}, **({} if up else {"axis": axis.tolist()})})


def end_holder(
    mesh: PartMesh,
    target: np.ndarray,
    turns: tuple[float, float, float],
    ball: float,
    end: np.ndarray,
) -> HolderChoice | None:
    """Return the collar or block round the upper end of a part; None if there is no room for one.

    Args:
        target, turns, ball: those of holder_choices.
        end: marks the triangles of the end, (m,).
    """
    if not target.any():
        return None
    posed = mesh.vertices @ rotation_matrix(turns).T
    made = _of_end(posed[mesh.triangles], end, target, BESIDE_END * ball, "up")
    return None if made is None else _told(made, posed, mesh.triangles, np.array([0.0, 0.0, 1.0]))


def _of_end(
    corners: np.ndarray, end: np.ndarray, target: np.ndarray, clear: float, where: str
) -> HolderChoice | None:
    """Return the collar or block round an end of any form; None if there is no room for one.

    Args:
        corners, target, clear, where: those of _Seen.
        end: marks the triangles of the end, (m,).
    """
    hull = convex_hull(corners[end].reshape(-1, 3)[:, :2])
    if hull is None:
        return None
    rectangle = narrowest_rectangle(hull)
    return _around_end(_Seen(corners, end, target, hull, rectangle, clear, where))


def _around_end(seen: _Seen) -> HolderChoice | None:
    """Return a collar or block round the end that the face closes; None if the face closes none."""
    level, highest = seen.level, seen.highest
    if highest.max() > level + HIGHER:
        return None
    middle, sides, axes = seen.rectangle
    round_middle = centroid(seen.hull)
    outer = radii(seen.hull, round_middle)[1]
    is_round = math.pi * outer**2 < sides.prod()
    if is_round:
        aside = np.linalg.norm(seen.corners[..., :2] - round_middle, axis=2, keepdims=True)
        half = np.array([outer])
    else:
        aside, half = np.abs((seen.corners[..., :2] - middle) @ axes.T), 0.5 * sides
    aside = aside.max(axis=1)  # of each triangle, (m, 1 or 2)
    wider = (aside > WIDER * half).any(axis=1)
    target_top = float(highest[seen.target].max())
    low = max([float(highest[wider].max(initial=-math.inf)), target_top + seen.clear])
    grip = min(level - low, LONGEST * float(np.ptp(seen.corners[..., 2])))
    grip = 1e-4 * math.floor(1e4 * grip + 1e-6)
    needed = 2.0 * aside[highest > level - grip].max(axis=0, initial=0.0)
    if grip < SHORTEST * needed.min() or grip <= 0.0:
        return None
    tip = 2.0 * aside[highest > level - TIP * grip].max(axis=0, initial=0.0)
    usual = min(max(OF_WIDTH * float(needed.min()), WALLS[0]), THICKEST)
    sizes = []
    for wall in dict.fromkeys((usual, *WALLS)):
        outside = [math.ceil(2e3 * (one + 2.0 * wall) - 1e-6) / 2.0 for one in needed]
        sizes.append({"diameter_mm": outside[0]} if is_round else {"size_mm": outside})
    beyond = plain(1e3 * (level - grip - target_top), 2)
    text = f"round the end that points {seen.where}, which is not peened; the target begins"
    kind, grip_mm = "collar" if is_round else "plate", round(1e3 * grip, 1)
    first, *thinner = ({"kind": kind, **size, "grip_mm": grip_mm} for size in sizes)
    narrows = bool((tip < STRAIGHT * needed).any())
    reason = f"{text} {beyond} mm beyond it"
    return HolderChoice(first, reason, thinner=tuple(thinner), narrows=narrows)


def _block(seen: _Seen, area: float, long: float) -> HolderChoice | None:
    """Return a block on a face [m²] that fills its rectangle; None if there is no room.

    Args:
        long: least length of the face over its width.
    """
    middle, sides, axes = seen.rectangle
    if sides.max() < long * sides.min() or area < FILLED * sides.prod():
        return None
    along = np.abs((seen.corners[..., :2] - middle) @ axes.T).min(axis=1)  # (m, 2)
    higher = ~seen.face & (seen.highest > seen.level + HIGHER)
    size_mm = [math.floor(2e3 * OF_FACE * one) / 2.0 for one in sides]
    if (along[higher] < 0.5 * OF_FACE * sides + seen.clear).all(axis=1).any():
        return None
    if 1e-3 * min(size_mm) < THINNEST:
        return None
    text = f"on a flat face of {plain(1e6 * area, 3)} mm² that looks {seen.where} and is not "
    return HolderChoice({"kind": "plate", "size_mm": size_mm}, f"{text}peened; it fits the face")


def _rod(seen: _Seen, area: float) -> HolderChoice | None:
    """Return a rod on the face, of some area [m²]; None if there is no room for one."""
    middle, level, highest = centroid(seen.hull), seen.level, seen.highest
    away = distances_in_plan(seen.corners[..., :2], middle)

    def distance(rows: np.ndarray) -> float:
        """Return how far the marked triangles (m,) are from the rod's axis [m]."""
        return float(away[rows].min(initial=math.inf))

    inner, hole = radii(seen.hull, middle)[0], distance(seen.face)
    in_the_way = distance(~seen.face & (highest > level + HIGHER)) - seen.clear
    beside = distance(seen.target & (highest > level - seen.clear)) - min(seen.clear, EDGE * inner)
    radius = min(max(OF_FACE * inner, 0.5 * (hole + inner)), in_the_way, beside)
    diameter_mm = math.floor(4e3 * radius) / 2.0
    if 1e-3 * diameter_mm < max(THINNEST, 2.0 * hole + 2.0 * SEAT * inner):
        return None
    text = f"on a flat face of {plain(1e6 * area, 3)} mm² that looks {seen.where} and is not peened"
    return HolderChoice({"kind": "rod", "diameter_mm": diameter_mm}, f"{text}; it fits the face")

"""Find the bores of a part, and hold it on an arbor through one of them."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from chamberopt.chamber.fixture import ACROSS
from chamberopt.chamber.layout.pose import Turns
from chamberopt.chamber.layout.target import CREASE_DEG
from chamberopt.design.fixture import joint_in_words
from chamberopt.geometry.face_shapes import is_hole
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.outline import (
    convex_hull,
    distances_in_plan,
    fitted_circle,
    frame_along,
    radii,
)
from chamberopt.geometry.triangles import (
    area_vectors,
    centre_of_mass,
    rotation_matrix,
    sides_of,
    unit_vectors,
)

# A keyway may interrupt the wall of a bore: largest sum of its area vectors over its area, and
# least radius in its outline over that round it. FREE is that of the way through.
OPEN, ROUND, FREE = 0.2, 0.9, 0.95
THINNEST = 4e-3  # m: of a bore whose arbor holds a part
# Of flanges: diameter over the bore's, least of it, and thickness over the bore's diameter and [m].
FLANGE, LEAST_FLANGE, THICK, THINNEST_FLANGE = 1.6, 1.2, 0.1, 2e-3
# Between wide flanges and the target, so that balls get there: ball diameters, and a share of how
# far the flanges stand out of where they close on the part. With cups at 0.25 of it the rim of the
# disc of tests/helpers/more_parts.py took 3000 ± 700 s, at 0.5 1920 ± 290, without 1670 ± 250.
BESIDE, OPENING = 2.0, 0.5
# To the narrowest flanges that close on the part no worse than the widest: step of their diameter,
# and width of the rim that has to lie on it, so that no hole ends right beneath.
WIDER_MM, RIM_MM = 0.5, 1.0
# What stands on a part or goes through it carries it near its centre of mass: largest distance of
# its axis from there over the part's size that way.
CENTRED = 0.25
# Widest gap between vertices round a way through a part, seen along it [rad].
AROUND = math.radians(30.0)
UPRIGHT, LEVEL = 0.999, 0.02  # cosines with the vertical of an axis that is upright, and level


class Bore(NamedTuple):
    """A round hole of a part, in the part file's frame; what an arbor takes goes through."""

    triangles: np.ndarray  # marks those of its wall, (m,)
    at_mm: tuple[float, ...]  # a point on the wall, by which to choose it
    point: np.ndarray  # on its axis, (3,) [m]
    axis: np.ndarray  # unit vector, (3,)
    radius: float  # [m]

    @property
    def wall(self) -> dict[str, Any]:
        """Keys that choose its wall, as an entry of `faces`."""
        return {"at_mm": list(self.at_mm), "crease_deg": CREASE_DEG}


def find_bores(mesh: PartMesh, target: np.ndarray, for_arbor: bool = True) -> list[Bore]:
    """Return the bores of a part that are no part of its target, the widest first.

    Args:
        target: marks the triangles to be peened, (m,).
        for_arbor: leaves out thin ones and those that end in the part or are narrowed by it.
    """
    faces = mesh.faces(CREASE_DEG)
    vectors = area_vectors(mesh.vertices, mesh.triangles)
    closed = np.linalg.norm(faces.area_vectors, axis=1) < OPEN * faces.area
    found = []
    for face in map(int, np.flatnonzero(closed & faces.free_of(target))):
        own = faces.of_triangle == face
        spread, axes = np.linalg.eigh(vectors[own].T @ unit_vectors(vectors[own]))
        along = np.abs(vectors[own] @ axes[:, 0]).sum() / faces.area[face]
        if along > 0.5 * ACROSS or spread[1] < 0.5 * spread[2]:
            continue
        bore = _bore(mesh, own, axes[:, 0], faces.place_mm(face), for_arbor)
        if bore is not None:
            found.append(bore)
    return sorted(found, key=lambda one: -one.radius)


def _bore(
    mesh: PartMesh, own: np.ndarray, axis: np.ndarray, at_mm: list[float], for_arbor: bool
) -> Bore | None:
    """Return the bore with these triangles as its wall; None if it is none, or takes no arbor."""
    axis = np.round(axis * np.sign(axis[np.abs(axis).argmax()]), 6)
    frame = frame_along(axis / np.linalg.norm(axis))
    corners = (mesh.vertices @ frame.T)[mesh.triangles]
    hull = convex_hull(corners[own].reshape(-1, 3)[:, :2])
    if hull is None or not is_hole(mesh.vertices, mesh.triangles[own]):
        return None
    middle = fitted_circle(hull)[0]
    inner, outer = radii(hull, middle)
    if inner < ROUND * outer:
        return None
    if for_arbor:
        away = distances_in_plan(corners[~own][..., :2], middle)
        if away.min(initial=math.inf) < FREE * inner or outer < THINNEST / 2:
            return None
    height = float(corners[own][..., 2].mean())
    return Bore(own, tuple(at_mm), np.r_[middle, height] @ frame, frame[2], outer)


def arbor_through(
    bore: Bore,
    mesh: PartMesh,
    target: np.ndarray,
    turns: Turns,
    ball: float,
    with_cups: bool = False,
) -> tuple[dict[str, Any], str] | None:
    """Return the keys of [holder] of an arbor through a bore, and the reason for it.

    An upright one goes out through the ceiling, a level one through both side walls. The result is
    None for another axis or one far from the part's centre of mass, if some of the target is in
    front of the bore, or if wide flanges are wanted and would not close on the part all round at
    both ends.

    Args:
        target: marks the triangles to be peened, (m,).
        ball: diameter of a ball [m], which must get past the arbor to the target.
        with_cups: whether its flanges mask all but what is near the target, as cups if the part is
            hollow beside its hub.
    """
    axis = rotation_matrix(turns) @ bore.axis
    frame = frame_along(bore.axis)
    corners = (mesh.vertices @ frame.T)[mesh.triangles[target]][..., :2]
    away = float(distances_in_plan(corners, (frame @ bore.point)[:2]).min(initial=math.inf))
    if away < FREE * bore.radius or not carries(mesh, bore.point, bore.axis):
        return None
    keys: dict[str, Any] = {"kind": "arbor", "at": {"faces": [bore.wall]}}
    if abs(axis[2]) > UPRIGHT:
        where = "up through the ceiling"
    elif abs(axis[2]) < LEVEL:
        level = np.round(axis * [1.0, 1.0, 0.0], 4) + 0.0
        keys |= {"axis": level.tolist(), "both_sides": True}
        where = f"through both side walls, with gaps of {joint_in_words(1e3 * ball)}"
    else:
        return None
    text = (
        f"an arbor through the bore of {2e3 * bore.radius:.4g} mm, which is not peened, and {where}"
    )
    if with_cups:
        even, widest = 0.5 * ball, math.floor(4e3 * (away - BESIDE * ball)) / 2.0
        depth = _depth_of_seat(bore, mesh, 5e-4 * widest, even)
        if depth < -even:
            return None
        out = max(depth, 0.0) + THINNEST_FLANGE
        wide = min(math.floor(4e3 * (away - OPENING * out)) / 2.0, widest)
        while wide < widest and not all(
            abs(_depth_of_seat(bore, mesh, 5e-4 * one, even) - depth) <= even
            for one in np.arange(wide - 2.0 * RIM_MM, wide + 0.5 * WIDER_MM, WIDER_MM)
        ):
            wide = min(wide + WIDER_MM, widest)
        keys |= {"diameter_mm": wide, "thickness_mm": 1e3 * THINNEST_FLANGE}
        if depth < even:
            return keys, f"{text}; flanges of {wide:g} mm on it mask the ends of the part"
        keys["grip_mm"] = round(1e3 * depth, 2)
        cups = f"cups of {wide:g} mm on it, which close on the part round hub and holes, mask these"
        return keys, f"{text}; {cups}"
    flange = math.floor(2e3 * 2.0 * min(FLANGE * bore.radius, away - ball)) / 2.0
    if 1e-3 * flange > 2.0 * LEAST_FLANGE * bore.radius:
        thick = max(THINNEST_FLANGE, 2.0 * THICK * bore.radius)
        keys |= {"diameter_mm": flange, "thickness_mm": math.ceil(2e3 * thick - 1e-6) / 2.0}
    if "diameter_mm" in keys:
        text += f"; flanges of {keys['diameter_mm']:g} mm on it lie against the part"
    else:
        text += "; it expands in the bore, as no flange has room beside the target"
    return keys, text


def carries(mesh: PartMesh, point: np.ndarray, axis: np.ndarray) -> bool:
    """Return whether a line passes so near to a part's centre of mass that it can be held there.

    Args:
        point, axis: a point on the line [m] and its unit vector in the part file's frame, (3,).
    """
    offset = point - centre_of_mass(mesh.vertices, mesh.triangles)
    offset = offset - (offset @ axis) * axis
    away = float(np.linalg.norm(offset))
    return away * away <= CENTRED * float(np.ptp(mesh.vertices @ offset))


def way_through(mesh: PartMesh) -> tuple[str, float] | None:
    """Return the widest free way through a part that goes all round it, as a spring does.

    It is the axis of the part's file along which it leads, past the centre of mass, and how wide a
    rod may be there [m]; None if there is none.
    """
    middle, found = centre_of_mass(mesh.vertices, mesh.triangles), []
    for axis in range(3):
        plan = np.delete(mesh.vertices - middle, axis, axis=1)
        angle = np.sort(np.arctan2(*plan.T))
        if np.diff(angle, append=angle[0] + 2.0 * np.pi).max() < AROUND:
            free = float(distances_in_plan(plan[mesh.triangles], np.zeros(2)).min())
            found.append((2.0 * free, "xyz"[axis]))
    width, along = max(found, default=(0.0, ""))
    return (along, width) if width > THINNEST else None


def _depth_of_seat(bore: Bore, mesh: PartMesh, radius: float, even: float) -> float:
    """Return how far inside the ends of a bore the part's faces are at a radius about it [m].

    It is the smaller one of both ends; -inf where the faces are not even all round, or the ends are
    not alike.

    Args:
        radius: of the seat [m], which is wider than the bore.
        even: largest difference of heights along the seat, and of the depths of both ends [m].
    """
    frame = frame_along(bore.axis)
    places = (mesh.vertices - bore.point) @ frame.T
    one, two = places[sides_of(mesh.triangles)].swapaxes(0, 1)
    near, far = (np.linalg.norm(end[:, :2], axis=1) for end in (one, two))
    cut = (near < radius) & (far >= radius)
    if radius <= bore.radius or not cut.any():
        return -math.inf
    share = (radius - near[cut]) / (far[cut] - near[cut])
    heights = one[cut, 2] + share * (two[cut, 2] - one[cut, 2])
    wall = places[mesh.triangles[bore.triangles]][..., 2]
    middle = 0.5 * float(wall.min() + wall.max())
    depths = []
    for way in (-1.0, 1.0):
        seat = way * (heights - middle)
        seat = seat[seat > 0.0]
        if not seat.size or np.ptp(seat) > even:
            return -math.inf
        depths.append(0.5 * float(np.ptp(wall)) - float(seat.max()))
    return min(depths) if np.ptp(depths) <= even else -math.inf

"""The design in which a virtual strip is peened: its holder closes the chamber like a lid.

           ________________
    ______|_____strip______|______  z = distance
    |                             |
    |            shot             |    the chamber of the design, without its part
    |_____________________________|
               sonotrode

The strip is flush with its holder, and both are of the same steel. It lies along x, or along y
where it fits only so. A real one lies on its block, and screws hold it (held_strip.py).
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.files import write_text
from chamberopt.design.almen_strip import strip_material
from chamberopt.design.design import validate
from chamberopt.design.load import Design
from chamberopt.design.shapes.base import ParametricChamber, PolygonChamber
from chamberopt.design.shapes.straight import Cylinder
from chamberopt.geometry.triangles import area_vectors
from chamberopt.peening.strip import StripSize

HOLDER_FILE = "strip_holder.obj"
STRIP_GROUP = "strip"
SIDES = 64  # sides of the polygon for a disc
MARGIN_MM = 5.0  # width by which the holder reaches beyond the walls
FIT_MM = 1e-6


def strip_design(
    design: Design, size: StripSize, folder: Path, distance_mm: float | None = None
) -> Design:
    """Return the design with its part replaced by a strip that is flush in a lid on the chamber.

    The lid is written as a mesh.

    Args:
        folder: folder for the mesh.
        distance_mm: distance from the sonotrode to the strip; None: as far as the part.

    Raises:
        InputError: the chamber has a shape without a lid, or the strip does not fit into it.
    """
    chamber, distance, outline = _lid_of(design, distance_mm)
    edge = _edge_that_fits(size, outline)
    thickness = chamber.height_mm - distance + MARGIN_MM
    half_sides = np.abs(outline).max(axis=0) + abs(chamber.slope) * thickness + MARGIN_MM
    path = folder / HOLDER_FILE
    write_text(path, _holder_obj(edge, half_sides, thickness))
    data = design.model_dump()
    data["part"] = {"mesh": str(path), "unit": "mm", "target": {"surface": [STRIP_GROUP]}}
    data["chamber"]["sonotrode_distance_mm"] = float(distance)
    data["materials"]["part"] = strip_material(design.shot).model_dump()
    data["effects"]["part_turn"] = None
    data["effects"]["flexure"] = False  # the strip is held down on a thick block
    for of_the_part in ("zones", "tolerances", "holder", "mask"):
        data.pop(of_the_part, None)
    return validate(Design, data)


def lies_along_y(design: Design, size: StripSize, distance_mm: float | None = None) -> bool:
    """Return whether a strip that fits into a lid lies along y in it, as it does not fit along x.

    Args:
        distance_mm: distance from the sonotrode to the strip; None: as far as the part.
    """
    outline = _lid_of(design, distance_mm)[2]
    return growth(_edge_mm(size), outline) < 1.0 - FIT_MM


def lid_outline_mm(design: Design, distance_mm: float) -> np.ndarray | None:
    """Return the outline (n, 2) [mm] of the room at a distance from the sonotrode [mm].

    It is None for a chamber that takes no lid.
    """
    try:
        return _lid_of(design, distance_mm)[2]
    except InputError:
        return None


def _lid_of(
    design: Design, distance_mm: float | None
) -> tuple[PolygonChamber | Cylinder, float, np.ndarray]:
    """Return the chamber, the distance of a lid with a strip, and its outline (n, 2) there [mm].

    Raises InputError for a chamber without a lid, or a distance outside it.
    """
    chamber = design.chamber
    if not isinstance(chamber, PolygonChamber | Cylinder):
        raise InputError(
            f'chamber.shape: given "{chamber.shape}"; not supported: a strip in the lid needs a '
            "cylinder, box or prism; use --at ZONE with a zone of the part"
        )
    distance = chamber.sonotrode_distance_mm if distance_mm is None else distance_mm
    if not 0.0 < distance < chamber.height_mm:
        raise InputError(
            f"--distance-mm: given {distance:g}; allowed: above 0 and below chamber.height_mm = "
            f"{chamber.height_mm:g}"
        )
    return chamber, distance, _outline_mm(chamber, distance)


def _outline_mm(chamber: ParametricChamber, height: float) -> np.ndarray:
    """Return the convex outline (n, 2) [mm] of a chamber at a height [mm], counter-clockwise."""
    import trimesh
    from scipy.spatial import ConvexHull

    shape = chamber.surface(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32))
    mesh = trimesh.Trimesh(1e3 * shape.vertices, shape.triangles, process=False)
    cut = trimesh.intersections.mesh_plane(mesh, (0.0, 0.0, 1.0), (0.0, 0.0, height))
    points = cut.reshape(-1, 3)[:, :2]
    return np.asarray(points[ConvexHull(points).vertices])


class StripRoom(NamedTuple):
    """The largest strip of the proportions of a whole one, and the largest disc, in a lid [mm]."""

    length: float
    width: float
    disc: float


def _largest(size: StripSize, outline: np.ndarray) -> StripRoom:
    """Return the largest strip of a size's proportions, and disc, inside an outline (n, 2) [mm]."""
    rectangle = _edge_mm(replace(size, is_disc=False))
    most = max(growth(edge, outline) for edge in (rectangle, _turned(rectangle)))
    length = 0.1 * math.floor(10.0 * most * 1e3 * size.length)
    width = math.floor(10.0 * length * size.width / size.length) / 10
    disc = 0.1 * math.floor(10.0 * 2.0 * float(sides_of(outline)[1].min()))
    return StripRoom(length, width, disc)


def sides_of(outline: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the normal of each side of an outline, (n, 2), and its distance from the middle."""
    along = np.roll(outline, -1, axis=0) - outline
    normal = np.c_[along[:, 1], -along[:, 0]] / np.linalg.norm(along, axis=1)[:, None]
    return normal, (normal * outline).sum(axis=1)


def growth(edge: np.ndarray, outline: np.ndarray) -> float:
    """Return the factor by which an edge, corners (n, 2), could grow and still fit an outline."""
    normal, reach = sides_of(outline)
    return float((reach / (edge @ normal.T).max(axis=0)).min())


def _edge_that_fits(size: StripSize, outline: np.ndarray) -> np.ndarray:
    """Return the corners (n, 2) of a strip along x, or else along y, inside an outline [mm].

    Raises InputError, with the sizes that fit, if it is inside neither way.
    """
    edge = _edge_mm(size)
    for one in (edge, _turned(edge)):
        if growth(one, outline) >= 1.0 - FIT_MM:
            return one
    room = _largest(size, outline)
    given = f"a {size}" if size.is_disc else f"a strip of {size}"
    offers = f"--disc-mm {room.disc:g}"
    if not size.is_disc:
        offers += f" or --size-mm {room.length:g} {room.width:g}"
    raise InputError(
        f"{given} does not fit into the chamber there; there is room for {offers}: give the size "
        "of a small strip that you have, or use --at ZONE"
    )


def _turned(edge: np.ndarray) -> np.ndarray:
    """Return the corners (n, 2) of a strip turned by 90 degrees."""
    return np.asarray(edge[:, ::-1] * [-1.0, 1.0])


def _edge_mm(size: StripSize) -> np.ndarray:
    """Return the corners of a strip along x [mm], (n, 2), counter-clockwise."""
    if size.is_disc:
        angle = 2.0 * np.pi * (np.arange(SIDES) + 0.5) / SIDES
        return np.asarray(500.0 * size.length * np.c_[np.cos(angle), np.sin(angle)])
    corners = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    return 500.0 * corners * [size.length, size.width]


def _holder_obj(edge: np.ndarray, half_sides: np.ndarray, thickness: float) -> str:
    """Return the OBJ file's text of a plate [mm], in whose lower face (z = 0) the strip is a group.

    Args:
        edge: corners of the strip [mm], (n, 2).
        half_sides: half sides of the plate along x and y [mm], (2,).
        thickness: thickness of the plate [mm].
    """
    from scipy.spatial import Delaunay

    n = len(edge)
    corners = half_sides * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    points = np.r_[edge, corners]
    # The corners of the strip are on a circle with no other point inside, so that Delaunay's
    # triangles do not cross the edge of the strip.
    lower = Delaunay(points).simplices
    vertices = np.r_[np.c_[points, np.zeros(n + 4)], np.c_[corners, np.full(4, thickness)]]
    down = area_vectors(vertices, lower)[:, 2] < 0.0
    lower = np.where(down[:, None], lower, lower[:, ::-1])
    is_strip = (lower < n).all(axis=1)
    low, top = np.arange(n, n + 4), np.arange(n + 4, n + 8)
    sides = [
        triangle
        for k in range(4)
        for j in [(k + 1) % 4]
        for triangle in ((low[k], low[j], top[j]), (low[k], top[j], top[k]))
    ]
    rest = np.r_[lower[~is_strip], sides, [[top[0], top[1], top[2]], [top[0], top[2], top[3]]]]
    lines = ["# The holder of a virtual Almen strip, in mm, written by chamberopt."]
    lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices]
    for name, faces in ((STRIP_GROUP, lower[is_strip]), ("holder", rest)):
        lines += [f"g {name}", *(f"f {a} {b} {c}" for a, b, c in faces + 1)]
    return "\n".join(lines) + "\n"

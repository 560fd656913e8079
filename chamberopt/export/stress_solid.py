"""Write the residual stress of a result as initial stress in the user's own mesh of solids.

Notation
    z      depth of an integration point below the peened surface [m]
    n      unit normal of the surface above the point, out of the part
    e      eigenstrain at that depth, along both directions of the surface; -2 e along n
    G      shear modulus of the part [Pa]

    initial stress = -2 G e (I - 3 n nᵀ)

Held at once in all directions, the peened layer has this stress. The solver's first step, without
loads, lets it balance: what it prints then is the residual stress. The eigenstrain is that before
any balance, so that thin and curved parts need nothing else. Isotropic thermal expansion in place
of it is wrong by a third on curved skins.

Source: CalculiX CrunchiX user's manual, *INITIAL CONDITIONS, TYPE=STRESS: element, integration
point, stress xx, yy, zz, xy, xz, yz. Integration points of C3D10 are by a test those of CalculiX.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.build import TARGET
from chamberopt.common.errors import InputError
from chamberopt.common.files import write_text
from chamberopt.common.limits import MAX_MESH_BYTES, read_limited, require_few
from chamberopt.coverage.stress_knowledge import DEPTH
from chamberopt.design.flexure import plate_metals
from chamberopt.export.stress import require_stress
from chamberopt.geometry.meshes.abaqus import read_elements
from chamberopt.geometry.meshes.elements import EDGES, ElementMesh, extract_surface
from chamberopt.geometry.meshes.units import METRES_PER
from chamberopt.geometry.triangles import area_vectors, unit_vectors
from chamberopt.results.arrays_file import load_result_arrays
from chamberopt.results.load import load_result
from sim_core import SceneError, TriangleMesh, closest_points

if TYPE_CHECKING:
    from chamberopt.chamber.part import Part
    from chamberopt.design.materials.catalogue import Elastic
    from chamberopt.results.arrays_file import ResultArrays
    from chamberopt.results.load import Result
    from chamberopt.results.records import StressRecord

TYPES = "C3D4", "C3D10"
# Unit of stress that goes with a unit of length by custom, and its pascals.
STRESS_UNITS = {"mm": ("MPa", 1e6), "m": ("Pa", 1.0), "in": ("psi", 6894.757293168)}
SAME_SIZE = 1.2  # ratio of two lengths of one part; units differ by 2.5 and more
NUMBER = rb"((?:\d+\.?\d*|\.\d+)(?:[ED][+-]?\d+)?)"
ELASTIC = re.compile(rb"^\*ELASTIC\b[^\n]*\n([^*\n]*)", re.I | re.M)
ROW = re.compile(rb"\s*" + NUMBER + rb"\s*,\s*" + NUMBER + rb"\s*(?:,|$)", re.I)
# Differences that a metal may have in two sources: of Young's moduli, relative, and of Poisson's
# ratios, which at ± 0.03 change the stress by 5 %.
SAME_METAL, SAME_RATIO = 0.15, 0.03
PEENED = 1  # tag of triangles with a stress that is told
ON_SKIN = 0.2  # distance over the depth of compression up to which a mesh lies on the part
COVERED = 0.95  # least share of the peened surface on which the mesh lies
ALONG = 0.95  # cosine to the normal up to which a point is below the surface, and not beside it
# Thickness of the elements at the skin over the depth of compression. In CalculiX a plate of C3D10
# bends by the right curvature to 1 % up to FINE, and to 6 % up to COARSEST. There the stress in the
# layer is off by 14 % of the largest in C3D4 (the first number) and by 6 % in C3D10, rms.
FINE, COARSEST = 0.6, (1.0, 1.5)
FARTHEST = 4.0  # distance over the depth of compression up to which a thickness is measured
FEW = 0.05  # share of the peened surface whose elements are not asked


def _quadratic(weights: np.ndarray) -> np.ndarray:
    """Return the weights (p, 10) of the nodes of C3D10 at points with these weights of corners."""
    middles = [4.0 * weights[:, a] * weights[:, b] for a, b in EDGES["tetra"]]
    return np.column_stack([weights * (2.0 * weights - 1.0), *middles])


# Weights of the nodes at the integration points, by number of nodes: (points, nodes).
FAR = 0.1381966011250105  # (5 - sqrt(5)) / 20
AT_POINTS = {4: np.full((1, 4), 0.25), 10: _quadratic(FAR + (1.0 - 4.0 * FAR) * np.eye(4))}


class PeenedSkin(NamedTuple):
    """The surface of a part with the profile under each of its triangles.

    Attributes:
        part: as it stands in the chamber.
        mesh: its triangles; those with a profile have the tag PEENED.
        surface: number of the profile of each triangle, -1 without one, (m,).
        profiles: depth [m] and eigenstrain.
        depth: depth of compression of each profile [m], (k,).
    """

    part: Part
    mesh: TriangleMesh
    surface: np.ndarray
    profiles: list[tuple[np.ndarray, np.ndarray]]
    depth: np.ndarray

    @property
    def deepest(self) -> float:
        """Depth [m] below which there is nothing."""
        return max(float(depth[-1]) for depth, _ in self.profiles)


def write_solid_stress(folder: Path, file: Path, deck: Path) -> list[str]:
    """Write the initial stress at the integration points of a deck's solids, for CalculiX.

    Return remarks for the user.

    Raises:
        InputError: the result has no stress; the deck cannot be read, has other elements than
            C3D4 and C3D10, does not lie on the part, or is too coarse.
    """
    result = load_result(folder)
    skin = peened_skin(result, require_stress(result), load_result_arrays(result))
    metals, of_file = plate_metals(result.design), skin.part.file
    assert metals is not None
    assert of_file is not None
    content = _content(deck)
    mesh = read_solids(deck, content)
    unit = _unit_of(deck, mesh, of_file.simulated.size)
    name, pascals = STRESS_UNITS[unit]
    _require_metal(deck, content, metals.part, pascals, name)
    in_file = mesh.points * METRES_PER[unit]
    mesh = replace(mesh, points=in_file @ of_file.rotation.T + of_file.shift)
    remarks = require_skin(deck, mesh, skin)
    element, point, place = integration_points(mesh)
    strain, normal = eigenstrain_at(place, skin)
    (inside,) = np.nonzero(strain)
    normal = normal[inside] @ of_file.rotation
    shear = metals.part.modulus / (2.0 + 2.0 * metals.part.poisson)
    size = -2.0 * shear / pascals * strain[inside]
    stress = size[:, None, None] * (np.eye(3) - 3.0 * normal[:, :, None] * normal[:, None])
    columns = stress[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]] + 0.0  # no -0
    rows = zip(element[inside].tolist(), point[inside].tolist(), columns.tolist(), strict=True)
    lines = [
        f"** Residual stress by chamberopt in elements of {deck.name!r}, in {name}, for CalculiX.",
        "** Include it after the mesh and before the first step, which has no loads and only holds",
        "** the body in place: what the solver prints then is the stress. It is an estimate.",
        "*INITIAL CONDITIONS, TYPE=STRESS",
        *(f"{one}, {at}, {', '.join(f'{x:.6g}' for x in six)}" for one, at, six in rows),
    ]
    write_text(file, "".join(f"{line}\n" for line in lines))
    count = len(np.unique(element[inside]))
    return [f"initial stress in {name} in {count:,} elements of {deck.name}, in {unit}", *remarks]


def peened_skin(result: Result, found: StressRecord, arrays: ResultArrays) -> PeenedSkin:
    """Return the surface of a result's part with the profile under each of its triangles.

    Where target and zones overlap, the smallest of them counts. If its stress is not told, there is
    no profile, and none where no ball comes.

    Raises InputError if no triangle has a profile, or the part's surface is not closed.
    """
    part, names = arrays.chamber.part, list(found.profiles)
    surfaces = {TARGET: part.target, **part.zones}
    surface = np.full(len(part.area), -1)
    for name in sorted(surfaces, key=lambda one: -float(part.area[surfaces[one]].sum())):
        surface[surfaces[name]] = names.index(name) if name in names else -1
    surface[~(arrays.elements["reachable"] > 0.5)] = -1
    tags = np.where(surface < 0, 0, PEENED)
    if not tags.any():
        raise InputError(f"{result.folder}: no triangle of its part has a residual stress")
    try:
        mesh = TriangleMesh(part.vertices, part.triangles, tags)
    except SceneError:
        text = "its part is no closed body, as one that is drawn with its chamber"
        raise InputError(f"{result.folder}: {text}; simulate it as a file of its own") from None
    keys = [DEPTH if name == TARGET else f"{name}.{DEPTH}" for name in names]
    depth = np.array([1e-6 * result.metrics[key].value for key in keys])
    curves = [(1e-6 * np.array(one.depth_um), np.array(one.eigenstrain))
              for one in found.profiles.values()]  # fmt: skip
    return PeenedSkin(part, mesh, surface, curves, depth)


def _content(deck: Path) -> bytes:
    if deck.is_dir():
        raise InputError(f"--mesh {deck}: is a folder; give the deck with your solids")
    try:
        return read_limited(deck, MAX_MESH_BYTES, "deck", follow=True)
    except FileNotFoundError:
        raise InputError(f"--mesh {deck}: no such file; give the deck with your solids") from None


def read_solids(deck: Path, content: bytes) -> ElementMesh:
    """Return the solids of a deck, in its numbers. Raise InputError if they cannot be used."""
    mesh = read_elements(deck, content, TYPES)
    if not mesh.blocks:
        raise InputError(
            f"{deck}: has no solids; give an Abaqus or CalculiX deck with C3D4 or C3D10"
        )
    if mesh.instance or not mesh.own:
        raise InputError(f"{deck}: has parts and instances; write the model out flat")
    if not np.isfinite(mesh.points).all():
        raise InputError(f"{deck}: has nodes that are no numbers; export it again")
    points = sum(len(block.nodes) * len(AT_POINTS[block.nodes.shape[1]]) for block in mesh.blocks)
    require_few(deck, points, "integration points")
    return mesh


def _unit_of(deck: Path, mesh: ElementMesh, size: np.ndarray) -> str:
    """Return the unit of a deck's numbers, in which it is as large as the part.

    Args:
        size: sides of the part's bounding box [m], (3,).
    """
    used = np.concatenate([block.nodes.ravel() for block in mesh.blocks])
    sides = np.ptp(mesh.points[used], axis=0)
    for unit, metres in METRES_PER.items():
        if 1.0 / SAME_SIZE < sides.max() * metres / size.max() < SAME_SIZE:
            if unit in STRESS_UNITS:
                return unit
            raise InputError(
                f"{deck}: its numbers are in {unit}, which has no usual unit of stress; "
                f"write it in {', '.join(STRESS_UNITS)}"
            )
    raise InputError(
        f"{deck}: its longest side is {sides.max():.5g}, and the part's {1e3 * size.max():.5g} mm, "
        "the same in no unit; give a mesh of the whole part"
    )


def _require_metal(deck: Path, content: bytes, metal: Elastic, pascals: float, unit: str) -> None:
    """Raise InputError if the deck has elastic constants, and not once those of the part's metal.

    Args:
        pascals: of the deck's unit of stress [Pa].
    """
    given = ELASTIC.findall(content)
    rows = [[float(x.upper().replace(b"D", b"E")) for x in found.groups()]
            for one in given if (found := ROW.match(one))]  # fmt: skip
    modulus = metal.modulus / pascals

    def is_alike(row: list[float]) -> bool:
        return abs(row[0] / modulus - 1.0) < SAME_METAL and abs(row[1] - metal.poisson) < SAME_RATIO

    if given and not any(map(is_alike, rows)):
        has = f"{rows[0][0]:g}, {rows[0][1]:g}" if rows else repr(given[0].decode(errors="replace"))
        raise InputError(
            f"{deck}: *ELASTIC has {has}, and the part's metal {modulus:.3g} {unit} and "
            f"{metal.poisson:g}; stress is written in the unit that goes with that of lengths: "
            "change the deck's, or the metal"
        )


def require_skin(deck: Path, mesh: ElementMesh, peened: PeenedSkin) -> list[str]:
    """Return remarks on what the elements at the peened skin of a mesh cannot show.

    Args:
        mesh: in the chamber [m].
    Raises:
        InputError: the mesh does not lie on the part, or is too coarse for the layer.
    """
    skin = extract_surface(mesh)
    assert skin.numbering is not None
    rows = np.arange(3 * len(skin.corners)).reshape(-1, 3)
    vectors = area_vectors(skin.corners.reshape(-1, 3), rows)
    normal, centre = unit_vectors(vectors), skin.corners.mean(axis=1)
    near = closest_points(peened.mesh, centre, peened.deepest)
    surface = np.where(near.triangle < 0, -1, peened.surface[near.triangle])
    depth = peened.depth[surface]
    along = np.einsum("ti,ti->t", normal, peened.part.normals_at(near.triangle, near.point))
    on = (surface >= 0) & (near.distance < ON_SKIN * depth) & (along > ALONG)
    area = np.where(on, np.linalg.norm(vectors, axis=1), 0.0)
    share = area.sum() / peened.part.area[peened.surface >= 0].sum()
    if not share > COVERED:
        raise InputError(
            f"{deck}: its skin is {100.0 * share:.0f} % of the peened surface, to "
            f"{1e6 * ON_SKIN * peened.depth.min():.0f} µm; give a mesh of the whole part, with the "
            "axes and the origin of the part's file, and nodes on its rounds"
        )
    order, corners = np.argsort(mesh.numbers), [block.nodes[:, :4] for block in mesh.blocks]
    row = order[np.searchsorted(mesh.numbers, skin.numbering.elements, sorter=order)]
    below = closest_points(peened.mesh, mesh.points, FARTHEST * peened.deepest).distance
    height = below[np.concatenate(corners)[row]].max(axis=1)
    first_order = any(block.nodes.shape[1] == 4 for block in mesh.blocks)
    order = np.argsort(ratio := height / depth)
    thickest = ratio[order][np.searchsorted(np.cumsum(area[order]), (1.0 - FEW) * area.sum())]
    text = (
        f"elements at the peened skin are {thickest:.2g} times as thick as the layer, which is "
        f"{1e3 * peened.depth.min():.2g} mm (all but {100.0 * FEW:g} % of them are thinner)"
    )
    if thickest > COARSEST[0 if first_order else 1]:
        raise InputError(f"{deck}: {text}; make them half as thick as the layer")
    remarks = []
    if first_order:
        remarks.append("C3D4 are too stiff in bending: take C3D10 for the distortion of the part")
    if thickest > FINE:
        remarks.append(
            f"{text}: forces are right; for the stress there, make them half as thick as the layer"
        )
    return remarks


def integration_points(mesh: ElementMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return element number, number from 1 and place (n, 3) of each integration point."""
    elements, points, places, first = [], [], [], 0
    for block in mesh.blocks:
        weights, count = AT_POINTS[block.nodes.shape[1]], len(block.nodes)
        places.append(np.einsum("pn,eni->epi", weights, mesh.points[block.nodes]).reshape(-1, 3))
        elements.append(np.repeat(mesh.numbers[first : first + count], len(weights)))
        points.append(np.tile(np.arange(1, len(weights) + 1), count))
        first += count
    return np.concatenate(elements), np.concatenate(points), np.concatenate(places)


def eigenstrain_at(place: np.ndarray, skin: PeenedSkin) -> tuple[np.ndarray, np.ndarray]:
    """Return the eigenstrain (n,) at places in the part, and the normal (n, 3) of the skin above.

    Both are 0 at places that are too deep, or beside the peened surface and not below it.

    Args:
        place: in the chamber [m], (n, 3).
    """
    strain, normal = np.zeros(len(place)), np.zeros((len(place), 3))
    near = closest_points(skin.mesh, place, skin.deepest, PEENED)
    at = np.flatnonzero(near.triangle >= 0)
    triangle, foot, distance = near.triangle[at], near.point[at], near.distance[at]
    above = skin.part.normals_at(triangle, foot)
    along = np.einsum("ij,ij->i", foot - place[at], above)
    of_any = closest_points(skin.mesh, place[at], skin.deepest).triangle
    below = (skin.mesh.tags[of_any] == PEENED) | (along > ALONG * distance)
    # A point of a curved mesh may lie a little outside of a flat facet.
    depth = np.where(along < 0.0, 0.0, distance)
    for number, (depths, strains) in enumerate(skin.profiles):
        own = below & (skin.surface[triangle] == number)
        strain[at[own]] = np.interp(depth[own], depths, strains, right=0.0)
    normal[at[below]] = above[below]
    return strain, normal

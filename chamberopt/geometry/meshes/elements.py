"""Make triangles of finite elements: of shell elements, and of the skin of solid elements.

Sets of elements, faces or points become groups of triangles.

A quadrilateral with mid-edge nodes becomes six triangles: the corner triangles (0 4 7) (1 5 4)
(2 6 5) (3 7 6), then the middle 4 5 6 7, cut along its shorter diagonal. If the file leaves out a
mid-edge node, the edge is straight.

    3---6---2
    7       5
    0---4---1
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from chamberopt.geometry.meshes.raw_mesh import ElementNumbers, RawMesh

Face = tuple[int, ...]
RING: tuple[Face, ...] = ((0, 1), (1, 2), (2, 3), (3, 0))

# Corner numbers of each face. Solids list their faces in the order of Abaqus, S1, S2 ...
FACES: dict[str, tuple[Face, ...]] = {
    "triangle": ((0, 1, 2),),
    "quad": ((0, 1, 2, 3),),
    "tetra": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "pyramid": ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)),
    "wedge": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "hexahedron": (
        (0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0),
    ),
}  # fmt: skip
# Edges in the order of their mid-edge nodes, which follow the corners (in VTK and Abaqus).
EDGES: dict[str, tuple[Face, ...]] = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": RING,
    "tetra": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
    "pyramid": (*RING, (0, 4), (1, 4), (2, 4), (3, 4)),
    "wedge": ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
    "hexahedron": (*RING, (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)),
}
CORNERS = {"triangle": 3, "quad": 4, "tetra": 4, "pyramid": 5, "wedge": 6, "hexahedron": 8}
SHELLS = ("triangle", "quad")
SOLIDS = ("tetra", "pyramid", "wedge", "hexahedron")
NONE = -1


class Block(NamedTuple):
    """Elements of one kind, such as triangles or tetrahedra.

    Their nodes are corners first, then mid-edge nodes (or NONE). Further nodes are ignored.
    """

    kind: str  # a key of FACES
    nodes: np.ndarray  # (k, p) rows of the mesh's points


@dataclass
class ElementMesh:
    """Finite element mesh. Its elements are counted from 0 on, through all blocks.

    The mesh has named sets: sets of elements, sets of elements with a face of each element, and
    sets of points. A triangle is in the group of a node set if all its corners are in the set.
    """

    points: np.ndarray  # (n, 3) in the file's numbers
    blocks: list[Block]
    numbers: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    own: bool = True  # True if the numbers (e,) are the file's own, False if they are positions
    instance: str = ""  # Abaqus instance in which the numbers count
    element_sets: dict[str, np.ndarray] = field(default_factory=dict)
    face_sets: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    node_sets: dict[str, np.ndarray] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


class _Polygons(NamedTuple):
    """Faces of elements that all have the same number n of corners."""

    corners: np.ndarray  # (k, n) points
    mids: np.ndarray  # (k, n) points in the middle of edges, or NONE
    owner: np.ndarray  # (k,) element of each face
    side: np.ndarray  # (k,) number of the face in its element
    shell: np.ndarray  # (k,) shell element that lies on the face, or NONE

    def select(self, keep: np.ndarray) -> _Polygons:
        return _Polygons(*(column[keep] for column in self))


def extract_surface(mesh: ElementMesh) -> RawMesh:
    """Return the triangles that bound the elements, in the elements' order.

    The sets of the mesh become groups of triangles.
    """
    corners, owners, origins, groups, notes = [], [], [], [], list(mesh.notes)
    has_solids = any(block.kind in SOLIDS for block in mesh.blocks)
    for n in (3, 4):
        faces = _polygons(mesh, n, SHELLS)
        if has_solids:
            skin = _skin(_polygons(mesh, n, SOLIDS), mesh.points, mesh.blocks)
            faces, inside = _with_shells(skin, faces)
            if inside:
                where = "that are not on the skin of the solid elements"
                notes.append(f"left out {inside} shell elements {where}")
        triangles, of_face = _triangulate(faces, mesh.points)
        corners.append(mesh.points[triangles])
        owners.append(faces.owner[of_face])
        origins.append(np.stack(_origin(mesh, faces), axis=1)[of_face])
        groups.append({name: mask[of_face] for name, mask in _groups(mesh, faces).items()})
    order = np.argsort(np.concatenate(owners), kind="stable")
    masks = {name: np.concatenate([part[name] for part in groups])[order] for name in groups[0]}
    elements, sides = np.concatenate(origins)[order].T
    return RawMesh(
        np.concatenate(corners)[order].reshape(-1, 3, 3),
        {name: mask for name, mask in masks.items() if mask.any()},
        notes=tuple(notes),
        numbering=ElementNumbers(elements, sides.astype(np.int8), mesh.own, mesh.instance),
    )


def _origin(mesh: ElementMesh, faces: _Polygons) -> tuple[np.ndarray, np.ndarray]:
    """Return the element number (k,) of each face, and the number (k,) of the face in its element.

    Faces of solids are numbered from 1 on, and a shell has the face number 0. If a shell lies on a
    solid, the shell's number is returned: the file's author put it there to show results.
    """
    has_shell = faces.shell != NONE
    is_solid = [np.full(len(block.nodes), block.kind in SOLIDS) for block in mesh.blocks]
    of_solid = np.concatenate([np.zeros(0, dtype=bool), *is_solid])[faces.owner]
    number = mesh.numbers[np.where(has_shell, faces.shell, faces.owner)]
    return number, np.where(of_solid & ~has_shell, faces.side + 1, 0)


def _polygons(mesh: ElementMesh, n: int, kinds: tuple[str, ...]) -> _Polygons:
    """Return all faces with n corners of the elements of the given kinds."""
    none = np.zeros(0, dtype=np.int64)
    rows = [(none.reshape(0, n), none.reshape(0, n), none, none, none)]
    first = 0
    for block in mesh.blocks:
        number = np.arange(first, first + len(block.nodes))
        first += len(block.nodes)
        for k, face in enumerate(FACES[block.kind]):
            if len(face) == n and block.kind in kinds:
                side, shell = np.full_like(number, k), np.full_like(number, NONE)
                rows.append((block.nodes[:, face], _mids(block, face), number, side, shell))
    return _Polygons(*(np.concatenate(column) for column in zip(*rows, strict=True)))


def _mids(block: Block, face: Face) -> np.ndarray:
    """Return the mid-edge nodes (k, n) of a face in each element of a block.

    They are NONE where an element has no mid-edge node.
    """
    edges = {frozenset(edge): CORNERS[block.kind] + k for k, edge in enumerate(EDGES[block.kind])}
    columns = [edges[frozenset((face[k], face[(k + 1) % len(face)]))] for k in range(len(face))]
    if block.nodes.shape[1] <= max(edges.values()):
        return np.full((len(block.nodes), len(face)), NONE)
    return block.nodes[:, columns]


def _skin(faces: _Polygons, points: np.ndarray, blocks: list[Block]) -> _Polygons:
    """Return the faces that belong to only one solid, turned to face away from it."""
    keys = np.sort(faces.corners, axis=1)
    _, same, times = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    faces = faces.select(times[same.reshape(-1)] == 1)
    if not len(faces.corners):
        return faces
    corners_of = [block.nodes[:, : CORNERS[block.kind]] for block in blocks]
    middle = np.concatenate([points[nodes].mean(axis=1) for nodes in corners_of])
    at = points[faces.corners]
    normal = np.cross(at[:, 1] - at[:, 0], at[:, -1] - at[:, 0])
    inward = np.einsum("ij,ij->i", normal, at.mean(axis=1) - middle[faces.owner]) < 0.0
    corners = np.where(inward[:, None], faces.corners[:, ::-1], faces.corners)
    mids = np.where(inward[:, None], np.roll(faces.mids[:, ::-1], -1, axis=1), faces.mids)
    return faces._replace(corners=corners, mids=mids)


def _with_shells(skin: _Polygons, shells: _Polygons) -> tuple[_Polygons, int]:
    """Return the skin of the solids with the shell element on each face entered, and the number of
    shell elements that are not on the skin.
    """
    if not len(shells.corners):
        return skin, 0
    keys = np.sort(np.concatenate([skin.corners, shells.corners]), axis=1)
    key = np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)
    on_skin, on_shell = key[: len(skin.corners)], key[len(skin.corners) :]
    shell_of_key = np.full(int(key.max()) + 1, NONE)
    shell_of_key[on_shell] = shells.owner
    inside = int((~np.isin(on_shell, on_skin)).sum())
    return skin._replace(shell=shell_of_key[on_skin]), inside


def _groups(mesh: ElementMesh, faces: _Polygons) -> dict[str, np.ndarray]:
    """Return marks (k,) of the faces in each set of the mesh, by the name of the set.

    Sets of nodes, faces and elements that share a name are joined.
    """
    groups: dict[str, np.ndarray] = {
        name: np.isin(faces.owner, elements) | np.isin(faces.shell, elements)
        for name, elements in mesh.element_sets.items()
    }
    for name, (elements, sides) in mesh.face_sets.items():
        chosen = np.isin(faces.owner * 8 + faces.side, elements * 8 + sides)
        groups[name] = groups.get(name, False) | chosen
    for name, nodes in mesh.node_sets.items():
        inside = np.asarray(np.isin(faces.corners, nodes).all(axis=1))
        groups[name] = groups.get(name, False) | inside
    return groups


def _triangulate(faces: _Polygons, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Divide faces into triangles. Return the points (t, 3) and the face (t,) of each triangle.

    Triangles with two equal corners are left out.
    """
    curved = (faces.mids != NONE).any(axis=1)
    plain, bent = np.flatnonzero(~curved), np.flatnonzero(curved)
    pieces = [_split(faces.corners[plain], plain, points)]
    if len(bent):
        corners = faces.corners[bent]
        # The corner replaces a missing node: the edge is straight, and one triangle collapses.
        mids = np.where(faces.mids[bent] == NONE, corners, faces.mids[bent])
        pieces += [
            (np.stack([corners[:, k], mids[:, k], mids[:, k - 1]], axis=1), bent)
            for k in range(corners.shape[1])
        ]
        pieces.append(_split(mids, bent, points))
    triangles, of_face = (np.concatenate(column) for column in zip(*pieces, strict=True))
    a, b, c = triangles.T
    whole = (a != b) & (b != c) & (c != a)
    return triangles[whole], of_face[whole]


def _split(
    polygons: np.ndarray, of_face: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Cut quadrilaterals into triangles along the shorter diagonal; triangles stay as they are.

    Args:
        polygons: corners of the polygons, rows of the points, (k, 3) or (k, 4).
        of_face: face of each polygon, (k,).

    Returns:
        Triangles (t, 3), and the face (t,) of each.
    """
    if polygons.shape[1] == 3:
        return polygons, of_face
    a, b, c, d = (points[polygons[:, k]] for k in range(4))
    short = np.linalg.norm(c - a, axis=1) <= np.linalg.norm(d - b, axis=1)
    first = np.where(short[:, None], polygons[:, [0, 1, 2]], polygons[:, [0, 1, 3]])
    second = np.where(short[:, None], polygons[:, [0, 2, 3]], polygons[:, [1, 2, 3]])
    return np.stack([first, second], axis=1).reshape(-1, 3), np.repeat(of_face, 2)

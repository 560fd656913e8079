"""Finite elements -> triangles: shells become TRI3, solids give their skin, sets become names of triangles.

quad8  3---6---2     corner triangles (0 4 7) (1 5 4) (2 6 5) (3 7 6), then the middle 4 5 6 7 by its
       7       5     shorter diagonal; a mid-edge node that the file leaves out makes the edge straight
       0---4---1
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from chamberopt.geometry.mesh_io.readers.raw_mesh import ElementNumbers, RawMesh

Face = tuple[int, ...]
RING: tuple[Face, ...] = ((0, 1), (1, 2), (2, 3), (3, 0))

# Corner numbers of each face; solids in the order in which Abaqus counts their faces S1, S2 ...
FACES: dict[str, tuple[Face, ...]] = {
    "triangle": ((0, 1, 2),),
    "quad": ((0, 1, 2, 3),),
    "tetra": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "pyramid": ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)),
    "wedge": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "hexahedron": (
        (0, 1, 2, 3),
        (4, 7, 6, 5),
        (0, 4, 5, 1),
        (1, 5, 6, 2),
        (2, 6, 7, 3),
        (3, 7, 4, 0),
    ),
}
# Edges in the order of their mid-edge nodes, which follow the corners (VTK's and Abaqus's order).
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
NONE = -1


@dataclass(frozen=True)
class Block:
    """Elements of one kind: nodes (k, p) rows of the points, corners first, then mid-edge nodes (or NONE).

    More nodes than corners and edges have (face and body centres) are left aside.
    """

    kind: str
    nodes: np.ndarray


@dataclass
class Elements:
    """A finite element mesh. Elements count through all blocks.

    points (n, 3) in the file's numbers · numbers (e,): what the file calls each element, its own number if ``own``,
    else its place · instance: Abaqus's, in which the numbers count · element_sets: name -> elements · face_sets: name
    -> (elements, which face of each) · node_sets: name -> points; a triangle belongs where all of its corners do.
    """

    points: np.ndarray
    blocks: list[Block]
    numbers: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    own: bool = True
    instance: str = ""
    element_sets: dict[str, np.ndarray] = field(default_factory=dict)
    face_sets: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    node_sets: dict[str, np.ndarray] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class _Polygons:
    """Faces with n corners: corners, mids (k, n) points or NONE · owner, side (k,): element, its face · shell (k,)
    the shell element that lies on the face, or NONE.
    """

    corners: np.ndarray
    mids: np.ndarray
    owner: np.ndarray
    side: np.ndarray
    shell: np.ndarray

    def select(self, keep: np.ndarray) -> _Polygons:
        return _Polygons(*(column[keep] for column in vars(self).values()))


def surface_of(mesh: Elements) -> RawMesh:
    """The triangles that bound the elements, in their order, with the sets' names."""
    soup, groups, notes = [], [], list(mesh.notes)
    order, origins = [], []
    for n in (3, 4):
        shells, solids = (
            _polygons(mesh, n, SHELLS),
            _polygons(mesh, n, tuple(set(FACES) - set(SHELLS))),
        )
        if any(block.kind not in SHELLS for block in mesh.blocks):
            faces, inside = _coated(_skin(solids, mesh.points, mesh.blocks), shells)
            if inside:
                notes.append(
                    f"left out {inside} shell elements that are not on the skin of the solid elements"
                )
        else:
            faces = shells
        triangles, of_face = _triangulated(faces, mesh.points)
        order.append(faces.owner[of_face])
        origins.append(np.stack(_origin(mesh, faces), axis=1)[of_face])
        soup.append(mesh.points[triangles])
        groups.append({name: mask[of_face] for name, mask in _named(mesh, faces).items()})
    sequence = np.argsort(np.concatenate(order), kind="stable")
    masks = {name: np.concatenate([part[name] for part in groups])[sequence] for name in groups[0]}
    named = {name: mask for name, mask in masks.items() if mask.any()}
    elements, sides = np.concatenate(origins)[sequence].T
    numbering = ElementNumbers(elements, sides.astype(np.int8), mesh.own, mesh.instance)
    return RawMesh(
        np.concatenate(soup)[sequence].reshape(-1, 3, 3), named, None, tuple(notes), numbering
    )


def _origin(mesh: Elements, faces: _Polygons) -> tuple[np.ndarray, np.ndarray]:
    """Number (k,) of the element that each face is of, and which of a solid's faces it is, from 1; 0: a shell.

    A shell that lies on a solid is what the file's author looks at the surface with: it comes first.
    """
    coated = faces.shell != NONE
    solid = [np.full(len(block.nodes), block.kind not in SHELLS) for block in mesh.blocks]
    of_solid = np.concatenate([np.zeros(0, dtype=bool), *solid])[faces.owner]
    number = mesh.numbers[np.where(coated, faces.shell, faces.owner)]
    return number, np.where(of_solid & ~coated, faces.side + 1, 0)


def _polygons(mesh: Elements, n: int, kinds: tuple[str, ...]) -> _Polygons:
    """All faces with n corners of the elements of some kinds."""
    rows: list[tuple[np.ndarray, ...]] = []
    first = 0
    for block in mesh.blocks:
        number = np.arange(first, first + len(block.nodes))
        first += len(block.nodes)
        for side, face in enumerate(FACES[block.kind]):
            if len(face) == n and block.kind in kinds:
                full = np.full_like(number, side)
                rows.append(
                    (
                        block.nodes[:, face],
                        _mids(block, face),
                        number,
                        full,
                        np.full_like(number, NONE),
                    )
                )
    if not rows:
        return _Polygons(*np.zeros((2, 0, n), dtype=np.int64), *np.zeros((3, 0), dtype=np.int64))
    return _Polygons(*(np.concatenate(column) for column in zip(*rows, strict=True)))


def _mids(block: Block, face: Face) -> np.ndarray:
    """Points (k, n) in the middle of the face's edges; NONE where an element has none."""
    edges = {frozenset(edge): CORNERS[block.kind] + at for at, edge in enumerate(EDGES[block.kind])}
    columns = [edges[frozenset((face[k], face[(k + 1) % len(face)]))] for k in range(len(face))]
    if block.nodes.shape[1] <= max(edges.values()):
        return np.full((len(block.nodes), len(face)), NONE)
    return block.nodes[:, columns]


def _skin(faces: _Polygons, points: np.ndarray, blocks: list[Block]) -> _Polygons:
    """The faces that belong to one solid only, facing away from it."""
    _, same, times = np.unique(
        np.sort(faces.corners, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    faces = faces.select(times[same.reshape(-1)] == 1)
    if not len(faces.corners):
        return faces
    middle = np.concatenate(
        [points[block.nodes[:, : CORNERS[block.kind]]].mean(axis=1) for block in blocks]
    )
    at = points[faces.corners]
    across = np.cross(at[:, 1] - at[:, 0], at[:, -1] - at[:, 0])
    inward = np.einsum("ij,ij->i", across, at.mean(axis=1) - middle[faces.owner]) < 0.0
    corners = np.where(inward[:, None], faces.corners[:, ::-1], faces.corners)
    mids = np.where(inward[:, None], np.roll(faces.mids[:, ::-1], -1, axis=1), faces.mids)
    return _Polygons(corners, mids, faces.owner, faces.side, faces.shell)


def _coated(skin: _Polygons, shells: _Polygons) -> tuple[_Polygons, int]:
    """The skin with the shell elements that lie on it, whose names it takes; and how many shells do not."""
    if not len(shells.corners):
        return skin, 0
    keys = np.sort(np.concatenate([skin.corners, shells.corners]), axis=1)
    _, same = np.unique(keys, axis=0, return_inverse=True)
    on_skin, on_shell = same.reshape(-1)[: len(skin.corners)], same.reshape(-1)[len(skin.corners) :]
    coat = np.full(int(same.max()) + 1, NONE)
    coat[on_shell] = shells.owner
    inside = int((~np.isin(on_shell, on_skin)).sum())
    return _Polygons(skin.corners, skin.mids, skin.owner, skin.side, coat[on_skin]), inside


def _named(mesh: Elements, faces: _Polygons) -> dict[str, np.ndarray]:
    """Name -> which faces (k,) it holds. A name may be that of a node set and of an element set at once."""
    named: dict[str, np.ndarray] = {}

    def add(name: str, mask: np.ndarray) -> None:
        named[name] = named[name] | mask if name in named else mask

    for name, elements in mesh.element_sets.items():
        add(name, np.isin(faces.owner, elements) | np.isin(faces.shell, elements))
    for name, (elements, sides) in mesh.face_sets.items():
        add(name, np.isin(faces.owner * 8 + faces.side, elements * 8 + sides))
    for name, nodes in mesh.node_sets.items():
        inside = np.zeros(len(mesh.points), dtype=bool)
        inside[nodes] = True
        add(name, inside[faces.corners].all(axis=1))
    return named


def _triangulated(faces: _Polygons, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (t, 3) of points, and the face (t,) each one lies in; collapsed ones are left out."""
    n = faces.corners.shape[1]
    curved = (faces.mids != NONE).any(axis=1)
    plain, bent = np.flatnonzero(~curved), np.flatnonzero(curved)
    pieces = [_split(faces.corners[plain], plain, points)]
    if len(bent):
        corners, mids = faces.corners[bent], faces.mids[bent].copy()
        missing = (
            mids == NONE
        )  # the corner itself stands in: the edge is straight, one triangle falls flat
        mids[missing] = corners[missing]
        pieces += [
            (np.stack([corners[:, k], mids[:, k], mids[:, k - 1]], axis=1), bent) for k in range(n)
        ]
        pieces.append(_split(mids, bent, points))
    triangles = np.concatenate([piece for piece, _ in pieces])
    of_face = np.concatenate([face for _, face in pieces])
    a, b, c = triangles.T
    whole = (a != b) & (b != c) & (c != a)
    return triangles[whole], of_face[whole]


def _split(
    polygons: np.ndarray, of_face: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Triangles as they are; quadrilaterals cut along the shorter diagonal."""
    if polygons.shape[1] == 3:
        return polygons, of_face
    a, b, c, d = (points[polygons[:, k]] for k in range(4))
    short = np.linalg.norm(c - a, axis=1) <= np.linalg.norm(d - b, axis=1)
    first = np.where(short[:, None], polygons[:, [0, 1, 2]], polygons[:, [0, 1, 3]])
    second = np.where(short[:, None], polygons[:, [0, 2, 3]], polygons[:, [1, 2, 3]])
    return np.stack([first, second], axis=1).reshape(-1, 3), np.repeat(of_face, 2)

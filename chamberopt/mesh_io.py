"""Reads a part's mesh, puts right what needs no guessing, says what it did, refuses the rest by name.

The user's triangles stay the user's: same order, same corners, so that coverage can be read on the mesh
that was given.
"""

from __future__ import annotations

import hashlib
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from chamberopt.design import METRES_PER
from chamberopt.errors import InputError
from chamberopt.triangles import shells_of, winding_number

FORMATS = (".stl", ".obj", ".ply", ".3mf")
SMALLEST, LARGEST = 5e-4, 3.0  # m, longest side of the bounding box: a part that can be peened in a chamber
WELD = 1e-6  # of the bounding box's diagonal: what a text format with 6 digits rounds away


@dataclass(frozen=True)
class PartMesh:
    """A closed part in its file's own frame.

    vertices (n, 3) float64 m · triangles (m, 3) int32, normals outward, in the file's order · notes: what was
    changed · sha256 of the file as read.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    notes: tuple[str, ...]
    sha256: str

    @property
    def size(self) -> np.ndarray:
        """Sides (3,) of the bounding box [m]."""
        return np.ptp(self.vertices, axis=0)


def read_part(path: Path, unit: str) -> PartMesh:
    """The part in a mesh file whose numbers are in `unit` (um, mm, cm, m, in): closed, outward, in metres.

    Raises InputError, with reason and place, for what is missing, empty, truncated, not finite, open, non-
    manifold or of a size that no part has.
    """
    content = _content(path)
    corners = _corners(path, content)
    if not len(corners):
        raise InputError(f"{path}: holds no triangles; export a surface mesh")
    bad = np.flatnonzero(~np.isfinite(corners).all(axis=(1, 2)))
    if len(bad):
        raise InputError(
            f"{path}: {len(bad)} triangles have a corner that is not a number, the first is triangle "
            f"{bad[0] + 1} of {len(corners)}; export the mesh again"
        )
    corners = corners * METRES_PER[unit] + 0.0  # + 0.0: -0 and 0 are one place
    _refuse_implausible(path, corners, unit)
    vertices, triangles, notes = _sewn(path, corners)
    triangles, flipped = _outward(path, vertices, triangles)
    digest = hashlib.sha256(content).hexdigest()
    return PartMesh(vertices, triangles.astype(np.int32), (*notes, *flipped), digest)


def box_text(sides: np.ndarray) -> str:
    """A bounding box's sides (3,) [m] as text: '44 x 44 x 70 mm'."""
    return " x ".join(f"{1e3 * side:.5g}" for side in sides) + " mm"


def place_text(point: np.ndarray) -> str:
    """A position (3,) [m] as text: '(1, 2, 3) mm'."""
    return "(" + ", ".join(f"{1e3 * value + 0.0:.5g}" for value in point) + ") mm"


def _content(path: Path) -> bytes:
    """The file's bytes, where there is a file of a known kind that can be read and is not empty."""
    suffix = path.suffix.lower()
    if path.is_dir():
        raise InputError(f"{path}: is a folder; give a mesh file")
    if not path.is_file():
        raise InputError(f"{path}: no such mesh file; check part.mesh, which counts from the design file's folder")
    if suffix not in FORMATS:
        raise InputError(f"{path}: {suffix or 'a file without ending'} is not supported yet; use {', '.join(FORMATS)}")
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}; check its permissions") from None
    if not content.strip():
        raise InputError(f"{path}: the file is empty; export the mesh again")
    return content


def _corners(path: Path, content: bytes) -> np.ndarray:
    """Corners (m, 3, 3) of the triangles in the file's bytes, in the file's numbers and order."""
    suffix = path.suffix.lower()
    if suffix == ".stl":
        content = _whole_stl(path, content)

    import trimesh

    if suffix == ".3mf" and "3mf" not in trimesh.available_formats():
        raise InputError(f"{path}: reading 3MF needs the package lxml: pip install lxml, or export as STL")
    options: dict[str, Any] = {"split_objects": False, "group_material": False, "skip_materials": True}
    try:
        scene = trimesh.load_scene(
            io.BytesIO(content), file_type=suffix[1:], process=False, **(options if suffix == ".obj" else {})
        )
        meshes = [mesh for mesh in scene.dump() if isinstance(mesh, trimesh.Trimesh)]
        soups = [np.asarray(mesh.vertices, dtype=np.float64)[mesh.faces] for mesh in meshes if len(mesh.faces)]
    except MemoryError:
        raise
    except Exception as error:  # each of trimesh's readers fails in its own way on a damaged file
        reason = str(error).strip().splitlines()[0][:120] if str(error).strip() else type(error).__name__
        raise InputError(
            f"{path}: cannot be read as {suffix[1:].upper()}, it is damaged or truncated ({reason}); export it again"
        ) from None
    return np.concatenate(soups) if soups else np.zeros((0, 3, 3))


def _whole_stl(path: Path, content: bytes) -> bytes:
    """The STL without what some exporters put behind it. InputError when it is truncated.

    A binary STL says how many triangles it holds, a text one ends with endsolid.
    """
    is_text = content.lstrip()[:5].lower() == b"solid" and b"facet" in content[:2000].lower()
    if is_text:
        if not content.rstrip().splitlines()[-1].strip().lower().startswith(b"endsolid"):
            raise InputError(f"{path}: truncated, the last line is not 'endsolid'; export or copy it again")
        return content
    declared = int.from_bytes(content[80:84], "little")
    if len(content) < 84 or len(content) < 84 + 50 * declared:
        held = max(0, (len(content) - 84) // 50)
        told = f"it says {declared} triangles and holds {held}" if len(content) >= 84 else "shorter than its header"
        raise InputError(f"{path}: truncated or not an STL: {told}; export or copy it again")
    return content[: 84 + 50 * declared]


def _refuse_implausible(path: Path, corners: np.ndarray, unit: str) -> None:
    sides = np.ptp(corners.reshape(-1, 3), axis=0)
    longest = float(sides.max())
    if SMALLEST <= longest <= LARGEST:
        return
    fitting = [u for u, m in METRES_PER.items() if SMALLEST <= longest / METRES_PER[unit] * m <= LARGEST]
    hint = f"; unit = {' or '.join(repr(u) for u in fitting)} would be plausible" if fitting else ""
    raise InputError(
        f"{path}: with part.unit = {unit!r} the part measures {box_text(sides)}; allowed: longest side "
        f"{1e3 * SMALLEST:g} to {1e3 * LARGEST:g} mm{hint}"
    )


def _sewn(path: Path, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Vertices (n, 3), triangles (m, 3) and notes from corners (m, 3, 3) [m]; each edge has two triangles."""
    points, numbers = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    points, triangles, notes = _without_repeats(points, numbers.reshape(-1, 3))
    open_edges = _edges(triangles, count=1)
    if len(open_edges):  # perhaps only the file's rounding keeps the edges apart
        reach = WELD * float(np.linalg.norm(np.ptp(points, axis=0)))
        closer, renumbered = _welded(points, reach)
        points2, triangles2, notes2 = _without_repeats(closer, renumbered[triangles])
        if not len(_edges(triangles2, count=1)):
            merged = len(points) - len(points2)
            notes += [f"merged {merged} vertices less than {1e3 * reach:.2g} mm apart", *notes2]
            points, triangles, open_edges = points2, triangles2, np.zeros((0, 2), int)
    if len(open_edges):
        holes = _loops(open_edges)
        a, b = points[open_edges[0]]
        where = f"{len(open_edges)} open edges in {holes} hole{'s' * (holes > 1)}"
        raise InputError(
            f"{path}: the surface is not closed: {where}, the first from {place_text(a)} to {place_text(b)}; "
            "close it in the CAD program"
        )
    crowded = _edges(triangles, count=3)
    if len(crowded):
        a, b = points[crowded[0]]
        raise InputError(
            f"{path}: not manifold: {len(crowded)} edges belong to more than two triangles, the first from "
            f"{place_text(a)} to {place_text(b)}; make the bodies overlap or leave a gap there"
        )
    return points, triangles, notes


def _without_repeats(points: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Drops triangles with two corners in one place, and second copies of a triangle; keeps the order."""
    notes = []
    a, b, c = triangles.T
    flat = (a == b) | (b == c) | (c == a)
    if flat.any():
        notes.append(f"dropped {flat.sum()} triangles without area, the first is triangle {flat.argmax() + 1}")
        triangles = triangles[~flat]
    turned = np.take_along_axis(triangles, (triangles.argmin(axis=1)[:, None] + np.arange(3)) % 3, axis=1)
    first = np.sort(np.unique(turned, axis=0, return_index=True)[1])
    if len(first) < len(triangles):
        notes.append(f"dropped {len(triangles) - len(first)} triangles that were there twice")
        triangles = triangles[first]
    used, renumbered = np.unique(triangles, return_inverse=True)
    return points[used], renumbered.reshape(-1, 3), notes


def _welded(points: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Points with those within reach [m] of each other made one, and the new number of each old point."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    pairs = cKDTree(points).query_pairs(reach, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(points), len(points)))
    _, group = connected_components(graph, directed=False)
    _, first, renumbered = np.unique(group, return_index=True, return_inverse=True)
    return points[first], renumbered.reshape(-1)


def _edges(triangles: np.ndarray, count: int) -> np.ndarray:
    """Edges (k, 2) that belong to one triangle (count=1), or to three and more (count=3)."""
    edges, times = np.unique(_undirected(triangles), axis=0, return_counts=True)
    return edges[times == 1] if count == 1 else edges[times >= count]


def _undirected(triangles: np.ndarray) -> np.ndarray:
    return np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)


def _loops(edges: np.ndarray) -> int:
    """Number of connected pieces that open edges (k, 2) form."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    used, numbers = np.unique(edges, return_inverse=True)
    a, b = numbers.reshape(-1, 2).T
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(len(used), len(used)))
    return int(connected_components(graph, directed=False)[0])


def _outward(path: Path, vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Triangles turned so that neighbours agree and every body encloses a positive volume."""
    notes = []
    directed = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    if len(np.unique(directed, axis=0)) < len(directed):
        import trimesh

        mesh = trimesh.Trimesh(vertices, triangles, process=False)
        trimesh.repair.fix_winding(mesh)
        fixed = np.asarray(mesh.faces)
        directed = fixed[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        if len(np.unique(directed, axis=0)) < len(directed):
            raise InputError(f"{path}: the surface has no inside (one-sided, like a Moebius band); redraw it")
        turned = int((fixed != triangles).any(axis=1).sum())
        notes.append(f"turned {turned} triangles that faced against their neighbours")
        triangles = fixed
    shells, volumes = shells_of(vertices, triangles)
    for k in np.flatnonzero(volumes < 0.0):
        if _stands_in_another(vertices, triangles, shells, k):
            continue  # the wall of a void
        triangles = np.where((shells == k)[:, None], triangles[:, ::-1], triangles)
        which = "it was" if len(volumes) == 1 else f"body {k + 1} of {len(volumes)} was"
        notes.append(f"{which} inside out: turned its normals outward")
    if (volumes == 0.0).any():
        raise InputError(f"{path}: a closed piece of the surface encloses no volume; remove it")
    return triangles, notes


def _stands_in_another(vertices: np.ndarray, triangles: np.ndarray, shells: np.ndarray, k: np.integer) -> bool:
    """Is closed piece k inside another closed piece (whichever way that one faces)?"""
    points = vertices[triangles[shells == k]].mean(axis=1)
    points = points[:: max(1, len(points) // 8)]
    others = (other for other in range(int(shells.max()) + 1) if other != k)
    return any(abs(np.median(winding_number(points, vertices[triangles[shells == other]]))) > 0.5 for other in others)

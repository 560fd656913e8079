"""Read a part from a mesh file: one closed surface in metres with outward normals.

A file passes through these steps:
    formats: recognise the format and read its triangles;
    units: convert to metres;
    healing: make one closed surface of the triangles;
    self_intersection: refuse a surface that crosses itself.

Faults that can be repaired without a guess are repaired, with a note for the user. Other faults are
refused, with the reason and the position. The triangles keep their order and their corners, so that
results can be given on the user's mesh.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from chamberopt.common import toml_errors
from chamberopt.common.errors import InputError
from chamberopt.common.limits import MAX_MESH_BYTES, read_limited, require_few
from chamberopt.geometry.faces import Faces
from chamberopt.geometry.meshes.formats import read_raw_mesh
from chamberopt.geometry.meshes.healing import sew_bodies, turn_outward
from chamberopt.geometry.meshes.raw_mesh import ElementNumbers, number_by_position
from chamberopt.geometry.meshes.self_intersection import refuse_self_intersection
from chamberopt.geometry.meshes.step_tessellation import Tessellation
from chamberopt.geometry.meshes.surface_error import SurfaceError
from chamberopt.geometry.meshes.units import METRES_PER, find_unit
from chamberopt.geometry.triangles import facet_normals

MOST_KEPT = 8  # parts that read_part_cached keeps
MEANT = 0.5  # cosine between a facet and a stated normal, below which the normal is wrong


@dataclass(frozen=True, eq=False)  # a mesh that was read once is recognised by its identity
class PartMesh:
    """Closed surface of a part, in metres along the axes of its file."""

    vertices: np.ndarray  # (n, 3) float64 [m]
    triangles: np.ndarray  # (m, 3) int32, in the file's order; normals point outward
    numbering: ElementNumbers  # the file's element of each triangle
    notes: tuple[str, ...]  # one sentence for each change
    sha256: str  # digest of the file as read
    # triangles of each group by name, (m,) bool
    groups: dict[str, np.ndarray] = field(default_factory=dict)
    unit: str = "m"  # unit of the file's numbers
    # surface normals at the corners, (m, 3, 3), if the file states them
    normals: np.ndarray | None = None
    is_exact: bool = False  # True if the triangles were made from the exact surface, as for STEP

    @property
    def elements(self) -> np.ndarray:
        """Number of each triangle's element in the file, (m,) int64; 0 for an added triangle."""
        return self.numbering.elements

    @property
    def size(self) -> np.ndarray:
        """Sides (3,) of the part's bounding box [m]."""
        return np.asarray(np.ptp(self.vertices, axis=0))

    def faces(self, crease_deg: float | None) -> Faces:
        """Return the part's faces, which end where the surface turns by an angle [degrees].

        An angle cuts no face of a CAD file, whose triangles turn by much where it bends tightly.
        For None they are the faces of the CAD file. Raises InputError if the file has none.
        """
        cad_face = self.numbering.cad_face
        border = cad_face if crease_deg is None else crease_deg
        if border is None:
            text = "the part's file has no faces of its own, as STEP has; leave cad_face out"
            raise InputError(text)
        return Faces(self.vertices, self.triangles, border, cad_face)

    def divided(self, vertices: np.ndarray, triangles: np.ndarray, origin: np.ndarray) -> PartMesh:
        """Return the part in other triangles, with the numbers and groups of its own.

        Args:
            vertices, triangles: the other triangles, (k, 3), and their vertices [m].
            origin: the triangle of this mesh under each of them, (k,).
        """
        return replace(
            self,
            vertices=vertices,
            triangles=triangles.astype(np.int32),
            numbering=self.numbering.select(origin),
            groups={name: mask[origin] for name, mask in self.groups.items()},
            normals=None,
        )


@dataclass(frozen=True)
class TriangleSoup:
    """Loose triangles of a file in metres, before they become a closed surface."""

    path: Path
    corners: np.ndarray  # (m, 3, 3) [m], in the coordinates of the file
    numbering: ElementNumbers
    groups: dict[str, np.ndarray]
    notes: tuple[str, ...]
    sha256: str
    unit: str
    bodies: np.ndarray  # (m,), body of each triangle; 0 if the file does not tell bodies apart
    normals: np.ndarray | None = None  # as in PartMesh
    is_exact: bool = False


def read_part(path: Path, unit: str = "guess", how: Tessellation | None = None) -> PartMesh:
    """Read a part from a mesh file, as one closed surface in metres.

    Args:
        unit: unit of the file's numbers: um, mm, cm, m, in, or "guess" if it is not known.
        how: fineness of the triangles of a STEP file.

    Raises:
        InputError: for a file that is missing, empty, truncated or not finite, for a surface that
            is open, not manifold or crosses itself, and for a size that no part has.
    """
    soup = read_triangles(path, unit, how)
    try:
        return close_surface(soup)
    except SurfaceError as error:
        if how is not None:
            error.args = (f"{error}; or make part.tessellation finer",)
        raise


def read_part_cached(path: Path, unit: str = "guess", how: Tessellation | None = None) -> PartMesh:
    """Return a part from a mesh file, read only if the file has changed since the last call.

    A study builds many chambers with the same part.

    Args:
        unit: unit of the file's numbers: um, mm, cm, m, in, or "guess" if it is not known.
        how: fineness of the triangles of a STEP file.

    Raises:
        InputError: for a file that cannot be used, and for a surface that is not closed.
    """
    try:
        key = _key(path, unit, how)
    except OSError:
        return read_part(path, unit, how)  # this raises an error that explains the reason
    mesh = _kept.get(key)
    if mesh is None:
        mesh = read_part(path, unit, how)
        _keep(key, mesh)
    return mesh


def keep_part(mesh: PartMesh, path: Path, unit: str, how: Tessellation | None = None) -> None:
    """Make later calls of `read_part_cached` return a part that was read elsewhere.

    Another process may have read it, or this one without a unit where the file states this one.
    """
    with suppress(OSError):  # the file is gone: the next reader says so
        _keep(_key(path, unit, how), mesh)


_Key = tuple[Path, str, Tessellation | None, int, int]
_kept: dict[_Key, PartMesh] = {}


def _key(path: Path, unit: str, how: Tessellation | None) -> _Key:
    """Return what a part is kept by. Raises OSError for a file that is not there."""
    stamp = path.stat()
    return path.resolve(), unit, how, stamp.st_mtime_ns, stamp.st_size


def _keep(key: _Key, mesh: PartMesh) -> None:
    """Keep a part; the oldest of more than MOST_KEPT is dropped."""
    _kept[key] = mesh
    for old in list(_kept)[:-MOST_KEPT]:
        _kept.pop(old, None)  # another thread may have dropped it


def read_triangles(
    path: Path, unit: str = "guess", how: Tessellation | None = None
) -> TriangleSoup:
    """Read the triangles of a mesh file in metres, without making a closed surface of them.

    Args:
        unit: unit of the file's numbers: um, mm, cm, m, in, or "guess" if it is not known.
        how: fineness of the triangles of a STEP file.

    Raises:
        InputError: for a file that is missing, empty, truncated or not finite, and for a size that
            no part has.
    """
    return triangles_in(path, _read_content(path), unit, how)


def triangles_in(
    path: Path, content: bytes, unit: str = "guess", how: Tessellation | None = None
) -> TriangleSoup:
    """Read the triangles in the content of a mesh file, as `read_triangles` does.

    Args:
        path: path of the file, for messages. The file need not be there yet.
    """
    raw = read_raw_mesh(path, content, how)
    corners = raw.corners
    if not len(corners):
        raise InputError(f"{path}: holds no triangles; export a surface mesh")
    require_few(path, len(corners), "triangles")
    bad = np.flatnonzero(~np.isfinite(corners).all(axis=(1, 2)))
    if len(bad):
        raise InputError(
            f"{path}: {len(bad)} triangles have a corner that is not a number, "
            f"the first is triangle {bad[0] + 1} of {len(corners)}; export the mesh again"
        )
    unit, unit_notes = find_unit(path, content, corners, unit, raw.unit)
    corners = corners * METRES_PER[unit] + 0.0  # + 0.0 turns -0 into 0, so that both are one place
    numbering, notes = raw.numbering or number_by_position(len(corners)), (*raw.notes, *unit_notes)
    sha256 = hashlib.sha256(content).hexdigest()
    bodies = np.zeros(len(corners), dtype=np.int64) if raw.bodies is None else raw.bodies
    return TriangleSoup(
        path, corners, numbering, raw.groups, notes, sha256, unit, bodies, raw.normals, raw.is_exact
    )


def close_surface(soup: TriangleSoup, only: np.ndarray | None = None) -> PartMesh:
    """Make one closed surface of all triangles, or of the triangles marked by `only` (m,).

    Raises:
        SurfaceError: if the surface is open, not manifold or crosses itself; it says where.
    """
    path = soup.path
    chosen = np.arange(len(soup.corners)) if only is None else np.flatnonzero(only)
    vertices, triangles, source, healed = sew_bodies(
        path, soup.corners[chosen], soup.bodies[chosen]
    )
    triangles, turned = turn_outward(path, vertices, triangles)
    refuse_self_intersection(path, vertices, triangles)
    given = np.where(source >= 0, chosen[source], -1)  # -1: the triangle closes a hole
    return PartMesh(
        vertices,
        triangles.astype(np.int32),
        soup.numbering.select(given),
        tuple(f"{path.name}: {note}" for note in (*soup.notes, *healed, *turned)),
        soup.sha256,
        {name: (given >= 0) & mask[given] for name, mask in soup.groups.items()},
        soup.unit,
        _normals_at(soup, vertices[triangles], given),
        soup.is_exact,
    )


def _normals_at(soup: TriangleSoup, corners: np.ndarray, given: np.ndarray) -> np.ndarray | None:
    """Return the normals at the corners (k, 3, 3) of triangles, as the file states them.

    A corner without a plausible normal in the file has the normal of its triangle. The result is
    None if the file states no normals.

    Args:
        given: the file's triangle from which each triangle comes, -1 for a new triangle, (k,).
    """
    if soup.normals is None:
        return None
    own = facet_normals(corners)
    normals = own.copy()
    for k in range(3):  # triangles may have been turned over, but their corners stay in place
        for corner in range(3):
            same = (given >= 0) & (soup.corners[given, corner] == corners[:, k]).all(axis=1)
            normals[same, k] = soup.normals[given[same], corner]
    normals *= np.sign(np.einsum("kci,kci->kc", normals, own))[..., None]
    meant = np.einsum("kci,kci->kc", normals, own) > MEANT
    return np.where(meant[..., None], normals, own)


def select_triangles(
    groups: Mapping[str, np.ndarray], names: Iterable[str], count: int, field: str
) -> np.ndarray:
    """Return marks (count,) of the triangles in the named groups. "all" means every triangle.

    Upper and lower case count as equal, unless two names of the file differ in nothing else.

    Raises:
        InputError: for a name without a group in the file; the message begins with `field`, the
            name of the design's key.
    """
    by_lower = {name.lower(): name for name in groups}
    chosen = np.zeros(count, dtype=bool)
    for name in names:
        known = name if name in groups else by_lower.get(name.lower())
        if name == "all" and known is None:
            chosen[:] = True
        elif known is None:
            hint = "its file names none: 'all'"
            if groups:
                hint = toml_errors.did_you_mean(name, ["all", *groups])
            raise InputError(f"{field}: {name!r} is not a name in the part's file; {hint}")
        else:
            chosen |= groups[known]
    return chosen


def _read_content(path: Path) -> bytes:
    """Return the content of a mesh file.

    Raises InputError if the file is missing, a folder, empty or too large.
    """
    if path.is_dir():
        raise InputError(f"{path}: is a folder; give a mesh file")
    try:
        content = read_limited(path, MAX_MESH_BYTES, "mesh file", follow=True)
    except FileNotFoundError:
        remedy = "check part.mesh, which is relative to the design file's folder"
        raise InputError(f"{path}: no such mesh file; {remedy}") from None
    if not content.strip():
        raise InputError(f"{path}: the file is empty; export the mesh again")
    return content

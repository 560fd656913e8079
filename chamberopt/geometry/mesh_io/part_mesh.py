"""Reads a part's mesh, puts right what needs no guessing, says what it did, refuses the rest by name and place.

The user's triangles stay the user's: same order, same corners, so that coverage can be read on the mesh that
was given. A file goes through `formats` (which reader), `units`, `healing` (one closed surface, outward),
`holes` and `crossings`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np

from chamberopt.common import toml_errors
from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io.formats import read_raw
from chamberopt.geometry.mesh_io.healing import outward, sewn
from chamberopt.geometry.mesh_io.readers.raw_mesh import ElementNumbers, number_by_position
from chamberopt.geometry.mesh_io.self_intersection import refuse_self_intersection
from chamberopt.geometry.mesh_io.units import METRES_PER, unit_of


@dataclass(frozen=True)
class PartMesh:
    """A closed part in its file's own frame.

    vertices (n, 3) float64 m · triangles (m, 3) int32, normals outward, in the file's order · numbering: which of its
    elements each one is of · notes: what was changed · sha256 of the file as read · groups: name -> (m,) bool, what
    the file calls some of its triangles · unit that the file's numbers were taken in.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    numbering: ElementNumbers
    notes: tuple[str, ...]
    sha256: str
    groups: dict[str, np.ndarray] = field(default_factory=dict)
    unit: str = "m"

    @property
    def elements(self) -> np.ndarray:
        """The number (m,) int64 of the element that each triangle is of; 0: of none in the file."""
        return self.numbering.elements

    @property
    def size(self) -> np.ndarray:
        """Sides (3,) of the bounding box [m]."""
        return np.ptp(self.vertices, axis=0)


@dataclass(frozen=True)
class TriangleSoup:
    """What a file holds, in metres and its own frame, before it is made one closed surface.

    path · corners (m, 3, 3) · numbering of its elements · groups: name -> (m,) bool · notes · sha256 of the file ·
    unit of its numbers.
    """

    path: Path
    corners: np.ndarray
    numbering: ElementNumbers
    groups: dict[str, np.ndarray]
    notes: tuple[str, ...]
    sha256: str
    unit: str


def read_part(path: Path, unit: str = "guess") -> PartMesh:
    """The part in a mesh file whose numbers are in `unit` (um, mm, cm, m, in; or guess): closed, outward, in metres.

    Raises InputError, with reason and place, for what is missing, empty, truncated, not finite, open, non-
    manifold, crossing itself, or of a size that no part has.
    """
    return close_surface(read_triangles(path, unit))


def read_triangles(path: Path, unit: str = "guess") -> TriangleSoup:
    """The triangles in a mesh file. Raises InputError as read_part does, but not for what they make together."""
    content = _content(path)
    raw = read_raw(path, content)
    corners = raw.corners
    if not len(corners):
        raise InputError(f"{path}: holds no triangles; export a surface mesh")
    bad = np.flatnonzero(~np.isfinite(corners).all(axis=(1, 2)))
    if len(bad):
        raise InputError(
            f"{path}: {len(bad)} triangles have a corner that is not a number, the first is triangle "
            f"{bad[0] + 1} of {len(corners)}; export the mesh again"
        )
    unit, told = unit_of(path, content, corners, unit, raw.unit)
    corners = corners * METRES_PER[unit] + 0.0  # + 0.0: -0 and 0 are one place
    digest = hashlib.sha256(content).hexdigest()
    numbering = raw.numbering or number_by_position(len(corners))
    return TriangleSoup(path, corners, numbering, raw.groups, (*raw.notes, *told), digest, unit)


def close_surface(read: TriangleSoup, only: np.ndarray | None = None) -> PartMesh:
    """One closed surface of all the triangles, or of those marked ``only`` (m,); its healing goes into the notes.

    Raises SurfaceError, with the place, where it is open, non-manifold or crosses itself.
    """
    path, chosen = read.path, np.arange(len(read.corners)) if only is None else np.flatnonzero(only)
    vertices, triangles, source, healed = sewn(path, read.corners[chosen])
    triangles, turned = outward(path, vertices, triangles)
    refuse_self_intersection(path, vertices, triangles)
    groups = {
        name: np.where(source >= 0, mask[chosen][source], False)
        for name, mask in read.groups.items()
    }
    notes = tuple(f"{path.name}: {note}" for note in (*read.notes, *healed, *turned))
    numbering = read.numbering.of(np.where(source >= 0, chosen[source], -1))
    return PartMesh(
        vertices, triangles.astype(np.int32), numbering, notes, read.sha256, groups, read.unit
    )


def read_part_cached(path: Path, unit: str = "guess") -> PartMesh:
    """As read_part, each file once as long as it does not change: a study builds a hundred chambers from it."""
    try:
        stamp = path.stat()
    except OSError:
        return read_part(path, unit)  # says what is wrong
    return _read_once(path, unit, stamp.st_mtime_ns, stamp.st_size)


@lru_cache(maxsize=8)
def _read_once(path: Path, unit: str, _changed: int, _size: int) -> PartMesh:
    return read_part(path, unit)


def _content(path: Path) -> bytes:
    """The file's bytes, where there is a file that can be read and is not empty."""
    if path.is_dir():
        raise InputError(f"{path}: is a folder; give a mesh file")
    if not path.is_file():
        raise InputError(
            f"{path}: no such mesh file; check part.mesh, which counts from the design file's folder"
        )
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read: {error.strerror}; check its permissions"
        ) from None
    if not content.strip():
        raise InputError(f"{path}: the file is empty; export the mesh again")
    return content


def select_triangles(
    groups: Mapping[str, np.ndarray], names: Iterable[str], count: int, field: str
) -> np.ndarray:
    """Which of ``count`` triangles have one of the names, (count,) bool; case counts only where the file needs it to.

    "all" are all. Raises InputError, naming the design's field, for a name that the file does not have.
    """
    by_lower = {name.lower(): name for name in groups}
    chosen = np.zeros(count, dtype=bool)
    for name in names:
        known = name if name in groups else by_lower.get(name.lower())
        if name == "all" and known is None:
            chosen[:] = True
        elif known is None:
            told = (
                toml_errors.did_you_mean(name, ["all", *groups])
                if groups
                else "its file names none: 'all'"
            )
            raise InputError(f"{field}: {name!r} is no name in the part's file; {told}")
        else:
            chosen |= groups[known]
    return chosen

"""Reads a part's mesh, puts right what needs no guessing, says what it did, refuses the rest by name and place.

The user's triangles stay the user's: same order, same corners, so that coverage can be read on the mesh that
was given. A file goes through `formats` (which reader), `units`, `healing` (one closed surface, outward),
`holes` and `crossings`.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from chamberopt.errors import InputError
from chamberopt.fields import METRES_PER
from chamberopt.mesh_io.crossings import refuse_crossings
from chamberopt.mesh_io.faults import SurfaceError, box_text, place_text
from chamberopt.mesh_io.formats import FORMATS, read_raw
from chamberopt.mesh_io.healing import outward, sewn
from chamberopt.mesh_io.units import unit_of

__all__ = ["FORMATS", "PartMesh", "SurfaceError", "box_text", "place_text", "read_part"]


@dataclass(frozen=True)
class PartMesh:
    """A closed part in its file's own frame.

    vertices (n, 3) float64 m · triangles (m, 3) int32, normals outward, in the file's order · notes: what was
    changed · sha256 of the file as read · groups: name -> (m,) bool, what the file calls some of its triangles
    · unit that the file's numbers were taken in.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    notes: tuple[str, ...]
    sha256: str
    groups: dict[str, np.ndarray] = field(default_factory=dict)
    unit: str = "m"

    @property
    def size(self) -> np.ndarray:
        """Sides (3,) of the bounding box [m]."""
        return np.ptp(self.vertices, axis=0)


def read_part(path: Path, unit: str = "guess") -> PartMesh:
    """The part in a mesh file whose numbers are in `unit` (um, mm, cm, m, in; or guess): closed, outward, in metres.

    Raises InputError, with reason and place, for what is missing, empty, truncated, not finite, open, non-
    manifold, crossing itself, or of a size that no part has.
    """
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
    vertices, triangles, source, healed = sewn(path, corners)
    triangles, turned = outward(path, vertices, triangles)
    refuse_crossings(path, vertices, triangles)
    groups = {name: np.where(source >= 0, mask[source], False) for name, mask in raw.groups.items()}
    notes = tuple(f"{path.name}: {note}" for note in (*raw.notes, *told, *healed, *turned))
    digest = hashlib.sha256(content).hexdigest()
    return PartMesh(vertices, triangles.astype(np.int32), notes, digest, groups, unit)


def _content(path: Path) -> bytes:
    """The file's bytes, where there is a file that can be read and is not empty."""
    if path.is_dir():
        raise InputError(f"{path}: is a folder; give a mesh file")
    if not path.is_file():
        raise InputError(f"{path}: no such mesh file; check part.mesh, which counts from the design file's folder")
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}; check its permissions") from None
    if not content.strip():
        raise InputError(f"{path}: the file is empty; export the mesh again")
    return content

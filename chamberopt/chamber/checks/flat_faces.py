"""Find the largest flat face of a part, by which a fitter sees how it is turned in its chamber."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from chamberopt.chamber.part import Part
from chamberopt.geometry.triangles import area_vectors, unit_vectors

# Of triangles in one plane: steps of their unit normals and of their distances from the origin [m].
TURN, OFF = 2e-3, 2e-5
LEAST = 0.03  # share of the part's surface, below which a face is none to tell it by
AS_LARGE = 0.99  # share of the largest area, from which on another face counts as large


class FlatFace(NamedTuple):
    """The largest flat face of a part in its chamber, or that of several that looks down most."""

    area: float  # [m²]
    normal: tuple[float, float, float]  # unit vector out of the part, in the chamber's frame
    off: float  # of its plane from the middle of the sonotrode's face, along the normal [m]
    is_alone: bool  # no other flat face is as large


def largest_flat_face(part: Part) -> FlatFace | None:
    """Return the largest flat face of a part, or None if none is large."""
    vectors = area_vectors(part.vertices, part.triangles)
    areas, normals = np.linalg.norm(vectors, axis=1), unit_vectors(vectors)
    off = np.einsum("ij,ij->i", normals, part.vertices[part.triangles[:, 0]])
    keys = np.round(np.c_[normals / TURN, off / OFF]).astype(np.int64)
    _, first, plane = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    of_plane = np.bincount(plane.reshape(-1), areas)
    if of_plane.max() < LEAST * areas.sum():
        return None
    large = np.flatnonzero(of_plane >= AS_LARGE * of_plane.max())
    lowest = large[normals[first[large], 2].argmin()]
    row = first[lowest]
    x, y, z = normals[row].tolist()
    return FlatFace(float(of_plane[lowest]), (x, y, z), float(off[row]), len(large) == 1)

"""Which element of its file each triangle comes from, so that results can go back in the file's own numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Numbering:
    """The origin of each of m triangles.

    elements (m,) int64: the number that the file gives the element, shared by the triangles of a quadrilateral; where
    the file numbers none (``own`` false) the place, from 1, of the triangle in it (OBJ: of the polygon, VTK: of the
    cell); 0 is not in the file: it closes a hole · faces (m,) int8: which face of a solid element, from 1 as Abaqus
    counts its S1, S2 ...; 0 is a shell · instance: Abaqus's instance that the numbers count in, "" without.
    """

    elements: np.ndarray
    faces: np.ndarray
    own: bool = False
    instance: str = ""

    def of(self, rows: np.ndarray) -> Numbering:
        """That of some of the triangles, in the order of rows: indices, -1 for one that is new, or a mask."""
        if rows.dtype == bool:
            rows = np.flatnonzero(rows)
        elements, faces = (
            np.where(rows >= 0, column[rows], 0) for column in (self.elements, self.faces)
        )
        return replace(self, elements=elements, faces=faces)


def by_place(count: int) -> Numbering:
    """That of a file which numbers nothing: its triangles from 1 on."""
    return Numbering(np.arange(1, count + 1), np.zeros(count, dtype=np.int8))

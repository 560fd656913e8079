"""What a reader hands on: triangles as the file says them, and the names it gives them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from chamberopt.geometry.mesh_io.readers.element_numbers import Numbering


@dataclass(frozen=True)
class RawMesh:
    """The triangles of a file, before anything is judged or put right.

    corners (m, 3, 3) in the file's numbers and order · groups: name -> (m,) bool, the file's sets, groups,
    properties, colours · unit: what the file states its numbers are in, None where it does not · notes: what
    was left out or turned into triangles · numbering of its elements, None where triangles are all it has.
    """

    corners: np.ndarray
    groups: dict[str, np.ndarray] = field(default_factory=dict)
    unit: str | None = None
    notes: tuple[str, ...] = ()
    numbering: Numbering | None = None


def joined(pieces: list[tuple[str, np.ndarray]]) -> RawMesh:
    """One mesh of named pieces (name, corners (k, 3, 3)); pieces of one name make one group, "" makes none."""
    pieces = [(name, corners) for name, corners in pieces if len(corners)]
    if not pieces:
        return RawMesh(np.zeros((0, 3, 3)))
    piece_of = np.repeat(np.arange(len(pieces)), [len(corners) for _, corners in pieces])
    groups: dict[str, np.ndarray] = {}
    for index, (name, _) in enumerate(pieces):
        if name:
            groups[name] = groups.get(name, False) | (piece_of == index)
    return RawMesh(np.concatenate([corners for _, corners in pieces]), groups)

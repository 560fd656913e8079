"""Convert exported positions and directions to the frame of the part's file or of the chamber."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.export.formats import FrameName
from chamberopt.geometry.meshes.units import METRES_PER

if TYPE_CHECKING:
    from chamberopt.chamber.part import Part

MEANING = {
    "part": "of the part's file: its axes, its origin, its unit",
    "chamber": "of the chamber: z up, the sonotrode's mean face at z = 0, "
    "the chamber's axis at x = y = 0",
}


@dataclass(frozen=True)
class Frame:
    """A frame of exported positions and directions, and its pose in the chamber's frame.

    Args:
        name: "part", the frame of the part's file, or "chamber".
        unit: unit of lengths.
        rotation: matrix that turns vectors of this frame to the chamber's frame, shape (3, 3).
        shift: shift to the chamber's frame after the rotation [m], shape (3,).
    """

    name: FrameName
    unit: str
    rotation: np.ndarray
    shift: np.ndarray

    def positions(self, metres: np.ndarray) -> np.ndarray:
        """Convert positions in the chamber's frame [m], shape (n, 3), to this frame and unit."""
        moved: np.ndarray = (metres - self.shift) @ self.rotation / METRES_PER[self.unit]
        return moved

    def directions(self, vectors: np.ndarray) -> np.ndarray:
        """Rotate vectors of the chamber's frame, shape (n, 3), to this frame."""
        turned: np.ndarray = vectors @ self.rotation
        return turned


def frame_of(name: FrameName, part: Part) -> Frame:
    """Return the frame for exported positions with the name "part" or "chamber".

    Lengths in the frame of the part are in the unit of the part's file, in the chamber's frame in
    mm.
    """
    if name == "chamber" or part.file is None:
        return Frame(name, "mm", np.eye(3), np.zeros(3))
    return Frame(name, part.unit, part.file.rotation, part.file.shift)

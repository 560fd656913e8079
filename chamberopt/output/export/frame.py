"""In whose coordinates positions and directions are handed on: those of the part's file, or the chamber's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.part import part_pose
from chamberopt.geometry.mesh_io.units import METRES_PER
from chamberopt.output.export.formats import FrameName

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.design import Design

SAID = {
    "part": "of the part's file: its axes, its origin, its unit",
    "chamber": "of the chamber: z up, the sonotrode's mean face at z = 0, the chamber's axis at x = y = 0",
}


@dataclass(frozen=True)
class Frame:
    """name · unit of its lengths · turn (3, 3), then shift (3,) [m]: from it to the chamber's frame."""

    name: FrameName
    unit: str
    turn: np.ndarray
    shift: np.ndarray

    def places(self, metres: np.ndarray) -> np.ndarray:
        """Positions (n, 3) of the chamber's frame [m] in this one and its unit."""
        moved: np.ndarray = (metres - self.shift) @ self.turn / METRES_PER[self.unit]
        return moved

    def directions(self, vectors: np.ndarray) -> np.ndarray:
        """Vectors (n, 3) of the chamber's frame turned into this one."""
        turned: np.ndarray = vectors @ self.turn
        return turned


def frame_of(name: FrameName, design: Design, chamber: Chamber) -> Frame:
    """The frame of that name; the chamber's lengths are in mm, as everywhere in a results folder."""
    if name == "chamber":
        return Frame(name, "mm", np.eye(3), np.zeros(3))
    return Frame(name, chamber.part.unit, *part_pose(design))

"""What is wrong with a surface, and where: one sentence for a person, and the place for a picture."""

from __future__ import annotations

import numpy as np

from chamberopt.common.errors import InputError


class SurfaceError(InputError):
    """A surface that cannot be used.

    corners (m, 3, 3) m: the surface as read · edges (k, 2, 3) m: what is wrong with it, as lines.
    """

    def __init__(self, message: str, corners: np.ndarray, edges: np.ndarray) -> None:
        super().__init__(message)
        self.corners, self.edges = corners, edges


class OpenSurfaceError(SurfaceError):
    """A surface with open edges that are too many to be closed."""


def format_box(sides: np.ndarray) -> str:
    """A bounding box's sides (3,) [m] as text: '44 x 44 x 70 mm'."""
    return " x ".join(f"{1e3 * side:.5g}" for side in sides) + " mm"


def format_point(point: np.ndarray) -> str:
    """A position (3,) [m] as text: '(1, 2, 3) mm'."""
    return "(" + ", ".join(f"{1e3 * value + 0.0:.5g}" for value in point) + ") mm"

"""Define errors that hold a faulty surface for a picture, and write lengths for messages."""

from __future__ import annotations

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.number_text import plain


class SurfaceError(InputError):
    """Error for a surface that cannot be used, by itself or at its place in the chamber.

    Args:
        corners: corners of the surface's triangles as read, (m, 3, 3) [m].
        edges: lines that show the fault in a picture, (k, 2, 3) [m].
    """

    def __init__(self, message: str, corners: np.ndarray, edges: np.ndarray) -> None:
        super().__init__(message)
        self.corners, self.edges = corners, edges
        self.add_note("to see it: chamberopt check FILE.toml --screenshot PICTURE.png")


class OpenSurfaceError(SurfaceError):
    """Error for a surface with open edges that are not closed automatically."""


def format_box(sides: np.ndarray) -> str:
    """Return the sides (3,) [m] of a bounding box as text: '44 x 44 x 70 mm'.

    Chords of a curved surface are a little shorter than it: sides have four digits.
    """
    return " x ".join(plain(1e3 * float(side)) for side in sides) + " mm"


def format_point(point: np.ndarray) -> str:
    """Return a position (3,) [m] as text: '(1, 2, 3) mm'."""
    return "(" + ", ".join(f"{round(1e3 * value, 5) + 0.0:.5g}" for value in point) + ") mm"

"""Place views of a chamber on a page, and draw areas, lines and words in them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.pictures.charts.colours import DARK_GREY
from chamberopt.pictures.drawing.cuts import outline_path

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Rectangle
    from numpy.typing import ArrayLike
    from shapely.geometry.base import BaseGeometry

    from chamberopt.pictures.drawing.dimensions import Point

PART = "#c9ced3"
LABEL = {"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}


@dataclass(frozen=True)
class View:
    """A view of the chamber, such as its plan: its position and scale on the page.

    Attributes:
        right: axis of the chamber (0, 1, 2) that points to the right.
        scale: length on the page over length in the chamber.
        corner: lower left corner of the cavity on the page [mm].
        low, high: corners of the cavity in the chamber, (2,) [mm].
        outside: drawn length of the part beyond the cavity to the left, to the right and above, on
            the page, (3,) [mm].
    """

    right: int
    scale: float
    corner: np.ndarray
    low: np.ndarray
    high: np.ndarray
    outside: np.ndarray

    def place(self, points: ArrayLike) -> np.ndarray:
        """Return the points on the page [mm] that show points (..., 2) [mm] of the chamber."""
        return np.asarray(self.corner + self.scale * (np.asarray(points) - self.low))

    def chamber_point(self, place: Point) -> Point:
        """Return the point [mm] of the chamber that is drawn at a place on the page [mm]."""
        x, y = self.low + (np.array(place) - self.corner) / self.scale
        return float(x), float(y)

    def window(self, axes: Axes) -> Rectangle:
        """Return the rectangle of the page that the view takes, at which drawings are cut off."""
        from matplotlib.patches import Rectangle

        left, right, above = self.outside
        size = self.scale * (self.high - self.low) + np.array([left + right, above])
        corner = tuple(self.corner - np.array([left, 0.0]))
        return Rectangle(corner, *size, transform=axes.transData)


def fill(
    axes: Axes, view: View, area: BaseGeometry, window: Rectangle | None = None, **look: Any
) -> None:
    """Fill an area [mm] of the chamber, cut off at a rectangle of the page."""
    from matplotlib.patches import PathPatch

    path = outline_path(area)
    if path is not None:
        patch = PathPatch(type(path)(view.place(path.vertices), path.codes), **look)
        axes.add_patch(patch)
        if window is not None:
            patch.set_clip_path(window)


def draw_lines(axes: Axes, view: View, lines: np.ndarray, colour: str, width: float) -> None:
    """Draw lines (n, 2, 2) [m] of the chamber, of a width [pt]."""
    from matplotlib.collections import LineCollection

    if len(lines):
        drawn = LineCollection(list(view.place(1e3 * lines)), colors=colour, linewidths=width)
        drawn.set_capstyle("round")
        axes.add_collection(drawn)


def label(axes: Axes, x: float, y: float, text: str) -> None:
    """Write the name of a view above and right of a place on the page [mm]."""
    axes.text(x, y, text, size=6.5, color=DARK_GREY, va="bottom", bbox=LABEL)

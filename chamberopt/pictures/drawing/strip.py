"""Draw an Almen strip with its block in the place of the part, dotted, in a section and a plan."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.design.almen_strip import STRIPS
from chamberopt.peening.held_strip import HEAD_MM
from chamberopt.pictures.charts.colours import BLACK

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

    from chamberopt.peening.held_strip import HeldStrip
    from chamberopt.pictures.drawing.view import View

DOTTED: dict[str, Any] = {"color": BLACK, "lw": 0.8, "ls": (0, (1, 1.5))}
CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
HEAD_SIDES = 24  # of the polygon for the head of a screw


def draw_strip(axes: Axes, view: View, held: HeldStrip) -> None:
    """Draw a strip and the heads of its screws in the plan. Its middle is on the room's axis."""
    assert held.size is not None
    turn = slice(None, None, 1 if held.along == "x" else -1)
    sides = 500.0 * np.array([held.size.length, held.size.width])
    _draw(axes, view, (CORNERS * sides)[:, turn])
    angle = np.linspace(0.0, 2.0 * np.pi, HEAD_SIDES + 1)
    head = 0.5 * HEAD_MM * np.c_[np.cos(angle), np.sin(angle)]
    for corner in CORNERS[:4]:
        _draw(axes, view, (corner * held.screws_mm)[turn] + head)


def draw_strip_aside(axes: Axes, view: View, held: HeldStrip) -> None:
    """Draw a strip in a section, and the lower face of the block on which it lies."""
    assert held.size is not None
    is_along = "xy"[view.right] == held.along
    half = 500.0 * (held.size.length if is_along else held.size.width)
    low = held.level_mm
    block = low + 1e3 * STRIPS[held.type].thickness
    _draw(axes, view, [[view.low[0], block], [view.high[0], block]])
    _draw(axes, view, [[-half, block], [-half, low], [half, low], [half, block]])


def _draw(axes: Axes, view: View, points: ArrayLike) -> None:
    axes.plot(*view.place(points).T, **DOTTED)

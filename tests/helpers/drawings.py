"""Texts of drawn pages with their places, and a chamber that can be drawn."""

from dataclasses import replace

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from chamberopt.chamber.build import Chamber
from chamberopt.design.shape_surface import TAG_SONOTRODE
from chamberopt.printers.sheet_page import HEIGHT, WIDTH


def boxes_of(figure: Figure) -> list[tuple[str, np.ndarray]]:
    """Each text of a page, with its box in pixels."""
    figure.set_dpi(72.0)
    draw = FigureCanvasAgg(figure).get_renderer()
    texts = [one for one in figure.axes[0].texts if one.get_text().strip()]
    return [(one.get_text(), one.get_window_extent(draw).extents) for one in texts]


def require_apart(boxes: list[tuple[str, np.ndarray]]) -> None:
    """Fail if texts overlap or leave the page."""
    for text, (x0, y0, x1, y1) in boxes:
        assert x0 > 0.0, text
        assert y0 > 0.0, text
        assert x1 < WIDTH / 25.4 * 72.0, text
        assert y1 < HEIGHT / 25.4 * 72.0, text
    for k, (text, one) in enumerate(boxes):
        for other_text, other in boxes[k + 1 :]:
            shared = np.minimum(one[2:], other[2:]) - np.maximum(one[:2], other[:2])
            assert shared.min() < 1.5, (text, other_text)


def on_sonotrode(chamber: Chamber) -> Chamber:
    """A chamber whose floor is a sonotrode."""
    height = chamber.vertices[chamber.triangles][..., 2].max(axis=1)
    face = np.where(height < height.min() + 1e-9, TAG_SONOTRODE, chamber.tags).astype(np.uint8)
    return replace(chamber, tags=face)

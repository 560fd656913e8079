"""Render surfaces along parallel lines of sight, so lengths are the same all over the image."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from chamberopt.pictures.actors import light
from chamberopt.pictures.camera import view_frame
from chamberopt.results.vtp_files import pyvista

NARROWEST = 0.6  # shortest side of an image over the largest side


class View(NamedTuple):
    """A rendered image of surfaces, and the position of its pixels in space.

    Attributes:
        image: red, green and blue of each of its points, uint8, (finer rows, finer columns, 3).
        frame: unit vectors to the right, upwards and to the eye, (3, 3).
        corner: upper left corner of the image along the first two unit vectors [mm].
        pixel_mm: size of a pixel [mm].
        finer: points of the image along each side of a pixel.
    """

    image: np.ndarray
    frame: np.ndarray
    corner: np.ndarray
    pixel_mm: float
    finer: int = 1

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns of pixels."""
        rows, columns = self.image.shape[:2]
        return rows // self.finer, columns // self.finer

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Return the columns and rows (k, 2) in the image of points [mm], (k, 3)."""
        flat = np.asarray(points, dtype=float) @ self.frame[:2].T
        return np.asarray((flat - self.corner) * [1.0, -1.0] / self.pixel_mm)


def render_view(
    add: Callable[[Any], None],
    eye: np.ndarray,
    points: np.ndarray,
    size: tuple[int, int],
    border: int,
    finer: int = 1,
) -> View:
    """Render surfaces from one direction, in an image that they fill.

    Args:
        add: function that adds the surfaces to a plotter.
        eye: direction to the eye.
        points: points that fill the image [mm], (k, 3).
        size: largest width and height [pixels]. A side that is not filled is made shorter.
        border: free border round the points [pixels].
        finer: that of View.
    """
    frame = view_frame(eye)
    flat = np.asarray(points, dtype=float) @ frame.T
    low, high = flat.min(axis=0), flat.max(axis=0)
    sides = np.maximum(high - low, 1e-9)[:2]
    pixel_mm = float((sides / (np.array(size) - 2 * border)).max())
    needed = np.ceil(sides / pixel_mm) + 2 * border
    columns, rows = np.maximum(needed, NARROWEST * np.array(size)).astype(int)
    plotter = pyvista().Plotter(off_screen=True, window_size=[int(columns), int(rows)])
    plotter.enable_anti_aliasing("ssaa")
    light(plotter)
    add(plotter)
    aim_along(plotter, frame, 0.5 * (low + high) @ frame, 0.5 * rows * pixel_mm)
    image = np.asarray(plotter.screenshot(None, return_img=True, scale=finer))[..., :3]
    plotter.close()
    corner = 0.5 * (low + high)[:2] + 0.5 * pixel_mm * np.array([-columns, rows])
    return View(image, frame, corner, pixel_mm, finer)


def aim_along(plotter: Any, frame: np.ndarray, middle: np.ndarray, half_height: float) -> None:
    """Point the camera of a plotter at `middle`, with parallel lines of sight.

    Args:
        frame: unit vectors to the right, upwards and to the eye, (3, 3).
        half_height: half of the image's height [mm].
    """
    distance = 2.0 * np.linalg.norm(np.ptp(np.reshape(plotter.bounds, (3, 2)), axis=1)) + 1.0
    plotter.camera_position = [middle + distance * frame[2], middle, frame[1]]
    plotter.camera.parallel_projection = True
    plotter.camera.parallel_scale = half_height
    plotter.renderer.ResetCameraClippingRange()

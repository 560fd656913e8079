"""A result in a window of its own, or as a picture of it."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from chamberopt.errors import InputError
from chamberopt.viewer.apart import picture_path
from chamberopt.viewer.part import Part, colour_range
from chamberopt.viewer.scene import in_chamber
from chamberopt.viewer.side_by_side import coverage_picture
from chamberopt.viewer.surfaces import CHAMBER, COVERAGE, pyvista, read_surface


def inspect(folder: str | Path, screenshot: str | Path | None = None, title: str = "") -> None:
    """Turn the part in its chamber with the mouse; or, with `screenshot`, write a picture without a window.

    Raises InputError when the folder has no coverage, or there is no display to open a window on.
    """
    folder = Path(folder)
    read_surface(folder / COVERAGE)
    if screenshot is not None:
        path = picture_path(screenshot)
        trouble = coverage_picture([folder], [title or folder.name], path)
        if trouble:
            raise InputError(trouble)
        return
    on_linux = sys.platform.startswith("linux")
    if on_linux and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise InputError("inspect: there is no display to open a window on; write a picture: --screenshot FILE.png")
    plotter = pyvista().Plotter(window_size=[1400, 900])
    part, chamber = Part(read_surface(folder / COVERAGE)), read_surface(folder / CHAMBER)
    in_chamber(plotter, part, chamber, title or folder.name, colour_range([part]), bar=True)
    plotter.add_axes()
    plotter.show()

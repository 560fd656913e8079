"""Draw pictures with VTK in a child process.

Where OpenGL's library is installed without a driver, VTK raises no error: it ends the process. In a
child, the end costs the picture, never the result.
"""

from __future__ import annotations

import ctypes
import io
import os
import subprocess
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

from chamberopt.common.child import Child, ChildLostError
from chamberopt.common.errors import InputError
from chamberopt.common.files import require_place, write_bytes

INSTALL = (
    "install OpenGL for machines without a display (Debian: apt install libegl1 libgl1-mesa-dri)"
)
MAX_SECONDS = 600.0  # for one picture
OFFSCREEN_WINDOWS = (
    ("libEGL.so.1", "vtkEGLRenderWindow"),
    ("libOSMesa.so.8", "vtkOSOpenGLRenderWindow"),
)


def missing_opengl() -> str | None:
    """Return None if this computer may be able to draw in 3D, else a line on what is missing."""
    if not sys.platform.startswith("linux") or offscreen_window():
        return None
    return f"no OpenGL library found: {INSTALL}"


def offscreen_window() -> str | None:
    """Return the name of the VTK window class that draws without a display.

    None if no OpenGL library for such a window is installed.
    """
    for library, window in OFFSCREEN_WINDOWS:
        try:
            ctypes.CDLL(library)
        except OSError:
            continue
        return window
    return None


def without_display() -> dict[str, str]:
    """Return the environment of a process that draws without a display."""
    environment = dict(os.environ)
    window = offscreen_window()
    if sys.platform.startswith("linux") and window:
        environment["VTK_DEFAULT_OPENGL_WINDOW"] = window
        environment.pop("DISPLAY", None)
    return environment


def picture_path(picture: str | Path, option: str = "--screenshot ") -> Path:
    """Return the path of a .png that an option of a command may write.

    Raises InputError for another ending, a missing folder, or a place that cannot be written.
    """
    return file_path(picture, (".png",), "pictures are written as .png", option)


def file_path(file: str | Path, suffixes: tuple[str, ...], written: str, option: str = "") -> Path:
    """Check that a file can be written at a path, and return the path.

    Args:
        suffixes: supported endings of the file's name, in lower case.
        written: the part of the error message that names the supported endings.
        option: the beginning of every error message, such as the command's option.

    Raises:
        InputError: another suffix, a missing folder, or a place that cannot be written.
    """
    path = Path(file)
    if path.suffix.lower() not in suffixes:
        raise InputError(f"{option}{path}: {written}; give such a name")
    require_place(path, option)
    return path


def require_opengl(picture: Path) -> Path:
    """Return the path of a picture, or raise InputError if this computer cannot draw in 3D."""
    if missing := missing_opengl():
        raise InputError(f"{picture}: cannot be drawn: {missing}")
    return picture


def write_screenshot(plotter: Any, picture: str) -> None:
    """Write the picture of a plotter as .png, whole or not at all."""
    content = io.BytesIO()
    plotter.screenshot(content)
    write_bytes(Path(picture), content.getvalue())


def draw_in_subprocess(
    render: Callable[[dict[str, Any]], Any],
    job: dict[str, Any],
    picture: str | Path,
    max_seconds: float = MAX_SECONDS,
    count: Callable[[int], None] = lambda drawn: None,
) -> str | None:
    """Draw a picture in a child process.

    Args:
        render: function that draws the picture in the child. For a film it yields the number of
            frames drawn so far, after each frame, and None at the end.
        job: argument of `render`, to which "picture" is added, the file to write.
        max_seconds: time after which the child is killed.
        count: called with each number of frames.

    Returns:
        None, or one line that says why there is no picture.

    Raises:
        InputError: raised by `render`.
    """
    name, missing = Path(picture).name, missing_opengl()
    if missing:
        return f"{name} skipped: {missing}"
    job = {**job, "picture": str(picture)}
    try:
        quiet = subprocess.DEVNULL
        with Child(max_seconds, env=without_display(), stderr=quiet) as child:
            child.ask(render, job)
            for drawn in iter(child.answer, None):
                count(drawn)
    except InputError:
        raise
    except ChildLostError as lost:
        if lost.is_late:
            return f"{name} skipped: it could not be drawn within {max_seconds:g} s"
        return f"{name} skipped: drawing failed (status {lost.status}); {INSTALL}"
    except Exception as error:
        why = "".join(traceback.format_exception_only(error)).splitlines()[-1]
        return f"{name} skipped: drawing failed ({why})"
    return None

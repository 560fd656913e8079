"""Drawing in a process of its own.

Where OpenGL's library is installed but its driver is not, VTK does not raise an error: it ends the
process. In a process of its own that costs the picture, never the result.
"""

from __future__ import annotations

import ctypes
import io
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

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
    """Return None if pictures can be tried on this machine, else one line on what is missing."""
    if not sys.platform.startswith("linux") or offscreen_window():
        return None
    return f"no OpenGL library found: {INSTALL}"


def offscreen_window() -> str | None:
    """Return VTK's name of a window that needs no display, or None if no library is installed."""
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
    """Return where an option may write a .png; InputError as file_path."""
    return file_path(picture, (".png",), "pictures are written as .png", option)


def file_path(file: str | Path, suffixes: tuple[str, ...], written: str, option: str = "") -> Path:
    """Return where a file may be written.

    Args:
        file: wanted.
        suffixes: that are supported.
        written: the sentence about them in the message.
        option: begins the message.

    Raises:
        InputError: another suffix, a missing folder, or a place that cannot be written.
    """
    path = Path(file)
    if path.suffix.lower() not in suffixes:
        raise InputError(f"{option}{path}: {written}; give such a name")
    require_place(path, option)
    return path


def require_opengl(picture: Path) -> Path:
    """Return a picture's path; InputError where this machine cannot draw it."""
    if missing := missing_opengl():
        raise InputError(f"{picture}: cannot be drawn: {missing}")
    return picture


def write_screenshot(plotter: Any, picture: str) -> None:
    """Write what a plotter shows as .png, whole or not at all."""
    content = io.BytesIO()
    plotter.screenshot(content)
    write_bytes(Path(picture), content.getvalue())


def draw_in_subprocess(
    job: dict[str, Any],
    picture: str | Path,
    max_seconds: float = MAX_SECONDS,
    count: Callable[[int], None] = lambda drawn: None,
) -> str | None:
    """Do a drawing job in a process of its own.

    Args:
        job: as JSON; "draw" names one of viewer.__main__.RENDERERS.
        picture: file to write.
        max_seconds: after which the process is stopped.
        count: called with each number that the process prints on a line of its own.

    Returns:
        None, or one line that says why there is no picture.

    Raises:
        InputError: the job cannot be drawn as it was wanted.
    """
    name, missing = Path(picture).name, missing_opengl()
    if missing:
        return f"{name} skipped: {missing}"
    command = [sys.executable, "-P", "-m", "chamberopt.viewer"]
    begun = time.monotonic()
    with (
        tempfile.TemporaryFile("w+") as errors,
        subprocess.Popen(
            [*command, json.dumps({**job, "picture": str(picture)})],
            env=without_display(),
            stdin=subprocess.PIPE,  # it is closed when this process ends, however it ends
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
        ) as drawing,
    ):
        stop = threading.Timer(max_seconds, drawing.kill)
        stop.start()
        try:
            for line in drawing.stdout or ():
                if line.strip().isdigit():
                    count(int(line))
            status = drawing.wait()
        finally:
            stop.cancel()
            drawing.kill()
        errors.seek(0)
        messages = errors.read().strip()
    if status == 0 and Path(picture).is_file():
        return None
    if status == 2:
        raise InputError(messages.splitlines()[-1])
    if time.monotonic() - begun > max_seconds:
        return f"{name} skipped: it could not be drawn within {max_seconds:g} s"
    if "Traceback" in messages:
        return f"{name} skipped: drawing failed ({messages.splitlines()[-1]})"
    return f"{name} skipped: drawing failed (status {status}); {INSTALL}"

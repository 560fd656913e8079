"""Drawing in a process of its own: where an OpenGL library is there but its driver is not, VTK does not raise, it takes
the process down, and a picture must never cost the results.
"""

from __future__ import annotations

import ctypes
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from chamberopt.common.errors import InputError

INSTALL = (
    "install OpenGL for machines without a display (Debian: apt install libegl1 libgl1-mesa-dri)"
)


def missing_opengl() -> str | None:
    """None when pictures can be tried on this machine, else one line that says what is missing."""
    if not sys.platform.startswith("linux") or offscreen_window():
        return None
    return f"no OpenGL library found: {INSTALL}"


def offscreen_window() -> str | None:
    """VTK's name for the window that needs no display, by what is installed."""
    windows = (("libEGL.so.1", "vtkEGLRenderWindow"), ("libOSMesa.so.8", "vtkOSOpenGLRenderWindow"))
    for library, window in windows:
        try:
            ctypes.CDLL(library)
        except OSError:
            continue
        return window
    return None


def without_display() -> dict[str, str]:
    """The environment of a process that draws without a display."""
    environment = dict(os.environ)
    window = offscreen_window()
    if sys.platform.startswith("linux") and window:
        environment["VTK_DEFAULT_OPENGL_WINDOW"] = window
        environment.pop("DISPLAY", None)
    return environment


def picture_path(picture: str | Path, option: str = "--screenshot ") -> Path:
    """Where --screenshot, or another option, may write. InputError for what is no .png, or in no folder."""
    return file_path(picture, (".png",), "pictures are written as .png", option)


def file_path(file: str | Path, suffixes: tuple[str, ...], written: str, option: str = "") -> Path:
    """Where a file may be written. InputError for another suffix, in no folder, or where none can be made."""
    path = Path(file)
    if path.suffix.lower() not in suffixes:
        raise InputError(f"{option}{path}: {written}; give such a name")
    if not path.resolve().parent.is_dir():
        raise InputError(f"{option}{path}: the folder does not exist; make it first")
    if path.is_dir():
        raise InputError(f"{option}{path}: is a folder; give another name")
    try:
        with tempfile.TemporaryFile(
            dir=path.resolve().parent
        ):  # better now than after all is simulated and drawn
            pass
    except OSError as error:
        raise InputError(
            f"{option}{path}: cannot be written: {error.strerror}; choose another place"
        ) from None
    return path


def draw_in_subprocess(
    job: dict[str, Any], picture: str | Path, patience: float = 600.0
) -> str | None:
    """Does a drawing job in a process of its own. None, or one line saying why there is no picture.

    patience [s]: subprocess.TimeoutExpired after so long.
    """
    missing = missing_opengl()
    if missing:
        return f"{Path(picture).name} skipped: {missing}"
    job = {**job, "picture": str(picture)}
    command = [sys.executable, "-m", "chamberopt.output.viewer", json.dumps(job)]
    run = subprocess.run(
        command,
        env=without_display(),
        capture_output=True,
        text=True,
        timeout=patience,
        check=False,
    )
    if run.returncode == 0 and Path(picture).is_file():
        return None
    if run.returncode == 2:
        raise InputError(run.stderr.strip().splitlines()[-1])
    if "Traceback" in run.stderr:
        return (
            f"{Path(picture).name} skipped: drawing failed ({run.stderr.strip().splitlines()[-1]})"
        )
    return f"{Path(picture).name} skipped: drawing failed (status {run.returncode}); {INSTALL}"

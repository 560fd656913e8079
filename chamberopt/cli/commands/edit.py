"""The command `edit`: make and edit a design on a page in the browser."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from chamberopt.cli.console import show
from chamberopt.cli.options import app


@app.command
def edit(
    file: Path = Path(),
    /,
    *,
    port: int = 0,
    trust_shape: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Edit a design on a page in the browser: see the chamber, pick the target, turn the part, run.

    Without a design, the page begins with a part's file, and proposes one. The page is for one
    person on this machine, and needs no network. Ctrl-C ends it.

    Parameters
    ----------
    file
        Design file (.toml), part (STEP, STL, ...), or a folder in which parts are kept; by default
        this folder.
    port
        Port of 127.0.0.1 at which the page is; by default a free one.
    trust_shape
        Run the design's own shape, a Python file, without asking.
    """
    from chamberopt.common.errors import InputError
    from chamberopt.common.progress import step
    from chamberopt.geometry.meshes.formats import is_mesh_name

    is_design = not file.is_dir() and not (file.is_file() and is_mesh_name(file.name))
    # a wrong design is reported before the server starts
    trusted = _trusted(file, trust_shape) if is_design else trust_shape
    try:
        with step("starting"):
            from chamberopt.page.server import serve
    except ModuleNotFoundError as error:
        raise InputError(
            f"the page needs {error.name}: install it with pip install 'chamberopt[page]'"
        ) from None

    def tell(address: str) -> None:
        shown = "a page for your part" if file == Path() else file
        show([f"{shown} is at {address}", "Ctrl-C ends the page"])

    folder, first = (file, None) if file.is_dir() else (file.parent, file)
    serve(folder, first, port, trusted, tell)


def _trusted(path: Path, trusted: bool) -> bool:
    """Return True if the design may run a Python file that makes its chamber's shape.

    The user is asked unless `trusted` is True. Raises InputError if the design is wrong, or if it
    has such a shape and the user does not allow that.
    """
    from chamberopt.common.toml_fields import read_toml
    from chamberopt.page.edited_file import EditedFile, custom_shape

    shape = custom_shape(read_toml(path, "design")[1])
    if shape and not trusted and sys.stdin.isatty():
        question = f"{path}: runs the Python file {shape}, which may do anything; go on? [y/N] "
        trusted = input(question).strip().lower() == "y"
    EditedFile(path, trusted)
    return trusted

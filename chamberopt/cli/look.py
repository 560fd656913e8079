"""inspect: a result."""

from __future__ import annotations

import json as json_format
from pathlib import Path

from chamberopt.cli.app import Json, Out, app
from chamberopt.cli.said import results_folder


@app.command
def inspect(result: Path, /, *, screenshot: Path | None = None, json: Json = False, out: Out = None) -> None:
    """Look at a result in 3D: the part coloured by coverage, inside its chamber. --out: a picture goes there.

    Parameters
    ----------
    result
        Results folder.
    screenshot
        Write a picture to this file instead of opening a window.
    """
    from chamberopt import viewer
    from chamberopt.results import load_result, summary

    loaded = load_result(result)
    if screenshot is None and out is not None:
        with results_folder(out, "inspect") as folder:
            screenshot = folder / "inspect.png"
    line = summary(loaded)
    if not json:
        print(line)
    viewer.inspect(loaded.folder, screenshot, title=f"{loaded.folder.resolve().name}\n{line}")
    if json:
        print(json_format.dumps({**loaded.data, "folder": str(loaded.folder), "screenshot": _text(screenshot)}))
    elif screenshot is not None:
        print(f"picture in {screenshot}")


def _text(path: Path | None) -> str | None:
    return None if path is None else str(path)

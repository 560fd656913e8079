"""inspect: results, triangle by triangle."""

from __future__ import annotations

import json as json_format
from pathlib import Path

from chamberopt.cli.console import remark, results_folder
from chamberopt.cli.options import Json, Out, app
from chamberopt.common.errors import InputError


@app.command
def inspect(
    *results: Path,
    quantity: str = "coverage",
    time_s: float | None = None,
    below: float | None = None,
    clip: str | None = None,
    cut_part: bool = False,
    chamber: bool = True,
    triangle: int | None = None,
    view: str | None = None,
    screenshot: Path | None = None,
    off_screen: bool = False,
    html: Path | None = None,
    json: Json = False,
    out: Out = None,
) -> None:
    """ViewState at results in 3D: each part coloured triangle by triangle in its chamber. Key h lists what the window can.

    Every option says what the window, or a picture, begins with. --out: a picture goes there.

    Parameters
    ----------
    results
        One results folder, or several: linked views on one colour scale.
    quantity
        coverage, impacts, speed, p90-speed, angle, dent, energy or interval.
    time_s
        Coverage, impacts and energy after so many seconds, not at the treatment time.
    below
        Show only what is covered below so many percent; the rest is pale.
    clip
        Cut the chamber open across an axis: X, Y or Z, and where in mm: Z=12.
    cut_part
        Cut the part too.
    chamber
        Draw the chamber.
    triangle
        Show this triangle's numbers and impact speeds; its row in coverage.vtp, from 0.
    view
        Direction from the part to the eye, X,Y,Z; chosen to show the target if left out.
    screenshot
        Write a picture to this file instead of opening a window.
    off_screen
        Open no window: write inspect.png to --out, or to results/inspect.
    html
        Write a page that shows the parts in a browser, with switches of its own.
    """
    from chamberopt.output import viewer
    from chamberopt.output.results.load import load_result, summary

    look = viewer.ViewState(
        quantity=quantity, time_s=time_s, below=below, cut=viewer.parse_clip(clip) if clip else None, cut_part=cut_part,
        chamber=chamber, triangle=triangle, eye=viewer.parse_view(view) if view else None,
    )  # fmt: skip
    if not results:
        raise InputError("inspect: requires an argument: one or more results folders")
    if screenshot is not None and out is not None:
        raise InputError(
            "inspect: --screenshot and --out both say where the picture goes; give one of them"
        )
    loaded = [load_result(path) for path in results]
    lines = [summary(one) for one in loaded]
    if not json:
        print("\n".join(lines))
    if html is not None:
        from chamberopt.output.report import write_part_page

        if look != viewer.ViewState():
            raise InputError(
                "inspect: the page of --html has switches of its own; leave out what says how to look"
            )
        remark(write_part_page([one.folder for one in loaded], html))
    if screenshot is None and (off_screen or out is not None):
        with results_folder(out, "inspect") as folder:
            screenshot = folder / "inspect.png"
            viewer.inspect([viewer.result_info(one) for one in loaded], look, screenshot)
    elif html is None or screenshot is not None:
        viewer.inspect([viewer.result_info(one) for one in loaded], look, screenshot)
    if json:
        first = {**loaded[0].data, "folder": str(loaded[0].folder)} if len(loaded) == 1 else {}
        written = {"screenshot": _text(screenshot), "page": _text(html)}
        print(
            json_format.dumps({**first, "folders": [str(one.folder) for one in loaded], **written})
        )
        return
    print(
        "\n".join(
            [f"page in {html}"] * (html is not None)
            + [f"picture in {screenshot}"] * (screenshot is not None)
        )
    )


def _text(path: Path | None) -> str | None:
    return None if path is None else str(path)

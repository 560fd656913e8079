"""The command `inspect`: show results in 3D, coloured by any quantity."""

from __future__ import annotations

from contextlib import ExitStack, nullcontext
from pathlib import Path

from chamberopt.cli.console import print_json, print_remarks, results_folder, show
from chamberopt.cli.options import Json, Out, View, app
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
    view: View = None,
    screenshot: Path | None = None,
    off_screen: bool = False,
    html: Path | None = None,
    json: Json = False,
    out: Out = None,
) -> None:
    """Show results in 3D: each part in its chamber, coloured by one quantity.

    Options set the initial view; key h in the window lists its keys. With --out, an image is
    written to that folder.

    Parameters
    ----------
    results
        One or more results folders; several are shown in linked views on one colour scale.
    quantity
        coverage, impacts, speed, p90-speed, angle, dent, energy, interval, strength (the
        peening strength S of a place), almen (its intensity, if the design is calibrated),
        saturation (its time), moved (how far the surface is from the file's facets), zones, depth
        (of compression) or stress (at the surface, if the design has [stress]).
    time_s
        Show coverage, impacts and energy after this time instead of the treatment time.
    below
        Show only what is covered less than this percentage; the rest is pale.
    clip
        Cut the chamber open across an axis: X, Y or Z, and where in mm: Z=12.
    cut_part
        Cut the part too.
    chamber
        Draw the chamber.
    triangle
        Show the numbers and impact speeds of this triangle (its row in part.vtp, from 0).
    screenshot
        Write an image to this file instead of opening a window.
    off_screen
        Open no window; write inspect.png to --out, by default to results/inspect.
    html
        Write an HTML page that shows the parts in a browser.
    """
    from chamberopt.common.progress import step
    from chamberopt.documents.coverage import summary
    from chamberopt.pictures.subprocess_drawing import picture_path, require_opengl
    from chamberopt.results.load import load_result
    from chamberopt.viewer.opened_result import result_info
    from chamberopt.viewer.view_state import ViewState, parse_clip, parse_view
    from chamberopt.viewer.window import inspect as open_window

    look = ViewState(
        quantity=quantity,
        time_s=time_s,
        below=below,
        cut=parse_clip(clip) if clip else None,
        cut_part=cut_part,
        chamber=chamber,
        triangle=triangle,
        eye=parse_view(view) if view else None,
    )
    if not results:
        raise InputError("inspect: requires an argument: one or more results folders")
    if screenshot is not None and out is not None:
        text = "--screenshot and --out both name the place of the image; give one of them"
        raise InputError(f"inspect: {text}")
    to_folder = screenshot is None and (off_screen or out is not None)
    with ExitStack() as claims:
        if html is not None:
            from chamberopt.printers.report_page import require_free_page, write_part_page

            if look != ViewState():
                text = "the page of --html sets the view in the browser"
                remedy = "remove the options that set the initial view"
                raise InputError(f"inspect: {text}; {remedy}")
            require_free_page(html)
        if to_folder:
            screenshot = claims.enter_context(results_folder(out, "inspect")) / "inspect.png"
        if screenshot is not None:
            require_opengl(picture_path(screenshot))
        with step("reading"):
            loaded = [load_result(path) for path in results]
        if not json:
            show(summary(one) for one in loaded)
        if html is not None:
            with step("writing the page"):
                print_remarks(write_part_page([one.folder for one in loaded], html))
        if html is None or screenshot is not None:
            infos = [result_info(one) for one in loaded]
            with step("drawing") if screenshot else nullcontext():
                open_window(infos, look, screenshot)
    if json:
        first = (
            {**loaded[0].record.as_json(), "folder": str(loaded[0].folder)}
            if len(loaded) == 1
            else {}
        )
        folders = [str(one.folder) for one in loaded]
        image, page = screenshot and str(screenshot), html and str(html)
        print_json({**first, "folders": folders, "screenshot": image, "page": page})
        return
    for kind, path in (("page", html), ("picture", screenshot)):
        if path is not None:
            show([f"{kind} in {path}"])

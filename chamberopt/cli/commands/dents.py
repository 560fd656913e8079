"""The command `dents`: an image of every dent that one replica of a result leaves on the part."""

from __future__ import annotations

from pathlib import Path

from chamberopt.cli.console import show
from chamberopt.cli.options import View, app
from chamberopt.cli.prepare import load_replica
from chamberopt.common.errors import InputError


@app.command
def dents(
    result: Path,
    picture: Path,
    /,
    *,
    replica: int = 0,
    at_s: float | None = None,
    view: View = None,
    pixels: int = 1000,
) -> None:
    """Draw each dent of one replica at its place and size; the surface without dents is black.

    Parameters
    ----------
    result
        Results folder.
    picture
        File to write (.png).
    replica
        Number of the replica, from 0; it is simulated beyond its recorded time if necessary.
    at_s
        Peening time in seconds, by default the treatment time.
    pixels
        Longer side of one view in pixels.
    """
    from chamberopt.common.files import claim_file
    from chamberopt.output.resimulate.impacts import dented_share, simulate_dents
    from chamberopt.output.viewer import parse_view
    from chamberopt.output.viewer.images.dents import draw_dents, require_pixels
    from chamberopt.output.viewer.subprocess_drawing import picture_path

    eye = parse_view(view) if view else None
    require_pixels(pixels)
    with claim_file(picture_path(picture, "")) as path:
        loaded, resimulated = load_replica(result, replica)
        design, recorded = resimulated.design, resimulated.scene.duration
        time = design.process.treatment_time if at_s is None else at_s
        found = simulate_dents(resimulated, time)
        beyond = f", simulated on from {recorded:g} s" if time > recorded else ""
        title = f"{len(found):,} dents after {time:g} s in replica {replica}{beyond}"
        share = f"{100.0 * dented_share(found, resimulated.chamber):.1f} %"
        title += f": {share} of the target"
        heading = f"{loaded.folder.resolve().name}: {title}"
        failure = draw_dents(loaded.folder, found, heading, path, eye, pixels)
    if failure:
        raise InputError(failure)
    show([title, f"picture in {path}"])

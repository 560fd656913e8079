"""The command `dents`: draw every dent that a replica of a result leaves on the part."""

from __future__ import annotations

from pathlib import Path

from chamberopt.cli.console import print_remarks, show
from chamberopt.cli.options import View, app
from chamberopt.cli.prepare import compile_with_message, load_replica, seconds_of
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
    """Draw each dent of one replica at its place and size; the surface without dents is pale.

    Parameters
    ----------
    result
        Results folder.
    picture
        File to write (.png).
    replica
        Number of the replica, from 0; it is simulated beyond its recorded time if necessary.
    at_s
        Peening time in seconds, by default the treatment time, or 600 if that is longer.
    pixels
        Longer side of one view in pixels.
    """
    from chamberopt.common.files import claim_file
    from chamberopt.common.number_text import plain
    from chamberopt.common.progress import step
    from chamberopt.pictures.dents import draw_dents, require_pixels
    from chamberopt.pictures.subprocess_drawing import picture_path, require_opengl
    from chamberopt.results.impacts import (
        MAX_SIMULATED_TREATMENT,
        dented_share,
        require_dent_time,
        simulate_dents,
        simulation_seconds,
    )
    from chamberopt.viewer.view_state import parse_view

    eye = parse_view(view) if view else None
    require_pixels(pixels)
    if at_s is not None:
        require_dent_time(at_s)
    with claim_file(require_opengl(picture_path(picture, ""))) as path:
        with step("reading the result"):
            loaded, resimulated = load_replica(result, replica)
            design, recorded = resimulated.design, resimulated.scene.duration
            usual = min(design.process.treatment_time, MAX_SIMULATED_TREATMENT)
            time = usual if at_s is None else at_s
        compile_with_message(design, resimulated.chamber, resimulated.cavity)
        with step("finding what it costs"):
            cost = plain(simulation_seconds(resimulated, time), 1)
        print_remarks([f"simulating {time:g} s of replica {replica}: about {cost} s on one core"])
        with step("simulating, seconds") as progress:
            counted = seconds_of(progress, resimulated.scene.warmup + time)
            found = simulate_dents(resimulated, time, counted)
        beyond = f", simulated on from {recorded:g} s" if time > recorded else ""
        title = f"{len(found):,} dents after {time:g} s in replica {replica}{beyond}"
        with step("drawing"):
            share = f"{100.0 * dented_share(found, resimulated.chamber):.1f} %"
            title += f": {share} of the target"
            heading = f"{loaded.folder.resolve().name}: {title}"
            failure = draw_dents(loaded.folder, found, heading, path, eye, pixels)
    if failure:
        raise InputError(failure)
    show([title, f"picture in {path}"])

"""The command `replay`: make a film of the ball flight in one replica of a result."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from chamberopt.cli.console import show
from chamberopt.cli.options import View, app
from chamberopt.cli.prepare import compile_with_message, load_replica, seconds_of
from chamberopt.common.errors import InputError

Size = Annotated[tuple[int, int], Parameter(negative="", help="Width and height in pixels.")]


@app.command
def replay(
    result: Path,
    film: Path,
    /,
    *,
    replica: int = 0,
    from_s: float = 0.0,
    span_ms: float = 20.0,
    frames: int = 80,
    fps: int = 20,
    size: Size = (640, 480),
    view: View = None,
) -> None:
    """Film some milliseconds of a result's ball flight as .gif or .mp4; it is simulated again.

    Parameters
    ----------
    result
        Results folder.
    film
        File to write (.gif; .mp4 needs the extra chamberopt[mp4]).
    replica
        Number of the replica, from 0.
    from_s
        Start of the film, in seconds after the warm-up.
    span_ms
        Simulated time that the film shows, in milliseconds.
    frames
        Number of frames, evenly spaced over that time.
    fps
        Frames shown per second.
    """
    from chamberopt.common.files import claim_file
    from chamberopt.common.progress import step
    from chamberopt.pictures.film import draw_replay, film_path, require_playable
    from chamberopt.pictures.subprocess_drawing import require_opengl
    from chamberopt.results.flight import require_simulated, simulate_flight
    from chamberopt.viewer.view_state import parse_view

    path = require_opengl(film_path(film))
    require_playable(fps, size, frames, path)
    eye = parse_view(view) if view else None
    with claim_file(path):
        with step("reading the result"):
            loaded, resimulated = load_replica(result, replica)
            shown = from_s, 1e-3 * span_ms, frames
            require_simulated(resimulated.scene, *shown)
        compile_with_message(resimulated.design, resimulated.chamber, resimulated.cavity)
        with step("simulating, seconds") as progress:
            counted = seconds_of(progress, resimulated.scene.warmup + from_s)
            flown = simulate_flight(resimulated, *shown, progress=counted)
        with step("drawing, frames", frames) as drawing:

            def count(drawn: int) -> None:
                drawing(drawn, frames, None)

            failure = draw_replay(loaded.folder, flown, path, fps, size, eye, count)
    if failure:
        raise InputError(failure)
    show([f"{len(flown.time)} frames, {len(flown.impacts)} impacts on the part: film in {path}"])

"""The command `replay`: a film of the ball flight in one replica of a result."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from chamberopt.cli.console import show
from chamberopt.cli.options import View, app
from chamberopt.cli.prepare import load_replica
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
    from chamberopt.output.resimulate.flight import simulate_flight
    from chamberopt.output.viewer import parse_view
    from chamberopt.output.viewer.images.film import film_path, require_playable
    from chamberopt.output.viewer.images.replay_film import DEFAULT_VIEW, draw_replay

    path = film_path(film)
    require_playable(fps, size, frames, path)
    eye = parse_view(view) if view else DEFAULT_VIEW
    with claim_file(path):
        loaded, resimulated = load_replica(result, replica)
        flown = simulate_flight(resimulated, from_s, 1e-3 * span_ms, frames)
        failure = draw_replay(loaded.folder, flown, path, fps, size, eye)
    if failure:
        raise InputError(failure)
    show([f"{len(flown.time)} frames, {len(flown.impacts)} impacts on the part: film in {path}"])

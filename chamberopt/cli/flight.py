"""replay, dents: what really happened in a result's replica, simulated again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from chamberopt.cli.options import app
from chamberopt.common.errors import InputError

if TYPE_CHECKING:
    from chamberopt.output.resimulate.rebuild import Replica
    from chamberopt.output.results.load import Result

Size = Annotated[tuple[int, int], Parameter(negative="", help="Width and height in pixels.")]
View = Annotated[
    str | None,
    Parameter(
        help="Direction from what is drawn to the eye, X,Y,Z; chosen to show it if left out."
    ),
]


@app.command
def replay(
    result: Path, film: Path, /, *, replica: int = 0, from_s: float = 0.0, span_ms: float = 20.0, frames: int = 80,
    fps: int = 20, size: Size = (640, 480), view: View = None,
) -> None:  # fmt: skip
    """Film some milliseconds of a result's shot flight, each ball where it was: a .gif or .mp4.

    Parameters
    ----------
    result
        Results folder.
    film
        File to write (.gif; .mp4 with the extra chamberopt[mp4]).
    replica
        Which of its replicas, from 0.
    from_s
        Where to begin, in seconds after the warm-up.
    span_ms
        How much of the flight, in milliseconds.
    frames
        Pictures, evenly spaced over it.
    fps
        Pictures a second: how slowly it is played.
    """
    from chamberopt.output.resimulate.flight import flight
    from chamberopt.output.viewer import parse_view
    from chamberopt.output.viewer.images.film import film_path, require_playable
    from chamberopt.output.viewer.images.replay_film import EYE
    from chamberopt.output.viewer.images.replay_film import replay as draw_replay

    path = film_path(film)
    require_playable(fps, size, frames, path)
    eye = parse_view(view) if view else None
    loaded, replayed = _again(result, replica)
    seen = flight(replayed, from_s, 1e-3 * span_ms, frames)
    trouble = draw_replay(loaded.folder, seen, path, fps, size, eye or EYE)
    if trouble:
        raise InputError(trouble)
    print(f"{len(seen.time)} frames, {len(seen.impacts)} impacts on the part: film in {path}")


@app.command
def dents(
    result: Path, picture: Path, /, *, replica: int = 0, at_s: float | None = None,
    view: View = None, pixels: int = 1000,
) -> None:  # fmt: skip
    """Draw every dent of one peening at its place and size, what is not peened black.

    Parameters
    ----------
    result
        Results folder.
    picture
        File to write (.png).
    replica
        Which of its replicas, from 0; simulated on beyond where it ended, if need be.
    at_s
        After how many seconds of peening; the treatment time if left out.
    pixels
        Longer side of what is drawn from one side.
    """
    from chamberopt.output.resimulate.dent_map import coverage, default_views, dent_map, peened
    from chamberopt.output.viewer import parse_view
    from chamberopt.output.viewer.images.dent_map import FINER, dent_picture, require_pixels
    from chamberopt.output.viewer.subprocess_drawing import picture_path

    path = picture_path(picture, "")
    eye = parse_view(view) if view else None
    require_pixels(pixels)
    loaded, replayed = _again(result, replica)
    design, chamber = replayed.design, replayed.chamber
    time = design.process.treatment_time if at_s is None else at_s
    left = peened(replayed, time)
    share = coverage(left, chamber, design.process.accuracy.sample_spacing)
    maps = [
        dent_map(chamber, left, side, FINER * pixels)
        for side in ([eye] if eye else default_views(chamber))
    ]
    beyond = (
        f", simulated on from {replayed.scene.duration:g} s"
        if time > replayed.scene.duration
        else ""
    )
    said = f"{len(left):,} dents after {time:g} s in replica {replica}{beyond}: {share:.1%} of the target"
    dent_picture(maps, left, f"{loaded.folder.resolve().name}: {said}", path)
    print(f"{said}\npicture in {path}")


def _again(folder: Path, replica: int) -> tuple[Result, Replica]:
    """A result and one of its replicas, ready to be simulated again."""
    from chamberopt.cli.prepare import compiled
    from chamberopt.output.resimulate.rebuild import rebuild_replica
    from chamberopt.output.results.load import load_result

    loaded = load_result(folder)
    replayed = rebuild_replica(loaded, replica)
    compiled(replayed.design, replayed.chamber, replayed.cavity)
    return loaded, replayed

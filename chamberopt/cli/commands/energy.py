"""The command `energy`: where the energy of the shot goes, by surface and as maps."""

from __future__ import annotations

from pathlib import Path

from chamberopt.cli.console import show
from chamberopt.cli.options import app
from chamberopt.cli.prepare import compile_with_message, load_replica, seconds_of


@app.command
def energy(result: Path, picture: Path, /, *, replica: int = 0) -> None:
    """Show where the energy of the shot goes: shares by surface, maps of sonotrode and walls.

    The replica is simulated again, with the impacts on all surfaces: a result has those on the part
    alone.

    Parameters
    ----------
    result
        Results folder.
    picture
        File to write (.png).
    replica
        Number of the replica, from 0.
    """
    from chamberopt.common.files import claim_file
    from chamberopt.common.progress import step
    from chamberopt.documents.wording import energy_lines
    from chamberopt.pictures.charts.energy import energy_picture
    from chamberopt.pictures.subprocess_drawing import picture_path
    from chamberopt.results.impact_energy import require_mesh, simulate_energy

    with claim_file(picture_path(picture, "")) as path:
        with step("reading the result"):
            _, resimulated = load_replica(result, replica)
            require_mesh(resimulated)
        compile_with_message(resimulated.design, resimulated.chamber, resimulated.cavity)
        scene = resimulated.scene
        with step("simulating, seconds") as progress:
            counted = seconds_of(progress, scene.warmup + scene.duration)
            found = simulate_energy(resimulated, counted)
        with step("drawing"):
            energy_picture(path, found)
    show([*energy_lines(found), f"picture in {path}"])

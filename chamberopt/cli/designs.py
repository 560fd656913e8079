"""check, simulate, accuracy: one design."""

from __future__ import annotations

import json as json_format
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING

from chamberopt.cli.console import (
    estimates,
    facts_said,
    notes_said,
    remark,
    results_folder,
    say,
    warn,
)
from chamberopt.cli.options import Cluster, Json, Out, Workers, app
from chamberopt.cli.prepare import compiled, effects_advised, settled_effects

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.chamber.reach.reach import Reach
    from chamberopt.geometry.mesh_io import SurfaceError


@app.command
def check(
    file: Path,
    /,
    *,
    pilot: bool = True,
    screenshot: Path | None = None,
    json: Json = False,
    out: Out = None,
) -> None:
    """Check a design or study file: geometry, volumes, shot, warnings; and, by a short pilot run with each effect
    switched, which effects it needs.

    Parameters
    ----------
    file
        Design or study file (.toml).
    pilot
        --no-pilot: nothing is simulated.
    screenshot
        Write a picture (.png) of the part with its target and of its chamber, or of what is wrong with its surface.
    """
    from chamberopt.chamber.build import build_chamber
    from chamberopt.chamber.checks.check import describe, shot_reach
    from chamberopt.common.files import make_output_folder, write_text
    from chamberopt.geometry.mesh_io import SurfaceError
    from chamberopt.optimize.load_study import load
    from chamberopt.optimize.study import Study
    from chamberopt.output.vtp_files import write_chamber

    loaded = load(file)
    design = loaded.design if isinstance(loaded, Study) else loaded
    try:
        chamber = build_chamber(design)
    except SurfaceError as fault:
        if screenshot is not None:
            _picture_of_fault(fault, screenshot)
        raise
    found = shot_reach(design, chamber)
    facts = describe(design, chamber, found)
    if screenshot is not None:
        _picture_of_target(chamber, found, screenshot)
    if isinstance(loaded, Study):
        facts["vary"] = {
            name: {"low": low, "start": design.value(name), "high": high}
            for name, (low, high) in loaded.vary.items()
        }
        facts["evaluations"] = loaded.optimizer.evaluations
    if out is not None:
        facts["folder"] = str(make_output_folder(out))
    kind = "study" if isinstance(loaded, Study) else "design"
    if not json:
        print("\n".join([f"{file}: a usable {kind}", *facts_said(facts)]), flush=True)
    if pilot:
        facts["effects"] = effects_advised(design, chamber)
        if not json:
            print("\n".join(f"effect: {one['said']}" for one in facts["effects"]))
    if out is not None:
        write_text(out / "check.json", json_format.dumps(facts, indent=2) + "\n")
        write_chamber(out, chamber)
    if json:
        print(json_format.dumps(facts, indent=2))


@app.command
def simulate(
    design: Path, /, *, analytic: bool = False, workers: Workers = None, cluster: Cluster = None, json: Json = False,
    out: Out = None,
) -> None:  # fmt: skip
    """Simulate one design and predict its coverage, with confidence intervals and pictures.

    Parameters
    ----------
    design
        Design file (.toml).
    analytic
        In an exact cylinder, box or prism, if the chamber is one, in place of its triangles.
    """
    from chamberopt.chamber.analytic import analytic_cavity
    from chamberopt.chamber.build import build_chamber
    from chamberopt.common.parallel.executor import open_executor
    from chamberopt.common.progress import progress_bar
    from chamberopt.design.load import load_design
    from chamberopt.output.save_run import save_simulation
    from chamberopt.simulation.evaluate import evaluate

    asked = load_design(design)
    chamber = build_chamber(asked)
    cavity = analytic_cavity(asked, chamber) if analytic else None
    warned = warn(asked, chamber)
    with results_folder(out, design.stem) as folder, open_executor(workers, cluster) as executor:
        candidate, advice = settled_effects(asked, chamber, executor)
        compiled(candidate, chamber, cavity)
        with progress_bar("replicas") as progress:
            evaluation = evaluate(candidate, chamber, executor, progress, cavity=cavity)
        remark(save_simulation(folder, candidate, chamber, evaluation, advice, warned))
    notes = (*map(str, advice), *chamber.notes, *evaluation.notes)
    say([*estimates(evaluation), *notes_said(notes)], folder, json)


@app.command
def accuracy(
    design: Path, /, *, budget_s: float = 300.0, json: Json = False, out: Out = None
) -> None:
    """What accuracy costs: every knob that trades it for time against a reference, and what to set for 5, 1, 0.1 %.

    Parameters
    ----------
    design
        Design file (.toml).
    budget_s
        CPU seconds to spend on simulating; more tell smaller errors apart.
    """
    from chamberopt.common.parallel.executor import local_executor
    from chamberopt.common.progress import progress_bar
    from chamberopt.design.load import load_design
    from chamberopt.output.results.accuracy_results import as_json, as_text, write_accuracy_results
    from chamberopt.simulation.convergence.study import require_budget, run_convergence_study

    require_budget(budget_s)
    candidate = load_design(design)
    with results_folder(out, f"{design.stem}-accuracy") as folder:
        with local_executor() as executor, progress_bar("CPU seconds") as progress:
            ladder = run_convergence_study(candidate, budget_s, executor, progress, compiled)
        write_accuracy_results(folder, ladder)
    if json:
        print(json_format.dumps({**as_json(ladder), "folder": str(folder)}, indent=2))
    else:
        print("\n".join([*as_text(ladder), f"results in {folder}"]))


def _picture_of_fault(fault: SurfaceError, screenshot: Path) -> None:
    """What is wrong with a part's surface, in red; the message itself follows on stderr."""
    from chamberopt.output.viewer import draw_part

    text = fill(str(fault), 110)
    remark(
        [
            draw_part(fault.corners, text, screenshot, edges=fault.edges)
            or f"picture in {screenshot}"
        ]
    )


def _picture_of_target(chamber: Chamber, found: Reach, screenshot: Path) -> None:
    """The part with its target, and what of it the shot does not reach."""
    from chamberopt.chamber.reach.reach import part_share
    from chamberopt.output.viewer import draw_part

    part = chamber.part
    missed = part.target & (part_share(found, chamber.source, len(part.triangles)) <= 0.5)
    title = f"{part.name}: the target in orange" + (
        ", in red where hardly a ball can touch it" if missed.any() else ""
    )
    corners = part.vertices[part.triangles]
    drawn = draw_part(corners, title, screenshot, part.target, missed=missed, chamber=chamber)
    remark([drawn or f"picture in {screenshot}"])

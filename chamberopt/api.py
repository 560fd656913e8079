"""From Python, in a few lines: load a design or study, simulate or optimise it, look at the result.

    import chamberopt

    design = chamberopt.load_design("designs/gear.toml")
    result = chamberopt.simulate(design.changed({"shot.mass_g": 8}), "results/more-shot")
    result.metrics["mean_coverage"]            # Estimate(value=..., half_width=...), 95 % interval
    chamberopt.show(result, "more-shot.png")

Coverage triangle by triangle is in the result's coverage.vtp: cell data on the part's own triangles, which pyvista
and ParaView read.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

from chamberopt.common.errors import InputError
from chamberopt.design.design import Design
from chamberopt.design.load import load_design
from chamberopt.optimize.load_study import load_study
from chamberopt.optimize.study import Study

if TYPE_CHECKING:
    from chamberopt.common.progress import Progress
    from chamberopt.output.results.load import Result

__all__ = ["Design", "Study", "load_design", "load_study", "optimise", "show", "simulate"]


def simulate(
    design: Design,
    out: str | Path,
    *,
    analytic: bool = False,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Result:
    """Simulate one design into the new or empty folder ``out``; the result as read back from there.

    ``analytic``: in an exact cylinder, box or prism, if the chamber is one, in place of its mesh. ``workers``: threads,
    one per core when None; the figures do not depend on it. Raises InputError for a chamber that cannot be built, does
    not take the shot or is not analytical, sim_core.SimulationError when a run must stop.
    """
    from chamberopt.chamber.analytic import analytic_cavity
    from chamberopt.chamber.build import build_chamber
    from chamberopt.common.parallel.executor import local_executor
    from chamberopt.output.results.load import load_result
    from chamberopt.output.save_run import save_simulation
    from chamberopt.simulation.effect_pilot import with_effects_resolved
    from chamberopt.simulation.evaluate import evaluate

    _require("design", design, Design, "load_design")
    chamber = build_chamber(design)
    cavity = analytic_cavity(design, chamber) if analytic else None
    with local_executor(workers) as executor:
        design, advice = with_effects_resolved(design, chamber, executor)
        evaluation = evaluate(design, chamber, executor, progress, cavity=cavity)
    _warn(
        [
            *map(str, advice),
            *evaluation.notes,
            *save_simulation(out, design, chamber, evaluation, advice),
        ]
    )
    return load_result(out)


def optimise(
    study: Study, out: str | Path, *, workers: int | None = None, progress: Progress | None = None
) -> Result:
    """Run a study into the folder ``out``; the result stands for its best design, as confirmed.

    ``out``: new, empty, or of the same study: a run that was stopped goes on, of one that has ended the result is read.
    ``workers`` as in simulate. Raises InputError when the folder is another study's, when the start cannot be
    simulated, or nothing meets the constraints.
    """
    from chamberopt.chamber.build import build_chamber
    from chamberopt.common.parallel.executor import local_executor
    from chamberopt.optimize.run_study import search_and_confirm
    from chamberopt.optimize.storage.study_folder import open_study_folder
    from chamberopt.output.results.load import load_result
    from chamberopt.output.save_run import save_study
    from chamberopt.simulation.effect_pilot import with_effects_resolved

    _require("study", study, Study, "load_study")
    with open_study_folder(study, out) as record, local_executor(workers) as executor:
        if not record.finished:
            start = build_chamber(study.design)
            study, advice = record.with_effects_resolved(
                lambda design: with_effects_resolved(design, start, executor)
            )
            found = search_and_confirm(study, record, executor, progress)
            _warn(
                [*map(str, advice), *found.best.evaluation.notes, *save_study(out, found, advice)]
            )
    return load_result(out)


def show(result: Result, screenshot: str | Path | None = None) -> None:
    """The part coloured by coverage in its chamber: in a window, or as a picture in the file ``screenshot``."""
    from chamberopt.output.results.load import Result
    from chamberopt.output.viewer import ViewState, inspect, result_info

    _require("result", result, Result, "simulate")
    inspect([result_info(result)], ViewState(), screenshot)


def _require(name: str, given: object, kind: type, maker: str) -> None:
    """InputError for what is no design, study or result, such as the path of one."""
    if not isinstance(given, kind):
        raise InputError(
            f"{name}: given {given!r}; give a {kind.__name__}, as chamberopt.{maker} makes it"
        )


def _warn(remarks: list[str]) -> None:
    for remark in remarks:
        warnings.warn(remark, stacklevel=3)

"""Python interface: load a design or study, simulate or optimise it, show the result.

    import chamberopt

    design = chamberopt.load_design("designs/gear.toml")
    result = chamberopt.simulate(design.changed({"shot.mass_g": 8}), "results/more-shot")
    result.metrics["mean_coverage"]            # Estimate(value=..., half_width=...), 95 % interval
    result.notes                               # cautions about the figures
    chamberopt.show(result, "more-shot.png")

A laboratory can measure candidates instead of simulating them: a Search proposes candidates, and
the laboratory tells it the measured figures, see docs/how_to/study.md.

The result's coverage.vtp has the coverage on a fine mesh of the part. part.vtp has the mean
coverage of each of the part's own triangles. pyvista and ParaView read both files.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from chamberopt.common.errors import InputError
from chamberopt.common.notebook import html_of
from chamberopt.design.design import Design
from chamberopt.design.load import load_design
from chamberopt.results.compare.comparison import Comparison
from chamberopt.results.load import Result, load_result
from chamberopt.search.ask_and_tell import Search
from chamberopt.search.run_sweep import SweepResult
from chamberopt.search.study import Study, load_study

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame
    from pyvista import Plotter, PolyData
    from trimesh import Trimesh

    from chamberopt.chamber.layout.pose import Pose
    from chamberopt.common.progress import Progress
    from chamberopt.design.calibration import Calibration
    from chamberopt.export.formats import FrameName
    from chamberopt.peening.virtual_strip import VirtualStrip
    from chamberopt.printers.notebook import PartsView
    from chamberopt.simulation.convergence import ConvergenceStudy
    from chamberopt.workflows.strip import StripPlace

__all__ = [
    "Design",
    "Result",
    "Search",
    "Study",
    "calibrate",
    "chart",
    "compare",
    "fields",
    "impacts",
    "load_design",
    "load_result",
    "load_study",
    "measure_accuracy",
    "optimise",
    "peen_strip",
    "plotter",
    "propose",
    "show",
    "simulate",
    "sweep",
    "trials",
    "view",
    "with_part",
]


def propose(
    part: str | Path,
    out: str | Path,
    *,
    target: Sequence[str] = (),
    unit: str | None = None,
    material: str = "",
    shot: str = "",
    ball_mm: float | None = None,
    shape: str | None = None,
    pose: Pose | None = None,
    shop: str | Path | None = None,
    intensity: str | None = None,
    coverage: float | None = None,
    calibration: str | Path | None = None,
    pilot: bool = True,
    workers: int | None = None,
    progress: bool = True,
) -> Design:
    """Propose a first design for a part, write it to a folder with studies, and return it.

    The file design.toml has the reason for each value beside it. The arguments are the options of
    `chamberopt new`.

    Args:
        part: the part's file.
        out: new or empty folder.
        target: what is to be peened: names of the file, or "all"; by default the likeliest.
        unit: of the numbers in the part's file, if it states none; "guess" takes the likeliest.
        material: alloy of the part.
        shot: material of the balls.
        pilot: simulate some seconds, so that times are estimates.
        workers: number of threads, by default one per core; it does not change the result.
        progress: False to show no steps.
    Raises:
        InputError: the part cannot be used, or no chamber can be built round it as wished.
    """
    from chamberopt.chamber.propose import first_design
    from chamberopt.chamber.propose.proposal import Wanted
    from chamberopt.chamber.shop import load_shop
    from chamberopt.common.files import claim_folder
    from chamberopt.common.progress import no_steps
    from chamberopt.geometry.meshes.units import STATED
    from chamberopt.workflows.propose import DESIGN, Wishes, require_file, write_proposal
    from chamberopt.workflows.simulate import teller_of

    of_shop = None if shop is None else load_shop(Path(shop))
    machine = None if calibration is None else Path(calibration)
    wanted = Wanted(
        unit or STATED, shape, material, shot, ball_mm, pose, of_shop, machine, coverage
    )
    wishes, names, path = Wishes(wanted, intensity, pilot), tuple(target), Path(part)
    require_file(path)
    wishes.require_possible()
    with claim_folder(out):
        pass  # reports a folder that is taken before the work begins
    with nullcontext() if progress else no_steps():
        first = first_design.propose(path, wanted, lambda _: names)
        given = first, path, wishes, lambda _: names, Path(out)
        done = write_proposal(*given, teller_of(progress), workers)
    _warn(one.text for one in done.made.warnings)
    return load_design(Path(out) / DESIGN)


def simulate(
    design: Design,
    out: str | Path,
    *,
    analytic: bool = False,
    tolerances: bool = False,
    ranges: bool = True,
    workers: int | None = None,
    progress: Progress | bool = True,
) -> Result:
    """Simulate one design, write the result to a folder, and return it as read from there.

    Args:
        out: new or empty folder.
        analytic: use the exact cylinder, box or prism instead of its mesh, if the chamber is one.
        tolerances: also simulate the effect of the design's tolerances. The figures are in
            result.record.tolerances.
        ranges: also simulate how far the figures may be off because friction etc. are not
            calibrated, in as many replicas again. The figures are in result.record.ranges.
        workers: number of threads, by default one per core. It does not change the result.
        progress: True to show bars in a terminal or notebook, False for nothing, or a function,
            called as progress(done, total, None) after each replica, and meanwhile with the parts
            of those that run. It counts those of the ranges anew.
    Raises:
        InputError: the chamber cannot be built, has no room for the shot or is not analytic.
        sim_core.SimulationError: a simulation had to stop.
    """
    from chamberopt.common.executor import local_executor
    from chamberopt.common.files import claim_folder
    from chamberopt.peening.tolerances import plan_tolerances
    from chamberopt.workflows.simulate import SimulationSettings, simulate_design, teller_of

    _require("design", design, Design, "load_design")
    if tolerances:
        plan_tolerances(design)
    with claim_folder(out) as folder, local_executor(workers) as executor:
        settings = SimulationSettings(analytic, tolerances, ranges)
        done = simulate_design(design, folder, executor, teller_of(progress), settings)
    _warn([*map(str, done.advice), *done.remarks])
    return load_result(out)


def optimise(
    study: Study,
    out: str | Path,
    *,
    ranges: bool = True,
    workers: int | None = None,
    progress: Progress | bool = True,
) -> Result:
    """Run a study, write it to a folder, and return the confirmed result of its best design.

    Args:
        out: new or empty folder, or the folder of the same study. An interrupted study is resumed.
            The result of a finished study is only read.
        ranges: also simulate whether the best design stays best where friction etc. are not
            calibrated.
        workers: number of threads, by default one per core. It does not change the result.
        progress: True for bars, False for nothing, or a function, called as
            progress(done, total, best) after each evaluation.
    Raises:
        InputError: the folder is another study's, the start cannot be simulated, or no candidate
            meets the constraints.
    """
    from chamberopt.common.executor import local_executor
    from chamberopt.search.study_folder import open_study_folder
    from chamberopt.workflows.optimise import optimise_study
    from chamberopt.workflows.simulate import teller_of

    _require("study", study, Study, "load_study")
    with open_study_folder(study, out) as folder, local_executor(workers) as executor:
        if not folder.finished:
            done = optimise_study(folder, executor, teller_of(progress), with_ranges=ranges)
            _warn([*map(str, done.advice), *done.remarks])
    return load_result(out)


def sweep(
    study: Study,
    out: str | Path,
    *,
    grid: int | None = None,
    sobol: int | None = None,
    seed: int | None = None,
    workers: int | None = None,
    progress: Progress | bool = True,
) -> SweepResult:
    """Simulate candidates on a grid or spread evenly over a study's [vary]; save them in a folder.

        swept = chamberopt.sweep(chamberopt.load_study("studies/gear.toml"), "map", sobol=64)
        for trial in swept.trials:
            print(trial.parameters, trial.objective)  # None if it failed: see trial.reason

    Args:
        out: new or empty folder, or the folder of the same sweep. An interrupted sweep is resumed.
            The result of a finished sweep is only read.
        grid: values of each parameter, bounds included. Give either grid or sobol.
        sobol: number of candidates, at Sobol points.
        seed: seed of the Sobol points, by default the study's optimizer.seed.
        workers: number of processes, by default one per core. It does not change the result.
        progress: True for bars, False for nothing, or a function, called as
            progress(done, total, best) after each candidate.
    Raises:
        InputError: the candidates cannot be planned, the folder is another study's, or no
            candidate can be simulated.
    """
    from chamberopt.search.run_sweep import plan_sweep
    from chamberopt.search.study_folder import open_study_folder
    from chamberopt.workflows.optimise import read_sweep, sweep_study
    from chamberopt.workflows.simulate import teller_of

    _require("study", study, Study, "load_study")
    plan = plan_sweep(study, grid, sobol, seed)
    with open_study_folder(study, out, plan.as_json()) as folder:
        if folder.finished:
            return read_sweep(folder, plan)
        done = sweep_study(folder, plan, teller_of(progress), workers)
    _warn([*map(str, done.advice), *done.remarks])
    return done.result


def compare(
    candidates: Sequence[str | Path],
    out: str | Path,
    *,
    treatment_time_s: float | None = None,
    workers: int | None = None,
    progress: Progress | bool = True,
) -> Comparison:
    """Compare designs and results with the first of them, and write the comparison into a folder.

    Args:
        candidates: design files, which are simulated, and results folders.
        out: new or empty folder.
        treatment_time_s: peening time of all candidates; results of another time are simulated
            again.
        workers: number of threads, by default one per core; it does not change the result.
        progress: True for bars, False for nothing, or a function, called as
            progress(done, total, None) in each step that counts.
    Raises:
        InputError: a candidate cannot be read, or not be compared with the first.
    """
    from chamberopt.common.executor import local_executor
    from chamberopt.common.files import claim_folder
    from chamberopt.workflows.comparison_folder import compare_candidates
    from chamberopt.workflows.simulate import teller_of

    with claim_folder(out) as folder:
        found, remarks = compare_candidates(
            candidates,
            folder,
            partial(local_executor, workers),
            teller_of(progress),
            treatment_time_s,
        )
    _warn(remarks)
    return found


def peen_strip(
    design: Design,
    out: str | Path,
    place: StripPlace | None = None,
    *,
    workers: int | None = None,
    progress: Progress | bool = True,
) -> VirtualStrip:
    """Peen a virtual Almen strip in place of the part, and save it in a folder.

    Args:
        out: new or empty folder.
        place: type, size and place of the strip. None for an A strip of full size in the lid.
        workers: number of threads, by default one per core; it does not change the result.
        progress: True for bars, False for nothing, or a function, called as
            progress(done, total, None) after each replica, and meanwhile with the parts of those
            that run.
    Raises:
        InputError: the strip does not fit, or the design lacks the zone.
    """
    from chamberopt.common.executor import local_executor
    from chamberopt.common.files import claim_folder
    from chamberopt.workflows.simulate import teller_of
    from chamberopt.workflows.strip import StripPlace, peen_strip_in

    _require("design", design, Design, "load_design")
    with claim_folder(out) as folder, local_executor(workers) as executor:
        peened, advice = peen_strip_in(
            design, place or StripPlace(), folder, executor, teller_of(progress)
        )
    _warn(map(str, advice))
    return peened


def calibrate(
    measured: str | Path,
    out: str | Path,
    *,
    workers: int | None = None,
    progress: Progress | bool = True,
) -> Calibration:
    """Calibrate the model to the measurements in a file, and save the machine in a folder.

    Args:
        measured: file of measurements (.toml), see docs/how_to/calibrate.md.
        out: new or empty folder. It receives machine.toml, which designs name as their calibration.
        workers: number of threads, by default one per core; it does not change the result.
        progress: True for bars, False for nothing, or a function, called as
            progress(done, total, None) in each step that counts.
    Raises:
        InputError: the measurements, or a design that they name, cannot be used.
    """
    from chamberopt.common.executor import local_executor
    from chamberopt.common.files import claim_folder
    from chamberopt.peening.measured import load_measured
    from chamberopt.workflows.calibrate import calibrate_machine
    from chamberopt.workflows.simulate import teller_of

    loaded, designs = load_measured(Path(measured))
    with claim_folder(out) as folder, local_executor(workers) as executor:
        found, _ = calibrate_machine(loaded, designs, folder, executor, teller_of(progress))
    return found.table


def measure_accuracy(
    design: Design, out: str | Path, *, budget_s: float = 300.0, progress: Progress | bool = True
) -> ConvergenceStudy:
    """Measure how the error of a design's coverage etc. depends on numerical settings and CPU time.

    Args:
        out: new or empty folder.
        budget_s: CPU seconds to spend on simulations.
        progress: True for bars, False for nothing, or a function, called as
            progress(done, total, None) in each step that counts.
    Raises:
        InputError: the budget is not positive, or the design cannot be simulated.
    """
    from chamberopt.common.executor import local_executor
    from chamberopt.common.files import claim_folder
    from chamberopt.simulation.convergence import require_budget
    from chamberopt.workflows.accuracy import measure_accuracy as measure
    from chamberopt.workflows.simulate import teller_of

    _require("design", design, Design, "load_design")
    require_budget(budget_s)
    with claim_folder(out) as folder, local_executor() as executor:
        return measure(design, budget_s, folder, executor, teller_of(progress))


def show(result: Result, screenshot: str | Path | None = None) -> None:
    """Show the part of a result in its chamber in a window, coloured by coverage.

    Args:
        screenshot: image file to write instead of opening a window.
    """
    from chamberopt.viewer.opened_result import result_info
    from chamberopt.viewer.view_state import ViewState
    from chamberopt.viewer.window import inspect

    _require("result", result, Result, "load_result")
    inspect([result_info(result)], ViewState(), screenshot)


def view(*results: Result) -> PartsView:
    """Return the parts of results in 3D, side by side, to be shown at the end of a notebook's cell.

    The view is that of a report: it turns, is coloured by each quantity, and is cut and measured.
    The notebook then holds the part, some MB. Raises InputError for a part that is too large.
    """
    from chamberopt.printers.notebook import PartsView

    _require_results("view", results)
    return PartsView(results)


def chart(*results: Result) -> Figure:
    """Return a chart of the coverage of results over peening time, as a figure of matplotlib.

    Thick lines are means; 95 % of the area has more than thin ones. Bands are 95 % intervals.

        figure = chamberopt.chart(result)
        figure.axes[0].set_title("gear, 60 mm")
        figure.savefig("gear.pdf")
    """
    from chamberopt.pictures.charts.colours import line_style
    from chamberopt.pictures.charts.coverage import CoverageCurve, coverage_figure

    _require_results("chart", results)
    curves = [
        CoverageCurve(one.folder.name, one.record.coverage_against_time, line_style(k))
        for k, one in enumerate(results)
    ]
    return coverage_figure(curves, max(one.design.process.treatment_time for one in results))


def plotter(
    *results: Result,
    quantity: str = "coverage",
    time_s: float | None = None,
    off_screen: bool = True,
) -> Plotter:
    """Return the parts of results in their chambers, drawn on a plotter of PyVista.

        drawn = chamberopt.plotter(result, quantity="mean_normal_speed")
        drawn.camera.zoom(1.5)
        drawn.screenshot("gear.png")

    Args:
        quantity: what colours the parts, as `chamberopt inspect --quantity` names it.
        time_s: peening time after which it is shown [s]; by default the treatment time.
        off_screen: False for a window, which `.show()` opens.
    Raises:
        InputError: a result lacks the quantity, or its files were changed.
    """
    from chamberopt.viewer.opened_result import result_info
    from chamberopt.viewer.plotter import ResultPlotter
    from chamberopt.viewer.view_state import ViewState
    from chamberopt.viewer.window import open_results

    _require_results("plotter", results)
    state = ViewState(quantity=quantity, time_s=time_s)
    view = ResultPlotter(open_results([*map(result_info, results)], state), off_screen)
    view.draw(state)
    view.aim(state)
    drawn: Plotter = view.plotter
    return drawn


def with_part(design: Design, mesh: Trimesh | PolyData, file: str | Path, *, unit: str) -> Design:
    """Return a copy of a design with a mesh of trimesh or PyVista as its part.

    The mesh is written to `file`, so that the design can be saved and its results name their part.
    The design keeps its pose and its target, whose names of surfaces a PLY file does not have.

    Args:
        file: a .ply file, new or with the same mesh.
        unit: unit of the mesh's numbers: um, mm, cm, m or in.
    Raises:
        InputError: the mesh is empty, open or crosses itself, another file is there, or the design
            cannot have the part.
    """
    from chamberopt.workflows.part_file import write_part

    _require("design", design, Design, "load_design")
    return design.changed({"part.mesh": write_part(mesh, file, unit), "part.unit": unit})


def impacts(
    result: Result,
    *,
    frame: FrameName = "part",
    replicas: int | None = None,
    workers: int | None = None,
    progress: Progress | bool = True,
) -> DataFrame:
    """Return every impact on the part of a result, a row for each, in a pandas DataFrame.

    A result stores no impacts: it is simulated again, and must be the same to the last bit. An
    impact takes about 100 bytes. The columns are those of docs/reference/exports.md.

    Args:
        frame: coordinates: "part", as in the part's file and in its unit, or "chamber", in mm.
        replicas: number of replicas, beginning with the first, which are then not compared with the
            result; None for all.
        workers: number of threads, by default one per core.
        progress: True for bars, False for nothing, or a function, called as
            progress(done, total, None) after each replica, and meanwhile with the parts of those
            that run.
    Raises:
        InputError: the simulation is not the result's, or pandas is missing (extra "notebook").
    """
    from chamberopt.common.executor import local_executor
    from chamberopt.export.data_frames import impacts_frame, require_pandas
    from chamberopt.results.rebuild import rebuild_chamber
    from chamberopt.workflows.simulate import teller_of

    _require("result", result, Result, "load_result")
    require_pandas("impacts")
    rebuilt, teller = rebuild_chamber(result), teller_of(progress)
    with local_executor(workers) as executor:
        teller.compile(result.design, rebuilt.chamber, rebuilt.cavity)
        with teller.step("impacts, replicas", replicas or result.record.replicas) as shown:
            return impacts_frame(
                result, rebuilt, executor, frame=frame, replicas=replicas, progress=shown
            )


def fields(result: Result, *, frame: FrameName = "part") -> DataFrame:
    """Return the values on each triangle of a result's part, such as coverage, in a DataFrame.

    Its rows are the triangles of part.vtp, its columns the centre of each triangle and the values
    of docs/reference/exports.md. Units and meanings are in `fields(result).attrs["columns"]`.

    Args:
        frame: coordinates: "part", as in the part's file and in its unit, or "chamber", in mm.
    Raises:
        InputError: a file of the result was changed, or pandas is missing (extra "notebook").
    """
    from chamberopt.export.data_frames import fields_frame

    _require("result", result, Result, "load_result")
    return fields_frame(result, frame)


def trials(study: Result | SweepResult | str | Path) -> DataFrame:
    """Return the evaluations of a study or sweep, a row for each, in a pandas DataFrame.

    NAME_pm is the 95 % half-width of NAME. Figures without a number, such as a time that words like
    "never" stand for, are NaN.

    Args:
        study: a study's result, a sweep, or the folder of either, which need not be finished.
    Raises:
        InputError: there are no evaluations, or pandas is missing (extra "notebook").
    """
    from chamberopt.export.data_frames import trials_frame

    return trials_frame(Path(study) if isinstance(study, str | Path) else study.folder)


# How a notebook shows what this module returns. It is told here, above all that it takes.


@html_of.register
def _design_html(design: Design) -> str:
    from chamberopt.printers.notebook import design_html

    return design_html(design)


@html_of.register
def _study_html(study: Study) -> str:
    from chamberopt.printers.notebook import study_html

    return study_html(study)


@html_of.register
def _result_html(result: Result) -> str:
    from chamberopt.printers.notebook import result_html

    return result_html(result)


@html_of.register
def _sweep_html(sweep: SweepResult) -> str:
    from chamberopt.printers.notebook import sweep_html

    return sweep_html(sweep)


@html_of.register
def _comparison_html(comparison: Comparison) -> str:
    from chamberopt.printers.notebook import comparison_html

    return comparison_html(comparison)


def _require(name: str, given: object, kind: type, source: str) -> None:
    """Raise InputError unless an argument has the type `kind`.

    A common mistake is a path in place of a loaded object.


    Args:
        name: name of the argument.
        given: value of the argument.
        source: function of this package that returns a value of the type.
    """
    if not isinstance(given, kind):
        raise InputError(
            f"{name}: given {given!r}; give a {kind.__name__}, as chamberopt.{source} returns it"
        )


def _warn(remarks: Iterable[str]) -> None:
    for remark in remarks:
        warnings.warn(remark, stacklevel=3)


def _require_results(name: str, results: Sequence[Result]) -> None:
    """Raise InputError unless all of at least one value are results.

    Args:
        name: the function that they were given to.
    """
    if not results:
        text = "given no result; give one or more, as chamberopt.load_result reads"
        raise InputError(f"{name}: {text}")
    for result in results:
        _require("result", result, Result, "load_result")

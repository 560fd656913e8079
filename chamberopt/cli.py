"""The command line: thin, one function a command. Results go to stdout, progress and errors to stderr.

Exit status: 0 done, 1 the simulation, a worker or the disk failed, 2 something to put right in the input,
130 interrupted.
"""

from __future__ import annotations

import json as json_format
import shlex
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager, nullcontext, suppress
from importlib.metadata import version
from io import TextIOWrapper
from itertools import count
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, CycloptsError, Parameter

from chamberopt.errors import InputError

# Heavy packages (numba, trimesh, pyvista, nlopt) are imported inside the commands: --help answers at once.
if TYPE_CHECKING:
    from concurrent.futures import Executor

    from chamberopt.accuracy import Evaluation
    from chamberopt.advice import Advice
    from chamberopt.chamber import Chamber
    from chamberopt.config import Design, Study
    from chamberopt.estimate import Estimate
    from chamberopt.mesh_io import SurfaceError
    from chamberopt.reach.reach import Reach
    from chamberopt.studies.interrupt import Interrupt
    from chamberopt.studies.record import Record
    from sim_core import AnalyticCavity

app = App(
    name="chamberopt",
    help="Designs ultrasonic shot peening chambers for uniform coverage of a part.",
    version=version("chamberopt"),
    suppress_keyboard_interrupt=False,
)

Json = Annotated[bool, Parameter(name="--json", negative="", help="Print JSON on stdout instead of text.")]
Workers = Annotated[
    int | None, Parameter(name="--workers", help="Workers on this machine; one per core if left out. Same figures.")
]
Cluster = Annotated[
    str | None,
    Parameter(
        name="--cluster", help="Dask scheduler to work on: tcp://HOST:PORT, or its scheduler file. Same figures."
    ),
]
Out = Annotated[Path | None, Parameter(name="--out", help="Folder for the results; new or empty.")]
Resumable = Annotated[
    Path | None,
    Parameter(name="--out", help="Folder for the results; new, empty, or of this study where it was stopped."),
]


@app.command
def check(
    file: Path, /, *, pilot: bool = True, screenshot: Path | None = None, json: Json = False, out: Out = None
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
    from chamberopt.chamber import build_chamber
    from chamberopt.checks.checkup import describe, shot_reach
    from chamberopt.config import Study, load
    from chamberopt.disk import new_folder, write_text
    from chamberopt.mesh_io import SurfaceError
    from chamberopt.viewer import write_chamber

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
            name: {"low": low, "start": design.value(name), "high": high} for name, (low, high) in loaded.vary.items()
        }
        facts["evaluations"] = loaded.optimizer.evaluations
    if out is not None:
        facts["folder"] = str(new_folder(out))
    kind = "study" if isinstance(loaded, Study) else "design"
    if not json:
        print("\n".join([f"{file}: a usable {kind}", *_facts(facts)]), flush=True)
    if pilot:
        facts["effects"] = _advice(design, chamber)
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
    from chamberopt.accuracy import evaluate
    from chamberopt.analytic import analytic_cavity
    from chamberopt.chamber import build_chamber
    from chamberopt.config import load_design
    from chamberopt.progress import progress_bar
    from chamberopt.results import write_simulation
    from chamberopt.workers.executor import open_executor

    asked = load_design(design)
    chamber = build_chamber(asked)
    cavity = analytic_cavity(asked, chamber) if analytic else None
    _warn(asked, chamber)
    with _results(out, design.stem) as folder, open_executor(workers, cluster) as executor:
        candidate, advice = _settled(asked, chamber, executor)
        _compile(candidate, chamber, cavity)
        with progress_bar("replicas") as progress:
            evaluation = evaluate(candidate, chamber, executor, progress, cavity=cavity)
        _remark(write_simulation(folder, candidate, chamber, evaluation, advice))
    notes = (*map(str, advice), *chamber.notes, *evaluation.notes)
    _say([*_estimates(evaluation), *_notes(notes)], folder, json)


@app.command
def accuracy(design: Path, /, *, budget_s: float = 300.0, json: Json = False, out: Out = None) -> None:
    """What accuracy costs: every knob that trades it for time against a reference, and what to set for 5, 1, 0.1 %.

    Parameters
    ----------
    design
        Design file (.toml).
    budget_s
        CPU seconds to spend on simulating; more tell smaller errors apart.
    """
    from chamberopt.config import load_design
    from chamberopt.price.ladder import climb, require_budget
    from chamberopt.price_list import as_json, as_text, write_price_list
    from chamberopt.progress import progress_bar
    from chamberopt.workers.executor import local_executor

    require_budget(budget_s)
    candidate = load_design(design)
    with _results(out, f"{design.stem}-accuracy") as folder:
        with local_executor() as executor, progress_bar("CPU seconds") as progress:
            ladder = climb(candidate, budget_s, executor, progress, _compile)
        write_price_list(folder, ladder)
    if json:
        print(json_format.dumps({**as_json(ladder), "folder": str(folder)}, indent=2))
    else:
        print("\n".join([*as_text(ladder), f"results in {folder}"]))


@app.command
def run(
    study: Path, /, *, workers: Workers = None, cluster: Cluster = None, json: Json = False, out: Resumable = None
) -> None:
    """Run a study: search for a better design, confirm it on fresh seeds, write it as best.toml. With the --out of a
    run that was stopped it goes on from there. Ctrl-C: once to stop after this evaluation, twice to stop now.

    Parameters
    ----------
    study
        Study file (.toml).
    """
    from chamberopt.studies.interrupt import Interrupt

    with Interrupt() as interrupt:
        from chamberopt.chamber import build_chamber
        from chamberopt.config import load_study
        from chamberopt.studies.record import open_record
        from chamberopt.workers.executor import open_executor

        question = load_study(study)
        start = build_chamber(question.design)
        if out is None:
            _remark(_unfinished(study))
        place = _results(None, study.stem) if out is None else nullcontext(out)
        with place as folder, open_record(question, folder) as record:
            if record.finished:
                _finished(record.folder, json)
                return
            command = f"to go on: {_command('run', study, '--out', record.folder)}"
            try:
                with open_executor(workers, cluster) as executor:
                    _run(question, start, record, executor, interrupt, command, json)
            except InputError:
                raise
            except BaseException as error:
                if record.begun:
                    error.add_note(command)
                raise


def _run(
    question: Study, start: Chamber, record: Record, executor: Executor, interrupt: Interrupt, how_to_go_on: str,
    json: bool,
) -> None:  # fmt: skip
    """A study from where its record stands to what is said of its result. start: the chamber of its design."""
    from chamberopt.chamber import build_chamber
    from chamberopt.progress import progress_bar
    from chamberopt.results import write_study
    from chamberopt.studies.study import go_on

    question, advice = record.settled(lambda design: _settled(design, start, executor))
    design = question.design
    _compile(design, start)
    if record.trials:
        _remark([f"{record.folder}: {len(record.trials)} evaluations are there; going on from the next"])
    with progress_bar("evaluations") as progress:
        interrupt.be_patient(how_to_go_on)
        result = go_on(question, record, executor, progress, stop=lambda: interrupt.asked)
    _remark(write_study(record.folder, result, advice))
    _warn(result.best.design, build_chamber(result.best.design, result.target))
    lines = [f"{'parameter':34}{'start':>12}{'best':>12}"]
    lines += [
        f"{name:34}{question.design.value(name):12.5g}{result.best.design.value(name):12.5g}" for name in question.vary
    ]
    lines += [
        "",
        "start",
        *_estimates(result.start.evaluation),
        "",
        "best",
        *_estimates(result.best.evaluation),
    ]
    verdict = "better than the start" if result.improved else "within the noise of the start"
    lines += ["", f"{_row('gain', result.gain)}: {verdict}"]
    if result.findings:
        lines += ["", *result.findings.sentences(), ""]
    if question.objective.pareto:
        lines += [f"the front of {' and '.join(question.objective.pareto)}: pareto.csv, pareto.png", ""]
    fine = result.best.evaluation
    lines += [
        f"± 95 % intervals; start and best from {len(fine.replicas)} replicas of {design.process.recorded_time:g} s on "
        f"seeds of their own, the search's figures in history.csv from {_said(question.drafted(design))}"
    ]
    notes = (*map(str, advice), *result.doubts, *result.at_bounds, *start.notes, *result.best.evaluation.notes)
    _say([*lines, *_notes(notes)], record.folder, json)


def _finished(folder: Path, json: bool) -> None:
    """What `run` says of a study that needs nothing more."""
    from chamberopt.results import load_result, summary

    _remark([f"{folder}: this study is finished, nothing was run; to run it anew give another folder (--out)"])
    _say([f"best design: {summary(load_result(folder))}"], folder, json)


def _unfinished(study: Path) -> list[str]:
    """Earlier runs of a study that were stopped, by their folders' names: what is run now begins anew."""
    from chamberopt.studies.record import is_finished, is_study_folder

    names = [study.stem, *(path.name for path in sorted(Path("results").glob(f"{study.stem}-[0-9]*")))]
    stopped = [folder for name in names if is_study_folder(folder := Path("results", name)) and not is_finished(folder)]
    return [f"{folder}: not finished; to go on there: {_command('run', study, '--out', folder)}" for folder in stopped]


def _command(*words: object) -> str:
    """A command of ours as a shell takes it."""
    return shlex.join(["chamberopt", *map(str, words)])


@app.command
def sweep(
    study: Path, /, *, grid: int | None = None, sobol: int | None = None, seed: int | None = None,
    workers: Workers = None, cluster: Cluster = None, json: Json = False, out: Resumable = None,
) -> None:  # fmt: skip
    """Map a study: simulate candidates all over [vary], on a grid or evenly spread, instead of searching. With the
    --out of a sweep that was stopped it goes on from there.

    Parameters
    ----------
    study
        Study file (.toml).
    grid
        Values of every parameter, bounds included: N parameters make GRID^N candidates.
    sobol
        Candidates in all, as Sobol points; powers of 2 spread best.
    seed
        Of the Sobol points; the study's optimizer.seed if left out.
    """
    from chamberopt import maps
    from chamberopt.chamber import build_chamber
    from chamberopt.config import load_study
    from chamberopt.progress import progress_bar
    from chamberopt.studies.sweep import plan_sweep, run_sweep
    from chamberopt.workers.executor import open_executor

    question = load_study(study)
    plan = plan_sweep(question, grid, sobol, seed)
    start = build_chamber(question.design)
    place = _results(None, f"{study.stem}-sweep") if out is None else nullcontext(out)
    with place as folder, open_executor(workers, cluster, "processes") as executor:
        design, advice = _settled(question.design, start, executor)
        question = question.model_copy(update={"design": design})
        _compile(design, start)
        with progress_bar("candidates") as progress:
            found = run_sweep(question, plan, folder, executor, progress)
        _remark(maps.write_sweep(folder, found))
    lines = [f"{len(found.trials)} candidates in {found.seconds:.0f} s, {_said(question.drafted(design))} each"]
    best = found.best
    if best is not None and best.objective is not None:
        lines += ["", f"best, number {best.number}", *(f"{name:34}{x:12.5g}" for name, x in best.parameters.items())]
        goal = {question.objective.name: best.objective, **best.metrics}
        lines += [_row(name, estimate) for name, estimate in goal.items()]
    failed = [trial for trial in found.trials if trial.objective is None]
    reasons = [f"{len(failed)} candidates could not be simulated, the first for: {failed[0].reason}"] if failed else []
    _say([*lines, *_notes([*map(str, advice), *reasons, maps.caution(found)])], folder, json)


@app.command
def compare(*results: Path, json: Json = False, out: Out = None) -> None:
    """Compare results of the same part: what differs in the designs, and what that did to the coverage.

    Parameters
    ----------
    results
        Two or more results folders.
    """
    from chamberopt import compare as comparing

    comparison = comparing.compare(results)
    with _results(out, "compare") as folder:
        _remark(comparing.write_comparison(folder, comparison))
    if json:
        print(json_format.dumps({**comparison.as_json(), "folder": str(folder)}, indent=2))
    else:
        print(f"{comparison.as_text()}\nresults in {folder}")


@app.command
def inspect(result: Path, /, *, screenshot: Path | None = None, json: Json = False, out: Out = None) -> None:
    """Look at a result in 3D: the part coloured by coverage, inside its chamber. --out: a picture goes there.

    Parameters
    ----------
    result
        Results folder.
    screenshot
        Write a picture to this file instead of opening a window.
    """
    from chamberopt import viewer
    from chamberopt.results import load_result, summary

    loaded = load_result(result)
    if screenshot is None and out is not None:
        with _results(out, "inspect") as folder:
            screenshot = folder / "inspect.png"
    line = summary(loaded)
    if not json:
        print(line)
    viewer.inspect(loaded.folder, screenshot, title=f"{loaded.folder.resolve().name}\n{line}")
    if json:
        print(json_format.dumps({**loaded.data, "folder": str(loaded.folder), "screenshot": _text(screenshot)}))
    elif screenshot is not None:
        print(f"picture in {screenshot}")


@contextmanager
def _results(out: Path | None, name: str) -> Iterator[Path]:
    """Where results go: --out (new or empty), else the first free of results/NAME, results/NAME-2 ...

    When nothing came of it the folder does not stay behind empty.
    """
    from chamberopt.disk import is_free, new_folder

    names = (name if number == 1 else f"{name}-{number}" for number in count(1))
    free = (folder for name in names if is_free(folder := Path("results", name)))
    folder = new_folder(next(free) if out is None else out)
    try:
        yield folder
    except BaseException:
        with suppress(OSError):
            if not any(folder.iterdir()):
                folder.rmdir()
        raise


def _picture_of_fault(fault: SurfaceError, screenshot: Path) -> None:
    """What is wrong with a part's surface, in red; the message itself follows on stderr."""
    from chamberopt.viewer import part_picture

    text = fill(str(fault), 110)
    _remark([part_picture(fault.corners, text, screenshot, edges=fault.edges) or f"picture in {screenshot}"])


def _picture_of_target(chamber: Chamber, found: Reach, screenshot: Path) -> None:
    """The part with its target, and what of it the shot does not reach."""
    from chamberopt.reach.reach import part_share
    from chamberopt.viewer import part_picture

    part = chamber.part
    missed = part.target & (part_share(found, chamber.source, len(part.triangles)) <= 0.5)
    title = f"{part.name}: the target in orange" + (", in red where hardly a ball can touch it" if missed.any() else "")
    corners = part.vertices[part.triangles]
    drawn = part_picture(corners, title, screenshot, part.target, missed=missed, chamber=chamber)
    _remark([drawn or f"picture in {screenshot}"])


def _compile(design: Design, chamber: Chamber, cavity: AnalyticCavity | None = None) -> None:
    """Compiles, aloud, before the bar starts: else its first minute would look like a hang."""
    from chamberopt.process import chamber_mesh, require_countable, scene_physics
    from chamberopt.progress import announce_compilation

    require_countable(design)
    shot = design.shot
    physics = scene_physics(design, cavity or chamber_mesh(chamber))
    announce_compilation(physics, shot.count, shot.mix is None, cavity is not None and cavity.radius is not None)


def _settled(design: Design, chamber: Chamber, executor: Executor) -> tuple[Design, list[Advice]]:
    """The design with its effects chosen, and why, where it leaves them to us."""
    from chamberopt.advice import settled
    from chamberopt.progress import progress_bar

    with progress_bar("pilot runs") as progress:
        return settled(design, chamber, executor, progress, lambda variant: _compile(variant, chamber))


def _advice(design: Design, chamber: Chamber) -> list[dict[str, Any]]:
    """Which effects a design needs, by pilot runs."""
    from chamberopt.advice import advise, settled
    from chamberopt.progress import progress_bar
    from chamberopt.workers.executor import local_executor

    def prepare(variant: Design) -> None:
        _compile(variant, chamber)

    print("pilot runs, with each effect switched (--no-pilot skips them) ...", file=sys.stderr, flush=True)
    with local_executor() as executor, progress_bar("pilot runs") as progress:
        advice = settled(design, chamber, executor, progress, prepare)[1]
        advice = advice or advise(design, chamber, executor, progress, prepare)
    return [one.as_json() for one in advice]


def _remark(remarks: Sequence[str]) -> None:
    """What went less than well, such as a picture skipped: to stderr, so that --json stays clean."""
    for remark in remarks:
        print(remark, file=sys.stderr)


def _warn(design: Design, chamber: Chamber) -> None:
    """What `check` would warn of, to stderr."""
    from chamberopt.checks.checkup import warnings

    _remark([f"warning: {text}" for text in warnings(design, chamber)])


def _text(path: Path | None) -> str | None:
    return None if path is None else str(path)


def _estimates(evaluation: Evaluation) -> list[str]:
    """Objective and metrics, a line each, with their 95 % intervals."""
    rows = {evaluation.objective_name: evaluation.objective, **evaluation.metrics}
    return [_row(name, estimate) for name, estimate in rows.items()]


def _row(name: str, estimate: Estimate) -> str:
    return f"{name:34}{estimate.value:12.5g} ± {estimate.half_width:.2g}"


def _said(design: Design) -> str:
    """How accurate a search is, in words."""
    accuracy = design.process.accuracy
    if accuracy.coverage is not None:
        return f"as many as make ± {accuracy.coverage:g}"
    return f"{accuracy.replicas} replicas of {design.process.recorded_time:g} s"


def _notes(notes: Sequence[str]) -> list[str]:
    return [f"note: {note}" for note in notes]


def _facts(table: Mapping[str, Any], prefix: str = "") -> list[str]:
    """A nested table as aligned lines; lists of sentences as notes and warnings."""
    lines: list[str] = []
    for name, value in table.items():
        if isinstance(value, Mapping) and set(value) == {"low", "start", "high"}:
            lines.append(f"{prefix + name:33} {value['start']:g} in {value['low']:g} .. {value['high']:g}")
        elif isinstance(value, Mapping):
            lines += _facts(value, f"{prefix}{name}.")
        elif name in ("notes", "warnings"):
            lines += [f"{name.removesuffix('s')}: {text}" for text in value]
        else:
            text = _listed(value, name) if isinstance(value, list) else str(value)
            lines.append(f"{prefix + name:34}{text}")
    return lines


def _listed(values: list[Any], name: str) -> str:
    """Sizes as 1 x 2 x 3, other numbers and names with commas."""
    if values and isinstance(values[0], float):
        return (" x " if name.startswith("bounding_box") else ", ").join(f"{value:g}" for value in values)
    return ", ".join(values) or "none"


def _say(lines: Sequence[str], folder: Path, json: bool) -> None:
    """The outcome on stdout: text, or what result.json holds; either way with the folder."""
    if json:
        result = json_format.loads((folder / "result.json").read_text(encoding="utf-8"))
        print(json_format.dumps({**result, "folder": str(folder)}, indent=2))
    else:
        print("\n".join([*lines, f"results in {folder}"]))


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; its exit status. Every error a user can put right is one message on stderr."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a terminal without ± must not cost the figures
    try:
        app(
            list(sys.argv[1:] if arguments is None else arguments),
            exit_on_error=False,
            print_error=False,
            result_action="return_value",
        )
    except CycloptsError as error:
        return _failed(f"{str(error).rstrip()} (chamberopt --help lists what there is)", 2)
    except InputError as error:
        return _failed(str(error), 2)
    except KeyboardInterrupt as error:
        return _failed("interrupted; what had been finished stays on disk", 130, error)
    except BrokenPipeError:  # the reader of our stdout left, as `head` does
        sys.stderr.close()
        return 0
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return _failed(f"{where}{error.strerror or error}; what had been finished stays on disk", 1, error)
    except MemoryError as error:
        return _failed("out of memory; what had been finished stays on disk", 1, error)
    except BrokenExecutor as error:
        what = (
            f"{str(error) or 'a worker process died, twice'} (killed from outside, or out of memory: use fewer workers)"
        )
        return _failed(f"{what}; what had been finished stays on disk", 1, error)
    except (ValueError, RuntimeError) as error:
        return _simulator_failed(error)
    return 0


def _simulator_failed(error: Exception) -> int:
    """sim_core's own two errors; anything else is ours, and shows where it came from."""
    import sim_core

    if isinstance(error, sim_core.SceneError):
        return _failed(str(error), 2, error)
    if isinstance(error, sim_core.SimulationError):
        return _failed(f"the simulation stopped: {error}", 1, error)
    raise error


def _failed(message: str, status: int, error: BaseException | None = None) -> int:
    """Says what went wrong, and what was noted on the way up: which candidate it was, how to go on."""
    print("\n".join([message, *getattr(error, "__notes__", ())]), file=sys.stderr)
    return status

"""Save a finished simulation, study or sweep: data, pictures and, as the last file, result.json."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

from chamberopt.common.files import make_output_folder, whole_or_nothing
from chamberopt.documents.coverage import summary
from chamberopt.documents.study import evaluated
from chamberopt.documents.wording import objective_label
from chamberopt.pictures.charts.study import convergence_picture, pareto_picture, slices_picture
from chamberopt.pictures.charts.sweep import sweep_map
from chamberopt.pictures.coverage import draw_coverage
from chamberopt.results.load import START
from chamberopt.results.write import (
    NO_SPREADS,
    write_result,
    write_simulation,
    write_study,
    write_sweep,
)
from chamberopt.simulation.field_values import CandidateResult, complete_result

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from chamberopt.peening.range_result import Spreads, StudyRanges
    from chamberopt.results.records import CandidateRecord
    from chamberopt.search.candidate import ConfirmedCandidate
    from chamberopt.search.run_study import StudyResult
    from chamberopt.search.run_sweep import SweepResult
    from chamberopt.simulation.advice import Advice
    from chamberopt.simulation.evaluation import Evaluation


def save_simulation(
    folder: str | Path,
    design: Design,
    chamber: Chamber,
    evaluation: Evaluation,
    advice: Sequence[Advice] = (),
    warned: Sequence[str] | None = None,
    spreads: Spreads = NO_SPREADS,
) -> tuple[CandidateRecord, list[str]]:
    """Save a simulation in a new or empty folder.

    Writes design.toml, coverage.vtp, part.vtp, hits.npz, arrays.npz, chamber.stl, chamber.vtp,
    result.json and coverage.png.

    Args:
        folder: new or empty folder.
        design: the simulated design, with its optional physical effects chosen.
        chamber: chamber of the design.
        evaluation: evaluation of the design.
        advice: reasons for the physical effects, if the design left their choice to the program.
        warned: warnings of `chamberopt check`; None if it was not run.
        spreads: effect of the design's tolerances, and ranges of what is not calibrated.

    Returns:
        What result.json says, and remarks for the user, such as why a picture was skipped.
    """
    folder = make_output_folder(folder)
    with whole_or_nothing(folder):  # a folder without result.json is of no use
        completed = complete_result(design, chamber, evaluation)
        record = write_simulation(folder, completed, spreads)
        write_result(folder, record, advice, warned)
    picture = folder / "coverage.png"
    return record, _draw_coverage([folder], [evaluation], [folder.resolve().name], picture)


def save_study(
    folder: str | Path,
    study_result: StudyResult,
    advice: Sequence[Advice] = (),
    warned: Sequence[str] | None = None,
    ranges: StudyRanges | None = None,
) -> list[str]:
    """Complete the folder of a finished study.

    Adds the data files of the best and the start design, and coverage.png (of the best),
    before_after.png, convergence.png, slices.png (if a model could be fitted) and pareto.png (for
    two objectives). result.json is written last. A study that is stopped while it is being saved
    therefore counts as unfinished, and is saved again when it is resumed.

    Args:
        folder: folder of the study.
        study_result: result of the study.
        advice: reasons for the physical effects, if the design left their choice to the program.
        warned: warnings of `chamberopt check` on the best design; None if it was not run.
        ranges: ranges of what is not calibrated; None if they were not simulated.

    Returns:
        Remarks for the user, such as why a picture was skipped.
    """
    folder = Path(folder)

    def complete(one: ConfirmedCandidate) -> CandidateResult:
        return complete_result(one.design, study_result.chamber_of(one), one.evaluation)

    # Start and best are completed in threads while the diagrams are drawn, to keep all cores busy.
    with ThreadPoolExecutor(2) as threads:
        results = threads.map(complete, (study_result.start, study_result.best))
        _draw_diagrams(folder, study_result)
        start, best = results
        record = write_study(folder, study_result, start, best, ranges)
        remarks = _draw_start_and_best(folder, study_result, threads)
    write_result(folder, record, advice, warned)
    return remarks


def save_sweep(folder: str | Path, sweep: SweepResult) -> list[str]:
    """Complete the folder of a finished sweep and return remarks for the user.

    Adds history.csv, best.toml (if a candidate meets the constraints), map.png and, last,
    result.json.
    """
    folder = Path(folder)
    record = write_sweep(folder, sweep)
    remarks = sweep_map(folder / "map.png", sweep, objective_label(sweep.study.objective.goals[0]))
    write_result(folder, record)
    return remarks


def _draw_diagrams(folder: Path, study_result: StudyResult) -> None:
    """Draw convergence.png, slices.png and pareto.png of a study, if their data are there."""
    axes = [objective_label(one) for one in study_result.study.objective.goals]
    candidates = [evaluated(one, axes[0]) for one in study_result.trials]
    convergence_picture(folder / "convergence.png", study_result, candidates, axes[0])
    if study_result.sensitivity:
        slices_picture(folder / "slices.png", study_result, study_result.sensitivity, axes[0])
    if study_result.study.objective.pareto:
        pareto_picture(folder / "pareto.png", study_result, axes)


def _draw_start_and_best(folder: Path, study_result: StudyResult, threads: Executor) -> list[str]:
    """Draw the coverage of a study's start and best design from the study's data files.

    Return remarks on skipped pictures.
    """
    start, best = study_result.start.evaluation, study_result.best.evaluation
    is_start = study_result.best is study_result.start
    best_name = "best design, which is the start" if is_start else "best design"
    folders, names = [folder / START, folder], ["start", best_name]
    pictures = [
        threads.submit(_draw_coverage, *one)
        for one in (
            ([folder], [best], [best_name], folder / "coverage.png"),
            (folders, [start, best], names, folder / "before_after.png"),
        )
    ]
    return list(dict.fromkeys(remark for one in pictures for remark in one.result()))


def _draw_coverage(
    folders: Sequence[Path], evaluations: Sequence[Evaluation], names: Sequence[str], picture: Path
) -> list[str]:
    titles = [f"{name}\n{summary(one)}" for name, one in zip(names, evaluations, strict=True)]
    skipped = draw_coverage(folders, titles, picture)
    return [skipped] if skipped else []

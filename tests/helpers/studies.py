"""A study or a sweep from a new or interrupted folder to its result."""

from pathlib import Path

from chamberopt.common.executor import SerialExecutor
from chamberopt.search.run_study import StudyProgress, StudyResult, run_study
from chamberopt.search.run_sweep import SweepPlan, SweepResult, run_sweep
from chamberopt.search.study import Study
from chamberopt.search.study_folder import open_study_folder


def assert_total_never_grows(progress: list[tuple[int, int, float | None]]) -> None:
    """What was told of a study's progress: it never falls behind, and its end is all there is."""
    done, totals = ([one[k] for one in progress] for k in (0, 1))
    assert done == sorted(done)
    assert totals == sorted(totals, reverse=True)
    assert done[-1] == totals[-1]


def run_in_folder(
    study: Study, path: Path, executor=None, progress=None, simulator=None, stop=None, at_once=None
) -> StudyResult:
    with open_study_folder(study, path) as folder:
        executor = executor or SerialExecutor()
        told = StudyProgress(progress)
        return run_study(study, folder, executor, told, simulator, stop, at_once)


def sweep_in_folder(
    study: Study, plan: SweepPlan, path: Path, executor, progress=None, simulator=None
) -> SweepResult:
    with open_study_folder(study, path, plan.as_json()) as folder:
        return run_sweep(study, plan, folder, executor, progress, simulator)

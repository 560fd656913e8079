"""Study -> a better design: the search proposes candidates, the best are judged again on fresh seeds."""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.files import write_text
from chamberopt.common.progress import Progress
from chamberopt.coverage.statistics.confidence_interval import Estimate, paired_difference
from chamberopt.design.load import save_design
from chamberopt.optimize.candidates import FIRST_ALONE, Candidates, ConfirmedCandidate, Stop
from chamberopt.optimize.constraints import NOT_KNOWN
from chamberopt.optimize.evaluate_candidate import Simulator
from chamberopt.optimize.search.phases import PARETO_PHASES, maximise
from chamberopt.optimize.sensitivity import Sensitivity, analyse_sensitivity
from chamberopt.optimize.storage.study_folder import STUDY, StudyFolder, open_study_folder
from chamberopt.optimize.storage.trial_log import Trial
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate
from chamberopt.simulation.evaluation import Evaluation

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from chamberopt.optimize.study import Study
    from chamberopt.simulation.replicas import Replica


@dataclass(frozen=True)
class StudyResult:
    """What a study found.

    start, best, confirmed: judged on the same fresh seeds · gain: objective of best minus start with its 95 %
    interval from those paired replicas · sensitivity: what a model of the whole search says about the best; None when
    there is too little to fit · trials: search and confirmation, as they ran · seconds: wall clock of all evaluations,
    whenever they ran · target (m,) bool: of all candidates, where it is the start's; None where each design's own says
    it. Of two objectives, best is the best by the first.
    """

    study: Study
    folder: Path
    algorithm: str
    trials: tuple[Trial, ...]
    start: ConfirmedCandidate
    confirmed: tuple[ConfirmedCandidate, ...]
    best: ConfirmedCandidate
    gain: Estimate
    seconds: float
    target: np.ndarray | None = None
    sensitivity: Sensitivity | None = None

    @property
    def at_bounds(self) -> tuple[str, ...]:
        """A sentence for each parameter whose best value lies on its bound, where the search could not go on."""
        said = []
        for name, (low, high) in self.study.vary.items():
            value = self.best.design.value(name)
            for bound, side in ((low, "lower"), (high, "upper")):
                if abs(value - bound) < 1e-3 * (high - low):
                    said.append(
                        f"{name} = {value:g} lies on its {side} bound: better may lie beyond; widen [vary]"
                    )
        return tuple(said)

    @property
    def warnings(self) -> tuple[str, ...]:
        """A sentence where it is not known whether the best keeps the constraints."""
        return (f"constraints: {self.best.reason}",) if self.best.feasibility == NOT_KNOWN else ()

    @property
    def improved(self) -> bool:
        """Whether the best beats the start by more than the interval of the gain."""
        return self.gain.low > 0.0


def run_study(
    study: Study,
    folder: str | Path,
    executor: Executor,
    progress: Progress | None = None,
    simulator: Simulator | None = None,
    stop: Stop | None = None,
) -> StudyResult:
    """Search for a better design within the budget, then confirm the best and the start on fresh seeds.

    folder: new, empty, or where this very study was stopped: then what is on record there is not evaluated again, and
    the end is the same as if it had never been stopped. simulator: stands in for the simulation (tests, other models).
    progress(done, total, best): after each evaluation. stop(): asked before each; KeyboardInterrupt when it says True.

    Every candidate of the search gets the same seeds. The best candidates and the start are then simulated
    with more replicas on a second stream of seeds, and the answer is the best of those: the search's own
    figures favour the lucky. (Of the few confirmed the best is still picked by the figures reported: a little
    in its favour.)

    Raises InputError when the folder is in use or its study another, when the start cannot be simulated, or nothing
    meets the constraints; OSError when an evaluation cannot be recorded.
    """
    with open_study_folder(study, folder) as record:
        return search_and_confirm(study, record, executor, progress, simulator, stop)


def search_and_confirm(
    study: Study,
    record: StudyFolder,
    executor: Executor,
    progress: Progress | None = None,
    simulator: Simulator | None = None,
    stop: Stop | None = None,
) -> StudyResult:
    """The same from where a record stands. study: the record's, with its effects chosen (StudyFolder.settled)."""
    folder = record.path
    record.begin()
    save_inputs(study, folder)
    target = fixed_target(study)
    simulator = simulator or chamber_simulator(study, executor, target)
    candidates = Candidates(study, record, simulator, progress, stop)
    settings = study.optimizer
    phases: Sequence[tuple[str, float]] = [
        (phase.algorithm, phase.share) for phase in settings.phases
    ]
    if study.objective.pareto and settings.algorithm == "auto" and not phases:
        phases = PARETO_PHASES
    algorithm = maximise(
        candidates.score,
        candidates.start,
        settings.algorithm,
        settings.evaluations,
        settings.seed,
        step=settings.initial_step,
        tolerance=settings.tolerance,
        phases=phases,
        seen=candidates.seen,
    )
    confirmed = candidates.confirm()
    record.require_no_more(len(candidates.trials))
    if not confirmed or confirmed[0].searched != 0:
        first = next(trial for trial in candidates.trials if trial.stage == "confirm")
        raise InputError(
            f"the start could not be simulated on the confirmation's seeds: {first.reason}"
        )
    start = confirmed[0]
    winners = [one for one in confirmed if one.feasible] or [
        one for one in confirmed if one.feasibility == NOT_KNOWN
    ]
    if not winners:
        raise InputError(
            f"constraints: no candidate meets them (the start: {start.reason}); loosen them, widen [vary] or "
            f"raise optimizer.evaluations; every evaluation is in {folder / 'history.jsonl'}"
        )
    best = max(winners, key=lambda candidate: candidate.evaluation.objective.value)
    return StudyResult(
        study=study,
        folder=folder,
        algorithm=algorithm,
        trials=tuple(candidates.trials),
        start=start,
        confirmed=tuple(confirmed),
        best=best,
        gain=Estimate(0.0, 0.0)
        if best is start
        else paired_difference(best.goals[0], start.goals[0]),
        seconds=record.seconds,
        target=target,
        sensitivity=analyse_sensitivity(
            candidates.model(FIRST_ALONE),
            study.vary,
            best.parameters,
            best.evaluation.objective.half_width,
        ),
    )


def fixed_target(study: Study) -> np.ndarray | None:
    """The target (m,) bool of every candidate where it is what the shot reaches: found once, in the start's chamber.

    A search could else shrink what it has to cover. Raises InputError where the study varies the target itself.
    """
    from chamberopt.chamber.build import build_chamber

    if not study.design.part.target.reachable:
        return None
    varied = [name for name in study.vary if name.startswith("part.target.")]
    if varied:
        raise InputError(
            f"vary: {varied[0]} with part.target.reachable: not supported; leave one of the two out"
        )
    return build_chamber(study.design).part.target


def save_inputs(study: Study, folder: Path) -> None:
    """The study as files to read and to run again; inputs.json has what it is compared by."""
    import tomli_w

    if (folder / STUDY).is_file():
        return
    save_design(study.design, folder / "design.toml")
    asked = study.model_dump(mode="json", exclude={"design"}, exclude_none=True)
    write_text(folder / STUDY, tomli_w.dumps({"design": "design.toml", **asked}))


def chamber_simulator(study: Study, executor: Executor, target: np.ndarray | None) -> Simulator:
    """The real thing: chamber, replicas, coverage. Asked again for more replicas it adds to those it has."""
    from chamberopt.chamber.build import build_chamber

    known: dict[
        str, tuple[Chamber, list[Replica]]
    ] = {}  # of the confirmation, and of the search's last candidate

    def simulate_candidate(design: Design, stream: str, replicas: int | None) -> Evaluation:
        began = time.perf_counter()
        key = f"{stream} {design.model_dump_json()}"
        if key not in known:
            for other in [other for other in known if other.startswith("search")]:
                del known[other]
            known[key] = build_chamber(design, target), []
        chamber, done = known[key]
        built = time.perf_counter() - began
        plan = ReplicaPlan(replicas, stream, study.objective.goals[0])
        result = evaluate(design, chamber, executor, plan=plan, done=done)
        return replace(result, timings={"chamber": built, **result.timings})

    return simulate_candidate

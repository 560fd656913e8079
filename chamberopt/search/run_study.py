"""Run a study: search for a better design, then confirm the best candidates with new seeds."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.errors import InputError, WorkerLostError
from chamberopt.common.estimate import Estimate, estimate, paired_difference
from chamberopt.common.executor import result_of
from chamberopt.common.files import write_text
from chamberopt.common.number_text import rounded
from chamberopt.common.progress import Progress
from chamberopt.coverage.metrics import parse_objective
from chamberopt.design.load import save_design
from chamberopt.peening.calibration_errors import evaluate_calibrated
from chamberopt.search.ask_and_tell import Search
from chamberopt.search.candidate import Candidate, CandidateEvaluator, ConfirmedCandidate, Simulator
from chamberopt.search.optimiser.gaussian_process import one_thread
from chamberopt.search.optimiser.point_search import End
from chamberopt.search.sensitivity import Sensitivity, analyse_sensitivity
from chamberopt.search.study.constraints import NOT_KNOWN
from chamberopt.search.study.parameters import bound_at
from chamberopt.search.study_folder import STUDY, StudyFolder
from chamberopt.search.trial_log import Trial
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate, prepare_target
from chamberopt.simulation.evaluation import Evaluation
from chamberopt.simulation.replicas import Replica, ReplicaSet

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.design import Design
    from chamberopt.search.study import Study

Outcome = Evaluation | InputError
Stop = Callable[[], bool]
"""Returns True when the user wants to stop the study."""

TOLERANCES = (
    "what the [tolerances] do to the best design: chamberopt simulate best.toml --tolerances"
)
MAXIMISED = (
    "the search maximised the {which} of the objective over the [tolerances] of what it varies; at "
    "the best design it is {lost:.2g} {side} the value without them, by its model"
)


@dataclass(frozen=True)
class StudyResult:
    """The result of a study: the best design, and how the search found it."""

    study: Study
    folder: Path
    algorithm: str  # the phases of the search that ran
    trials: tuple[Trial, ...]  # of search and confirmation, in order
    # Start, confirmed and best are confirmed with the same new seeds; confirmed begins with the
    # start. With two objectives, best is the best by the first.
    start: ConfirmedCandidate
    confirmed: tuple[ConfirmedCandidate, ...]
    best: ConfirmedCandidate
    gain: Estimate  # objective of best minus start, from these paired replicas
    ended_by: End  # why the search ended
    counts: float  # smallest gain of the objective that counts; 0 if any does
    # What more might have been gained at most, by the search's last model or the definition of the
    # objective; infinite if neither tells.
    possible_gain: float
    seconds: float  # wall-clock time of all evaluations, earlier runs included
    # Target of all candidates, shape (m,) bool, if the start determines it; None if each design
    # has its own.
    target: np.ndarray | None = None
    sensitivity: Sensitivity | None = None  # None if there are too few points for a model

    _chambers: dict[int, Chamber] = field(default_factory=dict, repr=False, compare=False)

    def chamber_of(self, one: ConfirmedCandidate) -> Chamber:
        """Return the chamber of the start, the best or another confirmed candidate, built once."""
        from chamberopt.chamber.build import build_chamber

        number = one.candidate.number
        if number not in self._chambers:
            self._chambers[number] = build_chamber(one.design, self.target)
        return self._chambers[number]

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on what is not left to gain, on best values at their bounds, and on how
        tolerances changed the search: the most important first.
        """
        lost = self.best.lost_to_tolerances
        which = "mean" if self.study.objective.over_tolerances == "mean" else "worst value"
        sentences = [*self._nothing_left]
        numbers = {name: one for name, one in self.study.vary.items() if not one.texts}
        for name, varied in numbers.items():
            value = self.best.parameters[name]
            if side := bound_at(value, varied.bounds):
                place = f"{name} = {value:g} lies on its {side} bound"
                sentences.append(f"{place}: a better design may lie beyond; widen [vary]")
        more = tolerance_notes(lost, which) if self.study.design.tolerances else []
        return *sentences, *more

    @property
    def _nothing_left(self) -> tuple[str, ...]:
        """A sentence if the search ended because no more could be gained, or if no candidate is
        better than the start by what counts; else nothing.
        """
        counts, ended = self.counts, ""
        if self.ended_by == "gain":
            tried = sum(one.stage == "search" for one in self.trials)
            ended = (
                f"the search ended after {tried} candidates, as nothing within [vary] can be "
                f"better than its best by more than {max(self.possible_gain, 0.0):.2g} (95 % sure)"
            )
        elif self.gain.high < counts:
            most = max(self.gain.high, 0.0)
            ended = f"no confirmed candidate is better than the start by more than {most:.2g}"
        if not ended:
            return ()
        reason = f"{ended}, and less than {counts:.2g} does not count"
        if not self.gain.high < counts:  # the search has gained all there is
            return (reason,)
        return (f"nothing left to gain here: {reason}; {self._instead}",)

    @property
    def _instead(self) -> str:
        """What to ask for in the place of a gain that is not there."""
        time = self.best.figures.metrics.get("time_to_98_s")
        treatment = self.best.design.process.treatment_time
        if time is None or not time.has_number or not time.high < treatment:
            return "vary other parameters, or widen [vary]"
        return (
            f"it has full coverage after {rounded(time.value, 2)} of {treatment:g} s: ask for the "
            "shortest time (objective minus_treatment_time_s), or how little shot or amplitude "
            "will do"
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """A sentence on constraints that the best design may violate; empty if it meets all."""
        if self.best.feasibility != NOT_KNOWN:
            return ()
        return (f"constraints: {self.best.reason}",)

    @property
    def ended_early(self) -> int:
        """Number of candidates of the search whose first few replicas told enough."""
        few = self.study.first_look
        search = (one for one in self.trials if one.stage == "search")
        return sum(one.replicas == few for one in search) if few else 0

    @property
    def improved(self) -> bool:
        """Whether the best design surely beats the start: the interval of its gain is above 0."""
        return self.gain.low > 0.0


class StudyProgress(NamedTuple):
    """What a study tells its progress.

    Attributes:
        evaluations: called as evaluations(done, total, best) after each evaluation, in evaluations
            with all replicas; `total` is the most that may follow, and never grows.
        replicas: called as replicas(done, total, None) for the candidates that are simulated now.
    """

    evaluations: Progress | None
    replicas: Progress | None = None


def run_study(
    study: Study,
    folder: StudyFolder,
    executor: Executor,
    progress: StudyProgress | None = None,
    simulator: Simulator | None = None,
    stop: Stop | None = None,
    at_once: int | None = None,
) -> StudyResult:
    """Search for a better design within the budget, then confirm the best and the start.

    All candidates of the search are simulated with the same seeds. The best of them and the start,
    the unchanged design, are then simulated with more replicas and new seeds, because the search's
    own figures favour lucky candidates. The result is the best by these confirmed figures. (They
    favour it a little, too, because it is chosen by them.)

    Args:
        study: the study of the folder, with its effects resolved.
        folder: folder of the study. If this very study was interrupted in it, it is resumed, and
            the result is the same, bit for bit, as without the interruption.
        progress: what is called after each evaluation, and for replicas while it runs.
        simulator: replaces the simulation, e.g. in tests.
        stop: called before each evaluation; the study stops with KeyboardInterrupt if it is True.
        at_once: number of evaluations that memory can hold at a time; by default optimizer.batch.
    Raises:
        InputError: the start cannot be simulated, or no candidate meets the constraints.
        OSError: a trial cannot be written.
    """
    folder.begin()
    save_inputs(study, folder.path)
    target = fixed_target(study)
    evaluations, replicas = progress or StudyProgress(None)
    own = ChamberSimulator(study, executor, target, replicas)
    evaluator = CandidateEvaluator(study, simulator or own)
    search = Search(study, folder, evaluations, has_promise=evaluator.has_promise)
    # With fewer threads than a batch has candidates, some of them wait: figures are the same.
    batch = study.optimizer.batch
    threads = ThreadPoolExecutor(min(batch, at_once or batch), "candidate")
    try:
        # The model's threads are limited during all evaluations: a limit is of the whole process.
        with one_thread():
            run_search(search, lambda one: threads.submit(evaluator.evaluate, one), stop)
    finally:  # after an error those that run are not waited for
        threads.shutdown(wait=False, cancel_futures=True)
    folder.recorded.require_end(len(search.trials))
    best, start = search.best, search.confirmed[0]
    # What an exact objective needs no model for is not what the parameters do to its limits.
    model = None if parse_objective(study.objective.goals[0]).is_exact else search.objective_model
    is_gain = best is not start
    gain = paired_difference(best.goals[0], start.goals[0]) if is_gain else Estimate(0.0, 0.0)
    if is_gain and not (best.goals[0].has_number and start.goals[0].has_number):
        gain = gain.not_known(NOT_KNOWN)
    noise, values = estimate(best.goals[0].pseudovalues).half_width, best.parameters
    return StudyResult(
        study=study,
        folder=folder.path,
        algorithm=search.phases,
        trials=tuple(search.trials),
        start=start,
        confirmed=search.confirmed,
        best=best,
        gain=gain,
        ended_by=search.ended_by,
        counts=search.counts,
        possible_gain=search.possible_gain,
        seconds=folder.seconds,
        target=target,
        sensitivity=analyse_sensitivity(model, search.space, values, noise) if model else None,
    )


def run_search(
    search: Search, submit: Callable[[Candidate], Future[Outcome]], stop: Stop | None = None
) -> None:
    """Have all candidates of a search evaluated, and tell the search their figures, until it ends.

    Args:
        submit: function that begins an evaluation of a candidate.
        stop: called before each evaluation; if it returns True, the evaluations that run are
            finished and told, and KeyboardInterrupt is raised.
    """
    running: deque[tuple[Candidate, Future[Outcome]]] = deque()
    try:
        while (candidate := search.ask()) is not None or running:
            if candidate is None:
                search.tell(running[0][0], _outcome(*running[0]))
                running.popleft()
            elif stop and stop():
                for one in running:
                    search.tell(one[0], _outcome(*one))
                raise KeyboardInterrupt
            else:
                running.append((candidate, submit(candidate)))
    finally:
        for _, evaluation in running:
            evaluation.cancel()


def _outcome(candidate: Candidate, evaluation: Future[Outcome]) -> Outcome:
    try:
        return result_of(evaluation)
    except WorkerLostError as error:
        if candidate.stage == "sweep":  # a row with this reason
            return InputError(str(error))
        raise


def tolerance_notes(lost: float, which: str = "mean") -> list[str]:
    """Return sentences for the user: what a search maximised, as the design has tolerances.

    Args:
        lost: score that the tolerances cost the best design; 0 if this is not known.
        which: "mean" or "worst value" of the objective over the tolerances.
    """
    side = "below" if lost > 0.0 else "above"
    maximised = [MAXIMISED.format(which=which, lost=abs(lost), side=side)] if lost else []
    return [*maximised, TOLERANCES]


def fixed_target(study: Study) -> np.ndarray | None:
    """Return which triangles of the part are the target in all candidates, shape (m,) bool.

    If the target is all that the shot reaches, it is found once, in the chamber of the unchanged
    design. A search could otherwise shrink the area that it has to cover. The result is None if the
    design itself names the target.
    """
    from chamberopt.chamber.build import build_chamber

    if not study.design.part.target.reachable:
        return None
    return build_chamber(study.design).part.target


def save_inputs(study: Study, folder: Path) -> None:
    """Write the study's design.toml and study.toml to the folder, from which it can be run again.

    Nothing is written if study.toml is there already.
    """
    import tomlkit

    if (folder / STUDY).is_file():
        return
    save_design(study.design, folder / "design.toml")
    values = study.model_dump(mode="json", exclude={"design"}, exclude_none=True)
    write_text(folder / STUDY, tomlkit.dumps({"design": "design.toml", **values}))


class _Simulated(NamedTuple):
    """The chamber, the replicas and the target of a candidate, in case more replicas are wanted."""

    chamber: Chamber
    known: ReplicaSet


class _ReplicasUnderway:
    """The replicas of all candidates that are simulated now, each in a thread of its own."""

    def __init__(self, progress: Progress | None) -> None:
        self._progress, self._lock = progress, threading.Lock()
        self._now: dict[int, tuple[float, int]] = {}  # done and total, by the thread

    def tell(self, done: float, total: int, best: float | None) -> None:
        """Tell of the replicas of this thread's candidate, as a function `Progress`."""
        if self._progress is None:
            return
        with self._lock:
            self._now[threading.get_ident()] = done, total
            all_done, all_total = map(sum, zip(*self._now.values(), strict=True))
            self._progress(all_done, all_total, best)

    def end(self) -> None:
        """Take note that this thread's candidate is simulated."""
        with self._lock:
            self._now.pop(threading.get_ident(), None)


class ChamberSimulator:
    """Simulates the candidates of a study: builds the chamber, runs replicas, evaluates coverage.

    If it is asked for more replicas of a candidate, it adds them to the replicas that it has.
    Several threads may call it at a time.
    """

    def __init__(
        self,
        study: Study,
        executor: Executor,
        target: np.ndarray | None,
        progress: Progress | None = None,
    ) -> None:
        self._underway = _ReplicasUnderway(progress)
        self._study, self._executor, self._target = study, executor, target
        # Replicas of confirmed candidates. Chambers and targets, which take ten times as much
        # memory, are built again if a later round asks for more replicas.
        self._confirmed: dict[str, list[Replica]] = {}
        self._meant: set[tuple[str, str]] | None = None  # tight gaps of the study's own design
        self._last = threading.local()  # each thread's last candidate

    def __call__(self, design: Design, stream: str, replicas: int | None) -> Evaluation:
        began = time.perf_counter()
        one = self._candidate(design, stream)
        seconds = time.perf_counter() - began
        is_shown = stream == "confirm"  # all figures of a result, which the search needs not
        plan = ReplicaPlan(replicas, stream, self._study.objective.goals[0], is_shown)
        run = evaluate_calibrated if is_shown else evaluate
        what = design, one.chamber, self._executor, self._underway.tell
        try:
            evaluation = run(*what, plan=plan, known=one.known)
        finally:
            self._underway.end()
        return replace(evaluation, timings={"chamber": seconds, **evaluation.timings})

    def reachable(self, design: Design) -> float:
        """Return the largest share of the target that the balls may touch, from geometry alone."""
        one = self._candidate(design, "search")
        one.known.target = prepare_target(design, one.chamber, chamber_mesh(one.chamber))
        return one.known.target.reach.largest

    def unbuildable(self, design: Design) -> str:
        """Return what no shop would build in a candidate's chamber, by geometry; "" if all is well.

        It is a gap beside a wall, tighter than a ball passes, that the study's own design does not
        have: what that has is meant.
        """
        from chamberopt.chamber.build import build_chamber
        from chamberopt.chamber.checks.tight_gaps import tight_gaps

        found = list(tight_gaps(self._candidate(design, "search").chamber, design.shot.diameters))
        if found and self._meant is None:
            own = self._study.design
            chamber = build_chamber(own, self._target)
            self._meant = {one.sides for one in tight_gaps(chamber, own.shot.diameters)}
        return next((one.text for one in found if one.sides not in (self._meant or ())), "")

    def _candidate(self, design: Design, stream: str) -> _Simulated:
        from chamberopt.chamber.build import build_chamber

        key, last = f"{stream} {design.model_dump_json()}", vars(self._last)
        if key not in last:
            last.clear()
            chamber = build_chamber(design, self._target)
            replicas = self._confirmed.setdefault(key, []) if stream == "confirm" else []
            last[key] = _Simulated(chamber, ReplicaSet(replicas))
        found: _Simulated = last[key]
        return found

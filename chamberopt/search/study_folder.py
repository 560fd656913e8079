"""The folder of a study while it runs: its inputs, effects, trials and confirmed evaluations.

A trial is an evaluated candidate, and a row of the log history.jsonl. From the trials, an
interrupted study is resumed without evaluating them again.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from chamberopt.common.errors import InputError, first_wrong_value
from chamberopt.common.files import (
    INPUTS,
    RESULT,
    claim_folder,
    make_folder,
    open_plain,
    remove_file,
    remove_leftovers,
    write_text,
)
from chamberopt.common.limits import MAX_RESULT_BYTES, read_limited
from chamberopt.common.versions import program_versions
from chamberopt.coverage.metrics import metric_names
from chamberopt.design.design import Design
from chamberopt.search.study.parameters import ParameterSpace, Varied, Vary
from chamberopt.search.study.schema import Objective
from chamberopt.search.trial_log import HISTORY, TIMINGS, JsonLines, Trial, read_seconds, trials_of
from chamberopt.simulation.advice import Advice
from chamberopt.simulation.evaluation import Evaluation, load_evaluation, save_evaluation

if TYPE_CHECKING:
    from chamberopt.design.design import Design
    from chamberopt.search.study import Study

# Resuming a study: the trials that its folder holds already.
#
# The search is deterministic: after an interruption it runs again from its first candidate and asks
# for the same candidates in the same order. A recorded trial is returned instead of simulating the
# candidate again. Where the record ends, simulation continues; the result is the same, bit for bit,
# as that of an uninterrupted run.


class RecordedTrials:
    """The trials that a study's log held when the study was opened.

    The constructor repairs the log: a last line that a crash cut off is removed. Raises InputError
    if a row of the log is damaged or does not belong to this study.
    """

    def __init__(self, log: JsonLines, study: Study) -> None:
        self._log, self._objectives = log, len(study.objective.goals)
        self._space = ParameterSpace(study.design, study.vary)
        self._metrics = set(metric_names(study.design))
        log.repair()
        self.trials: list[Trial] = []
        for number, trial in enumerate(trials_of(log)):
            if trial.number != number or not self._is_possible(trial):
                raise log.damaged(number + 1)
            self.trials.append(trial)

    def find(self, number: int, stage: str, point: Sequence[float]) -> Trial | None:
        """Return the recorded trial with this number, or None if the log has fewer trials.

        Raises InputError if that trial is of another stage or another point in the unit cube, even
        if the points differ only by a bit.
        """
        if number >= len(self.trials):
            return None
        trial = self.trials[number]
        wanted, recorded = f"{stage} of {_exact(point)}", f"{trial.stage} of {_exact(trial.point)}"
        if wanted != recorded:
            what = f"recorded is the {recorded}, but the search now asks for the {wanted}"
            raise self._mismatch(number, what)
        if trial.parameters != self._space.values_at(np.array(point)):
            raise self._log.damaged(number + 1)
        return trial

    def require_end(self, number: int) -> None:
        """Raise InputError if the log has more than the `number` trials of the finished study."""
        if len(self.trials) > number:
            raise self._mismatch(number, "the study has ended before this row")

    def _is_possible(self, trial: Trial) -> bool:
        """Return whether a trial can belong to this study.

        The trial must have all objectives and metrics of the study, or have failed. The first
        trial of the search, which is the start design, cannot have failed.
        """
        if not trial.goals:
            return trial.number > 0 or trial.stage != "search"
        return (
            len(trial.goals) == self._objectives
            and all(math.isfinite(goal.value) for goal in trial.goals)
            and all(one.half_width >= 0.0 for one in (*trial.goals, *trial.metrics.values()))
            and trial.metrics.keys() == self._metrics
            and (trial.replicas or 0) > 0
            and trial.highest is None
        )

    def _mismatch(self, number: int, what: str) -> InputError:
        return InputError(
            f"{self._log.path}:{number + 1}: {what}. The file was edited, or written by another "
            "version of the program or another kind of machine; resume the study where it was "
            "begun, or run it in a new folder (--out)"
        )


def _exact(point: Sequence[float]) -> str:
    """Return the numbers of a point as text with all digits, so that different points differ."""
    return "[" + ", ".join(repr(float(share)) for share in point) + "]"


# The inputs of a study: what its results depend on, stored and compared before it is resumed.

FORMAT = 1
MAX_DIFFERENCES = 12  # in one message
OF_FURTHER = "begin_with", "optimizer.evaluations", "optimizer.seed"  # in which one differs
OF_NO_TRIAL = "ranges", "to_settle", "settled"  # of the design: no trial depends on them
NO_MATTER = tuple(f"study.design.{one}" for one in OF_NO_TRIAL)


def study_inputs(study: Study, plan: Mapping[str, object] | None = None) -> dict[str, object]:
    """Return everything that the trials of a study depend on, as plain JSON values.

    A file that the design names, such as the part's mesh, is given by its name and the sha256 of
    its content, without its folder, so that the file may be moved.

    Args:
        plan: the plan of a sweep; None for a search.
    """
    values = study.model_dump(mode="json", exclude={"design"})
    values["design"] = _with_digests(study.design.model_dump(mode="json"))
    inputs = {"format": FORMAT, "study": values, "sweep": plan, "program": program_versions()}
    plain = json.loads(json.dumps(inputs))
    assert isinstance(plain, dict)
    return plain


def require_same_inputs(
    folder: Path, before: Mapping[str, object], now: Mapping[str, object]
) -> None:
    """Raise InputError if the inputs with which the study began, `before`, differ from `now`.

    The `[ranges]` of the design may differ, as they are simulated after the last trial, and so may
    what is to be settled.
    """
    title = f"{folder}: the study in this folder began otherwise:"
    remedy = "to resume it, restore these inputs; to run the new study, give another folder (--out)"
    _require_same(before, now, title, remedy)


@dataclass(frozen=True)
class StudyInputs:
    """What a study asks, as its folder tells without its design's files.

    vary: the values that each varied parameter may have, by dotted name.
    goals: the objectives.
    plan: the plan of a sweep; None for a search.
    study: the whole study as JSON values, with digests of files.
    """

    vary: dict[str, Varied]
    goals: tuple[str, ...]
    plan: dict[str, Any] | None
    study: dict[str, Any]

    def is_of(self, study: Study) -> bool:
        """Return whether these are the inputs of a study, so that the study can be resumed."""
        now = study_inputs(study)["study"]
        return not _changed_names({"study": self.study}, {"study": now})

    def asks_as(self, other: StudyInputs) -> bool:
        """Return whether another study asks the same, whatever its budget, seed and first ones."""
        mine, others = (
            {k: v for k, v in _flatten(one.study).items() if k not in OF_FURTHER}
            for one in (self, other)
        )
        return mine == others and self.plan == other.plan

    def differences(self, design: Design) -> list[str]:
        """Return the names of values in which a design differs from that of this study.

        What varies, and how accurately is simulated, is left out. So are values that the program
        did not know when the study began.
        """
        before, now = self.study["design"], _with_digests(design.model_dump(mode="json"))
        left_out = ("process.accuracy", *OF_NO_TRIAL, *self.vary)
        return [
            name
            for name in sorted(_flatten(before).keys() & set(_changed_names(before, now)))
            if not name.startswith(left_out) and not any(v.startswith(f"{name}.") for v in left_out)
        ]


def read_inputs(folder: Path) -> StudyInputs:
    """Return what the study of a folder asks. Raises InputError if the folder is no study's."""
    path = folder / INPUTS
    if not path.is_file():
        raise InputError(f"{folder}: no study was begun in it; give a study's results folder")
    data: dict[str, Any] = _read_json(path)
    try:
        study, plan = data["study"], data["sweep"]
        vary = TypeAdapter(dict[str, Vary]).validate_python(study["vary"])
        goals = Objective.model_validate(study["objective"]).goals
        if not isinstance(study["design"], dict) or not isinstance(plan, dict | None):
            raise TypeError("not a table")
        return StudyInputs(vary, goals, plan, study)
    except ValidationError as error:
        raise _damaged(path, first_wrong_value(error)) from None
    except (LookupError, TypeError, ValueError, InputError) as error:
        raise _damaged(path, error) from None


def require_same_files(design: Design, before: Mapping[str, Any], folder: Path) -> None:
    """Raise InputError if a file that the design names has changed since the study began."""
    title = f"{folder}: changed while the study ran, so the running evaluations are not kept:"
    remedy = "to resume, restore the file and run the study again on this folder"
    now = _with_digests(design.model_dump(mode="json"))
    _require_same(before["study"]["design"], now, title, remedy)


def _require_same(
    before: Mapping[str, object], now: Mapping[str, object], title: str, remedy: str
) -> None:
    """Raise InputError if two tables differ. The message lists the differences.

    A difference reads e.g. `study.design.shot.mass_g: was 5.0, is 6.0`.

    Args:
        title: first line of the message.
        remedy: last line of the message.
    """
    old, new = _flatten(before), _flatten(now)
    changed = [
        f"{name}: was {_format(old, name)}, is {_format(new, name)}"
        for name in _changed_names(before, now)
    ]
    if len(changed) > MAX_DIFFERENCES:
        hidden = len(changed) - MAX_DIFFERENCES
        changed = [*changed[:MAX_DIFFERENCES], f"and {hidden} more"]
    if changed:
        raise InputError("\n  ".join([title, *changed]) + f"\n{remedy}")


def _changed_names(before: Mapping[str, object], now: Mapping[str, object]) -> list[str]:
    """Return the dotted names of values in which two tables differ, but for what no trial of a
    study depends on."""
    old, new = _flatten(before), _flatten(now)
    return [
        name
        for name in {**old, **new}
        if not name.startswith(NO_MATTER)
        and (name not in old or name not in new or old[name] != new[name])
    ]


def _with_digests(value: object) -> Any:
    """Return a JSON value with each path of a file replaced by the file's name and sha256."""
    if isinstance(value, dict):
        return {name: _with_digests(item) for name, item in value.items()}
    if isinstance(value, list):
        return [_with_digests(item) for item in value]
    # Paths in a design are whole ones. Of a long sentence, Path.is_file raises an OSError.
    if isinstance(value, str) and os.path.isabs(value) and os.path.isfile(value):
        with open_plain(Path(value), follow=True) as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        return {"file": Path(value).name, "sha256": digest}
    return value


def _flatten(value: object, prefix: str = "") -> dict[str, object]:
    """Return the values of nested tables by dotted name, such as "shot.mass_g".

    Args:
        prefix: dotted name of `value`; "" for the outermost table.
    """
    if not isinstance(value, Mapping) or not value:
        return {prefix: value}
    flat: dict[str, Any] = {}
    for name, item in value.items():
        flat |= _flatten(item, f"{prefix}.{name}" if prefix else str(name))
    return flat


def _format(flat: Mapping[str, object], name: str) -> str:
    value = json.dumps(flat[name], ensure_ascii=False) if name in flat else "absent"
    return value if len(value) <= 80 else value[:77] + "..."


INPUTS_0_1 = "asked.json"
EFFECTS = "effects.json"
STUDY = "study.toml"
CONFIRMED = "confirm"


@contextmanager
def open_study_folder(
    study: Study, folder: str | Path, plan: Mapping[str, object] | None = None
) -> Iterator[StudyFolder]:
    """Open the folder of a study, and keep other processes from writing to it meanwhile.

    Args:
        folder: new, empty, or the folder in which this very study was begun.
        plan: the plan of a sweep; None for a search.
    Raises:
        InputError: the folder holds something else, another process writes to it, or the study,
            the part or the program have changed since the study began.
    """
    folder = Path(folder)
    if (folder / INPUTS_0_1).is_file():
        text = "this study was run by version 0.1, which cannot be resumed"
        raise InputError(f"{folder}: {text}; give another folder (--out)")
    with claim_folder(folder, is_study_folder):
        yield StudyFolder(study, folder, plan)


def is_study_folder(folder: Path) -> bool:
    """Return True if a study was begun in the folder, whether or not it is finished."""
    return (folder / INPUTS).is_file()


def is_finished(folder: Path) -> bool:
    """Return True if the study of the folder is finished, i.e. if its result.json is there."""
    return (folder / RESULT).is_file()


class StudyFolder:
    """The folder of a study that runs: its inputs, its trials and its confirmed evaluations.

    recorded: the trials that the folder held when `open_study_folder` opened it.
    """

    def __init__(self, study: Study, path: Path, plan: Mapping[str, object] | None = None) -> None:
        self.path, self.study, self._inputs = path, study, study_inputs(study, plan)
        self._history = JsonLines(path / HISTORY)
        self._timings = JsonLines(path / TIMINGS, survives_power_cut=False)
        if self.begun:
            before, now = _read_json(path / INPUTS), self._inputs
            if self.finished:  # a result stays valid when the program changes
                before, now = ({k: one.get(k) for k in ("study", "sweep")} for one in (before, now))
            require_same_inputs(path, before, now)
        self.recorded = RecordedTrials(self._history, study)
        self._timings.repair()

    @property
    def finished(self) -> bool:
        return is_finished(self.path)

    @property
    def begun(self) -> bool:
        """True if the folder has a trial log, so that the study can be resumed."""
        return self._history.path.exists()

    @property
    def seconds(self) -> float:
        """Wall-clock time of all evaluations of the study [s], also before interruptions."""
        return sum(read_seconds(self.path).values())

    def begin(self) -> None:
        """Write the inputs on which the trials depend to the folder, before the first trial.

        If an earlier run wrote inputs but no trial, its inputs are replaced.
        """
        remove_leftovers(self.path)
        path = self.path / INPUTS
        if path.is_file() and (self.begun or _read_json(path) == self._inputs):
            return
        for name in (EFFECTS, STUDY):
            remove_file(self.path / name)
        write_text(path, json.dumps(self._inputs, indent=2) + "\n")

    def with_effects_resolved(
        self, resolve: Callable[[Design], tuple[Design, list[Advice]]]
    ) -> tuple[Study, list[Advice]]:
        """Return the study with its optional physical effects chosen, and the reasons (advice).

        If the design does not leave effects to the program ("auto"), the study is returned as it
        is, without advice.

        Args:
            resolve: function that chooses the effects of a design by pilot runs. It is called once
                and its answer is stored in the folder, because a pilot run takes minutes.
        """
        design = self.study.design
        if not design.effects.auto:
            return self.study, []
        self.begin()
        path = self.path / EFFECTS
        if not path.is_file():
            resolved, advice = resolve(design)
            effects = resolved.effects.model_dump(mode="json")
            values = {"effects": effects, "advice": [asdict(one) for one in advice]}
            write_text(path, json.dumps(values, indent=2) + "\n")
        stored = _read_json(path)
        try:
            resolved = design.changed({"effects": stored["effects"]})
            advice = TypeAdapter(list[Advice]).validate_python(stored["advice"])
            if not all(one.changes for one in advice):
                raise ValueError("advice without changes")
        except ValidationError as error:
            raise _damaged(path, first_wrong_value(error)) from None
        except (KeyError, TypeError, ValueError, InputError) as error:
            raise _damaged(path, error) from None
        return self.study.model_copy(update={"design": resolved}), advice

    def evaluation(self, trial: Trial) -> Evaluation:
        """Return the stored evaluation of a recorded trial that confirms a candidate.

        Raises InputError if the file and the trial have different figures.
        """
        path = self._evaluation_path(trial.number)
        found = load_evaluation(path)
        metrics = {name: one.interval_json() for name, one in found.metrics.items()}
        if (
            found.objective.to_json() != trial.goals[0].to_json()
            or metrics != {name: one.interval_json() for name, one in trial.metrics.items()}
            or found.replicas != trial.replicas
        ):
            raise InputError(
                f"{path}: not the evaluation that row {trial.number + 1} of {HISTORY} tells of; "
                "restore the file or run the study in a new folder (--out)"
            )
        return found

    def append(
        self, trial: Trial, evaluation: Evaluation | Exception | None, seconds: float
    ) -> None:
        """Write a trial as one row of the log.

        If the trial is of the stage "confirm" and did not fail, its evaluation is written to a
        separate file. Row and file are on the disk when this method returns.

        Raises:
            OSError: row or file cannot be written.
            InputError: a file that the design names has changed since the study began.
        """
        require_same_files(self.study.design, self._inputs, self.path)
        if trial.stage == "confirm" and isinstance(evaluation, Evaluation):
            path = self._evaluation_path(trial.number)
            make_folder(path.parent)
            save_evaluation(path, evaluation)  # before the row, which says that this file exists
        self._history.append(trial.row())
        self._timings.append({"number": trial.number, "seconds": round(seconds, 3)})

    def _evaluation_path(self, number: int) -> Path:
        return self.path / CONFIRMED / f"{number:03d}.npz"


def _read_json(path: Path) -> dict[str, object]:
    try:
        data = json.loads(read_limited(path, MAX_RESULT_BYTES, "file of a study"))
        if not isinstance(data, dict):
            raise TypeError("not a table")
    except OSError as error:
        text = f"cannot be read: {error.strerror}; check its permissions"
        raise InputError(f"{path}: {text}") from None
    except (ValueError, TypeError) as error:
        raise _damaged(path, error) from None
    return data


def _damaged(path: Path, error: object) -> InputError:
    remedy = "restore the file or run the study in a new folder (--out)"
    return InputError(f"{path}: damaged ({error}); {remedy}")

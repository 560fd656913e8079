"""The folder of a study while it runs: inputs, effects, trials and confirmed evaluations."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import TypeAdapter, ValidationError

from chamberopt.common.errors import InputError, first_wrong_value
from chamberopt.common.files import (
    INPUTS,
    RESULT,
    claim_folder,
    make_folder,
    remove_file,
    remove_leftovers,
    write_text,
)
from chamberopt.common.limits import MAX_RESULT_BYTES, read_limited
from chamberopt.design.design import Design
from chamberopt.optimize.storage import study_inputs
from chamberopt.optimize.storage.resume import RecordedTrials
from chamberopt.optimize.storage.trial_log import HISTORY, TIMINGS, JsonLines, Trial, read_seconds
from chamberopt.simulation.effect_pilot import Advice
from chamberopt.simulation.evaluation import Evaluation, load_evaluation, save_evaluation

if TYPE_CHECKING:
    from chamberopt.optimize.study import Study

INPUTS_0_1 = "asked.json"
EFFECTS = "effects.json"
STUDY = "study.toml"
CONFIRMED = "confirm"


@contextmanager
def open_study_folder(
    study: Study, folder: str | Path, plan: Mapping[str, Any] | None = None
) -> Iterator[StudyFolder]:
    """Open the folder of a study, and hold it against other processes.

    Args:
        folder: new, empty, or where this very study was begun.
        plan: the plan of a sweep.
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
    """Whether a study was begun in the folder; it may be finished or not."""
    return (folder / INPUTS).is_file()


def is_finished(folder: Path) -> bool:
    """Whether the study of the folder has its result, which is written last."""
    return (folder / RESULT).is_file()


class StudyFolder:
    """An open study folder, see open_study_folder; `recorded` are the trials that it held then."""

    def __init__(self, study: Study, path: Path, plan: Mapping[str, Any] | None = None) -> None:
        self.path, self._study, self._inputs = path, study, study_inputs.study_inputs(study, plan)
        self._history = JsonLines(path / HISTORY)
        self._timings = JsonLines(path / TIMINGS, survives_power_cut=False)
        if self.begun:
            before, now = _read_json(path / INPUTS), self._inputs
            if self.finished:  # a result stays valid when the program changes
                before, now = ({k: one.get(k) for k in ("study", "sweep")} for one in (before, now))
            study_inputs.require_same_inputs(path, before, now)
        self.recorded = RecordedTrials(self._history, study)
        self._timings.repair()

    @property
    def finished(self) -> bool:
        return is_finished(self.path)

    @property
    def begun(self) -> bool:
        """Whether there are trials to resume from."""
        return self._history.path.exists()

    @property
    def seconds(self) -> float:
        """Wall-clock time of all evaluations, earlier runs included [s]."""
        return sum(read_seconds(self.path).values())

    def begin(self) -> None:
        """Write the inputs before the first trial; inputs of a run without trials are replaced."""
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
        """The study with effects instead of "auto", and the advice of the pilot runs.

        `resolve` is called once and its answer is stored, because a pilot run takes minutes.
        """
        design = self._study.design
        if not design.effects.auto:
            return self._study, []
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
        return self._study.model_copy(update={"design": resolved}), advice

    def evaluation(self, trial: Trial) -> Evaluation:
        """The evaluation of a recorded confirmation; InputError unless its file has its figures."""
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
        """Store a trial, and the whole evaluation of a confirmation; both are then on the disk.

        OSError if they cannot be written, InputError if a file that the design names has changed.
        """
        study_inputs.require_same_files(self._study.design, self._inputs, self.path)
        if trial.stage == "confirm" and isinstance(evaluation, Evaluation):
            path = self._evaluation_path(trial.number)
            make_folder(path.parent)
            save_evaluation(path, evaluation)  # before the row, which says that this file exists
        self._history.append(trial.row())
        self._timings.append({"number": trial.number, "seconds": round(seconds, 3)})

    def _evaluation_path(self, number: int) -> Path:
        return self.path / CONFIRMED / f"{number:03d}.npz"


def _read_json(path: Path) -> dict[str, Any]:
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

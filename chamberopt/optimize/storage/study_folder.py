"""A study's folder while it runs: what was asked, and every evaluation. What a study that was stopped goes on from."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chamberopt.common.errors import InputError
from chamberopt.common.files import make_output_folder, write_text
from chamberopt.coverage.statistics.confidence_interval import Estimate
from chamberopt.design.design import Design
from chamberopt.optimize.storage.lock import only_writer
from chamberopt.optimize.storage.study_inputs import require_same, require_same_files, study_inputs
from chamberopt.optimize.storage.trial_log import HISTORY, TIMINGS, JsonLines, Trial, read_seconds
from chamberopt.simulation.effect_pilot import Advice
from chamberopt.simulation.evaluation import Evaluation, load_evaluation, save_evaluation

if TYPE_CHECKING:
    from chamberopt.optimize.study import Study

INPUTS = "inputs.json"
EFFECTS = "effects.json"
STUDY = "study.toml"
CONFIRMED = "confirm"
RESULT = "result.json"  # written last of all (results.py): a study that has it is finished


@contextmanager
def open_study_folder(
    study: Study, folder: str | Path, plan: Mapping[str, Any] | None = None
) -> Iterator[StudyFolder]:
    """The record of a study in a folder that is new, empty or its own, held against other processes.

    Raises InputError when the folder holds anything else or is being written, and when study, part or program are not
    what they were: it says what changed. plan: of a sweep, what it was asked beside its study.
    """
    folder = Path(folder)
    if not is_study_folder(folder):
        folder = make_output_folder(folder)
    with only_writer(folder):
        yield StudyFolder(study, folder, plan)


def is_study_folder(folder: Path) -> bool:
    """Whether a study was begun here; whether it ended is another question."""
    return (folder / INPUTS).is_file()


def is_finished(folder: Path) -> bool:
    """Whether the study that was begun here has its result."""
    return (folder / RESULT).is_file()


class StudyFolder:
    """See open_study_folder. trials: those on disk when it was opened."""

    def __init__(self, study: Study, folder: Path, plan: Mapping[str, Any] | None = None) -> None:
        self.path, self._study, self._inputs = folder, study, study_inputs(study, plan)
        self._history, self._timings = (
            JsonLines(folder / HISTORY),
            JsonLines(folder / TIMINGS, lasting=False),
        )
        self._require_same_study()
        self.trials = self._read_trials()
        self._timings.repair()

    @property
    def finished(self) -> bool:
        """Whether its result is written."""
        return is_finished(self.path)

    @property
    def begun(self) -> bool:
        """Whether there is anything to go on from."""
        return self._history.path.exists()

    @property
    def seconds(self) -> float:
        """Wall clock of all its evaluations, whenever they ran."""
        return sum(read_seconds(self.path).values())

    def begin(self) -> None:
        """Write down what was asked, before anything that answers it; over an older question that nothing came of."""
        path = self.path / INPUTS
        if path.is_file() and (self.begun or _read_json(path) == self._inputs):
            return
        for name in (EFFECTS, STUDY):
            (self.path / name).unlink(missing_ok=True)
        write_text(path, json.dumps(self._inputs, indent=2) + "\n")

    def with_effects_resolved(
        self, resolve: Callable[[Design], tuple[Design, list[Advice]]]
    ) -> tuple[Study, list[Advice]]:
        """The study with the effects of its design chosen, and why, where it leaves them to us: asked of `settle` once,
        for a pilot takes its time.
        """
        design = self._study.design
        if not design.effects.auto:
            return self._study, []
        self.begin()
        path = self.path / EFFECTS
        if not path.is_file():
            chosen, advice = resolve(design)
            told = {
                "effects": chosen.effects.model_dump(mode="json"),
                "advice": [asdict(one) for one in advice],
            }
            write_text(path, json.dumps(told, indent=2) + "\n")
        kept = _read_json(path)
        try:
            chosen = design.changed({"effects": kept["effects"]})
            advice = [_advice(**one) for one in kept["advice"]]
        except (KeyError, TypeError, AttributeError) as error:
            raise _damaged(path, error) from None
        return self._study.model_copy(update={"design": chosen}), advice

    def replayed(self, number: int, stage: str, point: Sequence[float]) -> Trial | None:
        """The recorded trial of that number, None when there is none yet; InputError when it is of another candidate,
        by as little as a bit.
        """
        if number >= len(self.trials):
            return None
        trial = self.trials[number]
        proposed, recorded = (
            f"{stage} of {_listed(point)}",
            f"{trial.stage} of {_listed(trial.point)}",
        )
        if proposed != recorded:
            raise self._foreign(
                number, f"recorded is the {recorded}, but what comes now is the {proposed}"
            )
        return trial

    def require_no_more(self, number: int) -> None:
        """InputError when a study that has ended after so many trials has more of them on record."""
        if len(self.trials) > number:
            raise self._foreign(number, "the study has ended before this row")

    def evaluation(self, number: int) -> Evaluation:
        """All of a recorded confirmation. Raises InputError when its file is gone or damaged."""
        return load_evaluation(self._file(number))

    def append(self, trial: Trial, evaluation: Evaluation | None, seconds: float) -> None:
        """Keep a trial, of a confirmation all of it; on the disk when this returns. Raises OSError if it cannot be, and
        InputError if the part's file has changed under it.
        """
        require_same_files(self._study.design, self._inputs, self.path)
        if trial.stage == "confirm" and evaluation is not None:
            path = self._file(trial.number)
            path.parent.mkdir(exist_ok=True)
            save_evaluation(path, evaluation)  # first: a row says that its file is there
        self._history.append(trial.row())
        self._timings.append({"number": trial.number, "seconds": round(seconds, 3)})

    def _file(self, number: int) -> Path:
        return self.path / CONFIRMED / f"{number:03d}.npz"

    def _require_same_study(self) -> None:
        """Where evaluations are there, they answer what was asked then."""
        if not self.begun:
            return
        before, now = _read_json(self.path / INPUTS), self._inputs
        if self.finished:  # its result stands, whatever program is asked for it
            before, now = (
                {key: one.get(key) for key in ("study", "sweep")} for one in (before, now)
            )
        require_same(self.path, before, now)

    def _read_trials(self) -> list[Trial]:
        trials = []
        self._history.repair()
        for number, row in enumerate(self._history.rows()):
            try:
                trial = Trial.from_row(row)
                if trial.number != number:
                    raise ValueError
            except (KeyError, TypeError, ValueError, AttributeError):
                raise self._history.damaged(number + 1) from None
            trials.append(trial)
        return trials

    def _foreign(self, number: int, what: str) -> InputError:
        return InputError(
            f"{self._history.path}:{number + 1}: {what}: the record was edited, or another version of the program or "
            "another kind of machine made it; go on where it was made, or run the study in a new folder (--out)"
        )


def _read_json(path: Path) -> dict[str, Any]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(data, dict):
            raise TypeError("no table")
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read: {error.strerror}; check its permissions"
        ) from None
    except (ValueError, TypeError) as error:
        raise _damaged(path, error) from None
    return data


def _damaged(path: Path, error: Exception) -> InputError:
    return InputError(
        f"{path}: damaged ({error}); restore the file or run the study in a new folder (--out)"
    )


def _advice(changes: dict[str, dict[str, Any]], **others: Any) -> Advice:
    estimates = {
        name: Estimate(**{**one, "pseudovalues": tuple(one["pseudovalues"])})
        for name, one in changes.items()
    }
    return Advice(changes=estimates, **others)


def _listed(point: Sequence[float]) -> str:
    """Exact: no two numbers are printed alike."""
    return "[" + ", ".join(repr(float(share)) for share in point) + "]"

"""The trial log history.jsonl: a row is appended for each evaluated candidate (trial) of a study.

The row is on the disk before the next evaluation starts in its place. Running a study twice writes
the same history.jsonl, byte for byte. Run times differ, so they are in a separate file,
timings.jsonl.
"""

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate, finite_or_none
from chamberopt.common.files import append_bytes, csv_text, read_file, write_bytes
from chamberopt.common.limits import parse_json

HISTORY = "history.jsonl"
TIMINGS = "timings.jsonl"
DAMAGED = KeyError, TypeError, ValueError, AttributeError, OverflowError  # of a row's values


@dataclass(frozen=True)
class Trial:
    """One evaluated candidate, as a row of the trial log."""

    number: int
    stage: str  # "search", "confirm" or "sweep"
    point: tuple[float, ...]  # place in the unit cube, see study/parameters.py
    parameters: dict[str, float | str]  # values in the units of the file, by dotted name
    goals: tuple[Estimate, ...]  # of each objective of the study; empty when the evaluation failed
    metrics: dict[str, Estimate]  # without their pseudo-values
    penalty: float  # violation of the constraints, relative to their limits
    score: float  # what the search maximises: the first objective less penalties
    feasible: bool
    reason: str  # why the candidate is not feasible, else ""
    replicas: int | None = None  # that were simulated; None when the evaluation failed
    highest: float | None = None  # largest objective by reach alone, if that spared a simulation
    refused: bool = False  # whether geometry ruled the candidate out before any simulation
    reachable: float | None = None  # share of the target that a ball can touch, if simulated

    @property
    def objective(self) -> Estimate | None:
        """The estimate of the first objective; None if the evaluation failed."""
        return self.goals[0] if self.goals else None

    def row(self) -> dict[str, object]:
        """Return the trial as JSON values, from which `from_row` restores the same bits."""
        objective = self.objective
        interval = (objective or Estimate(math.nan, math.nan)).interval_json()
        return {
            "number": self.number,
            "stage": self.stage,
            "point": list(self.point),
            "parameters": self.parameters,
            "objective": interval["value"],
            "half_width": interval["half_width"],
            "replicas": self.replicas,
            "highest": self.highest,
            # Pseudo-values tell a model of the search how uncertain each score is.
            "goals": [one.to_json() for one in self.goals],
            "penalty": self.penalty,
            "score": self.score,
            "feasible": self.feasible,
            "reason": self.reason,
            "metrics": {name: metric.interval_json() for name, metric in self.metrics.items()},
            # Only where it is so: rows of before the keys stay as they were written.
            **({"refused": True} if self.refused else {}),
            **({} if self.reachable is None else {"reachable": self.reachable}),
        }

    @classmethod
    def from_row(cls, row: Mapping[str, Any]) -> Self:
        """Return the trial that a row of the log holds.

        Raises one of the errors in DAMAGED if the row is not exactly as it was written.
        """
        trial = cls(
            number=int(row["number"]),
            stage=str(row["stage"]),
            point=tuple(float(share) for share in row["point"]),
            parameters={
                name: value  # a whole number stays one, as its file has it
                for name, value in row["parameters"].items()
                if isinstance(value, str) or value == float(value)
            },
            goals=tuple(Estimate.from_json(one) for one in row["goals"]),
            metrics={
                name: Estimate.from_interval_json(metric) for name, metric in row["metrics"].items()
            },
            penalty=float(row["penalty"]),
            score=float(row["score"]),
            feasible=bool(row["feasible"]),
            reason=str(row["reason"]),
            replicas=None if row["replicas"] is None else int(row["replicas"]),
            highest=None if row["highest"] is None else float(row["highest"]),
            refused=bool(row.get("refused", False)),
            reachable=float(row["reachable"]) if "reachable" in row else None,
        )
        if trial.row() != row:  # a text or true in the place of a number, or words of its own
            raise ValueError("not as it was written")
        return trial


class JsonLines:
    """A file of JSON rows, one in each line, that only grows.

    Args:
        survives_power_cut: force each row to the disk at once, which takes milliseconds.
    """

    def __init__(self, path: Path, survives_power_cut: bool = True) -> None:
        self.path, self._survives_power_cut = path, survives_power_cut

    def append(self, row: Mapping[str, object]) -> None:
        """Append a row. If OSError is raised, e.g. by a full disk, the file is unchanged."""
        line = (json.dumps(row, allow_nan=False) + "\n").encode()
        append_bytes(self.path, line, self._survives_power_cut)

    def rows(self) -> list[dict[str, object]]:
        """Return all rows in order. A last line that a crash cut off is left out.

        Raises InputError if a row is damaged.
        """
        return self._read()[0]

    def repair(self) -> None:
        """Remove a last line that a crash cut off, so that the next row begins a new line.

        The content under a second name of the file (hard link), such as a backup, stays as it is.
        """
        _, whole, cut_off = self._read()
        if cut_off or (whole and self.path.lstat().st_nlink > 1):
            write_bytes(self.path, whole)

    def damaged(self, line: int) -> InputError:
        """Return an InputError which says that line `line`, counted from 1, is damaged."""
        text = "damaged row; restore the file or run the study in a new folder"
        return InputError(f"{self.path}:{line}: {text}")

    def _read(self) -> tuple[list[dict[str, object]], bytes, bytes]:
        """Return the rows, the bytes of their lines, and the bytes of a cut-off last line."""
        try:
            content = read_file(self.path)
        except FileNotFoundError:
            return [], b"", b""
        except OSError as error:
            text = f"cannot be read: {error.strerror}; check its permissions"
            raise InputError(f"{self.path}: {text}") from None
        *lines, incomplete = content.split(b"\n")  # a row counts once its line has ended
        rows = []
        for number, line in enumerate(lines, start=1):
            try:
                row = parse_json(line)
            except (ValueError, RecursionError):
                row = None
            if not isinstance(row, dict):
                raise self.damaged(number)
            rows.append(row)
        return rows, content.removesuffix(incomplete), incomplete


def read_trials(folder: Path) -> list[Trial]:
    """Return all trials of a study's log in order."""
    path = folder / HISTORY
    if not path.is_file():
        raise InputError(f"{path}: is not there; give a study's results folder")
    return list(trials_of(JsonLines(path)))


def trials_of(log: JsonLines) -> Iterator[Trial]:
    """Yield the trials of a log in order. Raises InputError if a row is damaged."""
    for line, row in enumerate(log.rows(), start=1):
        try:
            yield Trial.from_row(row)
        except DAMAGED:
            raise log.damaged(line) from None


def read_seconds(folder: Path) -> dict[int, float]:
    """Return the wall-clock time [s] of each evaluation in a study's folder, by trial number."""
    log, seconds = JsonLines(folder / TIMINGS), {}
    for line, row in enumerate(log.rows(), start=1):
        number, time = row.get("number"), row.get("seconds")
        if not isinstance(number, int) or not isinstance(time, (int, float)):
            raise log.damaged(line)
        seconds[number] = float(time)
    return seconds


def trials_as_csv(trials: Iterable[Trial], seconds: Mapping[int, float]) -> str:
    """Return trials as CSV text, with the rows of `trial_rows`."""
    return csv_text(trial_rows(trials, seconds))


def trial_rows(trials: Iterable[Trial], seconds: Mapping[int, float]) -> list[dict[str, object]]:
    """Return a row for each trial, with a column for each parameter and metric.

    NAME_pm is the half-width of NAME, None where words such as "never" stand in the place of the
    number. A failed evaluation has no metrics.

    Args:
        seconds: wall-clock time [s] of each evaluation, by its number.
    """
    rows = []
    for one in trials:
        number = one.number + 1  # as pictures count
        row: dict[str, object] = {"number": number, "stage": one.stage, **one.parameters}
        row["objective"], row["half_width"] = _cells(one.objective)
        row |= {"score": one.score, "feasible": one.feasible, "reason": one.reason}
        row["seconds"] = seconds.get(one.number)
        for name, metric in one.metrics.items():
            row[name], row[f"{name}_pm"] = _cells(metric)
        rows.append(row)
    return rows


def _cells(figure: Estimate | None) -> tuple[object, object]:
    """Return the two cells of a figure in a table: its value and half-width.

    If words such as "never" stand for the value, return these words and None.
    """
    if figure is None or figure.in_words:
        return figure and figure.in_words, None
    return finite_or_none(figure.value), finite_or_none(figure.half_width)

"""The study's diary: one row per evaluation, on disk before the next begins; what it took in seconds stands apart.

Two runs of one study leave the same history.jsonl, byte for byte; only timings.jsonl differs.
"""

import csv
import io
import json
import math
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from chamberopt.common.errors import InputError
from chamberopt.common.files import sync_folder
from chamberopt.coverage.statistics.confidence_interval import Estimate

HISTORY = "history.jsonl"
TIMINGS = "timings.jsonl"


@dataclass(frozen=True)
class Trial:
    """One candidate as it was judged.

    stage: "search", "confirm" or "sweep" · point: in shares of the bounds · parameters: in the file's units, by dotted
    name · goals: every objective of the study, empty when the evaluation failed · metrics: without their pseudo-values
    · penalty: of the constraints, relative to their limits · score: what the optimiser saw, the first objective less
    penalties · reason: why it is not feasible, else "".
    """

    number: int
    stage: str
    point: tuple[float, ...]
    parameters: dict[str, float]
    goals: tuple[Estimate, ...]
    metrics: dict[str, Estimate]
    penalty: float
    score: float
    feasible: bool
    reason: str

    @property
    def objective(self) -> Estimate | None:
        """The first objective; None when the evaluation failed."""
        return self.goals[0] if self.goals else None

    def row(self) -> dict[str, Any]:
        """The trial as plain JSON values; numbers as Python prints them, which reads back to the same bits."""
        return {
            "number": self.number,
            "stage": self.stage,
            "point": list(self.point),
            "parameters": self.parameters,
            **(
                _plain(self.objective)
                if self.objective
                else {"objective": None, "half_width": None}
            ),
            "replicas": len(self.objective.pseudovalues) if self.objective else None,
            "goals": [_whole(goal) for goal in self.goals],
            "penalty": self.penalty,
            "score": self.score,
            "feasible": self.feasible,
            "reason": self.reason,
            "metrics": {name: _plain(metric, "value") for name, metric in self.metrics.items()},
        }

    @classmethod
    def from_row(cls, row: Mapping[str, Any]) -> Self:
        """The trial of a row. Raises KeyError, TypeError, ValueError or AttributeError for what is none."""
        return cls(
            number=int(row["number"]),
            stage=str(row["stage"]),
            point=tuple(float(share) for share in row["point"]),
            parameters={name: float(value) for name, value in row["parameters"].items()},
            goals=tuple(_goal(goal) for goal in row["goals"]),
            metrics={name: _estimate(metric, "value") for name, metric in row["metrics"].items()},
            penalty=float(row["penalty"]),
            score=float(row["score"]),
            feasible=bool(row["feasible"]),
            reason=str(row["reason"]),
        )


def _plain(estimate: Estimate, name: str = "objective") -> dict[str, float | None]:
    """JSON knows neither infinity, a half-width that is not known, nor NaN: both are null."""
    named = {name: estimate.value, "half_width": estimate.half_width}
    return {key: value if math.isfinite(value) else None for key, value in named.items()}


def _whole(estimate: Estimate) -> dict[str, Any]:
    """With pseudo-values, from which a model of the search learns how sure it is."""
    return {
        **_plain(estimate, "value"),
        "pseudovalues": list(estimate.pseudovalues),
        "bias": estimate.bias,
    }


def _goal(row: Mapping[str, Any]) -> Estimate:
    bare = _estimate(row, "value")
    return Estimate(
        bare.value,
        bare.half_width,
        tuple(float(x) for x in row["pseudovalues"]),
        float(row["bias"]),
    )


def _estimate(row: Mapping[str, Any], name: str) -> Estimate:
    value, half_width = row[name], row["half_width"]
    return Estimate(
        math.nan if value is None else float(value),
        math.inf if half_width is None else float(half_width),
    )


class JsonLines:
    """Rows of JSON, one a line, in a file that only grows: each is on the disk before `append` returns.

    lasting: even through a power cut, which costs milliseconds a row.
    """

    def __init__(self, path: Path, lasting: bool = True) -> None:
        self.path, self._lasting = path, lasting

    def append(self, row: Mapping[str, Any]) -> None:
        """Raises OSError where the row cannot be written, a full disk say: the file is then as it was before."""
        line = (json.dumps(row, allow_nan=False) + "\n").encode()
        created = not self.path.exists()
        with open(self.path, "ab", buffering=0) as file:
            length = os.fstat(file.fileno()).st_size
            try:
                while line:
                    line = line[file.write(line) :]
                if self._lasting:
                    os.fsync(file.fileno())
            except OSError as error:
                with suppress(OSError):
                    os.ftruncate(file.fileno(), length)
                raise OSError(error.errno, error.strerror, str(self.path)) from error
        if created and self._lasting:
            sync_folder(self.path.parent)

    def rows(self) -> list[dict[str, Any]]:
        """Every row, in order, without a last line torn by a crash. InputError names a row that is damaged."""
        return self._read()[0]

    def repair(self) -> None:
        """Cut off a last line torn by a crash, so that the next row begins a line of its own."""
        length = self._read()[1]
        if self.path.exists() and self.path.stat().st_size > length:
            os.truncate(self.path, length)

    def damaged(self, line: int) -> InputError:
        """What to raise about a row, counted from 1."""
        return InputError(
            f"{self.path}:{line}: damaged row; restore the file or run the study in a new folder"
        )

    def _read(self) -> tuple[list[dict[str, Any]], int]:
        """The rows, and how many bytes they take."""
        try:
            content = self.path.read_bytes()
        except FileNotFoundError:
            return [], 0
        except OSError as error:
            raise InputError(
                f"{self.path}: cannot be read: {error.strerror}; check its permissions"
            ) from None
        *lines, torn = content.split(b"\n")  # a row counts when its line is ended
        rows = []
        for number, line in enumerate(lines, start=1):
            try:
                row = json.loads(line)
            except ValueError:
                raise self.damaged(number) from None
            if not isinstance(row, dict):
                raise self.damaged(number)
            rows.append(row)
        return rows, len(content) - len(torn)


def read_trials(folder: Path) -> list[dict[str, Any]]:
    """Every row of a study's history, in order, with its seconds where they are known."""
    path = folder / HISTORY
    if not path.is_file():
        raise InputError(f"{path}: is not there; give a study's results folder")
    seconds = read_seconds(folder)
    return [
        {**row, "seconds": seconds.get(number)} for number, row in enumerate(JsonLines(path).rows())
    ]


def read_seconds(folder: Path) -> dict[int, float]:
    """Seconds of wall clock that each evaluation took, by its number."""
    return {
        row.get("number", -1): row.get("seconds", 0.0) for row in JsonLines(folder / TIMINGS).rows()
    }


def trials_as_csv(rows: list[dict[str, Any]]) -> str:
    """The history as a table: a column per parameter and metric, NAME_pm for the half-width of NAME."""
    flat = []
    for row in rows:
        line = {key: row[key] for key in ("number", "stage")}
        line |= row["parameters"]
        line |= {
            key: row[key]
            for key in ("objective", "half_width", "score", "feasible", "reason", "seconds")
        }
        for name, metric in row["metrics"].items():
            line |= {name: metric["value"], f"{name}_pm": metric["half_width"]}
        flat.append(line)
    # A failed evaluation has no metrics: the columns are those of all rows together.
    columns = list(dict.fromkeys(name for line in flat for name in line))
    text = io.StringIO()
    table = csv.DictWriter(text, columns, lineterminator="\n")
    table.writeheader()
    table.writerows(flat)
    return text.getvalue()

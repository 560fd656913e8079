"""The study's diary: one row per evaluation, on disk as soon as the evaluation ends."""

import csv
import io
import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from chamberopt.errors import InputError
from chamberopt.estimate import Estimate

HISTORY = "history.jsonl"


@dataclass(frozen=True)
class Trial:
    """One candidate as it was judged.

    stage: "search" or "confirm" · parameters: in the file's units, by dotted name · objective, metrics: None
    and empty when the evaluation failed · score: what the optimiser saw, objective less penalties ·
    reason: why it is not feasible, else "".
    """

    number: int
    stage: str
    parameters: dict[str, float]
    objective: Estimate | None
    metrics: dict[str, Estimate]
    score: float
    feasible: bool
    reason: str
    seconds: float

    def row(self) -> dict[str, Any]:
        """The trial as plain JSON values."""
        goal = self.objective
        return {
            "number": self.number,
            "stage": self.stage,
            "parameters": self.parameters,
            "objective": goal.value if goal else None,
            "half_width": goal.half_width if goal else None,
            "score": self.score,
            "feasible": self.feasible,
            "reason": self.reason,
            "metrics": {name: {"value": m.value, "half_width": m.half_width} for name, m in self.metrics.items()},
            "seconds": round(self.seconds, 3),
        }


class History:
    """Appends trials to FOLDER/history.jsonl; each is on the disk before `append` returns."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / HISTORY

    def append(self, trial: Trial) -> None:
        with open(self.path, "a", encoding="utf-8") as file:
            file.write(json.dumps(trial.row(), allow_nan=False) + "\n")
            file.flush()
            os.fsync(file.fileno())


def read_history(folder: Path) -> list[dict[str, Any]]:
    """Every row of a history, in order, without a last line torn by a crash; damage elsewhere is said."""
    path = folder / HISTORY
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}; give a study's results folder") from None
    rows = []
    for number, line in enumerate(lines, start=1):
        try:
            rows.append(json.loads(line))
        except json.JSONDecodeError:
            if number == len(lines):
                break
            raise InputError(f"{path}:{number}: damaged row; restore the file or run the study again") from None
    return rows


def as_csv(rows: list[dict[str, Any]]) -> str:
    """The history as a table: a column per parameter and metric, NAME_pm for the half-width of NAME."""
    flat = []
    for row in rows:
        line = {key: row[key] for key in ("number", "stage")}
        line |= row["parameters"]
        line |= {key: row[key] for key in ("objective", "half_width", "score", "feasible", "reason", "seconds")}
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

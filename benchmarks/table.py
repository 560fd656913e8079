"""The rows of a benchmark and where they go: a CSV in results/ that names the machine."""

import csv
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

RESULTS = Path(__file__).parent / "results"


def machine() -> str:
    """Operating system, processor and Python."""
    return (
        f"{platform.system()} {platform.machine()} {_processor()}, Python "
        f"{platform.python_version()}"
    )


def write_csv(name: str, rows: Sequence[dict[str, Any]]) -> Path:
    """Write results/``name``; every row begins with the machine. Returns the path."""
    path = RESULTS / name
    path.parent.mkdir(exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, ["machine", *rows[0]])
        writer.writeheader()
        writer.writerows({"machine": machine(), **row} for row in rows)
    return path


def read_csv(name: str) -> list[dict[str, float]]:
    """The rows of results/``name``, all of numbers, without the machine."""
    with (RESULTS / name).open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return [{key: float(text) for key, text in row.items() if key != "machine"} for row in rows]


def array_bytes(built: Any) -> int:
    """Memory of a structure's arrays, working space left out."""
    if isinstance(built, np.ndarray):
        return built.nbytes
    if not isinstance(built, tuple):
        return 0
    fields = getattr(built, "_fields", ("",) * len(built))
    parts = (
        part
        for field, part in zip(fields, built, strict=True)
        if field not in ("stack", "scratch", "probe")
    )
    return sum(map(array_bytes, parts))


def print_table(rows: Sequence[dict[str, Any]]) -> None:
    """The rows in columns."""
    lines = [list(rows[0]), *([str(value) for value in row.values()] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        print("  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)))


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        return next(
            line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")
        )
    except (OSError, StopIteration):
        return platform.processor()

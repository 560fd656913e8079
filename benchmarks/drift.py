"""Main figures of shipped designs from version to version: what moved beyond its interval?

    python -m benchmarks.drift                         the table of what is recorded
    python -m benchmarks.drift --check                 the same; exit status 1 if a figure of the
                                                       newest version moved, and no reason is kept
    python -m benchmarks.drift record                  simulate, append this version, print
        [--checkout FOLDER] [--why TEXT]
    python -m benchmarks.drift explain --why TEXT      keep a reason with the newest version,
        [--commit COMMIT]                              or with another

`record` simulates the designs of DESIGNS as their files say, on their own seeds and with the
budget of BUDGET, and appends value and half-width of each figure to benchmarks/results/drift.csv
with version, commit and the design's digest. The commit is the last that touched the sources or
the designs. A version that is recorded again replaces its rows. On two cores it takes some five
minutes. With --checkout another version is recorded, from its own sources: a `git worktree` of it.

A figure moved if it differs from the version before by more than both half-widths together, the
root of the sum of their squares. The seeds are the same, so an unchanged program gives the same
bits, and the table says so.
"""

import argparse
import csv
import hashlib
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from benchmarks.table import RESULTS, machine

ROOT = Path(__file__).parents[1]
FILE = RESULTS / "drift.csv"
DESIGNS = ("plate", "gear", "blade", "gear_zones")
SOURCES = ("chamberopt", "sim_core", "designs")
BUDGET = {"replicas": 8, "simulated_time_s": {"plate": 2.0, "gear": 1.5, "blade": 10.0}}
FIGURES = (
    "mean_coverage",
    "p05_coverage",
    "uniform_coverage",
    "time_to_98_s",
    "intensity_uniformity",
    "strength_um",
    "almen_intensity",
    "saturation_time_s",
    "mean_normal_speed_m_s",
    "impacts_per_mm2_s",
)


class Figure(NamedTuple):
    """A recorded figure of a design by a version."""

    machine: str
    version: str
    commit: str
    date: str
    why: str  # reason why figures of this version differ from those of the one before
    design: str
    design_sha256: str
    figure: str
    value: float
    half_width: float  # nan: not resolved

    @property
    def is_resolved(self) -> bool:
        return math.isfinite(self.half_width)


def verdict(before: Figure | None, after: Figure) -> str:
    """Return whether a figure moved from one version to the next, in a word."""
    if before is None:
        return "first"
    if (before.value, before.half_width) == (after.value, after.half_width) or (
        before.value == after.value and not (before.is_resolved or after.is_resolved)
    ):
        return "same bits"
    if not (before.is_resolved and after.is_resolved):
        return "not resolved"
    both = math.hypot(before.half_width, after.half_width)
    return "within" if abs(after.value - before.value) <= both else "MOVED"


def read(path: Path = FILE) -> list[Figure]:
    """Return the recorded figures, in the order in which versions were made."""
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        rows = [
            Figure(**{**row, "value": float(row["value"]), "half_width": float(row["half_width"])})
            for row in csv.DictReader(file)
        ]
    return sorted(rows, key=lambda row: row.date)


def write(rows: Sequence[Figure], path: Path = FILE) -> None:
    """Write all recorded figures."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(Figure._fields)
        writer.writerows(rows)


def versions(rows: Sequence[Figure]) -> list[tuple[str, str, str, str]]:
    """Return version, commit, date and reason of each recorded version, oldest first."""
    return [*dict.fromkeys((row.version, row.commit, row.date, row.why) for row in rows)]


def table(rows: Sequence[Figure]) -> str:
    """Return the drift table in Markdown: a row for each design and figure, a column a version."""
    found = versions(rows)
    names = [f"{version} {commit}" for version, commit, _, _ in found]
    lines = [f"| design | figure | {' | '.join(names)} |", f"|---|---|{'--:|' * len(names)}"]
    by = {(row.design, row.figure, row.commit): row for row in rows}
    for design, figure in dict.fromkeys((row.design, row.figure) for row in rows):
        cells, before = [], None
        for _, commit, _, _ in found:
            row = by.get((design, figure, commit))
            cells.append("" if row is None else _cell(before, row))
            before = row or before
        lines.append(f"| {design} | {figure} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _cell(before: Figure | None, row: Figure) -> str:
    word = verdict(before, row)
    if word == "same bits":
        return "="
    shown = f"{row.value:.4g} ± {row.half_width:.2g}" if row.is_resolved else "not resolved"
    changed = " (design changed)" if before and before.design_sha256 != row.design_sha256 else ""
    return f"**{shown}**{changed}" if word == "MOVED" else shown


def reasons(rows: Sequence[Figure]) -> str:
    """Return a list of the versions in Markdown: date, reason, and how many figures moved."""
    lines = []
    for version, commit, date, why in versions(rows):
        words = [word for row, word in verdicts(rows) if row.commit == commit]
        told = ", ".join(f"{words.count(word)} {word}" for word in dict.fromkeys(words))
        lines.append(f"- `{commit}` ({version}, {date[:10]}): {told}.{' ' if why else ''}{why}")
    return "\n".join(lines)


def verdicts(rows: Sequence[Figure]) -> list[tuple[Figure, str]]:
    """Return each recorded figure with whether it moved since the version before."""
    last: dict[tuple[str, str], Figure] = {}
    found = []
    for row in rows:
        key = row.design, row.figure
        found.append((row, verdict(last.get(key), row)))
        last[key] = row
    return found


def unexplained(rows: Sequence[Figure]) -> list[Figure]:
    """Return the figures of the newest version that moved, if no reason is kept with it."""
    if not rows:
        return []
    newest = versions(rows)[-1][1]
    return [
        row
        for row, word in verdicts(rows)
        if row.commit == newest and word == "MOVED" and not row.why
    ]


def record(checkout: Path, why: str) -> list[Figure]:
    """Simulate the designs with the sources of a checkout, and return their figures."""
    version, commit, date = _version(checkout)
    found = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copytree(checkout / "designs", folder / "designs")
        for design in DESIGNS:
            path = folder / "designs" / f"{design}.toml"
            if not path.is_file():
                continue
            sha256 = hashlib.sha256(path.read_bytes()).hexdigest()[:12]
            path.write_text(_with_budget(path.read_text(encoding="utf-8"), design), "utf-8")
            print(f"{commit}: {design}", file=sys.stderr, flush=True)
            metrics = _simulated(checkout, path, folder / design)
            for figure in FIGURES:
                if (value := metrics.get(figure)) is None:
                    continue
                width = value["half_width"]
                resolved = width is not None and value.get("in_words") != "not resolved"
                numbers = float(value["value"]), float(width) if resolved else math.nan
                found.append(
                    Figure(machine(), version, commit, date, why, design, sha256, figure, *numbers)
                )
    return found


def _with_budget(text: str, design: str) -> str:
    """Return a design's file with the replicas and simulated time that drift is recorded with."""
    seconds = BUDGET["simulated_time_s"].get(design)
    text = re.sub(r"(?m)^replicas = \d+", f"replicas = {BUDGET['replicas']}", text)
    if seconds is not None:
        text = re.sub(r"(?m)^simulated_time_s = [\d.]+", f"simulated_time_s = {seconds}", text)
    return text


def _simulated(checkout: Path, design: Path, out: Path) -> dict:
    """Return the metrics of a design by the program of a checkout."""
    setting = {**os.environ, "PYTHONPATH": str(checkout)}
    program = [sys.executable, "-m", "chamberopt", "simulate"]
    told = subprocess.run(
        [*program, "--help"], cwd=checkout, env=setting, capture_output=True, text=True, check=True
    )
    without = ["--no-ranges"] if "--no-ranges" in told.stdout else []
    subprocess.run(
        [*program, str(design), *without, "--out", str(out)],
        cwd=checkout, env=setting, stdout=subprocess.DEVNULL, check=True,
    )  # fmt: skip
    result = json.loads((out / "result.json").read_text(encoding="utf-8"))
    return {**result["metrics"], result["objective"].get("name", ""): result["objective"]}


def _version(checkout: Path) -> tuple[str, str, str]:
    """Return version, commit and date of the sources of a checkout; "+" ends a changed commit."""

    def git(*words: str) -> str:
        done = subprocess.run(
            ["git", "-C", str(checkout), *words], capture_output=True, text=True, check=True
        )
        return done.stdout.strip()

    commit, date = git("log", "-1", "--format=%h %cI", "--", *SOURCES).split()
    changed = "+" if git("status", "--porcelain", "--", *SOURCES) else ""
    text = (checkout / "pyproject.toml").read_text(encoding="utf-8")
    (version,) = re.findall(r'(?m)^version = "(.*)"', text)
    return version, commit + changed, date


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("action", nargs="?", choices=("show", "record", "explain"), default="show")
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--checkout", type=Path, default=ROOT)
    parser.add_argument("--why", default="", help="why figures of this version differ")
    parser.add_argument("--commit", help="of the version that is explained")
    options = parser.parse_args(arguments)
    if options.action == "record":
        new = record(options.checkout.resolve(), options.why)
        write(sorted([row for row in read() if row.commit != new[0].commit] + new, key=_made))
    rows = read()
    if options.action == "explain" and rows:
        chosen = options.commit or versions(rows)[-1][1]
        write([row._replace(why=options.why) if row.commit == chosen else row for row in rows])
        rows = read()
    if not rows:
        print(f"error: nothing is recorded in {FILE}: record first", file=sys.stderr)
        return 2
    print(table(rows), reasons(rows), sep="\n\n")
    for row in (moved := unexplained(rows)):
        print(f"{row.design}: {row.figure} moved, and no reason is kept: record it with --why")
    return 1 if options.check and moved else 0


def _made(row: Figure) -> str:
    return row.date


if __name__ == "__main__":
    sys.exit(main())

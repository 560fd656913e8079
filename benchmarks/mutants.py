"""How many seeded faults do the tests of a file catch?

    python benchmarks/mutants.py --seeds 20 --first 0
    python benchmarks/mutants.py --seeds 1 --first 7 --show
    python benchmarks/mutants.py --seeds 20 --first 0 --map .coverage

Each seed draws a file of the program that has a file of tests of its own, and puts one fault into
it: an operator or comparison becomes its opposite, a number grows by a half, a small whole one to
its successor and one that guards against rounding a thousandfold, a term of a sum or a factor of a
product is dropped, a condition is turned round. The tests of that file run on a copy of the
program, without the fault and with it. A fault that they pass is missed. With `--map` it is missed
only if all tests pass it that run its lines, by the map of a run of all tests in this folder, with
pytest-cov:

    python -m pytest --cov=chamberopt --cov=sim_core --cov-context=test --cov-report=

Compiled code and child processes leave no lines in the map; there the tests of the folder run.
Faults that change nothing count as missed, so the share is a lower bound. Lines for people
(messages, descriptions), and what says how lines and legends of a drawing look, get no faults. A
fault in the simulator's compiled code takes minutes, as all is compiled anew. Faults in constants
of a file and in its code are counted apart.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from benchmarks.table import print_table

ROOT = Path(__file__).resolve().parents[1]
COPIED = "chamberopt", "sim_core", "tests", "benchmarks", "designs", "studies", "docs"
OPPOSITES: dict[type[ast.AST], type[ast.AST]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Lt: ast.GtE,
    ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.And: ast.Or, ast.Or: ast.And,
    ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
}  # fmt: skip
# Arguments of drawings: how thick lines are and where a legend stands is seen, and not tested.
LOOKS = {
    "lw", "ls", "line_width", "ms", "mew", "point_size", "capsize", "linespacing", "handlelength",
    "bbox_to_anchor", "label_font_size", "arrowprops",
}  # fmt: skip
# Of faults: in a number that a file chooses, which a test would tell from a half more by repeating
# it, or in what the file does.
CHOICE, CODE = "choice", "code"
MANY = 10  # the successor of a whole number from here on is hardly another one
ROUNDING = 1e-6  # numbers below it guard against rounding: a half more would change nothing
# Of the tests of a file, and of all; a fault that makes them longer is caught.
LONGEST_S, LONGEST_OF_ALL_S = 600.0, 3600.0


def mirrored(packages: tuple[str, ...]) -> list[tuple[Path, Path]]:
    """Files of the program with the tests of each, both relative to the root."""
    pairs = []
    for package in packages:
        for path in sorted((ROOT / package).rglob("*.py")):
            own = path.relative_to(ROOT)
            test = Path("tests") / own.with_name(f"test_{own.name}")
            if (ROOT / test).is_file():
                pairs.append((own, test))
    return pairs


class Faults(ast.NodeTransformer):
    """Puts the fault with a number into a tree; `count` is how many faults there can be.

    Its `kind` is CHOICE in the value of a constant of the file, such as MAX_PASSES, else CODE.
    """

    def __init__(self, chosen: int = -1) -> None:
        self.count, self._chosen, self.text, self.line = 0, chosen, "", 0
        self.kind, self._now = CODE, CODE

    def _is_chosen(self, node: ast.AST, text: str) -> bool:
        self.count += 1
        if self.count - 1 != self._chosen:
            return False
        self.line, self.kind = getattr(node, "lineno", 1), self._now
        self.text = f"line {self.line}: {text}"
        return True

    def visit_JoinedStr(self, node: ast.JoinedStr) -> ast.AST:
        return node  # words

    def visit_Assign(self, node: ast.Assign) -> ast.AST:
        names = [one.id for one in ast.walk(node.targets[0]) if isinstance(one, ast.Name)]
        self._now = CHOICE if node.col_offset == 0 and all(map(str.isupper, names)) else CODE
        self.generic_visit(node)
        self._now = CODE
        return node

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:
        if node.value is not None:
            node.value = self.visit(node.value)
        return node

    def visit_Call(self, node: ast.Call) -> ast.AST:
        if isinstance(node.func, ast.Attribute) and node.func.attr == "reshape":
            node.func = self.visit(node.func)
            return node  # any length below 0 is one that numpy finds
        return self.generic_visit(node)

    def visit_keyword(self, node: ast.keyword) -> ast.AST:
        return node if node.arg in LOOKS else self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        before = ast.unparse(node)
        if isinstance(node.op, (ast.Add, ast.Sub, ast.Mult)):
            for kept in (node.left, node.right):
                if self._is_chosen(node, f"{before} -> {ast.unparse(kept)}"):
                    return kept
        if opposite := OPPOSITES.get(type(node.op)):
            changed = ast.BinOp(node.left, opposite(), node.right)  # type: ignore[arg-type]
            if self._is_chosen(node, f"{before} -> {ast.unparse(changed)}"):
                return ast.copy_location(changed, node)
        return node

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        self.generic_visit(node)
        opposite = OPPOSITES.get(type(node.ops[0]))
        if opposite and self._is_chosen(node, f"{ast.unparse(node)} turned round"):
            node.ops[0] = opposite()  # type: ignore[call-overload]
        return node

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.AST:
        self.generic_visit(node)
        if self._is_chosen(node, f"{ast.unparse(node)}: and for or"):
            node.op = OPPOSITES[type(node.op)]()  # type: ignore[assignment]
        return node

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        if isinstance(node.value, bool) or not isinstance(node.value, (int, float)):
            return node
        if isinstance(node.value, int):
            value: float = node.value + (1 if node.value < MANY else node.value // 2)
        else:
            value = (1e3 if node.value < ROUNDING else 1.5) * node.value or 0.5
        if self._is_chosen(node, f"{node.value} -> {value}"):
            return ast.copy_location(ast.Constant(value), node)
        return node


def with_fault(source: str, rng: random.Random) -> tuple[str, Faults]:
    """The source with one fault, and the fault; an empty text if there is nothing to change."""
    counted = Faults()
    counted.visit(ast.parse(source))
    if not counted.count:
        return "", counted
    fault = Faults(rng.randrange(counted.count))
    tree = ast.fix_missing_locations(fault.visit(ast.parse(source)))
    return ast.unparse(tree), fault


def drawn(seeds: range, packages: tuple[str, ...]) -> Iterator[tuple[int, Path, Path, str, Faults]]:
    """For each seed a file, its tests, the file's text with a fault, and the fault."""
    pairs = mirrored(packages)
    for seed in seeds:
        rng, text = random.Random(seed), ""
        while not text:
            own, test = rng.choice(pairs)
            text, fault = with_fault((ROOT / own).read_text("utf-8"), rng)
        yield seed, own, test, text, fault


def lines_of(source: str, fault: Faults) -> set[int]:
    """The lines that run a fault: its statement, or of a constant all that name it."""
    holds = [
        node for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.stmt) and node.lineno <= fault.line <= (node.end_lineno or 0)
    ]  # fmt: skip
    inner = min(holds, key=lambda node: (node.end_lineno or 0) - node.lineno)
    if fault.kind == CODE:
        return set(range(inner.lineno, (inner.end_lineno or 0) + 1))
    lines = source.splitlines()
    names = re.findall(r"\b[A-Z][A-Z0-9_]+\b", lines[inner.lineno - 1].partition("=")[0])
    used = re.compile(rf"\b({'|'.join(names)})\b")
    return {k for k, line in enumerate(lines, 1) if used.search(line)}


def running(lines: set[int], own: Path, database: Path) -> list[str]:
    """The tests that run some lines of a file, by the map of `--map`."""
    from coverage import CoverageData

    data = CoverageData(str(database))
    data.read()
    by_line = data.contexts_by_lineno(str(ROOT / own))
    return sorted({one.partition("|")[0] for line in lines for one in by_line.get(line, ()) if one})


def is_caught(copy: Path, own: Path, tests: list[str], text: str) -> bool:
    """Whether tests fail with the fault in the copy, which is mended afterwards.

    Args:
        tests: files, folders or names of single tests.
    """
    (copy / own).write_text(text, "utf-8")
    one_file = len(tests) == 1 and tests[0].endswith(".py")
    workers, longest = ("1", LONGEST_S) if one_file else ("auto", LONGEST_OF_ALL_S)
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-n", workers, *tests]
    environment = {**os.environ, "PYTHONPATH": str(copy)}
    try:
        ended = subprocess.run(
            command, cwd=copy, env=environment, capture_output=True, timeout=longest, check=False
        )
    except subprocess.TimeoutExpired:
        return True
    finally:
        shutil.copy(ROOT / own, copy / own)
    return ended.returncode != 0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--packages", default="chamberopt,sim_core")
    parser.add_argument("--map", type=Path, help="ask all tests that run the fault, by this map")
    parser.add_argument("--show", action="store_true", help="tell the faults, run no tests")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.seeds)
    faults, rows = drawn(seeds, tuple(options.packages.split(","))), []
    passed: set[Path] = set()  # files whose tests pass without a fault
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        if not options.show:
            for name in COPIED:
                shutil.copytree(ROOT / name, copy / name)
            shutil.copy(ROOT / "pyproject.toml", copy)
        for seed, own, test, text, fault in faults:
            caught: bool | str = "not run"
            if not options.show:
                source = (ROOT / own).read_text("utf-8")
                if test not in passed and is_caught(copy, own, [str(test)], source):
                    sys.exit(f"{test} fails without a fault")
                passed.add(test)
                caught = is_caught(copy, own, [str(test)], text)
                if not caught and options.map:
                    found = running(lines_of(source, fault), own, options.map)
                    caught = is_caught(copy, own, found or [str(test.parent)], text)
            rows.append((fault.kind, caught))
            print(seed, own.as_posix(), fault.kind, fault.text, caught, sep="  ", flush=True)
    if not options.show:
        print_table([
            {"in": kind, "faults": len(own), "caught": sum(own)}
            for kind in (CODE, CHOICE)
            for own in [[bool(caught) for its, caught in rows if its == kind]]
        ])  # fmt: skip


if __name__ == "__main__":
    main()

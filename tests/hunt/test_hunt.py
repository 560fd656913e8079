"""Wrong files and arguments, drawn from a seed: each is refused with one message, or works.

Every command runs in a process of its own with limits on memory and time. Accepted are exit 0, and
exit 2 with a message, without a traceback and without a file made or changed. A seed that fails is
repeated with `pytest -m long -k "toml and 47"` or as a case of FIXED.
"""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.hunt import arguments, meshes, results, toml_files
from tests.hunt.base import write_base
from tests.hunt.command import WITHOUT_VTK, Executable, Server, fault, fingerprint

DRAW: dict[str, Callable[[random.Random, Path, Path], list[str]]] = {
    "toml": toml_files.write_wrong_files,
    "mesh": meshes.write_wrong_mesh,
    "arguments": arguments.draw_arguments,
    "results": results.write_altered_results,
    "formulas": results.write_formulas,
    "many": toml_files.write_many_keys,
    "step": meshes.write_damaged_step,
}
FEW = {"toml": 12, "mesh": 10, "arguments": 8, "results": 2, "formulas": 2, "many": 4, "step": 2}
# Seeds whose commands end within seconds, for the program that a user starts.
STARTED = {"toml": (0, 1, 2), "mesh": (1, 4, 10), "arguments": (1, 4, 7), "results": (3, 6, 8),
           "formulas": (0,), "many": (0, 1), "step": (0,)}  # fmt: skip
MANY = {"toml": 5_000, "mesh": 3_000, "arguments": 1_000, "results": 1_000, "formulas": 300,
        "many": 300, "step": 500}  # fmt: skip
CHUNK = 100
LONG = [(kind, at) for kind, count in MANY.items() for at in range(0, count, CHUNK)]
REPLACED = "report.html"  # a command replaces its own older page


@pytest.fixture(scope="module")
def base(server: Server, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The small design and study, with a result of each command that makes one."""
    folder = tmp_path_factory.mktemp("base")
    write_base(folder)
    for words in (
        ["simulate", "design.toml", "--out", "result"],
        ["run", "study.toml", "--no-ranges", "--out", "study"],
        ["sweep", "study.toml", "--grid", "2", "--out", "sweep", "--workers", "1"],
    ):
        outcome = server.run(folder, words, seconds=300, within=WITHOUT_VTK)
        assert outcome.status == 0, outcome.errors
    return folder


def complaint(
    server: Server | Executable, kind: str, seed: int, folder: Path, base: Path
) -> str | None:
    """What is wrong with the end of one drawn command, or None; the folder is removed."""
    folder.mkdir()
    words = DRAW[kind](random.Random(f"{kind}{seed}"), folder, base)
    before = fingerprint(folder)
    outcome = server.run(folder, words)
    after, formulas = fingerprint(folder), results.formula_cells(folder)
    shutil.rmtree(folder)
    why = fault(outcome)
    changed = [name for name in before if after.get(name) != before[name]]
    if words[:1] == ["run"]:  # goes on with the study that it resumes
        changed = [name for name in changed if not name.startswith("study/")]
    if not why and any(not name.endswith(REPLACED) for name in changed):
        why = f"it changed {changed}"
    if not why and formulas:
        why = f"its table has the formulas {formulas}"
    made = sorted(after.keys() - before.keys() - {"results"})  # made before it is looked into
    if not why and outcome.status and made:
        why = f"it was refused and left {made}"
    return why and f"{kind} {seed}: {why}: chamberopt {words}\n{outcome.errors[-1500:]}"


@pytest.mark.parametrize("kind", DRAW)
def test_some_wrong_input_is_refused(server: Server, base: Path, tmp_path: Path, kind: str) -> None:
    complaints = [complaint(server, kind, k, tmp_path / "case", base) for k in range(FEW[kind])]
    assert not any(complaints), "\n\n".join(filter(None, complaints))


@pytest.mark.parametrize("kind", DRAW)
def test_the_program_that_a_user_starts_refuses_it(base: Path, tmp_path: Path, kind: str) -> None:
    case, seeds = tmp_path / "case", STARTED[kind]
    complaints = [complaint(Executable(), kind, seed, case, base) for seed in seeds]
    assert not any(complaints), "\n\n".join(filter(None, complaints))


@pytest.mark.long
@pytest.mark.parametrize(("kind", "first"), LONG)
def test_much_wrong_input_is_refused(
    server: Server, base: Path, tmp_path: Path, kind: str, first: int
) -> None:
    seeds = range(first, first + CHUNK)
    complaints = [complaint(server, kind, seed, tmp_path / "case", base) for seed in seeds]
    assert not any(complaints), "\n\n".join(filter(None, complaints))

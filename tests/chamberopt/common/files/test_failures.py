"""The n-th system call fails, for every n: afterwards the old or the new state stands, whole."""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
from pathlib import Path

import pytest

from tests.chamberopt.common.files.scene import RUN, SIMULATE, write_scene
from tests.hunt.command import Outcome, Server, fault

HERE = "tests.chamberopt.common.files"
ERRORS = (errno.ENOSPC, errno.EIO, errno.EACCES, errno.ENOLCK)
SWEEP = "sweep study.toml --grid 2 --workers 1 --out study"
RESUMED = (RUN, SWEEP)
OUTPUTS = {
    SIMULATE: "result", RUN: "study", SWEEP: "study", "save": "design.toml",
    "new box.stl --unit mm --no-pilot --out new": "new", "check design.toml --out check": "check",
    "report given": "given/report.html", "report given --sheet": "given/process_sheet.pdf",
    "export given --to fields-vtp --to chamber-3mf --out all": "all",
    "export given --to impacts-csv --workers 1 --out impacts.csv": "impacts.csv",
}  # fmt: skip
# What differs between two runs that nothing disturbed.
DIFFERS = ("timings.jsonl", "history.csv")
DATED = (".json", ".html", ".pdf")
DATES = re.compile(
    rb'"(created|sha256|seconds|\w+\.csv)": [^\n]*|"(timings_s|files)": \{[^}]*\}'
    rb"|report made [-\d]*|/CreationDate \([^)]*\)"
)


@pytest.fixture(scope="module")
def scene(server: Server, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The tiny scene with a result, "given"."""
    folder = tmp_path_factory.mktemp("scene")
    write_scene(folder)
    assert server.run(folder, SIMULATE.replace("result", "given").split()).status == 0
    for one in ("", " --sheet"):
        assert server.run(folder, f"report given{one}".split()).status == 0
    return folder


def run(server: Server, folder: Path, number: int, how: tuple[int, str], words: str) -> Outcome:
    request = [str(number), str(how[0]), how[1], *words.split()]
    return server.run(folder, request, seconds=60, within=f"{HERE}.shim:run_failing")


def state(path: Path) -> dict[str, bytes]:
    """What a file, or each file in a folder, holds, but for dates and times."""
    files = [path] if path.is_file() else [one for one in sorted(path.rglob("*")) if one.is_file()]
    return {
        one.relative_to(path.parent).as_posix(): (
            DATES.sub(b"", one.read_bytes()) if one.suffix in DATED else one.read_bytes()
        )
        for one in files
        if one.name not in DIFFERS
    }


def every_failure(
    server: Server, scene: Path, place: Path, words: str, hows: list[tuple[int, str]], step: int = 1
) -> None:
    """Fail each call of a command, or one of `step`, and look at what it leaves."""
    output = OUTPUTS[words]
    folder = place / "here"
    shutil.copytree(scene, folder)
    before = state(folder / output)
    outcome = run(server, folder, 0, (0, "once"), words)
    assert outcome.status == 0, outcome.errors
    calls = int(outcome.output.rpartition("calls: ")[2])
    after = state(folder / output)
    shutil.rmtree(folder)
    others = names(scene, output)
    seen: set[str] = set()
    failed, numbers = 0, range(1, calls + 1, step)
    for number in numbers:
        for how in hows or [(ERRORS[number % 4], "once")]:
            shutil.copytree(scene, folder, copy_function=os.link)
            outcome = run(server, folder, number, how, words)
            told = f"call {number} of {calls}, {how}: {outcome}"
            assert fault(outcome, (0, 1, 2)) is None, told
            found = state(folder / output)
            failed += outcome.status != 0
            if outcome.status == 0:
                assert found == after, told
            else:
                message = os.strerror(how[0])
                assert outcome.errors.count(message) == 1, told
                # simulate reads what it wrote, to tell its figures, when the result is whole
                was_read = f"{output}/result.json: cannot be read" in outcome.errors
                if words not in RESUMED:
                    assert found == (after if was_read else before), told
            assert not list(folder.rglob(".*")), told
            assert names(folder, output) == others, told
            key = json.dumps({name: str(hash(content)) for name, content in found.items()})
            if words in RESUMED and outcome.status and key not in seen:
                seen.add(key)
                again = server.run(folder, words.split(), seconds=60)
                assert again.status == 0, f"{told}; resumed: {again}"
                assert state(folder / output) == after, told
            shutil.rmtree(folder)
    assert failed > len(numbers) / 2  # what fails is mostly told


def names(folder: Path, output: str) -> set[str]:
    """The names in a folder but those of the output."""
    found = {one.relative_to(folder).as_posix() for one in folder.rglob("*")}
    return {one for one in found if not one.startswith(output)}


# The long tests fail every call. Three is prime to the four errors, which take turns.
@pytest.mark.parametrize(
    ("words", "step"), [(SIMULATE, 3), pytest.param(RUN, 1, marks=pytest.mark.long), ("save", 1)]
)
def test_of_each_call(words: str, step: int, server: Server, scene: Path, tmp_path: Path) -> None:
    every_failure(server, scene, tmp_path, words, [], step)


@pytest.mark.long
@pytest.mark.parametrize("words", OUTPUTS)
def test_of_each_call_in_each_way(words: str, server: Server, scene: Path, tmp_path: Path) -> None:
    """With each error; and with a disk that stays full from there on."""
    hows = [*((error, "once") for error in ERRORS), (errno.ENOSPC, "on")]
    every_failure(server, scene, tmp_path, words, hows)

"""Results that were altered together with all their digests: what no result has is refused."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chamberopt.results.arrays_file import ARRAYS_FILE, read_result_arrays
from tests.helpers.results.arrays import change_elements
from tests.helpers.results.digests import accept_changes
from tests.hunt.base import write_base
from tests.hunt.command import WITHOUT_VTK, Server, fault


@pytest.fixture(scope="module")
def result(server: Server, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("forged")
    write_base(folder)
    words = ["simulate", "design.toml", "--no-ranges", "--out", "result"]
    assert server.run(folder, words, seconds=300, within=WITHOUT_VTK).status == 0
    return folder / "result"


def _values(**changed: Any) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        file = folder / "result.json"
        file.write_text(json.dumps({**json.loads(file.read_text()), **changed}))

    return change


def _column(name: str, value: Callable[[np.ndarray], Any]) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        column = read_result_arrays(folder / ARRAYS_FILE).elements[name]
        change_elements(folder, **{name: value(column)})

    return change


def _entries(change: Callable[[dict[str, np.ndarray]], Any]) -> Callable[[Path], None]:
    """A change of the entries of arrays.npz, as numpy has them."""

    def changed(folder: Path) -> None:
        with np.load(folder / ARRAYS_FILE) as file:
            entries = dict(file)
        change(entries)
        np.savez_compressed(folder / ARRAYS_FILE, **entries)

    return changed


def _truncated(folder: Path) -> None:
    content = (folder / ARRAYS_FILE).read_bytes()
    (folder / ARRAYS_FILE).write_bytes(content[: len(content) // 2])


LOOK, REPLAY = ["report", "result"], ["replay", "result", "film.gif"]
# What is altered, the command, and what it says.
FORGED: dict[str, tuple[Callable[[Path], None], list[str], str]] = {
    "half of the arrays": (_truncated, LOOK, r"arrays\.npz: damaged"),
    "arrays that fill memory": (
        _entries(lambda one: one.update(a0=np.zeros(2 * 10**8, np.uint8))),
        LOOK,
        "unpacks to",
    ),
    "objects for numbers": (
        _entries(lambda one: one.update(a0=np.array([{}], dtype=object))),
        LOOK,
        "allow_pickle=False",
    ),
    "no vertices": (_entries(lambda one: one.pop("a0")), LOOK, r"arrays\.npz: damaged"),
    "three numbers for coverage": (
        _column("coverage", lambda one: np.stack([one] * 3, axis=1)),
        LOOK,
        "coverage has the shape",
    ),
    "coverage that is none": (
        _column("coverage", lambda one: one * np.nan),
        LOOK,
        "an exposed triangle has no coverage",
    ),
    "an area beyond all": (
        _column("exposed_area_mm2", lambda one: one + 1e300),
        LOOK,
        "exposed_area_mm2 has a number that is not from",
    ),
    "a table for a curve": (_values(coverage_against_time={"x": 1}), LOOK, "coverage_against_time"),
    "a row without time": (_values(coverage_against_time=[{}]), LOOK, "coverage_against_time.0"),
    "a number for a stream": (_values(stream=5), REPLAY, "stream: Input should be"),
    "a text for effects": (_values(effects="all"), LOOK, "effects: Input should be"),
    "a number for a date": (_values(created=5), LOOK, "created: Input should be"),
    "half a character": (_values(notes=["\ud800"]), LOOK, "surrogates not allowed"),
    "no date": (_values(created="soon"), LOOK, "created: "),
    "a seed of 400 digits": (_values(seed=10**400), REPLAY, "more digits"),
    "another seed": (_values(seed=7), REPLAY, "seed: given 7, its design has 1"),
}


@pytest.mark.parametrize("case", FORGED)
def test_what_no_result_has_is_refused(
    server: Server, result: Path, tmp_path: Path, case: str
) -> None:
    change, words, message = FORGED[case]
    folder = tmp_path / "result"
    shutil.copytree(result, folder)
    change(folder)
    accept_changes(folder)

    outcome = server.run(tmp_path, words)

    assert fault(outcome) is None, outcome.errors
    assert outcome.status == 2
    assert re.search(message, outcome.errors), outcome.errors

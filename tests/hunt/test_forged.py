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

from chamberopt.results.vtp_files import pyvista, save_surface
from tests.helpers.results.digests import accept_changes
from tests.hunt.base import write_base
from tests.hunt.command import Server, fault


@pytest.fixture(scope="module")
def result(server: Server, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("forged")
    write_base(folder)
    words = ["simulate", "design.toml", "--out", "result"]
    assert server.run(folder, words, seconds=300).status == 0
    return folder / "result"


def _values(**changed: Any) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        file = folder / "result.json"
        file.write_text(json.dumps({**json.loads(file.read_text()), **changed}))

    return change


def _count(name: str, count: int) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        path = folder / name
        path.write_text(
            re.sub(r'NumberOfPoints="\d+"', f'NumberOfPoints="{count}"', path.read_text())
        )

    return change


def _column(name: str, value: Callable[[np.ndarray], Any]) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        surface = pyvista().read(folder / "part.vtp")
        surface.cell_data[name] = value(np.asarray(surface.cell_data[name]))
        save_surface(folder / "part.vtp", surface)

    return change


LOOK, REPLAY = ["report", "result"], ["replay", "result", "film.gif"]
# What is altered, the command, and what it says.
FORGED: dict[str, tuple[Callable[[Path], None], list[str], str]] = {
    "a huge count in part.vtp": (_count("part.vtp", 8 * 10**12), LOOK, "NumberOfPoints"),
    "a large count in part.vtp": (_count("part.vtp", 5 * 10**7), LOOK, "far too short"),
    "a huge count in chamber.vtp": (_count("chamber.vtp", 8 * 10**12), LOOK, "NumberOfPoints"),
    "three numbers for coverage": (
        _column("coverage", lambda one: np.stack([one] * 3, axis=1)),
        LOOK,
        "coverage has 3 numbers for each place",
    ),
    "coverage that is none": (
        _column("coverage", lambda one: one * np.nan),
        LOOK,
        "an exposed triangle has no coverage",
    ),
    "an area beyond all": (
        _column("exposed_area_mm2", lambda one: one + 1e300),
        LOOK,
        "infinite or too large",
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

"""How long a run will take, by results of like designs."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from chamberopt.design.load import save_design
from chamberopt.page.duration import _whole_seconds, duration_in_words
from chamberopt.results.load import Result
from tests.helpers.results.short_plate import plate_result
from tests.helpers.synthetic import DESIGNS


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    return plate_result(tmp_path_factory.mktemp("plate") / "result")


def test_it_grows_with_the_replicas(result: Result, tmp_path: Path) -> None:
    seconds = sum(result.record.timings_s.values()) / result.record.replicas
    replicas = round(600.0 / seconds)
    save_design(result.design.changed({"process.accuracy.replicas": replicas}), tmp_path / "a.toml")
    assert duration_in_words(tmp_path / "a.toml", [tmp_path, result.folder]) == "about 10 minutes"


def test_a_study_takes_as_long_as_its_evaluations(result: Result, tmp_path: Path) -> None:
    save_design(result.design, tmp_path / "a.toml")
    study = 'design = "a.toml"\n[vary]\n"chamber.height_mm" = { low = 20, high = 60 }\n'
    (tmp_path / "study.toml").write_text(f"{study}[optimizer]\nevaluations = 100000\n")
    words = duration_in_words(tmp_path / "study.toml", [result.folder])
    assert words.endswith(("minutes", "hours"))
    assert " to " in words  # by a design's result it is not known how many replicas they take
    known = SimpleNamespace(study=SimpleNamespace(seconds=366.0, evaluations=6))
    like: Any = SimpleNamespace(record=known)
    assert _whole_seconds(result.design, 9, like) == 549.0


def test_nothing_is_said_of_another_part(result: Result) -> None:
    assert duration_in_words(DESIGNS / "gear.toml", [result.folder]) == ""

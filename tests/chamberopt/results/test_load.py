"""Damaged, unfinished and foreign folders are refused with a reason."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from chamberopt.common.errors import InputError
from chamberopt.results.load import Result, load_result, load_start
from chamberopt.results.records import FORMAT
from chamberopt.workflows import save_run
from chamberopt.workflows.save_run import save_simulation
from tests.helpers.results.digests import replace_result
from tests.helpers.synthetic import plate_design, plate_evaluation

DESIGN = plate_design()


@pytest.fixture
def no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        save_run, "draw_coverage", lambda *_: "coverage.png skipped: no OpenGL library found"
    )


def wrong_figures(text: str) -> list[dict]:
    """Well-formed variants of result.json whose objective is no number or that lack a metric."""
    wrong = []
    for value in ("x", None, float("nan"), []):
        data = json.loads(text)
        data["objective"]["value"] = value
        wrong.append(data)
    data = json.loads(text)
    del data["metrics"]["std_coverage"]
    return [*wrong, data]


@pytest.mark.usefixtures("no_pictures")
def test_a_result_can_be_looked_at_without_the_parts_file(tmp_path: Path) -> None:
    folder = tmp_path / "plate"
    save_simulation(folder, DESIGN, *plate_evaluation())
    data = json.loads((folder / "result.json").read_text())
    data["design"]["part"]["mesh"] = "gone.stl"
    replace_result(folder, data)
    assert not load_result(folder).design.part.mesh_path.exists()
    assert load_result(folder).objective.value == plate_evaluation()[1].objective.value


@pytest.mark.usefixtures("no_pictures")
def test_what_is_no_result_is_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not a results folder"):
        load_result(tmp_path)
    for name, said in (("calibration", "calibration.txt and"), ("strip", "strip.png and")):
        folder = tmp_path / name
        folder.mkdir()
        (folder / f"{name}.json").write_text("{}")
        with pytest.raises(InputError, match=f"{said} .*made by simulate or run is needed"):
            load_result(folder)
    (tmp_path / "history.jsonl").write_text("{}\n")
    with pytest.raises(InputError, match="has not finished"):
        load_result(tmp_path)
    folder = tmp_path / "plate"
    save_simulation(folder, DESIGN, *plate_evaluation())
    text = (folder / "result.json").read_text()
    for damaged in (text[: len(text) // 2], "[]", "{}", text.replace('"metrics"', '"metric"')):
        (folder / "result.json").write_text(damaged)
        with pytest.raises(InputError, match=r"damaged|not as it was written"):
            load_result(folder)
    for wrong in wrong_figures(text):
        replace_result(folder, wrong)
        with pytest.raises(InputError, match="damaged"):
            load_result(folder)
    (folder / "result.json").write_text(text.replace(f'"format": {FORMAT}', '"format": 99'))
    with pytest.raises(InputError, match=rf"in format 99, expected {FORMAT}: .* read it with"):
        load_result(folder)


def test_a_link_that_leads_back_to_itself_is_refused(tmp_path: Path) -> None:
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    with pytest.raises(InputError, match="a link that leads back to itself"):
        load_result(loop)


def test_a_study_without_its_start_says_where_it_was(tmp_path: Path) -> None:
    study = cast(Result, SimpleNamespace(study="a study", folder=tmp_path))
    with pytest.raises(InputError, match=r"start: not there, and a study has it; restore"):
        load_start(study)

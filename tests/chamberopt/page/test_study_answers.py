"""What the page shows of a study is what its log says, and damaged logs are refused in words."""

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from chamberopt.common.errors import InputError
from chamberopt.design.load import load_design
from chamberopt.page import further_study
from chamberopt.page.acts import Acts, list_results
from chamberopt.page.study_answers import (
    _front,
    _name,
    candidate_answer,
    candidates_answer,
    model_answer,
)
from chamberopt.search.study import load_study
from chamberopt.search.trial_log import Trial, read_trials
from tests.helpers.results.followed_study import BUDGET, Hill, followed_study
from tests.helpers.studies import run_in_folder


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return followed_study(tmp_path_factory.mktemp("followed"))


@pytest.fixture
def copy(out: Path, tmp_path: Path) -> Path:
    """The results folder in a copy of the design's folder."""
    shutil.copytree(out.parents[1], tmp_path / "copy")
    return tmp_path / "copy" / "results" / "study"


def rewritten(folder: Path, row: int, **values: Any) -> None:
    """Replace values in one row of the trial log."""
    log = folder / "history.jsonl"
    rows = [json.loads(line) for line in log.read_text().splitlines()]
    rows[row] |= values
    log.write_text("".join(json.dumps(one) + "\n" for one in rows))


def test_every_candidate_is_there_as_the_log_has_it(out: Path) -> None:
    answer: Any = json.loads(json.dumps(candidates_answer(out), allow_nan=False))
    trials = read_trials(out)
    assert not answer["finished"]
    assert answer["objectives"] == ["uniform coverage"]
    assert [one["name"] for one in answer["varied"]] == ["chamber.height_mm", "shot.mass_g"]
    assert [one["values"] for one in answer["candidates"]] == [one.parameters for one in trials]
    kinds = [one["kind"] for one in answer["candidates"]]
    assert answer["sentence"] == (
        f"{BUDGET} proposed, {kinds.count('refused')} refused by geometry before any simulation, "
        f"{kinds.count('simulated')} simulated, 2 confirmed with new seeds. "
        "The objective is uniform coverage: mean minus standard deviation of coverage."
    )
    assert kinds.count("refused") > 0
    assert [one["is_start"] for one in answer["candidates"]].index(True) == 0
    (best,) = (one for one in answer["candidates"] if one["is_best"])
    confirmed = {one.point: one for one in trials if one.stage == "confirm"}.values()
    assert best["number"] == 1 + max(confirmed, key=lambda one: one.score).number
    assert (best["standing"], answer["candidates"][0]["standing"]) == (
        "the best so far",
        "the start",
    )
    for one, trial in zip(answer["candidates"], trials, strict=True):
        assert (one["objective"] is None) == (not trial.goals)
    scores = [one.goals[0].value for one in trials if one.goals and one.stage == "search"]
    assert [best for _, best in answer["best"]] == np.maximum.accumulate(scores).tolist()


def test_a_confirmation_is_named_by_the_candidate_that_it_confirms() -> None:
    search, confirm = (cast(Trial, SimpleNamespace(stage=one)) for one in ("search", "confirm"))
    assert _name(search, 3, 3) == "3"
    assert _name(confirm, 6, 3) == "3 again"
    assert _name(confirm, 7, 7) == "7, by the model"


def test_the_front_names_candidates_as_the_page_does_from_the_least_of_the_first_objective() -> (
    None
):
    rng = np.random.default_rng(0)
    rows = [(2.0, 1.0), (0.0, 3.0), (1.0, 2.0), (0.5, 2.0), (3.0, 3.0), (3.0, 3.0), ()]
    for order in (np.arange(7), rng.permutation(7)):
        trials: Any = [
            SimpleNamespace(
                number=number,
                goals=[SimpleNamespace(value=one) for one in rows[k]],
                stage="confirm" if k == 5 else "search",
                feasible=k != 4,
            )
            for number, k in enumerate(order)
        ]
        named = [int(order[one - 1]) for one in _front(trials)]
        assert named == [1, 2, 0]
        assert _front(trials[:0]) == []


def test_figures_of_a_candidate_are_in_words_with_units_and_intervals(out: Path) -> None:
    design = load_design(out.parents[1] / "design.toml")
    answer: Any = candidate_answer(out, 1, design)
    assert answer["values"] == {"chamber.height_mm": 30.0, "shot.mass_g": 3.0}
    figures = dict(answer["figures"])
    assert "±" in next(text for name, text in figures.items() if name.startswith("uniform"))
    assert figures["mean coverage of the target"] == "50 %"
    assert answer["differs"] == []
    other = design.changed({"sonotrode.amplitude_um": 20, "chamber.height_mm": 33})
    assert candidate_answer(out, 1, other)["differs"] == ["Sonotrode amplitude [µm]"]
    with pytest.raises(InputError, match="not a candidate of study"):
        candidate_answer(out, 99, design)


def test_the_time_that_a_candidate_needs_is_offered_with_its_numbers(copy: Path) -> None:
    design = load_design(copy.parents[1] / "design.toml")
    rows = [json.loads(line) for line in (copy / "history.jsonl").read_text().splitlines()]
    time = {"value": 170.2, "half_width": 6.0}
    rewritten(copy, 0, metrics=rows[0]["metrics"] | {"time_to_98_s": time})
    assert candidate_answer(copy, 1, design)["time"] == {"process.treatment_time_s": 177.0}
    known = design.changed({"process.treatment_time_s": 177.0})
    assert candidate_answer(copy, 1, known)["time"] == {}


def test_the_model_comes_with_its_check_or_the_reason_why_there_is_none(copy: Path) -> None:
    answer = json.loads(json.dumps(model_answer(copy), allow_nan=False))
    assert not answer["reason"]
    assert {name for name, *_ in answer["shares"]} == set(answer["slices"])
    check = answer["check"]
    simulated = [one for one in read_trials(copy) if one.goals and one.stage == "search"]
    assert [row[1] for row in check["rows"]] == [one.goals[0].value for one in simulated]
    inside = sum(abs(value - told) <= half for _, value, told, half in check["rows"])
    assert f"{inside} of {len(simulated)} lie within" in check["sentence"]
    log = copy / "history.jsonl"
    log.write_text("".join(log.read_text().splitlines(keepends=True)[:5]))
    assert "too few" in model_answer(copy)["reason"]


def test_an_unfinished_study_is_listed(copy: Path) -> None:
    (row,) = list_results(copy.parents[1], load_design(copy.parents[1] / "design.toml"))
    assert row["is_study"]
    assert row["unusable"]
    assert row["text"] == "a study that has not finished"


@pytest.mark.parametrize(
    "values",
    [
        {"objective": None, "goals": "<b>"},
        {"parameters": {"<img src=x>": 1.0, "shot.mass_g": 3.0}},
        {"point": [0.5]},
        {"point": [float("nan"), 0.5]},
        {"score": float("inf")},
        {"number": 7},
        {"refused": False},
    ],
)
def test_a_hostile_log_is_refused_in_words(copy: Path, values: dict[str, Any]) -> None:
    rewritten(copy, 0, **values)
    for answer in (candidates_answer, model_answer):
        with pytest.raises(InputError, match="damaged row"):
            answer(copy)


@pytest.mark.parametrize("text", ["{}", "[]", '{"study": {"vary": {"a": [1]}}, "sweep": null}'])
def test_damaged_inputs_are_refused_in_words(copy: Path, text: str) -> None:
    (copy / "inputs.json").write_text(text)
    with pytest.raises(InputError, match="damaged"):
        candidates_answer(copy)


class Commands:
    """In the place of the command that a page starts: what it would be."""

    def start(self, arguments: list[str], folder: Path, result: str = "") -> dict[str, object]:
        return {"arguments": arguments, "result": result}


@pytest.fixture
def acts(copy: Path) -> Iterator[Acts]:
    made = Acts(copy.parents[1] / "design.toml", False, Commands())  # type: ignore[arg-type]
    yield made
    made.close()


def test_a_study_is_resumed_and_gone_on_with(acts: Acts, copy: Path) -> None:
    asked, folder = {"folder": "results/study"}, copy.parents[1]
    (folder / "a.toml").write_text((folder / "study.toml").read_text().replace("[2, 4]", "[1, 4]"))
    started = {"arguments": ["run", "./study.toml", "--out=results/study"]}
    assert acts.resume(asked) == {**started, "result": "results/study"}
    seen = acts.candidates(asked)["version"]
    assert acts.candidates({**asked, "seen": seen}) == {"version": seen}

    further = ["run", "./study-2.toml", "--out", "results/study-2"]
    assert acts.more({**asked, "evaluations": 5})["arguments"] == further
    study = load_study(folder / "study-2.toml")
    best = max(read_trials(copy), key=lambda one: (one.stage == "search", one.score))
    assert study.begin_with == (best.parameters,)
    assert (study.optimizer.evaluations, study.optimizer.seed) == (7, 2)  # with start and best
    assert study.vary == load_study(folder / "study.toml").vary
    assert acts.more({**asked, "evaluations": 5})["arguments"][1] == "./study-3.toml"
    with pytest.raises(InputError, match="new chambers to simulate: given 0"):
        acts.more({**asked, "evaluations": 0})
    assert not (folder / "study-4.toml").exists()

    (folder / "study.toml").unlink()
    with pytest.raises(InputError, match="no study file here asks what this study asked"):
        acts.resume(asked)


def test_a_further_study_tries_as_many_new_chambers_as_were_asked_for(
    acts: Acts, copy: Path
) -> None:
    acts.more({"folder": "results/study", "evaluations": 3})
    further = load_study(copy.parents[1] / "study-2.toml")
    run_in_folder(further, copy.parent / "study-2", simulator=Hill())
    before, after = (
        {one.point for one in read_trials(folder) if one.stage == "search" and one.goals}
        for folder in (copy, copy.parent / "study-2")
    )
    assert len(after - before) >= 3  # one that is told by few replicas costs less
    for folder, other in (("study", "study-2"), ("study-2", "study")):
        answer = acts.candidates({"folder": f"results/{folder}"})
        assert answer["same"] == [f"results/{other}"]


@pytest.mark.parametrize("ended", ["gain", "values"])
def test_a_study_with_nothing_left_to_try_is_not_gone_on_with(
    acts: Acts, copy: Path, monkeypatch: pytest.MonkeyPatch, ended: str
) -> None:
    monkeypatch.setattr(further_study, "is_finished", lambda _: True)
    monkeypatch.setattr(further_study, "_ended_by", lambda _: ended)
    with pytest.raises(InputError, match="search between wider values, or for another aim"):
        acts.more({"folder": "results/study", "evaluations": 3})


def test_a_folder_runs_no_python_file(acts: Acts, copy: Path) -> None:
    ran = copy / "ran"
    (copy / "shape.py").write_text(f"open({str(ran)!r}, 'w').close()")
    design = (copy / "design.toml").read_text().replace('"cylinder"', '"shape.py"')
    (copy / "other.toml").write_text(design)
    study = (copy / "study.toml").read_text()
    for text in (
        study.replace('"design.toml"', '"other.toml"'),
        study.replace("begin_with = []", 'begin_with = ["other.toml"]'),
    ):
        (copy / "study.toml").write_text(text)
        with pytest.raises(InputError, match="runs the Python file"):
            acts.model({"folder": "results/study"})
    (copy / "study.toml").write_text(study.replace('"design.toml"', '"../../../design.toml"'))
    with pytest.raises(InputError, match="outside the folder"):
        acts.model({"folder": "results/study"})
    assert not ran.exists()

"""How long a run will take, by results of like designs."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from chamberopt.design.load import save_design
from chamberopt.page import duration
from chamberopt.page.duration import (
    AROUND_S,
    EFFORTS,
    ENDS,
    UNSURE,
    _at_pace,
    _by_moment,
    _by_result,
    _in_words,
    _whole_seconds,
    foretold,
    tried,
)
from chamberopt.results.load import Result
from chamberopt.simulation.effort import Scale
from tests.helpers.results.short_plate import plate_result
from tests.helpers.synthetic import DESIGNS


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    return plate_result(tmp_path_factory.mktemp("plate") / "result")


def test_it_grows_with_the_replicas(result: Result, tmp_path: Path) -> None:
    seconds = sum(result.record.timings_s.values()) / result.record.replicas
    replicas = round(600.0 / seconds)
    save_design(result.design.changed({"process.accuracy.replicas": replicas}), tmp_path / "a.toml")
    known = foretold(tmp_path / "a.toml", [tmp_path, result.folder], ranges=False)
    assert known["asked"] == ("about 10 minutes", "")  # 20 s more at the most
    accuracy = result.design.process.accuracy
    whole, time = accuracy.simulated_time_s + accuracy.warmup_time_s, accuracy.simulated_time_s
    for name, scale in (("quick", 0.25), ("thorough", 4.0)):
        replicas_s = 600.0 * (1.0 + (scale - 1.0) * time / whole)
        assert known[name].words == _in_words(*(one + replicas_s for one in AROUND_S))


def test_a_study_takes_as_long_as_its_evaluations(result: Result, tmp_path: Path) -> None:
    save_design(result.design, tmp_path / "a.toml")
    study = 'design = "a.toml"\n[vary]\n"chamber.height_mm" = { low = 20, high = 60 }\n'
    (tmp_path / "study.toml").write_text(f"{study}[optimizer]\nevaluations = 100000\n")
    (words, _), *others = foretold(tmp_path / "study.toml", [result.folder]).values()
    assert not others
    assert words.endswith(("minutes", "hours"))
    assert " to " in words  # by a design's result it is not known how many replicas they take
    known = SimpleNamespace(study=SimpleNamespace(seconds=366.0, evaluations=6))
    like: Any = SimpleNamespace(record=known)
    assert _whole_seconds(result.design, 9, like) == 549.0


def test_a_design_without_results_is_tried_for_a_moment(result: Result, tmp_path: Path) -> None:
    """A study is not."""
    save_design(result.design, tmp_path / "a.toml")
    known = tried(tmp_path / "a.toml")
    assert [*known] == [*EFFORTS]
    assert all(one.words.startswith("about ") for one in known.values())
    (tmp_path / "study.toml").write_text('design = "a.toml"\n[vary]\n')
    assert tried(tmp_path / "study.toml") == {}


def test_a_time_that_is_not_sure_has_its_usual_and_its_longest_end(
    result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At 60 s a simulated second on two cores, until the figures are sure or at once."""
    monkeypatch.setattr(duration, "core_count", lambda: 2)
    settings = {"replicas": 10, "simulated_time_s": 1.8, "warmup_time_s": 0.2, "max_replicas": 40}
    key = "process.accuracy."
    design = result.design.changed({f"{key}{name}": one for name, one in settings.items()})
    assert _at_pace(design, 60.0, ranges=False) == "about 8 to 13 minutes"
    sure = design.changed({f"{key}objective_half_width": 0.01})
    longest = ", and up to 52 minutes until it is as sure as it asks"
    assert _at_pace(sure, 60.0, ranges=False) == f"about 8 to 13 minutes{longest}"
    ends = 600 / UNSURE + AROUND_S[0], 600 * UNSURE + AROUND_S[1]
    assert _in_words(*ends) == "about 8 to 13 minutes"


def test_too_little_is_told_before_with_the_remedy(result: Result) -> None:
    needed = SimpleNamespace(mean_and_std=30.0)
    record = SimpleNamespace(
        **{**vars(result.record), "field": SimpleNamespace(simulated_s_needed=needed)}
    )
    like: Any = SimpleNamespace(record=record, design=result.design, folder=result.folder)
    key = "process.accuracy."
    short = result.design.changed({f"{key}replicas": 10, f"{key}simulated_time_s": 2.0})
    few = _by_result(short, None, like, ranges=False).few
    told = "too little to tell the mean coverage, as the result result shows: "
    assert few == f"{told}it takes process.accuracy.simulated_time_s = 3.3 s"
    assert _by_result(short, "quick", like, ranges=False).few == f"{told}take more of it"
    assert _by_result(short, "thorough", like, ranges=False).few == ""
    enough = short.changed({f"{key}simulated_time_s": 3.3})
    assert _by_result(enough, None, like, ranges=False).few == ""


def test_too_few_dents_are_told_by_a_moment(result: Result) -> None:
    """At 1 impact on a mm² in a second, in windows of 2 mm²."""
    key = "process.accuracy."
    settings = {"replicas": 10, "simulated_time_s": 0.5, "gauge_mm2": 2.0}
    design = result.design.changed({f"{key}{name}": one for name, one in settings.items()})

    def few(scale: Scale | None) -> str:
        return _by_moment(design, scale, 1.0, 1e6, False).few

    told = "too little to tell single places: about {} dents in each window of 2 mm², where 25 "
    assert few(None) == f"{told.format(10)}would do; it takes {key}simulated_time_s = 1.4 s"
    assert few("quick") == f"{told.format('2.5')}would do; take more of it"
    assert few("thorough") == ""
    assert _by_moment(design, None, 1.0, 0.0, False).few == ""  # not known


def test_nothing_is_said_of_another_part(result: Result) -> None:
    assert foretold(DESIGNS / "gear.toml", [result.folder]) == {}


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (1.0, "5 s"),
        (42.0, "40 s"),
        (89.0, "90 s"),
        (91.0, "2 minutes"),
        (59.0 * 60.0, "59 minutes"),
        (5399.0, "90 minutes"),
        (5400.0, "1.5 hours"),
        (100.0 * 3600.0, "1e+02 hours"),
    ],
)
def test_a_time_is_told_in_the_unit_that_suits_it(seconds: float, words: str) -> None:
    assert _in_words(seconds, seconds) == f"about {words}"
    assert _in_words(120.0, 300.0) == "about 2 to 5 minutes"
    assert _in_words(60.0, 80.0) == "about 60 to 80 s"
    assert _in_words(2880.0, 7200.0) == "about 0.8 to 2 hours"


def test_a_design_takes_as_much_longer_as_it_has_more_balls_and_simulates_longer(
    result: Result,
) -> None:
    design, record = result.design, result.record
    assert record.ranges is None
    own = sum(record.timings_s.values())
    assert _whole_seconds(design, 1, result, ranges=False) == pytest.approx(own)
    known = _whole_seconds(design, 1, result)
    assert known == pytest.approx((1.0 + ENDS) * own)  # of a friction that is not calibrated
    accuracy = design.process.accuracy
    whole = accuracy.simulated_time_s + accuracy.warmup_time_s
    longer = {"process.accuracy.simulated_time_s": 3.0 * accuracy.simulated_time_s}
    more = {"shot.mass_g": 2.0 * design.shot.mass_g}
    for changes, times in (
        (longer, (whole + 2.0 * accuracy.simulated_time_s) / whole),
        (more, design.changed(more).shot.count / design.shot.count),
        ({"process.accuracy.replicas": 3 * record.replicas}, 3.0),
    ):
        assert _whole_seconds(design.changed(changes), 1, result) == pytest.approx(times * known)
    if record.study is None:  # of several candidates each takes as long; ranges are the best's
        several = _whole_seconds(design, 4, result)
        assert several == pytest.approx(4.0 * own)

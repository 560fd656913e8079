"""The wanted intensity and coverage, in words beside what was simulated."""

import math
from types import SimpleNamespace
from typing import Any

import pytest

from chamberopt.common.estimate import Estimate
from chamberopt.documents.wanted import (
    coverage_standing,
    enough_time,
    intensity_lines,
    not_told,
    time_lines,
    time_text,
    times_longer,
    wanted_rows,
)

TIME = Estimate(100.0, 10.0)
HALF, FULL = Estimate(0.5, 0.03), Estimate(0.99, 0.005)  # mean coverage


def a_design(
    time: float, percent: float | None = None, wanted: tuple[float, float] | None = None
) -> Any:
    """A design of an uncalibrated machine, as far as these texts read it."""
    process = SimpleNamespace(treatment_time=time, coverage_percent=percent, intensity_mmA=wanted)
    return SimpleNamespace(process=process, calibration=None)


def a_result(design: Any, time: Estimate, mean: Estimate = FULL) -> Any:
    """A result without ranges, as far as these texts read it."""
    metrics = {"time_to_98_s": time, "mean_coverage": mean}
    record = SimpleNamespace(ranges=None)
    return SimpleNamespace(design=design, metrics=metrics, record=record)


@pytest.mark.parametrize(
    ("time", "percent", "standing"),
    [
        (111.0, 100.0, "met"),  # above the upper end, 110 s
        (105.0, 100.0, "not decided"),
        (89.0, 100.0, "not met"),
        (221.0, 200.0, "met"),
        (200.0, 200.0, "not decided"),
        (179.0, 200.0, "not met"),
        (150.0, 200.0, "not met"),
    ],
)
def test_coverage_is_a_multiple_of_the_time_to_98(
    time: float, percent: float, standing: str
) -> None:
    design = a_design(time, percent)
    assert coverage_standing(design, {"time_to_98_s": TIME}) == standing
    (line,) = time_lines(a_result(design, TIME))
    assert line.warns == (100.0 * percent / 100.0 > time)
    words = {"met": "Enough", "not met": "Not enough", "not decided": "Not certain to be enough"}
    assert line.text.startswith(f"{words[standing]}: {time:g} s are ")
    assert line.text.endswith(f"; wanted are {percent:g} %: {percent / 100:g} × the time to 98 %.")
    assert f"{time / 100.0:.2g} × the time to 98 % on 95 % of the" in line.text
    assert "area, 100 ± 10 s" in line.text


@pytest.mark.parametrize(
    ("time", "standing", "why"),
    [
        (Estimate(100.0, math.inf, in_words="not resolved"), "not decided", "is not resolved."),
        (Estimate(1e6, 0.0, in_words="never"), "not met", "however long it is peened."),
    ],
)
def test_a_time_without_a_number_gives_no_multiple(time: Estimate, standing: str, why: str) -> None:
    design, metrics = a_design(300.0, 200.0), {"time_to_98_s": time}
    assert time_text(design, metrics) == ""
    assert coverage_standing(design, metrics) == standing
    (line,) = time_lines(a_result(design, time, HALF))
    assert line.warns
    assert line.text.startswith("Not enough: 300 s leave 50 ± 3 % of the target bare; ")
    assert line.text.endswith(why)


def test_a_target_that_is_covered_needs_no_time_that_is_resolved() -> None:
    time = Estimate(100.0, math.inf, in_words="not resolved")
    assert time_lines(a_result(a_design(300.0), time)) == []
    unknown = Estimate(0.5, math.inf, in_words="not resolved")
    assert time_lines(a_result(a_design(300.0), TIME, unknown)) == []


def test_without_a_wanted_coverage_98_per_cent_are_enough() -> None:
    (line,) = time_lines(a_result(a_design(50.0), TIME, HALF))
    assert line.warns
    assert line.text.startswith(
        "Not enough: 50 s leave 50 ± 3 % of the target bare; they are 0.5 ×"
    )
    (line,) = time_lines(a_result(a_design(120.0), TIME))
    assert (line.warns, line.text[:22]) == (False, "Enough: 120 s are 1.2 ")


def test_the_sheet_has_the_band_beside_the_predicted_intensity() -> None:
    metrics = {"time_to_98_s": TIME, "strength_um": Estimate(13.0, 0.2)}
    result: Any = SimpleNamespace(design=a_design(250.0, 200.0, (0.15, 0.2)), metrics=metrics)
    rows = dict(wanted_rows(result))
    assert rows["that is"].startswith("2.5 × the time to 98 %")
    assert rows["coverage wanted"] == "200 %: 2 × the time to 98 %; met"
    assert rows["intensity wanted"].startswith("0.15 to 0.2 mmA, mean over the target; not decided")
    assert rows["intensity predicted"].startswith("0.18 mmA, within a factor of 2.5")
    bare: Any = SimpleNamespace(design=a_design(250.0), metrics=metrics)
    assert [*dict(wanted_rows(bare))] == ["that is"]
    (line,) = intensity_lines(bare.design, metrics)
    assert line.text.startswith("Almen intensity: 0.18 mmA, within a factor of 2.5 (")
    assert not line.warns


def test_an_intensity_that_is_certainly_outside_is_a_warning() -> None:
    far = {"strength_um": Estimate(1.1, 0.05)}
    (line,) = intensity_lines(a_design(250.0, wanted=(0.15, 0.2)), far)
    assert line.warns
    assert "0.15 to 0.2 mmA: outside with the whole interval; predicted 0.015 mmA" in line.text


@pytest.mark.parametrize(("percent", "enough"), [(None, 107.0), (200.0, 213.0)])
def test_the_least_whole_time_that_is_enough(percent: float | None, enough: float) -> None:
    time = {"time_to_98_s": Estimate(100.0, 6.2)}
    assert enough_time(a_design(1.0, percent), time) == enough
    assert coverage_standing(a_design(enough, percent), time) == "met"
    assert coverage_standing(a_design(enough - 1.0, percent), time) != "met"


def test_a_time_keeps_the_margin_of_another() -> None:
    """120 s for 61 s, as friction may be higher: 54.2 s need as much more."""
    time, then = ({"time_to_98_s": Estimate(one, 2.3)} for one in (54.2, 61.0))
    assert enough_time(a_design(1.0), time, 120.0, then) == 107.0
    assert enough_time(a_design(1.0), then, 120.0, then) == 120.0
    assert enough_time(a_design(1.0), time, 40.0, then) == 57.0  # with too short a time, none


@pytest.mark.parametrize(
    "time", [None, Estimate(9.0, math.inf), Estimate(9.0, 1.0, in_words="never")]
)
def test_no_time_is_enough_where_none_is_known(time: Estimate | None) -> None:
    assert enough_time(a_design(1.0), {"time_to_98_s": time} if time else {}) is None


UNKNOWN = {"strength_um": Estimate(13.0, 9.0).not_known("not resolved")}


def test_an_intensity_that_is_not_known_has_its_remedy() -> None:
    (line,) = intensity_lines(a_design(250.0), UNKNOWN)
    assert line.text == (
        "Almen intensity: not known: too few dents were simulated to tell the peening strength; "
        "simulate longer."
    )
    assert line.warns
    (wanted,) = intensity_lines(a_design(250.0, wanted=(0.15, 0.2)), UNKNOWN)
    assert wanted.text.endswith("to tell the peening strength; simulate longer.")


@pytest.mark.parametrize(("needed", "times"), [(35.0, 4), (5.0, 2), (None, 2)])
def test_the_time_that_tells_what_is_not_told(needed: float | None, times: int) -> None:
    """Of a simulation of 10 s, after which the places of the part are told or not."""
    times_needed = SimpleNamespace(p05_times_intensity=needed, mean_and_std=52.0)
    field = SimpleNamespace(simulated_s_needed=times_needed)
    record = SimpleNamespace(field=field, simulated_time_s=10.0)
    result: Any = SimpleNamespace(metrics=UNKNOWN, record=record)
    assert times_longer(result) == times
    assert not_told(result.metrics) == ["the peening strength"]
    few = Estimate(0.9, 0.1).not_known("not resolved")
    result.metrics = {**UNKNOWN, "mean_coverage": few, "time_to_98_s": few}
    assert times_longer(result) == 6
    assert not_told(result.metrics) == ["the coverage", "the time to 98 %", "the peening strength"]
    result.metrics = {"strength_um": Estimate(13.0, 0.2), "mean_coverage": Estimate(0.9, 0.1)}
    assert times_longer(result) == 1
    assert not_told(result.metrics) == []

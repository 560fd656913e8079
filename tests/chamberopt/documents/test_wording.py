"""Numbers of the report have the digits that their intervals allow, and the metrics' labels."""

import math

import pytest

from chamberopt.common.estimate import Estimate
from chamberopt.documents.coverage import labels_of
from chamberopt.documents.document import Table
from chamberopt.documents.wording import (
    Label,
    energy_lines,
    keys_in_words,
    objective_label,
    plain,
    with_interval,
)
from chamberopt.results.impact_energy import ImpactEnergy, SurfaceEnergy


@pytest.mark.parametrize(
    ("value", "half_width", "text"),
    [
        (0.80934, 0.00407, "0.809 ± 0.004"),
        (0.2301, 0.0132, "0.230 ± 0.013"),
        (0.577, 0.00996, "0.577 ± 0.010"),
        (5e-18, 1e-18, "0"),
        (5e-18, 0.02, "0.000 ± 0.020"),
        (-0.0001, 0.02, "0.000 ± 0.020"),
        (2166.9, 1678.4, "2200 ± 1700"),
        (3708.0, 497781.0, "4000 ± 500\u202f000"),
        (363.0, 0.0, "363"),
        (-9.96, 0.5, "−10.0 ± 0.5"),
        (1.5, math.inf, "1.5 ± not known"),
        (math.nan, 1.0, "not known"),
    ],
)
def test_an_interval_has_one_or_two_digits_and_its_value_the_same_decimals(
    value, half_width, text
) -> None:
    assert with_interval(value, half_width) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (33.9552, "33.96"),
        (5e-18, "0"),
        (4311860.0, "4\u202f311\u202f860"),
        (1e-7, "1e-07"),
        (120.0, "120"),
    ],
)
def test_a_number_alone_has_four_digits_that_count(value: float, text: str) -> None:
    assert plain(value) == text


def test_an_objective_that_is_a_metric_has_its_label() -> None:
    assert objective_label("minus_time_to_98_s") == Label(
        "time until 95 % of the area is 98 % covered", "s", -1.0
    )
    assert objective_label("p05_coverage").unit == "%"
    assert (
        objective_label("uniform_coverage").meaning == "mean minus standard deviation of coverage"
    )
    seconds = objective_label("-0.001 root.time_to_98_s")
    assert seconds.text == "time until 95 % of the area is 98 % covered, zone root"
    assert (seconds.unit, seconds.factor) == ("s", -1000.0)
    assert objective_label("1 uniform_coverage + -0.001 time_to_98_s").in_full == (
        "weighted sum (mean coverage of the target − standard deviation of coverage over the "
        "target − 0.001 × time until 95 % of the area is 98 % covered [s])"
    )
    assert objective_label("of a later version").text == "of a later version"


def test_a_label_converts_value_and_half_width_to_its_unit() -> None:
    seconds = objective_label("-0.5 time_to_98_s")
    shown = seconds.scale(Estimate(-35.0, 2.0, in_words="not resolved"))
    assert (shown.value, shown.half_width, shown.in_words) == (70.0, 4.0, "not resolved")


def test_an_objective_of_one_figure_has_its_words_and_stands_once() -> None:
    goal = "minus_time_to_98_s"
    labels = labels_of(goal, [goal, "mean_coverage", "time_to_98_s"])
    assert [*labels] == [goal, "mean_coverage"]
    assert labels[goal].with_unit == "time until 95 % of the area is 98 % covered [s]"
    assert labels[goal].factor == -1.0


def test_energy_is_told_a_surface_with_its_share_of_all() -> None:
    """2 W on 40 cm² are 50 mW/cm²; balls on one another have no area."""

    def one(name: str, area: float, power: float, lost: float) -> SurfaceEnergy:
        return SurfaceEnergy(
            name, area, Estimate(1234.0, 0.0), Estimate(power, 0.0), Estimate(lost, 0.1 * lost)
        )

    surfaces = one("the part", 4e-3, 2.0, 0.75), one("balls", math.nan, 1.0, 0.25)
    table, note = energy_lines(ImpactEnergy(0.5, surfaces, ()))
    assert isinstance(table, Table)
    assert list(table.rows) == [
        ("the part", "4000", "1234", "50", "750 ± 80", "75"),
        ("balls", "", "1234", "", "250 ± 25", "25"),
        ("all", "", "", "", "1000", "100"),
    ]
    assert "by tenths of 0.5 s" in str(note)
    nothing, _ = energy_lines(ImpactEnergy(0.5, (one("the part", 4e-3, 0.0, 0.0),), ()))
    assert isinstance(nothing, Table)
    assert nothing.rows[0][-1] == ""


def test_keys_of_files_become_words_and_names_of_files_stay() -> None:
    text = "raise process.accuracy.simulated_time_s of part.stl"
    assert keys_in_words(text) == "raise simulated time of the accuracy of the process of part.stl"

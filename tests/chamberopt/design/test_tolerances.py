"""Tolerances are ranges of numbers of the design, and wrong ones are refused by name."""

from pathlib import Path

import pytest

from chamberopt.common.errors import InputError
from chamberopt.design.design import Design
from chamberopt.design.load import load_design, save_design
from chamberopt.design.tolerances import iso_2768_m, require_tolerances, tolerance_box
from tests.helpers.synthetic import machine_values, plate_design

PLATE = plate_design(chamber__height_mm=16.0)


def tolerated(**tolerances: object) -> Design:
    named = {key.replace("__", "."): value for key, value in tolerances.items()}
    return PLATE.changed({"tolerances": named})


def test_ranges_are_absolute_or_shares_on_one_side_or_both() -> None:
    design = tolerated(
        amplitude_um=2,
        shot__mass_g=["-10 %", "0 %"],
        shot__diameter_mm=[-0.1, "2 %"],
        part__offset_mm__0=0.5,
        process__treatment_time_s="2 %",
    )
    box = tolerance_box(design)
    mass = PLATE.value("shot.mass_g")
    assert box["sonotrode.amplitude_um"] == (23.0, 27.0)
    assert box["shot.mass_g"] == pytest.approx((0.9 * mass, mass))
    assert box["shot.diameter_mm"] == pytest.approx((2.9, 3.06))
    assert box["part.offset_mm.0"] == (-0.5, 0.5)
    assert box["process.treatment_time_s"] == pytest.approx((4.9, 5.1))


def test_peak_to_valley_is_half_as_much_zero_to_peak() -> None:
    box = tolerance_box(tolerated(amplitude_pv_um=4))
    assert box == {"sonotrode.amplitude_um": (23.0, 27.0)}
    values = {"amplitude_um": None, "amplitude_pv_um": 50.0}
    by_peak_to_valley = tolerated(amplitude_um=2).changed(
        {f"sonotrode.{key}": value for key, value in values.items()}
    )
    assert tolerance_box(by_peak_to_valley) == {"sonotrode.amplitude_pv_um": (46.0, 54.0)}


def test_tolerances_are_saved_with_the_design(tmp_path: Path) -> None:
    design = tolerated(amplitude_um=2, shot__mass_g=("-10 %", 0))
    save_design(design, tmp_path / "design.toml")
    assert load_design(tmp_path / "design.toml") == design
    assert design.changed({"shot.mass_g": 3.0}).tolerances == design.tolerances
    save_design(PLATE, tmp_path / "plain.toml")
    assert "tolerances" not in (tmp_path / "plain.toml").read_text()


@pytest.mark.parametrize(
    ("name", "tolerance", "message"),
    [
        ("shot.mas_g", 1, r"unknown; did you mean 'shot\.mass_g'"),
        ("shot", {"mass_g": 1}, "put the whole name in quotes"),
        ("shot.mass_g", 0, "more than 0"),
        ("shot.mass_g", -1, "more than 0"),
        ("shot.mass_g", ["2 %", "3 %"], "low below 0 or 0, high above it"),
        ("shot.mass_g", "2", 'allowed: a number, a share such as "2 %"'),
        ("shot.mass_g", True, "allowed: a number"),
        ("shot.mass_g", [1, 2, 3], "allowed: a number"),
        ("shot.diameter_mm", 2.95, r"is 0\.05 to 5\.95; allowed: a number from 0\.1 to 20 mm"),
        ("shot.density_kg_m3", "2 %", "not set in this design"),
        ("part.offset_mm.0", "2 %", "is no range; give it without %"),
        ("process.seed", 1, "a whole number cannot vary"),
        ("process.accuracy.simulated_time_s", 0.1, "a setting of the simulation"),
    ],
)
def test_a_wrong_tolerance_is_refused_by_name(name: str, tolerance: object, message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        PLATE.changed({"tolerances": {name: tolerance}})
    assert str(error.value).startswith(f"tolerances.{name}: ")


def test_what_was_measured_has_no_tolerance() -> None:
    design = PLATE.changed({"calibration": machine_values(C0=0.02)})
    for name in ("log_mean.0", "ball_density_kg_m3"):
        with pytest.raises(InputError, match="what was measured, with errors that intervals hold"):
            design.changed({"tolerances": {f"calibration.{name}": 0.1}})


def test_a_number_has_one_tolerance() -> None:
    with pytest.raises(InputError, match="amplitude_um has a tolerance already"):
        tolerated(amplitude_um=1, sonotrode__amplitude_um=1)


def test_the_design_must_be_able_to_have_both_ends() -> None:
    design = tolerated(chamber__sonotrode_distance_mm=["-1 %", 2])
    with pytest.raises(InputError, match=r"^tolerances\.chamber\.sonotrode_distance_mm: .* = 17: "):
        require_tolerances(design)


def test_deviations_grow_with_the_length_at_the_ends_of_the_ranges_of_the_standard() -> None:
    ends = {6.0: 0.1, 30.0: 0.2, 120.0: 0.3, 400.0: 0.5, 1000.0: 0.8, 2000.0: 1.2}
    assert [iso_2768_m(length) for length in ends] == list(ends.values())
    beyond = [iso_2768_m(length + 0.01) for length in ends]
    assert beyond == [*list(ends.values())[1:], 1.2]

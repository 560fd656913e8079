"""The wanted Almen intensity: how it is given, and how a prediction compares with it."""

import math

import numpy as np
import pytest

from chamberopt.common.errors import InputError
from chamberopt.common.estimate import NOT_RESOLVED, Estimate
from chamberopt.design.almen_strip import USUAL_K, USUAL_K_LOG_SD
from chamberopt.design.calibration import Calibration
from chamberopt.design.intensity import (
    INCH_MM,
    INSIDE,
    MOST_BIAS,
    NOT_DECIDED,
    OUTSIDE,
    THICK_MM,
    THIN_MM,
    Comparison,
    PredictedIntensity,
    STRONG_MPa,
    WantedIntensity,
    usual_intensity,
    why_none,
)
from chamberopt.design.materials import Alloy, alloy

STEEL = alloy("42CrMo4").model_copy(update={"tensile_MPa": 1100.0})
STRONG = STEEL.model_copy(update={"tensile_MPa": STRONG_MPa})
TITANIUM, ALUMINIUM = alloy("Ti-6Al-4V"), alloy("7075-T6")


def calibration(**changed: object) -> Calibration:
    """A machine whose strips give 12 mmA per mm of strength."""
    values: dict[str, object] = {
        "program": "0.2",
        "parameters": ("K", "beta"),
        "log_mean": (math.log(12.0), 0.0),
        "log_covariance": ((1e-4, 0.0), (0.0, 1e-4)),
        "amplitude_um": (20.0, 40.0),
        "ball_diameter_mm": (2.0, 2.0),
        "ball_density_kg_m3": 7800.0,
    }
    return Calibration.model_validate(values | changed)


@pytest.mark.parametrize(
    ("given", "low", "high"),
    [
        ("0.15-0.20A", 0.15, 0.20),
        (" .15 to .2 mmA", 0.15, 0.20),
        ("0.20+-0.02a", 0.18, 0.22),
        ("0.20±0.02A", 0.18, 0.22),
        ("0.20+/-0.02A", 0.18, 0.22),
        ("0.45-0.60N", 0.15, 0.20),  # h_A = h_N / 3
        ("0.20-0.30C", 0.70, 1.05),  # h_A = 3.5 h_C
        ("0.15A", 0.15, 0.226),  # AMS 2430: 0.003 in = 0.0762 mm are more than 30 %
        ("0.40A", 0.40, 0.52),  # 30 % are more
    ],
)
def test_an_intensity_is_given_as_on_drawings(given: str, low: float, high: float) -> None:
    found = WantedIntensity.parse(given)
    assert (found.low, found.high) == pytest.approx((low, high), abs=5e-4)
    assert found.text.startswith(f"asked: {given.strip()}")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("0.15-0.20", "allowed: a range such as 0.15-0.20A"),
        ("0.15-0.20B", "allowed: a range such as 0.15-0.20A"),
        ("0,15-0,20A", "allowed: a range such as 0.15-0.20A"),
        ("", "allowed: a range such as 0.15-0.20A"),
        ("nanA", "allowed: a range such as 0.15-0.20A"),
        ("0.20-0.15A", "the lower end first"),
        ("0.006-0.010A", "0.006 in are 0.15 mm"),  # inches
        ("6-10A", "0.006 in are 0.15 mm"),  # thousandths of an inch
        ("0.2-0.2A", "a range without width"),
        ("0.2+-0.3A", "-0.1 to 0.5 mm"),
    ],
)
def test_other_texts_are_refused_with_the_form(given: str, message: str) -> None:
    with pytest.raises(InputError, match="--intensity: given") as caught:
        WantedIntensity.parse(given)
    assert message in str(caught.value)


def test_how_far_an_intensity_lies_off_its_range() -> None:
    wanted = WantedIntensity(0.1, 0.4)
    assert wanted.middle == pytest.approx(0.2)
    assert [wanted.off(x) for x in (0.1, 0.2, 0.4)] == [0.0, 0.0, 0.0]
    assert wanted.off(0.05) == pytest.approx(-math.log(2.0))
    assert wanted.off(0.8) == pytest.approx(math.log(2.0))
    assert wanted.off(0.0) == -math.inf


def test_without_strips_the_band_is_that_of_the_usual_constant() -> None:
    """S = 20 µm, known exactly: 0.27 mmA, and 95 % of a log-normal with sd 0.9."""
    found = PredictedIntensity.of({"strength_um": Estimate(20.0, 0.0)}, None)
    assert found is not None
    assert found.value == pytest.approx(0.27)
    assert found.factor == pytest.approx(2.46, abs=0.01)
    wide = math.exp(1.96 * USUAL_K_LOG_SD)
    assert (found.low, found.high) == pytest.approx((0.27 / wide, 0.27 * wide))
    assert "0.27 mmA, within a factor of 2.5 (one standard deviation, at 95 %" in found.in_words
    assert "chamberopt calibrate" in found.in_words
    poor = PredictedIntensity.of({"strength_um": Estimate(20.0, 19.6)}, None)  # sd of ln S: 0.5
    assert poor is not None
    assert poor.factor == pytest.approx(math.exp(math.hypot(0.9, 0.5)))


def test_the_band_holds_the_truth_of_machines_as_they_are_supposed_to_differ() -> None:
    """K drawn from what is known of it: 95 % of the true intensities lie in the band."""
    rng = np.random.default_rng(1)
    found = PredictedIntensity.of({"strength_um": Estimate(12.0, 0.3)}, None)
    assert found is not None
    k = USUAL_K * np.exp(USUAL_K_LOG_SD * rng.standard_normal(20_000))
    true = 1e-3 * k * (12.0 + 0.3 / 1.96 * rng.standard_normal(20_000))
    assert np.mean((true > found.low) & (true < found.high)) == pytest.approx(0.95, abs=0.005)
    one_sd = (true > found.value / found.factor) & (true < found.value * found.factor)
    assert np.mean(one_sd) == pytest.approx(0.683, abs=0.01)


def test_measured_strips_take_the_place_of_the_usual_constant() -> None:
    metrics = {"almen_intensity": Estimate(0.18, 0.01), "strength_um": Estimate(15.0, 0.1)}
    found = PredictedIntensity.of(metrics, calibration())
    assert found == PredictedIntensity(0.18, pytest.approx(0.17), pytest.approx(0.19))
    assert found.in_words == "0.180 ± 0.010 mmA"
    dents_only = calibration(
        parameters=("amplitude",), log_mean=(0.0,), log_covariance=((1e-4,),)
    )  # no strips: the usual K
    rough = PredictedIntensity.of(metrics, dents_only)
    assert rough is not None
    assert rough.value == pytest.approx(1e-3 * USUAL_K * 15.0)
    discs = calibration(strips="disc of 40 mm")
    assert (discs.own_strips, calibration().own_strips) == ("disc of 40 mm", "")
    assert PredictedIntensity.of(metrics, discs) is None
    assert "disc of 40 mm" in Comparison.of((0.1, 0.2), metrics, discs).predicted


@pytest.mark.parametrize(
    ("value", "half_width", "standing"),
    [
        (0.18, 0.01, INSIDE),
        (0.15, 0.0, INSIDE),
        (0.19, 0.02, NOT_DECIDED),
        (0.22, 0.03, NOT_DECIDED),
        (0.25, 0.01, OUTSIDE),
        (0.10, 0.01, OUTSIDE),
        (0.18, 0.20, NOT_DECIDED),
    ],
)
def test_the_whole_interval_decides(value: float, half_width: float, standing: str) -> None:
    metrics = {"almen_intensity": Estimate(value, half_width)}
    found = Comparison.of((0.15, 0.20), metrics, calibration())
    assert found.standing == standing
    assert found.in_words.startswith(standing)


@pytest.mark.parametrize(
    "strength",
    [
        Estimate(20.0, math.inf),
        Estimate(20.0, 1.0, in_words="x"),
        Estimate(0.0, 0.0),
        Estimate(20.0, math.inf, bias=1.01 * MOST_BIAS * 20.0, in_words=NOT_RESOLVED),
        Estimate(20.0, math.inf, in_words=NOT_RESOLVED),  # of so few replicas that none is known
    ],
)
def test_no_intensity_is_made_of_a_strength_that_is_not_known(strength: Estimate) -> None:
    assert PredictedIntensity.of({"strength_um": strength}, None) is None
    found = Comparison.of((0.15, 0.20), {"strength_um": strength}, None)
    assert found.standing == NOT_DECIDED
    assert "too few dents" in found.predicted


def test_a_strength_that_is_not_resolved_tells_the_intensity_roughly() -> None:
    """Its bias is as a half-width, beside what is known of the usual constant."""
    resolved = PredictedIntensity.of({"strength_um": Estimate(20.0, 0.0)}, None)
    unresolved = Estimate(20.0, math.inf, bias=1.0, in_words=NOT_RESOLVED)
    found = PredictedIntensity.of({"strength_um": unresolved}, None)
    assert resolved is not None
    assert found is not None
    assert found.value == resolved.value
    log_sd = math.log(found.factor)
    assert log_sd**2 == pytest.approx(math.log(resolved.factor) ** 2 + (1.0 / 20.0 / 1.96) ** 2)
    assert math.log(found.high / found.low) == pytest.approx(2.0 * 1.96 * log_sd)


def test_an_estimate_far_off_is_outside_though_no_strip_was_measured() -> None:
    """0.0135 mmA, at 95 % at most 0.079, is certainly below 0.15 mmA."""
    found = Comparison.of((0.15, 0.20), {"strength_um": Estimate(1.0, 0.05)}, None)
    assert found.standing == OUTSIDE


@pytest.mark.parametrize(
    ("metal", "medium", "thick"),
    [
        (STEEL, (0.008, 0.012), (0.012, 0.016)),
        (STRONG, (0.006, 0.010), (0.006, 0.010)),
        (TITANIUM, (0.006, 0.010), (0.006, 0.010)),
        (ALUMINIUM, (0.006, 0.010), (0.010, 0.014)),
    ],
)
def test_the_ranges_are_those_of_the_table_in_inches(
    metal: Alloy, medium: tuple[float, float], thick: tuple[float, float]
) -> None:
    for mm, inches in ((THIN_MM, medium), (THICK_MM, medium), (1.01 * THICK_MM, thick)):
        found = usual_intensity(metal, 1e-3 * mm)
        assert found is not None
        assert (found.low, found.high) == pytest.approx(
            [INCH_MM * one for one in inches], abs=0.005
        )
    assert usual_intensity(metal, math.inf) is not None


def test_near_the_step_of_the_table_both_ranges_are_told() -> None:
    told = {
        share: usual_intensity(metal, share * 1e-3 * THICK_MM).text  # type: ignore[union-attr]
        for metal in (ALUMINIUM,)
        for share in (0.9, 0.99, 1.01, 1.1)
    }
    assert ["(0.25-0.36A above 9.52 mm)" in told[share] for share in told] == [0, 1, 0, 0]
    assert ["(0.15-0.25A up to 9.52 mm)" in told[share] for share in told] == [0, 0, 1, 0]
    same = usual_intensity(TITANIUM, 1e-3 * THICK_MM)
    assert same is not None
    assert "9.52 mm)" not in same.text


def test_a_range_of_the_table_reads_as_if_it_were_given() -> None:
    found = usual_intensity(TITANIUM, 5e-3)
    assert found is not None
    again = WantedIntensity.parse(f"{found.low:g}-{found.high:g}A")
    assert (again.low, again.high) == (found.low, found.high) == (0.15, 0.25)


def test_thin_targets_and_other_metals_have_none_and_say_why() -> None:
    assert usual_intensity(TITANIUM, 0.99e-3 * THIN_MM) is None
    assert "0.64 mm thick or less" in why_none(TITANIUM, 0.64e-3)
    assert usual_intensity(alloy("IN718"), 5e-3) is None
    assert "no range for nickel" in why_none(alloy("IN718"), 5e-3)

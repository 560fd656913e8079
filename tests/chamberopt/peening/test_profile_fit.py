"""Measured profiles of residual stress calibrate the law: hidden factors of made-up coupons."""

import math
from pathlib import Path

import numpy as np
import pytest

from chamberopt.common.errors import InputError
from chamberopt.coverage.stress_knowledge import BANDS, DEPTH, OF_LAW, PEAK_DEPTH, stress_bands
from chamberopt.coverage.stress_law import (
    AS_IS,
    OF_DENT,
    LawFactors,
    PeenedMetal,
    eigenstrain_under_dents,
    residual_stress,
)
from chamberopt.coverage.stress_model import law_factors
from chamberopt.design.calibration import Calibration, LawCalibration, Misfit, law_metal
from chamberopt.design.load import Design
from chamberopt.design.materials import alloy, ball
from chamberopt.peening.measured import MeasuredProfile, load_measured
from chamberopt.peening.profile_fit import CouponProfile, fit_law, law_prior
from tests.helpers.synthetic import machine_values, plate_design

STEEL, PART = ball("steel"), alloy("7075-T6")
METAL = PeenedMetal(
    PART.elastic, 503e6, 572e6, 1.0 / (PART.elastic.compliance + STEEL.elastic.compliance)
)
DENT, SHOT = 0.3e-3, (3e-3, 7800.0)
END_UM = 1e6 * OF_DENT * DENT


def predict(factors: LawFactors, bend: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """The law for equal dents; with `bend` its largest stress lies deeper than the law has it."""
    depth = np.linspace(0.0, 2.5 * END_UM, 400)
    moved = depth * (1.0 - bend * np.exp(-4.0 * depth / END_UM))
    strain = eigenstrain_under_dents(
        1e-6 * moved, np.array([DENT]), np.array([4.0]), SHOT, METAL, factors
    )
    return depth, 1e-6 * residual_stress(1e-6 * depth, strain[0], METAL)


def coupon(
    rng: np.random.Generator, factors: LawFactors, sd: float = 20.0, bend: float = 0.0
) -> CouponProfile:
    at = np.linspace(0.0, 1.3 * END_UM, 12)
    depth, stress = predict(factors, bend)
    y = np.interp(at, depth, stress) + rng.normal(0.0, sd, len(at))
    measured = MeasuredProfile(
        method="x-ray", depth_um=tuple(at), stress_MPa=tuple(y), sd_MPa=max(sd, 1.0)
    )
    return CouponProfile("metal", measured, predict)


def test_hidden_factors_lie_in_their_intervals() -> None:
    """60 shops whose factors are drawn from the prior: 95 % intervals hold 90 to 98 %."""
    rng, prior = np.random.default_rng(3), law_prior()
    held, sds = 0, []
    for _ in range(60):
        hidden = rng.normal(prior.mean, prior.sd)
        found = fit_law([coupon(rng, LawFactors(*np.exp(hidden)))])
        sd = np.sqrt(np.diag(np.array(found.log_covariance)))
        held += int((np.abs(np.array(found.log_mean) - hidden) < 1.96 * sd).sum())
        sds.append(sd)
    assert 0.90 * 180 <= held <= 0.98 * 180
    assert np.mean(sds, axis=0) == pytest.approx([0.02, 0.03, 0.06], rel=0.3)


def test_exact_profiles_give_the_factors_back() -> None:
    rng = np.random.default_rng(1)
    hidden = LawFactors(0.9, 1.2, 0.8)
    found = fit_law([coupon(rng, hidden, sd=0.0)])
    assert np.exp(found.log_mean) == pytest.approx(hidden, rel=0.01)
    assert found.misfit.error_scale == 1.0
    both = fit_law([coupon(rng, hidden), coupon(rng, hidden)])
    one = fit_law([coupon(rng, hidden)])
    assert both.misfit.values == 2 * one.misfit.values


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_factors_lie_within_three_standard_deviations_of_the_law(sign: float) -> None:
    """A law whose stress grows at each of three depths by 50 MPa a standard deviation of a factor.

    With an error of 10 MPa the prior draws a factor back by 1/26.
    """
    depth, sd = np.array([0.0, 10.0, 20.0]), law_prior().sd
    stress = 50.0 * sign * np.array([3.3, 0.0, -2.6]) - 1e3
    measured = MeasuredProfile(
        method="x-ray", depth_um=tuple(depth), stress_MPa=tuple(stress), sd_MPa=10.0
    )
    one = CouponProfile(
        "metal", measured, lambda factors: (depth, 50.0 * np.log(factors) / sd - 1e3)
    )
    found = np.array(fit_law([one]).log_mean) / sd
    assert found == pytest.approx(sign * np.array([3.0, 0.0, -2.5]), abs=1e-3)


def test_a_profile_of_another_shape_widens_the_errors() -> None:
    found = fit_law([coupon(np.random.default_rng(2), AS_IS, sd=2.0, bend=0.8)])
    assert found.misfit.error_scale > 2.0
    close = fit_law([coupon(np.random.default_rng(2), AS_IS, sd=2.0)])
    assert found.log_covariance[0][0] > 4.0 * close.log_covariance[0][0]


def calibrated(sd: float) -> Calibration:
    metal = law_metal(asked().materials.part)
    law = LawCalibration(
        metal=metal,
        log_mean=tuple(math.log(x) for x in (0.9, 1.2, 0.8)),
        log_covariance=tuple(map(tuple, (sd**2 * np.eye(3)).tolist())),
        misfit=Misfit(kind="stress profiles", chi2=10.0, values=12),
    )
    return Calibration(**machine_values(amplitude=0.02), stress=(law,))


def asked() -> Design:
    return plate_design().changed({"materials.part": {"alloy": "7075-T6"}, "stress": {}})


def test_a_design_of_the_metal_takes_the_factors_and_narrower_bands() -> None:
    machine = calibrated(0.05)
    design = asked().changed({"calibration": machine.model_dump()})
    assert law_factors(design) == pytest.approx((0.9, 1.2, 0.8))
    bands = stress_bands(design)
    for name in OF_LAW:
        assert 1.2 < bands[name] < 1.25 < BANDS[name]  # 20 % stay
    assert bands[PEAK_DEPTH] == BANDS[PEAK_DEPTH]
    other = design.changed({"materials.part": {"alloy": "Ti-6Al-4V"}})
    assert law_factors(other) == AS_IS
    assert stress_bands(other)[DEPTH] == BANDS[DEPTH]


def test_wrong_factors_are_refused() -> None:
    machine = calibrated(0.05).model_dump()
    law = machine["stress"][0]
    for name, value, message in (
        ("log_mean", (0.0, 0.0), r"log_mean: given \[0.0, 0.0\]; allowed: 3 numbers"),
        ("log_covariance", ((1.0,),), "log_covariance: is not 3 rows of 3 numbers"),
        ("log_covariance", ((-1.0, 0.0, 0.0),) * 3, "is not positive semi-definite"),
    ):
        wrong = {**machine, "stress": [{**law, name: value}]}
        with pytest.raises(InputError, match=message):
            asked().changed({"calibration": wrong})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("depth_um = [0, 50]\nstress_MPa = [-1, -2]", "allowed: 3 or more, ascending from 0"),
        ("depth_um = [0, 50, 40]\nstress_MPa = [-1, -2, 3]", "allowed: 3 or more, ascending"),
        ("depth_um = [0, 50, 90]\nstress_MPa = [-1, -2]", "has 2 stresses for 3 depths"),
        ("depth_um = [0, 50, 90]\nstress_MPa = [1, 2, 3]", "compressive stresses are negative"),
        ("depth_um = [0, 50, 90]\nstress_MPa = [190, 270, -40]", "mostly tension"),
        ("depth_um = [0, 50, 90]\nstress_MPa = [-270e6, -3e8, 0]", "is it in MPa"),
        ("depth_um = [0, 0.05, 0.09]\nstress_MPa = [-200, -300, 0]", "is it in µm"),
        (
            "depth_um = [0, 50, 90]\nstress_MPa = [-1, -2, 1]\n"
            '[[profile]]\nmethod = "x-ray"\ndepth_um = [0, 50, 90]\nstress_MPa = [-1, -2, 1]',
            "profile.1: has the numbers of one above it",
        ),
        ("depth_um = [0, 50, 9e5]\nstress_MPa = [-200, -300, 0]", "ends at 900000"),
        ("depth_um = [0, 50, 90]\nstress_MPa = [-1, -2, 1]", r"coupon has no \[stress\]; add"),
    ],
)
def test_wrong_profiles_are_refused(text: str, message: str, tmp_path: Path) -> None:
    design = Path(__file__).parents[3] / "designs" / "plate.toml"
    drop = '[[drop]]\nsurface = "part"\nspeed_m_s = 3\nrestitution = 0.5\n'
    profile = f'[[profile]]\nmethod = "x-ray"\n{text}\n'
    file = tmp_path / "measured.toml"
    file.write_text(f'design = "{design.as_posix()}"\n{drop}{profile}')
    with pytest.raises(InputError, match=message):
        load_measured(file)
    if "coupon" in message:
        file.write_text(f'design = "{design.as_posix()}"\n{profile}')
        with pytest.raises(InputError, match="which tells the metal alone"):
            load_measured(file)

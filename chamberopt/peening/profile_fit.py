"""Fit the law of residual stress to measured profiles of a metal: three factors on the law.

Each coupon is simulated on the calibrated machine. The factors on depths, on the largest stress and
on that at the surface (coverage/stress_law.py) are then the most probable ones, with the bands of
the law as their prior (posterior.py). What the machine's own calibration leaves open is not in
them: a coupon and a design on one machine share it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.errors import InputError
from chamberopt.coverage.coverage_from_impacts import in_batches
from chamberopt.coverage.metrics import FULL_COVERAGE
from chamberopt.coverage.stress_knowledge import BANDS, OF_LAW
from chamberopt.coverage.stress_law import LawFactors
from chamberopt.coverage.stress_model import stress_model
from chamberopt.coverage.stress_profile import dented_by_size, layer_histograms, level_layers
from chamberopt.design.calibration import LAW, LawCalibration, Parameter, law_metal
from chamberopt.peening.measured import Measured, MeasuredProfile, with_amplitude
from chamberopt.peening.posterior import Data, Figures, Prior, explaining_posterior
from chamberopt.simulation.evaluate import prepare_target
from chamberopt.simulation.replicas import ReplicaSetting, simulate_replicas

if TYPE_CHECKING:
    from chamberopt.design.calibration import Calibration
    from chamberopt.design.load import Design

KIND = "stress profiles"
WIDEST = 3.0  # prior standard deviations from the prior within which factors lie

Predict = Callable[[LawFactors], tuple[np.ndarray, np.ndarray]]


class CouponProfile(NamedTuple):
    """A measured profile, and the function that predicts it.

    Attributes:
        metal: of the coupon.
        measured: depths, stresses and their error.
        predict: gives depths [µm] and stresses [MPa] of the law with some factors.
    """

    metal: str
    measured: MeasuredProfile
    predict: Predict


def law_prior() -> Prior:
    """Return what is known of the factors before measuring: 1, within the bands of the law."""
    sd = np.array([math.log(BANDS[name]) / 1.96 for name in OF_LAW])
    # The posterior takes any names; these are no parameters of a machine.
    return Prior(cast("tuple[Parameter, ...]", LAW), np.zeros(len(LAW)), sd)


def fit_law(profiles: Sequence[CouponProfile]) -> LawCalibration:
    """Return the most probable factors on the law for one metal, by its measured profiles."""

    def model_of(one: CouponProfile) -> Callable[[Mapping[Parameter, float]], Figures]:
        at = np.array(one.measured.depth_um)

        def model(theta: Mapping[Parameter, float]) -> Figures:
            depth, stress = one.predict(LawFactors(*(math.exp(x) for x in theta.values())))
            return Figures(np.interp(at, depth, stress), np.zeros((len(at), len(at))))

        return model

    data = []
    for number, one in enumerate(profiles):
        at, y = np.array(one.measured.depth_um), np.array(one.measured.stress_MPa)
        errors = one.measured.sd**2 * np.eye(len(at))
        data.append(Data(KIND, f"profile {number + 1}", at, y, errors, model_of(one)))
    prior = law_prior()
    found = explaining_posterior(data, prior, prior.mean, (-WIDEST * prior.sd, WIDEST * prior.sd))
    return LawCalibration(
        metal=profiles[0].metal,
        log_mean=tuple(found.mean.tolist()),
        log_covariance=tuple(map(tuple, found.covariance.tolist())),
        misfit=found.misfits[0],
    )


def simulate_coupon(
    entry: MeasuredProfile, design: Design, table: Calibration, executor: Executor, field: str
) -> CouponProfile:
    """Simulate the coupon of a measured profile on the calibrated machine.

    Args:
        design: the coupon's design.
        field: name of the profile in the file of measurements, for errors.

    Raises:
        InputError: the simulated coupon is not covered, so that the law does not hold.
    """
    coupon = with_amplitude(design, entry.zero_to_peak_um)
    coupon = coupon.model_copy(update={"calibration": table})
    model, process = stress_model(coupon), coupon.process
    assert model is not None
    chamber = build_chamber(coupon)
    mesh = chamber_mesh(chamber)
    surface = prepare_target(coupon, chamber, mesh)
    replicas = simulate_replicas(ReplicaSetting(coupon, chamber, mesh), executor)
    batches = in_batches([surface.in_sector(one.hits) for one in replicas])
    seen = layer_histograms(surface, batches, process.recorded_time, model)
    time = process.treatment_time if entry.time_s is None else entry.time_s
    share = seen.share(time)
    covered = float(share.max(initial=0.0))
    if covered < FULL_COVERAGE:
        text = f"the simulated coupon is covered to {100.0 * covered:.0f} % after {time:g} s"
        raise InputError(f"{field}: {text}; the law of stress takes 98 %: check time_s and design")
    sizes = dented_by_size(batches, seen.found.highest, model)

    def predict(factors: LawFactors) -> tuple[np.ndarray, np.ndarray]:
        layers = level_layers(replace(model, factors=factors), seen.found.highest, sizes)
        return 1e6 * layers.depth, 1e-6 * (share @ layers.stress)

    return CouponProfile(law_metal(coupon.materials.part), entry, predict)


def calibrate_law(
    measured: Measured, designs: Mapping[str, Design], table: Calibration, executor: Executor
) -> Calibration:
    """Return a calibration with factors on the law of residual stress for each metal measured.

    Args:
        designs: designs by path, as `load_measured` gives them.
    """
    by_metal: dict[str, list[CouponProfile]] = {}
    for number, entry in enumerate(measured.profile):
        design = designs[entry.design or measured.design]
        one = simulate_coupon(entry, design, table, executor, f"profile.{number}")
        by_metal.setdefault(one.metal, []).append(one)
    fitted = tuple(fit_law(profiles) for profiles in by_metal.values())
    return table.model_copy(update={"stress": fitted})

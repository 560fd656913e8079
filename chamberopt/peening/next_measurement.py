"""Predict figures of a calibrated design, and name the measurement that would improve each most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from chamberopt.design.calibration import PARAMETERS
from chamberopt.peening.calibrate import Calibrated
from chamberopt.peening.posterior import Model
from chamberopt.peening.setups import DropModel, amplitude_model

# Figures and their names in words.
PREDICTED = (
    ("intensity", "Almen intensity"),
    ("saturation_time", "saturation time T"),
    ("coverage_rate", "coverage rate"),
)
FAST_DROP = 3.0  # m/s: a drop at this speed shows v0, and a drop at half of v0 shows C0
# Standard deviations of logarithms: of S and T from five arc heights, each read to 3 %, of a rate
# from coverages of 30 and 60 % read to 3 points, and of single figures.
SET_SD = 0.015, 0.12
COVERAGE_SD = 0.07
DENTS_SD, DROP_SD, LASER_SD, IMPACTS_SD = 0.04, 0.015, 0.03, 0.05
GAIN = 0.9  # share of a standard deviation that a measurement must get below to be named


class Candidate(NamedTuple):
    """A measurement of the machine that could be made next.

    Attributes:
        name: the measurement in words.
        slopes: slopes of the logarithms of the measured figures by the logarithms of the machine's
            parameters, (n, p).
        errors: covariance of the errors of these logarithms, (n, n). It is enlarged by the factor
            by which past measurements of this kind scattered more than their errors explain.
    """

    name: str
    slopes: np.ndarray
    errors: np.ndarray


@dataclass(frozen=True)
class Prediction:
    """A predicted figure of the design, and how much better a further measurement would make it.

    Attributes:
        name, words: key of the figure, and its name in words.
        value: predicted value.
        sd_before, sd: standard deviations of the value's logarithm, before all measurements and
            now.
        noise: standard deviation of the value's logarithm by the noise of simulations.
        next_name, next_sd: the measurement that would leave the least standard deviation, and this
            deviation; the name is "" where no measurement helps.
    """

    name: str
    words: str
    value: float
    sd_before: float
    sd: float
    noise: float
    next_name: str
    next_sd: float


def predict(found: Calibrated) -> list[Prediction]:
    """Predict the figures of the design that was calibrated, each with its best next measurement.

    The figures are Almen intensity, saturation time and coverage rate. Only the coverage rate is
    predicted if no strip was measured.
    """
    posterior, candidates = found.posterior, _candidates(found)
    before = np.diag(posterior.prior.sd**2)
    predictions = []
    for name, words in PREDICTED:
        if name != "coverage_rate" and not found.table.has_strips:
            continue
        model = found.figures[name]
        at = model(posterior.values)
        row = posterior.slopes(model)
        left = {one.name: _sd(row, posterior.after(one.slopes, one.errors)) for one in candidates}
        best = min(left, key=lambda one: left[one])
        sd = _sd(row, posterior.covariance)
        helps = left[best] < GAIN * sd
        predictions.append(
            Prediction(
                name, words, float(np.exp(at.values[0])), _sd(row, before), sd,
                float(np.sqrt(at.noise[0, 0])), best if helps else "", left[best],
            )
        )  # fmt: skip
    return predictions


def _sd(row: np.ndarray, covariance: np.ndarray) -> float:
    return float(np.sqrt(max(0.0, (row @ covariance @ row.T)[0, 0])))


def _candidates(found: Calibrated) -> list[Candidate]:
    materials, figures, posterior = found.design.materials, found.figures, found.posterior
    scales = {one.kind: one.error_scale for one in posterior.misfits}
    models: list[tuple[str, str, Model, float]] = [
        ("dent diameters", "dents of a coupon (30)", figures["mean_dent"], DENTS_SD),
        ("coverage", "coverage of a coupon at 30 and 60 %", figures["coverage_rate"], COVERAGE_SD),
        ("amplitude", "the amplitude by laser", amplitude_model, LASER_SD),
        ("impact rates", "impacts on the part a second, by microphone", figures["impacts"],
         IMPACTS_SD),
        ("ball drops", f"a ball drop on the part at {FAST_DROP:g} m/s",
         DropModel(materials.part, FAST_DROP), DROP_SD),
    ]  # fmt: skip
    if materials.wall.v0_m_s is not None:
        speed = 0.5 * materials.wall.v0_m_s
        name = f"a slow ball drop on the wall, at {speed:.2g} m/s"
        models.append(("ball drops", name, DropModel(materials.wall, speed), DROP_SD))
    made = [
        Candidate(name, posterior.slopes(model), _diagonal([sd], scales.get(kind, 1.0)))
        for kind, name, model, sd in models
    ]
    # Without strips, K and beta are no parameters.
    if set(PARAMETERS[-2:]) <= set(posterior.prior.names):
        both = [posterior.slopes(figures[name]) for name in ("intensity", "saturation_time")]
        made.insert(
            0, Candidate("another set of strips, at this design's amplitude",
                         np.concatenate(both), _diagonal(SET_SD, scales.get("arc heights", 1.0)))
        )  # fmt: skip
    return made


def _diagonal(sds: Sequence[float], scale: float) -> np.ndarray:
    return np.diag(np.square(sds)) * scale**2

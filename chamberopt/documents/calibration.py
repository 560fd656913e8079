"""Text about a calibration: its parameters, its misfits to measurements, predictions, cautions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.number_text import plain
from chamberopt.design.calibration import TIME_ERROR, Parameter
from chamberopt.peening.measured import falls
from chamberopt.peening.profile_fit import law_prior

if TYPE_CHECKING:
    from chamberopt.design.calibration import Misfit
    from chamberopt.peening.calibrate import Calibrated
    from chamberopt.peening.next_measurement import Prediction

WORDS: dict[Parameter, tuple[str, str]] = {
    "amplitude": ("amplitude, times", ""),
    "C0": ("restitution C0, times", ""),
    "v0": ("yield speeds v0, times", ""),
    "mu": ("friction, times", ""),
    "hardness": ("hardness of the part, times", ""),
    "K": ("K", "mmA/mm"),
    "beta": ("dents on strips, times", ""),
}
UNKNOWN = 1.5  # standard deviation of a logarithm: a 95 % interval of a factor of 20 either way
NOT_SETTLED = 0.5  # standard deviations
FAR = 3.0  # standard deviations from the prior mean


def calibration_lines(found: Calibrated, predictions: Sequence[Prediction]) -> list[str]:
    """Return the lines that the command `calibrate` prints.

    They give the parameters, the misfits, the predictions and the most useful next measurement.
    """
    prior, table = found.posterior.prior, found.table
    lines = [f"{'parameter':32}{'before':>20}{'now':>20}    (median ± standard deviation)"]
    for k, name in enumerate(prior.names):
        words, unit = WORDS[name]
        unit = "mm/mm" if unit and table.not_mmA else unit
        before = _value(prior.mean[k], prior.sd[k], unit)
        now = _value(table.log_mean[k], table.log_sd(name), unit)
        lines.append(f"{words:32}{before:>20}{now:>20}")
    lines += ["", "how well the model explains what was measured"]
    for one in table.misfits:
        lines.append(
            _misfit_line(
                one,
                f"the model does not explain your {one.kind}",
                ", so that all intervals are "
                "wider; look at the picture, check the measurements and what the design assumes",
            )
        )
    for law in table.stress:
        lines += ["", f"the law of residual stress for {law.metal}"]
        for k, words in enumerate(("depths", "largest stress", "stress at the surface")):
            before = _value(0.0, float(law_prior().sd[k]), "")
            now = _value(law.log_mean[k], math.sqrt(law.log_covariance[k][k]), "")
            lines.append(f"{words + ', times':32}{before:>20}{now:>20}")
        lines.append(_misfit_line(law.misfit, "the law does not have the shape of your profiles"))
    peak_to_valley, balls = 2e6 * found.design.sonotrode.amplitude, found.design.shot.count
    as_designed = f"as designed ({peak_to_valley:g} µm peak to valley, {balls} balls)"
    lines += ["", f"{as_designed}: standard deviations"]
    for figure in predictions:
        spread = f"{_percent(figure.sd_before)} before, now {_percent(figure.sd)}"
        if figure.next_name:
            spread += f"; with {figure.next_name}: {_percent(figure.next_sd)}"
        lines.append(f"{figure.words:32}{spread}")
    return [*lines, *(f"note: {text}" for text in calibration_notes(found))]


def _misfit_line(one: Misfit, else_why: str, then: str = "") -> str:
    """Return a line with chi² of a kind of measurement, and a verdict."""
    text = f"chi² = {plain(one.chi2, 2)} of {one.values} value{'s' * (one.values > 1)}"
    scale = f"their errors are taken {plain(one.error_scale, 2)} times as large"
    verdict = "well" if one.error_scale == 1.0 else f"{else_why}: {scale}{then}"
    return f"{one.kind:32}{text:30}{verdict}"


def calibration_notes(found: Calibrated) -> list[str]:
    """Return cautions to read before trusting the calibration."""
    kinds, prior = {one.kind for one in found.data}, found.posterior.prior
    off = np.abs(found.posterior.mean - prior.mean) / prior.sd
    texts = [
        f"{WORDS[name][0].removesuffix(', times')} is {far:.1f} standard deviations from what was "
        f"known before: check what was measured and the design, or give what you know as [prior] "
        f"{name}"
        for name, far in zip(prior.names, off, strict=True)
        if far > FAR
    ]
    if not found.table.has_strips:
        texts.append(
            "without arc heights of strips there is no intensity in mmA: designs with this "
            "calibration have peening strength alone"
        )
    elif kinds == {"arc heights"}:
        texts.append(
            "strips alone tell the intensity, not the coverage: a ball drop or a coupon tells that"
        )
    strips = [one for one in found.data if one.kind == "arc heights"]
    for number, one in enumerate(strips):
        sd = math.sqrt(one.covariance[0, 0])
        texts += [
            f"strip.{number} ({one.label}): the arc after {one.at[i]:g} s is below an earlier one, "
            f"by {fall:.1f} standard deviations of the two"
            for i, fall in falls(np.exp(one.y), sd)
        ]
    if found.moved > NOT_SETTLED:
        texts.append(
            f"after {found.rounds} rounds the values still moved by {found.moved:.1f} standard "
            "deviations: raise process.accuracy.replicas or simulated_time_s, or measure more"
        )
    if found.table.not_mmA:
        texts.append(found.table.not_mmA)
    if found.table.has_strips:
        texts.append(
            f"intervals of saturation times of designs hold {_percent(TIME_ERROR)} more, for what "
            "the model leaves out: none is better known than to ± 15 %"
        )
    return texts


def _value(log_mean: float, log_sd: float, unit: str) -> str:
    return f"{plain(math.exp(log_mean), 3)} {unit} ± {_percent(log_sd)}".replace("  ", " ")


def _percent(log_sd: float) -> str:
    """Return a standard deviation of a logarithm as text in per cent.

    Above 0.5 the text is a factor, and above UNKNOWN it is "not known".
    """
    if log_sd > UNKNOWN:
        return "not known"
    if log_sd > 0.5:
        return f"×/÷ {math.exp(log_sd):.2g}"
    return f"{plain(100.0 * log_sd, 2)} %"

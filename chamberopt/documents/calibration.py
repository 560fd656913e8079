"""Text about a calibration: its parameters, its misfits to measurements, predictions, cautions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.number_text import plain
from chamberopt.design.calibration import TIME_ERROR, Parameter
from chamberopt.documents.document import Table
from chamberopt.documents.terminal_lines import note_lines
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
EXPLAINED = "The model explains what was measured"
# Why a misfit is bad, and what follows: one to measurements, and one to profiles of stress.
OF_MEASURED = (
    "the model does not explain your {}",
    ", so that all intervals are wider; look at the picture, check the measurements and what the "
    "design assumes",
)
OF_PROFILES = ("the law does not have the shape of your profiles", "")


def calibration_end(
    found: Calibrated, predictions: Sequence[Prediction], verbose: bool
) -> list[Table | str]:
    """Return the end of the command `calibrate`: a sentence, what is known now, and notes.

    Args:
        verbose: the parameters and the misfits to each kind of measurement follow, and all notes.
    """
    both = (
        *((one, OF_MEASURED) for one in found.table.misfits),
        *((law.misfit, OF_PROFILES) for law in found.table.stress),
    )
    bad = [(one, faults) for one, faults in both if one.error_scale != 1.0]
    kinds = ", ".join(one.kind for one, _ in bad)
    sentence = f"The model does not explain what was measured: {kinds}" if bad else EXPLAINED
    first = next(iter(predictions), None)
    if first is not None:
        now, before = _percent(first.sd), _percent(first.sd_before)
        sentence += f"; the {first.words} of its design is known to {now} (before: {before})"
    table = Table(
        "",
        ("standard deviation of the", "before", "now", "best measured next", "then"),
        [
            (one.words, _percent(one.sd_before), _percent(one.sd))
            + ((one.next_name, _percent(one.next_sd)) if one.next_name else ("-", "-"))
            for one in predictions
        ],
        numbers=False,
    )
    more = _lines(found, predictions) if verbose else [_misfit_line(*one) for one in bad]
    notes = note_lines(calibration_notes(found), verbose)
    return [f"{sentence}.", "", table, "", *more, *notes]


def calibration_lines(found: Calibrated, predictions: Sequence[Prediction]) -> list[str]:
    """Return the lines of calibration.txt.

    They give the parameters, the misfits, the predictions and the most useful next measurement.
    """
    return [*_lines(found, predictions), *(f"note: {text}" for text in calibration_notes(found))]


def _lines(found: Calibrated, predictions: Sequence[Prediction]) -> list[str]:
    """Return the lines of calibration.txt without its notes."""
    prior, table = found.posterior.prior, found.table
    lines = [f"{'parameter':32}{'before':>20}{'now':>20}    (median ± standard deviation)"]
    for k, name in enumerate(prior.names):
        words, unit = WORDS[name]
        unit = "mm/mm" if unit and table.not_mmA else unit
        before = _value(prior.mean[k], prior.sd[k], unit)
        now = _value(table.log_mean[k], table.log_sd(name), unit)
        lines.append(f"{words:32}{before:>20}{now:>20}")
    lines += ["", "how well the model explains what was measured"]
    lines += [_misfit_line(one, OF_MEASURED) for one in table.misfits]
    for law in table.stress:
        lines += ["", f"the law of residual stress for {law.metal}"]
        for k, words in enumerate(("depths", "largest stress", "stress at the surface")):
            before = _value(0.0, float(law_prior().sd[k]), "")
            now = _value(law.log_mean[k], math.sqrt(law.log_covariance[k][k]), "")
            lines.append(f"{words + ', times':32}{before:>20}{now:>20}")
        lines.append(_misfit_line(law.misfit, OF_PROFILES))
    peak_to_valley, balls = 2e6 * found.design.sonotrode.amplitude, found.design.shot.count
    as_designed = f"as designed ({peak_to_valley:g} µm peak to valley, {balls} balls)"
    lines += ["", f"{as_designed}: standard deviations"]
    for figure in predictions:
        spread = f"{_percent(figure.sd_before)} before, now {_percent(figure.sd)}"
        if figure.next_name:
            spread += f"; with {figure.next_name}: {_percent(figure.next_sd)}"
        lines.append(f"{figure.words:32}{spread}")
    return lines


def _misfit_line(one: Misfit, faults: tuple[str, str]) -> str:
    """Return a line with chi² of a kind of measurement, and a verdict."""
    why, then = faults
    text = f"chi² = {plain(one.chi2, 2)} of {one.values} value{'s' * (one.values > 1)}"
    scale = f"their errors are taken {plain(one.error_scale, 2)} times as large"
    verdict = "well" if one.error_scale == 1.0 else f"{why.format(one.kind)}: {scale}{then}"
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

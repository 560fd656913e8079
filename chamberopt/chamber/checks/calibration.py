"""Warnings about a design outside the conditions of its calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING

from chamberopt.chamber.checks.warning import DesignWarning, WarningKind
from chamberopt.design.calibration import NO_STRIPS

if TYPE_CHECKING:
    from chamberopt.design.calibration import Calibration
    from chamberopt.design.load import Design

# No measurement of the machine has tried the model beyond these limits.
AMPLITUDE_RANGE, DIAMETER_RANGE, DENSITY_RANGE = 1.3, 1.5, 1.05
COUNTED_TWICE = (
    "calibration: made without friction, so its C0 and v0 stand for what friction takes too, and "
    'this design counts it twice: set effects.friction = "none" here, or calibrate with friction'
)
NOT_COUNTED = (
    "calibration: made with friction, and this design has none: its shot is too fast; leave "
    "effects.friction out"
)


def calibration_warnings(design: Design) -> list[DesignWarning]:
    """Return warnings about a design for which its calibration may not hold.

    A warning is about values of the design beyond the measured range, friction that was left out
    of only one of the two, measurements that the calibrated model does not explain, or Almen strips
    that were not measured or not whole.
    """
    one = design.calibration
    if one is None:
        return []
    found: list[tuple[str, str]] = []  # what it is about, and the message
    low, high = one.amplitude_um
    for sonotrode in (design.sonotrode, *design.sonotrodes):
        amplitude = sonotrode.zero_to_peak_um
        if not (2.0 - AMPLITUDE_RANGE) * low <= amplitude <= AMPLITUDE_RANGE * high:
            text = (
                f"calibration: made at amplitudes of {low:g} to {high:g} µm zero-to-peak, more "
                f"than 30 % from this design's {amplitude:g}: measure strips at that amplitude too"
            )
            found.append(("amplitude", text))
    small, large = one.ball_diameter_mm
    for diameter, _ in design.shot.sizes:
        size = 1e3 * diameter
        if not small / DIAMETER_RANGE <= size <= large * DIAMETER_RANGE:
            text = (
                f"calibration: made with balls of {small:g} to {large:g} mm, and this design's of "
                f"{size:g} mm differ by more than a factor of 1.5: calibrate with such balls"
            )
            found.append(("diameter", text))
    density, ratio = design.shot.density, design.shot.density / one.ball_density_kg_m3
    if max(ratio, 1.0 / ratio) > DENSITY_RANGE:
        text = (
            f"calibration: made with balls of {one.ball_density_kg_m3:g} kg/m³, this design's have "
            f"{density:g}: another material has other constants; calibrate with this shot"
        )
        found.append(("density", text))
    if ("mu" in one.parameters) != (design.effects.friction is not None):
        found.append(("friction", COUNTED_TWICE if design.effects.friction else NOT_COUNTED))
    found += [("misfit", text) for text in misfit_texts(one)]
    if one.not_mmA:
        found.append(("strips", one.not_mmA))
    if not one.has_strips:
        found.append(("strips", f"calibration: {NO_STRIPS}"))
    return [DesignWarning(WarningKind.CALIBRATION, text, (about,)) for about, text in found]


def misfit_texts(calibration: Calibration) -> list[str]:
    """Return a text for each kind of measurement that the calibrated model does not explain."""
    return [
        f"calibration: the model explains your {misfit.kind} only with errors "
        f"{misfit.error_scale:.2g} times as large, as intervals have them: look at the picture of "
        "the calibration"
        for misfit in calibration.misfits
        if misfit.error_scale > 1.0
    ]

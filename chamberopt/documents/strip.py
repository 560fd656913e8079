"""Text about a virtual strip, a simulated Almen strip."""

from __future__ import annotations

from typing import TYPE_CHECKING

from chamberopt.common.number_text import estimate_text, plain
from chamberopt.pictures.charts.strip import MULTIPLE_NAMES, fit_text
from chamberopt.results.command_records import FIT_NAMES

if TYPE_CHECKING:
    from chamberopt.peening.virtual_strip import VirtualStrip


def strip_lines(strip: VirtualStrip) -> list[str]:
    """Return the lines that the command `strip` prints about a simulated Almen strip."""
    first = "intensity I" if strip.is_calibrated else "peening strength S"
    lines = [
        f"{strip.setting.type} strip, {strip.setting.place}",
        f"{first:24}{estimate_text(strip.intensity, unit=strip.unit)}",
        f"{'saturation time T':24}{estimate_text(strip.time, unit='s')}",
    ]
    for name, time, height in zip(MULTIPLE_NAMES, strip.at, strip.heights, strict=True):
        label = f"after {name:3} = {plain(float(time), 3)} s"
        lines.append(f"{label:24}{estimate_text(height, unit=strip.unit)}")
    for name, fit in zip(FIT_NAMES, strip.fits, strict=True):
        lines.append(f"{'fit of ' + name:24}{fit_text(fit, strip)}")
    return lines

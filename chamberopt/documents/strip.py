"""Text about a virtual strip, a simulated Almen strip."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from chamberopt.common.number_text import estimate_text, plain
from chamberopt.documents.document import Table
from chamberopt.documents.terminal_lines import note_lines
from chamberopt.pictures.charts.strip import MULTIPLE_NAMES, fit_text
from chamberopt.results.command_records import FIT_NAMES

if TYPE_CHECKING:
    from chamberopt.peening.virtual_strip import VirtualStrip


def strip_end(strip: VirtualStrip, notes: Iterable[str], verbose: bool) -> list[Table | str]:
    """Return the end of the command `strip`: a sentence, the five arc heights and notes.

    Args:
        notes: notes on the design, which come before those on the strip.
        verbose: the curves that were fitted to the arc heights follow, and all notes.
    """
    what, height = "peening strength S", "arc strength, not calibrated"
    if strip.is_calibrated:
        what, height = "Almen intensity I", f"arc height, {strip.unit}"
    sentence = (
        f"{strip.setting.type} strip, {strip.setting.place}: {what} "
        f"{estimate_text(strip.intensity, unit=strip.unit)}, saturation time T "
        f"{estimate_text(strip.time, unit='s')}."
    )
    rows = [
        (name, f"{plain(float(time), 3)} s", estimate_text(arc, unit=strip.unit))
        for name, time, arc in zip(MULTIPLE_NAMES, strip.at, strip.heights, strict=True)
    ]
    fits = [
        f"fit of {name}: {fit_text(fit, strip)}"
        for name, fit in zip(FIT_NAMES, strip.fits, strict=True)
    ]
    table = Table("", ("after", "", height), rows)
    more = ["", *fits] if verbose else []
    return [sentence, "", table, *more, "", *note_lines([*notes, *strip.notes], verbose)]

"""Propose tolerances of a chamber's heights and of the amplitude, which a sheet's drawing shows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from chamberopt.design.tolerances import USUAL

# Permissible deviations of lengths, ISO 2768-1 class m: up to a nominal size, and either way [mm].
# By heart: the standard could not be read here.
ISO_2768_M = ((6.0, 0.1), (30.0, 0.2), (120.0, 0.3), (400.0, 0.5), (1000.0, 0.8), (2000.0, 1.2))
# Lengths that are set up. In plan the wall follows the sonotrode's face, with less clearance.
LENGTHS = ("height_mm", "sonotrode_distance_mm")
PEAK_TO_VALLEY_UM = USUAL["amplitude_pv_um"]
OF_AMPLITUDE = {"amplitude_um": 0.5 * PEAK_TO_VALLEY_UM, "amplitude_pv_um": PEAK_TO_VALLEY_UM}
REASON = "heights: ISO 2768-m; amplitude: SAE AMS 2580A; what they cost: simulate --tolerances"


def propose_tolerances(tables: Mapping[str, Mapping[str, Any]]) -> dict[str, float]:
    """Return how far heights in the chamber and the amplitude may lie off, by dotted name.

    Args:
        tables: tables of the design file.
    """
    lengths = {key: tables["chamber"][key] for key in LENGTHS}
    found = {f"chamber.{key}": _deviation_mm(one) for key, one in lengths.items()}
    set_ = {key: one for key, one in OF_AMPLITUDE.items() if key in tables["sonotrode"]}
    return found | {f"sonotrode.{key}": one for key, one in set_.items()}


def _deviation_mm(length: float) -> float:
    """Return the permissible deviation of a length, both in mm."""
    return next(off for most, off in ISO_2768_M if length <= most)

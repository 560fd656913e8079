"""Propose the mass of the charge, and the numbers that the study varies, in steps of a shop."""

from __future__ import annotations

import math
from typing import NamedTuple

from chamberopt.chamber.propose.sizes import Sizes
from chamberopt.chamber.scene import MAX_BALLS
from chamberopt.common.toml_fields import allowed_range
from chamberopt.design.shapes.base import ParametricChamber
from chamberopt.design.shot import ShotTable

LAYER, PACKED = 0.25, 0.9069  # the charge, in layers of balls; share of a plane that one covers
LIGHTER, HEAVIER = 0.4, 2.5  # charges of the study, as shares of the first
FINE_MM, COARSE_MM = 0.5, 1.0  # steps of lengths
FEW_MM = 400.0  # range of a length up to which its step is fine: a study takes 999 of them
LARGEST_MM = allowed_range(ParametricChamber.model_fields["height_mm"])[1]  # side of a chamber
HEAVIEST_G = allowed_range(ShotTable.model_fields["mass_g"])[1]


class Range(NamedTuple):
    """What a number of the design may be, in its unit."""

    low: float
    high: float
    step: float


def propose_charge(floor: float, diameter: float, ball_mass: float) -> tuple[float, str]:
    """Mass of the charge [g] to two digits, and the reason for it.

    Args:
        floor: area of the sonotrode [m²].
        diameter, ball_mass: of a ball [m], [kg].
    """
    count = max(1, round(LAYER * PACKED * floor / (math.pi / 4.0 * diameter**2)))
    wanted, most = 1e3 * count * ball_mass, _heaviest_g(ball_mass)
    if wanted > most:
        return most, "the most that is supported, less than a quarter of a layer of balls"
    return min(float(f"{wanted:.2g}"), most), "a quarter of a layer of balls on the sonotrode"


def propose_ranges(
    sizes: Sizes, mass_g: float, ball_mm: float, ball_mass: float
) -> dict[str, Range]:
    """What the study varies, by dotted name."""
    distance, height = round(1e3 * sizes.distance), round(1e3 * sizes.height)
    far = round(1.25 * distance)
    near = max(round(0.4 * distance), math.ceil(2.0 * ball_mm))
    # Above the part even when it is highest, so that no ball is caught between.
    low = math.ceil(far + 1e3 * sizes.top + 2.0 * ball_mm)
    high = min(round(1.5 * height), LARGEST_MM)
    digit = _second_digit(mass_g)
    least, most = (digit * round(share * mass_g / digit) for share in (LIGHTER, HEAVIER))
    mass = (least, min(most, _heaviest_g(ball_mass)), digit)
    return {
        "chamber.height_mm": _lengths(min(low, height), high),
        "chamber.sonotrode_distance_mm": _lengths(min(near, distance), far),
        "shot.mass_g": Range(*(float(f"{one:.6g}") for one in mass)),
    }


def _lengths(low: float, high: float) -> Range:
    """All lengths between two whole ones [mm]."""
    return Range(low, high, FINE_MM if high - low <= FEW_MM else COARSE_MM)


def _second_digit(mass: float) -> float:
    """What a mass changes by if its second digit does so by one."""
    return 10.0 ** (math.floor(math.log10(mass)) - 1)


def _heaviest_g(ball_mass: float) -> float:
    """The largest charge [g] of two digits that the program takes."""
    most = min(1e3 * MAX_BALLS * ball_mass, HEAVIEST_G)
    digit = _second_digit(most)
    return float(f"{digit * math.floor(most / digit + 1e-9):.6g}")

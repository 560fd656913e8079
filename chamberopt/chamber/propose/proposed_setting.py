"""Settings of a shop for an Almen intensity: balls and amplitude, and the law between them.

Notation
    D   diameter of the balls
    A   amplitude of the sonotrode
    I   Almen intensity, in proportion to peening strength

    I ~ D^p A^q        p = BALL_POWER, q = AMPLITUDE_POWER

The strength of an impact of speed v is d²/D ~ D v (1 - e²)^(1/2), by Kirk's formula of the dent d
(coverage/dents.py). Where restitution e is constant and the balls are fast enough for gravity to
matter little, all speeds go with that of the sonotrode, so that p = q = 1. As e falls with speed,
fast shot gains less, and q is a little less. The law only says which pilot to run next: what is
proposed was simulated itself.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from chamberopt.chamber.layout.balls import (
    AS_GOOD,
    MOSTLY,
    SizeFit,
    fit_sizes,
    larger_sizes,
    serving_sizes,
    sizes_to_try,
)
from chamberopt.chamber.propose.proposal import Proposal, Wanted
from chamberopt.chamber.shop import ShopSonotrode, usual_shop
from chamberopt.design.intensity import WantedIntensity

BALL_POWER, AMPLITUDE_POWER = 1.0, 0.9
# Settings in the middle half of the range, by logarithms, count as equally good.
MIDDLE = 0.5
ALIKE = 0.01  # share of the target within which sizes in the range serve alike


class Setting(NamedTuple):
    """What a shop can set for an intensity: diameter of the balls [mm], and amplitude [µm]."""

    ball_mm: float
    amplitude_um: float  # zero-to-peak

    @property
    def in_words(self) -> str:
        """Both with their units."""
        return f"{self.ball_mm:g} mm at {self.amplitude_um:g} µm"


class Settings(NamedTuple):
    """What may be set for an intensity.

    Attributes:
        serving: balls that serve the target as well as any, with all amplitudes of the sonotrode.
        larger: larger balls that serve most of it, or touch nearly all, with all amplitudes.
        fits: how each size suits the target, by diameter [mm].
    """

    serving: list[Setting]
    larger: list[Setting]
    fits: dict[float, SizeFit]

    @property
    def served(self) -> dict[float, float]:
        """Share of the target that each size serves, by diameter [mm].

        Larger balls that touch nearly all of it count as those that serve it best.
        """
        most = max((self.fits[one.ball_mm].served for one in self.serving), default=0.0)
        larger = {one.ball_mm for one in self.larger}
        return {
            ball: most if ball in larger and one.served < MOSTLY else one.served
            for ball, one in self.fits.items()
        }


def settings_of(made: Proposal, wanted: Wanted) -> Settings:
    """Return the balls that the geometry allows, each with all amplitudes of the sonotrode."""
    amplitudes = amplitudes_of(made.sonotrode)[1]

    def with_each(diameters: Iterable[float]) -> list[Setting]:
        return [Setting(_in_mm(ball), one) for ball in diameters for one in amplitudes]

    if wanted.ball_mm is not None:
        ball = made.design.shot.diameter
        fits = fit_sizes(made.chamber.part, [ball])
        return Settings(with_each([ball]), [], {_in_mm(ball): fits[0]})
    stock = (wanted.shop or usual_shop()).stock_mm(made.tables["shot"]["material"])
    part = made.chamber.part
    fits = fit_sizes(part, sizes_to_try(part, stock))
    larger = with_each(one.diameter for one in larger_sizes(fits))
    by_ball = {_in_mm(one.diameter): one for one in fits}
    return Settings(with_each(serving_sizes(fits)), larger, by_ball)


def _in_mm(diameter: float) -> float:
    return round(1e3 * diameter, 4)


def setting_of(made: Proposal) -> Setting:
    """Return the balls and the amplitude of a proposal."""
    return Setting(made.tables["shot"]["diameter_mm"], made.design.sonotrode.zero_to_peak_um)


def amplitudes_of(one: ShopSonotrode) -> tuple[str, dict[float, float]]:
    """Return the design's key of a sonotrode's amplitudes, and its values by zero-to-peak [µm]."""
    if one.amplitudes_um is not None:
        return "amplitude_um", {value: value for value in one.amplitudes_um}
    assert one.amplitudes_pv_um is not None
    return "amplitude_pv_um", {0.5 * value: value for value in one.amplitudes_pv_um}


def expected_intensity(setting: Setting, simulated: Mapping[Setting, float]) -> float:
    """Return the intensity [mmA] of a setting, by the law from the simulated one nearest to it.

    Args:
        simulated: intensities of settings that were simulated [mmA], at least one.
    """

    def distance(other: Setting) -> float:
        return sum(abs(math.log(a / b)) for a, b in zip(setting, other, strict=True))

    near = min(simulated, key=distance)
    return simulated[near] * _ratio(setting, near)


def _ratio(setting: Setting, other: Setting) -> float:
    """Return by the law the intensity of a setting over that of another one."""
    balls, amplitudes = (one / two for one, two in zip(setting, other, strict=True))
    return math.pow(balls, BALL_POWER) * math.pow(amplitudes, AMPLITUDE_POWER)


def choose(
    wanted: WantedIntensity,
    settings: Sequence[Setting],
    simulated: Mapping[Setting, float],
    served: Mapping[float, float] | None = None,
) -> Setting:
    """Return the setting for an intensity: of the largest amplitude in the middle of the range.

    The same intensity takes the less time the larger the amplitude, with smaller balls. Where balls
    elsewhere in the range serve more of the target, these are taken: an intensity is known to a
    factor, and what no ball touches stays bare. Where no setting is in the middle half of the
    range, it is the one nearest to the middle; where none is in the range, of those that serve as
    much as any: less of the target would be served, and the intensity still missed.

    Args:
        served: share of the target that each size serves, by diameter [mm]; all of it by default.
    """
    off = {
        one: abs(math.log(max(expected_intensity(one, simulated), 1e-9) / wanted.middle))
        for one in settings
    }
    half = 0.5 * MIDDLE * math.log(wanted.high / wanted.low)
    inside = [one for one in settings if not wanted.off(expected_intensity(one, simulated))]
    shares = {one: (served or {}).get(one.ball_mm, 1.0) for one in inside or settings}
    least = max(shares.values()) - (ALIKE if inside else AS_GOOD)
    best = [one for one in shares if shares[one] >= least]
    middle = [one for one in best if off[one] <= half]
    if inside and middle:
        return max(middle, key=lambda one: (one.amplitude_um, -off[one]))
    return min(best, key=lambda one: off[one])


def with_amplitude(made: Proposal, setting: Setting) -> Proposal:
    """Return a proposal with the amplitude of a setting that its sonotrode has."""
    key, values = amplitudes_of(made.sonotrode)
    near = min(values, key=lambda one: abs(one - setting.amplitude_um))
    tables = {**made.tables, "sonotrode": {**made.tables["sonotrode"], key: values[near]}}
    design = made.design.changed({f"sonotrode.{key}": values[near]})
    return replace(made, tables=tables, design=design)

"""The Almen intensity that a specification asks for, and how a predicted one compares with it.

Notation
    S   peening strength [µm]                   (coverage/strength.py)
    K   Almen intensity over S [mmA/mm]
    I   predicted Almen intensity, K S [mmA]

Strips that were measured give K and its error (calibration.py). Until then K is the usual value,
which is known to a factor: ln K has the standard deviation USUAL_K_LOG_SD. The 95 % interval of I
is then I exp(± 1.96 sd), with sd² the sum of the squares of that and of the relative error of S.

Where no specification is at hand, ranges that are usual for a metal and a thickness are those of
SAE AMS-S-13165, table VI (once MIL-S-13165C, cancelled, still quoted), for metallic and ceramic
shot. They were read in a copy (yumpu.com/en/document/view/13851658, page 20) whose text has strong
steel and titanium in one column. The table has no nickel alloys, and none for less than 0.09 in:
customer and shop agree on an intensity there.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, cast

from chamberopt.common.errors import InputError
from chamberopt.common.estimate import NOT_RESOLVED, Estimate
from chamberopt.common.number_text import plain, with_interval
from chamberopt.design.almen_strip import OVER_A, USUAL_K, USUAL_K_LOG_SD, StripType, usual_strip
from chamberopt.design.materials import Alloy

if TYPE_CHECKING:
    from chamberopt.design.calibration import Calibration

Z = 1.96  # standard deviations to either end of a 95 % interval
# A single intensity stands for itself and what lies above it: SAE AMS 2430, 3.11.1, as quoted (see
# docs/how_to/drawing.md): - 0, + 30 % or + 0.003 in, whichever is the greater.
ABOVE_SHARE, ABOVE_MM = 0.30, 0.0762
# mm on the strip of its type. Inches and thousandths of an inch lie outside.
LEAST_MM, MOST_MM = 0.03, 1.5
INSIDE, OUTSIDE = "inside", "outside"
NOT_DECIDED = "not decided"
UNTIL = "an estimate until strips are measured: chamberopt calibrate"
TOO_FEW = "too few dents were simulated to tell the peening strength; simulate longer"
FORM = (
    "a range such as 0.15-0.20A, a value with its tolerance such as 0.20+-0.02A, or a value such "
    "as 0.15A (to 30 % or 0.076 mm above it, by SAE AMS 2430); in mm of an A, N or C strip"
)
INCH_MM = 25.4
NEAR_ENOUGH = 1.1
# Largest bias of a strength without an interval over its value, from which an intensity is told. Of
# eight designs with 1 to 60 dents in a window it held the strength of more dents, or nearly.
MOST_BIAS = 0.5
AT_STEP = 0.05  # share of THICK_MM within which both ranges are told
THIN_MM, THICK_MM = 0.090 * INCH_MM, 0.375 * INCH_MM
STRONG_MPa = 1379.0  # tensile strength of steel: 200,000 psi
STRONG_HB = 390.0  # hardness of such steel, by the conversions of ASTM A370: by heart
TABLE = "table VI of SAE AMS-S-13165"
# From THIN_MM to THICK_MM, and above it [in on A strips].
_STEEL = (0.008, 0.012), (0.012, 0.016)
_STRONG = (0.006, 0.010), (0.006, 0.010)  # strong steel, and titanium
_ALUMINIUM = (0.006, 0.010), (0.010, 0.014)
_NUMBER = r"(\d+\.?\d*|\.\d+)"
_GIVEN = re.compile(
    rf"\s*{_NUMBER}\s*(?:(-|–|to|\+-|\+/-|±)\s*{_NUMBER})?\s*(?:mm)?\s*([NAC])\s*", re.IGNORECASE
)


@dataclass(frozen=True)
class WantedIntensity:
    """The range of the Almen intensity [mmA] that is wanted, and how it was given."""

    low: float
    high: float
    text: str = ""

    @classmethod
    def parse(cls, given: str) -> WantedIntensity:
        """Return the range that a text such as 0.15-0.20A stands for.

        Strips of the types N and C are converted to A: h_A = h_N / 3 = 3.5 h_C (almen_strip.py).

        Raises InputError if the text has another form, or its numbers are no mm.
        """
        found = _GIVEN.fullmatch(given)
        if found is None:
            raise InputError(f"--intensity: given {given!r}; allowed: {FORM}")
        first, sign, second, letter = found.groups()
        low, text = float(first), ""
        if sign is None:
            high = low + max(ABOVE_SHARE * low, ABOVE_MM)
            text = ", by SAE AMS 2430 to 30 % or 0.076 mm above it"
        elif sign.lower() in ("-", "–", "to"):
            high = float(second)
        else:
            low, high = low - float(second), low + float(second)
        if not LEAST_MM <= low <= high <= MOST_MM:
            inches = f"; 0.006 in are {0.006 * 25.4:.2f} mm" if sign is None or low <= high else ""
            raise InputError(
                f"--intensity: given {given!r}, which is {low:g} to {high:g} mm; allowed: "
                f"{LEAST_MM:g} to {MOST_MM:g} mm, the lower end first{inches}"
            )
        if low == high:
            raise InputError(f"--intensity: given {given!r}, a range without width; widen it")
        strip = cast(StripType, letter.upper())
        low, high = (float(f"{one / OVER_A[strip]:.3g}") for one in (low, high))
        if strip != "A":
            text += f", converted from {strip} strips roughly"
        return cls(low, high, f"asked: {given.strip()}{text}")

    @property
    def middle(self) -> float:
        """Geometric middle of the range [mmA]."""
        return math.sqrt(self.low * self.high)

    def off(self, intensity: float) -> float:
        """Return the logarithm of the factor by which an intensity lies off the range; 0 in it.

        It is negative below the range. Up to NEAR_ENOUGH beside the range counts as in it, as no
        simulation without strips tells it better.
        """
        if intensity <= 0.0:
            return -math.inf
        if self.low / NEAR_ENOUGH <= intensity <= self.high * NEAR_ENOUGH:
            return 0.0
        return math.log(intensity / (self.low if intensity < self.low else self.high))


@dataclass(frozen=True)
class PredictedIntensity:
    """A predicted Almen intensity [mmA], with its 95 % interval.

    factor: one standard deviation is a multiplication or division by it; 1 if strips were measured.
    """

    value: float
    low: float
    high: float
    factor: float = 1.0

    @classmethod
    def of(
        cls, metrics: Mapping[str, Estimate], calibration: Calibration | None
    ) -> PredictedIntensity | None:
        """Return the prediction that follows from the metrics of a simulation.

        It is None if hardly anything is known of the strength, or if the arc heights that the
        machine is calibrated to are not those of whole strips.
        """
        if calibration is not None and calibration.not_mmA:
            return None
        if calibration is not None and calibration.has_strips:
            return cls._measured(metrics.get("almen_intensity"))
        return cls.estimated(metrics.get("strength_um"))

    @classmethod
    def _measured(cls, one: Estimate | None) -> PredictedIntensity | None:
        if one is None or one.in_words or not math.isfinite(one.half_width):
            return None
        return cls(one.value, max(one.low, 0.0), one.high)

    @classmethod
    def estimated(cls, strength_um: Estimate | None) -> PredictedIntensity | None:
        """Return the prediction by the usual K; None if hardly anything is known of the strength.

        A strength that is not resolved tells it roughly, by its bias on both sides: see
        coverage/strength_intervals.py.
        """
        one = strength_um
        if one is not None and one.in_words == NOT_RESOLVED and one.bias > 0.0:
            known = one.bias < MOST_BIAS * one.value
            one = replace(one, half_width=one.bias, in_words="") if known else None
        if one is None or one.in_words or not math.isfinite(one.half_width) or one.value <= 0.0:
            return None
        value = 1e-3 * USUAL_K * one.value
        sd = math.hypot(USUAL_K_LOG_SD, one.half_width / (Z * one.value))
        return cls(value, value * math.exp(-Z * sd), value * math.exp(Z * sd), math.exp(sd))

    def times(self, factor: float) -> PredictedIntensity:
        """Return the prediction for something whose intensity is a multiple of this one."""
        low, value, high = (factor * one for one in (self.low, self.value, self.high))
        return replace(self, value=value, low=low, high=high)

    @property
    def factor_in_words(self) -> str:
        """The factor within which it is known, after its number; "" if strips were measured."""
        return "" if self.factor == 1.0 else f", within a factor of {plain(self.factor, 2)}"

    def on_strips(self, strip: StripType) -> str:
        """Return the arc height of a strip of a type in words."""
        value = plain(OVER_A[strip] * self.value, 2)
        return f"{value} mmA" if strip == "A" else f"{value} mm on {strip} strips"

    def standing(self, wanted: tuple[float, float]) -> str:
        """Return where the whole 95 % interval lies: INSIDE a range, OUTSIDE it, or NOT_DECIDED.

        Args:
            wanted: lower and upper end of the range [mmA].
        """
        low, high = wanted
        if low <= self.low and self.high <= high:
            return INSIDE
        return OUTSIDE if self.high < low or self.low > high else NOT_DECIDED

    @property
    def in_words(self) -> str:
        """The value with its band, as "0.18 mmA, within a factor of 2.5 (...)"."""
        if self.factor == 1.0:
            return with_interval(self.value, self.high - self.value, "mmA")
        value, low, high, factor = (
            plain(one, 2) for one in (self.value, self.low, self.high, self.factor)
        )
        return (
            f"{value} mmA, within a factor of {factor} (one standard deviation, at 95 % {low} to "
            f"{high} mmA): {UNTIL}"
        )


def strip_to_measure(
    wanted: tuple[float, float] | None, predicted: PredictedIntensity | None
) -> StripType:
    """Return the type of the strips that measure a wanted range [mmA], or else a prediction.

    A strips are taken where neither is known.
    """
    if wanted is not None:
        return usual_strip(wanted[1])
    return "A" if predicted is None else usual_strip(predicted.value)


def range_on_strips(low: float, high: float) -> str:
    """Return a range [mmA] in words, in mm of the strips that measure it.

    An order in mmN or mmC is so told as it was given, and beside it what it is in mmA, roughly.
    """
    strip, ends = usual_strip(high), f"{plain(low, 2)} to {plain(high, 2)} mmA"
    if strip == "A":
        return f"{plain(low)} to {plain(high)} mmA"
    own = " to ".join(plain(OVER_A[strip] * one, 2) for one in (low, high))
    return f"{own} mm{strip} (roughly {ends})"


@dataclass(frozen=True)
class Comparison:
    """A simulated intensity beside the wanted range.

    standing: INSIDE, OUTSIDE or NOT_DECIDED.
    in_words: the standing, with the place of the predicted value where it is not decided.
    predicted: the prediction in words, or why there is none.
    """

    standing: str
    in_words: str
    predicted: str

    @classmethod
    def of(
        cls,
        wanted: tuple[float, float],
        metrics: Mapping[str, Estimate],
        calibration: Calibration | None,
    ) -> Comparison:
        """Return the comparison for the metrics of a simulation.

        Args:
            wanted: lower and upper end of the range [mmA].
        """
        found = PredictedIntensity.of(metrics, calibration)
        if found is not None:
            return cls.with_prediction(wanted, found)
        why = TOO_FEW
        if calibration is not None and calibration.not_mmA:
            why = f"the calibration has arc heights of a {calibration.strips}, not mmA"
        return cls(NOT_DECIDED, NOT_DECIDED, f"not known: {why}")

    @classmethod
    def with_prediction(
        cls, wanted: tuple[float, float], predicted: PredictedIntensity
    ) -> Comparison:
        """Return the comparison for a prediction that is known."""
        standing = predicted.standing(wanted)
        words = f"{standing} with the whole interval"
        if standing == NOT_DECIDED:
            shown = float(f"{predicted.value:.2g}")  # as it is told
            where = INSIDE if wanted[0] <= shown <= wanted[1] else OUTSIDE
            words = f"{NOT_DECIDED}: the estimate lies {where}, but is known too roughly to tell"
        return cls(standing, words, predicted.in_words)


def usual_intensity(alloy: Alloy, thickness: float) -> WantedIntensity | None:
    """Return the usual range for an alloy of some thickness [m]; None if the table has none."""
    ranges = {"titanium": _STRONG, "aluminium": _ALUMINIUM, "steel": _STEEL}.get(alloy.metal)
    if ranges is None or 1e3 * thickness < THIN_MM:
        return None
    what = alloy.metal
    if alloy.metal == "steel" and _is_strong(alloy):
        ranges, what = _STRONG, f"steel from {STRONG_MPa:.0f} MPa on"
    is_thick = 1e3 * thickness > THICK_MM
    low, high = (round(INCH_MM * one, 2) for one in ranges[is_thick])
    edge = f"above {THICK_MM:.3g} mm" if is_thick else f"of {plain(1e3 * thickness, 2)} mm"
    text = f"usual for {what} {edge} under the target by {TABLE}"
    at_step = abs(1e3 * thickness - THICK_MM) < AT_STEP * THICK_MM
    if at_step and ranges[0] != ranges[1]:
        other = "-".join(f"{INCH_MM * one:.2g}" for one in ranges[not is_thick])
        text += f" ({other}A {'up to' if is_thick else 'above'} {THICK_MM:.3g} mm)"
    return WantedIntensity(low, high, text)


def _is_strong(alloy: Alloy) -> bool:
    """Return whether the surface of a steel has STRONG_MPa, by its hardness where it is a case."""
    if alloy.tensile_MPa is None:
        return (alloy.hardness_HB or 0.0) >= STRONG_HB
    return alloy.tensile_MPa >= STRONG_MPa


def why_none(alloy: Alloy, thickness: float) -> str:
    """Return in words why there is no usual range for an alloy of some thickness [m]."""
    if math.isfinite(thickness) and 1e3 * thickness < THIN_MM:
        return (
            f"a quarter of the target is {plain(1e3 * thickness, 2)} mm thick or less, where "
            f"{TABLE} has no range (below {THIN_MM:.2g} mm): agree on one with your customer"
        )
    return f"{TABLE} has no range for {alloy.metal}: take that of your drawing"

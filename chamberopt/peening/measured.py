"""The file of measurements that `chamberopt calibrate` takes, and the designs that it names."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import Field

from chamberopt.common.errors import InputError
from chamberopt.common.toml_errors import Problem, format_problems
from chamberopt.common.toml_fields import File, Pair, Several, list_field, quantity, read_toml
from chamberopt.design.almen_strip import StripType
from chamberopt.design.calibration import OF_STRIPS
from chamberopt.design.design import validate
from chamberopt.design.load import load_design
from chamberopt.design.table_base import FileTable
from chamberopt.peening.strip import StripSize

if TYPE_CHECKING:
    from chamberopt.design.load import Design

# Standard deviations of measurements that come without any, see docs/how_to/calibrate.md.
ARC_PERCENT, COVERAGE_POINTS, DENT_PERCENT = 3.0, 3.0, 1.5
DROP_PERCENT, IMPACTS_PERCENT = 1.5, 5.0
SD_OF_METHOD = {"x-ray": 30.0, "hole drilling": 50.0}  # MPa
LEAST_DEPTHS = 3
MAX_ARC_MM = 3.0
MAX_FALL = 3.0  # standard deviations by which an arc may be below an earlier arc by chance
# Diameters of single dents on the shipped plate scatter by SPREAD of their mean. The logarithms of
# mean and 90th percentile of n dents have the covariance SAMPLED times SPREAD² / n.
SPREAD = 0.3
SAMPLED = np.array([[1.0, 0.3], [0.3, 0.33]])
Surface = Literal["shot", "wall", "sonotrode", "part"]


class Peened(FileTable):
    """A strip, coupon or part that was peened: in which design, and at which amplitude."""

    design: File | None = Field(default=None, description="instead of the one above all")
    amplitude_um: float | None = quantity(0.1, 500, "µm", "zero-to-peak, as set", None)
    amplitude_pv_um: float | None = quantity(0.2, 1000, "µm", "peak to valley, as set", None)

    def _problems(self) -> Iterator[Problem]:
        if self.amplitude_um is not None and self.amplitude_pv_um is not None:
            yield Problem("amplitude_pv_um", "given beside amplitude_um; keep one of the two")

    @property
    def zero_to_peak_um(self) -> float | None:
        """Zero-to-peak amplitude of this measurement [µm]; None for the amplitude of the design."""
        return 0.5 * self.amplitude_pv_um if self.amplitude_pv_um else self.amplitude_um


class MeasuredStrip(Peened):
    """Arc heights of Almen strips, each peened in the lid of the chamber for another time."""

    type: StripType = Field(default="A", description="of the strip")
    time_s: Several[float] = list_field("a list of times in s", "at least two, each once")
    arc_mm: Several[float] = list_field("a list of arc heights in mm", "one for each time")
    sd_percent: float = quantity(0.01, 50, "%", "standard deviation of an arc", ARC_PERCENT)
    distance_mm: float | None = quantity(
        0.01, 2000, "mm", "from the sonotrode; absent: that of the part", None
    )
    disc_mm: float | None = quantity(1, 500, "mm", "diameter of a round strip", None)
    size_mm: Pair | None = list_field("[length, width] in mm", "of a small strip", None)

    def _problems(self) -> Iterator[Problem]:
        yield from super()._problems()
        if self.type != "A":
            text = "not supported: K is that of A strips, and other arcs convert only roughly"
            yield Problem("type", f"given {self.type!r}; {text}; measure A strips")
        yield from _time_problems("time_s", self.time_s)
        if len(self.time_s) < 2:
            yield Problem("time_s", f"given {len(self.time_s)} times; at least two are needed")
        if len(self.arc_mm) != len(self.time_s):
            text = f"has {len(self.arc_mm)} arcs for {len(self.time_s)} times; give one for each"
            yield Problem("arc_mm", text)
        for i, arc in enumerate(self.arc_mm):
            if not 0.0 < arc <= MAX_ARC_MM:
                text = f"given {arc:g}; allowed: above 0, to {MAX_ARC_MM:g} mm"
                yield Problem(f"arc_mm.{i}", text)
        for i, fall in falls(np.array(self.arc_mm), 1e-2 * self.sd_percent):
            if fall > MAX_FALL:
                text = (
                    f"given {self.arc_mm[i]:g} after {max(self.arc_mm[:i]):g}, {fall:.1f} standard "
                    "deviations less: longer peening does not flatten a strip"
                )
                yield Problem(f"arc_mm.{i}", f"{text}; correct it, or give their true sd_percent")
        if self.disc_mm is not None and self.size_mm is not None:
            yield Problem("size_mm", "given beside disc_mm; keep one of the two")
        if self.size_mm is not None and not 0.0 < self.size_mm[1] <= self.size_mm[0]:
            text = f"given {list(self.size_mm)}; allowed: [length, width], the longer side first"
            yield Problem("size_mm", text)

    @property
    def size(self) -> StripSize:
        """Size of the strip; the standard size unless the file gives another size."""
        if self.disc_mm is not None:
            return StripSize(1e-3 * self.disc_mm, 1e-3 * self.disc_mm, is_disc=True)
        if self.size_mm is None:
            return StripSize()
        return StripSize(1e-3 * self.size_mm[0], 1e-3 * self.size_mm[1])


class MeasuredCoverage(FileTable):
    """Coverage of a coupon after a time, as seen through a magnifier."""

    time_s: float = quantity(1e-4, 1e6, "s", "peening time")
    percent: float = quantity(0.1, 99.9, "%", "covered; above 90 it tells little")
    sd: float = quantity(0.01, 50, "points", "standard deviation", COVERAGE_POINTS)


class MeasuredDents(FileTable):
    """Diameters of single dents on a polished coupon."""

    mean: float = quantity(1e-3, 20, "mm", "mean diameter")
    p90: float | None = quantity(1e-3, 20, "mm", "which a tenth exceed", None)
    count: int = quantity(5, 1_000_000, "", "how many dents were measured", 30)
    sd_percent: float = quantity(0.01, 50, "%", "of reading a diameter", DENT_PERCENT)

    def _problems(self) -> Iterator[Problem]:
        if self.p90 is not None and self.p90 <= self.mean:
            text = f"given {self.p90:g}, not above the mean of {self.mean:g}; exchange or correct"
            yield Problem("p90", f"{text} them")


class CouponMaterial(FileTable):
    """The metal of a coupon, where it is not the metal of the part."""

    hardness_HB: float | None = quantity(5, 1000, "HB", "Brinell hardness", None)  # noqa: N815
    C0: float | None = quantity(0.05, 1, "", "restitution below v0", None)
    v0_m_s: float | None = quantity(1e-4, 100, "m/s", "normal speed where yielding starts", None)


class MeasuredCoupon(Peened):
    """A coupon, a test piece that is peened in place of the part of a design."""

    material: CouponMaterial | None = Field(default=None, description="if not that of the part")
    coverage: Several[MeasuredCoverage] = list_field(
        "a list of { time_s = ..., percent = ..., sd = ... }", "of the coupon", ()
    )
    dent_mm: MeasuredDents | None = Field(default=None, description="{ mean = ..., count = ... }")

    def _problems(self) -> Iterator[Problem]:
        yield from super()._problems()
        yield from _time_problems("coverage", tuple(one.time_s for one in self.coverage))
        if not self.coverage and self.dent_mm is None:
            yield Problem("coverage", "missing; give coverage, dent_mm or both")


class MeasuredDrop(FileTable):
    """A ball that was dropped on a surface, and the share of its speed that it kept."""

    design: File | None = Field(default=None, description="instead of the one above all")
    surface: Surface = Field(description="what it fell on")
    speed_m_s: float = quantity(1e-3, 100, "m/s", "at the impact: sqrt(2 g h) of a fall by h")
    restitution: float = quantity(0.01, 1, "", "speed after over speed before")
    sd_percent: float = quantity(0.01, 50, "%", "standard deviation", DROP_PERCENT)


class MeasuredImpacts(Peened):
    """Impacts on the part per second, counted with a microphone or an accelerometer."""

    per_s: float = quantity(1e-3, 1e9, "1/s", "impacts on the whole part")
    sd_percent: float = quantity(0.01, 50, "%", "standard deviation", IMPACTS_PERCENT)


class MeasuredAmplitude(FileTable):
    """The amplitude of the sonotrode, measured by laser or accelerometer."""

    set_pv_um: float = quantity(0.2, 1000, "µm", "as set, peak to valley")
    measured_pv_um: float = quantity(0.2, 1000, "µm", "as measured, peak to valley")
    sd: float | None = quantity(1e-3, 100, "µm", "of the measured one; absent: 3 %", None)


# Of a measured profile: the depth at which it ends [µm], and the size of stress [MPa].
LEAST_DEEP_UM, MOST_DEEP_UM, MOST_MPa = 10.0, 5000.0, 4000.0


class MeasuredProfile(Peened):
    """Residual stress by depth in a peened coupon, which is the part of its design."""

    method: Literal["x-ray", "hole drilling"] = Field(description="how it was measured")
    time_s: float | None = quantity(0.01, 1e6, "s", "peening time, if not the design's", None)
    depth_um: Several[float] = list_field("a list of depths in µm", "at least three, ascending")
    stress_MPa: Several[float] = list_field(  # noqa: N815
        "a list of stresses in MPa", "one for each depth; compression is negative"
    )
    sd_MPa: float | None = quantity(  # noqa: N815
        0.1, 1000, "MPa", "standard deviation of one; absent: 30 by X-rays, 50 by drilling", None
    )

    def _problems(self) -> Iterator[Problem]:
        yield from super()._problems()
        if len(self.stress_MPa) != len(self.depth_um):
            text = f"has {len(self.stress_MPa)} stresses for {len(self.depth_um)} depths"
            yield Problem("stress_MPa", f"{text}; give one for each")
        ascends = all(above < below for above, below in pairwise(self.depth_um))
        if len(self.depth_um) < LEAST_DEPTHS or not ascends or self.depth_um[0] < 0.0:
            text = f"given {list(self.depth_um)}; allowed: {LEAST_DEPTHS} or more, ascending from 0"
            yield Problem("depth_um", text)
        if self.depth_um and not LEAST_DEEP_UM < self.depth_um[-1] < MOST_DEEP_UM:
            text = (
                f"ends at {self.depth_um[-1]:g}; allowed: {LEAST_DEEP_UM:g} to {MOST_DEEP_UM:g} µm"
            )
            yield Problem("depth_um", f"{text}; is it in µm?")
        largest = max(self.stress_MPa, key=abs, default=-1.0)
        if abs(largest) > MOST_MPa:
            text = f"has {largest:g}; allowed: up to {MOST_MPa:g} MPa in size; is it in MPa?"
            yield Problem("stress_MPa", text)
        elif largest >= 0.0:
            text = "is mostly tension; compressive stresses are negative: give them so"
            yield Problem("stress_MPa", text)

    @property
    def sd(self) -> float:
        """Standard deviation of one stress [MPa]."""
        return self.sd_MPa or SD_OF_METHOD[self.method]


class PriorTable(FileTable):
    """What is known of a parameter before measuring: its usual value and standard deviation."""

    sd_log: float = quantity(1e-4, 5, "", "standard deviation of its natural logarithm")
    mean: float | None = quantity(1e-4, 1e4, "", "median, absent: the usual one", None)


class Priors(FileTable):
    """What is known of parameters before measuring, in place of the program's priors."""

    amplitude: PriorTable | None = Field(default=None, description="factor on the amplitude")
    C0: PriorTable | None = Field(default=None, description="factor on restitutions")
    v0: PriorTable | None = Field(default=None, description="factor on yield speeds")
    mu: PriorTable | None = Field(default=None, description="factor on friction")
    hardness: PriorTable | None = Field(default=None, description="factor on the hardness")
    K: PriorTable | None = Field(default=None, description="mmA per mm of strength")
    beta: PriorTable | None = Field(default=None, description="dents on strips over simulated")


class Measured(FileTable):
    """All measurements of one machine."""

    RENAMED = {"drops": "drop", "strips": "strip", "coupons": "coupon", "profiles": "profile"}  # noqa: RUF012

    design: File = Field(description="where they were peened, and for which predictions are made")
    strip: Several[MeasuredStrip] = list_field("tables, [[strip]]", "arc heights", ())
    coupon: Several[MeasuredCoupon] = list_field("tables, [[coupon]]", "coverage and dents", ())
    drop: Several[MeasuredDrop] = list_field("tables, [[drop]]", "bounces of a ball", ())
    impacts: Several[MeasuredImpacts] = list_field("tables, [[impacts]]", "impact rates", ())
    profile: Several[MeasuredProfile] = list_field("tables, [[profile]]", "residual stress", ())
    amplitude: MeasuredAmplitude | None = Field(default=None, description="of the sonotrode")
    prior: Priors = Field(default_factory=Priors, description="instead of the usual priors")

    def _problems(self) -> Iterator[Problem]:
        if not (self.strip or self.coupon or self.drop or self.impacts or self.amplitude):
            text = "holds no measurement; give [[strip]], [[coupon]], [[drop]], [[impacts]] or"
            beside = " beside [[profile]], which tells the metal alone" if self.profile else ""
            yield Problem("", f"{text} [amplitude]{beside}")
        for number, one in enumerate(self.strip):
            if one.size != self.strip[0].size:
                text = (
                    f"a {one.size} beside a {self.strip[0].size}: an arc height belongs to one size"
                )
                yield Problem(f"strip.{number}", f"{text}; calibrate each size on its own")
        numbers = [(found.design, found.depth_um, found.stress_MPa) for found in self.profile]
        for number, same in enumerate(numbers):
            if same in numbers[:number]:
                text = "has the numbers of one above it, and each counts as a measurement"
                yield Problem(f"profile.{number}", f"{text}; leave one out")


Entry = MeasuredStrip | MeasuredCoupon | MeasuredDrop | MeasuredImpacts


def load_measured(path: Path) -> tuple[Measured, dict[str, Design]]:
    """Read a file of measurements, and return it with the designs that it names, by path.

    Raises InputError with every problem of the file, or of the first design that cannot be used.
    """
    example = "see docs/how_to/calibrate.md for an example"
    source, values = read_toml(path, "measurements", example)
    if {"part", "chamber"} <= values.keys():
        text = "this is a design file; a file of measurements is wanted, which names designs"
        raise InputError(f"{path}: {text}")
    found = validate(Measured, values, path, source)
    designs = {}
    for field, name in _designs(found):
        if name in designs:
            continue
        try:
            designs[name] = _usable(load_design(name))
        except InputError as error:
            text = format_problems([Problem(field, "cannot be used:")], path, source)
            raise InputError(f"{text}\n{error}") from None
    friction = any(one.effects.friction is not None for one in designs.values())
    without = {"mu": ("" if friction else "no design here has effects.friction")}
    without |= dict.fromkeys(OF_STRIPS, "" if found.strip else "no [[strip]] is given")
    silent = [
        Problem(
            f"profile.{number}", "the design of its coupon has no [stress]; add the table to it"
        )
        for number, one in enumerate(found.profile)
        if designs[one.design or found.design].stress is None
    ]
    if silent:
        raise InputError(format_problems(silent, path, source))
    idle = [
        Problem(f"prior.{name}", f"given, but {reason}, so it is not looked for; leave it out")
        for name, reason in without.items()
        if reason and getattr(found.prior, name) is not None
    ]
    if idle:
        raise InputError(format_problems(idle, path, source))
    densities = {one.shot.density for one in designs.values()}
    if len(densities) > 1:
        several = " and ".join(f"{one:g}" for one in sorted(densities))
        raise InputError(
            f"{path}: balls of {several} kg/m³: constants of one shot material do not hold for "
            "another; calibrate each on its own"
        )
    return found, designs


def _designs(found: Measured) -> Iterator[tuple[str, str]]:
    """Yield each field of the file that names a design: the field's name and the design's path."""
    yield "design", found.design
    for kind in ("strip", "coupon", "drop", "impacts", "profile"):
        for number, entry in enumerate(getattr(found, kind)):
            if entry.design is not None:
                yield f"{kind}.{number}.design", entry.design


def _usable(design: Design) -> Design:
    """Return the design without its calibration.

    Raises InputError if the design leaves the choice of its physical effects to a pilot run
    ("auto"), or has steps. A calibration needs the same effects in all simulations.
    """
    design.require_one_step("a calibration")
    if design.effects.auto:
        text = 'effects: given "auto"; a calibration needs effects that stay: name them, as '
        raise InputError(f"{text}`chamberopt check --pilot` advises")
    return design.model_copy(update={"calibration": None})


def falls(arcs: np.ndarray, sd: float) -> list[tuple[int, float]]:
    """Return which arc heights are below an earlier arc height, and how certainly.

    Args:
        arcs: arc heights in the order of their peening times, (n,).
        sd: standard deviation of each arc height, as a share of it.
    Returns:
        Position of each arc height that is too low, with the number of standard deviations of the
        difference by which it is below the largest arc height before it.
    """
    with np.errstate(divide="ignore", invalid="ignore"):  # arcs of 0 and less are refused
        fall = -np.log(arcs / np.maximum.accumulate(arcs)) / (math.sqrt(2.0) * sd)
    return [(i, float(one)) for i, one in enumerate(fall) if one > 0.0]


def _time_problems(name: str, times: tuple[float, ...]) -> Iterator[Problem]:
    for before, after in pairwise(times):
        if after <= before:
            text = f"has {after:g} s after {before:g} s; give each time once, in order"
            yield Problem(name, text)
    if times and times[0] <= 0.0:
        yield Problem(name, f"has {times[0]:g} s; times must be above 0")


def with_amplitude(design: Design, amplitude_um: float | None) -> Design:
    """Return the design with its first sonotrode at this zero-to-peak amplitude [µm].

    With an amplitude of None the design stays as it is.
    """
    if amplitude_um is None:
        return design
    face = design.sonotrode
    return design.changed({f"sonotrode.{face.amplitude_key}": face.per_amplitude * amplitude_um})


def with_material(design: Design, material: CouponMaterial | None) -> Design:
    """Return the design with its part made of a coupon's metal.

    The design stays as it is where `material` is None.
    """
    given: Mapping[str, Any] = material.model_dump(exclude_none=True) if material else {}
    return design.changed({f"materials.part.{name}": one for name, one in given.items()})


def dent_errors(dents: MeasuredDents) -> np.ndarray:
    """Return the covariance of the errors of measured dents on a coupon, (2, 2).

    It is for the logarithms of mean and 90th percentile of the dent diameters. Its shape is (1, 1),
    for the mean alone, where no percentile was measured.
    """
    reading = (1e-2 * dents.sd_percent) ** 2 * np.eye(2)
    size = 1 if dents.p90 is None else 2
    return np.asarray((SPREAD**2 / dents.count * SAMPLED + reading)[:size, :size])

"""Calibration of one machine by measurements: factors on a design's numbers, and Almen constants.

`chamberopt calibrate` finds these values. A design that names the calibration file is simulated
with them in place of its own. The intervals of its results include the calibration's uncertainty.

Notation, with the names of PARAMETERS
    amplitude   factor on the amplitude of the sonotrode
    C0, v0      factors on restitution and yield speed of all surfaces, balls and strips
    mu          factor on the coefficients of friction, where a design has friction
    hardness    factor on the hardness of the part, B of Kirk's law of dents
    K           arc height over peening strength [mmA/mm]
    beta        number of dents on a real strip over the simulated number
    m, C        mean and covariance of their natural logarithms     (log_mean, log_covariance)
    L           lower triangle with L L' = C
    g           derivatives of a result, such as the mean coverage, by the logarithms
    L' g        independent standard errors of the result
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar, get_args

import numpy as np
from pydantic import BeforeValidator, Field, ValidationError, ValidationInfo

from chamberopt.common.errors import InputError
from chamberopt.common.toml_errors import CrossCheckError, Problem, explain_validation_error
from chamberopt.common.toml_fields import Pair, Several, from_file, list_field, quantity, read_toml
from chamberopt.design.almen_strip import strip_material
from chamberopt.design.materials import PartMaterial, RestitutionTable
from chamberopt.design.table_base import FileTable

if TYPE_CHECKING:
    from chamberopt.design.shot import ShotTable

Parameter = Literal["amplitude", "C0", "v0", "mu", "hardness", "K", "beta"]
PARAMETERS: tuple[Parameter, ...] = get_args(Parameter)
LAW = "depth", "peak", "surface"  # factors on the law of residual stress
OF_STRIPS: tuple[Parameter, ...] = ("K", "beta")
MAX_LOG = 10.0
# Standard error of ln T by effects that the model leaves out, such as dents after the strongest
# dent of a spot. No saturation time is better known than to ± 15 %.
TIME_ERROR = 0.075
ROUNDING = 1e-9
WHOLE_STRIP = "whole strip"
NOT_BY_CHANCE = 2.0  # standard deviations
NO_STRIPS = (
    "the design's calibration has no arc heights of strips, so there is no Almen intensity; "
    "measure some, add them as [[strip]] and run chamberopt calibrate again"
)
NO_CALIBRATION = (
    "Almen intensity in mmA takes a calibration to measured strips: see chamberopt calibrate, and "
    'give the design calibration = "machine.toml"'
)
Law = TypeVar("Law", bound=RestitutionTable)


class Misfit(FileTable):
    """Agreement of the simulation with the measurements of one kind, after calibration."""

    kind: str = Field(description="of measurement")
    chi2: float = quantity(0, 1e12, "", "sum of squared residuals over their variances")
    values: int = quantity(1, 1_000_000, "", "number of measured values")
    error_scale: float = quantity(
        1, 1e6, "", "factor on their errors without which the model does not explain them", 1.0
    )


class LawCalibration(FileTable):
    """Factors on the law of residual stress, by measured profiles of one metal.

    They are on depths, on the largest stress and on that at the surface, in this order.
    """

    metal: str = Field(description="of the coupon, with its strengths")
    log_mean: Several[float] = list_field("3 numbers", "means of their logarithms")
    log_covariance: Several[Several[float]] = list_field("3 lists of 3 numbers", "of these")
    misfit: Misfit = Field(description="how well the law explains the measured profiles")

    def _problems(self) -> Iterator[Problem]:
        if len(self.log_mean) != len(LAW) or max(map(abs, self.log_mean)) > MAX_LOG:
            text = f"allowed: {len(LAW)} numbers from -{MAX_LOG:g} to {MAX_LOG:g}"
            yield Problem("log_mean", f"given {list(self.log_mean)}; {text}")
        if [len(row) for row in self.log_covariance] != [len(LAW)] * len(LAW):
            yield Problem("log_covariance", f"is not {len(LAW)} rows of {len(LAW)} numbers")
        elif np.linalg.eigvalsh(np.array(self.log_covariance)).min() < -ROUNDING:
            yield Problem("log_covariance", "is not positive semi-definite, as covariances are")


class Calibration(FileTable):
    """Calibrated values of one machine, with their uncertainty."""

    program: str = Field(description="version of chamberopt that made it")
    parameters: Annotated[Several[Parameter], Field(min_length=1)] = list_field(
        f"some of {', '.join(PARAMETERS)}", "what is calibrated"
    )
    log_mean: Several[float] = list_field(
        "a list of numbers", "means of their logarithms, in the order of parameters"
    )
    log_covariance: Several[Several[float]] = list_field(
        "a list of as many lists of numbers", "covariance of their logarithms, same order"
    )
    amplitude_um: Pair = list_field(
        "[lowest, highest], zero-to-peak in µm", "amplitudes at which was measured"
    )
    ball_diameter_mm: Pair = list_field("[lowest, highest] in mm", "of the balls measured with")
    ball_density_kg_m3: float = quantity(500, 25000, "kg/m³", "of the balls measured with")
    strips: str = Field(
        default=WHOLE_STRIP, description="what was measured: arc heights and K are those of one"
    )
    misfits: Several[Misfit] = list_field("a list of tables", "by kind of measurement", ())
    stress: Several[LawCalibration] = list_field(
        "a list of tables", "factors on the law of residual stress, by metal", ()
    )

    def _problems(self) -> Iterator[Problem]:
        count = len(self.parameters)
        if len(set(self.parameters)) < count:
            yield Problem("parameters", f"given {list(self.parameters)}; name each once")
        if (OF_STRIPS[0] in self.parameters) != (OF_STRIPS[1] in self.parameters):
            yield Problem("parameters", "has one of K and beta; strips give both or neither")
        if len(self.log_mean) != count:
            text = f"has {len(self.log_mean)} numbers for {count} parameters"
            yield Problem("log_mean", f"{text}; make it again with chamberopt calibrate")
        elif max(map(abs, self.log_mean)) > MAX_LOG:
            text = f"given {max(self.log_mean, key=abs):g}; allowed: -{MAX_LOG:g} to {MAX_LOG:g}"
            yield Problem("log_mean", text)
        yield from self._covariance_problems(count)
        for name in ("amplitude_um", "ball_diameter_mm"):
            low, high = getattr(self, name)
            if not 0.0 < low <= high:
                text = f"given [{low:g}, {high:g}]; allowed: [lowest, highest], above 0"
                yield Problem(name, text)

    def _covariance_problems(self, count: int) -> Iterator[Problem]:
        rows, again = self.log_covariance, "make it again with chamberopt calibrate"
        if len(rows) != count or any(len(row) != count for row in rows):
            yield Problem("log_covariance", f"is not {count} rows of {count} numbers; {again}")
            return
        matrix = np.array(rows)
        size = float(np.abs(matrix).max())
        if size > MAX_LOG**2:
            yield Problem("log_covariance", f"has {size:g}, more than {MAX_LOG**2:g}; {again}")
        elif np.abs(matrix - matrix.T).max() > ROUNDING * size:
            yield Problem("log_covariance", f"is not symmetric; {again}")
        elif np.linalg.eigvalsh(matrix).min() < -ROUNDING * size:
            text = "is not positive semi-definite, as covariances are"
            yield Problem("log_covariance", f"{text}; {again}")

    def factor(self, name: Parameter) -> float:
        """Return the calibrated value of a parameter; 1 if it is not calibrated."""
        if name not in self.parameters:
            return 1.0
        return math.exp(self.log_mean[self.parameters.index(name)])

    def log_sd(self, name: Parameter) -> float:
        """Return the standard deviation of a parameter's natural logarithm; 0 if uncalibrated."""
        if name not in self.parameters:
            return 0.0
        at = self.parameters.index(name)
        return math.sqrt(max(0.0, self.log_covariance[at][at]))

    def intensity_mmA(self, strength_um: float) -> float:  # noqa: N802
        """Return the Almen intensity [mmA] that a simulated peening strength [µm] stands for."""
        return self.factor("K") * 1e-3 * strength_um

    @property
    def own_strips(self) -> str:
        """What was measured in the place of whole Almen strips, such as "disc of 30 mm", or ""."""
        return "" if not self.has_strips or self.strips == WHOLE_STRIP else self.strips

    @property
    def not_mmA(self) -> str:  # noqa: N802
        """Return a note if the strips of the calibration were not whole Almen strips, else ""."""
        if not self.own_strips:
            return ""
        return (
            f"calibration: what is called mmA is mm of arc height of a {self.strips}, with which "
            "it was made, not of a whole strip"
        )

    def law_of(self, part: PartMaterial) -> LawCalibration | None:
        """Return the factors on the law of residual stress for a metal; None if not measured."""
        return next((one for one in self.stress if one.metal == law_metal(part)), None)

    @property
    def has_strips(self) -> bool:
        """True if arc heights were measured. Without them there is no Almen intensity."""
        return "K" in self.parameters

    @cached_property
    def _triangle(self) -> np.ndarray:
        """Return the lower triangle L with L L' = covariance, in the order of PARAMETERS.

        Rows and columns of parameters that are not calibrated are 0.
        """
        rows = [PARAMETERS.index(name) for name in self.parameters]
        matrix = np.array(self.log_covariance)
        # A parameter that is known exactly has a row of zeros, for which there is no L.
        tiny = ROUNDING * max(float(np.abs(matrix).max()), ROUNDING)
        order = np.argsort(rows)
        found = np.zeros((len(PARAMETERS), len(PARAMETERS)))
        at = np.array(rows)[order]
        ordered = matrix[np.ix_(order, order)] + tiny * np.eye(len(rows))
        found[np.ix_(at, at)] = np.linalg.cholesky(ordered)
        return found

    def errors(self, slopes: Mapping[Parameter, float], of_model: float = 0.0) -> tuple[float, ...]:
        """Return the independent standard errors L' g of a result by the calibration.

        There is an error for each of PARAMETERS, and last the model's own error. The errors of the
        difference of two results are the differences of their errors.

        Args:
            slopes: derivative of the result by each parameter's logarithm; 0 where missing.
            of_model: standard error by effects that the model leaves out.
        """
        slope = np.array([slopes.get(name, 0.0) for name in PARAMETERS])
        return *(self._triangle.T @ slope).tolist(), of_model


def law_metal(part: PartMaterial) -> str:
    """Return the name of a metal for the law of residual stress, with what the law takes of it."""
    strengths = f"{part.yield_MPa or 0.0:g} to {part.tensile_MPa or 0.0:g} MPa"
    return f"{part.alloy or 'metal'}, {part.hardness_HB:g} HB, {strengths}"


def why_no_intensity(calibration: Calibration | None) -> str:
    """Return why a design with this calibration has no Almen intensity; "" if it has one."""
    if calibration is None:
        return NO_CALIBRATION
    return "" if calibration.has_strips else NO_STRIPS


def _read(given: object, info: ValidationInfo) -> object:
    """Return the calibration in a file if a path is given, else the given value unchanged."""
    if not isinstance(given, str):
        return given
    if (info.context or {}).get("recorded"):  # a result holds the numbers, and names no file
        raise CrossCheckError([Problem("", f"given {given!r} in a result; simulate again")])
    path = from_file(given, info.context)
    try:
        remedy = "make one with chamberopt calibrate"
        values = read_toml(path, "calibration", remedy)[1]
        if "parameters" not in values:
            raise InputError(f"{path}: holds no calibration; {remedy}")
        return Calibration.model_validate(values)
    except InputError as error:
        raise CrossCheckError([Problem("", str(error))]) from None
    except ValidationError as error:
        found = explain_validation_error(error, Calibration)
        texts = (f"{path.name}: {one.field}: {one.text}" for one in found)
        raise CrossCheckError([Problem("", text) for text in texts]) from None


CalibrationField = Annotated[
    Calibration | None,
    BeforeValidator(_read),
    Field(
        default=None,
        description="of the machine: a file that chamberopt calibrate wrote",
        json_schema_extra={"form": 'the path of a calibration, such as "machine.toml"'},
    ),
]


def with_measured_values(design: Any) -> Any:
    """Return a copy of a Design with the values of its calibration in place of its own.

    The copy is only for a simulation: it names no calibration, and its values are not checked.
    A design without calibration is returned as it is.
    """
    one: Calibration | None = design.calibration
    if one is None:
        return design
    materials, effects = design.materials, design.effects
    moving = dict.fromkeys(("amplitude_um", "amplitude_pv_um"), one.factor("amplitude"))
    part = _with_measured_restitution(materials.part, one)
    hardness = part.hardness_HB * one.factor("hardness")
    laws = {
        name: _with_measured_restitution(getattr(materials, name), one)
        for name in ("shot", "wall", "sonotrode")
    }
    friction = effects.friction
    if friction is not None:
        friction = _times(friction, dict.fromkeys(friction.COEFFICIENTS, one.factor("mu")))
    return design.model_copy(
        update={
            "sonotrode": _times(design.sonotrode, moving),
            "sonotrodes": tuple(_times(further, moving) for further in design.sonotrodes),
            "materials": materials.model_copy(
                update={**laws, "part": part.model_copy(update={"hardness_HB": hardness})}
            ),
            "effects": effects.model_copy(update={"friction": friction}),
            "calibration": None,
        }
    )


def calibration_problems(design: Any) -> Iterator[Problem]:
    """Yield a problem for each value of a Design that its calibration puts out of range."""
    one: Calibration | None = design.calibration
    if one is None:
        return
    remedy = "correct log_mean, or make it again with chamberopt calibrate"
    found = with_measured_values(design)
    tables = {name: getattr(found, name) for name in ("sonotrode", "materials", "effects")}
    tables |= {f"sonotrodes.{k}": further for k, further in enumerate(found.sonotrodes)}
    for name, table in tables.items():
        try:
            type(table).model_validate(table.model_dump())
        except ValidationError as error:
            for problem in explain_validation_error(error, type(table)):
                text = f"{name}.{problem.field} would be out of range: {problem.text}"
                yield Problem("calibration", f"{text}; {remedy}")
    # C0 may come out above 1 by its own error. It is then 1.
    least = one.factor("C0") * math.exp(-NOT_BY_CHANCE * one.log_sd("C0"))
    for name in ("shot", "wall", "sonotrode", "part"):
        law = getattr(design.materials, name)
        key = "C0" if law.e_at_m_s is None else "e_at_m_s"
        highest = law.C0 if law.e_at_m_s is None else max(e for _, e in law.e_at_m_s)
        if highest * least > 1.0:
            text = f"its C0 makes materials.{name}.{key} {highest * one.factor('C0'):.3g}"
            yield Problem("calibration", f"{text}; allowed: to 1; {remedy}")


def calibrated_strip(shot: ShotTable, calibration: Calibration | None) -> PartMaterial:
    """Return hardness and restitution of an Almen strip under this shot.

    A calibration corrects the restitution but not the hardness, which the standard sets.
    """
    strip = strip_material(shot)
    return strip if calibration is None else _with_measured_restitution(strip, calibration)


def _times(table: Any, factors: Mapping[str, float]) -> Any:
    """Return a copy of a table with some numbers multiplied by factors. None stays None."""
    values = {name: getattr(table, name) for name in factors}
    changed = {name: one * factors[name] for name, one in values.items() if one is not None}
    return table.model_copy(update=changed)


def _with_measured_restitution(law: Law, one: Calibration) -> Law:
    return scaled_restitution(law, one.factor("C0"), one.factor("v0"))


def scaled_restitution(law: Law, c0: float, v0: float) -> Law:
    """Return a restitution law with its C0 and v0 multiplied by factors.

    A restitution above 1 becomes 1. The copy no longer says that v0 is the catalogue's.

    Args:
        law: restitution over impact speed, from C0 and v0 or as a table of points.
        c0: factor on the restitution.
        v0: factor on the speed at which yielding starts, and on the speeds of a table.
    """
    law = law.model_copy(update={"v0_for": None})
    if law.e_at_m_s is not None:
        points = tuple((speed * v0, min(1.0, e * c0)) for speed, e in law.e_at_m_s)
        law = law.model_copy(update={"e_at_m_s": points})
    scaled: Law = _times(law, {"C0": c0, "v0_m_s": v0})
    lowered = scaled.C0 is not None and scaled.C0 > 1.0
    return scaled.model_copy(update={"C0": 1.0}) if lowered else scaled

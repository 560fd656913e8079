"""Records of the commands strip, calibrate, accuracy and compare.

A record is the whole content of a JSON file. The program writes these files and never reads them.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chamberopt.common.files import write_text
from chamberopt.common.versions import versions
from chamberopt.peening.kirk_fit import MULTIPLES
from chamberopt.results.records import CoverageAtTime, Interval, Table, WholeEstimate

if TYPE_CHECKING:
    from chamberopt.peening.calibrate import Calibrated
    from chamberopt.peening.next_measurement import Prediction
    from chamberopt.peening.virtual_strip import VirtualStrip
    from chamberopt.results.compare.comparison import Comparison
    from chamberopt.results.compare.difference import Difference
    from chamberopt.results.compare.distributions import Distributions, Histogram
    from chamberopt.results.compare.local_difference import LocalDifference

FIT_NAMES = "two parameters", "three parameters"


def write_record(path: Path, record: Table) -> None:
    """Write a record as JSON."""
    write_text(path, json.dumps(record.as_json(), indent=2, allow_nan=False) + "\n")


class ArcHeight(Table):
    """The arc height after a multiple of the saturation time."""

    times_saturation: float
    time_s: float
    arc_height: float
    half_width: float
    unit: str


class KirkFitRecord(Table):
    """A curve through the five arc heights. Its formula is in peening/kirk_fit.py."""

    a: float
    b: float
    c: float
    intensity: float
    saturation_time_s: float


class CurvePoint(Table):
    """A point of the saturation curve."""

    time_s: float
    arc_height: float
    half_width: float


class StripRecord(Table):
    """A virtual strip. Arc heights and the intensity are in `unit`."""

    format: int
    type: str
    place: str
    calibrated: bool
    unit: str
    intensity: WholeEstimate
    saturation_time_s: WholeEstimate
    arc_heights: list[ArcHeight]
    fits: dict[str, KirkFitRecord]
    curve: list[CurvePoint]
    replicas: int
    simulated_time_s: float
    notes: list[str]
    versions: dict[str, str]


def strip_record(strip: VirtualStrip) -> StripRecord:
    """The record of a peened strip."""
    process = strip.setting.design.process
    heights = zip(MULTIPLES, strip.at, strip.heights, strict=True)
    curve = zip(strip.drawn_at, strip.drawn, strict=True)
    return StripRecord(
        format=1,
        type=strip.setting.type,
        place=strip.setting.place,
        calibrated=strip.is_calibrated,
        unit=strip.unit,
        intensity=strip.intensity,
        saturation_time_s=strip.time,
        arc_heights=[
            ArcHeight(
                times_saturation=multiple,
                time_s=float(time),
                arc_height=height.value,
                half_width=height.half_width,
                unit=strip.unit,
            )
            for multiple, time, height in heights
        ],
        fits={
            name: KirkFitRecord(
                a=fit.a,
                b=fit.b,
                c=fit.c,
                intensity=fit.intensity,
                saturation_time_s=fit.saturation_time,
            )
            for name, fit in zip(FIT_NAMES, strip.fits, strict=True)
        },
        curve=[
            CurvePoint(time_s=float(time), arc_height=one.value, half_width=one.half_width)
            for time, one in curve
        ],
        replicas=process.accuracy.replicas,
        simulated_time_s=process.recorded_time,
        notes=list(strip.notes),
        versions=versions(),
    )


class ParameterRecord(Table):
    """Mean and standard deviation of a parameter's logarithm, before and after the calibration."""

    log_mean_before: float
    log_sd_before: float
    log_mean: float
    log_sd: float


class MisfitRecord(Table):
    """The misfit between the model and the measurements of one kind."""

    kind: str
    chi2: float
    values: int
    error_scale: float
    explained: bool


class MeasuredRecord(Table):
    """Measurements of one kind in one set-up, each with its prediction."""

    kind: str
    label: str
    at: list[float]
    log_measured: list[float]
    log_predicted: list[float]
    log_sd_measured: list[float]
    log_sd_predicted: list[float]


class PredictionRecord(Table):
    """A predicted figure of the design, with standard deviations of its logarithm."""

    value: float
    log_sd_before: float
    log_sd: float
    log_noise: float
    next_measurement: str
    log_sd_after_next: float


class CalibrationRecord(Table):
    """A calibration of the model to one machine. `machine` is the content of machine.toml."""

    format: int
    machine: dict[str, Any]
    parameters: dict[str, ParameterRecord]
    correlation: list[list[float]]
    misfits: list[MisfitRecord]
    data: list[MeasuredRecord]
    predictions: dict[str, PredictionRecord]
    rounds: int
    simulations: int
    notes: list[str]
    versions: dict[str, str]


def calibration_record(
    found: Calibrated, predictions: list[Prediction], notes: list[str]
) -> CalibrationRecord:
    """The record of a calibration."""
    posterior, prior = found.posterior, found.posterior.prior
    sd = [found.table.log_sd(name) for name in prior.names]
    return CalibrationRecord(
        format=1,
        machine=found.table.model_dump(mode="json"),
        parameters={
            name: ParameterRecord(
                log_mean_before=float(prior.mean[k]),
                log_sd_before=float(prior.sd[k]),
                log_mean=float(posterior.mean[k]),
                log_sd=sd[k],
            )
            for k, name in enumerate(prior.names)
        },
        correlation=(posterior.covariance / [[a * b for b in sd] for a in sd]).tolist(),
        misfits=[
            MisfitRecord(**one.model_dump(), explained=one.error_scale == 1.0)
            for one in found.table.misfits
        ],
        data=[
            MeasuredRecord(
                kind=one.kind,
                label=one.label,
                at=one.at.tolist(),
                log_measured=one.y.tolist(),
                log_predicted=one.model(posterior.values).values.tolist(),
                log_sd_measured=[math.sqrt(x) for x in one.covariance.diagonal()],
                log_sd_predicted=posterior.sd(one.model).tolist(),
            )
            for one in found.data
        ],
        predictions={
            one.name: PredictionRecord(
                value=one.value,
                log_sd_before=one.sd_before,
                log_sd=one.sd,
                log_noise=one.noise,
                next_measurement=one.next_name,
                log_sd_after_next=one.next_sd,
            )
            for one in predictions
        },
        rounds=found.rounds,
        simulations=found.runs,
        notes=notes,
        versions=versions(),
    )


class ReferenceRecord(Table):
    """The reference run, with which all other runs are compared."""

    text: str
    settings: dict[str, Any]


class ErrorLawRecord(Table):
    """The law error = scale cost^-power. An infinite half-width is null."""

    scale: float
    power: float
    power_half_width: float | None


class HalvingRecord(Table):
    """The factor in cost that halves the error. Null if no cost halves the error."""

    times: float | None
    low: float | None
    high: float | None
    text: str


class RecommendationRecord(Table):
    """The settings for one accuracy. 0 replicas if the accuracy is out of reach."""

    accuracy: float
    settings: dict[str, Any]
    replicas: int
    cpu_s: float | None
    remarks: list[str]
    lines: list[str]


class ConvergenceRecord(Table):
    """A convergence study. Each row is a run or a number of replicas."""

    format: int
    reference: ReferenceRecord
    rows: list[dict[str, Any]]
    law: ErrorLawRecord
    halving: HalvingRecord
    recommendations: list[RecommendationRecord]
    cpu_s: float
    wall_s: float
    design: dict[str, Any]
    versions: dict[str, str]


class DifferenceRecord(Table):
    """A difference to the first candidate, and the simulation time that would show it."""

    value: float | None
    half_width: float | None
    in_words: str = ""
    paired: bool
    real: bool
    times_as_long: float | None
    replicas: int | None


class HistogramRecord(Table):
    """The share of each candidate in each bin."""

    unit: str
    edges: list[float]
    shares: list[list[float]]


class DistributionsRecord(Table):
    """Distributions over the target. Means are null for a candidate without impacts."""

    coverage: HistogramRecord
    normal_speed: HistogramRecord
    angle: HistogramRecord
    impacts: list[int]
    mean_normal_speed_m_s: list[float | None]
    mean_angle_deg: list[float | None]


class LocalDifferenceRecord(Table):
    """Shares of the target where a later candidate really covers more or less than the first."""

    share_more: float
    share_less: float
    averaged_over_mm: float


class ComparisonRecord(Table):
    """Candidates side by side."""

    results: list[str]
    labels: list[str]
    parameters: dict[str, list[Any]]
    metrics: dict[str, list[Interval]]
    confidence_of_each_difference: float
    differences_to_first: dict[str, list[DifferenceRecord]]
    coverage_against_time: list[list[CoverageAtTime]]
    distributions: DistributionsRecord
    local_differences_to_first: list[LocalDifferenceRecord]


def comparison_record(
    comparison: Comparison, spread: Distributions, local: list[LocalDifference]
) -> ComparisonRecord:
    """The record of a comparison."""
    return ComparisonRecord(
        results=[str(result.folder) for result in comparison.results],
        labels=list(comparison.labels),
        parameters={name: list(values) for name, values in comparison.parameters.items()},
        metrics={name: list(values) for name, values in comparison.metrics.items()},
        confidence_of_each_difference=comparison.confidence,
        differences_to_first={
            name: [difference_record(gap) for gap in gaps]
            for name, gaps in comparison.differences.items()
        },
        coverage_against_time=[one.record.coverage_against_time for one in comparison.results],
        distributions=DistributionsRecord(
            coverage=_histogram(spread.coverage),
            normal_speed=_histogram(spread.speed),
            angle=_histogram(spread.angle),
            impacts=list(spread.impacts),
            mean_normal_speed_m_s=list(spread.mean_speed),
            mean_angle_deg=list(spread.mean_angle),
        ),
        local_differences_to_first=[
            LocalDifferenceRecord(
                share_more=one.more, share_less=one.less, averaged_over_mm=one.radius
            )
            for one in local
        ],
    )


def difference_record(gap: Difference) -> DifferenceRecord:
    """The record of one difference."""
    return DifferenceRecord(
        **gap.estimate.interval_json(),
        paired=gap.paired,
        real=gap.real,
        times_as_long=gap.time_ratio,
        replicas=gap.replicas,
    )


def _histogram(one: Histogram) -> HistogramRecord:
    shares = [share.tolist() for share in one.shares]
    return HistogramRecord(unit=one.unit, edges=one.edges.tolist(), shares=shares)

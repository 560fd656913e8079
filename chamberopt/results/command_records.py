"""Define the content of the JSON files of the commands strip, calibrate, accuracy and compare.

A record is the whole content of a JSON file. The program writes these files and never reads them.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chamberopt.common.files import write_text
from chamberopt.common.record_types import Interval, Table, WholeEstimate
from chamberopt.common.versions import versions
from chamberopt.peening.kirk_fit import MULTIPLES
from chamberopt.results.records import CoverageAtTime

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
    """Write a record as a JSON file at `path`."""
    write_text(path, json.dumps(record.as_json(), indent=2, allow_nan=False) + "\n")


class ArcHeight(Table):
    """The arc height of a virtual Almen strip after a multiple of its saturation time."""

    times_saturation: float
    time_s: float
    arc_height: float
    half_width: float
    unit: str


class KirkFitRecord(Table):
    """A saturation curve fitted to five arc heights of a strip: constants a, b, c and intensity.

    The formula is in peening/kirk_fit.py.
    """

    a: float
    b: float
    c: float
    intensity: float
    saturation_time_s: float


class CurvePoint(Table):
    """A point of the drawn saturation curve: the arc height after one peening time."""

    time_s: float
    arc_height: float
    half_width: float


class StripRecord(Table):
    """The content of strip.json: a simulated Almen strip. Arc heights and intensity are in `unit`.

    Args:
        type: type of the strip.
        place: where in the chamber the strip lies.
        calibrated: True if the arc heights come from a calibrated model.
        fits: fitted saturation curves, by the number of their parameters.
    """

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
    """Return the content of strip.json for a simulated Almen strip."""
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
    """A calibrated parameter: mean and standard deviation of its logarithm, before and after
    the calibration.
    """

    log_mean_before: float
    log_sd_before: float
    log_mean: float
    log_sd: float


class MisfitRecord(Table):
    """The misfit between the model and all measurements of one kind.

    Args:
        chi2: sum of squared deviations, each divided by its standard deviation before squaring.
        values: number of measured values.
        error_scale: factor by which the stated errors were widened to explain the misfit.
        explained: True if no widening was needed.
    """

    kind: str
    chi2: float
    values: int
    error_scale: float
    explained: bool


class MeasuredRecord(Table):
    """Measurements of one kind in one set-up, each with the calibrated model's prediction."""

    kind: str
    label: str
    at: list[float]
    log_measured: list[float]
    log_predicted: list[float]
    log_sd_measured: list[float]
    log_sd_predicted: list[float]


class PredictionRecord(Table):
    """A figure that the model predicts for the design, with standard deviations of its logarithm.

    Args:
        log_sd_before: before the calibration.
        log_sd: after the calibration.
        log_noise: by the noise of the simulations alone.
        next_measurement: the measurement that would leave the least standard deviation.
        log_sd_after_next: the standard deviation that it would leave.
    """

    value: float
    log_sd_before: float
    log_sd: float
    log_noise: float
    next_measurement: str
    log_sd_after_next: float


class CalibrationRecord(Table):
    """The content of calibration.json: a calibration of the model to one peening machine.

    `machine` is the content of machine.toml.
    """

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
    """Return the content of calibration.json: a calibration and its predictions."""
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
    """The settings of the reference, a run with which an accuracy study compares its others."""

    text: str
    settings: dict[str, Any]


class ErrorLawRecord(Table):
    """The fitted curve error = scale · cost^-power. `power_half_width`: null if infinite."""

    scale: float
    power: float
    power_half_width: float | None


class HalvingRecord(Table):
    """The factor `times` in cost that halves the error, with its interval from low to high.

    The numbers are null if the batches of replicas do not tell it.
    """

    times: float | None
    low: float | None
    high: float | None
    text: str


class RecommendationRecord(Table):
    """The recommended settings for one wanted accuracy. `replicas`: 0 if it cannot be reached."""

    accuracy: float
    settings: dict[str, Any]
    replicas: int
    cpu_s: float | None
    remarks: list[str]
    lines: list[str]


class ConvergenceRecord(Table):
    """The content of accuracy.json: how the error of coverage falls with the simulation's cost.

    Each row holds the settings and the errors of a simulation, or of some of its replicas.
    """

    format: int
    reference: ReferenceRecord
    rows: list[dict[str, Any]]
    law: ErrorLawRecord | None
    halving: HalvingRecord
    recommendations: list[RecommendationRecord]
    left_out: list[str]
    cpu_s: float
    wall_s: float
    design: dict[str, Any]
    versions: dict[str, str]


class DifferenceRecord(Table):
    """A figure of a later candidate minus the same figure of the first candidate, with the number
    of replicas that would prove the difference.


    Args:
        paired: True if replicas were compared pair by pair, on the same seeds, as they correlate.
        real: True if the difference is larger than its half-width.
        times_as_long: factor in simulated time with which the difference would be real.
        replicas: number of replicas with which the difference would be real.
    """

    value: float | None
    half_width: float | None
    in_words: str = ""
    paired: bool
    real: bool
    times_as_long: float | None
    replicas: int | None


class HistogramRecord(Table):
    """Histograms with common bins: for each candidate, the share of its values in each bin."""

    unit: str
    edges: list[float]
    shares: list[list[float]]


class DistributionsRecord(Table):
    """Histograms of coverage, impact speed and impact angle on the target, for all candidates.

    Means are null for a candidate without impacts.
    """

    coverage: HistogramRecord
    normal_speed: HistogramRecord
    angle: HistogramRecord
    impacts: list[int]
    mean_normal_speed_m_s: list[float | None]
    mean_angle_deg: list[float | None]


class LocalDifferenceRecord(Table):
    """Shares of the target where a later candidate has more or less coverage than the first.

    A point of the target counts only if its difference is more than noise. `averaged_over_mm` is
    the largest radius of the discs over which coverage is averaged there.
    """

    share_more: float
    share_less: float
    averaged_over_mm: float


class ComparisonRecord(Table):
    """The content of compare.json: figures of candidates and differences from the first."""

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
    """Return the content of compare.json.

    Args:
        comparison: figures and their differences.
        spread: histograms over the target.
        local: coverage of each later candidate minus coverage of the first, at each vertex.
    """
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
                share_more=one.more, share_less=one.less, averaged_over_mm=one.radii[1]
            )
            for one in local
        ],
    )


def difference_record(gap: Difference) -> DifferenceRecord:
    """Return a difference between two candidates in the form in which compare.json stores it."""
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

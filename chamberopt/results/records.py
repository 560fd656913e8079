"""Define the typed content of result.json, the record of a result.

Code that writes result.json and code that reads it share these classes. A folder may come from
another person, and its digests only prove that it is complete. The type of every value is therefore
checked before any value is used.
"""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, TypeAlias

from pydantic import (
    AfterValidator,
    ConfigDict,
    Field,
    ValidationError,
    field_serializer,
    model_serializer,
    model_validator,
)

from chamberopt.common.errors import InputError, first_wrong_value
from chamberopt.common.estimate import Estimate
from chamberopt.common.record_types import Interval, KnownInterval, Positive, Table, WholeEstimate
from chamberopt.coverage.metrics import METRICS, find_metric, parse_objective
from chamberopt.peening.range_result import RangeResult, RivalAtEnds
from chamberopt.peening.tolerance_result import ToleranceResult
from chamberopt.search.study.parameters import bound_at

FORMAT = 9
ROUNDING = 1e-9
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Count = Annotated[int, Field(ge=0)]
Digest = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
FileName = Annotated[str, Field(pattern=r"^[^/\\:]+$")]  # no path to another folder
Bounds = Annotated[list[float], Field(min_length=2, max_length=2)]
Texts = Annotated[list[str], Field(min_length=1)]
Curve = Annotated[list[float], Field(min_length=1)]


def _dated(text: str) -> str:
    datetime.fromisoformat(text)  # ValueError for any other text
    return text


if TYPE_CHECKING:
    Ends: TypeAlias = list[float | str]
else:
    Ends = Bounds | Texts  # bounds of a number, or the allowed texts


def _with_units(metrics: dict[str, Estimate]) -> dict[str, dict[str, object]]:
    """Return metrics by name as JSON values, each with its unit."""

    def unit(name: str) -> str:
        metric = find_metric(name)
        return metric.unit if metric else ""

    return {name: {**one.to_json(), "unit": unit(name)} for name, one in metrics.items()}


class Objective(Table):
    """The objective: the metric, or sum of metrics, that a study maximises, with its estimate."""

    name: str
    estimate: WholeEstimate

    @model_validator(mode="before")
    @classmethod
    def _of_one_table(cls, data: object) -> object:
        if isinstance(data, dict) and "estimate" not in data:
            return {"name": data.get("name"), "estimate": data}
        return data

    @model_validator(mode="after")
    def _is_an_objective(self) -> Self:
        try:
            parse_objective(self.name)
        except InputError as error:
            raise ValueError(str(error)) from None
        return self

    @model_serializer
    def _as_one_table(self) -> dict[str, object]:
        return {"name": self.name, **self.estimate.to_json(), "unit": ""}


class Needed(Table):
    mean_and_std: Positive | None
    p05_times_intensity: Positive | None


class FieldRecord(Table):
    gauge_mm2: Positive
    points: Count
    dents_in_median_window: Positive
    dents_needed: Needed
    simulated_s_needed: Needed
    reachable_share: float
    crease_share: float
    alike_places: Annotated[int, Field(ge=1)]
    double_gauge: dict[str, WholeEstimate]

    _units = field_serializer("double_gauge")(_with_units)


class CoverageAtTime(Table):
    """Coverage of the target after one peening time: mean and 5th percentile over its area."""

    time_s: Positive
    mean_coverage: Share
    half_width: Positive
    p05_coverage: Share | None = None
    p05_half_width: Positive | None = None


class ZoneLimit(Table):
    key: str
    limit: float
    metric: str
    standing: Literal["met", "not met", "not known"]


class ZoneRecord(Table):
    """A zone of the part, with the limits that the design sets for it and whether they are met."""

    name: str
    triangles: Count
    exposed_area_mm2: Positive
    reachable_share: Share
    limits: list[ZoneLimit]


class ProfileRecord(Table):
    """Mean residual stress under a surface, by depth; compression is negative.

    half_width_MPa: of the 95 % interval by the scatter of the replicas; empty if there is none.
    eigenstrain: strain in both directions of the surface that would leave this stress.
    """

    depth_um: Curve
    stress_MPa: Curve  # noqa: N815
    half_width_MPa: list[Positive]  # noqa: N815
    eigenstrain: Curve

    @model_validator(mode="after")
    def _is_as_long(self) -> Self:
        if len({len(self.depth_um), len(self.stress_MPa), len(self.eigenstrain)}) > 1:
            raise ValueError("curves of different lengths")
        if len(self.half_width_MPa) not in (0, len(self.depth_um)):
            raise ValueError("half_width_MPa: of another length")
        return self


class StressRecord(Table):
    """Residual stress under the peened surface, by an estimate.

    thickness_mm: of the plate in which it is; None for a thick part.
    peened: how the plate is peened and held.
    bands: factor by which the law may be wrong in each figure, more or less.
    profiles: under the target, by the name "the target", and under zones.
    """

    thickness_mm: Positive | None
    peened: str
    bands: dict[str, Annotated[float, Field(ge=1.0)]]
    profiles: dict[str, ProfileRecord]


class FixtureRecord(Table):
    """A holder or a mask.

    size_mm: a diameter, two sides, or the thickness of a shell.
    length_mm: length in the room along its axis, 0 for a shell.
    place_mm: middle of a holder's end at the part, in the chamber's frame.
    covered_mm2: area of the part under it, of which covered_target_mm2 is on the target.
    """

    kind: str
    size_mm: list[Positive]
    length_mm: Positive
    covered_mm2: float
    covered_target_mm2: float
    place_mm: list[float] | None = None


class ChamberRecord(Table):
    """Volume, target and mesh of the chamber that was simulated.

    pieces_in_air: number of pieces of the part that reach no wall.
    fixtures: "holder" and "mask", if there are any.
    facets_left: True if coarse triangles in place of a curved surface decide the coverage.
    """

    volume_mm3: Positive
    target_exposed_area_mm2: Positive
    target_triangles: Count
    pieces_in_air: Count
    facets_left: bool
    fixtures: dict[str, FixtureRecord] = Field(default_factory=dict)


class TrappedRecord(Table):
    """Balls that hopped on one spot or rattled in a gap, as means over the replicas.

    Args:
        hopping_time, rattling_time: share of the balls times recorded time.
        hopping_impacts, rattling_impacts: share of all impacts on the part. Those of rattling balls
            are in no figure.
        hopping_at_end: share of the balls that hopped on one spot at the end.
        rattling_balls: share of the balls that rattled in a gap at some time; None if not known, as
            in results whose figures still have the impacts of rattling balls.
        rattling_longest: share of the recorded time in which the ball held longest was held.
        place: surfaces and position of the gap whose balls hit the part most often; "" if none.
    """

    hopping_time: Share
    hopping_impacts: Share
    hopping_at_end: Share
    rattling_time: Share
    rattling_impacts: Share
    rattling_balls: Share | None = None
    rattling_longest: Share | None = None
    place: str = ""


class AdviceRecord(Table):
    """Whether pilot runs advise to simulate an optional physical effect, and the reason.

    Args:
        effect: name of the effect.
        on: True if it should be simulated.
        verdict: the advice in a few words.
        said: the advice as one text.
        changes: change of each figure, such as mean coverage, if the effect is simulated.
    """

    effect: str
    on: bool
    verdict: str
    said: str
    changes: dict[str, Interval]


class SliceRecord(Table):
    """How the score of a design depends on one parameter, by the model fitted to a study.

    Args:
        flat: range (or texts) of the parameter in which the loss of score is within the noise.
        choices: allowed texts, for a parameter that is a choice.
        share_of_variance: share of the score's variance that this parameter explains.
        values: values of the parameter at which the curves are given.
        mean: score at each value, with the other parameters as in the best design.
        half_width: half-width of the score's interval at each value.
        main_effect: score at each value, averaged over the other parameters.
        or_worse: True at values where `mean` is only an upper limit of the score.
    """

    flat: Ends
    choices: list[str] = Field(default_factory=list)
    share_of_variance: float
    values: Curve
    mean: Curve
    half_width: Curve
    main_effect: Curve
    or_worse: list[bool]

    @model_validator(mode="after")
    def _is_as_long(self) -> Self:
        curves = (self.values, self.mean, self.half_width, self.main_effect, self.or_worse)
        if len({len(one) for one in curves}) > 1:
            raise ValueError("curves of different lengths")
        return self


class ModelRecord(Table):
    noise: float
    expected: KnownInterval
    together: float
    parameters: dict[str, SliceRecord]


class CandidatePoint(Table):
    parameters: dict[str, int | float | str]


class BestRecord(CandidatePoint):
    searched_as: int | None = None


class FrontPoint(CandidatePoint):
    standing: str
    objectives: dict[str, Interval]


class ViolationRecord(Table):
    """A constraint that a candidate violates, certainly or possibly: its figure and a text."""

    figure: str
    text: str


class ConfirmedRecord(CandidatePoint):
    searched_as: int | None
    objective: WholeEstimate
    feasible: bool
    standing: str
    violations: list[ViolationRecord]


class StartRecord(CandidatePoint):
    objective: WholeEstimate
    metrics: dict[str, WholeEstimate]

    _units = field_serializer("metrics")(_with_units)


class AccuracyRecord(Table):
    """How accurately a candidate was simulated: the table process.accuracy of its design."""

    model_config = ConfigDict(extra="allow")

    replicas: Count
    simulated_time_s: Positive | None = None
    objective_half_width: Positive | None = None


class Accuracies(Table):
    search: AccuracyRecord
    confirm: AccuracyRecord


class StudyRecord(Table):
    algorithm: str
    vary: dict[str, Ends]
    evaluations: Count
    ended_early: Count
    ended_by: str | None = None  # why the search ended; None if not known
    possible_gain: Positive | None = None  # what was left to gain at most; None if not known
    counts: Positive = 0.0  # smallest gain that counts; 0 if any does
    accuracy: Accuracies
    failed: Count
    missing_a_constraint: Count
    gain: WholeEstimate
    improved: bool
    notes: list[str] = Field(default_factory=list)
    model: ModelRecord | None = None
    front: list[FrontPoint] = Field(default_factory=list)
    best: BestRecord
    start: StartRecord
    confirmed: list[ConfirmedRecord]
    at_ends: list[RivalAtEnds] = Field(default_factory=list)  # of what is not calibrated
    seconds: Positive

    @property
    def keeps_start(self) -> bool:
        """Whether the best design is the start, or surely gains less than counts."""
        is_start = self.best.parameters == self.start.parameters
        return is_start or max(self.gain.high, 0.0) < self.counts

    @property
    def on_bounds(self) -> list[str]:
        """Names of the parameters whose value in the best design lies on a bound of the search."""
        return [
            name for name, ends in self.vary.items() if bound_at(self.best.parameters[name], ends)
        ]

    @model_validator(mode="after")
    def _has_the_same_parameters(self) -> Self:
        candidates = self.best, self.start, *self.front, *self.confirmed
        names = [set(one.parameters) for one in candidates]
        modelled = set(self.model.parameters) if self.model else set()  # of the best chamber shape
        if any(one != set(self.vary) for one in names) or not modelled <= set(self.vary):
            raise ValueError("other parameters than vary")
        return self


class ResultRecord(Table):
    """The keys that each result.json has, of a simulation, a study or a sweep."""

    kind: Literal["simulation", "study", "sweep"]
    format: int
    created: Annotated[str, AfterValidator(_dated)]
    notes: list[str]
    warnings: list[str] | None = None  # of `chamberopt check`; None if it was not run
    effects: list[AdviceRecord] = Field(default_factory=list)
    files: dict[FileName, Digest]
    versions: dict[str, str]
    sha256: str = ""  # of all other keys

    @model_validator(mode="after")
    def _is_of_a_version(self) -> Self:
        if "chamberopt" not in self.versions:
            raise ValueError("versions: chamberopt is missing")
        return self


class SweepFacts(Table):
    """The facts of a sweep: varied parameters, number of candidates, best candidate."""

    objective: str
    vary: dict[str, Ends]
    method: str
    count: int | None
    seed: int | None
    candidates: Count
    failed: Count
    missing_a_constraint: Count
    accuracy: AccuracyRecord
    best: dict[str, Any] | None
    seconds: Positive


class SweepRecord(ResultRecord):
    """The content of a sweep's result.json. Only its digests are read again."""

    sweep: SweepFacts


class CandidateRecord(ResultRecord):
    """The content of result.json for a simulation, or for a study with its best design."""

    REQUIRED: ClassVar = [name for name, metric in METRICS.items() if metric.required]

    objective: Objective
    metrics: dict[str, WholeEstimate]
    zones: list[ZoneRecord] = Field(default_factory=list)
    # Share of the target that a ball can touch in each step, by its name; None without steps.
    steps: dict[str, Share] | None = None
    field: FieldRecord
    coverage_against_time: list[CoverageAtTime]
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)]
    stream: str
    replicas: Annotated[int, Field(ge=1, le=1_000_000)]
    stopped_by: str
    analytic: bool
    simulated_time_s: Positive
    collisions: dict[str, Count]
    timings_s: dict[str, Positive]
    trapped: TrappedRecord | None = None  # None if not known
    # Share by which the target was dented more in the first halves of the replicas: the shot had
    # not settled. None if it had, or it is not known.
    first_half_excess: float | None = None
    chamber: ChamberRecord
    design: dict[str, Any]
    part_sha256: Digest
    part_unit: str
    shape_sha256: Digest | Literal[""] = ""
    study: StudyRecord | None = None
    tolerances: ToleranceResult | None = None
    ranges: RangeResult | None = None  # None if nobody has simulated them
    stress: StressRecord | None = None  # None if the design does not ask for it

    _units = field_serializer("metrics")(_with_units)

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        if missing := [name for name in self.REQUIRED if name not in self.metrics]:
            raise ValueError(f"metrics: {missing[0]} is missing")
        limited = {limit.metric for zone in self.zones for limit in zone.limits}
        if missing := sorted(limited - self.metrics.keys()):
            raise ValueError(f"zones: {missing[0]} is limited and not among the metrics")
        if unknown := [name for name in self.field.double_gauge if not find_metric(name)]:
            raise ValueError(f"field.double_gauge: {unknown[0]!r} is no metric")
        if (self.kind == "study") != (self.study is not None):
            raise ValueError(f"study: belongs to a study, and this is a {self.kind}")
        for name, found in self.metrics.items():
            metric = find_metric(name)
            value = found.value or 0.0
            if metric and not metric.lowest - ROUNDING <= value <= metric.highest + ROUNDING:
                limits = f"{metric.lowest:g} to {metric.highest:g}"
                raise ValueError(f"metrics.{name}: given {value:g}, possible {limits}")
        return self


def read_record(data: dict[str, object]) -> ResultRecord:
    """Return the checked content of a result.json. Raise ValueError that names a wrong key."""
    model = ResultRecord if data.get("kind") == "sweep" else CandidateRecord
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise ValueError(first_wrong_value(error)) from None

"""What a result.json must hold: every key that commands read, with the types of all values.

A result comes from elsewhere, and its digests tell only that it is whole. Nothing of it is used
before this has found it as `write.py` makes it.
"""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from chamberopt.common.errors import InputError, first_wrong_value
from chamberopt.coverage.metrics import METRICS, find_metric, parse_objective

ROUNDING = 1e-9
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Positive = Annotated[float, Field(ge=0.0)]
Count = Annotated[int, Field(ge=0)]
Digest = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
FileName = Annotated[str, Field(pattern=r"^[^/\\:]+$")]  # in the folder itself
Bounds = Annotated[list[float], Field(min_length=2, max_length=2)]
Texts = Annotated[list[str], Field(min_length=1)]
Curve = Annotated[list[float], Field(min_length=1)]


def _dated(text: str) -> str:
    datetime.fromisoformat(text)  # ValueError for any other text
    return text


class _Table(BaseModel):
    """A table of result.json; further keys are no fault."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)


class _Interval(_Table):
    """A value and its half-width; null where there is none, with words in its place."""

    value: float | None
    half_width: Positive | None
    in_words: str = ""


class _Known(_Interval):
    """An interval that has a value, and a half-width unless words stand in its place."""

    @model_validator(mode="after")
    def _is_known(self) -> Self:
        if self.value is None or (self.half_width is None and not self.in_words):
            raise ValueError("an estimate without a value or half_width")
        return self


class _Estimate(_Known):
    pseudovalues: list[float]
    bias: float | None  # none if infinite, where there is no dent at all
    shared: list[float]


class _Objective(_Estimate):
    name: str

    @model_validator(mode="after")
    def _is_an_objective(self) -> Self:
        try:
            parse_objective(self.name)
        except InputError as error:
            raise ValueError(str(error)) from None
        return self


class _Needed(_Table):
    mean_and_std: Positive | None
    p05_times_intensity: Positive | None


class _Field(_Table):
    gauge_mm2: Positive
    points: Count
    dents_in_median_window: Positive
    dents_needed: _Needed
    simulated_s_needed: _Needed
    reachable_share: float
    crease_share: float
    alike_places: Annotated[int, Field(ge=1)]
    double_gauge: dict[str, _Estimate]


class _AtTime(_Table):
    """One row of the coverage against time."""

    time_s: Positive
    mean_coverage: Share
    half_width: Positive
    p05_coverage: Share | None = None
    p05_half_width: Positive | None = None


class _ZoneLimit(_Table):
    key: str
    limit: float
    metric: str
    standing: Literal["met", "not met", "not known"]


class _Zone(_Table):
    """A zone of the part, and whether its figures meet its limits."""

    name: str
    triangles: Count
    exposed_area_mm2: Positive
    reachable_share: Share
    limits: list[_ZoneLimit]


class _Chamber(_Table):
    volume_mm3: Positive
    target_exposed_area_mm2: Positive
    target_triangles: Count


class _Advice(_Table):
    """Why an effect was chosen by pilot runs."""

    effect: str
    on: bool
    verdict: str
    said: str
    changes: dict[str, _Interval]


class _Slice(_Table):
    """The model of a study's score along one parameter."""

    flat: Bounds | Texts
    choices: list[str] = []
    share_of_variance: float
    values: Curve
    mean: Curve
    half_width: Curve
    main_effect: Curve
    or_worse: list[bool] | None = None  # results before 0.2 lack it

    @model_validator(mode="after")
    def _is_as_long(self) -> Self:
        curves = (self.values, self.mean, self.half_width, self.main_effect, self.or_worse)
        if len({len(one) for one in curves if one is not None}) > 1:
            raise ValueError("curves of different lengths")
        return self


class _Model(_Table):
    noise: float
    expected: _Known
    together: float
    parameters: dict[str, _Slice]


class _Candidate(_Table):
    parameters: dict[str, float | str]


class _FrontPoint(_Candidate):
    standing: str
    objectives: dict[str, _Interval]


class _Confirmed(_Candidate):
    searched_as: int | None
    objective: _Estimate
    feasible: bool
    standing: str
    reason: str


class _Start(_Candidate):
    objective: _Estimate
    metrics: dict[str, _Estimate]


class _Accuracy(_Table):
    replicas: Count
    simulated_time_s: Positive | None = None
    objective_half_width: Positive | None = None


class _Accuracies(_Table):
    search: _Accuracy
    confirm: _Accuracy


class _Study(_Table):
    algorithm: str
    vary: dict[str, Bounds | Texts]
    evaluations: Count
    given_up: Count = 0
    accuracy: _Accuracies
    failed: Count
    missing_a_constraint: Count
    gain: _Estimate
    improved: bool
    notes: list[str] = []
    model: _Model | None = None
    front: list[_FrontPoint] = []
    best: _Candidate
    start: _Start
    confirmed: list[_Confirmed]
    seconds: Positive

    @model_validator(mode="after")
    def _has_the_same_parameters(self) -> Self:
        candidates = self.best, self.start, *self.front, *self.confirmed
        names = [set(one.parameters) for one in candidates]
        modelled = set(self.model.parameters) if self.model else set()  # those of the best's shape
        if any(one != set(self.vary) for one in names) or not modelled <= set(self.vary):
            raise ValueError("other parameters than vary")
        return self


class _Range(_Table):
    """A number with a tolerance, and the value at which it was simulated too."""

    low: float
    nominal: float
    high: float
    changed_to: float


class _Ends(_Table):
    low: _Known
    high: _Known


class _InCorner(_Table):
    predicted: _Known
    simulated: _Known
    agrees: bool


class _ToleratedFigure(_Table):
    nominal: _Known
    q05: _Known
    q95: _Known
    lowest: _Known
    highest: _Known
    effects: dict[str, _Ends]
    corner: _InCorner | None


class _Tolerances(_Table):
    """Figures over the box of tolerances."""

    box: dict[str, _Range]
    worst_for: str
    corner: dict[str, float]
    figures: dict[str, _ToleratedFigure]
    notes: list[str]

    @model_validator(mode="after")
    def _is_of_one_box(self) -> Self:
        of_numbers = [set(one.effects) for one in self.figures.values()]
        of_numbers += [set(self.corner)] if self.corner else []
        if not self.box or any(one != set(self.box) for one in of_numbers):
            raise ValueError("other numbers than those of the box")
        if self.worst_for and self.worst_for not in self.figures:
            raise ValueError(f"worst_for: {self.worst_for!r} is none of the figures")
        return self


class _Any(_Table):
    """Any result."""

    kind: Literal["simulation", "study", "sweep"]
    created: Annotated[str, AfterValidator(_dated)]
    notes: list[str]
    warnings: list[str] = []
    effects: list[_Advice] = []
    files: dict[FileName, Digest]
    versions: dict[str, str]

    @model_validator(mode="after")
    def _is_of_a_version(self) -> Self:
        if "chamberopt" not in self.versions:
            raise ValueError("versions: chamberopt is missing")
        return self


class _Candidates(_Any):
    """The result of a candidate: a simulation, or the best of a study."""

    REQUIRED: ClassVar = [name for name, metric in METRICS.items() if metric.required]

    objective: _Objective
    metrics: dict[str, _Estimate]
    zones: list[_Zone] = []
    field: _Field
    coverage_against_time: list[_AtTime]
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)]
    stream: str
    replicas: Annotated[int, Field(ge=1, le=1_000_000)]
    stopped_by: str
    analytic: bool
    simulated_time_s: Positive
    collisions: dict[str, Positive]
    timings_s: dict[str, Positive]
    chamber: _Chamber
    design: dict[str, Any]
    part_sha256: Digest
    part_unit: str
    shape_sha256: Digest | Literal[""] = ""
    study: _Study | None = None
    tolerances: _Tolerances | None = None

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


def require_recorded(data: dict[str, Any]) -> None:
    """Raise ValueError, which names the key, unless commands can use all of a result.json."""
    model = _Any if data.get("kind") == "sweep" else _Candidates
    try:
        model.model_validate(data)
    except ValidationError as error:
        raise ValueError(first_wrong_value(error)) from None

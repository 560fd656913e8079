"""A study's own tables: what may vary, what is sought, what must hold, and the budget."""

from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import BaseModel, BeforeValidator, Field, model_validator

from chamberopt.common import toml_errors
from chamberopt.common.errors import InputError
from chamberopt.common.toml_errors import CrossCheckError, Problem
from chamberopt.common.toml_fields import list_field, quantity
from chamberopt.coverage.metrics import METRICS, OBJECTIVES, RENAMED_OBJECTIVES, renamed_objective
from chamberopt.design.design import Design, validate
from chamberopt.design.table import STRICT


def _refuse_old_name(name: Any) -> Any:
    if isinstance(name, str) and name in RENAMED_OBJECTIVES:
        raise CrossCheckError([Problem("", renamed_objective(name))])
    return name


if TYPE_CHECKING:
    ObjectiveName = str
else:
    ObjectiveName = Annotated[Literal[tuple(OBJECTIVES)], BeforeValidator(_refuse_old_name)]
# NLopt's own names without the "NLOPT_" prefix, and two phases that are none of them: points spread evenly, and a model
# of the scores on which NLopt looks for the next; "auto" is these two, one after the other.
Algorithm = Literal[
    "auto",
    "sobol",
    "surrogate",
    "GN_DIRECT_L",
    "GN_DIRECT_L_RAND",
    "GN_ORIG_DIRECT_L",
    "GN_MLSL_LDS",
    "GN_CRS2_LM",
    "GN_ISRES",
    "GN_ESCH",
    "GN_AGS",
    "LN_BOBYQA",
    "LN_COBYLA",
    "LN_SBPLX",
    "LN_NELDERMEAD",
    "LN_PRAXIS",
]


class Objective(BaseModel):
    """What is maximised: one objective by name, a weighted sum, or two at once."""

    model_config = STRICT

    name: ObjectiveName = Field(default="uniform_coverage", description="what is maximised")
    sum: dict[str, float] = Field(
        default_factory=dict,
        description="of objectives and metrics, in place of a name",
        json_schema_extra={
            "form": "{ NAME = WEIGHT, ... }, e.g. { uniform_coverage = 1.0, time_to_98_s = -0.001 }"
        },
    )
    pareto: Annotated[tuple[ObjectiveName, ObjectiveName], Field(strict=False)] | None = list_field(
        'two names, e.g. ["uniform_coverage", "minus_time_to_98_s"]',
        "two objectives at once, in place of a name",
        None,
    )

    @model_validator(mode="after")
    def _agree(self) -> Self:
        names = (*OBJECTIVES, *METRICS)
        problems = [
            Problem(
                f"sum.{name}",
                renamed_objective(name)
                if name in RENAMED_OBJECTIVES
                else f"not an objective or a metric; {toml_errors.did_you_mean(name, names)}",
            )
            for name in self.sum
            if name not in names
        ]
        if self.sum and not any(self.sum.values()):
            problems.append(Problem("sum", "all weights are 0; give one another value"))
        if self.pareto and self.pareto[0] == self.pareto[1]:
            problems.append(
                Problem("pareto", f"given {self.pareto[0]} twice; give two different objectives")
            )
        given = [self.name != "uniform_coverage", bool(self.sum), self.pareto is not None]
        if given.count(True) > 1:
            problems.append(Problem("", "more than one of name, sum and pareto; give one"))
        if problems:
            raise CrossCheckError(problems)
        return self

    @property
    def goals(self) -> tuple[str, ...]:
        """Names as objective.objective() takes them: one, or the two of a Pareto front."""
        if self.sum:
            return (" + ".join(f"{weight:.10g} {name}" for name, weight in self.sum.items()),)
        return self.pareto or (self.name,)


class Limits(BaseModel):
    """What a metric must stay within."""

    model_config = STRICT

    min: float | None = Field(default=None, description="least value allowed")
    max: float | None = Field(default=None, description="largest value allowed")

    @model_validator(mode="after")
    def _agree(self) -> Self:
        if self.min is None and self.max is None:
            raise CrossCheckError([Problem("", "empty; give min, max or both, e.g. { min = 0.9 }")])
        if self.min is not None and self.max is not None and self.min > self.max:
            raise CrossCheckError([Problem("min", f"given {self.min:g}, above max = {self.max:g}")])
        return self


class Phase(BaseModel):
    """A part of a search."""

    model_config = STRICT

    algorithm: Algorithm = Field(
        description='"sobol", "surrogate" or an NLopt name without its prefix'
    )
    share: float = quantity(
        0.001, 1, "of the evaluations", "the last phase has what the others leave", 1.0
    )

    @model_validator(mode="after")
    def _agree(self) -> Self:
        if self.algorithm == "auto":
            raise CrossCheckError(
                [Problem("algorithm", 'given "auto", which is phases itself; leave phases out')]
            )
        return self


class Optimizer(BaseModel):
    """How the best design is sought, and with what budget."""

    model_config = STRICT

    algorithm: Algorithm = Field(
        default="auto", description="auto, sobol, surrogate, or an NLopt name without prefix"
    )
    phases: Annotated[tuple[Phase, ...], Field(strict=False)] = list_field(
        "a table [[optimizer.phases]] each",
        "several algorithms one after another, in place of one",
        (),
    )
    initial_step: float = quantity(
        0.001, 1, "of the bounds", "first step of local algorithms", 0.15
    )
    tolerance: float = quantity(
        1e-6, 0.5, "of the bounds", "step at which local algorithms end", 0.02
    )
    evaluations: int = Field(
        default=40, ge=2, le=1000000, description="designs simulated while searching"
    )
    seed: int = Field(
        default=1, ge=0, le=2**31 - 1, description="of the search's own random numbers"
    )
    confirm: int = Field(
        default=3, ge=1, le=1000, description="best candidates simulated again on fresh seeds"
    )
    confirm_replicas: int = Field(
        default=16, ge=3, le=100000, description="replicas of each confirmation"
    )
    first_replicas: int = Field(
        default=4,
        ge=0,
        le=100000,
        description="after so many a candidate plainly worse than the best gets no more; 0: all",
    )
    confirm_rounds: int = Field(
        default=2,
        ge=1,
        le=10,
        description="while the best cannot be told apart: again, each time with twice the replicas",
    )

    @model_validator(mode="after")
    def _agree(self) -> Self:
        problems = []
        if 0 < self.first_replicas < 3:
            text = f"given {self.first_replicas}; 3 is the least that gives an interval, 0 gives all of them to each"
            problems.append(Problem("first_replicas", text))
        if self.phases and self.algorithm != "auto":
            problems.append(
                Problem(
                    "phases", f"given beside algorithm = {self.algorithm!r}; give one of the two"
                )
            )
        if sum(phase.share for phase in self.phases[:-1]) >= 1.0:
            problems.append(
                Problem(
                    "phases", "the shares before the last phase add up to 1 or more; lower them"
                )
            )
        if problems:
            raise CrossCheckError(problems)
        return self


class Study(BaseModel):
    """A design, what may vary in it, what is sought, and the budget.

    `vary` maps a dotted design parameter to (low, high) in the file's units.
    """

    model_config = STRICT

    design: Design = Field(description="the start")
    vary: dict[str, Annotated[tuple[float, float], Field(strict=False)]] = Field(
        min_length=1,
        description='e.g. "chamber.height_mm" = [35, 60]',
        json_schema_extra={"form": "[low, high]"},
    )
    objective: Objective = Field(default_factory=Objective)
    constraints: dict[str, Limits] = Field(
        default_factory=dict,
        description="METRIC = { min =, max = }, or a number of the design in quotes",
    )
    optimizer: Optimizer = Field(default_factory=Optimizer)
    search_accuracy: dict[str, int | float | str] = Field(
        default_factory=dict,
        description="while searching, in place of the design's own: keys of [process.accuracy], and facets",
        json_schema_extra={"form": "a number or a text"},
    )

    def at_search_accuracy(self, design: Design) -> Design:
        """A candidate at the accuracy of the search. Raises InputError for a draft that cannot be."""
        data = design.model_dump()
        for name, value in self.search_accuracy.items():
            table = data["chamber"] if name == "facets" else data["process"]["accuracy"]
            table[name] = value
        return validate(Design, data)

    @model_validator(mode="after")
    def _agree(self) -> Self:
        problems = [
            p
            for name, bounds in self.vary.items()
            for p in _vary_problems(self.design, name, bounds)
        ]
        for name, limits in self.constraints.items():
            problems += [
                Problem(f"constraints.{name}", text)
                for text in self._constraint_problems(name, limits)
            ]
        phases = [phase.algorithm for phase in self.optimizer.phases] or [self.optimizer.algorithm]
        if self.objective.pareto and not {"auto", "sobol", "surrogate"}.issuperset(phases):
            text = "given two objectives, which only auto, sobol and surrogate can search"
            problems.append(Problem("objective.pareto", text))
        problems += self._search_accuracy_problems()
        if problems:
            raise CrossCheckError(problems)
        return self

    def _constraint_problems(self, name: str, limits: Limits) -> list[str]:
        """No figure of a candidate, or one that no candidate can have: better said before the search than after it."""
        numbers = self.design.numbers()
        if name in METRICS:
            low, high = METRICS[name].lowest, METRICS[name].highest
        elif name in self.vary:
            low, high = self.vary[name]
        elif name in numbers:
            try:
                low = high = self.design.value(name)
            except InputError as error:
                return [str(error).removeprefix(f"{name}: ")]
        else:
            return [
                f"not a metric; {toml_errors.did_you_mean(name, (*METRICS, *(numbers if '.' in name else ())))}"
            ]
        within = f"{low:g}" if low == high else f"from {low:g} to {high:g}"
        remedy = f"but it is {within} in every candidate; change the limit{' or [vary]' if name in numbers else ''}"
        said = []
        if limits.min is not None and limits.min > high:
            said.append(f"given min = {limits.min:g}, {remedy}")
        if limits.max is not None and limits.max < low:
            said.append(f"given max = {limits.max:g}, {remedy}")
        return said

    def _search_accuracy_problems(self) -> list[Problem]:
        try:
            self.at_search_accuracy(self.design)
        except InputError as error:
            return [
                Problem(
                    "search_accuracy",
                    str(error).replace("process.accuracy.", "").replace("chamber.", ""),
                )
            ]
        return []


def _vary_problems(design: Design, name: str, bounds: tuple[float, float]) -> list[Problem]:
    """Why a design parameter cannot vary between these bounds."""
    field, (low, high), numbers = f"vary.{name}", bounds, design.numbers()
    try:
        start = design.value(name)
    except InputError as error:
        near = toml_errors.did_you_mean(name, numbers)
        return [
            Problem(
                field,
                str(error).removeprefix(f"{name}: ") if name in numbers else f"unknown; {near}",
            )
        ]
    if name.startswith("process.accuracy."):
        return [
            Problem(
                field, "not a choice of design, but of how well it is known; see [search_accuracy]"
            )
        ]
    if name not in numbers:
        return [Problem(field, "a whole number cannot vary; leave it out")]
    if low >= high:
        return [Problem(field, f"given [{low:g}, {high:g}]; low must be below high")]
    if not low <= start <= high:
        text = f"given [{low:g}, {high:g}], but the design starts at {start:g}"
        return [Problem(field, f"{text}; widen the bounds or change the design")]
    problems = []
    for bound in bounds:
        try:
            design.changed({name: bound})
        except InputError as error:
            problems.append(Problem(field, f"the design cannot have {name} = {bound:g}: {error}"))
    return problems

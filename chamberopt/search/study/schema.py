"""The tables of a study file: varied parameters, objective, constraints and budget."""

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field, ValidationInfo, model_validator

from chamberopt.common import toml_errors
from chamberopt.common.errors import InputError
from chamberopt.common.notebook import ShownInNotebook
from chamberopt.common.toml_errors import CrossCheckError, Problem
from chamberopt.common.toml_fields import Several, from_file, list_field, quantity
from chamberopt.coverage.metrics import (
    METRICS,
    OBJECTIVES,
    RENAMED_OBJECTIVES,
    find_metric,
    is_number,
    metric_problem,
    parse_objective,
    renamed_objective,
)
from chamberopt.design.design import SHAPE, Design
from chamberopt.design.load import load_design
from chamberopt.design.table_base import MAX_NAMES, FileTable
from chamberopt.search.study.constraints import Limits, limit_problems, zone_constraints
from chamberopt.search.study.parameters import (
    NONE,
    Vary,
    designs_by_shape,
    from_catalogue,
    has_key,
    setting,
    vary_problems,
    with_key,
)

LEAST_CONFIRMED = 4  # replicas, of which figures of strength take halves and quarters


def _refuse_old_name(name: object) -> object:
    if isinstance(name, str) and name in RENAMED_OBJECTIVES:
        raise CrossCheckError([Problem("", renamed_objective(name))])
    return name


if TYPE_CHECKING:
    ObjectiveName = str
else:
    ObjectiveName = Annotated[Literal[tuple(OBJECTIVES)], BeforeValidator(_refuse_old_name)]

# NLopt's names without the prefix "NLOPT_", and three of our own: evenly spread points, the model
# of the scores, and "auto", which is these two one after the other.
# fmt: off
Algorithm = Literal[
    "auto", "sobol", "surrogate",
    "GN_DIRECT_L", "GN_DIRECT_L_RAND", "GN_ORIG_DIRECT_L", "GN_MLSL_LDS", "GN_CRS2_LM",
    "GN_ISRES", "GN_ESCH", "GN_AGS",
    "LN_BOBYQA", "LN_COBYLA", "LN_SBPLX", "LN_NELDERMEAD", "LN_PRAXIS",
]
# fmt: on


LEAST_WEIGHT = 1e-9  # of a sum, and one over the largest: squares of scores stay numbers


class Objective(FileTable):
    """What is maximised: one objective by name, a weighted sum, or two at once."""

    name: ObjectiveName = Field(default="uniform_coverage", description="what is maximised")
    sum: dict[str, float] = Field(
        default_factory=dict,
        description="weighted sum of objectives, metrics and numbers in [vary], instead of a name",
        json_schema_extra={
            "form": "{ NAME = WEIGHT, ... }, e.g. { uniform_coverage = 1.0, time_to_98_s = -0.001 }"
        },
    )
    pareto: Annotated[tuple[ObjectiveName, ObjectiveName], Field(strict=False)] | None = list_field(
        'two names, e.g. ["uniform_coverage", "minus_time_to_98_s"]',
        "two objectives at once, instead of a name",
        None,
    )

    over_tolerances: Literal["mean", "worst"] = Field(
        default="mean", description="what counts over the design's [tolerances], by the model"
    )

    def _problems(self) -> Iterator[Problem]:
        names = (*OBJECTIVES, *METRICS)
        for name in self.sum:
            if name in RENAMED_OBJECTIVES:
                yield Problem(f"sum.{name}", renamed_objective(name))
            elif name not in names and not find_metric(name) and not is_number(name):
                text = f"not an objective or a metric; {toml_errors.did_you_mean(name, names)}"
                yield Problem(f"sum.{name}", text)
        for name, weight in self.sum.items():
            if weight and not LEAST_WEIGHT <= abs(weight) <= 1.0 / LEAST_WEIGHT:
                text = f"given {weight:g}; give 0, or a size from {LEAST_WEIGHT:g} to "
                yield Problem(f"sum.{name}", f"{text}{1.0 / LEAST_WEIGHT:g}")
        if self.sum and not any(self.sum.values()):
            yield Problem("sum", "all weights are 0; give one another value")
        if self.pareto and self.pareto[0] == self.pareto[1]:
            text = f"given {self.pareto[0]} twice; give two different objectives"
            yield Problem("pareto", text)
        given = [self.name != "uniform_coverage", bool(self.sum), self.pareto is not None]
        if given.count(True) > 1:
            yield Problem("", "more than one of name, sum and pareto; give one")

    @property
    def goals(self) -> tuple[str, ...]:
        """The study's objectives as texts: a name or a weighted sum, or two for a Pareto front."""
        if self.sum:
            return (" + ".join(f"{weight:.10g} {name}" for name, weight in self.sum.items()),)
        return self.pareto or (self.name,)

    @property
    def is_cost(self) -> bool:
        """Whether the first objective is minus what is to be small, such as a time."""
        return all(weight <= 0.0 for weight in parse_objective(self.goals[0]).terms.values())


class Phase(FileTable):
    """A phase of a search: an algorithm, and its share of the budget."""

    algorithm: Algorithm = Field(
        description='"sobol", "surrogate" or an NLopt name without its prefix'
    )
    share: float = quantity(
        0.001, 1, "of the evaluations", "the last phase gets what the others leave", 1.0
    )

    def _problems(self) -> Iterator[Problem]:
        if self.algorithm == "auto":
            text = 'given "auto", which has phases of its own; leave phases out'
            yield Problem("algorithm", text)


class Optimizer(FileTable):
    """The table [optimizer]: how to search for the best design, and with which budget."""

    algorithm: Algorithm = Field(
        default="auto", description="auto, sobol, surrogate, or an NLopt name without prefix"
    )
    phases: Several[Phase] = list_field(
        "a table [[optimizer.phases]] each",
        "several algorithms one after another, instead of one",
        (),
    )
    initial_step: float = quantity(
        0.001, 1, "of the bounds", "first step of local algorithms", 0.15
    )
    tolerance: float = quantity(
        1e-6, 0.5, "of the bounds", "step below which local algorithms stop", 0.02
    )
    evaluations: int = quantity(
        2, 1000000, "", "what the search may simulate, in candidates with all their replicas", 40
    )
    batch: int = quantity(
        1, 64, "", "candidates evaluated at a time, each proposed before the others have scores", 2
    )
    seed: int = quantity(0, 2**31 - 1, "", "seed of the search's own random numbers", 1)
    confirm: int = quantity(1, 1000, "", "best candidates simulated again with new seeds", 3)
    confirm_replicas: int = quantity(3, 100000, "", "replicas of each confirmation", 16)
    first_replicas: int = quantity(
        0,
        100000,
        "",
        "of a candidate, which gets all only if these do not tell its figures; 0: all to each",
        3,
    )
    confirm_rounds: int = quantity(
        1,
        10,
        "",
        "rounds of confirmation while the best are close, each with twice the replicas",
        2,
    )

    def _problems(self) -> Iterator[Problem]:
        if 0 < self.first_replicas < 3:
            text = f"given {self.first_replicas}; 3 is the least that gives an interval, 0 gives "
            yield Problem("first_replicas", f"{text}all replicas to each candidate")
        if self.phases and self.algorithm != "auto":
            text = f"given beside algorithm = {self.algorithm!r}; give one of the two"
            yield Problem("phases", text)
        if sum(phase.share for phase in self.phases[:-1]) >= 1.0:
            text = "the shares before the last phase add up to 1 or more; lower them"
            yield Problem("phases", text)


class Study(FileTable, ShownInNotebook):
    """A study: a design, its varied parameters, objective and constraints, and the budget.

    `vary` maps the dotted name of a parameter to the values it may have, in the units of the file.
    """

    RENAMED: ClassVar[dict[str, str]] = {"draft": "search_accuracy"}  # former names of keys

    design: Design = Field(
        description="design that the search starts from",
        json_schema_extra={"form": "the path of a design, relative to this file"},
    )
    vary: dict[str, Vary] = Field(
        min_length=1,
        max_length=MAX_NAMES,
        description='e.g. "chamber.height_mm" = [35, 60]',
        json_schema_extra={"form": "[low, high], { low =, high =, step = } or { choose = [...] }"},
    )
    objective: Objective = Field(default_factory=Objective)
    constraints: dict[str, Limits] = Field(
        default_factory=dict,
        max_length=MAX_NAMES,
        description="METRIC = { min =, max = }, or a number of the design in quotes",
    )
    optimizer: Optimizer = Field(default_factory=Optimizer)
    begin_with: Several[dict[str, float | str]] = list_field(
        "design files, or tables of the values of all names in [vary]",
        "candidates that are evaluated first, such as the best design for a similar part",
        (),
    )
    search_accuracy: dict[str, int | float | str] = Field(
        default_factory=dict,
        description="while searching, instead of the design's own: keys of [process.accuracy], "
        "and facets",
        json_schema_extra={"form": "a number or a text"},
    )

    @model_validator(mode="before")
    @classmethod
    def _look_up_sizes(cls, data: object) -> object:
        """Replace "catalogue" in [vary] by the ball sizes that are sold.

        So the study stays the same when the catalogue changes.
        """
        if not isinstance(data, Mapping) or not isinstance(data.get("vary"), Mapping):
            return data
        design = data.get("design")  # None where it has problems of its own
        material = design.shot.material if isinstance(design, Design) else "steel"
        return {**data, "vary": from_catalogue(data["vary"], material)}

    @model_validator(mode="before")
    @classmethod
    def _read_begin_with(cls, data: Any, info: ValidationInfo) -> object:
        """Replace the design files in `begin_with` by their values of the varied parameters.

        So the study is complete without these files.
        """
        given = data.get("begin_with") if isinstance(data, Mapping) else None
        if not isinstance(given, (list, tuple)) or not isinstance(data.get("vary"), Mapping):
            return data
        read = []
        for k, one in enumerate(given):
            if isinstance(one, str):
                try:
                    design = load_design(from_file(one, info.context))
                    one = {name: setting(design, name) for name in data["vary"]}
                except InputError as error:
                    raise CrossCheckError([Problem(f"begin_with.{k}", str(error))]) from None
            read.append(one)
        return {**data, "begin_with": read}

    @property
    def all_constraints(self) -> dict[str, Limits]:
        """Limits of the study and of its design's zones, by the limited metric or number."""
        return {**self.constraints, **zone_constraints(self.design)}

    @property
    def first_look(self) -> int | None:
        """Number of replicas that a candidate of the search gets if they tell its figures.

        It is None if each candidate gets all replicas: if these are no more, or if the study says
        so or asks for an accuracy of the search.
        """
        few, accuracy = self.optimizer.first_replicas, self.at_search_accuracy(self.design)
        is_asked = "objective_half_width" in self.search_accuracy
        return few if 0 < few < accuracy.process.accuracy.replicas and not is_asked else None

    @property
    def first_look_of_confirmation(self) -> int | None:
        """Number of replicas after which a confirmation ends if more would tell nothing.

        It is None if each confirmation gets all replicas: if the design asks for an accuracy of the
        objective or has a calibration, or if the study sets no such number.
        """
        few, design = self.optimizer.first_replicas, self.design
        wanted = design.process.accuracy.objective_half_width
        if not few or wanted is not None or design.calibration is not None:
            return None
        least = max(few, LEAST_CONFIRMED)
        return least if least < self.optimizer.confirm_replicas else None

    def at_search_accuracy(self, design: Design) -> Design:
        """Return a candidate's design with the accuracy of the search, which is usually coarser.

        Raises InputError if [search_accuracy] does not fit the design.
        """
        tables = {"facets": "chamber"}
        values = self.search_accuracy.items()
        return design.changed({f"{tables.get(k, 'process.accuracy')}.{k}": v for k, v in values})

    def _shape_problems(self) -> list[Problem]:
        """Return the reasons why the design cannot have the chamber shapes that [vary] lists."""
        if SHAPE not in self.vary:
            return []
        if problems := vary_problems(self.design, SHAPE, self.vary[SHAPE]):
            return problems
        try:
            designs_by_shape(self.design, self.vary)
        except InputError as error:
            return [Problem(f"vary.{SHAPE}", str(error))]
        return []

    def _vary_problems(self, by_shape: Mapping[str, Design]) -> Iterator[Problem]:
        for name, varied in self.vary.items():
            yield from vary_problems(with_key(by_shape, name) or self.design, name, varied)
            if name.startswith("part.target.") and self.design.part.target.reachable:
                text = "not supported with part.target.reachable; leave one of the two out"
                yield Problem(f"vary.{name}", text)
        for name in self.constraints:
            if not all(has_key(one, name) for one in by_shape.values()):
                text = "only some of the shapes have it; not supported, leave it out"
                yield Problem(f"constraints.{name}", text)

    def _objective_problems(self, by_shape: Mapping[str, Design]) -> Iterator[Problem]:
        field = "objective.sum" if self.objective.sum else "objective"
        for goal in map(parse_objective, self.objective.goals):
            for name in goal.terms:
                varied = self.vary.get(name)
                if problem := metric_problem(self.design, name):
                    yield Problem(field, f"{name}: {problem}")
                elif is_number(name) and (varied is None or varied.texts):
                    text = f"{name} is a number of the design that does not vary; add it to [vary]"
                    yield Problem(field, text)
                elif is_number(name) and not all(has_key(one, name) for one in by_shape.values()):
                    yield Problem(field, f"{name}: only some of the shapes have it; leave it out")
            if not goal.is_exact:
                continue
            if not self.all_constraints and not self.objective.pareto:
                text = "nothing is asked of the simulation; give limits in [constraints]"
                yield Problem(field, f"given {goal.name}, but {text}")
            key, accuracy = "objective_half_width", self.design.process.accuracy
            if accuracy.objective_half_width is not None or key in self.search_accuracy:
                text = f"the objective is exact, so no {key} tells how many replicas to take"
                yield Problem(field, f"{text}; leave that out, and give replicas")

    def _problems(self) -> Iterator[Problem]:
        problems = self._shape_problems()
        yield from problems
        by_shape = {} if problems else designs_by_shape(self.design, self.vary)
        if not problems:
            yield from self._vary_problems(by_shape)
        bounds = {name: one.bounds for name, one in self.vary.items() if not one.texts}
        for k, values in enumerate(self.begin_with):
            if values.keys() != self.vary.keys():
                text = f"has {', '.join(values) or 'nothing'}; give {', '.join(self.vary)}"
                yield Problem(f"begin_with.{k}", text)
            for name, value in values.items():
                low, high = bounds.get(name, (-math.inf, math.inf))
                texts = self.vary[name].texts if name in self.vary else ()
                base = by_shape.get(str(values.get(SHAPE, self.design.chamber.shape)))
                has_none = value == NONE and NONE not in texts
                if base and name in self.vary and has_none == has_key(base, name) and name != SHAPE:
                    text = f"given {value!r}, but a {base.chamber.shape} "
                    text += "has it; give a value" if has_none else "has none"
                    yield Problem(f"begin_with.{k}.{name}", text)
                    continue
                if has_none:
                    continue
                if texts or isinstance(value, str):
                    if value not in texts:
                        text = (
                            f"given {value!r}, which is none of the values in [vary]; add it there"
                        )
                        yield Problem(f"begin_with.{k}.{name}", text)
                elif not low <= value <= high:
                    text = (
                        f"{value:g} is outside [{low:g}, {high:g}] of [vary]; widen it, or leave "
                    )
                    yield Problem(f"begin_with.{k}.{name}", f"{text}the design out")
        if len(self.begin_with) >= self.optimizer.evaluations:
            text = f"given {self.optimizer.evaluations}, too few for the start and those of "
            text += f"begin_with; give {len(self.begin_with) + 1} or more"
            yield Problem("optimizer.evaluations", text)
        for name, limits in self.constraints.items():
            yield from limit_problems(self.design, bounds, name, limits)
            levels = self.vary[name].values(False) if name in self.vary else ()
            if levels and not any(limits.hold(one) for one in levels):
                text = "none of its values in [vary] is within; change the limits or the values"
                yield Problem(f"constraints.{name}", text)
        if self.objective.over_tolerances == "worst" and not self.design.tolerances:
            text = 'given "worst", but the design has no [tolerances]; add them, or leave it out'
            yield Problem("objective.over_tolerances", text)
        yield from self._objective_problems(by_shape)
        phases = [phase.algorithm for phase in self.optimizer.phases] or [self.optimizer.algorithm]
        if self.objective.pareto and not {"auto", "sobol", "surrogate"}.issuperset(phases):
            text = "given two objectives, which only auto, sobol and surrogate can search"
            yield Problem("objective.pareto", text)
        if "gauge_mm2" in self.search_accuracy:
            text = "it is the same for all candidates; set process.accuracy.gauge_mm2 instead"
            yield Problem("search_accuracy.gauge_mm2", text)
        try:
            self.at_search_accuracy(self.design)
        except InputError as error:
            text = str(error).replace("process.accuracy.", "").replace("chamber.", "")
            yield Problem("search_accuracy", text)

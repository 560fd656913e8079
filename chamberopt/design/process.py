"""Peening time of a design, the steps in which it is peened, and accuracy of its simulation.

Without steps a part stays in one pose, with one charge of balls. In steps it is peened in several,
one after another: each step has its share of the time, and changes some keys of the design.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from chamberopt.common.toml_errors import Problem
from chamberopt.common.toml_fields import Pair, list_field, quantity
from chamberopt.design.shapes.base import is_custom
from chamberopt.design.shapes.imported import IMPORTED
from chamberopt.design.table_base import SI, FileTable

MIN_POINTS, MAX_POINTS = 1_000, 1_000_000  # limits on the number of coverage windows
MAX_STEPS = 10
NONE = "none"  # in the place of a holder or mask that a step does not have
LONGEST_NAME = 40
NAME = f"a name in quotes of at most {LONGEST_NAME} letters, digits and _, no digit first"
OF_POSE = "rotate_deg", "offset_mm"
# Keys of which a table has only one, so that a step's key takes the place of the design's other.
EITHER_OR = (("diameter_mm", "mix"), ("amplitude_um", "amplitude_pv_um"))


class Accuracy(FileTable):
    """Number and length of the replicas: simulations of one design, each from its own start."""

    RENAMED: ClassVar[dict[str, str]] = {
        "coverage": "objective_half_width",
        "most_replicas": "max_replicas",
        "drag_piece_ms": "drag_step_ms",
    }
    REMOVED: ClassVar[dict[str, str]] = {
        "coverage_model": "coverage is measured in windows of process.accuracy.gauge_mm2",
        "sample_mm": "coverage is measured in windows of process.accuracy.gauge_mm2",
    }

    replicas: int = quantity(3, 100000, "", "3 is the least that gives a confidence interval", 8)
    simulated_time_s: float = quantity(1e-4, 10000, "s", "of each replica, after warm-up", 1.0)
    warmup_time_s: float = quantity(0, 10000, "s", "simulated first and not counted", 0.2)
    objective_half_width: float | None = quantity(
        1e-4,
        0.5,
        "",
        "wanted half-width of the objective's 95 % interval; of a time as a share of it",
        None,
    )
    max_replicas: int = quantity(3, 100000, "", "limit for objective_half_width", 200)
    points: int = quantity(
        MIN_POINTS, MAX_POINTS, "", "windows of the target in which coverage is measured", 20_000
    )
    gauge_mm2: float = quantity(
        1e-4, 1e4, "mm²", "area of the window in which coverage is measured round each point", 1.0
    )
    elastic_below_mm_s: float = quantity(
        0.1, 1000, "mm/s", "slower impacts lose no energy: ends endless bouncing", 10.0
    )
    drag_step_ms: float = quantity(
        0.1, 1000, "ms", "longest flight between two drag impulses, effects.drag", 10.0
    )

    def _problems(self) -> Iterator[Problem]:
        if self.objective_half_width is not None and self.max_replicas < self.replicas:
            text = f"given {self.max_replicas}, below replicas = {self.replicas}; raise it"
            yield Problem("max_replicas", text)

    simulated_time = SI("simulated_time_s", 1.0, "Recorded time of each replica [s]")
    warmup_time = SI("warmup_time_s", 1.0, "Time of each replica before recording starts [s]")
    gauge = SI("gauge_mm2", 1e-6, "Area [m²] of the window in which coverage is measured")
    elastic_below = SI("elastic_below_mm_s", 1e-3, "Impacts of less normal speed [m/s] are elastic")
    drag_step = SI("drag_step_ms", 1e-3, "Longest time [s] between two drag impulses")


class Process(FileTable):
    """Duration of the peening, and accuracy of its simulation."""

    treatment_time_s: float = quantity(0.01, 1e6, "s", "peening time the coverage is predicted for")
    seed: int = quantity(0, 2**63 - 1, "", "same seed, same result", 1)
    intensity_mmA: Pair | None = list_field(  # noqa: N815
        "two numbers [low, high], 0 < low < high",
        "the Almen intensity that is wanted, mean over the target",
        None,
    )
    coverage_percent: float | None = quantity(
        100, 1000, "%", "that is wanted: 100 is the time to 98 %, 200 twice that time", None
    )
    accuracy: Accuracy = Field(default_factory=Accuracy, description="replicas and their length")

    def _problems(self) -> Iterator[Problem]:
        if self.intensity_mmA is not None and not 0 < self.intensity_mmA[0] < self.intensity_mmA[1]:
            text = f"given {list(self.intensity_mmA)}; allowed: [low, high] with 0 < low < high"
            yield Problem("intensity_mmA", text)

    @property
    def recorded_time(self) -> float:
        """Time of each replica [s] in which impacts are recorded, after the warm-up."""
        return self.accuracy.simulated_time

    treatment_time = SI("treatment_time_s", 1.0, "Peening time [s] of the predicted coverage")


def _changes(what: str) -> Any:
    return Field(default=None, description=what, json_schema_extra={"form": "a table"})


Changes = dict[str, Any] | None


class Step(FileTable):
    """One of several steps in which a part is peened, and the keys of the design that it changes.

    The first step is the design as its tables have it, and changes nothing.
    """

    name: Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$", max_length=LONGEST_NAME)] = (
        Field(
            description="e.g. turned: its figures are steps.turned.mean_coverage ...",
            json_schema_extra={"form": NAME},
        )
    )
    time_share: float = quantity(
        1e-3, 1e6, "", "its part of process.treatment_time_s, over the sum of all steps' parts", 1.0
    )
    part: Changes = _changes("the pose of the part in this step")
    chamber: Changes = _changes("keys of the chamber that differ in this step")
    sonotrode: Changes = _changes("keys of the sonotrode that differ in this step")
    sonotrodes: tuple[dict[str, Any], ...] | None = Field(
        default=None,
        strict=False,
        description="the further sonotrodes of this step, in place of the design's",
        json_schema_extra={"form": "a list of tables"},
    )
    shot: Changes = _changes("keys of the shot that differ in this step")
    holder: dict[str, Any] | Literal["none"] | None = _changes(
        'the whole holder of this step, in place of the design\'s; "none": no holder'
    )
    mask: dict[str, Any] | Literal["none"] | None = _changes(
        'the whole mask of this step, in place of the design\'s; "none": no mask'
    )

    REMOVED: ClassVar[dict[str, str]] = dict.fromkeys(
        ("materials", "zones", "effects", "calibration", "tolerances", "ranges", "stress"),
        "is the same in all steps, as one part is peened on one machine",
    ) | {"process": "is of all steps together: give each step its time_share of the time"}

    def _problems(self) -> Iterator[Problem]:
        for key in self.part or {}:
            if key not in OF_POSE:
                text = f"is the same in all steps; a step may change {' and '.join(OF_POSE)}"
                yield Problem(f"part.{key}", text)
        for key, value in (self.chamber or {}).items():
            if key == "mesh" or (key == "shape" and (is_custom(value) or value == IMPORTED)):
                text = "a chamber that a file describes is not supported in a step; leave it out"
                yield Problem(f"chamber.{key}", text)
        for key in ("material", "density_kg_m3"):
            if key in (self.shot or {}):
                text = "balls of another metal are not supported in a step; leave it out"
                yield Problem(f"shot.{key}", text)

    @property
    def title(self) -> str:
        """Its name as people read it."""
        return self.name.replace("_", " ")

    @property
    def changes(self) -> dict[str, Any]:
        """What the step changes in the design, by the name of the table."""
        tables = ((name, getattr(self, name)) for name in type(self).model_fields)
        return {
            name: one
            for name, one in tables
            if one is not None and name not in ("name", "time_share")
        }

    def with_values(self, design: Mapping[str, Any]) -> "Step":
        """Return the step with the values that a checked design has in their place.

        Args:
            design: values of the design that this step makes, by table.
        """
        found: dict[str, Any] = {}
        for name, change in self.changes.items():
            table = design[name]
            if isinstance(change, dict):
                found[name] = {key: table[key] for key in change}
            else:
                found[name] = change if change == NONE else table
        return self.model_copy(update=found)


def step_problems(steps: Sequence[Step]) -> Iterator[Problem]:
    """Yield a problem if there is one step only, it changes the design, or names are alike."""
    if len(steps) == 1:  # an empty list in a file is as none
        yield Problem("steps", "given one step; give two or more, or leave it out")
    names = [step.name for step in steps]
    for k, step in enumerate(steps):
        if step.name in names[:k]:
            text = f"given {step.name!r}, as steps.{names.index(step.name)} has; names must differ"
            yield Problem(f"steps.{k}.name", text)
    for name in steps[0].changes if steps else ():
        text = f"the first step is the design itself: write this in [{name}], and leave it out here"
        yield Problem(f"steps.0.{name}", text)


def values_in_step(design: Mapping[str, Any], steps: Sequence[Step], number: int) -> dict[str, Any]:
    """Return the values of the design that is peened in one of the steps alone.

    Times are in proportion: of the peening time and of the simulated time, each step has its share.
    So the dents of all steps together are those of a short piece of the whole treatment.

    Args:
        design: values of the design with all steps.
        number: position of the step.
    """
    step, share = steps[number], steps[number].time_share / sum(one.time_share for one in steps)
    found = {**design, "steps": None, "tolerances": None}
    for name, change in step.changes.items():
        found[name] = None if change == NONE else change
        if name not in ("holder", "mask", "sonotrodes"):
            found[name] = {**_not_replaced(design[name], change), **change}
    accuracy = design["process"]["accuracy"]
    found["process"] = {
        **design["process"],
        "treatment_time_s": share * design["process"]["treatment_time_s"],
        "accuracy": {**accuracy, "simulated_time_s": share * accuracy["simulated_time_s"]},
    }
    return found


def _not_replaced(table: Mapping[str, Any], change: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys of a table in whose place a change has none."""
    replaced = {key for pair in EITHER_OR for key in pair if not set(pair).isdisjoint(change)}
    if change.get("shape", table.get("shape")) != table.get("shape"):
        replaced |= set(table) - {"shape"}  # each shape has keys of its own
    return {key: one for key, one in table.items() if key not in replaced}

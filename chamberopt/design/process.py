"""How long a design is peened, and how well the answer is to be known."""

from typing import ClassVar, Literal, Self

from pydantic import BaseModel, Field, model_validator

from chamberopt.common.toml_errors import CrossCheckError, Problem
from chamberopt.common.toml_fields import quantity
from chamberopt.design.materials import STRICT


class Accuracy(BaseModel):
    """How much is simulated: independent replicas, each after its own start and warm-up."""

    model_config = STRICT
    RENAMED: ClassVar[dict[str, str]] = {  # former names of keys
        "coverage": "objective_half_width",
        "max_replicas": "max_replicas",
        "drag_step_ms": "drag_step_ms",
    }

    replicas: int = Field(
        default=8, ge=3, le=100000, description="3 is the least that gives a confidence interval"
    )
    simulated_time_s: float = quantity(1e-4, 10000, "s", "of each replica, after warm-up", 1.0)
    warmup_time_s: float = quantity(0, 10000, "s", "simulated first and not counted", 0.2)
    objective_half_width: float | None = quantity(
        1e-4, 0.5, "", "wanted half-width of the objective's 95 % interval", None
    )
    max_replicas: int = Field(
        default=200, ge=3, le=100000, description="where the wish for accuracy ends"
    )
    coverage_model: Literal["avrami", "dents"] = Field(
        default="avrami", description="from dent rates, or dent by dent over the whole treatment"
    )
    sample_mm: float = quantity(
        0.005, 10, "mm", 'spacing of the points that coverage_model = "dents" marks', 0.1
    )
    elastic_below_mm_s: float = quantity(
        0.1, 1000, "mm/s", "slower hits lose nothing: ends endless bouncing", 10.0
    )
    drag_step_ms: float = quantity(
        0.1, 1000, "ms", "longest flight between two kicks of the air, effects.drag", 10.0
    )

    @model_validator(mode="after")
    def _agree(self) -> Self:
        if self.objective_half_width is not None and self.max_replicas < self.replicas:
            text = f"given {self.max_replicas}, below replicas = {self.replicas}; raise it"
            raise CrossCheckError([Problem("max_replicas", text)])
        return self

    @property
    def simulated_time(self) -> float:
        """Recorded time of each replica [s]."""
        return self.simulated_time_s

    @property
    def warmup_time(self) -> float:
        """Time of each replica before recording starts [s]."""
        return self.warmup_time_s

    @property
    def sample_spacing(self) -> float:
        """Spacing of the points that dents mark [m]."""
        return self.sample_mm * 1e-3

    @property
    def elastic_below(self) -> float:
        """Normal speed [m/s] below which hits lose nothing."""
        return self.elastic_below_mm_s * 1e-3

    @property
    def drag_step(self) -> float:
        """Longest time [s] between two kicks of the air."""
        return self.drag_step_ms * 1e-3


# The longest treatment [s] that is simulated from beginning to end: minutes of computing a replica.
MAX_SIMULATED_TREATMENT = 600.0


class Process(BaseModel):
    """How long the part is peened, and how the answer is computed."""

    model_config = STRICT

    treatment_time_s: float = quantity(0.01, 1e6, "s", "peening time the coverage is predicted for")
    seed: int = Field(default=1, ge=0, le=2**63 - 1, description="same seed, same result")
    accuracy: Accuracy = Field(default_factory=Accuracy, description="replicas and their length")

    @model_validator(mode="after")
    def _agree(self) -> Self:
        if (
            self.accuracy.coverage_model == "dents"
            and self.treatment_time_s > MAX_SIMULATED_TREATMENT
        ):
            text = f'given "dents", which simulates all of treatment_time_s = {self.treatment_time_s:g} in each replica'
            wants = f'at most {MAX_SIMULATED_TREATMENT:g} s are supported; shorten the treatment or use "avrami"'
            raise CrossCheckError([Problem("accuracy.coverage_model", f"{text}; {wants}")])
        return self

    @property
    def recorded_time(self) -> float:
        """What each replica records [s]: all of the treatment where every dent is marked."""
        marks = self.accuracy.coverage_model == "dents"
        return self.treatment_time_s if marks else self.accuracy.simulated_time

    @property
    def treatment_time(self) -> float:
        """Peening time [s] the coverage is predicted for."""
        return self.treatment_time_s

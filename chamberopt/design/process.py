"""Peening time of a design, and the accuracy of its simulation."""

from collections.abc import Iterator
from typing import ClassVar, Literal

from pydantic import Field

from chamberopt.common.toml_errors import Problem
from chamberopt.common.toml_fields import quantity
from chamberopt.design.table_base import SI, FileTable

# Longest treatment [s] simulated from beginning to end; one replica then takes minutes to compute.
MAX_SIMULATED_TREATMENT = 600.0


class Accuracy(FileTable):
    """Number and length of the independent replicas; each has its own start and warm-up."""

    RENAMED: ClassVar[dict[str, str]] = {
        "coverage": "objective_half_width",
        "most_replicas": "max_replicas",
        "drag_piece_ms": "drag_step_ms",
    }

    replicas: int = quantity(3, 100000, "", "3 is the least that gives a confidence interval", 8)
    simulated_time_s: float = quantity(1e-4, 10000, "s", "of each replica, after warm-up", 1.0)
    warmup_time_s: float = quantity(0, 10000, "s", "simulated first and not counted", 0.2)
    objective_half_width: float | None = quantity(
        1e-4, 0.5, "", "wanted half-width of the objective's 95 % interval", None
    )
    max_replicas: int = quantity(3, 100000, "", "limit for objective_half_width", 200)
    coverage_model: Literal["avrami", "dents"] = Field(
        default="avrami", description="from dent rates, or dent by dent over the whole treatment"
    )
    sample_mm: float = quantity(
        0.005, 10, "mm", 'spacing of the points that coverage_model = "dents" marks', 0.1
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
    sample_spacing = SI("sample_mm", 1e-3, "Spacing of the points that dents mark [m]")
    elastic_below = SI("elastic_below_mm_s", 1e-3, "Impacts of less normal speed [m/s] are elastic")
    drag_step = SI("drag_step_ms", 1e-3, "Longest time [s] between two drag impulses")


class Process(FileTable):
    """How long the part is peened, and how accurately that is simulated."""

    treatment_time_s: float = quantity(0.01, 1e6, "s", "peening time the coverage is predicted for")
    seed: int = quantity(0, 2**63 - 1, "", "same seed, same result", 1)
    accuracy: Accuracy = Field(default_factory=Accuracy, description="replicas and their length")

    def _problems(self) -> Iterator[Problem]:
        if self._simulates_all and self.treatment_time_s > MAX_SIMULATED_TREATMENT:
            yield Problem(
                "accuracy.coverage_model",
                'given "dents", which simulates all of treatment_time_s = '
                f"{self.treatment_time_s:g} in each replica; at most {MAX_SIMULATED_TREATMENT:g} s "
                'are supported; shorten the treatment or use "avrami"',
            )

    @property
    def _simulates_all(self) -> bool:
        return self.accuracy.coverage_model == "dents"

    @property
    def recorded_time(self) -> float:
        """Recorded time of each replica [s]; the whole treatment where every dent is marked."""
        return self.treatment_time_s if self._simulates_all else self.accuracy.simulated_time

    treatment_time = SI("treatment_time_s", 1.0, "Peening time [s] of the predicted coverage")

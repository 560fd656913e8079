"""Peening time of a design, and the accuracy of its simulation."""

from collections.abc import Iterator
from typing import ClassVar

from pydantic import Field

from chamberopt.common.toml_errors import Problem
from chamberopt.common.toml_fields import Pair, list_field, quantity
from chamberopt.design.table_base import SI, FileTable

MIN_POINTS, MAX_POINTS = 1_000, 1_000_000  # limits on the number of coverage windows


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

"""The knobs of a design that trade accuracy for time, and the settings at which the ladder tries them."""

from __future__ import annotations

from typing import Any

from chamberopt.design.design import Design

FACETS, MOTION = "chamber.facets", "sonotrode.motion"
TIME, WARM_UP = "process.accuracy.simulated_time_s", "process.accuracy.warmup_time_s"
FLOOR, PIECE = "process.accuracy.elastic_below_mm_s", "process.accuracy.drag_step_ms"
MODEL = "process.accuracy.coverage_model"
REFERENCE, DESIGNED = "reference", "as designed"


def knobs(design: Design) -> dict[str, tuple[Any, ...]]:
    """Settings of every knob, by dotted name; the last is the reference's."""
    accuracy = design.process.accuracy
    warm, floor, piece = accuracy.warmup_time_s, accuracy.elastic_below_mm_s, accuracy.drag_step_ms
    ladder: dict[str, tuple[Any, ...]] = {}
    if design.chamber.is_round:
        facets = design.value(FACETS)
        ladder[FACETS] = tuple(sorted({16, facets, min(1024, max(256, 4 * facets))}))
    if not design.sonotrodes:
        ladder[MOTION] = ("random_phase", "sinusoidal")
    ladder |= {
        WARM_UP: tuple(sorted({0.0, warm / 4, warm, min(1e4, 4 * max(warm, 0.05))})),
        FLOOR: tuple(sorted({min(1e3, 10 * floor), floor, max(0.1, floor / 10)}, reverse=True)),
    }
    if design.effects.drag:
        ladder[PIECE] = tuple(
            sorted({min(1e3, 4 * piece), piece, max(0.1, piece / 4)}, reverse=True)
        )
    time_s = accuracy.simulated_time_s
    return ladder | {TIME: (max(1e-4, time_s / 4), min(1e4, 4 * time_s), time_s)}


def designs(design: Design) -> tuple[dict[str, Any], dict[tuple[str, str], Design]]:
    """The reference's settings, and every design of the ladder by knob and setting, the reference first."""
    own = design.changed({MODEL: "avrami"})
    settings = {knob: values[-1] for knob, values in knobs(own).items()}
    reference = own.changed(settings)
    ladder = {(REFERENCE, ""): reference}
    for knob, values in knobs(own).items():
        ladder |= {(knob, shown(value)): reference.changed({knob: value}) for value in values[:-1]}
    return settings, ladder | {(DESIGNED, ""): own}


def shown(value: Any) -> str:
    """A setting as a design file has it."""
    return f"{value:g}" if isinstance(value, int | float) else str(value)

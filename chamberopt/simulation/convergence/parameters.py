"""The numerical parameters of a design, which trade accuracy for time, and settings to try."""

from __future__ import annotations

from typing import Any

from chamberopt.design.design import Design

FACETS, MOTION = "chamber.facets", "sonotrode.motion"
TIME, WARM_UP = "process.accuracy.simulated_time_s", "process.accuracy.warmup_time_s"
ELASTIC_SPEED = "process.accuracy.elastic_below_mm_s"
DRAG_STEP = "process.accuracy.drag_step_ms"
MODEL = "process.accuracy.coverage_model"
REFERENCE, DESIGNED = "reference", "as designed"


def numerical_parameters(design: Design) -> dict[str, tuple[Any, ...]]:
    """Settings of every numerical parameter by dotted name; the last is the reference's."""
    accuracy = design.process.accuracy
    settings: dict[str, tuple[Any, ...]] = {}
    if design.chamber.is_round:
        facets = design.value(FACETS)
        settings[FACETS] = tuple(sorted({16, facets, min(1024, max(256, 4 * facets))}))
    if not design.sonotrodes:
        settings[MOTION] = ("random_phase", "sinusoidal")
    warm_up, speed = accuracy.warmup_time_s, accuracy.elastic_below_mm_s
    settings[WARM_UP] = tuple(sorted({0.0, warm_up / 4, warm_up, min(1e4, 4 * max(warm_up, 0.05))}))
    settings[ELASTIC_SPEED] = tuple(
        sorted({min(1e3, 10 * speed), speed, max(0.1, speed / 10)}, reverse=True)
    )
    if design.effects.drag:
        step = accuracy.drag_step_ms
        settings[DRAG_STEP] = tuple(
            sorted({min(1e3, 4 * step), step, max(0.1, step / 4)}, reverse=True)
        )
    time_s = accuracy.simulated_time_s
    settings[TIME] = max(1e-4, time_s / 4), min(1e4, 4 * time_s), time_s
    return settings


def study_designs(design: Design) -> tuple[dict[str, Any], dict[tuple[str, str], Design]]:
    """The designs of a convergence study.

    Returns:
        The reference's settings by parameter, and the designs by parameter and setting: the
        reference, one for each other setting of each parameter, and the design as it is.
    """
    own = design.changed({MODEL: "avrami"})
    parameters = numerical_parameters(own)
    settings = {name: values[-1] for name, values in parameters.items()}
    reference = own.changed(settings)
    designs = {(REFERENCE, ""): reference}
    for name, values in parameters.items():
        for value in values[:-1]:
            designs[name, setting_text(value)] = reference.changed({name: value})
    return settings, designs | {(DESIGNED, ""): own}


def setting_text(value: Any) -> str:
    """A setting as a design file holds it, without quotes."""
    return f"{value:g}" if isinstance(value, int | float) else str(value)


def short_name(parameter: str) -> str:
    """The key of a parameter without table and unit."""
    key = parameter.rsplit(".", 1)[-1]
    for unit in ("_mm_s", "_ms", "_s"):
        key = key.removesuffix(unit)
    return key.replace("_", " ")

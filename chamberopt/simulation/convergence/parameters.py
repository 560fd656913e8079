"""The numerical parameters of a design, which trade accuracy for time, and settings to try."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from chamberopt.design.design import Design
from chamberopt.design.process import MAX_POINTS, MIN_POINTS

FACETS, MOTION = "chamber.facets", "sonotrode.motion"
TIME, WARM_UP = "process.accuracy.simulated_time_s", "process.accuracy.warmup_time_s"
ELASTIC_SPEED = "process.accuracy.elastic_below_mm_s"
DRAG_STEP = "process.accuracy.drag_step_ms"
POINTS, GAUGE = "process.accuracy.points", "process.accuracy.gauge_mm2"
REFERENCE, DESIGNED = "reference", "as designed"


def numerical_parameters(design: Design) -> dict[str, tuple[Any, ...]]:
    """Settings of every numerical parameter by dotted name; the last is the reference's."""
    accuracy = design.process.accuracy
    settings: dict[str, Iterable[Any]] = {}
    if design.chamber.is_round:
        facets = design.value(FACETS)
        settings[FACETS] = sorted({16, facets, min(1024, max(256, 4 * facets))})
    if not design.sonotrodes:
        settings[MOTION] = "random_phase", "sinusoidal"
    warm_up, time_s = accuracy.warmup_time_s, accuracy.simulated_time_s
    settings[WARM_UP] = sorted({0.0, warm_up / 4, warm_up, min(1e4, 4 * max(warm_up, 0.05))})
    settings[ELASTIC_SPEED] = _falling(accuracy.elastic_below_mm_s, 10)
    if design.effects.drag:
        settings[DRAG_STEP] = _falling(accuracy.drag_step_ms, 4)
    points = accuracy.points
    settings[POINTS] = sorted({max(MIN_POINTS, points // 4), points, min(MAX_POINTS, 4 * points)})
    gauge = accuracy.gauge_mm2
    settings[GAUGE] = min(1e4, 4 * gauge), gauge
    settings[TIME] = max(1e-4, time_s / 4), min(1e4, 4 * time_s), time_s
    return {name: tuple(values) for name, values in settings.items()}


def _falling(value: float, factor: float) -> list[float]:
    """A value between a larger and a smaller one, all from 0.1 to 1000, as both fields allow."""
    return sorted({min(1e3, factor * value), value, max(0.1, value / factor)}, reverse=True)


def study_designs(design: Design) -> tuple[dict[str, Any], dict[tuple[str, str], Design]]:
    """The reference's settings by parameter, and the designs by parameter and setting.

    They are the reference, one for each other setting of each parameter, and the design as it is.
    """
    parameters = numerical_parameters(design)
    settings = {name: values[-1] for name, values in parameters.items()}
    reference = design.changed(settings)
    others: dict[tuple[str, str], Design] = {}
    for name, values in parameters.items():
        others |= {(name, setting_text(x)): reference.changed({name: x}) for x in values[:-1]}
    return settings, {(REFERENCE, ""): reference, **others, (DESIGNED, ""): design}


def setting_text(value: Any) -> str:
    """A setting as a design file holds it, without quotes."""
    return f"{value:g}" if isinstance(value, int | float) else str(value)


def short_name(parameter: str) -> str:
    """The key of a parameter without table and unit."""
    return re.sub("_(mm_s|mm2|ms|s)$", "", parameter.rsplit(".", 1)[-1]).replace("_", " ")

"""The numerical parameters of a design, which trade accuracy for time, and settings to try."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from functools import reduce
from typing import Any

from chamberopt.design.design import Design
from chamberopt.design.process import MAX_POINTS, MIN_POINTS

FACETS, MOTION = "chamber.facets", "sonotrode.motion"
TIME, WARM_UP = "process.accuracy.simulated_time_s", "process.accuracy.warmup_time_s"
ELASTIC_SPEED = "process.accuracy.elastic_below_mm_s"
DRAG_STEP = "process.accuracy.drag_step_ms"
POINTS, GAUGE = "process.accuracy.points", "process.accuracy.gauge_mm2"
REFERENCE, DESIGNED = "reference", "as designed"
# Parameters that are left out of a study with a small budget, the first first. A wider gauge is
# another figure; the others are in the order in which they matter less. Simulated time is never
# left out.
LEFT_OUT_FIRST = GAUGE, MOTION, ELASTIC_SPEED, DRAG_STEP, FACETS, POINTS, WARM_UP


def numerical_parameters(design: Design) -> dict[str, tuple[object, ...]]:
    """Return the values to try of each numerical parameter of a design, by its dotted name.

    The last value is the value in the reference, with which all others are compared.
    """
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
    settings[POINTS] = max(MIN_POINTS, points // 4), min(MAX_POINTS, 2 * points), points
    gauge = accuracy.gauge_mm2
    settings[GAUGE] = min(1e4, 4 * gauge), gauge
    settings[TIME] = max(1e-4, time_s / 4), min(1e4, 4 * time_s), time_s
    return {name: tuple(values) for name, values in settings.items()}


def _falling(value: float, factor: float) -> list[float]:
    """Return `factor` times a value, the value, and the value over `factor`, the largest first.

    They are cut off at 0.1 and 1000, the range that a design file allows.
    """
    return sorted({min(1e3, factor * value), value, max(0.1, value / factor)}, reverse=True)


def study_designs(
    design: Design, left_out: Collection[str] = ()
) -> tuple[dict[str, object], dict[tuple[str, str], Design]]:
    """Return the reference's setting of each numerical parameter, and all designs to simulate.

    The designs are the reference, a copy of it for each other setting of a parameter, and the
    design as it is. Their keys are the parameter and its setting as text.

    Args:
        left_out: parameters that the reference has as the design has them, and that are not tried.
    """
    parameters = {
        name: (reduce(getattr, name.split("."), design),) if name in left_out else values
        for name, values in numerical_parameters(design).items()
    }
    settings = {name: values[-1] for name, values in parameters.items()}
    reference = design.changed(settings)
    others: dict[tuple[str, str], Design] = {}
    for name, values in parameters.items():
        tried = (one for one in dict.fromkeys(values[:-1]) if one != values[-1])
        others |= {(name, setting_text(one)): reference.changed({name: one}) for one in tried}
    return settings, {(REFERENCE, ""): reference, **others, (DESIGNED, ""): design}


def setting_text(value: object) -> str:
    """Return the value of a numerical parameter as a design file writes it, without quotes."""
    return f"{value:g}" if isinstance(value, int | float) else str(value)


def short_name(parameter: str) -> str:
    """Return the name of a parameter in words, without its table and unit, as "simulated time"."""
    return re.sub("_(mm_s|mm2|ms|s)$", "", parameter.rsplit(".", 1)[-1]).replace("_", " ")

"""Text about zones, named regions of the part, and about the steps in which it is peened.

It has coverage etc. in each zone with its limits, and on the target after each step alone.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from chamberopt.common.key_words import in_words, unit_of
from chamberopt.coverage.metrics import METRICS, STEPS
from chamberopt.design.process import NONE
from chamberopt.design.zones import LIMITED
from chamberopt.documents.document import AnswerLine, Section, Sentence, Table
from chamberopt.documents.wording import Label, metric_label, per_cent, plain

if TYPE_CHECKING:
    from collections.abc import Sequence

    from chamberopt.design.process import Step
    from chamberopt.results.load import Result
    from chamberopt.results.records import ZoneLimit


SIGNS = {"min": "≥", "max": "≤"}
WORDS = {
    "coverage_min": "coverage",
    "coverage_max": "coverage",
    "exposure_max": "exposure",
    "intensity_mmA": "Almen intensity",
}
SUM = (
    "The figures of the target are of all steps together: their dents are added up by place. In "
    "times to a coverage, the times of all steps are scaled alike. Below are the figures of the "
    "target after each step alone."
)


def limit_text(limit: ZoneLimit) -> str:
    """Return a limit of a zone as text, e.g. "coverage ≥ 98 %"."""
    name = limit.metric.rpartition(".")[2]
    sign, label = SIGNS[dict(LIMITED[limit.key])[name]], metric_label(name)
    return f"{WORDS[limit.key]} {sign} {plain(label.factor * limit.limit)} {label.unit}".rstrip()


def zone_lines(result: Result) -> list[AnswerLine]:
    """Return a sentence on each zone, which warns if a limit is not certainly met."""
    lines = []
    for zone in result.record.zones:
        judged = "; ".join(
            f"{limit_text(limit)} is {limit.standing} ({_limited_figure(result, limit)})"
            for limit in zone.limits
        )
        if not judged:
            mean = result.metrics[f"{zone.name}.mean_coverage"]
            judged = f"no limits; mean coverage {metric_label('mean_coverage').format(mean)}"
        text = f"Zone {zone.name}: {judged}."
        is_met = all(limit.standing == "met" for limit in zone.limits)
        lines.append(AnswerLine("zone", text, warns=not is_met))
    return lines


def zones_section(result: Result) -> Section | None:
    """Return the section with the figures of all zones, and whether they meet their limits.

    Return None for a part without zones.
    """
    zones = result.record.zones
    if not zones:
        return None
    limits = [
        (
            zone.name,
            limit_text(limit),
            f"{_limit_label(limit).text}: {_limited_figure(result, limit)}",
            limit.standing,
        )
        for zone in zones
        for limit in zone.limits
    ]
    figures = []
    for name in METRICS:
        label = _of_zone(name)
        found = [result.metrics.get(f"{zone.name}.{name}") for zone in zones]
        if any(found):
            cells = (label.number(one) if one else "–" for one in found)
            figures.append((label.with_unit, *cells))
    shares = (per_cent(zone.reachable_share) for zone in zones)
    share = ("share of the whole zone that a ball can touch", *shares)
    area = ("area in the chamber [mm²]", *(plain(zone.exposed_area_mm2) for zone in zones))
    head = ("", *(zone.name for zone in zones))
    table = Table("± 95 % intervals", head, [area, share, *figures])
    judged = Table("Limits, by the whole interval", ("zone", "limit", "figure", ""), limits, False)
    return Section("Zones", [judged, table] if limits else [table])


def _limited_figure(result: Result, limit: ZoneLimit) -> str:
    return _limit_label(limit).format(result.metrics[limit.metric])


def _limit_label(limit: ZoneLimit) -> Label:
    return _of_zone(limit.metric.rpartition(".")[2])


def _of_zone(name: str) -> Label:
    """Return the label of the metric `name`, with "the zone" for "the target" in its text."""
    label = metric_label(name)
    return replace(label, text=label.text.replace("the target", "the zone"))


def turned(rotate_deg: Sequence[float]) -> str:
    """Return a pose of the part in words, e.g. "180° about x, then 45° about z"."""
    turns = zip("xyz", rotate_deg, strict=True)
    return ", then ".join(f"{plain(angle)}° about {axis}" for axis, angle in turns if angle)


# How a step's keys are told that a plain name and unit would not tell as clearly.
OF_KEYS = {"shot.diameter_mm": "balls of {} mm", "shot.mass_g": "{} g of balls"}


def changes_in_words(step: Step) -> str:
    """Return what a step changes in the design, in words."""
    texts = []
    for name, change in step.changes.items():
        if not isinstance(change, dict):
            texts.append(f"no {name}" if change == NONE else f"other {name}: see the design")
            continue
        for key, value in change.items():
            if (name, key) == ("part", "rotate_deg"):
                texts.append(
                    f"part turned {turned(value)}" if any(value) else "part as in its file"
                )
            elif told := OF_KEYS.get(f"{name}.{key}"):
                texts.append(told.format(plain(value)))
            elif isinstance(value, int | float | str) and value:
                of = value if isinstance(value, str) else f"{plain(value)} {unit_of(key)}".rstrip()
                texts.append(f"{name} {in_words(key)} {of}")
            elif value:
                texts.append(f"{name} {in_words(key)}: see the design")
    return ", ".join(texts) or "as the design"


def step_lines(result: Result) -> list[AnswerLine]:
    """Return a sentence on each step: its time, what it changes, and what it does alone."""
    lines: list[AnswerLine] = []
    if not result.design.steps:
        return lines
    steps = zip(result.design.steps, result.design.in_steps.values(), strict=True)
    for number, (step, one) in enumerate(steps, start=1):
        figures = [
            f"{label.text} {label.format(found)}"
            for name in ("mean_coverage", "almen_intensity", "strength_um")
            if (found := result.metrics.get(f"{STEPS}.{step.name}.{name}"))
            for label in (metric_label(name),)
        ]
        time = plain(one.process.treatment_time)
        text = f"Step {number}, {step.title}, {time} s, {changes_in_words(step)}; alone: "
        lines.append(AnswerLine("step", f"{text}{', '.join(figures[:2])}.", False))
    return lines


def steps_section(result: Result) -> Section | None:
    """Return the section with the steps and what each does alone; None for a design without."""
    steps, found = result.design.steps, result.record.steps
    if not steps or found is None:
        return None
    times = (plain(one.process.treatment_time) for one in result.design.in_steps.values())
    rows: list[Sequence[str]] = [
        ("time [s]", *times),
        ("changes", *map(changes_in_words, steps)),
        ("share of the target that a ball can touch", *(per_cent(found[s.name]) for s in steps)),
    ]
    for name in METRICS:
        label = metric_label(name)
        of_steps = [result.metrics.get(f"{STEPS}.{step.name}.{name}") for step in steps]
        if any(of_steps):
            rows.append((label.with_unit, *(label.number(one) if one else "–" for one in of_steps)))
    table = Table("± 95 % intervals", ("", *(step.title for step in steps)), rows)
    return Section("Steps", [Sentence(SUM), table])

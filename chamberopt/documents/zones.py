"""Text about zones, named regions of the part: coverage etc. in them, and their limits."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from chamberopt.coverage.metrics import METRICS
from chamberopt.design.zones import LIMITED
from chamberopt.documents.document import AnswerLine, Section, Table
from chamberopt.documents.wording import Label, metric_label, per_cent, plain

if TYPE_CHECKING:
    from chamberopt.results.load import Result
    from chamberopt.results.records import ZoneLimit


SIGNS = {"min": "≥", "max": "≤"}


def limit_text(limit: ZoneLimit) -> str:
    """Return a limit of a zone as text, e.g. "coverage_min = 0.98".

    For a limit with a least and a largest value, the text of the least is "intensity_mmA ≥ 0.1".
    """
    sides = dict(LIMITED[limit.key])
    sign = "=" if len(sides) == 1 else SIGNS[sides[limit.metric.rpartition(".")[2]]]
    return f"{limit.key} {sign} {limit.limit:g}"


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

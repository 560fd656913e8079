"""What a report says of zones: their figures, and whether they meet their limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from chamberopt.coverage.metrics import METRICS
from chamberopt.design.zones import LIMITED
from chamberopt.documents.wording import (
    AnswerLine,
    Label,
    interval_text,
    metric_label,
    per_cent,
    plain,
)
from chamberopt.printers import html

if TYPE_CHECKING:
    from chamberopt.results.load import Result
    from chamberopt.results.records import ZoneLimit


SIGNS = {"min": "≥", "max": "≤"}


def limit_text(limit: ZoneLimit) -> str:
    """Such as "coverage_min = 0.98"; each end of a band has its sign, as "intensity_mmA ≥ 0.1"."""
    sides = dict(LIMITED[limit.key])
    sign = "=" if len(sides) == 1 else SIGNS[sides[limit.metric.rpartition(".")[2]]]
    return f"{limit.key} {sign} {limit.limit:g}"


def zone_lines(contents: Mapping[str, Any]) -> list[AnswerLine]:
    """A sentence on each zone for the answer, which warns if a limit is not certainly met.

    Args:
        contents: as `zone_contents` returns them.
    """
    lines = []
    for zone in contents["zones"]:
        judged = "; ".join(
            f"{row['text']} is {row['standing']} ({interval_text(row['figure'], row['unit'])})"
            for row in zone["limits"]
        )
        mean = interval_text(zone["mean_coverage"], "%")
        text = f"Zone {zone['name']}: {judged or f'no limits; mean coverage {mean}'}."
        is_met = all(row["standing"] == "met" for row in zone["limits"])
        lines.append(AnswerLine("zone", text, warns=not is_met))
    return lines


def zone_contents(result: Result) -> dict[str, Any]:
    """The figures of each zone, and whether they meet the zone's limits."""
    zones, rows = result.record.zones, []
    for name in METRICS:
        label = _of_zone(name)
        figures = [result.metrics.get(f"{zone.name}.{name}") for zone in zones]
        if any(figures):
            cells = [one and label.scale(one) for one in figures]
            rows.append({"label": label.with_unit, "zones": cells})

    def with_figure(limit: ZoneLimit) -> dict[str, Any]:
        label = _of_zone(limit.metric.rpartition(".")[2])
        return {
            **limit.model_dump(),
            "text": limit_text(limit),
            "label": label.text,
            "unit": label.unit,
            "figure": label.scale(result.metrics[limit.metric]),
        }

    mean = metric_label("mean_coverage")
    shown = [
        {
            **zone.model_dump(exclude={"limits"}),
            "limits": [*map(with_figure, zone.limits)],
            "mean_coverage": mean.scale(result.metrics[f"{zone.name}.mean_coverage"]),
        }
        for zone in zones
    ]
    return {"zones": shown, "metrics": rows}


def _of_zone(name: str) -> Label:
    """The label of a metric of the target, as that of a zone."""
    label = metric_label(name)
    return replace(label, text=label.text.replace("the target", "the zone"))


def zones_section(contents: Mapping[str, Any]) -> str:
    """The figures of all zones beside each other, and whether they meet their limits."""
    zones, metrics = contents["zones"]["zones"], contents["zones"]["metrics"]
    if not zones:
        return ""
    limits = [
        (
            zone["name"],
            row["text"],
            f"{row['label']}: {interval_text(row['figure'], row['unit'])}",
            row["standing"],
        )
        for zone in zones
        for row in zone["limits"]
    ]
    figures = [
        (row["label"], *(interval_text(one) if one else "–" for one in row["zones"]))
        for row in metrics
    ]
    shares = (per_cent(zone["reachable_share"]) for zone in zones)
    share = ("share of the whole zone that a ball can touch", *shares)
    area = ("area in the chamber [mm²]", *(plain(zone["exposed_area_mm2"]) for zone in zones))
    head = ("", *(zone["name"] for zone in zones))
    table = html.table("± 95 % intervals", head, [area, share, *figures])
    judged = html.table(
        "Limits, by the whole interval", ("zone", "limit", "figure", ""), limits, numbers=False
    )
    return html.section("Zones", judged if limits else "", table)

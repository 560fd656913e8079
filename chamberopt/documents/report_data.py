"""What a report says, as plain JSON values: collected from a results folder before any HTML."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chamberopt.common.estimate import Estimate, independent_difference, paired_difference
from chamberopt.common.files import read_file
from chamberopt.documents.conclusions import (
    accuracy_rows,
    answer,
    answer_lines,
    cost_rows,
    influence,
)
from chamberopt.documents.tolerances import tolerance_contents
from chamberopt.documents.wording import metric_label, objective_label, plain
from chamberopt.documents.zones import limit_text, zone_contents
from chamberopt.results.load import load_result, load_start, load_trials
from chamberopt.search.study_folder import STUDY

if TYPE_CHECKING:
    from chamberopt.results.load import Result
    from chamberopt.results.records import FrontPoint, StudyRecord


def report_contents(folder: str | Path) -> dict[str, Any]:
    """Everything on the page except its pictures.

    Raises:
        InputError: the folder is no finished result.
    """
    result = load_result(folder)
    record, study = result.record, result.study
    start = load_start(result) if study else None
    gain = None if start is None else _change(result.objective, start.objective, result, start)
    rows = load_trials(result.folder) if study else []
    label = objective_label(result.objective_name)
    zones = zone_contents(result)
    candidates = {"result": result} if start is None else {"start": start, "best": result}
    return {
        "kind": record.kind,
        "name": result.folder.resolve().name,
        "made": record.created,
        "answer": answer(result, start, gain),
        "answer_lines": answer_lines(result, zones),
        "question": _question(result, study),
        "metrics": _metrics(result, start),
        "calibrated": result.design.calibration is not None,
        "zones": zones,
        "field": _field(result),
        "front": [_pareto_row(row) for row in study.front] if study else [],
        "evaluations": [_evaluation(row, label.factor) for row in rows],
        "influence": influence(study, label) if study and start else None,
        "coverage_against_time": {
            name: one.record.coverage_against_time for name, one in candidates.items()
        },
        "tolerances": tolerance_contents(record.tolerances),
        "accuracy": accuracy_rows(result),
        "cost": cost_rows(result, rows),
        "effects": _effects(result),
        "notes": [*(study.notes if study else ()), *record.notes],
        "warnings": record.warnings,
        "design": _design(result, start),
        "identity": {
            "part, SHA-256": record.part_sha256,
            "seed": f"{result.seeds[0]}, stream “{result.seeds[1]}”",
            **record.versions,
        },
    }


def _change(after: Estimate, before: Estimate, result: Result, start: Result) -> Estimate:
    """The difference, from pairs of replicas where both ran on the same seeds."""
    if after == before:  # the start is the best: nothing that is shown of it is uncertain
        return Estimate(0.0, 0.0) if after.has_number else Estimate(0.0, 0.0).not_known("not known")
    same_seeds = result.seeds == start.seeds
    change = (paired_difference if same_seeds else independent_difference)(after, before)
    return change if after.has_number and before.has_number else change.not_known("not known")


def _question(result: Result, study: StudyRecord | None) -> dict[str, Any]:
    label, design = objective_label(result.objective_name), result.design
    chamber = result.record.chamber
    question: dict[str, Any] = {
        "part": design.part.mesh_path.name,
        "target": {
            "target_triangles": chamber.target_triangles,
            "target_exposed_area_mm2": chamber.target_exposed_area_mm2,
        },
        "shape": design.chamber.shape,
        "treatment_time_s": design.process.treatment_time,
        "objective": {
            "name": result.objective_name,
            "label": label.text,
            "unit": label.unit,
            "meaning": label.meaning,
        },
        "smaller_is_better": label.factor < 0.0,
        "constraints": [],
        "vary": [],
    }
    if not study:
        return question
    if STUDY in result.record.files:
        tables = tomllib.loads(read_file(result.path(STUDY)).decode())
        question["constraints"] = [
            " and ".join(f"{name} {'≥' if side == 'min' else '≤'} {limit:g}"
                         for side, limit in limits.items())
            for name, limits in tables.get("constraints", {}).items()
        ]  # fmt: skip
    question["constraints"] += [
        f"{limit_text(limit)} of zone {zone.name}"
        for zone in result.record.zones
        for limit in zone.limits
    ]
    question["vary"] = [
        {
            "name": name,
            "values": (", " if isinstance(ends[0], str) else " to ").join(map(plain, ends)),
            "start": study.start.parameters[name],
            "best": study.best.parameters[name],
        }
        for name, ends in study.vary.items()
    ]
    return {**question, "evaluations": study.evaluations, "algorithm": study.algorithm}


def _metrics(result: Result, start: Result | None) -> list[dict[str, Any]]:
    """Objective and metrics in the unit shown, with start, change and whether it is significant."""
    label = objective_label(result.objective_name)
    before = None if start is None else start.objective
    entries = [(result.objective_name, label, result.objective, before)]
    entries += [
        (name, metric_label(name), metric, start.metrics.get(name) if start else None)
        for name, metric in result.metrics.items()
        # Else the objective is this metric, or it is in the table of zones.
        if metric_label(name).text != label.text and "." not in name
    ]
    rows = []
    for name, label, value, before in entries:
        row: dict[str, Any] = {
            "name": name,
            "label": label.text,
            "unit": label.unit,
            "result": label.scale(value),
        }
        if start is not None and before is not None:
            change = _change(value, before, result, start)
            row |= {
                "start": label.scale(before),
                "change": label.scale(change),
                "real": abs(change.value) > change.half_width,
                "exact": change.half_width == 0.0 and not change.in_words,
            }
        rows.append(row)
    return rows


def _field(result: Result) -> dict[str, Any]:
    """The windows in which coverage is measured."""
    field = result.record.field
    labels = {name: metric_label(name) for name in field.double_gauge}
    return {
        "gauge_mm2": field.gauge_mm2,
        "reachable_share": field.reachable_share,
        "crease_share": field.crease_share,
        "dents": field.dents_in_median_window,
        "double_gauge": [
            {
                "label": labels[name].text,
                "unit": labels[name].unit,
                "result": labels[name].scale(one),
            }
            for name, one in field.double_gauge.items()
        ],
    }


def _evaluation(row: Mapping[str, Any], factor: float) -> dict[str, Any]:
    value, half_width = row["objective"], row["half_width"]
    return {
        "number": row["number"] + 1,
        "stage": row["stage"],
        "value": None if value is None else factor * value,
        "half_width": None if half_width is None else abs(factor) * half_width,
        "feasible": bool(row["feasible"]),
        "reason": row["reason"],
        "parameters": row["parameters"],
    }


def _pareto_row(point: FrontPoint) -> dict[str, Any]:
    """A candidate of the confirmed Pareto front, its objectives in the unit shown."""
    objectives = []
    for name, value in point.objectives.items():
        label = objective_label(name)
        objectives.append({"label": label.text, "unit": label.unit, "result": label.scale(value)})
    return {"parameters": point.parameters, "objectives": objectives}


def _effects(result: Result) -> dict[str, Any]:
    """Which effects are on, and what a pilot run estimated of each where one was made."""
    effects = result.design.effects.model_dump(mode="json", exclude={"auto"})
    return {
        "pilot": result.record.effects,
        "effects": [
            {"effect": name, "value": _effect_text(name, value)} for name, value in effects.items()
        ],
    }


def _effect_text(name: str, value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} = {_text(one)}" for key, one in value.items() if one is not None)
    if name == "rest" and value is None:
        return "on where a still surface faces up"
    return "on" if value else "off"


def _design(result: Result, start: Result | None) -> list[dict[str, Any]]:
    """Every value of the design by its dotted name, with the start's where that differs."""
    values = dict(_flatten(result.record.design))
    before = dict(_flatten(start.record.design)) if start else {}
    # The file's name only: its folder is private to the machine.
    values["part.mesh"] = before["part.mesh"] = result.design.part.mesh_path.name
    rows = []
    for name, value in values.items():
        row = {"name": name, "value": _text(value)}
        if start and _text(before.get(name)) != row["value"]:
            row["start"] = _text(before.get(name))
        rows.append(row)
    return rows


def _flatten(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from _flatten(value, f"{prefix}{name}.")
        elif value not in ([], None):
            yield prefix + name, value


def _text(value: Any) -> str:
    if value is None:
        return "–"
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.6g}" if isinstance(value, float) else json.dumps(value, ensure_ascii=False)


def read_design_file(result: Result) -> tuple[str, str]:
    """Name and text of the design that the result belongs to."""
    name = "best.toml" if result.study else "design.toml"
    return name, read_file(result.path(name)).decode()

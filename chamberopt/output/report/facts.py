"""What a report says, as plain values: gathered from a results folder's texts, before any of it is HTML."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chamberopt.common.errors import InputError
from chamberopt.coverage.statistics.confidence_interval import (
    Estimate,
    independent_difference,
    paired_difference,
)
from chamberopt.optimize.storage.study_folder import STUDY
from chamberopt.optimize.storage.trial_log import HISTORY, read_trials
from chamberopt.output.report.answer import answer
from chamberopt.output.report.cost import accuracy_reached, price_paid
from chamberopt.output.report.influence import influence
from chamberopt.output.report.words import goal_words, metric_words
from chamberopt.output.results.load import load_result

if TYPE_CHECKING:
    from chamberopt.output.results.load import Result

START = "start"


def facts(folder: str | Path) -> dict[str, Any]:
    """Everything on the page but its pictures, as JSON takes it. Raises InputError for a folder that is no result."""
    result = load_result(folder)
    study = result.data.get("study")
    start = (
        load_result(result.folder / START) if study and (result.folder / START).is_dir() else None
    )
    gain = None if start is None else _change(result.objective, start.objective, result, start)
    rows = read_trials(result.folder) if study and (result.folder / HISTORY).is_file() else []
    goal = goal_words(result.objective_name)
    return {
        "kind": result.kind,
        "name": result.folder.resolve().name,
        "made": result.data.get("created", ""),
        "answer": answer(result, start, gain),
        "question": _question(result, study),
        "metrics": _metrics(result, start),
        "front": [_compromise(one) for one in study.get("front", [])] if study else [],
        "evaluations": [_evaluation(row, goal.factor) for row in rows],
        "influence": influence(study, goal) if study and start else None,
        "coverage_against_time": {
            name: one.data.get("coverage_against_time", [])
            for name, one in _candidates(result, start)
        },
        "accuracy": accuracy_reached(result, study),
        "cost": price_paid(result, study, rows),
        "effects": _effects(result),
        "notes": _notes(result, study),
        "warnings": result.data.get("warnings"),
        "design": _design(result, start),
        "identity": {
            "part, SHA-256": result.part_sha256,
            "seed": f"{result.seeds[0]}, stream “{result.seeds[1]}”",
            **{name: str(version) for name, version in result.data.get("versions", {}).items()},
        },
    }


def _candidates(result: Result, start: Result | None) -> list[tuple[str, Result]]:
    return [("result", result)] if start is None else [("start", start), ("best", result)]


def _change(after: Estimate, before: Estimate, result: Result, start: Result) -> Estimate:
    return (
        paired_difference(after, before)
        if result.seeds == start.seeds
        else independent_difference(after, before)
    )


def _question(result: Result, study: dict[str, Any] | None) -> dict[str, Any]:
    goal, design, about = (
        goal_words(result.objective_name),
        result.design,
        result.data.get("chamber", {}),
    )
    asked: dict[str, Any] = {
        "part": design.part.mesh_path.name,
        "target": {
            name: about[name]
            for name in ("target_triangles", "target_exposed_area_mm2")
            if name in about
        },
        "shape": design.chamber.shape,
        "treatment_time_s": design.process.treatment_time,
        "objective": {
            "name": result.objective_name,
            "label": goal.label,
            "unit": goal.unit,
            "meaning": goal.meaning,
        },
        "smaller_is_better": goal.factor < 0.0,
        "constraints": [],
        "vary": [],
    }
    if not study:
        return asked
    with suppress(OSError, ValueError):
        limits = tomllib.loads((result.folder / STUDY).read_text(encoding="utf-8")).get(
            "constraints", {}
        )
        asked["constraints"] = [_limits(name, found) for name, found in limits.items()]
    asked["vary"] = [
        {
            "name": name,
            "low": low,
            "high": high,
            "start": study["start"]["parameters"][name],
            "best": study["best"]["parameters"][name],
        }
        for name, (low, high) in study["vary"].items()
    ]
    return {**asked, "evaluations": study["evaluations"], "algorithm": study["algorithm"]}


def _limits(name: str, limits: Mapping[str, float]) -> str:
    return " and ".join(
        f"{name} {'≥' if side == 'min' else '≤'} {limit:g}" for side, limit in limits.items()
    )


def _metrics(result: Result, start: Result | None) -> list[dict[str, Any]]:
    """Objective and metrics in the unit shown; change: best minus start, real where it is more than its interval."""
    named = {result.objective_name: (goal_words(result.objective_name), result.objective)}
    named |= {name: (metric_words(name), metric) for name, metric in result.metrics.items()}
    rows: list[dict[str, Any]] = []
    for name, (words, figure) in named.items():
        if name in result.metrics and words.label in [row["label"] for row in rows]:
            continue  # the objective is this very metric
        row: dict[str, Any] = {
            "name": name,
            "label": words.label,
            "unit": words.unit,
            "result": _shown(figure, words.factor),
        }
        before = None
        if start is not None:
            before = start.objective if name == result.objective_name else start.metrics.get(name)
        if start is not None and before is not None:
            change = _change(figure, before, result, start)
            real = abs(change.value) > change.half_width
            row |= {
                "start": _shown(before, words.factor),
                "change": _shown(change, words.factor),
                "real": real,
            }
        rows.append(row)
    return rows


def _shown(figure: Estimate, factor: float) -> dict[str, float]:
    return {"value": factor * figure.value, "half_width": abs(factor) * figure.half_width}


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


def _compromise(one: Mapping[str, Any]) -> dict[str, Any]:
    """One of the confirmed front of two objectives, each in the unit shown."""
    words = {name: goal_words(name) for name in one["objectives"]}
    goals = [
        {
            "label": words[name].label,
            "unit": words[name].unit,
            "result": _shown(Estimate(goal["value"], goal["half_width"]), words[name].factor),
        }
        for name, goal in one["objectives"].items()
    ]
    return {"parameters": one["parameters"], "objectives": goals}


def _effects(result: Result) -> dict[str, Any]:
    """Which effects are on, and what a pilot run estimated of each where one was run."""
    chosen = result.design.effects.model_dump(mode="json", exclude={"auto"})
    return {
        "pilot": result.data.get("effects", []),
        "effects": [
            {"effect": name, "value": _switched(name, value)} for name, value in chosen.items()
        ],
    }


def _switched(name: str, value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} = {_text(one)}" for key, one in value.items() if one is not None)
    if name == "rest" and value is None:
        return "on where something faces up"
    return "on" if value else "off"


def _notes(result: Result, study: dict[str, Any] | None) -> list[str]:
    """Whatever limits the answer: what the study is not sure of, then the notes of the simulation."""
    if not study:
        return list(result.notes)
    unsure = [
        f"constraints: {one['reason']}"
        for one in study.get("confirmed", [])
        if one["parameters"] == study["best"]["parameters"] and one.get("standing") == "not known"
    ]
    return [*unsure, *study.get("at_bounds", []), *result.notes]


def _design(result: Result, start: Result | None) -> list[dict[str, Any]]:
    """Every number of the design by its dotted name, with the start's where it is another."""
    values, before = (
        dict(_flat(result.data["design"])),
        dict(_flat(start.data["design"])) if start else {},
    )
    values["part.mesh"] = before["part.mesh"] = (
        result.design.part.mesh_path.name
    )  # no path of one machine
    return [
        {"name": name, "value": _text(value)}
        | (
            {"start": _text(before.get(name))}
            if start and _text(before.get(name)) != _text(value)
            else {}
        )
        for name, value in values.items()
    ]


def _flat(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{name}.")
        elif value not in ([], None):
            yield prefix + name, value


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    return (
        value
        if isinstance(value, str)
        else "–"
        if value is None
        else json.dumps(value, ensure_ascii=False)
    )


def design_file(folder: Path) -> tuple[str, str]:
    """Name and text of the design that the figures belong to."""
    for name in ("best.toml", "design.toml"):
        path = folder / name
        if path.is_file():
            return name, path.read_text(encoding="utf-8")
    raise InputError(
        f"{folder}: neither best.toml nor design.toml is there; give a complete results folder"
    )

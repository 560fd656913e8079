"""Write the data files of a result. Every file appears whole or not at all."""

from __future__ import annotations

import json
import math
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chamberopt.common.files import RESULT, make_folder, write_text
from chamberopt.common.npz_files import save_record
from chamberopt.common.versions import versions
from chamberopt.coverage.metrics import exposed_target, find_metric
from chamberopt.coverage.part_impacts import HITS_FILE, save_hits, sort_hits_by_triangle
from chamberopt.design.load import Design, save_design, with_paths_from
from chamberopt.optimize import pareto
from chamberopt.optimize.storage.trial_log import read_trials, trials_as_csv
from chamberopt.optimize.study.constraints import judge_zones
from chamberopt.output.results.chamber_file import CHAMBER_FILE
from chamberopt.output.results.load import FORMAT, START, content_sha256, file_sha256
from chamberopt.output.vtp_files import write_chamber, write_coverage
from chamberopt.simulation.complete_result import CandidateResult

if TYPE_CHECKING:
    from collections.abc import Sequence

    from chamberopt.chamber.build import Chamber
    from chamberopt.common.estimate import Estimate
    from chamberopt.optimize.run_study import StudyResult
    from chamberopt.optimize.run_sweep import SweepResult
    from chamberopt.simulation.effect_pilot import Advice
    from chamberopt.simulation.evaluation import Evaluation


def write_simulation(folder: Path, candidate: CandidateResult) -> dict[str, Any]:
    """Write the data files of a simulation into its empty folder; return its result.json."""
    save_design(candidate.design, folder / "design.toml")
    return {"kind": "simulation", **_write_candidate(folder, candidate)}


def write_study(
    folder: Path, study_result: StudyResult, start: CandidateResult, best: CandidateResult
) -> dict[str, Any]:
    """Add the data files of a study that has ended to its folder.

    run_study has written design.toml, study.toml and history.jsonl. This adds best.toml,
    history.csv, pareto.csv (of two objectives), the best design's coverage.vtp, part.vtp, hits.npz,
    chamber.npz, chamber.stl and chamber.vtp, and start/, a results folder of the start as confirmed
    on the same seeds.

    Returns:
        The study's result.json, which `write_result` writes.
    """
    save_design(best.design, folder / "best.toml")
    write_text(folder / "history.csv", trials_as_csv(read_trials(folder)))
    own = make_folder(folder / START)
    write_result(own, write_simulation(own, start))
    if study_result.study.objective.pareto:
        write_text(folder / "pareto.csv", pareto.as_csv(study_result))
    candidate = _write_candidate(folder, best)
    return {"kind": "study", **candidate, "study": _about_study(study_result)}


def write_sweep(folder: Path, sweep: SweepResult) -> dict[str, Any]:
    """Add the data files of a sweep that has ended to its folder; return its result.json.

    run_sweep has written design.toml, study.toml and history.jsonl. This adds history.csv and,
    unless no candidate is feasible, best.toml.
    """
    write_text(folder / "history.csv", trials_as_csv(read_trials(folder)))
    if sweep.best is not None:
        save_design(sweep.study.design.changed(sweep.best.parameters), folder / "best.toml")
    return _about_sweep(sweep)


def best_row_note(sweep: SweepResult) -> str:
    """Explain what the best row of a sweep is worth."""
    if sweep.best is None:
        return (
            "no candidate meets the constraints, so there is no best.toml: loosen the constraints "
            "or widen [vary]"
        )
    return (
        f"the best of {len(sweep.trials)} candidates is also the luckiest, so its figures are too "
        "good; for figures without this bias simulate best.toml with another process.seed, or "
        "search with chamberopt run"
    )


def write_result(
    folder: Path,
    data: dict[str, Any],
    advice: Sequence[Advice] = (),
    warned: Sequence[str] | None = None,
) -> None:
    """Write result.json, the file that makes a folder a finished result.

    Args:
        folder: of the result.
        data: what write_simulation, write_study or write_sweep returned.
        advice: why effects were chosen, if the design left the choice to the program.
        warned: warnings of `chamberopt check`; None if it was not run.
    """
    if advice:
        data = {**data, "effects": [one.as_json() for one in advice]}
    if warned is not None:
        data = {**data, "warnings": list(warned)}
    data = {**data, "files": data_digests(folder)}
    data["sha256"] = content_sha256(data)
    write_text(folder / RESULT, json.dumps(data, indent=2, allow_nan=False) + "\n")


def data_digests(folder: Path) -> dict[str, str]:
    """sha256 of each data file of a results folder; pictures, which nothing reads, are left out."""
    files = (one for one in sorted(folder.iterdir()) if one.is_file())
    skipped = RESULT, ".png"
    return {
        one.name: file_sha256(one)
        for one in files
        if not one.name.startswith(".") and not one.name.endswith(skipped)
    }


def _write_candidate(folder: Path, candidate: CandidateResult) -> dict[str, Any]:
    """Write the surfaces and impacts of one candidate; return its part of result.json."""
    design, chamber, evaluation = candidate.design, candidate.chamber, candidate.evaluation
    write_coverage(folder, chamber, candidate.element_values, candidate.display)
    hits = sort_hits_by_triangle(evaluation.hits, len(chamber.part.triangles))
    save_hits(folder / HITS_FILE, hits)
    write_chamber(folder, chamber)
    save_record(folder / CHAMBER_FILE, chamber)
    target = exposed_target(chamber)
    return {
        "format": FORMAT,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "objective": {"name": evaluation.objective_name, **_with_unit(evaluation.objective, "")},
        "metrics": {name: _with_unit_of(name, value) for name, value in evaluation.metrics.items()},
        **({"zones": _about_zones(design, chamber, evaluation)} if design.zones else {}),
        "field": _about_field(design, evaluation),
        "coverage_against_time": candidate.time_curve,
        "seed": design.process.seed,
        "stream": evaluation.stream,
        "replicas": evaluation.replicas,
        "stopped_by": evaluation.stopped_by,
        "analytic": evaluation.analytic,
        "simulated_time_s": evaluation.simulated_time,
        "collisions": evaluation.collisions,
        "timings_s": {step: round(seconds, 3) for step, seconds in evaluation.timings.items()},
        "chamber": {
            "volume_mm3": chamber.volume * 1e9,
            "target_exposed_area_mm2": float(chamber.exposed_area[target].sum() * 1e6),
            "target_triangles": int(target.sum()),
        },
        "notes": [*chamber.notes, *evaluation.notes],
        "design": _design_values(design, folder),
        "part_sha256": chamber.part.sha256,
        **({"shape_sha256": chamber.shape_sha256} if chamber.shape_sha256 else {}),
        "part_unit": chamber.part.unit,
        "versions": versions(),
    }


def _about_zones(design: Design, chamber: Chamber, evaluation: Evaluation) -> list[dict[str, Any]]:
    """Each zone, and whether its figures meet its limits; the figures are among the metrics."""
    judged = judge_zones(design, evaluation.metrics)
    return [
        {
            "name": name,
            "triangles": int(zone.sum()),
            "exposed_area_mm2": float(chamber.exposed_area[zone].sum() * 1e6),
            "reachable_share": evaluation.zones[name],
            "limits": judged[name],
        }
        for name, zone in chamber.part.zones.items()
    ]


def _about_field(design: Design, evaluation: Evaluation) -> dict[str, Any]:
    """The windows that the figures of coverage belong to, and the figures of twice the radius."""
    found = evaluation.resolution
    return {
        "gauge_mm2": design.process.accuracy.gauge_mm2,
        "points": design.process.accuracy.points,
        "dents_in_median_window": found.dents,
        "dents_needed": {
            "mean_and_std": found.needed_for_mean,
            "p05_times_intensity": found.needed_for_places,
        },
        "simulated_s_needed": {
            "mean_and_std": _number(found.time_for(found.needed_for_mean)),
            "p05_times_intensity": _number(found.time_for(found.needed_for_places)),
        },
        "reachable_share": evaluation.reachable,
        "crease_share": evaluation.crease_share,
        "alike_places": evaluation.alike,
        "double_gauge": {
            name: _with_unit_of(name, value) for name, value in evaluation.metrics_of_wide.items()
        },
    }


def _number(value: float) -> float | None:
    """None in the place of infinity, which JSON does not have."""
    return value if math.isfinite(value) else None


def _about_study(result: StudyResult) -> dict[str, Any]:
    search = [trial for trial in result.trials if trial.stage == "search"]
    few = result.study.optimizer.first_replicas
    all_of = max((trial.replicas or 0 for trial in search), default=0)
    return {
        "algorithm": result.algorithm,
        "vary": {name: list(one.ends) for name, one in result.study.vary.items()},
        "evaluations": len(search),
        "given_up": sum(one.replicas == few < all_of for one in search),
        "accuracy": {
            "search": result.study.at_search_accuracy(
                result.study.design
            ).process.accuracy.model_dump(exclude_none=True),
            "confirm": result.study.design.process.accuracy.model_dump(exclude_none=True)
            | {"replicas": result.best.evaluation.replicas},
        },
        "failed": sum(trial.objective is None for trial in search),
        "missing_a_constraint": sum(
            trial.objective is not None and not trial.feasible for trial in search
        ),
        "gain": _with_unit(result.gain, ""),
        "improved": result.improved,
        "notes": list(result.notes),
        **({"model": result.sensitivity.as_json()} if result.sensitivity else {}),
        **({"front": pareto.front_json(result)} if result.study.objective.pareto else {}),
        "best": {"searched_as": result.best.searched, "parameters": result.best.parameters},
        "start": {
            "parameters": result.start.parameters,
            "objective": _with_unit(result.start.evaluation.objective, ""),
            "metrics": {
                name: _with_unit_of(name, value)
                for name, value in result.start.evaluation.metrics.items()
            },
        },
        "confirmed": [
            {
                "searched_as": candidate.searched,
                "parameters": candidate.parameters,
                "objective": _with_unit(candidate.evaluation.objective, ""),
                "feasible": candidate.feasible,
                "standing": candidate.feasibility,
                "reason": candidate.reason,
            }
            for candidate in result.confirmed
        ],
        "seconds": round(result.seconds, 3),
    }


def _about_sweep(sweep: SweepResult) -> dict[str, Any]:
    plan, study, best = sweep.plan, sweep.study, sweep.best
    return {
        "kind": "sweep",
        "format": FORMAT,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "sweep": {
            "objective": study.objective.goals[0],
            "vary": {name: list(one.ends) for name, one in study.vary.items()},
            "method": plan.method,
            "count": plan.count,
            "seed": plan.seed,
            "candidates": len(sweep.trials),
            "failed": sum(trial.objective is None for trial in sweep.trials),
            "missing_a_constraint": sum(
                t.objective is not None and not t.feasible for t in sweep.trials
            ),
            "accuracy": study.at_search_accuracy(study.design).process.accuracy.model_dump(
                exclude_none=True
            ),
            "best": best.row() if best else None,
            "seconds": round(sweep.seconds, 3),
        },
        "notes": [best_row_note(sweep)],
        "versions": versions(),
    }


def _with_unit_of(name: str, estimate: Estimate) -> dict[str, Any]:
    metric = find_metric(name)
    return _with_unit(estimate, metric.unit if metric else "")


def _with_unit(estimate: Estimate, unit: str) -> dict[str, Any]:
    return {**estimate.to_json(), "unit": unit}


def _design_values(design: Design, folder: Path) -> dict[str, Any]:
    """Values of the design as in its file, with paths relative to the folder."""
    values: dict[str, Any] = with_paths_from(
        folder.resolve(), design.model_dump(mode="json", exclude_none=True)
    )
    return values

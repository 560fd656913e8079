"""What a run leaves on disk, and reading it back. Every file appears whole or not at all."""

from __future__ import annotations

import json
import shlex
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chamberopt.common.errors import InputError
from chamberopt.common.files import make_output_folder, write_text
from chamberopt.common.versions import versions
from chamberopt.coverage.metrics import METRICS, exposed_target
from chamberopt.coverage.part_impacts import HITS_FILE, save_hits
from chamberopt.coverage.statistics.confidence_interval import Estimate
from chamberopt.design.design import validate
from chamberopt.design.load import Design, save_design, with_paths_from
from chamberopt.optimize import pareto
from chamberopt.optimize.storage.study_folder import RESULT, is_study_folder
from chamberopt.optimize.storage.trial_log import HISTORY, read_trials, trials_as_csv
from chamberopt.simulation.evaluation import Evaluation
from chamberopt.simulation.time_curve import coverage_against_time
from chamberopt.simulation.triangle_fields import compute_triangle_fields

if TYPE_CHECKING:
    from collections.abc import Sequence

    from chamberopt.chamber.build import Chamber
    from chamberopt.optimize.run_study import StudyResult
    from chamberopt.simulation.effect_pilot import Advice

FORMAT = 1
LATER = ("time_to_98_s", "intensity_uniformity")  # metrics that results of 0.1.0 may lack


@dataclass(frozen=True)
class Result:
    """A results folder read back.

    kind: "simulation" or "study"; a study stands for its best design as confirmed. design: the candidate the
    figures belong to · data: all of result.json.
    """

    folder: Path
    kind: str
    design: Design
    objective_name: str
    objective: Estimate
    metrics: dict[str, Estimate]
    part_sha256: str
    seeds: tuple[int, str]
    notes: tuple[str, ...]
    data: dict[str, Any]


def write_simulation(
    folder: str | Path,
    design: Design,
    chamber: Chamber,
    evaluation: Evaluation,
    advice: Sequence[Advice] = (),
    warned: Sequence[str] | None = None,
) -> list[str]:
    """Leave a simulation in a new or empty folder; returns remarks, such as why a picture was skipped.

    advice: why its effects were chosen, if the design left them to us · warned: what `check` warns of, if it was asked.

    design.toml · result.json · coverage.vtp · hits.npz · chamber.stl, chamber.vtp · coverage.png.
    """
    folder = make_output_folder(folder)
    save_design(design, folder / "design.toml")
    about = _write_candidate(folder, design, chamber, evaluation)
    _write_json(folder, {"kind": "simulation", **about, **_chosen(advice), **_warned(warned)})
    return _picture([folder], [evaluation], [folder.resolve().name], folder / "coverage.png")


def write_study(
    folder: str | Path,
    study_result: StudyResult,
    advice: Sequence[Advice] = (),
    warned: Sequence[str] | None = None,
) -> list[str]:
    """Complete the folder of a study that has ended; returns remarks, such as why a picture was skipped.

    Beside design.toml, study.toml and history.jsonl, which run_study wrote: best.toml · result.json ·
    history.csv · convergence.png · the best's coverage.vtp, hits.npz, chamber.stl, chamber.vtp, coverage.png ·
    before_after.png · slices.png where there is enough to fit · pareto.csv and pareto.png of two objectives · start/, a
    results folder of the start as confirmed on the same seeds. result.json is the last: a study that is stopped while
    it writes has none, and writes all of them again.
    """
    from chamberopt.chamber.build import build_chamber
    from chamberopt.output.plots.study_and_accuracy import convergence_picture
    from chamberopt.output.plots.study_model import front_picture, slices_picture

    folder = Path(folder)
    start, best = study_result.start, study_result.best
    save_design(best.design, folder / "best.toml")
    write_text(folder / "history.csv", trials_as_csv(read_trials(folder)))
    target = study_result.target
    (folder / "start").mkdir(exist_ok=True)
    save_design(start.design, folder / "start" / "design.toml")
    chamber = build_chamber(start.design, target)
    about = _write_candidate(folder / "start", start.design, chamber, start.evaluation)
    _write_json(folder / "start", {"kind": "simulation", **about})
    about = _write_candidate(
        folder, best.design, build_chamber(best.design, target), best.evaluation
    )
    convergence_picture(folder / "convergence.png", study_result)
    if study_result.sensitivity:
        slices_picture(folder / "slices.png", study_result, study_result.sensitivity)
    if study_result.study.objective.pareto:
        write_text(folder / "pareto.csv", pareto.as_csv(study_result))
        front_picture(folder / "pareto.png", study_result)
    remarks = _picture([folder], [best.evaluation], ["best design"], folder / "coverage.png")
    pair, names = [start.evaluation, best.evaluation], ["start", "best design"]
    remarks += _picture([folder / "start", folder], pair, names, folder / "before_after.png")
    _write_json(
        folder,
        {
            "kind": "study",
            **about,
            "study": _about_study(study_result),
            **_chosen(advice),
            **_warned(warned),
        },
    )
    return list(dict.fromkeys(remarks))


def load_result(path: str | Path) -> Result:
    """Read a results folder (or its result.json). InputError when it is none, unfinished or damaged."""
    path = Path(path)
    file = path if path.name == RESULT else path / RESULT
    folder = file.parent
    if not file.is_file():
        if is_study_folder(folder) or (folder / HISTORY).is_file():
            raise InputError(
                f"{folder}: a study that did not finish: it has no {RESULT} yet; go on with: chamberopt run STUDY.toml "
                f"--out {shlex.quote(str(folder))}"
            )
        raise InputError(
            f"{folder}: not a results folder: {RESULT} is not there; give one made by simulate or run"
        )
    try:
        data = json.loads(file.read_text(encoding="utf-8"), parse_constant=_refuse_constant)
        if data["format"] != FORMAT:
            raise InputError(
                f"{file}: written in format {data['format']}, this version reads {FORMAT}; simulate again"
            )
        if data["kind"] == "sweep":
            what = "a sweep, a map of candidates that stands for no single one"
            raise InputError(
                f"{folder}: {what}; simulate the design you want of it, such as its best.toml"
            )
        return Result(
            folder=folder,
            kind=data["kind"],
            design=validate(Design, data["design"], file, mesh_must_exist=False),
            objective_name=data["objective"]["name"],
            objective=_estimate(data["objective"]),
            metrics={
                name: _estimate(data["metrics"][name])
                for name in METRICS
                if name in data["metrics"] or name not in LATER
            },
            part_sha256=data["part_sha256"],
            seeds=(data["seed"], data["stream"]),
            notes=tuple(data["notes"]),
            data=data,
        )
    except OSError as error:
        raise InputError(
            f"{file}: cannot be read: {error.strerror}; check its permissions"
        ) from None
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"{file}: damaged ({type(error).__name__}: {error}); simulate again"
        ) from None


def _write_candidate(
    folder: Path, design: Design, chamber: Chamber, evaluation: Evaluation
) -> dict[str, Any]:
    """Write the surfaces of one candidate; what there is to say of it, for result.json."""
    from chamberopt.output.viewer import COVERAGE, write_chamber, write_coverage

    write_coverage(folder / COVERAGE, chamber, compute_triangle_fields(design, chamber, evaluation))
    if evaluation.sorted_hits is not None:
        save_hits(folder / HITS_FILE, evaluation.sorted_hits)
    write_chamber(folder, chamber)
    return _about(folder, design, chamber, evaluation)


def _picture(
    folders: list[Path], evaluations: list[Evaluation], names: list[str], picture: Path
) -> list[str]:
    from chamberopt.output.viewer import coverage_picture

    titles = [
        f"{name}\n{summary(evaluation)}"
        for name, evaluation in zip(names, evaluations, strict=True)
    ]
    trouble = coverage_picture(folders, titles, picture)
    return [trouble] if trouble else []


def summary(evaluation: Evaluation | Result) -> str:
    """One line: the objective with its interval, mean and spread of coverage."""
    goal = evaluation.objective
    mean, spread = (evaluation.metrics[name] for name in ("mean_coverage", "std_coverage"))
    name = evaluation.objective_name.replace("_", " ")
    figures = f"mean {_share(mean)}   std {_share(spread)}"
    return f"{name} {goal.value:.3f} ± {goal.half_width:.3f}   {figures}"


def _share(estimate: Estimate) -> str:
    return f"{100.0 * estimate.value:.1f} ± {100.0 * estimate.half_width:.1f} %"


def _about(
    folder: Path, design: Design, chamber: Chamber, evaluation: Evaluation
) -> dict[str, Any]:
    target = exposed_target(chamber)
    return {
        "format": FORMAT,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "objective": {"name": evaluation.objective_name, **_plain(evaluation.objective, "")},
        "metrics": {
            name: _plain(value, METRICS[name].unit) for name, value in evaluation.metrics.items()
        },
        "coverage_against_time": coverage_against_time(design, chamber, evaluation),
        "seed": design.process.seed,
        "stream": evaluation.stream,
        "replicas": len(evaluation.replicas),
        "stopped_by": evaluation.stopped_by,
        "analytic": evaluation.analytic,
        "simulated_time_s": evaluation.total.simulated_time,
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
        **({"shape_sha256": design.chamber.sha256} if design.chamber.sha256 else {}),
        "part_unit": chamber.part.unit,
        "versions": versions(),
    }


def _chosen(advice: Sequence[Advice]) -> dict[str, Any]:
    """What a pilot said of each effect of a design that left them to us: result.json's "effects"."""
    return {"effects": [one.as_json() for one in advice]} if advice else {}


def _warned(warned: Sequence[str] | None) -> dict[str, Any]:
    return {} if warned is None else {"warnings": list(warned)}


def _about_study(result: StudyResult) -> dict[str, Any]:
    search = [trial for trial in result.trials if trial.stage == "search"]
    return {
        "algorithm": result.algorithm,
        "vary": {name: list(bounds) for name, bounds in result.study.vary.items()},
        "evaluations": len(search),
        "accuracy": {
            "search": result.study.at_search_accuracy(
                result.study.design
            ).process.accuracy.model_dump(exclude_none=True),
            "confirm": result.study.design.process.accuracy.model_dump(exclude_none=True)
            | {"replicas": len(result.best.evaluation.replicas)},
        },
        "failed": sum(trial.objective is None for trial in search),
        "missing_a_constraint": sum(
            trial.objective is not None and not trial.feasible for trial in search
        ),
        "gain": _plain(result.gain, ""),
        "improved": result.improved,
        "at_bounds": list(result.at_bounds),
        **({"model": result.sensitivity.as_json()} if result.sensitivity else {}),
        **({"front": pareto.as_json(result)} if result.study.objective.pareto else {}),
        "best": {"searched_as": result.best.searched, "parameters": result.best.parameters},
        "start": {
            "parameters": result.start.parameters,
            "objective": _plain(result.start.evaluation.objective, ""),
            "metrics": {
                name: _plain(value, METRICS[name].unit)
                for name, value in result.start.evaluation.metrics.items()
            },
        },
        "confirmed": [
            {
                "searched_as": candidate.searched,
                "parameters": candidate.parameters,
                "objective": _plain(candidate.evaluation.objective, ""),
                "feasible": candidate.feasible,
                "standing": candidate.feasibility,
                "reason": candidate.reason,
            }
            for candidate in result.confirmed
        ],
        "seconds": round(result.seconds, 3),
    }


def _plain(estimate: Estimate, unit: str) -> dict[str, Any]:
    """An estimate as JSON; the pseudo-values let two results be compared with an interval later."""
    return {
        "value": estimate.value,
        "half_width": estimate.half_width,
        "unit": unit,
        "pseudovalues": list(estimate.pseudovalues),
        "bias": estimate.bias,
    }


def _estimate(data: dict[str, Any]) -> Estimate:
    pseudovalues = tuple(float(x) for x in data["pseudovalues"])
    return Estimate(
        float(data["value"]), float(data["half_width"]), pseudovalues, float(data.get("bias", 0.0))
    )


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is no figure")


def _design_values(design: Design, folder: Path) -> dict[str, Any]:
    """The design as its file would say it, its files relative to the folder."""
    values: dict[str, Any] = with_paths_from(
        folder.resolve(), design.model_dump(mode="json", exclude_none=True)
    )
    return values


def _write_json(folder: Path, data: dict[str, Any]) -> None:
    write_text(folder / RESULT, json.dumps(data, indent=2, allow_nan=False) + "\n")

"""Read results folders."""

from __future__ import annotations

import json
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate
from chamberopt.coverage.metrics import METRICS
from chamberopt.design.design import validate
from chamberopt.design.load import Design
from chamberopt.optimize.storage.study_folder import RESULT, is_study_folder
from chamberopt.optimize.storage.trial_log import HISTORY
from chamberopt.output.vtp_files import COVERAGE, Surface, read_surface

if TYPE_CHECKING:
    from chamberopt.simulation.evaluation import Evaluation

FORMAT = 1


@dataclass(frozen=True)
class Result:
    """A results folder that has been read.

    kind: "simulation" or "study"; a study stands for its best design as confirmed.
    design: the candidate that the figures belong to.
    seeds: process.seed and the name of the random stream.
    data: everything in result.json.
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


def load_result(path: str | Path) -> Result:
    """Read a results folder, given itself or its result.json.

    Raises:
        InputError: it is not a results folder, or unfinished, or damaged.
    """
    path = Path(path)
    file = path if path.name == RESULT else path / RESULT
    folder = file.parent
    if not file.is_file():
        if is_study_folder(folder) or (folder / HISTORY).is_file():
            raise InputError(
                f"{folder}: this study has not finished, {RESULT} is missing; continue it with: "
                f"chamberopt run STUDY.toml --out {shlex.quote(str(folder))}"
            )
        raise InputError(
            f"{folder}: not a results folder, {RESULT} is missing; give one made by simulate or run"
        )
    try:
        data = json.loads(file.read_text(encoding="utf-8"), parse_constant=_refuse_constant)
        if data["format"] != FORMAT:
            raise InputError(
                f"{file}: written in format {data['format']}, this version reads {FORMAT}; "
                "simulate again"
            )
        if data["kind"] == "sweep":
            raise InputError(
                f"{folder}: a sweep is a map of many candidates, not the result of one; simulate "
                "the design that you want from it, such as its best.toml"
            )
        return Result(
            folder=folder,
            kind=data["kind"],
            design=validate(Design, data["design"], file, mesh_must_exist=False),
            objective_name=data["objective"]["name"],
            objective=_read_estimate(data["objective"]),
            metrics={
                name: _read_estimate(data["metrics"][name])
                for name, metric in METRICS.items()
                if name in data["metrics"] or metric.required
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


def load_coverage(result: Result) -> Surface:
    """Read the coverage.vtp of a result; InputError if missing, damaged or another result's."""
    surface = read_surface(result.folder / COVERAGE)
    require_matching_coverage(
        result.folder,
        surface,
        result.data["chamber"]["target_triangles"],
        result.metrics["impacts_per_mm2_s"].value * result.design.process.treatment_time,
    )
    return surface


def require_matching_coverage(
    folder: Path, surface: Surface, target_triangles: int, impacts_per_mm2: float
) -> None:
    """Raise InputError unless coverage.vtp has the target and impacts that result.json records.

    Args:
        folder: of the result.
        surface: read from its coverage.vtp.
        target_triangles: exposed triangles of the target, by result.json.
        impacts_per_mm2: mean over the target at the treatment time, by result.json.
    """
    target = (np.asarray(surface["target"]) > 0) & (np.asarray(surface["exposed_area_mm2"]) > 0.0)
    area = np.asarray(surface["exposed_area_mm2"])[target]
    impacts = np.asarray(surface["impacts_per_mm2"])[target]
    mean = float((area * impacts).sum() / area.sum()) if len(area) else 0.0
    if len(area) != target_triangles or not np.isclose(mean, impacts_per_mm2, rtol=1e-6):
        raise InputError(
            f"{folder / COVERAGE}: of another result than result.json: a target of {len(area)} "
            f"triangles with {mean:.6g} impacts per mm², not {target_triangles} with "
            f"{impacts_per_mm2:.6g}; simulate again"
        )


def summary(evaluation: Evaluation | Result) -> str:
    """Return one line with the objective and its interval, and mean and spread of coverage."""
    goal = evaluation.objective
    mean, spread = (evaluation.metrics[name] for name in ("mean_coverage", "std_coverage"))
    name = evaluation.objective_name.replace("_", " ")
    figures = f"mean {_share(mean)}   std {_share(spread)}"
    return f"{name} {goal.value:.3f} ± {goal.half_width:.3f}   {figures}"


def _share(estimate: Estimate) -> str:
    return f"{100.0 * estimate.value:.1f} ± {100.0 * estimate.half_width:.1f} %"


def _read_estimate(data: dict[str, Any]) -> Estimate:
    """An estimate of a result, which always has a value and a half-width."""
    if data["value"] is None or data["half_width"] is None:
        raise ValueError("an estimate without a value or half_width")
    return Estimate.from_json(data)


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not a number")

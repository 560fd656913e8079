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
from chamberopt.common.number_text import estimate_text
from chamberopt.coverage.metrics import METRICS
from chamberopt.design.design import validate
from chamberopt.design.load import Design
from chamberopt.optimize.storage.study_folder import RESULT, is_study_folder
from chamberopt.optimize.storage.trial_log import HISTORY
from chamberopt.output.vtp_files import (
    COVERAGE,
    ELEMENT_COLUMNS,
    FIELD_COLUMNS,
    OF_ELEMENT,
    PART,
    Surface,
    read_surface,
)

if TYPE_CHECKING:
    from chamberopt.simulation.evaluation import Evaluation

FORMAT = 2


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


def load_part(result: Result) -> Surface:
    """Read the part.vtp of a result; InputError if missing, damaged or another result's."""
    return read_part(
        result.folder,
        result.data["chamber"]["target_triangles"],
        result.metrics["impacts_per_mm2_s"].value * result.data["simulated_time_s"],
    )


def read_part(folder: Path, target_triangles: int, impacts_per_mm2: float) -> Surface:
    """Read part.vtp; InputError unless it has the target and impacts that result.json records.

    Args:
        folder: of the result.
        target_triangles: exposed triangles of the target, by result.json.
        impacts_per_mm2: simulated, mean over the target, by result.json.
    """
    part = read_surface(folder / PART, ELEMENT_COLUMNS)
    target = (part["target"] > 0) & (part["exposed_area_mm2"] > 0.0)
    mean = part["impacts"][target].sum() / max(part["exposed_area_mm2"][target].sum(), 1e-300)
    if target.sum() != target_triangles or not np.isclose(mean, impacts_per_mm2, rtol=1e-6):
        raise InputError(
            f"{folder / PART}: of another result than result.json: a target of {target.sum()} "
            f"triangles with {mean:.6g} impacts per mm², not {target_triangles} with "
            f"{impacts_per_mm2:.6g}; simulate again"
        )
    return part


def read_field(folder: Path, part: Surface) -> Surface:
    """Read coverage.vtp; InputError unless it belongs to the part.vtp beside it."""
    field = read_surface(folder / COVERAGE, ("triangle", *OF_ELEMENT), FIELD_COLUMNS)
    triangle = np.asarray(field["triangle"])
    covers_all = np.array_equal(np.unique(triangle), np.arange(part.n_cells))
    if not covers_all or (part["impacts"][triangle] != field["element_impacts"]).any():
        raise InputError(
            f"{folder / COVERAGE}: of another result than the part.vtp beside it; simulate again"
        )
    return field


def summary(evaluation: Evaluation | Result) -> str:
    """Return one line with the objective and its interval, and mean and spread of coverage."""
    mean, spread = (evaluation.metrics[name] for name in ("mean_coverage", "std_coverage"))
    name = evaluation.objective_name.replace("_", " ")
    shares = f"mean {estimate_text(mean, 100.0, '%')}   std {estimate_text(spread, 100.0, '%')}"
    return f"{name} {estimate_text(evaluation.objective)}   {shares}"


def _read_estimate(data: dict[str, Any]) -> Estimate:
    """An estimate of a result: a value with a half-width, or words."""
    found = Estimate.from_json(data)
    if data["value"] is None or (data["half_width"] is None and not found.in_words):
        raise ValueError("an estimate without a value or half_width")
    return found


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not a number")

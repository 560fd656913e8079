"""Run a convergence study and save it as a table (.csv), as JSON and as a picture.

The study measures how the error of coverage etc. falls with the computing time of a simulation.
"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chamberopt.common.estimate import finite_or_none
from chamberopt.common.files import csv_text, write_text
from chamberopt.common.versions import versions
from chamberopt.design.load import save_design
from chamberopt.documents.accuracy import describe_error_law, describe_reference
from chamberopt.pictures.charts.accuracy import accuracy_picture
from chamberopt.results.command_records import (
    ConvergenceRecord,
    ErrorLawRecord,
    HalvingRecord,
    RecommendationRecord,
    ReferenceRecord,
    write_record,
)
from chamberopt.simulation.convergence import describe_cost, run_convergence_study
from chamberopt.simulation.recommendation import ACCURACIES, Recommendation, recommend
from chamberopt.workflows.simulate import Teller

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from chamberopt.simulation.convergence import ConvergenceStudy


def measure_accuracy(
    design: Design, budget_s: float, folder: Path, executor: Executor, teller: Teller
) -> ConvergenceStudy:
    """Run a convergence study of about `budget_s` CPU seconds, and save it in an empty folder.

    Raises InputError for a design with steps.
    """

    def compile_it(one: Design, chamber: Chamber) -> None:
        teller.compile(one, chamber, None)

    design.require_one_step("a convergence study")
    teller.tell(describe_cost(budget_s))
    study = run_convergence_study(design, budget_s, executor, compile_it, teller.tell)
    with teller.step("writing and drawing"):
        save_accuracy(folder, study)
    return study


def save_accuracy(folder: Path, study: ConvergenceStudy) -> None:
    """Write accuracy.json, accuracy.csv, accuracy.png and design.toml into an empty folder."""
    save_design(study.design, folder / "design.toml")
    write_text(folder / "accuracy.csv", csv_text(rows(study)))
    write_record(folder / "accuracy.json", convergence_record(study))
    accuracy_picture(folder / "accuracy.png", study)


def convergence_record(study: ConvergenceStudy) -> ConvergenceRecord:
    """Return the content of accuracy.json for an accuracy study."""
    law = study.law
    times, low, high = (law and law.halving) or (None, None, None)
    return ConvergenceRecord(
        format=4,
        reference=ReferenceRecord(text=describe_reference(study), settings=study.settings),
        rows=rows(study),
        law=ErrorLawRecord(
            scale=law.scale, power=law.power, power_half_width=finite_or_none(law.half_width)
        )
        if law
        else None,
        halving=HalvingRecord(times=times, low=low, high=high, text=describe_error_law(study)),
        recommendations=[_recommendation(recommend(study, one)) for one in ACCURACIES],
        left_out=list(study.left_out),
        cpu_s=study.cpu_s,
        wall_s=study.wall_s,
        design=study.design.model_dump(mode="json", exclude_none=True, exclude={"part": {"mesh"}}),
        versions=versions(),
    )


def _recommendation(advice: Recommendation) -> RecommendationRecord:
    values = asdict(advice) | {
        "cpu_s": advice.cpu_s if advice.replicas else None,
        "remarks": list(advice.remarks),
        "lines": list(advice.lines),
    }
    return RecommendationRecord(**values)


def rows(study: ConvergenceStudy) -> list[dict[str, object]]:
    """Return the rows of accuracy.csv: a row for each simulation and each number of its replicas.

    A value is None where its column does not apply.
    """
    runs, sizes = [], []
    for run in (study.reference, *study.runs):
        row: dict[str, Any] = {
            "parameter": run.parameter,
            "setting": run.setting,
            "replicas": run.replicas,
            "cpu_times_reference": run.cpu.value / study.reference.cpu.value,
        }
        names = ("cpu_s", "objective", "mean_coverage", "bias", "bias_mean_coverage")
        values = (run.cpu, run.objective, run.mean, run.bias, run.mean_bias)
        for name, value in zip(names, values, strict=True):
            row |= {name: value.value, f"{name}_half_width": value.half_width}
        runs.append(row)
    for size in study.sizes:
        row = {"parameter": "replicas", "setting": str(size.replicas), "replicas": size.replicas}
        row |= {"cpu_s": size.cpu_s, "rms_error": size.rms}
        row |= dict(zip(("rms_low", "rms_high"), size.interval, strict=True))
        sizes.append(row | {"mean_half_width": size.half_width, "batches": size.batches})
    columns = dict.fromkeys((*runs[0], *sizes[0]))
    return [columns | row for row in (*runs, *sizes)]

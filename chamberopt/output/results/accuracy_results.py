"""Results of a convergence study: text to read, a table (.csv), everything as JSON, a picture."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from chamberopt.common.estimate import Estimate
from chamberopt.common.files import write_text
from chamberopt.common.versions import versions
from chamberopt.design.load import save_design
from chamberopt.output.plots.accuracy import accuracy_picture
from chamberopt.simulation.convergence.parameters import FACETS, setting_text, short_name
from chamberopt.simulation.convergence.recommendation import ACCURACIES, recommend
from chamberopt.simulation.convergence.runs import Run
from chamberopt.simulation.convergence.study import ConvergenceStudy

FORMAT = 2


def write_accuracy_results(folder: Path, study: ConvergenceStudy) -> None:
    """Leave accuracy.json, accuracy.csv, accuracy.png and the design in an empty folder."""
    save_design(study.design, folder / "design.toml")
    table = io.StringIO()
    writer = csv.DictWriter(table, list(rows(study)[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows(study))
    write_text(folder / "accuracy.csv", table.getvalue())
    write_text(
        folder / "accuracy.json", json.dumps(accuracy_json(study), indent=2, allow_nan=False) + "\n"
    )
    accuracy_picture(folder / "accuracy.png", study)


def rows(study: ConvergenceStudy) -> list[dict[str, Any]]:
    """One row a run and a batch size, with the same columns; None where a column does not apply."""
    columns = ("rms_error", "rms_low", "rms_high", "mean_half_width", "batches")
    runs = [
        _run_row(run, study.reference) | dict.fromkeys(columns)
        for run in (study.reference, *study.runs, *study.models)
    ]
    sizes = [
        dict.fromkeys(runs[0])
        | {
            "parameter": "replicas",
            "setting": str(size.replicas),
            "replicas": size.replicas,
            "cpu_s": size.cpu_s,
            "rms_error": size.rms,
            "rms_low": size.low,
            "rms_high": size.high,
            "mean_half_width": size.half_width,
            "batches": size.batches,
        }
        for size in study.sizes
    ]
    return [*runs, *sizes]


def _run_row(run: Run, reference: Run) -> dict[str, Any]:
    row: dict[str, Any] = {
        "parameter": run.parameter,
        "setting": run.setting,
        "replicas": run.replicas,
        "cpu_times_reference": run.cpu.value / reference.cpu.value,
    }
    for name, value in (
        ("cpu_s", run.cpu),
        ("objective", run.objective),
        ("mean_coverage", run.mean),
        ("bias", run.bias),
        ("bias_mean_coverage", run.mean_bias),
    ):
        row |= {name: value.value, f"{name}_half_width": value.half_width}
    return row


def accuracy_text(study: ConvergenceStudy) -> list[str]:
    """The lines that the command prints."""
    lines = [describe_reference(study), ""]
    lines.append(
        f"{'replicas':>10}{'CPU s':>9}{'RMS error':>12}{'95 % interval':>20}{'own interval':>15}"
    )
    lines += [
        f"{size.replicas:10}{size.cpu_s:9.2f}{size.rms:12.4f}{size.low:11.4f} .. {size.high:.4f}"
        f"{f'± {size.half_width:.4f}':>15}"
        for size in study.sizes
    ]
    lines += [describe_error_law(study), ""]
    lines.append(
        f"{'parameter':24}{'setting':>24}{'CPU s a replica':>19}"
        f"{'bias of objective':>21}{'of mean coverage':>21}"
    )
    for run in (*study.runs, *study.models):
        cpu = f"{run.cpu.value:.3f} ± {run.cpu.half_width:.3f}"
        lines.append(
            f"{short_name(run.parameter):24}{run.setting:>24}{cpu:>19}"
            f"{_signed(run.bias):>21}{_signed(run.mean_bias):>21}"
        )
    if study.models:
        lines.append(
            f"the last {len(study.models)}: from the same impacts of {study.model_time:.3g} s of "
            "treatment"
        )
    for accuracy in ACCURACIES:
        lines += ["", *recommend(study, accuracy).lines]
    return [
        *lines,
        "",
        f"{study.cpu_s:.0f} CPU s of simulation, {study.wall_s:.0f} s in all with compiling",
    ]


def _signed(bias: Estimate) -> str:
    exact = bias.value == bias.half_width == 0.0
    return "0" if exact else f"{bias.value:+.4f} ± {bias.half_width:.4f}"


def accuracy_json(study: ConvergenceStudy) -> dict[str, Any]:
    """Everything, for accuracy.json."""
    law = study.law
    middle, low, high = law.halving
    recommendations = []
    for accuracy in ACCURACIES:
        advice = recommend(study, accuracy)
        row = {**asdict(advice), "lines": advice.lines}
        recommendations.append(row if advice.replicas else row | {"cpu_s": None})
    return {
        "format": FORMAT,
        "reference": {"text": describe_reference(study), "settings": study.settings},
        "rows": rows(study),
        "law": {"scale": law.scale, "power": law.power, "power_half_width": law.half_width},
        "halving": {
            "times": middle,
            "low": low,
            "high": min(high, 1e9),  # JSON has no infinity
            "text": describe_error_law(study),
        },
        "dent_time_s": study.model_time,
        "recommendations": recommendations,
        "cpu_s": study.cpu_s,
        "wall_s": study.wall_s,
        "design": study.design.model_dump(
            mode="json", exclude_none=True, exclude={"part": {"mesh"}}
        ),
        "versions": versions(),
    }


def describe_reference(study: ConvergenceStudy) -> str:
    """Settings and estimates of the reference."""
    run = study.reference
    settings = ", ".join(
        f"{short_name(name)} {setting_text(value)}" for name, value in study.settings.items()
    )
    walls = ""
    if FACETS in study.settings:
        walls = (
            f"; no chamber here has a round wall, so {FACETS} can only be compared with the finest"
        )
    return (
        f"reference: {run.replicas} replicas with {settings}: objective {run.objective.value:.4f} "
        f"± {run.objective.half_width:.2g}, mean coverage {run.mean.value:.4f} ± "
        f"{run.mean.half_width:.2g}, in {run.replicas * run.cpu.value:.0f} CPU s{walls}"
    )


def describe_error_law(study: ConvergenceStudy) -> str:
    """The cost of halving the error, and the reason if it is not 4."""
    law, sizes = study.law, study.sizes
    middle, low, high = law.halving
    merged = [str(size.replicas) for size in sizes if size.are_merged]
    left_out = len(merged) <= len(sizes) - 2
    reason = "as independent replicas should: 4"
    if high < 4.0:
        reason = "less than the 4 of independent replicas"
        if not left_out:
            reason += ", because triangles are merged where dents are few, and more replicas end it"
    elif low > 4.0:
        estimating = 1.0 - sizes[-1].replicas * study.reference.cpu.value / sizes[-1].cpu_s
        reason = (
            "more than the 4 of independent replicas: some replicas differ much from the others, "
            f"or the estimate, {estimating:.0%} of the largest batch's time, takes too long"
        )
    text = (
        f"more replicas alone: halving the error costs {middle:.2f} times as much "
        f"({low:.2f} to {high:.2f}), {reason} "
        f"(error ~ cost^-{law.power:.2f} ± {law.half_width:.2f})"
    )
    if merged and left_out:
        text += (
            f"; {', '.join(merged)} replicas are left out, because triangles are merged where "
            "dents are few"
        )
    return text

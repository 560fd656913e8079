"""Results of a convergence study: text to read, a table (.csv), everything as JSON, a picture."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from chamberopt.common.estimate import Estimate
from chamberopt.common.files import csv_text, write_text
from chamberopt.common.versions import versions
from chamberopt.design.load import save_design
from chamberopt.pictures.charts.accuracy import accuracy_picture
from chamberopt.simulation.convergence import FACETS, ConvergenceStudy, setting_text, short_name
from chamberopt.simulation.recommendation import ACCURACIES, recommend

FORMAT = 3


def write_accuracy_results(folder: Path, study: ConvergenceStudy) -> None:
    """Leave accuracy.json, accuracy.csv, accuracy.png and the design in an empty folder."""
    save_design(study.design, folder / "design.toml")
    write_text(folder / "accuracy.csv", csv_text(rows(study)))
    text = json.dumps(accuracy_json(study), indent=2, allow_nan=False)
    write_text(folder / "accuracy.json", text + "\n")
    accuracy_picture(folder / "accuracy.png", study)


def rows(study: ConvergenceStudy) -> list[dict[str, Any]]:
    """One row a run and a batch size, with the same columns; None where a column does not apply."""
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


def accuracy_text(study: ConvergenceStudy) -> list[str]:
    """The lines that the command prints."""
    lines = [
        describe_reference(study),
        "",
        f"{'replicas':>10}{'CPU s':>9}{'RMS error':>12}{'95 % interval':>20}{'own interval':>15}",
    ]
    for size in study.sizes:
        low, high = size.interval
        lines.append(
            f"{size.replicas:10}{size.cpu_s:9.2f}{size.rms:12.4f}{low:11.4f} .. {high:.4f}"
            f"{f'± {size.half_width:.4f}':>15}"
        )
    lines += [
        describe_error_law(study),
        "",
        f"{'parameter':24}{'setting':>24}{'CPU s a replica':>19}"
        f"{'bias of objective':>21}{'of mean coverage':>21}",
    ]
    for run in study.runs:
        cpu = f"{run.cpu.value:.3f} ± {run.cpu.half_width:.3f}"
        biases = "".join(f"{_signed(bias):>21}" for bias in (run.bias, run.mean_bias))
        lines.append(f"{short_name(run.parameter):24}{run.setting:>24}{cpu:>19}{biases}")
    for accuracy in ACCURACIES:
        lines += ["", *recommend(study, accuracy).lines]
    total = f"{study.cpu_s:.0f} CPU s of simulation, {study.wall_s:.0f} s in all with compiling"
    return [*lines, "", total]


def _signed(bias: Estimate) -> str:
    exact = bias.value == bias.half_width == 0.0
    return "0" if exact else f"{bias.value:+.4f} ± {bias.half_width:.4f}"


def accuracy_json(study: ConvergenceStudy) -> dict[str, Any]:
    """Everything, for accuracy.json."""
    law, law_text = study.law, describe_error_law(study)
    middle, low, high = law.halving
    recommendations = []
    for accuracy in ACCURACIES:
        advice = recommend(study, accuracy)
        cpu_s = advice.cpu_s if advice.replicas else None
        recommendations.append({**asdict(advice), "cpu_s": cpu_s, "lines": advice.lines})
    design = study.design.model_dump(mode="json", exclude_none=True, exclude={"part": {"mesh"}})
    return {
        "format": FORMAT,
        "reference": {"text": describe_reference(study), "settings": study.settings},
        "rows": rows(study),
        "law": {"scale": law.scale, "power": law.power, "power_half_width": law.half_width},
        # JSON has no infinity.
        "halving": {"times": middle, "low": low, "high": min(high, 1e9), "text": law_text},
        "recommendations": recommendations,
        "cpu_s": study.cpu_s,
        "wall_s": study.wall_s,
        "design": design,
        "versions": versions(),
    }


def describe_reference(study: ConvergenceStudy) -> str:
    """Settings and estimates of the reference."""
    run = study.reference
    settings = ", ".join(
        f"{short_name(name)} {setting_text(value)}" for name, value in study.settings.items()
    )
    walls = f"; no chamber here has a round wall, so {FACETS} can only be compared with the finest"
    remark = walls if FACETS in study.settings else ""
    return (
        f"reference: {run.replicas} replicas with {settings}: objective {run.objective.value:.4f} "
        f"± {run.objective.half_width:.2g}, mean coverage {run.mean.value:.4f} ± "
        f"{run.mean.half_width:.2g}, in {run.replicas * run.cpu.value:.0f} CPU s{remark}"
    )


def describe_error_law(study: ConvergenceStudy) -> str:
    """The cost of halving the error, and the reason if it is not 4."""
    law, sizes = study.law, study.sizes
    middle, low, high = law.halving
    unresolved = [str(size.replicas) for size in sizes if not size.is_resolved]
    left_out = len(unresolved) <= len(sizes) - 2
    reason = "as independent replicas should: 4"
    if high < 4.0:
        reason = "less than the 4 of independent replicas"
        if not left_out:
            reason += ", because the windows have too few dents, and more replicas end it"
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
    if unresolved and left_out:
        text += (
            f"; {', '.join(unresolved)} replicas are left out, because their windows have too few "
            "dents"
        )
    return text

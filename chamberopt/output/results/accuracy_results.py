"""The ladder of accuracy on paper: a table to read, rows for a spreadsheet, everything as JSON, and the diagram."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from chamberopt.common.files import write_text
from chamberopt.common.versions import versions
from chamberopt.coverage.statistics.confidence_interval import Estimate
from chamberopt.design.load import save_design
from chamberopt.output.plots.accuracy import accuracy_picture
from chamberopt.simulation.convergence.recommendation import (
    ASKED,
    choices,
    described,
    explained,
    recommend,
    short,
    unrecorded,
)
from chamberopt.simulation.convergence.runs import Run
from chamberopt.simulation.convergence.study import ConvergenceStudy

FORMAT = 1


def rows(ladder: ConvergenceStudy) -> list[dict[str, Any]]:
    """Every rung and every level of replicas, one kind of row for all; None where a column says nothing."""
    found = [
        _rung_row(rung, ladder.reference)
        for rung in (ladder.reference, *ladder.rungs, *ladder.dents)
    ]
    for level in ladder.levels:
        found.append(
            dict.fromkeys(found[0])
            | {
                "knob": "replicas",
                "setting": str(level.replicas),
                "replicas": level.replicas,
                "cpu_s": level.cpu_s,
                "rms_error": level.rms,
                "rms_low": level.low,
                "rms_high": level.high,
                "half_width_said": level.said,
                "sub_pools": level.blocks,
            }
        )
    return found


def _rung_row(rung: Run, reference: Run) -> dict[str, Any]:
    return {
        "knob": rung.knob,
        "setting": rung.setting,
        "replicas": rung.replicas,
        "cpu_s": rung.cpu.value,
        "cpu_s_half_width": rung.cpu.half_width,
        "cpu_times_reference": rung.cpu.value / reference.cpu.value,
        "objective": rung.objective.value,
        "objective_half_width": rung.objective.half_width,
        "mean_coverage": rung.mean.value,
        "mean_coverage_half_width": rung.mean.half_width,
        "bias": rung.bias.value,
        "bias_half_width": rung.bias.half_width,
        "bias_mean_coverage": rung.mean_bias.value,
        "bias_mean_coverage_half_width": rung.mean_bias.half_width,
        "rms_error": None,
        "rms_low": None,
        "rms_high": None,
        "half_width_said": None,
        "sub_pools": None,
    }


def as_text(ladder: ConvergenceStudy) -> list[str]:
    """What the command prints."""
    lines = [described(ladder), ""]
    lines += [f"{'replicas':>10}{'CPU s':>9}{'RMS error':>12}{'95 % interval':>20}{'± said':>10}"]
    for one in ladder.levels:
        lines += [
            f"{one.replicas:10}{one.cpu_s:9.2f}{one.rms:12.4f}{one.low:11.4f} .. {one.high:.4f}{one.said:10.4f}"
        ]
    lines += [explained(ladder), unrecorded(ladder), ""]
    lines += [
        f"{'knob':24}{'setting':>24}{'CPU s a replica':>19}{'bias of objective':>21}{'of mean coverage':>21}"
    ]
    for rung in (*ladder.rungs, *ladder.dents):
        cpu = f"{rung.cpu.value:.3f} ± {rung.cpu.half_width:.3f}"
        lines += [
            f"{short(rung.knob):24}{rung.setting:>24}{cpu:>19}{_signed(rung.bias):>21}{_signed(rung.mean_bias):>21}"
        ]
    if ladder.dents:
        lines += [
            f"the last {len(ladder.dents)}: from the same impacts of {ladder.dent_time:.3g} s of treatment"
        ]
    lines += ["", "Pareto front (CPU s, error as the half-width of a 95 % interval, with bias):"]
    lines += [f"{one.cpu_s:10.2f}{one.error:10.4f}   {one.name}" for one in choices(ladder)]
    for accuracy in ASKED:
        lines += ["", *recommend(ladder, accuracy).lines]
    spent = f"{ladder.spent_s:.0f} CPU s were spent on simulating, {ladder.wall_s:.0f} s by the clock, compiling included"
    return [*lines, "", spent]


def _signed(bias: Estimate) -> str:
    return (
        "0"
        if bias.value == bias.half_width == 0.0
        else f"{bias.value:+.4f} ± {bias.half_width:.4f}"
    )


def as_json(ladder: ConvergenceStudy) -> dict[str, Any]:
    """Everything, for accuracy.json."""
    power, halving = ladder.law, ladder.law.halving
    front = [asdict(one) for one in choices(ladder)]
    advice = [
        {**asdict(one), "lines": one.lines}
        for one in (recommend(ladder, accuracy) for accuracy in ASKED)
    ]
    for one in advice:  # JSON has no infinity
        if not one["replicas"]:
            one["cpu_s"] = one["half_width"] = None
    return {
        "format": FORMAT,
        "reference": {"said": described(ladder), "settings": ladder.settings},
        "rows": rows(ladder),
        "law": {"scale": power.scale, "power": power.power, "power_half_width": power.half_width},
        "halving": {
            "times": halving[0],
            "low": halving[1],
            "high": min(halving[2], 1e9),
            "said": explained(ladder),
        },
        "a_replica": unrecorded(ladder),
        "dent_time_s": ladder.dent_time,
        "front": front,
        "recommendations": advice,
        "cpu_s": ladder.spent_s,
        "wall_s": ladder.wall_s,
        "design": ladder.design.model_dump(
            mode="json", exclude_none=True, exclude={"part": {"mesh"}}
        ),
        "versions": versions(),
    }


def write_accuracy_results(folder: Path, ladder: ConvergenceStudy) -> None:
    """Leave accuracy.json, accuracy.csv, accuracy.png and the design in an empty folder."""
    save_design(ladder.design, folder / "design.toml")
    table = io.StringIO()
    writer = csv.DictWriter(table, list(rows(ladder)[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows(ladder))
    write_text(folder / "accuracy.csv", table.getvalue())
    write_text(
        folder / "accuracy.json", json.dumps(as_json(ladder), indent=2, allow_nan=False) + "\n"
    )
    accuracy_picture(folder / "accuracy.png", ladder)

"""The made-up measurement of docs/how_to/blind_prediction.md, and how to compare a measurement.

    python -m benchmarks.blind_prediction measure RESULT STRIP --out measured.toml
    python -m benchmarks.blind_prediction compare RESULT STRIP measured.toml

RESULT is a folder of `chamberopt simulate`, STRIP one of `chamberopt strip`, both of one design.
`measure` writes MADE-UP values: what the hidden machine of benchmarks/made_up_shop.py would give
in the design of RESULT, at the times that were predicted, with the errors that `chamberopt
calibrate` assumes for readings. A shop writes the same file with what it measured. `compare` gives

    E_n = (measured - predicted) / sqrt(half-width of the one squared + that of the other squared)

for each figure, with half-widths of 95 %. A prediction holds where |E_n| is at most 1. (E_n scores
are usual in comparisons of laboratories, ISO 13528; named by heart.) Exit status 1 if one does not.
"""

import argparse
import json
import math
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from benchmarks.made_up_shop import HIDDEN
from benchmarks.table import print_table
from chamberopt.chamber.build import build_chamber
from chamberopt.common.estimate import normal_quantile
from chamberopt.common.executor import SerialExecutor
from chamberopt.peening.calibration_errors import SIMULATED
from chamberopt.peening.probes import ArcProbe
from chamberopt.peening.setups import Setup, exact_calibration, simulate_setup
from chamberopt.peening.strip import StripSize, strip_cells
from chamberopt.peening.strip_holder import strip_design
from chamberopt.results.load import load_result
from chamberopt.simulation.evaluate import evaluate

ARC_SD, COVERAGE_SD = 0.03, 3.0  # of an arc, as a share; of a coverage [points]
LONGER = 4  # times as many replicas for what the machine does
Z = normal_quantile(0.95)
HEADING = """\
# MADE UP, not measured: what the hidden machine of benchmarks/made_up_shop.py would have given.
# Written by `python -m benchmarks.blind_prediction measure`.

"""


def predicted(result: Path, strip: Path) -> dict[str, tuple[float, float]]:
    """Return each predicted figure with its half-width: coverage in per cent, arcs in mm."""
    loaded = load_result(result)
    mean = loaded.metrics["mean_coverage"]
    time = loaded.design.process.treatment_time
    found = {f"coverage after {time:g} s, %": (100.0 * mean.value, 100.0 * mean.half_width)}
    for one in _arcs(strip):
        found[f"arc after {one['time_s']:.4g} s, mm"] = one["arc_height"], one["half_width"]
    return found


def _arcs(strip: Path) -> list[dict[str, Any]]:
    """Return the predicted arc heights. Raises ValueError if they are not in mm."""
    found = json.loads((strip / "strip.json").read_text(encoding="utf-8"))
    if not found["calibrated"]:
        raise ValueError(f"{strip}: not calibrated to strips, so its heights are not in mm")
    arcs: list[dict[str, Any]] = found["arc_heights"]
    return arcs


def measurements(result: Path, strip: Path, seed: int) -> dict[str, float]:
    """Return what the hidden machine gives for each predicted figure, with errors of reading."""
    loaded, rng = load_result(result), np.random.default_rng(seed)
    truth = {name: math.log(value) for name, value in HIDDEN.items()}
    design = loaded.design.model_copy(update={"calibration": None})
    more = {
        "process.accuracy.replicas": LONGER * design.process.accuracy.replicas,
        "process.seed": 1000 + seed,
    }
    design = design.changed(more)
    machine = design.model_copy(update={"calibration": exact_calibration(design, truth)})
    mean = evaluate(machine, build_chamber(machine), SerialExecutor()).metrics["mean_coverage"]
    names = list(predicted(result, strip))
    with tempfile.TemporaryDirectory() as folder:
        lid = strip_design(design, StripSize(), Path(folder))
        setup = Setup(lid, build_chamber(lid), SIMULATED)
        hidden = {name: truth[name] for name in SIMULATED}
        impacts = simulate_setup(setup, hidden, SerialExecutor(), 1000 + seed)
    times = tuple(one["time_s"] for one in _arcs(strip))
    probe = ArcProbe(strip_cells(StripSize()), times)
    exact = np.exp(probe.read(impacts).at(truth["beta"]) + truth["K"])
    read = exact * (1.0 + ARC_SD * rng.normal(size=len(exact)))
    percent = 100.0 * mean.value + COVERAGE_SD * rng.normal()
    return dict(zip(names, [round(percent), *np.round(read, 3).tolist()], strict=True))


def compared(
    expected: dict[str, tuple[float, float]], found: dict[str, float]
) -> list[dict[str, Any]]:
    """Return a row for each predicted figure: prediction, measurement, E_n and whether it holds.

    Raises ValueError if a predicted figure was not measured.
    """
    rows = []
    for name, (value, half_width) in expected.items():
        if name not in found:
            raise ValueError(f"{name!r} was predicted and is not in the file: give all of them")
        measured = found[name]
        own = Z * (COVERAGE_SD if name.startswith("coverage") else ARC_SD * measured)
        score = (measured - value) / math.hypot(half_width, own)
        rows.append(
            {
                "figure": name,
                "predicted": f"{value:.3g} ± {half_width:.2g}",
                "measured": f"{measured:.3g} ± {own:.2g}",
                "E_n": f"{score:+.2f}",
                "holds": "yes" if abs(score) <= 1.0 else "NO",
            }
        )
    return rows


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="action", required=True)
    for action in ("measure", "compare"):
        one = commands.add_parser(action)
        one.add_argument("result", type=Path)
        one.add_argument("strip", type=Path)
        if action == "measure":
            one.add_argument("--out", type=Path, required=True)
            one.add_argument("--seed", type=int, default=1)
        else:
            one.add_argument("measured", type=Path)
    options = parser.parse_args(arguments)
    if options.action == "measure":
        values = measurements(options.result, options.strip, options.seed)
        options.out.write_text(HEADING + tomlkit.dumps({"measured": values}), encoding="utf-8")
        print(f"wrote {options.out}, made up")
        return 0
    try:
        found = tomllib.loads(options.measured.read_text(encoding="utf-8"))["measured"]
        rows = compared(predicted(options.result, options.strip), found)
    except (OSError, KeyError, ValueError) as error:
        print(f"error: {options.measured}: {error}", file=sys.stderr)
        return 2
    print_table(rows)
    return 0 if all(row["holds"] == "yes" for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())

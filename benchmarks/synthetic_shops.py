"""Does a calibration find hidden truths, and do the intervals of calibrated designs hold?

    nice python benchmarks/synthetic_shops.py [--shops N] [--csv FILE]

A shop is the simulator with hidden values of all parameters, drawn from their priors. It measures
arc heights at two amplitudes, coverage and dents of a coupon, and two ball drops, with the errors
that the program assumes. Its calibration predicts another amplitude and twice the charge, which is
compared with the hidden truth; for the first shops also as `chamberopt simulate` predicts it. The
model's form is the shop's own: what a wrong model does is not tested here. A shop whose strips
would bend beyond what a gauge reads is left out. On one core a shop takes about 20 s, and as long
again where it is simulated.
"""

import argparse
import math
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.table import print_table, write_csv
from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.common.estimate import normal_quantile
from chamberopt.common.executor import SerialExecutor
from chamberopt.design.calibration import Calibration, Parameter
from chamberopt.design.design import Design
from chamberopt.design.load import load_design
from chamberopt.peening.calibrate import PRIORS, calibrate, prepare
from chamberopt.peening.calibration_errors import SIMULATED, evaluate_calibrated
from chamberopt.peening.measured import (
    MAX_ARC_MM,
    Measured,
    MeasuredDents,
    dent_errors,
    with_amplitude,
)
from chamberopt.peening.next_measurement import predict
from chamberopt.peening.posterior import Model
from chamberopt.peening.probes import ArcProbe, PartProbe, SaturationProbe, whole_target
from chamberopt.peening.setups import DropModel, Setup, exact_calibration, simulate_setup
from chamberopt.peening.strip import StripSize, strip_cells
from chamberopt.peening.strip_holder import strip_design
from chamberopt.simulation.evaluate import evaluate

ROOT = Path(__file__).parents[1]
DISC = StripSize(0.026, 0.026, is_disc=True)
BALL_G = 7800.0 * math.pi / 6.0 * 3e-3**3 * 1e3
BALLS = 33  # as many over the sonotrode's area as 100 in 70 mm
MEASURED_UM, PREDICTED_UM = (25.0, 40.0), 32.0
MULTIPLES = np.array([0.25, 0.5, 1.0, 2.0, 4.0])  # of T
LONGER = 4  # times as many replicas for what is true
ACCURACY = {"simulated_time_s": 1.0, "warmup_time_s": 0.1, "replicas": 8, "points": 2000}
EXECUTOR = SerialExecutor()
Z = normal_quantile(0.95)


def shop_design(folder: Path, balls: int, amplitude_um: float, **accuracy: float) -> Design:
    """A cylinder of 40 mm, closed by an aluminium lid of which a disc of 26 mm is the target."""
    plate = load_design(ROOT / "designs" / "plate.toml")
    values = {f"process.accuracy.{name}": value for name, value in accuracy.items()}
    design = plate.changed(
        {
            "chamber.diameter_mm": 40.0,
            "shot.mass_g": balls * BALL_G,
            "sonotrode.amplitude_um": amplitude_um,
            "effects.friction": {"mu": 0.3, "beta0": 0.2},
            **values,
        }
    )
    lid = strip_design(design, DISC, folder)
    return lid.changed({"materials.part": plate.materials.part.model_dump()})


def draw_truth(rng: np.random.Generator) -> dict[Parameter, float]:
    """Logarithms of all parameters."""
    return {
        name: math.log(median) + sd * float(rng.normal()) for name, (median, sd) in PRIORS.items()
    }


def measure(
    design: Design,
    truth: Mapping[Parameter, float],
    rng: np.random.Generator,
    folder: Path,
    seed: int,
    size: StripSize = DISC,
) -> dict[str, Any]:
    """The values of a file of measurements, by a shop with these hidden parameters.

    Args:
        seed: of the simulations that stand for the shop.
        size: of its strips, whole ones or discs.
    """
    replicas = LONGER * design.process.accuracy.replicas
    design = design.changed({"process.accuracy.replicas": replicas})
    simulated = {name: truth[name] for name in SIMULATED}
    strips, coupons = [], []
    for number, amplitude in enumerate(MEASURED_UM):
        set_up = with_amplitude(design, amplitude)
        lid_design = strip_design(set_up, size, folder)
        lid = Setup(lid_design, build_chamber(lid_design), SIMULATED)
        found = simulate_setup(lid, simulated, EXECUTOR, seed)
        cells = strip_cells(size)
        log_time = SaturationProbe(cells).read(found).at(0.0)[1]
        times = np.round(MULTIPLES * math.exp(log_time - truth["beta"]), 2)
        arcs = ArcProbe(cells, tuple(times.tolist())).read(found).at(truth["beta"]) + truth["K"]
        noisy = np.exp(arcs) * (1.0 + 0.03 * rng.normal(size=len(arcs)))
        strips.append({"amplitude_um": amplitude, "time_s": times.tolist(),
                       "arc_mm": noisy.tolist(),
                       **({"disc_mm": 1e3 * size.length} if size.is_disc else {})})  # fmt: skip
        if number:
            continue
        part = Setup(set_up, build_chamber(set_up), SIMULATED)
        probe = PartProbe(("rate", "mean", "p90"), part.target, part.area)
        seen = probe.read(simulate_setup(part, simulated, EXECUTOR, seed)).at(0.0)
        rate, mean, p90 = np.exp(seen + truth["hardness"] * np.array([-0.5, -0.25, -0.25]))
        coverage = []
        for aimed in (0.3, 0.6):
            when = round(-math.log(1.0 - aimed) / rate * math.exp(0.2 * rng.normal()), 3)
            percent = 100.0 * -math.expm1(-rate * when) + 3.0 * rng.normal()
            coverage.append({"time_s": when, "percent": float(np.clip(percent, 3.0, 97.0))})
        dents = {"mean": mean, "p90": p90, "count": 30}
        errors = dent_errors(MeasuredDents(mean=1.0, p90=2.0, count=30))
        for name, error in zip(dents, rng.multivariate_normal(np.zeros(2), errors), strict=False):
            dents[name] *= math.exp(error)
        dents["p90"] = max(dents["p90"], 1.01 * dents["mean"])
        coupons.append({"amplitude_um": amplitude, "coverage": coverage, "dent_mm": dents})
    drops = []
    for surface, speed in (("wall", 0.3), ("part", 3.0)):
        model: Model = DropModel(getattr(design.materials, surface), speed)
        e = math.exp(model(truth).values[0] + 0.015 * rng.normal())
        drops.append({"surface": surface, "speed_m_s": speed, "restitution": min(e, 1.0)})
    return {"design": "design.toml", "strip": strips, "coupon": coupons, "drop": drops}


def shop_rows(number: int, folder: Path, simulated: bool) -> list[dict[str, Any]]:
    """Predictions of one shop, and those of an uncalibrated design, a row a figure.

    There is no row if the shop's strips bend too far.

    Args:
        simulated: whether also to predict as `chamberopt simulate` does it.
    """
    rng = np.random.default_rng(number)
    started = time.process_time()
    base = shop_design(folder, BALLS, MEASURED_UM[0], **ACCURACY)
    held_out = shop_design(folder, 2 * BALLS, PREDICTED_UM, **ACCURACY)
    truth = draw_truth(rng)
    values = measure(base, truth, rng, folder, 1000 + number)
    if max(arc for strip in values["strip"] for arc in strip["arc_mm"]) > MAX_ARC_MM:
        return []
    for kind in ("strip", "coupon", "drop"):
        values[kind] = [{**one, "design": "base.toml"} for one in values[kind]]
    measured = Measured.model_validate(values)
    designs = {measured.design: held_out, measured.strip[0].design or "": base}
    prepared = prepare(measured, designs, folder)
    found = calibrate(measured, designs, prepared, EXECUTOR)
    cost = {"cpu_s": round(time.process_time() - started, 1)}
    off = {
        f"{name}_off_in_sd": round((found.posterior.values[name] - truth[name]) / sd, 2)
        for name in found.table.parameters
        if (sd := found.table.log_sd(name))
    }  # fmt: skip
    misfits = {f"chi2_{one.kind}": round(one.chi2, 2) for one in found.table.misfits}
    chamber = prepared.setups[0].chamber
    guess = {name: math.log(median) for name, (median, _) in PRIORS.items()}
    real, noise = true_figures(held_out, chamber, truth, 2000 + number)
    plain, _ = true_figures(held_out, chamber, guess, 3000 + number)
    rows = []
    for one in predict(found):
        true, width = real[one.name], Z * math.hypot(one.sd, one.noise)
        error = math.log(one.value) - true
        rows.append(
            {
                "shop": number,
                "figure": one.name,
                "by": "calibrate",
                "true": math.exp(true),
                "predicted": one.value,
                "error_of_log": error,
                "half_width_of_log": width,
                "held": abs(error) <= math.hypot(width, Z * noise[one.name]),
                "error_of_log_uncalibrated": plain[one.name] - true,
                "rounds": found.rounds,
                **cost,
                **off,
                **misfits,
            }
        )
    if simulated:
        rows += simulated_rows(number, held_out, chamber, found.table, truth)
    return rows


def true_figures(
    design: Design, chamber: Chamber, truth: Mapping[Parameter, float], seed: int
) -> tuple[dict[str, float], dict[str, float]]:
    """Logarithms of what is predicted, by hidden parameters, and their noise."""
    more = {"process.accuracy.replicas": LONGER * design.process.accuracy.replicas}
    setup = Setup(design.changed(more), chamber, SIMULATED)
    impacts = simulate_setup(setup, {name: truth[name] for name in SIMULATED}, EXECUTOR, seed)
    values, noise = {}, {}
    for names, probe in (
        (("intensity", "saturation_time"),
         SaturationProbe(whole_target(setup.target, setup.area))),
        (("coverage_rate",), PartProbe(("rate",), setup.target, setup.area)),
    ):  # fmt: skip
        reading = probe.read(impacts)
        for name, value, slopes, variance in zip(
            names, reading.at(0.0), probe.slopes, np.diag(reading.noise), strict=True
        ):
            exact = sum(slope * truth[parameter] for parameter, slope in slopes.items())
            values[name], noise[name] = float(value + exact), math.sqrt(variance)
    return values, noise


def simulated_rows(
    number: int,
    design: Design,
    chamber: Chamber,
    table: Calibration,
    truth: Mapping[Parameter, float],
) -> list[dict[str, Any]]:
    """What `chamberopt simulate` shows of the calibrated design, against the truth."""
    design = design.changed({"process.accuracy.simulated_time_s": 2.0})
    exact = exact_calibration(design, truth)
    real = design.model_copy(update={"calibration": exact}).changed(
        {"process.seed": 4000 + number, "process.accuracy.replicas": 8 * LONGER}
    )
    true = evaluate(real, chamber, EXECUTOR).metrics
    calibrated = design.model_copy(update={"calibration": table})
    found = evaluate_calibrated(calibrated, chamber, EXECUTOR).metrics
    return [
        {
            "shop": number,
            "figure": name,
            "by": "simulate",
            "true": true[name].value,
            "predicted": found[name].value,
            "error_of_log": math.log(found[name].value / true[name].value),
            "half_width_of_log": found[name].half_width / found[name].value,
            "held": abs(found[name].value - true[name].value)
            <= math.hypot(found[name].half_width, true[name].half_width),
        }
        for name in ("almen_intensity", "saturation_time_s", "mean_coverage")
    ]


def summary(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """rms errors and how often the intervals held."""
    found = []
    for by, name in dict.fromkeys((row["by"], row["figure"]) for row in rows):
        some = [row for row in rows if (row["by"], row["figure"]) == (by, name)]

        def rms(column: str, some: list[dict[str, Any]] = some) -> str:
            known = [row[column] ** 2 for row in some if column in row]
            return f"{math.sqrt(np.mean(known)):.3f}" if known else ""

        found.append(
            {
                "by": by,
                "figure": name,
                "shops": len(some),
                "rms of ln": rms("error_of_log"),
                "half-width of ln": rms("half_width_of_log"),
                "uncalibrated": rms("error_of_log_uncalibrated"),
                "held": f"{sum(row['held'] for row in some)} of {len(some)}",
            }
        )
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--shops", type=int, default=60)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--simulated", type=int, default=60, help="shops that also simulate")
    parser.add_argument("--csv", help="name of a file in benchmarks/results")
    arguments = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for number in range(arguments.first, arguments.first + arguments.shops):
        with tempfile.TemporaryDirectory() as folder:
            rows += shop_rows(number, Path(folder), number < arguments.simulated)
        print_table(summary(rows))
        if arguments.csv:
            columns = dict.fromkeys(name for row in rows for name in row)
            write_csv(
                arguments.csv, [{name: row.get(name, "") for name in columns} for row in rows]
            )


if __name__ == "__main__":
    main()

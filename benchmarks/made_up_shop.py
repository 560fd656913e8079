"""The measurements of a made-up shop, for the worked example of docs/tutorials/peening_examples.md.

Writes designs/shop/measured.toml: two sets of Almen strips and one coupon, as the hidden machine of
HIDDEN would give them in the chamber of designs/shop/coupon.toml, with the errors of reading that
`chamberopt calibrate` assumes, as benchmarks/synthetic_shops.py draws them. 20 s of one core:

    python -m benchmarks.made_up_shop
    python -m benchmarks.made_up_shop --compare designs/shop/machine.toml
    python -m benchmarks.made_up_shop --coupons

The second command shows whether the calibration's 95 % intervals hold the hidden machine. The third
writes designs/shop/measured_coupon.toml, for docs/how_to/coupons.md: what the shop measures where
strips cannot go, a coupon, two ball drops and the amplitude.

HIDDEN, factors on what designs/shop/coupon.toml says, and the constants of its strips
    amplitude 0.94    the sonotrode moves 6 % less than its display says
    C0 0.98, v0 1.4   restitution and yield speed of all surfaces
    hardness 1.10     the coupon has 330 HB, not 300
    K 19              mmA per mm of strength
    beta 1.25         dents on real strips over simulated ones
"""

import argparse
import math
import tempfile
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from benchmarks.synthetic_shops import PRIORS, ROOT, Z, measure
from benchmarks.table import print_table
from chamberopt.design.calibration import Calibration, Parameter
from chamberopt.design.load import load_design
from chamberopt.peening.strip import StripSize

SHOP = ROOT / "designs" / "shop"
HIDDEN: dict[Parameter, float] = {
    "amplitude": 0.94, "C0": 0.98, "v0": 1.4, "mu": 1.0, "hardness": 1.10, "K": 19.0, "beta": 1.25,
}  # fmt: skip
HEADING = """\
# MADE UP, not measured: what a shop with hidden parameters would have read, with errors of reading.
# Written by `python -m benchmarks.made_up_shop`, where the hidden parameters stand.
# One whole strip a time; arcs in mm; coverage of the plate's middle, and 30 dents on it.

"""
OF_COUPONS = """\
# MADE UP, not measured: what a shop with hidden parameters would have read, with errors of reading.
# Written by `python -m benchmarks.made_up_shop --coupons`, where the hidden parameters stand.
# Coverage of the plate's middle, and 30 dents on it; two ball drops; the amplitude by laser.

"""
LASER_SET_PV_UM = 80.0
LASER_SD = 0.03  # of an amplitude, as a share; what `chamberopt calibrate` assumes


def measurements(seed: int, coupons: bool = False) -> dict[str, Any]:
    """The values of the file of measurements, rounded as a shop writes them.

    Args:
        coupons: a coupon, ball drops and the amplitude, and no strips.
    """
    design = load_design(SHOP / "coupon.toml")
    truth = {name: math.log(value) for name, value in HIDDEN.items()}
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as folder:
        values = measure(design, truth, rng, Path(folder), seed, StripSize())
    for one in (*values["strip"], *values["coupon"]):
        one["amplitude_pv_um"] = 2.0 * one.pop("amplitude_um")
    for strip in values["strip"]:
        strip["arc_mm"] = np.round(strip["arc_mm"], 3).tolist()
    for coupon in values["coupon"]:
        for seen in coupon["coverage"]:
            seen["percent"] = round(seen["percent"])
        for name in ("mean", "p90"):
            coupon["dent_mm"][name] = round(coupon["dent_mm"][name], 4)
    if coupons:
        del values["strip"]
        for drop in values["drop"]:
            drop["restitution"] = round(drop["restitution"], 3)
        seen = HIDDEN["amplitude"] * LASER_SET_PV_UM * (1.0 + LASER_SD * float(rng.normal()))
        values["amplitude"] = {"set_pv_um": LASER_SET_PV_UM, "measured_pv_um": round(seen, 1)}
    else:
        del values["drop"]  # this shop drops no balls
    return {**values, "design": "coupon.toml"}


def compared(machine: Path) -> list[dict[str, Any]]:
    """Hidden value, calibrated one and whether its interval holds it, a row a parameter."""
    found = Calibration.model_validate(tomllib.loads(machine.read_text(encoding="utf-8")))
    rows = []
    for name in found.parameters:
        value, factor = found.factor(name), math.exp(Z * found.log_sd(name))
        rows.append(
            {
                "parameter": name,
                "before": PRIORS[name][0],
                "hidden": HIDDEN[name],
                "calibrated": f"{value:.3g}",
                "95 % interval": f"{value / factor:.3g} to {value * factor:.3g}",
                "held": "yes" if 1 / factor <= HIDDEN[name] / value <= factor else "no",
            }
        )
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--coupons", action="store_true", help="a coupon, and no strips")
    parser.add_argument("--out", type=Path, help="by default in designs/shop")
    parser.add_argument("--compare", type=Path, help="machine.toml, instead of writing a file")
    arguments = parser.parse_args()
    if arguments.compare:
        print_table(compared(arguments.compare))
        return
    coupons = arguments.coupons
    values = {"design": "", **measurements(arguments.seed, coupons)}  # the design first
    out = arguments.out or SHOP / ("measured_coupon.toml" if coupons else "measured.toml")
    heading = OF_COUPONS if coupons else HEADING
    out.write_text(heading + tomlkit.dumps(values), encoding="utf-8")
    print(f"wrote {out}")


if __name__ == "__main__":
    main()

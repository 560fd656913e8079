"""What dents does a sonotrode leave whose amplitude is not the same all over its face?

    python benchmarks/amplitude_profile.py [--seeds N] [--csv FILE]

Steel balls of 3 mm in an exact cylinder of 25 mm radius over a sonotrode of 25 µm at 20 kHz, under
a flat lid, in the material of designs/plate.toml. Dented area a second: all dents on the lid, and
the ratio of the dents per area in its middle (within half of the radius) to those near its rim (the
outer fifth). Figures are changes from the rigid piston, paired by seed, with 95 % intervals.
"""

import argparse
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.table import print_table, write_csv
from chamberopt.common.estimate import estimate
from chamberopt.coverage.dents import dent_diameter
from chamberopt.design.load import load_design
from chamberopt.design.materials.tables import PartMaterial
from sim_core import (
    AmplitudeProfile,
    Balls,
    Friction,
    Gravity,
    Physics,
    Restitution,
    Scene,
    Vibration,
    cylinder_cavity,
    pack_balls,
    simulate,
)

PLATE = Path(__file__).resolve().parents[1] / "designs" / "plate.toml"
CEILING, FLOOR, SIDE = 0, 1, 2
RADIUS, DIAMETER, DENSITY = 0.025, 3e-3, 7800.0
AMPLITUDE, FREQUENCY = 25e-6, 20e3
LAW = (0.91, 0.44)
STEEL = (0.3, 0.2)  # mu and beta0
WARM_UP, SECONDS = 0.3, 2.0
MIDDLE, RIM = 0.5, 0.8  # shares of the radius
CHAMBERS = ((15e-3, 30, None), (15e-3, 30, STEEL), (40e-3, 100, None), (40e-3, 100, STEEL))


class Face(NamedTuple):
    """Amplitude over the face: shares of AMPLITUDE in the middle, halfway and at the rim."""

    middle: float
    halfway: float
    rim: float


PISTON = Face(1.0, 1.0, 1.0)
FACES = (
    Face(1.1, 1.1, 1.1),
    Face(0.9, 0.9, 0.9),
    Face(1.1, 1.05, 0.9),
    Face(0.9, 0.95, 1.1),
    Face(1.0, 0.975, 0.9),
    Face(1.4, 1.2, 0.6),
)


class Dents(NamedTuple):
    """Dented area a second of one seed, and how much of it per area the middle has to the rim."""

    area: float
    evenness: float


def dents(
    face: Face,
    height: float,
    count: int,
    friction: tuple[float, float] | None,
    seed: int,
    material: PartMaterial,
) -> Dents:
    """Simulate so many balls under a lid at this height [m]."""
    cavity, rng = (
        cylinder_cavity(2.0 * RADIUS, 0.0, height, (FLOOR, CEILING, SIDE)),
        np.random.default_rng(seed),
    )
    places = pack_balls(cavity, count, DIAMETER, rng, 2.0 * AMPLITUDE)
    balls = Balls(places, rng.normal(0.0, 1.5, places.shape), DIAMETER, DENSITY)
    largest = max(face)
    points = zip((0.0, 0.5 * RADIUS, RADIUS), face, strict=True)
    profile = AmplitudeProfile(tuple((r, share / largest) for r, share in points))
    phase = rng.uniform(0.0, 2.0 * np.pi)
    shaking = Vibration(FLOOR, largest * AMPLITUDE, FREQUENCY, phase)
    if min(face) < largest:
        shaking = shaking._replace(profile=profile)
    law = None if friction is None else Friction((friction,) * 3, friction)
    physics = Physics(Gravity(), Restitution((LAW,) * 3, LAW), shaking, friction=law)
    log = simulate(Scene(cavity, balls, physics, SECONDS, WARM_UP, (CEILING,))).impacts
    area = 0.25 * math.pi * dent_diameter(log.normal_speed, DIAMETER, DENSITY, material) ** 2
    way = np.hypot(log.position[:, 0], log.position[:, 1]) / (RADIUS - 0.5 * DIAMETER)
    middle = area[way < MIDDLE].sum() / MIDDLE**2
    rim = area[way > RIM].sum() / (1.0 - RIM**2)
    return Dents(float(area.sum()) / SECONDS, float(middle / rim))


def _percent(one: list[float], piston: list[float]) -> str:
    found = estimate([100.0 * (x / y - 1.0) for x, y in zip(one, piston, strict=True)])
    return f"{found.value:+.1f} ± {found.half_width:.1f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=16)
    parser.add_argument("--csv", help="name of a file in benchmarks/results")
    arguments = parser.parse_args()
    material = load_design(PLATE).materials.part
    rows: list[dict[str, Any]] = []
    for height, count, friction in CHAMBERS:
        found = {
            face: [
                dents(face, height, count, friction, seed, material)
                for seed in range(arguments.seeds)
            ]
            for face in (PISTON, *FACES)
        }
        area, ratio = ({k: [d[i] for d in v] for k, v in found.items()} for i in (0, 1))
        rows += [
            {
                "lid_mm": 1e3 * height,
                "balls": count,
                "mu": "none" if friction is None else friction[0],
                "middle": face.middle,
                "rim": face.rim,
                "dents_percent": _percent(area[face], area[PISTON]),
                "middle_to_rim_percent": _percent(ratio[face], ratio[PISTON]),
            }
            for face in FACES
        ]
    print_table(rows)
    if arguments.csv:
        write_csv(arguments.csv, rows)


if __name__ == "__main__":
    main()

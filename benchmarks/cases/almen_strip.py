"""Virtual Almen strips on the lid of peening_cylinder.py, and one in a design's.

What the trade reports of intensity: a table on the web pages of SONATS, "importance of key
parameters", gives arc heights at several amplitudes. Their exponent is 0.96 ± 0.09 if a strip has
2 %. With less shot, its text says, the intensity hardly changes; there is no number.
"""

import math
import tempfile
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.cases import peening_cylinder
from benchmarks.cases.row import Row
from chamberopt.chamber.build import build_chamber
from chamberopt.common.estimate import Estimate
from chamberopt.common.executor import local_executor
from chamberopt.coverage.part_impacts import Hits
from chamberopt.design.almen_strip import strip_material
from chamberopt.design.load import Design, load_design
from chamberopt.design.materials import PartMaterial
from chamberopt.peening.kirk_fit import MULTIPLES, heights, kirk_fits, strip_saturation
from chamberopt.peening.strip import StripDents, StripSize, count_dents, strip_cells
from chamberopt.peening.virtual_strip import VirtualStrip, peen_strip, strip_in_lid

PLATE = Path(__file__).parents[2] / "designs" / "plate.toml"
DISC = StripSize(60e-3, 60e-3, is_disc=True)  # of the lid of 70 mm
LOW, HIGH = 25e-6, 40e-6  # amplitudes [m]
SEEDS, SECONDS = 16, 2.0
PUBLISHED = 0.96, 0.09
DENSITY = 7800.0


class Case(NamedTuple):
    """A number of balls, an amplitude [m] and whether restitution falls with speed."""

    count: int
    amplitude: float
    falls: bool = True

    @property
    def name(self) -> str:
        return f"{'e falls with speed' if self.falls else 'e constant'}, {self.count} balls"


CASES = [Case(count, amplitude, falls) for falls in (True, False) for count in (50, 200)
         for amplitude in (LOW, HIGH)]  # fmt: skip


def strip(case: Case) -> PartMaterial:
    """The metal of the strip; like the walls with a constant restitution where they have one."""
    metal = strip_material(load_design(PLATE).shot)
    return metal if case.falls else metal.model_copy(update={"exponent": 0.0})


@lru_cache
def dents(case: Case) -> StripDents:
    """The dents of a disc."""
    law = peening_cylinder.by_speed() if case.falls else peening_cylinder.constant(0.91)
    mass = DENSITY * math.pi / 6.0 * peening_cylinder.DIAMETER**3
    replicas = []
    for seed in range(SEEDS):
        log = peening_cylinder.impacts(case.count, law, seed, case.amplitude)
        speed, unknown = log.normal_speed, np.zeros(len(log.normal_speed))
        hits = Hits(log.triangle, log.position, speed, unknown, unknown, 0.5 * mass * speed**2)
        replicas.append(hits)
    return count_dents(replicas, SECONDS, strip_cells(DISC), DENSITY, strip(case))


def rows() -> Iterator[Row]:
    """Trends of the intensity, fits to five points, and the example of peening.md in docs/."""
    for low in CASES[::2]:
        power = math.log(HIGH / LOW)
        one, other = strength(low), strength(low._replace(amplitude=HIGH))
        found = math.log(other.value / one.value) / power
        yield Row("strips", low.name, "S's exponent of the amplitude", *PUBLISHED,
                  found, _relative(one, other) / power)  # fmt: skip
    few, many = (strength(Case(count, LOW)) for count in (100, 200))
    ratio = many.value / few.value
    yield Row("strips", "e falls with speed", "S with 200 balls / with 100", math.nan, 0.0,
              ratio, ratio * _relative(few, many))  # fmt: skip
    for falls in (True, False):
        law = "e falls with speed" if falls else "e constant"
        both = np.array([offsets(dents(case)) for case in CASES if case.falls == falls])
        for of_fit, name in zip(both.swapaxes(0, 1), ("two", "three"), strict=True):
            for what, offset in zip(("S", "T"), of_fit.T, strict=True):
                middle, half = 0.5 * float(offset.max() + offset.min()), 0.5 * float(np.ptp(offset))
                yield Row("strips", f"{law}, fits of {name} parameters to five points",
                          f"{what} of the fit / {what}, range of the above", math.nan, 0.0,
                          middle, half)  # fmt: skip
    example = whole_strip()
    for what, one in (("S, µm", example.intensity), ("T, s", example.time)):
        yield Row("strips", "whole strip, chamber of 80 x 40 mm, 100 balls of 3 mm, 30 µm",
                  what, math.nan, 0.0, one.value, one.half_width)  # fmt: skip


def strength(case: Case) -> Estimate:
    """S of a disc."""
    return strip_saturation(dents(case)).strength


def offsets(of_disc: StripDents) -> list[tuple[float, float]]:
    """S and T of the fits of two and three parameters over those of the curve."""
    found = strip_saturation(of_disc)
    times = np.multiply(MULTIPLES, found.time.value)
    fits = kirk_fits(times, np.array([one.value for one in heights(of_disc, times)]))
    return [
        (fit.intensity / found.strength.value, fit.saturation_time / found.time.value)
        for fit in fits
    ]


def example_design() -> Design:
    """The example of docs/explanation/peening.md."""
    mass = 1e3 * DENSITY * math.pi / 6.0 * 3e-3**3 * 100
    return load_design(PLATE).changed(
        {
            "chamber.diameter_mm": 80.0, "chamber.height_mm": 45.0,
            "chamber.sonotrode_distance_mm": 40.0, "shot.mass_g": mass,
            "sonotrode.amplitude_um": 30.0, "process.accuracy.replicas": 16,
        }
    )  # fmt: skip


@lru_cache
def whole_strip() -> VirtualStrip:
    """A whole strip in the lid of the example."""
    with tempfile.TemporaryDirectory() as folder, local_executor() as executor:
        setting = strip_in_lid(example_design(), "A", StripSize(), Path(folder))
        return peen_strip(setting, build_chamber(setting.design), executor)


def picture(path: Path) -> None:
    """The saturation curve of the example."""
    from chamberopt.pictures.charts.strip import strip_picture

    strip_picture(path, whole_strip())


def _relative(one: Estimate, other: Estimate) -> float:
    """Half-width of the logarithm of a ratio."""
    return math.hypot(one.half_width / one.value, other.half_width / other.value)

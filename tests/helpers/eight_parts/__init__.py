"""Eight parts as engineers have them, and three kept aside: each is written into a folder.

from tests.helpers.eight_parts import EIGHT_PARTS
path = EIGHT_PARTS["fir_tree"].write(folder)
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

from tests.helpers.eight_parts.meshes import (
    crank_pin,
    fan_blade,
    hip_stem,
    spring_seat_ring,
    t_joint,
)
from tests.helpers.eight_parts.scans import scan, scan_with_stray_facet


class ExamplePart(NamedTuple):
    """A part's file and what is known of it."""

    write: Callable[[Path], Path]  # writes the file into a folder and returns its path
    size_mm: tuple[float, float, float]  # sides of the bounding box
    unit: str | None = (
        None  # to be given by the user: what the file states, or is guessed, is wrong
    )
    target: str | None = None  # a name in the file that a person would choose


SHIPPED = Path(__file__).parents[3] / "designs" / "parts"


def _copy(name: str, folder: Path) -> Path:
    """One of the STEP files that make_step_files.py wrote, or of the shipped ones."""
    own = Path(__file__).with_name(name)
    return Path(shutil.copy(own if own.is_file() else SHIPPED / name, folder))


EIGHT_PARTS = {
    "fir_tree": ExamplePart(partial(_copy, "fir_tree.step"), (55.7, 39.6, 26.0), target="FIR_TREE"),
    "helical_gear": ExamplePart(partial(_copy, "helical_gear.step"), (66.2, 66.2, 18.0)),
    "hip_stem": ExamplePart(hip_stem, (43.3, 16.0, 137.1)),
    "t_joint": ExamplePart(t_joint, (80.0, 60.0, 55.0), unit="in", target="WELD"),
    "crank_pin": ExamplePart(crank_pin, (92.5, 92.9, 60.0), target="FILLETS"),
    "fan_blade": ExamplePart(fan_blade, (42.0, 24.4, 100.0), target="SUCTION_SIDE"),
    "scan": ExamplePart(scan, (53.9, 54.9, 22.2)),
    "scan_stray": ExamplePart(scan_with_stray_facet, (53.9, 54.9, 22.2)),
}
KEPT_ASIDE = {
    "spring_seat_ring": ExamplePart(spring_seat_ring, (60.0, 60.0, 8.0)),
    "knee_tray": ExamplePart(partial(_copy, "knee_tray.step"), (74.1, 48.3, 40.0)),
    "stepped_shaft": ExamplePart(partial(_copy, "stepped_shaft.step"), (38.1, 38.1, 96.0)),
}

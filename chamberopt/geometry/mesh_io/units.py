"""In which unit a file's numbers are: stated by the design or by the file, else guessed from the size, aloud."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io.surface_error import format_box

Unit = Literal["um", "mm", "cm", "m", "in", "guess"]
METRES_PER: dict[str, float] = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}

SMALLEST, LARGEST = (
    5e-4,
    3.0,
)  # m, longest side of the bounding box: a part that can be peened in a chamber
# What an exporter would write, likeliest first; inch and cm cannot be told from mm by size, so are not guessed.
GUESSED = (("mm", 3e-3, 1.5), ("m", 3e-3, 1.5), ("um", 3e-3, 1.5))
SAID = re.compile(rb"\bunits?\b[\"' ]*[=:][\"' ]*(\w+)", re.I)
SPELLED = {
    "mm": "mm", "millimeter": "mm", "millimeters": "mm", "millimetre": "mm", "millimetres": "mm",
    "cm": "cm", "centimeter": "cm", "centimeters": "cm", "centimetre": "cm",
    "m": "m", "meter": "m", "meters": "m", "metre": "m", "metres": "m",
    "um": "um", "micron": "um", "microns": "um", "micrometer": "um", "micrometre": "um",
    "in": "in", "inch": "in", "inches": "in",
}  # fmt: skip


def unit_of(
    path: Path, content: bytes, corners: np.ndarray, given: str, stated: str | None
) -> tuple[str, list[str]]:
    """The unit of corners (m, 3, 3), and a note where a person should look at it.

    given: the design's part.unit, or "guess" · stated: what the format itself says. Raises InputError when the
    two contradict each other, nothing can be guessed, or the part is of a size that no part has.
    """
    sides = np.ptp(corners.reshape(-1, 3), axis=0)
    step = content[:64].lstrip().startswith(b"ISO-10303-21")
    if stated is not None and given not in ("guess", stated) and not step:
        raise InputError(
            f"{path}: part.unit is {given!r}, but the file says that its numbers are in {stated!r}; "
            "leave part.unit out, or export in the unit that is meant"
        )
    if stated is not None:
        told = (
            f"unit stated by the file: the part measures {format_box(sides * METRES_PER[stated])}"
        )
        unit, notes = stated, [] if given == stated else [told]
    elif given != "guess":
        unit, notes = given, []
    else:
        unit, notes = _guess(path, content, sides)
    _refuse_implausible(path, sides, unit)
    return unit, notes


def _guess(path: Path, content: bytes, sides: np.ndarray) -> tuple[str, list[str]]:
    said = SAID.search(content[:4096])
    unit = SPELLED.get(said[1].decode().lower()) if said else None
    if unit is not None:
        why = f"a comment in the file says {said[0].decode().strip()!r}"  # type: ignore[index]
    else:
        longest = float(sides.max())
        unit = next((u for u, low, high in GUESSED if low <= longest * METRES_PER[u] < high), None)
        why = "by its size"
    if unit is None:
        raise InputError(
            f"{path}: the unit cannot be guessed from a longest side of {sides.max():.5g}; give part.unit, one of "
            + ", ".join(f'"{u}"' for u in METRES_PER)
        )
    return unit, [
        f"unit guessed as {unit!r} ({why}): the part measures {format_box(sides * METRES_PER[unit])}; "
        "give part.unit if that is wrong"
    ]


def _refuse_implausible(path: Path, sides: np.ndarray, unit: str) -> None:
    longest = float(sides.max()) * METRES_PER[unit]
    if SMALLEST <= longest <= LARGEST:
        return
    fitting = [u for u, m in METRES_PER.items() if SMALLEST <= sides.max() * m <= LARGEST]
    hint = f"; unit = {' or '.join(repr(u) for u in fitting)} would be plausible" if fitting else ""
    raise InputError(
        f"{path}: with part.unit = {unit!r} the part measures {format_box(sides * METRES_PER[unit])}; allowed: longest "
        f"side {1e3 * SMALLEST:g} to {1e3 * LARGEST:g} mm{hint}"
    )

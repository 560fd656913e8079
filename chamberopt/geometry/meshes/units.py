"""Find the unit of a file's numbers: given by the design, stated by the file, or guessed."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.meshes.surface_error import format_box

Unit = Literal["um", "mm", "cm", "m", "in", "guess"]
STATED = "stated"  # in place of a unit: it is not guessed where several are possible
METRES_PER: dict[str, float] = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
UNIT_NAMES = {
    "mm": "mm", "millimeter": "mm", "millimeters": "mm", "millimetre": "mm", "millimetres": "mm",
    "cm": "cm", "centimeter": "cm", "centimeters": "cm", "centimetre": "cm",
    "m": "m", "meter": "m", "meters": "m", "metre": "m", "metres": "m",
    "um": "um", "micron": "um", "microns": "um", "micrometer": "um", "micrometre": "um",
    "in": "in", "inch": "in", "inches": "in",
}  # fmt: skip
UNIT_COMMENT = re.compile(rb"\bunits?\b[\"' ]*[=:][\"' ]*(\w+)", re.I)

# m: longest side of the bounding box of a part that can be peened in a chamber.
MIN_SIZE, MAX_SIZE = 5e-4, 3.0
GUESSED = "unit guessed as"  # start of the note on a unit that is not certain
BY_SIZE = "by its size"  # reason for a unit of which the file says nothing
# Units that exporters write, the most likely first, and the sizes [m] for which they are guessed.
# Inches and centimetres are never guessed, because their sizes overlap with millimetres.
GUESSED_UNITS = ("mm", "m", "um")
MIN_GUESSED_SIZE, MAX_GUESSED_SIZE = 3e-3, 1.5


class UnknownUnitError(InputError):
    """Error for a file that does not state its unit, and whose size leaves several possible.

    Args:
        sizes: the size that the part would have, by unit.
    """

    def __init__(self, path: Path, sizes: dict[str, str]) -> None:
        choices = [f"{unit} ({size})" for unit, size in sizes.items()]
        listed = ", ".join(choices[:-1]) + f" or {choices[-1]}"
        super().__init__(
            f"{path}: the file does not state the unit of its numbers; give part.unit: {listed}"
        )
        self.sizes = sizes


def find_unit(
    path: Path, content: bytes, corners: np.ndarray, given: str, stated: str | None
) -> tuple[str, list[str]]:
    """Return the unit of the corners (m, 3, 3) of a file, and a note unless the design gives it.

    Args:
        given: the design's part.unit; "guess"; or STATED.
        stated: the unit that the file's format states, if any.
    Raises:
        UnknownUnitError: if the unit has to be stated, and the file or its size do not.
        InputError: if the two units contradict each other, the unit cannot be guessed, or no part
            can be so large or so small.
    """
    sides = np.ptp(corners.reshape(-1, 3), axis=0)
    if stated is not None and given not in ("guess", STATED, stated):
        raise InputError(
            f"{path}: part.unit is {given!r}, but the file says that its numbers are in "
            f"{stated!r}; leave part.unit out, or export in the unit that is meant"
        )
    unit, why, wrong = stated or given, "unit stated by the file", ""
    if unit in ("guess", STATED):
        unit, reason = _guess(path, content, sides, may_guess=unit == "guess")
        why, wrong = f"{GUESSED} {unit!r} ({reason})", "; give part.unit if that is wrong"
    box = format_box(sides * METRES_PER[unit])
    if not MIN_SIZE <= sides.max() * METRES_PER[unit] <= MAX_SIZE:
        fits = [repr(u) for u, m in METRES_PER.items() if MIN_SIZE <= sides.max() * m <= MAX_SIZE]
        raise InputError(
            f"{path}: with part.unit = {unit!r} the part measures {box}; allowed: longest side "
            f"{1e3 * MIN_SIZE:g} to {1e3 * MAX_SIZE:g} mm"
            + (f"; unit = {' or '.join(fits)} would be plausible" if fits else "")
        )
    return unit, [] if unit == given else [f"{why}: the part measures {box}{wrong}"]


def _guess(path: Path, content: bytes, sides: np.ndarray, may_guess: bool) -> tuple[str, str]:
    """Return the guessed unit, and the reason for it: a comment in the file, or else the size.

    Args:
        sides: sides (3,) of the bounding box in the file's unit.
        may_guess: whether the likeliest of several possible units is taken.
    """
    comment = UNIT_COMMENT.search(content[:4096])
    name = comment[1].decode().lower() if comment else ""
    if comment and name in UNIT_NAMES:
        return UNIT_NAMES[name], f"a comment in the file says {comment[0].decode().strip()!r}"
    possible = [
        unit
        for unit, metres in METRES_PER.items()
        if MIN_GUESSED_SIZE <= sides.max() * metres < MAX_GUESSED_SIZE
    ]
    if len(possible) > 1 and not may_guess:
        raise UnknownUnitError(
            path, {unit: format_box(sides * METRES_PER[unit]) for unit in possible}
        )
    for unit in GUESSED_UNITS:
        if unit in possible:
            return unit, BY_SIZE
    raise InputError(
        f"{path}: the unit cannot be guessed from a longest side of {sides.max():.5g}; "
        "give part.unit, one of " + ", ".join(f'"{unit}"' for unit in METRES_PER)
    )

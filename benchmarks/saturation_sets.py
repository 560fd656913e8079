"""Published saturation curves through the program's fits: is the accepted intensity found?

    python -m benchmarks.saturation_sets [FILE.toml]

Without a file the sets are those of benchmarks/cases/saturation_sets.toml, each with its source. A
file of your own has tables [[set]] with name, source, exposure, arc_height and, if known, intensity
with intensity_tolerance, and saturation_time. Exposure is a time or the inverse of a feed rate: the
fits have no unit. The table shows the intensity by the fits of two and of three parameters
(chamberopt/peening/kirk_fit.py), what was published, and whether a set is one that SAE AMS-S-13165,
4.2.3, takes for a curve: four points or more, one of them after twice the saturation time or later.
Exit status 1 if a published intensity is missed by more than its tolerance, 2 if a file is wrong.
"""

import argparse
import sys
import tomllib
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from benchmarks.table import print_table
from chamberopt.peening.kirk_fit import kirk_fits

SHIPPED = Path(__file__).parent / "cases" / "saturation_sets.toml"
OF_THE_STANDARD = "SAE J2597"  # how names of its sets begin
SETS_OF_THE_STANDARD = 10

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Values = Annotated[tuple[Positive, ...], Field(min_length=4)]


class SaturationSet(BaseModel):
    """Arc heights of one saturation curve, and what was published of it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str
    source: str
    exposure_unit: str = ""
    height_unit: str = ""
    exposure: Values
    arc_height: Values
    intensity: Positive | None = None
    intensity_tolerance: Positive | None = None
    saturation_time: Positive | None = None

    @model_validator(mode="after")
    def _check(self) -> "SaturationSet":
        if len(self.exposure) != len(self.arc_height):
            counts = f"{len(self.exposure)} of exposure, {len(self.arc_height)} of arc_height"
            raise ValueError(f"give as many arc heights as exposures, not {counts}")
        if any(np.diff(self.exposure) <= 0.0):
            raise ValueError("give exposures in ascending order")
        if (self.intensity is None) != (self.intensity_tolerance is None):
            raise ValueError("give intensity and intensity_tolerance together")
        return self


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid")

    set: tuple[SaturationSet, ...] = Field(min_length=1)


def read_sets(path: Path) -> tuple[SaturationSet, ...]:
    """Return the sets of a file. Raises ValueError, with the field, if the file is wrong."""
    try:
        return _File.model_validate(tomllib.loads(path.read_text(encoding="utf-8"))).set
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(one) for one in first["loc"])
        raise ValueError(f"{path}: {place}: {first['msg']}") from None
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise ValueError(f"{path}: {error}") from None


def row(one: SaturationSet) -> dict[str, Any]:
    """Return what both fits find of a set, and whether they find what was published."""
    times, heights = np.array(one.exposure), np.array(one.arc_height)
    two, three = kirk_fits(times, heights)
    found = {"set": one.name, "points": len(times)}
    for name, fit in (("two", two), ("three", three)):
        found[f"intensity, {name}"] = f"{fit.intensity:.2f}"
    found["published"] = (
        "not given" if one.intensity is None else f"{one.intensity:g} ± {one.intensity_tolerance:g}"
    )
    found["within"] = (
        " and ".join(
            dict.fromkeys("yes" if is_within(one, fit.intensity) else "NO" for fit in (two, three))
        )
        if one.intensity is not None
        else ""
    )
    found["T, two"] = f"{two.saturation_time:.4g}"
    found["T, three"] = f"{three.saturation_time:.4g}"
    found["T published"] = f"{one.saturation_time:g}" if one.saturation_time else "not given"
    found["last point / T"] = f"{times[-1] / two.saturation_time:.2f}"
    found["a curve"] = "yes" if times[-1] >= 2.0 * two.saturation_time else "no: too short"
    return found


def is_within(one: SaturationSet, intensity: float) -> bool:
    """Return True if an intensity lies within the tolerance of the published one."""
    assert one.intensity is not None
    assert one.intensity_tolerance is not None
    return abs(intensity - one.intensity) <= one.intensity_tolerance


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path, nargs="?", default=SHIPPED)
    path = parser.parse_args(arguments).file
    try:
        sets = read_sets(path)
    except ValueError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    rows = [row(one) for one in sets]
    print_table(rows)
    print()
    for one in sets:
        print(f"{one.name}: {one.source}")
    of_standard = sum(one.name.startswith(OF_THE_STANDARD) for one in sets)
    known = [found for found in rows if found["within"]]
    missed = sum("NO" in found["within"] for found in known)
    print(f"\n{len(known) - missed} of {len(known)} published intensities are found by both fits.")
    if of_standard < SETS_OF_THE_STANDARD:
        print(
            f"{of_standard} of the {SETS_OF_THE_STANDARD} sets of SAE J2597 are in this file; the "
            "others could not be read. Who has the standard adds them, and runs this again."
        )
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())

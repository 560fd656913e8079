"""Results of a virtual strip: text to read, a table (.csv), everything as JSON, a picture."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from chamberopt.common.files import csv_text, write_text
from chamberopt.common.number_text import estimate_text, plain
from chamberopt.common.versions import versions
from chamberopt.design.load import save_design
from chamberopt.peening.kirk_fit import MULTIPLES
from chamberopt.peening.virtual_strip import VirtualStrip
from chamberopt.pictures.charts.strip import MULTIPLE_NAMES, fit_text, strip_picture

FORMAT = 1
FIT_NAMES = "two parameters", "three parameters"


def write_strip_results(folder: Path, strip: VirtualStrip) -> None:
    """Leave design.toml, strip.csv, strip.png and, last of all, strip.json in a folder."""
    save_design(strip.setting.design, folder / "design.toml")
    write_text(folder / "strip.csv", csv_text(rows(strip)))
    strip_picture(folder / "strip.png", strip)
    text = json.dumps(strip_json(strip), indent=2, allow_nan=False)
    write_text(folder / "strip.json", text + "\n")


def rows(strip: VirtualStrip) -> list[dict[str, Any]]:
    """One row for each of the five times."""
    return [
        {
            "times_saturation": multiple,
            "time_s": float(time),
            "arc_height": height.value,
            "half_width": height.half_width,
            "unit": strip.unit,
        }
        for multiple, time, height in zip(MULTIPLES, strip.at, strip.heights, strict=True)
    ]


def strip_json(strip: VirtualStrip) -> dict[str, Any]:
    """Everything, for strip.json."""
    design = strip.setting.design
    curve = zip(strip.drawn_at, strip.drawn, strict=True)
    return {
        "format": FORMAT,
        "type": strip.setting.type,
        "place": strip.setting.place,
        "calibrated": strip.is_calibrated,
        "unit": strip.unit,
        "intensity": strip.intensity.to_json(),
        "saturation_time_s": strip.time.to_json(),
        "arc_heights": rows(strip),
        "fits": {
            name: {
                "a": fit.a,
                "b": fit.b,
                "c": fit.c,
                "intensity": fit.intensity,
                "saturation_time_s": fit.saturation_time,
            }
            for name, fit in zip(FIT_NAMES, strip.fits, strict=True)
        },
        "curve": [
            {"time_s": float(time), "arc_height": one.value, "half_width": one.half_width}
            for time, one in curve
        ],
        "replicas": design.process.accuracy.replicas,
        "simulated_time_s": design.process.recorded_time,
        "notes": list(strip.notes),
        "versions": versions(),
    }


def strip_text(strip: VirtualStrip) -> list[str]:
    """The lines that the command prints."""
    first = "intensity I" if strip.is_calibrated else "peening strength S"
    lines = [
        f"{strip.setting.type} strip, {strip.setting.place}",
        f"{first:24}{estimate_text(strip.intensity, unit=strip.unit)}",
        f"{'saturation time T':24}{estimate_text(strip.time, unit='s')}",
    ]
    for name, time, height in zip(MULTIPLE_NAMES, strip.at, strip.heights, strict=True):
        label = f"after {name:3} = {plain(float(time), 3)} s"
        lines.append(f"{label:24}{estimate_text(height, unit=strip.unit)}")
    for name, fit in zip(FIT_NAMES, strip.fits, strict=True):
        lines.append(f"{'fit of ' + name:24}{fit_text(fit, strip)}")
    return lines

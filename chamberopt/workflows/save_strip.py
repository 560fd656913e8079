"""Save a virtual strip: a table (.csv), the record as JSON, a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from chamberopt.common.files import csv_text, write_text
from chamberopt.design.load import save_design
from chamberopt.pictures.charts.strip import strip_picture
from chamberopt.results.command_records import strip_record, write_record

if TYPE_CHECKING:
    from chamberopt.peening.virtual_strip import VirtualStrip


def save_strip(folder: Path, strip: VirtualStrip) -> None:
    """Write design.toml, strip.csv, strip.png and, as the last file, strip.json into a folder."""
    record = strip_record(strip)
    save_design(strip.setting.design, folder / "design.toml")
    write_text(folder / "strip.csv", csv_text([one.as_json() for one in record.arc_heights]))
    strip_picture(folder / "strip.png", strip)
    write_record(folder / "strip.json", record)

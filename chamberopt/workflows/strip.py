"""Peen a virtual Almen strip and save it as a table (.csv), as JSON and as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from chamberopt.chamber.build import build_chamber
from chamberopt.common.files import csv_text, whole_or_nothing, write_text
from chamberopt.design.load import save_design
from chamberopt.design.zones import LID
from chamberopt.peening.strip import StripSize
from chamberopt.peening.virtual_strip import peen_strip, strip_in_lid, strip_in_zone
from chamberopt.pictures.charts.strip import strip_picture
from chamberopt.results.command_records import strip_record, write_record
from chamberopt.workflows.simulate import Teller, resolve_effects

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from chamberopt.design.almen_strip import StripType
    from chamberopt.design.load import Design
    from chamberopt.peening.virtual_strip import VirtualStrip
    from chamberopt.simulation.advice import Advice


class StripPlace(NamedTuple):
    """The type and size of an Almen strip and its place in the chamber.

    Attributes:
        at: "lid" for a strip that closes the chamber in place of the part, or the name of a zone of
            the part.
        distance_mm: distance from the sonotrode to a strip in the lid. None for the part's own
            distance.
    """

    type: StripType = "A"
    at: str = LID
    size: StripSize = StripSize()
    distance_mm: float | None = None


def peen_strip_in(
    design: Design, place: StripPlace, folder: Path, executor: Executor, teller: Teller
) -> tuple[VirtualStrip, list[Advice]]:
    """Peen an Almen strip in place of the part, and save it in a new or empty folder.

    Returns:
        The peened strip, and the reasons for physical effects that the design left to the program.
    """
    design.require_one_step("a virtual strip")
    with whole_or_nothing(folder):
        with teller.step("building the chamber"):
            if place.at == LID:
                setting = strip_in_lid(design, place.type, place.size, folder, place.distance_mm)
                chamber = build_chamber(setting.design)
            else:
                chamber = build_chamber(design)
                setting = strip_in_zone(design, place.type, place.at, chamber)
            teller.check(setting.design, chamber)
        resolved, advice = resolve_effects(setting.design, chamber, executor, teller)
        setting = setting._replace(design=resolved)
        teller.compile(resolved, chamber, None)
        with teller.step("replicas", resolved.process.accuracy.replicas) as progress:
            peened = peen_strip(setting, chamber, executor, progress)
        with teller.step("writing and drawing"):
            save_strip(folder, peened)
    return peened, advice


def save_strip(folder: Path, strip: VirtualStrip) -> None:
    """Write design.toml, strip.csv, strip.png and, as the last file, strip.json into a folder."""
    record = strip_record(strip)
    save_design(strip.setting.design, folder / "design.toml")
    write_text(folder / "strip.csv", csv_text([one.as_json() for one in record.arc_heights]))
    strip_picture(folder / "strip.png", strip)
    write_record(folder / "strip.json", record)

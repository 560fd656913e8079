"""A shop: the sonotrodes, balls and sizes of chambers that it has, known before any calibration.

`chamberopt new --shop FILE` proposes nothing that the shop in the file does not have. Without a
file, `usual_shop` stands in: usual sizes, with their sources in usual_shop.toml.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Annotated, NamedTuple

from pydantic import Field

from chamberopt.common.errors import InputError
from chamberopt.common.files import read_file
from chamberopt.common.toml_errors import Problem
from chamberopt.common.toml_fields import Pair, Several, Triple, list_field, quantity, read_toml
from chamberopt.design.design import validate
from chamberopt.design.materials import ball, ball_sizes, balls, find
from chamberopt.design.sonotrode import MAX_BLOCKS, Face
from chamberopt.design.table_base import FileTable

EXAMPLE = Path(__file__).with_name("usual_shop.toml")
MOST = 200  # sonotrodes, sizes of balls and heights in one file
AMPLITUDES = {"amplitudes_um": 500.0, "amplitudes_pv_um": 1000.0}  # the most of each [µm]
STEEL, HARD = "steel", "tungsten_carbide"  # materials of balls
Numbers = Annotated[Several[float], Field(max_length=MOST)]


class ShopSonotrode(FileTable):
    """A sonotrode of a shop: its face, its frequency and the amplitudes that it can set."""

    name: str = Field(min_length=1, max_length=100, description="what the shop calls it")
    diameter_mm: float | None = quantity(5, 2000, "mm", "of a round face", None)
    size_mm: Pair | None = list_field("two numbers [length, width] in mm", "of a block", None)
    frequency_khz: float = quantity(0.01, 200, "kHz", "usually 20")
    amplitudes_um: Numbers | None = list_field(f"1 to {MOST} numbers", "zero-to-peak", None)
    amplitudes_pv_um: Numbers | None = list_field(f"1 to {MOST} numbers", "peak-to-valley", None)
    note: str = Field(default="", max_length=300, description="such as its own resonance")
    pieces: int = Field(default=1, ge=1, le=MAX_BLOCKS, description="blocks to set side by side")

    def _problems(self) -> Iterator[Problem]:
        for key in ("name", "note"):  # a line break would end the design's comment
            if not getattr(self, key).isprintable():
                yield Problem(key, "has a line break or a control character; leave it out")
        if (self.diameter_mm is None) == (self.size_mm is None):
            yield Problem("diameter_mm", "give it for a disc, or size_mm for a block: one of them")
        if self.size_mm is not None and not all(5.0 <= one <= 2000.0 for one in self.size_mm):
            yield Problem("size_mm", f"given {list(self.size_mm)}; allowed: 5 to 2000 mm each")
        if self.pieces > 1 and self.size_mm is None:
            text = "given for a disc; only blocks (size_mm) make up one floor side by side"
            yield Problem("pieces", text)
        given = [key for key in AMPLITUDES if getattr(self, key) is not None]
        if len(given) != 1:
            text = "give amplitudes_um (zero-to-peak) or amplitudes_pv_um, one of them"
            yield Problem("amplitudes_um", text)
        for key in given:
            values = getattr(self, key)
            if not values or not all(0.1 <= one <= AMPLITUDES[key] for one in values):
                text = f"given {list(values)}; allowed: one or more, 0.1 to {AMPLITUDES[key]:g} µm"
                yield Problem(key, text)

    def amplitude_nearest(self, zero_to_peak_um: float) -> tuple[str, float]:
        """Return the design's key and value [µm] of the settable amplitude nearest to a given one.

        Args:
            zero_to_peak_um: the amplitude that is wanted.
        """
        if self.amplitudes_um is not None:
            near = min(self.amplitudes_um, key=lambda one: abs(one - zero_to_peak_um))
            return "amplitude_um", near
        assert self.amplitudes_pv_um is not None
        near = min(self.amplitudes_pv_um, key=lambda one: abs(0.5 * one - zero_to_peak_um))
        return "amplitude_pv_um", near

    @property
    def face(self) -> Face:
        """Its face, the longer side of a block along x."""
        size = None if self.size_mm is None else (max(self.size_mm), min(self.size_mm))
        return Face(name=self.name, diameter_mm=self.diameter_mm, size_mm=size)


class Stand(NamedTuple):
    """What a chamber stands on: the face of a sonotrode, or of several side by side."""

    sonotrode: ShopSonotrode
    face: Face  # the longer side along x


class StockBalls(FileTable):
    """Balls of one material that a shop has in stock."""

    material: str = Field(description="a name that `chamberopt shot` lists")
    diameters_mm: Numbers = list_field(f"1 to {MOST} numbers", "of the balls in stock")

    def _problems(self) -> Iterator[Problem]:
        if find(self.material, balls()) is None:
            known = ", ".join(one.name for one in balls())
            yield Problem("material", f"given {self.material!r}; known are {known}")
        if not self.diameters_mm or not all(0.1 <= one <= 20.0 for one in self.diameters_mm):
            text = f"given {list(self.diameters_mm)}; allowed: one or more, 0.1 to 20 mm"
            yield Problem("diameters_mm", text)


class Shop(FileTable):
    """What a shop has: sonotrodes, balls in stock, and the sizes of chambers that it can build."""

    sonotrodes: Annotated[Several[ShopSonotrode], Field(min_length=1, max_length=MOST)] = (
        list_field(f"1 to {MOST} tables, [[sonotrodes]]", "that can carry a chamber")
    )
    balls: Annotated[Several[StockBalls], Field(max_length=MOST)] = list_field(
        f"at most {MOST} tables, [[balls]]", "in stock; without any, all that are sold", ()
    )
    clearance_mm: float = quantity(0.01, 5, "mm", "between a sonotrode and the wall round it", 0.2)
    largest_chamber_mm: Triple | None = list_field(
        "three numbers [length, width, height] in mm", "inside of the largest chamber", None
    )
    heights_mm: Numbers = list_field(f"at most {MOST} numbers", "of standard walls and lids", ())

    def _problems(self) -> Iterator[Problem]:
        if not all(2.0 <= one <= 2000.0 for one in self.largest_chamber_mm or ()):
            text = f"given {list(self.largest_chamber_mm or ())}; allowed: 2 to 2000 mm each"
            yield Problem("largest_chamber_mm", text)
        if not all(2.0 <= one <= 2000.0 for one in self.heights_mm):
            text = f"given {list(self.heights_mm)}; allowed: 2 to 2000 mm each"
            yield Problem("heights_mm", text)

    def stands(self) -> list[Stand]:
        """Return the sonotrodes, each of which can carry a chamber alone."""
        return [Stand(one, one.face) for one in self.sonotrodes]

    def stands_of_blocks(self) -> Iterator[Stand]:
        """Yield the floors that the shop's blocks make side by side, no wider than long."""
        for one in self.sonotrodes:
            for columns, rows in product(range(1, one.pieces + 1), repeat=2):
                if 1 < columns * rows <= one.pieces:
                    for block in {one.face, one.face.turned}:
                        face = block.model_copy(update={"columns": columns, "rows": rows})
                        if face.sides_mm[0] >= face.sides_mm[1]:
                            yield Stand(one, face)

    def has(self, material: str) -> bool:
        """Return whether the shop has balls of a material."""
        return not self.balls or any(ball(one.material).name == material for one in self.balls)

    def stock_mm(self, material: str) -> tuple[float, ...]:
        """Return the diameters [mm] in stock of balls of a material, in ascending order.

        Raises InputError if there are none that do not enter the clearance round a sonotrode.
        """
        stock = ball_sizes(material)
        if self.balls:
            own = [one for one in self.balls if ball(one.material).name == ball(material).name]
            stock = tuple(size for one in own for size in one.diameters_mm)
            if not own:
                have = ", ".join(sorted({ball(one.material).name for one in self.balls}))
                raise InputError(f"--shot: the shop has no balls of {material}; it has {have}")
        fit = tuple(sorted({one for one in stock if one >= 2.0 * self.clearance_mm}))
        if not fit:
            text = f"all balls of {material} are smaller than twice clearance_mm"
            raise InputError(f"--shop: {text} = {self.clearance_mm:g}; give larger ones")
        return fit


def load_shop(path: Path) -> Shop:
    """Load a shop's file. Raises InputError, which names every problem with file and line."""
    source, data = read_toml(path, "shop", "see chamberopt shop --example")
    if "log_mean" in data:
        text = "this is what chamberopt calibrate found of a machine; give a file of what the shop"
        raise InputError(f"{path}: {text} has: chamberopt shop --example prints one")
    return validate(Shop, data, path, source)


def example_text() -> str:
    """Return the text of an annotated file of a shop, with usual sizes."""
    return read_file(EXAMPLE, follow=True).decode()


def usual_shop() -> Shop:
    """Return a shop with usual sonotrodes, and with all balls that are sold."""
    return load_shop(EXAMPLE).model_copy(update={"balls": ()})

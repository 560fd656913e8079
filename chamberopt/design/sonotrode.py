"""Sonotrodes of a design: the chamber's floor, and further sonotrodes in its walls."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Literal, Self

import numpy as np
from pydantic import Field

from chamberopt.common.toml_errors import Problem
from chamberopt.common.toml_fields import (
    Direction,
    Pair,
    Position,
    Several,
    Shift,
    list_field,
    quantity,
)
from chamberopt.design.shapes.hole_and_deflector_tables import PlacedBore
from chamberopt.design.table_base import SI, FileTable

if TYPE_CHECKING:
    from sim_core import AmplitudeProfile

MAX_POINTS = 50  # points of a profile
MAX_SHARE = 2.0
MAX_BLOCKS = 20  # in a row
ROUND = 64  # corners about a disc
# Height of what is drawn of a disc or block over its side, and its depth below the floor over that
# height, so that the floor is drawn in front of it.
DRAWN, SUNK = 0.15, 0.01
LEAST_LARGEST = 0.1  # of the shares: with less, amplitude_um is not that of the face
POINTS = (
    "pairs [mm from the middle, share], from 0 to the rim, e.g. [[0, 1], [20, 0.97], [35, 0.9]]"
)


class AmplitudeProfileTable(FileTable):
    """Amplitude over the face of a sonotrode, which bends, as shares of its given amplitude.

    The share is 1 where the given amplitude was measured, usually in the middle of the face.
    """

    share_at_mm: Annotated[Several[Pair], Field(max_length=MAX_POINTS)] = list_field(
        POINTS, "measured share of the amplitude, at distances from the middle"
    )
    middle_mm: Shift = list_field(
        "two numbers [x, y] in mm", "middle of the floor's face, in the chamber's frame", (0.0, 0.0)
    )

    def _problems(self) -> Iterator[Problem]:
        if len(self.share_at_mm) < 2:
            text = f"given {len(self.share_at_mm)} points; allowed: two or more {POINTS}"
            yield Problem("share_at_mm", text)
            return
        for i, (distance, share) in enumerate(self.share_at_mm):
            if not 0.0 <= share <= MAX_SHARE:
                text = f"given {share:g}; allowed: a share from 0 to {MAX_SHARE:g}"
                yield Problem(f"share_at_mm.{i}.1", text)
            if not 0.0 <= distance <= 1000.0:
                text = f"given {distance:g}; allowed: 0 to 1000 mm"
                yield Problem(f"share_at_mm.{i}.0", text)
        if self.share_at_mm[0][0] != 0.0:
            text = f"given {self.share_at_mm[0][0]:g}; the first point is the middle, at 0 mm"
            yield Problem("share_at_mm.0.0", text)
        for i, ((nearer, _), (further, _)) in enumerate(pairwise(self.share_at_mm), start=1):
            if further <= nearer:
                text = f"given {further:g} after {nearer:g} mm; give each distance once, in order"
                yield Problem(f"share_at_mm.{i}.0", text)
        if self.largest < LEAST_LARGEST:
            text = (
                f"given no share of {LEAST_LARGEST:g} or more, so the face would hardly move; the "
                "share is 1 where the amplitude was measured"
            )
            yield Problem("share_at_mm", text)

    @property
    def largest(self) -> float:
        """Largest share of the given amplitude."""
        return max(share for _, share in self.share_at_mm)

    def simulated(self, middle: tuple[float, float, float]) -> AmplitudeProfile:
        """Return the profile in the form that the simulator takes, in shares of the largest one.

        ``middle``: middle of the face [m].
        """
        from sim_core import AmplitudeProfile

        points = ((1e-3 * far, share / self.largest) for far, share in self.share_at_mm)
        return AmplitudeProfile(tuple(points), middle)

    @property
    def rms(self) -> float:
        """Rms share of the given amplitude over the disc to the last point."""
        from sim_core import rms_share

        return self.largest * rms_share(self.simulated((0.0, 0.0, 0.0)))

    @property
    def in_words(self) -> str:
        """Return the profile in words, such as 1.00 in the middle to 0.90 at 35 mm, rms 0.95."""
        (_, middle), (rim, last) = self.share_at_mm[0], self.share_at_mm[-1]
        extreme = "" if self.largest <= max(middle, last) else f", at most {self.largest:.2f}"
        return (
            f"{middle:.2f} in the middle to {last:.2f} at {rim:g} mm{extreme}, rms {self.rms:.2f}"
        )


class VibratingFace(FileTable):
    """Frequency and amplitude of a sonotrode's vibrating face.

    The amplitude is given either zero-to-peak or peak-to-valley.
    """

    frequency_khz: float = quantity(0.01, 200, "kHz", "usually 20")
    amplitude_um: float | None = quantity(
        0.1, 500, "µm", "zero-to-peak: half of peak-to-valley", None
    )
    amplitude_pv_um: float | None = quantity(
        0.2, 1000, "µm", "peak-to-valley, as the trade says: twice zero-to-peak", None
    )

    amplitude_profile: AmplitudeProfileTable | None = Field(
        default=None,
        description="amplitude over the face: { share_at_mm = [[0, 1], [35, 0.9]] }; absent: the "
        "same everywhere",
    )

    frequency = SI("frequency_khz", 1e3, "Frequency [Hz]")

    def _problems(self) -> Iterator[Problem]:
        if self.amplitude_um is None and self.amplitude_pv_um is None:
            text = "missing; give it (zero-to-peak), or amplitude_pv_um (peak-to-valley)"
            yield Problem("amplitude_um", text)
        if self.amplitude_um is not None and self.amplitude_pv_um is not None:
            text = f"given beside amplitude_um = {self.amplitude_um:g}; give one of the two"
            yield Problem("amplitude_pv_um", text)

    @property
    def amplitude_key(self) -> str:
        """Return the key with which the file gives the amplitude."""
        return "amplitude_pv_um" if self.amplitude_um is None else "amplitude_um"

    @property
    def per_amplitude(self) -> float:
        """Return 2 if the amplitude is given peak-to-valley, and 1 if it is given zero-to-peak."""
        return 2.0 if self.amplitude_um is None else 1.0

    @property
    def zero_to_peak_um(self) -> float:
        """Return the zero-to-peak amplitude [µm], whichever way the file gives the amplitude."""
        return float(getattr(self, self.amplitude_key)) / self.per_amplitude

    @property
    def amplitude(self) -> float:
        """Zero-to-peak amplitude [m]; with a profile, where the share is 1."""
        return self.zero_to_peak_um * 1e-6

    @property
    def peak_speed(self) -> float:
        """Return the largest speed of the face [m/s], 2 pi times frequency times amplitude.

        With a profile it is that of places where the share is 1.
        """
        return 2.0 * math.pi * self.frequency * self.amplitude

    @property
    def largest_share(self) -> float:
        """Return the largest share of the amplitude on the face; 1 without a profile."""
        return 1.0 if self.amplitude_profile is None else self.amplitude_profile.largest

    @property
    def largest_amplitude(self) -> float:
        """Return the zero-to-peak amplitude [m] of the place that moves most."""
        return self.amplitude * self.largest_share

    @property
    def is_centred(self) -> bool:
        """Return True if the amplitude depends on the distance from the chamber's axis alone."""
        return self.amplitude_profile is None or not any(self.amplitude_profile.middle_mm)

    @property
    def rms_peak_speed(self) -> float:
        """Return the rms over the face of the peak speed [m/s], the scale of the shot's speed."""
        profile = self.amplitude_profile
        return self.peak_speed if profile is None else self.peak_speed * profile.rms


class Face(FileTable):
    """The whole face on which the chamber stands: a disc or a block, or blocks side by side.

    Its middle is on the chamber's axis. The walls stand on it or go round it, so that the floor is
    the face or a part of it. Blocks are simulated as one face that moves alike all over, and no
    ball enters their joints.
    """

    name: str = Field(default="", max_length=100, description="what the shop calls the sonotrode")
    diameter_mm: float | None = quantity(5, 2000, "mm", "of a round face", None)
    size_mm: Pair | None = list_field("two numbers [x, y] in mm", "sides of a block", None)
    columns: int = Field(
        default=1, ge=1, le=MAX_BLOCKS, description="of blocks, side by side along x"
    )
    rows: int = Field(default=1, ge=1, le=MAX_BLOCKS, description="of blocks, side by side along y")

    def _problems(self) -> Iterator[Problem]:
        if not self.name.isprintable():
            yield Problem("name", "has a line break or a control character; leave it out")
        if (self.diameter_mm is None) == (self.size_mm is None):
            yield Problem("diameter_mm", "give it for a disc, or size_mm for a block: one of them")
        if self.size_mm is not None and not all(5.0 <= one <= 2000.0 for one in self.size_mm):
            yield Problem("size_mm", f"given {list(self.size_mm)}; allowed: 5 to 2000 mm each")
        if self.size_mm is None and self.count > 1:
            text = "given for a disc; only blocks (size_mm) make up one floor side by side"
            yield Problem("columns", text)

    @property
    def block_mm(self) -> tuple[float, float]:
        """Lengths along x and y of one block; of a disc twice its diameter."""
        return self.size_mm or (self.diameter_mm or math.nan,) * 2

    @property
    def sides_mm(self) -> tuple[float, float]:
        """Lengths along x and y of the disc or of all blocks together."""
        x, y = self.block_mm
        return self.columns * x, self.rows * y

    @property
    def count(self) -> int:
        """Number of all blocks; 1 for a disc."""
        return self.columns * self.rows

    @property
    def area_mm2(self) -> float:
        """Length times width."""
        return math.prod(self.sides_mm)

    @property
    def turned(self) -> Self:
        """The same face turned by 90 degrees."""
        x, y = self.block_mm
        size = None if self.size_mm is None else (y, x)
        return self.model_copy(update={"size_mm": size, "columns": self.rows, "rows": self.columns})

    @property
    def outline(self) -> np.ndarray:
        """Corners (n, 2) [m] of the face, counter-clockwise; a disc lies within its corners."""
        half = 5e-4 * np.array(self.sides_mm)
        if self.size_mm is not None:
            return np.asarray(half * np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]]))
        angle = 2.0 * np.pi * np.arange(ROUND) / ROUND
        return np.asarray(half / np.cos(np.pi / ROUND) * np.c_[np.cos(angle), np.sin(angle)])

    @property
    def body(self) -> tuple[np.ndarray, np.ndarray]:
        """Body to draw below the face, closed: its points [m] and triangles.

        How far a sonotrode reaches down, half a wave or more, is not known: a piece is drawn.
        """
        from chamberopt.geometry.solids import extrude

        height = DRAWN * 1e-3 * max(self.block_mm)
        points, triangles = extrude(self.outline, height)
        return points - [0.0, 0.0, (1.0 + SUNK) * height], triangles

    def joints_on(self, vertices: np.ndarray, floor: np.ndarray) -> np.ndarray:
        """Return both ends of each joint between blocks on a floor [m], (k, 2, 3).

        Args:
            vertices: of the chamber [m], (n, 3).
            floor: triangles of its floor, (m, 3).
        """
        from chamberopt.geometry.triangles import border_edges

        start, end = np.moveaxis(vertices[border_edges(floor)], 1, 0)
        found = []
        for axis, places in enumerate(self.joints_mm):
            for at in 1e-3 * np.array(places):
                meets = (start[:, axis] > at) != (end[:, axis] > at)
                one, way = start[meets], (end - start)[meets]
                points = one + way * ((at - one[:, axis]) / way[:, axis])[:, None]
                found.append(points[points[:, 1 - axis].argsort()].reshape(-1, 2, 3))
        return np.concatenate(found) if found else np.zeros((0, 2, 3))

    @property
    def joints_mm(self) -> tuple[list[float], list[float]]:
        """Places of the joints between columns along x, and between rows along y."""
        (x, y), (long, wide) = self.block_mm, self.sides_mm
        return (
            [k * x - 0.5 * long for k in range(1, self.columns)],
            [k * y - 0.5 * wide for k in range(1, self.rows)],
        )

    @property
    def in_words(self) -> str:
        """Number, size and name, such as 4 blocks of 80 × 80 mm side by side, 2 × 2 (block A)."""
        size = " × ".join(f"{one:g}" for one in dict.fromkeys(self.block_mm))
        if self.count == 1 and self.name:
            return f'"{self.name}" ({size} mm)'
        if self.count == 1:
            return f"a {'disc' if self.size_mm is None else 'block'} of {size} mm"
        x, y = self.block_mm
        grid = f"{self.columns} × {self.rows}" + (f" ({self.name})" if self.name else "")
        return f"{self.count} blocks of {x:g} × {y:g} mm side by side, {grid}"


class Sonotrode(VibratingFace):
    """The first sonotrode, which is the vibrating floor of the chamber."""

    face: Face | None = Field(
        default=None,
        description="on which the chamber stands: { diameter_mm = 70 } or, of blocks, "
        "{ size_mm = [80, 80], columns = 2 }; absent: not known, and no larger than the floor",
    )

    motion: Literal["sinusoidal", "random_phase"] = Field(
        default="sinusoidal",
        description="how the face moves: in time, or each ball meets it at a random phase",
    )

    def _problems(self) -> Iterator[Problem]:
        yield from super()._problems()
        if self.face is not None and self.face.count > 1 and self.amplitude_profile is not None:
            text = "given beside blocks, each of which has its own: not supported; leave one out"
            yield Problem("amplitude_profile", text)


class FurtherSonotrode(PlacedBore, VibratingFace):
    """A further sonotrode: a round face at the bottom of a well that opens into the room."""

    at_mm: Position = Field(description="middle of the face, in the chamber's frame")
    axis: Direction = Field(description="the way the face looks, into the room")
    diameter_mm: float = quantity(0.5, 2000, "mm", "of the face")
    phase_deg: float = quantity(
        -360, 360, "degrees", "ahead of the first sonotrode, at the same frequency", 0.0
    )

    def _problems(self) -> Iterator[Problem]:
        yield from super()._problems()
        profile = self.amplitude_profile
        if profile is not None and any(profile.middle_mm):
            text = "given for a further sonotrode, whose middle is at_mm; leave it out"
            yield Problem("amplitude_profile.middle_mm", text)

    @property
    def phase(self) -> float:
        """Phase [rad] by which this sonotrode's vibration is ahead of the first sonotrode's."""
        return math.radians(self.phase_deg)

"""Sonotrodes of a design: the chamber's floor, and further sonotrodes in its walls."""

import math
from collections.abc import Iterator
from typing import Literal

from pydantic import Field

from chamberopt.common.toml_errors import Problem
from chamberopt.common.toml_fields import Direction, Position, quantity
from chamberopt.design.shapes.hole_and_deflector_tables import PlacedBore
from chamberopt.design.table_base import SI, FileTable


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
        """Zero-to-peak amplitude [m]."""
        return self.zero_to_peak_um * 1e-6

    @property
    def peak_speed(self) -> float:
        """Return the largest speed of the face [m/s], 2 pi times frequency times amplitude."""
        return 2.0 * math.pi * self.frequency * self.amplitude


class Sonotrode(VibratingFace):
    """The first sonotrode, which is the vibrating floor of the chamber."""

    motion: Literal["sinusoidal", "random_phase"] = Field(
        default="sinusoidal",
        description="how the face moves: in time, or each ball meets it at a random phase",
    )


class FurtherSonotrode(PlacedBore, VibratingFace):
    """A further sonotrode: a round face at the bottom of a well that opens into the room."""

    at_mm: Position = Field(description="middle of the face, in the chamber's frame")
    axis: Direction = Field(description="the way the face looks, into the room")
    diameter_mm: float = quantity(0.5, 2000, "mm", "of the face")
    phase_deg: float = quantity(
        -360, 360, "degrees", "ahead of the first sonotrode, at the same frequency", 0.0
    )

    @property
    def phase(self) -> float:
        """Phase [rad] by which this sonotrode's vibration is ahead of the first sonotrode's."""
        return math.radians(self.phase_deg)

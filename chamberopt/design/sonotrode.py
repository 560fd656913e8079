"""Sonotrodes of a design: the one that is the chamber's floor, and further ones in its walls."""

import math
from typing import Literal

from pydantic import Field

from chamberopt.common.toml_fields import Direction, Position, quantity
from chamberopt.design.shapes.hole_and_deflector_tables import PlacedBore
from chamberopt.design.table_base import SI, FileTable


class VibratingFace(FileTable):
    """A face that vibrates. Amplitude is ZERO-TO-PEAK: half of a peak-to-valley figure."""

    frequency_khz: float = quantity(0.01, 200, "kHz", "usually 20")
    amplitude_um: float = quantity(0.1, 500, "µm", "zero-to-peak: half of peak-to-valley")

    frequency = SI("frequency_khz", 1e3, "Frequency [Hz]")
    amplitude = SI("amplitude_um", 1e-6, "Zero-to-peak amplitude [m]")

    @property
    def peak_speed(self) -> float:
        """Largest speed of the face, 2 pi f A [m/s]."""
        return 2.0 * math.pi * self.frequency * self.amplitude


class Sonotrode(VibratingFace):
    """The vibrating floor."""

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
        """Phase ahead of the first sonotrode [rad]."""
        return math.radians(self.phase_deg)

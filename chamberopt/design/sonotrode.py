"""The sonotrodes of a design: the one that is the chamber's floor, and further ones that look into it."""

import math
from typing import Literal

from pydantic import BaseModel, Field

from chamberopt.common.toml_fields import (
    Direction,
    Position,
    list_field,
    metres,
    quantity,
    unit_vector,
)
from chamberopt.design.materials import STRICT


class Vibrating(BaseModel):
    """A face that vibrates. Amplitude is ZERO-TO-PEAK: half of a peak-to-valley figure."""

    model_config = STRICT

    frequency_khz: float = quantity(0.01, 200, "kHz", "usually 20")
    amplitude_um: float = quantity(0.1, 500, "µm", "zero-to-peak: half of peak-to-valley")

    @property
    def frequency(self) -> float:
        """Frequency [Hz]."""
        return self.frequency_khz * 1e3

    @property
    def amplitude(self) -> float:
        """Zero-to-peak amplitude [m]."""
        return self.amplitude_um * 1e-6

    @property
    def peak_speed(self) -> float:
        """Largest speed of the face, 2 pi f A [m/s]."""
        return 2.0 * math.pi * self.frequency * self.amplitude


class Sonotrode(Vibrating):
    """The vibrating floor."""

    motion: Literal["sinusoidal", "random_phase"] = Field(
        default="sinusoidal",
        description="how the face moves: as it does, or met by each ball at a phase drawn anew",
    )


class FurtherSonotrode(Vibrating):
    """One more: a round face at the bottom of a well that opens into the room."""

    at_mm: Position = list_field(
        "three numbers [x, y, z] in mm", "middle of the face, in the chamber's frame"
    )
    axis: Direction = list_field(
        "three numbers [x, y, z], not all 0", "the way the face looks, into the room"
    )
    diameter_mm: float = quantity(0.5, 2000, "mm", "of the face")
    phase_deg: float = quantity(
        -360, 360, "degrees", "ahead of the first sonotrode, at the same frequency", 0.0
    )

    @property
    def at(self) -> tuple[float, float, float]:
        """Middle of the face (x, y, z) [m]."""
        return metres(self.at_mm)

    @property
    def direction(self) -> tuple[float, float, float]:
        """The way the face looks, a unit vector."""
        return unit_vector(self.axis)

    @property
    def diameter(self) -> float:
        """Of the face [m]."""
        return self.diameter_mm * 1e-3

    @property
    def phase(self) -> float:
        """Ahead of the first sonotrode [rad]."""
        return math.radians(self.phase_deg)

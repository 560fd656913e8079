"""Which effects a design asks for: one optional key of [effects] each; what is absent is not simulated."""

import math
from typing import Self

from pydantic import BaseModel, Field, model_validator

from chamberopt.common.toml_errors import CrossCheckError, Problem
from chamberopt.common.toml_fields import Triple, list_field, quantity
from chamberopt.design.materials import STRICT


class PartTurn(BaseModel):
    """The part turns about an axis during peening: steadily (rpm), or to and fro (angle_deg and frequency_hz)."""

    model_config = STRICT

    rpm: float | None = quantity(
        -10000, 10000, "1/min", "right-handed about the axis; real set-ups: 1 to 100", None
    )
    angle_deg: float | None = quantity(0.01, 3600, "degrees", "to and fro, to each side", None)
    frequency_hz: float | None = quantity(1e-4, 100, "Hz", "of the motion to and fro", None)
    axis: Triple = list_field(
        "three numbers [x, y, z], not all 0", "direction, in the part file's frame", (0.0, 0.0, 1.0)
    )
    through_mm: Triple = list_field(
        "three numbers [x, y, z] in mm", "a point on it, same frame", (0.0, 0.0, 0.0)
    )

    @model_validator(mode="after")
    def _agree(self) -> Self:
        problems = []
        if not any(self.axis):
            problems.append(
                Problem("axis", "given [0, 0, 0], which points nowhere; e.g. [0, 0, 1]")
            )
        if (self.angle_deg is None) != (self.frequency_hz is None):
            given, lacking = (
                ("angle_deg", "frequency_hz")
                if self.frequency_hz is None
                else ("frequency_hz", "angle_deg")
            )
            remedy = (
                "rpm is given: remove it" if self.rpm is not None else "give both, or rpm instead"
            )
            problems.append(Problem(given, f"given without {lacking}; {remedy}"))
        elif self.rpm is not None and self.angle_deg is not None:
            problems.append(
                Problem("rpm", "given beside angle_deg and frequency_hz; keep rpm or the other two")
            )
        elif self.rpm is None and self.angle_deg is None:
            problems.append(
                Problem(
                    "", "says no motion; e.g. { rpm = 30 } or { angle_deg = 20, frequency_hz = 1 }"
                )
            )
        if problems:
            raise CrossCheckError(problems)
        return self

    @property
    def amplitude(self) -> float | None:
        """Largest angle to each side [rad], of a part that turns to and fro."""
        return None if self.angle_deg is None else math.radians(self.angle_deg)

    @property
    def through(self) -> tuple[float, float, float]:
        """A point on the axis [m], in the part file's frame."""
        x, y, z = self.through_mm
        return x * 1e-3, y * 1e-3, z * 1e-3

    @property
    def period(self) -> float:
        """Time [s] after which the part is where it was; infinite for 0 rpm."""
        if self.frequency_hz is not None:
            return 1.0 / self.frequency_hz
        return 60.0 / abs(self.rpm) if self.rpm else math.inf


class FrictionTable(BaseModel):
    """Balls rub and spin: Walton's mu and beta0, of balls on all surfaces and, unless given apart, of ball on ball."""

    model_config = STRICT

    mu: float = Field(
        ge=0.0, le=10.0, description="coefficient of friction; 0 is smooth, metals: tenths"
    )
    beta0: float = Field(
        ge=-1.0,
        le=1.0,
        description="of a hit that sticks, slip after over slip before, turned round",
    )
    mu_balls: float | None = Field(
        default=None, ge=0.0, le=10.0, description="mu of ball on ball, if not the same"
    )
    beta0_balls: float | None = Field(
        default=None, ge=-1.0, le=1.0, description="beta0 of ball on ball, likewise"
    )

    @property
    def surfaces(self) -> tuple[float, float]:
        """mu and beta0 of a ball on a surface."""
        return self.mu, self.beta0

    @property
    def balls(self) -> tuple[float, float]:
        """mu and beta0 of ball on ball."""
        return (
            self.mu if self.mu_balls is None else self.mu_balls,
            self.beta0 if self.beta0_balls is None else self.beta0_balls,
        )


class Effects(BaseModel):
    """Which effects act on the shot in flight. What is not listed here is not simulated."""

    model_config = STRICT

    auto: bool = Field(
        default=False,
        description='the others are switched for you, by a pilot run; short for { auto = true }: effects = "auto"',
    )
    gravity: bool = Field(default=True, description="9.80665 m/s² downwards")
    part_turn: PartTurn | None = Field(
        default=None, description="{ rpm = ... } or { angle_deg = ..., frequency_hz = ... }"
    )
    friction: FrictionTable | None = Field(
        default=None,
        description="balls rub and spin: { mu = 0.3, beta0 = 0.2 }; left out: smooth, no rotation",
    )
    rest: bool | None = Field(
        default=None,
        description="balls slide and lie still on surfaces that neither vibrate nor turn; left out: where the chamber "
        "has some that face up",
    )

    drag: bool = Field(
        default=False, description="of still air at 20 °C: 0.4 m/s² for 3 mm of steel at 5 m/s"
    )
    ball_collisions: bool = Field(
        default=True, description="false: balls fly through each other; for very little shot"
    )

    @model_validator(mode="after")
    def _agree(self) -> Self:
        if self.rest and not self.gravity:
            raise CrossCheckError(
                [Problem("rest", "given true with gravity = false; nothing lies still without")]
            )
        return self

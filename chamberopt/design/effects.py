"""Physical effects of a design, such as gravity and friction: keys of the table [effects]."""

import math
from collections.abc import Iterator
from typing import ClassVar

from pydantic import Field, ValidationInfo, field_validator

from chamberopt.common.toml_errors import CrossCheckError, Problem
from chamberopt.common.toml_fields import Triple, list_field, quantity
from chamberopt.design.materials import CATALOGUE, NONE, treatments
from chamberopt.design.table_base import FileTable, Metres

FRICTION_FORM = f'"{CATALOGUE}", "{NONE}", or a table, e.g. {{ mu = 0.2, beta0 = 0.2 }}'
ROUGHNESS_FORM = (
    ", ".join(f'"{one.name}"' for one in treatments())
    + f', "{NONE}", or a table, e.g. {{ slope_deg = 3 }}'
)
FLEXURE_FORM = (
    "true, false, or a table, e.g. { part_E_GPa = 114, part_poisson = 0.34, "
    "part_density_kg_m3 = 4430 }"
)


class PartTurn(FileTable):
    """Rotation of the part about an axis: steady (rpm) or to and fro (angle_deg, frequency_hz)."""

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

    def _problems(self) -> Iterator[Problem]:
        if not any(self.axis):
            yield Problem("axis", "given [0, 0, 0], which points nowhere; e.g. [0, 0, 1]")
        oscillation = {"angle_deg": self.angle_deg, "frequency_hz": self.frequency_hz}
        given = [name for name, value in oscillation.items() if value is not None]
        if len(given) == 1:
            lacking = (oscillation.keys() - given).pop()
            steady = self.rpm is not None
            remedy = "rpm is given: remove it" if steady else "give both, or rpm instead"
            yield Problem(given[0], f"given without {lacking}; {remedy}")
        elif given and self.rpm is not None:
            text = "given beside angle_deg and frequency_hz; keep rpm or the other two"
            yield Problem("rpm", text)
        elif not given and self.rpm is None:
            example = "{ rpm = 30 } or { angle_deg = 20, frequency_hz = 1 }"
            yield Problem("", f"gives no motion; e.g. {example}")

    @property
    def amplitude(self) -> float | None:
        """Largest angle to each side [rad] of a part that turns to and fro."""
        return None if self.angle_deg is None else math.radians(self.angle_deg)

    through = Metres("through_mm", "A point on the axis [m], in the part file's frame")

    @property
    def period(self) -> float:
        """Time [s] after which the part is at its starting angle again; infinite for 0 rpm."""
        if self.frequency_hz is not None:
            return 1.0 / self.frequency_hz
        return 60.0 / abs(self.rpm) if self.rpm else math.inf


class FrictionTable(FileTable):
    """Friction of balls on surfaces and, unless given separately, of ball on ball.

    mu is the coefficient of friction and beta0 the tangential restitution of Walton's model.
    """

    # Names of the coefficients, for calibrations and ranges that know them to a common factor.
    COEFFICIENTS: ClassVar[tuple[str, ...]] = (
        "mu", "mu_part", "mu_sonotrode", "mu_wall", "mu_balls",
    )  # fmt: skip

    mu: float = quantity(0, 10, "", "coefficient of friction; 0 is smooth, metals: tenths")
    beta0: float = quantity(
        -1,
        1,
        "",
        "tangential restitution of a sticking impact: minus the slip after over the slip before",
    )
    mu_part: float | None = quantity(0, 10, "", "mu on the part, if not the same", None)
    mu_sonotrode: float | None = quantity(0, 10, "", "mu on sonotrodes, likewise", None)
    mu_wall: float | None = quantity(0, 10, "", "mu on walls and lid, likewise", None)
    mu_balls: float | None = quantity(0, 10, "", "mu of ball on ball, if not the same", None)
    beta0_balls: float | None = quantity(-1, 1, "", "beta0 of ball on ball, if not the same", None)
    pairs: str | None = Field(
        default=None,
        description="materials for which the catalogue gave these numbers; written by the program, "
        "which looks them up anew for others",
    )

    @property
    def surfaces(self) -> tuple[tuple[float, float], ...]:
        """Friction coefficient mu and tangential restitution beta0 of a ball on the part, on
        sonotrodes and on walls.
        """
        own = (self.mu_part, self.mu_sonotrode, self.mu_wall)
        return tuple((self.mu if one is None else one, self.beta0) for one in own)

    @property
    def balls(self) -> tuple[float, float]:
        """Friction coefficient mu and tangential restitution beta0 of ball on ball."""
        mu, beta0 = self.mu_balls, self.beta0_balls
        return self.mu if mu is None else mu, self.beta0 if beta0 is None else beta0


class RoughnessTable(FileTable):
    """Roughness of the surfaces that balls hit: the rms slope of a profile, one number or several.

    A dented face has slopes: a dent of diameter d by a ball of diameter D has an rms slope of
    d / (2 D), 4 degrees for dents of 0.4 mm by balls of 3 mm. Only slopes over lengths of a contact
    or more count, tenths of a millimetre: Rdq of a profile that is filtered so.
    """

    SLOPES: ClassVar[tuple[str, ...]] = ("slope_deg", "part_deg", "sonotrode_deg", "wall_deg")

    slope_deg: float = quantity(0, 25, "degrees", "rms slope of all surfaces; peened faces: 2 to 5")
    part_deg: float | None = quantity(0, 25, "degrees", "of the part, if not the same", None)
    sonotrode_deg: float | None = quantity(0, 25, "degrees", "of sonotrodes, likewise", None)
    wall_deg: float | None = quantity(0, 25, "degrees", "of walls and lid, likewise", None)
    treatment: str | None = Field(
        default=None,
        description="treatment for which the catalogue gave slope_deg; written by the program",
    )

    def _problems(self) -> Iterator[Problem]:
        names = [one.name for one in treatments()]
        if self.treatment is not None and self.treatment not in names:
            text = f"given {self.treatment!r}; allowed: {', '.join(names)}; or leave it out"
            yield Problem("treatment", text)

    @property
    def slopes(self) -> tuple[float, float, float]:
        """Rms slopes [-] of part, sonotrodes and walls."""
        own = (self.part_deg, self.sonotrode_deg, self.wall_deg)
        degrees = (self.slope_deg if one is None else one for one in own)
        part, sonotrode, wall = (math.tan(math.radians(one)) for one in degrees)
        return part, sonotrode, wall


class FlexureTable(FileTable):
    """Flexure of thin parts, by Zener's theory, and the elasticity of part and balls.

    The elasticity is that of the alloy and of the balls in the catalogue unless it is given.
    """

    on: bool = Field(
        default=True, description="false: parts are rigid however thin; short: flexure = false"
    )
    part_E_GPa: float | None = quantity(  # noqa: N815
        1, 1500, "GPa", "Young's modulus of the part, if not the alloy's", None
    )
    part_poisson: float | None = quantity(0, 0.5, "", "Poisson's ratio of the part, likewise", None)
    part_density_kg_m3: float | None = quantity(
        500, 25000, "kg/m³", "density of the part, likewise", None
    )
    shot_E_GPa: float | None = quantity(  # noqa: N815
        1, 1500, "GPa", "Young's modulus of the balls, if not the material's", None
    )
    shot_poisson: float | None = quantity(0, 0.5, "", "Poisson's ratio of the balls", None)

    def _problems(self) -> Iterator[Problem]:
        for which in ("part_", "shot_"):
            keys = [key for key in type(self).model_fields if key.startswith(which)]
            given = [key for key in keys if getattr(self, key) is not None]
            for key in keys if given else ():
                if key not in given:
                    yield Problem(key, f"missing beside {given[0]}; give {' and '.join(keys)}")


class SurfaceEffectTable(FileTable):
    """Base class of a table in [effects] that adds a further effect of hits on surfaces.

    The simulator knows the effect by the key of the table.
    """

    @property
    def parameters(self) -> dict[str, float]:
        """Return the numbers for the simulator's effect of the same name, in SI units."""
        raise NotImplementedError


class Effects(FileTable):
    """The effects that act on the shot.

    Friction and roughness that a design file leaves out are those of the catalogue
    (materials/friction.py). Balls lie at rest, and thin parts bend, where chamber and part ask for
    it. Gravity and collisions of balls are on. Drag and a turning part must be asked for.
    """

    auto: bool = Field(
        default=False,
        description="a pilot run decides which of the others are needed; short for "
        '{ auto = true }: effects = "auto"',
    )
    gravity: bool = Field(default=True, description="9.80665 m/s² downwards")
    part_turn: PartTurn | None = Field(
        default=None, description="{ rpm = ... } or { angle_deg = ..., frequency_hz = ... }"
    )
    friction: FrictionTable | None = Field(
        default=None,
        description="balls slip and spin: { mu = 0.2, beta0 = 0.2 }; absent: by the catalogue, for "
        "the metals of [materials]",
        json_schema_extra={"form": FRICTION_FORM},
    )
    roughness: RoughnessTable | None = Field(
        default=None,
        description="facets throw balls aside: { slope_deg = 3 }; absent: as of peened faces, none "
        "without friction",
        json_schema_extra={"form": ROUGHNESS_FORM},
    )
    flexure: FlexureTable | None = Field(
        default=None,
        description="thin parts take energy from balls; the table has the elasticity of part and "
        "balls; absent: where the part is so thin that it matters",
        json_schema_extra={"form": FLEXURE_FORM},
    )
    rest: bool | None = Field(
        default=None,
        description="balls slide and lie still on surfaces that neither vibrate nor turn; absent: "
        "where the chamber has some that face up",
    )
    drag: bool = Field(
        default=False, description="of still air at 20 °C: 0.4 m/s² for 3 mm of steel at 5 m/s"
    )
    ball_collisions: bool = Field(
        default=True, description="false: balls fly through each other; for very little shot"
    )

    @field_validator("flexure", mode="before")
    @classmethod
    def _accept_on_and_off(cls, given: object) -> object:
        return {"on": given} if isinstance(given, bool) else given

    @property
    def of_surfaces(self) -> dict[str, dict[str, float]]:
        """Return the numbers of each SurfaceEffectTable, in SI units, by name of the effect."""
        tables = {name: getattr(self, name) for name in type(self).model_fields}
        return {k: v.parameters for k, v in tables.items() if isinstance(v, SurfaceEffectTable)}

    @field_validator("friction", "roughness", mode="before")
    @classmethod
    def _accept_none(cls, given: object, info: ValidationInfo) -> object:
        """Accept the text "none", and refuse texts that the catalogue does not know."""
        if not isinstance(given, str):
            return given
        if given == NONE:
            return None
        form = FRICTION_FORM if info.field_name == "friction" else ROUGHNESS_FORM
        raise CrossCheckError([Problem("", f"given {given!r}; allowed: {form}")])

    def _problems(self) -> Iterator[Problem]:
        if self.rest and not self.gravity:
            yield Problem("rest", "given true with gravity = false; nothing lies still without")

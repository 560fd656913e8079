"""The shot: spheres of one or a few sizes, with positions, velocities and, with friction, spins."""

from dataclasses import dataclass

import numpy as np

from sim_core.errors import SceneError, number

MAX_SIZES = 8  # each size has its own obstacles; a few sizes stand for a distribution well
# m/s: shot flies at 20; the float32 filters overflow on squares of much faster speeds
MAX_SPEED = 1e6


@dataclass(frozen=True)
class Balls:
    """The n balls of a scene.

    Args:
        positions: positions of the ball centres [m], shape (n, 3).
        velocities: velocities of the balls [m/s], shape (n, 3).
        diameter: one diameter [m] for all balls, or an array of shape (n,).
        density: one density [kg/m³] for all balls, or an array of shape (n,).
        spins: angular velocities [rad/s], shape (n, 3). They need Physics.friction. None means no
            spin.

    Raises:
        SceneError: for wrong shapes, numbers that are not finite, speeds beyond MAX_SPEED, or more
            than MAX_SIZES different diameters.
    """

    positions: np.ndarray
    velocities: np.ndarray
    diameter: float | np.ndarray
    density: float | np.ndarray = 7800.0
    spins: np.ndarray | None = None

    def __post_init__(self) -> None:
        for name in ("diameter", "density"):
            value = _one_or_each(name, getattr(self, name), np.shape(self.positions)[:1])
            object.__setattr__(self, name, value)
        if len(self.sizes) > MAX_SIZES:
            raise SceneError(
                f"balls.diameter has {len(self.sizes)} different values: "
                f"at most {MAX_SIZES} sizes are supported"
            )
        for name in ("positions", "velocities", "spins"):
            if getattr(self, name) is None and name == "spins":
                continue
            try:
                array = np.array(getattr(self, name), dtype=np.float64, order="C")
            except (TypeError, ValueError):
                raise SceneError(f"balls.{name} must be numbers of shape (n, 3)") from None
            if array.ndim != 2 or array.shape[1] != 3 or len(array) == 0:
                raise SceneError(
                    f"balls.{name} must have shape (n, 3) with n >= 1, not {array.shape}"
                )
            bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
            if len(bad):
                raise SceneError(
                    f"balls.{name}: ball {bad[0]} has {array[bad[0]].tolist()}; give finite numbers"
                )
            limits = {"velocities": (MAX_SPEED, "m/s"), "spins": (MAX_SPEED / self.radius, "rad/s")}
            limit, unit = limits.get(name, (np.inf, ""))
            if np.abs(array).max() > limit:
                worst = int(np.abs(array).max(axis=1).argmax())
                raise SceneError(
                    f"balls.{name}: ball {worst} has {array[worst].tolist()} {unit}; "
                    f"at most {limit:g}"
                )
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        for name, others in (("velocities", self.velocities), ("spins", self.spins)):
            if others is not None and others.shape != self.positions.shape:
                raise SceneError(
                    f"balls.positions has {len(self.positions)} balls, balls.{name} {len(others)}: "
                    "give one each"
                )

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def alike(self) -> bool:
        """True if all balls have the same diameter and the same density."""
        return np.ndim(self.diameter) == 0 and np.ndim(self.density) == 0

    @property
    def radius(self) -> float:
        """Radius [m] of the largest ball."""
        return 0.5 * float(self.sizes[-1])

    @property
    def sizes(self) -> np.ndarray:
        """The different ball diameters [m], each once, ascending."""
        return np.unique(self.diameter)

    @property
    def diameters(self) -> np.ndarray:
        """Diameter of each ball [m], shape (n,)."""
        return np.broadcast_to(self.diameter, len(self))

    @property
    def densities(self) -> np.ndarray:
        """Density of each ball [kg/m³], shape (n,)."""
        return np.broadcast_to(self.density, len(self))

    @property
    def ball_mass(self) -> float:
        """Mean mass of the balls [kg]."""
        return float(self.masses.mean())

    @property
    def masses(self) -> np.ndarray:
        """Mass of each ball [kg], shape (n,)."""
        return np.asarray(self.densities * np.pi / 6.0 * self.diameters**3)


def _one_or_each(name: str, given: object, count: tuple[int, ...]) -> float | np.ndarray:
    """Return a diameter or density as one float if all balls share it, else as an array (n,).

    Args:
        name: name of the field in messages.
        given: user input, one number or one for each ball.
        count: number of balls, as the shape (n,).

    Raises:
        SceneError: for a wrong shape, and for a number that is not positive and finite.
    """
    if np.ndim(given) == 0:  # type: ignore[arg-type]
        values = np.array([number(f"balls.{name}", given)])
    else:
        try:
            values = np.array(given, dtype=np.float64)
        except (TypeError, ValueError):
            raise SceneError(f"balls.{name} must be one number, or one for each ball") from None
        if values.shape != count:
            raise SceneError(
                f"balls.{name} has shape {values.shape} for {count} balls: "
                "give one number, or one each"
            )
    bad = np.flatnonzero(~(np.isfinite(values) & (values > 0.0)))
    if len(bad):
        which = "" if np.ndim(given) == 0 else f" of ball {bad[0]}"  # type: ignore[arg-type]
        raise SceneError(f"balls.{name}{which} is {values[bad[0]]}: it must be positive")
    if (values == values[:1]).all() and len(values):
        return float(values[0])
    values.flags.writeable = False
    return values

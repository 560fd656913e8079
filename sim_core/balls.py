"""The shot: spheres of one size or a few, as columns of positions, velocities and, where they rub, spins."""

from dataclasses import dataclass

import numpy as np

from sim_core.errors import SceneError, number

MOST_SIZES = (
    8  # each has obstacles of its own; more is a distribution, which a few sizes stand for well
)
FASTEST = 1e6  # m/s: shot has 20; the filters' float32 squares of much more overflow


@dataclass(frozen=True)
class Balls:
    """Balls, all alike or of a few sizes.

    ``positions`` [m] and ``velocities`` [m/s], shape (n, 3) float64; ``diameter`` [m] and ``density`` [kg/m³]: one
    number, or one for each ball, shape (n,); given for each and all equal, they become one number. ``spins`` [rad/s],
    shape (n, 3), only with Physics.friction, where None is no spin. Raises SceneError for wrong shapes, numbers that
    are not finite, speeds beyond FASTEST, or more than MOST_SIZES different diameters.
    """

    positions: np.ndarray
    velocities: np.ndarray
    diameter: float | np.ndarray
    density: float | np.ndarray = 7800.0
    spins: np.ndarray | None = None

    def __post_init__(self) -> None:
        for name in ("diameter", "density"):
            object.__setattr__(
                self, name, _each(name, getattr(self, name), np.shape(self.positions)[:1])
            )
        if len(self.sizes) > MOST_SIZES:
            raise SceneError(
                f"balls.diameter has {len(self.sizes)} different values: at most {MOST_SIZES} sizes are supported"
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
            most, unit = {
                "velocities": (FASTEST, "m/s"),
                "spins": (FASTEST / self.radius, "rad/s"),
            }.get(name, (np.inf, ""))
            if np.abs(array).max() > most:
                worst = int(np.abs(array).max(axis=1).argmax())
                raise SceneError(
                    f"balls.{name}: ball {worst} has {array[worst].tolist()} {unit}; at most {most:g}"
                )
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        for name, others in (("velocities", self.velocities), ("spins", self.spins)):
            if others is not None and others.shape != self.positions.shape:
                raise SceneError(
                    f"balls.positions has {len(self.positions)} balls, balls.{name} {len(others)}: give one each"
                )

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def alike(self) -> bool:
        """True when all have one diameter and one density."""
        return np.ndim(self.diameter) == 0 and np.ndim(self.density) == 0

    @property
    def radius(self) -> float:
        """Half the diameter [m]; of the largest ball, if there are several sizes."""
        return 0.5 * float(self.sizes[-1])

    @property
    def sizes(self) -> np.ndarray:
        """The different diameters [m], ascending."""
        return np.unique(self.diameter)

    @property
    def diameters(self) -> np.ndarray:
        """Of each ball [m], shape (n,)."""
        return np.broadcast_to(self.diameter, len(self))

    @property
    def densities(self) -> np.ndarray:
        """Of each ball [kg/m³], shape (n,)."""
        return np.broadcast_to(self.density, len(self))

    @property
    def ball_mass(self) -> float:
        """Mass of one ball [kg]; the mean, if they differ."""
        return float(self.masses.mean())

    @property
    def masses(self) -> np.ndarray:
        """Of each ball [kg], shape (n,)."""
        return np.asarray(self.densities * np.pi / 6.0 * self.diameters**3)


def _each(name: str, given: object, count: tuple[int, ...]) -> float | np.ndarray:
    """One positive number, or one for each ball, (n,)."""
    if np.ndim(given) == 0:  # type: ignore[arg-type]
        values = np.array([number(f"balls.{name}", given)])
    else:
        try:
            values = np.array(given, dtype=np.float64)
        except (TypeError, ValueError):
            raise SceneError(f"balls.{name} must be one number, or one for each ball") from None
        if values.shape != count:
            raise SceneError(
                f"balls.{name} has shape {values.shape} for {count} balls: give one number, or one each"
            )
    bad = np.flatnonzero(~(np.isfinite(values) & (values > 0.0)))
    if len(bad):
        which = "" if np.ndim(given) == 0 else f" of ball {bad[0]}"  # type: ignore[arg-type]
        raise SceneError(f"balls.{name}{which} is {values[bad[0]]}: it must be positive")
    if (values == values[:1]).all() and len(values):
        return float(values[0])
    values.flags.writeable = False
    return values

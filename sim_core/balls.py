"""The shot: equal spheres as columns of positions, velocities and, where they rub, spins."""

from dataclasses import dataclass

import numpy as np

from sim_core.errors import SceneError, number

FASTEST = 1e6  # m/s: shot has 20; the filters' float32 squares of much more overflow


@dataclass(frozen=True)
class Balls:
    """Balls of one size and density.

    ``positions`` [m] and ``velocities`` [m/s], shape (n, 3) float64; ``diameter`` [m]; ``density`` [kg/m³]; ``spins``
    [rad/s], shape (n, 3), only with Physics.friction, where None is no spin. Raises SceneError for wrong shapes,
    numbers that are not finite, speeds beyond FASTEST, or several diameters (not supported yet).
    """

    positions: np.ndarray
    velocities: np.ndarray
    diameter: float
    density: float = 7800.0
    spins: np.ndarray | None = None

    def __post_init__(self) -> None:
        if np.ndim(self.diameter) != 0 or np.ndim(self.density) != 0:
            raise SceneError("several ball diameters or densities in one scene are not supported yet: give one number")
        for name in ("diameter", "density"):
            value = number(f"balls.{name}", getattr(self, name))
            if not (np.isfinite(value) and value > 0.0):
                raise SceneError(f"balls.{name} is {value}: it must be positive")
            object.__setattr__(self, name, value)
        for name in ("positions", "velocities", "spins"):
            if getattr(self, name) is None and name == "spins":
                continue
            try:
                array = np.array(getattr(self, name), dtype=np.float64, order="C")
            except (TypeError, ValueError):
                raise SceneError(f"balls.{name} must be numbers of shape (n, 3)") from None
            if array.ndim != 2 or array.shape[1] != 3 or len(array) == 0:
                raise SceneError(f"balls.{name} must have shape (n, 3) with n >= 1, not {array.shape}")
            bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
            if len(bad):
                raise SceneError(f"balls.{name}: ball {bad[0]} has {array[bad[0]].tolist()}; give finite numbers")
            most, unit = {"velocities": (FASTEST, "m/s"), "spins": (FASTEST / self.radius, "rad/s")}.get(
                name, (np.inf, "")
            )
            if np.abs(array).max() > most:
                worst = int(np.abs(array).max(axis=1).argmax())
                raise SceneError(f"balls.{name}: ball {worst} has {array[worst].tolist()} {unit}; at most {most:g}")
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
    def radius(self) -> float:
        """Half the diameter [m]."""
        return 0.5 * self.diameter

    @property
    def ball_mass(self) -> float:
        """Mass of one ball [kg]."""
        return float(self.density * np.pi / 6.0 * self.diameter**3)

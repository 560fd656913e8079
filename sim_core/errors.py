"""What can go wrong: a scene that cannot be simulated, or a simulation that must not go on."""


class SceneError(ValueError):
    """The scene is not one the simulator can take; the message names the ball, triangle or field, and the remedy."""


class SimulationError(RuntimeError):
    """An invariant broke or a ball cannot be followed; the message says where, and what to try."""


def number(name: str, value: object) -> float:
    """The value as a float; raises SceneError, with the field's name, for what is no number."""
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise SceneError(f"{name} is {value!r}: give a number") from None

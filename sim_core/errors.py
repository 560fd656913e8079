"""What can go wrong: a scene that cannot be simulated, or a simulation that must not go on."""


class SceneError(ValueError):
    """The scene is not one the simulator can take; the message names the ball, triangle or field, and the remedy."""


class SimulationError(RuntimeError):
    """An invariant broke or a ball cannot be followed; the message says where, and what to try."""

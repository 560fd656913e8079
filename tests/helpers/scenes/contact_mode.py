"""Scenes of contact mode: steel balls of 3 mm, frictionless unless given, with a constant e.

With a constant restitution e closed forms exist.
"""

import math

import numpy as np

from sim_core import Balls, Gravity, Physics, Rest, Restitution, Scene, TriangleMesh, Vibration
from sim_core.loop.simulate import Simulation
from sim_core.scene.invariants import clearance, energy, narrowest_gap
from tests.helpers.scenes.cavities import box
from tests.helpers.scenes.terrain import terrain

DIAMETER = 3e-3
R = 0.5 * DIAMETER
CAPTURE = 1e-3
TAGS = 8
TOUCH = 1e-12  # m: gaps may be negative by this
ROOM = box((0.02, 0.02, 0.05))


def physics(e: float = 0.8, resistance: float = 0.0, vibration: Vibration | None = None) -> Physics:
    law = (e, 1e3)
    return Physics(Gravity(), Restitution((law,) * TAGS, law), vibration, Rest(CAPTURE, resistance))


def shot(places: object, velocities: object = 0.0) -> Balls:
    places = np.atleast_2d(np.array(places, dtype=float))
    return Balls(
        places, np.broadcast_to(np.array(velocities, dtype=float), places.shape).copy(), DIAMETER
    )


def film(
    mesh: TriangleMesh, balls: Balls, what: Physics, until: float, pictures: int = 100
) -> tuple[Simulation, list[Balls]]:
    """The run, and the balls at so many equal steps from the start on; gaps are checked at each."""
    run = Simulation(Scene(mesh, balls, what, until))
    frames = [balls]
    for stop in np.linspace(0.0, until, pictures + 1)[1:]:
        run.play(float(stop), record=False)
        frames.append(run.balls())
        gap = clearance(mesh.corners, frames[-1].positions, 2.0 * balls.radius)
        assert (gap - 0.5 * balls.diameters).min() > -TOUCH
        assert narrowest_gap(frames[-1])[0] > -TOUCH
    return run, frames


def energies(frames: list[Balls]) -> np.ndarray:
    """Energy per ball mass [J/kg]."""
    return np.array([energy(balls, Gravity()) / balls.ball_mass for balls in frames])


def supports(run: Simulation) -> int:
    """On how many the first ball stands."""
    assert run.state.contact is not None
    return int(run.state.contact.supports.number[0])


def mode(run: Simulation) -> int:
    """How the first ball moves."""
    assert run.state.contact is not None
    return int(run.state.contact.mode[0])


def slope(degrees: float) -> tuple[np.ndarray, np.ndarray]:
    """Unit normal and downhill direction of a plane that falls towards +x."""
    angle = math.radians(degrees)
    return np.array([math.sin(angle), 0.0, math.cos(angle)]), np.array(
        [math.cos(angle), 0.0, -math.sin(angle)]
    )


def rough_floor(rng: np.random.Generator) -> TriangleMesh:
    """Peaks and pits as wide as a ball and more, with edges that balls are wedged against."""
    nodes = np.linspace(0.0, 0.02, 7)
    return terrain(nodes, nodes, rng.uniform(0.0, 0.004, (7, 7)), 0.05, rng)


def small_scene() -> Scene:
    """Six balls come down into a narrow V; some are at rest before the end."""
    x, y = np.linspace(0.0, 0.02, 3), np.array([-0.008, 0.0, 0.008])
    valley = terrain(x, y, np.tile(0.5 * np.abs(y), (3, 1)), 0.02, np.random.default_rng(1), tags=3)
    rng = np.random.default_rng(6)
    places = np.column_stack(
        [np.linspace(0.0017, 0.0183, 4), rng.normal(0.0, 5e-4, 4), np.full(4, 0.004)]
    )
    return Scene(valley, shot(places), physics(0.5, 0.05), 0.15)

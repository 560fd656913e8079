"""Random scenes: any chamber, any shot, any effects. They run with all invariants, or stop with a message."""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st

from sim_core import (
    Balls,
    Friction,
    Gravity,
    Physics,
    Rest,
    Restitution,
    Scene,
    SceneError,
    SimulationError,
    TriangleMesh,
    Vibration,
    pack_balls,
)
from sim_core.invariants import energy
from tests.cavities import CEILING, FLOOR
from tests.fuzzed_chambers import FAMILIES, WITH_FLOOR, Chamber
from tests.hard_cases.outcome import CONSTANT, allowed, play
from tests.hard_cases.saved_scene import FOLDER, save_scene

FOUND = FOLDER / "found.npz"  # the last failure: what hypothesis ends with is the simplest; give it a name and keep it
TRAVERSES = 12.0  # of the chamber's width by a ball at the shot's speed
PIECES = 3
MOST_BALLS = 12  # more make a jam a matter of minutes
BROKEN = ("has left the mesh", "not a number", "report the scene")  # in messages of runs: not a way out
RESTITUTIONS = (0.0, 1e-9, 0.05, 0.5, 0.9, 1.0 - 1e-12, 1.0)


class Plan(NamedTuple):
    """What a scene is made of.

    ``wide`` [m]: width of the chamber; ``far`` [widths]: its distance from the origin; ``speed`` [m/s] of the shot;
    ``weight``: g wide / speed²; ``restitution``: e, None elastic; ``elastic_below`` [speeds]; ``swing``: [diameters]
    of the floor, None still; ``beat``: the face's peak speed over the shot's; ``bare``: effects that change nothing
    are left out, which is other machine code, instead of given as g = 0 and e = 1; ``rests``: balls may lie still,
    where there is weight; ``rough``: mu and beta0 of balls that start spinning, None smooth.
    """

    family: str
    seed: int
    wide: float
    far: float
    count: int
    speed: float
    weight: float
    restitution: float
    elastic_below: float
    swing: float | None
    beat: float
    bare: bool
    rests: bool
    rough: tuple[float, float] | None


def powers(low: float, high: float) -> st.SearchStrategy[float]:
    """Ten to a number from low to high."""
    return st.floats(low, high).map(lambda exponent: 10.0**exponent)


def plans(bare: st.SearchStrategy[bool]) -> st.SearchStrategy[Plan]:
    """Plans, bare or not."""
    return st.builds(
        Plan,
        bare=bare,
        family=st.sampled_from(sorted(FAMILIES)),
        seed=st.integers(0, 2**20),
        wide=powers(-3.0, 0.0),
        far=st.sampled_from([0.0, 1.0, 1e3]),
        count=st.integers(1, MOST_BALLS),
        speed=powers(-3.0, 2.0),
        weight=st.just(0.0) | powers(-3.0, 2.0),
        restitution=st.sampled_from(RESTITUTIONS) | st.floats(0.0, 1.0),
        elastic_below=st.sampled_from([1e-3, 0.03]),
        swing=st.none() | powers(-4.0, -0.5),
        beat=powers(-1.0, 1.0),
        rests=st.booleans(),
        rough=st.none() | st.tuples(st.sampled_from([0.0, 0.1, 0.5, 10.0]), st.floats(-1.0, 1.0)),
    )


def chamber_of(plan: Plan) -> Chamber:
    """The same plan makes the same chamber. Raises SceneError when no ball fits in."""
    rng = np.random.default_rng([plan.seed, *plan.family.encode()])
    diameter = plan.wide * rng.uniform(0.03, 0.12)
    vertices, triangles = FAMILIES[plan.family](diameter / plan.wide, rng)
    level = (vertices[triangles][:, :, 2] == vertices[:, 2].min()).all(axis=1)
    mesh = TriangleMesh(plan.wide * (vertices + plan.far), triangles, np.where(level, FLOOR, CEILING))
    gravity = Gravity(z=-plan.weight * plan.speed**2 / plan.wide)
    law = (plan.restitution, CONSTANT if plan.restitution == 1.0 else plan.speed)
    restitution = Restitution((law, law), law, plan.elastic_below * plan.speed)
    vibration = None
    if plan.swing is not None and plan.family in WITH_FLOOR:
        amplitude = plan.swing * diameter
        vibration = Vibration(FLOOR, amplitude, plan.beat * plan.speed / (math.tau * amplitude))
    positions = pack_balls(mesh, plan.count, diameter, rng, vibration.amplitude if vibration else 0.0)
    velocities = rng.normal(0.0, plan.speed, positions.shape)
    physics = Physics(
        None if plan.bare and plan.weight == 0.0 else gravity,
        None if plan.bare and plan.restitution == 1.0 else restitution,
        vibration,
        Rest(1e-3 * plan.speed) if plan.rests and plan.weight > 0.0 else None,
        friction=None if plan.rough is None else Friction((plan.rough,) * 2, plan.rough),
    )
    spins = None if plan.rough is None else rng.normal(0.0, plan.speed / diameter, positions.shape)
    return Chamber(mesh, Balls(positions, velocities, diameter, spins=spins), physics)


def duration_of(plan: Plan) -> float:
    """TRAVERSES, by the fastest of shot, fall and sonotrode."""
    fastest = plan.speed * max(1.0, math.sqrt(plan.weight), plan.beat if plan.swing else 0.0)
    return TRAVERSES * plan.wide / fastest


def judge(plan: Plan, keep: Path = FOUND) -> str:
    """How it ended: "ran", or the message it was refused or stopped with. A broken invariant is an AssertionError, and
    the scene is kept in the file ``keep``.
    """
    try:
        chamber = chamber_of(plan)
    except SceneError as error:
        return str(error)
    duration = duration_of(plan)
    try:
        scene = Scene(*chamber, duration)
    except SceneError as error:
        return str(error)
    try:
        require_invariants(chamber, duration)
    except (SceneError, SimulationError) as error:
        if not any(broken in str(error) for broken in BROKEN):
            return str(error)
        save_scene(keep, scene)
        raise AssertionError(str(error)) from error
    except Exception:
        save_scene(keep, scene)
        raise
    return "ran"


def require_invariants(chamber: Chamber, duration: float) -> None:
    """Plays it: no ball leaves, none overlaps, energy is kept or lost, never won from walls that stand still."""
    seen = play(chamber, duration, PIECES)
    size = float(np.ptp(chamber.mesh.vertices, axis=0).max())
    far = float(np.abs(chamber.mesh.vertices).max())
    assert seen.penetration <= allowed(chamber.mesh), f"overlap {seen.penetration:.3g} m"
    # far from the origin each restart rounds places, and with them what a fall through the chamber gives
    drift = 1e-12 + 1e-15 * PIECES * far / size
    assert not seen.energy_drift > drift, f"energy drifts by {seen.energy_drift:.3g}"
    if chamber.physics.vibration is None and not any(chamber.physics.gravity or ()):
        energies = np.array([energy(one) for one in seen.track])
        assert (energies[1:] <= energies[:-1] * (1.0 + drift)).all(), f"energy grows: {energies}"

"""Random scenes with any chamber, shot and effects.

They keep all invariants, or stop with a message.
"""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st

from sim_core import Balls, Physics, Scene, SceneError, SimulationError, TriangleMesh, pack_balls
from sim_core.contact.supports import SHORTEST_HOP
from tests.hard_cases.fuzzed_effects import (
    LID,
    SIZES,
    SONOTRODES,
    Strengths,
    physics_of,
    powers,
    strengths,
)
from tests.hard_cases.outcome import allowed, energy_above_floor, is_still, play
from tests.hard_cases.saved_scene import FOLDER, save_scene
from tests.helpers.scenes.cavities import CEILING, FLOOR, SIDES, box_around
from tests.helpers.scenes.fuzzed_chambers import FAMILIES, WITH_FLOOR, Chamber, Surface
from tests.helpers.scenes.turning_parts import BODIES, PART

FOUND = (
    FOLDER / "found.npz"
)  # the last failure: what hypothesis ends with is the simplest; give it a name and keep it
TRAVERSES = 12.0  # of the chamber's width by a ball at the shot's speed
PIECES = 3
MOST_BALLS = 12  # more make a jam a matter of minutes
BROKEN = (
    "has left the mesh",
    "not a number",
    "report the scene",
)  # in messages of runs: not a way out
TURNING = {f"turning {name}": body for name, body in BODIES.items()}


class Plan(NamedTuple):
    """What a scene is made of.

    ``wide`` [m]: width of the chamber; ``far`` [widths]: its distance from the origin; ``speed``
    [m/s] of the shot; ``effects``: the names of those present (fuzzed_effects.py), which is what
    machine code depends on, and how ``much`` of each.
    """

    family: str
    seed: int
    wide: float
    far: float
    count: int
    speed: float
    effects: frozenset[str]
    much: Strengths


def plans(combinations: tuple[str, ...]) -> st.SearchStrategy[Plan]:
    """Plans with one of these combinations of effects."""
    return st.one_of([_plans(frozenset(names.split())) for names in combinations])


def _plans(effects: frozenset[str]) -> st.SearchStrategy[Plan]:
    families = (
        set(TURNING)
        if "part_rotation" in effects
        else WITH_FLOOR
        if "vibration" in effects
        else set(FAMILIES)
    )
    return st.builds(
        Plan,
        family=st.sampled_from(sorted(families)),
        seed=st.integers(0, 2**20),
        wide=powers(-3.0, 0.0),
        far=st.sampled_from([0.0, 1.0, 1e3]),
        count=st.integers(1, MOST_BALLS),
        speed=powers(-3.0, 2.0),
        effects=st.just(effects),
        much=strengths(),
    )


def chamber_of(plan: Plan) -> Chamber:
    """The same plan makes the same chamber. Raises SceneError when no ball fits in."""
    rng = np.random.default_rng([plan.seed, *plan.family.encode()])
    diameter = plan.wide * rng.uniform(0.03, 0.12)
    (vertices, triangles), part = _shape(plan.family, diameter / plan.wide, rng)
    level = (vertices[triangles][:, :, 2] == vertices[:, 2].min()).all(axis=1)
    tags = np.where(level, FLOOR, np.where(part, PART, SIDES if part.any() else CEILING))
    if SONOTRODES in plan.effects:
        tags[(vertices[triangles][:, :, 2] == vertices[:, 2].max()).all(axis=1)] = LID
    mesh = TriangleMesh(plan.wide * (vertices + plan.far), triangles, tags)
    physics = physics_of(plan.effects, plan.much, plan.wide, plan.speed, diameter, mesh, plan.seed)
    size: float | np.ndarray = diameter
    density: float | np.ndarray = 7800.0
    if SIZES in plan.effects:
        size = diameter * np.where(np.arange(plan.count) % 2, plan.much.spread, 1.0)
        density = rng.choice([2500.0, 7800.0], plan.count)
    clear = max((one.amplitude for one in physics.vibrations), default=0.0)
    positions = pack_balls(mesh, plan.count, size, rng, clear, physics.part_rotation)
    velocities = rng.normal(0.0, plan.speed, positions.shape)
    spins = (
        None
        if physics.friction is None
        else rng.normal(0.0, plan.speed / diameter, positions.shape)
    )
    return Chamber(mesh, Balls(positions, velocities, size, density, spins), physics)


def _shape(family: str, diameter: float, rng: np.random.Generator) -> tuple[Surface, np.ndarray]:
    """The family's surface, one unit wide, and which triangles are of a part that can turn."""
    if family not in TURNING:
        vertices, triangles = FAMILIES[family](diameter, rng)
        return (vertices, triangles), np.zeros(len(triangles), dtype=np.bool_)
    body = TURNING[family].copy()
    body.apply_scale(rng.uniform(10.0, 25.0))  # they are 12 mm long
    body.apply_translation(rng.uniform(-0.15, 0.15, 3))
    mesh = box_around(body, 0.5)
    return (mesh.vertices, mesh.triangles), mesh.tags == PART


def duration_of(plan: Plan) -> float:
    """TRAVERSES, by the fastest of shot, fall, sonotrode and part."""
    much = plan.much
    fastest = max(
        1.0,
        math.sqrt(much.weight) if "gravity" in plan.effects else 0.0,
        much.beat if "vibration" in plan.effects and much.swing else 0.0,
        much.tip if "part_rotation" in plan.effects else 0.0,
    )
    return TRAVERSES * plan.wide / (fastest * plan.speed)


def play_and_check(plan: Plan, keep: Path = FOUND) -> str:
    """How it ended: "ran", or the message it was refused or stopped with. A broken invariant is an
    AssertionError, and the scene is kept in the file ``keep``.
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
    """Plays it: no ball leaves, none overlaps, energy is kept or lost, never won from walls that
    stand still.
    """
    physics = chamber.physics
    pieces = (
        1 if physics.random_phase is not None else PIECES
    )  # where each ball sees the face is not handed on
    seen = play(chamber, duration, pieces)
    size = float(np.ptp(chamber.mesh.vertices, axis=0).max())
    far = float(np.abs(chamber.mesh.vertices).max())
    assert seen.penetration <= allowed(chamber.mesh), f"overlap {seen.penetration:.3g} m"
    # far from the origin each restart rounds places, and with them what a fall through the chamber
    # gives
    drift = 1e-12 + 1e-15 * PIECES * far / size
    assert not seen.energy_drift > drift, f"energy drifts by {seen.energy_drift:.3g}"
    if is_still(physics) and not _falls_through_air(physics):
        energies = np.array([energy_above_floor(chamber.mesh, one, physics) for one in seen.track])
        kept = energies[:-1] + drift * energies[0] + _given_back(physics)
        assert (energies[1:] <= kept).all(), f"energy grows: {energies}"
    for ball in seen.track:
        assert ball.spins is None or np.isfinite(ball.spins).all()


def _falls_through_air(physics: Physics) -> bool:
    """True where kicks in the middle of a flight are taken for drag all along it: of second order
    in the energy.
    """
    return physics.drag is not None and any(physics.gravity or ())


def _given_back(physics: Physics) -> float:
    """Energy [J/kg] that captures and hops of balls pressed together may bring in
    (contact/supports.py).
    """
    if physics.rest is None:
        return 0.0
    weight = float(np.linalg.norm(physics.gravity or 0.0))
    return 50.0 * max(physics.rest.capture, 2.0 * SHORTEST_HOP * weight) ** 2

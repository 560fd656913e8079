"""Chamber + process settings -> Scene: the shot at rest low in the chamber, shaken by the sonotrode."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.build import TAG_PART, TAG_SONOTRODE, turning_axis
from chamberopt.common.errors import InputError
from chamberopt.design.shapes import further_sonotrode_tag

# Every ball is compared with every other: 20,000 take about 40 µs a prediction, a thousand times a second each.
MOST_BALLS = 20_000

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from sim_core import AnalyticCavity, PartRotation, Physics, Scene, TriangleMesh, Vibration

STREAMS = ("search", "confirm")


def replica_seed(seed: int, replica: int, stream: str = "search") -> int:
    """The random seed of one replica, 128 bits.

    The same for every candidate of a study (common random numbers), different between replicas, and
    different between the streams, so that a candidate chosen on "search" is judged on draws it has not seen.
    From sha256 rather than hash(), which Python salts anew in every process.
    """
    if stream not in STREAMS:
        raise ValueError(f"stream {stream!r}: one of {', '.join(STREAMS)}")
    digest = hashlib.sha256(f"chamberopt/{stream}/{seed}/{replica}".encode()).digest()
    return int.from_bytes(digest[:16], "big")


def start_velocities(rng: np.random.Generator, count: int, rms_speed: float) -> np.ndarray:
    """Isotropic Maxwell velocities [m/s], shape (count, 3), whose rms speed is `rms_speed` [m/s]."""
    return rng.normal(0.0, rms_speed / np.sqrt(3.0), (count, 3))


def chamber_mesh(chamber: Chamber) -> TriangleMesh:
    """The chamber's surface for the simulator. Make it once per chamber: its search tree goes with it."""
    from sim_core import TriangleMesh

    return TriangleMesh(chamber.vertices, chamber.triangles, chamber.tags)


def require_ball_count(design: Design) -> None:
    """InputError for more balls than the simulator is made for."""
    if design.shot.count > MOST_BALLS:
        raise InputError(
            f"shot: {design.shot.count} balls of {1e3 * min(design.shot.diameters):g} mm or more in "
            f"{design.shot.mass_g:g} g, more than the {MOST_BALLS} supported; lower shot.mass_g or use larger balls"
        )


def part_turn(design: Design, phase: float = 0.0) -> PartRotation | None:
    """How the part turns, if it does; ``phase`` [rad] at the start."""
    from sim_core import PartRotation

    turn = design.effects.part_turn
    if turn is None:
        return None
    point, axis = ((float(x), float(y), float(z)) for x, y, z in turning_axis(design))
    return PartRotation(TAG_PART, point, axis, turn.rpm, turn.amplitude, turn.frequency_hz, phase)


def require_turnable(design: Design, mesh: TriangleMesh) -> None:
    """InputError if the part is to turn in its chamber and cannot."""
    from sim_core import SceneError, require_free_rotation

    turn = part_turn(design)
    try:
        if turn is not None:
            require_free_rotation(mesh, turn, design.shot.diameter)
    except SceneError as error:
        raise InputError(f"effects.part_turn: {error}") from None


def balls_can_rest(design: Design, mesh: TriangleMesh | AnalyticCavity) -> bool:
    """Whether balls can lie still: as the design says, or wherever its chamber has a still surface that faces up."""
    from sim_core import Gravity, can_rest

    asked = design.effects.rest
    if asked is not None:
        return asked
    moving = [TAG_SONOTRODE, *(further_sonotrode_tag(k) for k in range(len(design.sonotrodes)))]
    if design.effects.part_turn is not None:
        moving.append(TAG_PART)
    gravity = Gravity() if design.effects.gravity else None
    return design.shot.mix is None and can_rest(mesh, gravity, *moving)


def vibrations(design: Design, phase: float) -> Vibration | tuple[Vibration, ...]:
    """How the sonotrode moves, or each of several; ``phase`` [rad] at the start: of the first, the others have theirs
    on top, so that among those of one frequency a phase is a shift in time, whatever the draw.
    """
    from sim_core import Vibration

    first = Vibration(TAG_SONOTRODE, design.sonotrode.amplitude, design.sonotrode.frequency, phase)
    further = tuple(
        Vibration(
            further_sonotrode_tag(k), one.amplitude, one.frequency, phase + one.phase, one.direction
        )
        for k, one in enumerate(design.sonotrodes)
    )
    return (first, *further) if further else first


def scene_physics(
    design: Design,
    mesh: TriangleMesh | AnalyticCavity,
    phase: float = 0.0,
    turn_phase: float = 0.0,
    draws: int = 0,
) -> Physics:
    """The effects of a design in its chamber's mesh, or analytical cavity.

    ``phase`` and ``turn_phase`` [rad]: of the sonotrode and of a part that turns, at the start; ``draws``: the seed
    of arrival phases that are drawn anew.
    """
    from sim_core import (
        BallCollisions,
        Drag,
        Friction,
        Gravity,
        Physics,
        RandomPhase,
        Rest,
        Restitution,
    )

    sonotrode, effects, materials = design.sonotrode, design.effects, design.materials
    if effects.auto:
        raise InputError(
            'effects: still "auto"; advice.settled decides them, as simulate and run do'
        )
    # One (C0, v0) per tag, in the order of the tags: TAG_PART, TAG_SONOTRODE, TAG_WALL, further sonotrodes.
    pairs = (
        materials.part,
        materials.sonotrode,
        materials.wall,
        *(materials.sonotrode for _ in design.sonotrodes),
    )
    surfaces = tuple((pair.restitution, pair.yield_speed) for pair in pairs)
    of_balls = (materials.shot.restitution, materials.shot.yield_speed)
    rubs, accuracy = effects.friction, design.process.accuracy
    return Physics(
        gravity=Gravity() if effects.gravity else None,
        restitution=Restitution(surfaces, of_balls, accuracy.elastic_below),
        vibration=vibrations(design, phase),
        part_rotation=part_turn(design, turn_phase),
        rest=Rest() if balls_can_rest(design, mesh) else None,
        friction=Friction((rubs.surfaces,) * len(surfaces), rubs.balls)
        if rubs is not None
        else None,
        drag=Drag(piece=accuracy.drag_step) if effects.drag else None,
        ball_collisions=BallCollisions() if effects.ball_collisions else None,
        random_phase=RandomPhase(draws) if sonotrode.motion == "random_phase" else None,
    )


def build_scene(design: Design, mesh: TriangleMesh | AnalyticCavity, seed: int) -> Scene:
    """The scene one replica simulates, in a chamber's mesh (`chamber_mesh`) or `analytic.analytic_cavity`.

    The shot starts packed low in the chamber with the speed scale of the sonotrode, 2 pi f A, so that the
    warm-up has to forget only the arrangement, not to heat or cool the shot through orders of magnitude; the
    phase of the sonotrode is drawn anew, and so is that of a turning part, which may take longer to turn once than
    a replica lasts. Same design, chamber and seed: same scene, to the last bit.

    Raises InputError when the shot does not fit or has too many balls, or the part cannot turn.
    """
    from sim_core import AnalyticCavity, Balls, Scene, SceneError, pack_balls

    require_ball_count(design)
    if not isinstance(mesh, AnalyticCavity):
        require_turnable(design, mesh)
    rng = np.random.default_rng(seed)
    sonotrode, shot = design.sonotrode, design.shot
    phase = rng.uniform(0.0, 2.0 * np.pi)
    turn_phase = 0.0 if design.effects.part_turn is None else rng.uniform(0.0, 2.0 * np.pi)
    swing = max(one.amplitude for one in (sonotrode, *design.sonotrodes))
    try:
        diameter = np.array(shot.diameters)
        turn = part_turn(design, turn_phase)
        positions = pack_balls(
            mesh, shot.count, diameter, rng, clear=swing, part_rotation=turn, floor=0.0
        )  # not in a sump
    except SceneError as error:
        raise InputError(
            f"shot: {error}; see shot.mass_g, shot.diameter_mm and [chamber]"
        ) from None
    velocities = start_velocities(rng, len(positions), sonotrode.peak_speed)
    draws = int(rng.integers(2**32)) if sonotrode.motion == "random_phase" else 0
    accuracy = design.process.accuracy
    return Scene(
        mesh=mesh,
        balls=Balls(positions, velocities, diameter, shot.density),
        physics=scene_physics(design, mesh, phase, turn_phase, draws),
        duration=design.process.recorded_time,
        warmup=accuracy.warmup_time,
        record=(TAG_PART,),
    )

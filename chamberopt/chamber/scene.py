"""Make the simulator's scene for a design: chamber, shot, effects and duration."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.toml_fields import metres
from chamberopt.design.shape_surface import TAG_PART, TAG_SONOTRODE, further_sonotrode_tag

T = TypeVar("T")

# A prediction compares a ball with every other ball. It takes about 40 µs for 20,000 balls, and
# every ball needs about a thousand predictions a simulated second.
MAX_BALLS = 20_000

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.chamber.part import Axis
    from chamberopt.design.load import Design
    from sim_core import (
        AnalyticCavity,
        Flexure,
        PartRotation,
        Physics,
        Scene,
        TriangleMesh,
        Vibration,
    )


def start_velocities(rng: np.random.Generator, count: int, rms_speed: float) -> np.ndarray:
    """Return random Maxwell velocities [m/s] in all directions, (count, 3), of this rms speed."""
    return rng.normal(0.0, rms_speed / np.sqrt(3.0), (count, 3))


def chamber_mesh(chamber: Chamber) -> TriangleMesh:
    """Return the chamber's surface in the simulator's form: the same at each call."""
    return chamber.mesh


def require_ball_count(design: Design) -> None:
    """Raise InputError for more balls than the simulator supports."""
    if design.shot.count > MAX_BALLS:
        raise InputError(
            f"shot: {design.shot.count} balls of {1e3 * min(design.shot.diameters):g} mm or more "
            f"in {design.shot.mass_g:g} g, more than the {MAX_BALLS} supported; lower shot.mass_g "
            "or use larger balls"
        )


def part_rotation(design: Design, axis: Axis | None, phase: float = 0.0) -> PartRotation | None:
    """Return the rotation of a turning part; None if the part does not turn.

    Args:
        axis: a point [m] on the axis and its direction, in the chamber's frame.
        phase: phase of a motion to and fro at the start [rad].
    """
    from sim_core import PartRotation

    turn = design.effects.part_turn
    if turn is None:
        return None
    if axis is None:
        raise ValueError("the axis of a turning part is not given")
    point, direction = ((float(x), float(y), float(z)) for x, y, z in axis)
    motion = turn.rpm, turn.amplitude, turn.frequency_hz, phase
    tag = design.turning_holder_tag
    return PartRotation(TAG_PART, point, direction, *motion, () if tag is None else (tag,))


def require_turnable(design: Design, mesh: TriangleMesh, axis: Axis | None) -> None:
    """Raise InputError if the part should turn but its chamber leaves no room for the turn."""
    from sim_core import SceneError, require_free_rotation

    turn = part_rotation(design, axis)
    if turn is not None:
        try:
            require_free_rotation(mesh, turn, min(design.shot.diameters))
        except SceneError as error:
            raise InputError(f"effects.part_turn: {error}") from None


def require_measured_faces(design: Design, mesh: TriangleMesh | AnalyticCavity) -> None:
    """Raise InputError for an amplitude_profile that its sonotrode's face cannot have.

    The face goes on beyond the last point, or the profile is steeper than any sonotrode.
    """
    from sim_core import SceneError, Vibration, require_profiles

    moving = vibrations(design, 0.0)
    further = [f"sonotrodes.{k}" for k in range(len(design.sonotrodes))]
    names = tuple(f"{name}.amplitude_profile" for name in ("sonotrode", *further))
    try:
        require_profiles(mesh, (moving,) if isinstance(moving, Vibration) else moving, names)
    except SceneError as error:
        raise InputError(str(error)) from None


def balls_can_rest(design: Design, mesh: TriangleMesh | AnalyticCavity) -> bool:
    """True if balls can lie still: as effects.rest says or, if the design does not give it, if a
    surface that does not move faces up.

    In an analytical cavity balls stand on nothing but the sonotrode, whatever effects.rest says.
    """
    from sim_core import AnalyticCavity, Gravity, can_rest

    if design.effects.rest is not None and not isinstance(mesh, AnalyticCavity):
        return design.effects.rest
    moving = [TAG_SONOTRODE, *(further_sonotrode_tag(k) for k in range(len(design.sonotrodes)))]
    if design.effects.part_turn is not None:
        moving += [TAG_PART, design.turning_holder_tag or TAG_PART]
    gravity = Gravity() if design.effects.gravity else None
    return design.effects.rest is not False and can_rest(mesh, gravity, *moving)


def vibrations(design: Design, phase: float) -> Vibration | tuple[Vibration, ...]:
    """Return the vibration of the only sonotrode, or a tuple of the vibrations of several.

    Args:
        phase: phase of the first sonotrode at the start [rad]. The phases of further sonotrodes are
            added to it, so two sonotrodes of one frequency always keep the same shift in time.
    """
    from sim_core import Vibration

    floor = design.sonotrode
    first = Vibration(TAG_SONOTRODE, floor.largest_amplitude, floor.frequency, phase)
    if floor.amplitude_profile is not None:
        x, y = floor.amplitude_profile.middle_mm
        first = first._replace(profile=floor.amplitude_profile.simulated(metres((x, y, 0.0))))
    further = []
    for k, one in enumerate(design.sonotrodes):
        motion = one.largest_amplitude, one.frequency, phase + one.phase, one.direction
        moving = Vibration(further_sonotrode_tag(k), *motion)
        if one.amplitude_profile is not None:
            moving = moving._replace(profile=one.amplitude_profile.simulated(one.at))
        further.append(moving)
    return (first, *further) if further else first


def scene_physics(
    design: Design,
    mesh: TriangleMesh | AnalyticCavity,
    phase: float = 0.0,
    turn_phase: float = 0.0,
    phase_seed: int = 0,
    roughness_seed: int = 0,
    axis: Axis | None = None,
) -> Physics:
    """Return the simulator's effects for a design in its chamber's mesh or analytical cavity.

    Raises InputError if the effects are still "auto".

    Args:
        axis: axis of a turning part: a point [m] and a direction, in the chamber's frame.
        phase, turn_phase: phases of the sonotrode and of a turning part at the start [rad].
        phase_seed: for motion = "random_phase", the seed of each ball's phase.
        roughness_seed: seed of the facets of rough surfaces.
    """
    import sim_core

    design = design.simulated
    effects, materials = design.effects, design.materials
    is_random = design.sonotrode.motion == "random_phase"
    if effects.auto:
        raise InputError(
            'effects: still "auto"; resolve them first with a pilot run, as simulate and run do'
        )

    def of_tags(part: T, sonotrode: T, wall: T) -> tuple[T, ...]:
        """Return one a tag: of part, sonotrode, wall, further sonotrodes, a turning holder."""
        holders = 0 if design.turning_holder_tag is None else 1
        return part, sonotrode, wall, *[sonotrode] * len(design.sonotrodes), *[wall] * holders

    laws = of_tags(materials.part, materials.sonotrode, materials.wall)
    surfaces, balls = tuple(law.restitution for law in laws), materials.shot.restitution
    accuracy, friction, roughness = design.process.accuracy, None, None
    if effects.friction is not None:
        friction = sim_core.Friction(of_tags(*effects.friction.surfaces), effects.friction.balls)
    if effects.roughness is not None:
        roughness = sim_core.Roughness(of_tags(*effects.roughness.slopes), roughness_seed)
    return sim_core.Physics(
        gravity=sim_core.Gravity() if effects.gravity else None,
        restitution=sim_core.Restitution(surfaces, balls, accuracy.elastic_below),
        vibration=vibrations(design, phase),
        part_rotation=part_rotation(design, axis, turn_phase),
        rest=sim_core.Rest() if balls_can_rest(design, mesh) else None,
        friction=friction,
        roughness=roughness,
        drag=sim_core.Drag(piece=accuracy.drag_step) if effects.drag else None,
        surface=sim_core.surface_effects(**effects.of_surfaces),
        ball_collisions=sim_core.BallCollisions() if effects.ball_collisions else None,
        random_phase=sim_core.RandomPhase(phase_seed) if is_random else None,
    )


def build_scene(
    design: Design,
    mesh: TriangleMesh | AnalyticCavity,
    seed: int,
    axis: Axis | None = None,
    flexure: Flexure | None = None,
) -> Scene:
    """Return the scene of one simulation. Equal arguments give bit-identical scenes.

    The shot starts packed low in the chamber, with random velocities of the rms speed 2 pi f A, the
    peak speed of the sonotrode; of a face that bends it is the rms over the face. The warm-up then
    has to remove only the effect of the arrangement, and need not change the shot's energy by
    orders of magnitude. The phases of the sonotrode and of a turning part are random, because a
    turn of the part may take longer than the simulation.

    Args:
        seed: random seed of the simulation.
        axis: axis of a turning part: a point [m] and a direction, in the chamber's frame.
        flexure: flexure of the mesh's surfaces where the part is thin.
    Raises:
        InputError: the shot does not fit or has too many balls, or the part cannot turn.
    """
    from sim_core import AnalyticCavity, Balls, Scene, SceneError, pack_balls

    require_ball_count(design)
    design = design.simulated
    if not isinstance(mesh, AnalyticCavity):
        require_turnable(design, mesh, axis)
    require_measured_faces(design, mesh)
    rng = np.random.default_rng(seed)
    sonotrode, shot = design.sonotrode, design.shot
    phase = rng.uniform(0.0, 2.0 * np.pi)
    turn_phase = 0.0 if design.effects.part_turn is None else rng.uniform(0.0, 2.0 * np.pi)
    clearance = max(one.largest_amplitude for one in (sonotrode, *design.sonotrodes))
    diameter, turn = np.array(shot.diameters), part_rotation(design, axis, turn_phase)
    try:
        # floor = 0: no balls in a well below the sonotrode's face
        positions = pack_balls(
            mesh, shot.count, diameter, rng, clear=clearance, part_rotation=turn, floor=0.0
        )
    except SceneError as error:
        remedy = "see shot.mass_g, shot.diameter_mm and [chamber]"
        raise InputError(f"shot: {error}; {remedy}") from None
    velocities = start_velocities(rng, len(positions), sonotrode.rms_peak_speed)
    phase_seed = int(rng.integers(2**32)) if sonotrode.motion == "random_phase" else 0
    roughness_seed = int(rng.integers(2**32)) if design.effects.roughness is not None else 0
    effects = scene_physics(design, mesh, phase, turn_phase, phase_seed, roughness_seed, axis)
    return Scene(
        mesh=mesh,
        balls=Balls(positions, velocities, diameter, shot.density),
        physics=effects._replace(flexure=flexure),
        duration=design.process.recorded_time,
        warmup=design.process.accuracy.warmup_time,
        record=(TAG_PART,),
        record_held=False,
    )

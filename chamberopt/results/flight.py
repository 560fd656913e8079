"""Simulate some milliseconds of ball flight again and record them frame by frame.

The simulator computes every position at the time of its frame. No position is interpolated.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.coverage.dents import Dents, dents_on_part

if TYPE_CHECKING:
    from chamberopt.results.rebuild import RebuiltReplica
    from sim_core import ImpactLog, PartRotation, Scene, Vibration

MIN_SPAN = 1e-6  # s
MAX_FRAMES = 2000
TRAIL = 4
MAX_POSITIONS = 10_000_000  # balls × frames × trail; 480 MB together with the velocities


@dataclass(frozen=True)
class FlightFrames:
    """Positions of balls, sonotrodes and part in one replica at evenly spaced times, called frames.

    Times count from the end of the replica's warm-up, as in its impact log.

    time: time of each frame [s], shape (f,).
    balls: centres of the balls [m], shape (f, n, 3).
    trail: centres of the balls at k times from the previous frame on [m], shape (f, k, n, 3). NaN
        in frame 0, which has no previous frame.
    diameter: diameters of the balls [m], shape (n,).
    sonotrodes: displacement of each vibrating face [m], shape (f, 3), by the tag of its triangles.
        Empty for the motion "random_phase", in which the phase of each collision is random.
    amplitude: largest amplitude of all sonotrodes [m].
    bends: True if a sonotrode has an amplitude profile. Its displacement is that of the places that
        move most.
    part_angle: rotation of the part [rad], shape (f,).
    part_axis: point [m] and direction of the rotation axis. None if the part stands still.
    dents, impacts: dents and impacts on the part from the first to the last frame, in coordinates
        fixed to the part.
    """

    time: np.ndarray
    balls: np.ndarray
    trail: np.ndarray
    diameter: np.ndarray
    sonotrodes: dict[int, np.ndarray]
    amplitude: float
    bends: bool
    part_angle: np.ndarray
    part_axis: tuple[np.ndarray, np.ndarray] | None
    dents: Dents
    impacts: ImpactLog


def simulate_flight(
    replica: RebuiltReplica,
    start: float,
    span: float,
    frames: int,
    trail: int = TRAIL,
    progress: Callable[[float], None] = lambda seconds: None,
) -> FlightFrames:
    """Simulate a replica again and record evenly spaced frames from `start` to `start + span`.

    Args:
        replica: replica to simulate.
        start: time of the first frame after the warm-up [s].
        span: time from the first to the last frame [s].
        frames: number of frames.
        trail: recorded positions of each ball from one frame to the next.
        progress: function that is called with the simulated time [s], warm-up included.

    Raises:
        InputError: the frames lie outside the recorded time, or there are too many.
        sim_core.SimulationError: the simulation had to stop.
    """
    from sim_core import simulate

    scene = replica.scene
    require_simulated(scene, start, span, frames, trail)
    end = min(start + span, scene.duration)
    times = np.linspace(start, end, (frames - 1) * trail + 1)
    # A scene that is cut short at `end` gives the same bits up to `end` as the whole scene.
    simulated = simulate(replace(scene, duration=end), times, progress)
    impacts = replica.on_chamber(simulated.impacts)
    on_part = replica.chamber.source[impacts.triangle] >= 0
    impacts = impacts.only((impacts.time >= start) & on_part)
    positions = simulated.frames.positions
    before = np.full((1, trail, *positions.shape[1:]), np.nan)
    later = positions[:-1].reshape(frames - 1, trail, *positions.shape[1:])
    time, rotation = times[::trail], scene.physics.part_rotation
    vibrations = () if scene.physics.random_phase else scene.physics.vibrations
    axis = None
    if rotation is not None:
        direction = np.array(rotation.axis)
        axis = np.array(rotation.axis_point), direction / np.linalg.norm(direction)
    return FlightFrames(
        time=time,
        balls=positions[::trail],
        trail=np.concatenate([before, later]),
        diameter=scene.balls.diameters,
        sonotrodes={one.tag: face_displacement(one, scene.warmup + time) for one in vibrations},
        amplitude=max((float(one.amplitude) for one in scene.physics.vibrations), default=0.0),
        bends=any(one.profile is not None for one in scene.physics.vibrations),
        part_angle=rotation_angle(rotation, scene.warmup + time),
        part_axis=axis,
        dents=dents_on_part(impacts, replica.chamber, replica.design),
        impacts=impacts,
    )


def face_displacement(vibration: Vibration, time: np.ndarray) -> np.ndarray:
    """Return the displacement of a vibrating face [m], shape (f, 3).

    Times [s] count from the start of the simulation, before the warm-up.
    """
    phase = 2.0 * math.pi * vibration.frequency * time + vibration.phase
    return np.asarray(np.sin(phase)[:, None] * vibration.peak)


def rotation_angle(rotation: PartRotation | None, time: np.ndarray) -> np.ndarray:
    """Return the angle [rad] by which the part has turned, shape (f,). 0 if it is fixed.

    Times [s] count from the start of the simulation, before the warm-up.
    """
    if rotation is None:
        return np.zeros(len(time))
    if rotation.rpm is not None:
        return 2.0 * math.pi * rotation.rpm / 60.0 * time + rotation.phase
    assert rotation.amplitude is not None
    assert rotation.frequency is not None
    phase = 2.0 * math.pi * rotation.frequency * time + rotation.phase
    return np.asarray(rotation.amplitude * np.sin(phase))


def require_simulated(
    scene: Scene, start: float, span: float, frames: int, trail: int = TRAIL
) -> None:
    """Raise InputError if frames are outside a replica's recorded time, or if there are too many.

    Args:
        scene: simulator's input for the replica.
        start: time of the first frame after the warm-up [s].
        span: time from the first to the last frame [s].
        frames: number of frames.
        trail: recorded positions of each ball per frame.
    """
    duration, positions = scene.duration, trail * len(scene.balls)
    if not 0.0 <= start < duration:
        raise InputError(
            f"--from-s: given {start:g}; the replica was simulated from 0 to {duration:g} s"
        )
    if not MIN_SPAN <= span <= (duration - start) * (1.0 + 1e-9):
        left = 1e3 * (duration - start)
        raise InputError(
            f"--span-ms: given {1e3 * span:g}; from {start:g} s on, {left:.6g} ms were simulated: "
            f"give from {1e3 * MIN_SPAN:g} to that, or begin earlier"
        )
    if not 2 <= frames <= MAX_FRAMES:
        raise InputError(f"--frames: given {frames}; 2 to {MAX_FRAMES} are supported")
    if frames * positions > MAX_POSITIONS:
        raise InputError(
            f"--frames: given {frames}, too many for so much shot; at most "
            f"{MAX_POSITIONS // positions} are supported"
        )

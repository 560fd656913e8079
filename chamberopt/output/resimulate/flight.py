"""Some milliseconds of shot flight, frame by frame: every position is the simulator's own, at that very time, and none
is put in between.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.coverage.dents import Dents, dents_on_part

if TYPE_CHECKING:
    from chamberopt.output.resimulate.rebuild import Replica
    from sim_core import ImpactLog, PartRotation, Vibration

SHORTEST = 1e-6  # s
MOST_FRAMES = 2000
MOST_POSITIONS = 10_000_000  # of all balls in all frames and their trails: 240 MB


@dataclass(frozen=True)
class Flight:
    """Frames of one replica; times from the end of its warm-up, as in its impact log.

    time (f,) s · balls (f, n, 3) m: their centres · trail (f, k, n, 3) m: where they were since the frame before,
    NaN before the first · diameter (n,) m · sonotrodes: by tag, the displacement of each face (f, 3) m; without those
    that have no one phase ("random_phase") · amplitude m: the largest · part_angle (f,) rad about part_axis (point m,
    direction), None where the part stands still · dents, impacts: of the time shown, places in the part's frame ·
    part_triangle (i,): what each impact hit.
    """

    time: np.ndarray
    balls: np.ndarray
    trail: np.ndarray
    diameter: np.ndarray
    sonotrodes: dict[int, np.ndarray]
    amplitude: float
    part_angle: np.ndarray
    part_axis: tuple[np.ndarray, np.ndarray] | None
    dents: Dents
    impacts: ImpactLog
    part_triangle: np.ndarray


def flight(replayed: Replica, start: float, span: float, frames: int, trail: int = 4) -> Flight:
    """Frames of ``span`` [s] from ``start`` [s after the warm-up], the first and last at its ends, evenly spaced.

    trail: exact places of each ball noted from frame to frame, the frame's own among them. Raises InputError for what
    the replica has not simulated, and sim_core.SimulationError.
    """
    from sim_core import simulate

    scene = replayed.scene
    _require_simulated(start, span, frames, scene.duration, trail * len(scene.balls))
    end = min(start + span, scene.duration)
    every = np.linspace(start, end, (frames - 1) * trail + 1)
    seen = simulate(
        replace(scene, duration=end), frames=every
    )  # the same bits as of the whole, as far as it goes
    impacts = replayed.booked(seen.impacts)
    shown = (impacts.time >= start) & (replayed.chamber.source[impacts.triangle] >= 0)
    impacts = impacts.only(shown)
    time, turn = every[::trail], scene.physics.part_rotation
    waving = () if scene.physics.random_phase else scene.physics.vibrations
    before = np.full((1, trail, *seen.frames.shape[1:]), np.nan)
    return Flight(
        time=time,
        balls=seen.frames[::trail],
        trail=np.concatenate(
            [before, seen.frames[:-1].reshape(frames - 1, trail, *seen.frames.shape[1:])]
        ),
        diameter=scene.balls.diameters,
        sonotrodes={one.tag: displacement(one, scene.warmup + time) for one in waving},
        amplitude=max((float(one.amplitude) for one in scene.physics.vibrations), default=0.0),
        part_angle=angle(turn, scene.warmup + time),
        part_axis=None
        if turn is None
        else (np.array(turn.axis_point), np.array(turn.axis) / np.linalg.norm(turn.axis)),
        dents=dents_on_part(impacts, replayed.chamber, replayed.design),
        impacts=impacts,
        part_triangle=replayed.chamber.source[impacts.triangle],
    )


def displacement(vibration: Vibration, time: np.ndarray) -> np.ndarray:
    """Where a vibrating face is from its middle (f, 3) [m] at times (f,) [s] from the scene's start."""
    return np.asarray(
        np.sin(2.0 * math.pi * vibration.frequency * time + vibration.phase)[:, None]
        * vibration.peak
    )


def angle(turn: PartRotation | None, time: np.ndarray) -> np.ndarray:
    """How far a part has turned (f,) [rad] at times (f,) [s] from the scene's start; 0 where it does not."""
    if turn is None:
        return np.zeros(len(time))
    if turn.rpm is not None:
        return 2.0 * math.pi * turn.rpm / 60.0 * time + turn.phase
    assert turn.amplitude is not None
    assert turn.frequency is not None
    return np.asarray(turn.amplitude * np.sin(2.0 * math.pi * turn.frequency * time + turn.phase))


def _require_simulated(
    start: float, span: float, frames: int, duration: float, positions: int
) -> None:
    if not 0.0 <= start < duration:
        raise InputError(
            f"--from-s: given {start:g}; the replica was simulated from 0 to {duration:g} s"
        )
    if not SHORTEST <= span <= (duration - start) * (1.0 + 1e-9):
        left = 1e3 * (duration - start)
        raise InputError(
            f"--span-ms: given {1e3 * span:g}; from {start:g} s on, {left:.6g} ms were simulated: give from "
            f"{1e3 * SHORTEST:g} to that, or begin earlier"
        )
    if not 2 <= frames <= MOST_FRAMES:
        raise InputError(f"--frames: given {frames}; 2 to {MOST_FRAMES} are supported")
    if frames * positions > MOST_POSITIONS:
        raise InputError(
            f"--frames: given {frames}, too many for so much shot; at most {MOST_POSITIONS // positions} are supported"
        )

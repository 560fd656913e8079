"""State of the event loop: every array of a scene being simulated, in one tuple."""

from typing import NamedTuple

import numpy as np

from sim_core.detect.ball_mesh import Scratch
from sim_core.effects.amplitude_profile import FaceProfiles
from sim_core.effects.ball_sizes import BallSizes
from sim_core.effects.contact_mode import ContactState
from sim_core.effects.drag import DragState
from sim_core.effects.flexure import FlexureState
from sim_core.effects.friction import FrictionState
from sim_core.effects.gravity import Gravity
from sim_core.effects.part_rotation import RotationState
from sim_core.effects.random_phase import RandomPhaseState
from sim_core.effects.restitution import RestitutionState
from sim_core.effects.roughness import RoughnessState
from sim_core.effects.sonotrodes import SonotrodeWaves
from sim_core.effects.surface.surface_effects import SurfaceEffects
from sim_core.effects.vibration import Wave
from sim_core.geometry.obstacle_set import ObstacleSet
from sim_core.loop.event_queue import EventQueue
from sim_core.loop.impact_log import CollisionBuffer, ImpactBuffer
from sim_core.loop.neighbours import NeighbourFilter
from sim_core.loop.stays import Stays
from sim_core.numerics.periodic_sides import PeriodicSides
from sim_core.numerics.profiler import Profiler
from sim_core.numerics.record_addresses import passed_by_address

# Places in SimulationState.counts: hits on walls, on balls and on the sonotrode, searches for a
# surface, and stale meetings.
WALLS, BALLS, SONOTRODE, SEARCHES, STALE = 0, 1, 2, 3, 4


class Clock(NamedTuple):
    """Time in a simulation, counted in windows of one length.

    The clock restarts from 0 in each window.

    now: time since the start of the present window [s], and number of past windows, (2,).
    window: length of a window [s].
    stop: time of the next pause [s since the start].
    origin: end of the warm-up, from which the times of impacts count [s since the start].
    """

    now: np.ndarray
    window: float
    stop: float
    origin: float


@passed_by_address
class SimulationState(NamedTuple):
    """All data that the event loop works on. An absent effect is None.

    motion: base position [m], where the straight path is at time 0 of the clock, and velocity
        [m/s] of each ball in the free-fall frame, (n, 6).
    neighbours: filter that finds balls that can meet; None if balls do not collide.
    stays: balls that hop on one spot or sit in a gap.
    counts: numbers of hits on walls, on balls and on the sonotrode, of searches for a surface,
        and of meetings that were dropped, (5,) int64.
    collision_buffer: collisions of balls not yet in the log; None unless they are logged.
    sides: the sides of a periodic box; None in any other chamber.
    profiler: time spent in each part of the loop; None unless it is measured.
    """

    motion: np.ndarray
    neighbours: NeighbourFilter | None
    obstacles: ObstacleSet
    queue: EventQueue
    scratch: Scratch
    gravity: Gravity | None
    restitution: RestitutionState | None
    wave: Wave | None
    rotation: RotationState | None
    clock: Clock
    buffer: ImpactBuffer
    stays: Stays
    counts: np.ndarray
    profiler: Profiler | None
    contact: ContactState | None
    friction_state: FrictionState | None
    surface_effects: SurfaceEffects
    random_phase: RandomPhaseState | None
    roughness: RoughnessState | None
    flexure: FlexureState | None
    drag: DragState | None
    sizes: BallSizes | None
    waves: SonotrodeWaves | None
    profiles: FaceProfiles | None
    collision_buffer: CollisionBuffer | None
    sides: PeriodicSides | None

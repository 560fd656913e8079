"""What the event loop works on: every column of a scene being played, in one tuple."""

from typing import NamedTuple

import numpy as np

from sim_core.detect.ball_mesh import Scratch
from sim_core.effects.contact_mode import Footing
from sim_core.effects.drag import Air
from sim_core.effects.friction import Grip
from sim_core.effects.gravity import Gravity
from sim_core.effects.part_rotation import Turning
from sim_core.effects.random_phase import Phases
from sim_core.effects.restitution import Restitution
from sim_core.effects.sonotrodes import Waves
from sim_core.effects.vibration import Wave
from sim_core.geometry.ball_sizes import Sizes
from sim_core.geometry.obstacle_set import Ground
from sim_core.loop.event_queue import Calendar
from sim_core.loop.impact_log import ImpactPage
from sim_core.loop.neighbours import Crowd
from sim_core.numerics.profiler import Stopwatch

# columns of Loop.tally
WALLS, BALLS, SONOTRODE, SEARCHES, STALE = 0, 1, 2, 3, 4


class Shot(NamedTuple):
    """The balls for the loop: ``motion`` (n, 6) float64 in the free-fall frame, and the ``crowd`` made of it,
    if they collide with one another.
    """

    motion: np.ndarray
    crowd: Crowd | None


class Clock(NamedTuple):
    """``now`` (2,): time on the window's clock [s], and windows gone by; ``window`` [s]; ``stop`` [s] and ``origin``
    [s]

    on the scene's clock: where to stop, and what impact times count from.
    """

    now: np.ndarray
    window: float
    stop: float
    origin: float


class Loop(NamedTuple):
    """Everything the event loop works on; ``tally`` (5,) int64, see WALLS and below; ``watch`` only to measure."""

    shot: Shot
    ground: Ground
    calendar: Calendar
    scratch: Scratch
    gravity: Gravity | None
    restitution: Restitution | None
    wave: Wave | None
    turning: Turning | None
    clock: Clock
    page: ImpactPage
    tally: np.ndarray
    watch: Stopwatch | None
    footing: Footing | None
    grip: Grip | None
    phases: Phases | None
    air: Air | None
    sizes: Sizes | None
    waves: Waves | None

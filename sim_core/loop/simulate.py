"""Scene in, SimulationResult out: sets up the columns, runs the compiled event loop, checks what must never break."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from sim_core.balls import Balls
from sim_core.contact.resting_balls import Resting, resting
from sim_core.detect.ball_mesh import Scratch, new_scratch
from sim_core.effects.contact_mode import ContactState, checked_rest, new_contact_state
from sim_core.effects.drag import DragState, checked_drag, new_drag_state
from sim_core.effects.friction import FrictionState, checked_friction, new_friction_state
from sim_core.effects.gravity import checked_gravity, gravity_acceleration
from sim_core.effects.part_rotation import RotationState, angle_at, checked_axis, new_rotation_state
from sim_core.effects.random_phase import (
    RandomPhaseState,
    checked_random_phase,
    new_random_phase_state,
)
from sim_core.effects.restitution import Restitution, checked_restitution
from sim_core.effects.sonotrodes import SonotrodeWaves, new_waves, whole_period_window
from sim_core.effects.vibration import Wave, checked_waves
from sim_core.errors import SceneError, SimulationError
from sim_core.geometry.analytic import AnalyticCavity
from sim_core.geometry.ball_sizes import BallSizes, new_ball_sizes
from sim_core.geometry.mesh import MAX_TAGS
from sim_core.geometry.obstacle_set import build_obstacle_set
from sim_core.impulses.drag import apply_drag_to_all
from sim_core.loop.contact_neighbours import hide_all
from sim_core.loop.event_queue import EventQueue, new_event_queue
from sim_core.loop.events import BUFFER_FULL, DONE, TOO_FAST, TOO_MANY_EVENTS, advance
from sim_core.loop.impact_log import ImpactBuffer, ImpactLog, impact_log, new_impact_buffer
from sim_core.loop.jam_message import touching
from sim_core.loop.neighbours import NeighbourFilter, new_neighbour_filter
from sim_core.loop.state import Clock, SimulationState
from sim_core.motion import WINDOW
from sim_core.numerics.profiler import Profiler
from sim_core.scene.invariants import contained, narrowest_gap, turned_corners
from sim_core.scene.scene import TOUCH, Scene

CHECK_EVERY = (
    1.0  # s simulated between checks that every ball is still inside; one check costs about a ms
)


@dataclass(frozen=True)
class Collisions:
    """How many collisions there were, warm-up included, and how often the loop searched for one."""

    walls: int
    balls: int
    sonotrode: int
    searches: int
    stale: int

    @property
    def total(self) -> int:
        """Real collisions."""
        return self.walls + self.balls + self.sonotrode


@dataclass(frozen=True)
class SimulationResult:
    """The recorded impacts, the balls at the end, counts of the collisions, and who lies still at the end.

    ``frames`` (f, n, 3) [m]: where the balls' centres were at the times asked for.
    """

    impacts: ImpactLog
    balls: Balls
    collisions: Collisions
    resting: Resting
    frames: np.ndarray


def simulate(scene: Scene, frames: Sequence[float] | np.ndarray = ()) -> SimulationResult:
    """Plays the scene from its start to the end of its duration.

    ``frames`` (f,) [s since the end of the warm-up], ascending: when to note where the balls are, each on its flight at
    that very time. It changes no bit of the rest. Releases the GIL while it runs; the same scene gives the same bits
    on any thread. Raises SimulationError when a ball is lost, jams, or stops being a number.
    """
    run = _Run(scene)
    run.play(scene.warmup, record=False)
    seen = run.play(
        scene.warmup + scene.duration, record=True, frames=_checked_frames(frames, scene)
    )
    balls = run.balls()
    still = resting(run.contact, run.obstacles, balls.positions, run.centre, scene.warmup)
    return SimulationResult(
        impact_log(run.chunks, run.centre),
        balls,
        Collisions(*(int(n) for n in run.count)),
        still,
        seen,
    )


def _checked_frames(frames: Sequence[float] | np.ndarray, scene: Scene) -> np.ndarray:
    """Frame times on the scene's clock [s]. SceneError for what is not in its duration, or in no order."""
    times = np.asarray(frames, dtype=float).reshape(-1)
    if not np.isfinite(times).all() or (np.diff(times) <= 0.0).any():
        raise SceneError("frames: not ascending times; give each once, in order")
    if len(times) and not 0.0 <= times[0] <= times[-1] <= scene.duration:
        raise SceneError(
            f"frames: from {times[0]:g} to {times[-1]:g} s; allowed: 0 to the duration, {scene.duration:g} s"
        )
    return scene.warmup + times


_obstacle_set = lru_cache(maxsize=8)(build_obstacle_set)  # replicas of one chamber share it


class _Run:
    """A scene being played: the columns the loop works on, and what it has written so far."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.gravity = checked_gravity(scene.physics.gravity)
        vibrations, waves = scene.physics.vibrations, checked_waves(scene.physics.vibration)
        self.wave: Wave | None = min(waves, key=lambda wave: wave.omega, default=None)
        self.restitution: Restitution | None = None
        tags = int(scene.mesh.tags.max()) + 1
        if scene.physics.restitution is not None:
            self.restitution = checked_restitution(scene.physics.restitution, tags)
        self.centre = scene.mesh.middle
        self.window = whole_period_window(vibrations, WINDOW)
        tags_vibrating = tuple(one.tag for one in vibrations)
        amplitudes = tuple(float(one.amplitude) for one in vibrations)
        vibrating = scene.mesh.corners[np.isin(scene.mesh.tags, tags_vibrating)] - self.centre
        random_phase = checked_random_phase(scene.physics.random_phase, len(vibrations))
        self.random_phase: RandomPhaseState | None = new_random_phase_state(
            random_phase, self.wave, vibrating, 0.5 * scene.balls.diameters
        )
        self.rotation: RotationState | None = new_rotation_state(
            scene.physics.part_rotation, self.centre
        )
        radii = tuple(float(r) for r in 0.5 * scene.balls.sizes)
        self.obstacles = _obstacle_set(
            scene.mesh, radii, tags_vibrating, amplitudes, checked_axis(scene.physics.part_rotation)
        )
        self.waves: SonotrodeWaves | None = new_waves(
            vibrations, waves, self.window, self._tags_of_obstacles()
        )
        self.sizes: BallSizes | None = new_ball_sizes(scene.balls, self.obstacles.roots)
        self.collide = scene.physics.ball_collisions is not None
        self.motion = np.concatenate(
            [scene.balls.positions - self.centre, scene.balls.velocities], axis=1
        )
        self.queue: EventQueue = new_event_queue(len(self.motion), self.collide)
        self.scratch: Scratch = new_scratch()
        self.friction_state = self._friction_state(tags)
        self.contact: ContactState | None = new_contact_state(
            checked_rest(scene.physics.rest),
            len(self.motion),
            self.gravity,
            self.restitution,
            self.friction_state,
        )
        drag = checked_drag(scene.physics.drag)
        self.drag: DragState | None = new_drag_state(
            drag, scene.balls.diameters, scene.balls.densities
        )
        self.neighbours = self._new_filter(
            2.0 * max(1.0, float(np.abs(scene.balls.velocities).max()))
        )
        self.profiler: Profiler | None = None
        self.now = np.zeros(2)
        self.count = np.zeros(5, dtype=np.int64)
        self.chunks: list[tuple[np.ndarray, np.ndarray]] = []

    def _friction_state(self, tags: int) -> FrictionState | None:
        friction, balls = self.scene.physics.friction, self.scene.balls
        if friction is None:
            return None
        spins = np.zeros_like(balls.positions) if balls.spins is None else balls.spins
        return new_friction_state(
            checked_friction(friction, tags), spins, balls.radius, self._tags_of_obstacles()
        )

    def _tags_of_obstacles(self) -> np.ndarray:
        return np.asarray(self.obstacles.tags[self.obstacles.tree.triangles[:, 0]])

    def _new_filter(self, fastest: float) -> NeighbourFilter | None:
        if not self.collide:
            return None
        low, high = self.scene.mesh.bounds - self.centre
        balls = self.scene.balls
        radii = None if balls.alike else 0.5 * balls.diameters
        neighbours = new_neighbour_filter(
            self.motion, low, high, 2.0 * balls.radius, fastest, self.window, radii
        )
        hide_all(self.contact, neighbours)
        return neighbours

    def play(
        self, until: float, record: bool, frames: Sequence[float] | np.ndarray = ()
    ) -> np.ndarray:
        """Advance to ``until`` [s], checking containment on the way; positions (f, n, 3) [m] at ``frames`` [s]."""
        buffer = new_impact_buffer(
            self._recorded_tags() if record else np.zeros(MAX_TAGS, dtype=np.bool_)
        )
        origin = self.scene.warmup
        start = self.now[0] + self.now[1] * self.window
        checks = np.linspace(start, until, 1 + max(1, math.ceil((until - start) / CHECK_EVERY)))[1:]
        due, noted, seen = set(checks), set(frames), []
        for stop in sorted({*checks, *frames}):
            self._advance(Clock(self.now, self.window, float(stop), origin), buffer)
            if stop in noted:
                seen.append(self._states()[0])
            if stop in due:
                self._require_sound()
        self._turn(buffer)
        return np.array(seen).reshape(-1, len(self.motion), 3)

    def _recorded_tags(self) -> np.ndarray:
        record = np.zeros(MAX_TAGS, dtype=np.bool_)
        record[np.arange(MAX_TAGS) if self.scene.record is None else list(self.scene.record)] = True
        return record

    def _advance(self, clock: Clock, buffer: ImpactBuffer) -> None:
        while True:
            status, ball = advance(
                SimulationState(
                    self.motion,
                    self.neighbours,
                    self.obstacles,
                    self.queue,
                    self.scratch,
                    self.gravity,
                    self.restitution,
                    self.wave,
                    self.rotation,
                    clock,
                    buffer,
                    self.count,
                    self.profiler,
                    self.contact,
                    self.friction_state,
                    self.random_phase,
                    self.drag,
                    self.sizes,
                    self.waves,
                )
            )
            if status == DONE:
                return
            if status == BUFFER_FULL:
                self._turn(buffer)
            elif status == TOO_FAST:
                speed = float(np.abs(self.motion[ball, 3:]).max())
                if not math.isfinite(speed):
                    raise SimulationError(
                        f"ball {ball}: its velocity is not a number any more; {self._when()}"
                    )
                self.neighbours = self._new_filter(4.0 * speed)
            elif status == TOO_MANY_EVENTS:
                raise SimulationError(self._jam(ball))

    def _jam(self, ball: int) -> str:
        positions = self._states()[0]
        where = np.round(positions[ball], 6).tolist()
        between, by_part = touching(self.scene, self._corners(), positions, ball)
        if self.rotation is not None and (by_part or self.contact is not None):
            through = "" if by_part else ", and the turning part presses on it through other balls"
            return (
                f"ball {ball} is caught between {between}{through}, at {where} m, {self._when()}; make room there for "
                "a ball between the part and what it turns past, or so little that none gets in"
            )
        return (
            f"ball {ball} jams at {where} m{f', between {between}' if between else ''}: more than ten million events "
            f"a second; {self._when()}. Look for a gap just as wide as the ball there"
            + (
                ""
                if self.contact is not None
                else "; if balls can lie still there, switch contact mode on"
            )
        )

    def _turn(self, buffer: ImpactBuffer) -> None:
        """Put away what the loop has written, and give it the empty page."""
        rows = int(buffer.filled[0])
        if rows:
            self.chunks.append((buffer.numbers[:rows].copy(), buffer.names[:rows].copy()))
            buffer.filled[0] = 0

    def _when(self) -> str:
        return f"{self.now[0] + self.now[1] * self.window:.6f} s after the start"

    def _states(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions [m] and velocities [m/s] now, (n, 3) each: point_at for all balls at once."""
        now = self.now[0]
        acceleration = (
            np.array(gravity_acceleration(self.gravity))
            if self.contact is None
            else self.contact.acceleration
        )
        base, velocities = self.motion[:, :3], self.motion[:, 3:]
        velocities_now = velocities + now * acceleration
        apply_drag_to_all(self.drag, self.contact, velocities_now, now)
        return (
            base + velocities * now + 0.5 * now * now * acceleration + self.centre,
            velocities_now,
        )

    def _require_sound(self) -> None:
        points, _ = self._states()
        bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
        if len(bad):
            raise SimulationError(
                f"ball {bad[0]}: its position is not a number any more; {self._when()}"
            )
        outside = np.flatnonzero(~self._inside(points))
        if len(outside):
            raise SimulationError(
                f"ball {outside[0]} has left the mesh at {np.round(points[outside[0]], 6).tolist()} m, {self._when()}. "
                "Look for surfaces that overlap or cross there; if there are none, please report the scene"
            )
        if not self.collide:
            return
        gap, one, two = narrowest_gap(self.balls())
        if gap < -TOUCH:
            raise SimulationError(
                f"balls {one} and {two} overlap by {-gap:.3g} m, {self._when()}; please report the scene"
            )

    def _inside(self, points: np.ndarray) -> np.ndarray:
        """Which points (n, 3) [m] are in the chamber; also down to where a face that swings wider than a ball is."""
        mesh, corners = self.scene.mesh, self._corners()
        if isinstance(mesh, AnalyticCavity):
            return mesh.contains(
                points, max((one.amplitude for one in self.scene.physics.vibrations), default=0.0)
            )
        inside = contained(mesh, points, corners)
        for one in self.scene.physics.vibrations:
            if one.amplitude >= 0.5 * self.scene.balls.sizes[0] and not inside.all():
                inside |= contained(mesh, points + one.peak, corners) | contained(
                    mesh, points - one.peak, corners
                )
        return inside

    def _corners(self) -> np.ndarray | None:
        """The triangles where they are now, if some of them turn."""
        turn = self.scene.physics.part_rotation
        mesh = self.scene.mesh
        if turn is None or self.rotation is None or isinstance(mesh, AnalyticCavity):
            return None
        return turned_corners(mesh, turn, angle_at(self.rotation, float(self.now[0])))

    def balls(self) -> Balls:
        """The balls as they are now."""
        spins = (
            None
            if self.friction_state is None
            else self.friction_state.spins + self.now[0] * self.friction_state.twists
        )
        return Balls(*self._states(), self.scene.balls.diameter, self.scene.balls.density, spins)

"""Simulation of a scene: set up its arrays, run the compiled event loop, check the invariants."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sim_core.balls import Balls
from sim_core.contact.resting_balls import Resting, resting
from sim_core.detect.ball_mesh import new_scratch
from sim_core.effects.amplitude_profile import new_face_profiles
from sim_core.effects.ball_sizes import new_ball_sizes
from sim_core.effects.contact_mode import checked_rest, new_contact_state, new_ride
from sim_core.effects.drag import checked_drag, new_drag_state
from sim_core.effects.flexure import checked_flexure, new_flexure_state
from sim_core.effects.friction import FrictionState, checked_friction, new_friction_state
from sim_core.effects.gravity import checked_gravity, gravity_acceleration
from sim_core.effects.part_rotation import angle_at, checked_axis, new_rotation_state
from sim_core.effects.random_phase import checked_random_phase, new_random_phase_state
from sim_core.effects.restitution import checked_restitution
from sim_core.effects.roughness import checked_roughness, new_roughness_state
from sim_core.effects.sonotrodes import clock_window, new_waves
from sim_core.effects.vibration import checked_waves
from sim_core.errors import SceneError, SimulationError
from sim_core.geometry.analytic import AnalyticCavity, periods_of
from sim_core.geometry.mesh import MAX_TAGS
from sim_core.geometry.obstacle_set import build_obstacle_set
from sim_core.geometry.obstacles import face_overlap_of
from sim_core.impulses.drag import apply_drag_to_all
from sim_core.loop.contact_neighbours import hide_all
from sim_core.loop.event_queue import new_event_queue
from sim_core.loop.events import BUFFER_FULL, DONE, HAS_LEFT, TOO_FAST, TOO_MANY_EVENTS, advance
from sim_core.loop.impact_log import (
    CollisionLog,
    ImpactLog,
    empty_buffer,
    joined,
    new_collision_buffer,
    new_impact_buffer,
)
from sim_core.loop.jam_message import jam_message
from sim_core.loop.neighbours import MAX_SPEED, NeighbourFilter, new_neighbour_filter
from sim_core.loop.state import Clock, SimulationState
from sim_core.loop.stays import Trapped, begin_anew, held_now, is_on_one_side, new_stays, trapped
from sim_core.motion import WINDOW
from sim_core.numerics.computed_once import computed_once
from sim_core.numerics.periodic_sides import new_periodic_sides
from sim_core.scene.frames import Frames, frames_of
from sim_core.scene.invariants import beneath_mean_plane, contained, narrowest_gap, turned_corners
from sim_core.scene.scene import TOUCH, Scene

# s simulated between checks that every ball is still inside; one check costs about a ms
CHECK_EVERY = 1.0
TELL_EVERY = 0.2  # s simulated between calls of `progress`, which cost nothing


@dataclass(frozen=True)
class Collisions:
    """Numbers of events in a simulation, warm-up included.

    walls: hits on surfaces that do not vibrate.
    balls: collisions of two balls.
    sonotrode: hits on vibrating faces.
    searches: searches for the surface that a ball meets next.
    stale: predicted meetings that were dropped because the other ball's path had changed.
    """

    walls: int
    balls: int
    sonotrode: int
    searches: int
    stale: int

    @property
    def total(self) -> int:
        """Number of hits on walls and sonotrode and of collisions of two balls."""
        return self.walls + self.balls + self.sonotrode


@dataclass(frozen=True)
class SimulationResult:
    """The logged impacts and collisions of a simulation, and the balls at its end.

    impacts: impacts on the recorded surfaces.
    balls: the balls at the end.
    collisions: numbers of hits, collisions and other events.
    resting: the balls that lie still at the end.
    trapped: the balls that hopped on one spot or sat in a gap for some of the recorded time.
    frames: the balls at the requested times.
    ball_collisions: collisions of balls with one another; None unless Scene.record_collisions is
        True.
    time: end of the simulation [s], on the clock of Scene.start_time.
    """

    impacts: ImpactLog
    balls: Balls
    collisions: Collisions
    resting: Resting
    trapped: Trapped
    frames: Frames
    ball_collisions: CollisionLog | None
    time: float


def simulate(
    scene: Scene,
    frames: Sequence[float] | np.ndarray = (),
    progress: Callable[[float], None] = lambda seconds: None,
    held: Callable[[np.ndarray], None] = lambda places: None,
) -> SimulationResult:
    """Simulate the scene from its start to the end of its duration.

    The GIL is released meanwhile. The same scene gives the same bits on any thread. The module
    docstring of sim_core has an example.

    Args:
        frames: ascending times [s since the end of the warm-up], (f,), at which the balls are
            noted, each on its flight at that very time. Noting changes no bit of the other results.
        progress: called at least every TELL_EVERY simulated seconds with the time since the start,
            including the warm-up [s].
        held: called before each call of `progress` with the places of the balls that are held in
            gaps then [m], (k, 3).

    Raises:
        SimulationError: if a ball is lost, jams, or stops being a number.
    """
    times = _checked_frames(frames, scene)
    run = Simulation(scene, progress, held)
    run.play(scene.warmup, record=False)
    begin_anew(run.state.stays, scene.warmup)
    end = scene.warmup + scene.duration
    noted = run.play(end, record=True, frames=scene.warmup + times)
    balls, state = run.balls(), run.state
    still = resting(state.contact, state.obstacles, balls.positions, run.centre, scene.warmup)
    return SimulationResult(
        impacts=joined(run.logs, scene.mesh),
        balls=balls,
        collisions=Collisions(*(int(n) for n in state.counts)),
        resting=still,
        trapped=trapped(state.stays, run.centre),
        frames=frames_of(times, noted, balls),
        ball_collisions=joined(run.meetings, scene.mesh) if run.meetings else None,
        time=scene.start_time + end,
    )


def _checked_frames(frames: Sequence[float] | np.ndarray, scene: Scene) -> np.ndarray:
    """Return the times of frames [s] as an array (f,).

    Raises SceneError unless they ascend within the scene's duration.
    """
    times = np.array(frames, dtype=float).reshape(-1)
    if not np.isfinite(times).all() or (np.diff(scene.warmup + times) <= 0.0).any():
        raise SceneError("frames: not ascending times; give each once, in order")
    if len(times) and not 0.0 <= times[0] <= times[-1] <= scene.duration:
        raise SceneError(
            f"frames: from {times[0]:g} to {times[-1]:g} s; "
            f"allowed: 0 to the duration, {scene.duration:g} s"
        )
    return times


_obstacle_set = computed_once(8)(build_obstacle_set)  # replicas of one chamber share the set


class Simulation:
    """A scene being simulated: the state that the event loop works on, and the logs so far."""

    def __init__(
        self,
        scene: Scene,
        progress: Callable[[float], None] = lambda seconds: None,
        held: Callable[[np.ndarray], None] = lambda places: None,
    ) -> None:
        self.scene, self.progress, self.held = scene, progress, held
        self.centre = scene.mesh.middle
        self.logs: list[ImpactLog] = []
        self.meetings: list[CollisionLog] = []
        self.state = self._new_state()

    def _new_state(self) -> SimulationState:
        scene, physics, balls = self.scene, self.scene.physics_at_start, self.scene.balls
        gravity = checked_gravity(physics.gravity)
        vibrations, waves = physics.vibrations, checked_waves(physics.vibration)
        wave = min(waves, key=lambda one: one.omega, default=None)
        tags = int(scene.mesh.tags.max()) + 1
        law = physics.restitution
        restitution = None if law is None else checked_restitution(law, tags)
        window = clock_window(vibrations, WINDOW)
        vibrating_tags = tuple(one.tag for one in vibrations)
        amplitudes = tuple(float(one.amplitude) for one in vibrations)
        vibrating = scene.mesh.corners[np.isin(scene.mesh.tags, vibrating_tags)] - self.centre
        random_phase = checked_random_phase(physics.random_phase, len(vibrations))
        if random_phase is not None:  # each ball's own phase is to hold in the next window too
            window = max(window, 1.0 / vibrations[0].frequency)
        radii = tuple(float(r) for r in 0.5 * balls.sizes)
        axle = checked_axis(physics.part_rotation)
        obstacles = _obstacle_set(scene.mesh, radii, vibrating_tags, amplitudes, axle)
        obstacle_tags = np.asarray(obstacles.tags[obstacles.tree.triangles[:, 0]])
        collide = physics.ball_collisions is not None
        motion = np.concatenate([balls.positions - self.centre, balls.velocities], axis=1)
        friction_state = self._friction_state(tags, obstacle_tags)
        overlaps = np.array([face_overlap_of(radius) for radius in radii])
        roots = obstacles.roots
        part_roots = roots if obstacles.part is None else obstacles.part.roots
        sizes = new_ball_sizes(balls, roots, part_roots, overlaps)
        contact = new_contact_state(
            checked_rest(physics.rest),
            len(motion),
            balls.radius,
            2.0 * balls.radius if collide else 0.0,
            gravity,
            restitution,
            friction_state,
        )
        sonotrodes = new_waves(vibrations, waves, window, obstacle_tags)
        if contact is not None:
            ride = new_ride(physics.rest, len(motion), wave, sonotrodes)
            contact = contact._replace(ride=ride, sizes=sizes)
        state = SimulationState(
            motion=motion,
            neighbours=None,
            obstacles=obstacles,
            queue=new_event_queue(len(motion), collide),
            scratch=new_scratch(),
            gravity=gravity,
            restitution=restitution,
            wave=wave,
            rotation=new_rotation_state(physics.part_rotation, self.centre),
            clock=Clock(np.zeros(2), window, 0.0, scene.warmup),
            buffer=new_impact_buffer(np.zeros(MAX_TAGS, dtype=np.bool_), scene.record_held),
            stays=new_stays(len(motion), balls.radius, gravity, waves),
            counts=np.zeros(5, dtype=np.int64),
            profiler=None,
            contact=contact,
            friction_state=friction_state,
            surface_effects=physics.surface,
            random_phase=new_random_phase_state(
                random_phase, wave, vibrating, 0.5 * balls.diameters
            ),
            roughness=new_roughness_state(checked_roughness(physics.roughness, tags), len(motion)),
            flexure=new_flexure_state(
                checked_flexure(physics.flexure, len(scene.mesh.tags)), balls, scene.mesh.tags
            ),
            drag=new_drag_state(checked_drag(physics.drag), balls.diameters, balls.densities),
            sizes=sizes,
            waves=sonotrodes,
            profiles=new_face_profiles(vibrations, obstacle_tags, self.centre),
            collision_buffer=new_collision_buffer(scene.record_collisions),
            sides=new_periodic_sides(periods_of(scene.mesh)),
        )
        max_speed = 2.0 * max(1.0, float(np.abs(balls.velocities).max()))
        return state._replace(neighbours=self._new_filter(state, max_speed))

    def _friction_state(self, tags: int, obstacle_tags: np.ndarray) -> FrictionState | None:
        friction, balls = self.scene.physics.friction, self.scene.balls
        if friction is None:
            return None
        spins = np.zeros_like(balls.positions) if balls.spins is None else balls.spins
        return new_friction_state(
            checked_friction(friction, tags), spins, balls.radius, obstacle_tags
        )

    def _new_filter(self, state: SimulationState, max_speed: float) -> NeighbourFilter | None:
        if self.scene.physics.ball_collisions is None:
            return None
        low, high = self.scene.mesh.bounds - self.centre
        balls, window = self.scene.balls, state.clock.window
        radii = None if balls.alike else 0.5 * balls.diameters
        reach, sides = 2.0 * balls.radius, state.sides
        neighbours = new_neighbour_filter(
            state.motion, low, high, reach, max_speed, window, radii, sides
        )
        hide_all(state.contact, neighbours)
        return neighbours

    @property
    def time(self) -> float:
        """Time since the start [s]."""
        clock = self.state.clock
        return float(clock.now[0] + clock.now[1] * clock.window)

    def play(
        self, until: float, record: bool, frames: Sequence[float] | np.ndarray = ()
    ) -> list[Balls]:
        """Simulate until a time [s since the start].

        Check at least every CHECK_EVERY seconds that balls are inside. ``record``: True to log.

        Returns: the balls at each of the times ``frames`` [s since the start].
        """
        recorded, buffers = self.scene.record, (self.state.buffer, self.state.collision_buffer)
        buffers[0].record[:] = record and recorded is None
        if record and recorded is not None:
            buffers[0].record[list(recorded)] = True
        if buffers[1] is not None:
            buffers[1].record[:] = record
        start = self.time

        def regular(every: float) -> set[float]:
            """Return the times up to `until` that are at most so many seconds apart."""
            steps = max(1, math.ceil((until - start) / every))
            return {*np.linspace(start, until, 1 + steps)[1:].tolist()}

        checks, tells = regular(CHECK_EVERY), regular(TELL_EVERY)
        requested, noted = set(frames), []
        for stop in sorted({*checks, *tells, *frames}):
            self.advance_to(float(stop))
            if stop in requested:
                noted.append(self.balls())
            if stop in checks:
                self._require_sound()
            if stop in tells:
                self.held(held_now(self.state.stays, self.centre))
                self.progress(self.time)
        self._empty_buffers()
        return noted

    def _empty_buffers(self) -> None:
        self.logs.append(empty_buffer(self.state.buffer, ImpactLog))
        if self.state.collision_buffer is not None:
            self.meetings.append(empty_buffer(self.state.collision_buffer, CollisionLog))

    def advance_to(self, stop: float) -> None:
        """Run the event loop until ``stop`` [s since the start]. Handle each reason for a pause."""
        self.state = self.state._replace(clock=self.state.clock._replace(stop=stop))
        while True:
            status, ball = advance(self.state)
            if status == DONE:
                return
            if status == BUFFER_FULL:
                self._empty_buffers()
            elif status == TOO_FAST:
                fast = self.state.motion[ball if ball >= 0 else slice(None), 3:]
                speed = float(np.abs(fast).max())
                if not math.isfinite(speed):
                    raise SimulationError(
                        f"ball {ball}: its velocity is not a number any more; {self._when()}"
                    )
                top = float(np.linalg.norm(fast, axis=-1).max())
                if top > MAX_SPEED:
                    raise SimulationError(
                        f"a ball has {top:.2g} m/s, {self._when()}: no shot is faster than "
                        f"{MAX_SPEED:g} m/s. Look at amplitude and frequency of the vibration, or "
                        "for a gap in which an elastic ball gains speed at each hit"
                    )
                neighbours = self._new_filter(self.state, min(4.0 * speed, MAX_SPEED))
                self.state = self.state._replace(neighbours=neighbours)
            elif status == TOO_MANY_EVENTS:
                positions, one_side = self.balls().positions, is_on_one_side(self.state.stays, ball)
                how = self._corners(), positions, ball, one_side, self._when()
                raise SimulationError(jam_message(self.scene, *how))
            elif status == HAS_LEFT:
                raise self._left(ball)

    def _when(self) -> str:
        return f"{self.time:.6f} s after the start"

    def _left(self, ball: int) -> SimulationError:
        where = np.round(self._positions_and_velocities()[0][ball], 6).tolist()
        return SimulationError(
            f"ball {ball} has left the mesh: it is at {where} m, {self._when()}. Look for surfaces "
            "that overlap or cross near there; if there are none, please report the scene"
        )

    def _positions_and_velocities(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the present positions [m] and velocities [m/s] of all balls, (n, 3) each."""
        state, now = self.state, self.state.clock.now[0]
        acceleration = np.array(gravity_acceleration(state.gravity))
        if state.contact is not None:
            acceleration = state.contact.acceleration
        base, velocities = state.motion[:, :3], state.motion[:, 3:]
        velocities_now = velocities + now * acceleration
        apply_drag_to_all(state.drag, state.contact, velocities_now, now)
        positions = base + velocities * now + 0.5 * now * now * acceleration + self.centre
        if isinstance(self.scene.mesh, AnalyticCavity):
            positions = self.scene.mesh.put_back(positions)
        return positions, velocities_now

    def _require_sound(self) -> None:
        points, _ = self._positions_and_velocities()
        bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
        if len(bad):
            raise SimulationError(
                f"ball {bad[0]}: its position is not a number any more; {self._when()}"
            )
        outside = np.flatnonzero(~self._inside(points))
        if len(outside):
            raise self._left(int(outside[0]))
        if self.state.neighbours is None:
            return
        gap, one, two = narrowest_gap(self.balls(), self.scene.mesh)
        if gap < -TOUCH:
            raise SimulationError(
                f"balls {one} and {two} overlap by {-gap:.3g} m, {self._when()}; "
                "please report the scene"
            )

    def _inside(self, points: np.ndarray) -> np.ndarray:
        """Return True for each ball centre (n, 3) [m] that is in the chamber, (n,) bool."""
        mesh, corners, vibrations = self.scene.mesh, self._corners(), self.scene.physics.vibrations
        if isinstance(mesh, AnalyticCavity):
            return mesh.contains(points, max((one.amplitude for one in vibrations), default=0.0))
        inside, radii = contained(mesh, points, corners), 0.5 * self.scene.balls.diameters
        out = np.flatnonzero(~inside)
        inside[out] = beneath_mean_plane(mesh, vibrations, points[out], radii[out], corners)
        return inside

    def _corners(self) -> np.ndarray | None:
        """Return the present corners of all triangles [m], or None if no triangle turns."""
        part_rotation, mesh = self.scene.physics.part_rotation, self.scene.mesh
        state = self.state
        if part_rotation is None or state.rotation is None or isinstance(mesh, AnalyticCavity):
            return None
        angle = angle_at(state.rotation, float(state.clock.now[0]))
        return turned_corners(mesh, part_rotation, angle)

    def balls(self) -> Balls:
        """Return the balls in their present state."""
        friction_state, spins = self.state.friction_state, None
        if friction_state is not None:
            spins = friction_state.spins + self.state.clock.now[0] * friction_state.twists
        diameter, density = self.scene.balls.diameter, self.scene.balls.density
        return Balls(*self._positions_and_velocities(), diameter, density, spins)

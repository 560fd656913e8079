"""Complete input of a simulation, checked once."""

from dataclasses import dataclass

import numpy as np

from sim_core.balls import Balls
from sim_core.effects.amplitude_profile import shares_at
from sim_core.effects.contact_mode import Rest, checked_rest
from sim_core.effects.drag import Drag, checked_drag
from sim_core.effects.flexure import Flexure, checked_flexure
from sim_core.effects.friction import Friction, checked_friction
from sim_core.effects.gravity import checked_gravity
from sim_core.effects.part_rotation import PartRotation, checked_axis
from sim_core.effects.random_phase import RandomPhase, checked_random_phase
from sim_core.effects.restitution import Restitution, checked_restitution
from sim_core.effects.roughness import Roughness, checked_roughness
from sim_core.effects.vibration import checked_waves
from sim_core.errors import SceneError
from sim_core.geometry.analytic import AnalyticCavity
from sim_core.geometry.mesh import TriangleMesh, connected_components, normals_towards_shot
from sim_core.geometry.turning_part import require_free_axis
from sim_core.numerics.computed_once import computed_once
from sim_core.scene.analytic_scene import require_clear, require_supported
from sim_core.scene.bent_faces import require_profiles
from sim_core.scene.invariants import (
    TurnedSurface,
    beneath_mean_plane,
    clearance,
    contained,
    narrowest_gap,
    triangles_near,
    turned_corners,
)
from sim_core.scene.narrow_gaps import (
    NearSurface,
    find_narrow_gap,
    largest_approach,
    surface_name,
    vibrating_name,
)
from sim_core.scene.physics import BallCollisions, Physics

MAX_DURATION = 1e6  # s: eleven days of peening
STEP = 1e-4  # share of a triangle's size: distance to the tested points on both its sides
# m: overlap at the start that counts as rounding of the input; ten thousand times less than a dent
TOUCH = 1e-9

# Effects whose type is checked. Gravity may be any three numbers.
EFFECT_TYPES = {
    "restitution": Restitution,
    "rest": Rest,
    "part_rotation": PartRotation,
    "random_phase": RandomPhase,
    "ball_collisions": BallCollisions,
    "drag": Drag,
    "friction": Friction,
    "roughness": Roughness,
    "flexure": Flexure,
}


@dataclass(frozen=True)
class Scene:
    """Complete input of a simulation: a cavity, balls inside it, the effects and the duration.

    Args:
        mesh: a closed mesh or an analytical cavity.
        balls: the shot at the start.
        physics: the effects.
        duration: duration of the recorded simulation [s].
        warmup: duration of the simulation before recording starts [s].
        record: tags of the surfaces whose impacts are logged; None means all.
        record_collisions: True to log collisions of balls with one another too.
        record_held: False to leave impacts of balls that rattle in a gap out of the log.
        start_time: time of the scene's start [s] on the clock of the vibrations and the turning
            part. Their phases are given at time 0 of this clock. A scene that goes on with the
            balls of an earlier result has that result's ``time``.

    Raises:
        SceneError: naming the ball, triangle or field, for
            a ball outside the mesh, overlapping a surface or another ball, or in a gap narrower
                than itself,
            a body in the mesh that is inside out,
            a tag without restitution, or a vibrating or turning tag that the mesh lacks,
            a part that cannot turn,
            numbers out of range,
            an analytical cavity with a turning part, contact mode in a periodic box, or gravity
                across a cylinder.
    """

    mesh: TriangleMesh | AnalyticCavity
    balls: Balls
    physics: Physics
    duration: float
    warmup: float = 0.0
    record: tuple[int, ...] | None = None
    record_collisions: bool = False
    record_held: bool = True
    start_time: float = 0.0

    def __post_init__(self) -> None:
        for name in ("duration", "warmup", "start_time"):
            value = getattr(self, name)
            if not isinstance(value, (int, float, np.number)) or not 0.0 <= value <= MAX_DURATION:
                raise SceneError(
                    f"scene.{name} is {value!r}: give seconds from 0 to {MAX_DURATION:g}"
                )
        if self.duration == 0.0:
            raise SceneError("scene.duration is 0 s: it must be positive")
        if self.record is not None and not all(tag in self.mesh.tags for tag in self.record):
            tags = np.unique(self.mesh.tags).tolist()
            raise SceneError(f"scene.record is {self.record}, but the mesh has tags {tags}")
        for name in ("record_collisions", "record_held"):
            if getattr(self, name) not in (True, False):
                raise SceneError(f"scene.{name} is {getattr(self, name)!r}: give True or False")
        self._require_physics()
        self._require_room()

    @property
    def physics_at_start(self) -> Physics:
        """The effects with the phases that they have at the scene's start."""
        return self.physics.begun_at(self.start_time)

    def _require_physics(self) -> None:
        for name, effect in self.physics._asdict().items():
            kind = EFFECT_TYPES.get(name)
            if kind is not None and effect is not None and not isinstance(effect, kind):
                raise SceneError(f"physics.{name} is {effect!r}: give a {kind.__name__}, or None")
        checked_waves(self.physics.vibration)
        vibrations, turn = self.physics.vibrations, self.physics.part_rotation
        checked_gravity(self.physics.gravity)
        rest = checked_rest(self.physics.rest)
        for name in ("friction", "random_phase", "part_rotation", "drag"):
            if rest is not None and rest.on_vibrating and getattr(self.physics, name) is not None:
                raise SceneError(
                    f"rest.on_vibrating is True, and physics.{name} is given: not supported "
                    f"together yet; leave one of them out"
                )
        if rest is not None and rest.on_vibrating and any(one.profile for one in vibrations):
            raise SceneError(
                "rest.on_vibrating is True, and a vibration has a profile: not supported together "
                "yet; leave one of them out"
            )
        tag_count = int(self.mesh.tags.max()) + 1
        if self.physics.restitution is not None:
            checked_restitution(self.physics.restitution, tag_count)
        if self.physics.friction is not None:
            checked_friction(self.physics.friction, tag_count)
        elif self.balls.spins is not None:
            raise SceneError(
                "balls.spins are given without physics.friction, where spins have no effect: "
                "give a Friction, or no spins"
            )
        checked_roughness(self.physics.roughness, tag_count)
        checked_flexure(self.physics.flexure, len(self.mesh.tags))
        if self.physics.flexure is not None and self.physics.restitution is None:
            raise SceneError(
                "physics.flexure is given without physics.restitution, which it lowers: give a "
                "Restitution too"
            )
        checked_drag(self.physics.drag)
        random_phase = checked_random_phase(self.physics.random_phase, len(vibrations))
        if random_phase is not None and self.start_time > 0.0:
            raise SceneError(
                f"scene.start_time is {self.start_time} s, and physics.random_phase is given: "
                "which phase each ball has found is not known any more; leave one of them out"
            )
        if self.record_collisions and self.physics.ball_collisions is None:
            raise SceneError(
                "scene.record_collisions is True, but physics.ball_collisions is None: balls do "
                "not meet; leave one of them out"
            )
        axis = checked_axis(turn)
        tags = np.unique(self.mesh.tags).tolist()
        if turn is not None and axis is not None and isinstance(self.mesh, TriangleMesh):
            for name, tag in [("tag", turn.tag), *(("with_part", one) for one in turn.with_part)]:
                if tag not in tags:
                    raise SceneError(f"part_rotation.{name}: {tag}, but the mesh has tags {tags}")
                if tag in [one.tag for one in vibrations]:
                    raise SceneError(
                        f"part_rotation.{name} and vibration.tag are both {tag}: "
                        "one surface cannot do both"
                    )
            require_free_axis(self.mesh, axis, 0.5 * float(self.balls.sizes[0]))
        for one in vibrations:
            if one.tag not in tags:
                raise SceneError(f"vibration.tag is {one.tag}, but the mesh has tags {tags}")
        require_profiles(self.mesh, vibrations)
        if isinstance(self.mesh, AnalyticCavity):
            require_supported(self.mesh, self.physics)

    def _require_room(self) -> None:
        if isinstance(self.mesh, AnalyticCavity):
            require_clear(self.mesh, self.balls, self.physics_at_start.vibrations, TOUCH)
        else:
            self._require_room_in_mesh()
        if self.physics.ball_collisions is None:
            return
        gap_between, one, two = narrowest_gap(self.balls, self.mesh)
        if gap_between < -TOUCH:
            raise SceneError(
                f"balls {one} and {two} overlap by {-gap_between:.3g} m at the start; "
                "move one of them"
            )

    def _require_room_in_mesh(self) -> None:
        assert isinstance(self.mesh, TriangleMesh)
        balls = self.balls
        wrong = _inside_out(self.mesh)
        if wrong >= 0:
            raise SceneError(
                f"mesh triangle {wrong} belongs to a body that is inside out: the cavity is behind "
                "it; reverse every triangle of that body so that normals point away from the shot"
            )
        turn = self.physics_at_start.part_rotation
        turned = None if turn is None else TurnedSurface(self.mesh, turned_corners(self.mesh, turn))
        corners = None if turned is None else turned.corners
        places = balls.positions
        inside = contained(self.mesh, places) if turned is None else turned.encloses(places)
        outside = np.flatnonzero(~inside)
        vibrations, radii = self.physics.vibrations, 0.5 * balls.diameters[outside]
        points = balls.positions[outside]
        outside = outside[~beneath_mean_plane(self.mesh, vibrations, points, radii, corners)]
        if len(outside):
            where = balls.positions[outside[0]].tolist()
            raise SceneError(
                f"ball {outside[0]} at {where} m is outside the mesh ({len(outside)} in all)"
            )
        # a turning part is at its phase; vibrating faces are checked at theirs below
        near = self._near(turned)
        still = ~np.isin(near.tags, [one.tag for one in self.physics.vibrations])
        gap = clearance(near.corners[still], balls.positions, balls.radius) - 0.5 * balls.diameters
        worst = int(gap.argmin())
        if gap[worst] < -TOUCH:
            raise SceneError(
                f"ball {worst} at {balls.positions[worst].tolist()} m overlaps a surface by "
                f"{-gap[worst]:.3g} m; move it or make it smaller"
            )
        self._require_room_above_sonotrode(near)
        self._require_room_between(near)

    def _near(self, turned: TurnedSurface | None) -> NearSurface:
        """Return the triangles that may touch balls or come near balls, at their rest positions.

        Args:
            turned: the surface with a turning part at its angle, if there is one.
        """
        assert isinstance(self.mesh, TriangleMesh)
        places, reach = self.balls.positions, self.balls.radius + largest_approach(self.physics)
        if turned is None:
            number, corners = triangles_near(self.mesh, places, reach), self.mesh.corners
        else:
            number, corners = turned.near(places, reach), turned.corners
        return NearSurface(number, self.mesh.tags[number], corners[number])

    def _require_room_above_sonotrode(self, near: NearSurface) -> None:
        """Raise SceneError for a ball that overlaps a vibrating surface, displaced by its phase.

        The corners of vibrating triangles in ``near`` are displaced, and stay so after the call.
        """
        balls = self.balls
        for vibration in self.physics_at_start.vibrations:
            vibrating = near.tags == vibration.tag
            swing = np.sin(vibration.phase) * vibration.peak
            near.corners[vibrating] += swing
            # where a bent face moves less, the ball is further from the face by the rest
            less = 1.0 - shares_at(vibration, balls.positions)
            positions = balls.positions + less[:, None] * swing
            gap = clearance(near.corners[vibrating], positions, balls.radius)
            gap -= 0.5 * balls.diameters
            worst = int(gap.argmin())
            if gap[worst] < -TOUCH:
                raise SceneError(
                    f"ball {worst} at {balls.positions[worst].tolist()} m starts "
                    f"{-gap[worst]:.3g} m inside {vibrating_name(self.physics, vibration.tag)}, "
                    "which is displaced by its phase at the start; keep one amplitude clear of it"
                )

    def _require_room_between(self, near: NearSurface) -> None:
        assert isinstance(self.mesh, TriangleMesh)
        gap = find_narrow_gap(near, self.physics_at_start, self.balls)
        if gap is None:
            return
        one, two = (surface_name(self.mesh, self.physics, side) for side in (gap.one, gap.two))
        when = " at the end of its swing" if gap.vibrates else ""
        raise SceneError(
            f"ball {gap.ball} at {self.balls.positions[gap.ball].tolist()} m does not fit between "
            f"{one} and {two}: the gap is narrower than the ball by {gap.narrower:.3g} m{when}; "
            "widen it, start the ball elsewhere, or make it smaller"
        )


def require_free_rotation(mesh: TriangleMesh, turn: PartRotation, diameter: float) -> None:
    """Raise SceneError if a part cannot turn in its chamber, with balls of this diameter [m].

    With balls of several sizes the smallest diameter decides. This is the part of a Scene's check
    that needs no balls. It covers numbers out of range too.
    """
    axis = checked_axis(turn)
    assert axis is not None
    require_free_axis(mesh, axis, 0.5 * diameter)


@computed_once(32)  # replicas of one chamber share the answer
def _inside_out(mesh: TriangleMesh) -> int:
    """Return a triangle whose closed shell is wound the wrong way round; -1 if there is none.

    The mesh as a whole encloses a positive volume for either winding of a small body in it. A shell
    is tested at its largest triangle, and is wrong only if the cavity is behind that triangle and
    not in front of it.
    """
    edges = np.concatenate([mesh.triangles[:, :2], mesh.triangles[:, 1:]])
    shell = connected_components(edges, len(mesh.vertices))[mesh.triangles[:, 0]]
    normals, doubled = normals_towards_shot(mesh.corners)
    order = np.lexsort((-doubled, shell))  # the largest of each shell first
    largest = order[np.unique(shell[order], return_index=True)[1]]
    if len(largest) == 1:
        return -1
    middle = mesh.corners[largest].mean(axis=1)
    step = STEP * np.sqrt(doubled[largest])[:, None] * normals[largest]
    wrong = largest[~contained(mesh, middle + step) & contained(mesh, middle - step)]
    return int(wrong[0]) if len(wrong) else -1

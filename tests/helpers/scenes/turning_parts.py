"""Turning parts for the tests, and a ball's gap to one by other means than the code under test."""

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from sim_core import Gravity, PartRotation, TriangleMesh
from sim_core.detect.ball_mesh import Scratch, new_scratch
from sim_core.detect.ball_turning_part import first_part_contact
from sim_core.effects.gravity import gravity_acceleration
from sim_core.effects.part_rotation import RotationState, checked_axis, new_rotation_state
from sim_core.geometry.obstacle_set import ObstacleSet, build_obstacle_set
from sim_core.geometry.turning_part import PartTree
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Flight, Vec3
from sim_core.scene.invariants import clearance, contained
from tests.helpers.scenes.cavities import CEILING, box_around

PART = CEILING  # the tag that box_around gives its body
FAR = 1e-3  # m; how much more than this a ball is away from a part is not measured


def bar(length: float = 0.02, width: float = 0.004, height: float = 0.01) -> trimesh.Trimesh:
    """A bar [m] about the origin, its length along x."""
    return trimesh.creation.box((length, width, height))


def star(teeth: int, tip: float, root: float, height: float) -> trimesh.Trimesh:
    """A prism about the z axis whose outline goes to and fro between two radii [m]: pointed teeth,
    open gaps.
    """
    angle = np.pi * np.arange(2 * teeth) / teeth
    radius = np.where(np.arange(2 * teeth) % 2 == 0, tip, root)
    rim = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    count = len(rim)
    low = np.column_stack([rim, np.full(count, -0.5 * height)])
    high = np.column_stack([rim, np.full(count, 0.5 * height)])
    middle = np.array([[0.0, 0.0, -0.5 * height], [0.0, 0.0, 0.5 * height]])
    here, there = np.arange(count), (np.arange(count) + 1) % count
    faces = [
        np.column_stack([here, there, count + there]),
        np.column_stack([here, count + there, count + here]),
        np.column_stack([there, here, np.full(count, 2 * count)]),
        np.column_stack([count + here, count + there, np.full(count, 2 * count + 1)]),
    ]
    return trimesh.Trimesh(
        np.concatenate([low, high, middle]), np.concatenate(faces), process=False
    )


BODIES = {
    "bar": bar(),
    "needle": trimesh.creation.box((0.024, 2e-4, 2e-4)),
    "star": star(7, 0.012, 0.006, 0.008),
    "ball": trimesh.creation.icosphere(2, 0.008),
    "wedge": trimesh.Trimesh(
        np.array(
            [
                [0.012, 0, -0.004],
                [-0.006, 0.003, -0.004],
                [-0.006, -0.008, -0.004],
                [0.001, 0, 0.007],
            ]
        ),
        [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
    ),
}


@jit
def _search(  # type: ignore[no-untyped-def]
    part: PartTree,
    rotation: RotationState,
    scratch: Scratch,
    position: Vec3,
    velocity: Vec3,
    gravity,
    face_overlap,
    time,
    limit,
):
    ball = Flight(position, velocity, gravity_acceleration(gravity))
    return first_part_contact(
        part, rotation, None, 0, scratch, ball, face_overlap, time, limit, -1, 0
    )


class Rotor:
    """A part that turns in an empty cube, ready to be asked for contacts."""

    def __init__(
        self, body: trimesh.Trimesh, turn: PartRotation, diameter: float = 3e-3, half: float = 0.04
    ) -> None:
        self.turn = turn
        self.radius = 0.5 * diameter
        self.mesh: TriangleMesh = box_around(body, half)
        self.obstacles: ObstacleSet = build_obstacle_set(
            self.mesh, (self.radius,), axis=checked_axis(turn)
        )
        self.own = np.ascontiguousarray(self.mesh.corners[self.mesh.tags == turn.tag])
        rotation = new_rotation_state(turn, self.mesh.middle)
        assert rotation is not None
        self.rotation = rotation
        self.scratch = new_scratch()

    def search(
        self,
        position: np.ndarray,
        velocity: np.ndarray,
        gravity: Gravity | None,
        time: float,
        limit: float,
    ) -> tuple[float, int]:
        """The answer of the code under test: delay [s] and obstacle, -1 if there is none within
        ``limit`` [s].
        """
        place, speed = Vec3(*map(float, position)), Vec3(*map(float, velocity))
        part, overlap = self.obstacles.part, self.obstacles.face_overlap
        delay, row = _search(
            part, self.rotation, self.scratch, place, speed, gravity, overlap, time, limit
        )
        return float(delay), int(row)

    def angle(self, time: np.ndarray) -> np.ndarray:
        """The part's angle [rad] at times [s], by the definition of PartRotation."""
        turn = self.turn
        if turn.rpm is not None:
            return np.asarray(2.0 * np.pi * turn.rpm / 60.0 * time + turn.phase)
        assert turn.amplitude is not None
        assert turn.frequency is not None
        return np.asarray(turn.amplitude * np.sin(2.0 * np.pi * turn.frequency * time + turn.phase))

    def seen(self, points: np.ndarray, time: np.ndarray) -> np.ndarray:
        """Points (n, 3) of the room at times (n,), in the part's frame."""
        axis = np.array(self.turn.axis) / np.linalg.norm(self.turn.axis)
        back = Rotation.from_rotvec(-self.angle(np.asarray(time))[:, None] * axis)
        return np.asarray(back.apply(points - self.turn.axis_point) + self.turn.axis_point)

    def clear(self, position: np.ndarray, time: float) -> bool:
        """True when a ball fits there, outside the part."""
        frame = self.seen(position[None], np.array([time]))
        room = contained(self.mesh, frame)[0] and np.abs(frame).max() < 0.03
        return bool(room and clearance(self.own, frame, 0.2)[0] > self.radius + 1e-9)

    def gap(
        self,
        position: np.ndarray,
        velocity: np.ndarray,
        gravity: Gravity | None,
        time: float,
        delay: np.ndarray,
    ) -> np.ndarray:
        """Distance (n,) [m] between ball and part after delays (n,) [s], capped at FAR."""
        points = flight(position, velocity, gravity, delay)
        frame = self.seen(points, time + delay)
        return clearance(self.own, frame, self.radius + FAR) - self.radius


def flight(
    position: np.ndarray, velocity: np.ndarray, gravity: Gravity | None, delay: np.ndarray
) -> np.ndarray:
    """Where a ball is (n, 3) [m] after delays (n,) [s]."""
    fall = np.zeros(3) if gravity is None else np.array(gravity)
    return np.asarray(position + delay[:, None] * velocity + 0.5 * delay[:, None] ** 2 * fall)

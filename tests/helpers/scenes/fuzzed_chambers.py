"""Random watertight chambers, from the plain to the nasty, with balls and effects that keep the
balls moving.

Every family is made about one unit wide; then it is turned at random, made 1 mm to 1 m wide, and
every other one is put a kilometre from the origin.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import trimesh
from manifold3d import CrossSection, Manifold, Mesh64
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from sim_core import (
    Balls,
    Gravity,
    Physics,
    Restitution,
    SceneError,
    TriangleMesh,
    Vibration,
    largest_amplitude,
    pack_balls,
)
from sim_core.geometry.obstacle_set import build_obstacle_set
from tests.helpers.scenes.cavities import CEILING, FLOOR

SPEED = 3.0  # m/s: of the shot at the start a component, and of the sonotrode at its peak
FAR = 1e3  # m from the origin


class Chamber(NamedTuple):
    """What a Scene wants, but for its duration."""

    mesh: TriangleMesh
    balls: Balls
    physics: Physics


Surface = tuple[np.ndarray, np.ndarray]  # vertices (n, 3), triangles (m, 3)


def random_chamber(family: str, seed: int, widest_swing: float = 0.0) -> Chamber:
    """The same arguments make the same chamber.

    Args:
        widest_swing: if positive, the floor vibrates by up to so many radii of the balls, or as
            far as the walls beside it allow.
    """
    rng = np.random.default_rng([seed, *family.encode()])
    wide = 10.0 ** rng.uniform(-3.0, 0.0)
    diameter = rng.uniform(0.03, 0.12)  # of the width
    vertices, triangles = FAMILIES[family](diameter, rng)
    level = (vertices[triangles][:, :, 2] == vertices[:, 2].min()).all(axis=1)
    turn = Rotation.random(random_state=int(rng.integers(1 << 31)))
    away = FAR * rng.normal(size=3) if rng.random() < 0.5 else np.zeros(3)
    mesh = TriangleMesh(
        turn.apply(wide * vertices) + away, triangles, np.where(level, FLOOR, CEILING)
    )
    radius = 0.5 * wide * diameter
    if widest_swing:
        return with_swing(mesh, turn, wide, radius, widest_swing, rng)
    physics = random_physics(family in WITH_FLOOR, turn, wide, wide * diameter, rng)
    if physics.vibration is not None and has_moving_edge(mesh, radius, physics.vibration):
        physics = random_physics(False, turn, wide, wide * diameter, rng)
    return Chamber(mesh, random_balls(mesh, wide * diameter, physics, rng), physics)


def with_swing(
    mesh: TriangleMesh,
    turn: Rotation,
    wide: float,
    radius: float,
    widest: float,
    rng: np.random.Generator,
) -> Chamber:
    """The mesh with a floor that swings by up to ``widest`` radii, or as far as there is room."""
    swing = rng.uniform(0.0, widest) * radius
    swing = min(swing, (1.0 - 1e-9) * largest_amplitude(mesh, FLOOR, radius)[0])
    while True:
        physics = vibrating(turn, wide, rng.uniform(0.05, 0.5), 0.0, rng, swing)
        if has_moving_edge(mesh, radius, physics.vibrations[0]):
            physics = random_physics(False, turn, wide, 2.0 * radius, rng)
        try:
            return Chamber(mesh, random_balls(mesh, 2.0 * radius, physics, rng), physics)
        except SceneError:  # no ball is clear of all surfaces by as much
            swing *= 0.5


def has_moving_edge(mesh: TriangleMesh, radius: float, vibration: Vibration) -> bool:
    """True when something cuts into the floor so that it cannot vibrate: not supported, and said
    so.
    """
    try:
        build_obstacle_set(mesh, (radius,), (vibration.tag,), (vibration.amplitude,))
    except SceneError:
        return True
    return False


def random_physics(
    with_floor: bool, turn: Rotation, wide: float, diameter: float, rng: np.random.Generator
) -> Physics:
    """Elastic with or without gravity, or with losses that a vibrating floor makes up for."""
    pull = rng.uniform(0.05, 0.5)
    if with_floor and rng.random() < 0.5:
        return vibrating(turn, wide, pull, diameter, rng)
    down = SPEED**2 / wide * pull
    return Physics(
        Gravity(*(down * turn.apply([0.0, 0.6, -0.8])).tolist()) if rng.random() < 0.5 else None
    )


def vibrating(
    turn: Rotation,
    wide: float,
    pull: float,
    diameter: float,
    rng: np.random.Generator,
    swing: float = 0.0,
) -> Physics:
    """A floor that makes up for losses; gravity is ``pull`` SPEED²/wide towards it.

    Without a ``swing`` [m] it is a little of the diameter [m].
    """
    law = (rng.uniform(0.5, 0.95), rng.uniform(0.1, 2.0))
    swing = swing or diameter * 10.0 ** rng.uniform(-2.5, -1.0)
    axis = tuple(turn.apply([0.0, 0.0, 1.0]).tolist())
    sonotrode = Vibration(FLOOR, swing, SPEED / (2.0 * np.pi * swing), rng.uniform(0.0, 6.0), axis)
    down = -(SPEED**2) / wide * pull * np.array(axis)
    return Physics(Gravity(*down.tolist()), Restitution((law, law), law), sonotrode)


def random_balls(
    mesh: TriangleMesh, diameter: float, physics: Physics, rng: np.random.Generator
) -> Balls:
    """Up to 60 balls, or as many as find a place."""
    count = int(rng.integers(5, 60))
    clear = physics.vibration.amplitude if physics.vibration else 0.0
    while True:
        try:
            positions = pack_balls(mesh, count, diameter, rng, clear)
        except SceneError:
            if count == 1:
                raise
            count = (count + 1) // 2
        else:
            return Balls(positions, rng.normal(0.0, SPEED, (count, 3)), diameter)


def hull(_: float, rng: np.random.Generator) -> Surface:
    """The hull of random points: every edge concave towards the shot, none alike."""
    points = rng.normal(size=(int(rng.integers(10, 60)), 3))
    points *= 0.5 / np.linalg.norm(points, axis=1)[:, None]
    body = trimesh.Trimesh(points, ConvexHull(points).simplices, process=False)
    body.fix_normals()
    return np.asarray(body.vertices), np.asarray(body.faces)


def dented(_: float, rng: np.random.Generator) -> Surface:
    """A sphere with every corner moved in or out: convex and concave edges in a random mixture."""
    ball = trimesh.creation.icosphere(subdivisions=int(rng.integers(1, 4)), radius=0.5)
    depth = rng.uniform(0.02, 0.4)
    return np.asarray(ball.vertices) * rng.uniform(
        1.0 - depth, 1.0, (len(ball.vertices), 1)
    ), np.asarray(ball.faces)


def spiked(_: float, rng: np.random.Generator) -> Surface:
    """A box with needles of three to six sides in it, some through its walls."""
    return room_less(
        [
            turned(
                Manifold.cylinder(
                    rng.uniform(0.2, 0.8), rng.uniform(1e-3, 0.1), 0.0, int(rng.integers(3, 7))
                ),
                rng,
            )
            for _ in range(12)
        ]
    )


def bladed(_: float, rng: np.random.Generator) -> Surface:
    """A box with plates in it, down to a millionth of its width thick."""
    return room_less(
        [
            turned(
                Manifold.cube(
                    [*rng.uniform(0.1, 0.6, 2), 10.0 ** rng.uniform(-6.0, -1.5)], center=True
                ),
                rng,
            )
            for _ in range(8)
        ]
    )


def wedged(_: float, rng: np.random.Generator) -> Surface:
    """A box with slivers of tetrahedra in it: edges of a degree or so, both ways."""
    bodies = []
    for _ in range(8):
        corners = rng.normal(0.0, 0.3, (4, 3))
        corners[3] = corners[:3].mean(axis=0) + rng.normal(size=3) * 10.0 ** rng.uniform(-2.5, -1.0)
        bodies.append(Manifold.hull_points(corners).translate(rng.uniform(-0.4, 0.4, 3)))
    return room_less(bodies)


def geared(_: float, rng: np.random.Generator) -> Surface:
    """A box with a toothed wheel in it."""
    angles = np.linspace(0.0, 2.0 * np.pi, 2 * int(rng.integers(5, 20)), endpoint=False)
    radii = np.where(np.arange(len(angles)) % 2, rng.uniform(0.15, 0.25), 0.3)
    outline = CrossSection([np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)])
    return room_less([turned(outline.extrude(rng.uniform(0.1, 0.5)), rng)])


def throated(diameter: float, rng: np.random.Generator) -> Surface:
    """Two boxes joined by a tube hardly wider than a ball."""
    sides = int(rng.integers(3, 9))
    inscribed = 0.5 * diameter * (1.0 + 10.0 ** rng.uniform(-3.0, -0.5))
    tube = Manifold.cylinder(0.6, inscribed / np.cos(np.pi / sides), -1.0, sides).rotate(
        [0.0, 90.0, 0.0]
    )
    one = Manifold.cube([0.4, 0.5, 0.5], center=True).translate([-0.3, 0.0, 0.0])
    two = Manifold.cube([0.4, 0.5, 0.5], center=True).translate([0.3, 0.0, 0.0])
    return surface(one + two + tube.translate([-0.3, 0.0, 0.0]))


def slotted(diameter: float, rng: np.random.Generator) -> Surface:
    """A box with a stack of plates in it, apart by a ball and a little, down to a millionth of
    it.
    """
    plates, place = [], -0.4
    for _ in range(4):
        thick = rng.uniform(0.01, 0.05)
        plates.append(Manifold.cube([0.5, 0.6, thick]).translate([-0.25, -0.3, place]))
        place += thick + diameter * (1.0 + 10.0 ** rng.uniform(-6.0, -0.5))
    return room_less(plates)


def grooved(_: float, rng: np.random.Generator) -> Surface:
    """A box with prisms side by side in it: between them grooves that end in an edge."""
    outline = CrossSection(
        [[(0.0, 0.0), (0.2, 0.0), (rng.uniform(0.02, 0.18), rng.uniform(0.1, 0.6))]]
    )
    prism = outline.extrude(0.7).rotate([90.0, 0.0, 0.0])
    return room_less([prism.translate([-0.45 + 0.2 * k, 0.35, -0.4]) for k in range(4)])


def pillared(diameter: float, rng: np.random.Generator) -> Surface:
    """A room over a star, which narrows or widens upwards, with such pillars standing in it."""

    def star(corners: int, radius: float, depth: float) -> CrossSection:
        angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, corners)) + 2.0 * np.pi / corners
        angles = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False) + 0.2 * angles / corners
        radii = radius * rng.uniform(1.0 - depth, 1.0, corners)
        return CrossSection([np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)])

    def grown(outline: CrossSection, lean: float) -> Manifold:
        return outline.extrude(1.0, scale_top=(1.0 + lean, 1.0 + lean))

    lean = rng.choice([0.0, 1.0]) * rng.uniform(-0.1, 0.1, 4)
    room = grown(star(int(rng.integers(3, 16)), 0.5, 0.5), lean[0])
    for k in range(3):
        width = rng.uniform(0.2, 1.0) * diameter
        pillar = grown(star(int(rng.integers(3, 8)), width, 0.3), lean[k + 1])
        room = room - pillar.translate([*rng.uniform(-0.2, 0.2, 2), 0.0])
    return surface(room)


FAMILIES: dict[str, Callable[[float, np.random.Generator], Surface]] = {
    f.__name__: f
    for f in (hull, dented, spiked, bladed, wedged, geared, throated, slotted, grooved, pillared)
}
WITH_FLOOR = {"spiked", "bladed", "wedged", "geared", "throated", "slotted", "grooved", "pillared"}


def turned(body: Manifold, rng: np.random.Generator) -> Manifold:
    """The body, somewhere in the room, any way round."""
    return body.rotate(rng.uniform(0.0, 360.0, 3)).translate(rng.uniform(-0.4, 0.4, 3))


def room_less(bodies: list[Manifold]) -> Surface:
    """What the bodies leave of a cube."""
    room = Manifold.cube([1.0, 1.0, 1.0], center=True)
    for body in bodies:
        room = room - body
    return surface(room)


def surface(body: Manifold) -> Surface:
    """Its vertices and triangles, in double precision."""
    mesh: Mesh64 = body.to_mesh64()
    return np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts)

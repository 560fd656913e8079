"""Compile the simulator ahead of time, so that a program can say why its first start takes long."""

import contextlib
import gc
import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from sim_core.balls import Balls
from sim_core.effects.sonotrodes import carry_phases
from sim_core.effects.vibration import AmplitudeProfile
from sim_core.geometry.analytic import cylinder_cavity
from sim_core.geometry.mesh import TriangleMesh
from sim_core.loop.simulate import simulate
from sim_core.loop.spatial_blocks import MIN_BALLS
from sim_core.motion import WINDOW
from sim_core.numerics.jit import CACHE_FOLDER, CACHED, compilations_counted
from sim_core.scene.physics import Physics
from sim_core.scene.scene import Scene


def _marker(physics: Physics, balls: int, alike: bool, cylinder: bool) -> Path:
    """Return the path of the file that exists if the code for such a scene has been compiled.

    Each set of effects has its own machine code.
    """
    effects = {**physics._asdict(), **physics.surface._asdict()}
    present = [name for name, effect in effects.items() if effect is not None]
    kind = ["many" if balls >= MIN_BALLS else "few", "alike" if alike else "mixed"]
    if carry_phases(physics.vibrations, WINDOW) and physics.random_phase is None:
        kind.append("sonotrodes")
    if physics.rest is not None and physics.rest.on_vibrating:
        kind.append("riding")
    if any(one.profile is not None for one in physics.vibrations):
        kind.append("bending")
    return CACHE_FOLDER / "-".join(["compiled", *present, *kind, *["bore"] * cylinder])


def is_compiled(physics: Physics, balls: int, alike: bool = True, cylinder: bool = False) -> bool:
    """Return True if the code for a scene with these effects has been compiled before.

    Only code from this version of the sources counts. The arguments are those of compile_simulator.
    """
    return _marker(physics, balls, alike, cylinder).exists()


def compile_simulator(
    physics: Physics,
    balls: int = 1,
    alike: bool = True,
    cylinder: bool = False,
    progress: Callable[[int], None] = lambda done: None,
) -> float:
    """Compile the code of a scene with these effects, or load it from the cache.

    Args:
        balls: number of balls.
        alike: True if all balls have one size and density.
        cylinder: True in an analytical cylinder, False in a mesh or a prism.
        progress: called as progress(done) after each compiled function. How many there will be is
            not known, as most functions serve several sets of effects.

    Returns:
        Duration of the compilation [s].
    """
    start = time.perf_counter()
    physics = _with_profiles_of_a_cube(physics)
    if len(physics.vibrations) > 2:
        # more sonotrodes use the same machine code
        physics = physics._replace(vibration=physics.vibrations[:2])
    shaken = [one.tag for one in physics.vibrations]
    vertices = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    quads = np.array(
        [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    )
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    tags = np.full(len(triangles), next(tag for tag in range(3) if tag not in shaken))
    for height, tag in enumerate(shaken):  # floor and ceiling
        tags[(vertices[triangles][:, :, 2] == height).all(axis=1)] = tag
    for law in (physics.restitution, physics.friction, physics.roughness):
        if law is not None:
            tags = np.minimum(tags, len(law.surfaces) - 1)
    if physics.part_rotation is not None:
        physics, vertices, triangles, tags = _with_a_turning_box(physics, vertices, triangles, tags)
    if physics.flexure is not None:
        rigid = np.zeros(3 if cylinder else len(triangles))
        physics = physics._replace(flexure=physics.flexure._replace(mobility=rigid))
    side = math.ceil(MIN_BALLS ** (1 / 3)) if balls >= MIN_BALLS else 2
    places = np.stack(np.meshgrid(*[np.linspace(0.1, 0.9, side)] * 3), axis=-1).reshape(-1, 3)
    diameter = 0.05 if alike else np.linspace(0.04, 0.05, len(places)).round(2)
    shot = Balls(places, np.random.default_rng(1).normal(size=places.shape), diameter)
    mesh = TriangleMesh(vertices, triangles, tags)
    floor = (vertices[triangles][:, :, 2] == 0.0).all(axis=1)
    walls = int(tags[~floor][0])
    room = (
        cylinder_cavity(2.0, 0.0, 1.0, (int(tags[floor][0]), walls, walls), (0.5, 0.5))
        if cylinder
        else mesh
    )
    with _few_collections(), compilations_counted(progress):
        simulate(Scene(room, shot, physics, duration=0.01))
    if CACHED:
        with contextlib.suppress(OSError):  # such as a full disk
            _marker(physics, balls, alike, cylinder).touch()
    return time.perf_counter() - start


def _with_profiles_of_a_cube(physics: Physics) -> Physics:
    """Return the effects with profiles for a face of the cube in which code is compiled, if any."""
    if all(one.profile is None for one in physics.vibrations):
        return physics
    even = AmplitudeProfile(((0.0, 1.0), (2.0, 1.0)))
    up = (0.0, 0.0, 1.0)
    each = (one._replace(profile=even, axis=up) for one in physics.vibrations)
    return physics._replace(vibration=tuple(each))


@contextlib.contextmanager
def _few_collections() -> Iterator[None]:
    """Let Python collect garbage rarely in this context.

    The compiler keeps its objects, and the search for garbage took 7 % of the compilation.
    """
    before = gc.get_threshold()
    gc.set_threshold(max(before[0], 100_000), 50, 1000)
    try:
        yield
    finally:
        gc.set_threshold(*before)


def _with_a_turning_box(
    physics: Physics, vertices: np.ndarray, triangles: np.ndarray, tags: np.ndarray
) -> tuple[Physics, np.ndarray, np.ndarray, np.ndarray]:
    """Add a small turning box in a corner of the cube in which code is compiled.

    Returns: effects, vertices [m], triangles and tags of the cube with the box.
    """
    turn = physics.part_rotation
    assert turn is not None
    turn = turn._replace(axis_point=(0.03, 0.03, 0.03), with_part=())
    shaken = [one.tag for one in physics.vibrations]
    still = next(tag for tag in range(4) if tag not in (turn.tag, *shaken))
    for name in ("restitution", "friction", "roughness"):
        law = getattr(physics, name)
        if law is not None:
            wider = law._replace(surfaces=[law.surfaces[0]] * max(4, len(law.surfaces)))
            physics = physics._replace(**{name: wider})
    box = len(vertices) + triangles[:, ::-1]
    return (
        physics._replace(part_rotation=turn),
        np.concatenate([vertices, 0.02 * vertices + 0.02]),
        np.concatenate([triangles, box]),
        np.concatenate([np.where(np.isin(tags, shaken), tags, still), np.full(len(box), turn.tag)]),
    )

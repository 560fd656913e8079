"""What a ball is jammed between, in words: whoever has to make room wants to know where."""

import numpy as np

from sim_core.geometry.analytic import AnalyticCavity
from sim_core.geometry.mesh import normals_towards_shot
from sim_core.loop.contact_neighbours import LEANING
from sim_core.scene.invariants import clearance
from sim_core.scene.narrow_gaps import surface_name
from sim_core.scene.scene import Scene

MOST_NAMED = 4  # of the surfaces, and of the balls, nearest first
ONE_WAY = 0.99  # cosine: triangles that face alike are one surface


def touching(
    scene: Scene, corners: np.ndarray | None, positions: np.ndarray, ball: int
) -> tuple[str, bool]:
    """What touches the ball, e.g. "triangle 7, the turning part (triangle 12) and ball 3", and whether the part does.

    ``corners`` (m, 3, 3) [m]: the triangles where they are now, if some of them turn; ``positions`` (n, 3) [m].
    """
    physics, radii, here = scene.physics, 0.5 * scene.balls.diameters, positions[[ball]]
    radius = float(radii[ball])
    names, held_by_part = _surfaces(scene, corners, here, radius)
    apart = np.linalg.norm(positions - here, axis=1) - radii - radius
    meets = (
        (apart <= LEANING) & (np.arange(len(apart)) != ball) & (physics.ball_collisions is not None)
    )
    names += [f"ball {k}" for k in np.argsort(apart) if meets[k]][:MOST_NAMED]
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]])), held_by_part


def _surfaces(
    scene: Scene, corners: np.ndarray | None, here: np.ndarray, radius: float
) -> tuple[list[str], bool]:
    """The surfaces that touch a ball ``here`` (1, 3) [m], nearest first, and whether the turning part does."""
    physics = scene.physics
    if isinstance(scene.mesh, AnalyticCavity):
        swing = max((one.amplitude for one in physics.vibrations), default=0.0)
        return scene.mesh.touched(here[0], radius + LEANING, swing), False
    corners = scene.mesh.corners if corners is None else corners
    slack = np.full(len(corners), LEANING)
    for vibration in physics.vibrations:  # it is given where the mesh has it
        slack[scene.mesh.tags == vibration.tag] += vibration.amplitude
    box = np.abs(here - np.clip(here, corners.min(axis=1), corners.max(axis=1))).max(axis=1)
    near = [int(t) for t in np.flatnonzero(box <= radius + slack)]
    gap = {t: float(clearance(corners[[t]], here, 2.0 * radius)[0]) - radius for t in near}
    normals = normals_towards_shot(corners)[0]
    found: list[int] = []
    for t in sorted((t for t in near if gap[t] <= slack[t]), key=lambda t: gap[t]):
        alike = (
            normals[t] @ normals[k] > ONE_WAY and scene.mesh.tags[t] == scene.mesh.tags[k]
            for k in found
        )
        if not any(alike) and len(found) < MOST_NAMED:
            found.append(t)
    tags = [int(scene.mesh.tags[t]) for t in found]
    held_by_part = physics.part_rotation is not None and physics.part_rotation.tag in tags
    return [surface_name(scene.mesh, physics, t) for t in found], held_by_part

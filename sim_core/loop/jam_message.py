"""Message that names the surfaces and balls that a jammed ball is caught between."""

import numpy as np

from sim_core.effects.restitution import ELASTIC_BELOW
from sim_core.geometry.analytic import AnalyticCavity
from sim_core.geometry.mesh import normals_towards_shot
from sim_core.loop.contact_neighbours import MAX_JAM_GAP
from sim_core.scene.invariants import clearance
from sim_core.scene.narrow_gaps import surface_name
from sim_core.scene.scene import Scene

MAX_NAMED = 4  # largest number of named surfaces, and of named balls, nearest first
ENDLESS_BELOW = 1e-6  # m/s: with a lower Restitution.elastic_below slow bounces hardly ever end
SAME_FACING = 0.99  # cosine: triangles that face alike are one surface


def jam_message(
    scene: Scene, corners: np.ndarray | None, positions: np.ndarray, ball: int, when: str
) -> str:
    """Return an error message with the cause of a ball's jam and a remedy.

    Args:
        corners: present corners of the triangles [m], (m, 3, 3), if some triangles turn.
        positions: positions of all balls [m], (n, 3).
        when: time of the jam, in words.
    """
    between, by_part = touching(scene, corners, positions, ball)
    where = f"at {np.round(positions[ball], 6).tolist()} m"
    rests = scene.physics.rest is not None
    if scene.physics.part_rotation is not None and (by_part or rests):
        through = "" if by_part else ", and the turning part presses on it through other balls"
        return (
            f"ball {ball} is caught between {between}{through}, {where}, {when}; make room there "
            "for a ball between the part and what it turns past, or so little that none gets in"
        )
    restitution = scene.physics.restitution
    if restitution is not None and not rests and restitution.elastic_below < ENDLESS_BELOW:
        return (
            f"ball {ball} bounces ever faster {where}, {when}: "
            f"restitution.elastic_below is {restitution.elastic_below:g} m/s, so that slow bounces "
            f"never end; give {ELASTIC_BELOW:g} m/s"
            + (", or Rest(on_vibrating=True)" if scene.physics.vibrations else "")
        )
    advice = "" if rests else "; if balls can lie still there, switch contact mode on"
    return (
        f"ball {ball} jams {where}{f', between {between}' if between else ''}: "
        f"more than a hundred million events a second; {when}. "
        f"Look for a gap just as wide as the ball there{advice}"
    )


def touching(
    scene: Scene, corners: np.ndarray | None, positions: np.ndarray, ball: int
) -> tuple[str, bool]:
    """Return the names of all that touches a ball, and True if the turning part touches it.

    Example of the names: "triangle 7, the turning part (triangle 12) and ball 3".
    """
    physics, radii, here = scene.physics, 0.5 * scene.balls.diameters, positions[[ball]]
    radius = float(radii[ball])
    names, held_by_part = _surfaces(scene, corners, here, radius)
    apart = np.linalg.norm(positions - here, axis=1) - radii - radius
    meets = (
        (apart <= MAX_JAM_GAP)
        & (np.arange(len(apart)) != ball)
        & (physics.ball_collisions is not None)
    )
    names += [f"ball {k}" for k in np.argsort(apart) if meets[k]][:MAX_NAMED]
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]])), held_by_part


def _surfaces(
    scene: Scene, corners: np.ndarray | None, here: np.ndarray, radius: float
) -> tuple[list[str], bool]:
    """Find the surfaces that touch a ball.

    ``here``: position of the ball (1, 3) [m].

    Returns: the names of the surfaces, nearest first, and True if the turning part is one of them.
    """
    physics = scene.physics
    if isinstance(scene.mesh, AnalyticCavity):
        swing = max((one.amplitude for one in physics.vibrations), default=0.0)
        return scene.mesh.touched(here[0], radius + MAX_JAM_GAP, swing), False
    corners = scene.mesh.corners if corners is None else corners
    slack = np.full(len(corners), MAX_JAM_GAP)
    for vibration in physics.vibrations:  # the vibration is given where the mesh has the surface
        slack[scene.mesh.tags == vibration.tag] += vibration.amplitude
    box = np.abs(here - np.clip(here, corners.min(axis=1), corners.max(axis=1))).max(axis=1)
    near = [int(t) for t in np.flatnonzero(box <= radius + slack)]
    gap = {t: float(clearance(corners[[t]], here, 2.0 * radius)[0]) - radius for t in near}
    normals = normals_towards_shot(corners)[0]
    found: list[int] = []
    for t in sorted((t for t in near if gap[t] <= slack[t]), key=lambda t: gap[t]):
        alike = (
            normals[t] @ normals[k] > SAME_FACING and scene.mesh.tags[t] == scene.mesh.tags[k]
            for k in found
        )
        if not any(alike) and len(found) < MAX_NAMED:
            found.append(t)
    tags = [int(scene.mesh.tags[t]) for t in found]
    held_by_part = physics.part_rotation is not None and physics.part_rotation.tag in tags
    return [surface_name(scene.mesh, physics, t) for t in found], held_by_part

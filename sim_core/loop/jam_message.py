"""Message on a ball with too many events in a short time: it is jammed, or bounces ever faster.

A ball that loses speed at each hit, and is pressed on a surface meanwhile, hits it infinitely often
in finite time: inelastic collapse.

Source: S. McNamara & W. R. Young, Phys. Rev. E 50 (1994) R28.
"""

import numpy as np

from sim_core.effects.restitution import ELASTIC_BELOW, E, Restitution, checked_restitution
from sim_core.geometry.analytic import AnalyticCavity
from sim_core.geometry.mesh import normals_towards_shot
from sim_core.loop.contact_neighbours import MAX_JAM_GAP
from sim_core.scene.invariants import clearance
from sim_core.scene.narrow_gaps import surface_name
from sim_core.scene.scene import Scene

MAX_NAMED = 4  # largest number of named surfaces, and of named balls, nearest first
SAME_FACING = 0.99  # cosine: triangles that face alike are one surface


def jam_message(
    scene: Scene,
    corners: np.ndarray | None,
    positions: np.ndarray,
    ball: int,
    on_one_side: bool,
    when: str,
) -> str:
    """Return an error message with the cause of a ball's many events and a remedy.

    Args:
        corners: present corners of the triangles [m], (m, 3, 3), if some triangles turn.
        positions: positions of all balls [m], (n, 3).
        on_one_side: True if the ball hits surfaces of which none faces another.
        when: time of the jam, in words.
    """
    names, by_part = touching(scene, corners, positions, ball)
    between = " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))
    where = f"at {np.round(positions[ball], 6).tolist()} m"
    rests = scene.physics.rest is not None
    if scene.physics.part_rotation is not None and (by_part or rests):
        through = "" if by_part else ", and the turning part presses on it through other balls"
        return (
            f"ball {ball} is caught between {between}{through}, {where}, {when}; make room there "
            "for a ball between the part and what it turns past, or so little that none gets in"
        )
    restitution = scene.physics.restitution
    if restitution is not None and (on_one_side or len(names) == 1):
        remedy = _collapse_remedy(restitution, int(scene.mesh.tags.max()) + 1)
        if remedy:
            return (
                f"ball {ball} bounces ever faster {where}{f', on {between}' if between else ''}, "
                f"{when}: inelastic collapse, a series of hits that never ends. {remedy}"
                + (", or give Rest(on_vibrating=True)" if scene.physics.vibrations else "")
            )
    advice = "" if rests else "; if balls can lie still there, switch contact mode on"
    touches = "" if not names else f", {'between' if len(names) > 1 else 'at'} {between}"
    return (
        f"ball {ball} jams {where}{touches}: "
        f"more than a hundred million events a second; {when}. "
        f"Look for a gap just as wide as the ball there{advice}"
    )


def _collapse_remedy(restitution: Restitution, tags: int) -> str:
    """Return what ends a series of ever shorter bounces; "" if no hit loses speed."""
    e = checked_restitution(restitution, tags).points[:, :, E]
    if e.min() == 0.0:
        return "A hit with restitution 0 leaves no speed at all: give a restitution above 0"
    if e.min() == 1.0:
        return ""
    usual = f", {ELASTIC_BELOW:g} m/s is usual" if restitution.elastic_below < ELASTIC_BELOW else ""
    return (
        "Raise elastic_below of the restitution, below which hits lose nothing: it is "
        f"{restitution.elastic_below:g} m/s{usual}"
    )


def touching(
    scene: Scene, corners: np.ndarray | None, positions: np.ndarray, ball: int
) -> tuple[list[str], bool]:
    """Return the names of all that touches a ball, and True if the turning part touches it.

    Example of the names: "triangle 7", "the turning part (triangle 12)" and "ball 3".
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
    return names, held_by_part


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
    turn = physics.part_rotation
    held_by_part = turn is not None and not set(turn.tags).isdisjoint(tags)
    return [surface_name(scene.mesh, physics, t) for t in found], held_by_part

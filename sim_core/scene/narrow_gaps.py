"""Search for gaps that are narrower than the ball that starts in them, or will become narrower.

A rigid ball in such a gap has no possible motion. The search checks pairs of surfaces that the ball
touches on opposite sides, because a ball in a wedge can still move out. A vibrating surface counts
at the position where its vibration brings it nearest to the ball, as do both of two vibrating
surfaces.
"""

from typing import NamedTuple

import numpy as np

from sim_core.balls import Balls
from sim_core.geometry.mesh import TriangleMesh
from sim_core.scene.invariants import clearance
from sim_core.scene.physics import Physics

TIGHT = 1e-13  # m: a gap narrower by less is rounding; a contact is found as exactly
# Cosine of normals: parallel up to 0.05 mrad. A ball that overlaps by 1 nm there could move out 40
# um.
OPPOSED = -1.0 + 1e-9


class NearSurface(NamedTuple):
    """The k triangles of a mesh that are near the balls of a scene."""

    number: np.ndarray  # numbers in the mesh, shape (k,)
    tags: np.ndarray  # surface tags, shape (k,)
    corners: np.ndarray  # corners at the start [m], shape (k, 3, 3)


class NarrowGap(NamedTuple):
    """A ball that does not fit between two triangles."""

    ball: int  # number of the ball
    one: int  # triangle on one side
    two: int  # triangle on the other side
    narrower: float  # diameter of the ball minus the width of the gap [m]
    # True if the gap is narrow when the vibrating surfaces come nearest, not at the start
    vibrates: bool


def find_narrow_gap(surface: NearSurface, physics: Physics, balls: Balls) -> NarrowGap | None:
    """Return the first ball that does not fit between surfaces at its start; None if all fit.

    Args:
        surface: all triangles that are nearer to a ball than its radius plus the distance by
            which surfaces can approach each other (`largest_approach`).
    """
    radius, approach = 0.5 * balls.diameters, largest_approach(physics)
    # a gap of -TIGHT: overlaps by half of it on two sides, or by more on one side
    near = clearance(surface.corners, balls.positions, balls.radius) < radius - 0.5 * TIGHT
    for vibration in physics.vibrations:
        vibrating, reach = surface.tags == vibration.tag, balls.radius + approach
        both = [surface.corners[own] for own in (vibrating, ~vibrating)]
        beside = [clearance(some, balls.positions, reach) < radius + approach for some in both]
        near |= np.all(beside, axis=0)
    for ball in np.flatnonzero(near):
        found = _tightest(surface, physics, balls.positions[ball], float(radius[ball]))
        if found is not None:
            return NarrowGap(int(ball), *found)
    return None


def surface_name(mesh: TriangleMesh, physics: Physics, triangle: int) -> str:
    """Return the name of a surface for messages, e.g. "the turning part (triangle 12)"."""
    turn, tag = physics.part_rotation, int(mesh.tags[triangle])
    if tag in [one.tag for one in physics.vibrations]:
        return f"{vibrating_name(physics, tag)} (triangle {triangle})"
    if turn is not None and tag in turn.tags:
        return f"the turning part (triangle {triangle})"
    return f"triangle {triangle}"


def vibrating_name(physics: Physics, tag: int) -> str:
    """Return the name of a vibrating surface for messages, with its tag if several vibrate."""
    return "the vibrating surface" + (f" of tag {tag}" if len(physics.vibrations) > 1 else "")


def largest_approach(physics: Physics) -> float:
    """Return a bound on the distance [m] by which vibrations bring two surfaces nearer together."""
    return sum(2.0 * one.amplitude for one in physics.vibrations)


def _tightest(
    surface: NearSurface, physics: Physics, here: np.ndarray, radius: float
) -> tuple[int, int, float, bool] | None:
    """Find the two triangles that leave a ball at ``here`` (3,) [m] the least room.

    Returns: the numbers of the triangles, the missing width [m], and True if vibration narrows the
    gap; or None if the ball fits.
    """
    turn, reach = physics.part_rotation, radius + largest_approach(physics)
    corners, tags = surface.corners, surface.tags
    box = np.abs(here - np.clip(here, corners.min(axis=1), corners.max(axis=1))).max(axis=1)
    near = np.flatnonzero(box <= reach)
    away = here - _nearest_points(corners[near], here)
    distance = np.linalg.norm(away, axis=1)
    touched = (distance <= reach) & (distance > 0.0)
    near, gap = near[touched], distance[touched] - radius
    away = away[touched] / distance[touched, None]
    least, moves = gap.copy(), np.full(len(near), -1)  # number of the vibration, if any
    turns = np.isin(tags[near], () if turn is None else turn.tags)
    for k, vibration in enumerate(physics.vibrations):
        vibrating = tags[near] == vibration.tag
        towards = away[vibrating] @ vibration.peak
        least[vibrating] -= np.abs(towards) - np.sin(vibration.phase) * towards
        moves[vibrating] = k
    closer = (moves[:, None] != moves) & ~turns[:, None] & ~turns
    room = np.where(closer, least[:, None] + least, gap[:, None] + gap)
    room[away @ away.T > OPPOSED] = np.inf
    if room.min(initial=np.inf) >= -TIGHT:
        return None
    one, two = np.unravel_index(room.argmin(), room.shape)
    number = surface.number[near]
    lacking, vibrates = float(-room[one, two]), bool(closer[one, two])
    return int(number[one]), int(number[two]), lacking, vibrates


def _nearest_points(corners: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return the point of each triangle that is closest to ``point``, on its face or border."""
    a, edge = corners, np.roll(corners, -1, axis=1) - corners
    tiny = np.finfo(float).tiny  # a triangle may have no area
    square = np.maximum(np.einsum("mki,mki->mk", edge, edge), tiny)
    share = np.einsum("mki,mki->mk", point - a, edge) / square
    border = a + np.clip(share, 0.0, 1.0)[..., None] * edge
    nearest = np.linalg.norm(point - border, axis=2).argmin(axis=1)
    found = np.asarray(border[np.arange(len(corners)), nearest])
    normal = np.cross(edge[:, 0], edge[:, 1])
    square = np.einsum("mi,mi->m", normal, normal)
    height = np.einsum("mi,mi->m", point - a[:, 0], normal) / np.maximum(square, tiny)
    foot = point - height[:, None] * normal
    inside = np.einsum("mki,mi->mk", np.cross(edge, foot[:, None] - a), normal) >= 0.0
    over = (square > 0.0) & inside.all(axis=1)
    found[over] = foot[over]
    return found

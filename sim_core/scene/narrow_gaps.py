"""Gaps narrower than the ball that starts in them, or about to be: no motion of a rigid ball there is right.

Asked are two surfaces that the ball touches on opposite sides; in a wedge it could still move out. A vibrating surface
counts where its swing brings it nearest; of two, both.
"""

from typing import NamedTuple

import numpy as np

from sim_core.balls import Balls
from sim_core.geometry.mesh import TriangleMesh
from sim_core.scene.invariants import clearance
from sim_core.scene.physics import Physics

TIGHT = 1e-13  # m: narrower by less is rounding; a contact is found as exactly
OPPOSED = (
    -1.0 + 1e-9
)  # cosine: parallel but for 0.05 mrad; a ball that overlaps by 1 nm would have 40 um to move out


class NarrowGap(NamedTuple):
    """``ball`` is in a gap ``narrower`` [m] than itself between the triangles ``one`` and ``two``; ``swings``: so when
    the vibrating surface that has one of them, or those that have both, come nearest to the other.
    """

    ball: int
    one: int
    two: int
    narrower: float
    swings: bool


def find_narrow_gap(
    mesh: TriangleMesh, physics: Physics, balls: Balls, corners: np.ndarray
) -> NarrowGap | None:
    """The first ball that does not fit where it starts; ``corners`` (m, 3, 3) [m]: the triangles at the start."""
    radius, swing = 0.5 * balls.diameters, _swing(physics)
    asked = (
        clearance(corners, balls.positions, balls.radius) < radius - 0.5 * TIGHT
    )  # two such gaps, or one of more
    for vibration in physics.vibrations:
        vibrating = mesh.tags == vibration.tag
        both = [corners[own] for own in (vibrating, ~vibrating) if own.any()]
        near = [
            clearance(some, balls.positions, balls.radius + swing) < radius + swing for some in both
        ]
        asked |= np.all(near, axis=0)
    for ball in np.flatnonzero(asked):
        found = _tightest(mesh, physics, balls.positions[ball], float(radius[ball]), corners)
        if found is not None:
            return NarrowGap(int(ball), *found)
    return None


def surface_name(mesh: TriangleMesh, physics: Physics, triangle: int) -> str:
    """E.g. "triangle 7", or "the turning part (triangle 12)"."""
    turn, tag = physics.part_rotation, int(mesh.tags[triangle])
    if tag in [one.tag for one in physics.vibrations]:
        return f"{vibrating_name(physics, tag)} (triangle {triangle})"
    if turn is not None and tag == turn.tag:
        return f"the turning part (triangle {triangle})"
    return f"triangle {triangle}"


def vibrating_name(physics: Physics, tag: int) -> str:
    """E.g. "the vibrating surface of tag 3"; without its tag where there is but one."""
    return "the vibrating surface" + (f" of tag {tag}" if len(physics.vibrations) > 1 else "")


def _swing(physics: Physics) -> float:
    """How much nearer [m] two surfaces may come to each other than they are at the start, or more."""
    return sum(2.0 * one.amplitude for one in physics.vibrations)


def _tightest(
    mesh: TriangleMesh, physics: Physics, here: np.ndarray, radius: float, corners: np.ndarray
) -> tuple[int, int, float, bool] | None:
    turn, reach = physics.part_rotation, radius + _swing(physics)
    box = np.abs(here - np.clip(here, corners.min(axis=1), corners.max(axis=1))).max(axis=1)
    near = np.flatnonzero(box <= reach)
    away = here - _nearest_points(corners[near], here)
    distance = np.linalg.norm(away, axis=1)
    touched = (distance <= reach) & (distance > 0.0)
    near, gap, away = (
        near[touched],
        distance[touched] - radius,
        away[touched] / distance[touched, None],
    )
    least, moves = gap.copy(), np.full(len(near), -1)  # which of the vibrations has it, if any
    turns = np.zeros(len(near), np.bool_) if turn is None else mesh.tags[near] == turn.tag
    for k, vibration in enumerate(physics.vibrations):
        vibrating = mesh.tags[near] == vibration.tag
        towards = away[vibrating] @ vibration.peak
        least[vibrating] -= np.abs(towards) - np.sin(vibration.phase) * towards
        moves[vibrating] = k
    swings = (moves[:, None] != moves) & ~turns[:, None] & ~turns
    room = np.where(swings, least[:, None] + least, gap[:, None] + gap)
    room[away @ away.T > OPPOSED] = np.inf
    if room.min(initial=np.inf) >= -TIGHT:
        return None
    one, two = np.unravel_index(room.argmin(), room.shape)
    return int(near[one]), int(near[two]), float(-room[one, two]), bool(swings[one, two])


def _nearest_points(corners: np.ndarray, point: np.ndarray) -> np.ndarray:
    """The point (m, 3) of each triangle (m, 3, 3) nearest to a point (3,): on its face, or else on its border."""
    a, edge = corners, np.roll(corners, -1, axis=1) - corners
    tiny = np.finfo(float).tiny  # a triangle may have no area
    share = np.einsum("mki,mki->mk", point - a, edge) / np.maximum(
        np.einsum("mki,mki->mk", edge, edge), tiny
    )
    border = a + np.clip(share, 0.0, 1.0)[..., None] * edge
    nearest = np.linalg.norm(point - border, axis=2).argmin(axis=1)
    found = border[np.arange(len(corners)), nearest]
    normal = np.cross(edge[:, 0], edge[:, 1])
    square = np.einsum("mi,mi->m", normal, normal)
    height = np.einsum("mi,mi->m", point - a[:, 0], normal) / np.maximum(square, tiny)
    foot = point - height[:, None] * normal
    over = (square > 0.0) & (
        np.einsum("mki,mi->mk", np.cross(edge, foot[:, None] - a), normal) >= 0.0
    ).all(axis=1)
    found[over] = foot[over]
    return found

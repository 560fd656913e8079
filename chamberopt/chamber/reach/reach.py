"""What the shot can reach: where a ball can touch the cavity's surface, coming from the room over the sonotrode."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.reach.connectivity import cell_edge, rooms
from chamberopt.chamber.reach.largest_ball import Touches, touches
from chamberopt.design.shapes import TAG_PART, TAG_SONOTRODE
from chamberopt.geometry.triangles import areas

if TYPE_CHECKING:
    from sim_core import TriangleMesh

# So much of its radius a ball may reach into a surface: what facets that turn by 8 degrees each take from it, or by 3
# in a hollow hardly rounder than the ball. A dent is deeper, and so are the tolerances of a gap.
FORGIVEN = 0.01
FINE = 1.0 / 3.0  # of the radius: distance between places looked at
MOST_PLACES = 100_000  # on the part, and as many on all else
LEAST_PLACES = 4  # on a triangle of the part, unless there are too many
WIDER = 1.25  # of the largest ball's radius: up to there widths are told apart


@dataclass(frozen=True)
class Reach:
    """What a ball of ``diameter`` [m] reaches in a cavity, ``mesh``.

    touches: the places looked at · fits (p,) bool: no wall is in a ball's way there · reached (p,) bool: and it gets
    there from over the sonotrode · room (p,) int, -1 where it does not fit · room_volume (r,) m³ that its centre has
    in the open of each room · spacing m between places, at most · share (k,): of each of the cavity's triangles.
    """

    mesh: TriangleMesh
    diameter: float
    touches: Touches
    fits: np.ndarray
    reached: np.ndarray
    room: np.ndarray
    room_volume: np.ndarray
    spacing: float
    share: np.ndarray


def reach(mesh: TriangleMesh, diameter: float, largest: float | None = None) -> Reach:
    """Where a ball of ``diameter`` [m], the smallest of the shot, can touch the surface; ``largest`` [m] of the shot.

    A ball is taken smaller by FORGIVEN. In tight places it is followed from place to place, in steps of a quarter
    radius: a bent passage hardly wider than the ball may be taken for closed.
    """
    radius = 0.5 * diameter
    forgiven = FORGIVEN * radius
    most = max(
        radius + 1.01 * np.sqrt(3.0) * cell_edge(mesh, radius), WIDER * 0.5 * (largest or diameter)
    )
    spacing = _spacing(mesh, FINE * radius)
    found = touches(mesh, spacing, most, forgiven)
    room, volume = rooms(mesh, found, radius - forgiven, float(spacing.max()))
    fits = found.radius >= radius
    room = np.where(fits, room, -1)
    started = np.unique(room[fits & (mesh.tags[found.triangle] == TAG_SONOTRODE)])
    reached = fits & np.isin(room, started)
    count = len(mesh.triangles)
    whole = np.bincount(found.triangle, found.area, count)
    touched = np.bincount(found.triangle[reached], found.area[reached], count)
    share = np.divide(touched, whole, out=np.zeros(count), where=whole > 0.0)
    return Reach(mesh, diameter, found, fits, reached, room, volume, float(spacing.max()), share)


def part_share(found: Reach, source: np.ndarray, count: int) -> np.ndarray:
    """The share of each of the part's ``count`` triangles, of what is in the cavity, that a ball can touch (count,).

    ``source`` (k,): the part's triangle that each of the cavity's lies on, else -1. 0 of what is not in the cavity.
    """
    size, own = areas(found.mesh.vertices, found.mesh.triangles), source >= 0
    touched, whole = (
        np.bincount(source[own], weights[own], count) for weights in (found.share * size, size)
    )
    return np.divide(touched, whole, out=np.zeros(count), where=whole > 0.0)


def _spacing(mesh: TriangleMesh, wanted: float) -> np.ndarray:
    """Distance [m] between places on each triangle (k,)."""
    size = areas(mesh.vertices, mesh.triangles)
    spacing = np.full(len(size), wanted)
    for chosen in (mesh.tags == TAG_PART, mesh.tags != TAG_PART):
        spacing[chosen] = max(wanted, float(np.sqrt(size[chosen].sum() / MOST_PLACES)))
    on_part = mesh.tags == TAG_PART
    if LEAST_PLACES * on_part.sum() <= MOST_PLACES:
        spacing[on_part] = np.minimum(spacing[on_part], np.sqrt(size[on_part] / LEAST_PLACES))
    return np.maximum(spacing, 1e-12)

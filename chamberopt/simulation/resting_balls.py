"""Write notes on balls that lie still when a replica ends, and so no longer peen.

The notes name surfaces and positions in the terms of a chamber's designer, who can make room there.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.checks.place_names import around, surface_names
from chamberopt.common.number_text import percent
from chamberopt.design.shape_surface import TAG_PART
from chamberopt.geometry.triangles import connected_pieces

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from sim_core import Resting

CONTACT_GAP = 2e-5  # m, at most between a ball at rest and the surface that holds it
PLACE_DISTANCE = 3.0  # ball diameters: balls nearer to each other lie in one place
MAX_PLACES = 3  # places named in a note, those places first that have most balls
ON_BALLS = ""  # kind of a ball that only other balls carry


@dataclass(frozen=True)
class RestingBalls:
    """The share of the balls at rest at the end of a replica, and a text on where they lie."""

    share: float  # their share of the shot
    line: str  # their number, what holds them and where, in words


def find_resting_balls(
    resting: Resting, diameters: Sequence[float], chamber: Chamber, part_turns: bool
) -> RestingBalls | None:
    """Describe the balls at rest at the end of a replica. Return None if there are none.

    Args:
        resting: the balls at rest, as the simulator reports them.
        diameters: diameter of each ball of the shot [m].
        part_turns: whether the part rotates. Its position at the end is then unknown, so that no
            ball is said to touch it.
    """
    if len(resting) == 0:
        return None
    balls, surfaces = len(diameters), surface_names(chamber)
    reach = [0.5 * diameters[ball] + CONTACT_GAP for ball in resting.ball]
    kinds = [_kind(resting, i, surfaces, chamber, r, part_turns) for i, r in enumerate(reach)]
    places = _places(resting, _with_carriers(resting, kinds), max(diameters))
    descriptions = [_describe(resting, members, kind) for kind, members in places[:MAX_PLACES]]
    others = sum(len(members) for _, members in places[MAX_PLACES:])
    descriptions += [f"{others} elsewhere"] if others else []
    verb = "lies" if len(resting) == 1 else "lie"
    return RestingBalls(
        len(resting) / balls,
        f"{len(resting)} of {balls} balls {verb} still at the end, places in the chamber's frame: "
        f"{'; '.join(descriptions)}",
    )


def resting_notes(resting: Sequence[RestingBalls], replicas: int) -> tuple[str, ...]:
    """Return a note on all replicas in which balls came to rest, or nothing if there are none.

    Args:
        resting: the balls at rest in each replica that has some.
        replicas: number of all replicas.
    """
    if not resting:
        return ()
    mean = sum(one.share for one in resting) / replicas
    worst = max(resting, key=lambda one: one.share)
    return (
        f"balls came to rest in {len(resting)} of {replicas} replicas and no longer peen: at the "
        f"end {percent(mean)} of the shot, on average over all replicas; in the worst one, "
        f"{worst.line}",
    )


def _kind(
    resting: Resting, i: int, surfaces: np.ndarray, chamber: Chamber, reach: float, part_turns: bool
) -> str:
    """Return what holds a ball at rest, such as "on the part's upper side".

    The result is ON_BALLS if other balls alone hold it.

    Args:
        i: row of the ball in `resting`.
        surfaces: name of the surface of each triangle of the chamber.
        reach: distance from the ball's centre within which a triangle holds it [m].
        part_turns: whether the part rotates, so that its position is unknown.
    """
    under = resting.triangles[i][resting.triangles[i] >= 0]
    if resting.jammed[i]:
        known = chamber.tags != TAG_PART if part_turns else np.ones(len(chamber.tags), dtype=bool)
        near = triangles_near(chamber, np.flatnonzero(known), resting.position[i], reach)
        under = np.union1d(under, near)
    names = sorted(set(surfaces[under]))
    if not resting.jammed[i]:
        return ON_BALLS if not names else join_names("on", names)
    if not names and not part_turns:
        return "jammed among other balls"
    if len(names) < 2:  # one surface alone cannot jam a ball
        names.append("other balls or the part" if part_turns else "other balls")
    return f"jammed {join_names('among', names)}"


def join_names(preposition: str, names: list[str]) -> str:
    """Return names of surfaces as text: "on the wall" or "between the part and the wall"."""
    return (
        f"{preposition} {names[0]}"
        if len(names) == 1
        else f"between {', '.join(names[:-1])} and {names[-1]}"
    )


def triangles_near(
    chamber: Chamber, triangles: np.ndarray, position: np.ndarray, reach: float
) -> np.ndarray:
    """Return the numbers of the given triangles that are within `reach` [m] of a position (3,)."""
    from sim_core import closest_on_each

    corners = chamber.vertices[chamber.triangles[triangles]]
    low, high = corners.min(axis=1), corners.max(axis=1)
    near = (np.abs(position - np.clip(position, low, high)) <= reach).all(axis=1)
    closest = closest_on_each(corners[near], np.broadcast_to(position, (near.sum(), 3)))
    return np.asarray(triangles[near][np.linalg.norm(closest - position, axis=1) <= reach])


def _with_carriers(resting: Resting, kinds: list[str]) -> list[str]:
    """Return what holds each ball at rest.

    A ball that only other balls carry is held by what holds one of these balls, such as a wall.
    """
    row = {int(ball): i for i, ball in enumerate(resting.ball)}
    kinds = list(kinds)
    # From below upwards, because the balls that carry a ball are below it.
    for i in np.argsort(resting.position[:, 2], kind="stable"):
        carriers = [row[int(ball)] for ball in resting.balls[i] if int(ball) in row]
        if kinds[i] == ON_BALLS:
            kinds[i] = next((kinds[k] for k in carriers if kinds[k]), "on other balls")
    return kinds


def _places(resting: Resting, kinds: list[str], diameter: float) -> list[tuple[str, np.ndarray]]:
    """Return groups of balls at rest: what holds them, and their rows; the largest group first.

    Balls that are near each other and held by the same surfaces belong to one group.

    Args:
        kinds: what holds each ball, in words.
        diameter: diameter of the largest balls [m].
    """
    from scipy.spatial import KDTree

    pairs = KDTree(resting.position).query_pairs(PLACE_DISTANCE * diameter, output_type="ndarray")
    alike = [kinds[one] == kinds[two] for one, two in pairs]
    one, two = pairs[np.array(alike, dtype=bool)].T
    label = connected_pieces(one, two, len(kinds))[1]
    order = sorted(Counter(label.tolist()).items(), key=lambda item: (-item[1], item[0]))
    places = [np.flatnonzero(label == k) for k, _ in order]
    return [(kinds[members[0]], members) for members in places]


def _describe(resting: Resting, members: np.ndarray, kind: str) -> str:
    where, since = around(resting.position[members]), resting.since[members].min()
    if len(members) == 1:
        return f"1 {kind} at {where}, since {since:.2f} s"
    return f"{len(members)} {kind} around {where}, the longest since {since:.2f} s"

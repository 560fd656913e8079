"""Balls that lie still when a replica ends, in the words of a chamber's designer: how many, on what, and where."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.build import TAG_PART
from chamberopt.chamber.checks.place_names import around, surface_names
from chamberopt.geometry.triangles import closest_points

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from sim_core import Resting

TOUCHES = 2e-5  # m: a ball held still is this near to what holds it, or nearer
ONE_PLACE = 3.0  # diameters: balls nearer to each other than that lie in one place
MOST_PLACES = 3  # named, those with most balls first
ON_BALLS = ""
STRAIGHT = (
    1e-6  # of its speed: what goes sideways by less will be on its spot for thousands of hits
)
MUCH = 0.1  # of the shot


@dataclass(frozen=True)
class RestingBalls:
    """The balls at rest at the end of a replica: their ``share`` of the shot, and one ``line`` on where they are."""

    share: float
    line: str


def find_resting_balls(
    resting: Resting, balls: int, diameter: float, chamber: Chamber, part_turns: bool
) -> RestingBalls | None:
    """What lies still of a shot of so many ``balls`` of this ``diameter`` [m]; None if nothing does.

    Of a part that turns it is not known here where it is at the end, so that nothing is said to touch it.
    """
    if len(resting) == 0:
        return None
    surfaces = surface_names(chamber)
    kinds = [
        _kind(resting, i, surfaces, chamber, 0.5 * diameter, part_turns)
        for i in range(len(resting))
    ]
    places = _places(resting, _inherited(resting, kinds), diameter)
    said = [_said(resting, members, kind) for kind, members in places[:MOST_PLACES]]
    others = sum(len(members) for _, members in places[MOST_PLACES:])
    said += [f"{others} elsewhere"] if others else []
    verb = "lies" if len(resting) == 1 else "lie"
    return RestingBalls(
        len(resting) / balls,
        f"{len(resting)} of {balls} balls {verb} still at the end: {'; '.join(said)}",
    )


def bouncing_share(velocities: np.ndarray) -> float:
    """The share of balls, of velocities (n, 3), that go straight up and down: for ever, if nothing meets them."""
    sideways, speed = (
        np.hypot(velocities[:, 0], velocities[:, 1]),
        np.linalg.norm(velocities, axis=1),
    )
    return float(((sideways < STRAIGHT * speed) & (speed > 0.0)).mean())


def bouncing_notes(shares: Sequence[float]) -> tuple[str, ...]:
    """One note where much of the shot, of a ``share`` in each replica, ends so: a trap of faces that are ideal."""
    caught = [share for share in shares if share > MUCH]
    if not caught:
        return ()
    return (
        f"in {len(caught)} of {len(shares)} replicas up to {_percent(max(caught))} of the shot ends bouncing straight "
        "up and down, each ball on its spot: between parallel faces friction takes all sideways speed, which rough "
        "faces would give back; shorten process.accuracy.simulated_time_s, or do not trust where the dents are",
    )


def resting_notes(stuck: list[RestingBalls], replicas: int) -> tuple[str, ...]:
    """One note on all replicas; ``stuck`` has those in which balls came to rest."""
    if not stuck:
        return ()
    share = sum(one.share for one in stuck) / replicas
    worst = max(stuck, key=lambda one: one.share)
    return (
        f"balls came to rest in {len(stuck)} of {replicas} replicas and peen no more: by the end {_percent(share)} of "
        f"the shot, on average of all; where it is most, {worst.line}",
    )


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %"


def _kind(
    resting: Resting,
    i: int,
    surfaces: np.ndarray,
    chamber: Chamber,
    radius: float,
    part_turns: bool,
) -> str:
    """E.g. "on the part's upper side", "jammed between the part's side and the wall"; ON_BALLS if it has only those."""
    under = resting.triangles[i][resting.triangles[i] >= 0]
    if resting.jammed[i]:
        known = chamber.tags != TAG_PART if part_turns else np.ones(len(chamber.tags), dtype=bool)
        under = np.union1d(
            under, _touched(chamber, np.flatnonzero(known), resting.position[i], radius + TOUCHES)
        )
    names = sorted(set(surfaces[under]))
    if not resting.jammed[i]:
        return ON_BALLS if not names else _between("on", names)
    if not names and not part_turns:
        return "jammed among other balls"
    if len(names) < 2:  # so something else holds it too
        names.append("other balls or the part" if part_turns else "other balls")
    return f"jammed {_between('among', names)}"


def _between(at: str, names: list[str]) -> str:
    return (
        f"{at} {names[0]}"
        if len(names) == 1
        else f"between {', '.join(names[:-1])} and {names[-1]}"
    )


def _touched(chamber: Chamber, asked: np.ndarray, position: np.ndarray, reach: float) -> np.ndarray:
    """Which of the triangles ``asked`` are within ``reach`` [m] of a position (3,)."""
    corners = chamber.vertices[chamber.triangles[asked]]
    near = (
        np.abs(position - np.clip(position, corners.min(axis=1), corners.max(axis=1))) <= reach
    ).all(axis=1)
    found = closest_points(corners[near], np.broadcast_to(position, (near.sum(), 3)))
    return np.asarray(asked[near][np.linalg.norm(found - position, axis=1) <= reach])


def _inherited(resting: Resting, kinds: list[str]) -> list[str]:
    """The same, a heap counted to what its lowest balls lie on."""
    seat = {int(ball): i for i, ball in enumerate(resting.ball)}
    kinds = list(kinds)
    for i in np.argsort(resting.position[:, 2], kind="stable"):  # what carries a ball is below it
        carriers = [seat[int(ball)] for ball in resting.balls[i] if int(ball) in seat]
        if kinds[i] == ON_BALLS:
            kinds[i] = next((kinds[k] for k in carriers if kinds[k]), "on other balls")
    return kinds


def _places(resting: Resting, kinds: list[str], diameter: float) -> list[tuple[str, np.ndarray]]:
    """Kind and members of each place, that with most balls first."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    pairs = KDTree(resting.position).query_pairs(ONE_PLACE * diameter, output_type="ndarray")
    alike = [kinds[one] == kinds[two] for one, two in pairs]
    one, two = pairs[np.array(alike, dtype=bool)].T
    links = coo_array((np.ones(len(one), dtype=bool), (one, two)), shape=(len(kinds),) * 2)
    label = connected_components(links, directed=False)[1]
    order = sorted(Counter(label.tolist()).items(), key=lambda item: (-item[1], item[0]))
    places = [np.flatnonzero(label == k) for k, _ in order]
    return [(kinds[members[0]], members) for members in places]


def _said(resting: Resting, members: np.ndarray, kind: str) -> str:
    where = around(resting.position[members])
    if len(members) == 1:
        return f"1 {kind} at {where}, since {resting.since[members[0]]:.2f} s"
    return f"{len(members)} {kind} around {where}, the longest since {resting.since[members].min():.2f} s"

"""Write notes on balls that hop on one spot or rattle in a gap while impacts are recorded.

Their impacts are in the figures, although they dent one spot again and again. What *locked*
and *jammed* mean is defined in sim_core/loop/stays.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.checks.place_names import around, surface_names
from chamberopt.common.number_text import percent
from chamberopt.design.shape_surface import TAG_PART
from chamberopt.simulation.resting_balls import join_names, triangles_near

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from sim_core import SimulationResult

# Share of the shot's time, or of the impacts, from which on there is a note. Below it no figure
# changes by as much as its interval.
MIN_SHARE = 0.01
REACH = 0.1  # ball diameters from a jammed ball within which a surface is named


@dataclass(frozen=True)
class TrappedBalls:
    """What locked and jammed balls did in one replica, as shares.

    Args:
        locked_time: share of the balls times recorded time in which balls hopped on one spot.
        locked_impacts: share of the impacts on the part that these hops made.
        locked_at_end: share of the balls that hopped on one spot at the end.
        jammed_time, jammed_impacts: the same shares for balls in a gap.
        place: surfaces and position of the gap whose balls hit the part most often; "" without.
    """

    locked_time: float
    locked_impacts: float
    locked_at_end: float
    jammed_time: float
    jammed_impacts: float
    place: str


SHARES = tuple(one.name for one in fields(TrappedBalls) if one.name != "place")


def find_trapped_balls(
    result: SimulationResult, duration: float, chamber: Chamber, part_turns: bool
) -> TrappedBalls:
    """Return what locked and jammed balls did in a replica.

    Args:
        duration: recorded time [s].
        part_turns: whether the part turns. Its surfaces are then not named.
    """
    found, balls = result.trapped, len(result.balls)
    impacts = max(len(result.impacts), 1)
    time = balls * duration
    hops = found.at_end & (found.locked > 0.0)
    return TrappedBalls(
        locked_time=min(1.0, float(found.locked.sum()) / time),
        locked_impacts=int(found.locked_hits.sum()) / impacts,
        locked_at_end=int(hops.sum()) / balls,
        jammed_time=min(1.0, float(found.jammed.sum()) / time),
        jammed_impacts=int(found.jammed_hits.sum()) / impacts,
        place=_place(result, chamber, part_turns),
    )


def _place(result: SimulationResult, chamber: Chamber, part_turns: bool) -> str:
    """Return the surfaces and the position of the jammed ball that hits most often; "" for none."""
    found = result.trapped
    if not found.jammed.any():
        return ""
    worst = int(np.argmax(found.jammed_hits + found.jammed))
    position, diameter = found.position[worst], result.balls.diameters[found.ball[worst]]
    known = chamber.tags != TAG_PART if part_turns else np.ones(len(chamber.tags), dtype=bool)
    near = triangles_near(chamber, np.flatnonzero(known), position, (0.5 + REACH) * diameter)
    names = sorted(set(surface_names(chamber)[near])) or ["the part"]
    return f"{join_names('at', names)}, around {around(position[None])}"


def trapped_shares(found: Sequence[TrappedBalls]) -> dict[str, float]:
    """Return the mean of each share over the replicas, by its name; nothing without replicas."""
    if not found:
        return {}
    return {name: float(np.mean([getattr(one, name) for one in found])) for name in SHARES}


def trapped_notes(found: Sequence[TrappedBalls], rough: bool) -> tuple[str, ...]:
    """Return notes on locked and on jammed balls, if there are so many that figures change.

    Args:
        found: what they did in each replica.
        rough: whether the design has rough faces.
    """
    mean = trapped_shares(found)
    notes = []
    if mean and max(mean["locked_time"], mean["locked_impacts"]) >= MIN_SHARE:
        some = sum(one.locked_time > 0.0 for one in found)
        end = mean["locked_at_end"]
        ends = "" if not end else f", and at the end {_of_the_shot(end)} did"
        remedy = (
            "the shot may be too dense to move sideways: lower shot.mass_g"
            if rough
            else "smooth faces with friction take all sideways speed of a few balls, and rough "
            "ones give it back: give effects.roughness, e.g. { slope_deg = 3 }"
        )
        notes.append(
            f"in {some} of {len(found)} replicas balls hopped up and down on one spot: "
            f"{percent(mean['locked_time'])} of the shot's time and "
            f"{percent(mean['locked_impacts'])} of the impacts on the part{ends}; do not trust "
            f"where the dents are; {remedy}"
        )
    if mean and max(mean["jammed_time"], mean["jammed_impacts"]) >= MIN_SHARE:
        some = sum(one.place != "" for one in found)
        worst = max(found, key=lambda one: (one.jammed_impacts, one.jammed_time))
        notes.append(
            f"in {some} of {len(found)} replicas balls sat in a gap hardly narrower or wider than "
            f"themselves: {percent(mean['jammed_impacts'])} of the impacts on the part are their "
            f"rattling, in {percent(mean['jammed_time'])} of the shot's time, e.g. {worst.place}; "
            "their slow impacts lower the mean speed; give another shot.diameter_mm than the gap, "
            "or close it"
        )
    return tuple(notes)


def _of_the_shot(share: float) -> str:
    return "all balls" if share >= 1.0 else f"{percent(share)} of the shot"

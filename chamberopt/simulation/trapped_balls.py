"""Write notes on balls that hop on one spot or rattle in a gap while impacts are recorded.

Hops are in the figures, although they dent one spot again and again. Rattling balls are jammed,
held in their gap, and the simulator leaves their impacts out, so that they are in no figure.
Definitions of *hopping* and *rattling* balls are in sim_core/loop/stays.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.chamber.checks.place_names import around, surface_names
from chamberopt.common.number_text import percent, plain
from chamberopt.design.shape_surface import TAG_PART
from chamberopt.simulation.resting_balls import join_names, triangles_near

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from sim_core import SimulationResult

# Share of the shot's time, or of the impacts, from which on there is a note. Below it no figure
# changes by as much as its interval.
MIN_SHARE = 0.01
REACH = 0.1  # ball diameters from a rattling ball within which a surface is named


@dataclass(frozen=True)
class TrappedBalls:
    """What hopping and rattling balls did in one replica, as shares.

    Args:
        hopping_time: share of the balls times recorded time in which balls hopped on one spot.
        hopping_impacts: share of the impacts on the part that these hops made.
        hopping_at_end: share of the balls that hopped on one spot at the end.
        rattling_time: share of the balls times recorded time in which balls were held in a gap.
        rattling_impacts: share of all impacts on the part that they made there, which are left out.
        rattling_balls: share of the balls that were held in a gap at some time.
        rattling_longest: share of the recorded time in which the ball held longest was held.
        place: surfaces and position of the gap whose balls hit the part most often; "" without.
    """

    hopping_time: float
    hopping_impacts: float
    hopping_at_end: float
    rattling_time: float
    rattling_impacts: float
    rattling_balls: float
    rattling_longest: float
    place: str


NOT_TRAPPED = TrappedBalls(
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, ""
)  # in a replica of which nothing is known
SHARES = tuple(one.name for one in fields(TrappedBalls) if one.name != "place")


def find_trapped_balls(
    result: SimulationResult, duration: float, chamber: Chamber, part_turns: bool
) -> TrappedBalls:
    """Return what hopping and rattling balls did in a replica.

    Args:
        duration: recorded time [s].
        part_turns: whether the part turns. Its surfaces are then not named.
    """
    found, balls = result.trapped, len(result.balls)
    left_out = int(found.rattling_hits.sum())
    impacts = max(len(result.impacts) + left_out, 1)
    time = balls * duration
    hops = found.at_end & (found.hopping > 0.0)
    return TrappedBalls(
        hopping_time=min(1.0, float(found.hopping.sum()) / time),
        hopping_impacts=int(found.hopping_hits.sum()) / impacts,
        hopping_at_end=int(hops.sum()) / balls,
        rattling_time=min(1.0, float(found.rattling.sum()) / time),
        rattling_impacts=left_out / impacts,
        rattling_balls=int((found.rattling > 0.0).sum()) / balls,
        rattling_longest=min(1.0, float(found.rattling.max(initial=0.0)) / duration),
        place=_place(result, chamber, part_turns),
    )


def _place(result: SimulationResult, chamber: Chamber, part_turns: bool) -> str:
    """Return surfaces and position of the rattling ball that hits most often; "" for none."""
    found = result.trapped
    if not found.rattling.any():
        return ""
    worst = int(np.argmax(found.rattling_hits + found.rattling))
    position, diameter = found.position[worst], result.balls.diameters[found.ball[worst]]
    known = chamber.tags != TAG_PART if part_turns else np.ones(len(chamber.tags), dtype=bool)
    near = triangles_near(chamber, np.flatnonzero(known), position, (0.5 + REACH) * diameter)
    names = sorted(set(surface_names(chamber)[near])) or ["the part"]
    return f"{join_names('at', names)}, around {around(position[None])}"


def mean_trapped(found: Sequence[TrappedBalls]) -> TrappedBalls | None:
    """Return the mean of each share over the replicas, and the place of the replica with most.

    It is None without replicas.
    """
    if not found:
        return None
    worst = max(found, key=lambda one: (one.rattling_impacts, one.rattling_time))
    means: dict[str, Any] = {
        name: float(np.mean([getattr(one, name) for one in found])) for name in SHARES
    }
    return replace(worst, **means)


def jammed_text(mean: TrappedBalls, design: Design) -> str:
    """Return how many balls are lost in gaps and for how long, as text; "" if hardly any are."""
    if max(mean.rattling_time, mean.rattling_impacts) < MIN_SHARE:
        return ""
    seconds = design.process.recorded_time
    return (
        f"{plain(mean.rattling_balls * design.shot.count, 2)} of {design.shot.count} balls "
        "are held or rattle in gaps hardly wider than themselves, the longest one for "
        f"{plain(mean.rattling_longest * seconds, 2)} of {plain(seconds, 2)} s: the shot "
        f"loses {percent(mean.rattling_time)} of its time, and "
        f"{percent(mean.rattling_impacts)} of all impacts on the part are those of held "
        "balls, which count in no figure"
    )


def trapped_notes(found: Sequence[TrappedBalls], design: Design) -> tuple[str, ...]:
    """Return notes on hopping and on rattling balls, if there are so many that they matter.

    Args:
        found: what they did in each replica.
    """
    mean = mean_trapped(found)
    notes = []
    if mean and max(mean.hopping_time, mean.hopping_impacts) >= MIN_SHARE:
        some = sum(one.hopping_time > 0.0 for one in found)
        end = mean.hopping_at_end
        ends = "" if not end else f", and at the end {_of_the_shot(end)} did"
        remedy = (
            "the shot may be too dense to move sideways: lower shot.mass_g"
            if design.effects.roughness is not None
            else "smooth faces with friction take all sideways speed of a few balls, and rough "
            "ones give it back: give effects.roughness, e.g. { slope_deg = 3 }"
        )
        notes.append(
            f"in {some} of {len(found)} replicas balls hopped up and down on one spot: "
            f"{percent(mean.hopping_time)} of the shot's time and "
            f"{percent(mean.hopping_impacts)} of the impacts on the part{ends}; do not trust "
            f"where the dents are; {remedy}"
        )
    if mean and (jammed := jammed_text(mean, design)):
        notes.append(
            f"{jammed}; e.g. {mean.place} in the chamber's frame; give another "
            "shot.diameter_mm than the gap, or close it"
        )
    return tuple(notes)


def _of_the_shot(share: float) -> str:
    return "all balls" if share >= 1.0 else f"{percent(share)} of the shot"

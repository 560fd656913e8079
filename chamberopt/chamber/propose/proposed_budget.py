"""Propose how long to peen, how long to simulate, and in which windows, by what a pilot measured.

A window, a disc of the target, gets d g t dents: d dents per area and simulated time in the median
window, g its area (the gauge), t the simulated time of all replicas. Single places take 25 dents in
a window, the mean the more, the longer the treatment is (chamberopt/coverage/coverage_intervals).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from chamberopt.chamber.matters import MatterKind
from chamberopt.chamber.propose.proposal import MOST_REPLICAS, REPLICAS, Proposal, touched_share
from chamberopt.common.errors import InputError
from chamberopt.common.number_text import rounded
from chamberopt.design.intensity import PredictedIntensity

DENTS, MARGIN = 25.0, 1.3  # needed in a window; over what is needed, as a pilot is short
COVERED = 0.95  # share of the target's area whose time to 98 % counts
SLOWER = 2.0  # times as slow as the start: candidates of a search that are still resolved
# Of all replicas, for MINUTES on two cores, with 1.2 times as many at the ends of friction and of
# other ranges: 0.5e5 (4,000 balls) to 1.1e5 (160 balls) in a second of a core were measured.
COLLISIONS = 2e7
MINUTES = 6.0
LEAST_TIME, MOST_TIME = 0.1, 1000.0  # s, of each replica
LEAST_WARMUP = 0.2  # s: balls cross the chamber some times
# Warm-up over the time after which a pilot no longer tells that the shot slows down: a simulation,
# which is longer, resolves less.
LONGER_WARMUP = 1.5
ROUND = (1, 1.5, 2, 3, 5, 7)  # numbers that times and windows are rounded to
MODEST_GB = 2.0  # that what is proposed takes, with its process, whatever the machine has
OF_MEMORY = f"{MODEST_GB:g} GB of memory"
UNSETTLED = "the shot still slowed down at the end of the pilot: results say whether it has settled"
SLOW_TO_SETTLE = "until then the shot still slowed down, by a pilot"
USUAL_GAUGE = 1e-6  # m²: wider only where the time would be too long
WIDEST = 0.02  # of the target's area
# What is set on a machine [s]: above them quarters of an hour, below them whole seconds.
QUARTER = 900.0
SET_TIMES = (
    *(10, 15, 20, 30, 45, 60, 90, 120, 180, 240, 300, 360, 420, 480, 540, 600),
    *(720, 900, 1200, 1500, 1800, 2400, 3000, 3600),
)
# Factors on the pilot's time, which is short. Where it resolves no single places, the least covered
# ones lag behind the target on average: 326 s against 133 s in a joint's chamber, 2900 s against
# 950 s of a bevel gear's teeth.
MORE, LAGGING = 1.3, 3.0
ROUGH = 0.4  # half-width of a time over the time, from which on that is a matter to settle
LONG = 1800.0  # s
UNEVEN = 1.5  # time of single places over that of the target on average, from which on they rule


class TooSlowError(InputError):
    """A design takes longer than a pilot was to look at; the text says how long at least."""


class Measured(NamedTuple):
    """What a pilot run measured of a design, at the slow end of friction.

    Attributes:
        dent_rate: dents in the median window, over its area and the time [1/(m² s)].
        collision_rate: collisions of one replica in a simulated second [1/s].
        time_to_98: after which 98 % of the target are dented [s].
        places: of 95 % of the target, each place; not of the whole on average.
        spread: half-width of the time's 95 % interval [s]; infinite if it is not known.
        friction: the friction was that of the slow end, not absent or known exactly.
        dents_for_mean: dents in the median window that the mean takes, for each s of treatment.
        target: area of the target [m²].
        simulated: simulated time of all replicas of the pilot [s].
        mean_time: after which the target is 98 % covered on average [s].
        warmup: after which the shot no longer slowed down [s].
        settled: this is known; otherwise it is half of the pilot.
        intensity: Almen intensity in wide windows, a little more than in single places where these
            differ; None if it is not known.
        room: simulated time of all replicas that MODEST_GB have room for [s].
    """

    dent_rate: float
    collision_rate: float
    time_to_98: float
    places: bool
    spread: float
    friction: bool
    dents_for_mean: float
    target: float
    simulated: float
    mean_time: float
    warmup: float = 0.0
    settled: bool = True
    intensity: PredictedIntensity | None = None
    room: float = math.inf

    @property
    def in_words(self) -> str:
        """The time to 98 %."""
        return f"98 % after about {rounded(self.time_to_98, 2)} s"


class Budget(NamedTuple):
    """Treatment time, simulated time and number of replicas, and gauge, each with its reason."""

    treatment: float  # [s]
    time: float  # [s]
    gauge_mm2: float
    warmup: float  # [s], of each replica
    reasons: dict[str, str]  # by dotted name
    search_time: float  # [s], as in Proposal
    most_replicas: int = MOST_REPLICAS


class Asked(NamedTuple):
    """What is asked of the budget beside the time to 98 %.

    Attributes:
        coverage_percent: wanted coverage; 200 is twice the time to 98 %.
        strength_dents: dents in the median window that the peening strength takes; 0 if that is not
            known.
        is_wish: an intensity is asked for: windows are wider, if its strength takes that.
        in_search: strength counts in the search too, as a study limits it.
    """

    coverage_percent: float | None = None
    strength_dents: float = 0.0
    is_wish: bool = True
    in_search: bool = False


def propose_budget(found: Measured, asked: Asked | None = None) -> Budget:
    """Return the budget with which single places of the target are probably resolved."""
    coverage_percent, strength_dents, is_wish, in_search = asked or Asked()
    times = (coverage_percent or 100.0) / 100.0
    longer = LAGGING * found.time_to_98
    if found.places:  # and what the pilot is not sure of
        longer = max(MORE * found.time_to_98, found.time_to_98 + found.spread)
    treatment = settable(times * longer)
    for_coverage = max(MARGIN * DENTS, found.dents_for_mean * treatment)
    needed = max(for_coverage, strength_dents)
    enough = needed / (REPLICAS * found.dent_rate * USUAL_GAUGE)
    most = COLLISIONS / (REPLICAS * found.collision_rate)
    time = _rounded_up(min(max(enough, LEAST_TIME), max(most, LEAST_TIME), MOST_TIME))
    time, most_replicas, is_full = _within(found.room, time)
    bound = f"{MINUTES:g} minutes of two cores"
    if is_full:
        bound = OF_MEMORY
    dents = REPLICAS * found.dent_rate * USUAL_GAUGE * time
    if not is_wish:
        needed = max(for_coverage, min(needed, dents))
    widest = max(1.0, WIDEST * found.target / USUAL_GAUGE)
    gauge = min(_rounded_up(max(1.0, needed / dents)), float(f"{widest:.2g}"))
    expected = (
        f"about {rounded(dents * gauge, 2)} dents in a window by a pilot; {needed:.0f} would do"
    )
    few = f"; {MatterKind.FEW_DENTS} are simulated in {bound}: simulate longer"
    wider = f"wider than the usual 1 mm²: enough dents within {bound}"
    reasons = {
        "process.treatment_time_s": _said_of_treatment(found, treatment, coverage_percent),
        "process.accuracy.simulated_time_s": expected + (few if dents * gauge < needed else ""),
    }
    warmup = _rounded_up(max(LEAST_WARMUP, LONGER_WARMUP * found.warmup))
    if not found.settled:
        reasons["process.accuracy.warmup_time_s"] = UNSETTLED
    elif warmup > LEAST_WARMUP:
        reasons["process.accuracy.warmup_time_s"] = SLOW_TO_SETTLE
    if is_full:
        reasons["process.accuracy.simulated_time_s"] += f"; no longer, to stay within {OF_MEMORY}"
    if most_replicas < MOST_REPLICAS:
        reasons["process.accuracy.max_replicas"] = f"no more, to stay within {OF_MEMORY}"
    if gauge > 1.0:
        reasons["process.accuracy.gauge_mm2"] = wider
    # The time to 98 % takes DENTS alone, where the mean takes more. A slow candidate has fewer.
    least = max(SLOWER * DENTS, strength_dents if in_search else 0.0)
    share = min(1.0, least / (dents * gauge)) if found.places else 1.0
    return Budget(treatment, time, gauge, warmup, reasons, REPLICAS * time * share, most_replicas)


def _within(room: float, time: float) -> tuple[float, int, bool]:
    """Return simulated time [s] and most replicas for which there is room, and if time was cut.

    Args:
        room: that of Measured.
        time: wanted simulated time of each replica [s].
    """
    # More replicas take the memory that fewer, longer ones do.
    most_replicas = MOST_REPLICAS if MOST_REPLICAS * time <= room else REPLICAS
    is_full = REPLICAS * time > room
    if is_full:
        time = max(LEAST_TIME, _rounded_down(room / REPLICAS))
    return time, most_replicas, is_full


def within_room(made: Proposal, room: float) -> Proposal:
    """Return a proposal that no pilot measured, simulated for as long as there is room.

    Args:
        room: that of Measured.
    """
    accuracy = made.tables["process.accuracy"]
    time, most_replicas, is_full = _within(room, accuracy["simulated_time_s"])
    values = {"simulated_time_s": time, "max_replicas": most_replicas}
    if all(accuracy[key] == value for key, value in values.items()):
        return made
    name = f"process.accuracy.{'simulated_time_s' if is_full else 'max_replicas'}"
    before = f"{made.reasons[name]}; " if name in made.reasons else ""
    reason = f"{before}no {'longer' if is_full else 'more'}, to stay within {OF_MEMORY}"
    return replace(
        made,
        tables={**made.tables, "process.accuracy": {**accuracy, **values}},
        reasons={**made.reasons, name: reason},
        design=made.design.changed({f"process.accuracy.{key}": x for key, x in values.items()}),
    )


def measured_budget(made: Proposal, found: Measured) -> Budget:
    """Return the budget of a proposal that follows from a pilot."""
    is_limited = not made.design.why_no_intensity
    process = made.design.process
    is_wish = process.intensity_mmA is not None
    asked = Asked(process.coverage_percent, made.strength_dents, is_wish, is_limited)
    return propose_budget(found, asked)


def in_turn(budgets: Sequence[Budget]) -> Budget:
    """Return the budget of steps, one after another, of which each has a budget of its own."""
    reasons = {key: text for one in reversed(budgets) for key, text in one.reasons.items()}
    for key, field in (("treatment_time_s", "treatment"), ("accuracy.simulated_time_s", "time")):
        name = f"process.{key}"
        each = ((getattr(one, field), one.reasons[name]) for one in budgets)
        reasons[name] = "; then ".join(f"{rounded(time, 3)} s, {text}" for time, text in each)
    return Budget(
        treatment=sum(one.treatment for one in budgets),
        time=_rounded_up(sum(one.time for one in budgets)),
        gauge_mm2=max(one.gauge_mm2 for one in budgets),
        warmup=max(one.warmup for one in budgets),
        reasons=reasons,
        search_time=sum(one.search_time for one in budgets),
        most_replicas=min(one.most_replicas for one in budgets),
    )


def with_budget(made: Proposal, budget: Budget) -> Proposal:
    """Return a proposal with a budget in the place of its own."""
    values = {
        "process.treatment_time_s": budget.treatment,
        "process.accuracy.simulated_time_s": budget.time,
        "process.accuracy.gauge_mm2": budget.gauge_mm2,
        "process.accuracy.warmup_time_s": budget.warmup,
        "process.accuracy.max_replicas": budget.most_replicas,
    }
    tables = {name: dict(table) for name, table in made.tables.items()}
    for name, value in values.items():
        table, _, key = name.rpartition(".")
        tables[table][key] = value
    reasons = {**made.reasons, **budget.reasons}
    design = made.design.changed(values)
    search_time = budget.search_time if touched_share(made) > COVERED else None
    return replace(made, tables=tables, reasons=reasons, design=design, search_time=search_time)


def settable(seconds: float) -> float:
    """Return the next longer time that is usually set on a machine [s]."""
    if seconds <= SET_TIMES[0]:
        return float(max(1, math.ceil(seconds)))
    if seconds > SET_TIMES[-1]:
        return QUARTER * math.ceil(seconds / QUARTER)
    return float(next(one for one in SET_TIMES if one >= seconds))


def _said_of_treatment(found: Measured, treatment: float, coverage_percent: float | None) -> str:
    """Return in words from what the proposed treatment time follows.

    Args:
        treatment: the treatment time [s].
        coverage_percent: wanted coverage, if one was asked for.
    """
    spread = f" ± {rounded(found.spread, 1)}" if math.isfinite(found.spread) else ""
    what = "95 % of the target is 98 % covered"
    if not found.places:
        out = "places are out of reach or not resolved"
        what = f"the target has the dents of 98 % coverage ON AVERAGE ({out})"
    friction = " at the slow end of friction" if found.friction else ""
    more = f", times {LAGGING:g}"
    if found.places:
        is_rough = found.spread > (MORE - 1.0) * found.time_to_98
        more = f", and {'its ±' if is_rough else f'{MORE - 1.0:.0%}'} more"
    long = f"; {MatterKind.LONG}: {_said_of_long(found)}" if found.time_to_98 > LONG else ""
    if found.places and found.spread > ROUGH * found.time_to_98:
        known = f"to ± {found.spread / found.time_to_98:.0%}"
        long += f"; {MatterKind.ROUGH_TIME}, {known}: simulate before it is set"
    if not found.places:
        long += (
            f"; {MatterKind.TIME_NOT_RESOLVED} for single places, at least "
            f"{rounded(found.time_to_98, 2)} s: simulate before it is set. Without that, peen so "
            "long, look at the least open places (such as roots) through a magnifier of 10 to 30 "
            "times, and go on, for twice as long each time, until no more dents are seen"
        )
    wanted = ""
    if coverage_percent is not None:
        times = rounded(coverage_percent / 100.0, 3)
        wanted = f", {times} times that for the {coverage_percent:g} % that is asked for"
    multiple = rounded(treatment / found.time_to_98, 2)
    return (
        f"an estimate, rounded up: after about {rounded(found.time_to_98, 2)}{spread} s {what}"
        f"{friction}, by a pilot of {rounded(found.simulated, 2)} simulated s{wanted}{more}, "
        f"in all {multiple} times as long{long}"
    )


def _said_of_long(found: Measured) -> str:
    """Return in words what makes a treatment long, and what shortens it."""
    uneven = found.time_to_98 / found.mean_time
    if uneven > UNEVEN:
        return (
            f"the least covered places take {rounded(uneven, 2)} times as long as the target on "
            "average: more poses ([[steps]]), or more room beside these, may do"
        )
    return "few balls get to the target, or slowly: a larger sonotrode, harder balls or the study"


def _rounded_down(value: float) -> float:
    """Return the last of 1, 1.5, 2, 3, 5, 7 and their decimal multiples that is no more; or 0."""
    if value <= 0.0:
        return 0.0
    power = 10.0 ** math.floor(math.log10(value) + 1e-9)
    return float(f"{max(k for k in ROUND if k == 1 or k * power <= value) * power:.3g}")


def _rounded_up(value: float) -> float:
    """Return the next of 1, 1.5, 2, 3, 5, 7 and their decimal multiples."""
    power = 10.0 ** math.floor(math.log10(value) + 1e-9)
    return float(f"{next(k for k in (*ROUND, 10) if k * power >= value * 0.999) * power:.3g}")

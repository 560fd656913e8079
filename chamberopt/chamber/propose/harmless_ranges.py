"""Keep the study of a proposal within heights at which balls do not come to rest or jam anew.

A search would spend its time there: balls that are held make a candidate many times slower.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.propose.proposal import Proposal, holding, new_harm, warned_again
from chamberopt.common.errors import InputError
from chamberopt.common.executor import core_count

ENDS = "low", "high"


def with_harmless_ranges(made: Proposal) -> Proposal:
    """Return a proposal whose study ends where a length of the chamber alone would do new harm.

    Each end of its range is tried, then halfway to it from the proposed value; else the range ends
    at that value.
    """
    ends = [
        (name, end)
        for name, one in made.bounds.items()
        if name.startswith("chamber.") and "low" in one
        for end in ENDS
    ]
    bounds = {name: dict(one) for name, one in made.bounds.items()}
    with ThreadPoolExecutor(core_count()) as threads:
        found = threads.map(lambda one: _farthest(made, *one), ends)
        for (name, end), value in zip(ends, found, strict=True):
            bounds[name][end] = value
    return replace(made, bounds=holding(bounds, made.design))


def _farthest(made: Proposal, name: str, end: str) -> float:
    """Return the value farthest from the proposed one, towards an end, that does no new harm."""
    now, one = made.design.value(name), made.bounds[name]
    halfway = now + one["step"] * round(0.5 * (one[end] - now) / one["step"])
    tried = (float(one[end]), float(halfway))
    return next((x for x in tried if x == now or not _does_harm(made, name, x)), float(now))


def _does_harm(made: Proposal, name: str, value: float) -> bool:
    design = made.design.changed({name: value})
    try:
        chamber = build_chamber(design)
    except InputError:
        return False  # the search refuses it without a simulation
    warnings = warned_again(made, design, chamber)
    other = replace(made, design=design, chamber=chamber, warnings=warnings)
    return new_harm(other, made) is not None

"""Warnings about facets of a part's rounds that are left as the file has them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.reach.reach import TOLERATED_OVERLAP

if TYPE_CHECKING:
    from chamberopt.chamber.part import Part

LEAST_SHARE = 0.01  # of the target's area that is worth a word
LEFT = "coverage is that of facets: "  # begins the warning


def facet_warnings(part: Part, ball: float, reachable: float) -> list[str]:
    """A warning that the figures of the target are those of its facets.

    Args:
        ball: diameter of the smallest ball [m].
        reachable: share of the target that it can touch between the facets.
    """
    facts = part.smoothing
    if facts is None or facts.coarse_share < LEAST_SHARE:
        return []
    noisy = facts.noisy_share >= max(facts.crossing_share, LEAST_SHARE)
    if noisy:
        why = "which fit no round, as on a scan or on bevels, and were left as they are"
        remedy = "if rounds are meant, smooth the scan or give a mesh with finer facets"
    elif facts.crossing_share >= LEAST_SHARE:
        why = "which would cross others if they were divided"
        remedy = "give a mesh with finer facets"
    else:
        why = "which were left as they are"
        remedy = "give a mesh with finer facets, or change part.smoothing"
    return [
        f"{LEFT}they turn by {np.degrees(facts.coarse_turn):.2g} degrees on "
        f"{facts.coarse_share:.0%} of the target, {why}; in their hollows a ball lies across two "
        f"of them: by facets a ball of {1e3 * ball:g} mm touches {reachable:.1%} of the target, by "
        f"the curvature of its rounds up to {touched_by_curvature(part, ball):.1%}; {remedy}"
    ]


def touched_by_curvature(part: Part, ball: float) -> float:
    """Share of the target where no hollow is rounder than a ball of a diameter [m]."""
    if part.hollow is None:
        return 1.0
    fits = part.hollow * 0.5 * ball <= 1.0 + TOLERATED_OVERLAP
    area = part.area[part.target]
    return float(area[fits[part.target]].sum() / area.sum())

"""Tell whether the shot had settled when recording began, by how fast it dents the target.

A replica begins with its balls spread over the chamber. Until as many come to rest, or get to the
far side of the part, as leave, the rate of dents falls. A warm-up that ends before leaves figures
that are those of a livelier shot, whatever their intervals say (R. W. Conway, "Some tactical
problems in digital simulation", Management Science 10, 1963).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.estimate import Estimate, estimate
from chamberopt.common.number_text import estimate_text

if TYPE_CHECKING:
    from chamberopt.coverage.part_impacts import Hits
    from chamberopt.design.load import Design

CONFIDENCE = 0.99  # that the halves differ, as the note is seldom wanted
LEAST = 0.01  # relative difference of the halves that is worth a note
SETTLED = 0.05  # relative difference of a pilot's rates that counts as none
SIGMAS = 2.0  # of the scatter of a pilot's rate, beside SETTLED
SHORTEST = 0.1  # s: shortest warm-up that a pilot is asked for


def dented_halves(
    hits: Hits, time: np.ndarray, target: np.ndarray, end: float
) -> tuple[float, float]:
    """Return the squared diameters of dents on the target [m²] in both halves of a replica.

    Args:
        hits: the impacts on the part.
        time: of each of them [s], (k,).
        target: marks the triangles of the target, (m,).
        end: of the replica [s].
    """
    size = np.where(target[hits.triangle], hits.dent, 0.0) ** 2
    late = time > 0.5 * end
    return float(size[~late].sum()), float(size[late].sum())


def first_half_excess(halves: Sequence[tuple[float, float]]) -> Estimate | None:
    """Return by what share the target was dented more in the first halves of the replicas.

    It is None unless it differs from 0 by more than noise.

    Args:
        halves: of each replica, as of `dented_halves`.
    """
    both = np.array(halves, dtype=float)
    if len(both) < 2 or not both[:, 1].sum() > 0.0:
        return None
    change = estimate((both[:, 0] - both[:, 1]) / both[:, 1].mean(), confidence=CONFIDENCE)
    return None if abs(change.value) < max(LEAST, change.half_width) else change


def settling_notes(change: Estimate | None, design: Design) -> tuple[str, ...]:
    """Return a note if the target was dented faster, or slower, in the first halves of replicas.

    Args:
        change: as of `first_half_excess`.
    """
    if change is None:
        return ()
    accuracy = design.process.accuracy
    enough = float(f"{accuracy.warmup_time_s + 0.5 * accuracy.simulated_time_s:.2g}")
    more = "more" if change.value > 0.0 else "less"
    by = estimate_text(replace(change, value=abs(change.value)), 100.0, "%")
    return (
        f"the shot had NOT SETTLED when recording began: it dented the target by {by} {more} in "
        "the first half of each replica than in the second, so figures are those of a shot that is "
        f"not yet steady; raise process.accuracy.warmup_time_s from {accuracy.warmup_time_s:g} to "
        f"{enough:g} or more",
    )


def settled_after(time: np.ndarray, size: np.ndarray, end: float) -> tuple[float, bool]:
    """Return the time [s] after which a pilot's rate of dents no longer falls, and if it is known.

    The rate is compared with that of the last half, over the halves, quarters, eighths ... of the
    pilot before. It is not known where the quarter before is above it, or the pilot is too short.

    Args:
        time: of the impacts on the target in all replicas [s], (k,).
        size: what each of them dents, (k,).
        end: of the pilot [s].
    """
    begin, settled = 0.5 * end, False
    late = time > begin
    last = float(size[late].sum()) / begin
    while 0.5 * begin >= SHORTEST:
        inside = (time > 0.5 * begin) & (time <= begin)
        rate = float(size[inside].sum()) / (0.5 * begin)
        scatter = float(np.sqrt(np.square(size[inside]).sum())) / (0.5 * begin)
        if rate > (1.0 + SETTLED) * last + SIGMAS * scatter:
            break
        begin, settled = 0.5 * begin, True
    return begin, settled

"""One ball on a shaken plate: where it locks to the shaking, and where its period doubles."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.cases.row import Row
from tests.helpers.scenes.shaken_plate import first_doubling, first_locking, in_step

# Restitutions, and round Γ between which a ball locks. Where all brackets are the same multiple of
# theory, all are off by the same.
BRACKETS = {0.3: (1.6, 1.8), 0.5: (1.0, 1.1), 0.7: (0.5, 0.6), 0.8: (0.3, 0.4), 0.9: (0.1, 0.2)}
PERIODS = 3_000  # below it a ball may keep step for about 1 / sqrt(what is missing) periods
IN_STEP = 0.2  # rad
BRACKET = 3e-5  # of Γ
NUDGE = 1e-7  # of g / omega²: far above rounding, far below what bends the map
BOUNCES = 12


def locks(gamma: float, e: float) -> bool:
    """Whether a ball dropped into step with the plate still is after PERIODS."""
    hits = in_step(gamma, e, PERIODS)
    phase = math.acos(min(first_locking(e) / gamma, 1.0))
    last = hits[-1, 0] - phase
    return len(hits) == PERIODS and bool(abs((last + math.pi) % math.tau - math.pi) < IN_STEP)


def locking(e: float) -> tuple[float, float]:
    """The Γ from which a ball locks, by halving, and half of the last bracket."""
    low, high = BRACKETS[e]
    while high - low > 2.0 * BRACKET * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if locks(middle, e) else (middle, high)
    return 0.5 * (low + high), 0.5 * (high - low)


def multiplier(gamma: float, e: float) -> float:
    """By how much a small difference in phase grows from one bounce to the next."""
    phases = [in_step(gamma, e, BOUNCES + 1, higher)[:BOUNCES, 0] for higher in (-NUDGE, NUDGE)]
    difference = phases[1] - phases[0]
    # Two eigenvalues whose product is e²: the differences follow d(k+1) = trace d(k) - e² d(k-1).
    after, now, before = difference[2:], difference[1:-1], difference[:-2]
    trace = float(now @ (after + e * e * before) / (now @ now))
    return 0.5 * (trace - math.sqrt(max(trace * trace - 4.0 * e * e, 0.0)))


def doubling(e: float) -> float:
    """The Γ at which the multiplier is -1, where a difference neither grows nor shrinks."""
    from scipy.optimize import brentq

    theory = first_doubling(e)
    return float(brentq(lambda gamma: multiplier(gamma, e) + 1.0, 0.99 * theory, 1.01 * theory,
                        xtol=1e-9))  # fmt: skip


def rows() -> Iterator[Row]:
    for e in BRACKETS:
        yield Row("bouncing ball", f"e = {e}", "Γ from which it locks to the shaking",
                  first_locking(e), 0.0, *locking(e))  # fmt: skip
    for e in BRACKETS:
        yield Row("bouncing ball", f"e = {e}", "Γ at which its period doubles",
                  first_doubling(e), 0.0, doubling(e), 1e-6)  # fmt: skip


def picture(path: Path) -> None:
    """Phases of the late impacts of balls that were dropped into step, against Γ, at e = 0.5."""
    import matplotlib.pyplot as plt

    e = 0.5
    figure, axes = plt.subplots(figsize=(9, 4.5), layout="constrained")
    for gamma in np.linspace(1.0, 1.8, 600):
        hits = in_step(gamma, e, 400, 0.01)
        late = (hits[hits[:, 0] > 300 * math.tau, 0] / math.tau + 0.5) % 1.0 - 0.5
        axes.plot(np.full(len(late), gamma), late, ",", color="0.1")
    for gamma, name in ((first_locking(e), "locks"), (first_doubling(e), "doubles")):
        axes.axvline(gamma, color="tab:red", lw=0.8)
        axes.annotate(f" {name} (theory)", (gamma, 0.47), color="tab:red", fontsize=9, va="top")
    axes.set(xlabel="Γ = A ω² / g", ylabel="phase of the impacts, periods", ylim=(-0.5, 0.5),
             title="A ball on a shaken plate, e = 0.5: impacts after 300 periods")  # fmt: skip
    figure.savefig(path, dpi=110)
    plt.close(figure)

"""Which spatial structure finds a ball's next meeting with another soonest.

It also shows how the time of each structure grows with the number of balls.

    python benchmarks/who_meets_whom.py [--quick] [--json] [--picture]

The structures are asked at moments of a gas of 3 mm balls. Its density is always the same: the
chamber is 40 mm high and as wide as it must be (half a metre for 10,000 balls). The question, put
to every ball in turn, is when and whom it meets first before the median ball's time to the wall.
With few balls many moments are asked, 10,000 balls in all.

The work that keeps a structure up to date counts too. It is given per event, that is, per flight
begun. For cells it is crossing borders and looking into the nine cells ahead until the flight ends
at a ball or at the limit, so that it includes the time to find later what the cells cannot see yet.
For sweep and prune it is sorting the new flight in. For the product it is registering the new path
and widening the box of its block, and the share of a flight in what happens once in a window of 20
ms: sorting all balls into blocks, and one more search for each ball, because no search goes past
the end of a window. The product's query is asked in mid window, see simulator_pairs.py.

One structure is not in the table: columns of cells from floor to ceiling, each with its balls in
eight float32 lanes. It was tried before the product had blocks and took 671, 727 and 807 ns with
upkeep at 2,000, 5,000 and 10,000 balls. That is less than blocks, but costs an event at every
border that a ball crosses.

The run fails unless all agree on every partner, and on every time to within rounding, because not
all of them measure times from now. Figures are CPU times with the structures taking turns: median,
best and worst of the sum. Rows go to benchmarks/results/who_meets_whom.csv and the picture to
docs/images/who_meets_whom.png. With --quick no CSV is written.
"""

import argparse
import json
import statistics
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.gas import Gas, sample_gas
from benchmarks.pictures import IMAGES, lines_picture
from benchmarks.structures import all_pairs, linked_cells, simulator_pairs, sweep_and_prune
from benchmarks.structures.pairs import ask
from benchmarks.table import array_bytes, print_table, write_csv

PICTURE = IMAGES / "who_meets_whom.png"
BALLS = [30, 100, 200, 500, 1_000, 2_000, 5_000, 10_000]
QUICK = [30, 200, 1_000]
TURNS = 7
TURN = 0.05  # CPU s: a shorter turn asks all balls again
# Balls in all moments of one size. If only a few hundred are asked, the processor learns every
# branch by heart: with a lone moment of 100 balls all pairs took 390 ns a ball, and with a hundred
# such moments 980. A simulation never asks the same again, so that its cost is like the latter.
ASKED = 10_000
CLOSE = 1e-12  # s: what rounding may change of a time

Answers = tuple[np.ndarray, np.ndarray]
PRODUCT = "product: sixteen at once, from 1,024 balls in blocks"
STRUCTURES: dict[str, Any] = {
    "all pairs": all_pairs,
    "sweep and prune": sweep_and_prune,
    "linked cells": linked_cells,
    PRODUCT: simulator_pairs,
}


def answers(gas: Gas) -> dict[str, Answers]:
    """Each structure's times [s] and partners, what it sees only later included."""
    found = {}
    for label, module in STRUCTURES.items():
        times, partners = np.empty(len(gas.motion)), np.empty(len(gas.motion), dtype=np.int64)
        built = module.build(gas)
        ask(built, gas.limit, times, partners)
        module.upkeep(built, np.full(len(gas.motion), gas.limit), gas.limit, times, partners)
        found[label] = times, partners
    return found


def require_agreement(found: dict[str, Answers]) -> None:
    """Exits unless all answers are those of all pairs."""
    times, partners = found["all pairs"]
    for label, (others, mates) in found.items():
        wrong = np.flatnonzero(
            (mates != partners) | ~np.isclose(others, times, rtol=0.0, atol=CLOSE)
        )
        if len(wrong):
            i = wrong[0]
            raise SystemExit(
                f"{label} and all pairs disagree on {len(wrong)} of {len(times)} balls, the first "
                f"number {i}: "
                f"{others[i]} s with {mates[i]}, {times[i]} s with {partners[i]}"
            )


class Moment(NamedTuple):
    """A gas, and when each ball's flight ends (n,) [s]: at a ball or at the limit."""

    gas: Gas
    ends: np.ndarray


def measure(gases: Sequence[Gas]) -> list[dict[str, Any]]:
    """A row for each structure over gases of as many balls; fails unless they agree on all."""
    balls = len(gases[0].motion)
    moments = []
    for gas in gases:
        found = answers(gas)
        require_agreement(found)
        moments.append(Moment(gas, np.minimum(found["all pairs"][0], gas.limit)))
    times: dict[str, list[tuple[float, float]]] = {label: [] for label in STRUCTURES}
    for _ in range(TURNS):
        for label, module in STRUCTURES.items():
            times[label].append((query_ns(module, moments), upkeep_ns(module, moments)))
    rows = []
    for label, module in STRUCTURES.items():
        both = [sum(pair) for pair in times[label]]
        query, upkeep = (statistics.median(column) for column in zip(*times[label], strict=True))
        rows.append(
            {
                "balls": balls,
                "structure": label,
                "ns_per_query": round(query),
                "maintenance_ns_per_event": round(upkeep),
                "sum_ns": round(statistics.median(both)),
                "best": round(min(both)),
                "worst": round(max(both)),
                "bytes_per_ball": round(array_bytes(module.build(gases[0])) / balls),
            }
        )
    return rows


def query_ns(module: Any, moments: Sequence[Moment]) -> float:
    """CPU time of one query [ns], the mean of a turn.

    The overhead of calling compiled code is not included.
    """
    balls = len(moments[0].ends)
    times, partners = np.empty(balls), np.empty(balls, dtype=np.int64)
    built = [(module.build(moment.gas), moment.gas.limit) for moment in moments]
    queries, spent = 0, 0.0
    while spent < TURN:
        start = time.process_time()
        for structure, limit in built:
            ask(structure, limit, times, partners)
        done = time.process_time()
        for structure, limit in built:
            ask(structure, limit, times[:0], partners[:0])
        spent += (done - start) - (time.process_time() - done)
        queries += balls * len(built)
    return spent / queries * 1e9


def upkeep_ns(module: Any, moments: Sequence[Moment]) -> float:
    """CPU time of one event's upkeep [ns], the mean of a turn.

    The overhead of calling compiled code is not included.
    """
    balls = len(moments[0].ends)
    times, partners = np.empty(balls), np.empty(balls, dtype=np.int64)
    events, spent, begin = 0.0, 0.0, time.process_time()
    while events == 0.0 or time.process_time() - begin < TURN:
        built = [(module.build(gas), gas.limit, ends) for gas, ends in moments]
        start = time.process_time()
        for structure, limit, ends in built:
            events += module.upkeep(structure, ends, limit, times, partners)
        done = time.process_time()
        for structure, _, ends in built:
            module.upkeep(structure, ends[:0], 0.0, times, partners)
        spent += (done - start) - (time.process_time() - done)
    return max(0.0, spent) / events * 1e9


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="no more than 1,000 balls")
    parser.add_argument("--json", action="store_true", help="rows as JSON on stdout")
    parser.add_argument("--picture", action="store_true", help=f"write {PICTURE.name}")
    options = parser.parse_args()
    rng = np.random.default_rng(1)
    rows = []
    for balls in QUICK if options.quick else BALLS:
        rows += measure([sample_gas(balls, rng) for _ in range(max(1, ASKED // balls))])
        if not options.json:
            print(f"{balls} balls: all structures agree", flush=True)
    if options.json:
        print(json.dumps(rows, indent=1))
    else:
        print_table(rows)
    if not options.quick:
        write_csv("who_meets_whom.csv", rows)
    if options.picture:
        panels = [
            {**row, "cost": name, "ns": row[column]}
            for name, column in (
                ("finding the meeting", "ns_per_query"),
                ("with keeping the structure true", "sum_ns"),
            )
            for row in rows
        ]
        lines_picture(
            PICTURE, panels, "cost", "balls", "ns", PRODUCT, "time of a flight's query [ns]"
        )


if __name__ == "__main__":
    main()

"""What each effect costs: with it, with it off, and in a simulator that never had it.

    python benchmarks/effects.py [--quick] [--json] [--effects NAME ...]

Three programs simulate the gear's chamber (200 balls, 10,000 triangles): the simulator with the
effect on, the simulator with it off, and a copy of the simulator from whose source the effect was
removed (simulator_without_effect.py). They take turns of one window each, round after round, so
that a machine that slows down slows all of them. All three compile with an empty cache. The figures
are CPU time per collision and medians over the rounds of each round's own ratio. An effect changes
how the shot moves, so the collisions timed with it on differ from those timed with it off. Rows go
to benchmarks/results/effects.csv.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.append(
    str(Path(__file__).parents[1])
)  # at the end: the copy that never had the effect comes first, by PYTHONPATH

from benchmarks.effect_scenes import EFFECTS, effect_scene
from benchmarks.scenes import ROOT
from benchmarks.simulator_without_effect import never_had
from benchmarks.table import print_table, write_csv

STEADY = 0.3  # s
TARGET = 0.4  # CPU s a window
ROUNDS = 9


class Program:
    """One of the three, in a process of its own."""

    def __init__(self, effect: str, on: bool, source: Path, cache: Path) -> None:
        paths = os.pathsep.join([str(source), str(ROOT)])
        self.process = subprocess.Popen(
            [sys.executable, __file__, "--play", effect, "on" if on else "off"],
            env={**os.environ, "PYTHONPATH": paths, "NUMBA_CACHE_DIR": str(cache)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.said = self._answer()
        if not Path(self.said["simulator"]).is_relative_to(source):
            raise RuntimeError(f"timed {self.said['simulator']}, not the copy in {source}")
        self.costs: list[float] = []

    def _answer(self) -> dict[str, Any]:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            raise RuntimeError("a program that was to be timed has stopped; its message is above")
        answer: dict[str, Any] = json.loads(line)
        return answer

    def play(self) -> None:
        """One window."""
        assert self.process.stdin is not None
        self.process.stdin.write("go\n")
        self.process.stdin.flush()
        self.costs.append(self._answer()["ns"])

    def stop(self) -> None:
        """End the process."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait()


def play(effect: str, on: bool) -> None:
    """What one of the programs does: it compiles and reports the time that took.

    Then it plays one window for every line that it is sent.
    """
    import sim_core
    from benchmarks.events import advance
    from benchmarks.table import array_bytes
    from sim_core.loop.simulate import Simulation

    run = Simulation(effect_scene(effect, on))
    start = time.process_time()
    advance(run, 1e-6)
    compiled = time.process_time() - start
    advance(run, STEADY)
    collisions, spent = advance(run, 0.02)
    piece = 0.02 * TARGET / max(spent, 1e-6)
    kept = (
        run.state.motion,
        run.state.queue,
        run.state.neighbours,
        run.state.contact,
        run.state.friction_state,
        run.state.random_phase,
        run.state.drag,
        run.state.sizes,
    )
    size = sum(map(array_bytes, kept)) / len(run.state.motion)
    print(
        json.dumps({"simulator": sim_core.__file__, "compile_s": compiled, "bytes_per_ball": size}),
        flush=True,
    )
    for _ in sys.stdin:
        collisions, spent = advance(run, piece)
        print(json.dumps({"ns": 1e9 * spent / max(collisions, 1)}), flush=True)


def measure(effect: str, rounds: int) -> dict[str, Any]:
    """One row."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "without").mkdir()
        stripped = never_had(EFFECTS[effect].variables, place / "without")
        sources = {"on": (True, ROOT), "off": (False, ROOT), "never": (False, stripped)}
        programs = {
            name: Program(effect, on, source, place / f"cache-{name}")
            for name, (on, source) in sources.items()
        }
        for turn in range(rounds):
            for program in list(programs.values())[:: 1 if turn % 2 else -1]:
                program.play()
        for program in programs.values():
            program.stop()

    def ratio(one: str, other: str) -> float:
        pairs = zip(programs[one].costs, programs[other].costs, strict=True)
        return round(statistics.median(a / b for a, b in pairs), 3)

    on, off = programs["on"], programs["off"]
    noise = [a / b for a, b in zip(off.costs, programs["never"].costs, strict=True)]
    return {
        "effect": effect,
        "ns_per_collision_off": round(statistics.median(off.costs)),
        "time_per_event_ratio_on": ratio("on", "off"),
        "time_per_event_ratio_off": ratio("off", "never"),
        "off_lowest": round(min(noise), 3),
        "off_highest": round(max(noise), 3),
        "bytes_per_ball": round(on.said["bytes_per_ball"]),
        "bytes_per_ball_off": round(off.said["bytes_per_ball"]),
        "compile_s": round(on.said["compile_s"], 1),
        "compile_s_off": round(off.said["compile_s"], 1),
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="three rounds instead of nine")
    parser.add_argument("--json", action="store_true", help="rows as JSON on stdout")
    parser.add_argument("--effects", nargs="*", choices=list(EFFECTS), help="only these")
    parser.add_argument("--play", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.play:
        play(options.play[0], options.play[1] == "on")
        return
    names = options.effects or list(EFFECTS)
    rows = []
    for name in names:
        rows.append(measure(name, 3 if options.quick else ROUNDS))
        if not options.json:
            print(
                " ".join(f"{key} {value}" for key, value in rows[-1].items()),
                file=sys.stderr,
                flush=True,
            )
    if options.json:
        print(json.dumps(rows, indent=1))
    else:
        print_table(rows)
    if not options.quick and not options.effects:
        write_csv("effects.csv", rows)


if __name__ == "__main__":
    main()

"""What a user waits for, and how fast the simulator is: first table of docs/explanation/core.md.

    python benchmarks/speed.py [--before FOLDER] [--rows ROW ...]

`--before` is a checkout of another version, installed in a virtual environment `.venv` of its own:
each row is then measured with both in turns. "cold" starts with an empty cache of compiled code,
"warm" with that of the run before it. CPU seconds are those of all processes of a command. Figures
are medians of three rounds, one for what takes minutes. Rows go to benchmarks/results/speed.csv
with the name of the machine. It takes a quarter of an hour, on Linux; growth is in growth.py, the
yardsticks (embree, the paper's method) are in events.py.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.scenes import ROOT
from benchmarks.table import print_table, write_csv

ROUNDS = 3
COMPILE = """
from dataclasses import replace
from sim_core import Rest, compile_simulator
from benchmarks.scenes import PHYSICS
compile_simulator({physics})
"""
STUDY = """
design = "{root}/designs/gear.toml"
[vary]
"chamber.height_mm" = [28, 60]
"chamber.sonotrode_distance_mm" = [10, 30]
[optimizer]
evaluations = 40
seed = 1
confirm = 1
confirm_replicas = 8
[search_accuracy]
simulated_time_s = 1.0
"""
CALIBRATION = """
program = "0"
parameters = ["amplitude", "C0", "v0", "mu"]
log_mean = [0.0, 0.0, 0.0, 0.0]
log_covariance = [[0.0025, 0, 0, 0], [0, 0.0001, 0, 0], [0, 0, 0.01, 0], [0, 0, 0, 0.04]]
amplitude_um = [20, 60]
ball_diameter_mm = [1.5, 1.5]
ball_density_kg_m3 = 7800
"""
EIGHT_CONFIRMED = """
design = "gear.toml"
[vary]
"chamber.height_mm" = [28, 60]
"chamber.sonotrode_distance_mm" = [10, 30]
[optimizer]
algorithm = "sobol"
evaluations = 9
first_replicas = 0
confirm = 7
confirm_replicas = 8
confirm_rounds = 1
[search_accuracy]
simulated_time_s = 0.3
replicas = 4
"""
SCENES = (
    "cylinder-200-1k",
    "cylinder-200-10k",
    "cylinder-200-100k",
    "gear-200-10k",
    "gear-200-100k",
)


class Version(NamedTuple):
    """A checkout, its interpreter, and an empty folder for its compiled code and its results."""

    root: Path
    python: str
    folder: Path

    def environment(self, cache: str | Path) -> dict[str, str]:
        """As a user's: Python keeps its own compiled files, and ours are in that folder."""
        setting = {**os.environ, "NUMBA_CACHE_DIR": str(self.folder / cache)}
        setting.pop("PYTHONDONTWRITEBYTECODE", None)
        return setting

    def spent(
        self, words: list[str], cache: str | Path, cores: set[int] | None = None
    ) -> dict[str, float]:
        """Seconds of a command, by the clock and of CPU, and its memory.

        Raises RuntimeError if it fails.

        Args:
            cores: that the command may use; None for all.
        """
        setting = self.environment(cache)
        begin = time.perf_counter()
        pinned = ["taskset", "-c", ",".join(map(str, sorted(cores)))] if cores else []
        going = subprocess.Popen([*pinned, self.python, *words], cwd=self.root, env=setting,
                                 stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)  # fmt: skip
        assert going.stdout is not None
        going.stdout.read(1)
        first = time.perf_counter() - begin
        going.stdout.read()
        _, status, used = os.wait4(going.pid, 0)
        going.returncode = os.waitstatus_to_exitcode(status)
        if status:
            raise RuntimeError(f"{words} ended with {going.returncode}")
        return {
            "first_s": first,
            "all_s": time.perf_counter() - begin,
            "cpu_s": used.ru_utime + used.ru_stime,
            "peak_gb": 1024e-9 * used.ru_maxrss,  # of the largest process
        }

    def printed(self, words: list[str]) -> Any:
        """The JSON that a benchmark of this version prints."""
        done = subprocess.run([self.python, *words], cwd=self.root,
                              env=self.environment("cache"), text=True,
                              stdout=subprocess.PIPE, check=True)  # fmt: skip
        return json.loads(done.stdout)


def compiling(version: Version, turn: int) -> Iterator[tuple[str, float]]:
    """CPU seconds of the first simulation that are spent on compiling."""
    for name, physics in (
        ("without rest", "PHYSICS"),
        ("with rest", "PHYSICS._replace(rest=Rest())"),
    ):
        words = ["-c", COMPILE.format(physics=physics)]
        cold, warm = (version.spent(words, f"{name}{turn}")["cpu_s"] for _ in range(2))
        yield f"compile {name}, CPU s", cold - warm


def checking(version: Version, turn: int) -> Iterator[tuple[str, float]]:
    """`chamberopt check` of the gear."""
    words = ["-m", "chamberopt", "check", "designs/gear.toml"]
    for state in ("cold", "warm"):
        spent = version.spent(words, f"check{turn}")
        yield f"check, {state}, s to the first output", spent["first_s"]
        yield f"check, {state}, s to the end", spent["all_s"]
        yield f"check, {state}, CPU s", spent["cpu_s"]


def quickstart(version: Version, turn: int) -> Iterator[tuple[str, float]]:
    """The first command of the README, and once more with all compiled."""
    for state in ("cold", "warm"):
        out = str(version.folder / f"quickstart{turn}-{state}")
        words = ["-m", "chamberopt", "run", "studies/quickstart.toml", "--out", out]
        spent = version.spent(words, f"quick{turn}")
        yield f"README's first command, {state}, s", spent["all_s"]
        yield f"README's first command, {state}, CPU s", spent["cpu_s"]
    yield "README's first command, peak memory, GB", spent["peak_gb"]


def simulating(version: Version, turn: int) -> Iterator[tuple[str, float]]:
    """`chamberopt simulate` of the gear with all compiled: figures, fields and pictures."""
    out = str(version.folder / f"simulate{turn}")
    words = ["simulate", "designs/gear.toml", "--no-ranges", "--out", out]
    spent = version.spent(["-m", "chamberopt", *words], "cache")
    yield "simulate the gear, s", spent["all_s"]
    yield "simulate the gear, CPU s", spent["cpu_s"]


def recommending(version: Version, turn: int) -> Iterator[tuple[str, float]]:
    """`chamberopt accuracy` with a budget of 80 CPU seconds."""
    for name in ("plate", "gear"):
        out = str(version.folder / f"accuracy{turn}-{name}")
        words = ["accuracy", f"designs/{name}.toml", "--budget-s", "80", "--out", out]
        spent = version.spent(["-m", "chamberopt", *words], "cache")
        yield f"accuracy of the {name} for 80 CPU s, CPU s", spent["cpu_s"]
        yield f"accuracy of the {name} for 80 CPU s, peak memory, GB", spent["peak_gb"]


def remembering(version: Version, turn: int) -> Iterator[tuple[str, float]]:
    """A study that confirms eight gears whose machine was calibrated."""
    folder = version.folder / f"calibrated{turn}"
    folder.mkdir()
    gear = (version.root / "designs" / "gear.toml").read_text(encoding="utf-8")
    gear = gear.replace('"parts/', f'"{version.root}/designs/parts/')
    texts = {
        "machine": CALIBRATION,
        "gear": f'calibration = "machine.toml"\n{gear}',
        "study": EIGHT_CONFIRMED,
    }
    for name, text in texts.items():
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    study, out = str(folder / "study.toml"), str(folder / "out")
    spent = version.spent(["-m", "chamberopt", "run", study, "--no-ranges", "--out", out], "cache")
    yield "a study of 8 calibrated gears, peak memory, GB", spent["peak_gb"]
    yield "a study of 8 calibrated gears, CPU s", spent["cpu_s"]


def colliding(version: Version, turn: int) -> Iterator[tuple[str, float]]:
    """Collisions in a steady chamber."""
    words = ["benchmarks/events.py", "--quick", "--json", "--scenes", *SCENES]
    for row in version.printed(words):
        if "collisions_per_cpu_s" in row:
            yield f"{row['scene']}, M collisions / CPU s", 1e-6 * row["collisions_per_cpu_s"]


def evaluating(version: Version, turn: int) -> Iterator[tuple[str, float]]:
    """The gear to ± 1 % on the objective, imports and all."""
    row = version.printed(["benchmarks/evaluation.py", "--here", "0.01"])
    yield "gear to ± 1 %, CPU s", row["cpu_s"]
    yield "gear to ± 1 %, s", row["wall_s"]


def studying(version: Version, turn: int) -> Iterator[tuple[str, float]]:
    """40 evaluations of a study, on one core and on two."""
    study = version.folder / "study.toml"
    study.write_text(STUDY.format(root=version.root), encoding="utf-8")
    seconds = []
    for cores in (1, 2):
        out = str(version.folder / f"study{turn}-{cores}")
        words = ["-m", "chamberopt", "run", str(study), "--out", out]
        found = version.spent(words, "cache", set(sorted(os.sched_getaffinity(0))[:cores]))
        seconds.append(found["all_s"])
        yield f"40 evaluations, {cores} core(s), s", seconds[-1]
    yield "40 evaluations, one core / two", seconds[0] / seconds[1]


def setting_up(version: Version, turn: int) -> Iterator[tuple[str, float]]:
    """A scene on 100,000 triangles that were seen before."""
    code = "print(__import__('benchmarks.growth').growth.triangles(100_000)['again_cpu_s'])"
    yield "set-up on 100k triangles seen before, CPU s", version.printed(["-c", code])


def layering(version: Version, turn: int) -> Iterator[tuple[str, float]]:
    """A dense layer of 9,600 balls on a shaken floor."""
    code = "print([*__import__('benchmarks.dense_layer').dense_layer.played(9_600, 2.0, 0.27, 3)])"
    collisions, spent = version.printed(["-c", code])
    yield "dense layer, M collisions / CPU s", 1e-6 * collisions / spent


# Each with its rounds.
ROWS: dict[str, tuple[Callable[[Version, int], Iterator[tuple[str, float]]], int]] = {
    "compile": (compiling, ROUNDS),
    "check": (checking, ROUNDS),
    "collisions": (colliding, ROUNDS),
    "set-up": (setting_up, ROUNDS),
    "layer": (layering, 1),
    "evaluation": (evaluating, ROUNDS),
    "study": (studying, 1),
    "simulate": (simulating, ROUNDS),  # the median leaves out the first, which compiles
    "accuracy": (recommending, 1),
    "memory": (remembering, 1),
    "quickstart": (quickstart, 1),
}


# What a version of before may not have yet.
NEEDS = {"set-up": "benchmarks/growth.py", "layer": "benchmarks/dense_layer.py"}


def measure(names: list[str], versions: dict[str, Version]) -> list[dict[str, Any]]:
    """The median of every figure, a column for each version that has the benchmark."""
    found: dict[str, dict[str, list[float]]] = {}
    for name in names:
        row, rounds = ROWS[name]
        for turn in range(rounds):
            for label, version in versions.items():
                if not (version.root / NEEDS.get(name, "")).exists():
                    continue
                for what, value in row(version, turn):
                    found.setdefault(what, {}).setdefault(label, []).append(value)
    return [
        {"what": what, **{one: float(f"{statistics.median(all_):.3g}") for one, all_ in by.items()}}
        for what, by in found.items()
    ]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--before", type=Path, help="checkout of another version")
    parser.add_argument("--rows", nargs="+", choices=ROWS, default=list(ROWS))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        versions = {}
        if options.before:
            other = options.before.resolve()
            python = str(other / ".venv" / "bin" / "python")
            versions["before"] = Version(other, python, Path(folder) / "before")
        versions["now"] = Version(ROOT, sys.executable, Path(folder) / "now")
        for version in versions.values():
            version.folder.mkdir()
        rows = measure(options.rows, versions)
    print_table(rows)
    if options.rows == list(ROWS):
        write_csv("speed.csv", rows)


if __name__ == "__main__":
    main()

"""Does another version of chamberopt compute the same figures, to the last bit?

    python benchmarks/same_figures.py record FOLDER     in a checkout of each of the two versions
    python benchmarks/same_figures.py compare FOLDER_A FOLDER_B

`record` runs the quickstart study and simulates every shipped design. `compare` holds the numbers
of every result.json, of the search's history and the impacts of every hits.npz against one another.
Times, versions, file paths, sentences and the names of keys are left out: they may change,
a figure may not.
"""

import json
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]
# What differs from run to run, and the inputs, whose keys may be renamed or joined by new ones.
LEFT_OUT = {"timings_s", "seconds", "versions", "created", "design", "part_sha256", "accuracy"}


def record(folder: Path) -> None:
    """Leave the results of the quickstart and of every shipped design in a new folder."""
    jobs = [["run", "studies/quickstart.toml"]]
    jobs += [
        ["simulate", f"designs/{path.name}"] for path in sorted((ROOT / "designs").glob("*.toml"))
    ]
    jobs += [["simulate", "designs/plate.toml", "--analytic"]]
    folder.mkdir(parents=True)
    for command, file, *options in jobs:
        name = "-".join([Path(file).stem, *(option.removeprefix("--") for option in options)])
        out = ["--out", str(folder.resolve() / name)]
        print(command, file, *options, flush=True)
        program = [sys.executable, "-m", "chamberopt", command, file, *options, *out]
        subprocess.run(program, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)


def numbers(value: Any) -> Iterator[float]:
    """Every number in a JSON value, but for those that are left out."""
    if isinstance(value, dict):
        for name, inner in value.items():
            if name not in LEFT_OUT:
                yield from numbers(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from numbers(inner)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield float(value)


def figures(folder: Path) -> dict[str, Counter[Any]]:
    """The figures of a results folder: of result.json, of the history, of single impacts."""
    found = {"result.json": Counter(numbers(json.loads((folder / "result.json").read_text())))}
    history = folder / "history.jsonl"
    if history.is_file():
        rows = [json.loads(line) for line in history.read_text().splitlines()]
        found["history"] = Counter((n, x) for n, row in enumerate(rows) for x in numbers(row))
    impacts = folder / "hits.npz"
    if impacts.is_file():
        with np.load(impacts, allow_pickle=False) as columns:
            found["impacts"] = Counter(columns[name].tobytes() for name in columns.files)
    return found


def compare(one: Path, two: Path) -> int:
    """Print what differs between two recorded folders; returns the number of differences."""
    results = sorted(path.parent.relative_to(one) for path in one.rglob("result.json"))
    differences = 0
    for result in results:
        before, after = figures(one / result), figures(two / result)
        for kind in sorted({*before, *after}):
            lost = before.get(kind, Counter()) - after.get(kind, Counter())
            new = after.get(kind, Counter()) - before.get(kind, Counter())
            differs = bool(lost or new)
            differences += differs
            verdict = f"DIFFERS: {lost.total()} lost, {new.total()} new" if differs else "the same"
            print(f"{result.as_posix():24}{kind:14}{verdict}")
            if differs and kind == "result.json":
                print("    lost", list(lost)[:8], "new", list(new)[:8])
    print(f"{len(results)} results, {differences} differences")
    return differences


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["record", folder]:
            record(Path(folder))
        case ["compare", one, two]:
            sys.exit(min(1, compare(Path(one), Path(two))))
        case _:
            sys.exit(__doc__)

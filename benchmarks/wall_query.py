"""Which spatial structure finds a ball's first contact with the mesh soonest.

It also shows how the time of each structure grows with the mesh.

    python benchmarks/wall_query.py [--quick] [--json] [--picture]

The question is that of Badreddine et al., "CAD based simulation of ultrasonic shot peening", whose
computing time grows with the mesh. All structures get the same flights on the same meshes:
parabolas of a 3 mm ball up to the wall. All but three hold the same obstacles, one for every
triangle and convex edge, and run the same exact tests. The run fails unless they agree on every
contact, bit for bit. The first of the three is the product, its eight-wide tree over flats merged
into few faces. It must touch what the others touch to within 1e-12 m, and its build and memory
include the search for the triangle that was hit. The second is the paper's method, with faces only
and the ball as a point. The third is embree's ray, straight and thin.

The two structures that test everything take different times. The paper's method tests the borders
of a triangle only if its plane is met before the best so far, and reads 96 bytes of it. The exact
test computes the borders of every plane met and reads 160 bytes, and on convex edges it must test a
capsule. With 10^6 triangles neither fits into a cache.

Figures are CPU times with the structures taking turns: median, best and worst. Where a query is
slow fewer are asked, as the column says. Rows go to benchmarks/results/wall_query.csv and the
picture to docs/images/wall_query.png. With --quick no CSV is written.
"""

import argparse
import json
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import embree, flights, paper_method
from benchmarks.pictures import IMAGES, lines_picture
from benchmarks.scenes import DIAMETER, cylinder, gear
from benchmarks.structures import binary_tree, every_obstacle, simulator_tree, uniform_grid
from benchmarks.structures.mesh_obstacles import FALL, Shell, ask, build_shell, gaps, sort_rows
from benchmarks.table import array_bytes, print_table, write_csv
from sim_core import TriangleMesh

PICTURE = IMAGES / "wall_query.png"
# If only 2,000 are asked again and again, the processor learns the branches by heart and takes
# up to 10 % less time.
FLIGHTS = 10_000
TURNS = 7
TURN = 0.1  # CPU s: shorter turns ask the same flights again, longer ones ask fewer
LEAST = 20  # flights

# name: mesh of fineness n, finenesses, those of --quick, and a place [m] well inside
MESHES: dict[
    str, tuple[Callable[[int], TriangleMesh], list[int], list[int], tuple[float, float, float]]
] = {
    "cylinder": (
        lambda n: cylinder(0.035, 0.04, 10**n),
        [2, 3, 4, 5, 6],
        [2, 3, 4],
        (0.0, 0.0, 0.02),
    ),
    "gear": (gear, [0, 1, 2, 3], [0], (0.0, 0.0, 0.0075)),  # as designed, 9k triangles, and finer
}


class Structure(NamedTuple):
    """How a structure is built and asked.

    ``build(shell)`` makes it. ``ask(built, flights (n, 6), delays (n,), obstacles (n,))`` fills the
    last two arrays. ``exact`` says whether its answers must equal those of the others, bit for bit.
    """

    build: Callable[[Shell], Any]
    ask: Callable[[Any, np.ndarray, np.ndarray, np.ndarray], Any] = ask
    exact: bool = True


PRODUCT = "product: eight-wide tree, flats merged"
REFERENCE = "eight-wide tree"
STRUCTURES = {
    "every plane (the paper)": Structure(
        lambda shell: paper_method.planes(shell.corners),
        lambda built, asked, *_: paper_method.ask(*built, asked[:, :3], asked[:, 3:]),
        False,
    ),
    "every obstacle": Structure(every_obstacle.build),
    "uniform grid": Structure(uniform_grid.build),
    "binary tree, oriented boxes": Structure(lambda shell: binary_tree.build(shell, oriented=True)),
    "binary tree, boxes": Structure(lambda shell: binary_tree.build(shell, oriented=False)),
    REFERENCE: Structure(simulator_tree.build),
    PRODUCT: Structure(
        simulator_tree.build_product, lambda built, *question: ask(built[0], *question), False
    ),
    "embree, thin ray": Structure(
        lambda shell: embree.build(shell.corners),
        lambda built, asked, *_: embree.ask(built, asked[:, :3], asked[:, 3:]),
        False,
    ),
}
# Largest gap [m] between ball and surface at a contact. Along a path that grazes an edge the
# contacts themselves may lie much further apart.
SAME_CONTACT = 1e-12


class Contest(NamedTuple):
    """A structure over one mesh, the flights it is asked, and its answers.

    A turn asks the flights ``passes`` times.
    """

    structure: Structure
    built: Any
    asked: np.ndarray
    passes: int
    delays: np.ndarray
    obstacles: np.ndarray

    def turn(self) -> float:
        """CPU time of one query [ns], the mean of a turn."""
        begin = time.process_time()
        for _ in range(self.passes):
            self.structure.ask(self.built, self.asked, self.delays, self.obstacles)
        return (time.process_time() - begin) / (self.passes * len(self.asked)) * 1e9


def enter(structure: Structure, built: Any, asked: np.ndarray) -> Contest:
    """As many flights as a turn has time for."""

    def contest(count: int, passes: int) -> Contest:
        return Contest(
            structure,
            built,
            asked[:count],
            passes,
            np.empty(count),
            np.empty(count, dtype=np.int64),
        )

    trial = contest(LEAST, 1)
    trial.turn()  # compiles
    queries = int(TURN / max(1e-9 * trial.turn(), 1e-9))
    count = min(max(queries, LEAST), len(asked))
    return contest(count, max(1, queries // count))


def compile_structures() -> None:
    """Once, so that no build is timed with its compiler."""
    shell = build_shell(cylinder(0.035, 0.04, 100), 0.5 * DIAMETER)
    asked = flights.sample(shell, shell.mesh.middle, LEAST, np.random.default_rng(1))
    for structure in STRUCTURES.values():
        built = structure.build(shell)
        if built is not None:
            structure.ask(built, asked, np.empty(LEAST), np.empty(LEAST, dtype=np.int64))


def measure(name: str, mesh: TriangleMesh, start: np.ndarray) -> list[dict[str, Any]]:
    """A row for each structure on this mesh; fails unless they agree."""
    shell = build_shell(mesh, 0.5 * DIAMETER)
    asked = flights.sample(shell, start, FLIGHTS, np.random.default_rng(1))
    rows: dict[str, dict[str, Any]] = {}
    contests: dict[str, Contest] = {}
    for label, structure in STRUCTURES.items():
        begin = time.process_time()
        built = structure.build(shell)
        spent = time.process_time() - begin
        if built is None:  # not installed
            continue
        contests[label] = enter(structure, built, asked)
        rows[label] = {
            "mesh": name,
            "triangles": len(mesh.triangles),
            "structure": label,
            "build_s": round(spent, 4),
            "bytes_per_triangle": round(array_bytes(built) / len(mesh.triangles)) or "",
            "queries": len(contests[label].asked),
        }
    turns = [{label: contest.turn() for label, contest in contests.items()} for _ in range(TURNS)]
    for label, row in rows.items():
        times = [turn[label] for turn in turns]
        row["ns_per_query"] = round(statistics.median(times))
        row["best"], row["worst"] = round(min(times)), round(max(times))
    off = require_agreement(shell, contests)
    print(
        f"{name}, {len(mesh.triangles)} triangles: contacts agree bit for bit, the product's "
        f"within {off:.1e} m",
        file=sys.stderr,
        flush=True,
    )
    return list(rows.values())


def require_agreement(shell: Shell, contests: dict[str, Contest]) -> float:
    """Exits unless every exact structure found the same contacts.

    The times must be equal bit for bit, and the obstacle must be the same or one that is met at
    that very time. Returns the largest distance [m] of the product's contacts from those.
    """
    reference = contests[REFERENCE]
    for label, contest in contests.items():
        if not contest.structure.exact:
            continue
        count = min(len(contest.asked), len(reference.asked))
        wrong = np.flatnonzero(contest.delays[:count] != reference.delays[:count])
        if len(wrong):
            i = wrong[0]
            raise SystemExit(
                f"{label} and {REFERENCE} disagree on {len(wrong)} of {count} flights, the first "
                f"number {i}: "
                f"{contest.delays[i]} and {reference.delays[i]} s"
            )
        for i in np.flatnonzero(contest.obstacles[:count] != reference.obstacles[:count]):
            one, two = (
                _alone(shell, c.obstacles[i], contest.asked[i]) for c in (contest, reference)
            )
            if one != two:
                raise SystemExit(
                    f"{label} and {REFERENCE} meet different obstacles at different times on "
                    f"flight {i}"
                )
    merged = contests[PRODUCT]
    count = min(len(merged.asked), len(reference.asked))
    asked, delay = merged.asked[:count], merged.delays[:count, None]
    at = asked[:, :3] + delay * asked[:, 3:] + 0.5 * delay * delay * np.array(FALL)
    off = float(np.abs(gaps(shell, reference.obstacles[:count], at)).max())
    if not off <= SAME_CONTACT:
        raise SystemExit(
            f"{PRODUCT}: its contacts are up to {off:.1e} m from what {REFERENCE} meets"
        )
    return off


def _alone(shell: Shell, obstacle: int, flight: np.ndarray) -> float:
    """When [s] a flight meets this one obstacle, searched as all are."""
    delays, obstacles = np.empty(1), np.empty(1, dtype=np.int64)
    ask(
        every_obstacle.EveryObstacle(sort_rows(shell, np.array([obstacle]))),
        flight[None],
        delays,
        obstacles,
    )
    return float(delays[0])


def add_growth(rows: list[dict[str, Any]]) -> None:
    """Time of each row relative to the same structure's on the smallest of its meshes."""
    first: dict[tuple[str, str], float] = {}
    for row in rows:
        first.setdefault((row["mesh"], row["structure"]), row["ns_per_query"])
        row["growth"] = round(row["ns_per_query"] / first[row["mesh"], row["structure"]], 2)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="no mesh above 10^4 triangles")
    parser.add_argument("--json", action="store_true", help="rows as JSON on stdout")
    parser.add_argument("--picture", action="store_true", help=f"write {PICTURE.name}")
    options = parser.parse_args()
    compile_structures()
    rows = []
    for name, (make, all_sizes, quick_sizes, start) in MESHES.items():
        for size in quick_sizes if options.quick else all_sizes:
            rows += measure(name, make(size), np.array(start))
    add_growth(rows)
    if options.json:
        print(json.dumps(rows, indent=1))
    else:
        print_table(rows)
    if not options.quick:
        write_csv("wall_query.csv", rows)
    if options.picture:
        lines_picture(
            PICTURE, rows, "mesh", "triangles", "ns_per_query", PRODUCT, "time of a query [ns]"
        )


if __name__ == "__main__":
    main()

"""Where the event loop's time goes: ns a collision in each of its parts, scene by scene.

    python benchmarks/loop_profile.py [scene ...]

The loop is compiled once more with a profiler in it (sim_core/numerics/profiler.py). The last
column says how much slower that makes it. What limits the loop is described in
docs/explanation/core.md.
"""

import argparse
import statistics
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.events import advance, steady
from benchmarks.scenes import MESHES
from sim_core.numerics.profiler import PARTS, new_profiler

WINDOW = 0.4  # CPU s a measurement


def profile(name: str, repeats: int = 5) -> tuple[list[float], dict[str, float], float]:
    """Median ns a collision in each part, events and searches a collision, and the slowdown.

    The slowdown is that caused by the profiler.
    """
    bare, watched = steady(name), steady(name)
    watched.state = watched.state._replace(profiler=new_profiler())
    advance(watched, 0.01)
    piece = 0.01 * WINDOW / max(advance(bare, 0.01)[1], 1e-6)
    parts, ratios = [], []
    watched.state.counts[:] = 0
    for _ in range(repeats):
        collisions, spent = advance(bare, piece)
        watched.state.profiler.spent[:] = 0
        seen, longer = advance(watched, piece)
        ticks = watched.state.profiler.spent
        parts.append(ticks / ticks.sum() * longer / seen * 1e9)
        ratios.append((longer / seen) / (spent / collisions))
    count = watched.state.counts / watched.state.counts[:3].sum()
    calls = {
        "walls": count[0],
        "balls": count[1],
        "sonotrode": count[2],
        "searches": count[3],
        "stale": count[4],
    }
    return (
        [statistics.median(column) for column in zip(*parts, strict=True)],
        calls,
        statistics.median(ratios),
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", nargs="*", metavar="scene", help=", ".join(MESHES))
    names = parser.parse_args().scenes or list(MESHES)
    for name in names:
        if name not in MESHES:
            parser.error(f"no scene {name}: choose from {', '.join(MESHES)}")
    print(
        "ns a collision | "
        + " | ".join(PARTS)
        + " | all | wall searches a collision | with / without profiler"
    )
    for name in names:
        parts, calls, ratio = profile(name)
        cells = [f"{part:.0f}" for part in parts]
        print(
            f"{name} | {' | '.join(cells)} | {sum(parts):.0f} | {calls['searches']:.2f} | "
            f"{ratio:.2f}",
            flush=True,
        )


if __name__ == "__main__":
    main()

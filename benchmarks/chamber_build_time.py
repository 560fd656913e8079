"""How long a chamber around a part takes to build: the gear in ever finer triangles.

VTK's boolean is measured beside it.

    python benchmarks/chamber_build_time.py [--quick] [--json]

For each mesh the table holds medians of a few runs in seconds of wall clock:

    read     read the file, heal it and look for self-crossings (once for each file)
    chamber  build the chamber around it: pose, CSG, slivers, tags (once for each candidate)
    mesh     prepare the mesh for the simulator
    tree     build the tree that the paths of balls are searched in (once for each candidate)
    vtk      vtkBooleanOperationPolyDataFilter on the same shape and part, and its volume error

VTK's filter is what PyVista offers. It keeps no record of which triangle a piece lies on. Rows go
to benchmarks/results/building.csv with the name of the machine.
"""

import argparse
import json
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "designs" / "parts")]

EDGES = {"10k": (1.3, 2.5), "100k": (0.39, 0.66)}  # mm: of the teeth's and the shaft's triangles
RUNS = 3
MOST_FOR_VTK = 20_000  # triangles: beyond, it is not tried


def gear_file(folder: Path, size: str) -> Path:
    """The gear, its triangles' edges as wanted."""
    import gear

    gear.EDGE, gear.SHAFT_EDGE = EDGES[size]
    path = folder / f"gear_{size}.stl"
    gear.main(path)
    return path


def timed(work: Callable[[], Any]) -> tuple[float, Any]:
    """Seconds, and what came out."""
    began = time.perf_counter()
    out = work()
    return time.perf_counter() - began, out


def row(path: Path, runs: int) -> dict[str, Any]:
    """One mesh."""
    from chamberopt.chamber.build import build_chamber
    from chamberopt.chamber.scene import chamber_mesh
    from chamberopt.design.design import validate
    from chamberopt.design.load import load_design
    from chamberopt.geometry.meshes.part_mesh import read_part
    from sim_core import compile_simulator  # noqa: F401  its import is not timed
    from sim_core.geometry.obstacle_set import build_obstacle_set

    data = load_design(ROOT / "designs" / "gear.toml").model_dump()
    data["part"]["mesh"] = str(path)
    design = validate(type(load_design(ROOT / "designs" / "gear.toml")), data)
    read, part = timed(lambda: read_part(path, "mm"))
    build_chamber(design)  # reads the file for good
    seconds: dict[str, list[float]] = {"chamber": [], "mesh": [], "tree": []}
    for run in range(runs):
        candidate = design.changed({"chamber.height_mm": 45.0 + 0.1 * run})
        spent, chamber = timed(lambda: build_chamber(candidate))  # noqa: B023
        seconds["chamber"].append(spent)
        spent, mesh = timed(lambda: chamber_mesh(chamber))  # noqa: B023
        seconds["mesh"].append(spent)
        spent, _ = timed(lambda: build_obstacle_set(mesh, 0.75e-3, 1, 40e-6))  # noqa: B023
        seconds["tree"].append(spent)
    median = {step: round(statistics.median(values), 3) for step, values in seconds.items()}
    return {
        "triangles": len(part.triangles),
        "read": round(read, 3),
        **median,
        **vtk_columns(design, runs),
    }


def vtk_columns(design: Any, runs: int) -> dict[str, Any]:
    """The same cut by VTK: its seconds and its relative volume error, empty if not tried."""
    import numpy as np
    import pyvista

    from chamberopt.chamber.build import build_chamber
    from chamberopt.chamber.part import posed_part

    part = posed_part(design)[0]
    if len(part.triangles) > MOST_FOR_VTK:
        return {"vtk": "", "vtk_volume_off": ""}
    shape = design.chamber.surface(part.vertices, part.triangles)
    bodies = [
        pyvista.PolyData.from_regular_faces(m.vertices, np.asarray(m.triangles))
        for m in (shape, part)
    ]
    seconds, cut = timed(lambda: bodies[0].boolean_difference(bodies[1]))
    volume = build_chamber(design).volume
    return {"vtk": round(seconds, 3), "vtk_volume_off": f"{abs(cut.volume / volume - 1.0):.1e}"}


def main() -> None:
    from benchmarks.table import machine, print_table, write_csv

    asked = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    asked.add_argument(
        "--quick", action="store_true", help="the smallest mesh alone, once; no file"
    )
    asked.add_argument("--json", action="store_true", help="rows as JSON on stdout")
    options = asked.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        sizes = list(EDGES)[:1] if options.quick else list(EDGES)
        rows = [
            {"part": size, **row(gear_file(Path(folder), size), 1 if options.quick else RUNS)}
            for size in sizes
        ]
    if options.json:
        print(json.dumps([{"machine": machine(), **one} for one in rows], indent=2))
    else:
        print_table(rows)
    if not options.quick:
        print(f"written: {write_csv('building.csv', rows)}", file=sys.stderr)


if __name__ == "__main__":
    main()

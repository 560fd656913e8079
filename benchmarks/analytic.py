"""The two systems of the paper side by side: one chamber, once analytical and once meshed.

It also shows what changes as the facets of the mesh shrink.

    python benchmarks/analytic.py [--quick] [--out FOLDER]

The chamber is that of designs/plate_paper.toml: a cylinder with 30 balls of 3 mm, closed by a plate
15 mm from the sonotrode. One number is fitted: the amplitude at which the analytical chamber covers
39 % in 50 s, as the paper measured. The rest is prediction. The run writes
docs/explanation/analytic.md, docs/images/analytic.png and benchmarks/results/analytic.csv and takes
one CPU minute; the fitted amplitude goes into the design by hand. With --quick it is rough, takes
seconds and writes to --out alone.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

from benchmarks.analytic_picture import picture
from benchmarks.analytic_report import report
from benchmarks.analytic_runs import PEENED, Effort, bin_edges, calibrated, rows, run
from benchmarks.pictures import IMAGES
from benchmarks.table import RESULTS, write_csv
from chamberopt.common.executor import local_executor
from chamberopt.design.load import load_design

ROOT = Path(__file__).parents[1]
FULL = Effort(60, 20.0, (8, 16, 32, 64, 128))
QUICK = Effort(12, 1.0, (8, 64))


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="rough, in seconds")
    parser.add_argument(
        "--out",
        type=Path,
        help="folder for all three files instead of docs/ and benchmarks/results/",
    )
    asked = parser.parse_args(arguments)
    if asked.quick and asked.out is None:
        parser.error("--quick is too rough for the documentation: give --out")
    effort = QUICK if asked.quick else FULL
    time = {"process.treatment_time_s": PEENED, "process.accuracy.simulated_time_s": effort.seconds}
    plate = load_design(ROOT / "designs" / "plate_paper.toml").changed(time)
    with local_executor() as executor:
        design = calibrated(plate, effort, executor)
        edges = bin_edges(design)
        exact = run(design, effort, edges, executor, "confirm", True)
        meshed = {
            n: run(design.changed({"chamber.facets": n}), effort, edges, executor, "search", False)
            for n in effort.facets
        }
    facets = design.chamber.facets
    document, image, table = (
        ROOT / "docs" / "explanation" / "analytic.md",
        IMAGES / "analytic.png",
        RESULTS / "analytic.csv",
    )
    if asked.out is not None:
        asked.out.mkdir(parents=True, exist_ok=True)
        document, image, table = (asked.out / file.name for file in (document, image, table))
    write_csv(table, rows(exact, meshed, facets, edges))
    picture(image, exact, meshed, facets, edges)
    text = report(design, effort, exact, meshed)
    document.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()

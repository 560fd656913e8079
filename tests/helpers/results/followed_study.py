"""A study beside a design, as it is while it runs: all candidates are evaluated, nothing is drawn.

Its figures are made up. Two numbers vary. High chambers with little shot are refused by geometry.
"""

from pathlib import Path

import numpy as np

from chamberopt.design.design import Design
from chamberopt.search.study import load_study
from chamberopt.simulation.evaluation import Evaluation
from tests.helpers.studies import run_in_folder
from tests.helpers.synthetic import judged
from tests.hunt.base import STUDY, write_base

BUDGET = 12


class Hill:
    """The objective is a hill with noise that the candidate decides."""

    def unbuildable(self, design: Design) -> str:
        high = design.chamber.height_mm > 31 and design.shot.mass_g < 2.6
        return "a gap of 2.1 mm, in which balls jam" if high else ""

    def reachable(self, _: Design) -> float:
        return 1.0

    def __call__(self, design: Design, stream: str, replicas: int | None) -> Evaluation:
        x = np.array([(design.chamber.height_mm - 26) / 8, (design.shot.mass_g - 2) / 2])
        rng = np.random.default_rng([int(1e6 * x.sum()), len(stream)])
        height = 0.7 - float(((x - [0.6, 0.7]) ** 2 * [0.8, 0.4]).sum())
        noise = 0.03 * rng.normal(size=replicas or 4)
        return judged(height + noise, mean_coverage=0.5, impacts_per_mm2_s=1.0)


def followed_study(folder: Path) -> Path:
    """Write design, part and study into a folder, run the study, and return its results folder."""
    write_base(folder)
    budget = f"evaluations = {BUDGET}\nbatch = 1"
    (folder / "study.toml").write_text(STUDY.replace("evaluations = 2", budget))
    out = folder / "results" / "study"
    run_in_folder(load_study(folder / "study.toml"), out, simulator=Hill())
    return out

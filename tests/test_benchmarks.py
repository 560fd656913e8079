"""The structures that the benchmarks compare give equal answers. Their speed is not tested here.

The comparison of the analytical chamber with the meshed one is made roughly.
"""

import csv
from pathlib import Path

import numpy as np
import pytest
import trimesh

from benchmarks import analytic, flights, stress_profiles, wall_query, who_meets_whom
from benchmarks.analytic_runs import INSCRIBED, PEENED, Run, fit, hotelling
from benchmarks.gas import sample_gas
from benchmarks.scenes import DIAMETER
from benchmarks.structures.mesh_obstacles import build_shell
from chamberopt.common.estimate import Estimate
from chamberopt.coverage.stress_knowledge import BANDS
from chamberopt.design.load import load_design
from sim_core.loop.spatial_blocks import MIN_BALLS
from tests.helpers.scenes.cavities import box_around

FLIGHTS = 100


@pytest.mark.long
def test_all_structures_find_the_same_contacts() -> None:
    """In a room with a body: faces, edges and corners to be met."""
    mesh = box_around(trimesh.creation.icosphere(subdivisions=1, radius=0.012), 0.03)
    shell = build_shell(mesh, 0.5 * DIAMETER)
    asked = flights.sample(shell, np.array([0.0, 0.0, 0.02]), FLIGHTS, np.random.default_rng(2))
    contests = {}
    for label, structure in wall_query.STRUCTURES.items():
        if structure.exact or label == wall_query.PRODUCT:
            answers = np.empty(FLIGHTS), np.empty(FLIGHTS, dtype=np.int64)
            contests[label] = wall_query.Contest(
                structure, structure.build(shell), asked, 1, *answers
            )
            contests[label].turn()
    assert len(contests) == 6
    wall_query.require_agreement(shell, contests)
    assert np.isfinite(contests[wall_query.PRODUCT].delays).all(), (
        "the chamber is closed: every flight ends"
    )


@pytest.mark.long
def test_all_structures_find_the_same_meetings() -> None:
    gas = sample_gas(MIN_BALLS, np.random.default_rng(3))
    answers = who_meets_whom.answers(gas)
    assert (answers[who_meets_whom.PRODUCT][1] >= 0).sum() > 100
    assert len(answers) == 4
    who_meets_whom.require_agreement(answers)


@pytest.mark.long
def test_the_analytical_chamber_beside_the_meshed_one(tmp_path: Path) -> None:
    """A rough run still gives the whole page.

    The 95 % intervals have half-width 1. A difference twice as wide happens once in 10,000 runs.
    """
    analytic.main(["--quick", "--out", str(tmp_path)])
    page = (tmp_path / "analytic.md").read_text(encoding="utf-8")
    assert "| volume, cm³ | 29.4524 | 29.4051 | −1.6 ‰ |" in page
    assert page.count("no difference seen") + page.count("they differ") == 3
    assert (tmp_path / "analytic.png").stat().st_size > 20_000
    with (tmp_path / "analytic.csv").open(encoding="utf-8") as file:
        rows = {row["quantity"]: row for row in csv.DictReader(file) if not row["bin"]}
    covered = float(rows["mean_coverage, 64 facets"]["analytical"])
    assert abs(covered - 0.39) < 3.0 * float(rows["mean_coverage, 64 facets"]["half_width"])
    for figure in ("mean_coverage", "impacts_per_mm2_s", "mean_normal_speed_m_s"):
        assert abs(float(rows[f"{figure}, 64 facets"]["difference_over_half_width"])) < 2.0
    assert float(rows["impacts_per_mm2_s, 8 facets"]["difference_over_half_width"]) > 0.0, (
        "less room, more impacts"
    )


def test_the_shipped_plate_of_the_paper_is_the_chamber_of_the_page() -> None:
    page = (analytic.ROOT / "docs" / "explanation" / "analytic.md").read_text(encoding="utf-8")
    paper, plate = (
        load_design(analytic.ROOT / "designs" / f"{name}.toml") for name in ("plate_paper", "plate")
    )
    assert f"{1e6 * paper.sonotrode.amplitude:.2f} µm zero to peak" in page
    assert paper.process.treatment_time == PEENED
    real = {"effects.friction": "catalogue", "effects.roughness": "peened"}  # the paper has none
    fitted = {"sonotrode.amplitude_um": 25.0, "process.treatment_time_s": 5.0}
    assert paper.changed(fitted | real) == plate


def test_a_quick_comparison_does_not_go_into_the_documentation() -> None:
    with pytest.raises(SystemExit):
        analytic.main(["--quick"])


def test_hotellings_test_holds_its_level_and_sees_a_shift() -> None:
    rng = np.random.default_rng(6)
    shares = np.array([0.1, 0.2, 0.3, 0.4])

    def drawn(of: np.ndarray) -> np.ndarray:
        return rng.multinomial(1000, of, size=12) / 1000.0

    level = np.mean([hotelling(drawn(shares), drawn(shares)) < 0.05 for _ in range(2000)])
    assert 0.03 < level < 0.07
    assert hotelling(drawn(shares), drawn(shares + np.array([0.02, 0.0, 0.0, -0.02]))) < 1e-3


def test_the_fit_finds_the_order_it_is_given() -> None:
    def run(value: float) -> Run:
        return Run(1.0, {"rate": Estimate(value, 0.001)}, {})

    meshed = {n: run(2.0 * (1.0 - INSCRIBED / n**2)) for n in (8, 16, 32)}
    k, half_width, p = fit(run(2.0), meshed, "rate")
    assert k == pytest.approx(-INSCRIBED)
    assert 0.0 < half_width < 0.1
    assert p == pytest.approx(1.0)


def test_the_bands_of_the_stress_law_hold_what_was_published() -> None:
    """Seven profiles, of which two were read; the bands are not smaller than they ask for."""
    kinds = [one.kind for one in stress_profiles.PROFILES]
    assert kinds.count(stress_profiles.READ) == 2
    assert len(kinds) == 7
    for name, logs in stress_profiles.ratios().items():
        assert stress_profiles.factor(logs) <= BANDS[name] <= 1.15 * stress_profiles.factor(logs)
        assert np.abs(logs).max() <= np.log(BANDS[name])

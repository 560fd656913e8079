"""Figures belong to the surface: coarse facets of its rounds, smoothed, give the same."""

import pytest

from benchmarks.facet_invariance import FIGURES, OFF, apart, cases, figures_of, rows_of
from chamberopt.common.estimate import Estimate

CASES = dict(cases())
SHORT = {"process.accuracy.simulated_time_s": 2.0}


@pytest.mark.long
def test_block_of_coarse_facets() -> None:
    """Facets of 30 degrees; 1.5 half-widths are three standard errors."""
    case = CASES["block, R = 1.5 r"]
    design, draw = case.design.changed(SHORT), case.coarse["strips of 30 degrees"]
    fine, smooth = figures_of(design.changed(OFF), case.fine), figures_of(design, draw)
    flat = figures_of(design.changed(OFF), draw)
    assert smooth.reach == pytest.approx(fine.reach, abs=0.005)
    assert flat.reach < 0.98
    for name in ("mean_coverage", "uniform_coverage"):
        assert abs(distance(smooth.estimates[name], fine.estimates[name])) < 1.5
    assert distance(flat.estimates[name], fine.estimates[name]) < -2.0


@pytest.mark.long
@pytest.mark.parametrize("name", CASES)
def test_no_figure_depends_on_the_facets(name: str) -> None:
    rows = [row for row in rows_of(name, CASES[name]) if row["smoothing"] == "on"]
    sizes = [abs(row[f"{key} apart"]) for row in rows for key in FIGURES if row[f"{key} apart"]]
    assert sizes
    assert max(sizes) < 2.0


def distance(one: Estimate, other: Estimate) -> float:
    found = apart(one, other)
    assert isinstance(found, float)
    return found

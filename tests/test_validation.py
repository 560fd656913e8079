"""Quick rows of docs/explanation/validation.md; benchmarks/validation.py runs all of them."""

import math
import re

import numpy as np
import pytest

from benchmarks import validation
from benchmarks.cases import bouncing_ball, gases, peening_cylinder
from benchmarks.cases.row import Row
from tests.helpers.scenes.shaken_plate import first_doubling, first_locking


@pytest.mark.parametrize("e", [0.3, 0.9])
def test_a_ball_doubles_its_period_where_theory_says(e: float) -> None:
    assert bouncing_ball.doubling(e) == pytest.approx(first_doubling(e), abs=1e-6)


@pytest.mark.parametrize(("share", "kept"), [(0.998, False), (1.002, True)])
def test_a_ball_locks_from_where_theory_says(share: float, kept: bool) -> None:
    assert bouncing_ball.locks(share * first_locking(0.5), 0.5) is kept


@pytest.mark.long
def test_a_gas_cools_by_haffs_law() -> None:
    times = np.linspace(0.25, 1.0, 4)
    grown = np.mean([gases.cooling(0.95, 0.05, seed, times) for seed in range(2)], axis=0) - 1.0
    assert grown @ times / (times @ times) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(("e", "slope"), [(0.8, 0.9976), (0.9, 0.9973), (0.95, 0.9982), (1.0, 1.0)])
def test_a_cooling_gas_is_slower_than_maxwells(e: float, slope: float) -> None:
    assert 1.0 + 3.0 / 16.0 * gases.excess(e) == pytest.approx(slope, abs=6e-5)


def test_a_limit_is_as_uncertain_as_the_line_is_bad() -> None:
    contacts, scatter = (3.0, 2.0, 1.0), 0.1 * np.array([-1.0, 0.0, 1.0])
    on_a_line = np.array([[5.0], [6.0], [7.0]]) + scatter
    value, half_width = peening_cylinder.without_contacts(contacts, on_a_line)
    # An error of 0.1/√3 at each, times √(1/3 + 2²/2), and Student's t of six degrees of freedom.
    assert value == pytest.approx(8.0)
    assert half_width == pytest.approx(2.4469 * 0.1 / np.sqrt(3.0) * np.sqrt(7.0 / 3.0), rel=1e-4)
    bent = on_a_line + np.array([[0.0], [3.0], [0.0]])
    assert peening_cylinder.without_contacts(contacts, bent)[1] > 10.0 * half_width


@pytest.mark.long
def test_speed_goes_with_amplitude_where_restitution_is_constant() -> None:
    found, half_width = peening_cylinder.exponent(peening_cylinder.constant(0.91), 50)
    assert abs(found - 1.0) < 0.05
    assert half_width < 0.05


@pytest.mark.parametrize(("name", "case"), validation.CASES.items())
def test_the_page_shows_the_rows_that_are_stored(name: str, case: validation.Case) -> None:
    page = validation.PAGE.read_text(encoding="utf-8")
    (table,) = re.findall(f"<!-- {name} -->(.*?)<!-- end of {name} -->", page, re.DOTALL)
    assert table.strip() == validation.table(validation.stored(name))
    assert (case.picture is None) or f"(../images/validation_{name}.png)" in page


def test_every_row_has_its_verdict() -> None:
    row = Row("case", "conditions", "quantity", 1.0, 0.1, 1.15, 0.04)
    assert row.agrees is False
    assert row._replace(half_width=0.06).agrees is True
    assert row._replace(reference=math.nan).agrees is None
    table = validation.table([row, row._replace(half_width=0.06)])
    assert "| 1.00 ± 0.10 | 1.150 ± 0.040 | **no** |" in table
    assert "| 1.150 ± 0.060 | yes |" in table

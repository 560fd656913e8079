"""Quick rows of docs/validation.md; benchmarks/validation.py runs all of them."""

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


def test_a_gas_cools_by_haffs_law() -> None:
    times = np.linspace(0.25, 1.0, 4)
    grown = np.mean([gases.cooling(0.95, 0.05, seed, times) for seed in range(2)], axis=0) - 1.0
    assert grown @ times / (times @ times) == pytest.approx(1.0, abs=0.02)


def test_speed_goes_with_amplitude_where_restitution_is_constant() -> None:
    found, half_width = peening_cylinder.exponent(peening_cylinder.constant(0.91), 50)
    assert abs(found - 1.0) < 0.05
    assert half_width < 0.05


def test_every_case_has_its_table_in_the_page_and_every_row_its_verdict() -> None:
    page = validation.PAGE.read_text(encoding="utf-8")
    for name, case in validation.CASES.items():
        (rows,) = re.findall(f"<!-- {name} -->(.*?)<!-- end of {name} -->", page, re.DOTALL)
        assert rows.count("\n| ") >= 2, name
        if case.picture is not None:
            assert f"(images/validation_{name}.png)" in page
    row = Row("case", "conditions", "quantity", 1.0, 0.1, 1.15, 0.04)
    assert row.agrees is False
    assert row._replace(half_width=0.06).agrees is True
    assert row._replace(reference=math.nan).agrees is None
    table = validation.table([row, row._replace(half_width=0.06)])
    assert "| 1.00 ± 0.10 | 1.150 ± 0.040 | **no** |" in table
    assert "| 1.150 ± 0.060 | yes |" in table

"""How long `new` proposes to simulate, and in which windows."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.propose.proposed_budget import DENTS, FAR, REPLICAS, SPEED, propose_budget
from tests.helpers.synthetic import chamber_round


@pytest.mark.parametrize("count", [20, 200, 2000, 20_000])
def test_windows_get_their_dents_by_the_flux_of_a_gas(count: int) -> None:
    """n v / 4 impacts per area and time: the time, or else the gauge, follows from it."""
    chamber = chamber_round(trimesh.creation.box((0.03, 0.03, 0.03)), gap=0.02)
    shot = SimpleNamespace(count=count, diameter=1e-3)
    design: Any = SimpleNamespace(shot=shot, sonotrode=SimpleNamespace(peak_speed=5.0))
    budget = propose_budget(design, chamber)
    flux = FAR * count / chamber.volume * SPEED * 5.0 / 4.0
    dents = REPLICAS * flux * 1e-6 * budget.gauge_mm2 * budget.time
    assert dents >= 0.99 * DENTS
    assert np.isclose(budget.gauge_mm2, 1.0) == (not budget.gauge_reason)


def test_few_balls_get_wider_windows_and_it_is_said() -> None:
    chamber = chamber_round(trimesh.creation.box((0.3, 0.3, 0.3)), gap=0.1)
    shot = SimpleNamespace(count=3, diameter=3e-3)
    design: Any = SimpleNamespace(shot=shot, sonotrode=SimpleNamespace(peak_speed=5.0))
    budget = propose_budget(design, chamber)
    assert budget.gauge_mm2 > 1.0
    assert "WIDER" in budget.gauge_reason

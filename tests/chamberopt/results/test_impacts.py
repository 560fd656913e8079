"""A replica simulated again and beyond the end of its result has the result's own dents first."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chamberopt.common.errors import InputError
from chamberopt.coverage.dents import dents_on_part
from chamberopt.results import impacts
from chamberopt.results.impacts import COSTED, simulate_dents, simulation_seconds
from chamberopt.results.rebuild import rebuild_replica
from sim_core import Scene, simulate
from tests.helpers.results.short_plate import plate_result


def test_a_peening_continues_the_replica_of_the_result(tmp_path: Path) -> None:
    replica = rebuild_replica(plate_result(tmp_path / "plate"))
    own = dents_on_part(simulate(replica.scene).impacts, replica.chamber, replica.design)
    longer = simulate_dents(replica, 0.5)
    assert len(longer) > 1.3 * len(own) > 300
    np.testing.assert_array_equal(longer.place[: len(own)], own.place)
    np.testing.assert_array_equal(longer.time[: len(own)], own.time)
    shorter = simulate_dents(replica, 0.1)
    assert shorter.time.max() <= 0.1
    np.testing.assert_array_equal(shorter.radius, own.radius[: len(shorter)])
    slower = replica.scene.balls.velocities * (1.0 - 1e-9)
    balls = replace(replica.scene.balls, velocities=slower)
    with pytest.raises(InputError, match=r"does not simulate it again bit for bit: .* impacts are"):
        simulate_dents(replace(replica, scene=replace(replica.scene, balls=balls)), 0.5)
    for time in (0.0, 601.0, float("nan")):
        with pytest.raises(InputError, match="--at-s"):
            simulate_dents(replica, time)


def test_what_simulating_costs_goes_with_the_simulated_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A clock that advances by the simulated time costs as many seconds as are simulated."""
    replica = rebuild_replica(plate_result(tmp_path / "plate"))
    clock = [7.0]

    def simulated(scene: Scene, **_: object) -> None:
        clock[0] += scene.warmup + scene.duration

    monkeypatch.setattr(impacts, "perf_counter", lambda: clock[0])
    monkeypatch.setattr("sim_core.simulate", simulated)
    for time in (0.5, 3.0):
        whole = replica.scene.warmup + time
        assert simulation_seconds(replica, time) == pytest.approx(whole)
    assert COSTED < 1.0

"""A result's chamber and replicas are those that were simulated."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.replica_seed import replica_seed
from chamberopt.chamber.scene import build_scene, chamber_mesh
from chamberopt.common.errors import InputError
from chamberopt.results.load import Result
from chamberopt.results.rebuild import _identity, rebuild_replica
from sim_core import simulate
from tests.helpers.results.short_plate import plate_result


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    return plate_result(tmp_path_factory.mktemp("rebuild") / "plate")


def test_a_replica_has_the_scene_of_the_chamber_that_is_built(result: Result) -> None:
    replica, design = rebuild_replica(result, 2), result.design
    built = build_scene(design, chamber_mesh(build_chamber(design)), replica_seed(1, 2))
    np.testing.assert_array_equal(replica.scene.mesh.vertices, built.mesh.vertices)
    np.testing.assert_array_equal(replica.scene.mesh.triangles, built.mesh.triangles)
    np.testing.assert_array_equal(replica.scene.balls.positions, built.balls.positions)
    assert replica.scene.physics == built.physics


def test_a_replica_that_is_not_there_is_refused(result: Result, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--replica: given 3; the result has 3, give 0 to 2"):
        rebuild_replica(result, 3)


def test_impacts_are_the_results_own_to_the_last_bit(result: Result) -> None:
    """Those on the wall, and those after the recorded time, are no part of a result."""
    replica = rebuild_replica(result, 0)
    log = simulate(replica.scene).impacts
    on_part = np.flatnonzero(replica.chamber.source[replica.on_chamber(log).triangle] >= 0)
    assert len(on_part) > 0
    speed = log.normal_speed.copy()
    speed[on_part[0]] *= 1.0 + 1e-6
    with pytest.raises(InputError, match=f" 1 of {len(on_part)} impacts are not the result's"):
        replica.on_chamber(replace(log, normal_speed=speed))
    time = log.time.copy()
    time[on_part[0]] = replica.scene.duration
    replica.on_chamber(replace(log, normal_speed=speed, time=time))
    on_wall = np.ones(len(log), dtype=bool)
    on_wall[on_part] = False
    other = np.where(on_wall, 2.0 * log.normal_speed, log.normal_speed)
    replica.on_chamber(replace(log, normal_speed=other))


def test_impacts_are_alike_only_if_triangle_and_speed_are_the_same() -> None:
    rng = np.random.default_rng(2)
    triangle = rng.integers(0, 3, 2000)
    speed = rng.choice(np.array([1.0, np.nextafter(np.float32(1.0), 2.0), 1e-3, 5.0]), 2000)
    _, alike = np.unique(_identity(triangle, speed), return_inverse=True)
    pairs = np.unique(
        np.column_stack([alike, triangle, np.unique(speed, return_inverse=True)[1]]), axis=0
    )
    assert len(pairs) == len(np.unique(alike)) == 12

"""Balls that hop on one spot or rattle in a gap are told from those that fly or lie still."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from sim_core import (
    Balls,
    Friction,
    Gravity,
    Physics,
    Restitution,
    Scene,
    TriangleMesh,
    Vibration,
    pack_balls,
    simulate,
)
from sim_core.loop.stays import MIN_HITS, end_series, new_stays
from tests.helpers.scenes.cavities import CEILING, FLOOR, SIDES, box_around, cylinder
from tests.helpers.scenes.contact_mode import ROOM, physics, shot

DIAMETER = 3e-3
LAW = (0.91, 1.0, 0.0)
SHAKING = Vibration(FLOOR, 25e-6, 20e3, 1.0)
SECONDS = 2.0


def shaken_cylinder(count: int, mu: float | None, subdivisions: int = 0) -> Scene:
    """Balls over a vibrating floor, under a flat lid 40 mm above it, with and without friction."""
    mesh, rng = cylinder(0.035, 0.04, 64, subdivisions), np.random.default_rng(1)
    places = pack_balls(mesh, count, DIAMETER, rng, SHAKING.amplitude)
    balls = Balls(places, rng.normal(0.0, 2.0, places.shape), DIAMETER)
    rubs = None if mu is None else Friction(((mu, 0.0),) * 3, (mu, 0.0))
    effects = Physics(Gravity(), Restitution((LAW,) * 3, LAW), SHAKING, friction=rubs)
    return Scene(mesh, balls, effects, SECONDS, record=(CEILING,))


@pytest.mark.parametrize("subdivisions", [0, 1])
def test_few_balls_with_friction_end_hopping_on_one_spot(subdivisions: int) -> None:
    """Smooth parallel faces take all sideways speed: benchmarks/friction.py has it of 15 balls."""
    result = simulate(shaken_cylinder(15, 0.2, subdivisions))
    found = result.trapped
    assert len(found) == 15
    assert found.at_end.all()
    assert found.hopping.sum() > 0.7 * 15 * SECONDS
    assert (found.hopping <= SECONDS).all()
    assert not found.rattling.any()
    # Few impacts are none of the hops, those before the sideways speed is gone.
    assert 0.7 * len(result.impacts) < found.hopping_hits.sum() <= len(result.impacts)
    last = [result.impacts.position[result.impacts.ball == k][-1] for k in found.ball]
    sideways = (found.position - np.array(last))[:, :2]
    assert (np.hypot(*sideways.T) < 0.5 * DIAMETER).all()


def test_no_ball_of_a_gas_is_trapped() -> None:
    assert len(simulate(shaken_cylinder(40, None)).trapped) == 0


@pytest.mark.long
def test_balls_that_come_to_lie_still_are_not_trapped() -> None:
    """They bounce on one spot of a still floor, ever lower, until they land."""
    places = [[0.005, 0.005, 0.03], [0.015, 0.015, 0.02], [0.005, 0.015, 0.01]]
    result = simulate(Scene(ROOM, shot(places), physics(0.9), 8.0))
    assert len(result.resting) == 3
    assert len(result.impacts) > 3 * MIN_HITS
    assert len(result.trapped) == 0


def groove(subdivisions: int, width: float = 0.98) -> Scene:
    """A ball above a groove between two blocks, of a width in balls, and a floor that vibrates far
    below.
    """
    blocks = [trimesh.creation.box((6e-3, 4e-3, 4e-3)) for _ in range(2)]
    for side, block in zip((-1.0, 1.0), blocks, strict=True):
        block.apply_translation([0.0, side * (2e-3 + 0.5 * width * DIAMETER), 0.0])
    blocks = [block.subdivide() if subdivisions else block for block in blocks]
    mesh = box_around(trimesh.util.concatenate(blocks), 10e-3)
    heights = mesh.vertices[mesh.triangles][:, :, 2]
    tags = np.where((heights == heights.min()).all(axis=1), FLOOR, mesh.tags)
    above = np.array([[0.0, 0.0, 2e-3 + 0.6 * DIAMETER]])
    ball = Balls(above, np.zeros((1, 3)), DIAMETER)
    effects = Physics(Gravity(), Restitution((LAW,) * 3, LAW), SHAKING)
    room = TriangleMesh(mesh.vertices, mesh.triangles, tags)
    assert set(tags.tolist()) == {CEILING, FLOOR, SIDES}
    return Scene(room, ball, effects, 1.0, record=(CEILING,))


@pytest.mark.parametrize("subdivisions", [0, 1])
def test_a_ball_in_a_groove_hardly_narrower_than_itself_rattles(subdivisions: int) -> None:
    scene = groove(subdivisions)
    result = simulate(scene)
    found = result.trapped
    assert found.ball.tolist() == [0]
    assert found.at_end.all()
    assert found.rattling[0] > 0.5
    assert found.hopping[0] == 0.0
    assert found.rattling_hits[0] > 0.9 * len(result.impacts)
    away = found.position[0] - scene.balls.positions[0]
    assert np.hypot(*away[:2]) < 0.5 * DIAMETER


def test_a_ball_between_parallel_walls_is_held_from_its_tenth_hit_on() -> None:
    """Without gravity and loss it hits after half a clearance c, then every c / v."""
    scene, clearance, speed, hits = groove(0, 1.006), 0.006 * DIAMETER, 0.1, 40
    lossless = Restitution(((1.0, 1.0, 0.0),) * 3, (1.0, 1.0, 0.0))
    physics = scene.physics._replace(gravity=Gravity(0.0, 0.0, 0.0), restitution=lossless)
    ball = Balls(np.zeros((1, 3)), np.array([[0.0, speed, 0.0]]), DIAMETER)
    between = replace(scene, balls=ball, physics=physics, duration=hits * clearance / speed)
    found = simulate(replace(between, record_held=False))
    assert len(found.impacts) == MIN_HITS - 1
    assert found.trapped.rattling_hits.tolist() == [hits - (MIN_HITS - 1)]
    assert found.trapped.rattling[0] == pytest.approx((hits - 1) * clearance / speed)


def test_a_held_ball_is_told_of_while_it_is_held() -> None:
    """The last tells name the ball of the groove, where the result has it."""
    told: list[np.ndarray] = []
    result = simulate(groove(0), held=told.append)
    assert len(told) >= 5
    assert [len(one) for one in told[-3:]] == [1, 1, 1]
    assert told[-1] == pytest.approx(result.trapped.position, abs=1e-9)


def test_hits_of_a_held_ball_can_be_left_out_of_the_log_and_change_no_other_bit() -> None:
    scene = groove(0)
    whole, part = simulate(scene), simulate(replace(scene, record_held=False))
    assert np.array_equal(part.balls.positions, whole.balls.positions)
    left_out = int(part.trapped.rattling_hits.sum())
    assert left_out == whole.trapped.rattling_hits.sum() > 0
    assert len(part.impacts) == len(whole.impacts) - left_out >= MIN_HITS - 1
    assert np.isin(part.impacts.time, whole.impacts.time).all()
    # The ball comes down into the groove with its hardest hits, which are logged.
    held = ~np.isin(whole.impacts.time, part.impacts.time)
    assert whole.impacts.normal_speed[held].mean() < 0.1 * part.impacts.normal_speed.max()
    # Of a simulation that is cut short the same hits are left out.
    early = simulate(replace(scene, record_held=False, duration=0.3)).impacts
    assert np.array_equal(early.time, part.impacts.time[part.impacts.time < 0.3])


def test_what_came_before_the_recording_does_not_count() -> None:
    scene = groove(0)
    later = simulate(replace(scene, warmup=0.5, duration=0.25)).trapped
    assert 0.0 < later.rattling[0] <= 0.25


def test_a_ball_that_other_balls_keep_in_place_is_not_trapped() -> None:
    """As in a dense layer: it hits its neighbours more often than the floor."""
    for meetings, is_trapped in ((MIN_HITS, True), (3 * MIN_HITS, False)):
        stays = new_stays(1, 0.5 * DIAMETER, Gravity(), ())
        stays.hits[0], stays.meetings[0], stays.last[0] = 2 * MIN_HITS, meetings, 1.0
        assert end_series(stays, 0, False) is is_trapped

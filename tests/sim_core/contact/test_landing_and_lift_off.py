"""Capture and sliding against what mechanics says of a point on a surface."""

import math

import numpy as np
import pytest
from scipy.special import ellipk

from sim_core import Gravity, Physics, Rest, Scene, SceneError, TriangleMesh, simulate
from sim_core.effects.contact_mode import ASLEEP
from sim_core.effects.gravity import STANDARD as G
from tests.helpers.jit_on_and_off import with_and_without_jit
from tests.helpers.scenes.cavities import FLOOR, box
from tests.helpers.scenes.contact_mode import (
    CAPTURE,
    DIAMETER,
    ROOM,
    TOUCH,
    R,
    energies,
    film,
    mode,
    physics,
    shot,
    slope,
    small_scene,
    supports,
)
from tests.helpers.scenes.terrain import profile, terrain
from tests.sim_core.loop.test_determinism import fingerprint


@pytest.mark.parametrize("e", [0.5, 0.9])
def test_a_dropped_ball_stops_when_the_series_of_its_bounces_ends(e: float) -> None:
    """Bounces last 2 e^k v/g, in all (v/g) (1 + 2e/(1-e)); capture cuts off 2 capture/(g (1-e))."""
    height = 0.01
    v = math.sqrt(2.0 * G * height)
    result = simulate(Scene(ROOM, shot([0.01, 0.01, R + height]), physics(e), 2.0))
    series = v / G * (1.0 + 2.0 * e / (1.0 - e))
    assert len(result.resting) == 1
    assert series - 2.0 * CAPTURE / (G * (1.0 - e)) < result.resting.since[0] <= series
    assert result.collisions.walls == math.ceil(math.log(CAPTURE / v) / math.log(e)) + 1
    np.testing.assert_allclose(result.balls.positions[0], [0.01, 0.01, R], atol=1e-15)
    assert (result.balls.velocities == 0.0).all()
    assert result.resting.triangles[0, 0] in np.flatnonzero(ROOM.tags == FLOOR)


def test_a_ball_at_rest_costs_nothing() -> None:
    run, _ = film(ROOM, shot([0.01, 0.01, R + 1e-9]), physics(), 0.1, 1)
    before = run.state.counts.copy()
    run.play(100.0, record=False)
    assert (run.state.counts == before).all()
    assert run.balls().positions[0, 2] == pytest.approx(R, abs=1e-15)


def test_on_the_edge_between_two_faces_of_one_plane_a_ball_gets_no_kick() -> None:
    rng = np.random.default_rng(4)
    nodes = np.linspace(0.0, 0.04, 5)
    floor = terrain(nodes, nodes, np.zeros((5, 5)), 0.05, rng, tags=6)
    for place in ([0.02, 0.013, R + 0.004], [0.02, 0.02, R + 0.004], [0.025, 0.025, R + 0.004]):
        balls = simulate(Scene(floor, shot(place), physics(), 1.0)).balls
        np.testing.assert_array_equal(balls.positions[0, :2], place[:2])
        assert (balls.velocities == 0.0).all()


@pytest.mark.parametrize("tags", [1, 6])  # one: the plane is merged; six: its triangles stay apart
@pytest.mark.parametrize("resistance", [0.0, 0.1])
def test_down_a_ramp_of_many_triangles_it_slides_as_on_one(tags: int, resistance: float) -> None:
    """s = ½ g (sin - resistance cos) t², straight down."""
    degrees, until = 15.0, 0.35
    rng = np.random.default_rng(3)
    x = np.sort(np.concatenate([[0.0, 0.3], rng.uniform(0.0, 0.3, 30)]))
    y = np.sort(np.concatenate([[-0.02, 0.02], rng.uniform(-0.02, 0.02, 6)]))
    ramp = terrain(
        x, y, np.tile(-math.tan(math.radians(degrees)) * x[:, None], len(y)), 0.05, rng, tags
    )
    normal, down = slope(degrees)
    start = 0.02 / down[0] * down + R * normal + np.array([0.0, 0.003, 0.0])
    run, frames = film(ramp, shot(start), physics(resistance=resistance), until)
    push = G * (math.sin(math.radians(degrees)) - resistance * math.cos(math.radians(degrees)))
    gone = frames[-1].positions[0] - start
    assert gone @ down == pytest.approx(
        0.5 * push * until**2, rel=1e-9 if resistance == 0.0 else 1e-7
    )
    assert abs(gone @ normal) < TOUCH
    assert abs(gone[1]) < TOUCH
    assert frames[-1].velocities[0] @ down == pytest.approx(push * until, rel=1e-7)
    assert run.state.counts[0] == 1
    if resistance == 0.0:
        assert np.abs(np.diff(energies(frames))).max() < 1e-14


@pytest.mark.parametrize(("first", "second"), [(20.0, 8.0), (8.0, 20.0)])
def test_over_a_gentle_change_of_slope_it_keeps_its_energy(first: float, second: float) -> None:
    a, b = math.tan(math.radians(first)), math.tan(math.radians(second))
    ramp = profile(
        np.array([0.0, 0.1, 0.3]), np.array([0.0, -0.1 * a, -0.1 * a - 0.2 * b]), 0.02, 0.08
    )
    normal, down = slope(first)
    _, frames = film(ramp, shot(0.03 * down + R * normal), physics(), 0.4)
    spent = energies(frames)
    assert np.abs(spent - spent[0]).max() < 1e-7
    assert frames[-1].positions[0, 0] > 0.13
    normal, _ = slope(second)
    assert frames[-1].velocities[0] @ normal == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("facet", [2.0, 0.5])  # degrees
def test_a_trough_of_facets_is_a_pendulum(facet: float) -> None:
    """T = 4 sqrt(L/g) K(sin(amplitude/2)) with L the trough's radius less the ball's."""
    radius = 0.05
    angle = np.radians(np.arange(-60.0, 60.0 + 0.5 * facet, facet))
    trough = profile(radius * np.sin(angle), -radius * np.cos(angle), 0.01, 0.02)
    length = radius - R
    start = math.radians(20.0)
    run, frames = film(
        trough,
        shot([0.999 * length * math.sin(start), 0.0, -0.999 * length * math.cos(start)]),
        physics(0.5),
        4.0,
        800,
    )
    x, time = np.array([f.positions[0, 0] for f in frames]), np.linspace(0.0, 4.0, 801)
    up = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    crossings = time[up] - x[up] * (time[up + 1] - time[up]) / (x[up + 1] - x[up])
    swing = math.asin(np.abs(x[400:]).max() / length)
    period = 4.0 * math.sqrt(length / G) * float(ellipk(math.sin(0.5 * swing) ** 2))
    assert np.diff(crossings)[2:].mean() == pytest.approx(period, rel=3.5e-3 * facet)
    spent = energies(frames)
    assert np.abs(spent[100:] - spent[100]).max() < 1e-12
    assert run.state.counts[3] < 20_000


def test_a_bowl_of_triangles_keeps_the_energy() -> None:
    radius, rng = 0.04, np.random.default_rng(8)
    nodes = np.linspace(-0.02, 0.02, 41)
    x, y = np.meshgrid(nodes, nodes, indexing="ij")
    bowl = terrain(nodes, nodes, -np.sqrt(radius**2 - x**2 - y**2), 0.02, rng, tags=6)
    length = radius - 1.05 * R
    start = [0.2 * length, 0.1 * length, -length * math.sqrt(1.0 - 0.05)]
    run, frames = film(bowl, shot(start, [0.0, 0.1, 0.0]), physics(0.5), 2.0)
    spent = energies(frames)
    assert (np.diff(spent) < 1e-12).all()
    depth = spent[20] - (-G * length)
    assert (
        spent[20] - spent[-1] < 0.02 * depth
    )  # what is lost where three faces meet at the bowl's bottom
    assert run.state.counts[3] < 20_000


@pytest.mark.parametrize("resistance", [0.0, 0.02])
def test_down_a_valley_it_is_led_by_both_faces(resistance: float) -> None:
    """Along the crease it gains g (sin - resistance load), with a load of cos(crease)/cos(40°)."""
    lift, fall = math.tan(math.radians(40.0)), 0.1
    y, x = np.array([-0.02, 0.0, 0.02]), np.linspace(0.0, 0.3, 31)
    valley = terrain(
        x, y, np.abs(y)[None, :] * lift - fall * x[:, None], 0.05, np.random.default_rng(1), tags=4
    )
    one = np.array([fall, -lift, 1.0]) / math.sqrt(fall**2 + lift**2 + 1.0)
    start = np.array([0.02, 0.0, -0.002 + R / one[2]])
    until = 0.5
    run, frames = film(valley, shot(start), physics(resistance=resistance), until)
    crease = np.array([1.0, 0.0, -fall]) / math.hypot(1.0, fall)
    push = G * (-crease[2])
    load = G * crease[0]  # the part of the weight that the crease does not carry along
    gone = frames[-1].positions[0] - start
    assert gone @ crease == pytest.approx(0.5 * (push - resistance * load) * until**2, rel=1e-6)
    assert abs(gone[1]) < 1e-12
    assert supports(run) == 2


def test_wedged_against_three_faces_it_sleeps() -> None:
    """It lies r over the sine of the faces' slope above the tip of an upturned tetrahedron."""
    corner = np.radians([90.0, 210.0, 330.0])
    rim = np.column_stack([0.03 * np.cos(corner), 0.03 * np.sin(corner), np.full(3, 0.03)])
    pit = TriangleMesh(
        np.vstack([rim, np.zeros(3)]),
        np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]]),
        np.ones(4, int),
    )
    run, frames = film(pit, shot([0.002, 0.001, 0.02], [0.1, 0.2, 0.0]), physics(), 2.0)
    upright = 1.0 / math.hypot(
        1.0, 0.03 / (0.03 * math.cos(math.radians(60.0)))
    )  # z of the faces' unit normals
    np.testing.assert_allclose(frames[-1].positions[0], [0.0, 0.0, R / upright], atol=1e-12)
    assert (frames[-1].velocities == 0.0).all()
    assert (np.diff(energies(frames)) < 1e-15).all()
    before = run.state.counts.copy()
    run.play(20.0, record=False)
    assert (run.state.counts == before).all()
    assert before[3] < 1000


@pytest.mark.parametrize("gap", [1e-9, 1e-7, 1e-5, 1e-3])
def test_in_a_slot_just_wider_than_itself_it_costs_a_bounded_number_of_events(gap: float) -> None:
    slot = box((DIAMETER + gap, 0.02, 0.05))
    run, frames = film(
        slot, shot([R + 0.5 * gap, 0.01, 0.02], [0.05, 0.1, 0.0]), physics(0.8, 0.005), 3.0
    )
    assert run.state.counts.sum() < 2000
    assert (np.diff(energies(frames)) < 1e-15).all()
    assert mode(run) == ASLEEP
    assert run.balls().positions[0, 2] == pytest.approx(R, abs=1e-12)


def test_a_scene_with_rest_gives_the_same_bits_with_the_jit_off() -> None:
    code = (
        "from tests.helpers.scenes.contact_mode import small_scene; from sim_core import simulate;"
        "from tests.sim_core.loop.test_determinism import fingerprint;"
        "r = simulate(small_scene()); print(r.collisions.total, len(r.resting), fingerprint(r))"
    )
    answers = with_and_without_jit(code)
    assert int(answers[0].split()[0]) > 50
    assert int(answers[0].split()[1]) > 0
    assert answers[0] == answers[1]
    assert fingerprint(simulate(small_scene())) == answers[0].split()[2]


def test_rest_is_checked() -> None:
    for wrong in (Rest(0.0), Rest(CAPTURE, -1.0), Rest(math.nan)):
        with pytest.raises(SceneError, match="rest"):
            Scene(ROOM, shot([0.01, 0.01, 0.01]), Physics(Gravity(), rest=wrong), 1.0)

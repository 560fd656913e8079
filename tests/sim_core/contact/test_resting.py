"""Sliding, resting, stuck: contact mode against what mechanics says of a point on a surface.

Steel balls of 3 mm; frictionless where nothing else is said. e is constant, so that closed forms exist.
"""

import math

import numpy as np
import pytest
from scipy.special import ellipk

from sim_core import (
    Balls,
    Gravity,
    Physics,
    Rest,
    Restitution,
    Scene,
    SceneError,
    TriangleMesh,
    Vibration,
    can_rest,
    pack_balls,
    simulate,
)
from sim_core.contact.jamming import hold
from sim_core.contact.path_end import TURN
from sim_core.effects.contact_mode import ASLEEP, JAMMED, MODE, ON_BALL, STAYS_UNTIL, SUPPORTS
from sim_core.effects.gravity import STANDARD as G
from sim_core.loop.contact_neighbours import LEANING, count_neighbours
from sim_core.loop.simulate import _Run
from sim_core.numerics.vec3 import Vec3
from sim_core.scene.invariants import clearance, closest_pair, energy
from tests.hard_cases.force_balance import force_lacking
from tests.helpers.jit_on_and_off import with_and_without_jit
from tests.helpers.scenes.cavities import FLOOR, box, cylinder
from tests.helpers.scenes.terrain import profile, terrain
from tests.sim_core.loop.test_determinism import fingerprint

DIAMETER = 3e-3
R = 0.5 * DIAMETER
CAPTURE = 1e-3
TAGS = 8
TOUCH = 1e-12  # m: the promise on gaps


def physics(e: float = 0.8, resistance: float = 0.0, vibration: Vibration | None = None) -> Physics:
    law = (e, 1e3)
    return Physics(Gravity(), Restitution((law,) * TAGS, law), vibration, Rest(CAPTURE, resistance))


def shot(places: object, velocities: object = 0.0) -> Balls:
    places = np.atleast_2d(np.array(places, dtype=float))
    return Balls(
        places, np.broadcast_to(np.array(velocities, dtype=float), places.shape).copy(), DIAMETER
    )


def film(
    mesh: TriangleMesh, balls: Balls, what: Physics, until: float, pictures: int = 100
) -> tuple[_Run, list[Balls]]:
    """The run, and the balls at so many equal steps from the start on; gaps are checked at each."""
    run = _Run(Scene(mesh, balls, what, until))
    frames = [balls]
    for stop in np.linspace(0.0, until, pictures + 1)[1:]:
        run.play(float(stop), record=False)
        frames.append(run.balls())
        assert clearance(mesh.corners, frames[-1].positions, DIAMETER).min() > R - TOUCH
        assert len(balls) == 1 or closest_pair(frames[-1])[0] > DIAMETER - TOUCH
    return run, frames


def energies(frames: list[Balls]) -> np.ndarray:
    """Energy per ball mass [J/kg]."""
    return np.array([energy(balls, Gravity()) / balls.ball_mass for balls in frames])


def feet(run: _Run) -> int:
    """On how many the first ball stands."""
    assert run.contact is not None
    return int(run.contact.marks[0, SUPPORTS])


def mode(run: _Run) -> int:
    """How the first ball moves."""
    assert run.contact is not None
    return int(run.contact.marks[0, MODE])


def slope(degrees: float) -> tuple[np.ndarray, np.ndarray]:
    """Unit normal and downhill direction of a plane that falls towards +x."""
    angle = math.radians(degrees)
    return np.array([math.sin(angle), 0.0, math.cos(angle)]), np.array(
        [math.cos(angle), 0.0, -math.sin(angle)]
    )


ROOM = box((0.02, 0.02, 0.05))


@pytest.mark.parametrize("e", [0.5, 0.9])
def test_a_dropped_ball_stops_when_the_series_of_its_bounces_ends(e: float) -> None:
    """Bounces last 2 e^k v/g: t = (v/g) (1 + 2e/(1-e)); what is cut off below capture is 2 capture/(g (1-e)) long."""
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
    before = run.count.copy()
    run.play(100.0, record=False)
    assert (run.count == before).all()
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
    assert run.count[0] == 1
    if resistance == 0.0:
        assert np.abs(np.diff(energies(frames))).max() < 1e-14


def test_resistance_stops_a_sliding_ball_and_holds_it_on_a_gentle_slope() -> None:
    """v²/(2 resistance g) on the level; on a slope of tan < resistance it never starts."""
    v, resistance = 0.3, 0.4
    result = simulate(
        Scene(
            box((0.1, 0.02, 0.02)),
            shot([0.01, 0.01, R], [v, 0.0, 0.0]),
            physics(0.8, resistance),
            1.0,
        )
    )
    assert result.balls.positions[0, 0] - 0.01 == pytest.approx(
        v**2 / (2.0 * resistance * G), rel=1e-6
    )
    assert result.resting.since[0] == pytest.approx(v / (resistance * G), rel=1e-6)
    normal, down = slope(20.0)
    x = np.array([0.0, 0.1])
    ramp = profile(x, -math.tan(math.radians(20.0)) * x, 0.01, 0.05)
    start = 0.05 * down + (R + 1e-9) * normal
    for resistance, still in ((0.37, True), (0.36, False)):  # tan 20° = 0.364
        result = simulate(Scene(ramp, shot(start), physics(0.8, resistance), 0.2))
        assert (len(result.resting) == 1) is still


@pytest.mark.parametrize(
    "speed", [0.4, 4.0]
)  # the faster turns by less than TURN while it is searched in one piece
def test_resistance_is_against_the_motion_of_a_ball_that_turns_downhill(speed: float) -> None:
    """Thrown across a slope, against small steps of v' = g sin - resistance g cos v/|v|."""
    resistance, degrees, until = 0.25, 20.0, 0.3
    normal, down = slope(degrees)
    x = np.array([0.0, 0.5])
    ramp = profile(x, -math.tan(math.radians(degrees)) * x, 0.7 * speed, 0.05)
    start, v = 0.02 / down[0] * down + R * normal, np.array([0.0, speed, 0.0])
    _, frames = film(ramp, shot(start, v), physics(resistance=resistance), until, 10)
    step, place, brake = 1e-5, start.copy(), resistance * G * math.cos(math.radians(degrees))
    for _ in range(round(until / step)):
        place += step * v
        v = v + step * (G * math.sin(math.radians(degrees)) * down - brake * v / np.linalg.norm(v))
    lag = 0.5 * TURN * brake  # the force's direction is old by TURN at most
    np.testing.assert_allclose(frames[-1].positions[0], place, atol=0.5 * lag * until**2)
    np.testing.assert_allclose(frames[-1].velocities[0], v, atol=lag * until)


def test_it_lifts_off_at_the_ramps_end() -> None:
    """A parabola from the edge with the speed of the slide; the foot reaches 1.5 seams (15 nm) past the edge."""
    normal, down = slope(20.0)
    edge = 0.1 / down[0]
    z = -0.1 * math.tan(math.radians(20.0))
    cliff = profile(
        np.array([0.0, 0.1, 0.105, 0.3]), np.array([0.0, z, z - 0.05, z - 0.05]), 0.02, 0.05
    )
    start, push, length, after = (
        0.02 * down + R * normal,
        G * math.sin(math.radians(20.0)),
        edge - 0.02,
        0.05,
    )
    slide = math.sqrt(2.0 * length / push)
    balls = simulate(Scene(cliff, shot(start), physics(), slide + after)).balls
    flight = down * push * slide * after + 0.5 * after**2 * np.array([0.0, 0.0, -G])
    np.testing.assert_allclose(balls.positions[0], start + down * length + flight, atol=2e-8)


@pytest.mark.parametrize("speed", [0.002, 0.05, 0.1])
def test_slowly_over_an_edge_it_rolls_until_it_leaves_it(speed: float) -> None:
    """Round an edge of radius R a point leaves where cos a = (2 + v²/(g R))/3, with v_x = sqrt(g R) cos^(3/2) a.

    The arc is taken in steps of 0.004 rad.
    """
    x = np.array([0.0, 0.1, 0.1 + 1e-6, 0.4])
    cliff = profile(x, np.array([0.0, 0.0, -0.05, -0.05]), 0.02, 0.05)
    _, frames = film(
        cliff, shot([0.0999, 0.0, R], [speed, 0.0, 0.0]), physics(), 1e-4 / speed + 0.06, 60
    )
    leaves = min(1.0, (2.0 + speed**2 / (G * R)) / 3.0)
    assert (np.diff(energies(frames)) < 1e-12).all()
    end = frames[-1]
    if end.positions[0, 2] > -0.05 + R + 1e-3:  # in flight, not down yet
        assert end.velocities[0, 0] == pytest.approx(math.sqrt(G * R) * leaves**1.5, rel=0.03)


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
    """Length: the trough's radius less the ball's; T = 4 sqrt(L/g) K(sin(amplitude/2)). Energy stays."""
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
    assert run.count[3] < 20_000


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
    assert run.count[3] < 20_000


@pytest.mark.parametrize("resistance", [0.0, 0.02])
def test_down_a_valley_it_is_led_by_both_faces(resistance: float) -> None:
    """Along the crease: g (sin - resistance load) with the load of both faces; cos(crease)/cos(40°) here."""
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
    assert feet(run) == 2


def test_wedged_against_three_faces_it_sleeps() -> None:
    """In the tip of a tetrahedron that stands on its tip: r over the sine of the faces' slope above it."""
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
    before = run.count.copy()
    run.play(20.0, record=False)
    assert (run.count == before).all()
    assert before[3] < 1000


@pytest.mark.parametrize("gap", [1e-9, 1e-7, 1e-5, 1e-3])
def test_in_a_slot_just_wider_than_itself_it_costs_a_bounded_number_of_events(gap: float) -> None:
    slot = box((DIAMETER + gap, 0.02, 0.05))
    run, frames = film(
        slot, shot([R + 0.5 * gap, 0.01, 0.02], [0.05, 0.1, 0.0]), physics(0.8, 0.005), 3.0
    )
    assert run.count.sum() < 2000
    assert (np.diff(energies(frames)) < 1e-15).all()
    assert mode(run) == ASLEEP
    assert run.balls().positions[0, 2] == pytest.approx(R, abs=1e-12)


def test_a_settling_heap_falls_still_and_is_reported() -> None:
    rng = np.random.default_rng(2)
    heap = pack_balls(box((0.012, 0.012, 0.03)), 50, DIAMETER, rng)
    balls = Balls(heap, rng.normal(0.0, 0.1, heap.shape), DIAMETER)
    run, frames = film(box((0.012, 0.012, 0.05)), balls, physics(0.9, 0.005), 2.0, 40)
    assert (np.diff(energies(frames)) < 50 * CAPTURE**2).all()
    assert np.abs(frames[-1].velocities).max() < 0.02
    assert run.count[:3].sum() < 2_000_000
    result = simulate(Scene(box((0.012, 0.012, 0.05)), balls, physics(0.9, 0.005), 2.0))
    assert len(result.resting) > 25


def rough_floor(rng: np.random.Generator) -> TriangleMesh:
    """Peaks and pits as wide as a ball and more, with edges that balls are wedged against."""
    nodes = np.linspace(0.0, 0.02, 7)
    return terrain(nodes, nodes, rng.uniform(0.0, 0.004, (7, 7)), 0.05, rng)


@pytest.mark.parametrize("e", [0.0, 0.5, 0.9])
@pytest.mark.parametrize(("floor", "seed"), [("flat", 7), ("rough", 3), ("rough", 6)])
def test_in_a_settling_pile_nothing_overlaps(floor: str, seed: int, e: float) -> None:
    """Checked every millisecond (see film), and through restarts, which know nothing of who lies still."""
    rng = np.random.default_rng(seed)
    room = box((0.012, 0.012, 0.06)) if floor == "flat" else rough_floor(rng)
    places = pack_balls(room, 50, DIAMETER, rng)
    balls = Balls(places, rng.normal(0.0, 0.5, places.shape), DIAMETER)
    for _ in range(6):
        run, frames = film(room, balls, physics(e, 0.005), 0.1)
        balls = frames[-1]
        assert run.count[:3].sum() < 200_000
        assert run.contact is not None
        marks, rows = run.contact.marks, run.contact.rows
        stood_on = ON_BALL - rows[rows <= ON_BALL]
        assert (marks[stood_on, MODE] >= ASLEEP).all()
        assert (np.diff(energies(frames)) < 50 * CAPTURE**2).all()
    assert np.abs(balls.velocities).max() < 0.1


def test_balls_that_go_on_as_one_in_flight_do_not_jam() -> None:
    """e = 0: rounding leaves such balls approaching or not, and must not have them meet for ever."""
    rng = np.random.default_rng(6)
    room = box((0.025, 0.025, 0.06))
    places = pack_balls(room, 100, DIAMETER, rng)
    balls = Balls(places, rng.normal(0.0, 0.5, places.shape), DIAMETER)
    run, _ = film(room, balls, physics(0.0, 0.005), 0.01, 10)
    assert 100 < run.count[1] < 3000
    assert run.contact is not None
    assert (run.contact.marks[:, MODE] != JAMMED).all()


def test_another_balls_hit_wakes_it() -> None:
    """Equal balls, head on along the floor: (1 ± e)/2 of the speed."""
    e, v = 0.8, 0.5
    room = box((0.2, 0.02, 0.02))
    balls = shot([[0.05, 0.01, R], [0.1, 0.01, R]], [[v, 0.0, 0.0], [0.0, 0.0, 0.0]])
    meets = (0.05 - DIAMETER) / v
    end = simulate(Scene(room, balls, physics(e), meets + 0.1)).balls
    np.testing.assert_allclose(
        end.velocities[:, 0], [0.5 * (1 - e) * v, 0.5 * (1 + e) * v], rtol=1e-9
    )
    expected = np.array([0.1 - DIAMETER + 0.05 * (1 - e) * v, 0.1 + 0.05 * (1 + e) * v])
    np.testing.assert_allclose(end.positions[:, 0], expected, rtol=1e-9)
    np.testing.assert_allclose(end.positions[:, 2], R, atol=TOUCH)


def test_on_the_sonotrode_nothing_rests() -> None:
    room = cylinder(0.012, 0.02, sections=12)
    shaking = Vibration(FLOOR, 25e-6, 20e3, 0.3)
    rng = np.random.default_rng(5)
    balls = Balls(pack_balls(room, 5, DIAMETER, rng, clear=25e-6), np.zeros((5, 3)), DIAMETER)
    assert can_rest(room, Gravity())
    assert not can_rest(room, Gravity(), FLOOR)
    assert not can_rest(room, None)
    with_rest = simulate(Scene(room, balls, physics(0.8, 0.0, shaking), 2.0))
    assert len(with_rest.resting) == 0
    assert np.sqrt((with_rest.balls.velocities**2).sum(axis=1).mean()) > 0.3
    assert with_rest.collisions.total < 1_000_000


def test_a_scene_with_rest_gives_the_same_bits_with_the_jit_off() -> None:
    code = (
        "from tests.sim_core.contact.test_resting import small_scene; from sim_core import simulate;"
        "from tests.sim_core.loop.test_determinism import fingerprint;"
        "r = simulate(small_scene()); print(r.collisions.total, len(r.resting), fingerprint(r))"
    )
    answers = with_and_without_jit(code)
    assert int(answers[0].split()[0]) > 50
    assert int(answers[0].split()[1]) > 0
    assert answers[0] == answers[1]
    assert fingerprint(simulate(small_scene())) == answers[0].split()[2]


def small_scene() -> Scene:
    """Six balls come down into a narrow V; some are at rest before the end."""
    x, y = np.linspace(0.0, 0.02, 3), np.array([-0.008, 0.0, 0.008])
    valley = terrain(x, y, np.tile(0.5 * np.abs(y), (3, 1)), 0.02, np.random.default_rng(1), tags=3)
    rng = np.random.default_rng(6)
    places = np.column_stack(
        [np.linspace(0.0017, 0.0183, 4), rng.normal(0.0, 5e-4, 4), np.full(4, 0.004)]
    )
    return Scene(valley, shot(places), physics(0.5, 0.05), 0.15)


def test_rest_is_checked() -> None:
    for wrong in (Rest(0.0), Rest(CAPTURE, -1.0), Rest(math.nan)):
        with pytest.raises(SceneError, match="rest"):
            Scene(ROOM, shot([0.01, 0.01, 0.01]), Physics(Gravity(), rest=wrong), 1.0)


def held_beside_another(leaves: float) -> _Run:
    """Ball 0 is held in the air, 1 um beside ball 1, which goes aside at ``leaves`` [m/s]."""
    balls = shot(
        [[0.005, 0.01, 0.03], [0.005 + DIAMETER + 1e-6, 0.01, 0.03]],
        [[0.0, 0.0, 0.0], [leaves, 0.0, 0.0]],
    )
    run = _Run(Scene(ROOM, balls, physics(), 1.0))
    assert run.contact is not None
    hold_beside(run, 0.0)
    return run


def hold_beside(run: _Run, moment: float) -> None:
    """Hold ball 0 where it is, as if it had jammed."""
    assert run.contact is not None
    here = Vec3(*(float(x) for x in run.motion[0, :3]))
    hold(run.contact, run.motion, 0, 0.0, moment, here, R)
    count_neighbours(run.contact, run.motion, 0, 0.0, DIAMETER)


def test_a_held_ball_falls_when_one_of_those_around_it_has_gone() -> None:
    """20 um at 0.1 m/s takes 0.2 ms; it looks every 2 ms."""
    run = held_beside_another(0.1)
    assert mode(run) == JAMMED
    run.play(0.03, record=False)
    fallen = 0.03 - run.balls().positions[0, 2]
    assert 0.5 * G * (0.03 - 0.003) ** 2 < fallen <= 0.5 * G * 0.03**2


def test_a_ball_held_at_one_place_again_and_again_is_left_there_for_longer_each_time() -> None:
    """1, 3, 7 ... ms: so that jams cost the logarithm of the time, and none hangs for ever."""
    run = held_beside_another(0.1)
    for times in range(1, 6):
        hold_beside(run, 0.0)
        assert run.contact is not None
        assert run.contact.memory[0, STAYS_UNTIL] == pytest.approx(1e-3 * (2**times - 1))
    run.play(0.03, record=False)
    assert mode(run) == JAMMED
    run.play(0.031 + 0.03, record=False)
    fallen = 0.03 - run.balls().positions[0, 2]
    assert 0.5 * G * 0.027**2 < fallen <= 0.5 * G * 0.03**2 + TOUCH


def test_every_ball_of_a_settled_heap_is_held_by_what_it_touches() -> None:
    """Forces of contacts within LEANING, each within friction of 0.3, can carry all weights: a linear programme."""
    for seed in range(6):
        rng = np.random.default_rng(seed)
        room = rough_floor(rng) if seed % 2 else box((0.012, 0.012, 0.06))
        places = pack_balls(room, 50, DIAMETER, rng)
        balls = Balls(places, rng.normal(0.0, 0.3, places.shape), DIAMETER)
        run = _Run(Scene(room, balls, physics([0.5, 0.9][seed // 3], 0.005), 2.0))
        run.play(2.0, record=False)
        assert run.contact is not None
        still = np.flatnonzero(run.contact.marks[:, MODE] >= ASLEEP)
        assert len(still) > 45
        lacking = force_lacking(room, run.balls(), still, LEANING, friction=0.3)
        assert lacking.max() < 0.02, (
            f"seed {seed}: ball {still[lacking.argmax()]} lacks {lacking.max():.2f}"
        )

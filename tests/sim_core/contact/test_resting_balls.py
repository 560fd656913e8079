"""Which balls lie still at the end, and that what they touch can hold them."""

import numpy as np

from sim_core import Balls, Gravity, Roughness, Scene, Vibration, can_rest, pack_balls, simulate
from sim_core.effects.contact_mode import ASLEEP
from sim_core.loop.contact_neighbours import MAX_JAM_GAP
from sim_core.loop.simulate import Simulation
from tests.hard_cases.force_balance import force_lacking
from tests.helpers.scenes.cavities import FLOOR, SMOOTH, box, cylinder
from tests.helpers.scenes.contact_mode import (
    CAPTURE,
    DIAMETER,
    energies,
    film,
    physics,
    rough_floor,
)


def test_a_settling_heap_falls_still_and_is_reported() -> None:
    rng = np.random.default_rng(2)
    heap = pack_balls(box((0.012, 0.012, 0.03)), 50, DIAMETER, rng)
    balls = Balls(heap, rng.normal(0.0, 0.1, heap.shape), DIAMETER)
    run, frames = film(box((0.012, 0.012, 0.05)), balls, physics(0.9, 0.005), 2.0, 40)
    assert (np.diff(energies(frames)) < 50 * CAPTURE**2).all()
    assert np.abs(frames[-1].velocities).max() < 0.02
    assert run.state.counts[:3].sum() < 2_000_000
    result = simulate(Scene(box((0.012, 0.012, 0.05)), balls, physics(0.9, 0.005), 2.0))
    assert len(result.resting) > 25


def test_a_longer_warm_up_makes_the_times_of_rest_earlier_by_as_much() -> None:
    places = np.array([[0.004 * k - 0.002, 0.006, 0.01] for k in (1, 2, 3)])
    room, balls = box((0.012, 0.012, 0.05)), Balls(places, 0.0 * places, DIAMETER)
    without, with_warm_up = (
        simulate(Scene(room, balls, physics(0.9, 0.005), 2.0 - warm_up, warmup=warm_up)).resting
        for warm_up in (0.0, 1.5)
    )
    assert without.ball.tolist() == [0, 1, 2]
    assert (without.since > 0.0).all()
    np.testing.assert_allclose(with_warm_up.since, without.since - 1.5, rtol=1e-9)


def test_on_the_sonotrode_nothing_rests() -> None:
    room = cylinder(0.012, 0.02, sections=12)
    shaking = Vibration(FLOOR, 25e-6, 20e3, 0.3)
    rng = np.random.default_rng(5)
    balls = Balls(pack_balls(room, 5, DIAMETER, rng, clear=25e-6), np.zeros((5, 3)), DIAMETER)
    assert can_rest(room, Gravity())
    assert not can_rest(room, Gravity(), FLOOR)
    assert not can_rest(room, None)
    # smooth balls and faces, with the machine code of the gear's chamber
    effects = physics(0.8, 0.0, shaking)._replace(friction=SMOOTH, roughness=Roughness((0.0,) * 3))
    with_rest = simulate(Scene(room, balls, effects, 2.0))
    assert len(with_rest.resting) == 0
    assert np.sqrt((with_rest.balls.velocities**2).sum(axis=1).mean()) > 0.3
    assert with_rest.collisions.total < 1_000_000


def test_every_ball_of_a_settled_heap_is_held_by_what_it_touches() -> None:
    """A linear programme finds contact forces, with friction 0.3, that carry all weights."""
    for seed in range(6):
        rng = np.random.default_rng(seed)
        room = rough_floor(rng) if seed % 2 else box((0.012, 0.012, 0.06))
        places = pack_balls(room, 50, DIAMETER, rng)
        balls = Balls(places, rng.normal(0.0, 0.3, places.shape), DIAMETER)
        run = Simulation(Scene(room, balls, physics([0.5, 0.9][seed // 3], 0.005), 2.0))
        run.play(2.0, record=False)
        assert run.state.contact is not None
        still = np.flatnonzero(run.state.contact.mode >= ASLEEP)
        assert len(still) > 45
        lacking = force_lacking(room, run.balls(), still, MAX_JAM_GAP, friction=0.3)
        assert lacking.max() < 0.02, (
            f"seed {seed}: ball {still[lacking.argmax()]} lacks {lacking.max():.2f}"
        )

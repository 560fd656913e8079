"""Whether the shot had settled when recording began."""

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.replica_seed import replica_seed
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.coverage.dents import dent_diameters
from chamberopt.simulation.replicas import ReplicaSetting, simulate_replica, simulate_seed
from chamberopt.simulation.settling import first_half_excess, settled_after, settling_notes
from tests.helpers.synthetic import plate_design

PLATE = plate_design().changed({"process.accuracy.simulated_time_s": 0.3})


def impacts(rate_at, end: float, per_second: float = 20_000.0) -> np.ndarray:
    """Times of random impacts with a rate (relative to `per_second`) that is at most 4."""
    rng = np.random.default_rng(1)
    time = np.sort(rng.uniform(0.0, end, rng.poisson(4.0 * per_second * end)))
    return time[rng.uniform(0.0, 4.0, len(time)) < rate_at(time)]


@pytest.mark.parametrize(
    ("decay", "warmup", "settled"),
    [(0.0, 0.125, True), (0.05, 0.125, True), (0.2, 0.5, True), (2.0, 2.0, False)],
)
def test_a_rate_that_falls_settles_after_some_decay_times(
    decay: float, warmup: float, settled: bool
) -> None:
    """The rate is 1 + exp(-t / decay): from 2.5 decay times to 5 it is 3 % above its end."""
    time = impacts(lambda t: 1.0 + (np.exp(-t / decay) if decay else 0.0), 4.0)
    assert settled_after(time, np.ones(len(time)), 4.0) == (warmup, settled)


def test_a_pilot_that_is_too_short_knows_nothing() -> None:
    time = impacts(np.ones_like, 0.3)
    assert settled_after(time, np.ones(len(time)), 0.3) == (0.15, False)


def test_halves_that_differ_by_more_than_noise_are_told() -> None:
    rng = np.random.default_rng(2)
    same = rng.poisson(10_000, (10, 2)).astype(float)
    assert settling_notes(first_half_excess([tuple(one) for one in same]), PLATE) == ()
    first = same * [1.05, 1.0]
    (note,) = settling_notes(first_half_excess([tuple(one) for one in first]), PLATE)
    assert "NOT SETTLED" in note
    assert "more in the first half" in note
    assert "from 0.2 to 0.35 or more" in note
    (note,) = settling_notes(first_half_excess([tuple(one) for one in same * [1.0, 1.05]]), PLATE)
    assert "less in the first half" in note
    assert first_half_excess([(1.05, 1.0)]) is None  # nothing is known of the noise
    assert first_half_excess([(0.0, 0.0)] * 3) is None


def test_the_halves_of_a_replica_are_all_that_it_dents_on_the_target() -> None:
    chamber = build_chamber(PLATE)
    setting, seed = (
        ReplicaSetting(PLATE, chamber, chamber_mesh(chamber)),
        replica_seed(1, 0, "search"),
    )
    log = simulate_seed(*setting, seed).impacts
    size = np.where(chamber.on_target[log.triangle], dent_diameters(log, chamber, PLATE) ** 2, 0.0)
    halves = simulate_replica(setting, seed).halves
    assert halves is not None
    assert sum(halves) == pytest.approx(size.sum())
    assert halves[0] == pytest.approx(size[log.time <= 0.15].sum())

"""Replicas are added until the interval is narrow enough."""

import numpy as np

from chamberopt.common.estimate import estimate
from chamberopt.simulation.replicas import MIN_REPLICAS_TO_STOP, next_replica_count


def test_how_many_replicas_come_next() -> None:
    assert next_replica_count(10, 0.01, 0.01, 200) == 10  # reached
    assert (
        next_replica_count(10, 0.0101, 0.01, 200) == 13
    )  # at least a quarter more: few looks, little luck
    assert next_replica_count(10, 0.013, 0.01, 200) == 17  # as foretold
    assert (
        next_replica_count(10, 1.0, 0.01, 200) == 20
    )  # but no more than twice: what foretells is rough
    assert next_replica_count(150, 1.0, 0.01, 200) == 200
    assert next_replica_count(200, 1.0, 0.01, 200) == 200  # spent
    assert next_replica_count(10, np.inf, 0.01, 200) == 20


def test_stopping_when_it_looks_good_keeps_the_95_percent() -> None:
    rng = np.random.default_rng(8)
    held, runs = 0, 2000
    for _ in range(runs):
        sample, n, wanted = rng.normal(size=400), MIN_REPLICAS_TO_STOP, 0.45
        while (more := next_replica_count(n, estimate(sample[:n]).half_width, wanted, 400)) > n:
            n = more
        got = estimate(sample[:n])
        held += got.low <= 0.0 <= got.high
    assert 0.92 <= held / runs <= 0.98, held / runs

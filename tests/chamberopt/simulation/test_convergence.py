"""A convergence study keeps to its budget of CPU seconds, and to the time by the clock."""

from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.common import memory
from chamberopt.common.errors import InputError
from chamberopt.common.executor import SerialExecutor
from chamberopt.coverage.field.memory import PROCESS, evaluation_bytes
from chamberopt.simulation import convergence
from chamberopt.simulation.convergence import (
    LIKELY_REPLICAS,
    MIN_REPLICAS,
    SERIAL,
    describe_cost,
    require_memory,
)
from tests.helpers.synthetic import plate_design

CPU_S = 0.5  # of each made-up replica
BUDGET = 120.0


def study_at_pace(monkeypatch: pytest.MonkeyPatch, pace: float) -> convergence._Study:
    """Simulate made-up replicas that take `pace` seconds by the clock for each CPU second."""
    clock = [0.0]
    monkeypatch.setattr(convergence, "core_count", lambda: 2)
    monkeypatch.setattr(convergence.time, "perf_counter", lambda: clock[0])

    def replica(*_: object) -> SimpleNamespace:
        clock[0] += pace * CPU_S
        return SimpleNamespace(cpu_s=CPU_S)

    monkeypatch.setattr(convergence, "simulate_timed", replica)
    study = convergence._Study(plate_design(), BUDGET, SerialExecutor(), lambda *_: None, 0.0)
    clock[0] = pace  # of the first CPU second
    study.seconds, study.spent = CPU_S / 4.2, 1.0
    made = [convergence.Replicas(SimpleNamespace(design=plate_design()), None) for _ in range(3)]
    study.simulate(made[0], made[1:], lambda *_: None)
    study.reference = made[0]  # type: ignore[attr-defined]
    return study


def test_free_cores_spend_the_budget(monkeypatch: pytest.MonkeyPatch) -> None:
    study = study_at_pace(monkeypatch, 0.5)
    assert not study.is_late
    assert BUDGET - 8.0 < study.spent <= BUDGET


@pytest.mark.parametrize("pace", [1.0, 2.0])
def test_cores_that_are_not_free_end_it_by_the_clock(
    monkeypatch: pytest.MonkeyPatch, pace: float
) -> None:
    stated = BUDGET * (SERIAL + (1.0 - SERIAL) / 2)
    study = study_at_pace(monkeypatch, pace)
    assert study.is_late
    assert 0.8 * stated < study.elapsed + pace * convergence.OF_COMMAND < 1.05 * stated


def test_the_fewest_replicas_are_simulated_however_late(monkeypatch: pytest.MonkeyPatch) -> None:
    study = study_at_pace(monkeypatch, 50.0)
    assert study.reference.started >= MIN_REPLICAS  # type: ignore[attr-defined]


def test_the_time_is_stated_before(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(convergence, "core_count", lambda: 2)
    assert "at most about 120 CPU s (--budget-s), and 66 s on 2 cores" in describe_cost(BUDGET)


def test_replicas_that_do_not_fit_into_memory_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half of what is free may be taken: by the process, by one replica's work, and by fields."""
    design = plate_design()
    chamber = build_chamber(design)
    fields: Any = [SimpleNamespace(setting=SimpleNamespace(points=k)) for k in (10**6, 2 * 10**6)]
    needed = PROCESS + 250.0 * 3e6 + evaluation_bytes(design, chamber, LIKELY_REPLICAS)
    for share, is_refused in ((0.999, True), (1.001, False)):
        monkeypatch.setattr(memory, "free_memory", lambda share=share: 2.0 * share * needed)
        with pytest.raises(InputError, match="memory") if is_refused else nullcontext():
            require_memory(fields, design, chamber)

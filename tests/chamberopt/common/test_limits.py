"""Limits of what a process may use."""

import sys

import pytest

from chamberopt.common.limits import limit_cpu_time, limit_memory, raise_cpu_time


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such limit")
def test_a_process_without_a_limit_of_computing_time_gets_none() -> None:
    import resource

    before = resource.getrlimit(resource.RLIMIT_CPU)
    raise_cpu_time(20.0)
    assert resource.getrlimit(resource.RLIMIT_CPU) == before


def test_windows_has_no_limits_and_no_module_for_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setitem(sys.modules, "resource", None)  # importing it would fail
    limit_memory()
    limit_cpu_time(1.0)
    raise_cpu_time(1.0)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such limit")
def test_a_system_that_refuses_a_limit_of_memory_reads_without_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    import resource

    def refuse(*_: object) -> None:
        raise ValueError("current limit exceeds maximum limit")  # as macOS says

    monkeypatch.setattr(resource, "setrlimit", refuse)
    limit_memory()

"""Limits of what a process may use."""

import sys

import pytest

from chamberopt.common.limits import raise_cpu_time


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such limit")
def test_a_process_without_a_limit_of_computing_time_gets_none() -> None:
    import resource

    before = resource.getrlimit(resource.RLIMIT_CPU)
    raise_cpu_time(20.0)
    assert resource.getrlimit(resource.RLIMIT_CPU) == before

"""How the memory of a process is kept."""

import platform

import pytest

from chamberopt.common.memory import keep_few_heaps


def test_threads_share_few_heaps_where_the_c_library_can() -> None:
    assert keep_few_heaps() is (platform.libc_ver()[0] == "glibc")


def test_what_the_user_has_set_for_the_c_library_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MALLOC_ARENA_MAX", "7")
    assert not keep_few_heaps()

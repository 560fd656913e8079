"""Limits of what a process may use."""

import sys
from pathlib import Path

import pytest

from chamberopt.common.errors import InputError
from chamberopt.common.limits import (
    MEBIBYTE,
    limit_cpu_time,
    limit_memory,
    parse_json,
    raise_cpu_time,
    read_limited,
    require_few,
)


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


def test_a_file_may_be_as_large_as_the_limit_and_no_larger(tmp_path: Path) -> None:
    path = tmp_path / "design.toml"
    path.write_bytes(b"a" * MEBIBYTE)
    assert len(read_limited(path, MEBIBYTE, "design")) == MEBIBYTE
    with pytest.raises(InputError, match=r"a design of 1\.0 MiB, at most 0\.5 MiB are read"):
        read_limited(path, MEBIBYTE // 2, "design")
    with pytest.raises(InputError, match="reduce it"):
        read_limited(path, MEBIBYTE - 1, "design")
    assert MEBIBYTE == 1024**2


def test_a_mesh_may_have_as_many_items_as_the_limit(tmp_path: Path) -> None:
    require_few(tmp_path, 20, "triangles", most=20)
    with pytest.raises(InputError, match="21 triangles, at most 20 are read"):
        require_few(tmp_path, 21, "triangles", most=20)


def test_numbers_of_a_result_are_finite_as_are_their_squares_and_cubes() -> None:
    assert parse_json("[1e30, -1e30, 0.1, 7]") == [1e30, -1e30, 0.1, 7]
    for text in ("1.01e30", "-1.01e30", "1e999", "NaN", "-Infinity", f"2{'0' * 30}"):
        with pytest.raises(ValueError, match=r".+"):
            parse_json(f"[{text}]")

"""The drift table: what moved beyond both intervals is told, and a reason is asked for."""

import math
from pathlib import Path

import pytest

from benchmarks import drift
from benchmarks.drift import Figure, read, table, unexplained, verdict, verdicts, versions, write


def figure(value: float, half_width: float, commit: str = "a", why: str = "") -> Figure:
    day = {"a": "2026-01-01", "b": "2026-01-02", "c": "2026-01-03"}[commit]
    return Figure(
        "here", "1.0", commit, day, why, "plate", "0123", "mean_coverage", value, half_width
    )


@pytest.mark.parametrize(
    ("after", "word"),
    [
        (figure(0.5, 0.03), "same bits"),
        (figure(0.549, 0.04), "within"),  # sqrt(0.03² + 0.04²) = 0.05
        (figure(0.551, 0.04), "MOVED"),
        (figure(0.45, 0.03), "MOVED"),
        (figure(0.5, math.nan), "not resolved"),
    ],
)
def test_a_figure_moves_beyond_both_half_widths(after: Figure, word: str) -> None:
    assert verdict(figure(0.5, 0.03), after) == word
    assert verdict(None, after) == "first"


def test_two_figures_that_are_not_resolved_may_be_the_same() -> None:
    assert verdict(figure(0.5, math.nan), figure(0.5, math.nan)) == "same bits"


def test_the_newest_version_needs_a_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(drift, "read", lambda: read(tmp_path / "drift.csv"))
    monkeypatch.setattr(drift, "write", lambda rows: write(rows, tmp_path / "drift.csv"))
    assert drift.main([]) == 2
    rows = [figure(0.5, 0.03), figure(0.7, 0.03, "b"), figure(0.7, 0.03, "c")]
    write(rows[::-1], tmp_path / "drift.csv")
    assert read(tmp_path / "drift.csv") == rows
    assert [word for _, word in verdicts(rows)] == ["first", "MOVED", "same bits"]
    assert unexplained(rows) == []  # the newest did not move
    assert unexplained(rows[:2]) == [rows[1]]
    assert unexplained([rows[0], figure(0.7, 0.03, "b", "friction is on")]) == []
    write(rows[:2], tmp_path / "drift.csv")
    assert drift.main(["--check"]) == 1
    told = capsys.readouterr().out
    assert "| plate | mean_coverage | 0.5 ± 0.03 | **0.7 ± 0.03** |" in told
    assert "record it with --why" in told
    assert drift.main([]) == 0
    assert drift.main(["explain", "--why", "friction is on"]) == 0
    assert drift.main(["--check"]) == 0
    assert [row.why for row in read(tmp_path / "drift.csv")] == ["", "friction is on"]


def test_a_reason_is_kept_with_its_version() -> None:
    rows = [figure(0.5, 0.03), figure(0.7, 0.03, "b", "friction is on")]
    assert "1 MOVED. friction is on" in drift.reasons(rows)
    assert [commit for _, commit, _, _ in versions(rows)] == ["a", "b"]
    assert table(rows).count("\n") == 2

"""Evidence that is listed is there, and the page shows the tables of the commands."""

import pytest

from benchmarks import credibility
from benchmarks.credibility import (
    FACTORS,
    LEVELS,
    PAGE,
    Benchmark,
    Command,
    Evidence,
    Factor,
    File,
    Page,
    Suite,
    problems,
    with_tables,
)


def test_all_evidence_is_there() -> None:
    assert list(problems()) == []
    assert {factor.level for factor in FACTORS} <= LEVELS.keys()


def test_the_page_shows_what_the_commands_print() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert with_tables(page) == page


@pytest.mark.parametrize(
    ("evidence", "told"),
    [
        (Page("explanation/nothing.md"), "no such page"),
        (Page("explanation/accuracy.md", "Nothing"), "no section Nothing"),
        (Suite("nothing.py"), "no such tests"),
        (Suite("benchmarks/test_credibility.py", "test_nothing"), "no test test_nothing"),
        (Benchmark("nothing"), "no such command"),
        (Benchmark("drift", "nothing.csv"), "no such results"),
        (Command("nothing"), "no such command"),
        (Command("report --nothing"), "no option --nothing"),
        (File("nothing.toml"), "no such file"),
        (File("CHANGELOG.md", "no such" + " words"), "has no"),
    ],
)
def test_evidence_that_is_missing_is_told(
    evidence: Evidence, told: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    factor = Factor("Verification", 1, "why", (evidence,), "more")
    monkeypatch.setattr(credibility, "FACTORS", (factor,))
    assert credibility.main([]) == 1
    assert told in capsys.readouterr().err


def test_a_level_needs_evidence(monkeypatch: pytest.MonkeyPatch) -> None:
    factors = (Factor("a", 2, "why", (), "more"), Factor("b", 5, "why", (File("LICENSE"),), "more"))
    monkeypatch.setattr(credibility, "FACTORS", factors)
    assert list(problems()) == ["a: level 2 without evidence", "b: no level 5"]


def test_links_lead_from_the_page() -> None:
    assert str(Page("explanation/accuracy.md")) == "[accuracy.md](accuracy.md)"
    assert str(Page("reference/trust.md", "The hunt")) == (
        "[trust, The hunt](../reference/trust.md#the-hunt)"
    )

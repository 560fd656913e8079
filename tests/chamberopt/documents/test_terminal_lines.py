"""The end of a command: its main figures in words, and the notes that matter most."""

from types import SimpleNamespace
from typing import Any

import pytest

from chamberopt.common.estimate import Estimate
from chamberopt.documents.coverage import Figure, main_figures
from chamberopt.documents.document import Table
from chamberopt.documents.terminal_lines import note_lines, sweep_end
from chamberopt.documents.wording import metric_label, objective_label
from chamberopt.search.trial_log import Trial
from tests.helpers.results.resumable_study import study


@pytest.mark.parametrize(
    ("count", "verbose", "last"),
    [
        (3, False, "note: 2"),
        (4, False, "and 1 more note: --verbose shows all"),
        (9, False, "and 6 more notes: --verbose shows all"),
        (9, True, "note: 8"),
    ],
)
def test_three_notes_are_shown(count: int, verbose: bool, last: str) -> None:
    lines = list(note_lines(map(str, range(count)), verbose))
    assert lines[:3] == ["note: 0", "note: 1", "note: 2"]
    assert lines[-1] == last


def test_the_almen_intensity_takes_the_place_of_the_strength() -> None:
    def chosen(*names: str) -> list[str]:
        found = Estimate(1.0, 0.1)
        shown = [Figure("uniform_coverage", objective_label("uniform_coverage"), found)]
        shown += [Figure(name, metric_label(name), found) for name in names]
        return [one.name for one in main_figures(shown)]

    rough = ("mean_coverage", "exposure", "strength_um", "shot_count")
    assert chosen(*rough) == ["uniform_coverage", "mean_coverage", "strength_um"]
    assert chosen(*rough, "almen_intensity") == [
        "uniform_coverage",
        "mean_coverage",
        "almen_intensity",
    ]


def test_a_sweep_ends_with_its_best_candidate_by_number() -> None:
    given, figure = study(), Estimate(0.7, 0.1)
    metrics = {"mean_coverage": Estimate(0.8, 0.1)}
    best, failed = (
        Trial(number, "sweep", (0.0,) * 3, {"shot.mass_g": 5.0}, goals, metrics, 0.0, 0.7, True, "")
        for number, goals in ((4, (figure,)), (5, ()))
    )
    trials = [best, failed]
    for chosen in (best, None):
        result: Any = SimpleNamespace(study=given, best=chosen, trials=trials, seconds=12.4)
        lines = sweep_end(result, ["a note"], verbose=False)
        texts = [one for one in lines if isinstance(one, str)]
        assert texts[-1] == "note: a note"
        assert any(one.startswith("2 candidates in 12 s, ") for one in texts)
        if chosen is None:
            assert texts[0] == "None of 2 candidates meets the constraints."
            continue
        assert texts[0].startswith("The best of 2 candidates, number 5, has this uniform coverage")
        (table,) = (one for one in lines if isinstance(one, Table))
        assert ["5"] in [list(row[1:]) for row in table.rows]
        longer = sweep_end(result, ["a note"], verbose=True)
        assert len(longer) == len(lines) + 3  # a blank line and two figures

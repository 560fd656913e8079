"""The end of a command: its main figures in words, and the notes that matter most."""

import pytest

from chamberopt.common.estimate import Estimate
from chamberopt.documents.coverage import Figure, main_figures
from chamberopt.documents.terminal_lines import note_lines
from chamberopt.documents.wording import metric_label, objective_label


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

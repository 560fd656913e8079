"""A proposed study ends where a length of the chamber would do harm that the proposal does not."""

from types import SimpleNamespace
from typing import Any

import pytest

from chamberopt.chamber.checks.warning import DesignWarning, WarningKind
from chamberopt.chamber.propose import harmless_ranges
from chamberopt.chamber.propose.harmless_ranges import with_harmless_ranges
from chamberopt.chamber.propose.proposal import Proposal
from chamberopt.common.errors import InputError

HEIGHT, DISTANCE = "chamber.height_mm", "chamber.sonotrode_distance_mm"


class Made(SimpleNamespace):
    """A design with these numbers, or a proposal of it."""

    def value(self, name: str) -> float:
        return float(self.numbers[name])

    def changed(self, numbers: dict[str, float]) -> "Made":
        return Made(numbers=self.numbers | numbers)


@pytest.mark.parametrize(
    ("kind", "rests_above", "refused_above", "height"),
    [
        (WarningKind.REST, 100.0, 100.0, (30.0, 42.0)),
        (WarningKind.REST, 40.0, 100.0, (30.0, 39.0)),
        (WarningKind.REST, 36.5, 100.0, (30.0, 36.0)),
        (WarningKind.REST, 40.0, 41.0, (30.0, 42.0)),  # a search leaves out what cannot be built
        (WarningKind.SLOT, 36.5, 100.0, (30.0, 42.0)),  # of the part alone: no harm
    ],
)
def test_a_range_ends_before_new_harm(
    kind: WarningKind,
    rests_above: float,
    refused_above: float,
    height: tuple[float, float],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def build(design: Made) -> Any:
        if design.value(HEIGHT) > refused_above:
            raise InputError("too high")
        return design

    def warned(made: object, design: Made, chamber: Made) -> tuple[DesignWarning, ...]:
        return (DesignWarning(kind, "told"),) * (chamber.value(HEIGHT) > rests_above)

    monkeypatch.setattr(harmless_ranges, "build_chamber", build)
    monkeypatch.setattr(harmless_ranges, "warned_again", warned)
    monkeypatch.setattr(harmless_ranges, "replace", lambda made, **new: Made(**vars(made) | new))
    bounds = {
        HEIGHT: {"low": 30.0, "high": 42.0, "step": 0.5},
        DISTANCE: {"low": 12.0, "high": 12.0, "step": 0.5},
        "shot.mass_g": {"low": 1.0, "high": 4.0, "step": 0.1},
    }
    design = Made(numbers={HEIGHT: 36.0, DISTANCE: 12.0, "shot.mass_g": 2.0})
    made: Any = Made(design=design, bounds=bounds, warnings=(), jams=())
    found: Proposal = with_harmless_ranges(made)
    assert (found.bounds[HEIGHT]["low"], found.bounds[HEIGHT]["high"]) == height
    assert DISTANCE not in found.bounds  # nothing is left to vary
    assert found.bounds["shot.mass_g"] == bounds["shot.mass_g"]

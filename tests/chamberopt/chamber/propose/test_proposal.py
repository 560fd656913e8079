"""Tolerances of a proposal, by ISO 2768-1 class m and of the amplitude, and its study's bounds."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.checks.check import warnings
from chamberopt.chamber.checks.place_names import PART, PART_SIDE
from chamberopt.chamber.checks.warning import DesignWarning, WarningKind
from chamberopt.chamber.layout.target import Surface
from chamberopt.chamber.propose import held_proposal
from chamberopt.chamber.propose.held_proposal import _where_left
from chamberopt.chamber.propose.proposal import (
    COUNTED,
    holding,
    new_harm,
    propose_tolerances,
    warned_again,
)
from tests.helpers.synthetic import plate_design


@pytest.mark.parametrize(
    ("height", "off"), [(6.0, 0.1), (29.0, 0.2), (31.0, 0.3), (121.0, 0.5), (1990.0, 1.2)]
)
def test_heights_have_those_of_the_standard_by_their_size(height: float, off: float) -> None:
    chamber = {"diameter_mm": 80.0, "height_mm": height, "sonotrode_distance_mm": 5.0}
    found = propose_tolerances({"chamber": chamber, "sonotrode": {"amplitude_pv_um": 60.0}})
    assert found == {
        "chamber.height_mm": off,
        "chamber.sonotrode_distance_mm": 0.1,
        "sonotrode.amplitude_pv_um": 4.0,
    }


def test_a_study_holds_the_design_with_which_it_starts() -> None:
    """A ceiling at 63.5 mm was rounded to 64 mm, so that `run` refused its own study."""
    design = plate_design(chamber__height_mm=63.5, shot__mass_g=3.0)
    bounds = {
        "chamber.height_mm": {"low": 64, "high": 68, "step": 0.5},
        "shot.mass_g": {"low": 1.0, "high": 2.0, "step": 0.1},
        "chamber.sonotrode_distance_mm": {"choose": [10.0, 20.0]},
        "shot.diameter_mm": {"low": 3.0, "high": 3.0, "step": 0.5},  # which the design has
    }
    found = holding(bounds, design)
    assert "shot.diameter_mm" not in found
    assert found["chamber.height_mm"] == {"low": 63.5, "high": 68, "step": 0.5}
    assert found["shot.mass_g"] == {"low": 1.0, "high": 3.0, "step": 0.1}
    assert found["chamber.sonotrode_distance_mm"] == {"choose": [10.0, 20.0]}


def found(*warnings: DesignWarning, jams: int = 0) -> Any:
    return SimpleNamespace(warnings=warnings, jams=(None,) * jams)


def test_new_harm_is_told_by_kind_and_subject() -> None:
    """A gap that jams balls in the place of another, and what no ball touches, are no new harm."""
    at_side = DesignWarning(WarningKind.JAM, "balls of 1 mm can jam", (PART_SIDE, PART_SIDE))
    at_holder = DesignWarning(WarningKind.JAM, "balls of 1 mm can jam", ("the holder", PART_SIDE))
    pocket = DesignWarning(WarningKind.POCKET, "a pocket around (1, 2, 3) mm", (PART,))
    rests = DesignWarning(WarningKind.REST, "balls can come to rest, around (1, 2, 3)", (PART,))
    before = found(at_side, replace(pocket, step="one"), jams=1)
    for made, harm in (
        (found(at_holder, jams=1), None),
        (found(at_holder, at_holder, jams=2), "balls jam in a gap"),
        (found(replace(pocket, message="a pocket around (9, 2, 3) mm", step="two")), None),
        (found(replace(pocket, about=("the holder", PART))), "a pocket"),
        (found(at_holder, replace(rests, step="two"), jams=2), "balls can come to rest"),
        *((found(DesignWarning(kind, "less is peened")), None) for kind in COUNTED),
    ):
        new = new_harm(made, before)
        assert (new and new.beginning) == harm


def test_a_changed_proposal_still_warns_of_a_floor_wider_than_any_sonotrode() -> None:
    """Its design does not tell it, so that it was lost with the first change."""
    design = plate_design()
    wide = DesignWarning(WarningKind.WIDE_FLOOR, "chamber: LARGER THAN USUAL SONOTRODES")
    full = DesignWarning(WarningKind.PACKING, "the balls fill 30% of the free volume")
    chamber = build_chamber(design)
    warned = warned_again(found(wide, full), design, chamber)
    assert warned == (wide, *warnings(design, chamber))


@pytest.mark.parametrize("radius", [0.4e-3, 2e-3, 86e-3])
@pytest.mark.parametrize(
    ("hidden", "told"),
    [
        ([0, 1], "mostly on ROOT in hollows of about {} mm, "),
        ([2, 3], "mostly on FLANK, "),
        ([1, 2, 3, 4], ""),
    ],
)
def test_what_is_left_out_is_named(
    monkeypatch: pytest.MonkeyPatch, radius: float, hidden: list[int], told: str
) -> None:
    """Of six triangles in the target two are a hollow root, two a flank, and two a tip.

    A hollow far wider than a ball keeps none out.
    """
    names = {"ALL": range(6), "ROOT": [0, 1], "FLANK": [2, 3], "TIP": [4, 5]}
    rows = {name: np.isin(np.arange(6), one) for name, one in names.items()}
    monkeypatch.setattr(held_proposal, "rows_of", lambda _, keys: rows[keys["surface"][0]])
    hollow = np.where(rows["ROOT"], 1.0 / radius, 0.0)
    part = SimpleNamespace(area=np.ones(6), target=np.ones(6, dtype=bool), hollow=hollow)
    known = [Surface(name, {"surface": [name]}, one, "") for name, one in rows.items()]
    design = SimpleNamespace(shot=SimpleNamespace(diameters=(1.2e-3,)))
    made = SimpleNamespace(design=design, chamber=SimpleNamespace(part=part), known=known)
    left = np.isin(np.arange(6), hidden) * 1.0
    said = told if radius < 3e-3 else told.replace(" in hollows of about {} mm", "")
    assert _where_left(made, left) == said.format(f"{1e3 * radius:.2g}")  # type: ignore[arg-type]

"""Charge and tolerances of a proposal, and the ranges that a study of it takes."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.checks.check import warnings
from chamberopt.chamber.checks.place_names import PART, PART_SIDE
from chamberopt.chamber.checks.warning import DesignWarning, WarningKind
from chamberopt.chamber.layout.holder import HolderChoice
from chamberopt.chamber.layout.sizes import Sizes
from chamberopt.chamber.layout.target import Surface
from chamberopt.chamber.matters import MatterKind
from chamberopt.chamber.propose import held_proposal
from chamberopt.chamber.propose.held_proposal import _where_left
from chamberopt.chamber.propose.proposal import (
    COUNTED,
    holding,
    new_harm,
    propose_charge,
    propose_ranges,
    propose_tolerances,
    warned_again,
)
from chamberopt.chamber.propose.text import to_settle
from chamberopt.search.study.parameters import Varied
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


@pytest.mark.parametrize(
    ("floor_mm2", "ball_mm", "height_mm", "mass_g", "reason"),
    [
        (2700, 3, 63, 19, "half a layer"),
        (92400, 3, 355, 650, "half a layer"),  # 653 g, of which a study has no steps
        (1075, 0.1, 39, 0.041, "less than half a layer"),  # of more than 10,000 balls
        (1.4e6, 3, 1533, 1100, "less than half a layer"),
        (3e6, 20, 1900, 10000, "the most that is supported"),  # of shot.mass_g
    ],
)
def test_a_study_takes_what_is_proposed(
    floor_mm2: float, ball_mm: float, height_mm: float, mass_g: float, reason: str
) -> None:
    """Its values have a number of steps that it takes, the start among them, within the limits."""
    ball_mass = 7790.0 * np.pi / 6.0 * (1e-3 * ball_mm) ** 3
    charge, why, full = propose_charge(1e-6 * floor_mm2, 1e-3 * ball_mm, ball_mass)
    assert (charge, why[: len(reason)]) == (pytest.approx(mass_g), reason)
    assert bool(full) == reason.startswith("less than")
    assert full * ball_mass * 1e3 > 1.1 * charge or not full
    distance = max(8e-3, 0.3e-3 * height_mm)
    below = 1e-3 * height_mm - distance - 5e-3 * ball_mm
    sizes = Sizes("box", {}, distance, 1e-3 * height_mm, 0.01, False, below)
    starts = (height_mm, round(1e3 * distance), charge)
    ranges = propose_ranges(sizes, charge, ball_mm, ball_mass)
    for (name, one), start in zip(ranges.items(), starts, strict=True):
        varied = Varied(**one._asdict())
        assert start in varied.values(is_whole=False), name
    assert ranges["chamber.height_mm"].high <= 2000
    assert ranges["shot.mass_g"].high <= min(10000.0, 20000e3 * ball_mass)


def test_a_study_lowers_no_part_until_the_face_hits_what_is_outside() -> None:
    sizes = Sizes("box", {}, 17e-3, 55e-3, 10e-3, False, 20e-3)
    low = [propose_ranges(sizes, 5.3, 2.0, 2.5e-5, is_raised=one) for one in (False, True)]
    assert [one["chamber.sonotrode_distance_mm"].low for one in low] == [7, 17]


def test_what_the_check_warns_of_is_to_be_settled() -> None:
    """Balls at rest change the process. That facets are coarse changes figures alone.

    Balls too large for a slot are told of once, also where the reason of their size tells it.
    """
    kinds = (WarningKind.REST, WarningKind.SLOT, WarningKind.FACETS)
    warnings = tuple(DesignWarning(kind, f"the {kind}") for kind in kinds)
    for reason, expected in (("as asked", ["rest", "slot"]), ("1 mm; NO SIZE SUITS ALL", ["rest"])):
        made: Any = SimpleNamespace(
            reasons={"shot.diameter_mm": reason},
            tables={"shot": {"diameter_mm": 1.0}},
            warnings=warnings,
            trials=(),
            design=plate_design(),
        )
        told = [one.text for one in to_settle(made, []) if one.kind is MatterKind.WARNED_OF]
        assert told == [f": the {kind}" for kind in expected]


def test_a_matter_of_which_the_check_warns_is_told_of_once() -> None:
    design = plate_design(to_settle=("THE CHECK WARNS: balls rest", "NOT MASKED: a face"))
    chamber = build_chamber(design)
    told = [one.text for one in warnings(design, chamber) if one.kind is WarningKind.TO_SETTLE]
    assert told == ["to be settled: NOT MASKED: a face"]


@pytest.mark.parametrize(
    ("shares", "taken"),
    [((0.98, 0.999), 1), ((0.98, 0.99), 0), ((0.9, 0.98), 1), ((0.9, 0.9), None)],
)
def test_a_holder_that_hides_more_is_taken_where_no_other_holds(
    shares: tuple[float, float], taken: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each is built and checked once, which takes most of the time of a proposal."""
    choices = [HolderChoice({"kind": "rod", "diameter_mm": k}, "on a face") for k in (0, 1)]
    tried = []

    def harmless(tables: Any, *others: Any) -> tuple[Any, str]:
        tried.append(number := tables["holder"]["diameter_mm"])
        is_hidden = 1.0 - shares[number] > others[-1]
        made = SimpleNamespace(share=shares[number], number=number)
        return (None, "the balls do not get there") if is_hidden else (made, "")

    free: Any = SimpleNamespace(
        design=plate_design(), mesh=None, tables={"sonotrode": {}}, reasons={}, share=1.0
    )
    monkeypatch.setattr(held_proposal, "holder_choices", lambda *_: choices)
    monkeypatch.setattr(held_proposal, "_harmless", harmless)
    monkeypatch.setattr(held_proposal, "_by_a_rod", lambda _: "")
    monkeypatch.setattr(held_proposal, "touched_share", lambda one: one.share)
    monkeypatch.setattr(held_proposal, "_with_balls_on_holder", lambda one: one)
    monkeypatch.setattr(held_proposal, "replace", lambda one, **_: SimpleNamespace(number=None))
    unused: Any = None
    target: Any = SimpleNamespace(triangles=np.zeros(1, dtype=bool))
    found: Any = held_proposal.held(free, unused, target, None, [], None, lambda *_: None)
    assert found.number == taken
    assert tried == [0, 1]

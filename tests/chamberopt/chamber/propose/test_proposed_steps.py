"""Finer balls that follow coarse ones in steps, each until it has covered what it touches."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.checks.warning import DesignWarning, WarningKind
from chamberopt.chamber.propose import proposal, proposed_steps
from chamberopt.chamber.propose.first_design import propose
from chamberopt.chamber.propose.proposal import Proposal, Wanted
from chamberopt.chamber.propose.proposed_budget import Measured, propose_budget
from chamberopt.chamber.propose.proposed_intensity import LARGER
from chamberopt.chamber.propose.proposed_steps import OVER, _over, with_finer_balls, without_finer
from chamberopt.chamber.propose.text import design_text
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate
from chamberopt.design.intensity import PredictedIntensity
from chamberopt.design.load import load_design
from chamberopt.documents.proposal import proposal_in_words, proposal_lines
from chamberopt.geometry.triangles import rotation_matrix

SLOT, COARSE, FINER = 5.0, 3.0, 1.0  # mm: balls of a quarter of the slot serve it


def pilot(seconds: float, intensity: float) -> Measured:
    """What a pilot says of a design whose target is covered after some time [s]."""
    predicted = PredictedIntensity.estimated(Estimate(intensity / 13.5e-3, 0.0))
    common = 1e5, 1e4, seconds, True, 1.0, True, 0.01, 5e-3, 6.4, seconds
    return Measured(*common, intensity=predicted)


@pytest.fixture(scope="module")
def coarse(tmp_path_factory: pytest.TempPathFactory) -> Proposal:
    """A block with a slot, peened on all sides with balls that are too large for the slot."""
    path = tmp_path_factory.mktemp("slotted") / "slotted.stl"
    block = trimesh.creation.box((66.0, 20.0, 20.0))
    slot = trimesh.creation.box((SLOT, 30.0, 30.0))
    slot.apply_translation((0.0, 0.0, -10.0))
    block.difference(slot).export(path)
    return propose(path, Wanted("mm", ball_mm=COARSE), lambda known: [one.name for one in known])


def test_each_size_peens_for_its_own_time_in_one_chamber(coarse: Proposal, tmp_path: Path) -> None:
    seen: list[Proposal] = []

    def measure(one: Proposal) -> Measured:
        seen.append(one)
        return pilot(300.0, 0.1)

    reasons = {**coarse.reasons, "shot.diameter_mm": f"{LARGER}: they suit 83%"}
    larger = replace(coarse, reasons=reasons)
    two, why = with_finer_balls(larger, pilot(600.0, 0.3), FINER, measure)
    assert two is not None, why
    (tmp_path / "design.toml").write_text(design_text(two, tmp_path), "utf-8")
    design = load_design(tmp_path / "design.toml")
    first, second = design.in_steps.values()
    times = [propose_budget(pilot(one, 0.1)).treatment for one in (600.0, 300.0)]
    assert [one.process.treatment_time for one in (first, second)] == pytest.approx(times)
    assert design.process.treatment_time == pytest.approx(sum(times))
    assert [1e3 * one.shot.diameter for one in (first, second)] == pytest.approx([COARSE, FINER])
    assert first.chamber == second.chamber
    assert first.shot.mass == coarse.design.shot.mass
    (alone,) = seen  # the finer balls are simulated by themselves
    assert alone.design.shot == second.shot
    assert two.chamber.pieces_in_air == coarse.chamber.pieces_in_air
    narrow = {WarningKind.FILLET, WarningKind.SLOT}  # the slot is for the finer balls
    warned = [one for one in two.warnings if one.kind in narrow]
    assert [one.text.partition(" mm")[0] for one in warned] == ["step finer: shot of 1"]
    told = two.reasons[".steps"]
    assert told.startswith("3 mm balls for 900 s, then 1 mm for 420 s: ")
    assert "about 0.3 mmA on the" in told
    assert "TWO INTENSITIES" in told
    assert two.reasons["shot.diameter_mm"] == "chosen for the intensity"
    lines = " ".join(" ".join(proposal_lines(proposal_in_words(two, []), verbose=False)).split())
    assert "balls of 3 mm (steel" in lines
    assert " and then " in lines
    assert ". TWO INTENSITIES: narrow places" in lines


@pytest.mark.parametrize(
    ("found", "finer_mm", "why"),
    [
        (None, FINER, "no pilot resolved the coarse balls"),
        (pilot(600.0, 0.3), COARSE, "no smaller ball"),
        (pilot(600.0, 0.3), 2.5, "the smaller ones suit hardly more"),  # large beside the slot
    ],
)
def test_one_size_stays_where_finer_ones_bring_nothing(
    coarse: Proposal, found: Measured | None, finer_mm: float, why: str
) -> None:
    def never(_: Proposal) -> Measured:
        raise AssertionError

    two, told = with_finer_balls(coarse, found, finer_mm, never)
    assert two is None
    assert told.startswith(why)


@pytest.mark.parametrize(
    ("finer", "why"),
    [
        (pilot(300.0, 0.21), "0.21 mmA of 1 mm are hardly less"),
        (pilot(900.0, 0.1), "1200 s more for "),
        (pilot(300.0, 0.1), ""),
    ],
)
def test_two_sizes_are_proposed_where_they_pay(coarse: Proposal, finer: Measured, why: str) -> None:
    """Not for an intensity that hardly differs, nor for hours that bring little."""
    two, told = with_finer_balls(coarse, pilot(600.0, 0.3), FINER, lambda _: finer)
    assert (two is None) == bool(why)
    assert told.startswith(why)


def test_what_stands_against_finer_balls_is_told(
    coarse: Proposal, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = pilot(600.0, 0.3)
    two, why = with_finer_balls(coarse, found, FINER, lambda _: None)
    assert (two, why) == (None, "no pilot resolved both sizes")
    larger = replace(coarse, reasons={**coarse.reasons, "shot.diameter_mm": f"{LARGER}: 80%"})
    reason = without_finer(larger, why).reasons["shot.diameter_mm"]
    assert reason == f"{LARGER}: 80%; no finer balls after them: {why}"
    assert without_finer(coarse, why) == coarse

    for kind, text, harm in (
        (WarningKind.UNTOUCHED, "0.6% of the target cannot be touched, at", ""),
        (WarningKind.PACKING, "they hinder each other, at", "they hinder each other"),
    ):
        one = DesignWarning(kind, text)
        monkeypatch.setattr(proposal, "warnings", lambda *_, said=one: [said])
        _, why = with_finer_balls(coarse, found, FINER, lambda _: None)
        assert why == (harm or "no pilot resolved both sizes")

    low = coarse.design.chamber.height_mm
    monkeypatch.setattr(proposal, "warnings", lambda *_: [])
    monkeypatch.setattr(
        proposed_steps,
        "jam_gaps",
        lambda room, ball, _: [None] * (1e3 * room.height < low + 2.0 and ball < 2e-3),
    )

    def measure(one: Proposal) -> Measured:
        is_coarse = one.design.shot.diameter > 2e-3
        return pilot(300.0, 0.3) if is_coarse else pilot(100.0, 0.1)

    two, why = with_finer_balls(coarse, found, FINER, measure)
    assert two is not None, why  # raised by one ball, then by two
    assert two.design.chamber.height_mm == low + 3.0 * FINER
    assert "high enough for both sizes" in two.reasons["chamber.height_mm"]

    def refused(*_: object) -> Proposal:
        raise InputError("part: outside of the chamber")

    monkeypatch.setattr(proposed_steps, "build_chamber", refused)
    two, why = with_finer_balls(coarse, found, FINER, lambda _: found)
    assert (two, why) == (None, "part: outside of the chamber")


@pytest.mark.parametrize(
    ("share", "places", "seconds", "is_tried"),
    [
        (0.6, False, 10.0, True),  # balls touch too little of it in one pose
        (0.6, True, 10.0, False),
        (0.999, False, 10.0, False),
        (0.999, True, 1e5, True),  # a place of it takes far longer than the mean
    ],
)
def test_a_second_pose_is_tried_for_what_is_hidden_or_uneven(
    coarse: Proposal, monkeypatch: pytest.MonkeyPatch, share: float, places: bool,
    seconds: float, is_tried: bool,
) -> None:  # fmt: skip
    monkeypatch.setattr(proposed_steps, "touched_share", lambda _: share)
    found = pilot(10.0, 0.2)._replace(places=places, time_to_98=seconds)
    assert proposed_steps.is_worth_a_second_pose(coarse, found) is is_tried


@pytest.mark.parametrize("axis", OVER)
@pytest.mark.parametrize("turns", [(0.0, 0.0, 0.0), (90.0, 0.0, -45.0), (20.0, -35.0, 130.0)])
def test_a_part_is_turned_over_by_half_a_turn_about_the_named_axis(
    axis: str, turns: tuple[float, float, float]
) -> None:
    """About a unit vector u half a turn is 2 uu - 1, also of what is beside the chamber's axis."""
    names = {"x": (1, 0), "y": (0, 1), "the diagonal of x and y": (1, 1)}
    along = np.array([*names.get(axis, (1, -1)), 0.0])
    half = 2.0 * np.outer(along, along) / (along @ along) - np.eye(3)
    part = SimpleNamespace(rotate_deg=turns, offset_mm=(3.0, 5.0))
    made: Any = SimpleNamespace(
        design=SimpleNamespace(part=part, shot=SimpleNamespace(diameter=2e-3)),
        tables={"chamber": {"height_mm": 40.0}},
    )
    values, (first, second) = _over(made, axis, raised=1.5)
    assert values == {"chamber": {"height_mm": 43.0}}
    assert "part" not in first
    over = rotation_matrix(tuple(second["part"]["rotate_deg"]))
    np.testing.assert_allclose(over, half @ rotation_matrix(turns), atol=1e-12)
    np.testing.assert_allclose(second["part"]["offset_mm"], (half @ (3.0, 5.0, 0.0))[:2])

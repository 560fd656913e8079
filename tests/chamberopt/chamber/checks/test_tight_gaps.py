"""Gaps beside the walls of a chamber that a search refuses before it simulates."""

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.checks.tight_gaps import tight_gaps
from chamberopt.search.candidate import Candidate, CandidateEvaluator, RefusedError
from tests.helpers.synthetic import chamber_round


@pytest.mark.parametrize(
    ("gap_mm", "found"),
    [(0.88, True), (1.4, True), (2.1, True), (3.1, True), (3.3, False), (8.0, False)],
)
def test_a_gap_through_which_balls_do_not_fly_is_found(gap_mm: float, found: bool) -> None:
    """A part of 20 mm in a box that is larger on all sides, by more at +x, where balls fly."""
    box = trimesh.creation.box((0.02, 0.02, 0.02))
    chamber = chamber_round(box, gap=1e-3 * gap_mm)
    vertices = chamber.vertices.copy()
    walls = np.arange(len(vertices)) >= len(box.vertices)
    vertices[walls & (vertices[:, 0] > 0.0), 0] += 0.02
    chamber = replace(chamber, vertices=vertices)
    texts = [one.text for one in tight_gaps(chamber, (2e-3,))]
    assert bool(texts) is found
    assert all("a ball of 2 mm jams, rattles or does not get in" in text for text in texts)


@pytest.mark.parametrize("left_mm", [1.2, 1.8])
def test_each_gap_is_told_with_its_own_width(left_mm: float) -> None:
    """A part of 20 mm has 3 mm in all beside it, of which so much to the left, and room around.

    At its ends a gap is wider than between the faces: there a ball touches an edge.
    """
    box = trimesh.creation.box((0.02, 0.02, 0.02))
    chamber = chamber_round(box, gap=0.02)
    vertices = chamber.vertices.copy()
    walls = np.arange(len(vertices)) >= len(box.vertices)
    left = vertices[:, 0] < 0.0
    vertices[walls & left, 0] = -1e-3 * (10.0 + left_mm)
    vertices[walls & ~left, 0] = 1e-3 * (13.0 - left_mm)
    gaps = list(tight_gaps(replace(chamber, vertices=vertices), (2e-3,)))
    assert {one.sides for one in gaps} == {("the part's side", "the wall")}
    widths = {}
    for one in gaps:
        x, low, high = map(float, re.findall(r"\(([-\d.]+),.*is ([\d.]+) to ([\d.]+)", one.text)[0])
        widths[x < 0.0] = low, high
    for is_left, wide in ((True, left_mm), (False, 3.0 - left_mm)):
        assert widths[is_left] == (pytest.approx(wide, abs=0.01), pytest.approx(wide, rel=0.2))


def test_a_search_refuses_such_a_candidate_in_words_without_a_simulation() -> None:
    class Simulator:
        def __call__(self, *_: object) -> None:
            raise AssertionError("it was simulated")

        def unbuildable(self, design: object) -> str:
            return f"the gap of {design}"

    study: Any = SimpleNamespace(
        first_look=None,
        at_search_accuracy=lambda design: design,
        objective=SimpleNamespace(goals=("uniform_coverage",)),
    )
    simulator: Any = Simulator()
    space: Any = SimpleNamespace(design_at=lambda _: "design", values_at=lambda _: {})
    candidate = Candidate(3, "search", np.zeros(1), space)
    answer = CandidateEvaluator(study, simulator).evaluate(candidate)
    assert isinstance(answer, RefusedError)
    assert str(answer) == "not simulated: the gap of design"
    assert not CandidateEvaluator(study, simulator).has_promise(candidate)

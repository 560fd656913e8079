"""Tolerances of a proposal, by ISO 2768-1 class m and of the amplitude, and its study's bounds."""

from types import SimpleNamespace
from typing import Any

import pytest

from chamberopt.chamber.propose.proposal import holding, new_harm, propose_tolerances
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


def found(*warnings: str, jams: int = 0) -> Any:
    return SimpleNamespace(warnings=warnings, jams=(None,) * jams)


def test_a_gap_that_jams_balls_in_the_place_of_another_is_no_new_harm() -> None:
    before = found("balls of 1 mm can jam in the gap of the part's side at (1, 2, 3) mm", jams=1)
    at_holder = "balls of 1 mm can jam in the gap between the holder and the part's side, 1 mm wide"
    rests = "step two: balls can come to rest on the part, which does not turn"
    for made, harm in (
        (found(at_holder, jams=1), ""),
        (found(at_holder, at_holder, jams=2), "balls jam in a gap"),
        (found("12% of the target cannot be touched by a ball of 1 mm"), ""),
        (found(at_holder, rests, jams=1), "balls can come to rest on the part"),
    ):
        assert new_harm(made, before) == harm

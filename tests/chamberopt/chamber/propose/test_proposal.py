"""Tolerances of a proposal, by ISO 2768-1 class m and of the amplitude, and its study's bounds."""

import pytest

from chamberopt.chamber.propose.proposal import holding, propose_tolerances
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

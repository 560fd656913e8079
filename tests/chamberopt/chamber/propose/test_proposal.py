"""Tolerances of a proposal: those of ISO 2768-1, class m, and of the amplitude."""

import pytest

from chamberopt.chamber.propose.proposal import propose_tolerances


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

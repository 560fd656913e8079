"""A sonotrode that swings wider than a ball is contained by its walls, or refused."""

import pytest

from chamberopt.chamber.analytic import analytic_cavity
from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.scene import build_scene
from chamberopt.common.errors import InputError
from sim_core import simulate
from tests.helpers.synthetic import plate_design


def test_no_ball_leaves_an_analytical_cavity() -> None:
    values = {"sonotrode__amplitude_um": 500, "sonotrode__frequency_khz": 2}
    design = plate_design(**values, shot__diameter_mm=0.2, shot__mass_g=0.005)
    brief = {"process.accuracy.warmup_time_s": 0.0, "process.accuracy.simulated_time_s": 0.3}
    design = design.changed(brief)
    cavity = analytic_cavity(design, build_chamber(design))
    assert simulate(build_scene(design, cavity, 1)).collisions.total > 10_000


@pytest.mark.parametrize(
    ("lean", "said"),
    [
        (30.0, r"sonotrode\.amplitude_um: given 500, .* by only 60 degrees.* at most 173\.\d:"),
        (-10.0, None),
    ],
)
def test_an_amplitude_too_large_for_the_walls_is_refused(lean: float, said: str | None) -> None:
    values = {"sonotrode__amplitude_um": 500, "chamber__inclination_deg": lean}
    design = plate_design(**values, shot__diameter_mm=0.2, shot__mass_g=0.005)
    if said is None:
        build_chamber(design)
        return
    with pytest.raises(InputError, match=said):
        build_chamber(design)
    build_chamber(design.changed({"sonotrode.amplitude_um": 173.0}))
    in_trade = design.changed({"sonotrode": {"frequency_khz": 2, "amplitude_pv_um": 1000}})
    with pytest.raises(InputError, match=r"amplitude_pv_um: given 1000, .* at most 34[67]\.\d:"):
        build_chamber(in_trade)

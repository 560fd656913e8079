"""The simulator is compiled before the first replica, for each step of a design."""

import pytest

import sim_core
from chamberopt.chamber.analytic import analytic_cavity
from chamberopt.chamber.build import build_chamber
from chamberopt.workflows.compile import compile_for
from tests.helpers.synthetic import plate_design


def test_each_step_is_compiled_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shot in the later step is of two sizes, which takes another variant."""
    asked: list[tuple[object, ...]] = []

    def is_compiled(*variant: object) -> bool:
        asked.append(variant)
        return True

    monkeypatch.setattr(sim_core, "is_compiled", is_compiled)
    mix = [{"diameter_mm": 2.0, "share": 0.5}, {"diameter_mm": 3.0, "share": 0.5}]
    later = {"name": "finer", "shot": {"diameter_mm": None, "mix": mix}}
    design = plate_design(steps=[{"name": "first"}, later])
    compile_for(design, build_chamber(design), None, print)
    assert [variant[2] for variant in asked] == [True, False]  # all balls alike


@pytest.mark.parametrize("is_kept", [True, False])
def test_what_is_not_compiled_is_and_that_it_cannot_be_kept_is_told(
    is_kept: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[tuple[object, ...]] = []
    told: list[str] = []
    monkeypatch.setattr(sim_core, "is_compiled", lambda *_: bool(done) and is_kept)
    monkeypatch.setattr(sim_core, "compile_simulator", lambda *variant: done.append(variant))
    box = {"shape": "box", "length_mm": 50.0, "width_mm": 40.0, "height_mm": 30.0}
    other = {"chamber": {**box, "sonotrode_distance_mm": 15.0}}
    for given, is_mesh, is_cylinder in (
        ({}, True, False),
        ({}, False, True),
        (other, False, False),
    ):
        done.clear()
        told.clear()
        design = plate_design().changed(given)
        built = build_chamber(design)
        cavity = None if is_mesh else analytic_cavity(design, built)
        assert (cavity is None) is is_mesh
        compile_for(design, built, cavity, told.append)
        ((*_, found, tell),) = done
        assert found is is_cylinder
        assert callable(tell)
        assert len(told) == (1 if is_kept else 2)
        assert ("NUMBA_CACHE_DIR" in told[-1]) is not is_kept

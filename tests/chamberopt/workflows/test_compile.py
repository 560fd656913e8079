"""The simulator is compiled before the first replica, for each step of a design."""

import pytest

import sim_core
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

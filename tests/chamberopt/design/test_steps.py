"""A step is the design with some keys changed, and with its share of the time."""

import pickle
from pathlib import Path
from typing import Any

import pytest

from chamberopt.common.errors import InputError
from chamberopt.design.design import Design
from chamberopt.design.load import load_design, save_design
from tests.helpers.synthetic import plate_design

TURNED: dict[str, Any] = {"name": "turned", "part": {"rotate_deg": (180.0, 0.0, 0.0)}}
FINE = {"name": "fine", "time_share": 0.5, "shot": {"diameter_mm": 2.0, "mass_g": 2}}


def stepped(*further: dict[str, Any], **values: object) -> Design:
    return plate_design().changed({**values, "steps": ({"name": "first"}, *further)})


def test_each_step_has_its_keys_and_its_share_of_the_time() -> None:
    design = stepped(TURNED, FINE)
    first, turned, fine = design.in_steps.values()
    assert list(design.in_steps) == ["first", "turned", "fine"]
    assert [one.process.treatment_time for one in (first, turned, fine)] == [2.0, 2.0, 1.0]
    assert fine.process.recorded_time == pytest.approx(design.process.recorded_time / 5.0)
    assert turned.part.rotate_deg == (180.0, 0.0, 0.0)
    assert turned.shot == first.shot == design.shot
    assert (fine.shot.diameter, fine.shot.mass_g) == (2e-3, 2.0)
    assert fine.materials == design.materials
    assert not any(one.steps for one in (first, turned, fine))
    assert plate_design().in_steps == {"": plate_design()}
    assert not design.has_like_steps
    assert stepped(TURNED).has_like_steps


def test_a_step_takes_the_place_of_other_sizes_and_of_a_holder() -> None:
    mix = ({"diameter_mm": 3.0, "share": 0.5}, {"diameter_mm": 2.0, "share": 0.5})
    holder = {"kind": "rod"}
    none = {"name": "none", "holder": "none", "shot": {"diameter_mm": 2.0}}
    design = stepped(none, **{"shot.mix": mix, "shot.diameter_mm": None, "holder": holder})
    first, other = design.in_steps.values()
    assert (first.shot.mix is None, first.holder is None) == (False, False)
    assert (other.shot.mix, other.holder) == (None, None)


def test_numbers_of_steps_can_be_changed_by_their_names(tmp_path: Path) -> None:
    design = stepped(TURNED, FINE)
    assert {"steps.2.time_share", "steps.1.part.rotate_deg.0", "steps.2.shot.diameter_mm"} <= set(
        design.numbers()
    )
    assert "steps.1.shot.diameter_mm" not in design.numbers()  # that of all steps
    assert design.value("steps.2.shot.diameter_mm") == 2.0
    other = design.changed({"steps.2.shot.diameter_mm": 1.5, "process.treatment_time_s": 50})
    assert other.in_steps["fine"].shot.diameter == 1.5e-3
    assert other.in_steps["fine"].process.treatment_time == 10.0
    save_design(other, tmp_path / "design.toml")
    assert load_design(tmp_path / "design.toml") == other
    assert pickle.loads(pickle.dumps(other)) == other


@pytest.mark.parametrize(
    ("step", "message"),
    [
        ({"part": {"mesh": "x.stl"}}, "steps.1.part.mesh: is the same in all steps"),
        ({"process": {"treatment_time_s": 3}}, "steps.1.process: is of all steps together: give"),
        ({"materials": {}}, "steps.1.materials: is the same in all steps"),
        ({"shot": {"material": "glass"}}, "steps.1.shot.material: balls of another metal are not"),
        (
            {"chamber": {"shape": "own.py"}},
            "steps.1.chamber.shape: a chamber that a file describes",
        ),
        (
            {"chamber": {"mesh": "x.stl"}},
            "steps.1.chamber.mesh: a chamber that a file describes is",
        ),
        ({"shot": {"diameter_mm": 40.0}}, "steps.1.shot.diameter_mm: given 40.0; allowed"),
        ({"shot": {"diametr_mm": 2.0}}, "steps.1.shot.diametr_mm: unknown key; did you mean"),
        ({"shot": {"mass_g": 9000.0}}, "steps.1.shot.mass_g: given 9000, whose balls fill"),
        ({"chamber": {"height_mm": 1.0}}, "steps.1.chamber.height_mm: given 1.0"),
        ({"name": "first"}, "steps.1.name: given 'first', as steps.0 has; names must differ"),
        ({"name": "turned over"}, "steps.1.name: given 'turned over'; allowed: a name in quotes"),
        ({"pose": 3}, "steps.1.pose: unknown key; allowed here: name, time_share, part"),
        ({"time_share": 0.0}, "steps.1.time_share: given 0.0; allowed: a number from 0.001"),
    ],
)
def test_what_a_step_cannot_change_is_refused_in_words(step: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as error:
        stepped({"name": "other", **step})
    assert message in str(error.value)


def test_the_first_step_changes_nothing_and_is_not_alone() -> None:
    with pytest.raises(InputError, match=r"^steps: given one step; give two or more"):
        stepped()
    with pytest.raises(InputError, match=r"^steps\.0\.part: the first step is the design itself"):
        plate_design().changed({"steps": (TURNED, {"name": "second"})})

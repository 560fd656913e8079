"""effects.part_turn of a design: its allowed values, and the rotation that the simulator gets."""

from pathlib import Path

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.checks.facts import describe
from chamberopt.chamber.checks.warning import WarningKind
from chamberopt.chamber.part import Axis, posed_part, turning_axis
from chamberopt.chamber.scene import build_scene, chamber_mesh, require_turnable
from chamberopt.common.errors import InputError
from chamberopt.design.design import Design
from chamberopt.design.load import load_design, save_design
from chamberopt.search.study import load_study

ROOT = Path(__file__).resolve().parents[3]
DESIGN = ROOT / "designs" / "gear_turning.toml"


@pytest.fixture(scope="module")
def design() -> Design:
    return load_design(DESIGN)


@pytest.fixture(scope="module")
def mesh(design: Design):  # type: ignore[no-untyped-def]
    return chamber_mesh(build_chamber(design))


def written(tmp_path: Path, motion: str) -> Path:
    text = DESIGN.read_text(encoding="utf-8")
    line = next(line for line in text.splitlines() if line.startswith("part_turn"))
    text = text.replace(line, f"part_turn = {motion}").replace(
        '"parts/', f'"{(ROOT / "designs/parts").as_posix()}/'
    )
    path = tmp_path / "design.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("motion", "words"),
    [
        ("{}", "effects.part_turn: gives no motion"),
        ("{ rpm = 30, angle_deg = 20, frequency_hz = 1 }", "effects.part_turn.rpm: given beside"),
        ("{ angle_deg = 20 }", "effects.part_turn.angle_deg: given without frequency_hz"),
        ("{ frequency_hz = 2 }", "effects.part_turn.frequency_hz: given without angle_deg"),
        (
            "{ rpm = 30, axis = [0, 0, 0] }",
            "effects.part_turn.axis: given .0, 0, 0., which points nowhere",
        ),
        (
            "{ rpm = 30, axis = [0, 1] }",
            "effects.part_turn.axis: too short; allowed: three numbers",
        ),
        (
            "{ rpm = 30, through_mm = 3 }",
            "effects.part_turn.through_mm: given 3; allowed: three numbers",
        ),
        ("{ rpm = 100000 }", "effects.part_turn.rpm: given 100000"),
        ('{ rpm = "30" }', "write it without quotes"),
        ("{ rpn = 30 }", "unknown key; did you mean 'rpm'"),
        ("30", "effects.part_turn: given 30; allowed: a table"),
        ("true", "effects.part_turn: given true; allowed: a table"),
    ],
)
def test_what_is_wrong_is_said_in_the_words_of_the_file(
    tmp_path: Path, motion: str, words: str
) -> None:
    with pytest.raises(InputError, match=words) as said:
        load_design(written(tmp_path, motion))
    assert len(str(said.value).splitlines()) == 1


@pytest.mark.parametrize(
    "motion", ["{ rpm = -3 }", "{ angle_deg = 20, frequency_hz = 1, axis = [0, 1, 0] }"]
)
def test_a_saved_design_loads_as_the_same(tmp_path: Path, motion: str) -> None:
    design = load_design(written(tmp_path, motion))
    save_design(design, tmp_path / "again.toml")
    assert load_design(tmp_path / "again.toml") == design


def axis_of(design: Design) -> Axis:
    axis = turning_axis(design, posed_part(design)[0])
    assert axis is not None
    return axis


def test_the_axis_goes_with_the_part_wherever_it_is_posed(design: Design) -> None:
    point, axis = axis_of(design)
    # The gear's axis is z in its file: after 90 degrees about x it lies along -y, at half height.
    np.testing.assert_allclose(axis, [0.0, -1.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(point[[0, 2]], [0.0, 0.015 + 0.022], atol=1e-4)
    lower = design.changed({"chamber.sonotrode_distance_mm": 10.0, "part.offset_mm.0": 3.0})
    np.testing.assert_allclose(axis_of(lower)[0] - point, [3e-3, 0.0, -5e-3], atol=1e-12)


def test_replicas_start_at_angles_of_their_own(design: Design, mesh) -> None:  # type: ignore[no-untyped-def]
    few = design.changed({"shot.mass_g": 0.2})
    one, two, again = (
        build_scene(few, mesh, seed, axis_of(few)).physics.part_rotation for seed in (1, 2, 1)
    )
    assert one == again
    assert one is not None
    assert two is not None
    assert one.rpm == 30.0
    assert one.phase != two.phase


def test_a_part_that_cannot_turn_is_refused_before_anything_is_simulated(tmp_path: Path) -> None:
    crooked = load_design(written(tmp_path, "{ rpm = 30, axis = [0.2, 0, 1] }"))
    with pytest.raises(InputError, match=r"effects\.part_turn: .* not round about its axis"):
        describe(crooked, build_chamber(crooked))


def test_too_short_a_simulation_of_a_slow_turn_is_remarked_on(tmp_path: Path, mesh) -> None:  # type: ignore[no-untyped-def]
    slow = load_design(written(tmp_path, "{ rpm = 0.1 }"))
    require_turnable(slow, mesh, axis_of(slow))
    found = describe(slow, build_chamber(slow))["warnings"]
    (said,) = (one.text for one in found if one.kind is WarningKind.PART_TURN)
    assert "takes 600 s to turn once" in said


def test_the_shipped_study_is_about_the_turning_gear() -> None:
    study = load_study(ROOT / "studies" / "gear_turning.toml")
    assert study.design.effects.part_turn is not None
    for name, varied in study.vary.items():
        for bound in varied.bounds:
            changed = study.design.changed({name: bound})
            require_turnable(changed, chamber_mesh(build_chamber(changed)), axis_of(changed))


def test_balls_rest_beside_a_turning_part_if_asked_or_if_something_still_faces_up(
    design: Design, mesh
) -> None:  # type: ignore[no-untyped-def]
    """Here only the sonotrode and the gear do, and on neither of them a ball can lie still."""
    assert build_scene(design, mesh, 1, axis_of(design)).physics.rest is None
    asked = design.model_copy(update={"effects": design.effects.model_copy(update={"rest": True})})
    physics = build_scene(asked, mesh, 1, axis_of(asked)).physics
    assert physics.rest is not None
    assert physics.part_rotation is not None

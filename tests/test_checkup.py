"""What `check` says before anything runs: where shot can come to rest, how the part turns, what sticks out."""

import math
from pathlib import Path

import pytest

from chamberopt.chamber import Chamber, build_chamber
from chamberopt.checkup import describe, warnings
from chamberopt.config import load_design
from chamberopt.design import Design
from chamberopt.ledges import ledges

DESIGNS = Path(__file__).resolve().parents[1] / "designs"


def made(name: str, **values: float) -> tuple[Design, Chamber]:
    design = load_design(DESIGNS / f"{name}.toml").with_values({k.replace("__", "."): v for k, v in values.items()})
    return design, build_chamber(design)


def without_gravity(design: Design) -> Design:
    return design.model_copy(update={"effects": design.effects.model_copy(update={"gravity": False})})


@pytest.fixture(scope="module")
def gear() -> tuple[Design, Chamber]:
    return made("gear")


def test_a_level_top_is_warned_of_with_area_place_and_remedy(gear: tuple[Design, Chamber]) -> None:
    """The gear's upper face: a disc with teeth, 20 mm from root to root and 22 to their tips, less the shaft."""
    design, chamber = gear
    (said,) = (text for text in warnings(design, chamber) if "come to rest" in text)
    assert "come to rest on the part, which neither vibrates nor turns" in said
    assert "around (0.0, 0.0, 25.0) mm, at z = 25 mm" in said
    assert "effects.part_turn" in said
    area = float(said.split("turns: ")[1].split(" mm²")[0])
    shaft = math.pi * 8**2
    assert 0.5 * math.pi * 22**2 - shaft < area < math.pi * 22**2 - shaft / 2
    (ledge,) = ledges(design, chamber)
    assert ledge.level
    assert not ledges(without_gravity(design), chamber)


def test_slopes_are_a_note_and_no_warning() -> None:
    design, chamber = made("blade")
    assert not any("come to rest" in text for text in warnings(design, chamber))
    (said,) = (text for text in describe(design, chamber)["notes"] if "come to rest" in text)
    assert "in hollows of the part" in said
    assert "none level" in said
    assert "z = 15 to 55 mm" in said


def test_nothing_comes_to_rest_under_a_lid_or_on_a_part_that_turns() -> None:
    for name in ("plate", "gear_turning"):
        assert not ledges(*made(name)), name


def test_a_turning_part_is_described_in_the_chambers_frame() -> None:
    design, chamber = made("gear_turning")
    turn = describe(design, chamber)["part_turn"]
    assert turn["rpm"] == 30.0
    assert turn["axis"] == pytest.approx([0.0, -1.0, 0.0], abs=1e-12)
    assert turn["through_mm"][0] == pytest.approx(0.0, abs=1e-3)
    assert turn["through_mm"][2] == pytest.approx(15.0 + 22.0, abs=0.1)
    assert "part_turn" not in describe(*made("plate"))


def test_a_part_through_the_side_wall_is_warned_of(gear: tuple[Design, Chamber]) -> None:
    """Not of a shaft that goes out through the ceiling, nor of a lid, nor of a shaft that turns in the wall."""
    assert not any("side wall between z" in text for text in warnings(*gear))
    for name in ("plate", "gear_turning"):
        assert not any("side wall between z" in text for text in warnings(*made(name))), name
    said = " ".join(warnings(*made("gear", chamber__diameter_mm=42.0)))
    assert "goes out through the side wall between z = 15 and 25 mm" in said
    assert "chamber.diameter_mm" in said


def test_a_part_that_turns_down_to_the_sonotrode_is_warned_of() -> None:
    """The gear of 22 mm, 15 mm over the sonotrode, turned about a line 6.9 mm under its own axis: down to 1.2 mm."""
    eccentric = {"effects.part_turn.through_mm.1": -6.9}
    design, chamber = made("gear_turning")
    said = " ".join(warnings(design.with_values(eccentric), chamber))
    assert "the gap between turning part and sonotrode is 1.16 mm, narrower than a ball of 1.5 mm" in said
    assert "turning part" not in " ".join(warnings(design, chamber))
    # 5 degrees to each side, a point 22 mm under the gear's axis hardly gets lower than at rest
    swings = design.with_values(eccentric)
    motion = swings.effects.part_turn.model_copy(update={"rpm": None, "angle_deg": 5.0, "frequency_hz": 1.0})  # type: ignore[union-attr]
    swings = swings.model_copy(update={"effects": swings.effects.model_copy(update={"part_turn": motion})})
    assert "turning part" not in " ".join(warnings(swings, chamber))


def test_balls_that_would_meet_but_are_let_through_each_other_are_warned_of() -> None:
    design, chamber = made("gear")
    through = design.model_copy(update={"effects": design.effects.model_copy(update={"ball_collisions": False})})
    assert any("effects.ball_collisions is false" in text for text in warnings(through, chamber))
    assert not any("ball_collisions" in text for text in warnings(design, chamber))
    alone = through.with_values({"shot.mass_g": 1e-3 * round(1e6 * design.shot.ball_mass)})
    assert not any("ball_collisions" in text for text in warnings(alone, chamber))

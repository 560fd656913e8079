"""What a shop has: its file, and the sonotrode on which a proposed chamber stands."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chamberopt.chamber.layout.floor import STEEPEST, Floor, floor_on_sonotrode, require_room
from chamberopt.chamber.layout.sizes import Sizes
from chamberopt.chamber.shop import Shop, example_text, load_shop, usual_shop
from chamberopt.cli import main
from chamberopt.common.errors import InputError

DISC = {"name": "D", "diameter_mm": 60.0, "frequency_khz": 20.0, "amplitudes_um": [20.0, 30.0]}
SQUARE = {**DISC, "name": "S", "diameter_mm": None, "size_mm": [60.0, 50.0], "pieces": 4}
BLOCK = {"name": "B", "size_mm": [120.0, 50.0], "frequency_khz": 20.0, "amplitudes_pv_um": [50.0]}


def shop(*sonotrodes: dict[str, object], **more: object) -> Shop:
    return Shop.model_validate({"sonotrodes": list(sonotrodes), **more})


def floor(plan: dict[str, float | str], shape: str, own: Shop, gap: float = 0.01) -> Floor:
    sizes = Sizes(shape, plan, 0.015, 0.05, gap, False, 0.03)
    return floor_on_sonotrode(sizes, 0.02, own, may_exceed=False)


def test_the_example_is_a_shop_that_is_read(tmp_path: Path) -> None:
    file = tmp_path / "shop.toml"
    file.write_text(example_text(), encoding="utf-8")
    assert load_shop(file).sonotrodes == usual_shop().sonotrodes
    assert load_shop(file).stock_mm("100Cr6")[0] == 0.4
    assert usual_shop().stock_mm("tungsten_carbide")[0] == 0.5  # all that are sold


@pytest.mark.parametrize(
    ("plan", "shape", "size"),
    [
        ({"diameter_mm": 52.0}, "cylinder", {"diameter_mm": 60.0}),  # the whole face
        ({"diameter_mm": 30.0}, "cylinder", {"diameter_mm": 60.0}),  # as wide as it is high
        ({"diameter_mm": 66.0}, "cylinder", {"diameter_mm": 60.0}),  # less room beside the part
        ({"length_mm": 45.0, "width_mm": 30.0}, "box", {"length_mm": 45.0, "width_mm": 30.0}),
        ({"length_mm": 45.0, "width_mm": 110.0}, "box", {"length_mm": 50.0, "width_mm": 120.0}),
        ({"sides": 6.0, "across_mm": 50.0}, "prism", {"sides": 6.0, "across_mm": 50.0}),
    ],
)
def test_a_floor_lies_within_the_face_of_a_sonotrode(
    plan: dict[str, float | str], shape: str, size: dict[str, float]
) -> None:
    found = floor(plan, shape, shop(DISC, BLOCK))
    assert found.lean == 0.0
    assert found.sizes.plan == size
    assert "clear" in found.reason


@pytest.mark.parametrize("clear", [0.2, 0.5])
def test_a_wall_round_a_face_is_wider_by_its_clearance(clear: float) -> None:
    own = shop(DISC, BLOCK, clearance_mm=clear)
    wide = 60.0 + 2.0 * clear
    found = floor({"diameter_mm": 52.0}, "cylinder", own)
    assert (
        f"the wall round it {clear:g} mm clear; BUILD IT {wide:g} mm wide, within the limits on "
        f"the sheet: the slit of {clear:g} mm on each side" in found.reason
    )
    found = floor({"length_mm": 110.0, "width_mm": 30.0}, "box", own)
    assert found.reason.endswith(f"the wall ends over its face, {clear:g} mm clear")
    found = floor({"length_mm": 60.0, "width_mm": 50.0}, "box", own)
    assert (
        f"on two sides, {clear:g} mm clear, and ends over its face elsewhere; BUILD IT "
        f"{50.0 + 2.0 * clear:g} mm wide" in found.reason
    )


def test_faces_of_the_part_that_are_walls_fix_the_floor() -> None:
    """No wall between them moves in or out, or leans, for the sake of a sonotrode."""
    plan: dict[str, float | str] = {"length_mm": 118.0, "width_mm": 49.0}
    free = Sizes("box", plan, 0.015, 0.05, 0.01, False, 0.03)
    for closed, width in (((), 50.0), (("y",), 50.0), (("-y", "y"), 49.0)):
        found = floor_on_sonotrode(replace(free, closed=closed), 0.02, shop(BLOCK), False)
        assert found.sizes.plan["width_mm"] == width
    wide = replace(free, plan={"length_mm": 118.0, "width_mm": 52.0}, closed=("-y", "y"))
    with pytest.raises(InputError, match="larger than the largest face"):
        floor_on_sonotrode(wide, 0.02, shop(BLOCK), False)


def test_a_room_is_no_wider_than_the_largest_chamber() -> None:
    own = shop(DISC, largest_chamber_mm=[45.0, 46.0, 60.0])
    found = floor({"diameter_mm": 30.0}, "cylinder", own)
    assert found.sizes.plan == {"diameter_mm": 45.0}
    assert found.sizes.gap == pytest.approx(0.01 + 7.5e-3)


@pytest.mark.parametrize(
    ("plan", "shape"),
    [({"diameter_mm": 74.0}, "cylinder"), ({"length_mm": 60.0, "width_mm": 36.0}, "box")],
)
def test_walls_lean_out_of_a_face_that_is_small(plan: dict[str, float | str], shape: str) -> None:
    """Where the part begins, the room is as wide as it should be; the floor lies on the face."""
    found = floor(plan, shape, shop(DISC), gap=0.004)
    out = 2e3 * found.sizes.distance * math.tan(math.radians(found.lean))
    own = [float(found.sizes.plan[key]) for key in plan]
    assert 0.0 < found.lean <= STEEPEST + 1.0
    assert np.hypot(*own, *([0.0] if shape == "cylinder" else [])) <= 60.0
    assert all(one + out >= float(plan[key]) - 0.1 for one, key in zip(own, plan, strict=True))


@pytest.mark.parametrize(
    ("plan", "shape", "grid"),
    [
        ({"length_mm": 118.0, "width_mm": 55.0}, "box", ((50.0, 60.0), 3, 1)),
        ({"length_mm": 55.0, "width_mm": 118.0}, "box", ((60.0, 50.0), 1, 3)),  # its long side: y
        ({"length_mm": 190.0, "width_mm": 52.0}, "box", ((50.0, 60.0), 4, 1)),
        ({"diameter_mm": 98.0}, "cylinder", ((60.0, 50.0), 2, 2)),
    ],
)
def test_blocks_side_by_side_carry_what_no_sonotrode_does(
    plan: dict[str, float | str], shape: str, grid: tuple[tuple[float, float], int, int]
) -> None:
    found = floor(plan, shape, shop(DISC, SQUARE), gap=0.001)
    assert found.lean == 0.0
    size, columns, rows = grid
    assert found.face is not None
    assert (found.face.size_mm, found.face.columns, found.face.rows) == (size, columns, rows)


def test_a_floor_is_made_narrower_where_that_saves_blocks() -> None:
    """The wall goes round blocks that are nearly filled, and ends over others."""
    plan: dict[str, float | str] = {"length_mm": 170.0, "width_mm": 66.0}
    found = floor(plan, "box", shop(DISC, SQUARE), gap=0.01)
    assert found.sizes.plan == {"length_mm": 170.0, "width_mm": 60.0}
    nearly = floor({**plan, "length_mm": 190.0}, "box", shop(DISC, SQUARE), gap=0.01)
    assert nearly.sizes.plan == {"length_mm": 200.0, "width_mm": 60.0}
    assert found.face is not None
    assert (found.face.sides_mm, found.face.count) == ((200.0, 60.0), 4)
    assert found.sizes.gap == pytest.approx(0.01 - 3e-3 + 0.0)


@pytest.mark.parametrize(("ball", "count"), [(2e-3, 2), (3e-3, 3)])
def test_less_room_that_is_four_balls_wide_saves_a_sonotrode(ball: float, count: int) -> None:
    """Two blocks are 120 mm long, so 10 of the 20 mm at each end of the part go."""
    own = shop({**SQUARE, "size_mm": [60.0, 56.0]})
    sizes = Sizes("box", {"length_mm": 140.0, "width_mm": 55.0}, 0.015, 0.05, 0.02, False, 0.03)
    found = floor_on_sonotrode(sizes, 0.02, own, False, ball)
    assert found.stand.face.count == count


def test_what_no_sonotrode_holds_is_refused_with_a_way_out() -> None:
    with pytest.raises(InputError, match=r"floor of 190 x 96 mm is larger than the largest.*strip"):
        floor({"length_mm": 190.0, "width_mm": 96.0}, "box", shop(DISC, BLOCK))
    sizes = Sizes("box", {"length_mm": 290.0, "width_mm": 196.0}, 0.015, 0.05, 0.01, False, 0.03)
    unknown = floor_on_sonotrode(sizes, 0.02, usual_shop(), may_exceed=True)
    assert math.isinf(unknown.lean)
    assert "LARGER THAN USUAL SONOTRODES" in unknown.reason


def test_a_height_is_one_that_the_shop_has() -> None:
    sizes = Sizes("cylinder", {"diameter_mm": 60.0}, 0.015, 0.041, 0.01, False, 0.03)
    own = shop(DISC, heights_mm=[30.0, 70.0, 50.0], largest_chamber_mm=[80.0, 60.0, 60.0])
    assert require_room(sizes, own).height == pytest.approx(0.05)
    with pytest.raises(InputError, match="above all of heights_mm"):
        require_room(sizes, shop(DISC, heights_mm=[30.0]))
    with pytest.raises(InputError, match="60 x 41 mm, more than largest_chamber_mm"):
        require_room(sizes, shop(DISC, largest_chamber_mm=[50.0, 50.0, 50.0]))


def test_amplitudes_are_those_that_a_sonotrode_can_set() -> None:
    disc, block = shop(DISC, BLOCK).sonotrodes
    assert disc.amplitude_nearest(40.0) == ("amplitude_um", 30.0)
    assert block.amplitude_nearest(40.0) == ("amplitude_pv_um", 50.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        ("log_mean = [1]", "this is what chamberopt calibrate found of a machine"),
        ("clearance_mm = 1", "sonotrodes: missing"),
        ("sonotrodes = []", "given []; allowed: 1 to 200 tables, [[sonotrodes]]"),
        (
            '[[sonotrodes]]\nname = "A"\nnote = "\\n[shot]"\ndiameter_mm = 60\n'
            "frequency_khz = 20\namplitudes_um = [9]",
            "note: has a line break",
        ),
        ('[[sonotrodes]]\nname = "A"\nfrequency_khz = 20\namplitudes_um = [9]', "or size_mm"),
        (
            '[[sonotrodes]]\nname = "A"\ndiameter_mm = 60\nfrequency_khz = 20',
            "give amplitudes_um (zero-to-peak) or amplitudes_pv_um",
        ),
        (
            '[[sonotrodes]]\nname = "A"\ndiameter_mm = 60\npieces = 2\nfrequency_khz = 20\n'
            "amplitudes_um = [9]",
            "pieces: given for a disc; only blocks",
        ),
        (
            '[[sonotrodes]]\nname = "A"\ndiameter_mm = 60\nfrequency_khz = 20\n'
            "amplitudes_um = [1e9]",
            "allowed: one or more, 0.1 to 500 µm",
        ),
        (
            '[[sonotrodes]]\nname = "A"\ndiameter_mm = 60\nfrequency_khz = 20\n'
            'amplitudes_um = [9]\n[[balls]]\nmaterial = "lead"\ndiameters_mm = [1]',
            "given 'lead'; known are",
        ),
        (
            '[[sonotrodes]]\nname = "A"\ndiameter_mm = 60\nfrequency_khz = 20\n'
            'amplitudes_um = [9]\n[[balls]]\nmaterial = "steel"\ndiameters_mm = [nan]',
            "diameters_mm",
        ),
    ],
)
def test_a_wrong_file_is_told(
    text: str, message: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "shop.toml"
    file.write_text(text, encoding="utf-8")
    assert main(["shop", str(file)]) == 2
    assert message in capfd.readouterr().err


def test_the_command_prints_an_example_and_checks_a_file(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert main(["shop", "--example"]) == 0
    file = tmp_path / "shop.toml"
    file.write_text(capfd.readouterr().out, encoding="utf-8")
    assert main(["shop", str(file)]) == 0
    assert '"disc of 80 mm" (80 mm), 20 kHz' in capfd.readouterr().out
    assert main(["shop"]) == 2
    assert "give the shop's file, or --example" in capfd.readouterr().err


def test_balls_are_in_stock_and_do_not_enter_the_clearance() -> None:
    own = shop(DISC, balls=[{"material": "steel", "diameters_mm": [3.0, 0.3, 1.0]}])
    assert own.stock_mm("steel") == (1.0, 3.0)
    with pytest.raises(InputError, match="has no balls of zirconia; it has steel"):
        own.stock_mm("zirconia")
    with pytest.raises(InputError, match="smaller than twice clearance_mm = 2"):
        shop(DISC, clearance_mm=2.0, balls=[{"material": "steel", "diameters_mm": [3.0]}]).stock_mm(
            "steel"
        )


def test_blocks_are_told_as_they_lie_in_the_chamber() -> None:
    pairs = [one.face for one in usual_shop().stands_of_blocks() if one.face.sides_mm == (160, 80)]
    assert [one.in_words.partition("side by side, ")[2] for one in pairs] == [
        "2 × 1 (block of 80 mm)"
    ]
    assert "side by side, 1 × 2 (" in pairs[0].turned.in_words
    assert pairs[0].turned.turned == pairs[0]
    one = shop({**SQUARE, "size_mm": [60.0, 56.0], "pieces": 1}).stands()[0].face
    assert one.turned.sides_mm == (56.0, 60.0)
    assert shop(DISC).stands()[0].face.turned == shop(DISC).stands()[0].face

"""What is not calibrated: groups of numbers, each between two factors."""

import math
from pathlib import Path

import pytest

from chamberopt.common.errors import InputError
from chamberopt.design.design import Design
from chamberopt.design.load import load_design, save_design
from chamberopt.design.materials import friction_pairs, treatment
from chamberopt.design.ranges import calibrated, unknowns, variants
from tests.helpers.synthetic import machine_values, plate_design

ROUGH = {
    "effects.friction": {"mu": 0.3, "beta0": 0.2, "mu_balls": 0.2},
    "effects.roughness": {"slope_deg": 20.0, "part_deg": 4.0},
}
PLATE = plate_design()  # whose part has a v0 of its own, the other surfaces that of the catalogue
KNOWN = {"friction": [1, 1], "v0": [1, 1], "slopes": [1, 1]}


def rough(**ranges: object) -> Design:
    return PLATE.changed(ROUGH | {"ranges": ranges or None})


def test_groups_are_friction_computed_v0_and_slopes() -> None:
    friction, v0, slopes = unknowns(rough())
    ends = {name: (x.value, x.low, x.high) for name, x in friction.numbers.items()}
    assert ends == {
        "effects.friction.mu": pytest.approx((0.3, 0.15, 0.45)),
        "effects.friction.mu_balls": pytest.approx((0.2, 0.1, 0.3)),
    }
    assert v0.numbers.keys() == {f"materials.{k}.v0_m_s" for k in ("shot", "wall", "sonotrode")}
    assert slopes.numbers.keys() == {f"effects.roughness.{k}_deg" for k in ("slope", "part")}
    smooth = PLATE.changed({"effects.friction": "none", "effects.roughness": "none"})
    assert [one.name for one in unknowns(smooth)] == ["v0"]


def bounds(design: Design, group: str) -> dict[str, tuple[float, float]]:
    numbers = next(one.numbers for one in unknowns(design) if one.name == group)
    return {name.rpartition(".")[2]: (x.low, x.high) for name, x in numbers.items()}


def test_numbers_of_the_catalogue_lie_between_its_bounds(tmp_path: Path) -> None:
    """Two surfaces with the same mu, as of steel on steel and on aluminium, may have other bounds.
    A number that is put in the place of the catalogue's has the usual factors.
    """
    metals = {"part": "7075-T6", "sonotrode": "Ti-6Al-4V", "wall": "42CrMo4"}
    design = PLATE.changed({f"materials.{key}": metal for key, metal in metals.items()})
    pairs = {(one.ball, one.metal): one for one in friction_pairs()}
    expected = {
        f"mu_{key}": pairs["steel", metal].mu_range
        for key, metal in (("part", "aluminium"), ("sonotrode", "titanium"), ("wall", "steel"))
    } | {"mu_balls": pairs["any", "any"].mu_range}
    assert bounds(design, "friction") == expected
    assert expected["mu_part"] != expected["mu_wall"]
    assert bounds(design, "slopes") == {"slope_deg": treatment("peened").slope_range}
    blasted = design.changed({"effects.roughness": "blasted"})
    assert bounds(blasted, "slopes") == {"slope_deg": treatment("blasted").slope_range}
    _, high = variants(design)["friction"]
    assert high.effects.friction.surfaces == (
        (expected["mu_part"][1], 0.2), (expected["mu_sonotrode"][1], 0.2),
        (expected["mu_wall"][1], 0.2),
    )  # fmt: skip
    save_design(blasted, tmp_path / "design.toml")
    saved = load_design(tmp_path / "design.toml")
    assert [bounds(saved, x) for x in ("friction", "slopes")] == [
        bounds(blasted, x) for x in ("friction", "slopes")
    ]

    own = design.changed({"effects.friction.mu_part": 0.4, "effects.roughness.part_deg": 4.0})
    assert bounds(own, "friction") == expected | {"mu_part": pytest.approx((0.2, 0.6))}
    assert bounds(own, "slopes")["part_deg"] == pytest.approx((2.4, 6.8), rel=0.01)
    given = design.changed({"ranges": {"friction": [0.8, 1.1], "slopes": [1, 1]}})
    assert bounds(given, "friction")["mu_sonotrode"] == pytest.approx((0.2, 0.275))
    assert "slopes" not in [one.name for one in unknowns(given)]
    with pytest.raises(InputError, match=r"roughness\.treatment: given 'worn'; allowed: peened"):
        design.changed({"effects.roughness": {"slope_deg": 3.0, "treatment": "worn"}})


def test_the_ends_are_the_numbers_times_the_factors() -> None:
    ends = variants(rough(v0=[0.5, 3], slopes=[0.5, 4]))
    low, high = ends["friction"]
    assert (low.effects.friction.mu, high.effects.friction.mu_balls) == pytest.approx((0.15, 0.3))
    assert low.effects.friction.beta0 == 0.2
    wall = PLATE.materials.wall.v0_m_s
    assert ends["v0"][1].materials.wall.v0_m_s == pytest.approx(3 * wall)
    assert ends["v0"][1].materials.part == PLATE.materials.part
    assert load_again(ends["v0"][1]).materials.wall.v0_m_s == pytest.approx(3 * wall)
    half = math.tan(math.radians(ends["slopes"][0].effects.roughness.part_deg))
    assert half == pytest.approx(0.5 * math.tan(math.radians(4.0)))
    assert ends["slopes"][1].effects.roughness.slope_deg == 25.0  # the steepest that is allowed


def load_again(design: Design) -> Design:
    return design.changed({"process.seed": 2})


def test_what_is_known_has_no_range(tmp_path: Path) -> None:
    design = rough(**KNOWN)
    assert unknowns(design) == []
    assert variants(design) == {}
    save_design(design, tmp_path / "design.toml")
    assert load_design(tmp_path / "design.toml").ranges == design.ranges
    save_design(PLATE, tmp_path / "plain.toml")
    assert "[ranges]" not in (tmp_path / "plain.toml").read_text()


def test_what_a_calibration_has_fitted_has_no_range() -> None:
    design = rough().changed({"calibration": machine_values(v0=0.1, C0=0.02)})
    assert [one.name for one in unknowns(design)] == ["friction", "slopes"]
    assert calibrated(design) == ["v0"]


@pytest.mark.parametrize(
    ("ranges", "message"),
    [
        ({"friction": [1.2, 2]}, r"friction: given \[1.2, 2.0\]; allowed: two factors \[low, high"),
        ({"v0": [0.5, 0.9]}, "v0: given"),
        ({"slopes": [1, 1000]}, "slopes: given"),
        ({"slopes": [-1, 2]}, "slopes: given"),
        ({"v0": 2}, "v0: given 2; allowed: two factors"),
        ({"mu": [0.5, 2]}, "mu: unknown key"),
    ],
)
def test_wrong_factors_are_refused_by_name(ranges: dict, message: str) -> None:
    with pytest.raises(InputError, match=rf"^ranges\.{message}"):
        PLATE.changed({"ranges": ranges})


def test_a_range_is_no_parameter_and_has_no_tolerance() -> None:
    design = rough(v0=[0.5, 3])
    assert not any(name.startswith("ranges") for name in design.numbers())
    with pytest.raises(InputError, match="how well a number is known"):
        design.changed({"tolerances": {"ranges.v0.0": 0.1}})

"""The catalogue of alloys and balls, and designs that name what is in it."""

import json
from pathlib import Path

import pytest

from chamberopt.cli import main
from chamberopt.common.errors import InputError
from chamberopt.design.calibration import scaled_restitution
from chamberopt.design.design import validate
from chamberopt.design.load import Design, load_design, save_design
from chamberopt.design.materials import (
    alloy,
    alloys,
    ball,
    ball_sizes,
    balls,
    computed_v0,
    friction_pairs,
    grades,
    treatments,
)

TABLES = """
[part]
mesh = "part.stl"
unit = "mm"
[chamber]
shape = "cylinder"
height_mm = 40
sonotrode_distance_mm = 15
diameter_mm = 50
[sonotrode]
frequency_khz = 20
amplitude_um = 25
[shot]
mass_g = 3
diameter_mm = 3
material = "steel"
[materials]
wall = "42CrMo4"
sonotrode = "Ti-6Al-4V"
part = "316L"
[process]
treatment_time_s = 50
"""


def design(folder: Path, *changes: tuple[str, str]) -> Design:
    (folder / "part.stl").touch()
    text = TABLES
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "design.toml").write_text(text, encoding="utf-8")
    return load_design(folder / "design.toml")


class TestCatalogue:
    def test_names_are_found_once_however_they_are_spelt(self) -> None:
        for listed in (alloys(), balls()):
            names = [name for one in listed for name in (one.name, *one.also)]
            plain = ["".join(filter(str.isalnum, name)).lower() for name in names]
            assert len({*plain}) == len({*names})
            assert not any(name != name.strip() for name in names)
        assert alloy("ti6al4v") is alloy("Ti64") is alloy("3.7165")
        assert ball("100Cr6") is ball("steel")
        assert alloy("1.7131") is alloy("16MnCr5")
        assert alloy("Ti-6Al-2Sn-4Zr-2Mo").name == "Ti-6242"
        assert alloy("AISI 6150").name == "51CrV4"
        assert alloy("GGG60").name == "EN-GJS-600-3"

    def test_each_row_says_what_is_known_of_it(self) -> None:
        for one in (*alloys(), *balls()):
            wanted = "by heart, not verified" if one.kind == "by heart" else "read"
            assert wanted in one.source, one.name
        for metal in alloys():
            if metal.tensile_MPa is not None:
                assert metal.yield_MPa is not None
                assert metal.yield_MPa < metal.tensile_MPa
                # about 3.4 MPa for each HB in steels, 3 in most other metals
                assert 2.6 < metal.tensile_MPa / metal.hardness_HB < 4.3, metal.name

    def test_balls_are_sold_in_sizes_that_a_design_may_have(self) -> None:
        known = {grade.name for grade in grades()}
        for one in balls():
            sizes = ball_sizes(one.name)
            assert list(sizes) == sorted({*sizes})
            assert 0.1 <= sizes[0] < sizes[-1] <= 8.0
            assert known.issuperset(one.grades)
        assert [one.lot_um for one in grades()] == sorted(one.lot_um for one in grades())

    def test_densities_stay(self) -> None:
        """A result records the name of its balls, so that a change would change its replay."""
        found = {one.name: one.density_kg_m3 for one in balls()}
        assert found == {"steel": 7800.0, "tungsten_carbide": 14900.0, "zirconia": 6050.0,
                         "silicon_nitride": 3200.0, "glass": 2500.0}  # fmt: skip

    def test_v0_by_johnsons_formula(self) -> None:
        """By hand: v_Y² = 26 (Y/E*)⁴ Y/rho, Y = 9.81e6 HB / 2.8, v0 = v_Y (1.18 / 0.91)⁴."""
        stress = 9.81e6 * 300 / 2.8
        ratio = stress * 2 * (1 - 0.3**2) / 210e9
        by_hand = (26 * ratio**4 * stress / 7800) ** 0.5 * (1.18 / 0.91) ** 4
        assert computed_v0(ball("steel"), alloy("42CrMo4")) == 0.44 == round(by_hand, 2)
        assert computed_v0(ball("steel"), ball("steel")) == 1.5
        # a harder surface than the ball: the ball yields
        assert computed_v0(ball("steel"), alloy("100Cr6"), hardness=900.0) == 3.0

    def test_unknown(self) -> None:
        with pytest.raises(InputError, match=r"alloy 'Ti-6Al-4W': unknown; did you mean 'Ti-6Al"):
            alloy("Ti-6Al-4W")
        with pytest.raises(InputError, match=r"'wood': unknown; known are steel, tungsten_carb"):
            ball_sizes("wood")


class TestNames:
    """A design that names metals holds their numbers."""

    def test_numbers_of_each(self, tmp_path: Path) -> None:
        found = design(tmp_path).materials
        assert found.shot.restitution == (0.91, 1.5)
        assert found.wall.restitution == (0.91, 0.44)
        assert found.sonotrode.restitution == (0.91, 1.1)
        assert found.part.restitution == (0.91, 0.079)
        assert found.part.hardness_HB == 146.0
        assert found.part.hardens_strongly

    def test_other_numbers_beside_a_name(self, tmp_path: Path) -> None:
        table = '{ alloy = "ti64", hardness_HB = 360, v0_m_s = 1.2 }'
        part = design(tmp_path, ('"316L"', table)).materials.part
        assert (part.alloy, part.hardness_HB, part.yield_MPa) == ("Ti-6Al-4V", 360.0, 880.0)
        assert part.restitution == (0.91, 1.2)
        part = design(tmp_path, ('"316L"', table.replace(", v0_m_s = 1.2", ""))).materials.part
        assert part.v0_m_s == pytest.approx(1.1 * (360 / 334) ** 2.5, rel=0.05)

    def test_what_is_saved_does_not_depend_on_the_catalogue(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        whole = design(tmp_path)
        save_design(whole, tmp_path / "saved.toml")
        for place in ("catalogue", "named_metals"):
            monkeypatch.setattr(f"chamberopt.design.materials.{place}.alloys", tuple)
        assert load_design(tmp_path / "saved.toml") == whole
        assert whole.changed({"chamber.height_mm": 41.0}).materials == whole.materials

    def test_another_ball_dents_at_another_speed(self, tmp_path: Path) -> None:
        steel = design(tmp_path)
        found = steel.changed({"shot.material": "ZrO2"})
        named = design(tmp_path, ('"steel"', '"zirconia"'))
        assert found == named
        assert found.materials.shot.v0_m_s == 8.0
        assert found.materials.part.v0_m_s == 0.09
        assert found.changed({"shot.material": "steel"}) == steel

    def test_a_calibrated_law_is_no_longer_the_catalogues(self, tmp_path: Path) -> None:
        law = scaled_restitution(design(tmp_path).materials.wall, 1.0, 2.0)
        assert (law.v0_m_s, law.v0_for) == (0.88, None)

    @pytest.mark.parametrize(
        ("old", "new", "said"),
        [
            ('"316L"', '"316LN"', "materials.part: given '316LN': unknown; did you mean '316L'"),
            ('"316L"', '{ alloy = "316M" }', "materials.part.alloy: given '316M': unknown; did"),
            ("wall =", 'shot = "zirconia"\nwall =', "materials.shot: given 'zirconia': it is not"),
            ('"steel"', '"glass"', "materials.part.C0: missing; give C0, or e_at_m_s for a table "
             "(the catalogue gives both only for a shot.material with a known hardness"),
            ('"steel"', '"stell"', "did you mean 'steel'"),
            ('"Ti-6Al-4V"', "{ C0 = 0.9, v0_m_s = 1, hardness_HB = 9 }", "given without alloy"),
        ],
    )  # fmt: skip
    def test_mistakes(self, tmp_path: Path, old: str, new: str, said: str) -> None:
        with pytest.raises(InputError) as caught:
            design(tmp_path, (old, new))
        assert said in str(caught.value)

    def test_balls_that_are_no_name_are_one_mistake(self, tmp_path: Path) -> None:
        with pytest.raises(InputError) as caught:
            design(tmp_path, ('"steel"', "7800"))
        (line,) = str(caught.value).splitlines()
        assert "shot.material: given 7800" in line


def test_the_catalogue_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["materials"]) == 0
    printed = capsys.readouterr().out
    assert all(one.name in printed for one in alloys())
    by_heart = sum(one.kind == "by heart" for one in alloys())
    counts = printed.partition(f"\n{len(alloys())} rows: ")[2].partition("Ti-6Al-4V")[0]
    assert f"{by_heart} by heart, not verified" in " ".join(counts.split())
    # an address can be copied in one piece
    addresses = [word for one in alloys() for word in one.source.split() if "/" in word]
    assert len(addresses) > 20
    assert all(address in printed for address in addresses)
    assert main(["shot", "WC", "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["balls"]
    assert row["name"] == "tungsten_carbide"
    assert row["v0_m_s"] == 1.1
    assert main(["shot"]) == 0
    printed = capsys.readouterr().out
    assert "0.4, 0.5, 0.6" in printed
    assert "G40 G100 G200  data sheet" in printed
    assert f"\n{len(balls())} rows: " in printed
    assert main(["shot", "glass"]) == 0
    assert "rows: " not in capsys.readouterr().out
    assert main(["materials", "Ti65"]) == 2
    assert "did you mean 'Ti64'?" in capsys.readouterr().err


class TestFriction:
    """Friction and slopes that a design does not give are the catalogue's."""

    def test_each_pair_lies_in_its_range_and_says_how_sure_it_is(self) -> None:
        names = {one.name for one in balls()} | {"any"}
        metals = {one.metal for one in alloys()} | {"any", "balls"}
        for one in friction_pairs():
            low, high = one.mu_range
            assert 0.0 < low <= one.mu <= high
            assert one.ball in names
            assert one.metal in metals
            assert one.sure
            assert one.source
        for face in treatments():
            low, high = face.slope_range
            assert low <= face.slope_deg <= high
            assert face.source

    def test_the_default_is_that_of_the_metals(self, tmp_path: Path) -> None:
        effects = design(tmp_path).effects
        assert effects.friction is not None
        part, sonotrode, wall = effects.friction.surfaces
        pairs = {(one.ball, one.metal): one for one in friction_pairs()}
        assert part == wall == (pairs["steel", "steel"].mu, pairs["steel", "steel"].beta0)
        assert sonotrode[0] == pairs["steel", "titanium"].mu
        assert effects.roughness is not None
        assert effects.roughness.slope_deg == treatments()[0].slope_deg

    def test_other_metals_have_other_friction_and_given_numbers_stay(self, tmp_path: Path) -> None:
        one = design(tmp_path)
        titanium = one.changed({"materials.part": "Ti-6Al-4V"}).effects.friction
        assert titanium is not None
        assert titanium.mu_part == titanium.mu_sonotrode
        mine = one.changed({"effects.friction.mu": 0.15})
        assert mine.effects.friction is not None
        assert mine.effects.friction.mu == 0.15
        own = {"mu": 0.1, "beta0": 0.0}
        kept = one.changed({"effects.friction": own}).changed({"materials.part": "Ti-6Al-4V"})
        assert kept.effects.friction is not None
        assert kept.effects.friction.mu_part is None

    def test_none_is_none_also_in_its_file(self, tmp_path: Path) -> None:
        change = ("[process]", '[effects]\nfriction = "none"\n[process]')
        smooth = design(tmp_path, change)
        assert (smooth.effects.friction, smooth.effects.roughness) == (None, None)
        for one in (smooth, smooth.changed({"effects.friction": "catalogue"})):
            save_design(one, tmp_path / "saved.toml")
            assert load_design(tmp_path / "saved.toml") == one
        only_rough = design(
            tmp_path, (change[0], change[1].replace("none", 'none"\nroughness = "ground'))
        )
        assert only_rough.effects.roughness is not None
        assert only_rough.effects.roughness.slope_deg == 1.0

    def test_a_result_of_before_was_simulated_without(self, tmp_path: Path) -> None:
        data = design(tmp_path).model_dump()
        data["effects"] = {"gravity": True}
        effects = validate(Design, data, recorded=True).effects
        assert (effects.friction, effects.roughness) == (None, None)

    @pytest.mark.parametrize("key", ["friction", "roughness"])
    def test_an_unknown_word_is_refused_with_those_allowed(self, tmp_path: Path, key: str) -> None:
        change = ("[process]", f'[effects]\n{key} = "smooth"\n[process]')
        with pytest.raises(
            InputError, match=rf"effects\.{key}: given 'smooth'; allowed: .*\"none\""
        ):
            design(tmp_path, change)


def test_a_name_without_its_temper_is_answered_with_those_that_have_one() -> None:
    with pytest.raises(InputError, match=r"did you mean 'Ti-6Al-4V' or .*'Ti-6242'"):
        alloy("ti6")
    with pytest.raises(InputError, match=r"did you mean '7075-T6' or .*'7075-T7351'"):
        alloy("7075")

"""Design and study files: units, bounds, cross-checks, and messages that name the remedy."""

import math
import shutil
import typing
from pathlib import Path

import numpy as np
import pytest

from chamberopt.common import toml_errors
from chamberopt.common.errors import InputError
from chamberopt.design.load import Design, load_design, save_design
from chamberopt.search.study import Limits, Study, load, load_study
from chamberopt.search.study.schema import Algorithm

ROOT = Path(__file__).resolve().parents[3]
DESIGNS = sorted((ROOT / "designs").glob("*.toml"))
STUDIES = sorted((ROOT / "studies").glob("*.toml"))
UNSET = (
    "sonotrode.amplitude_pv_um",
    "sonotrode.amplitude_profile.middle_mm.0",
    "sonotrode.amplitude_profile.middle_mm.1",
    "shot.density_kg_m3",
    "process.accuracy.objective_half_width",
    "part.target.element_mm",
    "part.target.beside_mm",
    "part.smoothing.tolerance_mm",
    "materials.part.yield_MPa",
    "materials.part.tensile_MPa",
    "materials.wall.hardness_HB",
    "materials.sonotrode.hardness_HB",
    *(f"effects.friction.mu_{name}" for name in ("part", "sonotrode", "wall", "balls")),
    "effects.friction.beta0_balls",
    *(f"effects.roughness.{name}_deg" for name in ("part", "sonotrode", "wall")),
    *(f"materials.{name}.exponent" for name in ("shot", "wall", "sonotrode", "part")),
)  # numbers that a design need not have
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
mass_g = 3.308
diameter_mm = 3
material = "steel"
[materials]
shot = { C0 = 0.9, v0_m_s = 1.5 }
wall = { C0 = 0.8, v0_m_s = 0.4 }
sonotrode = { C0 = 0.7, v0_m_s = 1.1 }
part = { C0 = 0.6, v0_m_s = 0.2, hardness_HB = 120 }
[process]
treatment_time_s = 50
"""


@pytest.fixture
def design_file(tmp_path: Path) -> Path:
    (tmp_path / "part.stl").touch()
    path = tmp_path / "design.toml"
    path.write_text(TABLES, encoding="utf-8")
    return path


@pytest.fixture
def design(design_file: Path) -> Design:
    return load_design(design_file)


def edited(path: Path, *changes: tuple[str, str]) -> str:
    """What the door says of a file with these replacements."""
    text = path.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load(path)
    return str(caught.value)


class TestUnits:
    """A file in mm, g, um, kHz, HB; a design in SI."""

    def test_lengths_masses_and_speeds_are_si(self, design: Design) -> None:
        assert design.chamber.height == pytest.approx(0.040)
        assert design.chamber.sonotrode_distance == pytest.approx(0.015)
        assert design.chamber.diameter == pytest.approx(0.050)
        assert design.sonotrode.frequency == pytest.approx(20_000)
        assert design.sonotrode.amplitude == pytest.approx(25e-6)
        assert design.shot.diameter == pytest.approx(0.003)
        assert design.shot.mass == pytest.approx(3.308e-3)
        assert design.process.treatment_time == 50.0

    def test_amplitude_is_zero_to_peak(self, design: Design) -> None:
        # physics: 25 um at 20 kHz is 3.14 m/s
        assert design.sonotrode.peak_speed == pytest.approx(3.14, abs=0.005)

    def test_thirty_balls_of_the_paper(self, design: Design) -> None:
        assert design.shot.count == 30
        assert design.shot.ball_mass == pytest.approx(7800 * math.pi / 6 * 0.003**3)

    def test_brinell_in_pascal(self, design: Design) -> None:
        assert design.materials.part.hardness == pytest.approx(9.81e6 * 120)
        assert design.materials.part.restitution == (0.6, 0.2)
        assert design.materials.part.yield_speed == 0.2

    def test_at_least_one_ball(self, design: Design) -> None:
        assert design.changed({"shot.mass_g": 0.01}).shot.count == 1

    def test_own_density(self, design_file: Path) -> None:
        design_file.write_text(
            TABLES.replace('material = "steel"', "density_kg_m3 = 3850"), encoding="utf-8"
        )
        assert load_design(design_file).shot.density == 3850.0

    def test_laws_of_restitution(self, design_file: Path) -> None:
        text = TABLES
        for old, new in {
            "shot = { C0 = 0.9, v0_m_s = 1.5": "shot = { C0 = 0.9, v0_m_s = 1.5, exponent = 0.2",
            "wall = { C0 = 0.8, v0_m_s = 0.4": "wall = { C0 = 0.8, exponent = 0",
            "C0 = 0.6, v0_m_s = 0.2": "e_at_m_s = [[0, 1], [2, 0.5]], v0_m_s = 0.2",
        }.items():
            assert old in text
            text = text.replace(old, new)
        design_file.write_text(text, encoding="utf-8")
        design = load_design(design_file)
        materials = design.materials
        assert materials.shot.restitution == (0.9, 1.5, 0.2)
        assert materials.sonotrode.restitution == (0.7, 1.1)
        assert materials.wall.restitution[0::2] == (0.8, 0.0)  # whatever v0 is
        assert materials.part.restitution == ((0.0, 2.0), (1.0, 0.5))
        assert materials.part.yield_speed == 0.2
        other = design.changed({"materials.part.e_at_m_s.1.1": 0.4, "materials.shot.exponent": 0})
        assert other.materials.part.restitution == ((0.0, 2.0), (1.0, 0.4))
        assert other.materials.shot.restitution == (0.9, 1.5, 0.0)
        save_design(other, design_file.with_name("again.toml"))
        assert load_design(design_file.with_name("again.toml")) == other

    def test_mesh_counts_from_the_file(self, design: Design, design_file: Path) -> None:
        assert design.part.mesh_path == design_file.resolve().parent / "part.stl"


class TestNumbers:
    """Reading and changing numbers by dotted name."""

    def test_value(self, design: Design) -> None:
        assert design.value("chamber.height_mm") == 40.0
        assert design.value("materials.part.hardness_HB") == 120.0
        assert design.value("part.offset_mm.1") == 0.0

    def test_changed_leaves_the_first_alone(self, design: Design) -> None:
        other = design.changed({"chamber.height_mm": np.float64(42.5), "part.offset_mm.1": 2})
        assert (other.chamber.height_mm, other.part.offset_mm) == (42.5, (0.0, 2.0))
        assert (design.chamber.height_mm, design.part.offset_mm) == (40.0, (0.0, 0.0))
        assert other.part.mesh_path == design.part.mesh_path

    def test_same_values_same_design(self, design: Design) -> None:
        assert design.changed({"chamber.height_mm": 40.0}) == design

    def test_whole_numbers_stay_whole(self, design: Design) -> None:
        assert design.changed({"process.seed": 3.0}).process.seed == 3
        with pytest.raises(
            InputError, match=r"facets: given 44.5; allowed: a whole number from 8 to 1024"
        ):
            design.changed({"chamber.facets": 44.5})

    def test_out_of_range(self, design: Design) -> None:
        with pytest.raises(
            InputError, match=r"chamber.height_mm: given 1.0; allowed: a number from 2 to 2000 mm"
        ):
            design.changed({"chamber.height_mm": 1.0})

    def test_not_a_number(self, design: Design) -> None:
        with pytest.raises(InputError, match=r"chamber.height_mm: given nan"):
            design.changed({"chamber.height_mm": math.nan})

    def test_misspelt(self, design: Design) -> None:
        with pytest.raises(InputError, match=r"did you mean 'chamber.height_mm'"):
            design.value("chamber.heigth_mm")

    def test_unset(self, design: Design) -> None:
        with pytest.raises(InputError, match=r"shot.density_kg_m3: not set in this design"):
            design.value("shot.density_kg_m3")
        with pytest.raises(InputError, match=r"effects.part_turn.rpm: not set in this design"):
            design.changed({"effects.part_turn.rpm": 30})
        with pytest.raises(InputError, match=r"density_kg_m3: given 4000 beside material"):
            design.changed({"shot.density_kg_m3": 4000.0})

    def test_what_is_not_a_number_can_be_changed(self, design: Design) -> None:
        other = design.changed(
            {
                "shot.material": None,
                "shot.density_kg_m3": np.int64(4000),
                "sonotrode.motion": "random_phase",
                "effects.part_turn": {"rpm": 30.0},
            }
        )
        assert other.shot.density == 4000.0
        assert other.sonotrode.motion == "random_phase"
        assert other.effects.part_turn is not None
        assert other.changed({"effects.part_turn.rpm": 20}).effects.part_turn.rpm == 20.0

    @pytest.mark.parametrize(
        ("name", "message"),
        [
            ("chamber.heigth_mm", "chamber.heigth_mm: unknown key; did you mean 'height_mm'"),
            ("chambre.height_mm", "chambre.height_mm: not a key of a design"),
            ("part.offset_mm.2", "part.offset_mm.2: not a key of a design"),
            ("chamber.height_mm.x", "chamber.height_mm.x: not a key of a design"),
        ],
    )
    def test_no_such_key(self, design: Design, name: str, message: str) -> None:
        with pytest.raises(InputError, match=message):
            design.changed({name: 40.0})

    def test_every_number_can_be_read_and_set(self, design: Design) -> None:
        absent = tuple(f"effects.{name}." for name, table in design.effects if table is None)
        absent += "holder.", "mask.", "sonotrode.face."
        for name in design.numbers():
            if name not in UNSET and not name.startswith(absent):
                assert design.changed({name: design.value(name)}) == design, name

    def test_an_amplitude_may_be_given_peak_to_valley(self, design_file: Path) -> None:
        plain = load_design(design_file)
        text = design_file.read_text().replace("amplitude_um = 25", "amplitude_pv_um = 50")
        design_file.write_text(text)
        design = load_design(design_file)
        assert design.sonotrode.amplitude == plain.sonotrode.amplitude == pytest.approx(25e-6)
        assert design.sonotrode.peak_speed == plain.sonotrode.peak_speed
        assert design.value("sonotrode.amplitude_pv_um") == 50.0
        louder = design.changed({"sonotrode.amplitude_pv_um": 60.0})
        assert louder.sonotrode.amplitude == pytest.approx(30e-6)
        save_design(louder, design_file)
        assert load_design(design_file) == louder
        with pytest.raises(InputError, match=r"sonotrode\.amplitude_um: not set in this design"):
            design.value("sonotrode.amplitude_um")
        with pytest.raises(InputError, match=r"amplitude_pv_um: given beside amplitude_um = 30"):
            design.changed({"sonotrode.amplitude_um": 30.0})
        with pytest.raises(
            InputError, match=r"amplitude_um: missing; give it \(zero-to-peak\), or"
        ):
            design.changed({"sonotrode.amplitude_pv_um": None})

    def test_frozen(self, design: Design) -> None:
        with pytest.raises(ValueError, match="frozen"):
            design.chamber.height_mm = 3.0  # type: ignore[misc]


class TestRoundTrip:
    """What is saved loads back as the very same design, wherever it is saved."""

    @pytest.mark.parametrize("path", DESIGNS, ids=lambda path: path.stem)
    def test_shipped_designs(self, path: Path, tmp_path: Path) -> None:
        design = load_design(path)
        save_design(design, tmp_path / "copy.toml")
        assert load_design(tmp_path / "copy.toml") == design

    def test_awkward_numbers(self, design: Design, tmp_path: Path) -> None:
        values = {
            "chamber.height_mm": 40.1 + 0.2,
            "shot.mass_g": 10 / 3,
            "materials.wall.v0_m_s": 1.1e-4,
        }
        other = design.changed(values)
        save_design(other, tmp_path / "awkward.toml")
        assert load_design(tmp_path / "awkward.toml") == other

    def test_awkward_names(self, design_file: Path) -> None:
        """A line separator and what looks like the end of a list, in the name of a file."""
        name = "a = [ b, ] \u2028.stl"
        design_file.with_name("part.stl").rename(design_file.with_name(name))
        text = design_file.read_text(encoding="utf-8").replace("part.stl", name)
        design_file.write_text(text, encoding="utf-8")
        design = load_design(design_file)
        save_design(design, design_file.with_name("again.toml"))
        assert load_design(design_file.with_name("again.toml")) == design

    def test_mesh_path_is_rewritten_relative(self, design: Design, tmp_path: Path) -> None:
        (tmp_path / "deep" / "er").mkdir(parents=True)
        save_design(design, tmp_path / "deep" / "er" / "d.toml")
        text = (tmp_path / "deep" / "er" / "d.toml").read_text(encoding="utf-8")
        assert 'mesh = "../../part.stl"' in text
        assert text.startswith("#")
        shutil.copytree(tmp_path, moved := tmp_path.parent / "moved", dirs_exist_ok=True)
        assert (
            load_design(moved / "deep" / "er" / "d.toml").part.mesh_path
            == moved.resolve() / "part.stl"
        )


class TestShipped:
    @pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.stem)
    def test_studies_load(self, path: Path) -> None:
        study = load_study(path)
        assert len(study.vary) >= 2

    @pytest.mark.parametrize("path", DESIGNS, ids=lambda path: path.stem)
    def test_yield_speeds_follow_the_formula_they_quote(self, path: Path) -> None:
        """v_Y² = 26 (Y/E*)⁴ Y/rho (Johnson), half of it for two balls; v0 = v_Y (1.18 / C0)⁴."""
        elastic = {"steel": (210e9, 0.30), "aluminium": (70e9, 0.33), "titanium": (114e9, 0.34)}
        part = {"gear": ("steel", 300), "plate": ("aluminium", 120), "blade": ("titanium", 330)}[
            path.stem.partition("_")[0]
        ]
        pairs = {
            "shot": ("steel", 650),
            "wall": ("steel", 300),
            "sonotrode": ("titanium", 330),
            "part": part,
        }
        design = load_design(path)
        for name, (metal, brinell) in pairs.items():
            bodies = (elastic["steel"], elastic[metal])
            stiffness = 1 / sum((1 - nu**2) / young for young, nu in bodies)
            strength = 9.81e6 * brinell / 2.8
            speed = math.sqrt(26 * (strength / stiffness) ** 4 * strength / 7800)
            speed *= 0.5 if name == "shot" else 1.0
            law = getattr(design.materials, name)
            assert law.v0_m_s == pytest.approx(speed * (1.18 / law.C0) ** 4, rel=0.03), name


class TestWrongDesigns:
    """Each message: file, line, field, what was given, what is allowed."""

    def test_all_at_once_with_their_lines(self, design_file: Path) -> None:
        said = edited(
            design_file,
            ("height_mm = 40", "heigth_mm = 40"),
            ('"mm"', '"mmm"'),
            ("mass_g = 3.308", "mass_g = -1"),
        ).splitlines()
        assert said == [
            f'{design_file}:4: part.unit: given \'mmm\'; allowed: "um", "mm", "cm", "m", "in", '
            '"guess" '
            "(of the numbers in the mesh file); did you mean 'mm'?",
            f"{design_file}:5: chamber.height_mm: missing; give a number from 2 to 2000 mm "
            "(inner height, sonotrode to ceiling)",
            f"{design_file}:7: chamber.heigth_mm: unknown key; did you mean 'height_mm'?",
            f"{design_file}:14: shot.mass_g: given -1; allowed: a number from 0.0001 to 10000 g "
            "(of all balls together)",
        ]

    def test_key_in_the_wrong_table(self, design_file: Path) -> None:
        said = edited(design_file, ("amplitude_um = 25", "amplitude_um = 25\ndiameter_mm = 3"))
        assert (
            "sonotrode.diameter_mm: unknown key here; did you mean 'diameter_mm' in [chamber]?"
            in said
        )

    def test_key_that_stands_above_all_tables(self, design_file: Path) -> None:
        said = edited(design_file, ("amplitude_um = 25", 'amplitude_um = 25\neffects = "auto"'))
        assert (
            "sonotrode.effects: unknown key here; did you mean 'effects' above the first [table]?"
            in said
        )

    @pytest.mark.parametrize("given", ['"Auto"', "true", '["auto"]', "3"])
    def test_effects_that_are_no_table(self, design_file: Path, given: str) -> None:
        source = "effects = " + given + "\n" + design_file.read_text().split("[effects]")[0]
        design_file.write_text(source)
        with pytest.raises(InputError) as error:
            load_design(design_file)
        assert ":1: effects: given " in str(error.value)
        assert 'allowed: "auto", or a table' in str(error.value)

    def test_a_bound_without_a_unit(self, design_file: Path) -> None:
        said = edited(
            design_file, ("[process]", "[process.accuracy]\nobjective_half_width = 2\n[process]")
        )
        assert "a number from 0.0001 to 0.5 (wanted" in said

    @pytest.mark.parametrize(
        ("former", "name"),
        [
            ("coverage = 0.01", "objective_half_width"),
            ("most_replicas = 100", "max_replicas"),
            ("drag_piece_ms = 5", "drag_step_ms"),
        ],
    )
    def test_a_former_name(self, design_file: Path, former: str, name: str) -> None:
        said = edited(design_file, ("[process]", f"[process.accuracy]\n{former}\n[process]"))
        key = former.split()[0]
        assert f"process.accuracy.{key}: is now called '{name}'; rename it" in said

    @pytest.mark.parametrize("former", ['coverage_model = "dents"', "sample_mm = 0.2"])
    def test_a_removed_key(self, design_file: Path, former: str) -> None:
        said = edited(design_file, ("[process]", f"[process.accuracy]\n{former}\n[process]"))
        text = "coverage is measured in windows of process.accuracy.gauge_mm2; leave it out"
        assert f"process.accuracy.{former.split()[0]}: {text}" in said

    @pytest.mark.parametrize("given", ["0", "-1", "1e5"])
    def test_a_gauge_out_of_its_bounds(self, design_file: Path, given: str) -> None:
        table = f"[process.accuracy]\ngauge_mm2 = {given}\n[process]"
        said = edited(design_file, ("[process]", table))
        assert "process.accuracy.gauge_mm2: given" in said
        assert "from 0.0001 to 10000 mm²" in said

    def test_true_is_not_a_number(self, design_file: Path) -> None:
        assert "height_mm: given true; allowed: a number" in edited(
            design_file, ("_mm = 40", "_mm = true")
        )

    def test_infinite(self, design_file: Path) -> None:
        assert "height_mm: given inf" in edited(design_file, ("_mm = 40", "_mm = inf"))

    def test_quoted_number(self, design_file: Path) -> None:
        assert "write it without quotes" in edited(design_file, ("_mm = 40", '_mm = "40"'))

    def test_table_given_as_a_number(self, design_file: Path) -> None:
        said = edited(
            design_file, ("part = { C0 = 0.6, v0_m_s = 0.2, hardness_HB = 120 }", "part = 0.6")
        )
        assert "materials.part: given 0.6; allowed: a table" in said

    @pytest.mark.parametrize(
        ("law", "said"),
        [
            ("v0_m_s = 0.4", "C0: missing; give C0, or e_at_m_s for a table"),
            ("C0 = 0.8", "v0_m_s: missing; give the speed above which e falls, or exponent = 0"),
            ("C0 = 0.8, v0_m_s = 0.4, exponent = -1", "exponent: given -1; allowed: a number from"),
            ("C0 = 1.1, v0_m_s = 0.4", "C0: given 1.1"),
            ("C0 = 0.8, e_at_m_s = [[1, 0.9]]", "C0: given beside e_at_m_s, the whole law"),
            ("exponent = 0, e_at_m_s = [[1, 0.9]]", "exponent: given beside e_at_m_s"),
            ("v0_m_s = 1, e_at_m_s = [[1, 0.9]]", "v0_m_s: given beside e_at_m_s"),
            ("e_at_m_s = []", "e_at_m_s: given an empty list; allowed: pairs [v in m/s, e]"),
            ("e_at_m_s = [[1, 0.9, 2]]", "e_at_m_s.0: given [1, 0.9, 2]; allowed: pairs"),
            ("e_at_m_s = [[1, 0.9], [2, 1.2]]", "e_at_m_s.1.1: given 1.2; allowed: e from 0 to 1"),
            ("e_at_m_s = [[-1, 0.9]]", "e_at_m_s.0.0: given -1; allowed: 0 to 1000 m/s"),
            ("e_at_m_s = [[2, 0.9], [1, 0.8]]", "e_at_m_s.1.0: given 1 after 2 m/s; give each"),
            ("e_at_m_s = [[2, 0.9], [2, 0.8]]", "e_at_m_s.1.0: given 2 after 2 m/s; give each"),
        ],
    )
    def test_a_bad_law_of_restitution(self, design_file: Path, law: str, said: str) -> None:
        found = edited(design_file, ("wall = { C0 = 0.8, v0_m_s = 0.4 }", f"wall = {{ {law} }}"))
        assert f"materials.wall.{said}" in found

    @pytest.mark.parametrize("law", ["C0 = 0.6, exponent = 0", "e_at_m_s = [[1, 0.9]]"])
    def test_a_part_that_does_not_say_where_dents_begin(self, design_file: Path, law: str) -> None:
        said = edited(design_file, ("C0 = 0.6, v0_m_s = 0.2", law))
        lacking = "give the speed below which the part is not dented"
        assert f"materials.part.v0_m_s: missing; {lacking}" in said

    def test_no_density_and_two_densities(self, design_file: Path) -> None:
        said = edited(
            design_file, ('material = "steel"', 'material = "steel"\ndensity_kg_m3 = 7800')
        )
        assert "shot.density_kg_m3: given 7800 beside material = 'steel'; keep one" in said
        said = edited(design_file, ('material = "steel"\ndensity_kg_m3 = 7800', ""))
        assert "shot.material: missing; give material (one of" in said

    def test_a_mix_of_sizes(self, design_file: Path) -> None:
        mix = "mix = [{ diameter_mm = 2, share = 0.25 }, { diameter_mm = 3, share = 0.75 }]"
        design_file.write_text(TABLES.replace("diameter_mm = 3\n", mix + "\n"), encoding="utf-8")
        shot = load_design(design_file).shot
        small, large = (7800 * math.pi / 6 * d**3 for d in (0.002, 0.003))
        assert shot.sizes == (
            (0.002, round(0.25 * 3.308e-3 / small)),
            (0.003, round(0.75 * 3.308e-3 / large)),
        )
        assert shot.count == len(shot.diameters) == 25 + 22
        assert shot.count * shot.ball_mass == pytest.approx(25 * small + 22 * large)
        assert shot.diameter == 0.003
        assert "shot.diameter_mm" in load_design(design_file).numbers()
        assert (
            load_design(design_file).changed({"shot.mix.1.diameter_mm": 4.0}).shot.diameter == 0.004
        )
        with pytest.raises(InputError, match=r"shot\.diameter_mm: given 2 beside mix"):
            load_design(design_file).changed({"shot.diameter_mm": 2.0})
        again = design_file.with_name("again.toml")
        save_design(load_design(design_file), again)
        assert load_design(again) == load_design(design_file)
        assert load_design(design_file).changed({"shot.mass_g": 4.0}).shot.mix == shot.mix
        effects = {"effects.rest": True, "effects.part_turn": {"rpm": 30.0}}
        assert load_design(design_file).changed(effects).effects.rest

    @pytest.mark.parametrize(
        ("mix", "said"),
        [
            (
                "",
                "shot.diameter_mm: missing; a number from 0.1 to 20 mm (of one ball), or several "
                "sizes: mix",
            ),
            ("diameter_mm = 3\nmix = [[2, 0.5], [3, 0.5]]", "shot.mix"),
            ("diameter_mm = 3\nMIX", "shot.diameter_mm: given 3 beside mix"),
            (
                "mix = [{ diameter_mm = 3, share = 1.0 }]",
                "shot.mix: given 1 sizes; allowed: 2 to 8",
            ),
            (
                "mix = [{ diameter_mm = 3, share = 0.5 }, { diameter_mm = 3, share = 0.5 }]",
                "one diameter_mm twice",
            ),
            (
                "mix = [{ diameter_mm = 3, share = 0.5 }, { diameter_mm = 2, share = 0.4 }]",
                "add up to 0.9",
            ),
            (
                "mix = [{ diameter_mm = 3, share = 0.5 }, { diameter_mm = 16, share = 0.5 }]",
                "shot.mix: given 16",
            ),
        ],
        ids=lambda text: text[:30],
    )
    def test_a_mix_that_is_wrong(self, design_file: Path, mix: str, said: str) -> None:
        fine = "mix = [{ diameter_mm = 2, share = 0.5 }, { diameter_mm = 3, share = 0.5 }]\n"
        shot = mix.replace("MIX", fine)
        design_file.write_text(TABLES.replace("diameter_mm = 3\n", shot + "\n"), encoding="utf-8")
        assert said in edited(design_file)

    @pytest.mark.parametrize(
        ("change", "said"),
        [
            (("distance_mm = 15", "distance_mm = 45"), "not below chamber.height_mm = 40"),
            (("distance_mm = 15", "distance_mm = 2"), "no ball fits under the part"),
            (("amplitude_um = 25", "amplitude_um = 500\n[effects]\n"), None),
            (
                ("amplitude_um = 25", "amplitude_um = 25\n[effects]\ngravity = false\nrest = true"),
                "effects.rest: given true",
            ),
            (
                (
                    "amplitude_um = 25",
                    "amplitude_um = 25\n[effects]\nfriction = { mu = -0.1, beta0 = 0.2 }",
                ),
                "effects.friction.mu: given -0.1; allowed: a number from 0 to 10",
            ),
            (
                ("amplitude_um = 25", "amplitude_um = 25\n[effects]\nfriction = { mu = 0.3 }"),
                "effects.friction.beta0: missing",
            ),
            (
                ("amplitude_um = 25", "amplitude_um = 25\n[effects]\nfriction = 0.3"),
                "effects.friction: given 0.3",
            ),
            (("mass_g = 3.308", "mass_g = 400"), "fill 65% of the chamber; at most 50 %"),
            (
                ("diameter_mm = 50", "diameter_mm = 2.5"),
                "does not fit a chamber with chamber.diameter_mm = 2.5",
            ),
        ],
    )
    def test_contradictions(
        self, design_file: Path, change: tuple[str, str], said: str | None
    ) -> None:
        if said is None:  # ten amplitudes of 500 um are 5 mm, within 15: allowed
            design_file.write_text(TABLES.replace(*change), encoding="utf-8")
            load_design(design_file)
        else:
            assert said in edited(design_file, change)

    @pytest.mark.parametrize(
        ("target", "said"),
        [
            ("direction = [0, 0, 1]", "part.target.direction: given without angle_deg"),
            ("angle_deg = [0, 10]", "part.target.angle_deg: given without direction"),
            ("direction = [0, 0, 0]\nangle_deg = [0, 10]", "points nowhere"),
            ("direction = [0, 0, 1]\nangle_deg = [20, 10]", "given [20.0, 10.0]; allowed"),
            ("direction = [0, 1]\nangle_deg = [0, 10]", "too short; allowed: three numbers"),
            ('direction = [0, 1, "up"]\nangle_deg = [0, 10]', "given 'up'"),
            ("box_mm = [[0, 0, 0], [1, 1, -1]]", "each low corner must be below"),
            ("box_mm = [0, 0, 0]", "two corners"),
        ],
    )
    def test_targets(self, design_file: Path, target: str, said: str) -> None:
        assert said in edited(design_file, ("[chamber]", f"[part.target]\n{target}\n[chamber]"))

    def test_missing_mesh_names_its_neighbours(self, design_file: Path) -> None:
        said = edited(design_file, ("part.stl", "prat.stl"), ("height_mm = 40", "height_mm = 0"))
        assert (
            f":3: part.mesh: given 'prat.stl': {design_file.parent.resolve() / 'prat.stl'}: no "
            "such mesh file" in said
        )
        assert "did you mean" in said
        assert "height_mm: given 0" in said


class TestStudies:
    @pytest.fixture
    def study_file(self, design_file: Path) -> Path:
        path = design_file.with_name("study.toml")
        path.write_text(
            'design = "design.toml"\n[vary]\n"chamber.height_mm" = [35, 60]\n', encoding="utf-8"
        )
        return path

    def test_defaults(self, study_file: Path) -> None:
        study = load_study(study_file)
        assert study.vary["chamber.height_mm"].bounds == (35.0, 60.0)
        assert study.objective.name == "uniform_coverage"
        assert (study.optimizer.algorithm, study.optimizer.evaluations) == ("auto", 40)
        assert isinstance(load(study_file), Study)
        assert isinstance(load(study_file.with_name("design.toml")), Design)

    @pytest.mark.parametrize(
        "written",
        [
            '[vary]\n"chamber.height_mm" = [35, 60]\n"shot.mass_g" = [2, 5]',
            "[vary]\nchamber.height_mm = [35, 60]\nshot.mass_g = [2, 5]",
            "[vary.chamber]\nheight_mm = [35, 60]\n[vary.shot]\nmass_g = [2, 5]",
            "[vary]\nchamber = { height_mm = [35, 60] }\nshot = { mass_g = [2, 5] }",
        ],
    )
    def test_ways_to_write_a_name(self, study_file: Path, written: str) -> None:
        study_file.write_text(f'design = "design.toml"\n{written}\n', encoding="utf-8")
        vary = load_study(study_file).vary
        assert {name: one.bounds for name, one in vary.items()} == {
            "chamber.height_mm": (35.0, 60.0),
            "shot.mass_g": (2.0, 5.0),
        }

    def test_constraints(self, study_file: Path) -> None:
        with study_file.open("a", encoding="utf-8") as file:
            file.write(
                "[constraints]\nmean_coverage = { min = 0.9 }\nshot_count = { min = 5, max = 60 }\n"
            )
        constraints = load_study(study_file).constraints
        assert constraints["mean_coverage"] == Limits(min=0.9)
        assert (constraints["shot_count"].min, constraints["shot_count"].max) == (5.0, 60.0)

    @pytest.mark.parametrize(
        ("change", "said"),
        [
            (
                ("height_mm", "heigth_mm"),
                ":3: vary.chamber.heigth_mm: unknown; did you mean 'chamber.height_mm'?",
            ),
            (
                ("chamber.height_mm", "shot.count"),
                "vary.shot.count: unknown; allowed: shot.mass_g, shot.diameter_mm, shot.density",
            ),
            (("[35, 60]", "[60, 35]"), "given [60, 35]; low must be below high"),
            (
                ("[35, 60]", "[42, 60]"),
                "the design starts at 40; widen the bounds or change the design",
            ),
            (("[35, 60]", "[10, 60]"), "the design cannot have chamber.height_mm = 10"),
            (("[35, 60]", "[35, 60, 70]"), "allowed: [low, high]"),
            (("[35, 60]", "35"), "allowed: [low, high]"),
            (("chamber.height_mm", "chamber.facets"), "a whole number cannot vary; leave it out"),
            (("chamber.height_mm", "shot.density_kg_m3"), "not set in this design"),
            (('"chamber.height_mm" = [35, 60]', ""), "vary"),
            (
                ("[vary]", "[constraints]\nmean_covrage = { min = 1 }\n[vary]"),
                "did you mean 'mean_coverage'?",
            ),
            (
                ("[vary]", "[constraints]\nmean_coverage = { minn = 1 }\n[vary]"),
                "did you mean 'min'?",
            ),
            (("[vary]", "[constraints]\nmean_coverage = {}\n[vary]"), "give min, max or both"),
            (
                ("[vary]", "[constraints]\nmean_coverage = { min = 1, max = 0 }\n[vary]"),
                "above max = 0",
            ),
            (
                ("[vary]", "[constraints]\nmean_coverage = { min = 1.1 }\n[vary]"),
                "mean_coverage: given min = 1.1, but it is from 0 to 1 in every candidate; change "
                "the limit",
            ),
            (
                ("[vary]", "[constraints]\ntime_to_98_s = { max = -1 }\n[vary]"),
                "given max = -1, but it is from 0 to",
            ),
            (
                ("[vary]", '[constraints]\n"chamber.height_mm" = { min = 61 }\n[vary]'),
                "given min = 61, but it is from 35 to 60 in every candidate; change the limit or "
                "[vary]",
            ),
            (
                ("[vary]", '[constraints]\n"shot.density_kg_m3" = { min = 61 }\n[vary]'),
                "constraints.shot.density_kg_m3: not set in this design",
            ),
            (
                ("[vary]", '[objective]\nsum = { shot_count = "a" }\n[vary]'),
                "given 'a'; allowed: { NAME = WEIGHT, ",
            ),
            (
                ("[vary]", '[optimizer]\nphases = "sobol"\n[vary]'),
                "allowed: a table [[optimizer.phases]] each",
            ),
            (
                ("[vary]", '[optimizer]\nalgorithm = "LN_BOBYQ"\n[vary]'),
                "did you mean 'LN_BOBYQA'?",
            ),
            (("[vary]", "[optimizer]\nevaluations = 1\n[vary]"), "allowed: a whole number from 2"),
            (("[vary]", '[objective]\nname = "coverage"\n[vary]'), '"uniform_coverage"'),
            (('design = "design.toml"', ""), "design: missing; give the path"),
            (('"design.toml"', '"desing.toml"'), "design.toml?"),
            (('"design.toml"', '"study.toml"'), "this is a study file"),
        ],
    )
    def test_wrong_studies(self, study_file: Path, change: tuple[str, str], said: str) -> None:
        assert said in edited(study_file, change)

    def test_one_fault_is_said_once(self, study_file: Path) -> None:
        said = edited(study_file, ("[vary]", "[search_accuracy]\nfacets = [1]\n[vary]"))
        assert (
            ":3: search_accuracy.facets: given [1]; allowed: a number or a text (while searching"
            in said
        )
        assert "\n" not in said

    def test_the_old_table_draft_names_its_new_name(self, study_file: Path) -> None:
        said = edited(study_file, ("[vary]", "[draft]\nfacets = 32\n[vary]"))
        assert ":2: draft: is now called 'search_accuracy'; rename it" in said

    def test_study_and_its_design_at_once(self, study_file: Path) -> None:
        design_file = study_file.with_name("design.toml")
        design_file.write_text(TABLES.replace("height_mm = 40", "height_mm = 0"), encoding="utf-8")
        said = edited(study_file, ("[vary]", "[optimizer]\nconfirm = 0\n[vary]"))
        assert f"{study_file}:1: design: given 'design.toml', which cannot be used:" in said
        assert f"{design_file}:7: chamber.height_mm: given 0" in said
        assert f"{study_file}:3: optimizer.confirm: given 0" in said

    def test_each_kind_of_file_where_the_other_is_wanted(self, study_file: Path) -> None:
        with pytest.raises(
            InputError, match="this is a study file; give the design file that it names"
        ):
            load_design(study_file)
        with pytest.raises(InputError, match="this is a design file; a study file is wanted"):
            load_study(study_file.with_name("design.toml"))

    def test_algorithms_are_those_that_nlopt_has(self) -> None:
        import nlopt

        ours = {"auto", "sobol", "surrogate"}
        assert ours < set(typing.get_args(Algorithm))
        unknown = [
            name
            for name in typing.get_args(Algorithm)
            if name not in ours and not hasattr(nlopt, name)
        ]
        assert not unknown

    def test_phases(self, study_file: Path) -> None:
        with study_file.open("a") as file:
            file.write(
                "[optimizer]\nphases = [{ algorithm = 'sobol', share = 0.3 }, { algorithm = "
                "'LN_BOBYQA' }]\n"
            )
        phases = load_study(study_file).optimizer.phases
        assert [(phase.algorithm, phase.share) for phase in phases] == [
            ("sobol", 0.3),
            ("LN_BOBYQA", 1.0),
        ]

    @pytest.mark.parametrize(
        ("table", "said"),
        [
            (
                '[optimizer]\nalgorithm = "LN_BOBYQA"\nphases = [{ algorithm = "sobol" }]',
                "give one of the two",
            ),
            ('[optimizer]\nphases = [{ algorithm = "auto" }]', "which has phases of its own"),
            (
                '[optimizer]\nphases = [{ algorithm = "sobol" }, { algorithm = "surrogate" }]',
                "add up to 1 or more",
            ),
            ("[optimizer]\nfirst_replicas = 2", "3 is the least"),
            ("[optimizer]\ninitial_step = 2", "initial_step"),
            ("[objective]\nsum = { coverage = 1 }", "not an objective or a metric"),
            ('[objective]\npareto = ["p05_coverage", "p05_coverage"]', "twice"),
            ('[constraints]\n"shot.mas_g" = { max = 3 }', "did you mean 'shot.mass_g'"),
        ],
    )
    def test_what_a_search_cannot_be_is_said(self, study_file: Path, table: str, said: str) -> None:
        study_file.write_text(study_file.read_text() + table + "\n")
        with pytest.raises(InputError, match=said):
            load_study(study_file)


def test_lines_of_keys() -> None:
    """The scan finds headers, dotted keys and quoted keys and ignores text that looks like keys."""
    source = '# a = 1\na = 1\n[t.u]\n"b.c" = 2\nd . e = 3 # x = 1\nlong = """\nnot = 1\n"""\n'
    source += "[ v ]\nw = [\n 1,\n]\n"
    assert toml_errors.key_lines(source) == {
        "a": 2, "t.u": 3, "t.u.b.c": 4, "t.u.d.e": 5, "t.u.long": 6, "v": 9, "v.w": 10,
    }  # fmt: skip


def test_a_wrong_number_in_a_list_is_one_problem(tmp_path: Path) -> None:
    text = (
        (ROOT / "designs" / "plate.toml")
        .read_text(encoding="utf-8")
        .replace("parts/", f"{ROOT}/designs/parts/")
    )
    chamber = 'shape = "revolve"\nprofile_mm = [[26, 0], [26, nan]]'
    for line in ('shape = "cylinder"\ndiameter_mm = 50', "height_mm = 20 "):
        text, chamber = text.replace(line, chamber), "#"
    (tmp_path / "d.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as error:
        load_design(tmp_path / "d.toml")
    assert len(str(error.value).splitlines()) == 1
    assert "chamber.profile_mm.1.1: given nan" in str(error.value)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ("".join(f"k{i} = 1\n" for i in range(20_000)), "and 19,990 more; put these right first"),
        (f"{'k' * 100_000} = 1", "kkk...: unknown key"),
        (
            "[tolerances]\n" + "".join(f'"shot.m{i}" = 1\n' for i in range(20_000)),
            "tolerances: has 20,000 names, at most 500 are allowed",
        ),
    ],
)
def test_the_first_ten_of_many_problems_are_told(wrong: str, told: str, tmp_path: Path) -> None:
    text = (ROOT / "designs" / "plate.toml").read_text()
    text = text.replace("parts/", f"{(ROOT / 'designs' / 'parts').as_posix()}/")
    path = tmp_path / "many.toml"
    path.write_text(f"{text}\n{wrong}")
    with pytest.raises(InputError) as found:
        load_design(path)
    message = str(found.value)
    assert told in message
    assert len(message.splitlines()) <= 11
    assert len(message) < 5_000

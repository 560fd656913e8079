"""The command line as a user meets it.

A wrong file gives one message on stderr and status 2, without a traceback.
"""

import io
import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

from chamberopt.cli import main
from chamberopt.common.progress import step
from tests.helpers.opengl import needs_opengl

ROOT = Path(__file__).resolve().parents[3]
NO_OPENGL = "chamberopt.pictures.subprocess_drawing.missing_opengl"


@dataclass(frozen=True)
class Wrong:
    """One mistake in a copy of the shipped gear design or study, and what must be said of it."""

    name: str
    change: tuple[str, str] | bytes
    said: tuple[str, ...]
    file: str = "designs/gear.toml"


STUDY = "studies/quickstart.toml"
WRONG = [
    Wrong("empty", b"", ("gear.toml", "empty", "copy of a shipped one")),
    Wrong("not utf-8", b'[part]\nmesh = "\xff"', ("not UTF-8", "byte 15", "save it as UTF-8")),
    Wrong("binary stl", b"solid\x00\x01\x02 = \x80", ("not UTF-8",)),
    Wrong("not toml", ("height_mm = 45", "height_mm : 45"), (":15", "not valid TOML", "column")),
    Wrong(
        "key given twice",
        ("height_mm = 45", "height_mm = 45\nheight_mm = 46"),
        ("not valid TOML", ":16"),
    ),
    Wrong(
        "misspelt key",
        ("height_mm = 45", "heigth_mm = 45"),
        (":15", "unknown key", "did you mean 'height_mm'"),
    ),
    Wrong("misspelt table", ("[sonotrode]", "[sonotrod]"), (":19", "did you mean 'sonotrode'")),
    Wrong(
        "effect not there yet",
        ("gravity = true", "wind = 0.3"),
        ("effects.wind: unknown key", "gravity"),
    ),
    Wrong(
        "key of another table",
        ("[shot]", "[shot]\nheight_mm = 3"),
        ("did you mean 'height_mm' in [chamber]",),
    ),
    Wrong(
        "missing key",
        ("diameter_mm = 70\n", ""),
        ("chamber.diameter_mm: missing", "from 2 to 2000 mm"),
    ),
    Wrong("no such unit", ('unit = "mm"', "unit = 1"), ("part.unit: given 1", '"mm"')),
    Wrong(
        "unknown unit", ('unit = "mm"', 'unit = "millimetre"'), ("given 'millimetre'", '"um", "mm"')
    ),
    Wrong(
        "negative mass",
        ("mass_g = 5", "mass_g = -5"),
        (":24", "shot.mass_g: given -5", "from 0.0001 to 10000 g"),
    ),
    Wrong(
        "metres for mm",
        ("height_mm = 45", "height_mm = 0.045"),
        ("given 0.045", "from 2 to 2000 mm"),
    ),
    Wrong(
        "quoted number",
        ("amplitude_um = 40", 'amplitude_um = "40"'),
        ("given '40'", "without quotes"),
    ),
    Wrong(
        "true for a number",
        ("replicas = 8", "replicas = true"),
        ("replicas: given true", "a whole number"),
    ),
    Wrong(
        "fraction of a replica", ("replicas = 8", "replicas = 8.5"), ("given 8.5", "a whole number")
    ),
    Wrong("two replicas", ("replicas = 8", "replicas = 2"), ("given 2", "confidence interval")),
    Wrong("not a number", ("simulated_time_s = 1.5", "simulated_time_s = nan"), ("given nan",)),
    Wrong("unknown material", ('"steel"', '"steal"'), ("given 'steal'", "did you mean 'steel'")),
    Wrong("two densities", ('"steel"', '"steel"\ndensity_kg_m3 = 7800'), ("keep one of the two",)),
    Wrong(
        "restitution above 1",
        ('part = "42CrMo4"', 'part = { alloy = "42CrMo4", C0 = 1.2 }'),
        ("C0: given 1.2", "0.05 to 1"),
    ),
    Wrong(
        "no hardness",
        ('part = "42CrMo4"', "part = { C0 = 0.91, v0_m_s = 0.44 }"),
        (":31", "hardness_HB: missing", "HB"),
    ),
    Wrong("unknown alloy", ('part = "42CrMo4"', 'part = "42CrMo5"'), (":31", "mean '42CrMo4'")),
    Wrong(
        "unknown shape",
        ('"cylinder"', '"cylindre"'),
        ("given 'cylindre'", "did you mean 'cylinder'"),
    ),
    Wrong(
        "part above the lid",
        ("sonotrode_distance_mm = 15", "sonotrode_distance_mm = 50"),
        ("given 50", "lower it"),
    ),
    Wrong(
        "ball too big", ("diameter_mm = 1.5 ", "diameter_mm = 18 "), ("given 18", "smaller ball")
    ),
    Wrong(
        "mesh not there",
        ("parts/gear.stl", "parts/gaer.stl"),
        (":4", "no such mesh file", "gear.stl"),
    ),
    Wrong(
        "angle without direction",
        ("direction = [0, 0, 1]\n", ""),
        ("angle_deg", "give both or neither"),
    ),
    Wrong("two of three", ("[0, 0, 1]", "[0, 1]"), ("direction: too short", "three numbers")),
    Wrong(
        "misspelt parameter",
        ("chamber.height_mm", "chamber.hight_mm"),
        (":5", "did you mean 'chamber.height_mm'"),
        STUDY,
    ),
    Wrong(
        "bounds reversed",
        ("[28, 60]", "[60, 28]"),
        ("given [60, 28]", "low must be below high"),
        STUDY,
    ),
    Wrong("start out of bounds", ("[28, 60]", "[50, 60]"), ("starts at 45", "widen"), STUDY),
    Wrong("unknown algorithm", ('"auto"', '"BOBYQA"'), ("did you mean 'LN_BOBYQA'",), STUDY),
    Wrong(
        "no budget",
        ("evaluations = 14", "evaluations = 0"),
        ("evaluations: given 0", "from 2"),
        STUDY,
    ),
    Wrong(
        "design not there",
        ("gear.toml", "gaer.toml"),
        (":2", "no such design file", "gear.toml?"),
        STUDY,
    ),
    Wrong(
        "unknown metric",
        ("[optimizer]", "[constraints]\ncoverage = { min = 1 }\n[optimizer]"),
        ("not a metric", "did you mean 'std_coverage'"),
        STUDY,
    ),
    Wrong(
        "unknown zone",
        ("[optimizer]", "[constraints]\nroot.mean_coverage = { min = 1 }\n[optimizer]"),
        ("constraints.root.mean_coverage", "no zone 'root'"),
        STUDY,
    ),
]


@pytest.fixture
def copies(tmp_path: Path) -> Path:
    """The shipped designs and studies in a folder of their own."""
    shutil.copytree(ROOT / "designs", tmp_path / "designs")
    shutil.copytree(ROOT / "studies", tmp_path / "studies")
    return tmp_path


def spoil(wrong: Wrong, folder: Path) -> Path:
    path = folder / wrong.file
    if isinstance(wrong.change, bytes):
        path.write_bytes(wrong.change)
    else:
        text = path.read_text(encoding="utf-8")
        assert wrong.change[0] in text
        path.write_text(text.replace(*wrong.change, 1), encoding="utf-8")
    return path


Said = Callable[..., tuple[int, str, str]]


@pytest.fixture
def chamberopt(capsys: pytest.CaptureFixture[str]) -> Said:
    """Runs a command in this process: status, stdout, stderr."""

    def call(*arguments: object) -> tuple[int, str, str]:
        status = main([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        return status, out, err

    return call


def in_a_shell(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "chamberopt", *map(str, arguments)]
    return subprocess.run(
        command, capture_output=True, text=True, encoding="utf-8", check=False, timeout=120
    )


@pytest.mark.parametrize("wrong", WRONG, ids=lambda wrong: wrong.name)
def test_wrong_files(wrong: Wrong, copies: Path, chamberopt: Said) -> None:
    path = spoil(wrong, copies)
    status, out, err = chamberopt("check", path)
    assert (status, out) == (2, "")
    assert err.startswith(str(path.parent)[: len(str(copies))])  # the message begins with the file
    assert path.name in err.splitlines()[0]
    assert "Traceback" not in err
    for word in wrong.said:
        assert word in err, f"{word!r} is not in: {err}"


@pytest.mark.parametrize(
    ("name", "command"),
    [("misspelt key", "check"), ("negative mass", "simulate"), ("bounds reversed", "run")],
)
def test_wrong_files_from_a_shell(name: str, command: str, copies: Path) -> None:
    path = spoil(next(wrong for wrong in WRONG if wrong.name == name), copies)
    done = in_a_shell(command, path, "--out", copies / "out")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"{path}:")
    assert len(done.stderr.splitlines()) <= 2
    assert not (copies / "out").exists()


class TestWrongCalls:
    """Not the file but the call is wrong: still one message, still 2."""

    def test_no_such_file(self, copies: Path, chamberopt: Said) -> None:
        status, _, err = chamberopt("check", copies / "designs" / "gera.toml")
        assert (status, err.count("\n")) == (2, 1)
        assert "no such design or study file; did you mean" in err
        assert "gear.toml?" in err

    def test_no_such_folder(self, tmp_path: Path, chamberopt: Said) -> None:
        status, _, err = chamberopt("simulate", tmp_path / "nowhere" / "gear.toml")
        assert status == 2
        assert f"the folder {tmp_path / 'nowhere'} does not exist" in err

    def test_a_folder(self, copies: Path, chamberopt: Said) -> None:
        status, _, err = chamberopt("check", copies / "designs")
        assert status == 2
        assert (
            "is a folder; give a design or study file (.toml); files in it: blade.toml, "
            "blade_conformal.toml" in err
        )

    def test_study_to_simulate_and_design_to_run(self, copies: Path, chamberopt: Said) -> None:
        status, _, err = chamberopt("simulate", copies / "studies" / "gear.toml")
        assert (status, "this is a study file" in err) == (2, True)
        status, _, err = chamberopt("run", copies / "designs" / "gear.toml")
        assert (status, "this is a design file" in err) == (2, True)

    def test_misspelt_command_and_option(self, copies: Path, chamberopt: Said) -> None:
        status, _, err = chamberopt("chek")
        assert (status, 'Did you mean "check"' in err) == (2, True)
        status, _, err = chamberopt("check", copies / "designs" / "gear.toml", "--jsn")
        assert (status, "Did you mean --json" in err) == (2, True)

    @pytest.mark.parametrize(
        ("words", "wrong"),
        [
            ("dents r x.png --replica 1.5", '--replica: unable to convert "1.5" into int'),
            ("sweep s.toml --grid 2.5", '--grid: unable to convert "2.5" into int'),
            ("replay r x.gif --size 64.5 64", '--size: unable to convert "64.5" into int'),
            ("accuracy d.toml --budget-s x", '--budget-s: unable to convert "x" into float'),
            ("new part.stl --ball-mm -3", "part.stl: no such file"),
        ],
    )
    def test_numbers_are_not_rounded(self, words: str, wrong: str, chamberopt: Said) -> None:
        status, _, err = chamberopt(*words.split())
        assert (status, wrong in err) == (2, True), err

    def test_missing_argument(self, chamberopt: Said) -> None:
        status, _, err = chamberopt("simulate")
        assert status == 2
        assert "requires an argument" in err

    def test_results_are_never_overwritten(self, copies: Path, chamberopt: Said) -> None:
        (copies / "out").mkdir()
        (copies / "out" / "result.json").write_text("{}")
        status, _, err = chamberopt(
            "simulate", copies / "designs" / "gear.toml", "--out", copies / "out"
        )
        assert (status, "never overwritten" in err) == (2, True)
        assert (copies / "out" / "result.json").read_text() == "{}"

    @pytest.mark.parametrize("command", ["inspect", "compare"])
    def test_not_a_results_folder(self, command: str, tmp_path: Path, chamberopt: Said) -> None:
        folders = [tmp_path] if command == "inspect" else [tmp_path, tmp_path]
        status, out, err = chamberopt(command, *folders)
        assert (status, out) == (2, "")
        assert str(tmp_path) in err

    def test_damaged_mesh(self, copies: Path, chamberopt: Said) -> None:
        mesh = copies / "designs" / "parts" / "gear.stl"
        mesh.write_bytes(mesh.read_bytes()[:5000])
        status, _, err = chamberopt("check", copies / "designs" / "gear.toml")
        assert status == 2
        assert str(mesh) in err

    def test_interrupt(
        self, copies: Path, chamberopt: Said, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def ctrl_c(*_: object) -> None:
            raise KeyboardInterrupt

        for module in ("workflows.simulate", "workflows.optimise", "chamber.build"):
            monkeypatch.setattr(f"chamberopt.{module}.build_chamber", ctrl_c)
        status, _, err = chamberopt("check", copies / "designs" / "gear.toml")
        assert (status, "interrupted" in err) == (130, True)


class TestCheck:
    @pytest.mark.parametrize(
        "name", ["designs/gear", "designs/plate", "designs/blade", "studies/gear"]
    )
    def test_shipped(self, name: str, chamberopt: Said) -> None:
        status, out, err = chamberopt("check", ROOT / f"{name}.toml")
        assert (status, err) == (0, "")
        assert " balls of " in out
        assert "effect: gravity is on: g H / V² = " in out
        assert max(map(len, out.partition("\n\n")[0].splitlines())) < 80

    def test_all_facts_by_their_names_with_verbose(self, chamberopt: Said) -> None:
        words = chamberopt("check", ROOT / "designs" / "gear_zones.toml")[1].splitlines()
        names = chamberopt("check", ROOT / "designs" / "gear_zones.toml", "-v")[1].splitlines()
        assert "shot         735 balls of 1 mm, 3.002 g, 0.32 % of the chamber" in words
        assert "             shot.mass_g: 3, from 2.7 to 3" in words
        assert f"{'shot.balls':33} 735" in names
        assert f"{'tolerances.shot.mass_g':33} 3, from 2.7 to 3" in names
        warned = [line for line in names if line.startswith("warning: ")]
        assert warned
        assert set(warned) <= set(words)

    def test_plate_has_the_papers_thirty_balls(self, chamberopt: Said) -> None:
        status, out, _ = chamberopt("check", ROOT / "designs" / "plate.toml", "--json")
        facts = json.loads(out)
        assert status == 0
        assert facts["shot"]["balls"] == 30
        assert facts["materials"]["wall"] == "42CrMo4, 300 HB, restitution 0.91 up to 0.44 m/s"
        # a 64-sided prism of 50 mm, 15 mm high: the plate is the lid
        area = 64 / 2 * 25**2 * 0.0980171403295606  # n/2 r² sin(2 pi / n)
        assert facts["chamber"]["free_volume_cm3"] == pytest.approx(area * 15 / 1000, rel=1e-5)
        assert facts["part"]["exposed_area_mm2"] == pytest.approx(area, rel=1e-5)

    def test_warns_of_a_crowded_and_of_a_narrow_chamber(
        self, copies: Path, chamberopt: Said
    ) -> None:
        path = copies / "designs" / "gear.toml"
        text = path.read_text(encoding="utf-8").replace("mass_g = 5", "mass_g = 160")
        path.write_text(text.replace("height_mm = 45", "height_mm = 26"), encoding="utf-8")
        status, out, _ = chamberopt("check", path, "--json")
        warnings = json.loads(out)["warnings"]
        assert status == 0
        assert any("hinder each other" in text for text in warnings)
        assert any(
            "gap between the ceiling and the part's upper side" in text
            and "is 1 to 1.09 mm" in text
            for text in warnings
        )

    def test_a_guessed_unit_is_said(self, copies: Path, chamberopt: Said) -> None:
        path = copies / "designs" / "gear.toml"
        path.write_text(
            path.read_text(encoding="utf-8").replace('unit = "mm"', ""), encoding="utf-8"
        )
        status, out, _ = chamberopt("check", path)
        assert status == 0
        assert "unit guessed as 'mm' (by its size): the part measures 44 x 44 x 70 mm" in out

    @pytest.mark.parametrize("open_part", [True, False])
    def test_screenshot_of_the_target_or_of_the_fault(
        self, open_part: bool, copies: Path, chamberopt: Said, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        drawn: list[tuple[str, int, int, int]] = []
        none = np.zeros(0)

        def draw(  # type: ignore[no-untyped-def]
            corners, title: str, picture, marked=none, edges=none, missed=none, chamber=None, **_
        ) -> None:
            drawn.append((title, int(marked.sum()), len(edges), int(missed.sum())))

        monkeypatch.setattr("chamberopt.pictures.part.draw_part", draw)
        design = copies / "designs" / "gear.toml"
        design.write_text(design.read_text().replace("diameter_mm = 1.5", "diameter_mm = 2.5"))
        if open_part:
            mesh = copies / "designs" / "parts" / "gear.stl"
            content = mesh.read_bytes()  # without its last 100 triangles
            mesh.write_bytes(content[:80] + (9820).to_bytes(4, "little") + content[84:-5000])
        status, out, err = chamberopt(
            "check", copies / "designs" / "gear.toml", "--screenshot", "look.png"
        )
        [(title, marked, edges, missed)] = drawn
        assert "picture in look.png" in err
        assert status == (2 if open_part else 0)
        if open_part:
            assert "the surface is not closed" in err
            assert "the surface is not closed" in " ".join(title.split())
            assert edges > 3
        else:
            assert "a usable design" in out
            assert marked > missed > 1000  # the roots of the teeth
            assert title == "gear.stl"

    def test_out(self, tmp_path: Path, chamberopt: Said) -> None:
        out = tmp_path / "out"
        status, said, _ = chamberopt("check", ROOT / "designs" / "gear.toml", "--out", out)
        assert status == 0
        assert str(out) in said
        assert json.loads((out / "check.json").read_text(encoding="utf-8"))["shot"]["balls"] == 363


def test_version(chamberopt: Said) -> None:
    assert chamberopt("--version")[:2] == (0, version("chamberopt") + "\n")


def test_help_loads_nothing_heavy() -> None:
    """`--help` answers at once: numba, vtk and the rest cost seconds."""
    heavy = {
        "numba",
        "trimesh",
        "pyvista",
        "vtkmodules",
        "nlopt",
        "manifold3d",
        "scipy",
        "matplotlib",
        "numpy",
        "tomlkit",
    }
    code = (
        f"import sys; from chamberopt.cli import main; main(['--help']); print({heavy} & "
        "set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "set()"


class TestWhole:
    """Small but real: the plate with a few balls and a few milliseconds, through every command."""

    @pytest.fixture
    def small(self, copies: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
        """The folder with small copies of the plate's design and study, as the working folder."""
        monkeypatch.chdir(copies)
        monkeypatch.setattr(NO_OPENGL, lambda: "not in this test")
        design = Path("designs/plate.toml")
        text = design.read_text(encoding="utf-8")
        for line in ("replicas = 8", "simulated_time_s = 4.0", "warmup_time_s = 0.2"):
            assert line in text
        text = text.replace("replicas = 8", "replicas = 3").replace("time_s = 4.0", "time_s = 0.05")
        text = text.replace("warmup_time_s = 0.2", "warmup_time_s = 0.01")
        design.write_text(f"{text}points = 1000\n", encoding="utf-8")
        study = "[optimizer]\nevaluations = 3\nconfirm = 1\nconfirm_replicas = 3\n"
        study += '[vary]\n"shot.mass_g" = [2, 5]\n'
        Path("studies/small.toml").write_text(
            f'design = "../designs/plate.toml"\n{study}', encoding="utf-8"
        )
        return copies

    def test_simulate_compare_inspect(self, small: Path, chamberopt: Said) -> None:
        status, out, _ = chamberopt("simulate", "designs/plate.toml", "--json")
        first = json.loads(out)
        assert (status, first["folder"]) == (0, str(Path("results/plate")))
        assert 0.0 < first["metrics"]["mean_coverage"]["value"] <= 1.0
        assert first["ranges"]["groups"].keys() == {"friction", "v0", "slopes"}

        # What was saved is the same design, gives the same bits without what is not calibrated,
        # and goes to the next free folder.
        design = Path("results/plate/design.toml")
        status, out, err = chamberopt("simulate", design, "--no-ranges", "--out", "again", "--json")
        again = json.loads(out)
        assert (status, "ranges" in again, "not calibrated" in err) == (0, False, False)
        assert again["collisions"] == first["collisions"]
        assert (again["objective"], again["metrics"]) == (first["objective"], first["metrics"])
        status, out, _ = chamberopt("simulate", "designs/plate.toml", "--no-ranges")
        assert (status, out.splitlines()[-1]) == (0, f"results in {Path('results/plate-2')}")

        status, out, _ = chamberopt("compare", "results/plate", "again", "--json")
        compared = json.loads(out)
        assert (status, compared["parameters"]) == (0, {})
        assert compared["differences_to_first"]["mean_coverage"][0]["value"] == 0.0
        assert Path(compared["folder"], "compare.txt").is_file()

    def test_compare_simulates_designs_on_common_seeds(self, small: Path, chamberopt: Said) -> None:
        text = Path("designs/plate.toml").read_text(encoding="utf-8")
        heavier = text.replace("mass_g = 3.308", "mass_g = 9.9").replace("seed = 1", "seed = 5")
        Path("designs/heavier.toml").write_text(heavier, encoding="utf-8")
        files = ("designs/plate.toml", "designs/heavier.toml")
        status, out, err = chamberopt("compare", *files, "--workers", 1, "--json")
        compared = json.loads(out)
        assert (status, compared["folder"]) == (0, str(Path("results/compare")))
        assert compared["parameters"] == {"shot.mass_g": [3.308, 9.9]}
        assert "heavier: seed = 1 instead of 5, as the first candidate" in err

        # The folders that it left are results. Simulating one of them alone and comparing them
        # again gives the same figures.
        heavier_alone = "results/compare/heavier/design.toml"
        status, out, _ = chamberopt("simulate", heavier_alone, "--no-ranges", "--json")
        alone = json.loads(out)["metrics"]["mean_coverage"]["value"]
        assert alone == compared["metrics"]["mean_coverage"][1]["value"]
        status, out, err = chamberopt("compare", "results/compare/plate", "results/compare/heavier")
        assert (status, "Shot mass [g]" in out, "instead of" in err) == (0, True, False)
        assert out.splitlines()[-1] == f"results in {Path('results/compare-2')}"

    def test_compare_refuses_before_it_makes_a_folder(self, small: Path, chamberopt: Said) -> None:
        text = Path("designs/plate.toml").read_text(encoding="utf-8")
        Path("designs/longer.toml").write_text(
            text.replace("time_s = 5", "time_s = 7"), encoding="utf-8"
        )
        status, out, err = chamberopt("compare", "designs/plate.toml", "designs/longer.toml")
        assert (status, out, err.count("\n")) == (2, "", 1)
        assert "--treatment-time-s" in err
        status, _, err = chamberopt("compare", "designs/plate.toml")
        assert (status, "two or more" in err) == (2, True)
        assert not Path("results").exists()

    @pytest.mark.long
    def test_simulate_analytically(self, small: Path, chamberopt: Said) -> None:
        status, out, _ = chamberopt("simulate", "designs/plate.toml", "--analytic", "--json")
        folder = Path(json.loads(out)["folder"])
        assert (
            status,
            json.loads((folder / "result.json").read_text(encoding="utf-8"))["analytic"],
        ) == (0, True)
        status, _, err = chamberopt("simulate", "designs/gear.toml", "--analytic")
        assert (status, err.count("\n")) == (2, 1)
        assert "the part reaches into the cavity" in err
        assert not Path("results/gear").exists()

    @needs_opengl
    @pytest.mark.long
    def test_inspect(self, small: Path, chamberopt: Said, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(NO_OPENGL, lambda: None)
        assert chamberopt("simulate", "designs/plate.toml", "--no-ranges")[0] == 0
        status, out, _ = chamberopt("inspect", "results/plate", "--screenshot", "look.png")
        assert (status, out.splitlines()[-1]) == (0, "picture in look.png")
        assert Path("look.png").stat().st_size > 10_000
        options = [
            "--quantity",
            "speed",
            "--below",
            "90",
            "--clip",
            "Y=1",
            "--triangle",
            "7",
            "--view",
            "1,-1,1",
        ]
        status, out, _ = chamberopt(
            "inspect", "results/plate", "results/plate", *options, "--off-screen", "--json"
        )
        said = json.loads(out)
        assert (status, said["screenshot"], len(said["folders"])) == (
            0,
            str(Path("results/inspect/inspect.png")),
            2,
        )
        assert Path("results/inspect/inspect.png").stat().st_size > 10_000
        for wrong, why in (
            (["--quantity", "sped"], "did you mean speed"),
            (["--triangle", "999999"], "has triangles 0 to"),
            (["--below", "120"], "up to 100 %"),
            (["--screenshot", "a.png", "--out", "out"], "give one of them"),
        ):
            status, out, err = chamberopt("inspect", "results/plate", "--off-screen", *wrong)
            assert (status, why in err, err.count("\n")) == (2, True, 1), err

    @pytest.mark.long
    def test_run(self, small: Path, chamberopt: Said) -> None:
        status, out, _ = chamberopt("run", "studies/small.toml", "--json")
        result = json.loads(out)
        assert (status, result["folder"]) == (0, str(Path("results/small")))
        assert result["study"]["evaluations"] == 3
        best = Path("results/small/best.toml")
        status, out, _ = chamberopt("check", best, "--json")
        assert status == 0
        assert 2 <= json.loads(out)["shot"]["mass_g"] <= 5.1
        status, again, err = chamberopt(
            "run", "studies/small.toml", "--out", "results/small", "--json"
        )
        assert (status, json.loads(again), "nothing was run" in err) == (0, result, True)
        status, _, err = chamberopt("run", "studies/gear.toml", "--out", "results/small")
        assert (status, "began otherwise" in err) == (2, True)
        Path("out").mkdir()
        Path("out/precious.txt").write_text("keep me")
        status, _, err = chamberopt("run", "studies/small.toml", "--out", "out")
        assert (status, "never overwritten" in err) == (2, True)

    def test_simulate_and_run_warn_as_check_does(self, small: Path, chamberopt: Said) -> None:
        """To stderr, so that --json stays clean; a study warns of its best design."""
        path = Path("designs/plate.toml")
        text = path.read_text(encoding="utf-8")
        path.write_text(text.replace("mass_g = 3.308", "mass_g = 0.5"), encoding="utf-8")
        study = Path("studies/small.toml")
        study.write_text(
            study.read_text(encoding="utf-8").replace("[2, 5]", "[0.48, 0.5]"), encoding="utf-8"
        )
        for command, file in (("simulate", path), ("run", study)):
            status, out, err = chamberopt(command, file, "--no-ranges", "--json")
            assert (status, bool(json.loads(out))) == (0, True)
            assert err.count(": shot.mass_g = ") == 1

    def test_shot_that_does_not_fit(self, small: Path, chamberopt: Said) -> None:
        """A filling of 45 % of the cylinder passes the check of the file.

        The plate takes a quarter of the cylinder, so that the shot does not fit.
        """
        path = Path("designs/plate.toml")
        path.write_text(
            path.read_text(encoding="utf-8").replace("mass_g = 3.308", "mass_g = 140"),
            encoding="utf-8",
        )
        for command in ("check", "simulate"):
            status, out, err = chamberopt(command, path)
            # What is known at once, such as the filling, is shown before the shot is placed.
            assert (status, "usable" in out, bool(out)) == (2, False, command == "check")
            assert "balls of 3 mm find a free place" in err
            assert "compiling" not in err
        assert not Path("results/plate").exists()


class TestProgress:
    """Steps are for people: on a terminal they show all, a log has a line a while."""

    def test_few_lines_in_a_log(self, monkeypatch: pytest.MonkeyPatch) -> None:
        clock = [0.0]
        monkeypatch.setattr("chamberopt.common.progress.time.monotonic", lambda: clock[0])
        stream = io.StringIO()
        with step("evaluations", stream=stream) as progress:
            for done in range(100):
                clock[0] += 5.0
                progress(done, 100, 0.5)
        assert stream.getvalue().splitlines() == [
            "evaluations: 5 of 100, best 0.5000, about 475 s left",
            "evaluations: 11 of 100, best 0.5000, about 445 s left",
            "evaluations: 23 of 100, best 0.5000, about 385 s left",
            "evaluations: 47 of 100, best 0.5000, about 265 s left",
            "evaluations: 95 of 100, best 0.5000, about 25 s left",
        ]

    def test_a_log_tells_no_time_by_the_pace_of_one_slow_item(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """A search that goes on at 20 of 76 takes 40 s for the next candidate, 3 s for others."""
        clock = [0.0]
        monkeypatch.setattr("chamberopt.common.progress.time.monotonic", lambda: clock[0])
        stream = io.StringIO()
        with step("evaluations", stream=stream) as progress:
            for done in (20, *range(21, 60)):
                clock[0] += 40.0 if done == 21 else 3.0
                progress(done, 76, None)
        first, second, *_ = stream.getvalue().splitlines()
        assert first == "evaluations: 21 of 76"
        assert second.startswith("evaluations: 36 of 76, about ")

    def test_a_log_has_no_lines_of_steps_within_a_counted_one(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        clock = [0.0]
        monkeypatch.setattr("chamberopt.common.progress.time.monotonic", lambda: clock[0])
        for total, told in ((None, True), (9, False)):
            stream = io.StringIO()
            with step("evaluations", total, stream=stream), step("replicas", stream=stream) as one:
                for done in range(20):
                    clock[0] += 5.0
                    one(done, 20, None)
            assert ("replicas: " in stream.getvalue()) is told

    def test_steps_within_steps(self, monkeypatch: pytest.MonkeyPatch) -> None:
        stream = io.StringIO()
        monkeypatch.setattr(stream, "isatty", lambda: True)
        monkeypatch.setenv("TERM", "xterm")
        monkeypatch.setenv("COLUMNS", "120")
        with step("pilot runs", stream=stream) as outer:
            outer(1, 6, None)
            with step("functions") as inner:
                inner(150, 0, None)  # how many there will be is not known
        assert "150 so far" in stream.getvalue()
        assert "1/6" in stream.getvalue()

    def test_best_so_far_on_a_terminal(self, monkeypatch: pytest.MonkeyPatch) -> None:
        stream = io.StringIO()
        monkeypatch.setattr(stream, "isatty", lambda: True)
        monkeypatch.setenv("TERM", "xterm")
        monkeypatch.setenv("COLUMNS", "120")
        with step("evaluations", stream=stream) as progress:
            progress(4, 10, 0.51234)
        assert "evaluations" in stream.getvalue()
        assert "4/10" in stream.getvalue()
        assert "best 0.5123" in stream.getvalue()


def test_a_command_that_ends_searches_nothing_for_garbage() -> None:
    run = "from chamberopt.cli import main; main(); import gc; print(gc.get_freeze_count() > 1000)"
    done = subprocess.run(
        [sys.executable, "-c", run, "--version"], capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "True"

"""A custom shape is checked, varied, recorded and saved like the shipped ones."""

import json
import pickle
import re
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.build import build_chamber
from chamberopt.cli import main
from chamberopt.common.errors import InputError
from chamberopt.design.load import load_design, save_design
from chamberopt.results.compare.comparison import compare
from chamberopt.results.load import load_result
from chamberopt.search.study import load_study
from chamberopt.workflows.save_run import save_simulation
from tests.helpers.synthetic import poisson_evaluation

ROOT = Path(__file__).resolve().parents[4]

PYRAMID = """
from chamberopt.common.toml_fields import quantity
from chamberopt.design.shapes import ChamberTable, ShapeSurface
import numpy as np

class Pyramid(ChamberTable):
    side_mm: float = quantity(10, 500, "mm", "of the floor")
    top_mm: float = quantity(10, 500, "mm", "height of the tip", 60.0)

    def surface(self, vertices, triangles):
        s, h = 0.5e-3 * self.side_mm, 1e-3 * self.top_mm
        points = np.array([[-s, -s, 0], [s, -s, 0], [s, s, 0], [-s, s, 0], [0, 0, h]])
        faces = np.array([[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
        return ShapeSurface(points, faces, np.array([1, 1, 2, 2, 2, 2], dtype=np.uint8))
"""
RETURN = "return ShapeSurface(points, faces, np.array([1, 1, 2, 2, 2, 2], dtype=np.uint8))"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A design with a pyramid of its own round a small block."""
    text = (ROOT / "designs" / "gear.toml").read_text(encoding="utf-8")
    head, rest = text.split("[part.target]")[0], text.split("[sonotrode]")[1]
    chamber = (
        '[chamber]\nshape = "pyramid.py"\nside_mm = 80\nsonotrode_distance_mm = 15\n\n[sonotrode]'
    )
    (tmp_path / "d.toml").write_text(
        head.replace("parts/gear.stl", "block.stl") + chamber + rest, encoding="utf-8"
    )
    (tmp_path / "pyramid.py").write_text(PYRAMID, encoding="utf-8")
    trimesh.creation.box((10, 10, 10)).export(tmp_path / "block.stl")
    return tmp_path


def said_of(folder: Path, *changes: tuple[str, str], file: str = "pyramid.py") -> str:
    """The message after these changes to the file; the command line prints it and exits with 2."""
    text = (folder / file).read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / file).write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as refused:
        build_chamber(load_design(folder / "d.toml"))
    assert main(["check", str(folder / "d.toml")]) == 2
    return str(refused.value)


def test_it_makes_a_chamber(folder: Path) -> None:
    chamber = build_chamber(load_design(folder / "d.toml"))

    mesh = trimesh.Trimesh(chamber.vertices, chamber.triangles, process=False)
    assert mesh.is_watertight
    assert chamber.volume == pytest.approx(1e-9 * (80 * 80 * 60 / 3 - 1000), rel=1e-7)


def test_its_keys_are_checked_and_vary(folder: Path) -> None:
    design = load_design(folder / "d.toml")

    assert {"chamber.side_mm", "chamber.top_mm"} <= set(design.numbers())
    assert design.value("chamber.top_mm") == 60.0
    other = design.changed({"chamber.side_mm": 70})
    assert (other.chamber.side_mm, other.chamber.shape) == (70.0, str(folder / "pyramid.py"))
    with pytest.raises(
        InputError,
        match=r"chamber\.side_mm: given 5.0; allowed: a number from 10 to 500 mm \(of the",
    ):
        design.changed({"chamber.side_mm": 5})
    (folder / "s.toml").write_text(
        'design = "d.toml"\n[vary]\n"chamber.side_mm" = [60, 90]\n', encoding="utf-8"
    )
    assert load_study(folder / "s.toml").vary["chamber.side_mm"].bounds == (60.0, 90.0)
    assert "d.toml:9: chamber.sid_mm: unknown key; did you mean 'side_mm'?" in said_of(
        folder, ("side_mm", "sid_mm"), file="d.toml"
    )


def test_loaded_twice_pickled_or_saved_elsewhere_it_is_the_same(folder: Path) -> None:
    design = load_design(folder / "d.toml")

    assert load_design(folder / "d.toml") == design
    again = pickle.loads(pickle.dumps(design))
    assert again == design
    assert type(again.chamber) is type(design.chamber)
    (folder / "deep").mkdir()
    save_design(design, folder / "deep" / "d.toml")
    assert 'shape = "../pyramid.py"' in (folder / "deep" / "d.toml").read_text(encoding="utf-8")
    assert load_design(folder / "deep" / "d.toml") == design


def test_a_file_that_changes_is_another_shape(folder: Path) -> None:
    before = load_design(folder / "d.toml")
    (folder / "pyramid.py").write_text(PYRAMID.replace("0.5e-3 *", "0.4e-3 *"), encoding="utf-8")
    after = load_design(folder / "d.toml")

    assert build_chamber(after).volume < build_chamber(before).volume
    assert before.chamber.sha256 == sha256(PYRAMID.encode()).hexdigest() != after.chamber.sha256


def test_results_name_the_file_and_can_be_read_without_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: None)
    design = load_design(folder / "d.toml")
    chamber = build_chamber(design)
    for name, changed in (("first", design), ("second", design.changed({"chamber.side_mm": 70}))):
        save_simulation(folder / name, changed, chamber, poisson_evaluation(changed, chamber))

    written = json.loads((folder / "first" / "result.json").read_text(encoding="utf-8"))
    assert written["shape_sha256"] == sha256(PYRAMID.encode()).hexdigest()
    assert written["design"]["chamber"]["shape"] == "../pyramid.py"
    assert load_result(folder / "first").design.model_dump() == design.model_dump()

    (folder / "pyramid.py").unlink()
    both = compare([folder / "first", folder / "second"])
    assert both.parameters == {"chamber.side_mm": (80.0, 70.0)}
    (folder / "pyramid.py").write_text("raise RuntimeError('run')", encoding="utf-8")
    recorded = load_result(folder / "first").design
    again = pickle.loads(pickle.dumps(recorded)).changed({"process.seed": 9})
    with pytest.raises(InputError, match=r"pyramid\.py: named by a result, whose code"):
        build_chamber(again)


def test_a_worker_with_another_file_of_the_shape_is_refused(folder: Path) -> None:
    sent = pickle.dumps(load_design(folder / "d.toml"))
    (folder / "pyramid.py").write_text(PYRAMID.replace("0.5e-3 *", "0.4e-3 *"), encoding="utf-8")
    with pytest.raises(InputError, match=r"pyramid\.py: on this worker its sha256 is .*expected"):
        pickle.loads(sent)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            (RETURN, "return 7"),
            "surface() of Pyramid gives int; it must give a chamberopt.design.shapes.ShapeSurface",
        ),
        ((RETURN, "return 1 / 0"), "pyramid.py:14: surface() failed: ZeroDivisionError"),
        (("[3, 0, 4]]", "[3, 4, 0]]"), "is not closed: each side of a triangle"),
        ((", [3, 0, 4]]", "]"), "must tag each triangle"),
        (("faces = np.array(", "faces = -1 + np.array("), "whose vertices do not exist"),
        (("faces = np.array([", "faces = np.fliplr(["), "is inside out"),
        (("[1, 1, 2", "[2, 2, 2"), "has no triangle tagged TAG_SONOTRODE"),
        (("[1, 1, 2", "[1, 1, 1"), "has a sonotrode that is not the floor at z = 0"),
        (("[0, 0, h]", "[0, 0, np.nan]"), "not finite numbers"),
        (("def surface", "def surfaces"), "Pyramid does not define surface()"),
        (
            ("import numpy as np", "import nunpy as np"),
            "pyramid.py:4: cannot be run: ModuleNotFoundError: No module",
        ),
        (
            ("class Pyramid(ChamberTable):", "class Pyramid(ChamberTable)"),
            "pyramid.py:6: cannot be run: SyntaxError",
        ),
        (("class Pyramid(ChamberTable)", "class Pyramid"), "it defines none"),
        (
            ("import numpy as np", "import numpy as np\nclass Cone(ChamberTable): pass"),
            "it defines Cone and Pyramid",
        ),
        (
            ("    def surface", "    def room(self): return 1 / 0\n    def surface"),
            "room() failed: ZeroDivisionError",
        ),
    ],
)
def test_what_is_wrong_with_it_is_said(folder: Path, change: tuple[str, str], said: str) -> None:
    assert said in said_of(folder, change)


def test_a_file_that_is_not_there(folder: Path) -> None:
    said = said_of(
        folder, ('"pyramid.py"', '"pyramids.py"'), ("mass_g = 5", "mass_g = -5"), file="d.toml"
    )

    assert (
        f"d.toml:8: chamber.shape: given 'pyramids.py': {folder / 'pyramids.py'}: no such shape "
        "file" in said
    )
    assert f"did you mean {folder / 'pyramid.py'}?" in said
    assert "shot.mass_g: given -5" in said


def test_the_shipped_oblong_is_a_stadium() -> None:
    design = load_design(ROOT / "designs" / "blade_oblong.toml").changed(
        {"chamber.inclination_deg": 10}
    )
    table = design.chamber

    made = table.surface(np.zeros((0, 3)), np.zeros((0, 3), dtype=int))

    mesh = trimesh.Trimesh(1e3 * made.vertices, made.triangles, process=False)
    straight, low, up = table.length_mm - table.width_mm, table.width_mm / 2, table.height_mm
    high = low + up * np.tan(np.radians(10))
    round_ends = np.pi / 3 * up * (low**2 + low * high + high**2) * np.sin(np.pi / 32) * 32 / np.pi
    assert mesh.volume == pytest.approx(round_ends + straight * up * (low + high), rel=1e-9)
    with pytest.raises(InputError, match=r"chamber\.length_mm: given 44"):
        build_chamber(design.changed({"chamber.length_mm": 44}))


def test_the_one_in_the_docs_works(folder: Path) -> None:
    docs = (ROOT / "docs" / "how_to" / "chambers.md").read_text(encoding="utf-8")
    (folder / "pyramid.py").write_text(
        docs.split("```python\n")[1].split("```")[0], encoding="utf-8"
    )

    assert build_chamber(load_design(folder / "d.toml")).volume == pytest.approx(1.27e-4, rel=1e-6)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("raise SystemExit(3)", r"pyramid\.py:14: surface\(\) failed: SystemExit: 3"),
        (
            "vertices[:] = 0.0",
            r"pyramid\.py:14: surface\(\) failed: ValueError: assignment destination is read-only",
        ),
        (
            "points = 1e3 * points",
            r"is 80 m wide; at most 10 m is allowed; its vertices are in metres, not mm",
        ),
    ],
)
def test_what_its_surface_may_not_do(folder: Path, line: str, said: str) -> None:
    assert re.search(said, said_of(folder, (RETURN, f"{line}\n        {RETURN}")))


def test_a_surface_that_crosses_itself_is_refused(folder: Path) -> None:
    """The tip of a tall notch in one side goes through the other side."""
    notched = (
        "\n        n = np.array([[-s, -s, 0], [s, -s, 0], [s, s, 0], [-s, s, 0], [0, 0, h], "
        "[0, 2 * s, 0.1 * h]])"
        "\n        faces = np.array([[0, 2, 1], [0, 3, 2], [5, 0, 1], [5, 1, 4], [5, 4, 0], "
        "[1, 2, 4], [2, 3, 4], [3, 0, 4]])"
        "\n        return ShapeSurface(n, faces, np.array([1, 1, 2, 2, 2, 2, 2, 2]))"
    )

    assert re.search(
        r"surface\(\) of Pyramid crosses itself, near \(",
        said_of(folder, (RETURN, notched.strip())),
    )


def test_lists_will_do_and_what_it_says_of_the_part_does_not_count(folder: Path) -> None:
    before = build_chamber(load_design(folder / "d.toml"))
    lists = "return ShapeSurface(points.tolist(), faces.tolist(), [1, 1, 2, 2, 2, 2], [0] * 6)"
    (folder / "pyramid.py").write_text(PYRAMID.replace(RETURN, lists), encoding="utf-8")

    chamber = build_chamber(load_design(folder / "d.toml"))

    assert np.array_equal(chamber.vertices, before.vertices)
    assert np.array_equal(chamber.tags, before.tags)


@pytest.mark.parametrize(
    ("method", "said"),
    [
        (
            "def widths_mm(self): return 'wide'",
            r"widths_mm\(\) of Pyramid gives 'wide'; it must give widths \[mm\] by key",
        ),
        ("def widths_mm(self): return {'side_mm': None}", r"widths_mm\(\) of Pyramid gives .*None"),
        (
            "def room(self): return 0.0",
            r"room\(\) of Pyramid gives 0.0; it must give a volume \[m³\] above 0",
        ),
        (
            "def notes(self, ball): return 'note'",
            r"notes\(\) of Pyramid gives 'note'; it must give a list of texts",
        ),
    ],
)
def test_what_its_other_methods_must_give(folder: Path, method: str, said: str) -> None:
    assert re.search(said, said_of(folder, ("    def surface", f"    {method}\n\n    def surface")))


@pytest.mark.parametrize(
    ("error", "said"),
    [
        ("ZeroDivisionError('why')", r"pyramid\.py:\d+: its checks failed: ZeroDivisionError: why"),
        ("ValueError('too, steep')", r"d\.toml:\d+: chamber: too, steep"),
    ],
)
def test_what_its_validators_raise_is_said(folder: Path, error: str, said: str) -> None:
    check = (
        f"    @pydantic.model_validator(mode='after')\n    def _agree(self): raise {error}\n\n"
        "    def surface"
    )
    assert re.search(
        said,
        said_of(
            folder,
            ("import numpy as np", "import numpy as np, pydantic"),
            ("    def surface", check),
        ),
    )


def test_without_a_height_no_key_is_blamed_for_the_ceiling(folder: Path) -> None:
    """The tip at 80 mm is cut off by the block, as wide as the pyramid there."""
    trimesh.creation.box((60, 60, 10)).export(folder / "block.stl")
    notes = build_chamber(load_design(folder / "d.toml")).notes

    assert any("a higher ceiling has no effect" in note for note in notes)
    assert not any("height_mm" in note for note in notes)


def test_results_of_a_file_that_was_edited_are_told_apart_and_still_read(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: None)
    for name, text in (("first", PYRAMID), ("second", PYRAMID.replace("0.5e-3 *", "0.4e-3 *"))):
        (folder / "pyramid.py").write_text(text, encoding="utf-8")
        design = load_design(folder / "d.toml")
        chamber = build_chamber(design)
        save_simulation(folder / name, design, chamber, poisson_evaluation(design, chamber))

    assert set(compare([folder / "first", folder / "second"]).parameters) == {"shape_sha256"}
    (folder / "pyramid.py").write_text(PYRAMID.replace("side_mm", "edge_mm"), encoding="utf-8")
    assert load_result(folder / "first").design.chamber.side_mm == 80.0
    with pytest.raises(InputError, match=r"chamber\.side_mm: unknown key"):
        load_design(folder / "d.toml")

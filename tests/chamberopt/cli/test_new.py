"""`chamberopt new`: from a part's file to a design that check accepts, without an edit."""

import io
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.layout.pose import hanging_pose, propose_pose, square_to_walls
from chamberopt.chamber.layout.target import propose_target, surfaces
from chamberopt.chamber.propose.first_design import propose
from chamberopt.chamber.propose.proposal import Proposal, Wanted
from chamberopt.chamber.propose.proposed_budget import Measured
from chamberopt.cli import main
from chamberopt.common.errors import InputError
from chamberopt.design.intensity import PredictedIntensity
from chamberopt.design.load import load_design
from chamberopt.geometry.meshes.part_mesh import PartMesh, read_part
from chamberopt.geometry.triangles import rotation_matrix
from chamberopt.search.study import load_study
from tests.chamberopt.design.test_shipped_parts import PARTS
from tests.helpers.eight_parts import EIGHT_PARTS, KEPT_ASIDE, ExamplePart
from tests.helpers.four_parts import FOUR_PARTS
from tests.helpers.more_parts import MORE_PARTS


@pytest.fixture(scope="module")
def gear() -> PartMesh:
    return read_part(PARTS / "gear.stl", "mm")


def test_a_gears_teeth_are_its_target_and_stand_upright(gear: PartMesh) -> None:
    target = propose_target(gear, surfaces(gear), [])
    shipped = load_design(PARTS.parent / "gear.toml")
    assert len(target.keys["faces"]) == 3  # flanks, tips and roots
    assert shipped.part.target.direction == (0, 0, 1)
    turns, reason = propose_pose(gear.vertices, gear.triangles, target.triangles)
    assert turns == (0.0, 0.0, 0.0)  # the shaft up
    assert "upright" in reason


@pytest.mark.parametrize("direction", [(0, 0, 1), (1, 0, 0), (0.6, 0.0, 0.8), (-0.48, 0.6, 0.64)])
def test_a_flat_target_is_turned_to_the_sonotrode(direction: tuple[float, float, float]) -> None:
    plate = trimesh.creation.box((60, 40, 5))
    turn = trimesh.geometry.align_vectors((0, 0, 1), direction)[:3, :3]
    vertices, target = plate.vertices @ turn.T, plate.face_normals[:, 2] > 0.5
    turns, _ = propose_pose(vertices, plate.faces, target)
    assert rotation_matrix(turns) @ direction == pytest.approx([0, 0, -1], abs=2e-3)
    sides = np.ptp(vertices @ rotation_matrix(square_to_walls(vertices, turns)).T, axis=0)
    assert sides == pytest.approx([60, 40, 5], abs=0.3)


def test_turns_are_simple_where_that_is_as_good(tmp_path: Path) -> None:
    """The inner faces of an angle, 5 and 3 in long, face down best at 30 degrees, well at 45."""
    angle = read_part(FOUR_PARTS["bracket"].write(tmp_path), "in")
    target = propose_target(angle, surfaces(angle), []).triangles
    assert propose_pose(angle.vertices, angle.triangles, target)[0] == (-90.0, 45.0, 0.0)
    round_bar = trimesh.creation.cylinder(10.0, 50.0, sections=31)
    assert square_to_walls(round_bar.vertices, (0.0, 0.0, 0.0)) == (0.0, 0.0, 0.0)
    plate = trimesh.creation.box((60, 40, 5))
    for turn, needed in ((7.3, -7.3), (7.02, -7.0), (0.4, 0.0), (-60.0, 60.0), (-90.0, 90.0)):
        turned = plate.vertices @ rotation_matrix((0.0, 0.0, turn)).T
        assert square_to_walls(turned, (0.0, 0.0, 0.0))[2] == pytest.approx(needed)


@pytest.mark.long
def test_a_long_part_hangs_where_no_sonotrode_carries_it_lying(tmp_path: Path) -> None:
    """A strip's two broad faces stand upright, whether it lies on its edge or hangs by an end."""
    strip = trimesh.creation.box((170, 5, 36))
    strip.export(tmp_path / "strip.stl")
    made = propose(tmp_path / "strip.stl", Wanted("mm"), lambda _: [])
    up = rotation_matrix(made.design.part.rotate_deg) @ [1.0, 0.0, 0.0]
    assert abs(up[2]) == pytest.approx(1.0)
    assert made.design.chamber.diameter_mm == 80.0
    assert made.design.holder is not None
    assert "on end, as no single sonotrode" in made.reasons["part.rotate_deg"]
    vertices, faces, normals = strip.vertices, strip.faces, strip.face_normals
    lying = (0.0, 0.0, 0.0)
    assert hanging_pose(vertices, faces, np.abs(normals[:, 1]) > 0.5, lying)
    assert hanging_pose(vertices, faces, normals[:, 2] < -0.5, lying) is None  # it looks down
    short = vertices * [0.3, 1.0, 1.0]
    assert hanging_pose(short, faces, np.abs(normals[:, 1]) > 0.5, lying) is None


def test_new_writes_a_design_and_a_study_that_are_accepted(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    part = EIGHT_PARTS["crank_pin"].write(tmp_path)
    command = ["new", str(part), "--target", "PIN", "--target", "FILLETS"]
    assert main([*command, "--material", "18CrNiMo7-6", "--shape", "prism", "--no-pilot"]) == 0
    assert "crank_pin/design.toml" in capfd.readouterr().out
    design = load_design("crank_pin/design.toml")
    assert set(design.part.target.surface) == {"PIN", "FILLETS"}
    assert design.chamber.shape == "prism"
    study = load_study("crank_pin/study.toml")
    assert "chamber.height_mm" in study.vary
    assert Path("crank_pin/design.png").stat().st_size > 10_000
    assert main(command) == 2
    assert "already holds files" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--target", "PINN"], "--target: 'PINN' is not a name in the part's file; did you mean"),
        (["--target", "face 99"], "--target: given 'face 99', but the part has face 1 to face"),
        (["--target", "PIN", "--target", "face 1"], "cannot be one target; give one kind"),
        (["--target", "pick"], "--target: pick asks, and nobody answers here"),
        (["--material", "unobtainium"], "alloy 'unobtainium': unknown"),
        (["--shot", "lead"], "material of balls 'lead': unknown"),
        (["--shot", "glass"], "--shot: given 'glass'; the hardness of these balls is not known"),
        (["--unit", "m"], "with --unit = 'm' the part measures"),
        (["--ball-mm", "900"], "--ball-mm: given 900; allowed: from 0.1 to 20 mm"),
        (
            ["--ball-mm", "14", "--target", "FILLETS", "--no-pilot"],
            "--ball-mm: given 14, but such balls touch 0% of the target: give 6 or smaller",
        ),
        (["--shop", "nowhere.toml"], "nowhere.toml: no such shop file"),
        (["--intensity", "0.15-0.20"], "--intensity: given '0.15-0.20'; allowed: a range such as"),
        (["--intensity", "0.006-0.010A"], "0.006 in are 0.15 mm"),
        (["--intensity", "0.2A", "--no-pilot"], "--intensity: it takes pilot runs"),
        (["--coverage", "50"], "--coverage: given 50; allowed: from 100 to 1000 %"),
        (["--calibration", "nowhere.toml"], "nowhere.toml: no such calibration file"),
    ],
)
def test_what_new_cannot_use_is_told(
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    options: list[str],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    part = EIGHT_PARTS["crank_pin"].write(tmp_path)
    assert main(["new", str(part), *options]) == 2
    (line,) = (one for one in capfd.readouterr().err.splitlines() if one.strip())
    assert message in line
    assert not Path("crank_pin").exists()


@pytest.mark.parametrize(
    ("part", "message"),
    [
        ("nowhere.stl", "nowhere.stl: no such file"),
        (".", ".: is a folder; give the file of the part"),
        (os.devnull, f"{os.devnull}: is no plain file; give the file of the part"),
    ],
)
def test_a_part_that_is_no_file_is_told(
    part: str, message: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert main(["new", part]) == 2
    assert message in capfd.readouterr().err


@pytest.mark.parametrize(
    ("side", "moved", "options", "message"),
    [
        (2.5, 0.0, (), "the part measures 2500 x 20 x 20 mm, too much for a chamber"),
        (0.1, 11.0, (), "the part is 10.98 m from the origin of its file, at most 10 m"),
        (0.1, 0.0, ("--target", "pick"), "--target: pick got no answer"),
    ],
)
def test_a_box_that_cannot_be_used_is_told(
    side: float,
    moved: float,
    options: tuple[str, ...],
    message: str,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.stdin", Nobody())
    box = trimesh.creation.box((side, 0.02, 0.02))
    box.apply_translation((moved, 0, 0)).export("box.stl")
    assert main(["new", "box.stl", "--unit", "m", *options]) == 2
    assert message in capfd.readouterr().err
    assert list(Path().iterdir()) == [Path("box.stl")]


class Nobody(io.StringIO):
    """A terminal whose input ends after the given text."""

    def isatty(self) -> bool:
        return True


def test_a_guess_is_said_and_no_folder_is_held_while_the_design_is_made(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C in the midst of the work leaves nothing; what is written has the guess too."""
    monkeypatch.chdir(tmp_path)
    trimesh.creation.box((20, 20, 30)).export("box.stl")
    held: list[Path] = []

    def watched(*given: Any) -> Proposal:
        held.extend(Path().glob("out*"))
        return propose(*given)

    monkeypatch.setattr("chamberopt.chamber.propose.first_design.propose", watched)
    monkeypatch.setattr("chamberopt.workflows.propose.draw_target", lambda *_: "no picture")
    assert main(["new", "box.stl", "--unit", "guess", "--out", "out", "--no-pilot"]) == 0
    said = capfd.readouterr()
    assert "UNIT GUESSED: the part measures 20 x 20 x 30 mm." in said.out
    assert "unit guessed as 'mm' (by its size)" in said.err
    assert "give --unit if that is wrong" in said.err
    assert not held
    made = sorted(one.name for one in Path("out").iterdir())
    assert made == ["design.toml", "study.toml"]
    assert load_study("out/study.toml").objective.name == "uniform_coverage"
    settle = load_design("out/design.toml").to_settle
    assert "UNIT GUESSED: the part measures 20 x 20 x 30 mm" in settle
    assert "a pad on the level top, up to the ceiling: no ball lies there" in said.out
    design = load_design("out/design.toml")
    assert design.mask is not None
    assert design.holder is not None  # a pad alone holds nothing


def test_a_unit_that_cannot_be_known_is_asked_for(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """An angle of 5 x 3 x 2 in, whose file states no unit, is no part of 5 x 3 x 2 mm."""
    monkeypatch.chdir(tmp_path)
    FOUR_PARTS["bracket"].write(tmp_path)
    assert main(["new", "bracket.stl"]) == 2
    message = (
        "bracket.stl: the file does not state the unit of its numbers; give --unit: "
        "mm (5 x 3 x 2 mm), cm (50 x 30 x 20 mm) or in (127 x 76.2 x 50.8 mm)"
    )
    assert message in capfd.readouterr().err

    def only_read(path: Path, wanted: Wanted, _: object) -> None:
        raise InputError(f"measures {read_part(path, wanted.unit).size[0]:.3f} m")

    monkeypatch.setattr("chamberopt.chamber.propose.first_design.propose", only_read)
    for answer, said in (("in\n", "measures 0.127 m"), ("ft\n", "given 'ft'"), ("", "no answer")):
        monkeypatch.setattr("sys.stdin", Nobody(answer))
        assert main(["new", "bracket.stl"]) == 2
        shown = capfd.readouterr()
        assert "127 x 76.2 x 50.8 mm if they are in in" in shown.out
        assert said in shown.err


def test_a_part_that_crosses_itself_is_not_to_be_seen_by_a_design_that_is_not_there(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    ring = trimesh.creation.torus(10.0, 3.0, major_sections=32, minor_sections=16)
    ring.vertices[:, 2] *= np.where(ring.vertices[:, 0] > 9.0, -1.0, 1.0)  # a part is turned over
    ring.export("ring.stl")
    assert main(["new", "ring.stl", "--unit", "mm"]) == 2
    shown = capfd.readouterr().err
    assert "the surface crosses itself" in shown
    assert "FILE.toml" not in shown


def test_a_pilot_that_cannot_run_leaves_the_starts_and_says_so(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: Any) -> Measured:
        raise InputError("the shot hardly hits the target")

    monkeypatch.chdir(tmp_path)
    trimesh.creation.box((20, 20, 30)).export("box.stl")
    monkeypatch.setattr("chamberopt.cli.teller.compile_with_message", lambda *_: None)
    monkeypatch.setattr("chamberopt.workflows.propose.measure_budget", fails)
    monkeypatch.setattr("chamberopt.workflows.propose.draw_target", lambda *_: "no picture")
    assert main(["new", "box.stl", "--unit", "mm"]) == 0
    assert "warning: no pilot, treatment and simulated time are starts" in capfd.readouterr().err
    assert "TIME NOT MEASURED by a pilot, a start" in Path("box/design.toml").read_text("utf-8")

    measured = Measured(1e5, 1e4, 250.0, True, 60.0, True, 0.01, 5e-3, 6.4, 200.0)
    monkeypatch.setattr("chamberopt.workflows.propose.measure_budget", lambda *_: measured)
    assert main(["new", "box.stl", "--unit", "mm", "--out", "piloted"]) == 0
    process = load_design("piloted/design.toml").process
    assert process.treatment_time == 360.0
    assert process.accuracy.simulated_time == 50.0  # 10 replicas: 50 dents in 1 mm²
    assert "after about 250 ± 60 s" in capfd.readouterr().out
    study = load_study("piloted/study.toml")
    assert study.objective.name == "minus_time_to_98_s"
    assert load_study("piloted/most_even.toml").objective.name == "uniform_coverage"
    assert "--time 180s" in Path("piloted/most_even.toml").read_text(encoding="utf-8")
    searched = study.search_accuracy
    assert searched["replicas"] * searched["simulated_time_s"] == 500.0


def test_a_usual_intensity_that_no_pilot_tells_is_no_reason_to_stop(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody asked for it. Where it is asked for, it is one message."""
    off = PredictedIntensity(0.9, 0.1, 5.0, 2.5)
    found = Measured(1e5, 1e4, 250.0, True, 60.0, True, 0.01, 5e-3, 6.4, 200.0, intensity=off)
    monkeypatch.chdir(tmp_path)
    trimesh.creation.box((20, 20, 30)).export("box.stl")
    monkeypatch.setattr("chamberopt.cli.teller.compile_with_message", lambda *_: None)
    monkeypatch.setattr("chamberopt.workflows.propose.measure_budget", lambda *_: found)
    monkeypatch.setattr("chamberopt.workflows.propose.predict_intensity", lambda *_: None)
    monkeypatch.setattr("chamberopt.workflows.propose.draw_target", lambda *_: "no picture")
    words = ["new", "box.stl", "--unit", "mm", "--material", "Ti-6Al-4V"]
    monkeypatch.setattr("chamberopt.common.progress._json_lines", True)
    assert main(words) == 0
    said, remarks = capfd.readouterr()
    begun = [line for line in remarks.splitlines() if '"done"' in line]
    numbers = [int(one) for one in re.findall(r'"step (\d) of 7: ', "".join(begun))]
    assert numbers == sorted(numbers) == [1, 2, 3, 4, 5, 6, 7]
    assert sum("reading the part" in line for line in begun) == 2  # of the stage, and in it
    assert "intensity    expected 0.9 mmA, within a factor of 2.5\n" in said
    assert "OUTSIDE THE USUAL RANGE, 0.15-0.25A, usual for titanium" in " ".join(said.split())
    assert main([*words, "--intensity", "usual", "--out", "asked"]) == 2
    assert "--intensity: the shot hardly dents a strip" in capfd.readouterr().err
    assert not Path("asked").exists()


@pytest.mark.long
@pytest.mark.parametrize("name", [*EIGHT_PARTS, *KEPT_ASIDE, *FOUR_PARTS, *MORE_PARTS])
def test_from_file_to_process_sheet(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The eight parts of the tutorial's readers, and those kept aside: no file is edited."""
    monkeypatch.chdir(tmp_path)
    one: ExamplePart = {**EIGHT_PARTS, **KEPT_ASIDE, **FOUR_PARTS, **MORE_PARTS}[name]
    part, unit = one.write(tmp_path), one.unit or "guess"
    assert main(["new", str(part), "--out", "new", "--unit", unit]) == 0
    size = np.ptp(read_part(part, unit).vertices, axis=0)
    assert 1e3 * size == pytest.approx(one.size_mm, abs=0.1)
    assert main(["check", "new/design.toml"]) == 0
    assert main(["simulate", "new/design.toml", "--no-ranges", "--out", "simulated"]) == 0
    study = Path("new/study.toml")
    study.write_text(study.read_text().replace("evaluations = 20", "evaluations = 8"))
    assert main(["run", str(study), "--no-ranges", "--out", "studied"]) == 0
    assert main(["report", "studied", "--sheet"]) == 0

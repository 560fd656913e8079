"""STEP files: unit, names, colours, assemblies, how fine the triangles are, a missing library."""

import math
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from chamberopt.chamber.layout.target import surfaces
from chamberopt.chamber.part import chosen_triangles, posed_part
from chamberopt.common.errors import InputError
from chamberopt.design.part import Selection
from chamberopt.export.frame import frame_of
from chamberopt.geometry.meshes import step_tessellation
from chamberopt.geometry.meshes.native_reader import LEAST_SECONDS
from chamberopt.geometry.meshes.part_mesh import PartMesh, read_part
from chamberopt.geometry.meshes.step import READER, StepFace, _decoded, _face_names, read_solids
from chamberopt.geometry.meshes.step_tessellation import Tessellation
from chamberopt.geometry.remesh import remesh, triangle_quality
from chamberopt.geometry.solids import split_bodies, unite
from chamberopt.geometry.triangles import areas, side_pairs, unit_normals, unit_vectors
from tests.helpers.eight_parts import EIGHT_PARTS, KEPT_ASIDE
from tests.helpers.mesh_files import SIDES, named_area, step_of_a_box, written
from tests.helpers.synthetic import plate_design

INCH = (
    "(CONVERSION_BASED_UNIT('INCH',#90)LENGTH_UNIT()NAMED_UNIT(#91));"
    "#90=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#92);"
    "#91=DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.);"
    "#92=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))"
)
SI = "(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT({},.METRE.))"
RIM_RADIUS = 0.150
BROACHED = np.array([math.sin(math.radians(8.0)), 0.0, math.cos(math.radians(8.0))])
GEAR_AND_TREE = "helical_gear", "fir_tree"
COARSE = Tessellation(1e-4, math.radians(25.0))


@pytest.fixture(scope="module", autouse=True)
def _gmsh() -> None:
    pytest.importorskip("gmsh", exc_type=(ImportError, OSError))


@pytest.fixture(scope="module")
def fir_tree(tmp_path_factory: pytest.TempPathFactory) -> PartMesh:
    return read_part(EIGHT_PARTS["fir_tree"].write(tmp_path_factory.mktemp("cad")), how=COARSE)


def corners_of(part: PartMesh, name: str) -> np.ndarray:
    return part.vertices[part.triangles[part.groups[name]]]


def below_rim(places: np.ndarray) -> np.ndarray:
    """Depth [m] of places (..., 3) below the disc's rim, an arc that moves along x as z grows."""
    x = places[..., 0] - places[..., 2] * math.tan(math.radians(8.0))
    return RIM_RADIUS - np.hypot(x, places[..., 1])


@pytest.mark.parametrize(
    ("stated", "unit", "metres"), [(SI.format(".CENTI."), "cm", 1e-2), (INCH, "in", 0.0254)]
)
def test_the_unit_is_the_files_and_exports_come_out_in_it(
    tmp_path: Path, stated: str, unit: str, metres: float, capfd: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path / "block.stp", step_of_a_box(stated))

    part = read_part(path)

    assert part.unit == unit
    assert part.size == pytest.approx(np.array(SIDES) * metres, rel=1e-6)
    assert part.groups["block"].all()
    assert any("unit stated by the file" in note for note in part.notes)
    assert capfd.readouterr().out == ""  # Gmsh is kept from stdout
    with pytest.raises(InputError, match=f"part.unit is 'um', but the file says .* '{unit}'"):
        read_part(path, "um")


def test_an_export_gives_back_the_numbers_of_the_file(tmp_path: Path) -> None:
    path = written(tmp_path / "block.stp", step_of_a_box(INCH))
    design = plate_design(part__mesh=str(path), part__unit="guess", part__rotate_deg=(0, 90, 0))

    part, _ = posed_part(design.changed({"part.target": {"surface": "block"}}))

    frame = frame_of("part", part)
    exported = frame.positions(part.vertices)
    assert frame.unit == "in"
    assert exported.min(axis=0) == pytest.approx([0, 0, 0], abs=1e-6)
    assert exported.max(axis=0) == pytest.approx(SIDES, rel=1e-6)


def test_names_and_colours_of_faces_choose_the_same_faces(fir_tree: PartMesh) -> None:
    assert (fir_tree.groups["FIR_TREE"] == fir_tree.groups["#ff0000"]).all()
    assert (fir_tree.groups["RIM"] == fir_tree.groups["#008000"]).all()
    assert fir_tree.groups["DISC_SEGMENT"].all()
    assert below_rim(corners_of(fir_tree, "RIM")) == pytest.approx(0.0, abs=1e-8)
    assert named_area(fir_tree, "BORE") == pytest.approx(
        0.112 * math.radians(20.0) * 0.026, rel=1e-4
    )


def test_an_assembly_is_placed_and_its_products_are_named(tmp_path: Path) -> None:
    part = read_part(KEPT_ASIDE["stepped_shaft"].write(tmp_path), how=COARSE)

    corners = part.vertices[part.triangles[part.groups["KEY"]]].reshape(-1, 3)
    assert part.unit == "in"
    assert corners.min(axis=0) == pytest.approx([8.6e-3, -4.01e-3, 5.99e-3], abs=1e-8)
    assert (part.groups["KEY"] != part.groups["SHAFT"]).all()


def test_bodies_that_touch_are_one_part(tmp_path: Path) -> None:
    text = step_of_a_box(SI.format(".MILLI."), heights=(0.0, SIDES[2]))

    part = read_part(written(tmp_path / "two.step", text))

    bodies, voids = split_bodies(part.vertices, part.triangles, "two")
    assert (len(bodies), voids) == (2, 0)
    assert unite(bodies, "two").volume == pytest.approx(2 * np.prod(SIDES) * 1e-9)


def test_triangles_are_fine_in_fillets_and_coarse_on_planes(fir_tree: PartMesh) -> None:
    corners = fir_tree.vertices[fir_tree.triangles]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    quality = triangle_quality(fir_tree.vertices, fir_tree.triangles)
    normals = unit_normals(corners)
    a, b = (side_pairs(fir_tree.triangles) // 3).T
    inside = fir_tree.groups["FIR_TREE"][a] & fir_tree.groups["FIR_TREE"][b]
    turn = np.degrees(np.arccos(np.clip((normals[a] * normals[b]).sum(axis=1), -1, 1)))[inside]
    diagonal = np.linalg.norm(fir_tree.size)

    middle = corners_of(fir_tree, "RIM").mean(axis=1)
    assert 0.0 < below_rim(middle).max() < COARSE.chord
    assert np.percentile(turn, 99.5) < 1.1 * math.degrees(COARSE.angle)
    assert sides.max() < 2.0 * diagonal / 40.0
    shortest = sides.min(axis=1)
    assert np.median(shortest[fir_tree.groups["FRONT"]]) > 1.5 * np.median(
        shortest[fir_tree.groups["FIR_TREE"]]
    )
    assert areas(fir_tree.vertices, fir_tree.triangles).max() < 5e-6  # no slivers over a slot
    assert np.percentile(quality, 1) > 0.1


def test_a_fillet_is_fine_across_and_coarse_along(fir_tree: PartMesh) -> None:
    corners = corners_of(fir_tree, "FIR_TREE")
    steps = corners - np.roll(corners, 1, axis=1)
    along = np.abs(unit_vectors(steps.reshape(-1, 3)) @ BROACHED) > 0.999
    lengths = np.linalg.norm(steps.reshape(-1, 3), axis=1)
    rough, steep = 0.026 / math.cos(math.radians(8.0)), 0.0018

    assert np.median(lengths[along]) == pytest.approx(rough / math.ceil(rough / steep), rel=0.1)
    assert len(corners) < 4000  # a mesh of equal sides has 10,000


def test_a_large_element_makes_fewer_triangles_of_a_target(fir_tree: PartMesh) -> None:
    target = fir_tree.groups["FRONT"]

    source = remesh(fir_tree.vertices, fir_tree.triangles, target, target, 4e-3)[2]

    assert target[source].sum() < 0.75 * target.sum()


def test_a_finer_chord_makes_more_triangles_nearer_to_the_surface(tmp_path: Path) -> None:
    path = KEPT_ASIDE["stepped_shaft"].write(tmp_path)
    counts, distances = [], []
    for chord in (2e-4, 8e-5):
        part = read_part(path, how=Tessellation(chord, math.radians(40.0), 0.01))
        middle = part.vertices[part.triangles].mean(axis=1)
        # its middle is a cylinder of 19.05 mm
        straight = (np.abs(middle[:, 2] - 0.048) < 0.012) & part.groups["SHAFT"]
        distances.append(float((0.01905 - np.linalg.norm(middle[straight, :2], axis=1)).max()))
        counts.append(int(straight.sum()))
        assert 0.3 * chord < distances[-1] < chord
    assert counts[1] > 2 * counts[0]


def test_planes_hold_as_many_triangles_as_their_side_asks_for(tmp_path: Path) -> None:
    """An area A holds 4 A / sqrt(3) s² equilateral triangles of side s."""
    path = written(tmp_path / "block.step", step_of_a_box(SI.format(".MILLI.")))
    a, b, c = 1e-3 * np.array(SIDES)
    expected = 8.0 * (a * b + b * c + c * a) / math.sqrt(3.0)
    side = 0.1 * min(a, b, c)
    part = read_part(path, how=Tessellation(side=side))
    assert len(part.triangles) == pytest.approx(expected / side**2, rel=0.3)
    with pytest.raises(InputError, match="million triangles") as told:
        read_part(path, how=Tessellation(side=1e-3 * side))
    count = float(str(told.value).split("about ")[1].split(" million")[0])
    assert count == pytest.approx(expected / side**2, rel=0.01)  # in millions


@pytest.mark.parametrize("backwards", [False, True])
def test_all_edges_of_a_long_chain_of_grids_get_the_rows_of_the_finest(
    monkeypatch: pytest.MonkeyPatch, backwards: bool
) -> None:
    """40 faces in a row, each of which shares an edge with the next; only the last wants 7 rows.

    Across the row each face has edges of its own, with as many rows as it wants itself.
    """
    count = 40

    def grid(_model: object, face: int, _side: object) -> list[tuple[int, int, int]]:
        own = 1000 + 2 * face
        return [(face, face + 1, 7 if face == count else 2), (own, own + 1, face)]

    rows: dict[int, int] = {}
    mesh = SimpleNamespace(
        setTransfiniteCurve=rows.__setitem__, setTransfiniteSurface=lambda *_: None
    )
    model = SimpleNamespace(getType=lambda *_: "Cylinder", mesh=mesh)
    monkeypatch.setattr(step_tessellation, "_find_grid", grid)
    faces = list(range(1, count + 1))
    step_tessellation.lay_grids(model, faces[::-1] if backwards else faces, lambda _: 1.0)  # type: ignore[arg-type]
    # Gmsh counts points, which are one more than rows.
    assert {rows[edge] for edge in range(1, count + 2)} == {7 + 1}
    assert all(rows[1000 + 2 * k] == rows[1001 + 2 * k] == k + 1 for k in faces)


@pytest.mark.parametrize(
    ("how", "remedy"),
    [
        (
            Tessellation(side=1e-5),
            r"million triangles, at most 2 are made; .*\.side_mm = 0\.\d+ or",
        ),
        (Tessellation(1e-7, math.radians(1.0), 1e-2), r"chord_mm = 0\.\d+ or more"),
    ],
)
def test_too_many_triangles_are_told_before_they_are_made(
    how: Tessellation, remedy: str, tmp_path: Path
) -> None:
    path = KEPT_ASIDE["stepped_shaft"].write(tmp_path)
    with pytest.raises(InputError, match=remedy):
        read_part(path, how=how)


def test_the_mesher_ends_with_the_command(tmp_path: Path) -> None:
    """However that ends, and without its temporary folder."""
    read = (
        "import tempfile; from pathlib import Path\n"
        "from chamberopt.geometry.meshes.native_reader import NativeReader, read_in_child\n"
        "from tests.helpers.worker_jobs import wait_beside\n"
        f"tempfile.tempdir = {str(tmp_path)!r}\n"
        "read_in_child(NativeReader(wait_beside, 'a', '', 1.0), Path('a'), b'x')"
    )
    with subprocess.Popen([sys.executable, "-c", read], cwd=Path(__file__).parents[4]) as command:
        _wait_until(lambda: any(tmp_path.glob("*/waiting")))
        command.kill()
    _wait_until(lambda: not any(tmp_path.iterdir()))


def damaged_fir_tree(folder: Path) -> Path:
    """A fir tree that Gmsh never finishes: a direction of 1.E12, and a face less."""
    text = EIGHT_PARTS["fir_tree"].write(folder).read_text()
    for line, damaged in (
        ("#1593 = DIRECTION('',(0.,0.,-1.));\n", "#1593 = DIRECTION('',(0.,1.E12,-1.));\n"),
        ("#763 = ADVANCED_FACE('FIR_TREE',(#764),#791,.F.);\n", ""),
    ):
        assert text.count(line) == 1
        text = text.replace(line, damaged)
    return written(folder / "damaged.step", text)


def test_a_file_that_never_ends_is_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CHAMBEROPT_READER_S", "4")
    with pytest.raises(InputError, match=r"damaged\.step: .*4 s of computing .*damaged.*READER_S"):
        read_part(damaged_fir_tree(tmp_path))
    monkeypatch.setenv("CHAMBEROPT_READER_S", "soon")
    with pytest.raises(InputError, match="CHAMBEROPT_READER_S: given 'soon'; give seconds"):
        read_part(EIGHT_PARTS["fir_tree"].write(tmp_path))


@pytest.mark.long
def test_a_file_that_never_ends_is_given_up_within_its_budget(tmp_path: Path) -> None:
    began = time.process_time(), os.times().children_user
    with pytest.raises(InputError, match=r"longer than a sound file of 0\.097 MB"):
        read_part(damaged_fir_tree(tmp_path))
    assert time.process_time() - began[0] + os.times().children_user - began[1] < 90.0


@pytest.mark.long
@pytest.mark.parametrize("name", ["fir_tree", "helical_gear", "knee_tray", "stepped_shaft"])
def test_a_sound_file_takes_a_tenth_of_its_budget(name: str, tmp_path: Path) -> None:
    path = {**EIGHT_PARTS, **KEPT_ASIDE}[name].write(tmp_path)
    before = os.times().children_user
    read_part(path)
    budget = LEAST_SECONDS + READER.seconds_per_mb * 1e-6 * path.stat().st_size
    assert os.times().children_user - before < 0.1 * budget


def _wait_until(is_so: Callable[[], bool]) -> None:
    end = time.monotonic() + 30.0
    while not is_so():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_how_fine_is_for_files_of_cad_alone(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"part\.tessellation is for STEP, and the file is STL"):
        read_part(EIGHT_PARTS["hip_stem"].write(tmp_path), how=COARSE)


def test_a_sketch_beside_a_solid_is_left_out(tmp_path: Path) -> None:
    code = (
        "import gmsh, sys; gmsh.initialize(); gmsh.option.setNumber('General.Verbosity', 0); "
        "gmsh.model.occ.addBox(0, 0, 0, 10, 10, 10); gmsh.model.occ.addRectangle(20, 0, 0, 5, 5); "
        "gmsh.model.occ.synchronize(); gmsh.write(sys.argv[1])"
    )
    path = tmp_path / "sketch.step"
    subprocess.run([sys.executable, "-c", code, str(path)], check=True)
    part = read_part(path)
    assert part.size == pytest.approx([1e-2, 1e-2, 1e-2])
    assert any("1 face beside the solids" in note for note in part.notes)


def test_a_damaged_file_says_so(tmp_path: Path) -> None:
    text = step_of_a_box(SI.format(".MILLI."))

    with pytest.raises(
        InputError, match=r"part\.step: cannot be meshed \(Could not read it\); the file is damaged"
    ):
        read_part(written(tmp_path / "part.step", text[: len(text) // 2]))


def test_names_are_read_as_written() -> None:
    text = (
        r"#1=PLANE('',#9);#2=ADVANCED_FACE('Zahn\X2\00FC\X0\ ''a''; b',(#8),#1,.T.);"
        r"#3 = ADVANCED_FACE ( 'NONE', (#8), #1, .T. ) ;"
        r"#4=CLOSED_SHELL('',(#2,#3));#5=MANIFOLD_SOLID_BREP('x',#4);"
    )

    (faces,) = read_solids(text)

    assert [face.name for face in faces] == ["Zahnü 'a'; b", ""]


@pytest.mark.parametrize(
    ("given", "name"),
    [
        (r"\X2\00E9683C\X0\!", "é格!"),
        (r"\X4\0001F600\X0\!", "😀!"),
        (r"\X2\D83D\X0\ half", "\ufffd half"),  # and the part is read all the same
        (r"\S\a \X\E4", "á ä"),
        (r"back\\slash \\X\\41", r"back\slash \X\41"),
        ("it''s a\n long\r\x07 name", "it's a long name"),
        ("Flügel é", "Flügel é"),
        (r"none", ""),
    ],
)
def test_each_escape_of_a_name_is_read(given: str, name: str) -> None:
    assert _decoded(given) == name


def test_names_are_left_out_where_the_faces_are_not_certain(tmp_path: Path) -> None:
    text = step_of_a_box(SI.format(".MILLI.")).replace("FACE_SURFACE(''", "FACE_SURFACE('top'", 1)
    path = written(tmp_path / "block.step", text)

    part = read_part(path)
    assert named_area(part, "top") == pytest.approx(600e-6)
    assert _face_names([[StepFace("a", np.zeros(3))] * 6], np.eye(6)[:, :3]) is None


def test_step_without_its_library_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "gmsh", None)

    with pytest.raises(InputError, match=r"pip install 'chamberopt\[cad\]'"):
        read_part(written(tmp_path / "part.step", "ISO-10303-21;"))


def test_the_faces_of_a_step_file_end_where_it_says_although_they_go_on_smoothly(
    tmp_path: Path,
) -> None:
    """Two fillets of 2.5 mm round shafts of 12.7 and 15 mm: their area is by Pappus's theorem."""
    mesh = read_part(KEPT_ASIDE["stepped_shaft"].write(tmp_path))
    faces, creased = mesh.faces(None), mesh.faces(30.0)
    assert faces.count == len(np.unique(mesh.numbering.cad_face)) == 20
    assert creased.count < faces.count
    (fillets,) = (one for one in surfaces(mesh) if one.name.startswith("fillets"))
    assert fillets.name == "fillets of 2.5 mm"
    radius, shafts = 2.5e-3, (12.7e-3, 15e-3)
    ways = [2.0 * math.pi * (one + radius - 2.0 / math.pi * radius) for one in shafts]
    exact = 0.5 * math.pi * radius * sum(ways)
    found = areas(mesh.vertices, mesh.triangles)[fillets.triangles].sum()
    assert found == pytest.approx(exact, rel=2e-3)
    # Their keys choose them in a design, and a finer division keeps the faces.
    keys = Selection.model_validate(fillets.keys)
    assert (chosen_triangles(mesh, keys) == fillets.triangles).all()
    twice = np.repeat(np.arange(len(mesh.triangles)), 2)
    cad_face = mesh.divided(mesh.vertices, mesh.triangles[twice], twice).numbering.cad_face
    assert cad_face is not None
    assert (cad_face[::2] == mesh.numbering.cad_face).all()


def test_no_other_hollow_of_a_part_is_a_fillet(tmp_path: Path) -> None:
    """Not the bore of a gear, nor flanks; round the tree of a disc are two radii."""
    gear, tree = (read_part(EIGHT_PARTS[name].write(tmp_path)) for name in GEAR_AND_TREE)
    assert not [one.name for one in surfaces(gear) if one.name.startswith("fillets")]
    names = [one.name for one in surfaces(tree) if one.name.startswith("fillets")]
    assert sorted(names) == ["fillets of 1 mm", "fillets of 2.99 mm"]

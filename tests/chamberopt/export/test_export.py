"""Exported impacts, chambers and studies, read back with the libraries that others use.

The part's file is the plate in inches, lying on its side far from its origin, so that its frame
differs from the chamber's in every respect.
"""

import gzip
import json
import shutil
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
import trimesh
from lxml import etree

import chamberopt as toolkit
from chamberopt.chamber.analytic import analytic_cavity
from chamberopt.chamber.build import build_chamber
from chamberopt.cli import main
from chamberopt.common.errors import InputError
from chamberopt.common.executor import SerialExecutor, local_executor
from chamberopt.coverage.part_impacts import load_hits
from chamberopt.design.load import Design
from chamberopt.export.chamber_files import (
    read_cavity,
    write_3mf,
    write_cavity,
    write_stl_per_surface,
)
from chamberopt.export.formats import FrameName
from chamberopt.export.impacts_table import ROWS_AT_ONCE, write_impacts
from chamberopt.results.load import load_result
from chamberopt.results.rebuild import rebuild_chamber
from chamberopt.results.vtp_files import pyvista
from chamberopt.search.study import Study
from chamberopt.simulation.evaluate import evaluate
from chamberopt.workflows.save_run import save_simulation, save_study
from tests.helpers.results.digests import replace_result
from tests.helpers.studies import run_in_folder
from tests.helpers.synthetic import DESIGNS, plate_design, poisson_evaluation

INCH = 25.4  # mm
Said = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with the part's file; no pictures are drawn."""
    folder = tmp_path_factory.mktemp("export")
    plate = trimesh.load_mesh(DESIGNS / "parts" / "plate.stl", process=False)
    plate.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    plate.apply_translation([500.0, -200.0, 90.0])
    plate.apply_scale(1.0 / INCH)
    plate.export(folder / "plate.stl")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("chamberopt.workflows.save_run._draw_coverage", lambda *_: [])
        yield folder


@pytest.fixture(scope="module")
def design(place: Path) -> Design:
    data = plate_design(shot__mass_g=6.0).model_dump()
    data["part"] = {
        "mesh": str(place / "plate.stl"),
        "unit": "in",
        "rotate_deg": (0.0, -90.0, 25.0),
        "offset_mm": (1.5, -2.0),
        "target": {"reachable": True},
    }
    data["effects"]["roughness"] = None  # so that the surface tells the normal of each hit
    data["process"]["accuracy"] |= {"replicas": 3, "simulated_time_s": 0.2, "warmup_time_s": 0.01}
    return Design.model_validate(data)


@pytest.fixture(scope="module")
def simulated(place: Path, design: Design) -> Path:
    chamber = build_chamber(design)
    save_simulation(
        place / "simulated", design, chamber, evaluate(design, chamber, SerialExecutor())
    )
    return place / "simulated"


@pytest.fixture(scope="module")
def study(place: Path, design: Design) -> Path:
    question = Study(
        design=design,
        vary={"shot.mass_g": (3.0, 6.5), "chamber.diameter_mm": (40.0, 55.0)},
        optimizer={"evaluations": 4, "confirm": 1, "confirm_replicas": 4},
    )
    save_study(place / "study", run_in_folder(question, place / "study", SerialExecutor()))
    return place / "study"


@pytest.fixture
def chamberopt(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Said:
    """Runs a command in this process, in an empty folder: status, stdout, stderr."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments: object) -> tuple[int, str, str]:
        status = main([str(argument) for argument in arguments])
        return status, *capsys.readouterr()

    return call


def table_of(folder: Path, file: Path, frame: FrameName = "part") -> dict[str, np.ndarray]:
    """The impacts of a results folder, by way of a Parquet file."""
    result = load_result(folder)
    count = write_impacts([file], result, rebuild_chamber(result), SerialExecutor(), frame=frame)
    table = pyarrow.parquet.read_table(file)
    assert table.num_rows == count > 100
    return {name: table[name].to_numpy() for name in table.column_names}


def columns(table: dict[str, np.ndarray], *names: str) -> np.ndarray:
    return np.stack([table[name] for name in names], axis=1).astype(float)


def require_result_again(folder: Path, table: dict[str, np.ndarray]) -> None:
    part, hits = pyvista().read(folder / "part.vtp"), load_hits(folder / "hits.npz").hits
    on_each = np.bincount(table["triangle"], minlength=part.n_cells)
    np.testing.assert_array_equal(on_each, part["impacts"])
    dented = table["triangle"][table["dent_diameter_um"] > 0.0]
    np.testing.assert_array_equal(np.bincount(dented, minlength=part.n_cells), part["dents"])
    order = np.argsort(table["triangle"], kind="stable")
    np.testing.assert_array_equal(table["normal_speed_m_s"][order], hits.speed)


def test_the_rows_give_the_figures_of_the_result(simulated: Path, tmp_path: Path) -> None:
    table = table_of(simulated, tmp_path / "i.parquet")
    require_result_again(simulated, table)
    assert np.unique(table["replica"]).tolist() == [0, 1, 2]
    for number in range(3):
        time = table["time_s"][table["replica"] == number]
        assert (np.diff(time) >= 0.0).all()
        assert 0.0 <= time[0] < time[-1] <= 0.2
    assert set(table["ball_diameter_mm"]) == {3.0}


def test_places_and_velocities_are_those_of_the_parts_file(
    simulated: Path, place: Path, tmp_path: Path
) -> None:
    part = trimesh.load_mesh(place / "plate.stl", process=False)
    table = table_of(simulated, tmp_path / "i.parquet")
    at, velocity = (
        columns(table, "x_in", "y_in", "z_in"),
        columns(table, "vx_m_s", "vy_m_s", "vz_m_s"),
    )
    nearest = trimesh.triangles.closest_point(part.triangles[table["triangle"]], at)
    assert np.abs(nearest - at).max() < 2e-6  # float32 in the STL file: 20 in are told to 1e-6
    across = (velocity * part.face_normals[table["triangle"]]).sum(axis=1)
    np.testing.assert_allclose(across, -table["normal_speed_m_s"], atol=2e-6)
    speed = np.linalg.norm(velocity, axis=1)
    np.testing.assert_allclose(np.sin(np.radians(table["angle_deg"])), -across / speed, atol=1e-5)


def test_in_the_chambers_frame_they_lie_on_part_vtp(simulated: Path, tmp_path: Path) -> None:
    surface = pyvista().read(simulated / "part.vtp")
    corners = np.asarray(surface.points)[surface.regular_faces]
    table = table_of(simulated, tmp_path / "i.parquet", "chamber")
    at = columns(table, "x_mm", "y_mm", "z_mm")
    nearest = trimesh.triangles.closest_point(corners[table["triangle"]], at)
    assert np.abs(nearest - at).max() < 1e-9
    np.testing.assert_allclose(
        table["vz_m_s"], table["normal_speed_m_s"]
    )  # up against the plate's lower face


def test_what_the_parquet_file_says_of_itself(
    simulated: Path, design: Design, tmp_path: Path
) -> None:
    table_of(simulated, tmp_path / "i.parquet")
    schema = pyarrow.parquet.read_schema(tmp_path / "i.parquet")
    about = json.loads(schema.metadata[b"chamberopt"])
    assert about["length_unit"] == "in"
    assert about["frame"].startswith("part: ")
    assert (about["seed"], about["stream"], about["replicas"], about["same_as_result"]) == (
        1,
        "search",
        3,
        True,
    )
    assert about["simulated_time_s"] == pytest.approx(0.6)
    assert about["design"]["shot"]["mass_g"] == 6.0
    assert about["versions"]["chamberopt"]
    assert list(about["columns"]) == schema.names
    assert b"meaning" in schema.field("x_in").metadata
    parts = pyarrow.parquet.ParquetFile(tmp_path / "i.parquet").metadata
    assert parts.row_group(0).column(0).compression == "ZSTD"
    assert max(parts.row_group(k).num_rows for k in range(parts.num_row_groups)) <= ROWS_AT_ONCE


def test_csv_holds_what_parquet_holds_whatever_the_number_of_workers(
    simulated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("chamberopt.export.impacts_table.ROWS_AT_ONCE", 100)  # many pieces
    result = load_result(simulated)
    ground = rebuild_chamber(result)
    files = [tmp_path / name for name in ("i.csv", "i.csv.gz", "i.parquet")]
    write_impacts(files, result, ground, SerialExecutor())
    monkeypatch.setattr(
        "chamberopt.results.impacts.MAX_IMPACTS_IN_MEMORY", 1.0
    )  # nor are all replicas in memory
    with local_executor(2) as executor:
        write_impacts([tmp_path / "two.csv.gz"], result, ground, executor)
    assert (tmp_path / "two.csv.gz").read_bytes() == (tmp_path / "i.csv.gz").read_bytes()
    assert (
        gzip.decompress((tmp_path / "i.csv.gz").read_bytes()) == (tmp_path / "i.csv").read_bytes()
    )
    read = np.genfromtxt(tmp_path / "i.csv", delimiter=",", names=True)
    table = pyarrow.parquet.read_table(tmp_path / "i.parquet")
    assert list(read.dtype.names) == table.column_names
    for name in table.column_names:
        np.testing.assert_allclose(
            read[name], table[name].to_numpy(), rtol=1e-5, atol=1e-12, err_msg=name
        )
    about = json.loads((tmp_path / "i.csv.json").read_text(encoding="utf-8"))
    schema = pyarrow.parquet.read_schema(tmp_path / "i.parquet")
    assert about == json.loads(schema.metadata[b"chamberopt"])


def test_endings_in_capitals_mean_the_same(simulated: Path, tmp_path: Path) -> None:
    result = load_result(simulated)
    files = [tmp_path / name for name in ("I.PARQUET", "I.CSV.GZ")]
    written = write_impacts(files, result, rebuild_chamber(result), SerialExecutor(), replicas=1)
    assert pyarrow.parquet.read_table(files[0]).num_rows == written
    assert gzip.decompress(files[1].read_bytes()).count(b"\n") == written + 1


def test_a_study_gives_the_impacts_of_its_best_and_of_its_start(
    study: Path, tmp_path: Path
) -> None:
    for folder in (study, study / "start"):
        table = table_of(folder, tmp_path / f"{folder.name}.parquet")
        require_result_again(folder, table)
        assert table["replica"].max() == load_result(folder).record.replicas - 1


def test_an_analytical_cavity_gives_its_own_impacts(place: Path, tmp_path: Path) -> None:
    design = plate_design(process__accuracy__replicas=3, process__accuracy__simulated_time_s=0.2)
    chamber = build_chamber(design)
    evaluation = evaluate(
        design, chamber, SerialExecutor(), cavity=analytic_cavity(design, chamber)
    )
    save_simulation(place / "analytic", design, chamber, evaluation)
    table = table_of(place / "analytic", tmp_path / "i.parquet")
    require_result_again(place / "analytic", table)
    assert np.abs(table["z_mm"]).max() < 1e-9  # the plate's lower face, in its file


def altered(folder: Path, copy: Path, change: Callable[[dict], None]) -> Path:
    """A copy of a results folder that says something else."""
    shutil.copytree(folder, copy)
    data = json.loads((copy / "result.json").read_text(encoding="utf-8"))
    change(data)
    replace_result(copy, data)
    return copy


def test_impacts_that_are_not_the_results_are_not_handed_on(
    simulated: Path, chamberopt: Said, tmp_path: Path
) -> None:
    folder = altered(
        simulated, tmp_path / "copy", lambda data: data["design"]["shot"].update(mass_g=5.0)
    )
    formats = ["--to", "impacts-parquet", "--to", "impacts-csv"]
    status, out, err = chamberopt("export", folder, *formats)
    err = err.splitlines()[-1]  # after what is said of compiling
    assert (status, out) == (2, "")
    assert "does not simulate it again bit for bit: the impacts on" in err
    assert "simulate the design again" in err
    assert not (tmp_path / "results" / "copy-export").exists()
    status, _, err = chamberopt(
        "export", folder, "--to", "impacts-csv", "--replicas", "2", "--out", "two.csv"
    )
    assert (status, err.splitlines()[-1]) == (
        0,
        "only 2 of 3 replicas: not compared with the result",
    )
    assert json.loads(Path("two.csv.json").read_text(encoding="utf-8"))["same_as_result"] is False
    status, _, err = chamberopt("export", folder, "--to", "impacts-csv", "--replicas", "4")
    assert (status, "--replicas: given 4; the result has 3, give 1 to 3" in err) == (2, True)


def test_several_formats_into_a_new_folder(simulated: Path, chamberopt: Said) -> None:
    formats = [
        "impacts-parquet",
        "impacts-csv",
        "chamber-stl",
        "chamber-stl-per-tag",
        "chamber-3mf",
    ]
    asked = [word for name in formats for word in ("--to", name)]
    status, out, err = chamberopt("export", simulated, *asked, "--json", "--workers", "1")
    told = json.loads(out)
    assert (status, err, list(told["files"])) == (0, "", formats)
    assert told["files"]["impacts-csv"] == str(Path("results/simulated-export/impacts.csv"))
    assert all(Path(file).exists() for file in told["files"].values())
    assert told["impacts"] == len(Path(told["files"]["impacts-csv"]).read_text().splitlines()) - 1
    status, out, _ = chamberopt("export", simulated, "--to", "chamber-stl")
    assert (status, out.split()) == (
        0,
        ["chamber-stl", str(Path("results/simulated-export-2/chamber.stl"))],
    )


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--to", "impact-csv"], "--to: given 'impact-csv'; did you mean 'impacts-csv'?"),
        (["--to", "stl"], "--to: given 'stl'; "),
        ([], "--to"),
        (
            ["--to", "impacts-csv", "--out", "i.parquet"],
            "i.parquet: is not a file of impacts-csv; give a name in .csv or",
        ),
        (
            ["--to", "chamber-stl-per-tag", "--out", "i.stl"],
            "i.stl: is not a file of chamber-stl-per-tag; give a folder",
        ),
        (
            ["--to", "chamber-stl", "--to", "chamber-3mf", "--out", "c.stl"],
            "one file for 2 formats; give a folder",
        ),
        (
            ["--to", "chamber-stl", "--out", "there.stl"],
            "there.stl: already exists, and nothing is ever overwritten",
        ),
        (["--to", "impacts-csv", "--out", "there.csv"], "there.csv.json: already exists"),
        (
            ["--to", "chamber-stl", "--out", "nowhere/c.stl"],
            "the folder nowhere does not exist; make it first",
        ),
        (["--to", "chamber-stl", "--out", "full"], "full: already holds files"),
        (["--to", "study-csv"], "history.jsonl: is not there; give a study's results folder"),
        (["--to", "chamber-stl", "--frame", "room"], "--frame"),
        (["--to", "stress-solid"], "--to stress-solid: takes --mesh DECK, your own deck"),
        (["--to", "stress-csv", "--mesh", "deck.inp"], "--mesh: applies only to stress-solid"),
    ],
)
def test_wrong_calls_are_one_message(
    simulated: Path, chamberopt: Said, words: list[str], said: str
) -> None:
    Path("full").mkdir()
    for file in ("there.stl", "there.csv.json", "full/file"):
        Path(file).write_text("mine")
    status, out, err = chamberopt("export", simulated, *words)
    assert (status, out) == (2, "")
    assert said in err
    assert "Traceback" not in err
    assert Path("there.stl").read_text() == Path("there.csv.json").read_text() == "mine"
    assert not Path("results/simulated-export").exists()


def test_without_pyarrow(
    simulated: Path, chamberopt: Said, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("pyarrow", "pyarrow.parquet"):
        monkeypatch.setitem(sys.modules, name, None)
    status, _, err = chamberopt("export", simulated, "--to", "impacts-parquet")
    assert (status, "pyarrow is not installed: pip install 'chamberopt[parquet]'" in err) == (
        2,
        True,
    )
    assert not Path("results/simulated-export").exists()
    assert chamberopt("export", simulated, "--to", "impacts-csv")[0] == 0


def test_where_nothing_may_be_written(
    simulated: Path, chamberopt: Said, monkeypatch: pytest.MonkeyPatch
) -> None:
    def denied(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("chamberopt.common.files.claimed.tempfile.TemporaryFile", denied)
    for out in ("new", "c.stl"):
        status, _, err = chamberopt("export", simulated, "--to", "chamber-stl", "--out", out)
        assert (status, f"{out}: cannot be written: Permission denied" in err) == (2, True)


def test_the_whole_chamber_as_stl_and_3mf(study: Path, tmp_path: Path) -> None:
    volume = load_result(study).record.chamber.volume_mm3
    cavity = read_cavity(study)
    write_cavity(study, tmp_path / "c.stl")
    write_3mf(study, tmp_path / "c.3mf")
    stl, scene = trimesh.load_mesh(tmp_path / "c.stl"), trimesh.load_scene(tmp_path / "c.3mf")
    (body,) = scene.geometry.values()
    for mesh, exact in ((stl, 1e-6), (body, 1e-12)):
        assert len(mesh.faces) == len(cavity.triangles)
        assert mesh.is_watertight
        assert mesh.volume == pytest.approx(volume, rel=exact)
    assert scene.units in ("mm", "millimeter", "millimeters")
    np.testing.assert_array_equal(body.triangles, cavity.vertices[cavity.triangles])
    with zipfile.ZipFile(tmp_path / "c.3mf") as package:
        assert package.testzip() is None
        model = etree.fromstring(package.read("3D/3dmodel.model"))
    core = {"c": "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"}
    assert model.xpath("//c:object/@name", namespaces=core) == ["chamber"]
    names = model.xpath("//c:base/@name", namespaces=core)
    assert names == ["part", "sonotrode", "wall"]
    numbers = np.array([int(p) for p in model.xpath("//c:triangle/@p1", namespaces=core)])
    for number, name in enumerate(names):
        np.testing.assert_array_equal(numbers == number, cavity.surfaces[name])


def test_each_surface_as_stl_by_its_name(place: Path, tmp_path: Path) -> None:
    """Every triangle is in one of the files.

    The surfaces of two sonotrodes, a hole and a deflector are as the design says.
    """
    data = plate_design().model_dump()
    well = {
        "frequency_khz": 20,
        "amplitude_um": 20,
        "at_mm": (40, 0, 7),
        "axis": (-1, 0, 0),
        "diameter_mm": 6,
    }
    hole = {"at_mm": (0, 0, 8), "axis": (0, 1, 0), "diameter_mm": 4, "depth_mm": 12}
    floating = {"kind": "plate", "at_mm": (0, 0, 8), "size_mm": (6, 4, 2)}
    data["chamber"] |= {"holes": [hole], "deflectors": [floating]}
    design = Design.model_validate({**data, "sonotrodes": [well]})
    chamber = build_chamber(design)
    save_simulation(place / "fitted", design, chamber, poisson_evaluation(design, chamber))
    write_stl_per_surface(place / "fitted", tmp_path / "stl")
    read = {file.stem: trimesh.load_mesh(file) for file in (tmp_path / "stl").iterdir()}
    assert set(read) == {
        "part",
        "sonotrode",
        "wall",
        "sonotrodes.0",
        "chamber.holes.0",
        "chamber.deflectors.0",
    }
    assert sum(len(mesh.faces) for mesh in read.values()) == len(chamber.triangles)
    polygon = 64 / 2 * np.sin(2 * np.pi / 64)  # area of 64 corners on a circle of radius 1
    assert read["sonotrode"].area == pytest.approx(polygon * 25**2, rel=1e-5)
    assert read["sonotrodes.0"].area == pytest.approx(polygon * 3**2, rel=1e-5)
    assert read["part"].area == pytest.approx(chamber.exposed_area.sum() * 1e6, rel=1e-5)
    block = read["chamber.deflectors.0"]
    assert block.is_watertight
    assert block.volume == pytest.approx(
        -6 * 4 * 2, rel=1e-5
    )  # normals point out of the cavity, into the block
    bore = read["chamber.holes.0"].bounds
    # The bore goes 12 mm beyond the wall. A flat side of the chamber's polygon is nearer than its
    # radius.
    assert bore[1] == pytest.approx([2.0, 25.0 + 12.0, 10.0], abs=0.05)
    assert bore[0] == pytest.approx([-2.0, 25.0, 6.0], abs=0.2)


def test_the_study_as_a_table(study: Path, chamberopt: Said) -> None:
    status, out, _ = chamberopt("export", study, "--to", "study-csv", "--out", "s.csv")
    assert (status, out.split()) == (0, ["study-csv", "s.csv"])
    read = np.genfromtxt(
        "s.csv", delimiter=",", names=True, dtype=None, encoding="utf-8", deletechars=""
    )
    rows = [
        json.loads(line)
        for line in (study / "history.jsonl").read_text(encoding="utf-8").splitlines()
    ]
    assert read["stage"].tolist() == [row["stage"] for row in rows]
    np.testing.assert_array_equal(
        read["shot.mass_g"], [row["parameters"]["shot.mass_g"] for row in rows]
    )
    for name, metric in rows[0]["metrics"].items():
        assert read[name][0] == metric.get("in_words", metric["value"])
        assert f"{name}_pm" in read.dtype.names
    assert (read["seconds"] > 0.0).all()


def test_an_unfinished_study_and_a_sweep(study: Path, chamberopt: Said, tmp_path: Path) -> None:
    unfinished = tmp_path / "unfinished"
    shutil.copytree(study, unfinished)
    (unfinished / "result.json").unlink()
    sweep = altered(study, tmp_path / "sweep", lambda data: data.update(kind="sweep"))
    for folder, said in (
        (unfinished, "has not finished"),
        (sweep, "a sweep is a map of many candidates"),
    ):
        for name in ("impacts-csv", "chamber-stl"):
            status, _, err = chamberopt("export", folder, "--to", name)
            assert (status, said in err) == (2, True)
        assert (
            chamberopt("export", folder, "--to", "study-csv", "--out", f"{folder.name}.csv")[0] == 0
        )
        assert len(Path(f"{folder.name}.csv").read_text(encoding="utf-8").splitlines()) > 5


def test_from_python_the_frames_hold_what_the_files_hold(
    simulated: Path, study: Path, tmp_path: Path
) -> None:
    pandas = pytest.importorskip("pandas")
    result = toolkit.load_result(simulated)
    hits = toolkit.impacts(result, workers=1)
    for name, column in table_of(simulated, tmp_path / "i.parquet").items():
        assert hits[name].dtype == column.dtype
        np.testing.assert_array_equal(hits[name], column)
    assert hits.attrs["length_unit"] == "in"
    one = toolkit.impacts(result, frame="chamber", replicas=1, workers=1)
    np.testing.assert_array_equal(one["time_s"], hits["time_s"][hits["replica"] == 0])
    assert not one.attrs["same_as_result"]

    surface = pyvista().read(simulated / "part.vtp")
    values = toolkit.fields(result, frame="chamber")
    for name in ("coverage", "impacts", "target", "exposed_area_mm2"):
        np.testing.assert_array_equal(values[name], surface[name])
    centres = surface.cell_centers().points
    np.testing.assert_allclose(values[["x_mm", "y_mm", "z_mm"]], centres, atol=1e-9)
    assert values.attrs["columns"]["mean_normal_speed"].endswith("m/s")
    in_part = toolkit.fields(result)[["x_in", "y_in", "z_in"]].to_numpy()
    part = trimesh.load_mesh(load_result(simulated).design.part.mesh_path, process=False)
    np.testing.assert_allclose(in_part, part.triangles_center, atol=1e-9)

    for given in (study, str(study), toolkit.load_result(study)):
        found = toolkit.trials(given)
        assert found["number"].tolist() == list(range(1, len(found) + 1))
        written = pandas.read_csv(study / "history.csv", na_values=["never", "not resolved"])
        pandas.testing.assert_frame_equal(
            found[list(written)].drop(columns="reason"), written.drop(columns="reason"),
            check_dtype=False,
        )  # fmt: skip
        assert found["time_to_98_s"].dtype == float


def test_without_pandas(simulated: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    result = toolkit.load_result(simulated)
    for call in (toolkit.impacts, toolkit.fields, lambda one: toolkit.trials(one.folder)):
        with pytest.raises(InputError, match=r"pandas is not installed: .*chamberopt\[notebook\]"):
            call(result)

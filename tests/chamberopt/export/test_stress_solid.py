"""Initial stress in a user's own solids: read back, and CalculiX balances it as closed forms."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from chamberopt.cli import main
from chamberopt.common.errors import InputError
from chamberopt.coverage.stress_law import bending, integrals
from chamberopt.design.flexure import plate_metals
from chamberopt.export.stress import require_stress
from chamberopt.export.stress_solid import eigenstrain_at, peened_skin, write_solid_stress
from chamberopt.geometry.meshes.elements import EDGES
from chamberopt.results.arrays_file import load_result_arrays
from chamberopt.results.load import content_sha256, load_result
from tests.chamberopt.export.test_stress import saved
from tests.helpers.solid_decks import Tets, balanced, deck_of, hollow_ball, slab, with_middles

SIDE, HEIGHT = 40.0, 5.0  # mm
OUTER, INNER = 2.0, 1.2  # radii of a hollow ball [mm]
ROOM = {"shape": "cylinder", "diameter_mm": 70, "height_mm": 50, "sonotrode_distance_mm": 15}
with_calculix = pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")


def saved_part(folder: Path, part: trimesh.Trimesh, **changes: object) -> Path:
    """A result with random dents on all of a part that is peened where it faces the sonotrode."""
    part.export(folder / "part.stl")
    design = {"part.mesh": str(folder / "part.stl"), "part.unit": "mm", "chamber": ROOM}
    target = {"direction": [0, 0, -1], "angle_deg": [0, 10]}
    return saved(folder / "result", **{"part.target": target, **design, **changes})


@pytest.fixture(scope="module")
def plate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plate whose lower face is peened, turned in its chamber, with a zone at a corner."""
    box = trimesh.creation.box((SIDE, SIDE, HEIGHT))
    for _ in range(4):
        box = box.subdivide()
    corner = {"name": "corner", "target": {"box_mm": [[10, 10, -2.6], [21, 21, -2.4]]}}
    stress = {"thickness_mm": HEIGHT}
    turned = {"part.rotate_deg": [20.0, 0.0, 30.0]}
    place = tmp_path_factory.mktemp("plate")
    return saved_part(place, box, stress=stress, zones=[corner], **turned)


def profile_of(folder: Path) -> tuple[np.ndarray, np.ndarray, float]:
    """Depths [mm] and eigenstrain of the target of a result, and the depth of compression [mm]."""
    result = load_result(folder)
    assert result.record.stress is not None
    one = result.record.stress.profiles["the target"]
    layer = 1e-3 * result.metrics["compression_depth_um"].value
    return 1e-3 * np.array(one.depth_um), np.array(one.eigenstrain), layer


def elastic_of(folder: Path) -> tuple[float, float]:
    """Young's modulus [MPa] and Poisson's ratio of a result's part."""
    metals = plate_metals(load_result(folder).design)
    assert metals is not None
    return metals.part.modulus / 1e6, metals.part.poisson


def planes(thickness: float, core: int = 4) -> np.ndarray:
    """Heights of the planes of a plate, with layers of a thickness at its peened lower face."""
    skin = -HEIGHT / 2 + thickness * np.arange(round(0.15 / thickness + 0.5) + 1)
    return np.r_[skin, np.linspace(skin[-1], HEIGHT / 2, core + 1)[1:]]


def plate_mesh(thickness: float, sides: int = 8) -> Tets:
    across = np.linspace(-SIDE / 2, SIDE / 2, sides + 1)
    return slab(across, across, planes(thickness))


def exported(folder: Path, place: Path, text: str) -> list[str]:
    """Write stress.inp for a deck with this text, and return the remarks."""
    (place / "deck.inp").write_text(text)
    return write_solid_stress(folder, place / "stress.inp", place / "deck.inp")


def read_initial(file: Path) -> np.ndarray:
    """The rows of *INITIAL CONDITIONS, TYPE=STRESS: element, point and six components, (n, 8)."""
    head, _, rows = file.read_text().partition("*INITIAL CONDITIONS, TYPE=STRESS\n")
    assert all(line.startswith("**") for line in head.splitlines())
    return np.array([row.split(",") for row in rows.splitlines()], dtype=float)


def pinned(mesh: Tets, *places: tuple[float, float, float]) -> list[str]:
    """Lines of *BOUNDARY that hold a body at three nodes, near these places, and let it strain."""
    nodes = [int(((mesh[0] - place) ** 2).sum(axis=1).argmin()) + 1 for place in places]
    return [f"{node}, {first}, 3" for first, node in enumerate(nodes, start=1)]


def test_each_point_has_the_stress_of_its_depth(plate: Path, tmp_path: Path) -> None:
    mesh = plate_mesh(0.07)
    remarks = exported(plate, tmp_path, deck_of(mesh))
    rows = read_initial(tmp_path / "stress.inp")
    depth, strain, _ = profile_of(plate)
    modulus, poisson = elastic_of(plate)
    points, tets = mesh
    elements = rows[:, 0].astype(int) - 1001
    z = points[tets[elements]].mean(axis=1)[:, 2] + HEIGHT / 2
    e = np.interp(z, depth, strain)
    expected = np.outer(-modulus / (1 + poisson) * e, [1, 1, -2, 0, 0, 0])
    assert rows[:, 2:] == pytest.approx(expected, rel=2e-3, abs=1e-3)
    deep = (points[tets].mean(axis=1)[:, 2] + HEIGHT / 2) < depth[-1]
    assert len(rows) == deep.sum() > 0
    assert set(rows[:, 1]) == {1}
    assert remarks[0] == f"initial stress in MPa in {len(rows):,} elements of deck.inp, in mm"
    assert remarks[1].startswith("C3D4 are too stiff in bending")
    assert len(remarks) == 2


def test_a_deck_in_metres_has_pascals_and_one_in_inches_psi(plate: Path, tmp_path: Path) -> None:
    points, tets = plate_mesh(0.07)
    stress = []
    for per_mm, unit in ((1.0, "MPa"), (1e-3, "Pa"), (1 / 25.4, "psi")):
        remarks = exported(plate, tmp_path, deck_of((points * per_mm, tets)))
        assert remarks[0].startswith(f"initial stress in {unit} in ")
        stress.append(read_initial(tmp_path / "stress.inp")[:, 2:])
    assert stress[1] == pytest.approx(1e6 * stress[0], rel=1e-4, abs=1.0)
    assert stress[2] == pytest.approx(145.0377 * stress[0], rel=1e-4, abs=1.0)


@with_calculix
def test_calculix_has_the_points_and_components_in_this_order(plate: Path, tmp_path: Path) -> None:
    """Held at all nodes, the stress that CalculiX prints is the initial one."""
    mesh = with_middles(plate_mesh(0.14, sides=2))
    exported(plate, tmp_path, deck_of(mesh))
    _, place, stress = balanced(
        tmp_path, mesh, tmp_path / "stress.inp", elastic_of(plate), ["NALL, 1, 3"]
    )
    rows = read_initial(tmp_path / "stress.inp")
    at = 4 * (rows[:, 0].astype(int) - 1001) + rows[:, 1].astype(int) - 1
    assert stress[at] == pytest.approx(rows[:, 2:], rel=1e-5, abs=1e-3)
    assert np.abs(np.delete(stress, at, axis=0)).max() < 1e-3
    depth, strain, _ = profile_of(plate)
    e = np.interp(place[at, 2] + HEIGHT / 2, depth, strain)
    modulus, poisson = elastic_of(plate)
    assert rows[:, 2] == pytest.approx(-modulus / (1 + poisson) * e, rel=5e-3, abs=0.1)


@with_calculix
@pytest.mark.parametrize(("order", "bends", "off"), [(10, 0.01, 0.03), (4, 0.5, 0.09)])
def test_a_free_plate_bends_as_the_closed_form(
    order: int, bends: float, off: float, plate: Path, tmp_path: Path
) -> None:
    """Curvature and stress of the plate, in layers half as thick as that of compression.

    Four C3D4 over the core are far too stiff in bending, which the stress in the layer hardly sees.
    """
    depth, strain, layer = profile_of(plate)
    mesh = plate_mesh(layer / 2)
    mesh = with_middles(mesh) if order == 10 else mesh
    exported(plate, tmp_path, deck_of(mesh))
    up = HEIGHT / 2
    held = pinned(mesh, (0, 0, up), (SIDE / 4, 0, up), (0, SIDE / 4, up))
    modulus, poisson = elastic_of(plate)
    moved, place, stress = balanced(
        tmp_path, mesh, tmp_path / "stress.inp", (modulus, poisson), held
    )
    x, y, z = mesh[0].T
    middle = (np.abs(z - up) < 1e-9) & (np.hypot(x, y) < SIDE / 3)
    terms = np.c_[np.ones(len(x)), x, y, 0.5 * (x**2 + y**2)][middle]
    found = np.linalg.lstsq(terms, moved[middle, 2], rcond=None)[0][-1]
    curvature = float(bending(depth, strain, HEIGHT))
    assert found == pytest.approx(curvature, rel=bends)
    below = place[:, 2] + up
    inside = (np.abs(place[:, :2]).max(axis=1) < SIDE / 4) & (below < layer)
    held_back = float(integrals(depth, strain)[0]) / HEIGHT + curvature * (up - below[inside])
    exact = modulus / (1 - poisson) * (held_back - np.interp(below[inside], depth, strain))
    rms = np.sqrt(((stress[inside, :2].mean(axis=1) - exact) ** 2).mean())
    assert rms < off * np.abs(exact).max()


@with_calculix
def test_a_hollow_ball_has_the_stress_of_the_closed_form(tmp_path: Path) -> None:
    """Radius 14 times the depth: s = E / (1 - nu), radial stress p, hoop stress q, from a to b.

    p' = -2 s e / r + A / r⁴,  p(a) = p(b) = 0,  q = p + r p' / 2
    """
    target = {"direction": [0, 0, -1], "angle_deg": [0, 180]}
    ball = trimesh.creation.icosphere(3, OUTER)
    folder = saved_part(tmp_path, ball, stress={}, **{"part.target": target})
    depth, strain, layer = profile_of(folder)
    modulus, poisson = elastic_of(folder)
    skin = OUTER - layer / 2 * np.arange(3, -1, -1)
    points, tets = with_middles(hollow_ball([*np.linspace(INNER, skin[0], 3)[:-1], *skin], 2))
    for k, edge in enumerate(EDGES["tetra"], start=4):  # the middles to the spheres of their ends
        radius = np.linalg.norm(points[tets[:, edge]], axis=2).mean(axis=1)
        middle = points[tets[:, k]]
        points[tets[:, k]] = middle * (radius / np.linalg.norm(middle, axis=1))[:, None]
    exported(folder, tmp_path, deck_of((points, tets)))
    held = pinned((points, tets), (0, 0, OUTER), (OUTER, 0, 0), (0, OUTER, 0))
    _, place, stress = balanced(
        tmp_path, (points, tets), tmp_path / "stress.inp", (modulus, poisson), held
    )
    r = np.linspace(INNER, OUTER, 20001)
    source = 2 * modulus / (1 - poisson) * np.interp(OUTER - r, depth, strain, right=0.0) / r
    step = np.diff(r, prepend=r[0])
    pushed = np.cumsum(0.5 * (source + np.r_[0.0, source[:-1]]) * step)
    a = 3 * pushed[-1] / (INNER**-3 - OUTER**-3)
    radial = -pushed - a / 3 * (r**-3 - INNER**-3)
    hoop = radial + 0.5 * r * (a / r**4 - source)
    at = np.linalg.norm(place, axis=1)
    xx, yy, zz, xy, xz, yz = stress.T
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    along = np.einsum("pi,ijp,pj->p", place / at[:, None], tensor, place / at[:, None])
    around = 0.5 * (xx + yy + zz - along)
    inside = OUTER - at < layer
    exact = np.interp(at, r, hoop)
    assert np.sqrt(((around - exact)[inside] ** 2).mean()) < 0.025 * np.abs(hoop).max()
    core = OUTER - at > 1.5 * layer
    assert around[core].mean() == pytest.approx(exact[core].mean(), rel=0.03)


@pytest.fixture
def without_corner(plate: Path, tmp_path: Path) -> Path:
    """The plate, but its corner's profile is not told."""
    other = Path(shutil.copytree(plate, tmp_path / "other"))
    data = json.loads((other / "result.json").read_text())
    del data["stress"]["profiles"]["corner"]
    data["sha256"] = content_sha256(data)
    (other / "result.json").write_text(json.dumps(data))
    return other


def test_the_smallest_surface_counts_where_they_overlap(
    plate: Path, without_corner: Path, tmp_path: Path
) -> None:
    """Nothing is written at the corner, though the target has a profile there."""
    mesh = plate_mesh(0.07, sides=16)
    rows = []
    for folder in (plate, without_corner):
        exported(folder, tmp_path, deck_of(mesh))
        rows.append(read_initial(tmp_path / "stress.inp"))
    x, y = (mesh[0][mesh[1][rows[1][:, 0].astype(int) - 1001]].mean(axis=1)).T[:2]
    assert not ((x > 10) & (y > 10)).any()
    assert len(rows[1]) / len(rows[0]) == pytest.approx(15 / 16, rel=0.01)


def test_the_layer_ends_at_an_edge_and_below_a_border(without_corner: Path) -> None:
    """At a depth of .1 mm: nearer to the bare side of the plate, and beside the bare corner."""
    result = load_result(without_corner)
    skin = peened_skin(result, require_stress(result), load_result_arrays(result))
    depth, strain, _ = profile_of(without_corner)
    low, of_file = 0.1 - HEIGHT / 2, skin.part.file
    assert of_file is not None
    at = np.array([[-19.98, 0, low], [9.9, 15, low], [10.01, 15, low], [10.06, 15, low]])
    found, normal = eigenstrain_at(1e-3 * at @ of_file.rotation.T + of_file.shift, skin)
    e = np.interp(0.1, depth, strain)
    assert found == pytest.approx([e, e, e, 0.0], rel=0.02)
    down = [0.0, 0.0, -1.0]
    expected = np.array([down, down, down, [0.0, 0.0, 0.0]])
    assert normal @ of_file.rotation == pytest.approx(expected, abs=1e-6)


Change = Callable[[str], str]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda _: "", "has no solids"),
        (lambda _: "*NODE\n1, 0, 0, 0\n", "has no solids"),
        (lambda _: "\0\1\2 no deck", "has no solids"),
        (
            lambda text: text.replace("C3D4", "DC3D4"),
            "type=DC3D4 is not supported here; leave it out, and use C3D4",
        ),
        (lambda text: text.replace("C3D4", "C3D10M"), "type=C3D10M is not supported here"),
        (lambda text: text.replace("C3D4", "S4"), "type=S4 is not supported here"),
        (lambda text: text.replace("1, -20,", "1, nan,", 1), "has nodes that are no numbers"),
        (lambda text: text.replace("1, -20,", "1, 1e999,", 1), "has nodes that are no numbers"),
        (lambda text: re.sub(r"\n1, .*", "", text, count=1), "names node 1 in element 1001"),
        (lambda text: text.replace("1001, ", "1001, 7, ", 1), "no whole number of elements"),
        (lambda text: "*INCLUDE, INPUT=mesh.inp\n" + text, r"\*INCLUDE is not supported"),
        (
            lambda text: (
                f"*PART, NAME=P\n{text}*END PART\n*ASSEMBLY\n*INSTANCE, NAME=I, PART=P\n"
                "*END INSTANCE\n*END ASSEMBLY\n"
            ),
            "has parts and instances; write the model out flat",
        ),
        (lambda text: text.replace("1001, ", "9" * 30 + ", ", 1), "allowed are numbers from 1 to"),
        (lambda text: text + "*ELASTIC\r\n .2D12, .33\r\n", r"\*ELASTIC has 2e\+11, 0.33, and"),
        (lambda text: text + "*ELASTIC\n71700, .2\n", r"\*ELASTIC has 71700, 0.2, and"),
        (lambda text: text + "*ELASTIC\nsoft, .33\n", r"\*ELASTIC has 'soft, .33', and"),
        (lambda text: text + "*ELASTIC\n71.7, .33\n", r"has 71.7, 0.33, and the part's metal"),
    ],
)
def test_a_deck_that_cannot_be_used_is_refused(
    change: Change, message: str, plate: Path, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=message):
        exported(plate, tmp_path, change(deck_of(plate_mesh(0.07))))
    assert not (tmp_path / "stress.inp").exists()


@pytest.mark.parametrize(
    ("move", "message"),
    [
        (
            lambda points: points + np.array([0.0, 0.0, 0.1]),
            "its skin is 0 % of the peened surface, to 28 µm",
        ),
        (lambda points: points[:, [0, 2, 1]], "its skin is 0 % of the peened surface"),
        (lambda points: points * [0.5, 1.0, 1.0], "its skin is 50 % of the peened surface"),
        (lambda points: points * 3.0, r"its longest side is 120, and the part's 40 mm"),
        (lambda points: points * 0.1, "its numbers are in cm, which has no usual unit of stress"),
    ],
)
def test_a_mesh_that_is_not_of_the_part_is_refused(
    move: Callable[[np.ndarray], np.ndarray], message: str, plate: Path, tmp_path: Path
) -> None:
    points, tets = plate_mesh(0.07)
    with pytest.raises(InputError, match=message):
        exported(plate, tmp_path, deck_of((move(points), tets)))


def test_elements_that_are_too_coarse_are_refused(plate: Path, tmp_path: Path) -> None:
    _, _, layer = profile_of(plate)
    for order, thickness in ((4, 1.2), (10, 1.7)):
        mesh = plate_mesh(thickness * layer)
        mesh = with_middles(mesh) if order == 10 else mesh
        with pytest.raises(
            InputError, match=f"{thickness} times as thick as the layer, which is 0.14 mm "
        ):
            exported(plate, tmp_path, deck_of(mesh))
    remarks = exported(plate, tmp_path, deck_of(with_middles(plate_mesh(layer))))
    assert remarks[1].endswith("for the stress there, make them half as thick as the layer")


def test_the_command_takes_a_deck(
    plate: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    deck, out = tmp_path / "deck.inp", tmp_path / "out"
    deck.write_text(deck_of(plate_mesh(0.07)))
    command = ["export", str(plate), "--to", "stress-solid", "--out", str(out), "--mesh"]
    assert main([*command, str(tmp_path / "none.inp")]) == 2
    assert "none.inp: no such file; give the deck with your solids" in capsys.readouterr().err
    assert main([*command, str(tmp_path)]) == 2
    assert "is a folder; give the deck" in capsys.readouterr().err
    assert main([*command, str(deck)]) == 0
    assert "initial stress in MPa in" in capsys.readouterr().err
    assert len(read_initial(out / "stress_solid.inp")) == 2 * 6 * 8 * 8  # two layers of cells

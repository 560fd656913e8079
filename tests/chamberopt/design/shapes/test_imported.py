"""Set-ups from CAD give the same room however they are drawn, and bad ones are refused.

The room is a box of 40 x 40 x 20 mm with a block of 20 x 20 mm that hangs 8 mm down from its
ceiling.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.checks.facts import describe
from chamberopt.common.errors import InputError
from chamberopt.common.executor import SerialExecutor
from chamberopt.design.design import Design, validate
from chamberopt.design.load import load_design, save_design
from chamberopt.design.shapes import TAG_PART, TAG_SONOTRODE, TAG_WALL
from chamberopt.geometry.triangles import area_vectors, areas
from chamberopt.search.study import Study
from tests.helpers.studies import run_in_folder
from tests.helpers.synthetic import judged

DESIGNS = Path(__file__).resolve().parents[4] / "designs"
Drawing = dict[str, np.ndarray]  # name -> corners (k, 3, 3) mm
FLOOR, ROOM, BLOCK, DRAWN = 40.0 * 40.0, 40.0 * 40.0 * 20.0, 20.0 * 20.0 * 8.0, 12.0


def fan(*quads: np.ndarray) -> np.ndarray:
    """Two triangles of each quadrilateral (4, 3)."""
    return np.concatenate([np.asarray(quad, dtype=float)[[[0, 1, 2], [0, 2, 3]]] for quad in quads])


def square(half: float, z: float) -> np.ndarray:
    """Its corners, counter-clockwise seen from above."""
    return np.array([[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]])


def sides(low: np.ndarray, high: np.ndarray) -> list[np.ndarray]:
    """Between two rings of four corners, the normals outward."""
    return [np.array([low[k], low[(k + 1) % 4], high[(k + 1) % 4], high[k]]) for k in range(4)]


def box(half: float, low: float, high: float) -> np.ndarray:
    return fan(
        square(half, low)[::-1], *sides(square(half, low), square(half, high)), square(half, high)
    )


def as_pieces(top: float = 20.0, block: float = DRAWN) -> Drawing:
    """One closed surface with only the bounding faces of the block.

    ``top`` is half the width of the ceiling [mm].
    """
    inner, outer = square(10, 20), square(top, 20)
    ring = [
        np.array([outer[k], outer[(k + 1) % 4], inner[(k + 1) % 4], inner[k]]) for k in range(4)
    ]
    hanging = [side[::-1] for side in sides(square(10, block), inner)]
    return {
        "SONOTRODE": fan(square(20, 0)[::-1]),
        "WALL": fan(*sides(square(20, 0), outer), *ring),
        "PART": fan(*hanging, square(10, block)),
    }


def as_bodies(top: float) -> Drawing:
    """A closed box, and the block as a body of its own that ends at a height."""
    room = {
        "SONOTRODE": fan(square(20, 0)[::-1]),
        "WALL": fan(*sides(square(20, 0), square(20, 20)), square(20, 20)),
    }
    return {**room, "PART": box(10, DRAWN, top)}


def inverted(drawing: Drawing) -> Drawing:
    return {name: corners[:, ::-1] for name, corners in drawing.items()}


def in_thick_walls() -> Drawing:
    """The outside of the chamber is drawn too."""
    drawing = as_pieces()
    return {**drawing, "WALL": np.concatenate([drawing["WALL"], box(25, -5, 25)])}


def with_a_post() -> Drawing:
    """A post of wall that stands free in the room, drawn as a body."""
    drawing = as_bodies(25.0)
    post = box(1, 2, 6) + np.array([15.0, 15.0, 0.0])
    return {**drawing, "WALL": np.concatenate([drawing["WALL"], post])}


def turned(drawing: Drawing, seed: int) -> Drawing:
    rng = np.random.default_rng(seed)
    matrix = trimesh.transformations.random_rotation_matrix(rng.random(3))[:3, :3]
    return {name: corners @ matrix.T + [300.0, -20.0, 7.0] for name, corners in drawing.items()}


def text_stl(path: Path, drawing: Drawing) -> Path:
    lines = []
    for name, corners in drawing.items():
        lines.append(f"solid {name}")
        for triangle in corners:
            lines += ["facet normal 0 0 0", "outer loop"]
            lines += [
                "vertex " + " ".join(f"{value:.9g}" for value in corner) for corner in triangle
            ]
            lines += ["endloop", "endfacet"]
        lines.append(f"endsolid {name}")
    path.write_text("\n".join(lines) + "\n")
    return path


def nastran(path: Path, drawing: Drawing) -> Path:
    grids, cards, names = [], [], []
    for pid, (name, corners) in enumerate(drawing.items(), start=1):
        names.append(f'$HMNAME PROP {pid:8d}"{name}" 4')
        for triangle in corners:
            start = len(grids) + 1
            grids += [
                f"GRID,{start + k},,{x:.9f},{y:.9f},{z:.9f}" for k, (x, y, z) in enumerate(triangle)
            ]
            cards.append(f"CTRIA3,{len(cards) + 1},{pid},{start},{start + 1},{start + 2}")
    path.write_text("\n".join(["BEGIN BULK", *names, *grids, *cards, "ENDDATA"]) + "\n")
    return path


def design(path: Path, placed: dict[str, Any] | None = None, **chamber: Any) -> Design:
    """The set-up in a file, with what else the plate's design has."""
    data = load_design(DESIGNS / "plate_imported.toml").model_dump()
    data["part"] = {"mesh": str(path), "unit": "mm", **(placed or {})}
    data["chamber"] = {"shape": "imported", "part": "PART", "sonotrode": "SONOTRODE", **chamber}
    data["shot"]["mass_g"] = 1.0
    return validate(Design, data)


def sound(chamber: Chamber, volume: float, distance: float) -> None:
    """Closed, consistent, of this volume [mm³], tags and sources of the right triangles."""
    mesh = trimesh.Trimesh(chamber.vertices, chamber.triangles, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert 1e9 * mesh.volume == pytest.approx(volume, rel=1e-7)
    assert chamber.volume == pytest.approx(mesh.volume, rel=1e-12)
    floor = chamber.tags == TAG_SONOTRODE
    assert (chamber.vertices[chamber.triangles[floor]][..., 2] == 0.0).all()
    assert 1e6 * areas(chamber.vertices, chamber.triangles)[floor].sum() == pytest.approx(
        FLOOR, rel=1e-6
    )
    assert 1e3 * chamber.part.vertices[:, 2].min() == pytest.approx(distance, abs=1e-5)
    own = chamber.tags == TAG_PART
    assert ((chamber.source >= 0) == own).all()
    facing = area_vectors(chamber.vertices, chamber.triangles)[own]
    of_part = area_vectors(chamber.part.vertices, chamber.part.triangles)[chamber.source[own]]
    assert (np.einsum("ij,ij->i", facing, of_part) < 0.0).all()


DRAWINGS = {
    "pieces": (as_pieces(), ROOM - BLOCK),
    "pieces, inverted": (inverted(as_pieces()), ROOM - BLOCK),
    "overlapping body": (as_bodies(25.0), ROOM - BLOCK),
    "touching body": (as_bodies(20.0), ROOM - BLOCK),
    "bodies, inverted": (inverted(as_bodies(25.0)), ROOM - BLOCK),
    "hanging body": (as_bodies(16.0), ROOM - BLOCK / 2),
    "thick walls": (in_thick_walls(), ROOM - BLOCK),
    "a post": (with_a_post(), ROOM - BLOCK - 2 * 2 * 4),
    "turned pieces": (turned(as_pieces(), 1), ROOM - BLOCK),
    "turned bodies": (turned(as_bodies(25.0), 2), ROOM - BLOCK),
}


@pytest.mark.parametrize("write", [text_stl, nastran])
@pytest.mark.parametrize("name", DRAWINGS)
def test_the_same_room_however_it_is_drawn(tmp_path: Path, name: str, write: Any) -> None:
    drawing, volume = DRAWINGS[name]

    chamber = build_chamber(design(write(tmp_path / "setup", drawing)))

    sound(chamber, volume, DRAWN)
    assert 1e6 * chamber.part.area == pytest.approx(
        1e6 * drawn_area(drawing["PART"]), rel=1e-6
    )  # in the file's order
    walls = (
        FLOOR
        + 4 * 40 * 20
        - (0.0 if name == "hanging body" else 400.0)
        + 2 * (2 * 2 + 2 * 8) * (name == "a post")
    )
    on_wall = chamber.tags == TAG_WALL
    assert 1e6 * areas(chamber.vertices, chamber.triangles)[on_wall].sum() == pytest.approx(
        walls, rel=1e-6
    )
    assert any("left out" in note for note in chamber.notes) == (name == "thick walls")
    assert any("is up" in note for note in chamber.notes) == ("turned" in name)


def drawn_area(corners: np.ndarray) -> np.ndarray:
    """m² of each triangle."""
    return 0.5e-6 * np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )


@pytest.mark.parametrize(
    "name", ["pieces", "overlapping body", "hanging body", "turned pieces", "turned bodies"]
)
@pytest.mark.parametrize("distance", [3.5, 12.0, 12.001, 30.0])
def test_the_sonotrode_moves_and_the_walls_go_on_straight(
    tmp_path: Path, name: str, distance: float
) -> None:
    drawing, volume = DRAWINGS[name]

    chamber = build_chamber(
        design(text_stl(tmp_path / "setup.stl", drawing), sonotrode_distance_mm=distance)
    )

    sound(chamber, volume + FLOOR * (distance - DRAWN), distance)


def test_the_distance_as_drawn_is_no_change(tmp_path: Path) -> None:
    path = text_stl(tmp_path / "setup.stl", as_pieces())

    drawn, asked = (
        build_chamber(design(path)),
        build_chamber(design(path, sonotrode_distance_mm=DRAWN)),
    )

    assert np.array_equal(drawn.vertices, asked.vertices)
    assert np.array_equal(drawn.triangles, asked.triangles)


def test_walls_that_lean_can_go_on_but_not_be_cut(tmp_path: Path) -> None:
    """The ceiling is wider than the floor by 8 mm on each side."""
    path = text_stl(tmp_path / "setup.stl", as_pieces(top=28.0))
    frustum = 20.0 / 3.0 * (40.0**2 + 40.0 * 56.0 + 56.0**2) - BLOCK

    sound(build_chamber(design(path)), frustum, DRAWN)
    sound(build_chamber(design(path, sonotrode_distance_mm=15.0)), frustum + 3 * FLOOR, 15.0)
    with pytest.raises(
        InputError,
        match=r"chamber\.sonotrode_distance_mm: the set-up is drawn with 12, .* straight",
    ):
        build_chamber(design(path, sonotrode_distance_mm=11.0))


def test_the_sonotrode_does_not_move_into_another_part_of_the_room(tmp_path: Path) -> None:
    """A duct leads out of the room, down beside it, and on 5 to 10 mm under its floor."""
    duct = [
        ((19, -5, 10), (30, 5, 15)),
        ((25, -5, -10), (30, 5, 15)),
        ((-10, -5, -10), (30, 5, -5)),
    ]
    boxes = [trimesh.creation.box(bounds=pair) for pair in [((-20, -20, 0), (20, 20, 20)), *duct]]
    room = trimesh.boolean.union(boxes, engine="manifold")
    corners = np.asarray(room.triangles)
    floor = (corners[..., 2] == 0.0).all(axis=1)
    drawing = {"SONOTRODE": corners[floor], "WALL": corners[~floor], "PART": box(10, DRAWN, 25.0)}
    path = text_stl(tmp_path / "setup.stl", drawing)
    volume = 1e-9 * room.volume - 1e-9 * BLOCK

    beside = build_chamber(design(path, sonotrode_distance_mm=DRAWN + 4.0))

    assert beside.volume == pytest.approx(volume + 4e-9 * FLOOR, rel=1e-7)
    with pytest.raises(
        InputError, match=r"cannot be moved farther .* another part of the room is in the way"
    ):
        build_chamber(design(path, sonotrode_distance_mm=DRAWN + 8.0))


def test_deflectors_and_wells_fit_an_imported_room_too(tmp_path: Path) -> None:
    path = text_stl(tmp_path / "setup.stl", as_pieces())
    rod = {"kind": "plate", "at_mm": [15.0, 0.0, 10.0], "size_mm": [2.0, 3.0, 4.0]}
    data = design(path, deflectors=[rod]).model_dump()

    sound(build_chamber(validate(Design, data)), ROOM - BLOCK - 24.0, DRAWN)
    data["sonotrodes"] = [
        {
            "at_mm": [25, 0, 10],
            "axis": [-1, 0, 0],
            "diameter_mm": 8.0,
            "frequency_khz": 20.0,
            "amplitude_um": 5.0,
        }
    ]
    well = 5 * 32 * 4**2 * np.sin(2 * np.pi / 64)
    sound(build_chamber(validate(Design, data)), ROOM - BLOCK - 24.0 + well, DRAWN)


def test_the_target_is_chosen_by_the_names_and_frame_of_the_file(tmp_path: Path) -> None:
    drawing = as_pieces()
    lower = {"target": {"surface": "PART", "direction": [0, 0, -1], "angle_deg": [0, 5]}}

    part = build_chamber(design(text_stl(tmp_path / "setup.stl", drawing), placed=lower)).part

    assert 1e6 * part.area[part.target].sum() == pytest.approx(400.0)
    with pytest.raises(InputError, match=r"part\.target\.surface: 'WALL' is not a name"):
        build_chamber(design(tmp_path / "setup.stl", placed={"target": {"surface": "WALL"}}))


def crossed() -> Drawing:
    """A post of wall that goes half into the floor."""
    drawing = as_bodies(25.0)
    return {
        **drawing,
        "WALL": np.concatenate([drawing["WALL"], box(2, -2, 2) + np.array([15.0, 15.0, 0.0])]),
    }


def stepped() -> Drawing:
    """The middle of the sonotrode is a level of its own, 1 mm higher."""
    high, low = square(10, 1), square(10, 0)
    outer = square(20, 0)
    ring = [np.array([outer[k], low[k], low[(k + 1) % 4], outer[(k + 1) % 4]]) for k in range(4)]
    drawing = as_pieces()
    step = [side[::-1] for side in sides(low, high)]
    floors = {
        "SONOTRODE": fan(*ring, high[::-1]),
        "WALL": np.concatenate([drawing["WALL"], fan(*step)]),
    }
    return {**drawing, **floors}


def leaking(drawing: Drawing) -> Drawing:
    return {**drawing, "WALL": drawing["WALL"][1:]}


@pytest.mark.parametrize(
    ("drawing", "tables", "said"),
    [
        (leaking(as_pieces()), {}, r"the surface is not closed: 3 open edges.*\(-?20, -?20, 0\)"),
        (
            leaking(as_bodies(25.0)),
            {},
            r"not closed: 3 open edges.*\(-?20, -?20, 0\).*must be closed without it",
        ),
        (
            as_pieces(),
            {"sonotrode": "SONO"},
            r"chamber\.sonotrode: 'SONO' is not a name.*did you mean 'SONOTRODE'",
        ),
        (
            as_pieces(),
            {"part": ["PART", "WALL", "SONOTRODE"]},
            r"chamber\.part: .*all of the triangles",
        ),
        (
            as_pieces(),
            {"sonotrode": ["SONOTRODE", "WALL"]},
            r"chamber\.sonotrode: its triangles are not flat",
        ),
        (
            stepped(),
            {},
            r"chamber\.sonotrode: its triangles are not flat, they reach from 0 to 1 mm",
        ),
        (
            as_pieces(),
            {"part": ["PART", "SONOTRODE"]},
            r"chamber\.part: 2 of its triangles are the sonotrode's too",
        ),
        (
            as_bodies(25.0),
            {"part": "WALL", "sonotrode": "PART"},
            "sonotrode: .* not flat, they face different ways",
        ),
        (
            as_pieces(block=2.0),
            {},
            r"shot\.diameter_mm: given 3, .* drawn 2 mm above the sonotrode",
        ),
        (crossed(), {}, r"closed surface . of the set-up, 64 mm³, crosses the wall of the room"),
        (
            {**as_bodies(25.0), "PART": box(3, 30, 40)},
            {},
            "no part of it is inside the chamber; check the groups",
        ),
    ],
)
def test_what_is_no_set_up_is_refused(
    tmp_path: Path, drawing: Drawing, tables: dict[str, Any], said: str
) -> None:
    with pytest.raises(InputError, match=said):
        build_chamber(design(text_stl(tmp_path / "setup.stl", drawing), **tables))


def test_a_sonotrode_with_a_free_edge_is_refused(tmp_path: Path) -> None:
    """A step up to the sonotrode: the wall around it is lower."""
    ring = [np.array([a, b, c, d])[::-1] for a, b, c, d in zip(*corners_of_a_step(), strict=True)]
    step = sides(square(10, -2), square(10, 0))
    walls = [*sides(square(20, -2), square(20, 20)), *ring, *(side[::-1] for side in step)]
    drawing = {
        "SONOTRODE": fan(square(10, 0)[::-1]),
        "WALL": fan(*walls, square(20, 20)),
        "PART": box(5, 12, 16),
    }

    with pytest.raises(
        InputError,
        match=r"chamber\.sonotrode: its face has a free edge at \(.*\) mm: walls must rise",
    ):
        build_chamber(design(text_stl(tmp_path / "setup.stl", drawing)))


def corners_of_a_step() -> tuple[np.ndarray, ...]:
    outer, inner = square(20, -2), square(10, -2)
    return outer, np.roll(outer, -1, axis=0), np.roll(inner, -1, axis=0), inner


@pytest.mark.parametrize(
    ("part", "said"),
    [
        (
            {"rotate_deg": [0.0, 90.0, 0.0]},
            "part.rotate_deg: given [0.0, 90.0, 0.0] beside chamber.shape",
        ),
        ({"offset_mm": [1.0, 0.0]}, "part.offset_mm: given [1.0, 0.0] beside chamber.shape"),
        ({"target": {"element_mm": 0.5}}, "part.target.element_mm: given beside chamber.shape"),
    ],
)
def test_what_a_drawn_set_up_leaves_no_choice_of_is_refused(
    tmp_path: Path, part: dict[str, Any], said: str
) -> None:
    with pytest.raises(InputError) as error:
        design(text_stl(tmp_path / "setup.stl", as_pieces()), placed=part)
    assert said in str(error.value)


def test_a_design_file_names_the_set_up_once_and_is_saved_whole(tmp_path: Path) -> None:
    made = design(text_stl(tmp_path / "setup.stl", as_pieces()))

    save_design(made, tmp_path / "made.toml")

    assert load_design(tmp_path / "made.toml") == made
    with pytest.raises(InputError, match=r"chamber\.mesh: not as in \[part\]"):
        design(tmp_path / "setup.stl", mesh=str(DESIGNS / "parts" / "plate.stl"))
    with pytest.raises(InputError, match=r"sonotrode_distance_mm: not set in this design"):
        made.value("chamber.sonotrode_distance_mm")


def test_a_study_moves_the_sonotrode_of_a_drawn_set_up(tmp_path: Path) -> None:
    """The volume tells how far: best where it is 4/3 of the drawn one's."""
    start = design(text_stl(tmp_path / "setup.stl", as_pieces()), sonotrode_distance_mm=DRAWN)
    best = DRAWN + (ROOM - BLOCK) / 3 / FLOOR
    question = Study(
        design=start,
        vary={"chamber.sonotrode_distance_mm": (8.0, 25.0)},
        optimizer={"evaluations": 16, "confirm": 1},
    )

    def volume_off(made: Design, *_: Any) -> Any:
        off = 1e9 * build_chamber(made).volume / (ROOM - BLOCK) - 4 / 3
        return judged(-abs(np.full(3, off)))

    result = run_in_folder(question, tmp_path / "study", SerialExecutor(), None, volume_off)

    assert result.best.design.value("chamber.sonotrode_distance_mm") == pytest.approx(best, abs=0.5)


def test_the_shipped_set_up_is_the_plates_own_chamber() -> None:
    """The room and the target's triangles are the same whichever way round the file draws them."""
    drawn, parametric = (
        load_design(DESIGNS / f"{name}.toml") for name in ("plate_imported", "plate")
    )
    one, two = build_chamber(drawn), build_chamber(parametric)

    assert one.volume == pytest.approx(two.volume, rel=1e-5)  # corners are on a grid of 0.1 µm
    assert 1e3 * one.height == pytest.approx(15.0, abs=1e-6)
    middles = []
    for chamber in (one, two):
        part = chamber.part
        middle = np.round(1e3 * part.vertices[part.triangles[part.target]].mean(axis=1), 4) + 0.0
        middles.append(sorted(map(tuple, middle.tolist())))
    assert np.array(middles[0]) == pytest.approx(np.array(middles[1]), abs=1e-3)
    assert describe(drawn, one)["warnings"] == []

"""Deflectors, fixture holes and further sonotrodes change the cavity as they should."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.bores_and_deflectors import first_crossings
from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.scene import balls_can_rest, build_scene, chamber_mesh, scene_physics
from chamberopt.common.errors import InputError
from chamberopt.design.design import Design, validate
from chamberopt.design.load import load_design, save_design
from chamberopt.design.shapes import (
    TAG_PART,
    TAG_SONOTRODE,
    TAG_WALL,
    further_sonotrode_tag,
    is_sonotrode,
)
from chamberopt.geometry.solids import SolidSurface
from chamberopt.geometry.triangles import area_vectors, areas
from chamberopt.simulation.resting_balls import find_resting_balls
from sim_core import Resting, Vibration

DESIGNS = Path(__file__).resolve().parents[3] / "designs"
FACETS, DIAMETER, HEIGHT = 64, 70.0, 45.0
PLATE = {
    "kind": "plate",
    "at_mm": [20.0, 0.0, 12.0],
    "size_mm": [10.0, 8.0, 4.0],
    "rotate_deg": [0.0, 0.0, 30.0],
}


def design(deflectors: Any = (), holes: Any = (), sonotrodes: Any = (), **chamber: Any) -> Design:
    """The gear's chamber of 70 x 45 mm with fittings."""
    data = load_design(DESIGNS / "gear.toml").model_dump()
    sizes = {"diameter_mm": DIAMETER, "height_mm": HEIGHT, "facets": FACETS, **chamber}
    data["chamber"] = {**data["chamber"], **sizes, "deflectors": deflectors, "holes": holes}
    data["sonotrodes"] = sonotrodes
    return validate(Design, data)


def sonotrode(**values: Any) -> dict[str, Any]:
    """One that looks down from a well in the ceiling, beside the shaft."""
    own = {
        "at_mm": [22.0, 0.0, 50.0],
        "axis": [0.0, 0.0, -1.0],
        "diameter_mm": 12.0,
        "frequency_khz": 20.0,
    }
    return {**own, "amplitude_um": 10.0, **values}


def polygon(diameter: float) -> float:
    """Area of the 64-sided polygon in a circle."""
    return 32 * (diameter / 2) ** 2 * np.sin(2 * np.pi / 64)


@pytest.fixture(scope="module")
def plain() -> Chamber:
    return build_chamber(design())


def sound(chamber: Chamber) -> None:
    """Closed, consistent, of the volume it says, tags of the right triangles."""
    mesh = trimesh.Trimesh(chamber.vertices, chamber.triangles, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert chamber.volume == pytest.approx(mesh.volume, rel=1e-9)
    assert ((chamber.source >= 0) == (chamber.tags == TAG_PART)).all()


def area_of(chamber: Chamber, tag: int) -> float:
    """mm²"""
    return 1e6 * float(areas(chamber.vertices, chamber.triangles)[chamber.tags == tag].sum())


def grown(chamber: Chamber, plain: Chamber) -> float:
    """mm³"""
    return 1e9 * (chamber.volume - plain.volume)


@pytest.mark.parametrize(
    ("deflector", "volume", "area"),
    [
        (PLATE, 10 * 8 * 4, 2 * (80 + 40 + 32)),
        (
            {
                "kind": "rod",
                "at_mm": [0, 26, 14],
                "diameter_mm": 5.0,
                "length_mm": 12.0,
                "rotate_deg": [0, 90, 0],
            },
            12 * polygon(5.0),
            2 * polygon(5.0) + 12 * 64 * 5 * np.sin(np.pi / 64),
        ),
    ],
)
def test_a_deflector_in_the_room_takes_its_volume_and_is_wall(
    plain: Chamber, deflector: dict[str, Any], volume: float, area: float
) -> None:
    chamber = build_chamber(design(deflectors=[deflector]))

    sound(chamber)
    assert grown(chamber, plain) == pytest.approx(-volume, rel=1e-5)
    assert area_of(chamber, TAG_WALL) - area_of(plain, TAG_WALL) == pytest.approx(area, rel=1e-5)
    assert area_of(chamber, TAG_SONOTRODE) == pytest.approx(
        area_of(plain, TAG_SONOTRODE), rel=1e-12
    )
    assert chamber.exposed_area == pytest.approx(plain.exposed_area, abs=1e-15)
    assert not any("rounding" in note for note in chamber.notes)


def test_a_ball_and_a_file_are_deflectors_too(plain: Chamber, tmp_path: Path) -> None:
    """The file's box is placed by the middle of its box, wherever the file has it."""
    box = trimesh.creation.box((6, 6, 6))
    box.apply_translation((100, 200, 300))
    box.export(tmp_path / "block.stl")
    ball = {"kind": "ball", "at_mm": [28.0, 0.0, 12.0], "diameter_mm": 8.0}
    block = {
        "kind": "mesh",
        "at_mm": [-28.0, 0.0, 20.0],
        "mesh": str(tmp_path / "block.stl"),
        "unit": "mm",
    }

    chamber = build_chamber(design(deflectors=[ball, block]))

    sound(chamber)
    assert -grown(chamber, plain) == pytest.approx(6**3 + np.pi / 6 * 8**3, rel=0.01)
    corners = 1e3 * chamber.vertices[chamber.triangles[chamber.tags == TAG_WALL]].reshape(-1, 3)
    assert corners[np.abs(corners[:, 0] + 28) < 3.1].shape[0] > 8
    on_ball = corners[(np.abs(corners - [28, 0, 12]) < 4.01).all(axis=1)]
    assert np.linalg.norm(on_ball - [28, 0, 12], axis=1) == pytest.approx(4.0, abs=1e-5)


def test_a_deflector_through_the_wall_counts_as_far_as_it_is_inside(plain: Chamber) -> None:
    """A plate set into the ceiling to half its height."""
    chamber = build_chamber(design(deflectors=[{**PLATE, "at_mm": [20.0, 0.0, HEIGHT]}]))

    sound(chamber)
    assert grown(chamber, plain) == pytest.approx(-10 * 8 * 2, rel=1e-5)


def test_a_hole_goes_its_depth_beyond_the_wall(plain: Chamber) -> None:
    """Through the flat ceiling its volume is that of a prism; through the round wall nearly so."""
    up = build_chamber(
        design(
            holes=[{"at_mm": [25, 0, 40], "axis": [0, 0, 2], "diameter_mm": 8.0, "depth_mm": 6.0}]
        )
    )
    out = build_chamber(
        design(
            holes=[{"at_mm": [0, 20, 9], "axis": [0, 1, 0], "diameter_mm": 8.0, "depth_mm": 6.0}]
        )
    )

    for chamber in (up, out):
        sound(chamber)
        assert set(np.unique(chamber.tags)) == {TAG_PART, TAG_SONOTRODE, TAG_WALL}
    assert grown(up, plain) == pytest.approx(6 * polygon(8.0), rel=1e-6)
    assert 1e3 * up.height == pytest.approx(HEIGHT + 6.0)
    radius = (
        DIAMETER / 2
    )  # the wall lies back from its highest line: the circle by r²/(8 R) on average over the bore
    facets = 2 / 3 * radius * (1 - np.cos(np.pi / FACETS))  # and the polygon behind the circle
    assert grown(out, plain) == pytest.approx(
        (6 + 4**2 / (8 * radius) + facets) * polygon(8.0), rel=1e-4
    )
    assert 1e3 * out.vertices[:, 1].max() == pytest.approx(radius + 6.0, abs=1e-6)


def test_a_hole_takes_the_shaft_of_the_part(plain: Chamber) -> None:
    """The shaft of 16 mm in a bore of 20 mm: a ring is added, and more of the shaft is exposed."""
    hole = {"at_mm": [0.0, 12.0, 40.0], "axis": [0, 0, 1], "diameter_mm": 34.0, "depth_mm": 5.0}
    chamber = build_chamber(design(holes=[{**hole, "at_mm": [0.0, 0.0, 40.0]}]))

    sound(chamber)
    assert grown(chamber, plain) == pytest.approx(5 * (polygon(34.0) - np.pi * 8**2), rel=2e-3)
    assert chamber.exposed_area.sum() - plain.exposed_area.sum() == pytest.approx(
        np.pi * 16 * 5 * 1e-6, rel=2e-3
    )


@pytest.mark.parametrize(
    ("at", "axis"),
    [
        ((22.0, 0.0, 50.0), (0.0, 0.0, -1.0)),
        ((50.0, 0.0, 20.0), (-1.0, 0.0, 0.2)),
        ((0, -40, 9), (0, 3, 0)),
    ],
)
def test_a_further_sonotrode_is_the_bottom_of_a_well(plain: Chamber, at: Any, axis: Any) -> None:
    made = design(sonotrodes=[sonotrode(at_mm=at, axis=axis)])
    chamber = build_chamber(made)

    sound(chamber)
    tag = further_sonotrode_tag(0)
    face = chamber.tags == tag
    assert area_of(chamber, tag) == pytest.approx(polygon(12.0), rel=1e-6)
    normals = -area_vectors(chamber.vertices, chamber.triangles)[face]
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    assert normals == pytest.approx(
        np.tile(np.array(axis) / np.linalg.norm(axis), (len(normals), 1)), abs=1e-5
    )
    middle = 1e3 * chamber.vertices[np.unique(chamber.triangles[face])]
    assert np.linalg.norm(middle - np.array(at), axis=1).max() == pytest.approx(6.0, abs=1e-5)
    assert area_of(chamber, TAG_SONOTRODE) == pytest.approx(
        area_of(plain, TAG_SONOTRODE), rel=1e-12
    )
    assert grown(chamber, plain) > 0.0
    assert is_sonotrode(chamber.tags).sum() == face.sum() + (chamber.tags == TAG_SONOTRODE).sum()


def test_a_ball_on_it_is_said_to_lie_there() -> None:
    chamber = build_chamber(design(sonotrodes=[sonotrode(at_mm=(0, -40, 9), axis=(0, 3, 0))]))
    on = np.full((1, 4), -1)
    on[0, 0] = np.flatnonzero(chamber.tags == further_sonotrode_tag(0))[0]
    ball = Resting(
        np.zeros(1, int), np.zeros((1, 3)), np.zeros(1), on, np.full((1, 4), -1), np.zeros(1, bool)
    )

    found = find_resting_balls(ball, [2e-3] * 10, chamber, part_turns=False)

    assert found is not None
    assert "1 on sonotrodes.0 at" in found.line


def test_each_sonotrode_vibrates_its_own_way() -> None:
    """A phase is relative to the first sonotrode's; all sonotrodes have the same restitution."""
    made = design(
        sonotrodes=[
            sonotrode(phase_deg=90.0, frequency_khz=30.0),
            sonotrode(at_mm=[-22.0, 0.0, 48.0]),
        ]
    )
    mesh = chamber_mesh(build_chamber(made))

    physics = scene_physics(made, mesh, phase=1.0)

    first, second, third = physics.vibration  # type: ignore[misc]
    own = made.sonotrode
    assert first == Vibration(TAG_SONOTRODE, own.amplitude, own.frequency, 1.0)
    amplitude = made.sonotrodes[0].amplitude
    assert second == Vibration(3, amplitude, 30e3, 1.0 + np.pi / 2, (0.0, 0.0, -1.0))
    assert third == Vibration(4, amplitude, 20e3, 1.0, (0.0, 0.0, -1.0))
    laws = physics.restitution.surfaces  # type: ignore[union-attr]
    assert len(laws) == 5
    assert laws[3] == laws[4] == laws[TAG_SONOTRODE]


def test_balls_do_not_rest_on_a_sonotrode_that_looks_up(tmp_path: Path) -> None:
    """Balls cannot lie on the sonotrode, but on the lower side of a second one's well."""
    data = design().model_dump()
    trimesh.creation.icosphere(subdivisions=2, radius=3).export(tmp_path / "part.stl")
    rod = trimesh.convex.convex_hull(
        [[0, 0, 0], [4, -4, 80], [4, 4, 80], [-4, 4, 80], [-4, -4, 80]]
    )
    rod.export(tmp_path / "part.stl")
    data["part"] = {"mesh": str(tmp_path / "part.stl"), "unit": "mm"}
    up = sonotrode(at_mm=[45.0, 0.0, 10.0], axis=[-1.0, 0.0, 0.5])
    one, two = validate(Design, data), validate(Design, {**data, "sonotrodes": [up]})

    assert not balls_can_rest(one, chamber_mesh(build_chamber(one)))
    mesh = chamber_mesh(build_chamber(two))
    facing = np.unique(mesh.tags[-area_vectors(mesh.vertices, mesh.triangles)[:, 2] > 1e-9])
    assert set(facing) == {TAG_SONOTRODE, TAG_WALL, 3}  # the wall: the well's lower side
    assert balls_can_rest(two, mesh)


OUTSIDE, WELL, AXIS = {**PLATE, "at_mm": [200.0, 0.0, 12.0]}, sonotrode(), [0.0, 0.0, 1.0]


@pytest.mark.parametrize(
    ("fittings", "said"),
    [
        (
            {"deflectors": [PLATE, OUTSIDE]},
            r"chamber\.deflectors\.1\.at_mm: given \[200.0.*none of it is in the room",
        ),
        (
            {"deflectors": [{**PLATE, "at_mm": [20.0, 0.0, 2.01]}]},
            r"chamber\.deflectors\.0\.at_mm.*face of \[sonotrode\] hits it",
        ),
        (
            {"deflectors": [{**PLATE, "at_mm": [22.0, 0.0, 47.995]}], "sonotrodes": [WELL]},
            r"chamber\.deflectors\.0\.at_mm.*face of \[sonotrodes\.0\] hits it",
        ),
        (
            {"holes": [{"at_mm": [0, 0, 60], "axis": AXIS, "diameter_mm": 5.0, "depth_mm": 5.0}]},
            r"holes\.0\.at_mm: from",
        ),
        (
            {"holes": [{"at_mm": [30, 0, 20], "axis": AXIS, "diameter_mm": 15.0, "depth_mm": 5.0}]},
            r"holes\.0\.at_mm: a b",
        ),
        (
            {
                "holes": [
                    {"at_mm": [25, 0, 20], "axis": [0, 0, -1], "diameter_mm": 5.0, "depth_mm": 5.0}
                ]
            },
            r"holes\.0\.at_mm: its bore cuts into a sonotrode's face",
        ),
        (
            {
                "holes": [
                    {"at_mm": [25, 0, 40], "axis": [1, 0, 1], "diameter_mm": 10.0, "depth_mm": 0.5}
                ]
            },
            r"holes\.0\.at_mm.*raise depth_mm",
        ),
        (
            {"sonotrodes": [sonotrode(at_mm=[22.0, 0.0, 44.0])]},
            r"sonotrodes\.0\.at_mm.*move at_mm back along the axis",
        ),
        (
            {"sonotrodes": [sonotrode(at_mm=[33.0, 0.0, 50.0])]},
            r"sonotrodes\.0\.at_mm.*does not lead into the room all",
        ),
        (
            {"sonotrodes": [sonotrode(axis=[0.0, 0.0, 1.0])]},
            r"sonotrodes\.0\.at_mm.*does not lead into the room all",
        ),
        ({"sonotrodes": [WELL, sonotrode(at_mm=[27.0, 0.0, 48.0])]}, r"sonotrodes\.1\.at_mm"),
        ({"sonotrodes": [sonotrode(at_mm=[0.0, 0.0, 50.0])]}, r"sonotrodes\.0\.at_mm: .*the part"),
        (
            {
                "sonotrodes": [
                    sonotrode(at_mm=[0.0, -40.0, 6.0], axis=[0.0, 1.0, 0.0], diameter_mm=14.0)
                ]
            },
            "does not lead into the room all round|free rim",
        ),
    ],
)
def test_what_is_out_of_place_is_refused_by_name(fittings: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        build_chamber(design(**fittings))


@pytest.mark.parametrize(
    ("fittings", "said"),
    [
        (
            {"deflectors": [{"kind": "rod", "at_mm": [0, 0, 20]}]},
            "chamber.deflectors.0.length_mm: missing; a rod has",
        ),
        (
            {"deflectors": [{**PLATE, "length_mm": 3.0}]},
            "chamber.deflectors.0.length_mm: not of a plate",
        ),
        (
            {"deflectors": [{**PLATE, "size_mm": [1.0, 0.0, 1.0]}]},
            "chamber.deflectors.0.size_mm: given",
        ),
        (
            {"deflectors": [{**PLATE, "sise_mm": 3.0}]},
            "deflectors.0.sise_mm: unknown key; did you mean 'size_mm'?",
        ),
        (
            {"deflectors": [{**PLATE, "kind": "wedge"}]},
            'deflectors.0.kind: given \'wedge\'; allowed: "plate", "rod"',
        ),
        (
            {"holes": [{"at_mm": [0, 0, 9], "axis": AXIS, "depth_mm": 5.0}]},
            "holes.0.diameter_mm: missing; give a number",
        ),
        (
            {"sonotrodes": [sonotrode(axis=[0.0, 0.0, 0.0])]},
            "sonotrodes.0.axis: given [0, 0, 0], which points nowhere",
        ),
        (
            {"sonotrodes": [sonotrode(amplitude_um=0.0)]},
            "sonotrodes.0.amplitude_um: given 0.0; allowed: a number from",
        ),
    ],
)
def test_wrong_tables_are_told_by_their_place_in_the_list(
    fittings: dict[str, Any], said: str
) -> None:
    with pytest.raises(InputError) as error:
        design(**fittings)
    assert said in str(error.value)


def test_a_wrong_table_in_a_file_is_told_by_its_line(tmp_path: Path) -> None:
    text = (
        (DESIGNS / "gear.toml")
        .read_text(encoding="utf-8")
        .replace("parts/", f"{DESIGNS.as_posix()}/parts/")
    )
    plate = '\n[[chamber.deflectors]]\nkind = "plate"\nat_mm = [20, 0, 12]\nsize_mm = [1, 2, {}]\n'
    path = tmp_path / "design.toml"
    path.write_text(text + plate.format(3) + plate.format("true"), encoding="utf-8")

    with pytest.raises(InputError) as error:
        load_design(path)

    line = len(path.read_text(encoding="utf-8").splitlines())
    assert f"{path}:{line}: chamber.deflectors.1.size_mm" in str(error.value)


def test_random_phases_of_several_sonotrodes_are_refused() -> None:
    data = design(sonotrodes=[WELL]).model_dump()
    data["sonotrode"]["motion"] = "random_phase"
    with pytest.raises(
        InputError, match=r"sonotrode\.motion: given .random_phase. beside sonotrodes"
    ):
        validate(Design, data)


def test_their_numbers_vary_and_are_saved(tmp_path: Path) -> None:
    (tmp_path / "block.stl").write_bytes((DESIGNS / "parts" / "plate.stl").read_bytes())
    block = {"kind": "mesh", "at_mm": [0.0, 25.0, 20.0], "mesh": str(tmp_path / "block.stl")}
    hole = {"at_mm": [0, 0, 40], "axis": AXIS, "diameter_mm": 34.0, "depth_mm": 5.0}
    made = design(deflectors=[PLATE, block], holes=[hole], sonotrodes=[WELL])
    names = (
        "chamber.deflectors.0.rotate_deg.1",
        "chamber.holes.0.depth_mm",
        "sonotrodes.0.at_mm.2",
    )

    other = made.changed(dict(zip(names, (12.5, 6.0, 51.0), strict=True)))

    assert set(names) <= set(made.numbers())
    assert [other.value(name) for name in names] == [12.5, 6.0, 51.0]
    assert other.value("chamber.deflectors.0.rotate_deg.2") == 30.0
    save_design(other, tmp_path / "made.toml")
    assert 'mesh = "block.stl"' in (tmp_path / "made.toml").read_text(encoding="utf-8")
    save_design(design(), tmp_path / "plain.toml")
    assert "deflectors" not in (tmp_path / "plain.toml").read_text(encoding="utf-8")
    assert load_design(tmp_path / "made.toml") == other


def test_a_design_without_fittings_builds_the_very_same_chamber(plain: Chamber) -> None:
    again = build_chamber(design(deflectors=[], holes=[], sonotrodes=[]))
    for field in dataclasses.fields(Chamber):
        if field.name in ("vertices", "triangles", "tags", "source"):
            assert np.array_equal(getattr(again, field.name), getattr(plain, field.name))


@pytest.mark.parametrize("seed", range(40))
def test_any_deflector_leaves_a_sound_chamber_or_is_refused(seed: int, plain: Chamber) -> None:
    rng = np.random.default_rng(seed)
    kinds = [
        {"kind": "plate", "size_mm": rng.uniform(0.5, 30, 3).tolist()},
        {
            "kind": "rod",
            "diameter_mm": float(rng.uniform(1, 12)),
            "length_mm": float(rng.uniform(2, 60)),
        },
        {"kind": "ball", "diameter_mm": float(rng.uniform(1, 25))},
    ]
    place = rng.uniform((-40, -40, -2), (40, 40, 50)).tolist()
    turned = rng.uniform(-180, 180, 3) if seed % 2 else rng.choice([0.0, 90.0, 45.0], 3)
    own = {**kinds[seed % 3], "at_mm": place, "rotate_deg": turned.tolist()}
    try:
        chamber = build_chamber(design(deflectors=[own]))
    except InputError as refused:
        error = str(refused)
    else:
        error = "chamber.deflectors.0.at_mm"
        sound(chamber)
        assert chamber.volume < plain.volume
    assert error.startswith("chamber.deflectors.0.at_mm")


def test_bodies_of_one_file_that_overlap_count_once(plain: Chamber, tmp_path: Path) -> None:
    box = trimesh.creation.box((4, 4, 4))
    trimesh.util.concatenate([box, box.copy().apply_translation((2, 0, 0))]).export(
        tmp_path / "two.stl"
    )
    vane = {
        "kind": "mesh",
        "mesh": str(tmp_path / "two.stl"),
        "unit": "mm",
        "at_mm": [28.0, 0.0, 12.0],
    }
    chamber = build_chamber(design([vane]))

    sound(chamber)
    assert plain.volume - chamber.volume == pytest.approx(1e-9 * 6 * 4 * 4, rel=1e-6)
    assert area_of(chamber, TAG_PART) == pytest.approx(area_of(plain, TAG_PART), rel=1e-9)


def test_deflectors_in_any_order_make_the_same_chamber() -> None:
    """One in another, two alike, two that touch: they are united before they are cut out."""
    inner, beside = (
        {**PLATE, "size_mm": [2.0, 2.0, 2.0]},
        {**PLATE, "at_mm": [20.0, 8.0, 12.0], "rotate_deg": [0.0] * 3},
    )
    some = [inner, PLATE, PLATE, {**beside, "at_mm": [20.0, 16.0, 12.0]}, beside]
    one, other = (build_chamber(design(order)) for order in (some, some[::-1]))

    sound(one)
    assert one.volume == pytest.approx(other.volume, rel=1e-12)
    assert area_of(one, TAG_WALL) == pytest.approx(area_of(other, TAG_WALL), rel=1e-9)


def test_no_shot_starts_in_a_bore_that_leads_below_the_sonotrode() -> None:
    sump = {
        "at_mm": [25.0, 0.0, 20.0],
        "axis": [1.0, 0.0, -1.0],
        "diameter_mm": 12.0,
        "depth_mm": 60.0,
    }
    asked = design(holes=[sump])
    chamber = build_chamber(asked)
    scene = build_scene(asked, chamber_mesh(chamber), seed=1)

    assert chamber.vertices[:, 2].min() < -0.02
    assert scene.balls.positions[:, 2].min() > 0.0


def test_a_file_of_a_deflector_is_not_told_as_the_part(tmp_path: Path) -> None:
    trimesh.creation.box((4, 4, 4)).export(tmp_path / "vane.stl")
    vane = {
        "kind": "mesh",
        "mesh": str(tmp_path / "vane.stl"),
        "unit": "m",
        "at_mm": [28.0, 0.0, 12.0],
    }
    with pytest.raises(InputError, match=r"chamber\.deflectors\.0\.mesh: .*with unit = 'm' "):
        build_chamber(design([vane]))
    notes = build_chamber(design([{**vane, "unit": "guess"}])).notes
    assert any(
        "vane.stl: unit guessed as 'mm' (by its size): it measures 4 x 4 x 4 mm; give chamber.def"
        in n
        for n in notes
    )
    with pytest.raises(
        InputError, match=r"deflectors\.0\.mesh: given ''; allowed: a text in quotes \(mesh file"
    ):
        design([{**vane, "mesh": ""}])


@pytest.mark.parametrize(
    ("fittings", "said"),
    [
        (
            {"deflectors": [{**PLATE, "at_mm": [1e300, 0.0, 0.0]}]},
            r"chamber\.deflectors\.0\.at_mm: given \[1e\+300",
        ),
        (
            {"sonotrodes": [sonotrode(at_mm=[0.0, -1e9, 0.0])]},
            r"sonotrodes\.0\.at_mm: .*from -10000 to 10000 mm",
        ),
        (
            {"sonotrodes": [sonotrode()] * 51},
            "sonotrodes: given .*; allowed: a list of at most 50 tables",
        ),
    ],
)
def test_too_far_and_too_many_are_refused(fittings: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        design(**fittings)


def test_the_sides_of_a_plate_vary() -> None:
    asked = design([PLATE])
    thicker = asked.changed({"chamber.deflectors.0.size_mm.2": 5.0})

    assert "chamber.deflectors.0.size_mm.2" in asked.numbers()
    assert thicker.chamber.deflectors[0].size_mm == (10.0, 8.0, 5.0)
    with pytest.raises(
        InputError,
        match=r"size_mm: given \[10.0, 8.0, 0.0\]; each side must be from 0.1 to 2000 mm",
    ):
        asked.changed({"chamber.deflectors.0.size_mm.2": 0.0})


@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_lines_cross_a_box_where_it_begins_and_ends(unit: float) -> None:
    """From the left of a box from 1 to 3, within it, along its edge and past it."""
    box = trimesh.creation.box(bounds=unit * np.array([[1.0, 0, 0], [3, 1, 1]]))
    count = len(box.faces)
    surface = SolidSurface(
        np.asarray(box.vertices), np.asarray(box.faces), np.zeros(count, int), np.zeros(count, int)
    )
    points = unit * np.array([
        [0.0, 0.3, 0.4], [2.0, 0.3, 0.4], [0, 0, 0], [0, 1.01, 0.5], [4, 0.5, 0.5],
    ])  # fmt: skip
    right = np.array([1.0, 0.0, 0.0])
    distance, is_inwards = first_crossings(surface, points, right, 0.0)
    assert distance / unit == pytest.approx([1.0, 1.0, 1.0, np.inf, np.inf])
    assert is_inwards[:3].tolist() == [True, False, True]
    later, is_inwards = first_crossings(surface, points, right, 1.5 * unit)
    assert later / unit == pytest.approx([3.0, np.inf, 3.0, np.inf, np.inf])
    assert not is_inwards[0]
    back, is_inwards = first_crossings(surface, points[-1:], -right, 0.0)
    assert (back[0] / unit, is_inwards[0]) == (pytest.approx(1.0), True)

"""Chambers are closed, have the right volume, and each triangle is traced to its origin."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.part import Part
from chamberopt.common.errors import InputError
from chamberopt.design.load import Design, load_design
from chamberopt.design.shapes import TAG_PART, TAG_SONOTRODE, TAG_WALL
from chamberopt.geometry.solids import make_solid
from chamberopt.geometry.triangles import area_vectors, areas, heights
from tests.chamberopt.chamber.test_fixture import BOX, END, THROUGH
from tests.chamberopt.chamber.test_fixture import design as boxed

DESIGNS = Path(__file__).resolve().parents[3] / "designs"
NAMES = ("gear", "plate", "blade")
NEAR = 2e-9  # m: the grid of 1 nm, and slivers of 1 nm that were handed to a neighbour


def shipped(name: str, **tables: dict[str, Any]) -> Design:
    """A shipped design with some entries of its tables changed and the whole surface as target."""
    data = load_design(DESIGNS / f"{name}.toml").model_dump()
    data["part"]["target"] = {}
    for table, entries in tables.items():
        data[table].update(entries)
    return Design.model_validate(data)


def with_mesh(folder: Path, mesh: trimesh.Trimesh, **tables: dict[str, Any]) -> Design:
    """A design around another part (numbers in mm)."""
    mesh.export(folder / "part.stl")
    part = {"mesh": str(folder / "part.stl"), **tables.pop("part", {})}
    return shipped("gear", part=part, **tables)


def box(
    size: tuple[float, float, float], at: tuple[float, float, float] = (0, 0, 0)
) -> trimesh.Trimesh:
    made = trimesh.creation.box(size)
    made.apply_translation(at)
    return made


def overlap(design: Design, chamber: Chamber) -> float:
    """Volume [m³] that the part and the whole shape have in common."""
    shape = design.chamber.surface(chamber.part.vertices, chamber.part.triangles)
    part = make_solid(chamber.part.vertices, chamber.part.triangles, "part")
    return (make_solid(shape.vertices, shape.triangles, "shape").body ^ part.body).volume() * 1e-9


def shape_volume(design: Design) -> float:
    """Volume [m³] of the whole shape, whose corners are on a grid of 1 nm."""
    chamber = design.chamber
    shape = chamber.surface(np.zeros((0, 3)), np.zeros((0, 3), dtype=int))
    volume = make_solid(shape.vertices, shape.triangles, "shape").volume
    polygon = chamber.facets / 2 * (chamber.diameter / 2) ** 2 * np.sin(2 * np.pi / chamber.facets)
    assert volume == pytest.approx(
        polygon * chamber.height, rel=4e-9 / chamber.diameter + 2e-9 / chamber.height
    )
    return volume


def check(design: Design, chamber: Chamber) -> None:
    """What holds for every chamber."""
    mesh = trimesh.Trimesh(chamber.vertices, chamber.triangles, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert chamber.volume == pytest.approx(mesh.volume, rel=1e-9)
    assert chamber.volume > 0.0
    left_out = any("cuts off" in note for note in chamber.notes)
    whole = shape_volume(design) - overlap(design, chamber)
    if left_out:
        assert chamber.volume < whole
    else:
        assert abs(chamber.volume - whole) < 1e-9 * shape_volume(design)

    assert set(np.unique(chamber.tags)) <= {TAG_PART, TAG_SONOTRODE, TAG_WALL}
    on_part = chamber.tags == TAG_PART
    assert ((chamber.source >= 0) == on_part).all()
    floor = chamber.vertices[chamber.triangles[chamber.tags == TAG_SONOTRODE]]
    assert (floor[..., 2] == 0.0).all()
    assert chamber.part.vertices[:, 2].min() == pytest.approx(
        design.chamber.sonotrode_distance, abs=1e-9
    )

    check_source(chamber, on_part)
    area = areas(chamber.vertices, chamber.triangles)
    assert chamber.exposed_area.shape == chamber.part.area.shape == chamber.part.target.shape
    assert chamber.exposed_area.sum() == pytest.approx(area[on_part].sum(), rel=1e-12)
    assert (chamber.exposed_area <= chamber.part.area * (1 + 1e-9) + NEAR * 1e-3).all()


def check_source(chamber: Chamber, on_part: np.ndarray) -> None:
    """Each part triangle of the cavity lies in its source triangle and faces the other way."""
    pieces = chamber.vertices[chamber.triangles[on_part]]
    sources = chamber.part.triangles[chamber.source[on_part]]
    a, b, c = (chamber.part.vertices[sources[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    assert np.abs(np.einsum("tki,ti->tk", pieces - a[:, None], normal)).max() < NEAR
    for start, end in ((a, b), (b, c), (c, a)):
        inward = np.cross(normal, end - start)
        inward /= np.linalg.norm(inward, axis=1)[:, None]
        assert np.einsum("tki,ti->tk", pieces - start[:, None], inward).min() > -NEAR
    thick = heights(chamber.vertices, chamber.triangles[on_part]) > 10 * NEAR
    facing = np.einsum(
        "ti,ti->t", area_vectors(chamber.vertices, chamber.triangles[on_part]), normal
    )
    assert (facing[thick] < 0.0).all()


@pytest.mark.parametrize("name", NAMES)
def test_the_shipped_designs_make_chambers(name: str) -> None:
    design = load_design(DESIGNS / f"{name}.toml")

    chamber = build_chamber(design)

    check(design, chamber)
    exposed_target = (chamber.exposed_area > 0) & chamber.part.target
    assert (
        chamber.exposed_area[exposed_target].sum() > 0.9 * chamber.part.area[exposed_target].sum()
    )
    assert not any("rounding" in note for note in chamber.notes)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", range(6))
def test_any_size_offset_and_rotation_makes_a_sound_chamber(name: str, seed: int) -> None:
    rng = np.random.default_rng([seed, NAMES.index(name)])
    turned = rng.uniform(-180, 180, 3) if seed % 3 else rng.choice([0.0, 90.0, 180.0], 3)
    design = shipped(
        name,
        part={
            "rotate_deg": tuple(turned.tolist()),
            "offset_mm": tuple(rng.uniform(-8, 8, 2).tolist()),
        },
        chamber={
            "height_mm": float(rng.uniform(25, 90)),
            "diameter_mm": float(rng.uniform(40, 110)),
            "sonotrode_distance_mm": float(rng.uniform(8, 20)),
            "facets": int(rng.integers(8, 100)),
        },
    )

    check(design, build_chamber(design))


@pytest.mark.parametrize(
    ("diameter", "height"), [(44.0, 45.0), (70.0, 25.0), (44.0, 25.0), (16.0, 45.0)]
)
def test_faces_that_coincide_with_the_gear_stay_sound(diameter: float, height: float) -> None:
    """Tip circle or shaft on the wall, ceiling on the upper face: hard cases for booleans."""
    design = shipped(
        "gear",
        chamber={"diameter_mm": diameter, "height_mm": height, "sonotrode_distance_mm": 15.0},
    )

    check(design, build_chamber(design))


def bridge() -> trimesh.Trimesh:
    """A bar across the chamber, whose legs hang down outside of the walls (numbers in mm)."""
    bar = trimesh.creation.box(bounds=[(-60, -5, 0), (60, 5, 8)])
    legs = [trimesh.creation.box(bounds=[(x - 4, -5, -90), (x + 4, 5, 4)]) for x in (-56.0, 56.0)]
    return trimesh.boolean.union([bar, *legs], engine="manifold")


@pytest.mark.parametrize("turn", [0.0, 90.0, 217.0])
@pytest.mark.parametrize("aside", [(0.0, 0.0), (3.0, -2.0)])
@pytest.mark.parametrize("lean", [0.0, 5.0])
def test_legs_outside_of_the_walls_do_not_set_the_distance(
    tmp_path: Path, turn: float, aside: tuple[float, float], lean: float
) -> None:
    """The cavity is that of the bar alone."""
    chamber = {"diameter_mm": 70.0, "height_mm": 40.0, "inclination_deg": lean}
    part = {"rotate_deg": [0.0, 0.0, turn], "offset_mm": aside}
    whole = with_mesh(tmp_path, bridge(), chamber=chamber, part=part)
    (tmp_path / "bar").mkdir()
    bar = trimesh.creation.box(bounds=[(-60, -5, 0), (60, 5, 8)])
    alone = with_mesh(tmp_path / "bar", bar, chamber=chamber, part=part)
    made, expected = build_chamber(whole), build_chamber(alone)
    assert made.volume == pytest.approx(expected.volume, rel=1e-6)
    assert made.lowest_of_part == pytest.approx(whole.chamber.sonotrode_distance, abs=1e-8)
    below = 90.0 - whole.chamber.sonotrode_distance_mm
    assert any(f"reaches {below:.3g} mm below the sonotrode" in note for note in made.notes)
    assert not any("below the sonotrode" in note for note in expected.notes)


def test_a_leg_over_a_face_larger_than_the_floor_is_refused(tmp_path: Path) -> None:
    chamber = {"diameter_mm": 70.0, "height_mm": 40.0}
    design = with_mesh(tmp_path, bridge(), chamber=chamber)
    made = build_chamber(design.changed({"sonotrode.face": {"diameter_mm": 100.0}}))
    assert made.lowest_of_part == pytest.approx(design.chamber.sonotrode_distance, abs=1e-8)
    for face in ({"diameter_mm": 110.0, "name": "B"}, {"size_mm": [120.0, 80.0], "name": "B"}):
        with pytest.raises(InputError, match=r'face: "B" .* reaches down to -7\d mm over it'):
            build_chamber(design.changed({"sonotrode.face": face}))


def test_a_hanging_box_is_subtracted_whole(tmp_path: Path) -> None:
    design = with_mesh(tmp_path, box((10, 20, 25)))

    chamber = build_chamber(design)

    check(design, chamber)
    assert chamber.volume == pytest.approx(shape_volume(design) - 5e-6, rel=1e-9)
    assert chamber.exposed_area == pytest.approx(chamber.part.area, rel=1e-9)
    assert any("reaches no wall" in note for note in chamber.notes)
    low, high = chamber.part.vertices.min(axis=0), chamber.part.vertices.max(axis=0)
    assert low == pytest.approx([-0.005, -0.010, 0.015], abs=1e-9)
    assert high == pytest.approx([0.005, 0.010, 0.040], abs=1e-9)


def test_a_rod_through_the_ceiling_is_held_and_cut_at_the_ceiling(tmp_path: Path) -> None:
    design = with_mesh(tmp_path, box((10, 10, 100)))

    chamber = build_chamber(design)

    inside = design.chamber.height - design.chamber.sonotrode_distance
    assert chamber.volume == pytest.approx(shape_volume(design) - 1e-4 * inside, rel=1e-9)
    assert chamber.exposed_area.sum() == pytest.approx(1e-4 + 4 * 0.01 * inside, rel=1e-9)
    hidden = 1.0 - (1e-4 + 4 * 0.01 * inside) / (2e-4 + 4 * 0.01 * 0.1)
    (note,) = chamber.notes
    assert note.startswith(
        f"{hidden:.1%} of the area of the target is outside the cavity and counts as not covered"
    )


def test_a_plate_closes_the_chamber_and_the_room_above_is_left_out() -> None:
    low, high = (
        shipped("plate", chamber={"height_mm": height, "diameter_mm": 50.0})
        for height in (40.0, 60.0)
    )
    first, second = build_chamber(low), build_chamber(high)

    distance = low.chamber.sonotrode_distance
    for design, chamber in ((low, first), (high, second)):
        check(design, chamber)
        assert chamber.volume == pytest.approx(
            shape_volume(design) * distance / design.chamber.height, rel=1e-9
        )
        # What is left out is all from the plate's upper side to the ceiling.
        top, ceiling = chamber.part.vertices[:, 2].max(), design.chamber.height
        volume = shape_volume(design) * (ceiling - top) / ceiling
        text = (
            f"cuts off a closed room of {1e6 * volume:.3g} cm³ between z = {1e3 * top:.4g} and "
            f"{1e3 * ceiling:.4g} mm"
        )
        assert any(text in note for note in chamber.notes)
        assert any("chamber.height_mm has no effect" in note for note in chamber.notes)
    assert chamber.exposed_area.sum() == pytest.approx(first.volume / distance, rel=1e-9)
    assert first.volume == pytest.approx(second.volume, rel=1e-9)


def test_a_plate_level_with_the_ceiling_closes_it_without_a_note_of_a_room() -> None:
    distance = load_design(DESIGNS / "plate.toml").chamber.sonotrode_distance_mm
    design = shipped("plate", chamber={"height_mm": distance + 10.0, "diameter_mm": 50.0})

    chamber = build_chamber(design)

    check(design, chamber)
    assert not any("cuts off" in note for note in chamber.notes)


def test_overlapping_bodies_in_one_file_count_once(tmp_path: Path) -> None:
    cross = trimesh.util.concatenate([box((20, 10, 10)), box((10, 20, 10.5))])
    design = with_mesh(tmp_path, cross)

    chamber = build_chamber(design)

    common = 10 * 10 * 10
    union = 20 * 10 * 10 + 10 * 20 * 10.5 - common
    assert chamber.volume == pytest.approx(shape_volume(design) - union * 1e-9, rel=1e-9)
    check_source(chamber, chamber.tags == TAG_PART)
    hidden = (
        chamber.exposed_area < 0.99 * chamber.part.area
    )  # some of each body is inside the other
    assert hidden[:12].any()


def test_a_void_inside_the_part_is_no_chamber(tmp_path: Path) -> None:
    inner = box((10, 10, 10))
    inner.invert()
    design = with_mesh(tmp_path, trimesh.util.concatenate([box((20, 20, 20)), inner]))

    chamber = build_chamber(design)

    assert chamber.volume == pytest.approx(shape_volume(design) - 8e-6, rel=1e-9)
    assert any("1 closed voids" in note for note in chamber.notes)
    assert (chamber.exposed_area[12:] == 0).all()


def test_rotation_is_about_x_then_y_then_z(tmp_path: Path) -> None:
    """Sides (10, 20, 30) are permuted by quarter turns about x, then y, then z."""
    design = with_mesh(tmp_path, box((10, 20, 30)), part={"rotate_deg": (90.0, 90.0, 90.0)})

    sides = np.ptp(build_chamber(design).part.vertices, axis=0)

    assert sides == pytest.approx([0.030, 0.020, 0.010], abs=1e-9)


def test_a_rotation_turns_the_way_the_right_hand_says(tmp_path: Path) -> None:
    """A wedge whose thick end is at +x points down with it after +90 degrees about y."""
    wedge = trimesh.convex.convex_hull(
        [[0, 0, 0], [20, -5, -5], [20, 5, -5], [20, 5, 5], [20, -5, 5]]
    )
    design = with_mesh(tmp_path, wedge, part={"rotate_deg": (0.0, 90.0, 0.0)})

    part = build_chamber(design).part

    lowest = part.vertices[:, 2] < part.vertices[:, 2].min() + 1e-9
    assert lowest.sum() == 4


def test_the_offset_moves_the_part_sideways(tmp_path: Path) -> None:
    design = with_mesh(
        tmp_path, box((10, 10, 10), at=(100, 200, 300)), part={"offset_mm": (3.0, -4.0)}
    )

    part = build_chamber(design).part

    assert (part.vertices.min(axis=0) + part.vertices.max(axis=0))[:2] / 2 == pytest.approx(
        [0.003, -0.004], abs=1e-9
    )


def test_the_target_is_chosen_in_the_files_own_frame(tmp_path: Path) -> None:
    """A box turned upside down: its file's upper face is the one that faces the sonotrode."""
    top = {"direction": (0.0, 0.0, 1.0), "angle_deg": (0.0, 10.0)}
    right = {"box_mm": ((104.9, -100.0, -100.0), (200.0, 100.0, 100.0))}

    def part(target: dict[str, Any]) -> Part:
        turned = {"rotate_deg": (180.0, 0.0, 0.0), "target": target}
        return build_chamber(
            with_mesh(tmp_path, box((10, 20, 30), at=(100, 0, 0)), part=turned)
        ).part

    lowest, side = part(top), part(right)
    assert lowest.area[lowest.target].sum() == pytest.approx(200e-6)
    corners = lowest.vertices[lowest.triangles[lowest.target]]
    assert np.allclose(corners[..., 2], 0.015, atol=1e-9)
    assert side.area[side.target].sum() == pytest.approx(600e-6)
    with pytest.raises(InputError, match="chooses none of the 12 triangles"):
        part({**top, **right})  # given together they intersect, and no triangle is both


def test_the_gears_target_is_its_toothed_rim() -> None:
    part = build_chamber(load_design(DESIGNS / "gear.toml")).part

    corners = part.vertices[part.triangles[part.target]]
    normal = area_vectors(part.vertices, part.triangles)[part.target]
    assert np.hypot(corners[..., 0], corners[..., 1]).min() > 0.017
    # New vertices near the teeth's ends may lean by a third of a degree.
    assert (np.abs(normal[:, 2]) < 0.006 * np.linalg.norm(normal, axis=1)).all()


@pytest.mark.parametrize(
    ("size", "tables", "said"),
    [
        (
            (10, 10, 10),
            {"part": {"offset_mm": (80.0, 0.0)}},
            r"part\.offset_mm.*beside the chamber",
        ),
        (
            (10, 10, 10),
            {"part": {"offset_mm": (31.0, 31.0)}},
            "no part of it is inside the chamber",
        ),
        (
            (90, 90, 10),
            {"part": {"target": {"direction": (0.0, 0.0, 1.0), "angle_deg": (0.0, 5.0)}}},
            "none of its 2 triangles bounds the cavity",
        ),
        (
            (10, 10, 10),
            {"part": {"target": {"box_mm": ((50.0, 50.0, 50.0), (60.0, 60.0, 60.0))}}},
            r"chooses none of the 12 triangles.*\[-5.0, -5.0, -5.0\] to \[5.0, 5.0, 5.0\] mm",
        ),
    ],
)
def test_what_cannot_be_a_chamber_is_refused(
    tmp_path: Path, size: Any, tables: dict[str, Any], said: str
) -> None:
    design = with_mesh(tmp_path, box(size), **tables)

    with pytest.raises(InputError, match=said):
        build_chamber(design)


@pytest.mark.parametrize(
    ("distance", "said"), [(0.02, "would hit the part"), (60.0, "above the ceiling")]
)
def test_a_part_too_low_or_too_high_is_refused_even_if_the_design_was_not_checked(
    distance: float, said: str
) -> None:
    design = shipped("gear")
    unchecked = design.chamber.model_copy(update={"sonotrode_distance_mm": distance})

    with pytest.raises(InputError, match=said):
        build_chamber(design.model_copy(update={"chamber": unchecked}))


def test_the_same_design_gives_the_same_chamber() -> None:
    design = load_design(DESIGNS / "gear.toml")

    first, second = build_chamber(design), build_chamber(design)

    for name in ("vertices", "triangles", "tags", "source", "exposed_area"):
        assert np.array_equal(getattr(first, name), getattr(second, name))


def test_a_mesh_file_that_changes_is_read_again(tmp_path: Path) -> None:
    first = build_chamber(with_mesh(tmp_path, box((10, 10, 10))))
    second = build_chamber(
        with_mesh(tmp_path, trimesh.creation.icosphere(subdivisions=2, radius=5))
    )

    assert len(first.part.triangles) == 12
    assert second.part.smoothing.given_triangles == 320


@pytest.mark.parametrize("high", [None, 1.0])  # mm: of the keyway; None: all through
def test_a_keyway_is_closed_by_the_flanges_of_the_arbor(tmp_path: Path, high: float | None) -> None:
    drill = trimesh.creation.cylinder(2.0, 20.0, sections=64)
    key = trimesh.creation.box((1.0, 3.0, 20.0))
    key.apply_translation((0.0, 1.5, 0.0))
    holes = [drill, key]
    for one in holes:
        one.apply_translation((-5.0, 0.0, 0.0))
    if high is not None:  # a blind one, and the arbor alone closes it
        holes[1] = trimesh.creation.box((1.0, 3.0, high))
        holes[1].apply_translation((-5.0, 1.5, 0.0))
    body = trimesh.boolean.difference([trimesh.creation.box(BOX), *holes], engine="manifold")
    body.export(tmp_path / "keyed.stl")
    flanges = {} if high else {"diameter_mm": 8.0, "thickness_mm": 2.0}
    holder = {"kind": "arbor", "at": THROUGH, "axis": (0, 1, 0), "both_sides": True, **flanges}
    given = boxed(tmp_path, "keyed", part={"rotate_deg": (90, 0, 0), "target": END}, holder=holder)
    notes = build_chamber(given).notes
    name = "the arbor" if high else "the flanges of the arbor"
    assert any(note.startswith(f"closed by {name}: a hollow of the part of ") for note in notes)

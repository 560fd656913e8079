"""Parametric cavities agree with independent formulas and with shapely."""

import re
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
import shapely
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.integrate import quad
from shapely import affinity

from chamberopt.chamber.build import build_chamber
from chamberopt.common.errors import InputError
from chamberopt.design.load import Design, load_design
from chamberopt.design.shape_surface import ShapeSurface
from chamberopt.design.shapes import SHAPES, TAG_SONOTRODE, TAG_WALL
from chamberopt.design.shapes.custom import find_fault
from chamberopt.geometry.triangles import areas
from chamberopt.simulation.numerical_parameters import FACETS, numerical_parameters

DESIGNS = Path(__file__).resolve().parents[4] / "designs"
NOTHING = np.zeros((0, 3)), np.zeros((0, 3), dtype=int)
PROFILE = [[30.0, 0.0], [30.0, 20.0], [20.0, 25.0], [26.0, 40.0], [0.0, 50.0]]


def surface(shape: str, part: tuple[np.ndarray, np.ndarray] = NOTHING, **keys: Any) -> ShapeSurface:
    return SHAPES[shape](shape=shape, sonotrode_distance_mm=15.0, **keys).surface(*part)


def checked(made: ShapeSurface) -> trimesh.Trimesh:
    """What holds for every shape; the mesh in mm."""
    mesh = trimesh.Trimesh(1e3 * made.vertices, made.triangles, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0.0
    assert find_fault(made) is None
    assert np.isin(made.tags, (TAG_SONOTRODE, TAG_WALL)).all()
    low = (made.vertices[made.triangles][..., 2] == 0.0).all(axis=1)
    assert np.array_equal(low, made.tags == TAG_SONOTRODE)
    assert made.vertices[:, 2].min() == 0.0
    return mesh


def floor_area(made: ShapeSurface) -> float:
    mesh = trimesh.Trimesh(1e3 * made.vertices, made.triangles, process=False)
    return float(mesh.area_faces[made.tags == TAG_SONOTRODE].sum())


def in_flats(facets: int) -> float:
    """Area of the regular polygon whose corners lie on a circle, over that of the circle."""
    return facets / (2.0 * np.pi) * np.sin(2.0 * np.pi / facets)


def simpson(area_at: Any, height: float) -> float:
    """Exact for solids whose plan grows linearly."""
    return height / 6.0 * (area_at(0.0) + 4.0 * area_at(0.5) + area_at(1.0))


def rounded_polygon_area(sides: int, sharp: float, radius: float, facets: int) -> float:
    """Area of an equiangular polygon with rounded corners, from its area with sharp ones."""
    turn = 2.0 * np.pi / sides
    steps = np.ceil(facets / sides - 1e-9)
    if facets / sides < 0.5 or radius <= 0.05:
        return sharp
    return sharp - sides * radius**2 * (np.tan(turn / 2.0) - 0.5 * steps * np.sin(turn / steps))


# ---- cylinder, revolve


@pytest.mark.parametrize("facets", [8, 9, 64, 1024])
def test_a_cylinder_is_the_prism_over_a_regular_polygon(facets: int) -> None:
    radius, height = 0.035, 0.045
    polygon = facets / 2 * radius**2 * np.sin(2 * np.pi / facets)

    made = surface("cylinder", diameter_mm=2e3 * radius, height_mm=1e3 * height, facets=facets)

    mesh = trimesh.Trimesh(made.vertices, made.triangles, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(polygon * height, rel=1e-12)
    assert len(made.triangles) == 4 * facets
    floor = made.tags == TAG_SONOTRODE
    assert mesh.area_faces[floor].sum() == pytest.approx(polygon, rel=1e-12)
    assert mesh.area_faces[made.tags == TAG_WALL].sum() == pytest.approx(
        mesh.area - polygon, rel=1e-12
    )


def test_the_floor_is_at_zero_and_the_axis_does_not_drift() -> None:
    made = surface("cylinder", diameter_mm=70.0, height_mm=45.0)

    floor = made.vertices[made.triangles[made.tags == TAG_SONOTRODE]]
    assert (floor[..., 2] == 0.0).all()
    assert np.abs(made.vertices[:, :2].mean(axis=0)).max() < 1e-17
    assert np.allclose(np.hypot(*made.vertices[:128, :2].T), 0.035, rtol=1e-15)
    assert made.vertices[:, 2].max() == 0.045


@pytest.mark.parametrize("lean", [-30.0, -5.0, 12.0, 45.0])
def test_a_leaning_cylinder_is_a_frustum(lean: float) -> None:
    low, height = 35.0, 40.0
    high = low + height * np.tan(np.radians(lean))

    mesh = checked(
        surface("cylinder", diameter_mm=2 * low, height_mm=height, inclination_deg=lean, facets=48)
    )

    frustum = np.pi / 3.0 * height * (low**2 + low * high + high**2)
    assert mesh.volume == pytest.approx(frustum * in_flats(48), rel=1e-12)
    apothems = np.cos(np.pi / 48) * np.array([low, high])
    side = 2.0 * np.tan(np.pi / 48) * apothems
    sides = 48 * 0.5 * side.sum() * np.hypot(height, apothems[1] - apothems[0])
    assert mesh.area == pytest.approx(np.pi * (low**2 + high**2) * in_flats(48) + sides, rel=1e-12)


@pytest.mark.parametrize("lean", [-15.0, 0.0, 25.0])
@pytest.mark.parametrize("corner", [0.5, 12.0])
def test_the_edge_below_a_cylinders_ceiling_is_rounded(lean: float, corner: float) -> None:
    low, height, a = 35.0, 40.0, np.radians(lean)
    middle_z = height - corner
    middle_r = low + np.tan(a) * middle_z - corner / np.cos(a)
    tangent = middle_z - corner * np.sin(a)

    def plan(z: float) -> float:
        inner = (
            low + np.tan(a) * z
            if z < tangent
            else middle_r + np.sqrt(max(0.0, corner**2 - (z - middle_z) ** 2))
        )
        return np.pi * inner**2

    keys = {
        "diameter_mm": 2 * low,
        "height_mm": height,
        "inclination_deg": lean,
        "corner_radius_mm": corner,
    }
    mesh = checked(surface("cylinder", facets=200, **keys))

    volume = quad(plan, 0.0, height, points=[tangent], epsrel=1e-9)[0]
    assert mesh.volume == pytest.approx(volume * in_flats(200), rel=5e-5)  # chords of the arc
    assert mesh.extents[2] == pytest.approx(height, rel=1e-12)


def test_a_revolved_cone_and_a_step_are_what_they_are() -> None:
    cone = checked(surface("revolve", profile_mm=[[30.0, 0.0], [0.0, 50.0]], facets=40))
    stepped = checked(
        surface(
            "revolve", profile_mm=[[30.0, 0.0], [30.0, 20.0], [20.0, 20.0], [20.0, 50.0]], facets=40
        )
    )

    assert cone.volume == pytest.approx(np.pi / 3 * 30**2 * 50 * in_flats(40), rel=1e-12)
    assert stepped.volume == pytest.approx(
        np.pi * (30**2 * 20 + 20**2 * 30) * in_flats(40), rel=1e-12
    )


@pytest.mark.parametrize("corner", [0.0, 1.5])
def test_a_revolved_profile_by_pappus(corner: float) -> None:
    """Volume by Pappus: area times the path of its centroid, rounded by opening with a disc."""
    half = shapely.Polygon([[0.0, -20.0], [30.0, -20.0], *PROFILE])
    whole = shapely.union(half, affinity.scale(half, -1.0, 1.0, origin=(0.0, 0.0)))
    fine = {"quad_segs": 256}
    if corner:
        whole = whole.buffer(-corner, **fine).buffer(2 * corner, **fine).buffer(-corner, **fine)
    section = whole.intersection(shapely.box(0.0, 0.0, 100.0, 100.0))
    apex = (
        0.0 if not corner else 0.01
    )  # mm³: shapely rounds the tip on the axis too; a cone's tip stays

    mesh = checked(surface("revolve", profile_mm=PROFILE, corner_radius_mm=corner, facets=200))

    pappus = 2.0 * np.pi * section.centroid.x * section.area * in_flats(200)
    assert mesh.volume == pytest.approx(pappus, rel=1e-12 if not corner else 1e-5, abs=apex)


def test_a_profile_may_overhang_and_a_leaning_one_is_sheared() -> None:
    pocket = [[30.0, 0.0], [30.0, 30.0], [20.0, 30.0], [20.0, 22.0], [10.0, 22.0], [10.0, 40.0]]
    mesh = checked(surface("revolve", profile_mm=pocket, facets=32))
    volume = np.pi * (30**2 * 30 - (20**2 - 10**2) * 8 + 10**2 * 10)
    assert mesh.volume == pytest.approx(volume * in_flats(32), rel=1e-12)

    slope = np.tan(np.radians(10.0))
    sheared = [[r + slope * z if r else 0.0, z] for r, z in PROFILE]
    leaning = checked(surface("revolve", profile_mm=PROFILE, inclination_deg=10.0))
    assert leaning.volume == pytest.approx(
        checked(surface("revolve", profile_mm=sheared)).volume, rel=1e-12
    )


# ---- box, prism


def test_a_box_and_a_hexagon_have_their_sizes() -> None:
    plain = checked(surface("box", length_mm=60.0, width_mm=40.0, height_mm=30.0))
    assert plain.volume == pytest.approx(60 * 40 * 30, rel=1e-12)
    assert plain.extents == pytest.approx([60.0, 40.0, 30.0], rel=1e-12)
    assert plain.area == pytest.approx(2 * (60 * 40 + 60 * 30 + 40 * 30), rel=1e-12)

    hexagon = checked(surface("prism", sides=6, across_mm=40.0, height_mm=30.0, turn_deg=30.0))
    assert hexagon.volume == pytest.approx(np.sqrt(3) / 2 * 40**2 * 30, rel=1e-12)
    assert hexagon.extents[:2] == pytest.approx(
        [40 * 2 / np.sqrt(3), 40.0], rel=1e-12
    )  # at 0 the flats face x


@pytest.mark.parametrize("lean", [-8.0, 0.0, 20.0])
@pytest.mark.parametrize("corner", [0.0, 0.3, 6.0])
def test_boxes_lean_and_are_rounded(lean: float, corner: float) -> None:
    out = 30.0 * np.tan(np.radians(lean))

    def plan(share: float) -> float:
        sharp = (60 + 2 * share * out) * (40 + 2 * share * out)
        return rounded_polygon_area(4, sharp, corner, 40)

    sizes = {"length_mm": 60.0, "width_mm": 40.0, "height_mm": 30.0}
    made = surface("box", **sizes, inclination_deg=lean, corner_radius_mm=corner, facets=40)

    assert checked(made).volume == pytest.approx(simpson(plan, 30.0), rel=1e-12)
    assert floor_area(made) == pytest.approx(plan(0.0), rel=1e-12)
    normal = checked(made).face_normals[made.tags == TAG_WALL]
    sides = normal[np.abs(normal[:, 2]) < 0.9]
    flat = np.abs(sides[:, :2]).max(axis=1) > 0.9999 * np.hypot(
        *sides[:, :2].T
    )  # the four walls: at the inclination
    assert flat.sum() >= 8
    assert np.degrees(np.arcsin(-sides[flat][:, 2])) == pytest.approx(lean, abs=1e-9)


# ---- conformal


def block(
    size: tuple[float, float, float], at: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> trimesh.Trimesh:
    """Its lowest face `at` 15 mm over the sonotrode; m."""
    made = trimesh.creation.box(1e-3 * np.array(size))
    made.apply_translation(1e-3 * np.add(at, (0.0, 0.0, 15.0 + size[2] / 2)))
    return made


def as_part(*meshes: trimesh.Trimesh) -> tuple[np.ndarray, np.ndarray]:
    joined = trimesh.util.concatenate(meshes)
    return np.asarray(joined.vertices), np.asarray(joined.faces)


ELL = as_part(block((40.0, 10.0, 10.0)), block((10.0, 30.0, 10.0), (15.0, 10.0, 0.0)))
ELL_PLAN = shapely.union(shapely.box(-20, -5, 20, 5), shapely.box(10, -5, 20, 25))


@pytest.mark.parametrize("lean", [-4.0, 0.0, 15.0])
def test_the_conformal_hull_is_the_parts_hull_grown(lean: float) -> None:
    keys = {
        "outline": "hull",
        "gap_mm": 6.0,
        "height_mm": 40.0,
        "inclination_deg": lean,
        "facets": 512,
    }
    out = 40.0 * np.tan(np.radians(lean))
    hull = ELL_PLAN.convex_hull

    made = surface("conformal", ELL, **keys)

    volume = simpson(lambda share: hull.buffer(6.0 + share * out, quad_segs=512).area, 40.0)
    assert checked(made).volume == pytest.approx(volume, rel=1e-5)
    assert floor_area(made) == pytest.approx(hull.buffer(6.0, quad_segs=512).area, rel=1e-5)


@pytest.mark.parametrize("corner", [0.0, 5.0])
def test_the_silhouette_follows_hollows_and_spans_narrow_ones(corner: float) -> None:
    keys = {
        "outline": "silhouette",
        "gap_mm": 6.0,
        "height_mm": 40.0,
        "corner_radius_mm": corner,
        "facets": 256,
    }
    plan = ELL_PLAN.buffer(6.0 + corner, quad_segs=256).buffer(-corner, quad_segs=256)

    made = surface("conformal", ELL, **keys)

    mesh = checked(made)
    assert mesh.volume == pytest.approx(plan.area * 40.0, rel=2e-4)
    assert floor_area(made) == pytest.approx(plan.area, rel=2e-4)
    hull = checked(
        surface("conformal", ELL, **{**keys, "outline": "hull", "corner_radius_mm": 0.0})
    )
    assert mesh.volume < 0.9 * hull.volume
    wall = shapely.Polygon(1e3 * made.vertices[_rim(made)][:, :2])
    assert wall.exterior.distance(ELL_PLAN) == pytest.approx(6.0, abs=0.01)


def _rim(made: ShapeSurface) -> list[int]:
    """The border of the floor, in order."""
    floor = made.triangles[made.tags == TAG_SONOTRODE]
    sides = {(int(a), int(b)) for row in floor for a, b in zip(row, np.roll(row, -1), strict=True)}
    after = {a: b for a, b in sides if (b, a) not in sides}
    rim = [next(iter(after))]
    while after[rim[-1]] != rim[0]:
        rim.append(after[rim[-1]])
    return rim


def test_only_what_is_below_the_ceiling_casts_a_shadow_and_holes_are_filled() -> None:
    ring = trimesh.creation.annulus(0.008, 0.014, 0.01, sections=64)
    ring.apply_translation([0.0, 0.0, 0.020])
    flange = block((80.0, 80.0, 5.0), (0.0, 0.0, 30.0))  # from z = 45 on
    keys = {"outline": "silhouette", "gap_mm": 3.0, "facets": 256}

    below = checked(surface("conformal", as_part(ring, flange), height_mm=44.0, **keys))
    beside = checked(surface("conformal", as_part(ring, flange), height_mm=46.0, **keys))

    assert below.volume == pytest.approx(np.pi * 17.0**2 * 44.0, rel=5e-3)
    assert below.extents[:2] == pytest.approx([34.0, 34.0], abs=0.05)
    assert beside.extents[:2] == pytest.approx([86.0, 86.0], abs=0.02)


def test_a_shadow_in_pieces_is_refused_until_the_gap_joins_them() -> None:
    apart = as_part(block((10.0, 10.0, 10.0)), block((10.0, 10.0, 10.0), (30.0, 0.0, 0.0)))
    keys = {"outline": "silhouette", "height_mm": 40.0}

    with pytest.raises(InputError, match=r"chamber\.gap_mm: given 5.* in 2 pieces"):
        surface("conformal", apart, gap_mm=5.0, **keys)
    checked(surface("conformal", apart, gap_mm=11.0, **keys))
    with pytest.raises(InputError, match=r"chamber\.height_mm: given 14: no part below"):
        surface("conformal", apart, gap_mm=11.0, **{**keys, "height_mm": 14.0})


def test_a_gap_too_narrow_for_the_shot_is_said() -> None:
    table = SHAPES["conformal"](
        shape="conformal", sonotrode_distance_mm=15.0, outline="hull", gap_mm=2.0, height_mm=40.0
    )

    assert table.notes(2e-3) == []
    (note,) = table.notes(3e-3)
    assert note.startswith("chamber.gap_mm = 2 is narrower than a ball of 3 mm")


# ---- whatever the values


def mm(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False)


LEANING = {
    "inclination_deg": mm(-45, 45),
    "facets": st.integers(8, 80),
    "corner_radius_mm": mm(0, 40),
}
VALUES: dict[str, dict[str, st.SearchStrategy[Any]]] = {
    "cylinder": {"diameter_mm": mm(2, 2000), "height_mm": mm(2, 2000), **LEANING},
    "box": {"length_mm": mm(2, 2000), "width_mm": mm(2, 2000), "height_mm": mm(2, 2000), **LEANING},
    "prism": {
        "sides": st.integers(3, 64),
        "across_mm": mm(2, 2000),
        "height_mm": mm(2, 2000),
        "turn_deg": mm(-360, 360),
        **LEANING,
    },
    "revolve": {
        "profile_mm": st.lists(st.tuples(mm(1, 60), mm(1, 80)), min_size=1, max_size=5).map(
            lambda points: [(points[0][0], 0.0), *sorted(points, key=lambda p: p[1])]
        ),
        **LEANING,
        "corner_radius_mm": mm(0, 3),
    },
    "conformal": {
        "outline": st.sampled_from(["hull", "silhouette"]),
        "gap_mm": mm(0.1, 50),
        "height_mm": mm(15.5, 60),
        **LEANING,
        "inclination_deg": st.one_of(st.just(0.0), mm(-45, 45)),
        "corner_radius_mm": st.one_of(st.just(0.0), mm(0, 40)),
    },
}


def volume_between(shape: str, keys: dict[str, Any]) -> tuple[float, float]:
    """Bounds [mm³] of the cavity's volume; equal where a formula holds its facets too."""
    facets, corner, slope = (
        keys["facets"],
        keys["corner_radius_mm"],
        np.tan(np.radians(keys["inclination_deg"])),
    )
    height = keys.get("height_mm", 0.0)
    if shape in ("cylinder", "revolve"):
        points = keys.get("profile_mm") or [
            (keys["diameter_mm"] / 2, 0.0),
            (keys["diameter_mm"] / 2, height),
        ]
        line = [(r + slope * z, z) for r, z in points]
        section = shapely.Polygon([(0.0, 0.0), *line, (0.0, line[-1][1])])
        volume = 2.0 * np.pi * section.centroid.x * section.area * in_flats(facets)
        return (
            (volume, volume) if corner <= 0.05 else (0.2 * volume, 1.8 * volume)
        )  # rounded: held by tests above
    if shape in ("box", "prism"):
        sides = keys.get("sides", 4)

        def plan(share: float) -> float:
            out = 2.0 * share * slope * height
            if shape == "box":
                sharp = (keys["length_mm"] + out) * (keys["width_mm"] + out)
            else:
                sharp = sides * (keys["across_mm"] + out) ** 2 / 4.0 * np.tan(np.pi / sides)
            return rounded_polygon_area(sides, sharp, corner, facets)

        return simpson(plan, height), simpson(plan, height)
    narrow = ELL_PLAN.convex_hull if keys["outline"] == "hull" else ELL_PLAN

    def grown(plan: shapely.Polygon) -> float:
        return simpson(
            lambda share: plan.buffer(keys["gap_mm"] + share * slope * height, quad_segs=64).area,
            height,
        )

    # Arcs lie between inscribed ones and, on one side only, mitred ones. A corner radius spans part
    # of the hollows of a silhouette.
    return in_flats(keys["facets"]) * grown(narrow), 1.01 * grown(ELL_PLAN.convex_hull)


@pytest.mark.parametrize("shape", sorted(VALUES))
@settings(max_examples=40, deadline=None, derandomize=True, database=None)
@given(data=st.data())
def test_any_values_make_a_cavity_or_are_refused(shape: str, data: st.DataObject) -> None:
    keys = data.draw(st.fixed_dictionaries(VALUES[shape]))
    try:
        made = surface(shape, ELL, **keys)
    except (ValidationError, InputError) as error:
        if not re.search(r"inclination_deg|corner_radius_mm|profile_mm|gap_mm", str(error)):
            raise
        return

    mesh = checked(made)
    low, high = volume_between(shape, keys)
    table = SHAPES[shape](shape=shape, sonotrode_distance_mm=15.0, **keys)
    assert 1e-9 * mesh.volume <= table.room() * (1 + 1e-9)
    assert low * (1 - 1e-9) <= mesh.volume <= high * (1 + 1e-9)


def test_every_shape_has_its_name_and_a_table_of_its_own() -> None:
    for name, table in SHAPES.items():
        assert get_args(table.model_fields["shape"].annotation) == (name,)
    assert set(VALUES) == set(SHAPES) - {"imported"}  # test_imported.py


@pytest.mark.parametrize(
    ("shape", "keys", "said"),
    [
        (
            "cylinder",
            {"diameter_mm": 70.0, "height_mm": 45.0, "inclination_deg": -40.0},
            "inclination_deg: given -40",
        ),
        (
            "cylinder",
            {"diameter_mm": 70.0, "height_mm": 45.0, "corner_radius_mm": 36.0},
            "34.95 is the furthest",
        ),
        (
            "box",
            {"length_mm": 60.0, "width_mm": 40.0, "height_mm": 30.0, "corner_radius_mm": 20.0},
            "19.975 is the",
        ),
        (
            "box",
            {"length_mm": 60.0, "width_mm": 4.0, "height_mm": 90.0, "inclination_deg": -2.0},
            "walls meet below",
        ),
        (
            "prism",
            {"sides": 5, "across_mm": 40.0, "height_mm": 30.0, "corner_radius_mm": 25.0},
            "corner_radius_mm",
        ),
        ("revolve", {"profile_mm": [[30.0, 1.0], [30.0, 20.0]]}, "begins at z = 1"),
        (
            "revolve",
            {"profile_mm": [[30.0, 0.0], [0.0, 20.0], [30.0, 30.0]]},
            r"given \[0.0, 20.0\] as point 1",
        ),
        (
            "revolve",
            {"profile_mm": [[30.0, 0.0], [30.0, 20.0], [20.0, 20.0], [32.0, 10.0]]},
            "crosses",
        ),
        (
            "revolve",
            {"profile_mm": [[30.0, 0.0], [30.0, 20.0], [30.0, 10.0], [5.0, 20.0]]},
            "folds back",
        ),
        (
            "revolve",
            {"profile_mm": [[30.0, 0.0], [30.0, 20.0], [30.0, 20.0]]},
            "point 2 is on or next to point 1",
        ),
        (
            "conformal",
            {"outline": "silhouette", "gap_mm": 5.0, "height_mm": 40.0, "inclination_deg": 2.0},
            'not supported with outline = "silhouette"; use "hull"',
        ),
        (
            "conformal",
            {"outline": "hull", "gap_mm": 5.0, "height_mm": 40.0, "corner_radius_mm": 3.0},
            "a hull has no corners that jut in",
        ),
        (
            "conformal",
            {"outline": "hull", "gap_mm": 5.0, "height_mm": 40.0, "inclination_deg": -9.0},
            "-7.054 is the furthest",
        ),
    ],
)
def test_what_makes_no_cavity_is_refused_with_what_would(
    shape: str, keys: dict[str, Any], said: str
) -> None:
    with pytest.raises(ValidationError, match=said):
        surface(shape, ELL, **keys)


@pytest.mark.parametrize(
    ("shape", "keys", "key", "fits"),
    [
        ("cylinder", {"diameter_mm": 70.0, "height_mm": 45.0}, "inclination_deg", -37.835),
        ("cylinder", {"diameter_mm": 70.0, "height_mm": 45.0}, "corner_radius_mm", 34.95),
        (
            "box",
            {"length_mm": 60.0, "width_mm": 40.0, "height_mm": 30.0},
            "corner_radius_mm",
            19.975,
        ),
        ("revolve", {"profile_mm": PROFILE}, "corner_radius_mm", None),
    ],
)
def test_what_is_said_to_fit_does(
    shape: str, keys: dict[str, Any], key: str, fits: float | None
) -> None:
    with pytest.raises(ValidationError) as refused:
        surface(shape, **keys, **{key: -44.0 if key == "inclination_deg" else 500.0})
    said = re.search(r"; (\S+) is the furthest", str(refused.value))
    assert said
    assert fits in (None, float(said[1]))

    checked(surface(shape, **keys, **{key: float(said[1])}))


# ---- with a part


TABLES: dict[str, dict[str, Any]] = {
    "cylinder": {
        "diameter_mm": 70.0,
        "height_mm": 45.0,
        "inclination_deg": 7.0,
        "corner_radius_mm": 4.0,
    },
    "box": {
        "length_mm": 60.0,
        "width_mm": 50.0,
        "height_mm": 45.0,
        "inclination_deg": -6.0,
        "corner_radius_mm": 5.0,
    },
    "prism": {
        "sides": 7,
        "across_mm": 60.0,
        "height_mm": 45.0,
        "turn_deg": 11.0,
        "inclination_deg": 4.0,
    },
    "revolve": {
        "profile_mm": [[30.0, 0.0], [30.0, 20.0], [36.0, 26.0], [0.0, 60.0]],
        "corner_radius_mm": 3.0,
    },
    "conformal": {
        "outline": "silhouette",
        "gap_mm": 12.0,
        "height_mm": 45.0,
        "corner_radius_mm": 2.0,
    },
}


def design_with(folder: Path, shape: str, mesh: trimesh.Trimesh, **keys: Any) -> Design:
    """The gear's set-up with another shape and part, facets and all (numbers in mm)."""
    mesh.export(folder / "part.stl")
    data = load_design(DESIGNS / "gear.toml").model_dump()
    data["part"] = {"mesh": str(folder / "part.stl"), "unit": "mm", "smoothing": "off"}
    data["chamber"] = {"shape": shape, "sonotrode_distance_mm": 15.0, **TABLES[shape], **keys}
    return Design.model_validate(data)


@pytest.mark.parametrize("shape", sorted(TABLES))
def test_a_part_is_taken_out_of_every_shape(tmp_path: Path, shape: str) -> None:
    ball = trimesh.creation.icosphere(subdivisions=3, radius=9.0)
    design = design_with(tmp_path, shape, ball)

    chamber = build_chamber(design)

    mesh = trimesh.Trimesh(chamber.vertices, chamber.triangles, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    alone = design.chamber.surface(chamber.part.vertices, chamber.part.triangles)
    assert 1e9 * chamber.volume == pytest.approx(checked(alone).volume - ball.volume, rel=1e-7)
    assert 1e6 * chamber.exposed_area.sum() == pytest.approx(ball.area, rel=1e-6)
    area = areas(chamber.vertices, chamber.triangles)
    assert 1e6 * area[chamber.tags == TAG_SONOTRODE].sum() == pytest.approx(
        floor_area(alone), rel=1e-6
    )
    assert not any("rounding" in note for note in chamber.notes)


@pytest.mark.parametrize("shape", sorted(TABLES))
def test_a_rod_goes_out_through_the_ceiling_of_every_shape(tmp_path: Path, shape: str) -> None:
    rod = trimesh.creation.box((8, 12, 100))
    rod.apply_transform(trimesh.transformations.rotation_matrix(0.4, [0, 0, 1]))
    chamber = build_chamber(design_with(tmp_path, shape, rod))

    mesh = trimesh.Trimesh(chamber.vertices, chamber.triangles, process=False)
    assert mesh.is_watertight
    assert not any("reaches no wall" in note or "rounding" in note for note in chamber.notes)


def test_a_conformal_chamber_follows_the_part_wherever_it_is(tmp_path: Path) -> None:
    part = trimesh.creation.box((30, 10, 20))
    leaning = {"outline": "hull", "inclination_deg": 5.0, "corner_radius_mm": 0.0}
    here = build_chamber(design_with(tmp_path, "conformal", part, **leaning))
    data = design_with(tmp_path, "conformal", part, **leaning).model_dump()
    data["part"] |= {"offset_mm": (7.0, -3.0), "rotate_deg": (0.0, 0.0, 90.0)}
    there = build_chamber(Design.model_validate(data))

    assert there.volume == pytest.approx(here.volume, rel=1e-6)


def test_the_blades_chamber_stays_by_its_gap(tmp_path: Path) -> None:
    """With thousands of triangles, and for both outlines."""
    design = load_design(DESIGNS / "blade_conformal.toml")
    for outline in ("hull", "silhouette"):
        data = design.model_dump()
        data["chamber"]["outline"] = outline
        chamber = build_chamber(Design.model_validate(data))
        below = chamber.part.vertices[chamber.part.vertices[:, 2] < design.chamber.height]
        wall = shapely.Polygon(1e3 * chamber.vertices[_rim(chamber)][:, :2])
        inside = shapely.points(1e3 * below[:, :2])
        assert shapely.contains(wall, inside).all()
        assert shapely.distance(wall.exterior, inside).min() == pytest.approx(
            9.0, abs=0.02
        )  # 64 facets: 0.011


def test_points_of_a_profile_vary(tmp_path: Path) -> None:
    design = design_with(tmp_path, "revolve", trimesh.creation.box((10, 10, 10)))

    assert {"chamber.profile_mm.1.0", "chamber.profile_mm.3.1", "chamber.inclination_deg"} <= set(
        design.numbers()
    )
    wider = design.changed({"chamber.profile_mm.1.0": 33.0})
    assert wider.chamber.profile_mm[1] == (33.0, 20.0)
    with pytest.raises(InputError, match=r"chamber\.profile_mm: begins at z = 2"):
        design.changed({"chamber.profile_mm.0.1": 2.0})
    with pytest.raises(
        InputError,
        match=r"chamber\.profile_mm: with a ceiling at 60 mm, but the part begins 70 mm above",
    ):
        build_chamber(design.changed({"chamber.sonotrode_distance_mm": 70.0}))


def test_facets_are_a_numerical_parameter_only_where_something_is_round(tmp_path: Path) -> None:
    block_ = trimesh.creation.box((10, 10, 10))

    assert FACETS in numerical_parameters(design_with(tmp_path, "box", block_))
    assert FACETS not in numerical_parameters(
        design_with(tmp_path, "box", block_, corner_radius_mm=0.0)
    )
    assert FACETS in numerical_parameters(design_with(tmp_path, "revolve", block_))

"""A virtual strip: equal impacts follow Kirk's curve, and the gauge weighs as its balls stand."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.common.errors import InputError
from chamberopt.coverage.part_impacts import Hits
from chamberopt.coverage.strength import strip_dents
from chamberopt.design.almen_strip import strip_material
from chamberopt.design.design import validate
from chamberopt.design.load import Design, load_design
from chamberopt.peening.kirk_fit import (
    MULTIPLES,
    KirkFit,
    StripSaturation,
    heights,
    kirk_fits,
    strip_saturation,
)
from chamberopt.peening.strip import (
    GAUGE,
    LENGTH,
    WIDTH,
    StripCurve,
    StripDents,
    StripSize,
    count_dents,
    strip_cells,
    strip_curve,
    surface_cells,
)
from chamberopt.peening.strip_holder import HOLDER_FILE, lies_along_y, strip_design
from tests.helpers.synthetic import DESIGNS, plane_chamber, plate_design

DESIGN = plate_design()
STRIP = strip_material(DESIGN.shot)
SIZES = {
    "whole": StripSize(),
    "small": StripSize(20e-3, 10e-3),
    "long": StripSize(50e-3, 10e-3),
    "disc": StripSize(25e-3, 25e-3, is_disc=True),
}


def hits_at(place: np.ndarray, speed: float | np.ndarray = 5.0) -> Hits:
    """Head-on impacts of the design's balls at places (k, 2)."""
    k, diameter = len(place), DESIGN.shot.diameter
    mass = DESIGN.shot.density * np.pi / 6.0 * diameter**3
    speeds = np.broadcast_to(np.asarray(speed, dtype=float), k)
    columns = (speeds, np.full(k, 90.0), np.zeros(k), 0.5 * mass * speeds**2)
    return Hits(np.zeros(k, dtype=np.int32), np.c_[place, np.zeros(k)], *columns)


def everywhere(size: StripSize, rng: np.random.Generator, per_mm2: float) -> np.ndarray:
    """Random places on the strip and beyond its edge."""
    low = -0.6 * np.array([size.length, size.width])
    count = rng.poisson(per_mm2 * 1e6 * 4.0 * low.prod())
    return rng.uniform(low, -low, (count, 2))


def counted(replicas: list[Hits], size: StripSize) -> StripDents:
    return count_dents(replicas, 1.0, strip_cells(size), DESIGN.shot.density, STRIP)


def middles(size: StripSize, times: int) -> np.ndarray:
    """Places of which each cell has as many: its middle, so many times."""
    if size.is_disc:
        ring, sector = np.divmod(np.arange(16), 4)
        radius, angle = 0.5 * size.length * np.sqrt((ring + 0.5) / 4), np.pi / 2 * (sector + 0.5)
        return np.tile(np.c_[radius * np.cos(angle), radius * np.sin(angle)], (times, 1))
    i, j = np.divmod(np.arange(16), 4)
    along = min(GAUGE[0], 0.5 * size.length) * (i - 1.5) / 2.0
    return np.tile(np.c_[along, size.width * (j - 1.5) / 4.0], (times, 1))


@pytest.mark.parametrize("name", SIZES)
def test_equal_impacts_follow_the_curve_of_kirk_exactly(name: str) -> None:
    """T = ln 10 / b, S = 0.9 s, and at T 90 % of the strip are covered; both fits find that."""
    size = SIZES[name]
    dents = counted([hits_at(middles(size, 30))] * 3, size)
    one = hits_at(np.zeros((1, 2)))
    (dent,), (s,) = strip_dents(one, DESIGN.shot.density, STRIP)
    area = strip_cells(size).area[0]
    rate = 30 * np.pi / 4.0 * dent**2 / area
    curve = strip_curve(dents)
    assert curve.saturation_time() == pytest.approx(np.log(10.0) / rate, rel=1e-7)
    times = np.geomspace(0.01, 10.0, 7) / rate
    assert curve.at(times) == pytest.approx(s * -np.expm1(-rate * times), rel=1e-7)
    found = strip_saturation(dents)
    assert found.strength.value == pytest.approx(0.9 * s)
    assert found.strength.half_width == pytest.approx(0.0, abs=1e-9 * s)
    assert -np.expm1(-rate * found.time.value) == pytest.approx(0.9)
    soon = strip_saturation(dents._replace(seconds=1e-3 * dents.seconds))  # within a second
    assert soon.time.value < 1.0
    assert soon.time.value == pytest.approx(1e-3 * found.time.value)
    assert soon.strength.value == pytest.approx(0.9 * s)
    shop = np.multiply(MULTIPLES, found.time.value)
    for fit in kirk_fits(shop, np.array([one.value for one in heights(dents, shop)])):
        assert fit.saturation_time == pytest.approx(found.time.value, rel=1e-4)
        assert fit.intensity == pytest.approx(0.9 * s, rel=1e-4)
        assert (fit.a, fit.c) == pytest.approx((s, 1.0), rel=1e-3)


@pytest.mark.parametrize("name", SIZES)
def test_weights_add_up_to_one(name: str) -> None:
    assert strip_cells(SIZES[name]).weight.sum() == pytest.approx(1.0)


def test_bending_along_the_strip_counts_for_four_fifths() -> None:
    """By hand: 15.875² / (15.875² + 7.94²) = 0.80; the inner half of a triangle has 3/4 of it."""
    a, b = GAUGE
    share = a**2 / (a**2 + b**2)
    assert share == pytest.approx(0.80, abs=0.001)
    weight = strip_cells(StripSize()).weight.reshape(4, 4)
    # along: 1/8, 3/8, 3/8, 1/8 of what k_x has; k_y is even along the strip
    assert weight.sum(axis=1) == pytest.approx(share * np.array([1, 3, 3, 1]) / 8 + (1 - share) / 4)
    outer = 0.5 * (1 - 0.25 * WIDTH / b) ** 2
    across = share / 4 + (1 - share) * np.array([outer, 0.5 - outer])
    assert weight.sum(axis=0) == pytest.approx([*across, *across[::-1]])
    assert strip_cells(StripSize()).area.sum() == pytest.approx(2 * a * WIDTH)


@pytest.mark.parametrize("name", SIZES)
def test_impacts_are_counted_where_they_are(name: str) -> None:
    size, rng = SIZES[name], np.random.default_rng(1)
    place = everywhere(size, rng, 100.0)
    cells = strip_cells(size)
    cell = cells.of(hits_at(place))
    if size.is_disc:
        inside = np.hypot(*place.T) < 0.5 * size.length
    else:
        inside = (np.abs(place) < [min(GAUGE[0], 0.5 * size.length), 0.5 * size.width]).all(axis=1)
    np.testing.assert_array_equal(cell >= 0, inside)
    expected = 100e6 * cells.area
    counts = np.bincount(cell[inside], minlength=16)
    assert np.abs(counts - expected).max() < 5.0 * np.sqrt(expected).max()


def test_a_strip_hit_at_its_ends_alone_shows_less_than_one_hit_in_the_middle() -> None:
    size = SIZES["whole"]
    place = middles(size, 1000)
    is_end = np.abs(place[:, 0]) > 0.5 * GAUGE[0]
    heights = [
        float(strip_curve(counted([hits_at(place[one])], size)).at(1e9))
        for one in (is_end, ~is_end)
    ]
    share = 0.8 / 4 + 0.2 / 2
    assert heights[0] / sum(heights) == pytest.approx(share, rel=0.01)


def test_few_dents_are_corrected_and_in_the_interval() -> None:
    """Impacts of broad speeds, some 500 in all, against two hundred times as many."""
    size, rng, few, many = SIZES["whole"], np.random.default_rng(2), 0.1, 50.0

    def peened(per_mm2: float, replicas: int) -> StripSaturation:
        places = [everywhere(size, rng, per_mm2) for _ in range(replicas)]
        return strip_saturation(
            counted([hits_at(one, 1.0 + rng.rayleigh(3.6, len(one))) for one in places], size)
        )

    exact = peened(many, 2)
    wanted = exact.strength.value, exact.time.value * many / few
    held, strengths = np.zeros(2, dtype=int), []
    for _ in range(20):
        found = peened(few, 8)
        got = found.strength, found.time
        held += [abs(one.value - x) < one.half_width for one, x in zip(got, wanted, strict=True)]
        strengths.append(found.strength.value)
    assert (held >= 14).all()
    assert np.mean(strengths) == pytest.approx(wanted[0], rel=0.1)


def test_fits_of_given_curves_find_them() -> None:
    times = np.array([30.0, 60.0, 120.0, 240.0, 480.0])
    for c in (0.7, 1.0, 1.3):
        exact = KirkFit(0.2, 0.02, c)
        two, three = kirk_fits(times, exact.at(times))
        assert (three.a, three.b, three.c) == pytest.approx((0.2, 0.02, c), rel=1e-3)
        t = three.saturation_time
        assert three.at(2.0 * t) == pytest.approx(1.1 * three.at(t))
        assert two.at(2.0 * two.saturation_time) == pytest.approx(1.1 * two.intensity)
        assert two.saturation_time == pytest.approx(np.log(10.0) / two.b)
        assert two.intensity == pytest.approx(0.9 * two.a)


def test_a_shop_s_points_saturate_where_they_were_published_to() -> None:
    """Four of Wieland's mean arc heights [0.001 in] and their T = 66.649.

    Source: "The shape of Almen saturation curves", Almen Saturation Curve Calculator 4.0, on the
    web pages of peenforming.ca.
    """
    times, heights = np.array([60.0, 70, 120, 140]), np.array([12.25, 12.77, 13.78, 13.91])
    two, three = kirk_fits(times, heights)
    assert np.abs(two.at(times) - heights).max() < 0.011
    assert two.saturation_time == pytest.approx(66.60, abs=0.01)
    assert three.saturation_time == pytest.approx(66.649, abs=0.01)


@pytest.mark.parametrize(
    ("chamber", "size"),
    [
        ({"shape": "cylinder", "diameter_mm": 80.0}, "whole"),
        ({"shape": "cylinder", "diameter_mm": 26.0, "inclination_deg": 3.0}, "disc"),
        ({"shape": "box", "length_mm": 77.0, "width_mm": 20.0}, "whole"),
        ({"shape": "box", "length_mm": 39.5, "width_mm": 80.0}, "whole"),  # along y
        ({"shape": "prism", "sides": 6, "across_mm": 30.0, "corner_radius_mm": 4.0}, "disc"),
    ],
)
def test_the_strip_closes_the_chamber(chamber: dict, size: str, tmp_path: Path) -> None:
    """The whole strip faces the shot, at the part's distance, and the lid leaves no gap."""
    metals = dict(part_E_GPa=114, part_poisson=0.3, part_density_kg_m3=4430)
    data = DESIGN.model_dump() | {
        "chamber": {"height_mm": 40.0, "sonotrode_distance_mm": 25.0, **chamber},
        "effects": {"flexure": metals | {"shot_E_GPa": 210, "shot_poisson": 0.3}},  # of the part
    }
    design = strip_design(validate(Design, data), SIZES[size], tmp_path)
    assert not design.effects.flexure.on
    assert (tmp_path / HOLDER_FILE).is_file()
    assert design.materials.part == STRIP
    built = build_chamber(design)
    assert built.height == pytest.approx(25e-3)
    exposed = built.exposed_area[built.part.target].sum()
    if SIZES[size].is_disc:
        sector = 2.0 * np.pi / 64
        assert exposed == pytest.approx(32 * (12.5e-3) ** 2 * np.sin(sector), rel=1e-5)
    else:
        assert exposed == pytest.approx(LENGTH * WIDTH, rel=1e-5)


def test_a_strip_along_the_longer_side_weighs_the_same_places(tmp_path: Path) -> None:
    """Cells along y are those along x turned by 90 degrees."""
    for room, turned in (((80.0, 39.5), False), ((39.5, 80.0), True), ((50.0, 50.0), None)):
        box = {"shape": "box", "length_mm": room[0], "width_mm": room[1], "height_mm": 40.0}
        data = DESIGN.model_dump() | {"chamber": {**box, "sonotrode_distance_mm": 25.0}}
        design = validate(Design, data)
        if turned is None:
            with pytest.raises(InputError, match="does not fit into the chamber there"):
                strip_design(design, StripSize(), tmp_path)
        else:
            assert lies_along_y(design, StripSize()) == turned
    places = np.random.default_rng(1).uniform(-0.5, 0.5, (200, 2)) * (LENGTH, WIDTH)
    along_x, along_y = (strip_cells(StripSize(), one) for one in (False, True))
    found = along_x.of(hits_at(places))
    assert np.array_equal(found, along_y.of(hits_at(places[:, ::-1])))
    assert (found >= 0).any()


def test_what_does_not_fit_is_refused_and_what_does_is_named(tmp_path: Path) -> None:
    """The shipped plate's chamber is 50 mm wide: 50 / sqrt(76.2² + 19²) of a strip fits."""
    with pytest.raises(InputError, match=r"room for --disc-mm 49\.\d or --size-mm 48\.\d 12:"):
        strip_design(DESIGN, StripSize(), tmp_path)
    strip_design(DESIGN, StripSize(48e-3, 12e-3), tmp_path)
    strip_design(DESIGN, StripSize(49.9e-3, 49.9e-3, is_disc=True), tmp_path)
    with pytest.raises(InputError, match="a disc of 51 mm does not fit"):
        strip_design(DESIGN, StripSize(51e-3, 51e-3, is_disc=True), tmp_path)
    with pytest.raises(InputError, match=r"--distance-mm: given 20; .*height_mm = 20"):
        strip_design(DESIGN, StripSize(20e-3, 10e-3), tmp_path, 20.0)
    conformal = load_design(DESIGNS / "blade_conformal.toml")
    with pytest.raises(InputError, match=r'given "conformal"; not supported: .*--at ZONE'):
        strip_design(conformal, StripSize(20e-3, 10e-3), tmp_path)


def test_a_surface_is_cut_in_pieces_of_neighbours() -> None:
    """A square of 32 x 32 pairs of triangles; what is not the surface has no cell."""
    chamber = plane_chamber(splits=5)
    part = chamber.part
    cells = surface_cells(part.vertices, part.triangles, np.where(part.target, part.area, 0.0))
    assert len(cells.area) == 16
    assert cells.area.sum() == pytest.approx(part.area[part.target].sum())
    assert cells.area == pytest.approx(cells.area.mean(), rel=0.1)
    assert cells.weight == pytest.approx(cells.area / cells.area.sum())
    middles_of = part.vertices[part.triangles].mean(axis=1)
    hits = hits_at(middles_of[:, :2])
    cell = cells.of(dataclasses.replace(hits, triangle=np.arange(len(middles_of))))
    np.testing.assert_array_equal(cell >= 0, part.target)
    sizes = [np.ptp(middles_of[cell == k], axis=0).max() for k in range(16)]
    assert max(sizes) < 0.8 * np.ptp(middles_of[part.target], axis=0).max()


@pytest.mark.parametrize("unit", [1.0, 60.0])
def test_a_curve_grows_as_its_slope_says_and_saturates_by_its_terms(unit: float) -> None:
    """Of one term after ln 10 of its times; in another unit of time, as much later."""
    curve = StripCurve(np.array([2.0, 1.0, 0.5]), np.array([3.0, 0.4, 0.0]) / unit)
    times = unit * np.geomspace(0.01, 100.0, 9)
    step = 1e-5
    slope = (curve.at(times * (1.0 + step)) - curve.at(times * (1.0 - step))) / (2.0 * step)
    assert curve.growth(times) == pytest.approx(slope, rel=1e-5, abs=1e-9)
    assert curve.at(1e6 * unit) == pytest.approx(3.0)  # what is never dented adds nothing
    time = curve.saturation_time()
    assert curve.at(2.0 * time) == pytest.approx(1.1 * curve.at(time))
    assert (curve.at(2.2 * time) < 1.1 * curve.at(1.1 * time)).all()
    one = StripCurve(curve.height[:1], curve.rate[:1])
    assert one.saturation_time() == pytest.approx(np.log(10.0) / curve.rate[0])
    assert StripCurve(curve.height[2:], curve.rate[2:]).saturation_time() == 0.0

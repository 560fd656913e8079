"""Dents are drawn at their place, with their diameter, on what is seen of the target alone."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread
from scipy.ndimage import binary_dilation

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.cli import main
from chamberopt.coverage.dents import Dents
from chamberopt.design.load import load_design
from chamberopt.geometry.triangles import area_vectors
from chamberopt.pictures import picture_page
from chamberopt.pictures.actors import Discs
from chamberopt.pictures.camera import flat_normal
from chamberopt.pictures.dents import GROUND, _with_rims, dent_colours
from chamberopt.pictures.drawn_part import DrawnPart
from chamberopt.pictures.subprocess_drawing import missing_opengl
from chamberopt.results.arrays_file import ARRAYS_FILE, read_result_arrays, save_result_arrays
from chamberopt.results.impacts import dented_share, simulate_dents
from chamberopt.results.load import Result
from chamberopt.results.rebuild import rebuild_replica
from tests.helpers.results.arrays import plain_arrays
from tests.helpers.results.dent_sides import dent_sides
from tests.helpers.results.short_plate import plate_result
from tests.helpers.results.sphere_in_sphere import ball_result
from tests.helpers.synthetic import DESIGNS, plate_design

INTO_PART = np.array([0.0, 0.0, 1.0])  # from below, where the plate's target is
BELOW, ABOVE, SLANTED = (0.0, 0.0, -1.0), (0.0, 0.0, 1.0), (1.0, -0.5, -1.0)
needs_opengl = pytest.mark.skipif(missing_opengl() is not None, reason="no OpenGL library")


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    return plate_result(tmp_path_factory.mktemp("dents") / "plate")


@pytest.fixture(scope="module")
def plate() -> Chamber:
    return build_chamber(plate_design())


def arrays_file(folder: Path, chamber: Chamber) -> Path:
    save_result_arrays(folder, plain_arrays(chamber))
    return folder / ARRAYS_FILE


def dents_at(places: list[tuple[float, float, float]], radius: float) -> Dents:
    """Dents on the lower side of a plate, in order of time."""
    count = len(places)
    return Dents(
        np.array(places), np.tile(INTO_PART, (count, 1)), np.full(count, radius), np.arange(count)
    )


def random_dents(chamber: Chamber, count: int, radius: float) -> Dents:
    """Dents of several sizes, spread at random and evenly over the exposed surface of the part."""
    rng = np.random.default_rng(0)
    exposed = np.flatnonzero(chamber.source >= 0)
    vectors = area_vectors(chamber.vertices, chamber.triangles[exposed])
    area = np.linalg.norm(vectors, axis=1)
    row = rng.choice(len(exposed), count, p=area / area.sum())
    weight = rng.dirichlet([1.0, 1.0, 1.0], count)
    corners = chamber.vertices[chamber.triangles[exposed[row]]]
    return Dents(
        np.einsum("kc,kcx->kx", weight, corners),
        vectors[row] / area[row, None],
        radius * rng.uniform(0.5, 1.0, count),
        np.arange(count, dtype=float),
    )


def white_share(image: np.ndarray) -> np.ndarray:
    """How much of each pixel inside the picture's middle half is white, 0..1: a dent, on black."""
    rows, columns = image.shape[:2]
    inner = np.zeros((rows, columns))
    middle = slice(rows // 4, 3 * rows // 4), slice(columns // 4, 3 * columns // 4)
    inner[middle] = image[middle].mean(axis=2) / 255.0
    return inner


def target_pixels(image: np.ndarray) -> np.ndarray:
    """Which pixels of an image without dents show the target: the black ones."""
    return image.max(axis=2) < 3.0


@needs_opengl
def test_one_dent_is_a_disc_of_its_diameter_at_its_place(plate: Chamber, tmp_path: Path) -> None:
    dents = dents_at([(1e-3, 2e-3, plate.height)], 0.4e-3)
    file, area = arrays_file(tmp_path, plate), np.pi * 0.4**2
    (flat, pixel), (slanted, wide) = dent_sides(file, tmp_path, dents, [BELOW, SLANTED], 1000)
    white = white_share(flat)
    assert white.sum() * pixel**2 == pytest.approx(area, rel=0.01)
    row, column = np.nonzero(white > 0.5)
    assert np.ptp(row) * pixel == pytest.approx(0.8, abs=2 * pixel)
    assert np.ptp(column) * pixel == pytest.approx(0.8, abs=2 * pixel)
    # The target's middle is in the picture's. Seen from below, y up, x points to the left.
    target = plate.part.vertices[plate.part.triangles[plate.part.target]].reshape(-1, 3)
    middle = 0.5e3 * (target.min(axis=0) + target.max(axis=0))
    rows, columns = flat.shape[:2]
    x = (0.5 * (columns - 1) - column.mean()) * pixel
    y = (0.5 * (rows - 1) - row.mean()) * pixel
    assert (x, y) == pytest.approx((1.0 - middle[0], 2.0 - middle[1]), abs=pixel)
    cosine = 1.0 / np.linalg.norm(SLANTED)
    assert white_share(slanted).sum() * wide**2 == pytest.approx(cosine * area, rel=0.03)


@pytest.mark.parametrize("pixel_mm", [0.01, 0.04])
def test_a_disc_of_twelve_pixels_or_less_has_no_rim(pixel_mm: float) -> None:
    """A larger disc lies with four fifths of its radius on itself in 72 % of its brightness."""
    radius = pixel_mm * np.array([5.9, 6.1, 60.0])  # half its diameter
    place, colour = np.arange(9.0).reshape(3, 3), np.full((3, 3), 200, np.uint8)
    found = _with_rims(Discs(place, place, radius, colour), pixel_mm)
    assert (found.place[:, 0] == [0.0, 3.0, 3.0, 6.0, 6.0]).all()
    assert found.radius / pixel_mm == pytest.approx([5.9, 6.1, 0.8 * 6.1, 60.0, 48.0])
    assert (found.colour[:, 0] == [200, 144, 200, 144, 200]).all()


@pytest.mark.long
@needs_opengl
def test_a_rim_parts_large_dents_and_small_ones_have_none(plate: Chamber, tmp_path: Path) -> None:
    file, rims = arrays_file(tmp_path, plate), []
    for radius in (0.4e-3, 0.1e-3):
        dents = dents_at([(0.0, 0.0, plate.height)], radius)
        ((image, _),) = dent_sides(file, tmp_path, dents, [BELOW], 1000, plain=False)
        white = white_share(image)
        assert (white == 1.0).sum() > 5
        rims.append((np.abs(white - 0.72) < 0.01).sum() / (white > 0.5).sum())
    assert 0.1 < rims[0] < 1.0 - 0.8**2  # pixels that lie in the rim altogether
    assert rims[1] < 0.01


@pytest.mark.long
@needs_opengl
def test_the_later_dent_lies_on_top(plate: Chamber, tmp_path: Path) -> None:
    places = [(0.0, 0.0, plate.height), (0.3e-3, 0.0, plate.height)]
    file, colours = arrays_file(tmp_path, plate), np.array([[255, 0, 0], [0, 255, 0]], np.uint8)
    images = []
    for order in ([0, 1], [1, 0]):
        dents = dents_at([places[k] for k in order], 0.3e-3)
        images.append(dent_sides(file, tmp_path, dents, [BELOW], 2000, colours[order])[0][0])
    red, green = (
        [((image[..., k] > 100) & (image[..., 1 - k] < 20)).sum() for image in images]
        for k in (0, 1)
    )
    assert green[0] == pytest.approx(red[1], rel=0.02)  # whole
    assert red[0] == pytest.approx(green[1], rel=0.02)  # partly covered
    assert red[0] < 0.7 * green[0]


@pytest.mark.long
@needs_opengl
def test_dents_on_the_far_side_and_behind_the_part_are_hidden(
    plate: Chamber, tmp_path: Path
) -> None:
    file = arrays_file(tmp_path, plate)
    dents = dents_at([(0.0, 0.0, plate.height), (2e-3, 1e-3, plate.height)], 0.4e-3)
    (below, _), (above, _) = dent_sides(file, tmp_path, dents, [BELOW, ABOVE], 600)
    (bare_below, _), (bare_above, _) = dent_sides(
        file, tmp_path, dents_at([], 1.0), [BELOW, ABOVE], 600
    )
    assert (np.abs(below - bare_below) > 50).any()
    np.testing.assert_array_equal(above, bare_above)
    turned = Dents(dents.place, -dents.normal, dents.radius, dents.time)  # face up, inside the part
    ((hidden, _),) = dent_sides(file, tmp_path, turned, [BELOW], 600)
    np.testing.assert_array_equal(hidden, bare_below)
    deep = Dents(dents.place + 1e-3 * INTO_PART, dents.normal, dents.radius, dents.time)
    ((hidden, _),) = dent_sides(file, tmp_path, deep, [BELOW], 600)
    np.testing.assert_array_equal(hidden, bare_below)


@pytest.mark.long
@needs_opengl
@pytest.mark.parametrize(
    ("name", "count", "radius"),
    [("plate", 6000, 0.3e-3), pytest.param("gear", 150_000, 0.06e-3, marks=pytest.mark.long)],
)
def test_the_share_of_colour_is_what_coverage_says(
    name: str, count: int, radius: float, tmp_path: Path
) -> None:
    """Of the whole target, against sample points: flat, and with round teeth."""
    chamber = build_chamber(load_design(DESIGNS / f"{name}.toml"))
    dents, file = random_dents(chamber, count, radius), arrays_file(tmp_path, chamber)
    view = BELOW if name == "plate" else (1.0, -1.4, -0.5)
    ((image, pixel),) = dent_sides(file, tmp_path, dents, [view], 1500)
    ((bare, _),) = dent_sides(file, tmp_path, dents_at([], 1.0), [view], 1500)
    target = target_pixels(bare)
    dented = image[target].mean() / 255.0
    expected = dented_share(dents, chamber)
    assert 0.1 < expected < 0.5
    assert dented == pytest.approx(expected, abs=0.004)
    # Elsewhere nothing changes, but for pixels that a target seen almost edge on fills in part.
    elsewhere = ~binary_dilation(target, iterations=3)
    changed = (image[elsewhere] != bare[elsewhere]).any(axis=1)
    assert changed.mean() < (0.002 if name == "gear" else 1e-9)
    if name == "plate":
        area = chamber.exposed_area[chamber.part.target].sum() * 1e6
        assert target.sum() * pixel**2 == pytest.approx(area, rel=0.01)


@pytest.mark.long
@needs_opengl
def test_a_ball_is_drawn_round_and_without_cracks(tmp_path: Path) -> None:
    ball_result(tmp_path / "ball")
    file = tmp_path / "ball" / ARRAYS_FILE
    ((image, pixel),) = dent_sides(file, tmp_path, dents_at([], 1.0), [(-1.0, -0.5, 0.8)], 300)
    part = image.min(axis=2) < 240.0
    assert part.sum() * pixel**2 == pytest.approx(np.pi * 10.0**2, rel=0.02)
    assert all(np.diff(np.flatnonzero(line)).max(initial=1) == 1 for line in part)


@needs_opengl
def test_no_dents_leave_the_target_black(plate: Chamber, tmp_path: Path) -> None:
    none = dents_at([], 1.0)
    ((image, pixel),) = dent_sides(arrays_file(tmp_path, plate), tmp_path, none, [BELOW], 300)
    area = plate.exposed_area[plate.part.target].sum() * 1e6
    assert target_pixels(image).sum() * pixel**2 == pytest.approx(area, rel=0.03)
    assert dented_share(none, plate) == 0.0


def test_only_a_flat_target_is_seen_face_on(plate: Chamber, tmp_path: Path) -> None:
    flat = DrawnPart(read_result_arrays(arrays_file(tmp_path, plate)).field)
    np.testing.assert_allclose(flat_normal(flat.whole), BELOW, atol=1e-6)
    gear = build_chamber(load_design(DESIGNS / "gear.toml"))
    teeth = DrawnPart(read_result_arrays(arrays_file(tmp_path, gear)).field).whole
    assert flat_normal(teeth) is None


@needs_opengl
def test_the_picture_has_as_much_of_its_ground_as_is_not_peened(
    result: Result, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = tmp_path / "dents.png"
    arguments = ["dents", str(result.folder), str(picture), "--at-s", "0.5", "--pixels", "400"]
    assert main(arguments) == 0
    printed = capsys.readouterr().out
    assert "simulated on from 0.3 s" in printed
    image = imread(picture)[..., :3]
    replica = rebuild_replica(result)
    dented = dented_share(simulate_dents(replica, 0.5), replica.chamber)
    bottom = (
        image.shape[0] - picture_page.EDGE - picture_page.LINE - picture_page.FOOT
    )  # of the view
    inner = image[bottom - 300 : bottom - 100, 100:300]  # the target alone
    bare = np.abs(inner - to_rgb(GROUND)).max(axis=2) < 0.25
    assert bare.mean() == pytest.approx(1.0 - dented, abs=0.03)
    assert 0.02 < dented < 0.2
    grey = np.array([0xB9, 0xBE, 0xC4]) / 255.0
    assert (np.abs(image - grey).max(axis=2) < 0.05).any()
    lightest = dent_colours()(1.0)[:3]
    assert (np.abs(image - lightest).max(axis=2) < 0.05).any()
    assert list(tmp_path.iterdir()) == [picture]


@needs_opengl
def test_on_the_command_line(
    result: Result, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, picture = str(result.folder), str(tmp_path / "a.png")
    for arguments, message in (
        ([folder, str(tmp_path / "a.jpg")], "pictures are written as .png"),
        ([folder, picture, "--at-s", "-1"], "--at-s: given -1"),
        ([folder, picture, "--view", "0,0,0"], "--view 0,0,0: give the direction"),
        ([folder, picture, "--view", "1,0,0", "--at-s", "0.1"], "seen edge on"),
        ([folder, picture, "--pixels", "99"], "--pixels: given 99; 200 to 4000"),
        ([folder, picture, "--replica", "3"], "--replica: given 3"),
        ([str(tmp_path), picture], "not a results folder"),
    ):
        assert main(["dents", *arguments]) == 2
        assert message in capsys.readouterr().err.strip().splitlines()[-1]
        assert not list(tmp_path.iterdir())

"""The shipped parts are reproducible, closed and well shaped; the gear is a true involute gear."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import trimesh

PARTS = Path(__file__).resolve().parents[3] / "designs" / "parts"
NAMES = ("gear", "plate", "blade")


@pytest.fixture
def gear() -> Iterator[ModuleType]:
    sys.path.insert(0, str(PARTS))
    try:
        import gear

        yield gear
    finally:
        sys.path.remove(str(PARTS))


@pytest.mark.parametrize("name", [*(f"{name}.stl" for name in NAMES), "plate_setup.bdf"])
def test_the_script_writes_the_same_bytes_again(tmp_path: Path, name: str) -> None:
    for script in PARTS.glob("*.py"):
        (tmp_path / script.name).write_bytes(script.read_bytes())

    # A command that ran in this process keeps its children from importing what lies beside them.
    environment = {key: one for key, one in os.environ.items() if key != "PYTHONSAFEPATH"}
    command = [sys.executable, str((tmp_path / name).with_suffix(".py"))]
    subprocess.run(command, check=True, capture_output=True, env=environment)

    assert (tmp_path / name).read_bytes() == (PARTS / name).read_bytes()


@pytest.mark.parametrize("name", NAMES)
def test_the_part_is_one_closed_outward_body_of_well_shaped_triangles(name: str) -> None:
    part = trimesh.load_mesh(PARTS / f"{name}.stl")

    assert part.is_watertight
    assert part.is_winding_consistent
    assert part.volume > 0
    assert part.body_count == 1
    assert part.euler_number == 2
    assert 2000 < len(part.faces) < 12000
    edges = np.linalg.norm(part.triangles - np.roll(part.triangles, 1, axis=1), axis=2)
    shape = (
        4 * np.sqrt(3) * part.area_faces / (edges**2).sum(axis=1)
    )  # 1 for an equilateral triangle
    assert np.median(shape) > 0.85
    assert shape.min() > 0.2
    assert edges.max() < 3.0


def test_the_plate_is_a_plate() -> None:
    plate = trimesh.load_mesh(PARTS / "plate.stl")

    assert plate.bounds.tolist() == [[-30, -30, 0], [30, 30, 10]]
    assert plate.volume == pytest.approx(36000, rel=1e-12)


def test_the_gear_has_the_asked_sizes() -> None:
    part = trimesh.load_mesh(PARTS / "gear.stl")

    radius = np.hypot(part.vertices[:, 0], part.vertices[:, 1])
    toothed = (part.vertices[:, 2] < 10) & (radius > 16)
    assert part.bounds.tolist() == [[-22, -22, 0], [22, 22, 70]]  # tip diameter m (z + 2) = 44
    on_border = toothed & (part.vertices[:, 2] > 0)
    assert radius[on_border].max() == pytest.approx(22, abs=1e-4)
    assert radius[on_border].min() == pytest.approx(
        17.5, abs=2e-3
    )  # root diameter m (z - 2.5) = 35
    assert radius[part.vertices[:, 2] > 10.5].max() == pytest.approx(8, abs=1e-4)


def test_all_teeth_are_alike(gear: ModuleType) -> None:
    outline = gear.profile()
    angle = 2 * np.pi / gear.TEETH
    turned = outline @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    mirrored = outline * [-1, 1]

    for other in (turned, mirrored):
        apart = np.linalg.norm(outline[:, None] - other[None], axis=2).min(axis=1)
        assert apart.max() < 1e-9


def test_the_flank_is_the_involute_of_the_base_circle(gear: ModuleType) -> None:
    """Its normal at every point touches the base circle: that is what an involute is."""
    radius = np.linspace(18.85, 22.0, 400)
    step = 1e-6

    along = gear.flank(radius + step) - gear.flank(radius - step)
    along /= np.linalg.norm(along, axis=1)[:, None]

    # distance from the centre to the normal line = |point . tangent|
    distance = np.abs((gear.flank(radius) * along).sum(axis=1))
    assert distance == pytest.approx(np.full(400, 20 * np.cos(np.radians(20))), rel=1e-7)


def test_the_tooth_is_half_a_pitch_wide_on_the_pitch_circle(gear: ModuleType) -> None:
    """Zero profile shift: tooth and space share the pitch circle's circumference equally."""
    x, y = gear.flank(np.array([20.0]))[0]

    assert 2 * 20 * np.arctan2(x, y) == pytest.approx(np.pi * 2 / 2, rel=1e-12)


def test_the_fillet_leaves_the_involute_tangent_and_ends_on_the_root_circle(
    gear: ModuleType,
) -> None:
    start = gear.fillet(np.array([gear.ALPHA]))[0]
    end = gear.fillet(np.array([np.pi / 2]))[0]

    radius = float(np.hypot(*start))
    assert gear.flank(np.array([radius]))[0] == pytest.approx(start, abs=1e-12)
    assert np.hypot(*end) == pytest.approx(17.5, rel=1e-12)

    fillet_way = gear.fillet(np.array([gear.ALPHA + 1e-6]))[0] - start
    flank_way = gear.flank(np.array([radius]))[0] - gear.flank(np.array([radius + 1e-6]))[0]
    cosine = fillet_way @ flank_way / np.linalg.norm(fillet_way) / np.linalg.norm(flank_way)
    assert cosine == pytest.approx(1.0, abs=1e-6)

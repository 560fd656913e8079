"""Figures pass continuously over all angles at which edges turn: no threshold decides."""

from itertools import pairwise

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.build import Chamber
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.estimate import Estimate
from chamberopt.coverage.field.target_field import TargetField, WindowSetting, find_target_field
from chamberopt.coverage.metrics import OBJECTIVES
from chamberopt.simulation.estimates import SeenDents, estimate_metrics, weighted_sum
from tests.helpers.synthetic import chamber_round, dents_at, plate_design, triangles_at

DESIGN = plate_design(process__treatment_time_s=1.0, process__accuracy__simulated_time_s=1.0)
HEIGHT, SIDE = 20e-3, 4e-3  # of a prism and of its sides [m]
DENT = 0.3e-3  # m
REPLICAS = 8


def prism(turns: list[float], levels: int = 2, other_diagonals: bool = False) -> trimesh.Trimesh:
    """A prism whose sides turn by these degrees from one to the next, 360 in all.

    Args:
        levels: heights at which its sides are divided, its two ends among them.
    """
    angle = np.radians(np.cumsum([0.0, *turns[:-1]]))
    along = np.column_stack([np.cos(angle), np.sin(angle)])
    # All sides are alike but the last two, which close the ring.
    sides = np.full(len(turns), SIDE)
    sides[-2:] = np.linalg.solve(along[-2:].T, -(along[:-2] * SIDE).sum(axis=0))
    assert (sides > 0.0).all()
    ring = np.cumsum(np.vstack([np.zeros(2), along * sides[:, None]]), axis=0)[:-1]
    ring -= ring.mean(axis=0)
    count = len(ring)
    heights = np.linspace(0.0, 1.0, levels) ** 1.3 * HEIGHT
    vertices = [(x, y, z) for z in heights for x, y in ring]
    vertices += [(0.0, 0.0, 0.0), (0.0, 0.0, HEIGHT)]
    triangles = []
    for level in range(levels - 1):
        for i in range(count):
            j = (i + 1) % count
            a, b = level * count + i, level * count + j
            c, d = b + count, a + count
            cut = [(a, b, d), (b, c, d)] if other_diagonals else [(a, b, c), (a, c, d)]
            triangles += cut
    low, high = levels * count, levels * count + 1
    top = (levels - 1) * count
    for i in range(count):
        j = (i + 1) % count
        triangles += [(low, j, i), (high, top + i, top + j)]
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    assert mesh.is_watertight
    assert mesh.volume > 0.0
    return mesh


def sides_of(mesh: trimesh.Trimesh) -> Chamber:
    """A chamber round a prism, whose target is its sides."""
    return chamber_round(mesh, np.abs(mesh.face_normals[:, 2]) < 0.5)


def side_corners(mesh: trimesh.Trimesh, count: int) -> np.ndarray:
    """Lower corners (count + 1, 3) of the sides in turn, the first again at the end."""
    return np.asarray(mesh.vertices)[[*range(count), 0]]


def rain(corners: np.ndarray, seed: int) -> np.ndarray:
    """Places of dents on the sides of a prism and on its edges, which are hit more, (k, 3).

    The same numbers of the same seed, wherever the corners (n + 1, 3) are. Every second side is hit
    half as often.
    """
    rng = np.random.default_rng(seed)
    places = []
    for k, (a, b) in enumerate(pairwise(corners)):
        for share in (rng.random(rng.poisson(300 + 300 * (k % 2))), np.zeros(rng.poisson(80))):
            z = rng.random(len(share)) * HEIGHT
            places.append(a + share[:, None] * (b - a) + z[:, None] * [0.0, 0.0, 1.0])
    return np.concatenate(places)


def seen_by(
    chamber: Chamber, places: list[np.ndarray], ball: float
) -> tuple[TargetField, SeenDents]:
    """The field of a chamber's target, and in it the dents of replicas at these places."""
    setting = WindowSetting(1e-6, 20_000, ball, DENT)
    field = find_target_field(chamber, chamber_mesh(chamber), setting)
    seen = SeenDents.none(field)
    seen.add([dents_at(DESIGN, triangles_at(chamber, one), one, DENT) for one in places])
    return field, seen


def figures_of(
    chamber: Chamber, places: list[np.ndarray], ball: float = 1e-3
) -> dict[str, Estimate]:
    """Figures of a target whose replicas dented these places."""
    _, seen = seen_by(chamber, places, ball)
    found = estimate_metrics(seen, seen.in_sector, chamber, DESIGN).metrics
    uniform = weighted_sum(OBJECTIVES["uniform_coverage"], found)
    return found | {"uniform_coverage": uniform}


SHOWN = "mean_coverage", "std_coverage", "uniform_coverage"


def test_edges_of_just_the_middle_angle_in_five_triangulations() -> None:
    """A prism of nine sides turns by exactly 40 degrees, which rounding makes more or less."""
    turns = [40.0] * 9
    whole = prism(turns)
    corners = side_corners(whole, 9)
    places = [rain(corners, seed) for seed in range(REPLICAS)]
    meshes = [whole, prism(turns, other_diagonals=True), prism(turns, 7), prism(turns, 4, True)]
    found = [figures_of(sides_of(mesh), places) for mesh in (*meshes, whole.subdivide())]
    for name in SHOWN:
        values = [one[name].value for one in found]
        assert np.ptp(values) < 0.1 * found[0][name].half_width + 5e-4, (name, values)
    for name in ("p05_coverage", "p95_coverage"):  # steep, so the choice of points shows
        values = [one[name].value for one in found]
        assert np.ptp(values) < 0.5 * found[0][name].half_width, (name, values)


def block(turn: float) -> tuple[trimesh.Trimesh, np.ndarray]:
    """A block with a ridge between two slopes, or with a valley where the turn is below 0.

    Returns:
        The mesh, and which of its triangles are the slopes.
    """
    across, rise = SIDE * np.cos(np.radians(0.5 * turn)), -SIDE * np.sin(np.radians(0.5 * turn))
    outline = [(-across, rise), (-across, -6e-3), (across, -6e-3), (across, rise), (0.0, 0.0)]
    corners = np.array([(x, y, z) for y in (0.0, HEIGHT) for x, z in outline])
    ends = np.array([(0, 1, 4), (1, 2, 4), (2, 3, 4)])
    quads = [(i, (i + 1) % 5, (i + 1) % 5 + 5, i + 5) for i in range(5)]
    sides = [t for a, b, c, d in quads for t in ((a, c, b), (a, d, c))]
    mesh = trimesh.Trimesh(corners, [*sides, *ends, *(ends[:, ::-1] + 5)], process=False)
    assert mesh.is_watertight
    mesh.fix_normals()
    return mesh, np.isin(np.arange(len(mesh.faces)), [6, 7, 8, 9])


def rain_on_slopes(turn: float, seed: int) -> np.ndarray:
    """Places of dents, the same on the slopes of any turn: fewer on the left, many on a ridge."""
    rng = np.random.default_rng(seed)
    right, left, edge = (rng.random((rng.poisson(mean), 2)) for mean in (1600, 800, 400))
    along, upward = np.cos(np.radians(0.5 * turn)), np.sin(np.radians(0.5 * turn))
    away = np.concatenate([right[:, 0], -left[:, 0], 0.0 * edge[:, 0]][: 3 if turn > 0.0 else 2])
    y = np.concatenate([right[:, 1], left[:, 1], edge[:, 1]][: 3 if turn > 0.0 else 2])
    return np.column_stack([SIDE * away * along, HEIGHT * y, -SIDE * np.abs(away) * upward])


@pytest.mark.long
@pytest.mark.parametrize("kind", ["ridge", "valley"])
def test_no_figure_jumps_at_any_angle(kind: str) -> None:
    """The same dents on slopes that turn by more and more: figures move from one end to another."""
    angles = np.arange(28.0, 53.0) if kind == "ridge" else -np.arange(48.0, 73.0)
    found = []
    for angle in angles:
        mesh, slopes = block(angle)
        chamber = chamber_round(mesh, slopes)
        places = [rain_on_slopes(angle, seed) for seed in range(REPLICAS)]
        found.append(figures_of(chamber, places, ball=0.3e-3))
    for name in SHOWN:
        values = np.array([one[name].value for one in found])
        whole = abs(values[-1] - values[0])
        assert np.abs(np.diff(values)).max() < 0.15 * whole + 6e-4, (name, values)
        assert np.ptp(values) < whole + 1e-3
    uniform = [one["uniform_coverage"].value for one in found]
    assert abs(uniform[-1] - uniform[0]) > 0.01


def test_dents_in_the_middle_of_the_range_count_half_as_on_a_crease() -> None:
    turn = 40.0
    mesh, slopes = block(turn)
    chamber = chamber_round(mesh, slopes)
    places = [rain_on_slopes(turn, seed) for seed in range(2)]
    field, seen = seen_by(chamber, places, 1e-3)
    on_edge = np.concatenate([np.abs(place[:, 0]) < 1e-9 for place in places])
    assert seen.crease_share == pytest.approx(0.5 * on_edge.mean(), abs=1e-6)
    ridge = np.flatnonzero(np.abs(field.creases.ends[:, :, 0]).max(axis=1) < 1e-9)
    assert field.sharpness(ridge).tolist() == [0.5]
    # All dents are in windows, by either way: their area is conserved.
    area = float((field.surface.area * field.surface.touched).sum()) / len(field.gauge.area)
    booked = sum(float(one.weight.sum()) for one in seen.gauge) * area
    assert booked == pytest.approx(sum(one.area for one in seen.gauge), rel=0.02)

"""A made-up spring whose coils are 1.988 mm apart, in balls of 2 mm: those that jam do not count.

Where jammed balls are taken out, the others go on with the same dents.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.stats import t

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.checks.jams import jam_gaps
from chamberopt.chamber.part import turning_axis
from chamberopt.chamber.replica_seed import replica_seed
from chamberopt.chamber.scene import build_scene, chamber_mesh
from chamberopt.coverage.dents import dent_diameters
from chamberopt.design.design import Design
from chamberopt.design.load import load_design
from sim_core import Balls, Scene, SimulationResult, simulate

WIRE, GAP, COILS, MEAN = 3.0, 1.988, 4, 8.0  # mm: wire, gap and mean radius of the coils
REPLICAS, SECONDS = 16, 1.0
DESIGN = """
part = { mesh = "spring.stl", unit = "mm", rotate_deg = [0, 90, 0] }
chamber = { shape = "cylinder", diameter_mm = 44, height_mm = 40, sonotrode_distance_mm = 10 }
sonotrode = { frequency_khz = 20, amplitude_um = 25 }
shot = { mass_g = 3, diameter_mm = 2, material = "steel" }
materials = { wall = "42CrMo4", sonotrode = "Ti-6Al-4V", part = "42CrMo4" }
effects = { gravity = true }
process = { treatment_time_s = 5, seed = 1, accuracy.replicas = 3, accuracy.simulated_time_s = 2 }
"""


def spring() -> trimesh.Trimesh:
    """A round wire along a helix about z, with flat ends."""
    around, along = 12, 24 * COILS
    turn = np.linspace(0.0, 2.0 * np.pi * COILS, along + 1)[:, None]
    rise = (WIRE + GAP) / (2.0 * np.pi)
    out = np.hstack([np.cos(turn), np.sin(turn), 0.0 * turn])
    axis = MEAN * out + rise * turn * [0.0, 0.0, 1.0]
    forward = np.hstack([-MEAN * np.sin(turn), MEAN * np.cos(turn), rise + 0.0 * turn])
    aside = np.cross(forward / np.linalg.norm(forward, axis=1)[:, None], out)
    angle = 2.0 * np.pi * np.arange(around)[:, None] / around
    round_ = np.cos(angle) * out[:, None] + np.sin(angle) * aside[:, None]
    vertices = np.vstack([(axis[:, None] + 0.5 * WIRE * round_).reshape(-1, 3), axis[[0, -1]]])
    ring, end = np.arange(around), len(vertices) - 1
    after, rows = (ring + 1) % around, around * np.arange(along)[:, None]
    one, two = rows + ring, rows + after
    sides = [
        np.stack([one, two, two + around], -1),
        np.stack([one, two + around, one + around], -1),
    ]
    caps = [
        np.stack([np.full(around, end - 1), after, ring], -1),
        np.stack([np.full(around, end), around * along + ring, around * along + after], -1),
    ]
    mesh = trimesh.Trimesh(vertices, np.vstack([*(one.reshape(-1, 3) for one in sides), *caps]))
    trimesh.repair.fix_normals(mesh)
    assert mesh.is_watertight
    return mesh


@pytest.fixture(scope="module")
def design(tmp_path_factory: pytest.TempPathFactory) -> Design:
    folder: Path = tmp_path_factory.mktemp("spring")
    spring().export(folder / "spring.stl")
    (folder / "spring.toml").write_text(DESIGN)
    return load_design(folder / "spring.toml")


@pytest.mark.long
def test_check_finds_the_gap_between_the_coils(design: Design) -> None:
    chamber = build_chamber(design)
    gap = jam_gaps(chamber, 2e-3)[0]
    assert gap.sides == ("the part's side", "the part's side")
    assert gap.width[0] == pytest.approx(1e-3 * GAP, rel=0.02)  # facets of 30 degrees, smoothed
    assert gap.target_share > 0.1
    assert not jam_gaps(chamber, 0.99 * gap.free_below)


def dented_area(found: SimulationResult, chamber: Chamber, design: Design) -> float:
    """Sum of the squares of the dents' diameters on the part [m²]."""
    return float((dent_diameters(found.impacts, chamber, design) ** 2).sum())


def without(scene: Scene, found: SimulationResult, rows: np.ndarray) -> Scene:
    """The scene going on from a result without some balls."""
    keep = np.setdiff1d(np.arange(len(found.balls)), rows)
    now = found.balls
    spins = None if now.spins is None else now.spins[keep]
    places, speeds = now.positions[keep], now.velocities[keep]
    balls = Balls(places, speeds, now.diameters[keep], now.density, spins)
    return replace(scene, balls=balls, warmup=0.0, duration=SECONDS, start_time=found.time)


@pytest.mark.long
def test_dents_are_those_of_a_run_without_the_jammed_balls(design: Design) -> None:
    chamber = build_chamber(design)
    mesh, axis = chamber_mesh(chamber), turning_axis(design, chamber.part)
    apart, area = [], []
    for number in range(REPLICAS):
        scene = build_scene(design, mesh, replica_seed(1, number), axis)
        first = simulate(replace(scene, duration=SECONDS))
        held = first.trapped.ball[first.trapped.at_end & (first.trapped.rattling > 0.0)]
        if len(held):
            rows = np.zeros(0, dtype=int), held
            both = [
                dented_area(simulate(without(scene, first, one)), chamber, design) for one in rows
            ]
            apart.append(both[0] - both[1])
            area.append(both[1])
    assert len(apart) >= 3
    error = np.std(apart, ddof=1) / np.sqrt(len(apart))
    assert abs(np.mean(apart)) < t.ppf(0.975, len(apart) - 1) * error
    assert error < 0.2 * np.mean(area)  # so that a large share would be seen

"""A small design and study that a hunt begins with: a box hangs in a cylinder over 27 balls."""

from __future__ import annotations

from pathlib import Path

import trimesh

from tests.helpers.mesh_files import write_stl

DESIGN = """
[part]
mesh = "box.stl"
unit = "mm"
rotate_deg = [0, 0, 10]
offset_mm = [1, 0]
[part.target]
surface = "all"
direction = [0, 0, -1]
angle_deg = [0, 10]
box_mm = [[-8, -8, -9], [8, 8, 9]]
[chamber]
shape = "cylinder"
diameter_mm = 40
height_mm = 30
sonotrode_distance_mm = 12
[sonotrode]
frequency_khz = 20
amplitude_um = 25
[shot]
mass_g = 3
diameter_mm = 3
material = "steel"
[materials]
shot = { C0 = 0.91, v0_m_s = 1.5 }
wall = { C0 = 0.91, v0_m_s = 0.44 }
sonotrode = { e_at_m_s = [[0.1, 0.97], [1, 0.91], [5, 0.6]] }
part = { C0 = 0.91, v0_m_s = 0.17, hardness_HB = 120 }
[effects]
gravity = true
rest = false
[process]
treatment_time_s = 5
seed = 1
[process.accuracy]
replicas = 3
simulated_time_s = 0.4
warmup_time_s = 0.01
points = 1000
gauge_mm2 = 20
"""
STUDY = """
design = "design.toml"
[vary]
"chamber.height_mm" = [26, 34]
"shot.mass_g" = [2, 4]
[objective]
name = "uniform_coverage"
[constraints]
impacts_per_mm2_s = { min = 0.0 }
[optimizer]
algorithm = "sobol"
evaluations = 2
confirm = 1
confirm_replicas = 3
confirm_rounds = 1
[search_accuracy]
simulated_time_s = 0.3
"""


def write_base(folder: Path) -> None:
    """Write box.stl, design.toml and study.toml."""
    box = trimesh.creation.box((16, 16, 16))
    write_stl(folder / "box.stl", box.vertices[box.faces])
    (folder / "design.toml").write_text(DESIGN)
    (folder / "study.toml").write_text(STUDY)

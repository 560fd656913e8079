"""Every kind of picture, of four parts that hide most of their targets.

Each picture is tested for showing its target. Whether it is good is seen by looking at all of them:

    python -m tests.chamberopt.pictures.test_gallery FOLDER
"""

import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from chamberopt.cli import main
from chamberopt.pictures.difference import draw_difference, write_differences
from chamberopt.results.arrays_file import read_result_arrays
from tests.helpers.opengl import needs_opengl
from tests.helpers.results.awkward_targets import TARGETS, parts

DESIGN = """
[part]
mesh = "{mesh}"
unit = "mm"
[part.target]
{target}
[chamber]
shape = "box"
length_mm = 70
width_mm = 66
height_mm = 50
sonotrode_distance_mm = 10
[sonotrode]
frequency_khz = 20
amplitude_um = 40
[shot]
mass_g = 20
diameter_mm = 3
material = "steel"
[materials]
shot = {{ C0 = 0.91, v0_m_s = 1.5 }}
wall = {{ C0 = 0.91, v0_m_s = 0.44 }}
sonotrode = {{ C0 = 0.91, v0_m_s = 1.1 }}
part = {{ C0 = 0.91, v0_m_s = 0.17, hardness_HB = 120 }}
[effects]
gravity = true
[process]
treatment_time_s = 20
seed = 1
[process.accuracy]
replicas = 3
simulated_time_s = {seconds}
warmup_time_s = 0.05
gauge_mm2 = 4
"""


def colourful(picture: Path) -> float:
    """Share of pixels that are neither white nor grey, black or the sonotrode's orange."""
    image = imread(picture)[..., :3]
    red, green, blue = np.moveaxis(image, -1, 0)
    is_orange = (red > green + 0.15) & (green > blue + 0.1)
    return float(((np.ptp(image, axis=2) > 0.25) & ~is_orange).mean())


def draw_gallery(folder: Path, name: str) -> list[Path]:
    """Draw every kind of picture of one part."""
    folder.mkdir(parents=True)
    mesh = folder / "part.stl"
    parts()[name][0].export(mesh)
    results = []
    for run, seconds in (("short", 1.0), ("long", 2.0)):
        design = folder / f"{run}.toml"
        text = DESIGN.format(mesh=mesh.name, target=TARGETS[name], seconds=seconds)
        design.write_text(text, encoding="utf-8")
        results.append(str(folder / run))
        assert main(["simulate", str(design), "--no-ranges", "--out", results[-1]]) == 0
    one, both = results[0], [*results, "--screenshot"]
    pictures = {
        kind: str(folder / f"{kind}.png")
        for kind in ("check", "inspect", "near", "triangle", "pair", "dents")
    }
    film = str(folder / "replay.gif")
    for arguments in (
        ["check", str(folder / "short.toml"), "--screenshot", pictures["check"]],
        ["inspect", one, "--screenshot", pictures["inspect"]],
        ["inspect", one, "--no-chamber", "--quantity", "speed", "--screenshot", pictures["near"]],
        ["inspect", one, "--clip", "Y", "--triangle", "0", "--screenshot", pictures["triangle"]],
        ["inspect", *both, pictures["pair"]],
        ["dents", one, pictures["dents"], "--pixels", "500"],
        ["compare", *results, "--out", str(folder / "compare")],
        ["replay", one, film, "--frames", "6", "--span-ms", "4"],
    ):
        assert main(arguments) == 0, arguments
    assert Path(film).stat().st_size > 10_000
    compared = [folder / "compare" / f"{kind}.png" for kind in ("compare", "difference")]
    drawn = [Path(one) for kind, one in pictures.items() if kind != "triangle"]
    return [*drawn, Path(one) / "coverage.png", *compared]


@needs_opengl
@pytest.mark.long
@pytest.mark.parametrize("name", TARGETS)
def test_every_kind_of_picture_shows_the_target(tmp_path: Path, name: str) -> None:
    for picture in draw_gallery(tmp_path / "gallery", name):
        shown = 0.0005 if picture.stem == "difference" else 0.004
        assert colourful(picture) > shown, picture.name


@needs_opengl
def test_differences_are_drawn(case: tuple, tmp_path: Path) -> None:
    surface = read_result_arrays(case[0] / "arrays.npz").field
    used = np.unique(np.asarray(surface.regular_faces)[np.asarray(surface["target"]) > 0])
    value = np.linspace(-0.2, 0.2, len(used))
    columns = [(value, np.abs(value) > 0.05, np.ones(len(used), dtype=bool))]
    write_differences(tmp_path / "difference.vtp", case[0], columns)
    picture = tmp_path / "difference.png"
    alike = (value, np.zeros(len(used), dtype=bool), columns[0][2])  # told of in a sentence alone
    titles = ["two - one", "three - one"]
    assert draw_difference(case[0], [*columns, alike], titles, picture) is None
    assert colourful(picture) > 0.01
    rows, across, _ = imread(picture).shape
    assert rows < 1.5 * across  # of one row of views


if __name__ == "__main__":
    for part in TARGETS:
        draw_gallery(Path(sys.argv[1]) / part.replace(" ", "_"), part)

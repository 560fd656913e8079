"""Sides of a dent map, rendered in a separate process.

A missing graphics driver therefore cannot end the tests.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np

from chamberopt.coverage.dents import Dents
from chamberopt.pictures import dents as dent_map
from chamberopt.pictures.actors import Discs
from chamberopt.pictures.drawn_part import DrawnPart
from chamberopt.pictures.subprocess_drawing import without_display
from chamberopt.results.arrays_file import read_result_arrays


def dent_sides(
    arrays: Path,
    scratch: Path,
    dents: Dents,
    views: list[tuple[float, float, float]],
    pixels: int,
    colours: np.ndarray | None = None,
    plain: bool = True,
) -> list[tuple[np.ndarray, float]]:
    """Image (rows, columns, 3), 0..255, and pixel size [mm] of the target from each view.

    arrays: an arrays.npz; colours: of the dents, uint8 (k, 3), white if left out.
    plain: in these very colours, without light, shade and rims.
    """
    if colours is None:
        colours = np.full((len(dents), 3), 255, dtype=np.uint8)
    np.savez(
        scratch / "dents.npz", place=1e3 * dents.place, normal=-dents.normal,
        radius=1e3 * dents.radius, colour=colours, views=views, pixels=pixels, plain=plain,
    )  # fmt: skip
    command = [sys.executable, "-m", __name__, str(arrays), str(scratch)]
    subprocess.run(command, check=True, env=without_display(), cwd=Path(__file__).parents[3])
    with np.load(scratch / "sides.npz") as sides:
        return [
            (sides[f"image_{k}"].astype(float), float(sides[f"pixel_mm_{k}"]))
            for k in range(len(views))
        ]


if __name__ == "__main__":
    part, folder = DrawnPart(read_result_arrays(Path(sys.argv[1])).field), Path(sys.argv[2])
    found = {}
    with np.load(folder / "dents.npz") as given:
        discs = Discs(*(given[name] for name in Discs._fields))
        if given["plain"]:
            dent_map.AMBIENT, dent_map.MIN_RIM_PIXELS = 1.0, np.inf
        for number, view in enumerate(given["views"]):
            side = dent_map.render_side(part, discs, tuple(view), int(given["pixels"]), "black")
            found |= {f"image_{number}": side.image, f"pixel_mm_{number}": side.pixel_mm}
    np.savez(folder / "sides.npz", **found)

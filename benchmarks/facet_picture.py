"""Draw what a ball touches of a fillet: of its facets, of its arc, and of the divided facets.

python benchmarks/facet_picture.py docs/images/facets.png
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import trimesh

from chamberopt.geometry.smoothing.smooth import divide_rounds, find_surfaces
from chamberopt.pictures.charts.colours import BLACK, BLUE, GREY, ORANGE

RADIUS, BALL, FACETS = 1.0, 0.8, 3  # mm, of the fillet and of the ball; in a right angle
WIDTH = 4.0  # of the block


def profile() -> np.ndarray:
    """The section (n, 2) [mm] of an angle with a fillet, counter-clockwise."""
    turn = np.radians(np.linspace(180.0, 270.0, FACETS + 1))
    fillet = RADIUS * np.c_[1.0 + np.cos(turn), 1.0 + np.sin(turn)]
    return np.concatenate(
        [[(0.0, 3.0)], fillet, [(3.0, 0.0), (3.0, -0.6), (-0.6, -0.6), (-0.6, 3.0)]]
    )


def solid() -> tuple[np.ndarray, np.ndarray]:
    """Vertices [m] and triangles of the angle."""
    from shapely.geometry import Polygon

    mesh = trimesh.creation.extrude_polygon(Polygon(profile()), WIDTH)
    return np.asarray(mesh.vertices) * 1e-3, np.asarray(mesh.faces)


def section(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Corners (n, 2) [mm] of the hollow at the end of the solid, along the fillet."""
    points = 1e3 * vertices[np.abs(vertices[:, 2]) < 1e-9]
    near = points[(points[:, 0] < 1.3) & (points[:, 1] < 1.3) & (points[:, :2] > -1e-6).all(axis=1)]
    angle = np.arctan2(near[:, 1] - RADIUS, near[:, 0] - RADIUS) % (2.0 * np.pi)
    return near[np.argsort(angle), :2]


def draw(axes: plt.Axes, corners: np.ndarray, title: str) -> None:
    """One section, with balls where they touch two facets at once and where they touch."""
    axes.plot(*corners.T, color=BLACK, lw=2.0, marker="o", ms=3.5)
    turn = np.radians(np.linspace(180.0, 270.0, 200))
    axes.plot(
        RADIUS + RADIUS * np.cos(turn), RADIUS + RADIUS * np.sin(turn), "--", color=GREY, lw=0.8
    )
    along = np.diff(corners, axis=0)
    length = np.linalg.norm(along, axis=1)
    normal = np.c_[-along[:, 1], along[:, 0]] / length[:, None]
    widest = 0.0
    for k in range(len(length) - 1):
        half = 0.5 * np.arccos(np.clip(normal[k] @ normal[k + 1], -1.0, 1.0))
        reach = min(BALL * np.tan(half), length[k], length[k + 1])
        corner = corners[k + 1]
        widest = max(widest, 2.0 * reach)
        for way in (-along[k] / length[k], along[k + 1] / length[k + 1]):
            axes.plot(
                *np.c_[corner, corner + reach * way], color=ORANGE, lw=5.0, solid_capstyle="butt"
            )
    middle = (
        corners[len(corners) // 2 - 1 : len(corners) // 2 + 1] if len(corners) % 2 == 0 else None
    )
    towards = np.array([1.0, 1.0]) / np.sqrt(2.0)
    touch = corners[len(corners) // 2] if middle is None else middle.mean(axis=0)
    sine = 1.0 if middle is not None else 1.0 / np.cos(half)
    axes.add_patch(plt.Circle(touch + BALL * sine * towards, BALL, fill=False, color=BLUE, lw=1.5))
    axes.set_title(f"{title}\nuntouched strips of {widest:.2g} mm", fontsize=10)
    axes.set_aspect("equal")
    axes.axis("off")


def main(path: Path) -> None:
    vertices, triangles = solid()
    every = np.ones(len(triangles), dtype=bool)
    surfaces = find_surfaces(vertices, triangles, every)
    limit, narrow = np.full(len(triangles), np.radians(6.0)), np.full(len(triangles), 6e-5)
    finer = divide_rounds(vertices, triangles, surfaces, limit, narrow)
    figure, axes = plt.subplots(1, 2, figsize=(8.0, 4.2))
    draw(axes[0], section(vertices, triangles), f"the file's facets, {90 / FACETS:.0f}° each")
    draw(axes[1], section(finer.vertices, finer.triangles), "divided along the arc behind them")
    figure.text(
        0.5,
        0.02,
        f"fillet of {RADIUS:g} mm (dashed), ball of {2 * BALL:g} mm; orange: where a ball that "
        "lies across two facets touches nothing\nDents of this ball are 0.12 to 0.2 mm wide: from "
        "both sides they cover narrow strips, and wide ones never.",
        ha="center",
        fontsize=9,
    )
    figure.subplots_adjust(left=0.02, right=0.98, top=0.88, bottom=0.14)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main(Path(sys.argv[1]))

"""Draws the shapes of docs/how_to/chambers.md: python benchmarks/shapes.py"""

import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.pictures import IMAGES
from chamberopt.chamber.build import build_chamber
from chamberopt.design.design import Design
from chamberopt.design.shapes import TAG_SONOTRODE, ShapeSurface
from chamberopt.pictures.charts.colours import EDGES, GLASS, PART_GREY, SONOTRODE

SHOWN: dict[str, dict[str, Any]] = {
    "cylinder": {"diameter_mm": 60, "height_mm": 57, "corner_radius_mm": 8},
    "cylinder, leaning": {"diameter_mm": 56, "height_mm": 57, "inclination_deg": -7},
    "box": {"length_mm": 60, "width_mm": 44, "height_mm": 57, "corner_radius_mm": 8},
    "prism, leaning": {
        "sides": 6,
        "across_mm": 44,
        "height_mm": 57,
        "inclination_deg": 7,
        "corner_radius_mm": 4,
    },
    "revolve": {
        "profile_mm": [[26, 0], [26, 12], [32, 18], [32, 44], [24, 57], [0, 57]],
        "corner_radius_mm": 3,
    },
    "conformal, hull": {"outline": "hull", "gap_mm": 9, "height_mm": 57},
    "conformal, silhouette": {
        "outline": "silhouette",
        "gap_mm": 5,
        "height_mm": 54,
        "corner_radius_mm": 3,
    },
    "shapes/oblong.py": {"length_mm": 66, "width_mm": 44, "height_mm": 57},
}
HEADINGS = {
    "cylinder": "a cylinder, rounded at the top",
    "cylinder, leaning": "a cylinder whose wall leans in",
    "box": "a box with round corners",
    "prism, leaning": "a prism of six sides that lean out",
    "revolve": "a profile turned about the axis",
    "conformal, hull": "walls that follow the part's hull",
    "conformal, silhouette": "walls that follow its outline",
    "shapes/oblong.py": "a shape of your own",
}
LIGHT = np.array([0.5, -0.7, 0.5]) / np.sqrt(0.99)


def main() -> None:
    """Writes docs/images/shapes.png."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 7.2), dpi=90)
    FigureCanvasAgg(figure)
    for number, (title, keys) in enumerate(SHOWN.items(), start=1):
        axes = figure.add_subplot(2, 4, number, projection="3d", computed_zorder=False)
        _draw(axes, *_made(title, keys))
        axes.set_title(HEADINGS[title], y=1.03, fontsize=12)
    figure.subplots_adjust(0.0, 0.0, 1.0, 0.94, 0.0, 0.12)
    figure.savefig(IMAGES / "shapes.png")


def _made(title: str, keys: dict[str, Any]) -> tuple[ShapeSurface, np.ndarray]:
    """The cavity of a shape around the blade, and the blade's triangles (m, 3, 3).

    Both are in metres and lie below the ceiling.
    """
    from chamberopt import load_design

    data = load_design(IMAGES.parents[1] / "designs" / "blade_oblong.toml").model_dump()
    own = data["chamber"]["shape"]
    name = own if title.endswith(".py") else title.partition(",")[0]
    data["chamber"] = {"shape": name, "sonotrode_distance_mm": 15, **keys}
    design = Design.model_validate(data)
    part = build_chamber(design).part
    return design.chamber.surface(part.vertices, part.triangles), part.vertices[part.triangles]


def _draw(axes: Any, cavity: ShapeSurface, part: np.ndarray) -> None:
    from matplotlib.colors import to_rgb, to_rgba
    from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

    corners = 1e3 * cavity.vertices[cavity.triangles]
    floor = cavity.tags == TAG_SONOTRODE
    top = corners[..., 2].max()
    part = 1e3 * part[(1e3 * part[..., 2] < top).any(axis=1)]
    part[..., 2] = np.minimum(part[..., 2], top)
    grey = np.array(to_rgb(PART_GREY)) * (0.75 + 0.25 * _unit(part) @ LIGHT)[:, None]
    face = np.tile(to_rgb(SONOTRODE), (int(floor.sum()), 1))
    for triangles, colours in ((corners[floor], face), (part, grey)):
        axes.add_collection3d(
            Poly3DCollection(triangles, facecolors=colours, edgecolors=colours, linewidths=0.3)
        )
    axes.add_collection3d(Poly3DCollection(corners[~floor], facecolors=to_rgba(GLASS, 0.25)))
    axes.add_collection3d(Line3DCollection(_edges(cavity), colors=EDGES, linewidths=0.6, alpha=0.8))
    axes.set(xlim=(-23, 23), ylim=(-23, 23), zlim=(4, 53))
    axes.set_aspect("equal")
    axes.view_init(elev=20, azim=-58)
    axes.set_axis_off()


def _edges(cavity: ShapeSurface) -> np.ndarray:
    """Sides (k, 2, 3) mm between triangles that face in different directions."""
    normal = _unit(cavity.vertices[cavity.triangles])
    sides: dict[tuple[int, int], list[int]] = {}
    for number, row in enumerate(cavity.triangles.tolist()):
        for a, b in zip(row, [*row[1:], row[0]], strict=True):
            sides.setdefault((min(a, b), max(a, b)), []).append(number)
    sharp = [
        side for side, (i, j) in sides.items() if normal[i] @ normal[j] < np.cos(np.radians(10.0))
    ]
    return 1e3 * cavity.vertices[np.array(sharp)]


def _unit(triangles: np.ndarray) -> np.ndarray:
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-30)[:, None]


if __name__ == "__main__":
    main()

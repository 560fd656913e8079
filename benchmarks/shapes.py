"""Draws the shapes of docs/how_to/chambers.md: python benchmarks/shapes.py"""

import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.pictures import IMAGES
from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.part import Part
from chamberopt.design.design import Design
from chamberopt.design.shapes import TAG_SONOTRODE, ShapeSurface
from chamberopt.pictures.charts.colours import EDGES, GLASS, PART_GREY, SONOTRODE
from chamberopt.pictures.view import render_view
from chamberopt.results.vtp_files import pyvista

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
EYE = np.array([0.55, -0.85, 0.42])
SIZE, BORDER = (520, 560), 12  # pixels of an image, and free round what it shows


def main() -> None:
    """Writes docs/images/shapes.png."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    figure = Figure(figsize=(12.0, 7.4), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    made = [_made(title, keys) for title, keys in SHOWN.items()]
    around = np.concatenate([1e3 * cavity.vertices for cavity, _ in made])  # all at one scale
    for axes, title, one in zip(figure.subplots(2, 4).flat, SHOWN, made, strict=True):
        view = render_view(partial(_add, *one), EYE, around, SIZE, BORDER)
        axes.imshow(view.image)
        axes.set_title(HEADINGS[title], fontsize=12)
        axes.set_axis_off()
    names = {"part": PART_GREY, "chamber wall": GLASS, "sonotrode": SONOTRODE}
    patches = [Patch(facecolor=colour, label=name) for name, colour in names.items()]
    figure.legend(handles=patches, loc="outside lower center", ncols=3, frameon=False, fontsize=12)
    figure.get_layout_engine().set(h_pad=0.1)
    figure.savefig(IMAGES / "shapes.png")


def _made(title: str, keys: dict[str, Any]) -> tuple[ShapeSurface, Part]:
    """The cavity of a shape around the blade, and the blade in it."""
    from chamberopt import load_design

    data = load_design(IMAGES.parents[1] / "designs" / "blade_oblong.toml").model_dump()
    own = data["chamber"]["shape"]
    name = own if title.endswith(".py") else title.partition(",")[0]
    data["chamber"] = {"shape": name, "sonotrode_distance_mm": 15, **keys}
    design = Design.model_validate(data)
    part = build_chamber(design).part
    return design.chamber.surface(part.vertices, part.triangles), part


def _add(cavity: ShapeSurface, part: Part, plotter: Any) -> None:
    """Add a cavity and the part, up to the ceiling, to a plotter."""
    room = pyvista().PolyData.from_regular_faces(1e3 * cavity.vertices, cavity.triangles)
    own = pyvista().PolyData.from_regular_faces(1e3 * part.vertices, part.triangles)
    on_floor = cavity.tags == TAG_SONOTRODE
    floor, walls = (room.extract_cells(np.flatnonzero(one)) for one in (on_floor, ~on_floor))
    own = own.clip_closed_surface("-z", origin=(0, 0, room.bounds[5]))
    plotter.add_mesh(own, color=PART_GREY, ambient=0.5, diffuse=0.5)
    plotter.add_mesh(floor, color=SONOTRODE, ambient=0.75, diffuse=0.25)
    plotter.add_mesh(walls, color=GLASS, opacity=0.35, ambient=0.8, diffuse=0.2, culling="front")
    edges = room.extract_feature_edges(10.0, boundary_edges=False, non_manifold_edges=False)
    if edges.n_cells:
        plotter.add_mesh(edges, color=EDGES, line_width=2)


if __name__ == "__main__":
    main()

"""Draw where the later candidates of a comparison cover more or less than the first candidate."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from chamberopt.pictures.actors import NO_RENDER
from chamberopt.pictures.camera import cells_of, near_directions, near_views, seen_area
from chamberopt.pictures.charts.colours import DIFFERENCE_MAP, FEW_TO_TELL
from chamberopt.pictures.panels import near_panels
from chamberopt.pictures.picture_page import ColourBar, Row, write_page
from chamberopt.pictures.subprocess_drawing import draw_in_subprocess
from chamberopt.results.arrays_file import ARRAYS_FILE, read_result_arrays
from chamberopt.results.vtp_files import Surface, save_surface

# Brown (less) over white to violet (more), readable for colour-blind readers, and not grey.
PALE, NO_TARGET = "#e6e9ec", "#a9b0b7"
WORTH_DRAWING = 0.005  # share of the target that differs by more than the noise


Columns = Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]]
"""For each later candidate the difference of coverage, -1..1, at the vertices of the target in
their order, shape (v,), marks of real differences, and marks of enough dents to tell, bool, (v,)
each."""


def write_differences(path: Path, first: Path, columns: Columns) -> None:
    """Write a part as .vtp with the coverage of each later candidate minus the first candidate's.

    Candidate k = 1, 2, ... has the columns difference_k [percentage points], real_k (1 where
    the difference is more than noise) and told_k (1 where there are enough dents to tell) at the
    vertices. The triangles have the column target.

    Args:
        path: .vtp file to write.
        first: the first candidate's results folder.
    """
    save_surface(path, _difference_surface(first, columns))


def _difference_surface(first: Path, columns: Columns) -> Surface:
    surface = read_result_arrays(first / ARRAYS_FILE).field
    target = np.asarray(surface["target"])
    used = np.unique(np.asarray(surface.regular_faces)[target > 0])
    normal = np.asarray(surface.point_data.active_normals)
    surface.clear_data()
    surface.cell_data["target"] = target
    surface.point_data.active_normals = normal
    for k, (value, *marks) in enumerate(columns, start=1):
        names = (f"difference_{k}", f"real_{k}", f"told_{k}")
        for name, column in zip(names, (100.0 * value, *marks), strict=True):
            surface.point_data[name] = np.zeros(surface.n_points, dtype=np.float32)
            surface.point_data[name][used] = column
    return surface


def draw_difference(
    first: Path,
    columns: Columns,
    titles: Sequence[str],
    picture: str | Path,
    one_below_other: bool = False,
) -> str | None:
    """Draw where later candidates cover more or less than the first, all on one colour scale.

    Args:
        first: the first candidate's results folder.
        titles: a title for each later candidate.
        picture: file to write, .png.
        one_below_other: whether the views of a candidate are one below the other, so that each is
            as wide as the picture.

    Returns:
        None, or one line that says why there is no picture.
    """
    job = {"first": first, "columns": columns, "titles": list(titles), "below": one_below_other}
    return draw_in_subprocess(render_difference, job, picture)


def render_difference(job: dict[str, Any]) -> None:
    """Draw the picture of draw_difference; this runs in a child process.

    The camera looks from where most of the target is visible. A candidate that hardly differs
    anywhere by more than the noise is told of in a sentence, unless all are such.
    """
    surface, titles = _difference_surface(job["first"], job["columns"]), job["titles"]
    limit = _scale_limit(surface, len(titles))
    on_target = np.asarray(surface["target"]) > 0
    target, rest = cells_of(surface, on_target), cells_of(surface, ~on_target)
    eyes = near_directions(target)
    views = near_views(seen_area(target, [rest], eyes), eyes)
    rows: list[Row] = []
    drawn: list[int] = []
    alike: list[str] = []
    used = np.unique(np.asarray(target.regular_faces))
    shares = [(np.asarray(target[f"real_{k + 1}"])[used] > 0).mean() for k in range(len(titles))]
    differs = [share >= WORTH_DRAWING for share in shares]
    for k, title in enumerate(titles, start=1):
        if any(differs) and not differs[k - 1]:
            alike.append(f"{title.splitlines()[0]}: hardly anywhere more than the noise")
            continue

        def add(plotter: Any, k: int = k) -> None:
            _add_difference(plotter, target, rest, k, limit)

        panels = near_panels(add, target, surface, views)
        if job["below"]:
            rows += [Row(title if one is panels[0] else "", [one]) for one in panels]
        else:
            rows.append(Row(title, panels))
        drawn.append(k)
    legend = [(PALE, "within the noise"), (NO_TARGET, "not in the target")]
    if not all((np.asarray(target[f"told_{k}"])[used] > 0).all() for k in drawn):
        legend.insert(1, (FEW_TO_TELL, "too few simulated dents to tell"))
    bar = ColourBar("difference of coverage [%-points]", DIFFERENCE_MAP, (-limit, limit), "both")
    write_page(job["picture"], rows, legend, bar, alike)


def _add_difference(plotter: Any, target: Surface, rest: Surface, k: int, limit: float) -> None:
    look: dict[str, Any] = {"ambient": 0.7, "diffuse": 0.3, **NO_RENDER}
    if rest.n_cells:
        plotter.add_mesh(rest, color=NO_TARGET, **look)
    # The border is half way between vertices with and without a real difference.
    same, shown = target.clip_scalar(scalars=f"real_{k}", value=0.5, both=True)
    if same.n_cells:
        few, noise = same.clip_scalar(scalars=f"told_{k}", value=0.5, both=True)
        for surface, colour in ((few, FEW_TO_TELL), (noise, PALE)):
            if surface.n_cells:
                plotter.add_mesh(surface, color=colour, **look)
    if shown.n_cells:
        plotter.add_mesh(
            shown, scalars=f"difference_{k}", cmap=DIFFERENCE_MAP, clim=(-limit, limit),
            nan_color=PALE, show_scalar_bar=False, **look,
        )  # fmt: skip


def _scale_limit(surface: Surface, count: int) -> float:
    """Return a round number above nearly all real differences, to end the colour scale [%]."""
    real = [
        np.abs(surface[f"difference_{k}"])[np.asarray(surface[f"real_{k}"]) > 0]
        for k in range(1, count + 1)
    ]
    values = np.concatenate(real)
    if not len(values):
        return 5.0
    most = float(np.percentile(values, 99.0))
    step = 1.0 if most <= 5.0 else 5.0
    return max(1.0, step * float(np.ceil(most / step)))

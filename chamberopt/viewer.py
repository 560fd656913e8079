"""The part in its chamber, in three dimensions. The only file that imports pyvista.

Pictures are drawn in a process of their own: where an OpenGL library is there but its driver is not, VTK does
not raise, it takes the process down, and a picture must never cost the results.
"""

from __future__ import annotations

import ctypes
import json
import os
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.coverage import coverage_at, mean_impact_angle_deg, mean_normal_speed
from chamberopt.disk import whole_file
from chamberopt.errors import InputError
from chamberopt.shapes import TAG_WALL, is_sonotrode

if TYPE_CHECKING:
    from chamberopt.chamber import Chamber
    from chamberopt.coverage import Tally

COVERAGE, CHAMBER = "coverage.vtp", "chamber.vtp"
# Even steps of lightness, told apart by colour-blind readers too.
COLOURS = "viridis"
GREY, DARK, GLASS, SONOTRODE, BACKGROUND = "#b9bec4", "#2b3440", "#9db7cc", "#e08a2e", "white"
FAULT = "#d01c1c"
INSTALL = "install OpenGL for machines without a display (Debian: apt install libegl1 libgl1-mesa-dri)"
MM = 1e3
# Pictures average coverage over so many dents or more where triangles got fewer: single dents would be confetti.
DENTS_SHOWN = 15
# ... but over no more than this share of the target's size, so that a picture never hides a pattern.
WIDEST = 0.06

Surface = Any
"""A pyvista.PolyData: pyvista's own annotations refuse numpy's."""


def _pyvista() -> Any:
    import pyvista

    return pyvista


def write_coverage(
    path: Path, chamber: Chamber, total: Tally, treatment_time: float, marked: np.ndarray | None = None
) -> None:
    """The user's part, posed in the chamber [mm], with what each triangle got; opens in ParaView.

    Cell data: coverage (0..1) and impacts_per_mm2 at the treatment time [s], dent_density (dented area per area then:
    coverage is 1 - exp(-it)), dents (simulated number), mean_normal_speed [m/s], mean_angle_deg (90 is head on),
    exposed_area_mm2, target; NaN where not exposed or never hit. marked (m,): with it, coverage is the share of each
    triangle inside dents rather than what follows from their rate.
    """
    exposed_mm2 = np.where(chamber.exposed_area > 0.0, chamber.exposed_area * 1e6, np.nan)
    times = treatment_time / total.simulated_time
    fields = {
        "coverage": coverage_at(total, chamber, treatment_time) if marked is None else marked,
        "impacts_per_mm2": total.impacts * times / exposed_mm2,
        "dent_density": total.dented_area * 1e6 * times / exposed_mm2,
        "dents": total.dents,
        "mean_normal_speed": mean_normal_speed(total),
        "mean_angle_deg": mean_impact_angle_deg(total),
        "exposed_area_mm2": chamber.exposed_area * 1e6,
        "target": chamber.part.target.astype(np.uint8),
    }
    _write_surface(path, chamber.part.vertices, chamber.part.triangles, fields)


def write_chamber(folder: Path, chamber: Chamber) -> None:
    """The closed cavity [mm]: chamber.stl for CAD, chamber.vtp with tags (0 part, 1 sonotrode, 2 wall, 3 ... more)."""
    fields = {"tag": chamber.tags, "source": chamber.source}
    _write_surface(folder / CHAMBER, chamber.vertices, chamber.triangles, fields)
    _write_surface(folder / "chamber.stl", chamber.vertices, chamber.triangles, {})


def _write_surface(path: Path, vertices: np.ndarray, triangles: np.ndarray, fields: dict[str, np.ndarray]) -> None:
    pyvista = _pyvista()
    surface = pyvista.PolyData.from_regular_faces(vertices * MM, triangles)
    for name, values in fields.items():
        surface.cell_data[name] = values
    with whole_file(path) as temporary:
        surface.save(temporary)


def read_surface(path: Path) -> Surface:
    """A .vtp of a results folder. VTK reads a damaged one as an empty mesh: here that is an InputError."""
    pyvista = _pyvista()
    if not path.is_file():
        raise InputError(f"{path}: not there; give a results folder that simulate or run has finished")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a damaged file VTK warns, in words nobody can act on
        surface = pyvista.read(path)
    if not isinstance(surface, pyvista.PolyData) or surface.n_cells == 0:
        raise InputError(f"{path}: damaged, no triangles could be read; simulate again")
    return surface


def why_no_pictures() -> str | None:
    """None when pictures can be tried on this machine, else one line that says what is missing."""
    if not sys.platform.startswith("linux") or _offscreen_window():
        return None
    return f"no OpenGL library found: {INSTALL}"


def _offscreen_window() -> str | None:
    """VTK's name for the window that needs no display, by what is installed."""
    windows = (("libEGL.so.1", "vtkEGLRenderWindow"), ("libOSMesa.so.8", "vtkOSOpenGLRenderWindow"))
    for library, window in windows:
        try:
            ctypes.CDLL(library)
        except OSError:
            continue
        return window
    return None


def coverage_picture(folders: Sequence[str | Path], titles: Sequence[str], picture: str | Path) -> str | None:
    """Draw the coverage of one result, or of several side by side on one colour scale, into a .png.

    folders: each with coverage.vtp and chamber.vtp. Returns None, or one line saying why there is no picture.
    """
    return _drawn_apart({"folders": [str(f) for f in folders], "titles": list(titles)}, picture)


def part_picture(
    corners: np.ndarray,
    title: str,
    picture: str | Path,
    marked: np.ndarray | None = None,
    edges: np.ndarray | None = None,
    missed: np.ndarray | None = None,
    chamber: Chamber | None = None,
) -> str | None:
    """Draw a part as its file has it into a .png, from two sides; for what is wrong with it, or what its target is.

    corners (m, 3, 3) m · marked (m,) bool: triangles in orange · missed (m,) bool: in red · edges (k, 2, 3) m: drawn
    red, through the part · chamber: drawn as glass round the part, beside the two.
    Returns None, or one line saying why there is no picture. Raises InputError where no such file can be.
    """
    path = _picture_path(picture)
    with tempfile.TemporaryDirectory() as folder:
        part = Path(folder) / "part.npz"
        marked, missed = (
            np.zeros(len(corners), dtype=bool) if chosen is None else chosen for chosen in (marked, missed)
        )
        edges = np.zeros((0, 2, 3)) if edges is None else edges
        np.savez(part, corners=corners * MM, marked=marked & ~missed, missed=missed, edges=edges * MM)
        job = {"part": str(part), "title": title}
        if chamber is not None:
            write_chamber(Path(folder), chamber)
            job["chamber"] = str(Path(folder) / CHAMBER)
        return _drawn_apart(job, path)


def _picture_path(picture: str | Path) -> Path:
    """Where --screenshot may write. InputError for what is no .png, or in no folder."""
    path = Path(picture)
    if path.suffix.lower() != ".png":
        raise InputError(f"--screenshot {path}: pictures are written as .png; give such a name")
    if not path.resolve().parent.is_dir():
        raise InputError(f"--screenshot {path}: the folder does not exist; make it first")
    return path


def _drawn_apart(job: dict[str, Any], picture: str | Path) -> str | None:
    """Does a drawing job in a process of its own. None, or one line saying why there is no picture."""
    missing = why_no_pictures()
    if missing:
        return f"{Path(picture).name} skipped: {missing}"
    job = {**job, "picture": str(picture)}
    environment = dict(os.environ)
    window = _offscreen_window()
    if sys.platform.startswith("linux") and window:
        environment["VTK_DEFAULT_OPENGL_WINDOW"] = window
        environment.pop("DISPLAY", None)
    command = [sys.executable, "-m", "chamberopt.viewer", json.dumps(job)]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=600, check=False)
    if run.returncode == 0 and Path(picture).is_file():
        return None
    if run.returncode == 2:
        raise InputError(run.stderr.strip().splitlines()[-1])
    return f"{Path(picture).name} skipped: drawing failed (status {run.returncode}); {INSTALL}"


def inspect(folder: str | Path, screenshot: str | Path | None = None, title: str = "") -> None:
    """Turn the part in its chamber with the mouse; or, with `screenshot`, write a picture without a window.

    Raises InputError when the folder has no coverage, or there is no display to open a window on.
    """
    folder = Path(folder)
    read_surface(folder / COVERAGE)
    if screenshot is not None:
        path = _picture_path(screenshot)
        trouble = coverage_picture([folder], [title or folder.name], path)
        if trouble:
            raise InputError(trouble)
        return
    on_linux = sys.platform.startswith("linux")
    if on_linux and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise InputError("inspect: there is no display to open a window on; write a picture: --screenshot FILE.png")
    pyvista = _pyvista()
    plotter = pyvista.Plotter(window_size=[1400, 900])
    part, chamber = _Part(read_surface(folder / COVERAGE)), read_surface(folder / CHAMBER)
    _scene(plotter, part, chamber, title or folder.name, _colour_range([part]), bar=True)
    plotter.add_axes()
    plotter.show()


def _draw(job: dict[str, Any]) -> None:
    """Each result twice: in its chamber, and the target from near; several results side by side."""
    pyvista = _pyvista()
    folders = [Path(folder) for folder in job["folders"]]
    parts = [_Part(read_surface(folder / COVERAGE)) for folder in folders]
    chambers = [read_surface(folder / CHAMBER) for folder in folders]
    limits = _colour_range(parts)
    single = len(folders) == 1
    shape = (1, 2) if single else (2, len(folders))
    size = [1800, 900] if single else [900 * len(folders), 1500]
    plotter = pyvista.Plotter(off_screen=True, shape=shape, window_size=size, border=False)
    for column, (part, chamber, title) in enumerate(zip(parts, chambers, job["titles"], strict=True)):
        plotter.subplot(0, 0 if single else column)
        _scene(plotter, part, chamber, title, limits, bar=False)
        plotter.subplot(*((0, 1) if single else (1, column)))
        _near(plotter, part, limits, bar=single or column == len(folders) - 1)
    with whole_file(Path(job["picture"])) as temporary:
        plotter.screenshot(temporary)


def _draw_part(job: dict[str, Any]) -> None:
    """The part's surface from two opposite sides, edges shining through it, where there are any; and in its chamber."""
    pyvista = _pyvista()
    with np.load(job["part"]) as data:
        corners, marked, missed, edges = data["corners"], data["marked"], data["missed"], data["edges"]
    surface = pyvista.PolyData.from_regular_faces(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    lines = pyvista.line_segments_from_points(edges.reshape(-1, 3)) if len(edges) else None
    room = read_surface(Path(job["chamber"])) if "chamber" in job else None
    views = (1.0, -1.0) if room is None else (1.0, -1.0, 0.0)
    plotter = pyvista.Plotter(off_screen=True, shape=(1, len(views)), window_size=[900 * len(views), 900], border=False)
    for column, side in enumerate(views):
        plotter.subplot(0, column)
        plotter.set_background(BACKGROUND)
        if room is not None and side == 0.0:
            _room(plotter, room)
            side = 1.0
        for chosen, colour in ((~(marked | missed), GREY), (marked, SONOTRODE), (missed, FAULT)):
            if chosen.any():
                plotter.add_mesh(surface.extract_cells(chosen), color=colour, opacity=1.0 if lines is None else 0.35)
        if lines is not None:
            plotter.add_mesh(lines, color=FAULT, line_width=6, lighting=False)
        if column == 0:
            plotter.add_text(job["title"], position="upper_left", font_size=11, color=DARK)
        plotter.camera_position = [(side, -1.6 * side, 0.7 * side), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
        plotter.reset_camera()
        plotter.enable_anti_aliasing("ssaa")
    with whole_file(Path(job["picture"])) as temporary:
        plotter.screenshot(temporary)


class _Part:
    """A part ready to be drawn: its target with the coverage shown on it [%], and the rest."""

    def __init__(self, surface: Surface) -> None:
        wanted = (surface["target"] > 0) & (surface["exposed_area_mm2"] > 0)
        self.target = surface.extract_cells(wanted).extract_surface(algorithm="dataset_surface")
        self.rest = surface.extract_cells(~wanted)
        density, self.reach = _averaged(
            np.asarray(self.target.cell_centers().points),
            np.asarray(self.target.cell_normals),
            np.asarray(self.target["dent_density"]),
            np.asarray(self.target["exposed_area_mm2"]),
            np.asarray(self.target["dents"]),
        )
        self.target["shown"] = -100.0 * np.expm1(-density)


def _averaged(
    centre: np.ndarray, normal: np.ndarray, density: np.ndarray, area: np.ndarray, dents: np.ndarray
) -> tuple[np.ndarray, float]:
    """Dent density averaged over discs of one radius [mm], just wide enough to hold DENTS_SHOWN dents; and that radius.

    Only over neighbours that face the same way, so that a flank is not mixed with the next one. 0.0: as it is.
    """
    if not len(centre) or np.mean(dents) >= DENTS_SHOWN:
        return density, 0.0
    from scipy.spatial import cKDTree

    per_mm2 = max(float(dents.sum() / area.sum()), 1e-12)
    size = float(np.linalg.norm(np.ptp(centre, axis=0)))
    reach = min(np.sqrt(DENTS_SHOWN / (np.pi * per_mm2)), WIDEST * size)
    pairs = cKDTree(centre).query_pairs(reach, output_type="ndarray")
    i, j = pairs[np.einsum("ij,ij->i", normal[pairs[:, 0]], normal[pairs[:, 1]]) > 0.7].T
    sums, areas = density * area, area.astype(float).copy()
    for here, there in ((i, j), (j, i)):
        sums = sums + np.bincount(here, (density * area)[there], len(area))
        areas = areas + np.bincount(here, area[there], len(area))
    return sums / areas, float(reach)


def _colour_range(parts: Sequence[_Part]) -> tuple[float, float]:
    """Round limits [%] that hold nearly all of what is shown on every part."""
    values = np.concatenate([part.target["shown"] for part in parts])
    low, high = np.percentile(values, [1.0, 99.5]) if len(values) else (0.0, 100.0)
    step = 5.0 if high - low < 20.0 else 10.0
    low = max(0.0, step * np.floor(low / step))
    return low, min(100.0, max(low + step, step * np.ceil(high / step)))


def _show(plotter: Any, part: _Part, limits: tuple[float, float], bar: bool) -> None:
    """The target coloured by coverage, the rest of the part grey, lit from the camera."""
    plotter.set_background(BACKGROUND)
    plotter.remove_all_lights()
    plotter.add_light(_pyvista().Light(light_type="headlight"))
    if part.rest.n_cells:
        plotter.add_mesh(part.rest, color=GREY, ambient=0.45, diffuse=0.55)
    style = {
        "vertical": True, "title": "coverage [%]\n", "fmt": "%.0f", "n_labels": 6, "color": DARK,
        "width": 0.06, "height": 0.55, "position_x": 0.88, "position_y": 0.2,
        "title_font_size": 20, "label_font_size": 20,
    }  # fmt: skip
    plotter.add_mesh(
        part.target, scalars="shown", cmap=COLOURS, clim=limits, ambient=0.7, diffuse=0.3,
        show_scalar_bar=bar, scalar_bar_args=style if bar else None,
    )  # fmt: skip


def _scene(plotter: Any, part: _Part, chamber: Surface, title: str, limits: tuple[float, float], bar: bool) -> None:
    """The part inside the glass chamber, over the sonotrode."""
    _show(plotter, part, limits, bar)
    _room(plotter, chamber)
    plotter.add_text(title, position="upper_left", font_size=13, color=DARK)
    legend = "orange: sonotrode   grey: not in the target"
    plotter.add_text(legend, position="lower_left", font_size=9, color=DARK)
    plotter.camera_position = [(1.0, -1.6, 0.35), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
    plotter.reset_camera()
    plotter.enable_anti_aliasing("ssaa")


def _room(plotter: Any, chamber: Surface) -> None:
    """The sonotrode, and the walls as glass with their edges."""
    tags = np.asarray(chamber["tag"])
    sonotrode, wall = (
        chamber.extract_cells(chosen).extract_surface(algorithm="dataset_surface")
        for chosen in (is_sonotrode(tags), tags == TAG_WALL)
    )
    plotter.add_mesh(sonotrode, color=SONOTRODE, lighting=False)
    plotter.add_mesh(wall, color=GLASS, opacity=0.16, specular=0.3)
    rims = wall.extract_feature_edges(30, non_manifold_edges=False, manifold_edges=False)
    plotter.add_mesh(rims, color=DARK, line_width=2, opacity=0.6)


def _near(plotter: Any, part: _Part, limits: tuple[float, float], bar: bool) -> None:
    """The target from near and a little below, where the shot comes from."""
    _show(plotter, part, limits, bar)
    if part.reach:
        text = f"averaged over {part.reach:.1f} mm around each triangle: few dents were simulated"
        plotter.add_text(text, position="lower_left", font_size=9, color=DARK)
    plotter.camera_position = [(1.0, -1.4, -0.8), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
    plotter.reset_camera(bounds=part.target.bounds)
    plotter.camera.SetWindowCenter(0.14 if bar else 0.0, 0.0)  # makes room for the colour bar
    plotter.enable_anti_aliasing("ssaa")


if __name__ == "__main__":
    try:
        asked = json.loads(sys.argv[1])
        (_draw_part if "part" in asked else _draw)(asked)
    except InputError as error:
        print(error, file=sys.stderr)
        sys.exit(2)

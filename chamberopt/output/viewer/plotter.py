"""The views of `inspect`, one for each result; everything in them follows from one ViewState."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.triangles import unit_normals
from chamberopt.output.plots.quantities import QUANTITIES
from chamberopt.output.viewer import overlay
from chamberopt.output.viewer.actors import (
    GREY,
    PALE,
    SONOTRODE,
    add_chamber,
    add_part,
    light,
    without_colour,
)
from chamberopt.output.viewer.opened_result import (
    OpenedResult,
    colour_limits,
    common_quantities,
    same_part,
)
from chamberopt.output.viewer.view_state import DEFAULT_VIEW, KEYS, Plane, ViewState
from chamberopt.output.vtp_files import Surface, pyvista

MAX_RESULTS = 6
VIEW_SIZES = {1: (1400, 900), 2: (1000, 900), 3: (800, 800), 4: (900, 700)}  # by number of results
SMALLEST_VIEW = (700, 650)  # with more results
SCREEN = (1500, 850)  # pixels; a window of this size fits on most screens
VIEW_ANGLE = 30.0  # degrees
STEEPER_BELOW = 2.0  # times as steep from below as from above, to see past the sonotrode
PIN_LENGTH = 0.06  # of the mark on a triangle, as a share of the target's size


class ResultPlotter:
    """A plotter with one view for each result.

    plotter: of pyvista.
    results: opened.
    linked: whether the views turn together, because they show the same part.
    quantities: names of those that all results have.
    """

    def __init__(
        self,
        results: Sequence[OpenedResult],
        off_screen: bool,
        size: tuple[int, int] | None = None,
        menu: bool = False,
    ) -> None:
        """Open the plotter.

        Args:
            results: at most MAX_RESULTS.
            off_screen: whether to draw without a window.
            size: of each view [pixels]; chosen by the number of results if left out.
            menu: whether to list the keys of the quantities.
        """
        if len(results) > MAX_RESULTS:
            raise InputError(
                f"inspect: {len(results)} results are too many for one window; give at most "
                f"{MAX_RESULTS}"
            )
        self.results, self.menu = list(results), menu
        rows = 2 if len(results) > 3 else 1
        self.shape = rows, -(-len(results) // rows)
        width, height = size or VIEW_SIZES.get(len(results), SMALLEST_VIEW)
        if menu:
            width, height = min(width, SCREEN[0] // self.shape[1]), min(height, SCREEN[1] // rows)
        self.plotter = pyvista().Plotter(
            off_screen=off_screen,
            shape=self.shape,
            window_size=[width * self.shape[1], height * self.shape[0]],
            border=len(results) > 1,
        )
        self.plotter.enable_anti_aliasing("msaa", multi_samples=8)  # ssaa would move the charts
        self.linked = same_part(results)
        self.quantities = common_quantities(results)
        self._actors: list[set[str]] = [set() for _ in results]  # drawn here, by name

    def draw(self, state: ViewState) -> None:
        """Draw everything for a state, cameras excepted; InputError if a result cannot show it."""
        limits = colour_limits(self.results, state)
        for number, result in enumerate(self.results):
            self._select_view(number)
            self._clear_view(number)
            self._draw_view(number, result, state, limits)
        if state.keys:
            self._select_view(0)
            overlay.show_keys(self.plotter, KEYS, self.view_size())
            self._actors[0].add("keys")

    def aim(self, state: ViewState) -> None:
        """Point the cameras, all the same way, at everything that is drawn."""
        boxes = [_bounds(result, state) for result in self.results]
        for number, result in enumerate(self.results):
            self._select_view(number)
            box = reduce(_union, boxes) if self.linked else boxes[number]
            eye, middle = _eye(result, state), box.mean(axis=1)
            up = (0.0, 1.0, 0.0) if abs(eye[2]) > 0.99 * np.linalg.norm(eye) else (0.0, 0.0, 1.0)
            self.plotter.camera_position = [tuple(middle + eye), tuple(middle), up]
            self.plotter.camera.view_angle = VIEW_ANGLE  # zoom() narrows it, so it is set each time
            self.plotter.reset_camera(bounds=box.ravel().tolist())
            self.plotter.camera.zoom(1.15)
        if self.linked:
            self.plotter.link_views()

    def pick_triangle(self, x: float, y: float) -> tuple[int, int] | None:
        """Return view and triangle at a point of the window [pixels], None beside the part."""
        import vtk

        renderer = self.plotter.iren.get_poked_renderer(x, y)
        number = [*self.plotter.renderers].index(renderer)
        picker = vtk.vtkCellPicker()
        picker.SetTolerance(1e-4)
        picker.Pick(x, y, 0.0, renderer)
        if picker.GetCellId() < 0 or number >= len(self.results):
            return None
        return number, int(pyvista().wrap(picker.GetDataSet())["triangle"][picker.GetCellId()])

    def view_size(self) -> tuple[int, int]:
        """Width and height of one view [pixels]."""
        width, height = self.plotter.window_size
        return width // self.shape[1], height // self.shape[0]

    def _select_view(self, number: int) -> None:
        self.plotter.subplot(*divmod(number, self.shape[1]))

    def _clear_view(self, number: int) -> None:
        plotter, renderer = self.plotter, self.plotter.renderer
        if _bar_name(number) in plotter.scalar_bars:
            plotter.remove_scalar_bar(_bar_name(number), render=False)
        for name in self._actors[number]:  # not the handles, and not what holds the charts
            renderer.remove_actor(name, reset_camera=False, render=False)
        if renderer.has_charts:
            plotter.remove_chart(0)

    def _draw_view(
        self, number: int, result: OpenedResult, state: ViewState, limits: tuple[float, float]
    ) -> None:
        plotter, size = self.plotter, self.view_size()
        before = set(plotter.renderer.actors)
        light(plotter)
        pale = result.above_threshold(state)
        part_actors = add_part(plotter, result.part, limits, pale)
        actors = list(part_actors)
        if state.chamber:
            faces, walls = add_chamber(plotter, result.chamber)
            actors += [*faces.values(), *walls]
        if state.cut is not None:
            _cut(actors if state.cut_part else actors[len(part_actors) :], state.cut, result)
        lines: list[str] = []
        speed = np.zeros(0)
        if state.triangle is not None and state.view in (None, number):
            lines, speed = _triangle_lines(result, state.triangle, state)
            corners = result.surface.points[result.surface.regular_faces[state.triangle]]
            overlay.mark_triangle(plotter, corners, PIN_LENGTH * result.part.whole.length)
        title = result.info.title
        if self.menu and number == 0:
            menu = _menu(self.quantities, state)
            title += "\n" + overlay.wrap(menu, 0.6 * size[0], overlay.fonts(size)[1])
        overlay.show_title(plotter, title, lines, size)
        quantity = QUANTITIES[state.quantity]
        overlay.show_colour_bar(plotter, quantity, limits, part_actors[0], _bar_name(number), size)
        overlay.show_legend(plotter, _legend(result, state), _remarks(result, state, pale), size)
        self._actors[number] = set(plotter.renderer.actors) - before
        if len(speed):
            overlay.show_histogram(plotter, speed)


def _bar_name(number: int) -> str:
    """Name of a view's colour bar, which VTK also writes: blanks, of another length in each."""
    return " " * (number + 1)


def _menu(names: Sequence[str], state: ViewState) -> str:
    """List the keys of the quantities, with the one shown in brackets."""
    keys = [
        f"[{key} {name}]" if name == state.quantity else f"{key} {name}"
        for key, name in enumerate(QUANTITIES, 1)
        if name in names
    ]
    return "  ".join([*keys, "h keys"])


def _triangle_lines(
    result: OpenedResult, triangle: int, state: ViewState
) -> tuple[list[str], np.ndarray]:
    """Return the lines on a triangle, and its impact speeds (k,) [m/s]."""
    return result.describe_triangle(triangle, state), result.hits.of(triangle).speed


def _remarks(result: OpenedResult, state: ViewState, pale: np.ndarray | None) -> list[str]:
    """Return remarks on time and threshold."""
    quantity, part, remarks = QUANTITIES[state.quantity], result.part, []
    if quantity.name == "coverage" or quantity.grows:
        treatment = result.info.treatment_s
        time = treatment if state.time_s is None else state.time_s
        remarks.append(f"after {time:.4g} s" + (" (the treatment)" if time == treatment else ""))
    if pale is not None:
        below = np.asarray(part.target["area"])[~pale].sum() + part.unreached["area"].sum()
        share = 100.0 * below / part.whole["area"].sum()
        remarks.append(f"below {state.below:g} %: {share:.1f} % of the area")
    return remarks


def _legend(result: OpenedResult, state: ViewState) -> list[tuple[str, str]]:
    """Return (colour, meaning) of colours that stand for no value."""
    entries = [(GREY, "not in the target")]
    entries += [(colour, meaning) for colour, _, meaning in without_colour(result.part)]
    if state.below is not None:
        entries.append((PALE, f"coverage {state.below:g} % or more"))
    return [(SONOTRODE, "sonotrode"), *entries] if state.chamber else entries


def _eye(result: OpenedResult, state: ViewState) -> np.ndarray:
    """Return the direction to the eye: as wanted, or in front of the chosen triangle."""
    if state.eye is not None:
        return np.array(state.eye)
    if state.triangle is None or state.triangle >= result.surface.n_cells:
        return view_of_target(result.part.whole)
    corners = result.surface.points[result.surface.regular_faces[state.triangle]]
    return unit_normals(corners) + np.array([0.2, -0.3, 0.1])


def view_of_target(target: Surface) -> np.ndarray:
    """Return a direction to the eye from which much of the target is seen.

    From a little above, where the chamber's edge hides least, unless twice as much of the target is
    seen from below.
    """
    above, below = np.array(DEFAULT_VIEW), np.array(DEFAULT_VIEW) * [1.0, 1.0, -STEEPER_BELOW]
    area, normal = np.asarray(target["area"]), np.asarray(target.face_normals)
    from_above, from_below = (
        float(area @ np.maximum(normal @ eye, 0.0)) / float(np.linalg.norm(eye))
        for eye in (above, below)
    )
    return below if from_below > 2.0 * from_above else above


def _cut(actors: Sequence[Any], cut: Plane, result: OpenedResult) -> None:
    """Cut away what lies on the normal's side of a plane."""
    normal, origin = cut
    point = result.chamber.center if origin is None else origin
    plane = pyvista().core.utilities.helpers.generate_plane(-np.array(normal), point)
    for actor in actors:
        actor.mapper.AddClippingPlane(plane)


def _bounds(result: OpenedResult, state: ViewState) -> np.ndarray:
    """Return bounds (3, 2) [mm] of what is drawn, or of the target if the chamber is not."""
    if not state.chamber:
        return np.reshape(result.part.whole.bounds, (3, 2))
    boxes = (np.reshape(one.bounds, (3, 2)) for one in (result.surface, result.chamber))
    return _union(*boxes)


def _union(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the box round two boxes, (3, 2) each."""
    low, high = np.minimum(one[:, 0], other[:, 0]), np.maximum(one[:, 1], other[:, 1])
    return np.stack([low, high], axis=1)

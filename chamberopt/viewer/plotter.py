"""Draw the views of `chamberopt inspect`, one for each result, as a ViewState says."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.design.shape_surface import is_sonotrode
from chamberopt.geometry.triangles import unit_normals
from chamberopt.pictures import overlay
from chamberopt.pictures.actors import (
    DARK,
    PALE,
    add_chamber,
    add_part,
    add_section,
    body_meanings,
    colour_meanings,
    light,
)
from chamberopt.pictures.camera import (
    Room,
    cells_of,
    chamber_view,
    directions,
    fit_camera,
    near_directions,
    near_views,
    seen_area,
    target_in_chamber,
)
from chamberopt.pictures.charts.colours import PART_GREY, zone_colour
from chamberopt.pictures.drawn_part import beyond
from chamberopt.pictures.quantities import QUANTITIES
from chamberopt.results.vtp_files import pyvista, size_text
from chamberopt.viewer.opened_result import (
    OpenedResult,
    colour_limits,
    common_quantities,
    same_part,
)
from chamberopt.viewer.view_state import KEYS, ViewState

MAX_RESULTS = 6
VIEW_SIZES = {1: (1400, 900), 2: (1000, 900), 3: (800, 800), 4: (900, 700)}  # by number of results
SMALLEST_VIEW = (700, 650)  # for larger numbers of results
SCREEN = (1500, 850)  # pixels; a window of this size fits on most screens
LEFT, RIGHT, BELOW = 20, 150, 90  # pixels for colour bar, legend and so on
CHART = 0.37  # share of a view's width, for the chart of a triangle
TRIAD = 0.86, 0.0, 1.0, 0.2  # shares of a view
LEGEND, BESIDE_CHART, BESIDE_SLIDER = 0.84, 0.6, 0.4  # shares of a view's width, for its legend
PIN_LENGTH = 0.06  # length of the mark on a triangle, over the target's size


class ResultPlotter:
    """Draws several results with pyvista, each in a view (a part of the window) of its own.

    Attributes:
        plotter: the plotter of pyvista.
        results: the shown results.
        linked: true if the views turn together, because they show the same part.
        quantities: names of the quantities that all results have.
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
            results: results to show, at most MAX_RESULTS.
            off_screen: true to draw without a window.
            size: size of each view [pixels]; by default it depends on the number of results.
            menu: true to write which key shows which quantity.
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
        for number in range(len(results)):
            self._select_view(number)
            self.plotter.add_axes(line_width=2, viewport=TRIAD, color=DARK)
        self._seen: dict[tuple[int, bool], np.ndarray] = {}
        self._actors: list[set[str]] = [set() for _ in results]  # names of the actors in each view

    def draw(self, state: ViewState) -> None:
        """Draw all views with the quantity, time, cut and so on of a state; the cameras stay.

        Raises InputError if a result cannot show the state.
        """
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
        """Point the camera of each view at everything that is drawn there.

        All cameras look the same way if the views show the same part.
        """
        groups = [self.results] * len(self.results) if self.linked else [[r] for r in self.results]
        eye = None
        for number, group in enumerate(groups):
            self._select_view(number)
            eye = eye if self.linked and eye is not None else self._eye(group, state)
            points = np.concatenate([_points(one, state) for one in group])
            fit_camera(self.plotter, points, eye, self.view_size(), self._room(number, state))
        if self.linked:
            self.plotter.link_views()

    def _room(self, number: int, state: ViewState) -> Room:
        """Return how much to keep free for text at each side of a view [pixels].

        The text is the title, the colour bar or chart, the legend and the values of a triangle.
        """
        size, left, right = self.view_size(), LEFT, RIGHT
        if state.triangle is not None and state.view in (None, number):
            left, right = (int(one * size[0]) for one in (overlay.NUMBERS, CHART))
        of_menu = 3 * ["menu"] if self.menu else []
        title = "\n".join([self.results[number].info.title, *of_menu])
        return Room(left, right, BELOW, overlay.title_height(title, size))

    def _eye(self, results: Sequence[OpenedResult], state: ViewState) -> np.ndarray:
        """Return the direction from the part to the eye.

        It is the direction in the state. If this is None, the eye faces the chosen triangle. If
        there is no such triangle either, it is the direction that shows most of the targets.
        """
        if state.eye is not None:
            return np.array(state.eye)
        first = results[0]
        if state.triangle is not None and state.triangle < first.surface.n_cells:
            corners = first.surface.points[first.surface.regular_faces[state.triangle]]
            return np.asarray(unit_normals(corners) + np.array([0.2, -0.3, 0.1]))
        target = target_in_chamber(first.surface)[0]
        eyes = directions(steep=False) if state.chamber else near_directions(target)
        seen = np.hstack([self._seen_area(one, state.chamber, eyes) for one in results])
        return chamber_view(seen, eyes) if state.chamber else near_views(seen, eyes)[0]

    def _seen_area(self, result: OpenedResult, chamber: bool, eyes: np.ndarray) -> np.ndarray:
        """Return the area of each patch of a result's target that is visible from each direction.

        A patch is a group of triangles that face the same way. The area is computed once for each
        result.

        Args:
            chamber: True if the sonotrode may hide the target.
            eyes: unit vectors to the eye, (e, 3).
        """
        key = self.results.index(result), chamber
        if key not in self._seen:
            target, *hiding = target_in_chamber(result.surface)
            if chamber:
                chosen = is_sonotrode(np.asarray(result.chamber["tag"]))
                hiding.append(cells_of(result.chamber, chosen))
            self._seen[key] = seen_area(target, hiding, eyes)
        return self._seen[key]

    def pick_triangle(self, x: float, y: float) -> tuple[int, int] | None:
        """Return the number of the view, and of the triangle at a point of the window [pixels].

        The result is None if no part is drawn at the point.
        """
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
        """Return the width and height of one view [pixels]."""
        width, height = self.plotter.window_size
        return width // self.shape[1], height // self.shape[0]

    def _select_view(self, number: int) -> None:
        self.plotter.subplot(*divmod(number, self.shape[1]))

    def _clear_view(self, number: int) -> None:
        plotter, renderer = self.plotter, self.plotter.renderer
        if _bar_name(number) in plotter.scalar_bars:
            plotter.remove_scalar_bar(_bar_name(number), render=False)
        for name in self._actors[number]:  # handles and the holder of the charts stay
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
            normal, origin = state.cut
            origin = result.chamber.center if origin is None else origin
            _cut(actors if state.cut_part else actors[len(part_actors) :], normal, origin)
            if state.chamber:
                cut_part = result.surface if state.cut_part else None
                add_section(plotter, result.chamber, cut_part, normal, origin)
        lines: list[str] = []
        speed = np.zeros(0)
        if state.triangle is not None and state.view in (None, number):
            lines, speed = _triangle_lines(result, state.triangle, state)
            corners = result.surface.points[result.surface.regular_faces[state.triangle]]
            overlay.mark_triangle(plotter, corners, PIN_LENGTH * result.part.whole.length)
        overlay.show_margins(plotter, self._room(number, state), size)
        title = result.info.title
        if self.menu and number == 0:
            menu = _menu(self.quantities, state)
            title += "\n" + overlay.wrap(menu, 0.6 * size[0], overlay.fonts(size)[1])
        overlay.show_title(plotter, title, lines, size)
        quantity = QUANTITIES[state.quantity]
        if quantity.name != "zones":
            bar = part_actors[0], _bar_name(number)
            ends = beyond([result.part], limits)
            overlay.show_colour_bar(plotter, quantity, limits, ends, *bar, size)
        share = BESIDE_SLIDER if self.menu else BESIDE_CHART if lines else LEGEND
        wide = int(share * size[0])
        remarks = _remarks(result, state, pale)
        overlay.show_legend(plotter, _legend(result, state), remarks, size, wide)
        self._actors[number] = set(plotter.renderer.actors) - before
        if len(speed):
            overlay.show_histogram(plotter, speed)
            plotter.hide_axes()
        else:
            plotter.show_axes()


def _bar_name(number: int) -> str:
    """Return a name for a view's colour bar: blanks, as VTK writes the name and needs it unique."""
    return " " * (number + 1)


def _menu(names: Sequence[str], state: ViewState) -> str:
    """Return a line that says which key shows which quantity; the shown quantity is in brackets."""
    keys = [
        f"[{key} {name}]" if name == state.quantity else f"{key} {name}"
        for key, name in enumerate(QUANTITIES, 1)
        if name in names
    ]
    return "  ".join([*keys, "h keys"])


def _triangle_lines(
    result: OpenedResult, triangle: int, state: ViewState
) -> tuple[list[str], np.ndarray]:
    """Return lines of text with a triangle's values, and the speeds (k,) of its impacts [m/s]."""
    return result.describe_triangle(triangle, state), result.hits.of(triangle).speed


def _remarks(result: OpenedResult, state: ViewState, pale: np.ndarray | None) -> list[str]:
    """Return remarks to write in a view: size of the part, shown time, area below the threshold.

    Args:
        pale: marks of the triangles whose coverage reaches the threshold `state.below`.
    """
    quantity, part = QUANTITIES[state.quantity], result.part
    remarks = [f"part {size_text(result.surface)}"]
    if state.chamber:
        remarks.append(f"chamber {size_text(result.chamber)}")
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
    """Return the legend of a view: colours that are not on the colour bar, with meanings."""
    bodies = body_meanings([result.chamber]) if state.chamber else []
    if state.quantity == "zones":
        zones = [(zone_colour(k), name) for k, name in enumerate(result.info.zones)]
        return [*bodies, *zones, (PART_GREY, "in no zone")]
    pale = [] if state.below is None else [(PALE, f"coverage {state.below:g} % or more")]
    return [*bodies, *colour_meanings([result.part]), *pale]


def _cut(actors: Sequence[Any], normal: Any, origin: Any) -> None:
    """Cut away one side of a plane from VTK actors: the side to which the plane's normal points."""
    plane = pyvista().core.utilities.helpers.generate_plane(-np.array(normal), origin)
    for actor in actors:
        actor.mapper.AddClippingPlane(plane)


def _points(result: OpenedResult, state: ViewState) -> np.ndarray:
    """Return the points that a view has to show [mm], shape (k, 3).

    They are the points of part and chamber, or of the target alone if the chamber is not drawn.
    """
    if not state.chamber:
        return np.asarray(result.part.whole.points)
    return np.concatenate([result.surface.points, result.chamber.points])

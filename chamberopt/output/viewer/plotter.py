"""The views of inspect, one a result: all that is in a plotter follows from one ViewState."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.triangles import unit_normals
from chamberopt.output.viewer import overlay
from chamberopt.output.viewer.actors import (
    GREY,
    PALE,
    SONOTRODE,
    add_chamber,
    light,
    target_and_rest,
)
from chamberopt.output.viewer.opened_result import OpenedResult, limits, offered, same_part
from chamberopt.output.viewer.view_state import FROM, KEYS, Vector, ViewState
from chamberopt.output.vtp_files import Surface, pyvista
from chamberopt.simulation.triangle_fields import QUANTITIES

MOST = 6
PER_VIEW = {
    1: (1400, 900),
    2: (1000, 900),
    3: (800, 800),
    4: (900, 700),
}  # pixels, by the number of results
VIEW_ANGLE = 30.0  # degrees
BELOW = 2.0  # times as steep as from above: past the sonotrode
SCREEN = 1500, 850  # pixels: a window no larger fits on most


class ResultPlotter:
    """A plotter with a view for each result. size: pixels of each · menu: whether the keys of quantities are listed."""

    def __init__(
        self,
        seen: Sequence[OpenedResult],
        off_screen: bool,
        size: tuple[int, int] | None = None,
        menu: bool = False,
    ) -> None:
        self.menu = menu
        if len(seen) > MOST:
            raise InputError(
                f"inspect: {len(seen)} results cannot be told apart in one window; give at most {MOST}"
            )
        self.seen = list(seen)
        rows = 2 if len(seen) > 3 else 1
        self.shape = rows, -(-len(seen) // rows)
        wide, high = size or PER_VIEW.get(len(seen), (700, 650))
        if menu:
            wide, high = min(wide, SCREEN[0] // self.shape[1]), min(high, SCREEN[1] // rows)
        whole = [wide * self.shape[1], high * self.shape[0]]
        self.plotter = pyvista().Plotter(
            off_screen=off_screen, shape=self.shape, window_size=whole, border=len(seen) > 1
        )
        self.plotter.enable_anti_aliasing("msaa", multi_samples=8)  # not ssaa: it moves charts
        self.linked = same_part(seen)
        self.drawn: list[set[str]] = [set() for _ in seen]
        self.offered = offered(seen)

    def draw(self, look: ViewState) -> None:
        """Everything anew; only the cameras stay as they are. InputError where a result does not have what is asked."""
        scale = limits(self.seen, look)
        for number, one in enumerate(self.seen):
            self._at(number)
            self._clear(number)
            self._draw_one(number, one, look, scale)
        if look.keys:
            self._at(0)
            overlay.keys(self.plotter, KEYS, self.size())
            self.drawn[0].add("keys")

    def aim(self, look: ViewState) -> None:
        """Point the cameras, all the same way, at all there is to see."""
        boxes = [_box(one, look) for one in self.seen]
        for number, one in enumerate(self.seen):
            self._at(number)
            box = reduce(_both, boxes) if self.linked else boxes[number]
            eye, middle = _eye(one, look), box.mean(axis=1)
            up = (0.0, 1.0, 0.0) if abs(eye[2]) > 0.99 * np.linalg.norm(eye) else (0.0, 0.0, 1.0)
            self.plotter.camera_position = [tuple(middle + eye), tuple(middle), up]
            self.plotter.camera.view_angle = VIEW_ANGLE  # zooming narrows it, each time again
            self.plotter.reset_camera(bounds=box.ravel().tolist())
            self.plotter.camera.zoom(1.15)
        if self.linked:
            self.plotter.link_views()

    def row_picked(self, x: float, y: float) -> tuple[int, int] | None:
        """(view, triangle) under a point of the window [pixels], None beside the part."""
        import vtk

        renderer = self.plotter.iren.get_poked_renderer(x, y)
        number = [*self.plotter.renderers].index(renderer)
        picker = vtk.vtkCellPicker()
        picker.SetTolerance(1e-4)
        picker.Pick(x, y, 0.0, renderer)
        if picker.GetCellId() < 0 or number >= len(self.seen):
            return None
        return number, int(pyvista().wrap(picker.GetDataSet())["row"][picker.GetCellId()])

    def size(self) -> tuple[int, int]:
        """Pixels of one view."""
        wide, high = self.plotter.window_size
        return wide // self.shape[1], high // self.shape[0]

    def _at(self, number: int) -> None:
        self.plotter.subplot(*divmod(number, self.shape[1]))

    def _clear(self, number: int) -> None:
        plotter, renderer = self.plotter, self.plotter.renderer
        if overlay.bar_name(number) in plotter.scalar_bars:
            plotter.remove_scalar_bar(overlay.bar_name(number), render=False)
        for name in self.drawn[number]:  # not handles, and not what holds the charts
            renderer.remove_actor(name, reset_camera=False, render=False)
        if renderer.has_charts:
            plotter.remove_chart(0)

    def _draw_one(
        self, number: int, one: OpenedResult, look: ViewState, scale: tuple[float, float]
    ) -> None:
        plotter, size, quantity = self.plotter, self.size(), QUANTITIES[look.quantity]
        shown = look.triangle if look.view in (None, number) else None
        before = set(plotter.renderer.actors)
        lines: list[str] = []
        light(plotter)
        passed = one.passed(look)
        actors = target_and_rest(plotter, one.part, scale, passed)
        if look.chamber:
            faces, walls = add_chamber(plotter, one.chamber)
            actors += [*faces.values(), *walls]
        if look.cut is not None:
            kept = actors if look.cut_part else actors[2:]
            _cut(kept, look.cut, one)
        speed = np.zeros(0)
        if shown is not None:
            lines, speed = _told(one, shown, look)
            corners = one.surface.points[one.surface.regular_faces[shown]]
            overlay.mark(plotter, corners, 0.06 * one.part.target.length)
        words = one.subject.title
        if self.menu and number == 0:
            words += "\n" + overlay.wrapped(
                _menu(self.offered, look), 0.6 * size[0], overlay.fonts(size)[1]
            )
        overlay.title(plotter, words, lines, size)
        overlay.bar(plotter, quantity, scale, actors[0], number, size)
        overlay.legend(plotter, _colours(one, look), _remarks(one, look, passed), size)
        self.drawn[number] = set(plotter.renderer.actors) - before
        if len(speed):
            overlay.histogram(plotter, speed)


def _menu(names: Sequence[str], look: ViewState) -> str:
    """The keys of the quantities, the one that is shown in brackets."""
    keys = [f"{key} {name}" for key, name in enumerate(QUANTITIES, 1) if name in names]
    return (
        "  ".join(f"[{key}]" if key.endswith(f" {look.quantity}") else key for key in keys)
        + "  h keys"
    )


def _told(one: OpenedResult, triangle: int, look: ViewState) -> tuple[list[str], np.ndarray]:
    """What is said of a triangle, and its impact speeds (k,) [m/s]."""
    lines = one.numbers(triangle, look)
    if one.hits is None:
        return [*lines, "impact speeds: not kept in this result"], np.zeros(0)
    return lines, one.hits.of(triangle).speed


def _remarks(one: OpenedResult, look: ViewState, passed: np.ndarray) -> list[str]:
    """What the colours do not say."""
    quantity, remarks = QUANTITIES[look.quantity], []
    if quantity.name == "coverage" or quantity.grows:
        at = one.subject.treatment_s if look.time_s is None else look.time_s
        remarks.append(
            f"after {at:.4g} s" + (" (the treatment)" if at == one.subject.treatment_s else "")
        )
    if look.below is not None:
        area = np.asarray(one.part.target["exposed_area_mm2"])
        remarks.append(
            f"below {look.below:g} %: {100.0 * area[~passed].sum() / area.sum():.1f} % of the area"
        )
    if one.part.coverage_reach and (quantity.name == "coverage" or look.below is not None):
        remarks.append(
            f"coverage averaged over {one.part.coverage_reach:.1f} mm around each triangle: few dents"
        )
    return remarks


def _colours(one: OpenedResult, look: ViewState) -> list[tuple[str, str]]:
    """(colour, meaning) of what is no quantity."""
    grey = "not in the target" + (
        ", or no such impact" if np.isnan(one.part.target["shown"]).any() else ""
    )
    entries = [(GREY, grey)]
    if look.below is not None:
        entries.append((PALE, f"coverage {look.below:g} % or more"))
    return [(SONOTRODE, "sonotrode"), *entries] if look.chamber else entries


def _eye(one: OpenedResult, look: ViewState) -> np.ndarray:
    """Where it is seen from: in front of the triangle that is asked about, if any."""
    if look.eye is not None or look.triangle is None or look.triangle >= one.surface.n_cells:
        return where_the_target_is_seen(one.part.target) if look.eye is None else np.array(look.eye)
    corners = one.surface.points[one.surface.regular_faces[look.triangle]]
    return unit_normals(corners) + np.array([0.2, -0.3, 0.1])


def where_the_target_is_seen(target: Surface) -> np.ndarray:
    """From a little above, where the rim of the chamber hides least, unless twice as much is to be seen from below."""
    above, below = np.array(FROM), np.array(FROM) * [1.0, 1.0, -BELOW]
    area, normal = np.asarray(target["exposed_area_mm2"]), np.asarray(target.cell_normals)
    seen = [
        float(area @ np.maximum(normal @ eye, 0.0)) / float(np.linalg.norm(eye))
        for eye in (above, below)
    ]
    return below if seen[1] > 2.0 * seen[0] else above


def _cut(actors: Sequence[Any], cut: tuple[Vector, Vector | None], one: OpenedResult) -> None:
    """Take away what lies on the normal's side."""
    normal, origin = cut
    point = one.chamber.center if origin is None else origin
    plane = pyvista().core.utilities.helpers.generate_plane(-np.array(normal), point)
    for actor in actors:
        actor.mapper.AddClippingPlane(plane)


def _box(one: OpenedResult, look: ViewState) -> np.ndarray:
    """Bounds (3, 2) [mm] of all there is to see: of the target alone where no chamber is drawn."""
    if not look.chamber:
        return np.reshape(one.part.target.bounds, (3, 2))
    return _both(np.reshape(one.surface.bounds, (3, 2)), np.reshape(one.chamber.bounds, (3, 2)))


def _both(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The box round two boxes."""
    return np.stack(
        [np.minimum(one[:, 0], other[:, 0]), np.maximum(one[:, 1], other[:, 1])], axis=1
    )

"""Open the window of `chamberopt inspect`, with keys, slider and clicks, or write its picture."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from chamberopt.common.errors import InputError
from chamberopt.common.files import claim_file
from chamberopt.pictures.actors import DARK
from chamberopt.pictures.quantities import QUANTITIES
from chamberopt.pictures.subprocess_drawing import (
    draw_in_subprocess,
    picture_path,
    write_screenshot,
)
from chamberopt.viewer.opened_result import OpenedResult, ResultInfo
from chamberopt.viewer.plotter import ResultPlotter
from chamberopt.viewer.view_state import ViewState, state_after_key

HANDLED_KEYS = "123456789bcxgurh"
MAX_CLICK_MOTION = 4  # pixels that the mouse may move between press and release


def inspect(
    infos: Sequence[ResultInfo], state: ViewState, screenshot: str | Path | None = None
) -> None:
    """Show results in a window, or write a picture of the window.

    Args:
        infos: the results to show.
        state: what the window shows first.
        screenshot: .png file to write; no window is opened then.
    Raises:
        InputError: a result's files are missing, damaged or from another result, a result lacks a
            wanted quantity, or there is no display.
    """
    if screenshot is not None:
        job = {"results": infos, "state": state}
        with claim_file(picture_path(screenshot)) as path:
            skipped = draw_in_subprocess(render_inspect, job, path)
        if skipped:
            raise InputError(skipped)
        return
    on_linux = sys.platform.startswith("linux")
    if on_linux and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise InputError(
            "inspect: there is no display to open a window on; write a picture: --screenshot "
            "FILE.png"
        )
    Window(open_results(infos, state), state).run()


def render_inspect(job: dict[str, Any]) -> None:
    """Draw the content of the window into a picture; this runs in a child process."""
    state = job["state"]
    view = ResultPlotter(open_results(job["results"], state), off_screen=True)
    view.draw(state)
    view.aim(state)
    write_screenshot(view.plotter, job["picture"])


def open_results(infos: Sequence[ResultInfo], state: ViewState) -> list[OpenedResult]:
    """Open results and colour their parts by the quantity in the state.

    Raises InputError if a result cannot show the state.
    """
    results = [OpenedResult(one) for one in infos]
    for one in results:
        one.show(state)
        if state.triangle is not None:
            one.describe_triangle(state.triangle, state)
    return results


class Window:
    """A window with results. Keys, slider, cutting plane and clicks change what it shows."""

    def __init__(
        self, results: Sequence[OpenedResult], state: ViewState, off_screen: bool = False
    ) -> None:
        self.view = ResultPlotter(results, off_screen, menu=True)
        self.first = self.state = state
        self.slider: Any = None
        self.plane: Any = None
        self._pressed_at = (0, 0)
        self.view.draw(state)
        self.view.aim(state)
        self._update_handles()

    def run(self) -> None:
        """Show the window, and return when it is closed."""
        plotter, iren = self.view.plotter, self.view.plotter.iren
        iren.clear_key_event_callbacks()
        for key in HANDLED_KEYS:
            plotter.add_key_event(key, lambda key=key: self.press_key(key))
        # Only q stays of VTK's own keys. Others would act beside the window's keys.
        iren.style.AddObserver(
            "CharEvent",
            lambda style, _: style.OnChar() if iren.interactor.GetKeySym() == "q" else 0,
        )
        iren.add_observer("LeftButtonPressEvent", lambda *_: self._on_mouse_press())
        iren.add_observer("LeftButtonReleaseEvent", lambda *_: self._on_mouse_release())
        plotter.show(title="chamberopt inspect")

    def change(self, state: ViewState) -> None:
        """Show another quantity, time, cut and so on, as `state` says.

        If a result cannot show the state, print why and keep the present state.
        """
        before, self.state = self.state, state
        try:
            self.view.draw(state)
        except InputError as error:
            print(error, file=sys.stderr)
            self.state = before
            self.view.draw(before)
        self._update_handles()
        self.view.plotter.render()

    def press_key(self, key: str) -> None:
        if key == "r":
            self._remove_handles()
        self.change(state_after_key(self.state, key, self.first, self.view.quantities))
        if key in "rg":
            self.view.aim(self.state)
            self.view.plotter.render()

    def set_time(self, seconds: float) -> None:
        """Show the peening time [s] at which the time slider was released."""
        if seconds != self._seconds():
            self.change(replace(self.state, time_s=seconds))

    def select_triangle(self, view: int, triangle: int) -> None:
        """Show the values of a clicked triangle.

        The values appear in all views if these show the same part, else only in the clicked view.
        """
        view_shown = None if self.view.linked else view
        self.change(replace(self.state, triangle=triangle, view=view_shown))

    def move_plane(self, normal: Sequence[float], origin: Sequence[float]) -> None:
        """Cut the chamber open where the user released the cutting plane."""
        if self.state.cut is not None:
            self.change(replace(self.state, cut=(tuple(normal), tuple(origin))))  # type: ignore[arg-type]

    def _on_mouse_press(self) -> None:
        self._pressed_at = self.view.plotter.iren.get_event_position()

    def _on_mouse_release(self) -> None:
        x, y = self.view.plotter.iren.get_event_position()
        if abs(x - self._pressed_at[0]) + abs(y - self._pressed_at[1]) > MAX_CLICK_MOTION:
            return
        found = self.view.pick_triangle(x, y)
        if found is not None:
            self.select_triangle(*found)

    def _seconds(self) -> float:
        """Return the shown peening time [s].

        If each result shows its own treatment time, it is the treatment time of the first result.
        """
        time = self.state.time_s
        return self.view.results[0].info.treatment_s if time is None else time

    def _update_handles(self) -> None:
        """Show the time slider if time matters, and the cutting plane if there is a cut."""
        results, plotter = self.view.results, self.view.plotter
        quantity = QUANTITIES[self.state.quantity]
        timed = quantity.grows or quantity.name == "coverage"
        if timed and self.slider is None:
            # VTK measures the slider's place from the window's corner, so the view there has it.
            plotter.subplot(self.view.shape[0] - 1, 0)
            self.slider = plotter.add_slider_widget(
                self.set_time, (0.0, max(one.info.longest_s for one in results)),
                value=self._seconds(), title="time [s]", color=DARK, fmt="%.4g",
                pointa=(0.42, 0.06), pointb=(0.6, 0.06), title_height=0.018, slider_width=0.03,
                tube_width=0.005,
            )  # fmt: skip
        if self.slider is not None:
            self.slider.GetRepresentation().SetValue(self._seconds())
            self.slider.SetEnabled(timed)
        if self.state.cut is not None and self.plane is None:
            normal, origin = self.state.cut
            chamber = results[0].chamber
            plotter.subplot(0, 0)
            self.plane = plotter.add_plane_widget(
                self.move_plane, normal=normal, bounds=chamber.bounds, factor=1.0, color=DARK,
                origin=chamber.center if origin is None else origin, test_callback=False,
                outline_opacity=0.0,
            )  # fmt: skip
        if self.state.cut is None and self.plane is not None:
            plotter.clear_plane_widgets()
            self.plane = None

    def _remove_handles(self) -> None:
        self.view.plotter.clear_slider_widgets()
        self.view.plotter.clear_plane_widgets()
        self.slider = self.plane = None

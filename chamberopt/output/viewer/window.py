"""Results in a window of their own, whose keys and handles change one ViewState; or as a picture of it."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from chamberopt.common.errors import InputError
from chamberopt.common.files import atomic_write
from chamberopt.output.viewer.actors import DARK
from chamberopt.output.viewer.opened_result import OpenedResult, ResultInfo
from chamberopt.output.viewer.plotter import ResultPlotter
from chamberopt.output.viewer.subprocess_drawing import draw_in_subprocess, picture_path
from chamberopt.output.viewer.view_state import ViewState, pressed
from chamberopt.simulation.triangle_fields import QUANTITIES

HANDLED = "12345678bcxgurh"
STILL = 4  # pixels that the mouse may move in a click


def inspect(
    subjects: Sequence[ResultInfo], look: ViewState, screenshot: str | Path | None = None
) -> None:
    """Turn the parts in their chambers with the mouse; or, with `screenshot`, write a picture without a window.

    Raises InputError when a folder has no coverage or another's, lacks what is asked, or there is no display.
    """
    if screenshot is not None:
        job = {
            "draw": "inspect",
            "subjects": [asdict(one) for one in subjects],
            "look": asdict(look),
        }
        trouble = draw_in_subprocess(job, picture_path(screenshot))
        if trouble:
            raise InputError(trouble)
        return
    on_linux = sys.platform.startswith("linux")
    if on_linux and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise InputError(
            "inspect: there is no display to open a window on; write a picture: --screenshot FILE.png"
        )
    Window(opened(subjects, look), look).run()


def render_inspect(job: dict[str, Any]) -> None:
    """What a drawing process does of it: the picture that the window would show."""
    look = ViewState.from_json(job["look"])
    stage = ResultPlotter(
        opened([ResultInfo(**one) for one in job["subjects"]], look), off_screen=True
    )
    stage.draw(look)
    stage.aim(look)
    with atomic_write(Path(job["picture"])) as temporary:
        stage.plotter.screenshot(temporary)


def opened(subjects: Sequence[ResultInfo], look: ViewState) -> list[OpenedResult]:
    """The results, each of which has what is looked at. InputError where one does not."""
    seen = [OpenedResult(one) for one in subjects]
    for one in seen:
        one.show(look)
        if look.triangle is not None:
            one.numbers(look.triangle, look)
    return seen


class Window:
    """A stage on the screen, and the look that its keys, slider, plane and clicks change."""

    def __init__(
        self, seen: Sequence[OpenedResult], look: ViewState, off_screen: bool = False
    ) -> None:
        self.stage = ResultPlotter(seen, off_screen, menu=True)
        self.first = self.look = look
        self.slider: Any = None
        self.plane: Any = None
        self._down = (0, 0)
        self.stage.draw(look)
        self.stage.aim(look)
        self._handles()

    def run(self) -> None:
        """Until it is closed."""
        plotter, iren = self.stage.plotter, self.stage.plotter.iren
        iren.clear_key_event_callbacks()
        for key in HANDLED:
            plotter.add_key_event(key, lambda key=key: self.pressed(key))
        # Of VTK's own keys only those that quit: the others would act beside ours.
        iren.style.AddObserver(
            "CharEvent",
            lambda style, _: style.OnChar() if iren.interactor.GetKeySym() == "q" else 0,
        )
        iren.add_observer("LeftButtonPressEvent", lambda *_: self._press())
        iren.add_observer("LeftButtonReleaseEvent", lambda *_: self._release())
        plotter.show(title="chamberopt inspect")

    def change(self, look: ViewState) -> None:
        """Another look; one that a result cannot give leaves the present one."""
        before, self.look = self.look, look
        try:
            self.stage.draw(look)
        except InputError as error:
            print(error, file=sys.stderr)
            self.look = before
            self.stage.draw(before)
        self._handles()
        self.stage.plotter.render()

    def pressed(self, key: str) -> None:
        """A key."""
        if key == "r":
            self._remove_handles()
        self.change(pressed(self.look, key, self.first, self.stage.offered))
        if key in "rg":
            self.stage.aim(self.look)
            self.stage.plotter.render()

    def slid(self, seconds: float) -> None:
        """The time slider, let go at so many seconds."""
        if seconds != self._seconds():
            self.change(replace(self.look, time_s=seconds))

    def clicked(self, view: int, triangle: int) -> None:
        """A triangle, in all views of the same part."""
        self.change(replace(self.look, triangle=triangle, view=None if self.stage.linked else view))

    def cut(self, normal: Sequence[float], origin: Sequence[float]) -> None:
        """The plane, let go somewhere."""
        if self.look.cut is not None:
            self.change(replace(self.look, cut=(tuple(normal), tuple(origin))))  # type: ignore[arg-type]

    def _press(self) -> None:
        self._down = self.stage.plotter.iren.get_event_position()

    def _release(self) -> None:
        x, y = self.stage.plotter.iren.get_event_position()
        if abs(x - self._down[0]) + abs(y - self._down[1]) > STILL:
            return
        found = self.stage.row_picked(x, y)
        if found is not None:
            self.clicked(*found)

    def _seconds(self) -> float:
        """The time that is shown: of the first result, where each shows its own treatment's."""
        return (
            self.stage.seen[0].subject.treatment_s if self.look.time_s is None else self.look.time_s
        )

    def _handles(self) -> None:
        """The slider where time changes what is shown, and the plane where something is cut."""
        seen, plotter = self.stage.seen, self.stage.plotter
        coverage, quantity = self.look.quantity == "coverage", QUANTITIES[self.look.quantity]
        timed = (coverage and not any(one.part.marked for one in seen)) or quantity.grows
        if timed and self.slider is None:
            plotter.subplot(
                self.stage.shape[0] - 1, 0
            )  # the view at the window's corner, which VTK measures from
            self.slider = plotter.add_slider_widget(
                self.slid, (0.0, max(one.subject.longest_s for one in seen)), value=self._seconds(), title="time [s]",
                color=DARK, pointa=(0.42, 0.06), pointb=(0.6, 0.06), fmt="%.4g", title_height=0.018,
                slider_width=0.03, tube_width=0.005,
            )  # fmt: skip
        if self.slider is not None:
            self.slider.GetRepresentation().SetValue(self._seconds())
            self.slider.SetEnabled(timed)
        if self.look.cut is not None and self.plane is None:
            normal, origin = self.look.cut
            plotter.subplot(0, 0)
            self.plane = plotter.add_plane_widget(
                self.cut, normal=normal, origin=seen[0].chamber.center if origin is None else origin, color=DARK,
                bounds=seen[0].chamber.bounds, factor=1.0, test_callback=False, outline_opacity=0.0,
            )  # fmt: skip
        if self.look.cut is None and self.plane is not None:
            plotter.clear_plane_widgets()
            self.plane = None

    def _remove_handles(self) -> None:
        self.stage.plotter.clear_slider_widgets()
        self.stage.plotter.clear_plane_widgets()
        self.slider = self.plane = None

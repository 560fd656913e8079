"""Show the steps and the progress of a workflow on the terminal."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from chamberopt.cli.console import print_remarks, print_warnings
from chamberopt.cli.interrupt import first_only_asks
from chamberopt.cli.prepare import compile_with_message
from chamberopt.common.progress import StoppedError, step
from chamberopt.workflows.optimise import CANDIDATES
from chamberopt.workflows.simulate import StepTeller

if TYPE_CHECKING:
    from collections.abc import Iterator

    from chamberopt.chamber.build import Chamber
    from chamberopt.cli.interrupt import Interrupt
    from chamberopt.common.progress import Progress
    from chamberopt.design.load import Design
    from sim_core import AnalyticCavity


class TerminalTeller(StepTeller):
    """Show on stderr the steps, compilation and warnings that a workflow reports."""

    def compile(self, design: Design, chamber: Chamber, cavity: AnalyticCavity | None) -> None:
        compile_with_message(design, chamber, cavity)

    def check(self, design: Design, chamber: Chamber, which: str = "") -> list[str] | None:
        return print_warnings(design, chamber, which)

    def tell(self, text: str) -> None:
        print_remarks([text])


class SimulationTeller(TerminalTeller):
    """Show a simulation on stderr. On Ctrl-C, it is ended with what is simulated by then."""

    @contextmanager
    def stoppable(self, progress: Progress) -> Iterator[Progress]:
        with first_only_asks() as is_asked:

            def tell(done: float, total: int, best: float | None) -> None:
                if is_asked():
                    raise StoppedError
                progress(done, total, best)

            yield tell


class SearchTeller(TerminalTeller):
    """Show a study on stderr. On Ctrl-C, wait for running evaluations and say how to resume it."""

    def __init__(self, interrupt: Interrupt, how_to_resume: str) -> None:
        super().__init__()
        self._interrupt, self._how_to_resume = interrupt, how_to_resume

    @contextmanager
    def step(self, what: str, total: int | None = None) -> Iterator[Progress]:
        with step(what, total) as progress:
            if what == CANDIDATES:
                self._interrupt.wait_for_evaluation(self._how_to_resume)
            yield progress

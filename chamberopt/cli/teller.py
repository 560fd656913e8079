"""The listener that tells on the terminal how a workflow goes."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from chamberopt.cli.console import print_warnings
from chamberopt.cli.prepare import compile_with_message
from chamberopt.common.progress import step
from chamberopt.workflows.simulate import Teller

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.common.progress import Progress
    from chamberopt.design.load import Design
    from sim_core import AnalyticCavity


class TerminalTeller(Teller):
    """Shows steps, compilation and warnings on stderr."""

    def step(self, what: str, total: int | None = None) -> AbstractContextManager[Progress]:
        return step(what, total)

    def compile(self, design: Design, chamber: Chamber, cavity: AnalyticCavity | None) -> None:
        compile_with_message(design, chamber, cavity)

    def check(self, design: Design, chamber: Chamber) -> list[str] | None:
        return print_warnings(design, chamber)

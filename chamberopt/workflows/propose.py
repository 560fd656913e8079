"""Propose a first design for a part. Python users and the command line share this workflow.

The design by rules of thumb comes first. Pilot simulations then choose its pose, charge, balls and
amplitude, and tell its treatment time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from chamberopt.chamber.propose.first_design import propose
from chamberopt.chamber.propose.proposed_budget import TooSlowError, measured_budget, with_budget
from chamberopt.chamber.propose.proposed_intensity import (
    as_no_wish,
    beside_larger,
    is_off,
    larger_balls,
    larger_instead,
    propose_intensity,
    usual_for,
    with_expected_intensity,
    with_thin_places,
)
from chamberopt.chamber.propose.proposed_mask import LeftOut, find_left_out
from chamberopt.chamber.propose.proposed_setting import setting_of
from chamberopt.chamber.propose.proposed_steps import (
    propose_second_pose,
    turned_over,
    with_finer_balls,
    without_finer,
)
from chamberopt.chamber.propose.quicker import Way, propose_quicker
from chamberopt.chamber.propose.text import design_text, study_texts
from chamberopt.common.errors import InputError
from chamberopt.common.executor import local_executor
from chamberopt.common.files import claim_folder, whole_or_nothing, write_text
from chamberopt.common.progress import no_steps
from chamberopt.common.toml_fields import allowed_range
from chamberopt.design.intensity import WantedIntensity
from chamberopt.design.process import Process
from chamberopt.design.shot import ShotSize
from chamberopt.peening.intensity_pilot import predict_intensity
from chamberopt.pictures.part import draw_target
from chamberopt.results.vtp_files import pyvista
from chamberopt.simulation.budget_pilot import measure_budget
from sim_core import SimulationError

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from chamberopt.chamber.propose.proposal import Proposal, Wanted
    from chamberopt.chamber.propose.proposed_budget import Measured
    from chamberopt.chamber.propose.proposed_intensity import IntensityPilot
    from chamberopt.chamber.propose.proposed_target import Surface
    from chamberopt.workflows.simulate import Teller

USUAL, NONE = "usual", "none"  # in the place of an intensity
Chooser = Callable[["Sequence[Surface]"], Sequence[str]]
DESIGN, PICTURE = "design.toml", "design.png"
# Stages of the work in their order; those between are of pilots, and the rules may skip some.
SIZES, PICTURE_OF = "reading the part and choosing sizes", "drawing the target"
TIME, WAYS = "simulating briefly, for the treatment time", "trying other poses and charges"
INTENSITY = "choosing balls and amplitude for the intensity"
FURTHER_STEP, WRITING = "trying a second pose and finer balls", "drawing and writing the proposal"
Begin = Callable[[str], None]


@dataclass(frozen=True)
class Wishes:
    """What is wished of a proposal.

    Attributes:
        geometry: wishes that rules of thumb follow.
        intensity: an Almen intensity, USUAL, NONE, or None to aim at the usual one if the alloy is
            given.
        pilot: simulate some seconds, so that times are estimates.
    """

    geometry: Wanted
    intensity: str | None = None
    pilot: bool = True

    def require_possible(self) -> None:
        """Raise InputError for wishes that are out of range or contradict each other."""
        ball_mm, coverage = self.geometry.ball_mm, self.geometry.coverage
        low, high = allowed_range(ShotSize.model_fields["diameter_mm"])
        if ball_mm is not None and not low <= ball_mm <= high:
            allowed = f"from {low:g} to {high:g} mm"
            raise InputError(f"--ball-mm: given {ball_mm:g}; allowed: {allowed}")
        low, high = allowed_range(Process.model_fields["coverage_percent"])
        if coverage is not None and not low <= coverage <= high:
            raise InputError(f"--coverage: given {coverage:g}; allowed: from {low:g} to {high:g} %")
        self.asked_intensity()
        if self.intensity == USUAL and not self.geometry.alloy:
            raise InputError("--intensity: usual follows from the alloy; give --material")
        if self.intensity not in (None, NONE) and not self.pilot:
            raise InputError("--intensity: it takes pilot runs; leave out --no-pilot")

    def asked_intensity(self) -> WantedIntensity | None:
        """Return the intensity that is asked for by its numbers. Raises InputError for others."""
        named = self.intensity in (None, USUAL, NONE)
        return None if self.intensity is None or named else WantedIntensity.parse(self.intensity)


@dataclass(frozen=True)
class Proposed:
    """A proposal that was written.

    Attributes:
        made: the proposal.
        left_out: what may be left out of its target, or is peened beside it.
        studies: names of the study files.
    """

    made: Proposal
    left_out: Sequence[LeftOut]
    studies: Sequence[str]


@contextmanager
def stages(teller: Teller, pilot: bool) -> Iterator[Begin]:
    """Yield the function that begins a stage of a proposal, and ends the one before.

    Stages are numbered, and their number never falls.

    Args:
        pilot: whether pilots are simulated.
    """
    of_pilots = (TIME, WAYS, INTENSITY, FURTHER_STEP) if pilot else ()
    order = [SIZES, PICTURE_OF, *of_pilots, WRITING]
    with ExitStack() as now:

        def begin(stage: str) -> None:
            now.close()
            number = order.index(stage) + 1
            now.enter_context(teller.step(f"step {number} of {len(order)}: {stage}"))

        yield begin


def require_file(part: Path) -> None:
    """Raise InputError unless the part is a plain file whose name can stand in a design file."""
    if not part.is_file():
        what = "is a folder" if part.is_dir() else "is no plain file"
        what = what if part.exists() else "no such file"
        raise InputError(f"{part}: {what}; give the file of the part, from CAD or a scanner")
    try:
        str(part.resolve()).encode()
    except UnicodeEncodeError:
        text = "its path is not UTF-8, so that no design can name it; rename the file or its folder"
        raise InputError(f"{part}: {text}") from None


def write_proposal(
    first: Proposal,
    path: Path,
    wishes: Wishes,
    choose: Chooser,
    out: Path,
    teller: Teller,
    workers: int | None = None,
) -> Proposed:
    """Improve a first proposal by pilots, and write its design, studies and picture into a folder.

    Raises InputError if an intensity that was asked for cannot be told.

    Args:
        out: new or empty folder.
        workers: number of threads of the pilots, by default one per core.
        first: the proposal by rules of thumb for the part at `path`, with these wishes.
        choose: picks the names of the surfaces to peen from all surfaces, as for `first`.
    """
    pyvista()  # before the folder is claimed: Ctrl-C during an import would leave the folder behind
    with ExitStack() as kept:
        folder = kept.enter_context(claim_folder(out))
        kept.enter_context(whole_or_nothing(folder))
        executor = kept.enter_context(local_executor(workers))
        begin = kept.enter_context(stages(teller, wishes.pilot))
        return _written(first, _Pilots(path, wishes, choose, executor, teller, begin), folder)


def _written(first: Proposal, pilots: _Pilots, folder: Path) -> Proposed:
    """Write what pilots make of a first proposal into a folder."""
    teller = pilots.teller
    pilots.begin(PICTURE_OF)  # before the pilots, so that it can be looked at meanwhile
    teller.tell(draw_target(first.design, first.chamber, folder / PICTURE))
    made = pilots.improve(first) if pilots.wishes.pilot else first
    pilots.begin(WRITING)
    if made.chamber is not first.chamber:
        teller.tell(draw_target(made.design, made.chamber, folder / PICTURE))
    left_out = find_left_out(made)
    write_text(folder / DESIGN, design_text(made, folder, left_out))
    studies = study_texts(made, DESIGN)
    for name, text in studies.items():
        write_text(folder / name, text)
    return Proposed(made, left_out, list(studies))


@dataclass(frozen=True)
class _Pilots:
    """Pilot simulations of proposals for the part in a file."""

    path: Path
    wishes: Wishes
    choose: Chooser
    executor: Executor
    teller: Teller
    begin: Begin

    def improve(self, first: Proposal) -> Proposal:
        """Return a proposal that pilots chose, with its treatment time and what to simulate.

        Raises InputError if an intensity that was asked for cannot be told.
        """
        quietly = partial(self._measure, is_told=False)
        self.begin(TIME)
        way = Way(first, self.wishes.geometry, self._measure(first))
        self.begin(WAYS)
        briefly = partial(quietly, is_brief=True)
        made, wanted, found = propose_quicker(way, self._again, briefly)
        if found is not None and not found.settled and made.design != first.design:
            found = quietly(made)
        why_so = {"part.rotate_deg": made.reasons["part.rotate_deg"]}  # with poses that were tried
        intensity, asked = self.wishes.intensity, self.wishes.asked_intensity()
        # A stated alloy has a usual intensity, which a proposal should not miss.
        seeks = bool(wanted.alloy and intensity is None and found and is_off(made, found.intensity))
        if intensity == USUAL or seeks:
            asked = usual_for(made)
        if asked:
            self.begin(INTENSITY)
            by_geometry = setting_of(made).ball_mm
            try:
                made = propose_intensity(made, wanted, asked, self._again, self._predict)
                found = self._measure(made)
            except InputError:  # which is no reason to stop if nobody asked
                if not seeks:
                    raise
                asked = None
        if not asked:
            if found is not None:
                made = with_expected_intensity(made, found.intensity)
            self.begin(FURTHER_STEP)
            return _in_budget(*propose_second_pose(made, found, quietly))
        made = _told(made, why_so)
        larger = larger_balls(made, wanted, asked, found, self._again, quietly)
        if larger is not None:
            larger = _told(larger[0], why_so), larger[1]
        coarse = larger or (made, found)
        if seeks:
            made, coarse = as_no_wish(made), (as_no_wish(coarse[0]), coarse[1])
        self.begin(FURTHER_STEP)
        coarse = propose_second_pose(*coarse, quietly)
        two, why = with_finer_balls(*coarse, by_geometry, quietly)
        if two is not None:
            return with_thin_places(two)
        if larger is None or found is None:
            return _in_budget(without_finer(coarse[0], why), coarse[1])
        made, after = propose_second_pose(made, found, quietly)
        both = made, after or found, coarse[0], coarse[1] or larger[1]
        if reason := larger_instead(*both, asked):
            reasons = {**coarse[0].reasons, "shot.diameter_mm": reason}
            return _in_budget(replace(coarse[0], reasons=reasons), coarse[1])
        return _in_budget(beside_larger(*both, why), after)

    def _again(self, other: Wanted) -> Proposal:
        with no_steps():  # those of the first proposal, again
            made = propose(self.path, other, self.choose)
            return turned_over(made) if other.turned_over else made

    def _measure(
        self,
        made: Proposal,
        longest: float = math.inf,
        is_told: bool = True,
        is_brief: bool = False,
    ) -> Measured | None:
        """Return what the budget of a proposal follows from; None where no pilot can tell it.

        The reason is told then, unless is_told is false. `longest` [s] and `is_brief` are those of
        `measure_budget`. Raises TooSlowError if the time to 98 % is longer.
        """
        try:
            self.teller.compile(made.design, made.chamber, None)
            with self.teller.step("pilot run") as progress:
                given = made.design, made.chamber, self.executor, progress
                return measure_budget(*given, longest, is_brief)
        except TooSlowError:
            raise
        except (InputError, SimulationError) as error:
            text = f"warning: no pilot, treatment and simulated time are starts: {error}"
            if is_told:
                self.teller.tell(text)
            return None

    def _predict(self, made: Proposal) -> IntensityPilot | None:
        """Return the intensity of a proposal; None if hardly a dent fell."""
        self.teller.compile(made.design, made.chamber, None)
        with self.teller.step("pilot run of the intensity") as progress:
            return predict_intensity(made.design, made.chamber, self.executor, progress)


def _told(made: Proposal, reasons: dict[str, str]) -> Proposal:
    """Return a proposal with these reasons in the place of its own."""
    return replace(made, reasons={**made.reasons, **reasons})


def _in_budget(made: Proposal, found: Measured | None) -> Proposal:
    """Return a proposal whose treatment time and budget follow from a pilot, if one could run."""
    made = with_thin_places(made)
    return made if found is None else with_budget(made, measured_budget(made, found))

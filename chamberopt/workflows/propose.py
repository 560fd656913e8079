"""Propose a first design for a part. Python users and the command line share this workflow.

The design by rules of thumb comes first. Pilot simulations then choose its pose, charge, balls and
amplitude, and tell its treatment time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.propose.first_design import propose, propose_alike
from chamberopt.chamber.propose.harmless_ranges import with_harmless_ranges
from chamberopt.chamber.propose.proposal import new_harm
from chamberopt.chamber.propose.proposed_budget import (
    TooSlowError,
    measured_budget,
    with_budget,
    within_room,
)
from chamberopt.chamber.propose.proposed_intensity import (
    Compared,
    as_no_wish,
    gives,
    is_off,
    larger_balls,
    larger_instead,
    of_ball_sizes,
    propose_intensity,
    settings_beside,
    usual_for,
    with_expected_intensity,
    with_prediction,
    with_thin_places,
    with_time,
    with_usual_intensity,
)
from chamberopt.chamber.propose.proposed_mask import LeftOut, find_left_out, in_setting
from chamberopt.chamber.propose.proposed_setting import setting_of, with_amplitude
from chamberopt.chamber.propose.proposed_steps import (
    is_worth_a_second_pose,
    propose_second_pose,
    turned_over,
    with_finer_balls,
    without_finer,
)
from chamberopt.chamber.propose.quicker import Way, propose_quicker, turns
from chamberopt.chamber.propose.text import design_text, study_texts
from chamberopt.common.errors import InputError
from chamberopt.common.executor import local_executor
from chamberopt.common.files import claim_folder, remove_file, whole_or_nothing, write_text
from chamberopt.common.progress import no_steps, tell_program
from chamberopt.common.toml_fields import allowed_range
from chamberopt.design.intensity import WantedIntensity
from chamberopt.design.process import Process
from chamberopt.design.shot import ShotSize
from chamberopt.peening.intensity_pilot import predict_intensity
from chamberopt.pictures.part import draw_target
from chamberopt.results.vtp_files import pyvista
from chamberopt.simulation.budget_pilot import COLLISIONS, LONGER, measure_budget, modest_time
from sim_core import SimulationError

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from chamberopt.chamber.layout.target import Surface
    from chamberopt.chamber.propose.proposal import Proposal, Wanted
    from chamberopt.chamber.propose.proposed_budget import Measured
    from chamberopt.chamber.propose.proposed_intensity import IntensityPilot
    from chamberopt.workflows.simulate import Teller

USUAL, NONE = "usual", "none"  # in the place of an intensity
Chooser = Callable[["Sequence[Surface]"], Sequence[str]]
DESIGN, PICTURE = "design.toml", "design.png"
# Stages of the work in their order; those between are of pilots, and the rules may skip some.
SIZES, PICTURE_OF = "reading the part and choosing sizes", "drawing the target"
TIME, WAYS = "simulating briefly, for the treatment time", "trying other poses and charges"
INTENSITY = "choosing balls and amplitude for the intensity"
FURTHER_STEP, WRITING = "trying balls of other sizes", "drawing and writing the proposal"
OF_POSES = "part.rotate_deg", ".steps"  # reasons that tell which poses were tried
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
        settings: names of the design files of the part's other settings, if it has any.
    """

    made: Proposal
    left_out: Sequence[LeftOut]
    studies: Sequence[str]
    settings: Sequence[str] = ()


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
            number, count = order.index(stage) + 1, len(order)
            tell_program("stage", lambda: {"number": number, "count": count, "names": order})
            now.enter_context(teller.step(f"step {number} of {count}: {stage}"))

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
    pilots.begin(PICTURE_OF)  # before the pilots: to be looked at meanwhile, or if they are killed
    write_text(folder / DESIGN, design_text(first, folder, find_left_out(first)))
    teller.tell(draw_target(first.design, first.chamber, folder / PICTURE, first.known))
    if pilots.wishes.pilot:
        made = pilots.improve(first)
    else:
        made = within_room(first, modest_time(first.design, first.chamber))
        if pilots.wishes.geometry.alloy:
            made = with_usual_intensity(made)
    pilots.begin(WRITING)
    made = with_harmless_ranges(made)
    if made.chamber is not first.chamber:
        remove_file(folder / PICTURE)  # of the first proposal
        told = draw_target(made.design, made.chamber, folder / PICTURE, made.known)
        if not (folder / PICTURE).is_file():
            teller.tell(told)
    left_out = find_left_out(made)
    write_text(folder / DESIGN, design_text(made, folder, left_out))
    studies = study_texts(made, DESIGN)
    for name, text in studies.items():
        write_text(folder / name, text)
    settings = _settings_beside(made, folder, left_out)
    for name, text in settings.items():
        write_text(folder / name, text)
    return Proposed(made, left_out, list(studies), list(settings))


def _settings_beside(made: Proposal, folder: Path, left_out: Sequence[LeftOut]) -> dict[str, str]:
    """Return the texts of the designs of a part's other settings, by file name.

    A setting that needs a chamber of its own has none: what is to be settled tells why.
    """
    texts: dict[str, str] = {}
    strips = made.strips
    if strips is None:
        return texts
    for number in (k for k in range(strips.settings) if k != strips.chosen):
        with suppress(InputError):
            other = in_setting(made, strips, number)
            build_chamber(other.design)
            head = f"# Setting {number + 1} of {strips.settings}, beside {DESIGN}, which is "
            head += f"setting {strips.chosen + 1}.\n"
            texts[f"setting_{number + 1}.toml"] = head + design_text(other, folder, left_out)
    return texts


class _Sought(NamedTuple):
    """What is sought for a part in a chosen pose.

    Attributes:
        wanted: the wishes that the pose and its sonotrodes follow from.
        asked: the intensity that is sought; None if none is.
        is_wish: somebody wished for it. Otherwise it is the usual one of a stated alloy, without
            which a proposal may do.
        reasons: which poses were tried, by dotted name.
        by_rule: diameter of the balls that geometry alone gives [mm], and the reason for them.
    """

    wanted: Wanted
    asked: WantedIntensity | None
    is_wish: bool
    reasons: dict[str, str]
    by_rule: tuple[float, str]


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

        Pilots are brief until all is chosen: only then the shot has to settle.

        Raises InputError if an intensity that was asked for cannot be told.
        """
        now, wanted, by_rule = self._chosen_way(first)
        return replace(self._improved(now, wanted, by_rule), poses=now.made.poses)

    def _improved(self, now: Compared, wanted: Wanted, by_rule: tuple[float, str]) -> Proposal:
        """Return a proposal for a chosen way, with balls, amplitude, times and budget by pilots.

        Args:
            by_rule: diameter of the balls that geometry alone gives [mm], and the reason for them.
        """
        by_geometry = by_rule[0]
        sought = self._sought(now, wanted, by_rule)
        if sought.asked:
            self.begin(INTENSITY)
            now, sought = self._with_intensity(now, sought, sought.asked)
        self.begin(FURTHER_STEP)
        now, others = self._beside(now, sought, by_geometry)
        trials, why = of_ball_sizes([now, *others]) if others else (), ""
        if asked := sought.asked:
            enough = [one for one in others if gives(asked, one.found)]
            coarse = now if gives(asked, now.found) or not enough else enough[0]
            measure = partial(self._measure, is_told=False)
            two, why = with_finer_balls(coarse.made, coarse.found, by_geometry, measure)
            if two is not None:
                return replace(with_thin_places(two), trials=trials)
        now = larger_instead(now, others, trials, sought.asked) or now
        now = now._replace(made=without_finer(now.made, why))
        found = now.found
        if found is not None and not found.settled:
            found = self._measure(now.made, is_told=False) or found
        if found is not None:
            trials = with_time(trials, setting_of(now.made).ball_mm, found)
        return replace(_in_budget(now.made, found), trials=trials)

    def _chosen_way(self, first: Proposal) -> tuple[Compared, Wanted, tuple[float, str]]:
        """Return the pose, sonotrodes and charge that peen quickest, and the wishes for them.

        Third is the diameter of the balls that geometry alone gives [mm], and the reason for them.
        """
        self.begin(TIME)
        wanted = self.wishes.geometry
        pose, fewer = first.thick_pose, first.without_fillets
        if pose or fewer:  # all proposals hold the part alike
            wanted = replace(wanted, may_leave_end=False, thick_pose=pose, without_fillets=fewer)
        by_rule = Way(first, wanted, self._measure(first, is_brief=True))
        way = self._strong_enough(by_rule)
        self.begin(WAYS)
        made, wanted, found = propose_quicker(
            way, self._each, turned_over, self._briefly, self.teller.step, self._longer
        )
        now = Compared(*propose_second_pose(made, found, self._briefly))
        over = bool(now.made.design.steps)
        is_turned, leaves_end = turns(now.made), now.made.leaves_end
        wanted = replace(
            wanted,
            ball_mm=self.wishes.geometry.ball_mm,
            turned_over=over,
            may_turn=is_turned,
            may_leave_end=leaves_end,
        )
        of_rule = now.made if way is by_rule else first
        if way is not by_rule:
            larger = {"shot.diameter_mm": way.made.reasons["shot.diameter_mm"]}
            now = now._replace(made=_told(now.made, larger))
        return now, wanted, (setting_of(of_rule).ball_mm, of_rule.reasons["shot.diameter_mm"])

    def _strong_enough(self, way: Way) -> Way:
        """Return a way with larger balls where all that suit the target are too weak.

        Poses are compared with balls that may be taken.
        """
        made, known = way.made, way.found and way.found.intensity
        asked = self._asked(made, way.found)
        if asked is None or known is None:
            return way
        larger = larger_balls(made, way.wanted, asked, known.value)
        if larger is None:
            return way
        wanted = replace(way.wanted, ball_mm=larger[0])
        (other,) = self._each([wanted], made)
        if other is None or other.sonotrode_count > made.sonotrode_count or new_harm(other, made):
            return way
        other = _told(other, {"shot.diameter_mm": larger[1]})
        found = self._measure(other, is_brief=True)
        return way if found is None else Way(other, wanted, found)

    def _asked(self, made: Proposal, found: Measured | None) -> WantedIntensity | None:
        """Return the intensity that is sought for a proposal; None if none is, or it is known.

        A stated alloy has a usual intensity, which a proposal should not miss.

        Args:
            found: what a pilot measured of it.
        """
        intensity, alloy = self.wishes.intensity, self.wishes.geometry.alloy
        may_miss = intensity is None and alloy and found and is_off(made, found.intensity)
        return usual_for(made) if intensity == USUAL or may_miss else self.wishes.asked_intensity()

    def _sought(self, now: Compared, wanted: Wanted, by_rule: tuple[float, str]) -> _Sought:
        """Return what is sought for the part as it stands in a proposal."""
        is_wish = self.wishes.intensity is not None or not wanted.alloy
        asked = self._asked(now.made, now.found)
        return _Sought(wanted, asked, is_wish, _of_poses(now.made), by_rule)

    def _with_intensity(
        self, start: Compared, sought: _Sought, asked: WantedIntensity
    ) -> tuple[Compared, _Sought]:
        """Return a proposal for an intensity, turned over where that is worth it with its balls.

        Without a wish for it the start is returned, with nothing sought, where no pilot tells it.
        """
        try:
            now = self._for_intensity(start.made, sought, asked)
        except InputError:
            if sought.is_wish:
                raise
            return start, sought._replace(asked=None)
        is_known = (  # with these balls it was tried, and was not worth it
            setting_of(now.made).ball_mm == setting_of(start.made).ball_mm
            and start.found is not None
            and is_worth_a_second_pose(start.made, start.found)
        )
        if is_known:
            return now, sought
        over, _ = propose_second_pose(now.made, now.found, self._briefly)
        if over.design.steps and not start.made.design.steps:
            other = sought._replace(
                wanted=replace(sought.wanted, turned_over=True), reasons=_of_poses(over)
            )
            with suppress(InputError):
                now = self._for_intensity(turned_over(start.made), other, asked)
                sought = other
        return now, sought

    def _for_intensity(self, start: Proposal, sought: _Sought, asked: WantedIntensity) -> Compared:
        """Return a proposal for an intensity, and what a pilot measured of it."""
        again = partial(self._again, like=start)
        made = propose_intensity(start, sought.wanted, asked, again, self._predict, sought.by_rule)
        made = _told(made, sought.reasons)
        return Compared(made, self._measure(made, is_brief=True))

    def _beside(
        self, now: Compared, sought: _Sought, by_geometry: float
    ) -> tuple[Compared, list[Compared]]:
        """Return a proposal with its intensity told, and others with balls of other sizes.

        Args:
            by_geometry: diameter of the balls that geometry alone gave [mm].
        """
        made, found = now.made if sought.is_wish else as_no_wish(now.made), now.found
        scale = 1.0
        if found is not None and sought.asked is None:
            made = with_expected_intensity(made, found.intensity)
        elif found is not None and found.intensity and made.predicted:
            # What one pilot tells of several sizes is compared; how strong one is, its own tells.
            scale = made.predicted.value / found.intensity.value
            found = found._replace(intensity=made.predicted)
        now = Compared(made, found)
        settings = settings_beside(made, sought.wanted, sought.asked, found, by_geometry)
        wishes = [replace(sought.wanted, ball_mm=one.ball_mm) for one in settings]
        each = zip(self._each(wishes, now.made), settings, strict=True)
        tried = []
        with self.teller.step("sizes tried", len(settings)) as progress:
            for k, (other, one) in enumerate(each):
                progress(k, len(settings), None)
                if other is not None:
                    other = with_amplitude(_told(other, sought.reasons), one)
                    tried.append(self._compared(other, now, sought, scale))
        return now, tried

    def _compared(self, made: Proposal, now: Compared, sought: _Sought, scale: float) -> Compared:
        """Return a proposal with other balls and what a pilot measured of it.

        Args:
            now: the proposal that they are compared with.
            scale: factor on the intensity that the pilot tells.
        """
        if harm := new_harm(made, now.made):
            return Compared(made, None, harm.beginning)
        found = self._briefly(made)
        if found is not None and found.intensity:
            found = found._replace(intensity=found.intensity.times(scale))
        if sought.asked and found and found.intensity:
            made = with_prediction(made, sought.asked, found.intensity)
        return Compared(made if sought.is_wish else as_no_wish(made), found)

    def _briefly(self, made: Proposal, longest: float = math.inf) -> Measured | None:
        return self._measure(made, longest, is_told=False, is_brief=True)

    def _longer(self, made: Proposal, longest: float = math.inf) -> Measured | None:
        """Return what a longer pilot measured, where a brief one resolved no places."""
        return self._measure(made, longest, is_told=False, is_brief=True, most=LONGER)

    def _each(
        self, wishes: Sequence[Wanted], like: Proposal | None = None
    ) -> list[Proposal | None]:
        """Return the proposal for each of some wishes; None where no chamber can be built.

        Threads make them: most of the work is done without Python's global lock.
        """

        def one(wanted: Wanted) -> Proposal | None:
            try:
                return self._again(wanted, like)
            except InputError:
                return None

        with no_steps():
            return [*self.executor.map(one, wishes)]

    def _again(self, other: Wanted, like: Proposal | None = None) -> Proposal:
        """Return a proposal for other wishes, in which the part stands as in another if it can."""
        given = self.path, other, self.choose
        with no_steps():  # those of the first proposal, again
            made = propose(*given) if like is None else propose_alike(like, *given)
            return turned_over(made) if other.turned_over else made

    def _measure(
        self,
        made: Proposal,
        longest: float = math.inf,
        is_told: bool = True,
        is_brief: bool = False,
        most: float = COLLISIONS,
    ) -> Measured | None:
        """Return what the budget of a proposal follows from; None where no pilot can tell it.

        The reason is told then, unless is_told is false. `longest` [s], `is_brief` and `most` are
        those of `measure_budget`. Raises TooSlowError if the time to 98 % is longer.
        """
        try:
            self.teller.compile(made.design, made.chamber, None)
            with self.teller.step("pilot run") as progress:
                given = made.design, made.chamber, self.executor, progress
                return measure_budget(*given, longest, is_brief, most)
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


def _of_poses(made: Proposal) -> dict[str, str]:
    """Return the reasons that tell which poses were tried, by dotted name."""
    return {key: made.reasons[key] for key in OF_POSES if key in made.reasons}


def _told(made: Proposal, reasons: dict[str, str]) -> Proposal:
    """Return a proposal with these reasons in the place of its own."""
    return replace(made, reasons={**made.reasons, **reasons})


def _in_budget(made: Proposal, found: Measured | None) -> Proposal:
    """Return a proposal whose treatment time and budget follow from a pilot, if one could run."""
    made = with_thin_places(made)
    return made if found is None else with_budget(made, measured_budget(made, found))

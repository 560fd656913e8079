"""Compose short overviews of a design, a study or what they give: a heading, a table, and notes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import PurePath
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.checks.check import notes
from chamberopt.common.key_words import title_with_unit
from chamberopt.documents.answer import answer, answer_lines
from chamberopt.documents.comparison import summary
from chamberopt.documents.coverage import figures, figures_table
from chamberopt.documents.document import Block, Fold, Items, Section, Sentence, Table, values
from chamberopt.documents.report import limits_of_intervals, notes_of
from chamberopt.documents.sheet import amplitude_text, key_row
from chamberopt.documents.study import limit_in_words
from chamberopt.documents.terminal_lines import sweep_end
from chamberopt.documents.wording import objective_label, plain
from chamberopt.results.load import load_start

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from chamberopt.results.compare.comparison import Comparison
    from chamberopt.results.load import Result
    from chamberopt.search.run_sweep import SweepResult
    from chamberopt.search.study import Study


def design_overview(design: Design, chamber: Chamber | None, problem: str = "") -> Section:
    """Return the overview of a design.

    Args:
        chamber: chamber of the design; None if it cannot be built.
        problem: the reason why it cannot be built.
    """
    shot, time = design.shot, plain(design.process.treatment_time)
    content: list[Block] = [
        Sentence(
            f"{design.part.mesh_path.name} is peened for {time} s by {shot.count:,} balls, "
            f"{plain(shot.mass_g)} g together, in a chamber of shape “{_shape(design)}”."
        ),
        values("", dict(_settings(design, chamber))),
    ]
    if chamber is None:
        content.append(Sentence(f"The chamber cannot be built: {problem}", "warning"))
    elif told := notes(design, chamber):
        content.append(Fold("Notes", [Items(told)]))
    return Section(f"Design: {design.part.mesh_path.stem}", content)


def study_overview(study: Study) -> Section:
    """Return the overview of a study: what varies, what is maximised, limits and budget."""
    goals = " and ".join(objective_label(name).in_full for name in study.objective.goals)
    rows = [
        (
            title_with_unit(name),
            (", " if varied.texts else " to ").join(map(plain, varied.ends)),
            _start(study, name),
        )
        for name, varied in study.vary.items()
    ]
    limits = [
        limit_in_words(name, sign, value)
        for name, limit in study.all_constraints.items()
        for sign, value in (("≥", limit.min), ("≤", limit.max))
        if value is not None
    ]
    content: list[Block] = [
        Sentence(
            f"The best chamber for {study.design.part.mesh_path.name} is searched for: objective "
            f"{goals}, {study.optimizer.evaluations:,} evaluations."
        ),
        Table("What varies", ("parameter", "values", "start"), rows),
    ]
    if limits:
        content.append(Sentence(f"Constraints: {', '.join(limits)}."))
    return Section(f"Study: {study.design.part.mesh_path.stem}", content)


def result_overview(result: Result) -> Section:
    """Return the overview of a result: its answer, its figures with intervals, and its notes."""
    start = load_start(result)
    content: list[Block] = [
        Sentence(answer(result, start), "sentence"),
        *(one.sentence() for one in answer_lines(result, start)),
        figures_table(figures(result, start)),
        Sentence(limits_of_intervals(result), "soft"),
    ]
    told = [*(f"Warning: {text}" for text in result.record.warnings or ()), *notes_of(result)]
    if told:
        content.append(Fold("Notes and warnings", [Items(told)]))
    return Section(f"Result: {result.folder.resolve().name}", content)


def sweep_overview(sweep: SweepResult) -> Section:
    """Return the overview of a sweep: its best candidate, and what became of all."""
    return Section(f"Sweep: {sweep.folder.resolve().name}", _blocks(sweep_end(sweep, (), False)))


def comparison_overview(comparison: Comparison) -> Section:
    """Return the overview of a comparison: a sentence for each candidate, and the main figures."""
    told = summary(comparison)
    answers = [Sentence(one, "sentence") for one in told.answers]
    doubts = [Sentence(one, "warning") for one in told.doubts]
    content: list[Block] = [*answers, *doubts, told.table, Sentence(told.legend)]
    return Section(f"Comparison with {comparison.labels[0]}", content, is_answer=True)


def _blocks(lines: Sequence[Table | str]) -> list[Block]:
    """Return the end of a command as blocks, without its empty lines."""
    return [Sentence(one) if isinstance(one, str) else one for one in lines if one]


def _shape(design: Design) -> str:
    return PurePath(design.chamber.shape).name


def _settings(design: Design, chamber: Chamber | None) -> Iterator[tuple[str, str]]:
    """Yield the name and the text of the main settings of a design."""
    if chamber is not None:
        sides = 1e3 * np.ptp(chamber.part.vertices, axis=0)
        yield "part, as it stands", " × ".join(plain(side, 3) for side in sides) + " mm"
        inside = 1e6 * float(chamber.exposed_area[chamber.part.target].sum())
        yield "target in the chamber", f"{plain(inside, 3)} mm²"
        yield "free volume", f"{plain(1e6 * chamber.volume, 3)} cm³"
    table = design.chamber.model_dump(mode="json", exclude_none=True, exclude={"facets"})
    for key, value in table.items():
        if isinstance(value, int | float) and not isinstance(value, bool) and value:
            name, text = key_row(key, value)
            yield f"chamber, {name}", text
    yield "sonotrode", f"{amplitude_text(design.sonotrode)}, {design.sonotrode.frequency_khz:g} kHz"
    balls = (f"{count:,} of Ø {plain(1e3 * d)} mm" for d, count in design.shot.sizes)
    material = (design.shot.material or "material not named").replace("_", " ")
    yield "shot", f"{', '.join(balls)}, {material}"
    yield "peening time", f"{plain(design.process.treatment_time)} s"
    accuracy = design.process.accuracy
    yield "simulated", f"{accuracy.replicas} replicas of {plain(design.process.recorded_time)} s"


def _start(study: Study, name: str) -> str:
    return plain(study.design.setting(name))

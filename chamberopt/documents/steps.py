"""Text about the steps in which a part is peened: what each changes, and what it does alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

from chamberopt.coverage.metrics import METRICS, STEPS
from chamberopt.design.process import NONE
from chamberopt.documents.document import AnswerLine, Section, Sentence, Table
from chamberopt.documents.wording import metric_label, per_cent, plain

if TYPE_CHECKING:
    from collections.abc import Sequence

    from chamberopt.design.process import Step
    from chamberopt.results.load import Result

SUM = (
    "The figures of the target are of all steps together: their dents are added up by place. In "
    "times to a coverage, the times of all steps are scaled alike. Below are the figures of the "
    "target after each step alone."
)


def turned(rotate_deg: Sequence[float]) -> str:
    """Return a pose of the part in words, e.g. "180° about x, then 45° about z"."""
    turns = zip("xyz", rotate_deg, strict=True)
    return ", then ".join(f"{plain(angle)}° about {axis}" for axis, angle in turns if angle)


def changes_in_words(step: Step) -> str:
    """Return what a step changes in the design: the pose in words, other keys as the file says."""
    texts = []
    for name, change in step.changes.items():
        if not isinstance(change, dict):
            texts.append(f"no {name}" if change == NONE else f"other {name}: see the design")
            continue
        for key, value in change.items():
            if (name, key) == ("part", "rotate_deg"):
                texts.append(
                    f"part turned {turned(value)}" if any(value) else "part as in its file"
                )
            elif isinstance(value, int | float | str) and value:
                texts.append(f"{name}.{key} = {value if isinstance(value, str) else plain(value)}")
            elif value:
                texts.append(f"{name}.{key}: see the design")
    return ", ".join(texts) or "as the design"


def step_lines(result: Result) -> list[AnswerLine]:
    """Return a sentence on each step: its time, what it changes, and what it does alone."""
    lines: list[AnswerLine] = []
    if not result.design.steps:
        return lines
    steps = zip(result.design.steps, result.design.in_steps.values(), strict=True)
    for number, (step, one) in enumerate(steps, start=1):
        figures = [
            f"{label.text} {label.format(found)}"
            for name in ("mean_coverage", "almen_intensity", "strength_um")
            if (found := result.metrics.get(f"{STEPS}.{step.name}.{name}"))
            for label in (metric_label(name),)
        ]
        time = plain(one.process.treatment_time)
        text = f"Step {number}, {step.name}, {time} s, {changes_in_words(step)}; alone: "
        lines.append(AnswerLine("step", f"{text}{', '.join(figures[:2])}.", False))
    return lines


def steps_section(result: Result) -> Section | None:
    """Return the section with the steps and what each does alone; None for a design without."""
    steps, found = result.design.steps, result.record.steps
    if not steps or found is None:
        return None
    times = (plain(one.process.treatment_time) for one in result.design.in_steps.values())
    rows: list[Sequence[str]] = [
        ("time [s]", *times),
        ("changes", *map(changes_in_words, steps)),
        ("share of the target that a ball can touch", *(per_cent(found[s.name]) for s in steps)),
    ]
    for name in METRICS:
        label = metric_label(name)
        of_steps = [result.metrics.get(f"{STEPS}.{step.name}.{name}") for step in steps]
        if any(of_steps):
            rows.append((label.with_unit, *(label.number(one) if one else "–" for one in of_steps)))
    table = Table("± 95 % intervals", ("", *(step.name for step in steps)), rows)
    return Section("Steps", [Sentence(SUM), table])

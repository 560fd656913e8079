"""Compose the report of a result as a document, which printers/ turns into an HTML page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from itertools import groupby
from typing import TYPE_CHECKING

from chamberopt.chamber.checks.check import matters
from chamberopt.chamber.matters import OF_TIME, Matter, matter_of
from chamberopt.chamber.propose.proposed_budget import ROUGH
from chamberopt.common.files import read_file
from chamberopt.common.key_words import title_with_unit
from chamberopt.common.number_text import estimate_text, typeset
from chamberopt.documents.answer import answer, answer_lines
from chamberopt.documents.coverage import coverage_section, figures, tiles
from chamberopt.documents.document import (
    Beside,
    Block,
    Document,
    Fold,
    Items,
    PartView,
    Section,
    Sentence,
    Table,
    TextFile,
    values,
)
from chamberopt.documents.proposal import as_sentence
from chamberopt.documents.ranges import groups_text, range_section
from chamberopt.documents.stress import stress_section
from chamberopt.documents.study import (
    front_section,
    influence_section,
    question_section,
    search_section,
)
from chamberopt.documents.tolerances import tolerance_section
from chamberopt.documents.wording import (
    keys_in_words,
    metric_label,
    named_value,
    objective_label,
    plain,
    value_text,
)
from chamberopt.documents.zones import steps_section, zones_section
from chamberopt.pictures.part3d import part_scene
from chamberopt.results.load import START, load_start, load_trials
from chamberopt.simulation.advice import unit_of_change

if TYPE_CHECKING:
    from chamberopt.results.load import Result
    from chamberopt.results.records import AdviceRecord, StudyRecord
    from chamberopt.search.trial_log import Trial

SETTLED = "Settled"  # title of the list of matters that are
SUBTITLES = {
    "study": "Report of a study: the best chamber found",
    "simulation": "Report of one simulated chamber",
}
LIMITS_OF_INTERVALS = (
    "The intervals cover random variation between simulations only. They do not include errors in "
    "your restitution, friction and material data: calibrate those with your machine."
)
COUNTED_ONLY = "The intervals cover random variation between simulations only."
LIMITS_OF_CALIBRATED = (
    "The intervals cover random variation between simulations, and what the calibration of the "
    "machine leaves open. They do not include what the model itself leaves out."
)
STEPS = {
    "chamber": "to build the chamber",
    "simulate": "to simulate",
    "coverage": "to compute the coverage",
}
STOP_REASONS = {
    "replicas": "the requested number of replicas",
    "accuracy": "the requested accuracy was reached",
    "max_replicas": "the largest allowed number; the requested accuracy was not reached",
    "points": "more would bring nothing: the error is in the choice of the windows' points",
    "user": "the simulation was stopped by the user",
}
ENDS = {  # by the reasons in search/optimiser/point_search.py
    "budget": "as its evaluations were spent",
    "values": "as all values of [vary] were evaluated",
    "converged": "as it found no new candidates",
    "gain": "as nothing was left to gain that counts",
}
COLLISIONS = {
    "walls": "with walls and part",
    "balls": "between balls",
    "sonotrode": "with the sonotrode",
}


def report(result: Result) -> Document:
    """Return the report of a result as a document.

    Raises:
        InputError: a file of the result is missing or damaged.
    """
    study, name = result.study, result.folder.resolve().name
    start = load_start(result)
    trials = load_trials(result.folder) if study else []
    of = {"result": result} if start is None else {START: start, "best": result}
    scene = part_scene(result, name)
    scenes = {"result" if start is None else "best": scene}
    if start is not None:
        scenes = {START: part_scene(start, START, max_triangles=0), **scenes}
    shown = figures(result, start)
    label = objective_label(result.objective_name)
    sections = (
        question_section(result),
        answer_section(result, start),
        *_matters(result),
        Section("The best chamber" if study else "The chamber", [PartView([scene])]),
        front_section(study) if study else None,
        search_section(result, trials) if study else None,
        influence_section(study, label) if study else None,
        coverage_section(shown, of, scenes),
        steps_section(result),
        zones_section(result),
        stress_section(result, start),
        range_section(result),
        tolerance_section(result),
        _accuracy_and_cost(result, trials),
        _effects(result),
        notes_section(result),
        _design(result, start),
        _made_with(result),
    )
    said, lines = answer(result, start), answer_lines(result, start)
    return Document(name, _subtitle(result), said, lines, [one for one in sections if one])


def answer_section(result: Result, start: Result | None) -> Section:
    """Return what a result says in sentences, and its main figures beside those of the start.

    Args:
        start: the design with which a study began; None for a result that is no study's.
    """
    return Section(
        "The answer",
        [
            Sentence(answer(result, start), "sentence"),
            *(one.sentence() for one in answer_lines(result, start)),
            tiles(figures(result, start)),
            Sentence(limits_of_intervals(result), "soft"),
        ],
        is_answer=True,
    )


def notes_of(result: Result) -> list[str]:
    """Return the notes on a result: of its study, if it is a study, then of its simulation."""
    return [*(result.study.notes if result.study else ()), *result.notes]


def limits_of_intervals(result: Result, has_groups: bool = False) -> str:
    """Return a sentence on errors that the intervals of a result do not cover.

    Args:
        has_groups: true where another sentence says what is not calibrated.
    """
    calibrated, ranges = result.design.calibration is not None, result.record.ranges
    if ranges is None:
        return LIMITS_OF_CALIBRATED if calibrated else LIMITS_OF_INTERVALS
    text = LIMITS_OF_CALIBRATED if calibrated else COUNTED_ONLY
    return (
        text
        if has_groups
        else f"{text} The ranges hold what is not calibrated: {groups_text(ranges)}."
    )


def _subtitle(result: Result) -> str:
    created = result.record.created
    made = f"simulated {created[:10]}, " if created else ""
    return (
        f"{SUBTITLES.get(result.record.kind, '')}; "
        f"{made}report made {datetime.now(UTC).date()} by chamberopt"
    )


def _accuracy_and_cost(result: Result, trials: Sequence[Trial]) -> Section:
    accuracy = values("How accurate it is", _accuracy(result))
    cost = [values("What the answer cost", _cost_of_answer(result))]
    if result.study:
        cost.append(values("Evaluations of the study", _cost_of_study(result.study, trials)))
    return Section("Accuracy and cost", [Beside([[accuracy], cost])])


def _accuracy(result: Result) -> dict[str, str]:
    """Return rows (name, text) on the intervals of the main figures and the number of replicas."""
    objective, mean = objective_label(result.objective_name), metric_label("mean_coverage")
    record, field = result.record, result.record.field
    needed = field.simulated_s_needed.p05_times_intensity
    rows = {
        f"95 % interval of the {objective.text}": objective.format(result.objective),
        f"95 % interval of the {mean.text}": mean.format(result.metrics["mean_coverage"]),
        "replicas, each with its own seed": f"{record.replicas}",
        "number of replicas": STOP_REASONS.get(record.stopped_by, record.stopped_by),
        "dents in the median window": plain(field.dents_in_median_window, 3),
        "simulation that resolves every figure": f"{plain(needed, 2)} s of all replicas"
        if needed and not result.resolves_places
        else "",
    }
    if result.study:
        search = result.study.accuracy.search
        replicas = f"up to {search.replicas} replicas"
        if half_width := search.objective_half_width:
            replicas = f"± {half_width:g} requested"
        time = search.simulated_time_s
        rows["a candidate of the search"] = replicas + (f" of {plain(time)} s" if time else "")
    rows["chamber's walls"] = "exact planes and cylinders" if record.analytic else "triangles"
    return {name: text for name, text in rows.items() if text}


def _cost_of_answer(result: Result) -> dict[str, str]:
    """Return rows (name and text) on simulated time, collisions and run time of the simulation.

    For a study, this is the simulation of its best design.
    """
    record, collisions = result.record, result.record.collisions
    kinds = [
        f"{_count(collisions[name])} {kind}"
        for name, kind in COLLISIONS.items()
        if name in collisions
    ]
    return {
        "simulated time": f"{plain(record.simulated_time_s)} s",
        "collisions": f"{_count(collisions.get('total', 0))}: {', '.join(kinds)}",
        **{STEPS.get(name, name): f"{s:.2f} s" for name, s in record.timings_s.items()},
    }


def _cost_of_study(study: StudyRecord, trials: Sequence[Trial]) -> dict[str, str]:
    """Return rows with the numbers of the study's evaluations, and the run time of all."""
    return {
        "in the search": _count(study.evaluations),
        "of these not simulated": _count(study.failed),
        "of these told enough in a few replicas": _count(study.ended_early),
        "of these miss a constraint": _count(study.missing_a_constraint),
        "the search ended": ENDS.get(study.ended_by or "", "not known"),
        "confirmations": _count(sum(one.stage == "confirm" for one in trials)),
        "run time of all": f"{plain(study.seconds, 3)} s",
    }


def _count(number: float) -> str:
    return plain(float(number), 12)


def _effects(result: Result) -> Section:
    """Return the section on optional physical effects: which are simulated, and pilot estimates."""
    effects = result.design.effects.model_dump(mode="json", exclude={"auto"})
    switched = {
        name.replace("_", " "): _effect_text(name, value) for name, value in effects.items()
    }
    in_result = values("In this result", switched)
    if pilot := result.record.effects:
        return Section("Physical effects", [in_result, *_advice(pilot)])
    text = (
        "No pilot run was made to estimate what each effect changes. "
        "“chamberopt check --pilot” makes one for a design."
    )
    return Section("Physical effects", [in_result, Sentence(text)])


def _advice(pilot: Sequence[AdviceRecord]) -> Iterator[Block]:
    rows = [
        (
            one.effect,
            one.verdict,
            *(
                typeset(estimate_text(by, 100.0, unit_of_change(name), sign=True))
                for name, by in one.changes.items()
            ),
        )
        for one in pilot
    ]
    yield Sentence(
        "The effects were chosen by a short pilot run, in which each was switched alone:"
    )
    yield Table(
        "", ("effect", "verdict", *(f"change of {name}" for name in pilot[0].changes)), rows
    )
    yield Items([one.said for one in pilot])


def _effect_text(name: str, value: object) -> str:
    if name == "flexure" and isinstance(value, Mapping) and not value["on"]:
        return "off"
    if isinstance(value, Mapping):
        return ", ".join(named_value(key, one, 6) for key, one in value.items() if one is not None)
    if name == "rest" and value is None:
        return "on where a still surface faces up"
    if name == "flexure" and value is None:
        return "on where the part is thin"
    return "on" if value else "off"


def open_matters(result: Result) -> list[Matter]:
    """Return the matters of a result's design, the most urgent first.

    A time that the result now knows is none.
    """
    time = result.metrics.get("time_to_98_s")
    is_known = time is not None and time.half_width <= ROUGH * time.value
    found = [as_sentence(matter_of(one)) for one in result.design.to_settle]
    found = [one for one in found if not (is_known and one.kind in OF_TIME)]
    return sorted(found, key=lambda one: one.urgency)


def own_warnings(result: Result) -> list[str]:
    """Return the warnings of a result's design without its matters, which have their own list."""
    of_matters = {*matters(result.design)}
    return [one for one in result.record.warnings or () if one not in of_matters]


def _matters(result: Result) -> Iterator[Section]:
    """Yield a section with the matters of each urgency, if any, and one with what is settled."""
    for urgency, found in groupby(open_matters(result), lambda one: one.urgency):
        texts = [keys_in_words(f"{one.mark.capitalize()}{one.text}") for one in found]
        yield Section(urgency.in_words, [Items(texts)])
    if settled := result.design.settled:
        yield Section(SETTLED, [Items([keys_in_words(one) for one in settled])])


def notes_section(result: Result) -> Section:
    """Return the warnings of the check and the notes on a result."""
    notes = [*(f"Warning: {text}" for text in own_warnings(result)), *notes_of(result)]
    notes = [keys_in_words(text) for text in notes]
    content = [Sentence(note, "warning") for note in notes]
    if result.record.warnings is None:
        text = "The design was not checked; “chamberopt check” lists its warnings."
        content.append(Sentence(text))
    elif not notes:
        content.append(Sentence("There are no notes or warnings."))
    return Section("Notes and warnings", content)


def _design(result: Result, start: Result | None) -> Section:
    """Return the section on the design.

    It has the changes from the start, every value by dotted name, and the design file.
    """
    after = _design_values(result)
    before = _design_values(start) if start else after
    changed = [
        (title_with_unit(name), before.get(name, value_text(None)), value)
        for name, value in after.items()
        if before.get(name, value_text(None)) != value
    ]
    content: list[Block] = []
    if changed:
        content.append(Table("What differs from the start", ("", "start", "best"), changed))
    every = Table("", ("", "value"), [*after.items()], numbers=False)
    name = "best.toml" if result.study else "design.toml"
    file = TextFile(name, read_file(result.path(name)).decode())
    content += [
        Fold("Every value of the design", [every], printed=True),
        Fold(f"{name}, for chamberopt simulate", [file]),
    ]
    return Section("The design", content)


def _design_values(result: Result) -> dict[str, str]:
    """Return each value of the design as text, by its dotted name.

    The folder of the mesh is private to the machine, so only the file's name is shown.
    """
    design = dict(_flatten(result.record.design))
    design["part.mesh"] = result.design.part.mesh_path.name
    return {name: value_text(value, 6) for name, value in design.items()}


def _flatten(table: Mapping[str, object], prefix: str = "") -> Iterator[tuple[str, object]]:
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from _flatten(value, f"{prefix}{name}.")
        elif value not in ([], None):
            yield prefix + name, value


def _made_with(result: Result) -> Section:
    rows = {
        "part, SHA-256": result.record.part_sha256,
        "seed": seed_text(result),
        **result.record.versions,
    }
    return Section("Made with", [values("", rows)])


def seed_text(result: Result) -> str:
    """Return a text with the seed and the name of the random stream of a result."""
    return f"{result.seeds[0]}, stream “{result.seeds[1]}”"

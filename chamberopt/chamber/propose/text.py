"""Write the texts of a proposed design file and study file, with a reason beside each value."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import tomlkit

from chamberopt.chamber.checks.warning import DesignWarning, WarningKind
from chamberopt.chamber.layout.balls import MANY, MISSED
from chamberopt.chamber.layout.target import Surface
from chamberopt.chamber.matters import Matter, MatterKind, matter_of
from chamberopt.chamber.propose.proposal import Proposal
from chamberopt.chamber.propose.proposed_budget import LONG
from chamberopt.chamber.propose.proposed_intensity import INTENSITY
from chamberopt.chamber.propose.proposed_mask import LeftOut
from chamberopt.chamber.propose.quicker import HALF
from chamberopt.common.errors import one_line
from chamberopt.common.key_words import AIMS
from chamberopt.common.number_text import rounded
from chamberopt.common.toml_fields import allowed_range
from chamberopt.design.almen_strip import USUAL_K, USUAL_K_LOG_SD
from chamberopt.design.load import Design, with_paths_from

MAX_LISTED = 20  # surfaces in a comment
EVALUATIONS, SEARCH_HALF_WIDTH = 20, 0.04
SEARCH_REPLICAS = 4
TARGET = "part.target"  # its reason begins with its name
# Warnings that are no matters to be settled: those of which a reason tells, and those of figures.
OTHERWISE_TOLD = {
    WarningKind.WIDE_FLOOR,
    WarningKind.WALL_IN_HOLE,
    WarningKind.COLLISIONS,
    WarningKind.PART_TURN,
    WarningKind.CHARGE,
    WarningKind.FACETS,
    WarningKind.CALIBRATION,
    WarningKind.TO_SETTLE,
}
OF_BALLS = {WarningKind.FILLET, WarningKind.SLOT}


class Goal(NamedTuple):
    """What a study of `new` is after."""

    objective: str  # name of it in a study file
    meaning: str
    accuracy: str  # a further line of [search_accuracy]


MOST_EVEN = Goal(
    "uniform_coverage",
    "mean minus standard deviation of coverage",
    f"objective_half_width = {SEARCH_HALF_WIDTH}",
)
FASTEST = Goal(
    "minus_time_to_98_s",
    "minus the time after which 95 % of the target's area has 98 %",
    f"max_replicas = {SEARCH_REPLICAS}  # alike for all candidates, to rank them",
)
# What a search can be after without limits and without a further number, the usual aim first.
GOALS = {
    one.objective: one
    for one in (
        FASTEST,
        MOST_EVEN,
        MOST_EVEN._replace(
            objective="p05_coverage", meaning="coverage of the least covered 5 % of the area"
        ),
        MOST_EVEN._replace(
            objective="intensity_uniformity", meaning="how even the peening strength is"
        ),
    )
}


def clauses(reason: str) -> tuple[list[str], list[Matter]]:
    """Return the clauses of a reason: why a value is so, and the matters about it."""
    found = [matter_of(one) for one in filter(None, one_line(reason).split("; "))]
    return [one.text for one in found if one.kind is None], [one for one in found if one.kind]


def _clauses_of(proposal: Proposal) -> dict[str, tuple[list[str], list[Matter]]]:
    """Return the clauses of each reason, by its key, but for keys that the design has not.

    A target's name is never to be settled.
    """
    own = {INTENSITY, *proposal.tables}
    own |= {f"{table}.{key}" for table, values in proposal.tables.items() for key in values}
    found = {key: clauses(reason) for key, reason in proposal.reasons.items() if key in own}
    if reason := proposal.reasons.get(TARGET):
        name, colon, rest = one_line(reason).partition(": ")
        (first, *why), settle = clauses(f"-{rest}")  # a dash begins nothing to settle
        found[TARGET] = [f"{name}{colon}{first[1:]}", *why], settle
    return found


def to_settle(proposal: Proposal, left_out: Sequence[LeftOut]) -> list[Matter]:
    """Return the matters of a proposal, the most urgent first.

    Of those as urgent the target's are first, and what follows is in the order of the design file.

    Args:
        left_out: what may be left out of the target, or is peened beside it.
    """
    tables = ["part.target", *proposal.tables]

    def place(key: str) -> int:
        table = key.rpartition(".")[0]
        return next((k for k, one in enumerate(tables) if one in (key, table)), len(tables))

    said = _clauses_of(proposal)
    found = [one for key in sorted(said, key=place) for one in said[key][1]]
    warned = [one for one in proposal.warnings if is_to_be_settled(one, proposal)]
    found += [Matter(MatterKind.WARNED_OF, f": {one_line(one.text)}") for one in warned]
    found += map(matter_of, [*_many_balls(proposal), *_quicker_balls(proposal)])
    for one in left_out:
        keys = " and ".join(f"part.target.{key}" for key in one.keys)
        many = "" if len(one.keys) > 1 else "s"
        leave = f": {keys} in the design leave{many} it out" if keys else ""
        found.append(matter_of(f"{one_line(one.text)}{leave}"))
    return sorted(dict.fromkeys(found), key=lambda one: one.urgency)


def is_to_be_settled(one: DesignWarning, proposal: Proposal) -> bool:
    """Return whether a warning of a proposal's check is a matter that no reason of it tells."""
    if one.kind in OF_BALLS:
        reason = proposal.reasons["shot.diameter_mm"]
        return not any(matter.kind is MatterKind.NO_SIZE for matter in clauses(reason)[1])
    return one.kind not in OTHERWISE_TOLD


def _many_balls(proposal: Proposal) -> Iterator[str]:
    """Yield that the balls are many, if they are, and which larger ones pilots compared."""
    count, size = max(
        (one.shot.count, one.shot.diameter) for one in proposal.design.in_steps.values()
    )
    if count > MANY:
        fewer = (one for one in proposal.trials if 1e-3 * one.ball_mm > size and one.count < count)
        larger = [f": {one.ball_mm:g} mm would suit {one.fit.served:.0%}" for one in fewer]
        yield f"{MatterKind.MANY_BALLS}, {count:,}, to be dosed and sorted{''.join(larger[:1])}"


def _quicker_balls(proposal: Proposal) -> Iterator[str]:
    """Yield which balls that pilots compared take less than half of a long time, if some do."""
    times = {one.ball_mm: one.time_to_98 or math.inf for one in proposal.trials if one.is_of_places}
    fits = {one.ball_mm: one.fit for one in proposal.trials}
    ball = proposal.tables["shot"]["diameter_mm"] if times else 0.0
    if not LONG < times.get(ball, 0.0) < math.inf:
        return
    as_good = [one for one in times if fits[one].touched >= fits[ball].touched - MISSED]
    best = min(as_good, key=times.__getitem__)
    if times[best] < HALF * times[ball]:
        time = f"by pilots about {rounded(times[best], 2)} s"
        yield f"{MatterKind.QUICKER_BALLS}: of {best:g} mm, {time}"


def design_text(proposal: Proposal, folder: Path, left_out: Sequence[LeftOut] = ()) -> str:
    """Return the text of the proposed design file.

    Args:
        left_out: what may be left out of the target.
        folder: folder that the file will be in. The path of the part is relative to it.
    """
    tables = with_paths_from(folder.resolve(), proposal.tables)
    name = Path(tables["part"]["mesh"]).name
    rules = "proposed by `chamberopt new`: rules of thumb to vary."
    lines = [f"# A first chamber for {one_line(name)}, {rules}", ""]
    if settle := to_settle(proposal, left_out):
        lines += ["to_settle = [  # the most urgent first; take out what is settled"]
        lines += [*(f"  {_line('', one.sentence)[3:]}," for one in settle), "]"]
    why = {key: "; ".join(said[0]) for key, said in _clauses_of(proposal).items()}
    for table, values in tables.items():
        title = f"[{table}]" + (f"  # {why[table]}" if why.get(table) else "")
        lines += ["", title] if table else [""]  # "" is the file's top, above all tables
        quoted = {f'"{key}"' if "." in key else key: one for key, one in values.items()}
        lines += _values(quoted, table, why)
        if table == "process" and "intensity_mmA" not in values and INTENSITY in proposal.reasons:
            lines.append(f"# Almen intensity: {why[INTENSITY]}")
        if table == "part.target":
            lines += _left_out(left_out)
            lines += _choices(proposal.known)
    return "\n".join(lines) + "\n"


def study_texts(proposal: Proposal, design: str) -> dict[str, str]:
    """Return the texts of study files that vary numbers of the proposed design, by file name.

    study.toml is after the shortest time, and most_even.toml after the most even coverage in less
    than the proposed time: after that it is nearly 1 in every good chamber, and ranks none. Without
    a pilot, or where balls touch too little of the target to cover it, study.toml is after the most
    even coverage, and alone.

    Args:
        design: name of the design file, in the same folder.
    """
    start = {name: f"now {proposal.design.value(name):g}" for name in proposal.bounds}
    process, limits = proposal.design.process, _intensity_limits(proposal.design)

    def text(goal: Goal, time: float) -> str:
        each = time / SEARCH_REPLICAS
        return study_lines(design, proposal.bounds, start, goal=goal, time=each) + limits

    # as many dents as the design's own replicas have
    even = text(MOST_EVEN, process.accuracy.replicas * process.accuracy.simulated_time_s)
    if proposal.search_time is None:
        return {"study.toml": even}
    short = (
        "# After the design's treatment time all good chambers are even. Rank them after half of"
    )
    short += f" it:\n# chamberopt run most_even.toml --time {0.5 * process.treatment_time:g}s\n"
    return {"study.toml": text(FASTEST, proposal.search_time), "most_even.toml": short + even}


def study_of_design(
    name: str,
    design: Design,
    bounds: Mapping[str, Mapping[str, Any]],
    notes: Mapping[str, str],
    evaluations: int,
    goal: Goal,
) -> str:
    """Return the text of a study file that varies numbers of any design.

    A candidate is simulated for as long as the design.

    Args:
        name, bounds, notes, evaluations, goal: as of `study_lines`, of which `name` is its
            `design`.
    """
    accuracy = design.process.accuracy
    least, most = allowed_range(type(accuracy).model_fields["simulated_time_s"])
    each = accuracy.replicas * accuracy.simulated_time / SEARCH_REPLICAS
    text = study_lines(name, bounds, notes, evaluations, goal, min(max(each, least), most))
    if accuracy.max_replicas < SEARCH_REPLICAS and "max_replicas" not in goal.accuracy:
        text += f"max_replicas = {SEARCH_REPLICAS}  # the design has fewer than the search\n"
    return text


def study_lines(
    design: str,
    bounds: Mapping[str, Mapping[str, Any]],
    notes: Mapping[str, str],
    evaluations: int = EVALUATIONS,
    goal: Goal = MOST_EVEN,
    time: float = 1.0,
) -> str:
    """Return the text of a study file that varies numbers of a design.

    Args:
        design: name of the design file, in the same folder.
        bounds: keys in [vary] by dotted name, such as low and high.
        notes: a comment on each number.
        goal: what the study maximises.
        time: simulated time of each replica of the search [s].
    """
    vary = {f'"{name}"': dict(one) for name, one in bounds.items()}
    lines = [
        f"# Searches a better chamber for the same part: {AIMS[goal.objective]}.",
        _line("design", design),
        "",
        "[vary]  # in the units of the names",
        *_values(vary, "x", {f'x."{name}"': text for name, text in notes.items()}),
        "",
        "[objective]",
        f'name = "{goal.objective}"  # {goal.meaning}',
        "",
        "[optimizer]",
        f"evaluations = {evaluations}",
        "confirm = 2  # the best candidates, simulated again on fresh seeds",
        "confirm_replicas = 8",
        "seed = 1",
        "",
        "[search_accuracy]  # of the search; confirmations take the design's own",
        f"replicas = {SEARCH_REPLICAS}",
        _line("simulated_time_s", float(f"{time:.3g}")),
        goal.accuracy,
    ]
    return "\n".join(lines) + "\n"


def _intensity_limits(design: Design) -> str:
    """Return lines of a study file that hold candidates to the wanted intensity, or "".

    Without measured strips they are comments: the range of the strength is known to a factor.
    """
    wanted = design.process.intensity_mmA
    if wanted is None:
        return ""
    if not design.why_no_intensity:
        limits = _line("almen_intensity", dict(zip(("min", "max"), wanted, strict=True)))
        return f"\n[constraints]\n{limits}  # mmA, the wanted intensity\n"
    ends = (float(f"{1e3 * one / USUAL_K:.3g}") for one in wanted)
    limits = _line("strength_um", dict(zip(("min", "max"), ends, strict=True)))
    factor = f"within a factor of {math.exp(USUAL_K_LOG_SD):.2g}"
    text = f"the wanted intensity, if {USUAL_K:g} mmA/mm hold: {factor}"
    return f"\n# [constraints]  # to hold candidates to it\n# {limits}  # {text}\n"


def _values(values: Mapping[str, object], table: str, reasons: Mapping[str, str]) -> list[str]:
    lines = [_line(key, value) for key, value in values.items()]
    noted = [reasons.get(f"{table}.{key}") for key in values]
    width = max((len(line) for line, reason in zip(lines, noted, strict=True) if reason), default=0)
    return [
        f"{line:{width}}  # {reason}" if reason else line
        for line, reason in zip(lines, noted, strict=True)
    ]


def _line(key: str, value: object) -> str:
    """Return a key and its value as one line of TOML."""
    if isinstance(value, dict):
        return f"{key} = {{ {', '.join(_line(k, v) for k, v in value.items())} }}"
    if isinstance(value, list):
        return f"{key} = [{', '.join(_line('', one)[3:] for one in value)}]"
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    return f"{key} = {tomlkit.item(value).as_string()}"


def _left_out(offers: Sequence[LeftOut]) -> list[str]:
    """Return comment lines with keys of [part.target] that leave something out of the target."""
    lines = []
    for one in offers:
        if not one.keys:
            continue
        first, *more = (_line(key, value) for key, value in one.keys.items())
        also = ", with the next line" if more else ""
        lines += [f"# {first}  # leaves out {one_line(one.text)}{also}"]
        lines += [f"# {line}" for line in more]
    return lines


def _choices(known: Sequence[Surface]) -> list[str]:
    """Return comment lines with the keys of [part.target] that choose each known surface."""
    lines = ["# The part's surfaces, the largest first; lists of several are one target:"]
    for one in known[:MAX_LISTED]:
        keys = ", ".join(_line(key, value) for key, value in one.keys.items())
        lines.append(f"# {keys}  # {one_line(one.name)}: {one.text}")
    if len(known) > MAX_LISTED:
        lines.append(f"#   and {len(known) - MAX_LISTED} smaller ones (--target pick)")
    return lines

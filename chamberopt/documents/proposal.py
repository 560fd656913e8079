"""A proposal of `new` in words: what is proposed and why, and what is to be settled first.

The reasons of a proposal's values have clauses that are matters (`chamber/matters.py`). They are
one list, here and in the design file's `to_settle`; all other clauses stand beside the values.
"""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import TYPE_CHECKING

from chamberopt.chamber.checks.fillets import OF_FILLET, OF_SLOT
from chamberopt.chamber.checks.openings import find_openings, walls_end_at
from chamberopt.chamber.layout.target import BEVELS, area_in_mm2
from chamberopt.chamber.matters import Matter, MatterKind
from chamberopt.chamber.propose.proposed_intensity import INTENSITY
from chamberopt.chamber.propose.text import clauses, to_settle
from chamberopt.common.errors import one_line
from chamberopt.common.key_words import in_words
from chamberopt.common.number_text import NO_BREAK, held_together, plain, rounded
from chamberopt.design.intensity import NOT_DECIDED, strip_to_measure
from chamberopt.documents.document import Table
from chamberopt.geometry.triangles import areas
from chamberopt.peening.held_strip import held_strip

if TYPE_CHECKING:
    from chamberopt.chamber.layout.target import Surface
    from chamberopt.chamber.propose.proposal import BallTrial, PoseTrial, Proposal
    from chamberopt.chamber.propose.proposed_mask import LeftOut

WIDTH, INDENT = 79, 13  # columns
MOST_LISTED = 6  # surfaces, without --verbose
SIMULATED = "simulated"  # the row that is told with --verbose alone
SUITS = (
    "Balls touch a place that they get to. They suit it if it also lies in no fillet of less than "
    f"{1 / OF_FILLET:g} diameters' radius and in no slot of less than {1 / OF_SLOT:g} diameters: "
    "these are peened slowly. It is covered once dents lie on it."
)
KINDS = {"bore": "the part itself, out through a wall"}  # of holders, in words
MINUTE, HOUR = 60.0, 3600.0  # s


@dataclass(frozen=True)
class Row:
    """What is told of a proposal under one name: its value, and the reasons of that value."""

    name: str
    value: str
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class Choice:
    """A surface that could be peened instead.

    Attributes:
        name: the value for --target.
        text: its area, and its number of faces.
        place: a place on it [mm], in the frame of the part's file; "" for one that the file names.
        alone: the names of its single faces, if they are few.
        is_target: whether it is the proposed target, or an end of it is left bare.
    """

    name: str
    text: str
    place: str
    alone: str
    is_target: bool


@dataclass(frozen=True)
class ProposalInWords:
    """A proposal in words, for a terminal and for the page.

    Attributes:
        sentence: what is proposed.
        rows: the proposed values with their reasons, in the order in which a shop asks.
        matters: what somebody has to look at, the most urgent first.
        choices: surfaces to choose a target from.
        poses: poses, the quickest first, where pilots compared them.
        trials: balls of several sizes, where pilots compared them.
    """

    sentence: str
    rows: tuple[Row, ...]
    poses: Table | None
    trials: Table | None
    matters: tuple[Matter, ...]
    choices: tuple[Choice, ...]


def proposal_in_words(made: Proposal, left_out: Sequence[LeftOut]) -> ProposalInWords:
    """Return a proposal in words.

    Args:
        left_out: what may be left out of the target, or is peened beside it.
    """
    rows = []
    for name, value, keys in _rows(made):
        reasons: list[str] = []
        for key in keys:
            reason = one_line(made.reasons.get(key, ""))  # its beginning may be the row's value
            why, _ = clauses(re.sub(f"^{re.escape(value)}[:;] ", "", reason))
            if why and why != [value]:
                of = f"{in_words(key.rpartition('.')[2])}: " if key.endswith("_mm") else ""
                reasons.append(f"{of}{'; '.join(why)}")
        rows.append(Row(name, value, tuple(reasons)))
    target = _target(made)
    return ProposalInWords(
        _sentence(made),
        tuple(rows),
        _poses(made) if made.poses else None,
        _trials(made) if made.trials else None,
        tuple(map(as_sentence, to_settle(made, left_out))),
        tuple(_choice(_as_simulated(one, made), one.name == target) for one in made.known),
    )


def proposal_lines(told: ProposalInWords, verbose: bool) -> list[Table | str]:
    """Return a proposal in lines of at most WIDTH columns, and tables.

    Args:
        verbose: what is simulated is told too, and all surfaces are listed.
    """
    lines: list[Table | str] = [*wrapped(told.sentence, 0), ""]
    for row in told.rows:
        if verbose or row.name != SIMULATED:
            lines += wrapped(f"{row.name:{INDENT}}{row.value}", INDENT)
            for reason in row.reasons:
                lines += wrapped(f"{'':{INDENT}}{reason}", INDENT)
    for table in filter(None, (told.poses, told.trials)):
        lines += ["", *wrapped(f"{table.caption}:", 0), table]
    numbered = enumerate(told.matters, 1)
    for urgency, matters in groupby(numbered, lambda one: one[1].urgency):
        lines += ["", f"{urgency.in_words}:"]
        for number, matter in matters:
            lines += wrapped(f"{number:2}. {matter.sentence}", 4)
    if told.trials or any("suit" in reason for row in told.rows for reason in row.reasons):
        lines += ["", *wrapped(SUITS, 0)]
    most = len(told.choices) if verbose else MOST_LISTED
    return [*lines, "", *choice_lines(told.choices, most)]


def as_sentence(matter: Matter) -> Matter:
    """Return a matter as a whole sentence in one line."""
    text = one_line(matter.text)
    return replace(matter, text=text if text.endswith(".") else f"{text}.")


def choices_of(known: Sequence[Surface]) -> list[Choice]:
    """Return the surfaces that a target can be chosen from, of which none is proposed yet."""
    return [_choice(one, False) for one in known]


def _as_simulated(one: Surface, made: Proposal) -> Surface:
    """Return a surface, with its area as it is simulated if it is the whole target of a proposal.

    Rounds that are divided along the surface behind their facets are a little larger.
    """
    if made.tables["part.target"] != one.keys or made.settings > 1:
        return one
    mesh = made.mesh
    told = area_in_mm2(float(areas(mesh.vertices, mesh.triangles)[one.triangles].sum()))
    return replace(one, text=one.text.replace(told, area_in_mm2(_target_area(made))))


def _target_area(made: Proposal) -> float:
    """Return the area of the target as it is simulated [m²]."""
    part = made.chamber.part
    return float(part.area[part.target].sum())


def _choice(one: Surface, is_target: bool) -> Choice:
    place = str(one.keys["faces"][0]["at_mm"]) if "faces" in one.keys else ""
    return Choice(one_line(one.name), one.text, place, one.alone, is_target)


def choice_lines(choices: Sequence[Choice], most: int) -> list[str]:
    """Return lines with at most `most` of the surfaces to choose a target from."""
    lines = []
    for one in choices[:most]:
        place = f", one at {one.place} mm" if one.place else ""
        alone = f"; {one.alone}" if one.alone else ""
        lines += wrapped(f"  {one.name}: {one.text}{place}{alone}", 4)
    more = [f"  and {len(choices) - most} more: --target pick"] if len(choices) > most else []
    frame = ", places in the part's file" if any(one.place for one in choices[:most]) else ""
    return [f"Surfaces to choose from (--target){frame}:", *lines, *more]


def time_in_words(seconds: float) -> str:
    """Return a time in the unit in which it is set on a machine, as "90 min"."""
    if seconds < 2 * MINUTE:
        return f"{plain(seconds, 3)} s"
    if seconds < 3 * HOUR:
        return f"{plain(seconds / MINUTE, 3)} min"
    return f"{plain(seconds / HOUR, 3)} h"


def _sentence(made: Proposal) -> str:
    """Return what is proposed in one sentence."""
    design = made.design
    balls = " and then ".join(_balls(made))
    area = area_in_mm2(_target_area(made))
    strips = each = ""
    if made.strips is not None:
        count = made.settings
        one = f"in setting {made.strips.chosen + 1} of {count}"
        strips = f", {f'in each of {count} settings' if made.strips.are_alike else one}"
        each = " in each setting"
    target = _in_short(one_line(_target(made)))
    if target == BEVELS:
        target = f"the welds ({target})"
    if beside_mm := design.part.target.beside_mm:
        target += f" and {plain(beside_mm)} mm beside them"
    return (
        f"Peen {target} ({area}{strips}) of {one_line(design.part.mesh_path.name)} for "
        f"{_time(made)}{each} with {balls}, the sonotrode at "
        f"{design.sonotrode.zero_to_peak_um:g} µm zero-to-peak.{_intensity(made)}"
    )


def _in_short(target: str) -> str:
    """Return the name of a target with its numbered faces as one list.

    >>> _in_short("face 1, face 6, face 7")
    'faces 1, 6 and 7'
    """
    numbers = re.findall(r"(?:^|, )face ([\d.]+)(?=, |$)", target)
    if len(numbers) < 2 or target != ", ".join(f"face {one}" for one in numbers):
        return target
    return f"faces {', '.join(numbers[:-1])} and {numbers[-1]}"


def _intensity(made: Proposal) -> str:
    """Return a sentence on the expected intensity beside the usual or wanted one, if known."""
    expected, usual = made.expected, made.usual
    if expected is None:
        return ""
    text = f" Almen intensity about {plain(expected.value, 2)} mmA{expected.factor_in_words}"
    if usual is None:
        return f"{text}."
    kind = "usual" if made.design.process.intensity_mmA is None else "wanted"
    aim = f"{usual.low:g} to {usual.high:g} mmA"
    standing = expected.standing((usual.low, usual.high))
    if standing == NOT_DECIDED:
        return f"{text}; {kind}: {aim}. Strips decide."
    return f"{text}, {standing} the {kind} {aim}."


def _time(made: Proposal) -> str:
    """Return the treatment time in words, and that it is a start where no pilot told it.

    It is one too where a pilot did not tell single places apart.
    """
    _, matters = clauses(made.reasons.get("process.treatment_time_s", ""))
    time = time_in_words(made.design.process.treatment_time)
    starts = (MatterKind.NOT_MEASURED, MatterKind.TIME_NOT_RESOLVED)
    is_start = any(one.kind in starts for one in matters)
    return f"{time} (a start)" if is_start else time


def _target(made: Proposal) -> str:
    """Return the name of the proposed target."""
    return made.reasons["part.target"].partition(": ")[0]


def _rows(made: Proposal) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Yield name and value of each row, and the keys whose reasons belong to it."""
    tables, design = made.tables, made.design
    yield "target", one_line(_target(made)), ("part.target", "part.target.reachable")
    yield "part", f"{tables['materials']['part']}", ("part.unit", "materials.part")
    pose = made.reasons.get("part.rotate_deg", "").partition(": ")[0]
    yield "pose", pose, ("part.rotate_deg", "effects.part_turn")
    chamber = dict(tables["chamber"])
    shape = chamber.pop("shape", "cylinder")
    end = walls_end_at(find_openings(made.chamber))
    if end is not None:  # they are built so high; those of the file go on into the part
        chamber["height_mm"] = round(1e3 * end, 2)
    sizes = ", ".join(f"{in_words(key)} {value:g}" for key, value in _numbers(chamber))
    yield "chamber", f"{shape}: {sizes} mm", tuple(f"chamber.{key}" for key in chamber)
    face = design.sonotrode.face or made.sonotrode.face
    yield "sonotrode", face.in_words, tuple(f"sonotrode.{key}" for key in tables["sonotrode"])
    for table, name in (("holder", "held by"), ("mask", "masked by")):
        own = {key: one for key, one in tables.items() if key.partition(".")[0] == table}
        if own:
            made_by = {"axis": "pad", "thickness_mm": "shell"}  # kinds of masks
            kind = next((text for key, text in made_by.items() if key in own.get(table, {})), "")
            kind = own.get(table, {}).get("kind", kind)
            sizes = ", ".join(
                f"{'flange ' * (kind == 'arbor' and key != 'grip_mm')}{in_words(key)} {value:g} mm"
                for one in own.values()
                for key, value in _numbers(one)
                if kind != "bore"  # its clearance is among the reasons: a seal, no clamp
            )
            keys = tuple(f"{one}.{key}" for one, values in own.items() for key in values)
            value = ", ".join(filter(None, (KINDS.get(kind, str(kind)), sizes)))
            whys = [why for key in keys for why in clauses(made.reasons.get(key, ""))[0]]
            yield name, value or next(iter(whys), "see the design"), keys
    balls = ", then ".join(_balls(made))
    yield "balls", balls, ("shot.diameter_mm", "shot.mass_g", "shot.material")
    yield "time", _time(made), ("process.treatment_time_s", "process.coverage_percent")
    if ".steps" in made.reasons:
        yield "steps", made.reasons[".steps"].partition(": ")[0], (".steps",)
    if INTENSITY in made.reasons:
        value = clauses(made.reasons[INTENSITY])[0][0].partition(": ")[0]
        yield "intensity", value, (INTENSITY,)
        yield "strips", _strips(made), ()
    accuracy = design.process.accuracy
    simulated = f"{accuracy.replicas} replicas of {plain(accuracy.simulated_time, 3)} s"
    keys = tuple(f"process.accuracy.{key}" for key in tables["process.accuracy"])
    yield SIMULATED, simulated, keys


def _strips(made: Proposal) -> str:
    """Return in words which strips or what else tells the intensity of a proposal."""
    kind = strip_to_measure(made.design.process.intensity_mmA, made.expected)
    held = held_strip(made.design, made.chamber, kind)
    by_dents = "accept a part by its coverage, for which the process sheet names places and shares"
    if held is None or held.size is None:
        why = "no lid of this chamber takes one" if held is None else held.why_no_whole
        return f"{why}: {by_dents}, and the intensity by a coupon of its metal"
    place = (
        f"in the lid in place of the part, {plain(held.level_mm)} mm from the sonotrode as the "
        f"middle of the target is: chamberopt strip {held.options}"
    )
    if held.is_whole:
        return f"{kind} strips {place}"
    return (
        f"{held.why_no_whole}: pieces of {held.size_in_words} cut from {kind} strips, {place}; "
        f"their arc heights are no mm{kind} until they are correlated with whole strips: {by_dents}"
    )


def _balls(made: Proposal) -> Iterator[str]:
    """Yield the charge of balls of each size, in the order in which they are taken."""
    material, seen = made.tables["shot"]["material"].replace("_", " "), set()
    for one in made.design.in_steps.values():
        size = 1e3 * one.shot.diameter
        if size not in seen:
            seen.add(size)
            yield f"{one.shot.count:,} balls of {size:g} mm ({material}, {1e3 * one.shot.mass:g} g)"


def _poses(made: Proposal) -> Table:
    """Return a table of the poses that pilots compared, the quickest first."""
    several = any(one.sonotrode_count > 1 for one in made.poses)
    turns = any(one.settings > 1 for one in made.poses)
    after = "98 % after, a setting" if turns else "98 % after"
    head = ["pose", after, "intensity", "sonotrodes"][: 3 + several]
    head += ["settings"] * turns + ["what became of it"]
    rows = []
    for one in sorted(made.poses, key=lambda one: (one.time_to_98 or math.inf) * one.settings):
        strong = f"{plain(one.intensity.value, 2)} mmA" if one.intensity else "not known"
        row = [one.pose, _after(one), strong]
        row += [str(one.sonotrode_count)] * several + [str(one.settings)] * turns
        rows.append([*row, one.outcome or ("slower" if one.time_to_98 else "no pilot")])
    text = "Poses that pilots compared, before balls and amplitude were chosen"
    return Table(text, head, rows, numbers=False)


def _after(one: BallTrial | PoseTrial) -> str:
    """Return in words after which time the target is covered by a pilot."""
    if not one.time_to_98:
        return "not known"
    return f"{rounded(one.time_to_98, 2)} s" + " on average" * (not one.is_of_places)


def _trials(made: Proposal) -> Table:
    """Return a table of the balls that pilots compared, one row a size."""
    taken = {round(1e3 * one.shot.diameter, 4) for one in made.design.in_steps.values()}
    several = any(one.sonotrode_count > 1 for one in made.trials)
    head = ["balls", "touch", "suit", "amplitude", "intensity", "98 % after", "number"]
    head += ["sonotrodes"] * several
    rows = []
    for one in made.trials:
        known = one.intensity
        row = [
            f"{one.ball_mm:g} mm" + ", taken" * (one.ball_mm in taken),
            f"{one.fit.touched:.0%}",
            f"{one.fit.served:.0%}",
            f"{one.amplitude_um:g} µm",
            f"{plain(known.value, 2)} mmA" if known else "not known",
            "not tried" if one.harm else _after(one),
            f"{one.count:,}",
        ]
        rows.append(row + [str(one.sonotrode_count)] * several)
    untried = "".join(f"; {x.ball_mm:g} mm not tried: {x.harm}" for x in made.trials if x.harm)
    text = f"Balls that pilots compared, each size in a chamber of its own{untried}"
    return Table(text, head, rows)


def _numbers(table: Mapping[str, object]) -> Iterator[tuple[str, float]]:
    for key, value in table.items():
        if isinstance(value, int | float) and not isinstance(value, bool) and key.endswith("_mm"):
            yield key, float(value)


def wrapped(text: str, indent: int) -> list[str]:
    """Return a text in lines of at most WIDTH columns, all but the first one indented."""
    leading = len(text) - len(text.lstrip())
    lines = textwrap.wrap(
        held_together(text.strip()),
        WIDTH,
        initial_indent=" " * leading,
        subsequent_indent=" " * indent,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [one.replace(NO_BREAK, " ") for one in lines] or [""]

"""Text for a terminal at the end of `new`: what is proposed, and what is to be settled first.

The reasons of a proposal's values say what has to be settled in clauses that begin with words in
capitals, such as NOT MASKED or LONG. They are one list here, and stand in the design file beside
the values with all other reasons.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from chamberopt.chamber.propose.proposed_intensity import INTENSITY
from chamberopt.chamber.propose.proposed_target import area_in_mm2
from chamberopt.common.errors import one_line
from chamberopt.common.key_words import in_words
from chamberopt.common.number_text import plain

if TYPE_CHECKING:
    from chamberopt.chamber.propose.proposal import Proposal
    from chamberopt.chamber.propose.proposed_mask import LeftOut
    from chamberopt.chamber.propose.proposed_target import Surface

WIDTH, INDENT = 79, 13  # columns
MOST_LISTED = 6  # surfaces, without --verbose
TO_SETTLE = re.compile(r"[A-Z][A-Z-]+(?: [A-Z-]{2,})*\b")  # at the beginning of a clause
NO_MATTER = ("ZERO-TO-PEAK", "PEAK-TO-VALLEY", "WIDER", "SAE ")  # no matter of the shop
SIMULATED = "simulated"  # the row that is told with --verbose alone
KINDS = {"bore": "the part itself, out through a wall"}  # of holders, in words
MINUTE, HOUR = 60.0, 3600.0  # s


class _Row(NamedTuple):
    """What is told of a proposal under one name: its value, and the values whose reasons follow."""

    name: str
    value: str
    keys: tuple[str, ...]


def proposal_end(made: Proposal, left_out: Sequence[LeftOut], verbose: bool) -> list[str]:
    """Return the end of the command that proposed a design: a sentence, its values, what to settle.

    Args:
        left_out: what may be left out of the target, or is peened beside it.
        verbose: what is simulated is told too, and all surfaces are listed.
    """
    lines, settle = [*_sentence(made), ""], []
    for row in _rows(made):
        told = wrapped(f"{row.name:{INDENT}}{row.value}", INDENT)
        for key in row.keys:
            reason = one_line(made.reasons.get(key, ""))  # its beginning may be the row's value
            why, first = clauses(re.sub(f"^{re.escape(row.value)}[:;] ", "", reason))
            settle += first
            if why and why != [row.value]:
                of = f"{in_words(key.rpartition('.')[2])}: " if key.endswith("_mm") else ""
                told += wrapped(f"{'':{INDENT}}{of}{'; '.join(why)}", INDENT)
        lines += told if verbose or row.name != SIMULATED else []
    for one in left_out:
        keys = " and ".join(f"part.target.{key}" for key in one.keys)
        leave = f": {keys} in the design leave it out" if keys else ""
        settle.append(f"{one.text}{leave}")
    if settle:
        lines += ["", "To be settled before it is built:"]
        for number, text in enumerate(settle, 1):
            lines += wrapped(f"{number:2}. {_as_sentence(one_line(text))}", 4)
    return [*lines, "", *surface_lines(made.known, len(made.known) if verbose else MOST_LISTED)]


def clauses(reason: str) -> tuple[list[str], list[str]]:
    """Return the clauses of a reason: why a value is so, and what is to be settled about it."""
    why: list[str] = []
    settle: list[str] = []
    for clause in filter(None, reason.split("; ")):
        found = TO_SETTLE.match(clause)
        marks = found is not None and len(found[0]) > 3 and not found[0].startswith(NO_MATTER)
        (settle if marks else why).append(clause)
    return why, settle


def surface_lines(known: Sequence[Surface], most: int) -> list[str]:
    """Return lines with at most `most` surfaces of the part to choose a target from."""
    lines = []
    for one in known[:most]:
        place = f", one at {one.keys['faces'][0]['at_mm']} mm" if "faces" in one.keys else ""
        alone = f"; {one.alone}" if one.alone else ""
        lines += wrapped(f"  {one_line(one.name)}: {one.text}{place}{alone}", 4)
    more = [f"  and {len(known) - most} more: --target pick"] if len(known) > most else []
    return ["Surfaces to choose from (--target):", *lines, *more]


def time_in_words(seconds: float) -> str:
    """Return a time in the unit in which it is set on a machine, as "90 min"."""
    if seconds < 2 * MINUTE:
        return f"{plain(seconds, 3)} s"
    if seconds < 3 * HOUR:
        return f"{plain(seconds / MINUTE, 3)} min"
    return f"{plain(seconds / HOUR, 3)} h"


def _sentence(made: Proposal) -> list[str]:
    """Return what is proposed in one sentence."""
    design, part = made.design, made.chamber.part
    balls = " and then ".join(_balls(made))
    target = made.reasons["part.target"].partition(": ")[0]
    area = area_in_mm2(float(part.area[part.target].sum()))
    return wrapped(
        f"Peen {one_line(target)} ({area}) of {one_line(design.part.mesh_path.name)} for "
        f"{time_in_words(design.process.treatment_time)} with {balls}, the sonotrode at "
        f"{design.sonotrode.zero_to_peak_um:g} µm zero-to-peak.",
        0,
    )


def _rows(made: Proposal) -> Iterator[_Row]:
    """Yield what is told of a proposal, in the order in which a shop asks."""
    tables, design = made.tables, made.design
    target = made.reasons["part.target"].partition(": ")[0]
    yield _Row("target", one_line(target), ("part.target", "part.target.reachable"))
    yield _Row("part", f"{tables['materials']['part']}", ("part.unit", "materials.part"))
    pose = made.reasons.get("part.rotate_deg", "").partition(": ")[0]
    yield _Row("pose", pose, ("part.rotate_deg", "effects.part_turn"))
    chamber = dict(tables["chamber"])
    shape = chamber.pop("shape", "cylinder")
    sizes = ", ".join(f"{in_words(key)} {value:g}" for key, value in _numbers(chamber))
    yield _Row("chamber", f"{shape}: {sizes} mm", tuple(f"chamber.{key}" for key in chamber))
    blocks = design.sonotrode.blocks
    face = made.sonotrode.in_words if blocks is None else blocks.in_words
    yield _Row("sonotrode", face, tuple(f"sonotrode.{key}" for key in tables["sonotrode"]))
    for table, name in (("holder", "held by"), ("mask", "masked by")):
        own = {key: one for key, one in tables.items() if key.partition(".")[0] == table}
        if own:
            sizes = ", ".join(
                f"{in_words(key)} {value:g} mm"
                for one in own.values()
                for key, value in _numbers(one)
            )
            kind = own.get(table, {}).get("kind", "pad" if "axis" in own.get(table, {}) else "")
            keys = tuple(f"{one}.{key}" for one, values in own.items() for key in values)
            value = ", ".join(filter(None, (KINDS.get(kind, str(kind)), sizes)))
            whys = [why for key in keys for why in clauses(made.reasons.get(key, ""))[0]]
            yield _Row(name, value or next(iter(whys), "see the design"), keys)
    balls = ", then ".join(_balls(made))
    yield _Row("balls", balls, ("shot.diameter_mm", "shot.mass_g", "shot.material"))
    time = time_in_words(design.process.treatment_time)
    yield _Row("time", time, ("process.treatment_time_s", "process.coverage_percent"))
    if ".steps" in made.reasons:
        yield _Row("steps", made.reasons[".steps"].partition(": ")[0], (".steps",))
    if INTENSITY in made.reasons:
        value = clauses(made.reasons[INTENSITY])[0][0]
        yield _Row("intensity", value, (INTENSITY,))
    accuracy = design.process.accuracy
    simulated = f"{accuracy.replicas} replicas of {plain(accuracy.simulated_time, 3)} s"
    keys = tuple(f"process.accuracy.{key}" for key in tables["process.accuracy"])
    yield _Row(SIMULATED, simulated, keys)


def _balls(made: Proposal) -> Iterator[str]:
    """Yield the charge of balls of each size, in the order in which they are taken."""
    material, seen = made.tables["shot"]["material"], set()
    for one in made.design.in_steps.values():
        size = 1e3 * one.shot.diameter
        if size not in seen:
            seen.add(size)
            yield f"{one.shot.count:,} balls of {size:g} mm ({material}, {1e3 * one.shot.mass:g} g)"


def _numbers(table: Mapping[str, object]) -> Iterator[tuple[str, float]]:
    for key, value in table.items():
        if isinstance(value, int | float) and not isinstance(value, bool) and key.endswith("_mm"):
            yield key, float(value)


def _as_sentence(text: str) -> str:
    return text if text.endswith(".") else f"{text}."


def wrapped(text: str, indent: int) -> list[str]:
    """Return a text in lines of at most WIDTH columns, all but the first one indented."""
    leading = len(text) - len(text.lstrip())
    lines = textwrap.wrap(
        text.strip(),
        WIDTH,
        initial_indent=" " * leading,
        subsequent_indent=" " * indent,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return lines or [""]

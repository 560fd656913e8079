"""Compose a process sheet of a result: what an operator sets, expects and measures."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from chamberopt.chamber.checks.openings import PLATE, thin_ribs
from chamberopt.chamber.checks.place_names import CEILING
from chamberopt.chamber.fixture import plugs_in_words, size_in_words
from chamberopt.chamber.layout.pose import axis_down
from chamberopt.common.estimate import NOT_RESOLVED, Estimate
from chamberopt.common.key_words import in_words, key_in_words, title_with_unit, unit_of
from chamberopt.common.number_text import estimate_text, rounded
from chamberopt.design.calibration import why_no_intensity
from chamberopt.design.fixture import joint_in_words, slit_in_words, slit_mm
from chamberopt.design.intensity import PredictedIntensity, WantedIntensity
from chamberopt.design.materials import alloys, find
from chamberopt.design.tolerances import USUAL, USUAL_IN_WORDS, tolerance_box
from chamberopt.documents.answer import answer, answer_lines, shot_lines
from chamberopt.documents.coverage import figures
from chamberopt.documents.document import Block, Document, Section, Sentence, Table
from chamberopt.documents.ranges import time_at_slow_end
from chamberopt.documents.report import limits_of_intervals, open_matters, open_warnings
from chamberopt.documents.study import exposed_target
from chamberopt.documents.tolerances import sheet_rows
from chamberopt.documents.wanted import intensity_lines, time_lines, wanted_rows
from chamberopt.documents.wording import keys_in_words, metric_label, per_cent, plain, value_text
from chamberopt.documents.zones import turned
from chamberopt.peening.strip import StripSize
from chamberopt.peening.strip_holder import why_no_strip
from chamberopt.results.load import load_start

if TYPE_CHECKING:
    from chamberopt.chamber.checks.openings import Mounting, Opening
    from chamberopt.chamber.checks.strips import StripOfTarget
    from chamberopt.chamber.fixture import Plug
    from chamberopt.design.fixture import Holder
    from chamberopt.design.shot import ShotTable
    from chamberopt.design.sonotrode import VibratingFace
    from chamberopt.documents.coverage import Figure
    from chamberopt.results.load import Result

# Why a process sheet must not be relied on as it stands (in red, above its drawing), and how the
# simulation differs from the machine, in words for a workshop.

TIME = "time_to_98_s"
WIDEST_FACE = 90.0  # mm: larger faces need slots or are several (chamber/usual_shop.toml)
SQUARE = 0.999  # cosine between a wall's normal and an axis above which the wall is named by it
EDGE, CLAMPED = 5e-5, 3e-3  # m: narrower openings are none; jaws take what stands out so far
LEAST_SLIT_MM = 0.2  # of both sides of a face, by heart: it vibrates and must touch nothing
# What is for who designs: options of commands, and how well a rule is founded.
OF_COMMANDS = r" \((?:[^()]*--[^()]*|no source read)\)"
LEAST_MISSED = 5e-4  # share of the target out of reach that is told
SAME_MM = 0.02  # lengths that differ by less count as equal
GUIDED = "guide it there in a bushing, stopped along its axis"  # of a part that turns
MOUNTED: dict[Mounting, str] = {
    "part goes in": "the part goes in from outside",
    "wall goes over": "the wall goes over it from outside",
    "split": "split the wall there",
}


def alarms(result: Result) -> Iterator[str]:
    """Yield the reasons not to use the sheet as it stands.

    They are matters that are to be settled first, figures that are not resolved, balls that jam, a
    shot that had not settled, a time that leaves the target bare or is too short for the wanted
    coverage, and an intensity outside of its range.
    """
    if count := len(open_matters(result)):
        yield (
            f"{count} matter{'s are' if count > 1 else ' is'} to be settled before this is built: "
            "see Warnings."
        )
    told = _expected_figures(result)
    if result.design.calibration is None:  # without one they are rough, resolved or not
        told = [row for row in told if row.name not in OF_STRIPS]
    unresolved = [row.label.text for row in told if _is_unresolved(row.result)]
    if unresolved:
        yield (
            f"Too few dents were simulated to resolve: {', '.join(unresolved)}. Simulate "
            "longer, or with more replicas, before this is built."
        )
    said = [*shot_lines(result), *time_lines(result)[:1]]
    said += intensity_lines(result.design, result.metrics)
    yield from (one.text for one in said if one.warns)


def _wide_face(result: Result, face_mm: tuple[float, ...]) -> Iterator[str]:
    """Yield a sentence if the face is larger than usual, and its amplitude was not measured."""
    face = result.design.sonotrode.face
    widest = max(face_mm if face is None else face.block_mm)
    if widest > WIDEST_FACE and result.design.sonotrode.amplitude_profile is None:
        yield (
            f"The face, {_size(face_mm)}, is larger than usual sonotrodes, and was simulated as "
            "one that moves alike all over. If yours is smaller, set several side by side or peen "
            "a strip at a time; if it has slots, measure its amplitude over the face."
        )


def _unusual_intensity(result: Result, usual: WantedIntensity | None) -> Iterator[str]:
    """Yield a sentence if an intensity that nobody asked for is expected off the usual range."""
    design = result.design
    found = PredictedIntensity.of(result.metrics, design.calibration)
    if usual is None or found is None or design.process.intensity_mmA is not None:
        return
    if off := usual.off(found.value):
        yield (
            f"The expected Almen intensity, {plain(found.value, 2)} mmA, is "
            f"{'below' if off < 0.0 else 'above'} {_range_text(usual)}, {usual.text}: agree on it, "
            "or ask for another one (process.intensity_mmA)."
        )


def _range_text(usual: WantedIntensity) -> str:
    return f"{plain(usual.low)} to {plain(usual.high)} mmA"


def _size(face_mm: tuple[float, ...]) -> str:
    """Return the size of a sonotrode's face in words: of a disc its diameter alone."""
    return f"{'Ø ' if len(face_mm) == 1 else ''}{' × '.join(map(plain, face_mm))} mm"


def _is_unresolved(figure: Estimate) -> bool:
    return figure.in_words == NOT_RESOLVED


def cautions(result: Result) -> Iterator[str]:
    """Yield warnings for the operator.

    The warnings say how the simulation differs from the machine, and which goals are not reached.
    """
    yield from (one.text for one in time_lines(result)[1:])
    if result.design.effects.friction is None:
        yield (
            "Simulated without friction, as asked. With it the shot was 22 to 47 % slower in a "
            "cylinder (mu 0.1 to 0.5), and coverage takes longer: rely on these times only once "
            "the coverage measured first agrees."
        )
    if result.record.chamber.facets_left:
        yield (
            "The part's file has coarse facets in the place of its rounds, which were not divided: "
            "coverage and times are those of the facets."
        )
    if result.record.chamber.pieces_in_air:
        yield "The part is held in the air: nothing holds it, a holder of the design would."
    study = result.study
    if ends := study.on_bounds if study and not study.keeps_start else []:
        yield (
            f"The search ended on its bounds of {', '.join(map(key_in_words, ends))}: a better "
            "chamber may lie beyond."
        )


MOST_ROWS = 4  # sizes of shot, or further sonotrodes; the report has all of them
MOST_KEYS = 8  # numbers of the chamber
DIGEST = 12  # characters of a digest in the title block
REVISION = "revision"
TO_FILL = ("drawing no.", REVISION, "drawn by, date", "checked by, date", "set up by, date")
DESIGN_OF = {
    "study": "best.toml",
    "simulation": "design.toml",
}  # file of the sheet's design, by kind
REQUALIFY = (
    "Requalify after: another sonotrode, chamber, holder, lot of parts or balls; a number out of "
    "tolerance; a program version that moved figures."
)
EXPECTED = (
    "mean_coverage",
    "p05_coverage",
    "time_to_98_s",
    "exposure",
    "almen_intensity",
    "almen_intensity_p05",
    "almen_intensity_p95",
    "strength_um",
    "saturation_time_s",
    "compression_depth_um",
)
OF_STRIPS = ("strength_um", "saturation_time_s", "compression_depth_um")
# Of the expected saturation time, after which strips are peened: a curve has at least four points,
# one of them at twice that time or later (SAE J443).
STRIP_TIMES = (0.25, 0.5, 1.0, 2.0)
DROP_SPEED = 3.0  # m/s, the speed of a ball that falls 0.46 m; docs/how_to/calibrate.md
SHEETS_OF = {
    "study": "The best chamber of a study, confirmed on fresh seeds",
    "simulation": "One simulated chamber",
}
KINDS = ("arc heights", "coverage", "dent diameters", "ball drops", "amplitude", "impact rates")

Row = tuple[str, str]  # a name and its value, or "" and a sentence


class AsBuilt(NamedTuple):
    """What a sheet says of the built chamber that its design does not give in numbers."""

    face_mm: tuple[float, ...]  # of the sonotrode: a diameter, or two sides
    openings: Sequence[Opening] = ()  # through which the part goes out
    mountings: Sequence[Mounting] = ()  # of each of them, if they are known
    strip: StripOfTarget | None = None  # if the target is peened a strip at a time
    plugs: Sequence[Plug] = ()  # of the mask
    usual: WantedIntensity | None = None  # Almen intensity of its metal and thickness
    later: Sequence[Sequence[Opening]] = ()  # openings in each further step
    level_mm: int | None = None  # of the target above the sonotrode, where strips are set
    radii: Sequence[float] = ()  # of the fillets that are the target [m]


def process_sheet(result: Result, built: AsBuilt, revision: str = "") -> Document:
    """Return the process sheet of a result as a document.

    Without a revision its field is left to be filled in.

    Its sections are the first page, with sentences of the kind "warning" for the top; tables that
    may go on further pages; and the title block, where a name without a value is to be filled in.

    """
    record = result.record
    start = load_start(result)
    checks, calibrated = first_checks(result, built.level_mm), calibrated_to(result)
    reasons = (
        *alarms(result),
        *_unusual_intensity(result, built.usual),
        *_wide_face(result, built.face_mm),
    )
    red = [Sentence(text, "warning") for text in reasons]
    requalify = Sentence(REQUALIFY)
    content: list[Block] = [*red, *setting_tables(result, built), checks, *calibrated, requalify]
    name = f"{result.design.part.mesh_path.name}: {result.folder.resolve().name}"
    fields = title_block(result, name) | ({REVISION: revision} if revision else {})
    block = Table("", (), [*fields.items()], numbers=False)
    return Document(
        name,
        f"{SHEETS_OF[record.kind]}; simulated {record.created[:10]}",
        answer(result, start),
        (),
        [
            Section("Process sheet", content),
            Section("Measurements, limits and warnings", limit_tables(result)),
            Section("Title block", [block]),
        ],
    )


def title_block(result: Result, name: str) -> dict[str, str]:
    """Return the fields of the title block. Those without a value are for the shop to fill in."""
    record = result.record
    return {
        "design": name,
        "chamberopt, simulated": f"{record.versions['chamberopt']}, {record.created[:10]}",
        "replicas, first seed": f"{record.replicas}, {result.seeds[0]}",
        "part, sha256": record.part_sha256[:DIGEST],
        "design, sha256": design_sha256(result)[:DIGEST],
        "result, sha256": record.sha256[:DIGEST],
        **dict.fromkeys(TO_FILL, ""),
    }


def design_sha256(result: Result) -> str:
    """Return the digest of the file of the sheet's design in the results folder."""
    return result.record.files.get(DESIGN_OF[result.record.kind], "")


def chamber_limits(result: Result) -> dict[str, tuple[float, float, float]]:
    """Return value, least and largest value of each key of [chamber] that has a tolerance."""
    box = tolerance_box(result.design)
    return {
        name.removeprefix("chamber."): (result.design.value(name), *ends)
        for name, ends in box.items()
        if name.startswith("chamber.")
    }


def slit_limits(result: Result) -> dict[str, tuple[float, float, float]]:
    """Return value, least and largest value of each key of [chamber] as wide as the sonotrode.

    A wall round the sonotrode's face stands beside it by a slit, which is not simulated.
    """
    face, chamber = result.design.sonotrode.face, result.design.chamber
    if face is None:
        return {}
    long, wide = face.sides_mm
    sides = {"diameter_mm": face.diameter_mm}
    if face.diameter_mm is None:
        sides = {"length_mm": long, "width_mm": wide}
    slit = 2.0 * slit_mm(1e3 * min(result.design.ball_diameters))
    least = min(LEAST_SLIT_MM, 0.5 * slit)
    return {
        key: (side, side + least, side + slit)
        for key, side in sides.items()
        if side is not None and abs(getattr(chamber, key, math.inf) - side) < SAME_MM
    }


def _over_face(result: Result) -> str:
    """Return in words along which sides of the chamber its walls end over a larger face."""
    face, chamber = result.design.sonotrode.face, result.design.chamber
    if face is None or face.diameter_mm is not None or chamber.shape != "box":
        return ""
    sides = zip(("length_mm", "width_mm"), face.sides_mm, strict=True)
    over = [in_words(key) for key, side in sides if getattr(chamber, key) < side - SAME_MM]
    return " and the ".join(over)


def setting_tables(result: Result, built: AsBuilt) -> list[Table]:
    """Return tables on the part, the chamber, its settings and the figures to expect.

    A row with an empty name holds a sentence.
    """
    return _tables([
        ("Part and pose", _part(result, built)),
        ("Chamber", _chamber(result, built)),
        ("Sonotrode", _sonotrode(result, built.face_mm)),
        ("Shot", _shot(result)),
        ("Steps", _steps(result, built)),
        ("To peen a part", _run(result)),
        ("Peening, and what to expect", _expected(result, built.usual)),
    ])  # fmt: skip


def limit_tables(result: Result) -> list[Table]:
    """Return tables on limits, tolerances, and everything that the process is warned of."""
    return _tables([
        ("Zones and limits", _zones(result)),
        ("Tolerances", _tolerances(result)),
        ("Not in these figures", (("", text) for text in cautions(result))),
        ("Warnings", _warnings(result)),
    ])  # fmt: skip


def _tables(found: Sequence[tuple[str, Iterator[Row]]]) -> list[Table]:
    """Return tables of names and values, without those that have no row."""
    tables = [Table(title, (), [*rows], numbers=False) for title, rows in found]
    return [one for one in tables if one.rows]


def _part(result: Result, built: AsBuilt) -> Iterator[Row]:
    strip = built.strip
    part, turn = result.design.part, result.design.effects.part_turn
    yield "part", part.mesh_path.name
    yield "metal", _metal(result)
    if result.design.chamber.shape == "imported":
        yield "pose", "as drawn with its chamber"
    else:
        down = axis_down(part.rotate_deg).replace("-", "−")
        pose = [turned(part.rotate_deg) or "as in its file", f"{down} down" if down else ""]
        yield "turned", ": ".join(filter(None, pose))
        x, y = part.offset_mm
        yield "offset from the axis", f"x {plain(x)} mm, y {plain(y)} mm" if x or y else "none"
        text = f"{plain(result.design.chamber.sonotrode_distance_mm)} mm"
        yield "sonotrode to lowest point", _limited(result, "chamber.sonotrode_distance_mm", text)
    if turn is not None:
        swing = (
            f"{plain(turn.angle_deg or 0.0)}° to each side at {plain(turn.frequency_hz or 0)} Hz"
        )
        axis = ", ".join(plain(one) for one in turn.axis)
        speed = swing if turn.rpm is None else f"{plain(turn.rpm)} turns a minute"
        yield "turns", f"{speed} about the file's axis ({axis})"
    if area := exposed_target(result):
        yield "target", area
    # A strip is told in a row of its own.
    chosen = part.target.model_copy(update={} if strip is None else {"box_mm": None})
    if words := chosen.in_words:
        radii = " and ".join(plain(1e3 * one) for one in built.radii)
        yield "target, chosen by", f"fillets of {radii} mm: {words}" if radii else words
    if strip is not None:
        yield "a strip at a time", _of_strip(strip)


def _of_strip(strip: StripOfTarget) -> str:
    """Return in words which strip of the target is peened, and how the part moves for the next."""
    low, high, length = (
        plain(round(1e3 * x, 1) + 0.0) for x in (strip.low, strip.high, strip.high - strip.low)
    )
    axis = "xyz"[strip.axis]
    return (
        f"setting {strip.before + 1} of {strip.settings}: {axis} {low} to {high} mm of its file; "
        f"the part is moved by {length} mm along that {axis} from one to the next, and each takes "
        "the peening time"
    )


def _metal(result: Result) -> str:
    """Return the part's metal and hardness in words, and how surely the hardness is known."""
    part = result.design.materials.part
    text, alloy = f"{part.alloy or 'not named'}, {plain(part.hardness_HB)} HB", None
    if part.alloy:
        alloy = find(part.alloy, alloys())
    if alloy is None or alloy.hardness_HB != part.hardness_HB:
        return f"{text}, as given"
    return f"{text}: the catalogue's, {alloy.origin}, for {alloy.condition}; measure yours"


def _limited(result: Result, name: str, text: str) -> str:
    """Return the text of a number of the design, with the range that its tolerance allows."""
    ends = tolerance_box(result.design).get(name)
    return text if ends is None else f"{text} ({' to '.join(map(plain, ends))})"


def _chamber(result: Result, built: AsBuilt) -> Iterator[Row]:
    table = result.design.chamber.model_dump(mode="json", exclude_none=True)
    wall = result.design.materials.wall.alloy
    yield "shape", PurePath(table.pop("shape")).name + (f", walls of {wall}" if wall else "")
    for key in ("sonotrode_distance_mm", "facets", "mesh", "unit"):
        table.pop(key, None)
    counted = {key: table.pop(key, ()) for key in ("holes", "deflectors")}
    rows = []
    for key, value in table.items():
        if value not in (0, 0.0, []):
            name, text = key_row(key, value)
            rows.append((name, _limited(result, f"chamber.{key}", text)))
    yield from _first(rows, "numbers", MOST_KEYS)
    for what, several in counted.items():
        if several:
            yield what, f"{len(several)}: see the report"
    yield from _fixtures(result, built)
    ball = 1e3 * min(result.design.ball_diameters)
    holder = result.design.holder
    in_bore = holder is not None and holder.clearance_mm > 0.0
    places = "round the part as above, of all other joints" if in_bore else "of joints and openings"
    slit = f"round the sonotrode {slit_in_words(ball)}"
    yield "gaps", f"{places} {joint_in_words(ball)}, or sealed; {slit}"
    if volume := result.record.chamber.volume_mm3:
        yield "free volume", f"{plain(1e-3 * volume)} cm³"


def _fixtures(result: Result, built: AsBuilt) -> Iterator[Row]:
    """Yield rows on what holds the part, where it goes out, and what masks it."""
    holder, openings = result.design.holder, built.openings
    held = "clamp it there" if result.design.effects.part_turn is None else GUIDED
    if holder is not None and holder.kind == "bore":
        play = "tight"
        if holder.clearance_mm:
            play = f"{plain(holder.clearance_mm)} mm of clearance all round, beyond the sizes below"
        yield "holder", f"the part itself, out through the wall, {play}"
    mask = result.design.mask
    if holder is None and not result.record.chamber.pieces_in_air:
        padded = mask is not None and mask.axis is not None and not openings
        out = "the mask clamps it" if padded else "the part goes out through the wall"
        yield "holder", f"none: {out}{'' if padded else f'; {held}'}"
    rows = []
    for number, way in enumerate(openings):
        frame = "" if number else " in the chamber's frame"
        how = f"; {MOUNTED[built.mountings[number]]}" if built.mountings else ""
        beyond = _beyond(way, openings, held, how)
        rows.append(("opening", f"{_of_opening(way)} at {_place(way)} mm{frame}; {beyond}"))
    yield from _first(rows, "openings")
    for rib in thin_ribs(openings):
        one, other = (f"the opening in {_wall_of(way)}" for way in (rib.one, rib.other))
        width = plain(1e3 * rib.width, 2)
        yield "no rib", f"{width} mm between {one} and {other} do not stand: cut both as one"
    faces = {"holder": holder.at if holder else None, "mask": mask.at if mask else None}
    for name, one in result.record.chamber.fixtures.items():
        size = size_in_words(one.kind, one.size_mm)
        if one.kind == "plugs":
            sizes = f"{plugs_in_words(built.plugs)}, " if built.plugs else ""
            size = f"{sizes}flush with their rims"
        text = f"{one.kind} {size or 'up to the wall'}"
        if one.length_mm:
            text += f", {plain(one.length_mm)} mm long"
        if one.place_mm and holder is not None:
            at, along = (
                ", ".join(plain(round(x, 3) + 0.0) for x in three)
                for three in (one.place_mm, holder.axis)
            )
            text += f", from ({at}) mm along ({along}) in the chamber's frame"
        if holder is not None and name == "holder":
            text += _flanges(holder) + _grip(holder)
        chosen = faces[name]
        where = f" ({', '.join(chosen.surface)})" if chosen and chosen.surface != ("all",) else ""
        yield name, f"{text}, on {plain(one.covered_mm2, 3)} mm² of the part{where}"


def _flanges(holder: Holder) -> str:
    """Return in words the flanges of an arbor, which mask the part's ends; "" without any."""
    if holder.kind != "arbor" or holder.diameter_mm is None or holder.thickness_mm is None:
        return ""
    ends = "flanges at both ends" if holder.both_sides else "a flange at the end"
    over = f", {plain(holder.grip_mm)} mm over it as a cup" if holder.grip_mm else ""
    size = f"Ø {plain(holder.diameter_mm)} × {plain(holder.thickness_mm)} mm"
    return f", with {ends} of the part, {size}{over}"


def _grip(holder: Holder) -> str:
    """Return in words how much of a collar or plate is round the part, and how it holds.

    The text is empty for other holders.
    """
    if holder.kind not in ("collar", "plate") or not holder.grip_mm:
        return ""
    return f"; {plain(holder.grip_mm)} mm of it round the part, in two halves that clamp it"


def _of_opening(one: Opening) -> str:
    """Return in words how large an opening is, and in which wall."""
    sides = [plain(round(1e3 * x, 1) + 0.0) for x in one.size]
    wall = _wall_of(one)
    if one.form == "edge" or min(one.size) < EDGE:
        return f"{sides[int(np.argmax(one.size))]} mm of {wall}, which ends on the part,"
    if one.form == "round":
        return f"round, Ø {plain(round(500.0 * sum(one.size), 1))} mm, in {wall}, its middle"
    size = f"{' × '.join(sides)} mm"
    if one.form == "other":
        section = "along the part's section" if one.outline is None else "as on the last page"
        return f"{section}, within {size}, in {wall}, its middle"
    return f"{size} in {wall}, its middle"


def _place(one: Opening) -> str:
    """Return the middle of an opening [mm] as text."""
    return f"({', '.join(plain(round(1e3 * x, 1) + 0.0) for x in one.place)})"


def _wall_of(one: Opening) -> str:
    """Return in words in which wall an opening is."""
    level = np.hypot(*one.way[:2]) or 1.0  # walls may lean
    ways = zip("xy", (float(x / level) for x in one.way[:2]), strict=True)
    at = next((f" at {'+−'[x < 0.0]}{axis}" for axis, x in ways if abs(x) > SQUARE), "")
    return one.wall if one.wall == CEILING else f"{one.wall}{at}"


OUTLINES = (
    "What the part fills of the wall, seen from outside, without clearance. Dashed: where it goes "
    "on over an edge of the wall."
)


def drawn_openings(built: AsBuilt) -> list[tuple[str, Opening]]:
    """Return the openings that are cut along the part's section, each with its place in words."""
    return [
        (f"{_wall_of(one)}, middle at\n{_place(one)} mm", one)
        for one in built.openings
        if one.form == "other" and one.outline is not None
    ][:MOST_ROWS]


def _beyond(one: Opening, openings: Sequence[Opening], held: str, mounted: str) -> str:
    """Return in words how far the part stands out of an opening, and how it is held and mounted."""
    if one.beyond < EDGE:
        return f"the part fills it{mounted}"
    farthest = max(other.beyond for other in openings)
    clamp = f": {held}" if one.beyond >= min(CLAMPED, farthest) else ""
    wider = ""
    if one.wider is not None:
        size = " × ".join(plain(round(1e3 * x, 1)) for x in one.wider)
        wider = f"; it widens to {size} mm within {plain(1e3 * PLATE)} mm outside"
    return f"the part stands out by {plain(1e3 * one.beyond, 2)} mm{clamp}{mounted}{wider}"


def key_row(key: str, value: Any) -> Row:
    """Return the name and the text of a chamber's value, with the unit in the text.

    In `key`, the unit is the end of the name, e.g. "height_mm".
    """
    parts = value if isinstance(value, list) else [value]
    if any(isinstance(one, list | dict) for one in parts):
        return in_words(key), "see the report"
    return in_words(key), f"{value_text(value)} {unit_of(key)}".rstrip()


def _sonotrode(result: Result, face_mm: tuple[float, ...]) -> Iterator[Row]:
    design = result.design
    face = design.sonotrode.face
    if face is not None:
        alike = ", driven alike: simulated as one face" if face.count > 1 else ""
        yield "stands on", f"{face.in_words}{alike}"
    metal = design.materials.sonotrode.alloy
    yield "face in the chamber", _size(face_mm) + (f", {metal}" if metal else "")
    if limits := slit_limits(result):
        sides = [
            f"{in_words(key)} {plain(low)} to {plain(high)} mm, so that it is clear of the face"
            for key, (_, low, high) in limits.items()
        ]
        yield "wall round the face", "; ".join(sides)
    gap = slit_in_words(1e3 * min(design.ball_diameters))
    if over := _over_face(result):
        yield "walls over the face", f"at both ends of the {over}, clear of it by {gap}"
    if face is not None and face.count > 1:
        yield "gaps between the blocks", f"{gap}, half a ball"
    yield "frequency", f"{plain(design.sonotrode.frequency_khz)} kHz"
    yield "amplitude", amplitude_text(design.sonotrode)
    yield "peak speed of the face", f"{plain(design.sonotrode.peak_speed, 3)} m/s"
    if design.sonotrode.amplitude_profile is not None:
        yield "amplitude over the face", design.sonotrode.amplitude_profile.in_words
    if design.calibration is not None:
        factor = plain(design.calibration.factor("amplitude"), 3)
        yield "calibrated to", f"{factor} times the amplitude that is set"
    others = []
    for one in design.sonotrodes:
        place = ", ".join(map(plain, one.at_mm))
        name = f"further, Ø {plain(one.diameter_mm)} mm"
        others.append((name, f"at ({place}) mm: {amplitude_text(one)}"))
    yield from _first(others, "sonotrodes")


def amplitude_text(face: VibratingFace) -> str:
    one = face.zero_to_peak_um
    return f"{plain(one)} µm zero-to-peak = {plain(2.0 * one)} µm peak to valley"


def _shot(result: Result) -> Iterator[Row]:
    shot = result.design.shot
    yield (
        "material",
        f"{(shot.material or 'not named').replace('_', ' ')}, {plain(shot.density)} kg/m³",
    )
    several, sizes = len(shot.sizes) > 1, []
    for diameter, count in shot.sizes:
        mass = 1e3 * shot.density * np.pi / 6.0 * diameter**3 * count
        text = f"{count:,} of Ø {plain(1e3 * diameter)} mm"
        sizes.append(("balls", f"{text}, {plain(mass, 3)} g" if several else text))
    yield from _first(sizes, "sizes")
    asked = _limited(result, "shot.mass_g", f"asked: {plain(shot.mass_g)} g")
    yield "mass of these balls", f"{plain(_weighed_g(shot), 3)} g ({asked})"
    for name, one in result.design.in_steps.items():
        if one.shot != shot:
            counts = (f"{count:,} of Ø {plain(1e3 * size)} mm" for size, count in one.shot.sizes)
            yield f"balls, step {name}", f"{', '.join(counts)}: {plain(_weighed_g(one.shot), 3)} g"


def _weighed_g(shot: ShotTable) -> float:
    """Return the mass of the simulated balls together [g]. Their number is whole."""
    return 1e3 * shot.ball_mass * shot.count


def _steps(result: Result, built: AsBuilt) -> Iterator[Row]:
    """Yield a row for each step, and for each of its openings if they are not those of the first.

    The drawing and the other tables are of the first.
    """
    if result.design.steps:
        yield "", "Tables and the drawing here are of the first step; the others differ from it:"
    yield from (("", one.text) for one in answer_lines(result) if one.about == "step")
    first, *others = (
        [f"{_of_opening(one)} at {_place(one)} mm" for one in openings]
        for openings in (built.openings, *built.later)
    )
    for number, found in enumerate(others, start=2):
        if found != first:
            yield from _first([(f"opening, step {number}", one) for one in found], "openings")


def _run(result: Result) -> Iterator[Row]:
    """Yield what an operator does for each part, in its order."""
    design = result.design
    if design.effects.part_turn is not None:
        yield "1 mount", "the part and its drive; turn it once by hand: it touches no wall"
    else:
        yield "1 mount", "the part as above; measure from it to the face at rest"
    steps = [*design.in_steps.values()]
    yield "2 fill", f"{plain(_weighed_g(steps[0].shot), 3)} g of balls, weighed; close the chamber"
    each = ", then ".join(
        f"{plain(one.process.treatment_time)} s as step {k}" for k, one in enumerate(steps, 1)
    )
    time = f"{plain(design.process.treatment_time)} s"
    yield "3 peen", f"{time}: {each} (see Steps)" if design.steps else time
    yield "4 weigh", "the balls again: what lacks is in a gap or in the part"
    missed = 1.0 - result.record.field.reachable_share
    but = f" but the {per_cent(missed)} that no ball can touch: see Warnings"
    look = "at the target through a lens of 10 times: no place without dents"
    yield "5 look", look + (but if missed > LEAST_MISSED else "")


def _expected(result: Result, usual: WantedIntensity | None) -> Iterator[Row]:
    """Yield rows (name, text) with the peening time and the expected coverage etc.

    Without a calibration, a row says why there is no intensity in mmA.
    """
    of_all = ", all steps together" if result.design.steps else ""
    time = f"{plain(result.design.process.treatment_time)} s{of_all}"
    yield "peening time", _limited(result, "process.treatment_time_s", time)
    yield from wanted_rows(result)
    calibration = result.design.calibration
    for row in _expected_figures(result):
        more = f"; range {row.range_with_unit}" if row.range_text else ""
        yield row.label.text, f"{row.label.format(row.result)}{more}"
    if slow := time_at_slow_end(result):
        yield f"{metric_label(TIME).text}, at the slow end", slow
    wanted = result.design.process.intensity_mmA
    rough = PredictedIntensity.of(result.metrics, calibration)
    if wanted is None and rough is not None and "almen_intensity" not in result.metrics:
        near = f"about {plain(rough.value, 2)} mmA{rough.factor_in_words}"
        yield "Almen intensity, roughly", near
    if wanted is None and usual is not None:
        yield "Almen intensity, usual", f"{_range_text(usual)}, {usual.text}"
    if wanted is None and (reason := why_no_intensity(calibration)):
        yield "", f"{reason[0].upper()}{reason[1:]}."
    for one in answer_lines(result, load_start(result)):
        if one.about in ("best", "calibration", "ranges"):  # zones have their own block
            first, over, rest = one.text.partition(" Over their ranges")
            yield "", first
            if rest:  # a row of its own: a long one is cut
                yield "", f"{over.strip()}{rest}"
    yield "", f"± 95 % intervals. {limits_of_intervals(result, has_groups=True)}"


def _expected_figures(result: Result) -> list[Figure]:
    """Return the figures that the sheet shows: the objective first, then those of EXPECTED."""
    calibration, shown = result.design.calibration, figures(result, None)
    hidden = "strength_um" if calibration and calibration.has_strips else ""
    return [
        row for row in shown if (row is shown[0] or row.name in EXPECTED) and row.name != hidden
    ]


def _zones(result: Result) -> Iterator[Row]:
    """Yield a row with a sentence for each zone. Zones with limits that are not met come first."""
    lines = [one for one in answer_lines(result) if one.about == "zone"]
    lines.sort(key=lambda line: not line.warns)
    yield from (("", one.text) for one in lines)


def _tolerances(result: Result) -> Iterator[Row]:
    """Yield rows with the tolerance range of each number of the design that has a tolerance.

    If the tolerances were simulated, further rows give their effect on coverage etc.
    """
    box = tolerance_box(result.design)
    for name, (low, high) in box.items():
        designed = plain(result.design.value(name))
        yield title_with_unit(name), f"{plain(low)} to {plain(high)}, as designed {designed}"
    found = result.record.tolerances
    if result.design.tolerances is None:
        low, high = (_peak_to_valley(result) + sign * USUAL["amplitude_pv_um"] for sign in (-1, 1))
        usual = f"{plain(low)} to {plain(high)} µm, {USUAL_IN_WORDS}"
        yield "", f"Amplitude: {usual}. The design states no tolerances: others are not known."
    elif found is None:
        yield "", "What they cost was not simulated."
    else:
        yield from sheet_rows(found)


def _warnings(result: Result) -> Iterator[Row]:
    warnings = result.record.warnings
    if warnings is None:
        yield "", "The design was not checked, so that its warnings are not known."
    elif not (left := open_warnings(result)):
        yield "", "There are none."
    else:
        yield from (("", re.sub(OF_COMMANDS, "", keys_in_words(text))) for text in left)


def first_checks(result: Result, level_mm: int | None = None) -> Table:
    """Return the quantities to measure before production, each with its expected value.

    Args:
        level_mm: how far from the sonotrode strips are set, if that is known.
    """
    rows = [(what, expected, "") for what, expected in _checks(result, level_mm)]
    return Table("", ("Measure first", "expected", "measured"), rows, numbers=False)


def _peak_to_valley(result: Result) -> float:
    """Return the amplitude of the sonotrode, peak to valley [µm]."""
    return 2.0 * result.design.sonotrode.zero_to_peak_um


def _checks(result: Result, level_mm: int | None) -> Iterator[Row]:
    design, calibration = result.design, result.design.calibration
    wanted = _peak_to_valley(result)
    expected = f"{plain(wanted)} µm peak to valley"
    if calibration is not None:
        factor, sd = calibration.factor("amplitude"), 1.96 * calibration.log_sd("amplitude")
        low, middle, high = (plain(wanted * factor * np.exp(x), 3) for x in (-sd, 0.0, sd))
        expected = f"{middle} ({low} to {high}) µm peak to valley where {plain(wanted)} is set"
    yield "amplitude of the face, by laser or accelerometer", expected
    if calibration is None:
        laws = {name: getattr(design.materials, name) for name in ("sonotrode", "wall", "part")}
        what = f"ball drop: one ball at {plain(DROP_SPEED)} m/s, speed after over speed before"
        yield what, ", ".join(f"{k} {_restitution(x)}" for k, x in laws.items())
    curve, end = result.record.coverage_against_time, design.process.treatment_time
    # Measuring tells most near a mean coverage of 0.5. A part is peened no longer than it is to be.
    row = min(curve, key=lambda row: abs(row.mean_coverage - 0.5), default=None)
    share, after = result.metrics["mean_coverage"], f"the peening time, {plain(end, 3)} s"
    # If the mean coverage at the end is not resolved, its curve is not reliable either.
    if row and share.has_number:
        over = ""
        if row.time_s < end:
            share = Estimate(row.mean_coverage, row.half_width)
            over = _over_ranges(result, row.time_s)
            after = f"{plain(row.time_s, 3)} s"
        text = estimate_text(share, 100.0, "%")
        yield f"mean coverage of the target after {after}", f"{text}{over}"
    intensity = result.metrics.get("almen_intensity")
    if intensity is None:
        rough = PredictedIntensity.of(result.metrics, calibration)
        kind, known = "A", "not known before: calibrates to mmA"
        if rough is not None:
            kind = "N" if rough.is_for_n else "A"
            known = rough.on_n_strips if rough.is_for_n else f"{plain(rough.value, 2)} mmA"
            known += f"{rough.factor_in_words}, as impacts on the target would give"
        strips = f"{kind} strips {_strip_times(result)}, for chamberopt calibrate"
        if level_mm is not None and not why_no_strip(design, StripSize()):
            strips += (
                f"; in the lid in place of the part, {level_mm} mm from the sonotrode, facing it"
            )
        elif level_mm is not None:
            strips += f"; no strip of {StripSize()} fits into the lid: a smaller one, or on a zone"
        yield strips, known
    else:
        text = metric_label("almen_intensity").format(intensity)
        yield f"intensity by A strips at the target, {_strip_times(result)}", text
    masses = {plain(_weighed_g(one.shot), 3): None for one in design.in_steps.values()}
    yield "mass of the shot, before and after", f"{' g, then '.join(masses)} g before"


def _over_ranges(result: Result, time: float) -> str:
    """Return in words what the mean coverage after a time [s] may be before a calibration.

    The curve is that of the design, run through as much faster or slower as the mean exposure is at
    the ends of its range. The text is empty if there is none.
    """
    ranges, exposure = result.record.ranges, result.metrics.get("exposure")
    ends = None if ranges is None else ranges.figures.get("exposure")
    if ends is None or exposure is None or not exposure.value > 0.0:
        return ""
    curve = result.record.coverage_against_time
    times, shares = zip(
        (0.0, 0.0), *((one.time_s, one.mean_coverage) for one in curve), strict=True
    )
    low, high = (
        rounded(100.0 * float(np.interp(time * one.value / exposure.value, times, shares)), 2)
        for one in (ends.low, ends.high)
    )
    return f" as designed, {low} to {high} % before calibration"


def _strip_times(result: Result) -> str:
    """Return in words after which times strips are peened."""
    saturation = result.metrics.get("saturation_time_s")
    if saturation is None or not (saturation.has_number or _is_roughly_known(saturation)):
        return "at 4 or 5 times"
    *times, last = (rounded(share * saturation.value, 2) for share in STRIP_TIMES)
    about = "" if saturation.has_number else "about "
    return f"after {about}{', '.join(times)} and {last} s"


def _is_roughly_known(saturation: Estimate) -> bool:
    """Return whether a time that is not resolved suffices to choose the times of strips.

    Strips at half of the time or at twice it still tell where the curve saturates.
    """
    return _is_unresolved(saturation) and 0.0 < saturation.bias < 0.5 * saturation.value


def calibrated_to(result: Result) -> Iterator[Sentence]:
    """Yield a sentence on the measurements by which the machine was calibrated.

    The sentence also names the kinds of measurement that are missing.
    """
    calibration = result.design.calibration
    kinds = {misfit.kind for misfit in calibration.misfits} if calibration else set()
    have, lacking = ([kind for kind in KINDS if (kind in kinds) is one] for one in (True, False))
    more = f" What it has not, and would make it surer: {', '.join(lacking)}." if lacking else ""
    if have:
        yield Sentence(f"The machine is calibrated by: {', '.join(have)}.{more}")


def _restitution(law: Any) -> str:
    from sim_core import restitution_at

    return plain(float(restitution_at(np.array(DROP_SPEED), law.restitution)), 2)


def _first(rows: Sequence[Row], what: str, most: int = MOST_ROWS) -> Iterator[Row]:
    """Yield at most `most` rows, then a sentence with the number of the rows left out, if any.

    `what` names the rows in the sentence.
    """
    yield from rows[:most]
    if (more := len(rows) - most) > 0:
        yield "", f"{more} more {what if more > 1 else what.removesuffix('s')} in the report."

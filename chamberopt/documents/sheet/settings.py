"""Tell on a process sheet what an operator sets: part, chamber, sonotrode, shot and steps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import PurePath
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.checks.openings import walls_end_at
from chamberopt.chamber.checks.place_names import CEILING
from chamberopt.chamber.layout.pose import axis_down
from chamberopt.chamber.layout.shot_material import iron_of_walls
from chamberopt.chamber.matters import MatterKind
from chamberopt.common.key_words import in_words
from chamberopt.design.fixture import joint_in_words, slit_in_words, slit_mm
from chamberopt.design.materials import alloys, balls, find
from chamberopt.design.tolerances import tolerance_box
from chamberopt.documents.answer import answer_lines
from chamberopt.documents.report import open_matters
from chamberopt.documents.sheet.openings import (
    FOLLOWS,
    clearance_of,
    fixture_rows,
    lid_in_words,
    opening_in_words,
    place_of,
)
from chamberopt.documents.sheet.rows import (
    AsBuilt,
    Row,
    amplitude_text,
    face_in_words,
    first_rows,
    for_the_shop,
    key_row,
    weighed_g,
    with_limits,
)
from chamberopt.documents.study import exposed_target
from chamberopt.documents.wanted import may_be_too_short, multiple_in_words
from chamberopt.documents.wording import per_cent, plain
from chamberopt.documents.zones import turned

if TYPE_CHECKING:
    from chamberopt.chamber.checks.flat_faces import FlatFace
    from chamberopt.chamber.checks.openings import Opening
    from chamberopt.chamber.checks.strips import StripOfTarget
    from chamberopt.results.load import Result

FRAME = (
    "(x, y, z) in mm in the chamber's frame, from the room's axis and the sonotrode's face: x and "
    "y as in the plan, z up"
)
LEAST_SLIT_MM = 0.2  # of both sides of a face, by heart: it vibrates and must touch nothing
SQUARE = 0.9998  # cosine between a face's normal and an axis from which on it looks along the axis
SAME_MM = 0.02  # lengths that differ by less count as equal
MASS_SHARE = 0.05  # of the shot's mass, more or less, where the design states no tolerance of it
MOST_KEYS = 8  # numbers of the chamber
MOSTLY = 0.7  # share of a force along an axis from which on it is told to push that way
GRAVITY = 9.81  # m/s²


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

    A wall round the sonotrode's face stands beside it by a slit, which is not simulated. The slit
    is no wider than half a ball even where the wall is not centred, but for the finest balls.
    """
    face, chamber = result.design.sonotrode.face, result.design.chamber
    if face is None:
        return {}
    long, wide = face.sides_mm
    sides = {"diameter_mm": face.diameter_mm}
    if face.diameter_mm is None:
        sides = {"length_mm": long, "width_mm": wide}
    slit = slit_mm(1e3 * min(result.design.ball_diameters))
    least, most = min(LEAST_SLIT_MM, slit), max(slit, min(2.0 * slit, 2.0 * LEAST_SLIT_MM))
    return {
        key: (side, side + least, side + most)
        for key, side in sides.items()
        if side is not None and abs(getattr(chamber, key, math.inf) - side) < SAME_MM
    }


def reference_limits(
    result: Result, openings: Sequence[Opening]
) -> dict[str, tuple[float, float, float]]:
    """Return the key of [chamber] that follows from others, as the part lies on the walls.

    Then the height of the walls and the distance from the sonotrode to the part differ by a length
    of the part, and only one of them can have a tolerance.
    """
    height, end = getattr(result.design.chamber, "height_mm", None), walls_end_at(openings)
    if height is None or end is None:
        return {}
    end_mm = round(1e3 * end, 2)
    return {"height_mm": (height, end_mm, end_mm)}


def _over_face(result: Result) -> str:
    """Return in words along which sides of the chamber its walls end over a larger face."""
    face, chamber = result.design.sonotrode.face, result.design.chamber
    if face is None or face.diameter_mm is not None or chamber.shape != "box":
        return ""
    sides = zip(("length_mm", "width_mm"), face.sides_mm, strict=True)
    over = [in_words(key) for key, side in sides if getattr(chamber, key) < side - SAME_MM]
    return " and the ".join(over)


def part_rows(result: Result, built: AsBuilt) -> Iterator[Row]:
    strip = built.strip
    part, turn = result.design.part, result.design.effects.part_turn
    yield "part", part.mesh_path.name
    yield "metal", _metal(result)
    if result.design.chamber.shape == "imported":
        yield "pose", "as drawn with its chamber"
    else:
        down = axis_down(part.rotate_deg).replace("-", "−")
        pose = [turned(part.rotate_deg) or "as in its file", f"{down} down" if down else ""]
        seen = f"; {_looks(built.flat)}" if built.flat else ""
        yield "turned", f"{': '.join(filter(None, pose))}{seen}"
        x, y = part.offset_mm
        yield "offset from the axis", f"x {plain(x)} mm, y {plain(y)} mm" if x or y else "none"
        text = f"{plain(result.design.chamber.sonotrode_distance_mm)} mm"
        yield (
            f"sonotrode to lowest point{' between the walls' * bool(built.openings)}",
            with_limits(result, "chamber.sonotrode_distance_mm", text),
        )
    start = "; on the part as it stands before it turns" if turn is not None else ""
    yield "places on this sheet", f"{FRAME}{start}"
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
    if words := built.chosen_in_words(chosen):
        radii = " and ".join(plain(1e3 * one) for one in built.radii)
        yield "target, chosen by", f"fillets of {radii} mm: {words}" if radii else words
    if strip is not None:
        yield "a strip at a time", _of_strip(strip)


def _looks(face: FlatFace) -> str:
    """Return in words which way a flat face of the part looks in the chamber, and how high."""
    which = "its largest flat face" if face.is_alone else "one of its largest flat faces"
    axis = int(np.abs(face.normal).argmax())
    along, high = face.normal[axis], plain(round(1e3 * abs(face.off), 1))
    if abs(along) < SQUARE:
        aside = plain(round(math.degrees(math.acos(abs(face.normal[2])))))
        way = f"{aside}° from straight {'up' if face.normal[2] > 0.0 else 'down'}"
    elif axis == 2:
        way = f"{'up' if along > 0.0 else 'down'}, {high} mm above the sonotrode"
    else:
        way = f"to {'+−'[along < 0.0]}{'xy'[axis]}"
    return f"{which}, {plain(1e6 * face.area, 3)} mm², looks {way}"


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


def chamber_rows(result: Result, built: AsBuilt) -> Iterator[Row]:
    table = result.design.chamber.model_dump(mode="json", exclude_none=True)
    wall = result.design.materials.wall.alloy
    walls = f", walls of {wall}" if wall else ""
    yield "shape", f"{PurePath(table.pop('shape')).name}{walls}; inside sizes"
    for key in ("sonotrode_distance_mm", "facets", "mesh", "unit"):
        table.pop(key, None)
    counted = {key: table.pop(key, ()) for key in ("holes", "deflectors")}
    rows, slits = [], slit_limits(result)
    follows = reference_limits(result, built.openings)
    for key, value in table.items():
        if value not in (0, 0.0, []):
            name, text = key_row(key, value)
            if key in follows:
                rows.append((name, f"({plain(follows[key][1])} mm): {FOLLOWS}"))
            elif key in slits:
                low, high = (plain(one) for one in slits[key][1:])
                rows.append((name, f"{low} to {high} mm, centred round the face of {text}"))
            else:
                rows.append((name, with_limits(result, f"chamber.{key}", text)))
    yield from first_rows(rows, "numbers", MOST_KEYS)
    if built.push is not None:
        yield "hold it against", _push(result, built.push, built.volume)
    iron = iron_of_walls(result.design.materials.part.alloy or "", wall or "")
    is_told = any(one.kind is MatterKind.IRON_FROM_WALLS for one in open_matters(result))
    if iron and not is_told:  # among what is to be settled
        yield "iron", for_the_shop(iron)
    yield "opened at", lid_in_words(built)
    for what, several in counted.items():
        if several:
            yield what, f"{len(several)}: see the report"
    yield from fixture_rows(result, built)
    ball = 1e3 * min(result.design.ball_diameters)
    holder = result.design.holder
    in_bore = holder is not None and holder.clearance_mm > 0.0
    places = "round the part as above, of all other joints" if in_bore else "of joints and openings"
    slit = f"round the sonotrode, which may touch nothing, {slit_in_words(ball)}"
    yield "gaps", f"{places} {joint_in_words(ball)}, or sealed; {slit}"
    if volume := result.record.chamber.volume_mm3:
        yield "free volume", f"{plain(1e-3 * volume)} cm³"


def _push(result: Result, push: tuple[float, float, float], volume: float) -> str:
    """Return in words what a holder has to bear.

    Args:
        push: mean force of the shot on the part [N].
        volume: of the part [m³].
    """
    axis = int(np.abs(push).argmax())
    way = ("x", "y", "z")[axis]
    size = float(np.linalg.norm(push))
    along = f"{'+' if push[axis] > 0.0 else '−'}{way}" if abs(push[axis]) > MOSTLY * size else ""
    told = f", mostly to {along}{', up' if along == '+z' else ''}" if along else ""
    metal = find(result.design.materials.part.alloy, alloys())
    weighs = "its weight is not known without its alloy"
    if metal is not None:
        weighs = f"it weighs {plain(GRAVITY * metal.density_kg_m3 * volume, 2)} N"
    return (
        f"the shot pushes the part by about {plain(size, 1)} N net on average{told}, single "
        f"impacts for microseconds far harder; {weighs}; what drive and handling add is not in it"
    )


def sonotrode_rows(result: Result, face_mm: tuple[float, ...]) -> Iterator[Row]:
    design = result.design
    face = design.sonotrode.face
    if face is not None:
        alike = ", driven alike: simulated as one face" if face.count > 1 else ""
        yield "stands on", f"{face.in_words}{alike}"
    metal = design.materials.sonotrode.alloy
    yield "face in the chamber", face_in_words(face_mm) + (f", {metal}" if metal else "")
    gap = slit_in_words(1e3 * min(design.ball_diameters))
    if over := _over_face(result):
        least = plain(0.5 * LEAST_SLIT_MM)
        yield "walls over the face", f"at both ends of the {over}, clear of it by {least} mm, {gap}"
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
    yield from first_rows(others, "sonotrodes")


def shot_rows(result: Result) -> Iterator[Row]:
    shot = result.design.shot
    sold = find(shot.material, balls())
    hard = ""
    if sold and sold.hardness_HB:  # above 650 it is Vickers'
        hard = f"; usual {plain(sold.hardness_HB)} {'HB' if sold.hardness_HB <= 650.0 else 'HV'}"
    state = f", {sold.condition.partition(';')[0]}" if sold else ""
    yield (
        "material",
        f"{(shot.material or 'not named').replace('_', ' ')}{state}, {plain(shot.density)} kg/m³; "
        f"hardness and grade of your lot are not stated{hard}",
    )
    several, sizes = len(shot.sizes) > 1, []
    for diameter, count in shot.sizes:
        mass = 1e3 * shot.density * np.pi / 6.0 * diameter**3 * count
        text = f"{count:,} of Ø {plain(1e3 * diameter)} mm"
        sizes.append(("balls", f"{text}, {plain(mass, 3)} g" if several else text))
    yield from first_rows(sizes, "sizes")
    asked = with_limits(result, "shot.mass_g", f"asked: {plain(shot.mass_g)} g")
    weighed = weighed_g(shot)
    yield "mass of these balls", f"{plain(weighed, 3)} g ({asked})"
    if "shot.mass_g" not in tolerance_box(result.design):
        low, high = (plain((1.0 + sign * MASS_SHARE) * weighed, 3) for sign in (-1.0, 1.0))
        yield (
            "keep it at",
            f"{low} to {high} g, as impacts are as many more or fewer (± {per_cent(MASS_SHARE)}, a "
            "rule of thumb)",
        )
    for name, one in result.design.in_steps.items():
        if one.shot != shot:
            counts = (f"{count:,} of Ø {plain(1e3 * size)} mm" for size, count in one.shot.sizes)
            yield f"balls, step {name}", f"{', '.join(counts)}: {plain(weighed_g(one.shot), 3)} g"


def step_rows(result: Result, built: AsBuilt) -> Iterator[Row]:
    """Yield a row for each step, and for each of its openings if they are not those of the first.

    The drawing and the other tables are of the first.
    """
    if result.design.steps:
        yield "", "Tables and the drawing here are of the first step; the others differ from it:"
    yield from (("", one.text) for one in answer_lines(result) if one.about == "step")
    first, *others = (
        [
            f"{opening_in_words(one, clearance_of(result))} at {place_of(one, openings)} mm"
            for one in openings
        ]
        for openings in (built.openings, *built.later)
    )
    for number, found in enumerate(others, start=2):
        if found != first:
            yield from first_rows([(f"opening, step {number}", one) for one in found], "openings")


def _set_by(result: Result, built: AsBuilt) -> str:
    """Return in words by what an operator sets how far a part is from the sonotrode."""
    distance = result.design.chamber.sonotrode_distance_mm
    block = f"on a block of {plain(distance)} mm on the sonotrode's face at rest"
    if walls_end_at(built.openings) is not None:
        return "it lies on the walls, which are its stop and set its distance"
    above = [one.beyond for one in built.openings if one.wall == CEILING]
    if above:
        out = plain(round(1e3 * max(above), 1))
        return (
            f"it stands {out} mm out, from the ceiling's inner side to its top: set that once "
            f"without balls, {block}, and fix a stop there"
        )
    return f"set it {block}, clamp it, and take the block out"


def run_rows(result: Result, built: AsBuilt) -> Iterator[Row]:
    """Yield what an operator does for each part, in its order.

    A part that is the ceiling or goes out through it closes the chamber, so that the balls are
    there before it.
    """
    design = result.design
    mount = f"the part as above; {_set_by(result, built)}"
    if design.effects.part_turn is not None:
        mount = "the part and its drive; turn it once by hand: it touches no wall"
    steps = [*design.in_steps.values()]
    fill = f"{plain(weighed_g(steps[0].shot), 3)} g of balls, weighed"
    if built.is_ceiling or any(one.wall == CEILING for one in built.openings):
        yield "1 fill", fill
        yield "2 mount", f"{mount}; it closes the chamber"
    else:
        yield "1 mount", mount
        yield "2 fill", f"{fill}; put the lid on"
    each = ", then ".join(
        f"{plain(one.process.treatment_time)} s as step {k}" for k, one in enumerate(steps, 1)
    )
    time = f"{plain(design.process.treatment_time)} s"
    if may_be_too_short(result):
        yield "3 peen", _not_set(result)
    else:
        yield "3 peen", f"{time}: {each} (see Steps)" if design.steps else time
    yield "4 weigh", "the balls again: balls that are missing are stuck in a gap or in the part"
    yield "5 look", "at the target, as under Acceptance"


def _not_set(result: Result) -> str:
    """Return in words how an operator finds a peening time that the simulation does not tell.

    The least time that may be enough is told where it is longer than that of the design.
    """
    planned, time = result.design.process.treatment_time, result.metrics.get("time_to_98_s")
    known = time is not None and not time.in_words and time.low > planned
    least = f"; the simulation expects {plain(time.low, 2)} s or more" if known and time else ""
    start, sum_or_more = plain(planned), multiple_in_words(result.design)
    it = f"{sum_or_more}that sum" if sum_or_more else "it"
    return (
        f"THE TIME IS NOT YET SET{least}. Peen {start} s, look as in 5, peen {start} s more, then "
        "twice as long each time, until a look shows no more dents than the one before. Record the "
        f"sum before that look: {it} is the peening time, ____ s."
    )

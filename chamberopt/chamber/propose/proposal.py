"""Propose a whole design for a part, with a wider chamber if its own check warns of gaps.

Every number comes from a rule of thumb, with its reason beside it. A study then varies the numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.checks.check import shot_reach, warnings
from chamberopt.chamber.checks.jams import JamGap, gaps_in_reach, jam_gaps
from chamberopt.chamber.checks.place_names import one_of
from chamberopt.chamber.part import Part, posed_part
from chamberopt.chamber.propose.pose import (
    Turns,
    hanging_pose,
    pose_in_words,
    propose_pose,
    square_to_walls,
)
from chamberopt.chamber.propose.proposed_arbor import Bore, find_bores, turning_bore, turning_pose
from chamberopt.chamber.propose.proposed_balls import (
    MOST_BALLS,
    charge_of,
    fit_sizes,
    propose_ball,
    sizes_to_try,
)
from chamberopt.chamber.propose.proposed_end import HeldEnd, held_end
from chamberopt.chamber.propose.proposed_floor import Floor, floor_on_sonotrode, require_room
from chamberopt.chamber.propose.proposed_holder import end_holder, holder_choices
from chamberopt.chamber.propose.proposed_mask import are_holes, pads, to_be_masked
from chamberopt.chamber.propose.proposed_target import (
    LONG,
    Sizes,
    Surface,
    Target,
    middle_in_plan,
    propose_sizes,
    propose_target,
    shape_for,
    surfaces,
)
from chamberopt.chamber.propose.proposed_tolerances import REASON as OF_LENGTHS
from chamberopt.chamber.propose.proposed_tolerances import propose_tolerances
from chamberopt.chamber.propose.shop import Shop, ShopSonotrode, usual_shop
from chamberopt.chamber.reach import Reach, reached_part_share
from chamberopt.chamber.scene import MAX_BALLS
from chamberopt.common.errors import InputError, UnreadableError
from chamberopt.common.progress import Progress, step
from chamberopt.common.toml_fields import MAX_COORDINATE_MM, allowed_range
from chamberopt.design.design import Design, validate
from chamberopt.design.fixture import USUAL_SHELL_MM, WIDEST_GAP, Holder
from chamberopt.design.materials import CATALOGUE, USUAL, alloy, ball, balls
from chamberopt.design.shape_surface import TAG_SONOTRODE
from chamberopt.design.shapes.base import ParametricChamber
from chamberopt.design.shot import ShotTable
from chamberopt.geometry.meshes.part_mesh import PartMesh, read_part
from chamberopt.geometry.meshes.surface_error import format_box
from chamberopt.geometry.meshes.units import GUESSED
from chamberopt.geometry.triangles import areas, rotation_matrix

LIGHTER, HEAVIER = 0.4, 2.0  # charges of the study, as shares of the first
FINE_MM, COARSE_MM = 0.5, 1.0  # steps of lengths
FEW_MM = 400.0  # longest range with fine steps: a study takes at most 999 steps
LARGEST_MM = allowed_range(ParametricChamber.model_fields["height_mm"])[1]  # side of a chamber
HEAVIEST_G = allowed_range(ShotTable.model_fields["mass_g"])[1]


class Range(NamedTuple):
    """The range in which a study varies a number, in its unit, and the step between values."""

    low: float
    high: float
    step: float


def propose_charge(floor: float, diameter: float, ball_mass: float) -> tuple[float, str]:
    """Return the mass of all balls together [g], to two digits, and the reason for it.

    Args:
        floor: area of the sonotrode [m²].
        diameter, ball_mass: diameter [m] and mass [kg] of a ball.
    """
    full = round(charge_of(floor, diameter))
    count = max(1, min(full, MOST_BALLS))
    wanted, most = 1e3 * count * ball_mass, _heaviest_g(ball_mass)
    if wanted > most:
        return most, "the most that is supported, less than half a layer of balls"
    mass = min(float(f"{wanted:.2g}"), most)
    if count < full:
        return mass, f"{CAPPED}, as more take hours to simulate"
    return mass, "half a layer of balls on the sonotrode"


def propose_ranges(
    sizes: Sizes, mass_g: float, ball_mm: float, ball_mass: float
) -> dict[str, Range]:
    """Return the range of each number that the proposed study varies, by dotted name.

    Args:
        sizes: sizes of the chamber.
        mass_g: mass of all balls together.
        ball_mm: ball diameter.
        ball_mass: mass of one ball [kg].
    """
    distance, height = round(1e3 * sizes.distance), round(1e3 * sizes.height)
    near = max(round(0.4 * distance), math.ceil(2.0 * ball_mm))
    # The ceiling stays above the part even when the part is highest, so that no ball is caught.
    under = math.floor(height - 1e3 * sizes.top - 2.0 * ball_mm)
    far = max(distance, min(round(1.25 * distance), under))
    low = math.ceil(far + 1e3 * sizes.top + 2.0 * ball_mm)
    high = min(round(1.5 * height), LARGEST_MM)
    digit = _second_digit(mass_g)
    least, most = (digit * round(share * mass_g / digit) for share in (LIGHTER, HEAVIER))
    mass = (least, min(most, _heaviest_g(ball_mass)), digit)
    return {
        "chamber.height_mm": _lengths(min(low, height), high),
        "chamber.sonotrode_distance_mm": _lengths(min(near, distance), far),
        "shot.mass_g": Range(*(float(f"{one:.6g}") for one in mass)),
    }


def _lengths(low: float, high: float) -> Range:
    """Return the range between two lengths [mm], with fine steps unless it is long."""
    return Range(low, high, FINE_MM if high - low <= FEW_MM else COARSE_MM)


def _second_digit(mass: float) -> float:
    """Return the value of one step in a mass's second significant digit, such as 10 for 345."""
    return 10.0 ** (math.floor(math.log10(mass)) - 1)


def _heaviest_g(ball_mass: float) -> float:
    """Return the largest mass of all balls [g], to two digits, that the program takes.

    Args:
        ball_mass: mass of one ball [kg].
    """
    most = min(1e3 * MAX_BALLS * ball_mass, HEAVIEST_G)
    digit = _second_digit(most)
    return float(f"{digit * math.floor(most / digit + 1e-9):.6g}")


WIDER = (1.0, 1.4, 2.0)  # factors on the room round the part that are tried
AMPLITUDE_UM = 40.0  # zero-to-peak; the nearest that the sonotrode can set is taken
USUAL_PART, WALL, SONOTRODE = "42CrMo4", "100Cr6", "Ti-6Al-4V"  # of the catalogue
# Materials of balls, and least hardness of steel balls over the part's. A part as hard as they are
# is hardly dented: in pilots of a gear of 650 HB tungsten carbide left 9 times the dents.
STEEL, HARD, HARDER = "steel", "tungsten_carbide", 1.25
MOST_HOLDERS = 6  # that are tried
HIDDEN = 0.005  # share of the target that a holder may keep from the balls
LEAST_LEFT, MOST_LEFT = 0.005, 0.15  # share of the target that is left out if no ball touches it
NO_PLACE = (
    "no flat face beside the target looks up or aside and has room for a holder",
    "all of it is to be peened; leave out of [part.target] the face to hold it by",
)
TREATMENT_S, HALF_WIDTH, MOST_REPLICAS = 300.0, 0.03, 24
REPLICAS = 10  # the fewest that a wanted half-width takes
BLOCKS = "LARGER THAN ONE SONOTRODE: several side by side, driven alike"
CAPPED = "less than half a layer of balls"
START = "a start, NOT MEASURED by a pilot"
ON_END = "on end, as no sonotrode is large enough for it lying"

Tables = dict[str, dict[str, Any]]
"""Tables of a design file by dotted name, as TOML values."""


@dataclass(frozen=True)
class Wanted:
    """The user's wishes for a proposed design. None or an empty text leaves the choice open."""

    unit: str = "guess"
    shape: str | None = None
    alloy: str = ""
    shot: str = ""  # material of the balls
    ball_mm: float | None = None
    shop: Shop | None = None  # what the shop has; usual sizes if it is not known
    calibration: Path | None = None  # file of the machine's calibration
    coverage: float | None = None  # [%], 200 is twice the time to 98 %


@dataclass(frozen=True)
class Proposal:
    """A proposed design, the reason for each value, and the warnings of its check."""

    design: Design
    tables: Tables  # the values of the design file
    reasons: dict[str, str]  # of values, by dotted name
    bounds: dict[str, dict[str, Any]]  # of the study, as its file has them
    known: tuple[Surface, ...]  # surfaces to choose the target from
    mesh: PartMesh
    chamber: Chamber
    reach: Reach
    warnings: tuple[str, ...]
    jams: tuple[JamGap, ...]  # gaps of chamber and part in which the balls jam
    sonotrode: ShopSonotrode  # whose face carries the chamber
    # Of all replicas of a candidate [s], to know the time in which its target is covered; None if
    # no pilot ran, or balls do not touch enough of the target.
    search_time: float | None = None
    # Dents in a window that the peening strength takes, by a pilot; 0 if no intensity is wanted.
    strength_dents: float = 0.0


def propose(
    path: Path, wanted: Wanted, choose: Callable[[Sequence[Surface]], Sequence[str]]
) -> Proposal:
    """Propose a design for the part in a file.

    Args:
        choose: function that picks the names of the surfaces to peen from all surfaces.
    Raises:
        InputError: the part cannot be used, or no chamber can be built round it.
    """
    _shot(wanted.shot, alloy(wanted.alloy or USUAL_PART).name, wanted.shop or usual_shop())
    with step("reading the part"):
        mesh = _read(path, wanted.unit)
        known = surfaces(mesh)
    asked = choose(known)
    target = propose_target(mesh, known, asked)
    _require_near_origin(path, target)
    turns, pose_reason = propose_pose(mesh.vertices, mesh.triangles, target.triangles)
    end = None if asked else held_end(mesh, target, turns)
    made = _proposed(path, wanted, mesh, known, target, turns, pose_reason, end)
    if asked or end is not None or not _hangs_by_a_face(made):
        return made
    end = held_end(mesh, target, made.design.part.rotate_deg, of_any=True)
    if end is not None:
        with suppress(InputError):
            other = _proposed(path, wanted, mesh, known, target, turns, ON_END, end)
            if "holder" in other.tables and _faults(other) <= _faults(made):
                return other
    return made


def _proposed(
    path: Path,
    wanted: Wanted,
    mesh: PartMesh,
    known: Sequence[Surface],
    target: Target,
    turns: Turns,
    pose_reason: str,
    end: HeldEnd | None,
) -> Proposal:
    """Return a proposal for a target of a part.

    Raises InputError if no chamber can be built round it.

    Args:
        turns, pose_reason: the pose that suits the target [degrees], and why.
        end: an end that is left out of the target, and the pose in which the part is held by it.
    """
    part_alloy, shop = alloy(wanted.alloy or USUAL_PART).name, wanted.shop or usual_shop()
    shot, shot_reason = _shot(wanted.shot, part_alloy, shop)
    if end is not None:
        target, turns = end.target, end.turns
    tables: Tables = {
        **({"": {"calibration": str(wanted.calibration.resolve())}} if wanted.calibration else {}),
        "part": {"mesh": str(path.resolve()), "unit": mesh.unit, "rotate_deg": list(turns)},
        "part.target": target.keys,
        "chamber": {},
        "sonotrode": {},
        "shot": {"mass_g": 1.0, "diameter_mm": 1.0, "material": shot},
        "materials": {"part": part_alloy, "wall": WALL, "sonotrode": SONOTRODE},
        "effects": {"gravity": True, "friction": CATALOGUE, "roughness": USUAL},
        "process": {
            "treatment_time_s": TREATMENT_S,
            "seed": 1,
            **({"coverage_percent": wanted.coverage} if wanted.coverage else {}),
        },
        "process.accuracy": {
            "replicas": REPLICAS,
            "simulated_time_s": 1.0,
            "warmup_time_s": 0.2,
            "objective_half_width": HALF_WIDTH,
            "max_replicas": MOST_REPLICAS,
        },
    }
    with step("choosing the balls"):
        diameter, ball_reason = _ball_diameter(tables, wanted, shop)
    tables["shot"]["diameter_mm"] = round(1e3 * diameter, 4)
    if end is None and (hanging := _hanging(mesh, target, turns, diameter, wanted)):
        turns, pose_reason = hanging, ON_END
    reasons = {
        "part.unit": ("GUESSED: " if any(GUESSED in note for note in mesh.notes) else "")
        + f"the part measures {format_box(mesh.size)}",
        "part.target": target.reason,
        "shot.diameter_mm": ball_reason,
        **({"shot.material": shot_reason} if shot_reason else {}),
        "materials.part": "C0 and v0 are computed: to be calibrated"
        if wanted.alloy
        else "NOT KNOWN, a guess: chamberopt materials lists alloys",
        "materials.wall": "hardened, as soft walls slow the balls; give yours",
        "effects.friction": "mu of these balls on these metals, dry: chamberopt materials",
        "effects.roughness": "rms slope of faces that shot has dented",
        "process.treatment_time_s": f"{START}: the report has coverage over time",
        "process.accuracy.simulated_time_s": f"{START}: results say what is resolved",
        "process.accuracy.objective_half_width": "until it is so sure; of a time: this share",
    }

    bores = find_bores(mesh, target.triangles)

    def built(is_local: bool, turning: Bore | None = None) -> tuple[Proposal, Floor]:
        """Return the proposal with the least room that is free of gaps, else of fewest faults.

        Args:
            is_local: true for a chamber round the target, whose walls the part goes out through.
            turning: a bore about whose axis, which is then level, the part turns.
        """
        best: tuple[Proposal, Floor] | None = None
        refused: InputError | None = None
        for number, wider in enumerate(WIDER):
            progress(number, len(WIDER), None)
            try:
                own, pose_why, placed, form = dict(tables), pose_reason, turns, wanted
                if turning is not None:
                    placed, turn = turning_pose(turning, mesh)
                    own["effects"] = {**own["effects"], "part_turn": turn}
                    pose_why = (
                        "on its axis, about which it turns, so that all of it passes the shot"
                    )
                    form = replace(wanted, shape=wanted.shape or "box")
                placed, floor = _place(mesh, target, placed, diameter, form, wider, is_local)
                pose = {"rotate_deg": list(placed)}
                if any(floor.offset_mm):
                    pose["offset_mm"] = list(floor.offset_mm)
                own |= {"part": {**tables["part"], **pose}, **_floor_tables(floor)}
                words = {"part.rotate_deg": f"{pose_in_words(mesh, known, placed)}: {pose_why}"}
                why = {**reasons, **words, **_floor_reasons(floor, is_local)}
                made = _checked(own, why, floor, known, mesh, wanted.shop)
            except UnreadableError:
                raise
            except InputError as error:
                refused = refused or error
                continue
            if best is None or _faults(made) < _faults(best[0]):
                best = made, floor
            if not any(word in text for text in made.warnings for word in ("gap", "side wall")):
                break
        if best is None:
            assert refused is not None
            raise refused
        return best

    with step("building and checking the chamber") as progress:
        made, floor = built(is_local=False)
        if not floor.is_one_sonotrode or _is_capped(made):
            with suppress(InputError):
                local = built(is_local=True)
                fits = local[1].is_one_sonotrode and not _is_capped(local[0])
                if fits and _faults(local[0]) <= _faults(made):
                    made, floor = local
    if made.chamber.pieces_in_air:
        with step("choosing what holds the part") as progress:
            made = _held(made, floor, target, end, bores, wanted.shop, progress)
    else:
        made = _clamped_outside(made, floor, wanted.shop)
    turning = turning_bore(bores, mesh, target.triangles)
    if turning is not None and (_faults(made) > (0, 0) or not floor.is_one_sonotrode):
        with step("trying it on its axis, turning") as progress, suppress(InputError):
            other, its_floor = built(is_local=False, turning=turning)
            other = _held(other, its_floor, target, None, [turning], wanted.shop, progress)
            better = (*_faults(other), *its_floor.excess) < (*_faults(made), *floor.excess)
            if better and "holder" in other.tables:
                made, floor = other, its_floor
    made = _padded(_masked(made, floor, wanted.shop), floor, target, wanted.shop)
    return _only_touched(made, floor, wanted.shop)


def _is_capped(made: Proposal) -> bool:
    """Return whether a chamber holds fewer balls than it should, as more take too long."""
    return made.reasons["shot.mass_g"].startswith(CAPPED)


def _only_touched(made: Proposal, floor: Floor, shop: Shop | None) -> Proposal:
    """Return a proposal whose target leaves out what no ball touches, if that is little of it.

    The time until 95 % of the target is covered would be that of the few places beside it. Where
    it is much, the user is left to choose other balls or another target.
    """
    hidden = 1.0 - touched_share(made)
    if not LEAST_LEFT < hidden < MOST_LEFT:
        return made
    target = {**made.tables["part.target"], "reachable": True}
    part = made.chamber.part
    touched = reached_part_share(made.reach, made.chamber.source, len(part.triangles))
    left = np.where(part.target, (1.0 - touched) * part.area, 0.0)
    place = one_of(part.vertices[part.triangles].mean(axis=1), left)
    text = f"leaves out the {hidden:.1%} that no ball touches here, such as at {place}"
    reasons = {**made.reasons, "part.target.reachable": text}
    tables = {**made.tables, "part.target": target}
    return _checked(tables, reasons, floor, made.known, made.mesh, shop)


def _held(
    free: Proposal,
    floor: Floor,
    target: Target,
    end: HeldEnd | None,
    bores: Sequence[Bore],
    shop: Shop | None,
    progress: Progress,
) -> Proposal:
    """Return a proposal with the first holder that does no harm, or without one and the reason.

    A holder does harm if no chamber can be built with it somewhere in the ranges of the study, if
    balls jam beside it, or if it keeps the balls from some of the target.

    Args:
        free: the proposal without a holder.
        end: an end that is left out of the target to hold the part by, if there is one.
        bores: bores that may take an arbor.
    """
    diameter, turns = free.design.shot.diameter, free.design.part.rotate_deg
    choices = holder_choices(free.mesh, target.triangles, turns, diameter, bores)[:MOST_HOLDERS]
    if end is not None:
        one = end_holder(free.mesh, target.triangles, turns, diameter, end.triangles)
        choices = choices if one is None else [one._replace(keys={**one.keys, "at": end.at})]
    why = "" if choices else NO_PLACE[bool(target.triangles.all())]
    for number, one in enumerate(choices):
        progress(number, len(choices), None)
        tables = _with_table(free.tables, "sonotrode", "holder", one.keys)
        height = "sonotrode to ceiling; what holds the part goes on to the wall"
        reasons = {**free.reasons, "holder.kind": one.reason, "chamber.height_mm": height}
        try:
            made = _checked_at_extremes(tables, reasons, floor, free, shop)
        except UnreadableError:
            raise
        except InputError as error:
            why = why or str(error)
            continue
        if touched_share(free) - touched_share(made) > HIDDEN:
            why = why or "a holder would keep the balls from some of the target"
        elif _faults(made) > _faults(free):
            new = [text for text in made.warnings if text not in free.warnings]
            why = why or f"a {one.keys['kind']} would bring a warning: {(new or made.warnings)[0]}"
        else:
            return made
    text = f"sonotrode to ceiling; NOTHING HOLDS THE PART: {why}"
    return replace(free, reasons={**free.reasons, "chamber.height_mm": text})


def _clamped_outside(made: Proposal, floor: Floor, shop: Shop | None) -> Proposal:
    """Return a proposal whose part, which goes out of the chamber, is held where it does."""
    most_mm = math.floor(50.0 * WIDEST_GAP * 1e3 * made.design.shot.diameter) / 100.0
    tables = _with_table(
        made.tables, "sonotrode", "holder", {"kind": "bore", "clearance_mm": most_mm}
    )
    text = "the part's own end, clamped outside; balls wedge in more play than this, so seal it"
    reasons = {**made.reasons, "holder.kind": text}
    return _checked(tables, reasons, floor, made.known, made.mesh, shop)


def _hangs_by_a_face(made: Proposal) -> bool:
    """Return whether a long part hangs by nothing but a holder that stands on one of its faces."""
    if made.design.holder is not None and is_firm(made.design.holder):
        return False
    sides = np.ptp(made.chamber.part.vertices, axis=0)
    return bool(sides[2] > LONG * sides[:2].max())


def is_firm(holder: Holder) -> bool:
    """Return whether a holder holds a part by itself, as one that stands on a face does not."""
    return holder.kind in ("arbor", "bore") or holder.grip_mm is not None


def _padded(made: Proposal, floor: Floor, target: Target, shop: Shop | None) -> Proposal:
    """Return a proposal with a pad on the level top of a part on which balls would come to rest.

    The pad goes up to the ceiling, against which it clamps the part, so that a holder which stands
    on a face is left out. Where a pad would do harm, the proposal stays as it is.
    """
    rests = any("come to rest on the part" in text for text in made.warnings)
    if "mask" in made.tables or not rests:
        return made
    diameter, turns = made.design.shot.diameter, made.design.part.rotate_deg
    bare = {name: one for name, one in made.tables.items() if name != "holder"}
    choices = [made.tables] if _hangs_by_a_face(made) else [bare, made.tables]
    if made.design.holder is not None and is_firm(made.design.holder):
        choices.reverse()
    for at in pads(made.mesh, target.triangles, turns, diameter):
        for tables in choices:
            after = "holder" if "holder" in tables else "sonotrode"
            own = _with_table(tables, after, "mask", {"axis": [0.0, 0.0, 1.0], "at": at})
            text = "a pad on the level top, up to the ceiling, clamps the part: no ball lies there"
            height = "sonotrode to ceiling; a pad on the part's top goes on to it"
            reasons = {**made.reasons, "mask.axis": text, "chamber.height_mm": height}
            if "holder" not in own:
                reasons.pop("holder.kind", None)
            try:
                other = _checked_at_extremes(own, reasons, floor, made, shop)
            except UnreadableError:
                raise
            except InputError:
                continue
            hidden = touched_share(made) - touched_share(other)
            is_held = not other.chamber.pieces_in_air
            if is_held and hidden <= HIDDEN and _faults(other) < _faults(made):
                return other
    return made


def _masked(bare: Proposal, floor: Floor, shop: Shop | None) -> Proposal:
    """Return a proposal with a mask on what must not be peened, where that does no harm.

    Harm is that of a holder. Where it would do some, the surfaces stay bare and are named.
    """
    names = to_be_masked(bare.design, bare.chamber, bare.known)
    if not names or bare.design.effects.part_turn is not None:
        return bare
    after = "holder" if "holder" in bare.tables else "sonotrode"
    first, value, what = "thickness_mm", USUAL_SHELL_MM, "a cap on"
    if are_holes(bare.mesh, bare.known, names):
        first, value, what = "plugs", True, "in"
    keys = {first: value, "at": {"surface": names}}
    text = f"{what} {', '.join(names)}: not to be peened, by the name"
    reasons = {**bare.reasons, f"mask.{first}": text}
    tables = _with_table(bare.tables, after, "mask", keys)
    try:
        made = _checked_at_extremes(tables, reasons, floor, bare, shop)
    except UnreadableError:
        raise
    except InputError:
        return bare
    hidden = touched_share(bare) - touched_share(made)
    return bare if hidden > HIDDEN or _faults(made) > _faults(bare) else made


def _checked_at_extremes(
    tables: Tables, reasons: dict[str, str], floor: Floor, made: Proposal, shop: Shop | None
) -> Proposal:
    """Return a proposal with these tables in the place of one's own.

    Raises InputError if a chamber cannot be built with them somewhere in the ranges of the study.
    """
    other = _checked(tables, reasons, floor, made.known, made.mesh, shop)
    # Where the part no longer goes out, a study leaves a candidate out: no reason against a mask.
    free = {"holder": None} if other.design.holder and other.design.holder.kind == "bore" else {}
    for extreme in _extremes(other.bounds):
        build_chamber(other.design.changed({**extreme, **free}))
    return other


def _with_table(tables: Tables, after: str, name: str, values: dict[str, Any]) -> Tables:
    """Return tables with one more after that of some name."""
    added: Tables = {}
    for key, one in tables.items():
        added |= {key: one, name: values} if key == after else {key: one}
    return added


def _extremes(bounds: dict[str, dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the lowest room of a study with the part high in it, and the opposite."""
    ends = {
        name: sorted(one.get("choose", (one.get("low"), one.get("high"))))
        for name, one in bounds.items()
        if name.startswith("chamber.")
    }
    distance = "chamber.sonotrode_distance_mm"
    low, high = ({name: one[k] for name, one in ends.items()} for k in (0, -1))
    return [{**low, distance: high[distance]}, {**high, distance: low[distance]}]


def touched_share(made: Proposal) -> float:
    """Return the share of the target's area that the balls can touch."""
    part = made.chamber.part
    share = reached_part_share(made.reach, made.chamber.source, len(part.triangles))
    return float(share[part.target] @ part.area[part.target] / part.area[part.target].sum())


def _shot(name: str, part: str, shop: Shop) -> tuple[str, str]:
    """Return the material of the balls, and why they are not of steel, or an empty text.

    Raises InputError if a wanted material is unknown, or its hardness and so its restitution is
    not known.

    Args:
        name: the wanted material; if it is empty, steel, or a harder one for a hard part.
        part: the part's alloy.
    """
    if name and ball(name).hardness_HB is None:
        known = ", ".join(one.name for one in balls() if one.hardness_HB is not None)
        text = "the hardness of these balls is not known, and their restitution follows from it"
        raise InputError(f"--shot: given {name!r}; {text}; give one of {known}")
    hardness = alloy(part).hardness_HB
    if name or (ball(STEEL).hardness_HB or 0.0) >= HARDER * hardness or not _has(shop, HARD):
        return ball(name or STEEL).name, ""
    return HARD, f"harder than the part, of {hardness:g} HB, which steel balls hardly dent"


def _has(shop: Shop, material: str) -> bool:
    """Return whether a shop has balls of a material."""
    return not shop.balls or any(ball(one.material).name == material for one in shop.balls)


def _read(path: Path, unit: str) -> PartMesh:
    """Return the part in a file. Messages name the option --unit, not the design's part.unit."""
    try:
        mesh = read_part(path, unit)
    except InputError as error:
        error.args = (str(error).replace("part.unit", "--unit"),)
        raise
    return replace(mesh, notes=tuple(note.replace("part.unit", "--unit") for note in mesh.notes))


def _require_near_origin(path: Path, target: Target) -> None:
    """Raise InputError if a face of the target has larger coordinates than a design may have."""
    far = max((abs(x) for face in target.keys.get("faces", ()) for x in face["at_mm"]), default=0)
    if far > MAX_COORDINATE_MM:
        text = f"the part is {1e-3 * far:.4g} m from the origin of its file"
        most = f"at most {1e-3 * MAX_COORDINATE_MM:g} m are allowed"
        raise InputError(f"{path}: {text}, {most}; move it to the origin in CAD and export again")


def _ball_diameter(tables: Tables, wanted: Wanted, shop: Shop) -> tuple[float, str]:
    """Return the wanted or proposed diameter of the balls [m], and the reason for it.

    Raises InputError if the shop does not have the wanted balls.

    Args:
        tables: tables of the design file, of which those of the part and the shot count.
    """
    material = tables["shot"]["material"]
    stock = shop.stock_mm(material)
    if wanted.ball_mm is not None:
        if wanted.shop is not None and wanted.ball_mm not in stock:
            have = ", ".join(f"{one:g}" for one in stock)
            text = f"the shop's stock of {material} has {have} mm"
            raise InputError(f"--ball-mm: given {wanted.ball_mm:g}, but {text}; give one of them")
        return 1e-3 * wanted.ball_mm, "as asked"
    part = _part_alone(tables)
    return propose_ball(fit_sizes(part, sizes_to_try(part, stock)))


def _part_alone(tables: Tables) -> Part:
    """Return the posed part of a design's tables, with its curved surfaces, without a chamber."""
    room: dict[str, Any] = {"shape": "cylinder", "diameter_mm": LARGEST_MM, "height_mm": LARGEST_MM}
    alone: Tables = {
        "chamber": {**room, "sonotrode_distance_mm": 100.0},
        "sonotrode": {"frequency_khz": 20.0, "amplitude_um": AMPLITUDE_UM},
    }
    return posed_part(validate(Design, _nested({**tables, **alone})))[0]


def _place(
    mesh: PartMesh,
    target: Target,
    turns: Turns,
    ball: float,
    wanted: Wanted,
    wider: float,
    is_local: bool = False,
) -> tuple[Turns, Floor]:
    """Return the turns of a part [degrees] and the sizes of a chamber round it on a sonotrode.

    The form of the chamber is the wanted one, else a cylinder where a sonotrode carries it. Else it
    is that whose walls lean less, or the smaller one: a cylinder, or the form that suits the part.

    Args:
        turns: turns that bring the target down; the part may still be turned about z.
        ball: diameter of the balls [m].
        wider: factor on the room round the part.
        is_local: true for a chamber round the target, whose walls the part goes out through.
    Raises:
        InputError: the shop has no sonotrode for it, or no chamber so large.
    """
    square, found = square_to_walls(mesh.vertices, turns), []
    suits = shape_for(np.ptp(mesh.vertices @ rotation_matrix(square).T, axis=0))
    refused: InputError | None = None
    usual = ["box"] if is_local else ["cylinder", suits]
    for shape in dict.fromkeys([wanted.shape] if wanted.shape else usual):
        placed = square if shape == "box" else turns
        posed = mesh.vertices @ rotation_matrix(placed).T
        posed[:, 2] -= posed[:, 2].min()
        on_target = posed[np.unique(mesh.triangles[target.triangles])]
        top, around = float(on_target[:, 2].max()), on_target if is_local else None
        sizes, shop = propose_sizes(posed, top, ball, shape, wider, around), wanted.shop
        try:
            floor = floor_on_sonotrode(sizes, _round(posed), shop or usual_shop(), shop is None)
            if shop is not None:
                room, highest = require_room(floor.sizes, shop), float(posed[:, 2].max())
                if highest < room.height - room.distance:  # a higher lid takes in the whole part
                    room = replace(room, through_ceiling=False, top=highest)
                floor = floor._replace(sizes=room)
            if is_local:
                x, y = 1e3 * (middle_in_plan(posed) - middle_in_plan(on_target))
                floor = floor._replace(offset_mm=(round(float(x), 1), round(float(y), 1)))
        except InputError as error:
            refused = refused or error
            continue
        found.append((placed, floor))
    if refused and not found:
        raise refused
    return min(found, key=lambda one: one[1].excess)


def _hanging(
    mesh: PartMesh, target: Target, turns: Turns, ball: float, wanted: Wanted
) -> Turns | None:
    """Return turns with which the part hangs on end, if only then a sonotrode carries the chamber.

    Args:
        turns, ball, wanted: as of _place.
    """

    def is_carried(pose: Turns) -> bool:
        try:
            return _place(mesh, target, pose, ball, wanted, 1.0)[1].is_one_sonotrode
        except InputError:
            return False

    hanging = hanging_pose(mesh.vertices, mesh.triangles, target.triangles, turns)
    needed = hanging is not None and not is_carried(turns) and is_carried(hanging)
    return hanging if needed else None


def _round(posed: np.ndarray) -> float:
    """Return the radius [m] of the part about the middle of its box, seen from above."""
    plan = posed[:, :2]
    middle = 0.5 * (plan.min(axis=0) + plan.max(axis=0))
    return float(np.linalg.norm(plan - middle, axis=1).max())


def _floor_tables(floor: Floor) -> Tables:
    """Return the tables of the design file that follow from the floor: chamber and sonotrode."""
    sizes, one = floor.sizes, floor.face.sonotrode
    key, amplitude = one.amplitude_nearest(AMPLITUDE_UM)
    sonotrode: dict[str, Any] = {"frequency_khz": one.frequency_khz, key: amplitude}
    if floor.blocks is not None:
        sonotrode["blocks"] = floor.blocks.model_dump(mode="json")
    return {
        "chamber": {
            "shape": sizes.shape,
            **sizes.plan,
            "height_mm": round(1e3 * sizes.height, 3),
            "sonotrode_distance_mm": round(1e3 * sizes.distance, 3),
        },
        "sonotrode": sonotrode,
    }


def _floor_reasons(floor: Floor, is_local: bool) -> dict[str, str]:
    sizes, one = floor.sizes, floor.face.sonotrode
    first = next(key for key in sizes.plan if key.endswith("_mm"))
    where = "; the part goes out through it" if sizes.through_ceiling else ""
    beside = "target, and the part goes out through the walls" if is_local else "part"
    key, _ = one.amplitude_nearest(AMPLITUDE_UM)
    kind = (
        "ZERO-TO-PEAK, half of" if key == "amplitude_um" else "PEAK-TO-VALLEY, twice zero-to-peak"
    )
    kind += " peak-to-valley" if key == "amplitude_um" else ""
    return {
        f"chamber.{first}": f"leaves {1e3 * sizes.gap:.3g} mm beside the {beside}; {floor.reason}",
        "chamber.height_mm": f"sonotrode to ceiling{where}",
        "chamber.sonotrode_distance_mm": "mean sonotrode face to the part's lowest point",
        **({"sonotrode.frequency_khz": one.note} if one.note else {}),
        **({"part.offset_mm": "the target in the middle"} if any(floor.offset_mm) else {}),
        **({"sonotrode.blocks": BLOCKS} if floor.blocks is not None else {}),
        f"sonotrode.{key}": f"{kind}; one that the sonotrode can set",
    }


def _in_shop(bounds: dict[str, dict[str, Any]], shop: Shop | None) -> dict[str, dict[str, Any]]:
    """Return the bounds of a study within what a shop has: its standard heights, its largest."""
    name, bounds = "chamber.height_mm", dict(bounds)
    if shop is None or name not in bounds:
        return bounds
    low, high = bounds[name]["low"], bounds[name]["high"]
    if shop.heights_mm:
        heights = sorted({one for one in shop.heights_mm if low <= one <= high})
        bounds[name] = {"choose": heights}
        if len(heights) < 2:
            del bounds[name]
    elif shop.largest_chamber_mm is not None:
        bounds[name]["high"] = min(high, math.floor(shop.largest_chamber_mm[2]))
    return bounds


def _faults(made: Proposal) -> tuple[int, int]:
    """Return how many gaps of a proposal jam balls, and how many warnings it has."""
    return len(made.jams), len(made.warnings)


def _checked(
    tables: Tables,
    reasons: dict[str, str],
    floor: Floor,
    known: Sequence[Surface],
    mesh: PartMesh,
    shop: Shop | None,
) -> Proposal:
    """Choose the mass of the balls for these values, and return the built and checked proposal.

    Raises InputError if the chamber would be too large or cannot be built.

    Args:
        tables: tables of the design file. Their mass of the balls is replaced.
        reasons: reason for each value, by dotted name.
        floor: sizes of the chamber, from which the ranges of the study follow.
        known: surfaces to choose the target from.
        mesh: the part.
        shop: the shop in whose bounds the study stays, if it is known.
    """
    sizes = floor.sizes
    largest = max(size for key, size in tables["chamber"].items() if key.endswith("_mm"))
    if largest > LARGEST_MM:
        text = f"the part measures {format_box(mesh.size)}, too much for a chamber: it would need"
        most = f"{largest:g} mm, and {LARGEST_MM:g} mm are the most"
        raise InputError(f"{text} {most}; check --unit, or cut the part down to what is peened")
    design = validate(Design, _nested(tables))
    chamber = build_chamber(design)
    face = float(areas(chamber.vertices, chamber.triangles)[chamber.tags == TAG_SONOTRODE].sum())
    diameter, ball_mass = design.shot.diameter, design.shot.ball_mass
    mass_g, reason = propose_charge(face, diameter, ball_mass)
    tables = {**tables, "shot": {**tables["shot"], "mass_g": mass_g}}
    tables["tolerances"] = propose_tolerances(tables)
    design = validate(Design, _nested(tables))
    reach = shot_reach(design, chamber)
    reasons = {**reasons, "shot.mass_g": f"{reason}: {design.shot.count}", "tolerances": OF_LENGTHS}
    found = tuple(warnings(design, chamber, reach))
    if math.isinf(floor.lean):
        found = (f"chamber: {floor.reason}", *found)
    ranges = propose_ranges(sizes, mass_g, 1e3 * diameter, ball_mass)
    return Proposal(
        design=design,
        tables=tables,
        reasons=reasons,
        bounds=_in_shop({name: one._asdict() for name, one in ranges.items()}, shop),
        known=tuple(known),
        mesh=mesh,
        chamber=chamber,
        reach=reach,
        warnings=found,
        jams=tuple(jam_gaps(chamber, diameter, gaps_in_reach(reach))),
        sonotrode=floor.face.sonotrode,
    )


def _nested(tables: Tables) -> dict[str, object]:
    """Return tables with dotted names, such as "part.target", as tables inside each other."""
    nested: dict[str, Any] = {}
    for name, values in tables.items():
        table = nested
        for key in filter(None, name.split(".")):  # "" is the file's top, above all tables
            table = table.setdefault(key, {})
        table.update(values)
    return nested

"""Propose a whole design for a part, with a wider chamber if its own check warns of gaps.

Every number comes from a rule of thumb, with its reason beside it. A study then varies the numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from chamberopt.chamber.checks.place_names import PART_SIDES, SIDE_WALL
from chamberopt.chamber.checks.warning import DesignWarning, WarningKind
from chamberopt.chamber.layout.arbor import RPM, Bore, find_bores, turning_bore, turning_pose
from chamberopt.chamber.layout.balls import fit_sizes, propose_ball, sizes_to_try
from chamberopt.chamber.layout.end import (
    Shape,
    bare_end,
    can_be_clamped,
    cut_shape,
    held_end,
    local_room,
    root_out,
    strip,
)
from chamberopt.chamber.layout.floor import (
    OUTSIDE,
    SEVERAL,
    Floor,
    clear_of_face,
    floor_on_sonotrode,
    of_blocks,
    require_room,
)
from chamberopt.chamber.layout.pose import (
    AT_SIDE,
    Pose,
    Turns,
    end_to_wall,
    hanging_pose,
    pose_by_size,
    pose_in_words,
    propose_pose,
    square_to_walls,
)
from chamberopt.chamber.layout.sizes import middle_in_plan, propose_sizes, shape_for
from chamberopt.chamber.layout.target import (
    Surface,
    Target,
    fewer_fillets,
    propose_target,
    surfaces,
)
from chamberopt.chamber.part import Part, posed_part
from chamberopt.chamber.propose.held_proposal import (
    hangs_by_a_face,
    held,
    is_firm,
    is_held_thinly,
    masked,
    only_touched,
    padded,
    rests,
)
from chamberopt.chamber.propose.proposal import (
    LARGEST_MM,
    REPLICAS,
    Proposal,
    Stance,
    Tables,
    Wanted,
    checked,
    faults,
    nested,
    touched_share,
)
from chamberopt.chamber.propose.proposed_clamp import clamped_outside, grips_poorly
from chamberopt.chamber.shop import HARD, STEEL, Shop, usual_shop
from chamberopt.common.errors import InputError, UnreadableError
from chamberopt.common.progress import step
from chamberopt.common.toml_fields import MAX_COORDINATE_MM
from chamberopt.design.design import Design, validate
from chamberopt.design.materials import CATALOGUE, USUAL, alloy, ball, balls
from chamberopt.geometry.heights import lowest_over, points_up_to
from chamberopt.geometry.meshes.part_mesh import PartMesh, keep_part, read_part_cached
from chamberopt.geometry.meshes.surface_error import format_box
from chamberopt.geometry.meshes.units import BY_SIZE, METRES_PER
from chamberopt.geometry.triangles import rotation_matrix

LEAST_TOUCHED = 0.02  # share of the target that balls which are wished for have to touch
REACHES = 0.95  # of a part's length, from which on a target reaches both of its ends
AT_WALL = 2.0  # ball diameters from the target to the wall through which its end goes out
OVER_RIM = (0.0, 2.5e-3, 5e-3)  # m over the ceiling at which a clamp may begin, as over a flange
ROUNDED = 0.5e-3  # m by which sizes are rounded up
FEW = 2  # sonotrodes side by side that are better than a room of which the part is held badly
WIDER = (1.0, 1.4, 2.0)  # factors on the room round the part that are tried
AMPLITUDE_UM = 40.0  # zero-to-peak; the nearest that the sonotrode can set is taken
USUAL_PART, WALL, SONOTRODE = "42CrMo4", "100Cr6", "Ti-6Al-4V"  # of the catalogue
CERAMIC = "zirconia"  # for metals on which steel leaves iron
# Least hardness of steel balls over the part's. A part as hard as they are is dented less: in
# pilots of a gear of 650 HB tungsten carbide left 9 times the dents.
HARDER = 1.25
HARDENED_HB = 280.0  # of steel: from here on it was hardened, to what its name does not tell
# By metal of the part. Of aluminium: SAE AMS-S-13165, note 5 to table VI (design/intensity.py).
IRON = {
    "aluminium": "STEEL LEAVES IRON on aluminium: decontaminate (note 5 to table VI of SAE "
    "AMS-S-13165), or ceramic balls, such as --shot zirconia",
    "titanium": "STEEL LEAVES IRON on titanium: decontaminate, or ceramic balls, such as --shot "
    "zirconia (no source read)",
    "cobalt": "STEEL LEAVES IRON on cobalt, as of implants: decontaminate, or ceramic balls, "
    "such as --shot zirconia (no source read)",
}
ON_STAINLESS = (
    "STEEL LEAVES IRON on stainless steel, which rusts: passivate the part, or ceramic balls, such "
    "as --shot zirconia (no source read)"
)
TREATMENT_S, HALF_WIDTH, MOST_REPLICAS = 300.0, 0.03, 24
BETWEEN = "a plate that fits between the faces of the part, like the two walls beside them"
CUT_OUT = "plates, cut out round it"
OWN_WALL, OWN_LID = "the part itself is the wall", f"the part itself is the lid: {CUT_OUT}"
START = "NOT MEASURED by a pilot, a start"
FEWER = "so that a strip of it takes few sonotrodes"
NOT_THIN = "so that it is held by an end of thicker metal"
ON_END = "on end, as no single sonotrode is large enough for it lying"
Chooser = Callable[[Sequence[Surface]], Sequence[str]]


class _Given(NamedTuple):
    """A part, and what is wished of a design for it."""

    path: Path
    wanted: Wanted
    mesh: PartMesh
    known: Sequence[Surface]


def propose(path: Path, wanted: Wanted, choose: Chooser) -> Proposal:
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
    if wanted.without_fillets:
        target = fewer_fillets(mesh, target)[wanted.without_fillets - 1]
    _require_near_origin(path, target)
    given = _Given(path, wanted, mesh, known)
    shape = Shape(mesh.vertices, mesh.triangles, target.triangles)
    if wanted.pose is None:
        stance = Stance(target, *propose_pose(*shape))
    else:
        as_asked = f"{wanted.pose.replace('-', ' ')}, as asked"
        stance = Stance(target, pose_by_size(*shape, wanted.pose), as_asked)
    keeps_target = bool(asked) or not wanted.may_leave_end
    if wanted.pose in AT_SIDE:
        return _lying(given, stance, keeps_target)
    if wanted.pose is None and wanted.thick_pose is not None:
        return _proposed(given, Stance(target, pose_by_size(*shape, wanted.thick_pose), NOT_THIN))
    end = None if keeps_target else held_end(mesh, target, stance.turns)
    made = _proposed(given, stance._replace(end=end))
    if wanted.pose is None and is_held_thinly(made):
        return _held_otherwise(given, target, made)
    if end is not None and "holder" not in made.tables:  # nothing holds the end: it is peened too
        return _proposed(given, stance)
    if keeps_target or wanted.pose or end is not None or not hangs_by_a_face(made):
        return made
    end = held_end(mesh, target, made.design.part.rotate_deg, of_any=True)
    if end is not None:
        with suppress(InputError):
            other = _proposed(given, stance._replace(why=ON_END, end=end))
            if "holder" in other.tables and faults(other) <= faults(made):
                return other
    return made


def propose_alike(like: Proposal, path: Path, wanted: Wanted, choose: Chooser) -> Proposal:
    """Propose a design in which the part stands and is held as in another one, where that can be.

    Args:
        like: the other one, such as with other balls.
        path, wanted, choose: those of propose.
    """
    if like.stance is not None:
        with suppress(InputError):
            given = _Given(path, wanted, like.mesh, like.known)
            made = _proposed(given, like.stance, like)
            is_held = "holder" in made.tables or "holder" not in like.tables
            if is_held and made.sonotrode_count <= like.sonotrode_count:
                return replace(
                    made, without_fillets=like.without_fillets, thick_pose=like.thick_pose
                )
    return propose(path, wanted, choose)


def _held_otherwise(given: _Given, target: Target, made: Proposal) -> Proposal:
    """Return a proposal in whose pose, or with fewer fillets as its target, an end holds the part.

    Args:
        made: the proposal for all of the target, whose holder grips an end of thin metal. It is
            returned where nothing else holds the part better.
    """
    mesh = given.mesh
    targets = [target, *fewer_fillets(mesh, target)]
    ways: list[tuple[Pose | None, int]] = [("standing", 0)]
    ways += [(None, number) for number in range(1, len(targets))]
    second: Proposal | None = None  # on which balls would come to rest
    for pose, number in (*ways, *((one, 0) for one in AT_SIDE)):
        of = targets[number]
        shape = mesh.vertices, mesh.triangles, of.triangles
        if pose is None:
            turns, why = propose_pose(*shape)
        else:
            turns, why = pose_by_size(*shape, pose), NOT_THIN
            if turns[:2] == made.design.part.rotate_deg[:2]:
                continue
        with suppress(InputError):
            other = _proposed(given, Stance(of, turns, why))
            other = replace(other, without_fillets=number, thick_pose=pose)
            is_held = is_firm(other) and not grips_poorly(other) and not is_held_thinly(other)
            if not is_held or len(other.jams) > len(made.jams):
                continue
            if not rests(other):
                return other
            second = second or other
    return second or made


def _lying(given: _Given, stance: Stance, keeps_target: bool) -> Proposal:
    """Return a proposal for a part that lies, held at its side.

    Where it is not held firmly otherwise, an end is left out of a target that reaches both ends, if
    it may be changed.
    """
    mesh, target, turns = given.mesh, stance.target, stance.turns
    upright = pose_by_size(mesh.vertices, mesh.triangles, target.triangles, "standing")
    by_root: Proposal | None = None
    if (bare := bare_end(mesh, target, upright)) is not None:
        with suppress(InputError):
            root = bare._replace(turns=turns, goes_out=True)
            made = _proposed(given, stance._replace(end=root))
            if is_firm(made):
                by_root = made
                if not rests(by_root):
                    return by_root
    along = mesh.vertices @ rotation_matrix(upright)[2]
    whole = np.ptp(along[mesh.triangles[target.triangles]]) > REACHES * np.ptp(along)
    for of_any in (False, True):
        end = None if keeps_target else held_end(mesh, target, upright, of_any)
        lying = None if end is None else end._replace(turns=turns, goes_out=True)
        made = _proposed(given, stance._replace(end=lying))
        if end is not None or keeps_target or not whole or is_firm(made):
            break
    if end is not None and "holder" not in made.tables:
        made = _proposed(given, stance)
    # Balls that rest on the part speak against a pose, not against what holds it there.
    if by_root is not None and rests(made) and faults(by_root) <= faults(made):
        return by_root
    return made


def _in_strips(
    given: _Given, target: Target, poses: dict[Turns, str], ball: float
) -> Proposal | None:
    """Return the proposal for a strip of a target that takes the fewest sonotrodes, of few faults.

    It is None where no strip stands on as many sonotrodes as a shop mounts.

    Args:
        poses: the poses that are tried [degrees], and why each is taken.
        ball: diameter of the balls [m].
    """
    shop, found = given.wanted.shop or usual_shop(), []
    sides = [side for one in shop.sonotrodes if one.size_mm for side in one.size_mm]
    longest = 1e-3 * max(sides, default=0.0) - 2.0 * AT_WALL * ball - ROUNDED
    for turns, why in poses.items():
        if (end := strip(given.mesh, target, turns, longest)) is not None:
            with suppress(InputError):
                made = _proposed(given, Stance(target, turns, why, end))
                if made.design.sonotrode.face and made.sonotrode_count <= SEVERAL:
                    found.append(made)
    return min(found, key=lambda one: (one.sonotrode_count, *faults(one)), default=None)


def _proposed(given: _Given, stance: Stance, like: Proposal | None = None) -> Proposal:
    """Return a proposal for a target of a part.

    Raises InputError if no chamber can be built round it.

    Args:
        like: a proposal in this stance, whose holder and pad are tried first.
    """
    (path, wanted, mesh, known), (target, turns, pose_reason, end, is_local) = given, stance
    part_alloy, shop = alloy(wanted.alloy or USUAL_PART).name, wanted.shop or usual_shop()
    shot, shot_reason = _shot(wanted.shot, part_alloy, shop)
    whole = target
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
    if not (end or wanted.pose) and (hanging := _hanging(mesh, target, turns, diameter, wanted)):
        turns, pose_reason = hanging, ON_END
    shape = cut_shape(mesh, target.triangles, target.keys.get("box_mm"))
    if end is not None and end.room_mm is not None:  # the room is round all of that
        shape = cut_shape(mesh, np.ones(len(mesh.triangles), dtype=bool), end.room_mm)
    # Balls would lie on what holds an end at the side: it goes out through the wall instead.
    out = end.axis if end is not None and end.goes_out else None
    bores = find_bores(mesh, target.triangles)
    may_turn = wanted.may_turn and wanted.pose is None
    turning = turning_bore(bores, mesh, target.triangles) if may_turn else None
    is_whole = turning is None and (end is None or end.strips is None)
    if is_whole and not _can_be_mounted(shape, turns, diameter, wanted, out):
        poses = {turns: pose_reason}
        for one in AT_SIDE if wanted.pose is None else ():
            pose = pose_by_size(mesh.vertices, mesh.triangles, whole.triangles, one)
            poses.setdefault(pose, FEWER)
        in_strips = _in_strips(given, whole, poses, diameter)
        if in_strips is not None:
            return in_strips
    is_guessed = any(f"({BY_SIZE})" in note for note in mesh.notes)
    measures = f"the part measures {format_box(mesh.size)}"
    by = "as asked" if wanted.unit in METRES_PER else "by the file"
    reasons = {
        "part.unit": f"UNIT GUESSED: {measures}"
        if is_guessed
        else f"{measures}, unit {mesh.unit}, {by}",
        "part.target": target.reason,
        "shot.diameter_mm": ball_reason,
        **({"shot.material": shot_reason} if shot_reason else {}),
        "materials.part": "how balls rebound from it (C0, v0) is computed: to be calibrated"
        + _hardness_in_words(part_alloy, shot)
        if wanted.alloy
        else "ALLOY NOT KNOWN, a guess: chamberopt materials lists alloys",
        "materials.wall": "hardened, as soft walls slow the balls; give yours",
        "effects.friction": "mu of these balls on these metals, dry: chamberopt materials",
        "effects.roughness": "rms slope of faces that shot has dented",
        "process.treatment_time_s": f"{START}: the report has coverage over time",
        "process.accuracy.simulated_time_s": "a start: results say what is resolved",
        "process.accuracy.objective_half_width": "until it is so sure; of a time: this share",
    }

    goes_out = out is not None

    def built(is_local: bool, turning: Bore | None = None) -> tuple[Proposal, Floor]:
        """Return the proposal with the least room that is free of gaps, else of fewest faults.

        Args:
            is_local: true for a chamber round the target, whose walls the part goes out through.
            turning: a bore about whose axis, which is then level, the part turns.
        """
        best: tuple[Proposal, Floor] | None = None
        refused: InputError | None = None
        common, pose, why_so, form = tables, turns, pose_reason, wanted
        if turning is not None:
            pose, turn = turning_pose(turning, mesh)
            common = {**tables, "effects": {**tables["effects"], "part_turn": turn}}
            why_so = "its axis level: about it the part turns, so that all of it passes the shot"
            form = replace(wanted, shape=wanted.shape or "box")
        for number, wider in enumerate(WIDER):
            progress(number, len(WIDER), None)
            try:
                placed, floor = _place(shape, pose, diameter, form, wider, is_local, out)
                floor = floor._replace(strips=end.strips if end is not None else None)
                part = {**tables["part"], "rotate_deg": list(placed)}
                if any(floor.offset_mm):
                    part["offset_mm"] = list(floor.offset_mm)
                own = {**common, "part": part, **_floor_tables(floor)}
                words = {"part.rotate_deg": f"{pose_in_words(mesh, known, placed)}: {why_so}"}
                if turning is not None:
                    words["part.rotate_deg"] = why_so
                    words["effects.part_turn"] = (
                        f"TURNED BY A DRIVE, at {RPM:g} rpm: its shaft is sealed in the wall"
                    )
                why = {**reasons, **words, **_floor_reasons(floor, goes_out, diameter)}
                made = checked(own, why, floor, known, mesh, wanted.shop)
            except UnreadableError:
                raise
            except InputError as error:
                # Its frames hold bodies, of which manifold3d complains at the end of the process.
                refused = refused or error.with_traceback(None)
                continue
            if best is None or faults(made) < faults(best[0]):
                best = made, floor
            if not any(map(_takes_room, made.warnings)):
                break
        if best is None:
            assert refused is not None
            raise refused
        return best

    spare: tuple[Proposal, Floor] | None = None  # a room of which the part is held badly
    with step("building and checking the chamber") as progress:
        is_local |= goes_out
        made, floor = built(is_local)
        is_large = not floor.is_one_sonotrode or made.is_capped
        if is_large and not is_local and like is None:
            with suppress(InputError):
                local, its_floor = built(is_local=True)
                if its_floor.is_one_sonotrode and not local.is_capped:
                    if not local.chamber.pieces_in_air:
                        local = clamped_outside(local, its_floor, wanted.shop)
                        local = padded(local, its_floor, target, wanted.shop, like)
                    if grips_poorly(local):
                        spare = local, its_floor
                    elif faults(local) <= faults(made):
                        made, floor, is_local = local, its_floor, True
    if made.chamber.pieces_in_air:
        with step("choosing what holds the part") as progress:
            above = None if goes_out else end
            made = held(made, floor, target, above, bores, wanted.shop, progress, like)
    elif "holder" not in made.tables:
        made = clamped_outside(made, floor, wanted.shop)
    is_small = floor.face is not None and made.sonotrode_count <= FEW
    is_good = is_small and "holder" in made.tables
    if spare is not None and not is_good and faults(spare[0]) <= faults(made):
        (made, floor), is_local = spare, True
    if turning is not None:
        with step("trying it on its axis, turning") as progress, suppress(InputError):
            other, its_floor = built(is_local=False, turning=turning)
            other = held(other, its_floor, target, None, [turning], wanted.shop, progress)
            as_good = (*faults(other), *its_floor.excess) <= (*faults(made), *floor.excess)
            if as_good and "holder" in other.tables:
                made, floor, is_local = other, its_floor, False
    holes = find_bores(mesh, target.triangles, for_arbor=False)
    made = padded(masked(made, floor, holes, wanted.shop), floor, target, wanted.shop, like)
    made = only_touched(made, floor, wanted.shop)
    if wanted.ball_mm is not None and touched_share(made) < LEAST_TOUCHED:
        raise InputError(_too_large(made, shop.stock_mm(shot)))
    left_out = end is not None and end.target is not whole
    made = replace(
        made,
        reasons={**made.reasons, **_room_reason(made, floor)},
        leaves_end=left_out,
        stance=Stance(whole, turns, pose_reason, end, is_local),
    )
    if spare is None or end is not None or wanted.pose is not None or not grips_poorly(made):
        return made
    upright = pose_by_size(mesh.vertices, mesh.triangles, target.triangles, "standing")
    by_root = root_out(mesh, target, turns, AT_WALL * diameter)
    for pose, why, root in ((turns, pose_reason, by_root), (upright, ON_END, None)):
        if root is not None or pose != turns:
            with suppress(InputError):
                other = _proposed(given, Stance(target, pose, why, root))
                is_better = is_firm(other) and not grips_poorly(other) and not rests(other)
                if is_better and other.sonotrode_count <= made.sonotrode_count:
                    return other
    return made


def _takes_room(warning: DesignWarning) -> bool:
    """Return whether a warning tells of what more room beside the part may end.

    A gap between two faces of the part is left as it is.
    """
    kind = warning.kind
    if kind in (WarningKind.JAM, WarningKind.NARROW_GAP):
        return not PART_SIDES.issuperset(warning.about)
    gutter = kind == WarningKind.REST and SIDE_WALL in warning.about
    return gutter or kind in (WarningKind.TURNING_GAP, WarningKind.SIDE_WALL)


def _too_large(made: Proposal, stock_mm: Sequence[float]) -> str:
    """Return a message on wished balls that touch none of the target, and which would."""
    given = made.tables["shot"]["diameter_mm"]
    fits = fit_sizes(made.chamber.part, [1e-3 * one for one in sorted(stock_mm)])
    most = max(one.touched for one in fits)
    largest = [1e3 * one.diameter for one in fits if one.touched >= max(0.5 * most, LEAST_TOUCHED)]
    remedy = f"give {largest[-1]:g} or smaller" if largest else "no size in stock does; --target"
    touches = f"but such balls touch {touched_share(made):.0%} of the target"
    return f"--ball-mm: given {given:g}, {touches}: {remedy}"


def _shot(name: str, part: str, shop: Shop) -> tuple[str, str]:
    """Return the material of the balls, and why they are not of steel or what steel leaves behind.

    Raises InputError if a wanted material is unknown, or its hardness and so its restitution is
    not known.

    Args:
        name: the wanted material; if it is empty, steel, a harder one for a hard part, or a
            ceramic where steel must leave no iron.
        part: the part's alloy.
    """
    if name and ball(name).hardness_HB is None:
        known = ", ".join(one.name for one in balls() if one.hardness_HB is not None)
        text = "the hardness of these balls is not known, and their restitution follows from it"
        raise InputError(f"--shot: given {name!r}; {text}; give one of {known}")
    hardness = alloy(part).hardness_HB
    metal, is_stainless = alloy(part).metal, alloy(part).stainless
    spoiled = metal if metal in IRON else "stainless steel" if is_stainless else ""
    if not name and spoiled and shop.has(CERAMIC):
        return CERAMIC, f"steel leaves iron on {spoiled}"
    if name or (ball(STEEL).hardness_HB or 0.0) >= HARDER * hardness or not shop.has(HARD):
        found = ball(name or STEEL).name
        on_steel = ON_STAINLESS if is_stainless else ""
        return found, IRON.get(metal, on_steel) if found == STEEL else ""
    return HARD, f"harder than the part, of {hardness:g} HB: balls of steel dent it less"


def _hardness_in_words(part: str, shot: str) -> str:
    """Return what is said of a hardness that decides the balls or the intensity; else nothing.

    The name of a steel that is hardened does not tell in which state the part is.

    Args:
        part: the part's alloy.
        shot: material of the balls.
    """
    metal = alloy(part)
    if metal.metal != "steel" or metal.stainless or metal.hardness_HB < HARDENED_HB:
        return ""
    state = metal.condition.replace(";", ",").replace(f", {metal.hardness_HB:g} HB", "")
    text = f"; HARDNESS ASSUMED, {metal.hardness_HB:g} HB ({state}): confirm it, as "
    if shot == HARD:
        return (
            f"{text}it decides the balls: of steel they are no harder than the part, in use too, "
            "and wear the sonotrode less (--shot steel)"
        )
    return f"{text}it decides which intensity is usual"


def _read(path: Path, unit: str) -> PartMesh:
    """Return the part in a file. Messages name the option --unit, not the design's part.unit."""
    try:
        mesh = read_part_cached(path, unit)
    except InputError as error:
        error.args = (str(error).replace("part.unit", "--unit"),)
        raise
    keep_part(mesh, path, mesh.unit)  # designs name the unit
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
    return posed_part(validate(Design, nested({**tables, **alone})))[0]


def _place(
    part: Shape,
    turns: Turns,
    ball: float,
    wanted: Wanted,
    wider: float,
    is_local: bool = False,
    out: np.ndarray | None = None,
) -> tuple[Turns, Floor]:
    """Return the turns of a part [degrees] and the sizes of a chamber round it on a sonotrode.

    The form of the chamber is the wanted one, else a cylinder where a sonotrode carries it. Else it
    is that whose walls lean less, or the smaller one: a cylinder, or the form that suits the part.

    Args:
        turns: turns that bring the target down; the part may still be turned about z.
        ball: diameter of the balls [m].
        wider: factor on the room round the part.
        is_local: true for a chamber round the target, whose walls the part goes out through.
        out: axis of the part's file (3,) along which an end goes out through a wall, near which the
            target ends.
    Raises:
        InputError: the shop has no sonotrode for it, or no chamber so large.
    """
    square, found = square_to_walls(part.vertices, turns), []
    if out is not None:
        square = end_to_wall(turns, out)
    suits = shape_for(np.ptp(part.vertices @ rotation_matrix(square).T, axis=0))
    refused: InputError | None = None
    usual = ["box"] if is_local else ["cylinder", suits]
    for shape in dict.fromkeys([wanted.shape] if wanted.shape else usual):
        placed = square if shape == "box" else turns
        posed = part.vertices @ rotation_matrix(placed).T
        posed[:, 2] -= posed[:, 2].min()
        on_target = posed[np.unique(part.triangles[part.target])]
        top, around = float(on_target[:, 2].max()), on_target if is_local else None
        sizes = propose_sizes(posed, top, ball, shape, wider, around, part.triangles)
        shop = wanted.shop
        out_at = sizes.height - sizes.distance
        if (
            sizes.through_ceiling
            and not is_local
            and not any(can_be_clamped(posed, part.triangles, 2, out_at + one) for one in OVER_RIM)
        ):  # a higher ceiling takes in the whole part
            sizes = propose_sizes(posed, float(posed[:, 2].max()), ball, shape, wider)
        local = None
        if is_local and shape == "box":
            at_wall = None if out is None else AT_WALL * wider * ball
            local = local_room(posed, part.triangles, part.target, sizes, at_wall)
            sizes = local.sizes
        try:
            floor = floor_on_sonotrode(
                sizes, _round(posed), shop or usual_shop(), shop is None, ball
            )
            lowest = 0.0
            if local is not None:
                lowest = lowest_over(posed, part.triangles, local.plan(floor.sizes))
                floor = floor._replace(sizes=local.as_low_as(floor.sizes, lowest))
                below = lowest - floor.sizes.distance
                floor = clear_of_face(
                    floor, posed, part.triangles, local.middle(floor.sizes), below
                )
            if shop is not None:
                room, highest = require_room(floor.sizes, shop), float(posed[:, 2].max()) - lowest
                if highest < room.height - room.distance:  # a higher lid takes in the whole part
                    room = replace(room, through_ceiling=False, top=highest)
                floor = floor._replace(sizes=room)
            if is_local:
                middle = middle_in_plan(on_target) if local is None else local.middle(floor.sizes)
                x, y = np.round(1e3 * (middle_in_plan(posed) - middle), 2) + 0.0
                floor = floor._replace(offset_mm=(float(x), float(y)))
        except InputError as error:
            refused = refused or error.with_traceback(None)
            continue
        found.append((placed, floor))
    if refused and not found:
        raise refused
    return min(found, key=lambda one: one[1].excess)


def _can_be_mounted(
    part: Shape, turns: Turns, ball: float, wanted: Wanted, out: np.ndarray | None
) -> bool:
    """Return whether as many sonotrodes as a shop mounts carry a chamber for all of a target.

    Args:
        part, turns, ball, wanted, out: as of _place.
    """
    for is_local in {True, out is not None}:
        with suppress(InputError):
            _, floor = _place(part, turns, ball, wanted, 1.0, is_local, out)
            if floor.face is not None and floor.stand.face.count <= SEVERAL:
                return True
    return False


def _hanging(
    mesh: PartMesh, target: Target, turns: Turns, ball: float, wanted: Wanted
) -> Turns | None:
    """Return turns with which the part hangs on end, if only then a sonotrode carries the chamber.

    Args:
        turns, ball, wanted: as of _place.
    """

    whole = Shape(mesh.vertices, mesh.triangles, target.triangles)

    def is_carried(pose: Turns) -> bool:
        try:
            return _place(whole, pose, ball, wanted, 1.0)[1].is_one_sonotrode
        except InputError:
            return False

    hanging = hanging_pose(*whole, turns)
    needed = hanging is not None and not is_carried(turns) and is_carried(hanging)
    return hanging if needed else None


def _round(posed: np.ndarray) -> float:
    """Return the radius [m] of the part about the middle of its box, seen from above."""
    plan = posed[:, :2]
    middle = 0.5 * (plan.min(axis=0) + plan.max(axis=0))
    return float(np.linalg.norm(plan - middle, axis=1).max())


def _floor_tables(floor: Floor) -> Tables:
    """Return the tables of the design file that follow from the floor: chamber and sonotrode."""
    sizes, one = floor.sizes, floor.stand.sonotrode
    key, amplitude = one.amplitude_nearest(AMPLITUDE_UM)
    sonotrode: dict[str, Any] = {"frequency_khz": one.frequency_khz, key: amplitude}
    if floor.face is not None:
        sonotrode["face"] = floor.face.model_dump(mode="json", exclude_defaults=True)
    return {
        "chamber": {
            "shape": sizes.shape,
            **sizes.plan,
            "height_mm": round(1e3 * sizes.height, 3),
            "sonotrode_distance_mm": round(1e3 * sizes.distance, 3),
        },
        "sonotrode": sonotrode,
    }


def _floor_reasons(floor: Floor, goes_out: bool, ball: float) -> dict[str, str]:
    sizes, one = floor.sizes, floor.stand.sonotrode
    where = "; the part goes out through it" if sizes.through_ceiling else ""
    where = f"; {BETWEEN}" if sizes.is_fixed else where
    where += "; " + OWN_LID if "z" in sizes.closed else ""
    placed = "the target ends near the wall" if goes_out else "the target in the middle"
    key, _ = one.amplitude_nearest(AMPLITUDE_UM)
    kind = (
        "zero-to-peak, half of" if key == "amplitude_um" else "peak-to-valley, twice zero-to-peak"
    )
    kind += " peak-to-valley" if key == "amplitude_um" else ""
    return {
        "chamber.height_mm": f"sonotrode to ceiling{where}",
        "chamber.sonotrode_distance_mm": "mean sonotrode face to the part's lowest point in it"
        + (f", so far that {OUTSIDE}" if floor.is_raised else ""),
        **({"sonotrode.frequency_khz": one.note} if one.note else {}),
        **({"sonotrode.face": of_blocks(ball)} if floor.stand.face.count > 1 else {}),
        **({"part.offset_mm": placed} if any(floor.offset_mm) else {}),
        f"sonotrode.{key}": f"{kind}; one to which the sonotrode can be set",
    }


def _room_reason(made: Proposal, floor: Floor) -> dict[str, str]:
    """Return the reason for a chamber's first size in plan, by its dotted name.

    It tells how far the walls are from the part, or from the target where the part goes out.
    """
    sizes = floor.sizes
    first = next(key for key in sizes.plan if key.endswith("_mm"))
    room = f"leaves at least {1e3 * sizes.gap:.3g} mm beside the part"
    if sizes.shape == "box" and not floor.lean:
        room = f"leaves {_room_in_box(made)}"
    if sides := [one for one in sizes.closed if one != "z"]:
        room += f"; {OWN_WALL} at {' and '.join(sides)}: {CUT_OUT}"
    return {f"chamber.{first}": f"{room}; {floor.reason}"}


def _room_in_box(made: Proposal) -> str:
    """Return in words how far each wall of an upright box is from the part, or from the target.

    What of the part is above the ceiling does not count.
    """
    part, chamber = made.chamber.part, made.tables["chamber"]
    below = points_up_to(part.vertices, part.triangles, 1e-3 * chamber["height_mm"])
    on_target = part.vertices[part.triangles[part.target]].reshape(-1, 3)
    beside, before = [], []
    for k, (name, key) in enumerate((("x", "length_mm"), ("y", "width_mm"))):
        for side, sign in (("-", -1.0), ("+", 1.0)):
            whole, target = (
                0.5 * float(chamber[key]) - 1e3 * float((sign * one[:, k]).max())
                for one in (below, on_target)
            )
            if whole > 0.0:
                beside.append(f"{whole:.3g} mm at {side}{name}")
            else:
                before.append(f"{max(target, 0.0):.3g} mm at {side}{name}")
    words = [f"{', '.join(beside)} beside the part"] if beside else []
    if before:
        words.append(f"{', '.join(before)} beside the target, where the part goes out")
    return " and ".join(words)

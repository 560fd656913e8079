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
from chamberopt.chamber.layout.arbor import Bore, find_bores
from chamberopt.chamber.layout.balls import fit_sizes, propose_ball, sizes_to_try
from chamberopt.chamber.layout.end import Shape, bare_end, cut_shape, held_end, root_out, strip
from chamberopt.chamber.layout.floor import SEVERAL, Floor
from chamberopt.chamber.layout.pose import (
    AT_SIDE,
    TURNING,
    Turns,
    Upright,
    pose_by_size,
    pose_in_words,
    propose_pose,
    square_poses,
)
from chamberopt.chamber.layout.shot_material import choose_shot, hardness_in_words
from chamberopt.chamber.layout.target import (
    Surface,
    Target,
    fewer_fillets,
    propose_target,
    surfaces,
)
from chamberopt.chamber.layout.turning import RPM, Spindle, find_spindle, turning_bore, turning_pose
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
from chamberopt.chamber.propose.proposed_budget import OF_TIME
from chamberopt.chamber.propose.proposed_clamp import clamped_outside, grips_poorly, why_not_turned
from chamberopt.chamber.propose.proposed_room import (
    AMPLITUDE_UM,
    AT_WALL,
    can_be_mounted,
    floor_reasons,
    floor_tables,
    hanging_turns,
    place_room,
    room_reason,
    under_low_ceiling,
)
from chamberopt.chamber.shop import Shop, usual_shop
from chamberopt.common.errors import InputError, UnreadableError
from chamberopt.common.progress import step
from chamberopt.common.toml_fields import MAX_COORDINATE_MM
from chamberopt.design.design import Design, validate
from chamberopt.design.materials import CATALOGUE, USUAL, alloy
from chamberopt.geometry.meshes.part_mesh import PartMesh, keep_part, read_part_cached
from chamberopt.geometry.meshes.surface_error import format_box
from chamberopt.geometry.meshes.units import BY_SIZE, METRES_PER
from chamberopt.geometry.triangles import rotation_matrix

LEAST_TOUCHED = 0.02  # share of the target that balls which are wished for have to touch
REACHES = 0.95  # of a part's length, from which on a target reaches both of its ends
ROUNDED = 0.5e-3  # m by which sizes are rounded up
FEW = 2  # sonotrodes side by side that are better than a room of which the part is held badly
WIDER = (1.0, 1.4, 2.0)  # factors on the room round the part that are tried
USUAL_PART, WALL, SONOTRODE = "42CrMo4", "100Cr6", "Ti-6Al-4V"  # of the catalogue
TREATMENT_S, HALF_WIDTH, MOST_REPLICAS = 300.0, 0.03, 24
START = f"{OF_TIME[2]}, a start"
FEWER = "so that a strip of it takes few sonotrodes"
NOT_THIN = "so that it is held by an end of thicker metal"
ASLANT = "the target faces the sonotrode aslant, so that the part itself is held firmly"
TURNED = "its axis level: about it the part turns, so that all of it passes the shot"
NO_SPINDLE = "--pose: given turning, but {}; give another pose, or another target (--target)"
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
    choose_shot(wanted.shot, alloy(wanted.alloy or USUAL_PART).name, wanted.shop or usual_shop())
    with step("reading the part"):
        mesh = _read(path, wanted.unit)
    with step("finding faces and fillets"):
        known = surfaces(mesh)
    asked = choose(known)
    target = propose_target(mesh, known, asked)
    if wanted.without_fillets:
        target = fewer_fillets(mesh, target)[wanted.without_fillets - 1]
    _require_near_origin(path, target)
    given = _Given(path, wanted, mesh, known)
    shape = Shape(mesh.vertices, mesh.triangles, target.triangles)
    if wanted.pose == TURNING:
        return _turning(given, target)
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
    if wanted.pose is None and end is None and not is_firm(made):
        for turns in square_poses(stance.turns):
            with suppress(InputError):
                other = _proposed(given, Stance(target, turns, ASLANT))
                if is_firm(other) and _is_no_worse(other, made):
                    return other
    if keeps_target or wanted.pose or end is not None or not hangs_by_a_face(made):
        return made
    end = held_end(mesh, target, made.design.part.rotate_deg, of_any=True)
    if end is not None:
        with suppress(InputError):
            other = _proposed(given, stance._replace(why=ON_END, end=end))
            if "holder" in other.tables and faults(other) <= faults(made):
                return other
    return made


def _turning(given: _Given, target: Target) -> Proposal:
    """Return a proposal whose part turns about a level axis, by an arbor or by its own ends.

    Raises InputError if the target does not go round an axis, or the part cannot turn about it.
    """
    mesh = given.mesh
    shape = mesh.vertices, mesh.triangles, target.triangles
    if turning_bore(find_bores(mesh, target.triangles), mesh, target.triangles) is not None:
        free = given._replace(wanted=replace(given.wanted, pose=None))
        made = _proposed(free, Stance(target, *propose_pose(*shape)))
        if made.design.effects.part_turn is not None:
            return made
    if (spindle := find_spindle(mesh, target.triangles)) is None:
        raise InputError(NO_SPINDLE.format("the target looks the same round no axis"))
    turns, _ = turning_pose(spindle, mesh)
    return _proposed(given, Stance(target, turns, TURNED, is_local=True, spindle=spindle))


def _is_no_worse(other: Proposal, made: Proposal) -> bool:
    """Return whether a proposal has no more faults and sonotrodes, and touches as much."""
    return (
        faults(other) <= faults(made)
        and other.sonotrode_count <= made.sonotrode_count
        and touched_share(other) >= touched_share(made) - LEAST_TOUCHED
    )


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
    ways: list[tuple[Upright | None, int]] = [("standing", 0)]
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
    (path, wanted, mesh, known), (target, turns, pose_reason, end, is_local, spindle) = (
        given,
        stance,
    )
    part_alloy, shop = alloy(wanted.alloy or USUAL_PART).name, wanted.shop or usual_shop()
    shot, shot_reason = choose_shot(wanted.shot, part_alloy, shop)
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
    if not (end or wanted.pose or spindle) and (
        hanging := hanging_turns(mesh, target, turns, diameter, wanted)
    ):
        turns, pose_reason = hanging, ON_END
    shape = cut_shape(mesh, target.triangles, target.keys.get("box_mm"))
    if end is not None and end.room_mm is not None:  # the room is round all of that
        shape = cut_shape(mesh, np.ones(len(mesh.triangles), dtype=bool), end.room_mm)
    # Balls would lie on what holds an end at the side: it goes out through the wall instead.
    out = end.axis if end is not None and end.goes_out else None
    if spindle is not None:
        out = spindle.axis
    bores = find_bores(mesh, target.triangles)
    may_turn = wanted.may_turn and wanted.pose is None
    turning = turning_bore(bores, mesh, target.triangles) if may_turn else None
    is_whole = not (turning or spindle) and (end is None or end.strips is None)
    if is_whole and not can_be_mounted(shape, turns, diameter, wanted, out):
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
        + hardness_in_words(part_alloy, shot)
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

    def built(is_local: bool, turning: Bore | Spindle | None = None) -> tuple[Proposal, Floor]:
        """Return the proposal with the least room that is free of gaps, else of fewest faults.

        Args:
            is_local: true for a chamber round the target, whose walls the part goes out through.
            turning: about whose axis, which is then level, the part turns.
        """
        best: tuple[Proposal, Floor] | None = None
        refused: InputError | None = None
        common, pose, why_so, form = tables, turns, pose_reason, wanted
        if turning is not None:
            pose, turn = turning_pose(turning, mesh)
            common = {**tables, "effects": {**tables["effects"], "part_turn": turn}}
            why_so = TURNED
            form = replace(wanted, shape=wanted.shape or "box")
        for number, wider in enumerate(WIDER):
            progress(number, len(WIDER), None)
            try:
                placed, floor = place_room(shape, pose, diameter, form, wider, is_local, out)
                floor = floor._replace(strips=end.strips if end is not None else None)
                part = {**tables["part"], "rotate_deg": list(placed)}
                if any(floor.offset_mm):
                    part["offset_mm"] = list(floor.offset_mm)
                own = {**common, "part": part, **floor_tables(floor)}
                words = {"part.rotate_deg": f"{pose_in_words(mesh, known, placed)}: {why_so}"}
                if turning is not None:
                    words["part.rotate_deg"] = why_so
                    its = "its shaft is" if spindle is None else "its ends are"
                    words["effects.part_turn"] = (
                        f"TURNED BY A DRIVE, at {RPM:g} rpm: {its} sealed in the wall"
                    )
                why = {**reasons, **words, **floor_reasons(floor, goes_out, diameter)}
                made = checked(own, why, floor, known, mesh, wanted.shop)
                if is_local and turning is None:
                    made, floor = under_low_ceiling(made, floor, wanted.shop)
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
        made, floor = built(is_local, spindle)
        is_large = not floor.is_one_sonotrode or made.is_capped
        if is_large and not is_local and like is None:
            with suppress(InputError):
                local, its_floor = built(is_local=True)
                takes_fewer = its_floor.excess[:2] < floor.excess[:2]  # sonotrodes
                if (takes_fewer or made.is_capped) and not local.is_capped:
                    if not local.chamber.pieces_in_air:
                        local = clamped_outside(local, its_floor, wanted.shop)
                        local = padded(local, its_floor, target, wanted.shop, like)
                    if grips_poorly(local):
                        spare = local, its_floor
                    elif faults(local) <= faults(made):
                        made, floor, is_local = local, its_floor, True
    if made.chamber.pieces_in_air and spindle is None:
        with step("choosing what holds the part") as progress:
            above = None if goes_out else end
            made = held(made, floor, target, above, bores, wanted.shop, progress, like)
    elif "holder" not in made.tables:
        made = clamped_outside(made, floor, wanted.shop)
    if spindle is not None and (why_not := why_not_turned(made)):
        raise InputError(NO_SPINDLE.format(why_not))
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
    made = replace(
        made,
        reasons={**made.reasons, **room_reason(made, floor)},
        stance=Stance(whole, turns, pose_reason, end, is_local, spindle),
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

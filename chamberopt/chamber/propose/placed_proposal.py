"""Propose a design for a part in a stance, with a wider chamber if its own check warns of gaps.

Every number comes from a rule of thumb, with its reason beside it. A study then varies the numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from chamberopt.chamber.checks.place_names import PART_SIDES, SIDE_WALL
from chamberopt.chamber.checks.warning import DesignWarning, WarningKind
from chamberopt.chamber.layout.arbor import Bore, find_bores
from chamberopt.chamber.layout.balls import fit_sizes, propose_ball, sizes_to_try
from chamberopt.chamber.layout.end import Shape, cut_shape, root_out, strip
from chamberopt.chamber.layout.floor import SEVERAL, Floor
from chamberopt.chamber.layout.pose import AT_SIDE, Turns, pose_by_size, pose_in_words
from chamberopt.chamber.layout.shot_material import (
    choose_shot,
    choose_walls,
    hardness_in_words,
    iron_of_walls,
)
from chamberopt.chamber.layout.target import Surface, Target
from chamberopt.chamber.layout.turning import RPM, Spindle, turning_bore, turning_pose
from chamberopt.chamber.matters import MatterKind
from chamberopt.chamber.part import Part, posed_part
from chamberopt.chamber.propose.held_proposal import (
    held,
    is_firm,
    masked,
    only_touched,
    padded,
    rests,
)
from chamberopt.chamber.propose.proposal import (
    LARGEST_MM,
    MOST_REPLICAS,
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
from chamberopt.common.progress import Progress, step
from chamberopt.design.design import Design, validate
from chamberopt.design.materials import CATALOGUE, USUAL, alloy
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.meshes.surface_error import format_box
from chamberopt.geometry.meshes.units import BY_SIZE, METRES_PER
from chamberopt.geometry.triangles import rotation_matrix

LEAST_TOUCHED = 0.02  # share of the target that balls which are wished for have to touch
ROUNDED = 0.5e-3  # m by which sizes are rounded up
FEW = 2  # sonotrodes side by side that are better than a room of which the part is held badly
# Height of a target [m] above which little of the shot's energy gets to its top, by heart: a part
# that is longer is peened a strip at a time instead of on end, where it can be.
TALLEST = 0.3
WIDER = (1.0, 1.4, 2.0)  # factors on the room round the part that are tried
USUAL_PART, SONOTRODE = "42CrMo4", "Ti-6Al-4V"  # of the catalogue
TREATMENT_S, HALF_WIDTH = 300.0, 0.03
FEWER = "so that a strip of it takes few sonotrodes"
TURNED = "its axis level: about it the part turns, so that all of it passes the shot"
NO_SPINDLE = "--pose: given turning, but {}; give another pose, or another target (--target)"
ON_END = "on end, as no single sonotrode is large enough for it lying"


class Given(NamedTuple):
    """A part, and what is wished of a design for it."""

    path: Path
    wanted: Wanted
    mesh: PartMesh
    known: Sequence[Surface]

    @property
    def shop(self) -> Shop:
        """The shop that is given, or a usual one."""
        return self.wanted.shop or usual_shop()

    @property
    def alloy(self) -> str:
        """Name of the part's alloy, which is a usual one if none is given."""
        return alloy(self.wanted.alloy or USUAL_PART).name


class _Setup(NamedTuple):
    """A part in a stance, with its balls: what all rooms that are tried for it have in common."""

    given: Given
    stance: Stance
    target: Target  # what of the stance's is peened
    turns: Turns  # [degrees]
    why: str  # it is turned so
    ball: float  # diameter [m]
    shape: Shape  # what the room is round
    out: np.ndarray | None  # axis of the part's file along which an end goes out, (3,)
    tables: Tables
    reasons: dict[str, str]

    @property
    def goes_out(self) -> bool:
        """Whether the part goes out through a wall, whatever room is tried."""
        return self.out is not None


class _Room(NamedTuple):
    """A proposal, and the floor of its chamber."""

    made: Proposal
    floor: Floor
    is_local: bool  # true for a chamber round the target, whose walls the part goes out through

    @property
    def rank(self) -> tuple[float, ...]:
        """Faults, then what the floor has beyond one sonotrode: the least rank is the best."""
        return (*faults(self.made), *self.floor.excess)


def proposed(given: Given, stance: Stance, like: Proposal | None = None) -> Proposal:
    """Return a proposal for a target of a part.

    Raises InputError if no chamber can be built round it.

    Args:
        like: a proposal in this stance, whose holder and pad are tried first.
    """
    wanted, mesh = given.wanted, given.mesh
    with step("choosing the balls"):
        setup = _set_up(given, stance)
    target, spindle, end = setup.target, stance.spindle, stance.end
    bores = find_bores(mesh, target.triangles)
    may_turn = wanted.may_turn and wanted.pose is None
    turning = turning_bore(bores, mesh, target.triangles) if may_turn else None
    is_whole = not (turning or spindle) and (end is None or end.strips is None)
    is_tall = wanted.pose is None and TALLEST < _height(setup) <= 1e-3 * LARGEST_MM
    if is_whole and (
        is_tall or not can_be_mounted(setup.shape, setup.turns, setup.ball, wanted, setup.out)
    ):
        in_strips = _in_strips(setup)
        if in_strips is not None:
            return in_strips
    with step("building and checking the chamber") as progress:
        room, spare = _placed(setup, progress, like)
    room = _held(setup, room, bores, like)
    if spindle is not None and (why_not := why_not_turned(room.made)):
        raise InputError(NO_SPINDLE.format(why_not))
    is_small = room.floor.face is not None and room.made.sonotrode_count <= FEW
    is_good = is_small and "holder" in room.made.tables
    if spare is not None and not is_good and faults(spare.made) <= faults(room.made):
        room = spare
    if turning is not None:
        with step("trying it on its axis, turning") as progress, suppress(InputError):
            other = _built(setup, progress, is_local=False, turning=turning)
            other = _on_holder(setup, other, [turning], progress)
            if other.rank <= room.rank and "holder" in other.made.tables:
                room = other
    made, floor = room.made, room.floor
    holes = find_bores(mesh, target.triangles, for_arbor=False)
    made = padded(masked(made, floor, holes, wanted.shop), floor, target, wanted.shop, like)
    made = only_touched(made, floor, wanted.shop)
    if wanted.ball_mm is not None and touched_share(made) < LEAST_TOUCHED:
        raise InputError(_too_large(made, given.shop.stock_mm(made.tables["shot"]["material"])))
    made = replace(
        made,
        reasons={**made.reasons, **room_reason(made, floor)},
        stance=Stance(stance.target, setup.turns, setup.why, end, room.is_local, spindle),
    )
    if spare is None or end is not None or wanted.pose is not None or not grips_poorly(made):
        return made
    return _held_by_an_end(setup, made)


def _height(setup: _Setup) -> float:
    """Return how high the target reaches above the part's lowest point in its pose [m]."""
    up = setup.given.mesh.vertices @ rotation_matrix(setup.turns)[2]
    on_target = setup.given.mesh.triangles[setup.target.triangles]
    return float(up[on_target].max() - up.min())


def _held_by_an_end(setup: _Setup, made: Proposal) -> Proposal:
    """Return a proposal whose part an end holds better than it is held by, if there is one.

    Its root goes out of a room that encloses all the rest, or it stands.

    Args:
        made: the proposal so far, which is returned if there is none.
    """
    given, target, turns = setup.given, setup.target, setup.turns
    mesh = given.mesh
    upright = pose_by_size(mesh.vertices, mesh.triangles, target.triangles, "standing")
    by_root = root_out(mesh, target, turns, AT_WALL * setup.ball)
    for pose, why, root in ((turns, setup.why, by_root), (upright, ON_END, None)):
        if root is not None or pose != turns:
            with suppress(InputError):
                other = proposed(given, Stance(target, pose, why, root))
                is_better = is_firm(other) and not grips_poorly(other) and not rests(other)
                if is_better and other.sonotrode_count <= made.sonotrode_count:
                    return other
    return made


def _in_strips(setup: _Setup) -> Proposal | None:
    """Return the proposal for a strip of a target that takes the fewest sonotrodes, of few faults.

    It is None where no strip stands on as many sonotrodes as a shop mounts.
    """
    given, whole, found = setup.given, setup.stance.target, []
    poses = {setup.turns: setup.why}
    for one in AT_SIDE if given.wanted.pose is None else ():
        pose = pose_by_size(given.mesh.vertices, given.mesh.triangles, whole.triangles, one)
        poses.setdefault(pose, FEWER)
    sides = [side for one in given.shop.sonotrodes if one.size_mm for side in one.size_mm]
    longest = 1e-3 * max(sides, default=0.0) - 2.0 * AT_WALL * setup.ball - ROUNDED
    for turns, why in poses.items():
        if (end := strip(given.mesh, whole, turns, longest)) is not None:
            with suppress(InputError):
                made = proposed(given, Stance(whole, turns, why, end))
                if made.design.sonotrode.face and made.sonotrode_count <= SEVERAL:
                    found.append(made)
    return min(found, key=lambda one: (one.sonotrode_count, *faults(one)), default=None)


def _set_up(given: Given, stance: Stance) -> _Setup:
    """Return a part in a stance, with its balls and with all reasons that no room changes.

    Raises InputError if the shop has no such balls.
    """
    (path, wanted, mesh, _), end, spindle = given, stance.end, stance.spindle
    target, turns, why = stance.target, stance.turns, stance.why
    shot, shot_reason = choose_shot(wanted.shot, given.alloy, given.shop)
    walls, wall_reason = choose_walls(given.alloy, shot)
    if end is not None:
        target, turns = end.target, end.turns
    tables: Tables = {
        **({"": {"calibration": str(wanted.calibration.resolve())}} if wanted.calibration else {}),
        "part": {"mesh": str(path.resolve()), "unit": mesh.unit, "rotate_deg": list(turns)},
        "part.target": target.keys,
        "chamber": {},
        "sonotrode": {},
        "shot": {"mass_g": 1.0, "diameter_mm": 1.0, "material": shot},
        "materials": {"part": given.alloy, "wall": walls, "sonotrode": SONOTRODE},
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
    diameter, ball_reason = _ball_diameter(tables, wanted, given.shop)
    tables["shot"]["diameter_mm"] = round(1e3 * diameter, 4)
    if not (end or wanted.pose or spindle) and (
        hanging := hanging_turns(mesh, target, turns, diameter, wanted)
    ):
        turns, why = hanging, ON_END
    shape = cut_shape(mesh, target.triangles, target.keys)
    if end is not None and end.room_mm is not None:  # the room is round all of that
        whole = np.ones(len(mesh.triangles), dtype=bool)
        shape = cut_shape(mesh, whole, {"box_mm": end.room_mm})
    # Balls would lie on what holds an end at the side: it goes out through the wall instead.
    out = end.axis if end is not None and end.goes_out else None
    if spindle is not None:
        out = spindle.axis
    is_guessed = any(f"({BY_SIZE})" in note for note in mesh.notes)
    measures = f"the part measures {format_box(mesh.size)}"
    by = "as asked" if wanted.unit in METRES_PER else "by the file"
    reasons = {
        "part.unit": f"{MatterKind.UNIT}: {measures}"
        if is_guessed
        else f"{measures}, unit {mesh.unit}, {by}",
        "part.target": target.reason,
        "shot.diameter_mm": ball_reason,
        **({"shot.material": shot_reason} if shot_reason else {}),
        "materials.part": "how balls rebound from it (C0, v0) is computed: to be calibrated"
        + hardness_in_words(given.alloy, shot)
        if wanted.alloy
        else f"{MatterKind.ALLOY}, a guess: chamberopt materials lists alloys",
        "materials.wall": wall_reason
        + (f"; {iron}" if (iron := iron_of_walls(given.alloy, walls)) else ""),
        "effects.friction": "mu of these balls on these metals, dry: chamberopt materials",
        "effects.roughness": "rms slope of faces that shot has dented",
        "process.treatment_time_s": f"{MatterKind.NOT_MEASURED} by a pilot, a start: the "
        "report has coverage over time",
        "process.accuracy.simulated_time_s": "a start: results say what is resolved",
        "process.accuracy.objective_half_width": "until it is so sure; of a time: this share",
    }
    return _Setup(given, stance, target, turns, why, diameter, shape, out, tables, reasons)


def _built(
    setup: _Setup, progress: Progress, is_local: bool, turning: Bore | Spindle | None = None
) -> _Room:
    """Return the least room that is free of gaps, else that of the fewest faults.

    Raises InputError if no room can be built.

    Args:
        is_local: true for a chamber round the target, whose walls the part goes out through.
        turning: about whose axis, which is then level, the part turns.
    """
    given, end = setup.given, setup.stance.end
    best: _Room | None = None
    refused: InputError | None = None
    common, pose, why, wanted = setup.tables, setup.turns, setup.why, given.wanted
    if turning is not None:
        pose, turn = turning_pose(turning, given.mesh)
        common = {**common, "effects": {**common["effects"], "part_turn": turn}}
        wanted = replace(wanted, shape=wanted.shape or "box")
    for number, wider in enumerate(WIDER):
        progress(number, len(WIDER), None)
        try:
            placed, floor = place_room(
                setup.shape, pose, setup.ball, wanted, wider, is_local, setup.out
            )
            floor = floor._replace(strips=end.strips if end is not None else None)
            part = {**common["part"], "rotate_deg": list(placed)}
            if any(floor.offset_mm):
                part["offset_mm"] = list(floor.offset_mm)
            tables = {**common, "part": part, **floor_tables(floor)}
            words = {"part.rotate_deg": f"{pose_in_words(given.mesh, given.known, placed)}: {why}"}
            if turning is not None:
                words["part.rotate_deg"] = why if setup.stance.spindle else TURNED
                how = "its shaft is sealed in the wall"
                if setup.stance.spindle is not None:
                    how = "the shop chooses which of its ends is driven, the other is guided"
                words["effects.part_turn"] = f"{MatterKind.TURNED}, at {RPM:g} rpm: {how}"
            own = floor_reasons(floor, setup.goes_out, setup.ball)
            reasons = {**setup.reasons, **words, **own}
            made = checked(tables, reasons, floor, given.known, given.mesh, wanted.shop)
            if is_local and turning is None:
                made, floor = under_low_ceiling(made, floor, wanted.shop)
        except UnreadableError:
            raise
        except InputError as error:
            # Its frames hold bodies, of which manifold3d complains at the end of the process.
            refused = refused or error.with_traceback(None)
            continue
        if best is None or faults(made) < faults(best.made):
            best = _Room(made, floor, is_local)
        if not any(map(_takes_room, made.warnings)):
            break
    if best is None:
        assert refused is not None
        raise refused
    return best


def _placed(setup: _Setup, progress: Progress, like: Proposal | None) -> tuple[_Room, _Room | None]:
    """Return the room for a part, and a spare one round its target, of which it is held badly.

    The room is round all of the part, or round the target where that takes fewer sonotrodes.

    Args:
        like: a proposal that is alike: the room is of its kind.
    """
    is_local = setup.stance.is_local or setup.goes_out
    room = _built(setup, progress, is_local, setup.stance.spindle)
    is_large = not room.floor.is_one_sonotrode or room.made.is_capped
    if not is_large or is_local or like is not None:
        return room, None
    shop = setup.given.wanted.shop
    with suppress(InputError):
        local = _built(setup, progress, is_local=True)
        takes_fewer = local.floor.excess[:2] < room.floor.excess[:2]  # sonotrodes
        if (takes_fewer or room.made.is_capped) and not local.made.is_capped:
            if not local.made.chamber.pieces_in_air:
                made = clamped_outside(local.made, local.floor, shop)
                made = padded(made, local.floor, setup.target, shop, like)
                local = local._replace(made=made)
            if grips_poorly(local.made):
                return room, local
            if faults(local.made) <= faults(room.made):
                return local, None
    return room, None


def _held(setup: _Setup, room: _Room, bores: Sequence[Bore], like: Proposal | None) -> _Room:
    """Return a room with what holds the part in it, if something does.

    Args:
        bores: those that may take an arbor.
        like: a proposal whose holder is tried first.
    """
    if room.made.chamber.pieces_in_air and setup.stance.spindle is None:
        with step("choosing what holds the part") as progress:
            return _on_holder(setup, room, bores, progress, like)
    if "holder" not in room.made.tables:
        made = clamped_outside(room.made, room.floor, setup.given.wanted.shop)
        return room._replace(made=made)
    return room


def _on_holder(
    setup: _Setup,
    room: _Room,
    bores: Sequence[Bore],
    progress: Progress,
    like: Proposal | None = None,
) -> _Room:
    """Return a room with a holder in it, if one does no harm."""
    end = None if setup.goes_out or room.made.design.effects.part_turn else setup.stance.end
    shop = setup.given.wanted.shop
    made = held(room.made, room.floor, setup.target, end, bores, shop, progress, like)
    return room._replace(made=made)


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

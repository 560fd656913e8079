"""Place a part in a room on a sonotrode, and tell why the room is as it is."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from chamberopt.chamber.checks.place_names import SIDE_WALL
from chamberopt.chamber.checks.warning import WarningKind
from chamberopt.chamber.layout.end import Shape, can_be_clamped, local_room
from chamberopt.chamber.layout.floor import (
    OUTSIDE,
    SEVERAL,
    Floor,
    clear_of_face,
    floor_on_sonotrode,
    of_blocks,
    require_room,
)
from chamberopt.chamber.layout.pose import Turns, end_to_wall, hanging_pose, square_to_walls
from chamberopt.chamber.layout.sizes import middle_in_plan, propose_sizes, shape_for
from chamberopt.chamber.layout.target import Target
from chamberopt.chamber.propose.proposal import (
    Proposal,
    Tables,
    Wanted,
    checked,
    faults,
    touched_share,
)
from chamberopt.chamber.shop import Shop, usual_shop
from chamberopt.common.errors import InputError
from chamberopt.geometry.heights import lowest_over, points_up_to
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.triangles import rotation_matrix

AT_WALL = 2.0  # ball diameters from the target to the wall through which its end goes out
OVER_RIM = (0.0, 2.5e-3, 5e-3)  # m over the ceiling at which a clamp may begin, as over a flange
ROUND = 1.1  # largest diameter of a round target over its least side
LOW = (0.25, 0.5, 1.0)  # ball diameters from the target to a low ceiling
SAME_SHARE = 0.005  # of the target that a low ceiling may keep from the balls
AMPLITUDE_UM = 40.0  # zero-to-peak; the nearest that the sonotrode can set is taken
BETWEEN = "a plate that fits between the faces of the part, like the two walls beside them"
CUT_OUT = "plates, cut out round it"
OWN_WALL, OWN_LID = "the part itself is the wall", f"the part itself is the lid: {CUT_OUT}"


def place_room(
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
    Round a target it is a box, or a cylinder where a lid closes it over a round target.

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
    usual = ["cylinder", suits]
    if is_local:
        is_round = out is None and _is_round(part.vertices @ rotation_matrix(turns).T, part)
        usual = ["cylinder", "box"] if is_round else ["box"]
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
        if is_local and shape in ("box", "cylinder"):
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
    if is_local and any(one.sizes.closed != ("z",) for _, one in found):  # not by a lid alone
        found = [one for one in found if one[1].sizes.shape == "box"] or found
    return min(found, key=lambda one: one[1].excess)


def under_low_ceiling(made: Proposal, floor: Floor, shop: Shop | None) -> tuple[Proposal, Floor]:
    """Return a proposal whose ceiling is so low that no ball gets above the part, and its floor.

    Where a part that slopes down to a wall goes out through it, balls gather over it, and rattle.
    The proposal stays as it is unless it has such a place, and fewer faults with a lower ceiling.
    """
    sloping = any(one.kind is WarningKind.REST and SIDE_WALL in one.about for one in made.warnings)
    if not sloping or made.chamber.pieces_in_air or floor.sizes.closed:
        return made, floor
    part, before = made.chamber.part, touched_share(made)
    top = float(part.vertices[part.triangles[part.target], 2].max())
    for balls in LOW:
        height_mm = 0.5 * math.ceil(2e3 * (top + balls * made.design.shot.diameter))
        if height_mm >= made.tables["chamber"]["height_mm"]:
            break
        sizes = replace(floor.sizes, height=1e-3 * height_mm, through_ceiling=True)
        low = floor._replace(sizes=sizes, is_low=True)
        tables = {**made.tables, "chamber": {**made.tables["chamber"], "height_mm": height_mm}}
        reason = "sonotrode to ceiling; so low that no ball lies or rattles over the part"
        reasons = {**made.reasons, "chamber.height_mm": reason}
        with suppress(InputError):
            other = checked(tables, reasons, low, made.known, made.mesh, shop)
            is_as_open = touched_share(other) >= before - SAME_SHARE
            if is_as_open and faults(other) < faults(made):
                return other, low
    return made, floor


def _is_round(posed: np.ndarray, part: Shape) -> bool:
    """Return whether a target is round as seen from above, as a fillet round a hub is.

    Args:
        posed: vertices of the part in its pose [m], (n, 3).
    """
    plan = posed[np.unique(part.triangles[part.target]), :2]
    radius = np.linalg.norm(plan - middle_in_plan(plan), axis=1).max()
    return bool(2.0 * radius < ROUND * np.ptp(plan, axis=0).min())


def can_be_mounted(
    part: Shape, turns: Turns, ball: float, wanted: Wanted, out: np.ndarray | None
) -> bool:
    """Return whether as many sonotrodes as a shop mounts carry a chamber for all of a target.

    Args:
        part, turns, ball, wanted, out: as of place_room.
    """
    for is_local in {True, out is not None}:
        with suppress(InputError):
            _, floor = place_room(part, turns, ball, wanted, 1.0, is_local, out)
            if floor.face is not None and floor.stand.face.count <= SEVERAL:
                return True
    return False


def hanging_turns(
    mesh: PartMesh, target: Target, turns: Turns, ball: float, wanted: Wanted
) -> Turns | None:
    """Return turns with which the part hangs on end, if only then a sonotrode carries the chamber.

    Args:
        turns, ball, wanted: as of place_room.
    """

    whole = Shape(mesh.vertices, mesh.triangles, target.triangles)

    def is_carried(pose: Turns) -> bool:
        try:
            return place_room(whole, pose, ball, wanted, 1.0)[1].is_one_sonotrode
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


def floor_tables(floor: Floor) -> Tables:
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


def floor_reasons(floor: Floor, goes_out: bool, ball: float) -> dict[str, str]:
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


def room_reason(made: Proposal, floor: Floor) -> dict[str, str]:
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

"""Propose a whole design for a part: the stances that are tried, and which of them is taken."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from chamberopt.chamber.layout.arbor import find_bores
from chamberopt.chamber.layout.end import Shape, bare_end, held_end
from chamberopt.chamber.layout.floor import SEVERAL
from chamberopt.chamber.layout.pose import (
    AT_SIDE,
    TURNING,
    Upright,
    pose_by_size,
    propose_pose,
    square_poses,
    upside_down,
)
from chamberopt.chamber.layout.shot_material import choose_shot
from chamberopt.chamber.layout.target import (
    Surface,
    Target,
    fewer_fillets,
    propose_target,
    surfaces,
)
from chamberopt.chamber.layout.turning import (
    SLENDER,
    find_spindle,
    slenderness,
    turning_bore,
    turning_pose,
)
from chamberopt.chamber.propose.held_proposal import (
    hangs_by_a_face,
    is_firm,
    is_held_thinly,
    nothing_holds,
    rests,
)
from chamberopt.chamber.propose.placed_proposal import (
    LEAST_TOUCHED,
    NO_SPINDLE,
    ON_END,
    TURNED,
    USUAL_PART,
    Given,
    proposed,
)
from chamberopt.chamber.propose.proposal import (
    COUNTED,
    Proposal,
    Stance,
    Wanted,
    faults,
    touched_share,
)
from chamberopt.chamber.propose.proposed_clamp import grips_poorly
from chamberopt.chamber.shop import usual_shop
from chamberopt.common.errors import InputError
from chamberopt.common.progress import step
from chamberopt.common.toml_fields import MAX_COORDINATE_MM
from chamberopt.design.materials import alloy
from chamberopt.geometry.meshes.part_mesh import PartMesh, keep_part, read_part_cached
from chamberopt.geometry.triangles import rotation_matrix

REACHES = 0.95  # of a part's length, from which on a target reaches both of its ends
BY_END = "on end, as it is held by an end then, and by nothing in the pose of the best exposure"
NOT_THIN = "so that it is held by an end of thicker metal"
UPSIDE_DOWN = "this end down, so that the other one is held firmly"
ASLANT = "the target faces the sonotrode aslant, so that the part itself is held firmly"
Chooser = Callable[[Sequence[Surface]], Sequence[str]]


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
    given = Given(path, wanted, mesh, known)
    shape = Shape(mesh.vertices, mesh.triangles, target.triangles)
    if wanted.pose == TURNING:
        return _turning(given, target)
    if (turned := _slender_turned(given, target)) is not None:
        return turned
    if wanted.pose is None:
        stance = Stance(target, *propose_pose(*shape))
    else:
        as_asked = f"{wanted.pose.replace('-', ' ')}, as asked"
        stance = Stance(target, pose_by_size(*shape, wanted.pose), as_asked)
    keeps_target = bool(asked) or not wanted.may_leave_end
    if wanted.pose in AT_SIDE:
        return _lying(given, stance, keeps_target)
    if wanted.pose is None and wanted.thick_pose is not None:
        return proposed(given, Stance(target, pose_by_size(*shape, wanted.thick_pose), NOT_THIN))
    end = None if keeps_target else held_end(mesh, target, stance.turns)
    made = proposed(given, stance._replace(end=end))
    if wanted.pose is None and is_held_thinly(made):
        return _held_otherwise(given, target, made)
    if end is not None and "holder" not in made.tables:  # nothing holds the end: it is peened too
        return proposed(given, stance)
    if wanted.pose is None and end is None and not is_firm(made):
        poses = [(turns, ASLANT) for turns in square_poses(stance.turns)]
        if (over := upside_down(*shape, stance.turns)) is not None:
            poses.insert(0, (over, UPSIDE_DOWN))
        for turns, why in poses:
            with suppress(InputError):
                other = proposed(given, Stance(target, turns, why))
                if is_firm(other) and _is_no_worse(other, made):
                    return other
    if wanted.pose is None and not keeps_target and nothing_holds(made):
        upright = pose_by_size(*shape, "standing")
        if (tip := held_end(mesh, target, upright)) is not None:
            with suppress(InputError):
                other = proposed(given, Stance(target, upright, BY_END, end=tip))
                if "holder" in other.tables and len(other.jams) <= len(made.jams):
                    return other
    if keeps_target or wanted.pose or end is not None or not hangs_by_a_face(made):
        return made
    end = held_end(mesh, target, made.design.part.rotate_deg, of_any=True)
    if end is not None:
        with suppress(InputError):
            other = proposed(given, stance._replace(why=ON_END, end=end))
            if "holder" in other.tables and faults(other) <= faults(made):
                return other
    return made


def _turning(given: Given, target: Target) -> Proposal:
    """Return a proposal whose part turns about a level axis, by an arbor or by its own ends.

    Raises InputError if the target does not go round an axis, or the part cannot turn about it.
    """
    mesh = given.mesh
    shape = mesh.vertices, mesh.triangles, target.triangles
    if turning_bore(find_bores(mesh, target.triangles), mesh, target.triangles) is not None:
        free = given._replace(wanted=replace(given.wanted, pose=None))
        made = proposed(free, Stance(target, *propose_pose(*shape)))
        if made.design.effects.part_turn is not None:
            return made
    if (spindle := find_spindle(mesh, target.triangles)) is None:
        raise InputError(NO_SPINDLE.format("the target looks the same round no axis"))
    turns, _ = turning_pose(spindle, mesh)
    return proposed(given, Stance(target, turns, TURNED, is_local=True, spindle=spindle))


def _slender_turned(given: Given, target: Target) -> Proposal | None:
    """Return a proposal in which a slender part turns by its ends, as shops turn it.

    It is None where another pose is asked for, or where turning does harm or takes many sonotrodes.
    """
    wanted, mesh = given.wanted, given.mesh
    is_open = wanted.pose is None and wanted.may_turn and wanted.shape in (None, "box")
    if not is_open or wanted.thick_pose is not None or wanted.without_fillets:
        return None
    spindle = find_spindle(mesh, target.triangles)
    if spindle is None or (long := slenderness(mesh, target.triangles, spindle)) < SLENDER:
        return None
    why = f"{TURNED}, as shops turn a part {long:.2g} times as long as wide, peened all round"
    with suppress(InputError):
        turns, _ = turning_pose(spindle, mesh)
        made = proposed(given, Stance(target, turns, why, is_local=True, spindle=spindle))
        is_harmless = not made.jams and all(one.kind in COUNTED for one in made.warnings)
        if is_harmless and "holder" in made.tables and made.sonotrode_count <= SEVERAL:
            return made
    return None


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
            given = Given(path, wanted, like.mesh, like.known)
            made = proposed(given, like.stance, like)
            is_held = "holder" in made.tables or "holder" not in like.tables
            if is_held and made.sonotrode_count <= like.sonotrode_count:
                return replace(
                    made, without_fillets=like.without_fillets, thick_pose=like.thick_pose
                )
    return propose(path, wanted, choose)


def _held_otherwise(given: Given, target: Target, made: Proposal) -> Proposal:
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
            other = proposed(given, Stance(of, turns, why))
            other = replace(other, without_fillets=number, thick_pose=pose)
            is_held = is_firm(other) and not grips_poorly(other) and not is_held_thinly(other)
            if not is_held or len(other.jams) > len(made.jams):
                continue
            if not rests(other):
                return other
            second = second or other
    return second or made


def _lying(given: Given, stance: Stance, keeps_target: bool) -> Proposal:
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
            made = proposed(given, stance._replace(end=root))
            if is_firm(made):
                by_root = made
                if not rests(by_root):
                    return by_root
    along = mesh.vertices @ rotation_matrix(upright)[2]
    whole = np.ptp(along[mesh.triangles[target.triangles]]) > REACHES * np.ptp(along)
    for of_any in (False, True):
        end = None if keeps_target else held_end(mesh, target, upright, of_any)
        lying = None if end is None else end._replace(turns=turns, goes_out=True)
        made = proposed(given, stance._replace(end=lying))
        if end is not None or keeps_target or not whole or is_firm(made):
            break
    if end is not None and "holder" not in made.tables:
        made = proposed(given, stance)
    # Balls that rest on the part speak against a pose, not against what holds it there.
    if by_root is not None and rests(made) and faults(by_root) <= faults(made):
        return by_root
    return made


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

"""Warn of a design before it is simulated, and tell what its shot reaches."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.build import (
    NOTED_HIDDEN,
    TARGET,
    floor_sides_mm,
    found_in_steps,
    hidden_share,
    selection_of,
)
from chamberopt.chamber.checks.calibration import calibration_warnings
from chamberopt.chamber.checks.fillets import facet_warnings, fillet_warnings
from chamberopt.chamber.checks.gaps import (
    MIN_MISSED_SHARE,
    find_ledges,
    gap_warnings,
    gutter_warnings,
    pocket_warnings,
    surface_warnings,
)
from chamberopt.chamber.checks.jams import JAM_BAND
from chamberopt.chamber.checks.openings import find_walls_in_holes
from chamberopt.chamber.checks.place_names import CEILING, SIDE_WALL, around, mm2, surface_names
from chamberopt.chamber.checks.warning import DesignWarning, WarningKind
from chamberopt.chamber.dimensionless import free_path
from chamberopt.chamber.matters import MatterKind, matter_of
from chamberopt.chamber.part import turning_axis
from chamberopt.chamber.reach import Reach, find_reach, reached_part_share
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.errors import one_line
from chamberopt.common.number_text import counted, plain
from chamberopt.design.almen_strip import USUAL_K_LOG_SD
from chamberopt.design.shape_surface import TAG_PART, TAG_SONOTRODE
from chamberopt.geometry.triangles import areas, edge_keys, sides_of, unit_normals

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.chamber.part import Axis
    from chamberopt.design.load import Design
    from chamberopt.design.sonotrode import VibratingFace
    from sim_core import TriangleMesh

# Share of the free volume above which the balls move as a dense bed rather than as a gas. Few balls
# of a bed reach the part, and frequent collisions slow the simulation down. Near a quarter the shot
# finds no places to start from.
MAX_PACKING_FRACTION = 0.2
MIN_AMPLITUDES = 10.0  # between part and sonotrode, as for sonotrode_distance_mm of a design
MAX_HIDDEN_SHARE = 0.05  # of the target's area; a larger share means a misplaced ceiling or wall
DOWN = 0.9  # cosine to the way down from which on a face that was level looks at the sonotrode
MIN_MASKED = 1e-4  # share of the target under a mask that is worth a warning
MOST_HOLES = 3  # of the part through a wall, which a warning names
MIN_FREE_PATH = 10.0  # chamber heights; on longer paths few balls meet another ball before a dent


def notes(design: Design, chamber: Chamber) -> list[str]:
    """Return notes on what the chamber assumes, and on effects that the design leaves out."""
    return [
        *chamber.notes,
        *_place_notes(design),
        *_intensity_notes(design),
        *friction_notes(design),
        *amplitude_notes(design),
        *(ledge.message for ledge in find_ledges(design, chamber) if not ledge.level),
    ]


def shot_reach(design: Design, chamber: Chamber) -> Reach:
    """Return the points of a chamber's surface that the shot reaches. A turning part is at rest.

    The search takes a second or two, the first time that a chamber is asked for balls of a size.
    """
    smallest, mean = min(design.shot.diameters), design.shot.diameter
    return find_reach(chamber_mesh(chamber), smallest, mean, chamber.normals)


def touched(design: Design, chamber: Chamber) -> np.ndarray:
    """Return the share of each triangle of the part that the balls can touch, (m,).

    With steps it is that of the step in which they touch most of it.
    """
    rooms = zip(design.in_steps.values(), chamber.steps or (chamber,), strict=True)
    count = len(chamber.part.triangles)
    each = [reached_part_share(shot_reach(one, room), room.source, count) for one, room in rooms]
    return np.asarray(np.max(each, axis=0))


def warnings(design: Design, chamber: Chamber) -> list[DesignWarning]:
    """Return warnings about values that are allowed but probably not intended, with remedies.

    What stops or harms the process comes first, then what is not peened, then what makes figures
    less sure.
    """
    if chamber.steps:
        return _step_warnings(design, chamber)
    reach = shot_reach(design, chamber)
    found = _wall_warnings(design, chamber, reach) + first_warnings(design, chamber, reach.mesh)
    for name, surface in _to_be_peened(design, chamber).items():
        found += surface_warnings(reach, surface, name, design.part.target.reachable)
    found += fillet_warnings(reach, chamber, max(design.shot.diameters))
    return found + facet_warnings(
        chamber.part, reach.diameter, reached_share(reach, chamber.on_target)
    )


def _wall_warnings(
    design: Design, chamber: Chamber, reach: Reach, turned_down: np.ndarray | None = None
) -> list[DesignWarning]:
    """Return warnings about gaps, pockets and gutters, from where the shot reaches.

    Args:
        turned_down: as of `find_ledges`.
    """
    turns = design.effects.part_turn is not None
    gaps = gap_warnings(reach, chamber, design.shot.diameters, turns)
    gutters = gutter_warnings(design, chamber, reach, turned_down)
    return [*gaps, *pocket_warnings(reach, chamber), *gutters]


def _step_warnings(design: Design, chamber: Chamber) -> list[DesignWarning]:
    """Return the warnings of each step, and one on what no ball can touch in any of them.

    Of narrow fillets and slots only the steps with the finest balls warn, as these get there.
    """
    part, found, steps = chamber.part, {}, design.in_steps
    shares, balls = np.zeros(len(part.triangles)), set()
    finest = min(max(one.shot.diameters) for one in steps.values())
    posed = (room.part.vertices[room.part.triangles] for room in chamber.steps)
    down = np.array([unit_normals(corners)[:, 2] < -DOWN for corners in posed])
    for (name, one), room, now in zip(steps.items(), chamber.steps, down, strict=True):
        reach = shot_reach(one, room)
        own = reached_part_share(reach, room.source, len(part.triangles))
        shares = np.maximum(shares, own * room.exposed_area)
        balls.add(f"{1e3 * reach.diameter:g}")
        turned_down = down.sum(axis=0) > now  # what looks down in another step
        first = first_warnings(one, room, reach.mesh, False, turned_down)
        found[name] = [*_wall_warnings(one, room, reach, turned_down), *first]
        if max(one.shot.diameters) == finest:
            found[name] += fillet_warnings(reach, room, finest)
        share = reached_share(reach, room.on_target)
        found[name] += facet_warnings(room.part, reach.diameter, share)
    told = [replace(warning, step=name) for name, warning in found_in_steps(found)]
    spared = {one.name for one in design.zones if one.is_spared}
    wanted = {TARGET: part.target}
    wanted |= {f"zone {name}": one for name, one in part.zones.items() if name not in spared}
    for name, rows in wanted.items():
        left, whole = float((part.area - shares)[rows].sum()), float(part.area[rows].sum())
        if left > MIN_MISSED_SHARE * whole and not design.part.target.reachable:
            text = (
                f"{left / whole:.1%} of {name} ({mm2(left)}) cannot be touched by a ball of "
                f"{' or '.join(sorted(balls))} mm in any step, however long it is peened: add a "
                f"step in another pose, or narrow {selection_of(name)}"
            )
            told.append(DesignWarning(WarningKind.UNTOUCHED, text, (name,)))
    return told


def first_warnings(
    design: Design,
    chamber: Chamber,
    mesh: TriangleMesh,
    of_surfaces: bool = True,
    turned_down: np.ndarray | None = None,
) -> list[DesignWarning]:
    """Return the warnings that do not depend on where the shot reaches the surface.

    Args:
        mesh: surface of the chamber.
        of_surfaces: whether a target that is partly outside the chamber is warned of. One of
            several steps need not have all of it inside.
        turned_down: as of `find_ledges`.
    """
    shot = design.shot
    found = _sonotrode_warnings(design, mesh, turning_axis(design, chamber.part))
    found += _block_warnings(design, chamber)
    filled = shot.volume / chamber.volume
    if filled > MAX_PACKING_FRACTION:
        text = (
            f"the balls fill {filled:.0%} of the free volume; above {MAX_PACKING_FRACTION:.0%} "
            "they hinder each other: lower shot.mass_g or enlarge the chamber"
        )
        found.append(DesignWarning(WarningKind.PACKING, text))
    for name, surface in _to_be_peened(design, chamber).items() if of_surfaces else ():
        if (hidden := hidden_share(surface)) > MAX_HIDDEN_SHARE:
            text = (
                f"{hidden:.0%} of the area of {name} is outside the chamber and counts as not "
                f"covered: enlarge the chamber, or narrow {selection_of(name)} to what is to be "
                "peened"
            )
            found.append(DesignWarning(WarningKind.HIDDEN, text, (name,)))
    found += _mask_warnings(chamber)
    found += _side_wall_warnings(design, chamber)
    found += _hole_warnings(design, chamber)
    found += [
        DesignWarning(WarningKind.REST, one.message, (one.name,))
        for one in find_ledges(design, chamber, turned_down)
        if one.level
    ]
    path = free_path(design, chamber)
    if not design.effects.ball_collisions and path < MIN_FREE_PATH:
        text = (
            f"effects.ball_collisions is false, though a ball would meet another every "
            f"{plain(path, 2)} chamber heights: they fly through each other; switch it on"
        )
        found.append(DesignWarning(WarningKind.COLLISIONS, text))
    turn = design.effects.part_turn
    recorded = design.process.accuracy.replicas * design.process.recorded_time
    if turn is not None and turn.rpm != 0.0 and recorded < turn.period:
        text = (
            f"the part takes {plain(turn.period, 3)} s to turn once, but the replicas together "
            f"last only {plain(recorded, 3)} s: coverage is that of some of its positions; raise "
            "process.accuracy.simulated_time_s or replicas"
        )
        found.append(DesignWarning(WarningKind.PART_TURN, text))
    if abs(shot.count * shot.ball_mass - shot.mass) > 0.05 * shot.mass:
        text = (
            f"shot.mass_g = {shot.mass_g:g} is rounded to {shot.count} whole ball(s) of "
            f"{shot.ball_mass * 1e6:.3g} mg: the charge differs by more than 5 %"
        )
        found.append(DesignWarning(WarningKind.CHARGE, text))
    found += calibration_warnings(design)
    # The check itself warns of it, as long as it is so.
    told = [one for one in matters(design) if MatterKind.WARNED_OF not in one]
    return found + [DesignWarning(WarningKind.TO_SETTLE, text) for text in told]


def matters(design: Design) -> list[str]:
    """Return the text of a warning of each matter to be settled before the chamber is built."""
    return [f"to be settled: {one_line(text)}" for text in design.to_settle]


def _to_be_peened(design: Design, chamber: Chamber) -> dict[str, Chamber]:
    """Return the chamber with its target, then with each zone to be peened as its target, by name.

    Zones that are to be spared are left out.
    """
    spared = {f"zone {one.name}" for one in design.zones if one.is_spared}
    return {name: one for name, one in chamber.surfaces().items() if name not in spared}


def _place_notes(design: Design) -> list[str]:
    """Return a note on where the part is, if the design does not move it sideways."""
    if design.chamber.setup() is not None or any(design.part.offset):
        return []
    return ["the middle of the part's box is on the chamber's axis; part.offset_mm moves it"]


def _intensity_notes(design: Design) -> list[str]:
    """Return a note on how the wanted Almen intensity will be judged, if the design has one."""
    wanted, calibration = design.process.intensity_mmA, design.calibration
    if wanted is None:
        return []
    how = f"only to a factor of {math.exp(USUAL_K_LOG_SD):.2g} until strips are measured"
    if calibration is not None and calibration.has_strips:
        how = "by the design's calibration"
        if calibration.not_mmA:
            how = f"not: the calibration has arc heights of a {calibration.strips}"
    return [
        f"process.intensity_mmA = [{wanted[0]:g}, {wanted[1]:g}] is wanted of the mean over the "
        f"target: chamberopt simulate predicts it, {how}"
    ]


def friction_notes(design: Design) -> list[str]:
    """Return a note on what leaving friction out changes, if the design leaves it out.

    Source: docs/explanation/friction.md.
    """
    if design.effects.friction is not None or design.effects.auto:
        return []
    remedy = 'effects.friction = "catalogue" takes that of the metals'
    return [
        'effects.friction is "none", so the balls are smooth: in a cylinder, any mu from 0.1 to '
        f"0.5 made the shot slower by 22 to 47 % (docs/explanation/friction.md); {remedy}"
    ]


def amplitude_notes(design: Design) -> list[str]:
    """Return a note on the amplitude over the face of each sonotrode that bends."""
    faces: list[tuple[str, VibratingFace]] = [("", design.sonotrode)]
    faces += [(f" of sonotrodes.{k}", one) for k, one in enumerate(design.sonotrodes)]
    return [
        f"amplitude over the face{name}: {one.amplitude_profile.in_words}"
        for name, one in faces
        if one.amplitude_profile is not None
    ]


def reached_share(reach: Reach, rows: np.ndarray) -> float:
    """Return the share of the area of the marked cavity triangles (k,) that the ball can touch."""
    size = areas(reach.mesh.vertices, reach.mesh.triangles)[rows]
    return float(reach.share[rows] @ size / size.sum())


def _mask_warnings(chamber: Chamber) -> list[DesignWarning]:
    """Return a warning if the mask covers some of the target, else an empty list."""
    mask, part = chamber.fixtures.get("mask"), chamber.part
    whole = float(part.area[part.target].sum())
    if mask is None or mask.covered_target < MIN_MASKED * whole:
        return []
    text = (
        f"the mask covers {mask.covered_target / whole:.1%} of the target "
        f"({mm2(mask.covered_target)}), which counts as not covered: leave these faces out of "
        "[part.target], or mask fewer faces"
    )
    return [DesignWarning(WarningKind.MASK, text)]


def _side_wall_warnings(design: Design, chamber: Chamber) -> list[DesignWarning]:
    """Return a warning if the part goes out through the side wall, else an empty list.

    There is no warning for a part whose whole target is in the chamber, that closes the chamber
    like a lid, turns (its joint is a round shaft), has a hole or a bore for its fixture, or is
    drawn with its chamber.
    """
    if hidden_share(chamber) < NOTED_HIDDEN:
        return []
    turns, drawn = design.effects.part_turn is not None, design.chamber.setup() is not None
    names = surface_names(chamber)
    held = design.holder is not None and design.holder.kind == "bore"
    if design.chamber.holes or held or turns or drawn or not (names == CEILING).any():
        return []
    edges, of_part = edge_keys(chamber.triangles), np.repeat(chamber.tags == TAG_PART, 3)
    joint = np.repeat(names == SIDE_WALL, 3) & np.isin(edges, edges[of_part])
    height = 1e3 * chamber.vertices[sides_of(chamber.triangles)[joint], 2]
    if not height.size:
        return []
    # The height does not move a side wall. A user's own shape has keys of its own.
    keys = [key for key in design.chamber.widths_mm() if key != "height_mm"]
    named = f" ({', '.join(f'chamber.{key}' for key in keys)})" if keys else ""
    text = (
        f"the part goes out through the side wall between z = {height.min():.4g} and "
        f"{height.max():.4g} mm: what is outside is not peened; enlarge the chamber"
        f"{named}, or check part.offset_mm"
    )
    return [DesignWarning(WarningKind.SIDE_WALL, text)]


def _hole_warnings(design: Design, chamber: Chamber) -> list[DesignWarning]:
    """Return a warning if pieces of a wall stand by themselves in holes of the part, else [].

    Holes that no ball gets into are left out. A proposal that leaves holes open tells of them among
    what is to be settled.
    """
    least = JAM_BAND[0] * min(design.ball_diameters)
    found = [one for one in find_walls_in_holes(chamber) if min(one.opening.size) >= least]
    told = {MatterKind.HOLE, MatterKind.HOLES}
    if not found or any(matter_of(one).kind in told for one in design.to_settle):
        return []
    where = [
        f"of {one.size_in_words} in {one.opening.wall} at {around(np.array([one.opening.place]))}"
        for one in found
    ]
    more = f" and {len(where) - MOST_HOLES} more" if len(where) > MOST_HOLES else ""
    key = design.chamber.ceiling_key
    moved = any(one.opening.wall == CEILING for one in found) and key != "shape"
    text = (
        f"the wall goes across {counted(len(where), 'hole')} of the part, "
        f"{', '.join(where[:MOST_HOLES])}{more}: the piece of wall in a hole is held by nothing, "
        "and balls leave there; plug it (mask.plugs = true, with the hole's wall as mask.at), or "
        f"{f'change chamber.{key}' if moved else 'move the part'}"
    )
    return [DesignWarning(WarningKind.WALL_IN_HOLE, text, (found[0].opening.wall,))]


def _sonotrode_warnings(
    design: Design, mesh: TriangleMesh, line: Axis | None
) -> list[DesignWarning]:
    """Return a warning if the sonotrode may hit the part, or a ball may be jammed between them.

    Args:
        line: axis of a turning part: a point [m] and a direction.
    """
    amplitude, ball = design.sonotrode.largest_amplitude, design.shot.diameter
    remedy = "raise chamber.sonotrode_distance_mm"
    clear, turn = sonotrode_clearance(mesh), design.effects.part_turn
    if clear < MIN_AMPLITUDES * amplitude:
        text = (
            f"part and sonotrode are only {1e3 * clear:.3g} mm apart, less than ten amplitudes of "
            f"{1e6 * amplitude:g} µm: they may hit each other; {remedy}"
        )
        return [DesignWarning(WarningKind.CONTACT, text)]
    if turn is None or line is None:
        return []
    own = mesh.vertices[mesh.triangles[mesh.tags == TAG_PART]].reshape(-1, 3)
    below = _lowest_height(line, own, turn.amplitude) - amplitude
    if not 0.0 < below < ball:
        return []
    text = (
        f"the gap between turning part and sonotrode is {below * 1e3:.3g} mm, narrower than a ball "
        f"of {ball * 1e3:g} mm: a ball may be jammed there as the part turns; {remedy}"
    )
    return [DesignWarning(WarningKind.TURNING_GAP, text)]


def _block_warnings(design: Design, chamber: Chamber) -> list[DesignWarning]:
    """Return a warning if the floor is so small that fewer of its blocks carry it.

    A floor that is a part of one sonotrode is usual.
    """
    blocks = design.sonotrode.face
    if blocks is None or blocks.count == 1:
        return []
    sides = floor_sides_mm(chamber.vertices, chamber.triangles, chamber.tags)
    columns, rows = np.ceil(sides / np.array(blocks.block_mm) - 1e-6).astype(int)
    if columns * rows >= blocks.count:
        return []
    (x, y), (long, wide) = sides, blocks.sides_mm
    text = (
        f"the sonotrodes are wider than the floor: {blocks.in_words}, together {long:g} × {wide:g} "
        f"mm, and the floor is {x:.4g} × {y:.4g} mm, so that walls stand over their faces; set "
        f"sonotrode.face.columns = {columns} and sonotrode.face.rows = {rows}, or enlarge the "
        "chamber"
    )
    return [DesignWarning(WarningKind.NARROW_FLOOR, text)]


def sonotrode_clearance(mesh: TriangleMesh) -> float:
    """Return the least distance [m] between part and sonotrode; inf without a part.

    It is the least distance of a corner of either surface from the other surface.
    """
    from sim_core import closest_points

    if not ((mesh.tags == TAG_PART).any() and (mesh.tags == TAG_SONOTRODE).any()):
        return float("inf")
    part, sonotrode = (
        mesh.vertices[np.unique(mesh.triangles[mesh.tags == tag])]
        for tag in (TAG_PART, TAG_SONOTRODE)
    )
    whole = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    least = float(closest_points(mesh, part, whole, TAG_SONOTRODE).distance.min())
    outside = np.maximum(
        0.0, np.maximum(part.min(axis=0) - sonotrode, sonotrode - part.max(axis=0))
    )
    near = sonotrode[np.linalg.norm(outside, axis=1) < least]  # the part's box is nearer than that
    if not len(near):  # usual, and saves a search tree of the part
        return least
    return float(closest_points(mesh, near, least, TAG_PART).distance.min())


def _lowest_height(line: Axis, points: np.ndarray, amplitude: float | None) -> float:
    """Return the lowest height [m] that points (n, 3) [m] of the turning part reach.

    At angle a of the part, the height of a point is c + r cos(a - a0) for some c, r and a0. The
    height is least where a is furthest from a0.

    Args:
        line: axis of the rotation.
        amplitude: largest angle to each side [rad]; None for a part that turns all round.
    """
    point, axis = line
    axis = axis / np.linalg.norm(axis)
    offset = points - point
    along = (offset @ axis)[:, None] * axis
    across, ahead = (offset - along)[:, 2], np.cross(axis, offset)[:, 2]
    largest = np.pi if amplitude is None else amplitude
    furthest = np.minimum(np.abs(np.arctan2(ahead, across)) + largest, np.pi)
    return float((point[2] + along[:, 2] + np.hypot(across, ahead) * np.cos(furthest)).min())

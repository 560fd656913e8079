"""Propose a mask, and offer what may be left out of a target.

A mask is on surfaces that must not be peened, or on a level top where balls would lie. What faces
away from the sonotrode, and what no ball touches, may be left out.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.checks.check import touched
from chamberopt.chamber.checks.jams import JAM_BAND
from chamberopt.chamber.checks.openings import (
    Opening,
    find_openings,
    find_walls_in_holes,
    part_at_wall,
)
from chamberopt.chamber.checks.place_names import around
from chamberopt.chamber.layout.arbor import Bore, find_bores
from chamberopt.chamber.layout.end import Strips
from chamberopt.chamber.layout.grip import FLAT_DEG
from chamberopt.chamber.layout.pose import Turns
from chamberopt.chamber.layout.target import RUNNING, Surface, apart, area_in_mm2, named_or_all
from chamberopt.chamber.matters import MatterKind
from chamberopt.chamber.part import chosen_on_part, of_target
from chamberopt.chamber.propose.proposal import Proposal, touched_share
from chamberopt.common.errors import InputError, one_line
from chamberopt.design.design import Design
from chamberopt.design.intensity import THIN_MM
from chamberopt.design.part import Selection
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.meshes.surface_error import format_point
from chamberopt.geometry.thickness import bare_behind
from chamberopt.geometry.triangles import (
    area_vectors,
    areas,
    rotation_matrix,
    side_pairs,
    sides_of,
    unit_vectors,
)

STRAIGHT_UP = 0.9998  # cosine from which on a face is level: balls lie on it
MOST_PADS = 8  # faces under one pad
MOSTLY = 0.9  # share of an area that counts as all of it
MET = 0.5  # share of a surface in the chamber from which on the shot meets it
AWAY_DEG = 105.0  # angle to the way down from which on a face is turned away from the sonotrode
LEAST = 0.02  # share of the target's area below which nothing is offered
NEARLY_ALL, MOST_NAMED = 0.9, 3
KINDS = ("surface", "faces")  # keys of a target that choose surfaces
MOST_PLUGS = 16  # bores that are plugged because they are open to the shot
MOST_LOOKED_AT = 20  # surfaces, the largest
# Share of the target's area from which on what is met of a surface is named, though most of it lies
# outside of the chamber.
PARTLY_MET = 0.05
# Share of the target's area below which what the shot meets beside it is not told, unless the file
# has a name for it.
TRIFLE = 0.01
# Outer edges that turn by more [degrees] are sharp; the length of them that is told [m].
SHARP, LEAST_EDGES = 45.0, 5e-3
EDGES = (
    f" outer edges turn by more than {SHARP:g} degrees in the file: break them before it is "
    "peened, as dents roll a burr over them, or guard those that are thin (no source read)"
)
ONE_SIDED = 0.25  # share of the target over thin metal with a bare far side, which is told
OTHER_HOLES = "the wall crosses other holes of the part, which need plugs"
MOVED_MM = 0.3  # of an opening, which is milled round the part with less play
# Names of what fits to other parts, whose size and finish shot would change.
NEVER = re.compile(
    r"(?<![a-z])(?:bores?|(?:\w+.)?holes?|threads?|(?:bearing|valve)?.?seats?|key.?ways?|splines?)"
    r"(?![a-z])",
    re.I,
)


def is_met(design: Design, chamber: Chamber, surface: Surface) -> bool:
    """Return whether a surface lies in the chamber for the most part, beside the target."""
    inside, whole = met_area(design, chamber, surface)
    return inside > MET * whole


def met_area(design: Design, chamber: Chamber, surface: Surface) -> tuple[float, float]:
    """Return the area of a surface in the chamber beside the target, and its whole area [m²]."""
    rows = rows_of(design, surface.keys)
    inside = chamber.exposed_area[rows & ~chamber.part.target].sum()
    return float(inside), float(chamber.part.area[rows].sum())


def rows_of(design: Design, keys: Mapping[str, Any]) -> np.ndarray:
    """Return the rows of the part's triangles that the keys of a selection choose, (m,) bool."""
    return np.asarray(chosen_on_part(design, Selection.model_validate(keys), ""))


def are_holes(
    mesh: PartMesh, known: Sequence[Surface], names: Sequence[str], holes: Sequence[Bore]
) -> bool:
    """Return whether surfaces of these names are no more than the walls of holes."""
    area = areas(mesh.vertices, mesh.triangles)
    chosen = np.any([one.triangles for one in known if one.name in names] or [area < 0.0], axis=0)
    walls = np.any([one.triangles for one in holes], axis=0)
    return bool(area[chosen & ~walls].sum() <= (1.0 - MOSTLY) * area[chosen].sum())


def to_be_plugged(
    design: Design, chamber: Chamber, bores: Sequence[Bore], names: Sequence[str]
) -> list[Bore]:
    """Return the bores that bear one of these names, or that the chamber's wall crosses."""
    found, area, at_wall = [], chamber.part.area, part_at_wall(chamber)
    named = np.zeros(len(area), dtype=bool)
    if names:
        named = rows_of(design, {"surface": list(names)})
    for bore in bores:
        rows = rows_of(design, {"faces": [bore.wall]})
        is_named = area[rows & named].sum() > MOSTLY * area[rows].sum()
        if is_named or at_wall[rows].any():
            found.append(bore)
    return found


def open_bores(design: Design, chamber: Chamber, bores: Sequence[Bore]) -> list[Bore]:
    """Return the bores that balls get into, the widest first; none of many, as of a sieve."""
    area = touched(design, chamber) * chamber.exposed_area
    found = []
    for bore in bores:
        rows = rows_of(design, {"faces": [bore.wall]})
        if area[rows].sum() > MET * chamber.part.area[rows].sum():
            found.append(bore)
    return found if len(found) <= MOST_PLUGS else []


def open_holes(proposal: Proposal) -> str:
    """Return in words which holes of the part the wall crosses without a plug; "" if none."""
    design, words, bores = proposal.design, [], None
    for room in _rooms(proposal.chamber):
        told = np.zeros(len(room.part.triangles), dtype=bool)
        for hole in find_walls_in_holes(room):
            told[hole.beside] = True
            opening = hole.opening
            if min(opening.size) < JAM_BAND[0] * min(design.ball_diameters):
                continue  # no ball gets into it
            place = around(np.array([opening.place]))
            words.append((hole.size_in_words, opening.wall, place))
        at_wall = part_at_wall(room)
        if not at_wall.any():
            continue
        if bores is None:
            nothing = np.zeros(len(proposal.mesh.triangles), dtype=bool)
            bores = find_bores(proposal.mesh, nothing, for_arbor=False)
        for bore in bores:  # those beside whose mouth the wall goes on, so that none stands alone
            rows = rows_of(design, {"faces": [bore.wall]})
            if (rows & at_wall).any() and not (rows & told).any():
                middles = room.part.vertices[room.part.triangles[rows & at_wall]].mean(axis=1)
                words.append((f"{2e3 * bore.radius:.3g} mm", "the wall", around(middles)))
    words = list(dict.fromkeys(words))
    if not words:
        return ""
    listed = [f"{size} in {wall} at {place}" for size, wall, place in words[:MOST_NAMED]]
    more = f" and {len(words) - MOST_NAMED} more" if len(words) > MOST_NAMED else ""
    several = len(words) > 1
    is_round = not any(" x " in size for size, _, _ in words)
    filler = "pin" if is_round else "filler"
    pin = f"{filler}s as wide in them" if several else f"a {filler} of {words[0][0]} in it"
    wall = "the wall" if several else words[0][1]
    return (
        f"{MatterKind.HOLES if several else MatterKind.HOLE}, not plugged: the part's, of "
        f"{', '.join(listed)}{more}: balls leave through {'them' if several else 'it'} unless "
        f"{'each' if several else 'it'} is closed, as by {pin}, up to {wall}"
    )


def to_be_masked(
    design: Design, chamber: Chamber, known: Sequence[Surface]
) -> tuple[list[str], list[str]]:
    """Return the names of surfaces that the shot meets and that must not be peened.

    The first are of what fits to other parts, such as bores; the second of what runs in them, such
    as a pin beside its fillets.
    """
    named = [one for one in known if "surface" in one.keys and is_met(design, chamber, one)]
    fits = [one.name for one in named if NEVER.search(one.name)]
    runs = [one.name for one in named if RUNNING.search(one.name) and one.name not in fits]
    return fits, runs


def pads(mesh: PartMesh, target: np.ndarray, turns: Turns, ball: float) -> list[dict[str, Any]]:
    """Return keys that choose the level faces on which balls would lie, the most faces first.

    A pad on them fills the room up to the ceiling. No face of the target is among them.

    Args:
        target: marks the triangles to be peened, (m,).
        turns: turns of the part in the chamber [degrees].
        ball: diameter of a ball [m].
    """
    faces = mesh.faces(FLAT_DEG)
    up = faces.area_vectors @ rotation_matrix(turns)[2]
    level = faces.free_of(target) & (up > STRAIGHT_UP * faces.area) & (faces.area > ball * ball)
    corners = mesh.vertices[mesh.triangles]

    def width(face: int) -> float:
        """Return the mean width of a face [m]; a facet along a round has hardly any."""
        own = corners[faces.of_triangle == face].reshape(-1, 3)
        return float(faces.area[face] / np.linalg.norm(np.ptp(own, axis=0)))

    found = np.array([one for one in np.flatnonzero(level) if width(int(one)) > ball], dtype=int)
    found = found[np.argsort(-faces.area[found], kind="stable")][:MOST_PADS]
    keys = [{"at_mm": faces.place_mm(int(one)), "crease_deg": FLAT_DEG} for one in found]
    return [{"faces": one} for one in (keys, keys[:1])[: len(keys)] if one]


@dataclass(frozen=True)
class LeftOut:
    """What may be left out of a target, and the keys of [part.target] that leave it out.

    Without keys it is what the shot meets beside the target, and the text is a whole sentence.
    """

    keys: dict[str, object]
    text: str


def find_left_out(proposal: Proposal) -> list[LeftOut]:
    """Return what of a proposed target faces away from the sonotrode or is hidden from the shot."""
    mesh, part = proposal.mesh, proposal.design.part
    target, area = of_target(mesh, part.target), areas(mesh.vertices, mesh.triangles)
    down = -rotation_matrix(part.rotate_deg)[2]
    normals = unit_vectors(area_vectors(mesh.vertices, mesh.triangles))
    away = target & (normals @ down < np.cos(np.radians(AWAY_DEG)))
    found = []
    whole = [
        one
        for one in proposal.known
        if area[one.triangles & away].sum() > NEARLY_ALL * area[one.triangles].sum()
    ]
    # The upper half of a round surface is no face that could be left out.
    of_faces = np.any([one.triangles for one in whole], axis=0) & away
    share = area[away].sum() / area[target].sum()
    is_turned = any(one.part for one in proposal.design.steps or ())
    if share > LEAST and area[of_faces].sum() > 0.5 * area[away].sum() and not is_turned:
        named = ", ".join(one.name for one in whole[:MOST_NAMED])
        direction = [round(float(x), 4) + 0.0 for x in down]
        keys: dict[str, object] = {"direction": direction, "angle_deg": [0.0, AWAY_DEG]}
        found.append(LeftOut(keys, f"the {share:.0%} that face away from the sonotrode ({named})"))
    hidden = 1.0 - touched_share(proposal)
    if hidden > LEAST and not part.target.reachable:
        text = f"the {hidden:.0%} that no ball touches here (another pose may reach it)"
        found.append(LeftOut({"reachable": True}, text))
    posed = proposal.chamber.part
    sharp, place = sharp_edges(posed.vertices, posed.triangles, posed.target)
    if sharp > LEAST_EDGES:
        long = (
            f"such as at {around(place[None])} in the chamber: {1e3 * sharp:.0f} mm of the target's"
        )
        found.append(LeftOut({}, f"{MatterKind.SHARP_EDGES}, {long}{EDGES}"))
    met = posed.target | (touched(proposal.design, proposal.chamber) > 0.5)
    bare = bare_behind(posed.vertices, posed.triangles, posed.target, met, 1e-3 * THIN_MM)
    if bare > ONE_SIDED:
        found.append(
            LeftOut(
                {},
                f"{MatterKind.ONE_SIDE}, {bare:.0%} of the target: less than {THIN_MM:.2g} mm "
                "under it, and the far side is not peened: it bends, as sheets are formed; peen "
                "both, or agree on it",
            )
        )
    if (lowest := float(posed.vertices[:, 2].min())) < 0.0:
        found.append(
            LeftOut(
                {},
                f"{MatterKind.CLEAR_OF_MACHINE}: outside of the walls the part reaches "
                f"{-1e3 * lowest:.3g} mm below the sonotrode's face, where the machine must "
                "leave it room",
            )
        )
    if text := open_holes(proposal):
        found.append(LeftOut({}, text))
    if text := moved_openings(proposal.chamber):
        found.append(LeftOut({}, text))
    if proposal.strips and (text := unlike_settings(proposal, proposal.strips)):
        found.append(LeftOut({}, text))
    return [*found, *met_beside(proposal, target)]


def unlike_settings(proposal: Proposal, strips: Strips) -> str:
    """Return in words in which settings the proposed chamber cannot be built; "" if in all.

    In each the part is moved so that another strip of the target is where the proposed one is.
    """
    why: dict[int, str] = {}
    proposed = _rooms(proposal.chamber)
    for number in (k for k in range(strips.settings) if k != strips.chosen):
        try:
            rooms = _rooms(build_chamber(in_setting(proposal, strips, number).design))
        except InputError as error:
            text = one_line(str(error)).partition(";")[0]
            why[number + 1] = OTHER_HOLES if text.startswith("mask.") else text
            continue
        each = list(zip(rooms, proposed, strict=True))
        if any(abs(1e3 * (_lowest(one) - _lowest(like))) > MOVED_MM for one, like in each):
            why[number + 1] = "what of the part is within the walls hangs lower"
        elif any(_opens_elsewhere(one, like) for one, like in each):
            why[number + 1] = "the part goes out of a wall elsewhere"
        elif any(len(find_walls_in_holes(a)) > len(find_walls_in_holes(b)) for a, b in each):
            why[number + 1] = OTHER_HOLES
    if not why:
        return ""
    return (
        f"{MatterKind.SETTINGS} {', '.join(map(str, why))} of {strips.settings} need a chamber of "
        f"their own: {'; '.join(dict.fromkeys(why.values()))}"
    )


def in_setting(proposal: Proposal, strips: Strips, number: int) -> Proposal:
    """Return a proposal whose part is moved so that another strip of its target is peened.

    Its chamber stays the one of the proposal, which may not suit it.

    Raises InputError if the part would be too far from the chamber.
    """
    design, tables, box = proposal.design, proposal.tables, strips.box_mm(proposal.mesh, number)
    by_mm = 1e3 * (strips.chosen - number) * strips.pitch

    def moved(part: Mapping[str, Any]) -> dict[str, Any]:
        """Return a table of [part] moved along the strips as they lie in its pose."""
        way = rotation_matrix(part.get("rotate_deg", design.part.rotate_deg))[:2, strips.axis]
        offset = np.round(np.asarray(part["offset_mm"]) + by_mm * way, 3) + 0.0
        return {**part, "offset_mm": [float(one) for one in offset]}

    offset = {"offset_mm": moved({"offset_mm": design.part.offset_mm})["offset_mm"]}
    tables = {
        **tables,
        "part": {**tables["part"], **offset},
        "part.target": {**tables["part.target"], "box_mm": box},
    }
    changes: dict[str, Any] = {"part.target.box_mm": box, "part.offset_mm": offset["offset_mm"]}
    if steps := tables.get("", {}).get("steps"):
        steps = [
            {**one, "part": moved(one["part"])} if "offset_mm" in one.get("part", {}) else one
            for one in steps
        ]
        tables[""] = {**tables[""], "steps": steps}
        changes["steps"] = steps
    return replace(proposal, design=design.changed(changes), tables=tables)


def _rooms(chamber: Chamber) -> tuple[Chamber, ...]:
    """Return the chamber as it is in each step."""
    return chamber.steps or (chamber,)


def _lowest(room: Chamber) -> float:
    """Return the height of the part's lowest point over the sonotrode [m]."""
    return float(room.part.vertices[:, 2].min())


def _opens_elsewhere(room: Chamber, other: Chamber) -> bool:
    """Return whether the part goes out of a room where it does not in another one."""
    there = find_openings(other)
    return any(_is_elsewhere(one, _nearest(one, there)) for one in find_openings(room))


def _nearest(one: Opening, others: Sequence[Opening]) -> Opening | None:
    """Return the opening in the same wall that differs least from one; None if it has none."""
    like = [other for other in others if other.wall == one.wall]
    return min(like, key=lambda other: _moved_mm(one, other), default=None)


def _is_elsewhere(one: Opening, near: Opening | None) -> bool:
    return near is None or _moved_mm(one, near) > MOVED_MM


def _moved_mm(one: Opening, other: Opening) -> float:
    """Return by how much places or sizes of two openings differ [mm]."""
    here, there = ((*x.place, *x.size) for x in (one, other))
    return float(1e3 * np.abs(np.subtract(here, there)).max())


def moved_openings(chamber: Chamber) -> str:
    """Return in words where the part goes out in a second pose, if that is elsewhere; else ""."""
    if not chamber.steps:
        return ""
    first, *others = map(find_openings, chamber.steps)
    for one in first:
        for other in others:
            if _is_elsewhere(one, near := _nearest(one, other)):
                before, after = (x and _in_words(x) for x in (one, near))
                return (
                    f"{MatterKind.OPENINGS_CHANGE} in the second pose, one from {before} in the "
                    f"chamber's frame to {after or 'none'}: a second wall or insert, and jaws "
                    "that suit it"
                )
    return ""


def _in_words(one: Opening) -> str:
    """Return the size and place of an opening."""
    size = " x ".join(f"{1e3 * side:.3g}" for side in one.size)
    return f"{size} mm at {format_point(np.round(one.place, 4))}"


def sharp_edges(
    vertices: np.ndarray, triangles: np.ndarray, target: np.ndarray
) -> tuple[float, np.ndarray]:
    """Return the length [m] of the outer edges of a target that turn by more than SHARP.

    The middle of the longest of them is returned too [m], (3,); that of the origin without any.

    Args:
        vertices, triangles: the part [m].
        target: marks its triangles that are peened, (m,).
    """
    one, two = side_pairs(triangles).T
    normals = unit_vectors(area_vectors(vertices, triangles))
    start, end = vertices[sides_of(triangles)[one]].transpose(1, 0, 2)
    one, two = one // 3, two // 3
    turned = np.einsum("ij,ij->i", normals[one], normals[two]) < np.cos(np.radians(SHARP))
    falls = vertices[triangles[two]].mean(axis=1) - start
    outer = np.einsum("ij,ij->i", falls, normals[one]) < 0.0
    rows = turned & outer & (target[one] | target[two])
    length = np.where(rows, np.linalg.norm(end - start, axis=1), 0.0)
    longest = int(length.argmax())
    return float(length.sum()), 0.5 * (start + end)[longest]


def _bodies_of(
    proposal: Proposal, target: np.ndarray, others: Sequence[Surface]
) -> Iterator[Surface]:
    """Yield the bodies of which a target is a face, such as a shaft of which a fillet is peened.

    A face that goes on smoothly beside the target is one too. What the file names beside the target
    stands for a body that is mostly made of it.

    Args:
        target: marks the triangles of the target in the part's file, (m,).
        others: surfaces beside the target.
    """
    area = areas(proposal.mesh.vertices, proposal.mesh.triangles)
    named = [one.triangles for one in others if "surface" in one.keys]
    told = np.any(named or [area < 0.0], axis=0)
    chosen = proposal.tables["part.target"].get("surface", ())
    for one in proposal.known:
        names, rest = {*one.keys.get("surface", ())}, one.triangles & ~target
        is_body = bool(names) and not names & {*chosen, "all"} and np.any(one.triangles & target)
        goes_on = "faces" in one.keys and bool(np.any(one.triangles & target) and rest.any())
        if goes_on or (is_body and area[rest & ~told].sum() > 0.5 * area[rest].sum() > 0.0):
            yield one


def met_beside(proposal: Proposal, target: np.ndarray) -> Iterator[LeftOut]:
    """Yield what the shot meets of the part beside its target, the largest surfaces by name.

    The area of what is not named is told too.

    Args:
        target: marks the triangles of the target in the part's file, (m,).
    """
    design, chamber = proposal.design, proposal.chamber
    beside = [one for one in proposal.known if not np.any(one.triangles & target)]
    choices = {one.name for one in [*beside, *_bodies_of(proposal, target, beside)]}
    others = [one for one in proposal.known if one.name in choices][:MOST_LOOKED_AT]
    target_area = float(areas(proposal.mesh.vertices, proposal.mesh.triangles)[target].sum())
    keys = {key: one for key, one in proposal.tables["part.target"].items() if key in KINDS}
    aimed = chamber.part.target | rows_of(design, keys)  # with what was left out of it
    bare = np.where(aimed, 0.0, chamber.exposed_area)
    found, wholes, rows = [], {}, {}
    for one in named_or_all(others):
        own = rows[one.name] = rows_of(design, one.keys)
        wholes[one.name] = float(chamber.part.area[own & ~aimed].sum())
        inside = float(bare[own].sum())
        if inside > min(MET * wholes[one.name], PARTLY_MET * target_area):
            found.append((one, inside, np.where(own, bare, 0.0)))
    met = [(one, inside, wholes[one.name]) for one, inside in apart(found)]
    met.sort(key=lambda one: not RUNNING.search(one[0].name))
    named, names = np.zeros_like(aimed), []
    for one, inside, whole in met[:MOST_NAMED]:
        named |= rows[one.name]
        rest_of = "the rest of " if np.any(rows[one.name] & aimed) else ""
        of_it = "" if inside > NEARLY_ALL * whole else " of it"
        names.append(f"{rest_of}{one.name} ({area_in_mm2(inside)}{of_it})")
    text = ", ".join(names)
    if (rest := float(bare[~named].sum())) > LEAST * target_area:
        text += f"{' and ' if text else ''}{area_in_mm2(rest)} {'more' if text else 'beside it'}"
    is_trifle = float(bare.sum()) < TRIFLE * target_area  # such as the ends of a wire
    if not text or (is_trifle and not any("surface" in one.keys for one, *_ in met)):
        return
    is_bare = proposal.design.mask is None
    kind = MatterKind.NOT_MASKED if is_bare else MatterKind.STILL_NOT_MASKED
    runs = "runs or fits by its name, and " if met and RUNNING.search(met[0][0].name) else ""
    yield LeftOut(
        {},
        f"{kind}: the shot also meets {text}; {runs}what has to keep "
        "its size and finish takes a mask",
    )

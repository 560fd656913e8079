"""Compute what the page shows of a design: its part, shape, cavity and the reach of the shot."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import groupby
from typing import Any

import numpy as np

from chamberopt.chamber.bores_and_deflectors import on_deflectors
from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.checks.check import first_warnings, notes, shot_reach
from chamberopt.chamber.checks.facts import describe, first_facts, with_clearance
from chamberopt.chamber.checks.openings import find_openings
from chamberopt.chamber.checks.warning import UNPEENED, DesignWarning, WarningKind
from chamberopt.chamber.layout.target import (
    Surface,
    area_in_mm2,
    crease_deg,
    find_surface,
    named_surfaces,
    names_within,
    single_sizes,
    surfaces,
    why_unnamed,
)
from chamberopt.chamber.part import chosen_on_part, chosen_triangles, named_surface, preview_part
from chamberopt.chamber.reach import reached_part_share
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.number_text import percent, plain
from chamberopt.design.design import Design
from chamberopt.design.part import Selection
from chamberopt.design.shape_surface import TAG_PART, TAG_SONOTRODE, TAG_WALL, is_sonotrode
from chamberopt.design.sonotrode import Face
from chamberopt.documents.facts import facts_in_words
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.sight import way_to_see
from chamberopt.geometry.smoothing.fillets import fillets_of
from chamberopt.geometry.triangles import areas, border_edges, sharp_edges
from chamberopt.page.page_words import Words, on_page
from chamberopt.page.picking import Picked
from chamberopt.pictures.charts.colours import EDGES, GREEN, KINDS

# Where a triangle of the part is: numbers of these kinds.
STATES = "rest", "target", "outside", "unreached", "zone", "holder", "mask"
REST, TARGET, BEYOND, MISSED, ZONE, HELD, MASKED = range(7)
# Types of arrays that Three.js takes; single precision is about 1e-5 mm.
ARRAY_TYPES = {"f": "<f4", "i": "<u4", "u": "<u4", "b": "u1"}


def part_answer(mesh: PartMesh) -> bytes:
    """Return the part as its file has it [mm], its named surfaces with areas, and the colours.

    The number of a triangle in `surface` is that of the name of its surface in `groups`, and in
    `cad_face` that of its face in a CAD file. None of -1 is no number there.
    """
    names = [[one.name, one.text] for one in named_surfaces(mesh)]
    box = [round(1e3 * float(side), 4) for side in mesh.size]
    head = {"names": names, "box_mm": box, "unit": mesh.unit, "notes": list(mesh.notes)}
    head |= {"kinds": KINDS, "states": STATES, "edges": EDGES, "pointed": GREEN}
    head |= {"closed": not len(border_edges(mesh.triangles))}  # or a piece of a drawn set-up
    named, cad_face = named_surface(mesh), mesh.numbering.cad_face
    head |= {"groups": list(mesh.groups)}
    numbers = {"surface": named, "cad_face": cad_face}
    known = {key: one.astype(np.uint32) for key, one in numbers.items() if one is not None}
    return packed(head, points=1e3 * mesh.vertices, triangles=mesh.triangles, **known)


def surface_answer(mesh: PartMesh, name: str) -> bytes:
    """Return the numbers of the triangles of one of the part's surfaces, such as "face 3".

    Raises InputError if the part has no surface of this name.
    """
    known = () if name in mesh.groups else _surfaces(mesh)  # faces take longer to find
    found = np.flatnonzero(find_surface(mesh, known, name).triangles)
    return packed({}, triangles=found)


def surfaces_answer(mesh: PartMesh) -> bytes:
    """Return what of a part can be chosen as the target, by a name or by a click on it.

    `rows` are the names with their sizes in words. `face` is the number of the face of each
    triangle, and `names` has the name that a click on a face means. A fillet is a face of its own.
    `sizes` has the size in words of each name of a row or a click. `unnamed` is why another face
    has no name, in words.
    """
    if mesh.numbering.cad_face is not None:
        face = mesh.faces(None).of_triangle
    else:
        creased = mesh.faces(crease_deg(mesh)).of_triangle
        both = np.stack([creased, fillets_of(mesh).of_triangle], axis=1)
        face = np.unique(both, axis=0, return_inverse=True)[1].reshape(-1)
    known = _surfaces(mesh)
    rows = [[one.name, one.text] for one in known]
    sizes = dict(rows)
    for one in known:
        sizes |= single_sizes(mesh, one)
    head = {"rows": rows, "sizes": sizes, "names": face_names(mesh, face)}
    return packed(head | {"unnamed": why_unnamed(mesh)}, face=face)


def picked_answer(mesh: PartMesh, picked: Sequence[Picked]) -> bytes:
    """Return what a target lists, in words, and the numbers of the triangles of each as `face_K`.

    A face has the name that the proposal gives it, where it has one.
    """
    known = _surfaces(mesh) if any(not one.name for one in picked) else ()
    area, rows, found = areas(mesh.vertices, mesh.triangles), [], {}
    for k, one in enumerate(picked):
        name = one.name or _name_of(mesh, known, one.triangles)
        place = "" if one.at_mm is None else f"at {', '.join(plain(x, 4) for x in one.at_mm)} mm"
        size = area_in_mm2(float(area[one.triangles].sum()))
        rows.append({"name": name, "size": size, "place": place, "by_name": bool(one.name)})
        found[f"face_{k}"] = np.flatnonzero(one.triangles)
    return packed({"rows": rows}, **found)


def face_names(mesh: PartMesh, face: np.ndarray) -> dict[int, str]:
    """Return the names that the proposal gives to faces, by the number of each.

    A face of several surfaces has the name of the first; one of several alike has its number too.

    Args:
        face: number of the face of each triangle, (m,).
    """
    names: dict[int, str] = {}
    numbers, first = np.unique(face, return_index=True)
    for one in reversed(_surfaces(mesh)):
        within = np.bincount(face, ~one.triangles)[numbers] == 0
        own = names_within(mesh, one, first[within].tolist())
        names |= dict(zip(numbers[within].tolist(), own, strict=True))
    return names


def _name_of(mesh: PartMesh, known: Sequence[Surface], picked: np.ndarray) -> str:
    """Return the name of what is picked, as the proposal gives it, or "a face".

    Args:
        known: all surfaces of the part.
        picked: marks its triangles, (m,) bool.
    """
    for one in known:
        if np.array_equal(one.triangles, picked):
            return f"{one.name}, all alike" if one.are_alike else one.name
    for one in known:
        if one.triangles[picked].all():
            (name,) = names_within(mesh, one, [int(picked.argmax())])
            return name if one.are_alike else f"one of {name}"
    return "a face"


@lru_cache(maxsize=2)
def _surfaces(mesh: PartMesh) -> list[Surface]:
    return surfaces(mesh)


def step_texts(design: Design) -> list[str]:
    """Return name and time of each step of a design; an empty list for a design without steps."""
    if not design.steps:
        return []
    whole = sum(one.time_share for one in design.steps)
    times = (plain(one.process.treatment_time, 3) for one in design.in_steps.values())
    return [
        f"{step.title}: {time} s, {percent(step.time_share / whole)} of the time"
        for step, time in zip(design.steps, times, strict=True)
    ]


def _in_step(design: Design, step: int) -> Design:
    """Return the design of one of its steps, or the design itself if it has no such step."""
    designs = [*design.in_steps.values()]
    return designs[step] if 0 <= step < len(designs) else designs[0]


def shape_answer(design: Design, step: int = 0) -> bytes:
    """Return the chamber's shape without the part [mm], the part's pose in it, and its target.

    Args:
        step: number of the step that is shown, for a design with steps.
    """
    design = _in_step(design, step)
    part = preview_part(design)
    shape = design.chamber.surface(part.vertices, part.mesh.triangles)
    chosen = {
        name: chosen_triangles(part.mesh, at, f"{name}.at") for name, at in _fixture_faces(design)
    }
    state = _state(part.target, part.zones, chosen)
    zone = np.zeros(len(state), np.uint8)
    for k, one in enumerate(part.zones.values(), 1):
        zone[one] = k
    low, high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
    own = part.vertices
    head = {
        "rotation": part.rotation.ravel().tolist(),
        "shift": (1e3 * part.shift).tolist(),
        "shape_mm": [(1e3 * low).tolist(), (1e3 * high).tolist()],
        "part_mm": [(1e3 * own.min(axis=0)).tolist(), (1e3 * own.max(axis=0)).tolist()],
        "shape": design.chamber.shape,
        "distance_mm": getattr(design.chamber, "sonotrode_distance_mm", None),
        "way": _way(part.mesh, part.rotation.tobytes(), part.target.tobytes()),
        "target_triangles": int(part.target.sum()),
        "balls": design.shot.count,
        "zones": [*part.zones],  # zone k + 1 has name k
        "awaited": _awaited(design),
        "form": _form(design),
    }
    surface = _surface(shape.vertices, shape.triangles, shape.tags, design.sonotrode.face)
    return packed(head, **surface, **_block(design), state=state, zone=zone)


def _awaited(design: Design) -> list[str]:
    """Return which fixtures of a design are drawn once its chamber is built."""
    holder, mask = design.holder, design.mask
    there = {"holder": holder is not None and holder.kind != "bore", "mask": mask is not None}
    return [name for name, is_there in there.items() if is_there]


def _form(design: Design) -> str:
    """Return what is the same for designs with the same part, chamber, holder and mask."""
    text = design.model_dump_json(include={"part", "chamber", "holder", "mask", "zones"})
    return hashlib.sha256(text.encode()).hexdigest()


@lru_cache(maxsize=8)
def _way(mesh: PartMesh, rotation: bytes, target: bytes) -> list[float]:
    """Return the unit vector to the eye that sees most of a target, as of `way_to_see`.

    Args:
        rotation: from the part's frame to that of the chamber, (3, 3), as bytes.
        target: marks the target's triangles, (m,) bool, as bytes.
    """
    turned = mesh.vertices @ np.frombuffer(rotation).reshape(3, 3).T
    chosen = np.frombuffer(target, dtype=bool)
    return [float(one) for one in way_to_see(turned, mesh.triangles, chosen)]


def check_answers(design: Design, step: int = 0) -> Iterator[bytes]:
    """Yield what the command `check` tells of a design, as two answers to the page.

    The first has the cavity. The second takes longer and has what the shot can reach.

    Args:
        step: number of the step whose chamber is shown, for a design with steps. Facts are of all.
    """
    whole = build_chamber(design)
    one = _in_step(design, step)
    chamber = whole.steps[step] if 0 <= step < len(whole.steps) else (*whole.steps, whole)[0]
    mesh = chamber_mesh(whole)
    head: dict[str, Any] = {
        "facts": _facts(design, with_clearance(first_facts(design, whole), mesh)),
        "notes": [on_page(text) for text in notes(design, whole)],
        "openings": _openings(chamber),
        **_warnings(first_warnings(design, whole, mesh)),
    }
    part = chamber.part
    chosen = {name: chosen_on_part(one, at, f"{name}.at") for name, at in _fixture_faces(one)}
    state = _state(part.target, part.zones, chosen)
    state[part.target & (chamber.exposed_area <= 0.0)] = BEYOND
    remeshed = part.file is not None and part.file.original is not None
    own = {"part_points": 1e3 * part.vertices, "part_triangles": part.triangles} if remeshed else {}
    surface = _surface(chamber.vertices, chamber.triangles, chamber.tags, one.sonotrode.face)
    bodies = _bodies(one, chamber) | _block(one)
    yield packed(head, **{**surface, **bodies}, state=state, **own)

    reach = shot_reach(one, chamber)
    found = describe(design, whole)
    share = reached_part_share(reach, chamber.source, len(part.triangles))
    state[part.target & (chamber.exposed_area > 0.0) & (share <= 0.5)] = MISSED
    head = {
        "facts": _facts(design, found),
        "notes": [on_page(text) for text in found["notes"]],
        **_warnings(found["warnings"]),
    }
    yield packed(head, state=state)


def _openings(chamber: Chamber) -> list[tuple[str, str]]:
    """Return the wall and the size of each opening through which the part goes out, in words."""
    found = []
    for one in find_openings(chamber):
        wide, high = (plain(round(1e3 * side, 1)) for side in one.size)
        size = f"Ø {wide} mm" if one.form == "round" else f"{wide} × {high} mm"
        found.append((one.wall, "where it ends on the part" if one.is_end else size))
    return found


def _warnings(found: Sequence[DesignWarning]) -> dict[str, list[Words]]:
    """Return warnings in words: those that the page shows first, and the others.

    What is to be settled is not among them: the page has a list of it.
    """
    own = [one for one in found if one.kind is not WarningKind.TO_SETTLE]
    return {
        "unpeened": [on_page(one.text) for one in own if one.kind in UNPEENED],
        "warnings": [on_page(one.text) for one in own if one.kind not in UNPEENED],
    }


def _facts(design: Design, found: Mapping[str, Any]) -> list[tuple[str, list[Words]]]:
    """Return subjects and the facts of each, in words, one after the other."""
    each = groupby(facts_in_words(design, found), lambda one: one.subject)
    return [(subject, [on_page(one.text) for one in facts]) for subject, facts in each]


def _fixture_faces(design: Design) -> Iterator[tuple[str, Selection]]:
    """Yield the name of holder and mask, and the faces that the design chooses for each."""
    for name, fixture in (("holder", design.holder), ("mask", design.mask)):
        if fixture is not None and fixture.at is not None:
            yield name, fixture.at


def _state(
    target: np.ndarray, zones: dict[str, np.ndarray], fixtures: dict[str, np.ndarray]
) -> np.ndarray:
    """Return for each triangle of the part where it is, one of STATES, (m,).

    Args:
        fixtures: triangles that holder and mask are to touch, (m,) bool each.
    """
    state = np.where(target, TARGET, REST).astype(np.uint8)
    for zone in zones.values():
        state[zone] = ZONE
    for name, faces in fixtures.items():
        state[faces] = HELD if name == "holder" else MASKED
    return state


def _surface(
    vertices: np.ndarray, triangles: np.ndarray, tags: np.ndarray, face: Face | None
) -> dict[str, np.ndarray]:
    """Return the walls and the sonotrode of a closed cavity, and its edges and joints, in mm."""
    edges, moving = vertices[sharp_edges(vertices, triangles)], is_sonotrode(tags)
    if face is not None:
        joints = face.joints_on(vertices, triangles[tags == TAG_SONOTRODE])
        edges = np.concatenate([edges, joints])
    return {
        "points": 1e3 * vertices,
        "walls": triangles[~moving & (tags != TAG_PART)],
        "sonotrode": triangles[moving],
        "edges": 1e3 * edges,
    }


def _bodies(design: Design, chamber: Chamber) -> dict[str, np.ndarray]:
    """Return the walls of a chamber, its deflectors, and its closed holder and mask [mm].

    They are apart, because a section fills each in a way and a colour of its own.
    """
    found, walls = {}, chamber.tags == TAG_WALL
    if chamber.fitting is not None:
        deflectors = walls & on_deflectors(design, chamber.fitting)
        found["deflectors"] = chamber.triangles[deflectors]
        walls &= ~deflectors
    for name, fixture in chamber.fixtures.items():
        walls &= ~chamber.on_fixture(name)
        found |= {f"{name}_points": 1e3 * fixture.vertices, f"{name}_triangles": fixture.triangles}
    return {"walls": chamber.triangles[walls], **found}


def _block(design: Design) -> dict[str, np.ndarray]:
    """Return what is drawn of the disc or blocks on which the chamber stands [mm], if known."""
    if design.sonotrode.face is None:
        return {}
    points, triangles = design.sonotrode.face.body
    return {"block_points": 1e3 * points, "block_triangles": triangles}


def packed(head: Mapping[str, object], **arrays: np.ndarray) -> bytes:
    """Return an answer to the page as bytes, with texts and numbers (`head`) and arrays.

    The bytes are the length of the head (4 bytes), the head as JSON, and the arrays. The head also
    tells each array's kind and length. Each array begins at a multiple of 4 bytes.
    """
    blocks = []
    for values in arrays.values():
        flat = np.ascontiguousarray(values).ravel()
        kind = "u1" if flat.dtype == np.uint8 else ARRAY_TYPES[flat.dtype.kind]
        blocks.append((kind, len(flat), flat.astype(kind).tobytes()))
    layout = {name: block[:2] for name, block in zip(arrays, blocks, strict=True)}
    text = json.dumps({**head, "arrays": layout}).encode()
    text += b" " * (-len(text) % 4)
    content = b"".join(data + b"\0" * (-len(data) % 4) for *_, data in blocks)
    return len(text).to_bytes(4, "little") + text + content

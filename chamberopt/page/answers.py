"""Compute what the page shows of a design: its part, shape, cavity and the reach of the shot."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from itertools import groupby
from typing import Any

import numpy as np

from chamberopt.chamber.bores_and_deflectors import on_deflectors
from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.checks.check import first_warnings, notes, shot_reach
from chamberopt.chamber.checks.facts import describe, first_facts, with_clearance
from chamberopt.chamber.part import named_surface, preview_part
from chamberopt.chamber.propose.proposed_target import named_surfaces
from chamberopt.chamber.reach import reached_part_share
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.design.design import Design
from chamberopt.design.shape_surface import TAG_PART, TAG_WALL, is_sonotrode
from chamberopt.documents.facts import facts_in_words
from chamberopt.geometry.triangles import border_edges, sharp_edges
from chamberopt.page.page_words import Words, on_page
from chamberopt.pictures.charts.colours import EDGES, KINDS

# Where a triangle of the part is: numbers of these kinds.
STATES = "rest", "target", "outside", "unreached", "zone"
REST, TARGET, BEYOND, MISSED, ZONE = range(5)
# Types of arrays that Three.js takes; single precision is about 1e-5 mm.
ARRAY_TYPES = {"f": "<f4", "i": "<u4", "u": "<u4", "b": "u1"}


def part_answer(design: Design) -> bytes:
    """Return the part as its file has it [mm], its named surfaces with areas, and the colours.

    The number of a triangle in `surface` is that of the name of its surface in `groups`.
    """
    mesh = preview_part(design).mesh
    names = [[one.name, one.text] for one in named_surfaces(mesh)]
    box = [round(1e3 * float(side), 4) for side in mesh.size]
    head = {"names": names, "box_mm": box, "unit": mesh.unit, "notes": list(mesh.notes)}
    head |= {"kinds": KINDS, "states": STATES, "edges": EDGES}
    head |= {"closed": not len(border_edges(mesh.triangles))}  # or a piece of a drawn set-up
    named = named_surface(mesh)
    head |= {"groups": list(mesh.groups)}
    surface = {} if named is None else {"surface": named.astype(np.uint32)}  # -1 is no number then
    return packed(head, points=1e3 * mesh.vertices, triangles=mesh.triangles, **surface)


def shape_answer(design: Design) -> bytes:
    """Return the chamber's shape without the part [mm], the part's pose in it, and its target."""
    part = preview_part(design)
    shape = design.chamber.surface(part.vertices, part.mesh.triangles)
    state = _state(part.target, part.zones)
    low, high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
    own = part.vertices
    head = {
        "rotation": part.rotation.ravel().tolist(),
        "shift": (1e3 * part.shift).tolist(),
        "shape_mm": [(1e3 * low).tolist(), (1e3 * high).tolist()],
        "part_mm": [(1e3 * own.min(axis=0)).tolist(), (1e3 * own.max(axis=0)).tolist()],
        "target_triangles": int(part.target.sum()),
        "balls": design.shot.count,
    }
    return packed(head, **_surface(shape.vertices, shape.triangles, shape.tags), state=state)


def check_answers(design: Design) -> Iterator[bytes]:
    """Yield what the command `check` tells of a design, as two answers to the page.

    The first has the cavity. The second takes longer and has what the shot can reach.
    """
    chamber = build_chamber(design)
    mesh = chamber_mesh(chamber)
    head: dict[str, Any] = {
        "facts": _facts(design, with_clearance(first_facts(design, chamber), mesh)),
        "notes": [on_page(text) for text in notes(design, chamber)],
        "warnings": [on_page(text) for text in first_warnings(design, chamber, mesh)],
    }
    part = chamber.part
    state = _state(part.target, part.zones)
    state[part.target & (chamber.exposed_area <= 0.0)] = BEYOND
    remeshed = part.file is not None and part.file.original is not None
    own = {"part_points": 1e3 * part.vertices, "part_triangles": part.triangles} if remeshed else {}
    surface = _surface(chamber.vertices, chamber.triangles, chamber.tags)
    yield packed(head, **{**surface, **_bodies(design, chamber)}, state=state, **own)

    reach = shot_reach(design, chamber)
    found = describe(design, chamber)
    share = reached_part_share(reach, chamber.source, len(part.triangles))
    state[part.target & (chamber.exposed_area > 0.0) & (share <= 0.5)] = MISSED
    head = {name: [on_page(text) for text in found[name]] for name in ("notes", "warnings")}
    yield packed({"facts": _facts(design, found), **head}, state=state)


def _facts(design: Design, found: Mapping[str, Any]) -> list[tuple[str, list[Words]]]:
    """Return subjects and the facts of each, in words, one after the other."""
    each = groupby(facts_in_words(design, found), lambda one: one.subject)
    return [(subject, [on_page(one.text) for one in facts]) for subject, facts in each]


def _state(target: np.ndarray, zones: dict[str, np.ndarray]) -> np.ndarray:
    """Return for each triangle of the part where it is: in a ZONE, TARGET or REST, (m,)."""
    state = np.where(target, TARGET, REST).astype(np.uint8)
    for zone in zones.values():
        state[zone] = ZONE
    return state


def _surface(
    vertices: np.ndarray, triangles: np.ndarray, tags: np.ndarray
) -> dict[str, np.ndarray]:
    """Return the walls, the sonotrode and the sharp edges of a closed cavity, in mm."""
    ends, moving = sharp_edges(vertices, triangles), is_sonotrode(tags)
    return {
        "points": 1e3 * vertices,
        "walls": triangles[~moving & (tags != TAG_PART)],
        "sonotrode": triangles[moving],
        "edges": 1e3 * vertices[ends],
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

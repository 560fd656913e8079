"""Read STEP parts and assemblies, in the file's unit. Names and colours become groups."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.meshes.native_reader import NativeReader, read_in_child
from chamberopt.geometry.meshes.raw_mesh import RawMesh, number_by_position
from chamberopt.geometry.meshes.step_tessellation import REMEDY, Tessellation, tessellate
from chamberopt.geometry.meshes.units import METRES_PER

# The text of a STEP file states the unit of its numbers and the names of its faces.
#
# An entity is `#12 = TYPE('name', #7, ...);`. A complex entity has several types: `#12 = (A()
# B(#7));`.
#
# Source: ISO 10303-21 (exchange structure), ISO 10303-42 (geometry and topology).

# A quote in a string is written twice, which reads as two strings: no text is read in two ways.
ENTITY = re.compile(r"#(\d+)\s*=\s*\(?\s*([A-Z_0-9]+)\s*((?:'[^']*+'|[^';])*+);")
STRING = re.compile(r"'((?:[^']|'')*+)'")
NUMBER = re.compile(r"[-+]?\d*\.?\d+(?:\.?[Ee][-+]?\d+)?")
REFERENCE = re.compile(r"#(\d+)")
IGNORED = dict.fromkeys(range(32))  # characters of a string, such as the end of a line
ESCAPE = re.compile(
    r"\\X2\\(?P<utf16>(?:[0-9A-F]{4})+)\\X0\\|\\X4\\(?P<utf32>(?:[0-9A-F]{8})+)\\X0\\"
    r"|\\X\\(?P<byte>[0-9A-F]{2})|\\S\\(?P<upper>.)|\\(?P<itself>\\)|'(?P<quote>')"
)
UNIT_ASSIGNED = re.compile(r"GLOBAL_UNIT_ASSIGNED_CONTEXT\s*\(\s*\(([^)]*)\)")
SI_UNIT = re.compile(r"SI_UNIT\s*\(\s*(?:\.(\w+)\.|\$)\s*,\s*\.METRE\.\s*\)")
CONVERTED_UNIT = re.compile(r"CONVERSION_BASED_UNIT\s*\(\s*'(\w+)'")
PREFIXES = {"": "m", "MILLI": "mm", "CENTI": "cm", "MICRO": "um"}
NAMED = {"INCH": "in", "MILLIMETRE": "mm", "MILLIMETER": "mm"}
FACES = ("ADVANCED_FACE", "FACE_SURFACE")
SHELLS, TURNED_SHELL = ("CLOSED_SHELL", "OPEN_SHELL"), "ORIENTED_CLOSED_SHELL"
SOLIDS = ("MANIFOLD_SOLID_BREP", "BREP_WITH_VOIDS", "FACETED_BREP")
BOUNDS, LOOPS = ("FACE_OUTER_BOUND", "FACE_BOUND"), ("EDGE_LOOP", "POLY_LOOP")
# The entities on the way from a face to its corners. Curves are left out, although points lie on
# them too.
LEADS_TO = {
    **dict.fromkeys(FACES, BOUNDS),
    **dict.fromkeys(BOUNDS, LOOPS),
    "EDGE_LOOP": ("ORIENTED_EDGE",),
    "ORIENTED_EDGE": ("EDGE_CURVE",),
    "EDGE_CURVE": ("VERTEX_POINT",),
    "VERTEX_POINT": ("CARTESIAN_POINT",),
    "POLY_LOOP": ("CARTESIAN_POINT",),
}
# Names that CAD programs give to faces without a name.
NO_NAMES = ("", "NONE")
# Names that programs which write STEP give to bodies without a name: their own.
TRANSLATOR = re.compile(r"Open ?CASCADE|\b(?:STEP|IGES)\W+(?:translator|(?:pre)?processor)\b", re.I)


class StepFace(NamedTuple):
    """Face of a solid, as the text of a STEP file describes it."""

    name: str  # "" if the face has no name
    # mean of its corners, (3,), in the file's numbers; nan for a face without corners
    middle: np.ndarray


def stated_unit(text: str) -> str | None:
    """Return the unit of the lengths of a STEP file: m, mm, cm, um, in, or None for another."""
    assigned = UNIT_ASSIGNED.search(text)
    for number in REFERENCE.findall(assigned[1]) if assigned else ():
        entity = re.search(rf"#{number}\s*=([^;]*);", text)
        if entity and "LENGTH_UNIT" in entity[1]:
            si, converted = SI_UNIT.search(entity[1]), CONVERTED_UNIT.search(entity[1])
            if converted:
                return NAMED.get(converted[1].upper())
            return PREFIXES.get(si[1] or "") if si else None
    return None


def read_solids(text: str) -> list[list[StepFace]]:
    """Return the faces of each solid in the text of a STEP file, in the file's order."""
    entities = {number: (kind, value) for number, kind, value in ENTITY.findall(text)}

    def linked(number: str, kinds: tuple[str, ...]) -> list[str]:
        """Return the numbers of the entities of some kinds to which an entity refers."""
        found = REFERENCE.findall(STRING.sub("", entities[number][1]))
        return [one for one in found if one in entities and entities[one][0] in kinds]

    @cache
    def corners(number: str) -> frozenset[str]:
        """Return the numbers of the points at the ends of a face's edges."""
        kind = entities[number][0]
        if kind == "CARTESIAN_POINT":
            return frozenset([number])
        return frozenset().union(*map(corners, linked(number, LEADS_TO[kind])))

    def face(number: str) -> StepFace:
        name = STRING.search(entities[number][1])
        texts = [STRING.sub("", entities[corner][1]) for corner in sorted(corners(number))]
        places = [list(map(float, NUMBER.findall(text))) for text in texts]
        middle = np.mean(places, axis=0) if places else np.full(3, np.nan)
        return StepFace(_decoded(name[1] if name else ""), middle)

    solids = []
    for number, (kind, _) in entities.items():
        if kind in SOLIDS:
            shells = [
                closed
                for shell in linked(number, (*SHELLS, TURNED_SHELL))
                for closed in (
                    linked(shell, SHELLS) if entities[shell][0] == TURNED_SHELL else [shell]
                )
            ]
            solids.append([face(one) for shell in shells for one in linked(shell, FACES)])
    return solids


def _decoded(text: str) -> str:
    """Return a name from a STEP file with its escape sequences decoded.

    A placeholder that CAD programs write for a missing name gives "".
    """
    text = ESCAPE.sub(_character, text.translate(IGNORED)).strip()
    return "" if text.upper() in NO_NAMES else text


def _character(escape: re.Match[str]) -> str:
    """Return the characters that an escape sequence stands for; U+FFFD for an incomplete one."""
    kind = str(escape.lastgroup)
    given = escape[kind]
    if kind in ("utf16", "utf32"):
        return bytes.fromhex(given).decode(f"{kind[:3]}-{kind[3:]}-be", errors="replace")
    if kind == "byte":
        return chr(int(given, 16))
    return chr(ord(given) | 0x80) if kind == "upper" else given


READER = NativeReader(tessellate, "part.step", f"ended its reader; {REMEDY}", 60.0)
NAMED_FACE = re.compile(r"(?:ADVANCED_FACE|FACE_SURFACE)\s*\(\s*'(?!'|NONE')")
# Share of a body's size: largest distance between the middle of a face and its middle in the file's
# text.
SAME_PLACE = 1e-4


def read_step(path: Path, content: bytes, how: Tessellation | None = None) -> RawMesh:
    """Mesh the bodies of a STEP file, in its own unit, with an assembly's parts in their places.

    Groups are the names of bodies and of faces, and the colours of faces, as "#ff0000".
    """
    if find_spec("gmsh") is None:
        raise InputError(f"{path}: STEP needs the package gmsh: pip install 'chamberopt[cad]'")
    how = how or Tessellation()
    limits = 1e3 * how.chord, how.angle, 1e3 * how.side
    arrays: dict[str, np.ndarray] = read_in_child(READER, path, content, *limits)
    if not len(arrays["corners"]):
        raise InputError(f"{path}: holds no faces; {REMEDY}")
    try:
        text = content.decode()
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    stated = stated_unit(text)
    unit = stated or "mm"
    mm = 1e3 * METRES_PER[unit]
    face_of, body = arrays["face_of"], arrays["body"]
    solids = read_solids(text) if NAMED_FACE.search(text) else []
    names = [name.rpartition("/")[2] for name in arrays["name"]]
    names = ["" if TRANSLATOR.search(name) else name for name in names]
    notes = [
        f"STEP: {len(body)} faces meshed to {1e6 * how.chord:g} µm and "
        f"{np.degrees(how.angle):.3g} degrees"
    ]
    if left_out := int(arrays["left_out"]):
        what = "1 face" if left_out == 1 else f"{left_out} faces"
        notes.append(f"STEP: {what} beside the solids, such as sketches, left out")
    if stated is None:
        notes.append("the file's own unit is not one of part.unit: its lengths are read in mm")
    labels = [{names[k]} if k >= 0 else set() for k in body]
    for k, name in enumerate(names):
        faces = np.flatnonzero(body == k)
        own = _face_names(solids, arrays["middle"][faces] / mm)
        if own is None:
            notes.append(f"the faces of {name or 'a body'} are not certain: no names for them")
        for face, label in zip(faces.tolist(), own or (), strict=bool(own)):
            labels[face].add(label)
    for face, (r, g, b, visible) in enumerate(arrays["colour"].tolist()):
        if visible:
            labels[face].add(f"#{r:02x}{g:02x}{b:02x}")
    groups = {
        label: np.array([label in own for own in labels])[face_of]
        for label in sorted(
            {label for own in labels for label in own if label},
            key=lambda label: (label.startswith("#"), label),  # colours last
        )
    }
    return RawMesh(
        arrays["corners"] / mm,
        groups,
        unit,
        tuple(notes),
        replace(number_by_position(len(face_of)), cad_face=face_of),
        bodies=body[face_of],
        normals=arrays["normals"],
        is_exact=True,
    )


def _face_names(solids: list[list[StepFace]], middles: np.ndarray) -> tuple[str, ...] | None:
    """Return the names of the faces of a body, in order.

    Gmsh's body has its faces in the order of its solid in the file. The solid is recognised by the
    middles of its faces: moved and turned, they coincide with the middles of the body's faces.

    Args:
        solids: faces of each solid in the file.
        middles: mean of each face's corners, (k, 3), in the file's numbers.
    Returns:
        The names; an empty tuple if the file names no faces. None if no solid is the body, or if
        several solids with different names could be.
    """
    if not any(face.name for faces in solids for face in faces):
        return ()
    alike = {
        tuple(face.name for face in faces)
        for faces in solids
        if len(faces) == len(middles)
        and _is_moved(np.array([face.middle for face in faces]), middles)
    }
    return alike.pop() if len(alike) == 1 else None


def _is_moved(one: np.ndarray, other: np.ndarray) -> bool:
    """Return True if points `one` (k, 3) are the points `other` (k, 3), moved and turned.

    Points that are nan are left out.
    """
    kept = np.isfinite(one).all(axis=1) & np.isfinite(other).all(axis=1)
    if not kept.any():
        return False
    one, other = (places[kept] - places[kept].mean(axis=0) for places in (one, other))
    u, _, v = np.linalg.svd(one.T @ other)  # Kabsch's best rotation
    turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    return bool(np.abs(one @ turn - other).max() <= SAME_PLACE * np.ptp(other, axis=0).max())

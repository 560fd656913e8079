"""Read STEP files, parts and assemblies, in the file's unit; names and colours are groups."""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io.native_reader import NativeReader, converted
from chamberopt.geometry.mesh_io.readers.raw_mesh import RawMesh
from chamberopt.geometry.mesh_io.readers.step.entities import StepFace, read_solids, stated_unit
from chamberopt.geometry.mesh_io.readers.step.tessellation import REMEDY, Tessellation
from chamberopt.geometry.mesh_io.units import METRES_PER

MESH = (
    "from chamberopt.geometry.mesh_io.readers.step.tessellation import tessellate; "
    "tessellate(*sys.argv[1:])"
)
READER = NativeReader("part.step", "part.npz", MESH, seconds_per_mb=60.0)
NAMED_FACE = re.compile(r"(?:ADVANCED_FACE|FACE_SURFACE)\s*\(\s*'(?!'|NONE')")
# Of a body's size: how far the middle of a face may be from that in the file's text.
SAME_PLACE = 1e-4


def read_step(path: Path, content: bytes, how: Tessellation | None = None) -> RawMesh:
    """Mesh the bodies of a STEP file, in its own unit; an assembly's parts are placed as in it.

    Groups are the names of bodies and of faces, and the colours of faces, as "#ff0000".
    """
    if find_spec("gmsh") is None:
        raise InputError(f"{path}: STEP needs the package gmsh: pip install 'chamberopt[cad]'")
    how = how or Tessellation()
    limits = 1e3 * how.chord, how.angle, 1e3 * how.side
    with converted(READER, path, content, *limits) as file:
        if file is None:
            raise InputError(f"{path}: ended its reader; {REMEDY}")
        with np.load(file) as loaded:
            arrays: dict[str, np.ndarray] = dict(loaded)
    if "fault" in arrays:
        raise InputError(f"{path}: {arrays['fault']}")
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
        bodies=body[face_of],
        normals=arrays["normals"],
        is_exact=True,
    )


def _face_names(solids: list[list[StepFace]], middles: np.ndarray) -> tuple[str, ...] | None:
    """Names of the faces of a body, in order.

    Faces are in the order of the solid in the file. That it is this solid is seen from the middles
    of its faces: moved and turned as one, they are those of the body.

    Args:
        middles: mean of each face's corners, (k, 3), in the file's numbers.
    Returns:
        None if no solid is the body, or several that differ in their names could be.
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
    """Whether places (k, 3) are the others, moved and turned as one; nan is left out."""
    kept = np.isfinite(one).all(axis=1) & np.isfinite(other).all(axis=1)
    if not kept.any():
        return False
    one, other = (places[kept] - places[kept].mean(axis=0) for places in (one, other))
    u, _, v = np.linalg.svd(one.T @ other)  # Kabsch's best rotation
    turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    return bool(np.abs(one @ turn - other).max() <= SAME_PLACE * np.ptp(other, axis=0).max())

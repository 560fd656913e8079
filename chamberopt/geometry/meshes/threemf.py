"""Read 3MF files with trimesh."""

from __future__ import annotations

import io
import re
import zipfile
from dataclasses import replace
from pathlib import Path

from chamberopt.common.errors import InputError
from chamberopt.common.limits import MAX_COPIES, MAX_UNPACKED_BYTES, require_few, require_size
from chamberopt.geometry.meshes.raw_mesh import RawMesh, read_scene
from chamberopt.geometry.meshes.units import UNIT_NAMES

# An object of the model, or a component that puts an earlier object into it.
OBJECT = re.compile(rb'<(?:\w+:)?(object|component)\s[^>]*?\b(?:object)?id\s*=\s*"(\d+)"')


def read_3mf(path: Path, content: bytes) -> RawMesh:
    """Read a 3MF file, in the unit that it states. Objects of one name become a group."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        unpacked = sum(entry.file_size for entry in archive.infolist())
        require_size(path, unpacked, MAX_UNPACKED_BYTES, "file that unpacks to data")
        model = next(name for name in archive.namelist() if "3d/3dmodel.model" in name.lower())
        text = archive.read(model)
        require_few(path, _copies(text), "copies of bodies", MAX_COPIES)
        found = re.search(rb'<model[^>]*\bunit\s*=\s*"(\w+)"', text)
    mesh = read_scene(io.BytesIO(content), "3mf")
    stated = found[1].decode().lower() if found else "millimeter"  # the specification's default
    if stated not in UNIT_NAMES:
        why = f"its unit, {stated!r}, is not supported"
        raise InputError(f"{path}: {why}; export it in millimetres")
    return replace(mesh, unit=UNIT_NAMES[stated])


def _copies(model: bytes) -> int:
    """Return the number of bodies in the largest object of a 3MF model.

    An object may repeat other objects, which repeat objects in turn, so that a short file can hold
    very many bodies.
    """
    bodies: dict[bytes, int] = {}
    current = b""
    for kind, number in OBJECT.findall(model):
        if kind == b"object":
            current = number
            bodies[current] = 0
        else:
            bodies[current] = bodies.get(current, 0) + max(1, bodies.get(number, 1))
            bodies[current] = min(bodies[current], 1 << 60)
    return max(bodies.values(), default=0)

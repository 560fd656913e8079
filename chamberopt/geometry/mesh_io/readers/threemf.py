"""Read 3MF files with trimesh."""

from __future__ import annotations

import io
import re
import zipfile
from dataclasses import replace
from pathlib import Path

from chamberopt.common.errors import InputError
from chamberopt.common.limits import MAX_UNPACKED_BYTES, require_size
from chamberopt.geometry.mesh_io.readers.raw_mesh import RawMesh, read_scene
from chamberopt.geometry.mesh_io.units import UNIT_NAMES


def read_3mf(path: Path, content: bytes) -> RawMesh:
    """Read the objects that a 3MF builds, by name; the file states its unit."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        unpacked = sum(entry.file_size for entry in archive.infolist())
        require_size(path, unpacked, MAX_UNPACKED_BYTES, "file that unpacks to data")
        model = next(name for name in archive.namelist() if "3d/3dmodel.model" in name.lower())
        found = re.search(rb'<model[^>]*\bunit\s*=\s*"(\w+)"', archive.read(model))
    mesh = read_scene(io.BytesIO(content), "3mf")
    stated = found[1].decode().lower() if found else "millimeter"  # the specification's default
    if stated not in UNIT_NAMES:
        why = f"its unit, {stated!r}, is not supported"
        raise InputError(f"{path}: {why}; export it in millimetres")
    return replace(mesh, unit=UNIT_NAMES[stated])

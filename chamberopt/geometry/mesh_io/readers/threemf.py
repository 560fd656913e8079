"""Read 3MF files with trimesh."""

from __future__ import annotations

import io
import re
import zipfile
from dataclasses import replace
from pathlib import Path

from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io.readers.raw_mesh import RawMesh, join_pieces, load_pieces
from chamberopt.geometry.mesh_io.units import UNIT_NAMES


def read_3mf(path: Path, content: bytes) -> RawMesh:
    """Read the objects that a 3MF builds, by name; the file states its unit."""
    pieces = load_pieces("3mf", content)
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        model = next(name for name in archive.namelist() if "3d/3dmodel.model" in name.lower())
        found = re.search(rb'<model[^>]*\bunit\s*=\s*"(\w+)"', archive.read(model))
    stated = found[1].decode().lower() if found else "millimeter"  # the specification's default
    if stated not in UNIT_NAMES:
        raise InputError(
            f"{path}: its unit, {stated!r}, is not supported; export it in millimetres"
        )
    return replace(join_pieces(pieces), unit=UNIT_NAMES[stated])

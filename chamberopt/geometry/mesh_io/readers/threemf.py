"""3MF files, read by trimesh."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path

from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io.readers.raw_mesh import RawMesh, joined, load_pieces

THREEMF_UNITS = {
    "micron": "um", "millimeter": "mm", "millimeters": "mm", "centimeter": "cm", "inch": "in", "meter": "m",
}  # fmt: skip


def read_3mf(path: Path, content: bytes) -> RawMesh:
    """The objects that the file builds, by name; the file states its unit."""
    import zipfile

    pieces = load_pieces("3mf", content)
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        model = next(name for name in archive.namelist() if "3d/3dmodel.model" in name.lower())
        found = re.search(rb'<model[^>]*\bunit\s*=\s*"(\w+)"', archive.read(model))
    stated = found[1].decode().lower() if found else "millimeter"  # the specification's own default
    if stated not in THREEMF_UNITS:
        raise InputError(
            f"{path}: its unit, {stated!r}, is not supported; export it in millimetres"
        )
    return replace(joined(pieces), unit=THREEMF_UNITS[stated])

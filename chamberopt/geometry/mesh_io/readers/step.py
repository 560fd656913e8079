"""Read STEP files, parts and assemblies; OpenCASCADE makes triangles of them."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io.native_reader import converted
from chamberopt.geometry.mesh_io.readers.raw_mesh import RawMesh, read_scene

# Largest distance from the true surface, and angle between neighbours. A facet of a 10 mm cylinder
# then turns a ball by less than the scatter of rough steel does.
MAX_DISTANCE_MM, MAX_ANGLE_RAD = 0.01, 0.1
CONVERT = "import cascadio; cascadio.step_to_glb(*sys.argv[1:3], *map(float, sys.argv[3:]))"


def read_step(path: Path, content: bytes) -> RawMesh:
    """Read the solids of a STEP file, in metres; names of products name the triangles.

    An assembly's parts are placed as in the assembly.
    """
    if find_spec("cascadio") is None:
        raise InputError(f"{path}: STEP needs the package cascadio: pip install 'chamberopt[cad]'")
    limits = MAX_DISTANCE_MM, MAX_ANGLE_RAD
    with converted(content, "part.step", "part.glb", CONVERT, *limits) as glb:
        mesh = read_scene(glb, "glb") if glb else None
    if mesh is None or not len(mesh.corners):
        raise InputError(
            f"{path}: holds no solid that could be meshed, or is damaged; "
            "export it again as AP214 or AP242"
        )
    angle = np.degrees(MAX_ANGLE_RAD)
    note = f"STEP: meshed to {1e3 * MAX_DISTANCE_MM:g} µm and {angle:.1f} degrees"
    return replace(mesh, unit="m", notes=(note,))

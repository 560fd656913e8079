"""STEP files (parts and assemblies), tessellated by OpenCASCADE."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io.readers.raw_mesh import RawMesh, joined, scene_pieces

# STEP is tessellated to this distance from the true surface and angle between neighbours: a facet of a 10 mm
# cylinder then turns a ball by less than the scatter of rough steel does.
STEP_MM, STEP_RAD = 0.01, 0.1
STEP_SECONDS = 1800.0


def read_step(path: Path, content: bytes) -> RawMesh:
    """STEP's solids, tessellated; bodies by their product's name. The file states its unit: metres come out.

    OpenCASCADE works in a process of its own: a damaged file can take its process down.
    """
    import trimesh

    if find_spec("cascadio") is None:
        raise InputError(f"{path}: STEP needs the package cascadio: pip install 'chamberopt[cad]'")
    with tempfile.TemporaryDirectory() as folder:
        step, glb = Path(folder) / "part.step", Path(folder) / "part.glb"
        step.write_bytes(content)
        work = (
            "import sys, cascadio; cascadio.step_to_glb(*sys.argv[1:3], *map(float, sys.argv[3:]))"
        )
        command = [sys.executable, "-c", work, str(step), str(glb), str(STEP_MM), str(STEP_RAD)]
        subprocess.run(command, capture_output=True, timeout=STEP_SECONDS, check=False)
        pieces = scene_pieces(trimesh.load_scene(glb, process=False)) if glb.is_file() else []
    if not pieces:
        raise InputError(
            f"{path}: holds no solid that could be meshed, or is damaged; export it again as AP214 or AP242"
        )
    told = f"STEP: meshed to {1e3 * STEP_MM:g} µm and {np.degrees(STEP_RAD):.1f} degrees"
    return replace(joined(pieces), unit="m", notes=(told,))

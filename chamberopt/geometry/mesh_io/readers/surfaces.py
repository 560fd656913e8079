"""Formats that hold a surface: STL, PLY, 3MF and STEP through trimesh, and OBJ."""

from __future__ import annotations

import io
import re
import subprocess
import sys
import tempfile
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io.readers.element_numbers import Numbering
from chamberopt.geometry.mesh_io.readers.raw_mesh import RawMesh, joined

MOST_COLOURS = 64  # a photograph on the part is no set of names
THREEMF_UNITS = {
    "micron": "um", "millimeter": "mm", "millimeters": "mm", "centimeter": "cm", "inch": "in", "meter": "m",
}  # fmt: skip
# STEP is tessellated to this distance from the true surface and angle between neighbours: a facet of a 10 mm
# cylinder then turns a ball by less than the scatter of rough steel does.
STEP_MM, STEP_RAD = 0.01, 0.1
STEP_SECONDS = 1800.0


def read_stl(path: Path, content: bytes) -> RawMesh:
    """Binary or text; the solids of a text file by their names."""
    return joined(_pieces("stl", _whole_stl(path, content)))


def read_ply(path: Path, content: bytes) -> RawMesh:
    """Text or binary; a triangle painted in one colour, by face or by its three corners, is named "#rrggbb"."""
    import trimesh

    _require_all_lines(path, content)
    mesh: Any = trimesh.load(io.BytesIO(content), file_type="ply", process=False)
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        return RawMesh(np.zeros((0, 3, 3)))
    corners = np.asarray(mesh.vertices, dtype=np.float64)[mesh.faces]
    colours = _colours(mesh)
    if colours is None:
        return RawMesh(corners)
    kinds, of_triangle = np.unique(colours, axis=0, return_inverse=True)
    names = (
        []
        if len(kinds) > MOST_COLOURS
        else ["#" + "".join(f"{int(c):02x}" for c in kind) for kind in kinds]
    )
    groups = {
        name: of_triangle.reshape(-1) == k for k, name in enumerate(names) if kinds[k, 0] >= 0
    }
    return RawMesh(corners, groups)


def _require_all_lines(path: Path, content: bytes) -> None:
    """A text file holds a line for each element its header counts; of one cut short the reader takes what is there."""
    header, end, body = content.partition(b"end_header")
    if not end or not re.search(rb"^format\s+ascii", header, re.MULTILINE):
        return
    said = sum(int(count) for count in re.findall(rb"^element\s+\S+\s+(\d+)", header, re.MULTILINE))
    there = sum(1 for line in body.splitlines() if line.strip())
    if there < said:
        raise InputError(
            f"{path}: truncated: its header counts {said} lines and {there} are there; export it again"
        )


def _colours(mesh: Any) -> np.ndarray | None:
    """Red, green, blue (m, 3) of each triangle, -1 where its corners differ; None without colours."""
    if mesh.visual.kind == "face":
        return np.asarray(mesh.visual.face_colors)[:, :3].astype(np.int64)
    if mesh.visual.kind == "vertex":
        of_corner = np.asarray(mesh.visual.vertex_colors)[:, :3].astype(np.int64)[mesh.faces]
        same = (of_corner == of_corner[:, :1]).all(axis=(1, 2))
        return np.where(same[:, None], of_corner[:, 0], -1)
    return None


def read_3mf(path: Path, content: bytes) -> RawMesh:
    """The objects that the file builds, by name; the file states its unit."""
    import zipfile

    pieces = _pieces("3mf", content)
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        model = next(name for name in archive.namelist() if "3d/3dmodel.model" in name.lower())
        found = re.search(rb'<model[^>]*\bunit\s*=\s*"(\w+)"', archive.read(model))
    stated = found[1].decode().lower() if found else "millimeter"  # the specification's own default
    if stated not in THREEMF_UNITS:
        raise InputError(
            f"{path}: its unit, {stated!r}, is not supported; export it in millimetres"
        )
    return replace(joined(pieces), unit=THREEMF_UNITS[stated])


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
        pieces = _placed(trimesh.load_scene(glb, process=False)) if glb.is_file() else []
    if not pieces:
        raise InputError(
            f"{path}: holds no solid that could be meshed, or is damaged; export it again as AP214 or AP242"
        )
    told = f"STEP: meshed to {1e3 * STEP_MM:g} µm and {np.degrees(STEP_RAD):.1f} degrees"
    return replace(joined(pieces), unit="m", notes=(told,))


def _pieces(kind: str, content: bytes) -> list[tuple[str, np.ndarray]]:
    import trimesh

    return _placed(trimesh.load_scene(io.BytesIO(content), file_type=kind, process=False))


def _placed(scene: Any) -> list[tuple[str, np.ndarray]]:
    """(name, corners (k, 3, 3)) of each mesh in a scene, moved to where the scene puts it."""
    pieces = []
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        mesh = scene.geometry[name]
        if not hasattr(mesh, "faces"):
            continue  # lines and points
        vertices = (
            np.asarray(mesh.vertices, dtype=np.float64) @ transform[:3, :3].T + transform[:3, 3]
        )
        told = str(mesh.metadata.get("name") or node)
        pieces.append(("" if told.startswith("geometry_") else told, vertices[mesh.faces]))
    return pieces


def _whole_stl(path: Path, content: bytes) -> bytes:
    """The STL without what some exporters put behind it. InputError when it is truncated.

    A binary STL says how many triangles it holds, a text one ends with endsolid.
    """
    if is_text_stl(content):
        if not content.rstrip().splitlines()[-1].strip().lower().startswith(b"endsolid"):
            raise InputError(
                f"{path}: truncated, the last line is not 'endsolid'; export or copy it again"
            )
        return content
    declared = int.from_bytes(content[80:84], "little")
    if len(content) < 84 or len(content) < 84 + 50 * declared:
        held = max(0, (len(content) - 84) // 50)
        told = (
            f"it says {declared} triangles and holds {held}"
            if len(content) >= 84
            else "shorter than its header"
        )
        raise InputError(f"{path}: truncated or not an STL: {told}; export or copy it again")
    return content[: 84 + 50 * declared]


def is_text_stl(content: bytes) -> bool:
    """A text STL; binary ones may begin with 'solid' too."""
    return content.lstrip()[:5].lower() == b"solid" and b"facet" in content[:2000].lower()


def read_obj(path: Path, content: bytes) -> RawMesh:
    """Faces of any number of corners, as fans; objects (o), groups (g) and materials (usemtl) give names."""
    points: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    fans: list[int] = []  # triangles of each face
    names: dict[str, tuple[str, ...]] = {}  # by keyword, those in force
    runs: list[tuple[int, tuple[str, ...]]] = []  # from which triangle on, which names
    for number, line in enumerate(content.decode("utf-8", errors="replace").splitlines(), start=1):
        keyword, *words = line.split("#")[0].split() or [""]
        if keyword == "v":
            try:
                points.append([float(word) for word in words[:3]])
            except ValueError:
                raise InputError(
                    f"{path}: line {number}: 'v' with no number; export it again"
                ) from None
        elif keyword == "f":
            try:
                ring = [int(word.split("/")[0]) for word in words]
            except ValueError:
                raise InputError(
                    f"{path}: line {number}: 'f' with no number; export it again"
                ) from None
            ring = [k - 1 if k > 0 else len(points) + k for k in ring]
            if len(ring) < 3 or min(ring) < 0:
                raise InputError(
                    f"{path}: line {number}: a face of {len(ring)} corners that are not there; export again"
                )
            triangles += [(ring[0], ring[k], ring[k + 1]) for k in range(1, len(ring) - 1)]
            fans.append(len(ring) - 2)
        elif keyword in ("o", "g", "usemtl"):
            names[keyword] = tuple(words) if keyword == "g" else (" ".join(words),)
            runs.append(
                (
                    len(triangles),
                    tuple(dict.fromkeys(name for kept in names.values() for name in kept)),
                )
            )
    if triangles and max(map(max, triangles)) >= len(points):
        raise InputError(
            f"{path}: truncated: a face names a vertex that is not there; export or copy it again"
        )
    corners = (
        np.array(points, dtype=np.float64)[np.array(triangles)]
        if triangles
        else np.zeros((0, 3, 3))
    )
    groups: dict[str, np.ndarray] = {}
    ends = [start for start, _ in runs[1:]] + [len(triangles)]
    for (start, told), end in zip(runs, ends, strict=True) if runs else ():
        for name in told if end > start else ():
            groups.setdefault(name, np.zeros(len(triangles), dtype=bool))[start:end] = True
    faces = Numbering(
        np.repeat(np.arange(1, len(fans) + 1), fans), np.zeros(len(triangles), dtype=np.int8)
    )
    return RawMesh(corners, groups, numbering=faces)

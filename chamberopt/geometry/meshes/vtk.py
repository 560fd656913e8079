"""Read VTK files with VTK's own readers: legacy .vtk, XML .vtp and .vtu.

VTK trusts the counts in a file. With wrong counts it may end the process, or fill the memory.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.limits import MAX_ELEMENTS
from chamberopt.geometry.meshes.elements import Block, ElementMesh, extract_surface
from chamberopt.geometry.meshes.native_reader import NativeReader, read_in_child
from chamberopt.geometry.meshes.raw_mesh import RawMesh

# VTK's numbers of cell types, https://vtk.org/doc/nightly/html/vtkCellType_8h.html
KINDS = {
    5: "triangle", 22: "triangle", 34: "triangle", 9: "quad", 23: "quad", 28: "quad",
    10: "tetra", 24: "tetra", 14: "pyramid", 27: "pyramid", 37: "pyramid",
    13: "wedge", 26: "wedge", 32: "wedge",
    12: "hexahedron", 25: "hexahedron", 29: "hexahedron", 33: "hexahedron",
}  # fmt: skip
TRIANGLE, POLYGON, QUAD = 5, 7, 9
WITHOUT_SURFACE = (0, 1, 2, 3, 4, 21, 35)  # points and lines
# An integer cell field with more values numbers the cells and does not name groups.
MAX_GROUPS = 64
MAX_COMPONENTS = 1000  # of an array
FIELD = "field "  # before the names of cell fields among the arrays
FAULT = "cannot be read as VTK, it is damaged or truncated; export it again"


def read_vtk(path: Path, content: bytes) -> RawMesh:
    """Read the surface of a VTK file.

    Integer cell data give groups: the cells where the field NAME is 3 are the group "NAME 3".
    """
    legacy = re.search(rb"^DATASET\s+(\w+)", content[:4096], re.M | re.I)
    xml = re.search(rb'<VTKFile[^>]*\btype\s*=\s*"(\w+)"', content[:4096])
    found = legacy or xml
    holds = found[1].decode().upper().replace("_", "") if found else "nothing that is known"
    if holds not in ("POLYDATA", "UNSTRUCTUREDGRID"):
        raise InputError(f"{path}: holds {holds}; save a PolyData or an UnstructuredGrid")
    if xml:
        _require_counts(path, content)
    is_poly_data = holds == "POLYDATA"
    reader = ("vtkXML" if xml else "vtk") + ("PolyData" if is_poly_data else "UnstructuredGrid")
    data = read_in_child(READER, path, content, f"{reader}Reader")
    if data["strips"]:
        raise InputError(f"{path}: triangle strips are not supported; save plain triangles")
    before, offsets, nodes, types = (data[k] for k in ("before", "offsets", "nodes", "types"))
    sizes = np.diff(offsets)
    mesh = ElementMesh(data["points"], [], own=False)
    numbers = []
    for kind, size in np.unique(np.stack([types, sizes], axis=1), axis=0).tolist():
        rows = np.flatnonzero((types == kind) & (sizes == size))
        if kind in WITHOUT_SURFACE:
            continue
        if kind not in KINDS:
            cell = f"cell {before + rows[0] + 1} is of VTK's type {kind} with {size} corners"
            raise InputError(f"{path}: {cell}, which is not supported; make triangles of it")
        columns = offsets[rows][:, None] + np.arange(size)
        mesh.blocks.append(Block(KINDS[kind], nodes[columns].astype(np.int64)))
        numbers.append(before + rows)
    if numbers:
        cell_of = np.concatenate(numbers)
        mesh.numbers = cell_of + 1
        fields = {k.removeprefix(FIELD): v for k, v in data.items() if k.startswith(FIELD)}
        mesh.element_sets = _groups_of_fields(fields, cell_of)
    return extract_surface(mesh)


def _require_counts(path: Path, content: bytes) -> None:
    """Raise InputError for an XML count that is no number, or so large that VTK would hang."""
    for name, text in re.findall(rb"""\b(NumberOf\w+)\s*=\s*["']([^"']*)""", content):
        most = MAX_COMPONENTS if name == b"NumberOfComponents" else MAX_ELEMENTS
        if not text.strip().isdigit() or int(text) > most:
            found = f"{name.decode()} is {text[:40].decode(errors='replace')!r}"
            expected = f"expected a whole number up to {most}"
            raise InputError(f"{path}: {found}, {expected}; it is damaged, export it again")


def unpack(given: Path, reader_name: str) -> dict[str, Any]:
    """Return the points, cells and cell fields of a VTK file, as arrays by name.

    Raises InputError if VTK reports an error or a warning.

    Args:
        reader_name: name of VTK's class that reads the file.
    """
    from vtkmodules import vtkIOLegacy, vtkIOXML
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkLogger

    reader: Any = getattr(vtkIOXML if "XML" in reader_name else vtkIOLegacy, reader_name)()
    reader.SetFileName(str(given))
    troubles: list[str] = []
    for source in (reader, getattr(reader, "GetXMLParser", lambda: None)()):
        if source is not None:
            source.AddObserver("ErrorEvent", lambda *_: troubles.append("error"))
            source.AddObserver("WarningEvent", lambda *_: troubles.append("warning"))
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)  # VTK's messages do not help users
    reader.Update()
    if troubles or reader.GetErrorCode():
        raise InputError(FAULT)
    data = reader.GetOutputDataObject(0)
    is_poly_data = "PolyData" in reader_name
    before = data.GetNumberOfVerts() + data.GetNumberOfLines() if is_poly_data else 0
    cells = data.GetPolys() if is_poly_data else data.GetCells()
    offsets = vtk_to_numpy(cells.GetOffsetsArray())
    sizes = np.diff(offsets)
    if is_poly_data:
        types = np.select([sizes == 3, sizes == 4], [TRIANGLE, QUAD], POLYGON)
    else:
        types = vtk_to_numpy(data.GetCellTypes()) if len(sizes) else sizes
    points = vtk_to_numpy(data.GetPoints().GetData()) if data.GetPoints() else np.zeros((0, 3))
    fields = {}
    for k in range(data.GetCellData().GetNumberOfArrays()):
        array = data.GetCellData().GetArray(k)
        # text and vector fields give no groups
        if array is not None and array.GetNumberOfComponents() == 1:
            fields[f"{FIELD}{array.GetName()}"] = vtk_to_numpy(array)
    return {
        "points": points.astype(np.float64),
        "nodes": vtk_to_numpy(cells.GetConnectivityArray()),
        "offsets": offsets,
        "types": types,
        "before": before,
        "strips": data.GetNumberOfStrips() if is_poly_data else 0,
        **fields,
    }


READER = NativeReader(unpack, "part.vtk", FAULT, seconds_per_mb=10.0)


def _groups_of_fields(fields: dict[str, np.ndarray], cells: np.ndarray) -> dict[str, np.ndarray]:
    """Return a set of elements for each value of each integer cell field, by field and value.

    Args:
        fields: values of each field in all cells of the file.
        cells: cell of each element, (e,).
    """
    groups: dict[str, np.ndarray] = {}
    for name, field in fields.items():
        values = field[cells]
        distinct = np.unique(values) if np.issubdtype(values.dtype, np.integer) else ()
        if 0 < len(distinct) <= MAX_GROUPS:
            groups |= {f"{name} {n}": np.flatnonzero(values == n) for n in distinct}
    return groups

"""Read VTK files with VTK's own readers: legacy .vtk, XML .vtp and .vtu."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io.readers.elements import Block, ElementMesh, extract_surface
from chamberopt.geometry.mesh_io.readers.raw_mesh import RawMesh

# VTK's numbers of cell types, https://vtk.org/doc/nightly/html/vtkCellType_8h.html
KINDS = {
    5: "triangle", 22: "triangle", 34: "triangle", 9: "quad", 23: "quad", 28: "quad",
    10: "tetra", 24: "tetra", 14: "pyramid", 27: "pyramid", 37: "pyramid",
    13: "wedge", 26: "wedge", 32: "wedge",
    12: "hexahedron", 25: "hexahedron", 29: "hexahedron", 33: "hexahedron",
}  # fmt: skip
TRIANGLE, POLYGON, QUAD = 5, 7, 9
WITHOUT_SURFACE = (0, 1, 2, 3, 4, 21, 35)  # points and lines
# An integer cell field with more values than this numbers the cells rather than naming groups.
MAX_GROUPS = 64


def read_vtk(path: Path, content: bytes) -> RawMesh:
    """Read the surface in a VTK file; integer cell data give groups: "FIELD 3" where FIELD is 3."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonDataModel import vtkPolyData

    data = _read_data(path, content)
    if not data.GetNumberOfPoints() or not data.GetNumberOfCells():
        return RawMesh(np.zeros((0, 3, 3)))
    is_poly_data = isinstance(data, vtkPolyData)
    if is_poly_data and data.GetNumberOfStrips():
        raise InputError(f"{path}: triangle strips are not supported; save plain triangles")
    before = data.GetNumberOfVerts() + data.GetNumberOfLines() if is_poly_data else 0
    cells = data.GetPolys() if is_poly_data else data.GetCells()
    offsets = vtk_to_numpy(cells.GetOffsetsArray())
    nodes = vtk_to_numpy(cells.GetConnectivityArray())
    sizes = np.diff(offsets)
    if is_poly_data:
        types = np.select([sizes == 3, sizes == 4], [TRIANGLE, QUAD], POLYGON)
    else:
        types = vtk_to_numpy(data.GetCellTypes())
    points = vtk_to_numpy(data.GetPoints().GetData()).astype(np.float64)
    mesh = ElementMesh(points, [], own=False)
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
        mesh.element_sets = _groups_of_fields(data.GetCellData(), cell_of)
    return extract_surface(mesh)


def _read_data(path: Path, content: bytes) -> Any:
    """VTK's data object; InputError for what VTK only reports, to continue with less."""
    from vtkmodules.vtkCommonCore import vtkLogger
    from vtkmodules.vtkIOLegacy import vtkPolyDataReader, vtkUnstructuredGridReader
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader, vtkXMLUnstructuredGridReader

    legacy = re.search(rb"^DATASET\s+(\w+)", content[:4096], re.M | re.I)
    xml = re.search(rb'<VTKFile[^>]*\btype\s*=\s*"(\w+)"', content[:4096])
    found = legacy or xml
    holds = found[1].decode().upper().replace("_", "") if found else "nothing that is known"
    if holds not in ("POLYDATA", "UNSTRUCTUREDGRID"):
        raise InputError(f"{path}: holds {holds}; save a PolyData or an UnstructuredGrid")
    poly = holds == "POLYDATA"
    reader: Any
    if xml:
        reader = vtkXMLPolyDataReader() if poly else vtkXMLUnstructuredGridReader()
        reader.SetFileName(str(path))
    else:
        reader = vtkPolyDataReader() if poly else vtkUnstructuredGridReader()
        reader.ReadFromInputStringOn()
        reader.SetBinaryInputString(content, len(content))
    troubles: list[str] = []
    for source in (reader, getattr(reader, "GetXMLParser", lambda: None)()):
        if source is not None:
            source.AddObserver("ErrorEvent", lambda *_: troubles.append("error"))
            source.AddObserver("WarningEvent", lambda *_: troubles.append("warning"))
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)  # VTK's messages do not help users
    try:
        reader.Update()
    finally:
        vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_WARNING)
    if troubles or reader.GetErrorCode():
        why = "cannot be read as VTK, it is damaged or truncated"
        raise InputError(f"{path}: {why}; export it again")
    return reader.GetOutputDataObject(0)


def _groups_of_fields(fields: Any, cells: np.ndarray) -> dict[str, np.ndarray]:
    """Sets of elements by the values of integer fields of their cells (e,)."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    groups: dict[str, np.ndarray] = {}
    for k in range(fields.GetNumberOfArrays()):
        array = fields.GetArray(k)
        if array is None or array.GetNumberOfComponents() != 1:
            continue  # texts and vectors
        values = vtk_to_numpy(array)[cells]
        distinct = np.unique(values) if np.issubdtype(values.dtype, np.integer) else ()
        if 0 < len(distinct) <= MAX_GROUPS:
            groups |= {f"{array.GetName()} {n}": np.flatnonzero(values == n) for n in distinct}
    return groups

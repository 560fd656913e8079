"""VTK files through VTK's own readers: legacy .vtk, XML .vtp and .vtu."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io.readers.elements import Block, Elements, surface_of
from chamberopt.geometry.mesh_io.readers.raw_mesh import RawMesh

# VTK's numbers of cell types, https://vtk.org/doc/nightly/html/vtkCellType_8h.html
KINDS = {
    5: "triangle", 22: "triangle", 34: "triangle", 9: "quad", 23: "quad", 28: "quad", 10: "tetra", 24: "tetra",
    14: "pyramid", 27: "pyramid", 37: "pyramid", 13: "wedge", 26: "wedge", 32: "wedge",
    12: "hexahedron", 25: "hexahedron", 29: "hexahedron", 33: "hexahedron",
}  # fmt: skip
WITHOUT_SURFACE = (0, 1, 2, 3, 4, 21, 35)  # points and lines
MOST_NAMES = (
    64  # an integer cell field with more values than this numbers the cells rather than naming them
)


def read_vtk(path: Path, content: bytes) -> RawMesh:
    """VTK's legacy .vtk and XML .vtp, .vtu; whole-number cell data give names: "FIELD 3" where FIELD is 3."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonDataModel import vtkPolyData

    data = _vtk_data(path, content)
    if not data.GetNumberOfPoints() or not data.GetNumberOfCells():
        return RawMesh(np.zeros((0, 3, 3)))
    before = 0  # cells that come before those of the array
    if isinstance(data, vtkPolyData):
        if data.GetNumberOfStrips():
            raise InputError(f"{path}: triangle strips are not supported; save plain triangles")
        before, array = data.GetNumberOfVerts() + data.GetNumberOfLines(), data.GetPolys()
    else:
        array = data.GetCells()
    offsets, nodes = (
        vtk_to_numpy(array.GetOffsetsArray()),
        vtk_to_numpy(array.GetConnectivityArray()),
    )
    sizes = np.diff(offsets)
    if isinstance(data, vtkPolyData):
        types = np.select([sizes == 3, sizes == 4], [5, 9], 7)
    else:
        types = vtk_to_numpy(data.GetCellTypes())
    made = Elements(vtk_to_numpy(data.GetPoints().GetData()).astype(np.float64), [], own=False)
    cells = []
    for kind, size in np.unique(np.stack([types, sizes], axis=1), axis=0).tolist():
        rows = np.flatnonzero((types == kind) & (sizes == size))
        if kind in WITHOUT_SURFACE:
            continue
        if kind not in KINDS:
            told = f"cell {before + rows[0] + 1} is of VTK's type {kind} with {size} corners"
            raise InputError(f"{path}: {told}, which is not supported; make triangles of it")
        made.blocks.append(
            Block(KINDS[kind], nodes[offsets[rows][:, None] + np.arange(size)].astype(np.int64))
        )
        cells.append(before + rows)
    if cells:
        made.numbers = np.concatenate(cells) + 1
        made.element_sets = _named_by_fields(data.GetCellData(), np.concatenate(cells))
    return surface_of(made)


def _vtk_data(path: Path, content: bytes) -> Any:
    """VTK's data object; what VTK reports as an error is an InputError, since it would go on with less."""
    from vtkmodules.vtkCommonCore import vtkLogger
    from vtkmodules.vtkIOLegacy import vtkPolyDataReader, vtkUnstructuredGridReader
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader, vtkXMLUnstructuredGridReader

    legacy = re.search(rb"^DATASET\s+(\w+)", content[:4096], re.M | re.I)
    xml = re.search(rb'<VTKFile[^>]*\btype\s*=\s*"(\w+)"', content[:4096])
    found = legacy or xml
    holds = found[1].decode().upper().replace("_", "") if found else "nothing that is known"
    if holds not in ("POLYDATA", "UNSTRUCTUREDGRID"):
        raise InputError(f"{path}: holds {holds}; save a PolyData or an UnstructuredGrid")
    if xml:
        reader: Any = (
            vtkXMLPolyDataReader() if holds == "POLYDATA" else vtkXMLUnstructuredGridReader()
        )
        reader.SetFileName(str(path))
    else:
        reader = vtkPolyDataReader() if holds == "POLYDATA" else vtkUnstructuredGridReader()
        reader.ReadFromInputStringOn()
        reader.SetBinaryInputString(content, len(content))
    troubles: list[str] = []
    for source in (reader, getattr(reader, "GetXMLParser", lambda: None)()):
        if source is not None:
            source.AddObserver("ErrorEvent", lambda *_: troubles.append("error"))
            source.AddObserver("WarningEvent", lambda *_: troubles.append("warning"))
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)  # in words nobody can act on
    try:
        reader.Update()
    finally:
        vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_WARNING)
    if troubles or reader.GetErrorCode():
        raise InputError(
            f"{path}: cannot be read as VTK, it is damaged or truncated; export it again"
        )
    return reader.GetOutputDataObject(0)


def _named_by_fields(fields: Any, cells: np.ndarray) -> dict[str, np.ndarray]:
    """Sets of elements by the whole-number cell fields; cells: which cell each element is."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    named: dict[str, np.ndarray] = {}
    for k in range(fields.GetNumberOfArrays()):
        array = fields.GetArray(k)
        if array is None or array.GetNumberOfComponents() != 1:
            continue  # texts and vectors
        values = vtk_to_numpy(array)[cells]
        kinds = np.unique(values) if np.issubdtype(values.dtype, np.integer) else ()
        if 0 < len(kinds) <= MOST_NAMES:
            named |= {f"{array.GetName()} {kind}": np.flatnonzero(values == kind) for kind in kinds}
    return named

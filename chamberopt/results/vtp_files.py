"""Write and read the surfaces of a results folder, which also open in ParaView.

part.vtp: the part in its own triangles, with a value for each triangle.
coverage.vtp: the same surface in triangles that suit the field, with a value for each corner.
chamber.vtp: the closed cavity.
"""

from __future__ import annotations

import base64
import binascii
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.files import new_file, write_bytes
from chamberopt.common.limits import (
    ANY_SHRINKAGE_BYTES,
    MAX_ELEMENTS,
    MAX_MESH_BYTES,
    MAX_NUMBER,
    MAX_SHRINKAGE,
    read_limited,
)

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.coverage.field.display_mesh import DisplayField

# Reader of the .vtp files that this module writes. It does not use VTK, because a damaged or forged
# file can make VTK end the process.
#
#     <VTKFile><PolyData><Piece NumberOfPoints="n" NumberOfPolys="m"> PointData, CellData, Points,
#     Polys with connectivity and offsets, each of them with DataArrays in base64:
#     [number of blocks, bytes of a block, bytes of the last one, packed bytes of each], blocks
#
# The header is encoded on its own, and so are all blocks together. The sizes that a file states are
# compared with its content before memory is allocated.
#
# Source: VTK file formats, https://docs.vtk.org/en/latest/vtk_file_formats, XML file formats.

TYPES = {
    "Float32": "<f4", "Float64": "<f8", "UInt8": "<u1", "Int8": "<i1", "Int32": "<i4",
    "Int64": "<i8",
}  # fmt: skip
HEADER = np.dtype("<u4")
MAX_COORDINATE = 1e7  # mm, positive or negative; every part and chamber is smaller
NORMALS = "Normals"


class DamagedSurfaceError(ValueError):
    """A file that this module did not write, or that was damaged. The message says why."""


@dataclass(frozen=True)
class SurfaceArrays:
    """The arrays of a surface of triangles, read from a .vtp file and checked.

    points: corners of the triangles [mm], finite, shape (n, 3), float32 or float64.
    triangles: numbers of the corners, 0 to n - 1, shape (m, 3).
    cells, vertices: columns by name, shape (m,) and (n,). Unknown values are NaN.
    normals: normals at the points, shape (n, 3), or None.
    """

    points: np.ndarray
    triangles: np.ndarray
    cells: dict[str, np.ndarray]
    vertices: dict[str, np.ndarray]
    normals: np.ndarray | None


def read_arrays(path: Path) -> SurfaceArrays:
    """Return the arrays of a .vtp file that this module wrote, checked.

    Raises:
        DamagedSurfaceError: the file is no .vtp file, or was altered.
        InputError: the file cannot be read, or is too large.
    """
    content = read_limited(path, MAX_MESH_BYTES, "surface of a result")
    try:
        if b"<!" in content:  # a few lines of XML entities can expand to gigabytes
            raise DamagedSurfaceError("it declares a document type")
        piece = ElementTree.fromstring(content).find("./PolyData/Piece")
        if piece is None:
            raise DamagedSurfaceError("it holds no surface")
        return _surface(piece, most=max(ANY_SHRINKAGE_BYTES, MAX_SHRINKAGE * len(content)))
    except ElementTree.ParseError as error:
        raise DamagedSurfaceError(str(error)) from None


def _surface(piece: ElementTree.Element, most: int) -> SurfaceArrays:
    """Return the checked surface of a Piece element of a .vtp file.

    Points and triangles together may take `most` bytes.
    """
    count, faces = _count(piece, "NumberOfPoints"), _count(piece, "NumberOfPolys")
    if not count or not faces:
        raise DamagedSurfaceError("no triangles could be read")
    if 24 * (count + faces) > most:
        raise DamagedSurfaceError(f"it is far too short for {count} points and {faces} triangles")
    points = _columns(piece, "Points", count)
    polygons = _columns(piece, "Polys", 3 * faces, {"offsets": faces})
    cells, vertices = _columns(piece, "CellData", faces), _columns(piece, "PointData", count)
    normals = vertices.pop(NORMALS, None)
    for name, column in (("Points", points.get("Points")), (NORMALS, normals)):
        if column is not None and (column.shape != (count, 3) or column.dtype.kind != "f"):
            raise DamagedSurfaceError(f"{name} are not three numbers each")
        if column is not None and not (np.abs(column) <= MAX_COORDINATE).all():
            raise DamagedSurfaceError(f"{name} are not finite, or too large")
    if "Points" not in points or not {"connectivity", "offsets"} <= polygons.keys():
        raise DamagedSurfaceError("it has no points or no triangles")
    corners, offsets = polygons["connectivity"], polygons["offsets"]
    if not all(one.ndim == 1 and one.dtype.kind == "i" for one in (corners, offsets)):
        raise DamagedSurfaceError("its triangles are no whole numbers")
    if not np.array_equal(offsets, 3 * np.arange(1, faces + 1)):
        raise DamagedSurfaceError("not all of its faces are triangles")
    if corners.min() < 0 or corners.max() >= count:
        raise DamagedSurfaceError("a triangle has a corner that there is not")
    for name, column in (cells | vertices).items():
        if column.ndim != 1:
            raise DamagedSurfaceError(f"{name} has {column.shape[1]} numbers for each place")
        if not ((np.abs(column) <= MAX_NUMBER) | np.isnan(column)).all():
            raise DamagedSurfaceError(f"{name} has a number that is infinite or too large")
    return SurfaceArrays(points["Points"], corners.reshape(-1, 3), cells, vertices, normals)


def _count(piece: ElementTree.Element, name: str) -> int:
    text = piece.get(name, "")
    if not text.isascii() or not text.isdigit() or len(text) > 9 or int(text) > 3 * MAX_ELEMENTS:
        raise DamagedSurfaceError(f"{name} is {text[:20]!r}, from 0 to {3 * MAX_ELEMENTS} are read")
    return int(text)


def _columns(
    piece: ElementTree.Element, place: str, rows: int, others: dict[str, int] | None = None
) -> dict[str, np.ndarray]:
    """Return the arrays inside the XML element `place` by name, each with `rows` rows.

    `others` gives the number of rows of the arrays that have another number.
    """
    found: dict[str, np.ndarray] = {}
    for one in piece.iterfind(f"./{place}/DataArray"):
        name = one.get("Name", "")
        if name in found:
            raise DamagedSurfaceError(f"it has {name[:40]!r} twice")
        found[name] = _array(one, (others or {}).get(name, rows))
    return found


def _array(element: ElementTree.Element, rows: int) -> np.ndarray:
    """Return the numbers of a DataArray element, shape (rows,) or (rows, components)."""
    name, parts = element.get("Name", "")[:40], element.get("NumberOfComponents", "1")
    kind = TYPES.get(element.get("type", ""))
    if kind is None or parts not in "123456789" or element.get("format") != "binary":
        raise DamagedSurfaceError(f"{name} is of another kind than is written here")
    size = rows * int(parts) * np.dtype(kind).itemsize
    values = np.frombuffer(_unpacked(element.text or "", name, size), kind)
    return values if parts == "1" else values.reshape(rows, int(parts))


def _unpacked(text: str, name: str, size: int) -> bytes:
    """Return the bytes of the array `name`, decoded from base64 and unpacked.

    Raises DamagedSurfaceError unless there are `size` bytes.
    """
    packed = "".join(text.split())
    try:
        count = int(np.frombuffer(base64.b64decode(packed[:8])[:4], HEADER)[0])
        letters = 4 * -(-(3 + count) * HEADER.itemsize // 3) if count else 16
        header = np.frombuffer(base64.b64decode(packed[:letters]), HEADER, 3 + count)
        content = base64.b64decode(packed[letters:], validate=True)
    except (binascii.Error, ValueError, IndexError):
        raise DamagedSurfaceError(f"{name} is not written as packed numbers") from None
    _, full, last, *lengths = header.tolist()
    sizes = [full] * count
    if count and last:
        sizes[-1] = last
    if sum(sizes) != size or sum(lengths) != len(content):
        raise DamagedSurfaceError(f"{name} has {sum(sizes)} bytes, expected {size}")
    found, at = [], 0
    for expected, length in zip(sizes, lengths, strict=True):
        unpacking = zlib.decompressobj()
        try:
            block = unpacking.decompress(content[at : at + length], expected + 1)
        except zlib.error as error:
            raise DamagedSurfaceError(f"{name} cannot be unpacked ({error})") from None
        if len(block) != expected or not unpacking.eof:
            raise DamagedSurfaceError(f"{name} unpacks to another size than it says")
        found.append(block)
        at += length
    return b"".join(found)


PART, COVERAGE, CHAMBER = "part.vtp", "coverage.vtp", "chamber.vtp"
# Names of cell data in coverage.vtp, and names of the same columns in part.vtp.
OF_ELEMENT = {
    "element": "element",
    "target": "target",
    "element_coverage": "coverage",
    "element_interval": "coverage_interval",
    "element_impacts": "impacts",
}
ZONE = "zone"  # a column of both files, in results with zones
# Required columns: cell data of part.vtp and point data of coverage.vtp.
ELEMENT_COLUMNS = ("coverage", "impacts", "dents", "exposed_area_mm2", "target", "element")
FIELD_COLUMNS = ("coverage", "dent_density", "coverage_interval", "reachable", "resolved")
WHOLE_NUMBERS = ("impacts", "dents", "target", "element", "triangle", "element_impacts", "tag",
                 "source", "fitting", ZONE)  # fmt: skip
# Columns with shares from 0 to 1, and columns without negative numbers.
SHARES = ("coverage", "coverage_interval", "reachable", "resolved", "element_coverage",
          "element_interval")  # fmt: skip
NOT_NEGATIVE = ("impacts", "dents", "target", "triangle", "element_impacts", "tag", "dent_density",
                "exposed_area_mm2", "reachable_area_mm2", "impacts_per_mm2", "energy_per_mm2",
                "mean_normal_speed", "p90_normal_speed", "mean_angle_deg",
                "mean_dent_um")  # fmt: skip
ROUNDING = 1e-6  # of single precision
MM = 1e3

Surface = Any
"""A pyvista.PolyData. It is Any, because pyvista's annotations do not fit numpy's."""


def pyvista() -> Any:
    """Import pyvista and return the module.

    It is imported only when it is used, because this takes half a second.
    """
    import pyvista

    return pyvista


def write_coverage(
    folder: Path, chamber: Chamber, values: dict[str, np.ndarray], display: DisplayField
) -> None:
    """Write the part, posed in the chamber [mm], as part.vtp and as coverage.vtp.

    Args:
        values: cell data of part.vtp: columns by name, shape (m,), with a value for each triangle.
        display: point data of coverage.vtp: fields at the vertices of a mesh to draw. Each
            triangle of this mesh lies in a triangle of the part. The cell data of coverage.vtp are
            the number of the part's triangle (triangle) and its values in the columns OF_ELEMENT,
            with zones also ZONE.
    """
    part, mesh = chamber.part, display.mesh
    _write_surface(folder / PART, part.vertices, part.triangles, values)
    columns = OF_ELEMENT | ({ZONE: ZONE} if ZONE in values else {})
    own = {name: values[column][mesh.part_triangle] for name, column in columns.items()}
    _write_surface(
        folder / COVERAGE,
        mesh.vertices,
        mesh.triangles,
        {"triangle": mesh.part_triangle, **own},
        {name: column.astype(np.float32) for name, column in display.fields.items()},
        mesh.normal,
    )


def write_chamber(folder: Path, chamber: Chamber) -> None:
    """Write the closed cavity [mm] as chamber.stl for CAD and as chamber.vtp with cell data.

    tag: 0 part, 1 sonotrode, 2 wall, 3 and more further sonotrodes.
    source: triangle of the part, -1 elsewhere.
    fitting: number of the hole or deflector, -1 elsewhere. Only chambers with fittings have it.
    """
    fields = {"tag": chamber.tags, "source": chamber.source}
    if chamber.fitting is not None:
        fields["fitting"] = chamber.fitting
    _write_surface(folder / CHAMBER, chamber.vertices, chamber.triangles, fields)
    write_stl(folder / "chamber.stl", chamber.vertices * MM, chamber.triangles)


def _write_surface(
    path: Path,
    vertices: np.ndarray,
    triangles: np.ndarray,
    cells: dict[str, np.ndarray],
    points: dict[str, np.ndarray] | None = None,
    normal: np.ndarray | None = None,
) -> None:
    surface = pyvista().PolyData.from_regular_faces(vertices * MM, triangles)
    surface.cell_data.update(cells)
    surface.point_data.update(points or {})
    if normal is not None:
        surface.point_data.active_normals = normal.astype(np.float32)
    save_surface(path, surface)


def save_surface(path: Path, surface: Surface) -> None:
    """Write a surface as .vtp or .vtkhdf, whole or not at all.

    On a full disk VTK's writer of .vtp ends the process, and its writer of .vtkhdf leaves a
    damaged file. A .vtp file is therefore written into memory first. For a .vtkhdf file, room on
    the disk is reserved first.
    """
    if path.suffix.lower() == ".vtp":
        writer = pyvista()._vtk.vtkXMLPolyDataWriter()
        writer.SetInputData(surface)
        writer.SetDataModeToBinary()
        writer.WriteToOutputStringOn()
        writer.Write()
        write_bytes(path, writer.GetOutputString().encode())
        return
    with new_file(path) as file:
        file.write(bytes(1024 * (surface.actual_memory_size + 1024)))
        file.flush()
        surface.save(file.name)


def write_stl(path: Path, vertices: np.ndarray, triangles: np.ndarray) -> None:
    """Write a mesh of triangles as a binary STL file."""
    from trimesh import Trimesh

    content: Any = Trimesh(vertices, triangles, process=False).export(file_type="stl")
    write_bytes(path, content)


def read_surface(path: Path, cells: Sequence[str] = (), points: Sequence[str] = ()) -> Surface:
    """Return a surface of a results folder, read from its .vtp file.

    Args:
        cells: names of the columns that must be there with a value for each triangle.
        points: names of the columns that must be there with a value for each point.

    Raises:
        InputError: the file is missing or damaged, or lacks a column.
    """
    if not path.is_file():
        raise InputError(
            f"{path}: not there; give a results folder that simulate or run has finished"
        )
    try:
        found = read_arrays(path)
        for column in (*found.cells.items(), *found.vertices.items()):
            _require_sound(*column)
    except DamagedSurfaceError as error:
        raise InputError(f"{path}: damaged ({error}); simulate again") from None
    for names, there in ((cells, found.cells), (points, found.vertices)):
        if missing := [name for name in names if name not in there]:
            raise InputError(
                f"{path}: has no {missing[0]}, so it is not the file that was written here; "
                "simulate again"
            )
    surface = pyvista().PolyData.from_regular_faces(found.points.copy(), found.triangles)
    surface.cell_data.update({name: column.copy() for name, column in found.cells.items()})
    surface.point_data.update({name: column.copy() for name, column in found.vertices.items()})
    if found.normals is not None:
        surface.point_data.active_normals = found.normals.copy()
    return surface


def size_text(surface: Surface) -> str:
    """Return the length, width and height of a surface [mm] as text."""
    x, y, z = np.ptp(np.reshape(surface.bounds, (3, 2)), axis=1)
    return f"{x:.4g} × {y:.4g} × {z:.4g} mm"


def _require_sound(name: str, column: np.ndarray) -> None:
    """Raise DamagedSurfaceError for a column with values of a wrong type or range."""
    if name in WHOLE_NUMBERS and column.dtype.kind not in "iu":
        raise DamagedSurfaceError(f"{name} are no whole numbers")
    known = column[~np.isnan(column)] if column.dtype.kind == "f" else column
    if not len(known):
        return
    low, high, is_share = known.min(), known.max(), name in SHARES
    if (low < 0 and (is_share or name in NOT_NEGATIVE)) or (is_share and high > 1.0 + ROUNDING):
        allowed = "0 to 1" if is_share else "0 or more"
        raise DamagedSurfaceError(f"{name} is from {low:g} to {high:g}, allowed: {allowed}")

"""Read the .vtp files that are written here, without VTK, which a damaged or forged file can end.

    <VTKFile><PolyData><Piece NumberOfPoints="n" NumberOfPolys="m"> PointData, CellData, Points,
    Polys with connectivity and offsets, each of them with DataArrays in base64:
    [number of blocks, bytes of a block, bytes of the last one, packed bytes of each], blocks

The header and all blocks together are encoded each on its own. What a file says of its size is
compared with what it holds before memory is taken.

Source: VTK file formats, https://docs.vtk.org/en/latest/vtk_file_formats, XML file formats.
"""

from __future__ import annotations

import base64
import binascii
import zlib
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from chamberopt.common.limits import (
    ANY_SHRINKAGE_BYTES,
    MAX_ELEMENTS,
    MAX_MESH_BYTES,
    MAX_NUMBER,
    MAX_SHRINKAGE,
    read_limited,
)

TYPES = {
    "Float32": "<f4", "Float64": "<f8", "UInt8": "<u1", "Int8": "<i1", "Int32": "<i4",
    "Int64": "<i8",
}  # fmt: skip
HEADER = np.dtype("<u4")
MAX_COORDINATE = 1e7  # mm, either way: no part or chamber is larger
NORMALS = "Normals"


class DamagedSurfaceError(ValueError):
    """A file that is not a surface as it is written here; the message says why."""


@dataclass(frozen=True)
class SurfaceArrays:
    """A surface of triangles, all of it checked.

    points: [mm], finite, shape (n, 3), as float32 or float64.
    triangles: shape (m, 3), from 0 to n - 1.
    cells, vertices: columns by their names, (m,) and (n,) each; NaN where a value is not known.
    normals: at the points, shape (n, 3); None if there are none.
    """

    points: np.ndarray
    triangles: np.ndarray
    cells: dict[str, np.ndarray]
    vertices: dict[str, np.ndarray]
    normals: np.ndarray | None


def read_arrays(path: Path) -> SurfaceArrays:
    """Read a .vtp file.

    Raises:
        DamagedSurfaceError: it is none, or was altered.
        InputError: it cannot be read, or is too large.
    """
    content = read_limited(path, MAX_MESH_BYTES, "surface of a result")
    try:
        if b"<!" in content:  # entities, of which a few lines make gigabytes
            raise DamagedSurfaceError("it declares a document type")
        piece = ElementTree.fromstring(content).find("./PolyData/Piece")
        if piece is None:
            raise DamagedSurfaceError("it holds no surface")
        return _surface(piece, most=max(ANY_SHRINKAGE_BYTES, MAX_SHRINKAGE * len(content)))
    except ElementTree.ParseError as error:
        raise DamagedSurfaceError(str(error)) from None


def _surface(piece: ElementTree.Element, most: int) -> SurfaceArrays:
    """Check and convert; `most`: bytes that points and triangles together may take."""
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
    """Arrays of one element of the file by their names; `others` have another number of rows."""
    found: dict[str, np.ndarray] = {}
    for one in piece.iterfind(f"./{place}/DataArray"):
        name = one.get("Name", "")
        if name in found:
            raise DamagedSurfaceError(f"it has {name[:40]!r} twice")
        found[name] = _array(one, (others or {}).get(name, rows))
    return found


def _array(element: ElementTree.Element, rows: int) -> np.ndarray:
    """One array, shape (rows,) or (rows, components)."""
    name, parts = element.get("Name", "")[:40], element.get("NumberOfComponents", "1")
    kind = TYPES.get(element.get("type", ""))
    if kind is None or parts not in "123456789" or element.get("format") != "binary":
        raise DamagedSurfaceError(f"{name} is of another kind than is written here")
    size = rows * int(parts) * np.dtype(kind).itemsize
    values = np.frombuffer(_unpacked(element.text or "", name, size), kind)
    return values if parts == "1" else values.reshape(rows, int(parts))


def _unpacked(text: str, name: str, size: int) -> bytes:
    """The bytes of an array, of which there must be `size`."""
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

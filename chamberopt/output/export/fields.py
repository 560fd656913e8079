"""A result's fields for other programs: ParaView's formats, or decks in the element numbers of the part's file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from chamberopt.chamber.part import part_meshes
from chamberopt.common.errors import InputError
from chamberopt.common.files import atomic_write, write_text
from chamberopt.geometry.mesh_io import PartMesh
from chamberopt.output.export.abaqus import abaqus_deck
from chamberopt.output.export.elements import (
    COLUMNS,
    ElementFields,
    of_elements,
    of_other_triangles,
)
from chamberopt.output.export.nastran import nastran_deck
from chamberopt.output.results.load import Result, load_coverage, load_result
from chamberopt.output.vtp_files import COVERAGE

DECKS: dict[str, Callable[[list[str], PartMesh, ElementFields], dict[str, str]]] = {
    "abaqus": abaqus_deck,
    "nastran": nastran_deck,
}
FIELD_FORMATS = ("vtp", "vtkhdf", *DECKS)


def write_fields(folder: str | Path, to: str, path: str | Path) -> list[str]:
    """Write the per-triangle fields of a results folder to a file; returns remarks for the user.

    to: "vtp" or "vtkhdf": coverage.vtp's surface, posed in the chamber [mm], with its cell data · "abaqus" or
    "nastran": per element of the part's file, in its numbers, to be included in its deck; where the file numbers no
    elements, the triangles are written along in the file's frame and unit, numbered from 1. Raises InputError for what
    is no result, was made before element numbers were kept, or whose part's file has changed since.
    """
    path = Path(path)
    if to not in FIELD_FORMATS:
        raise InputError(f"fields are not written as {to!r}; use one of {', '.join(FIELD_FORMATS)}")
    if to not in DECKS and path.suffix.lower() != f".{to}":
        raise InputError(
            f"{path}: {to} files are known by their ending; name it {path.with_suffix('.' + to).name}"
        )
    if not path.resolve().parent.is_dir() or path.is_dir():
        raise InputError(
            f"{path}: is no file in a folder that is there; make the folder, or give a file's name"
        )
    result = load_result(folder)
    surface = load_coverage(result)
    if "element" not in surface.cell_data:
        raise InputError(
            f"{result.folder / COVERAGE}: from a version that kept no element numbers; simulate again"
        )
    try:
        if to not in DECKS:
            with atomic_write(path) as temporary:
                surface.save(temporary)
            return []
        return _write_deck(result, surface, to, path)
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written: {error.strerror}; choose another place"
        ) from None


def _write_deck(result: Result, surface: Any, to: str, path: Path) -> list[str]:
    filed, simulated = _meshes(result, surface, path)
    own = filed.numbering.own
    number = np.asarray(surface["element"]) if own else np.arange(1, surface.n_cells + 1)
    fields = of_elements(surface, number)
    remarks = []
    if own and simulated is not filed:
        fields = of_other_triangles(surface, number, filed, simulated)
        said = "the target was simulated in triangles of target.element_mm"
        remarks.append(
            f"{said}: elements get means over those whose middles they hold, and no sums"
        )
    if not own:
        remarks.append(
            f"{result.design.part.mesh_path.name} has no element numbers that stand for one element each: its "
            f"triangles are written along, in {simulated.unit}, numbered from 1"
        )
    new = int((number == 0).sum())
    if new:
        remarks.append(
            f"left out {new} triangles that are in no element of the file: they close its holes"
        )
    remarks += _left_out(fields)
    about = [*_about(result), *(f"{name.upper()}: {COLUMNS[name][0]}" for name in fields.columns)]
    for suffix, text in DECKS[to](about, simulated, fields).items():
        file = path.with_stem(path.stem + suffix) if suffix else path
        write_text(file, text)
        if suffix:
            remarks.append(
                f"{file.name}: sets of elements by coverage, to be included inside the deck's *Assembly"
            )
    return remarks


def _left_out(fields: ElementFields) -> list[str]:
    names: dict[int, list[str]] = {}
    for name, values in fields.columns.items():
        names.setdefault(int(np.isnan(values).sum()), []).append(name)
    return [
        f"left out {without} of {len(fields.numbers)} elements, not exposed or never hit: {', '.join(columns)}"
        for without, columns in names.items()
        if without
    ]


def _meshes(result: Result, surface: Any, path: Path) -> tuple[PartMesh, PartMesh]:
    """The part as its file has it, and as it was simulated. InputError where the file is another one by now."""
    file = result.design.part.mesh_path
    if path.resolve() == file.resolve():
        raise InputError(f"{path}: is the part's own file; choose another name")
    filed, simulated = part_meshes(result.design)
    if filed.sha256 != result.part_sha256 or len(simulated.triangles) != surface.n_cells:
        raise InputError(
            f"{file}: is not the file any more that {result.folder} was made with, its elements may be others; put "
            "that file back, or simulate again"
        )
    return filed, simulated


def _about(result: Result) -> list[str]:
    """Where the numbers come from, for a deck's first lines."""
    design, version = result.design, result.data["versions"]["chamberopt"]
    return [
        f"chamberopt {version}: what a simulated ultrasonic shot peening gave each element",
        f"part file {design.part.mesh_path.name}, sha256 {result.part_sha256}",
        f"treatment time {design.process.treatment_time:g} s, seed {result.seeds[0]}",
    ]

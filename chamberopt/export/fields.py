"""Write the values on a result's part for ParaView, Abaqus or Nastran."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.files import check_new_file, require_place, write_new_texts
from chamberopt.export.decks import abaqus_deck, nastran_deck
from chamberopt.export.element_fields import (
    ElementFields,
    combination_of,
    fields_of_elements,
    fields_of_remeshed_elements,
)
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.results.arrays_file import ResultArrays, load_result_arrays
from chamberopt.results.load import Result, load_result
from chamberopt.results.vtp_files import save_surface

DECKS: dict[str, Callable[[list[str], PartMesh, ElementFields], dict[str, str]]] = {
    "abaqus": abaqus_deck,
    "nastran": nastran_deck,
}
FIELD_FORMATS = ("vtp", "vtkhdf", *DECKS)


def write_fields(folder: str | Path, path: str | Path, to: str) -> list[str]:
    """Write values on a result's part, such as coverage, to a file; return remarks for the user.

    Args:
        folder: the results folder.
        path: the file to write; it is replaced.
        to: "vtp" or "vtkhdf" writes the part's triangles, posed in the chamber [mm], with their
            values. "abaqus" or "nastran" writes values by the element numbers of the part's file,
            to be included in its deck. If the file numbers no elements, the triangles are written
            too, in the file's frame and unit, numbered from 1.
    Raises:
        InputError: the folder is not a result, or its files have changed since.
    """
    path = Path(path)
    if to not in FIELD_FORMATS:
        raise InputError(f"fields are not written as {to!r}; use one of {', '.join(FIELD_FORMATS)}")
    if to not in DECKS and path.suffix.lower() != f".{to}":
        raise InputError(
            f"{path}: {to} files need their ending; name it {path.with_suffix('.' + to).name}"
        )
    require_place(path)
    result = load_result(folder)
    arrays = load_result_arrays(result)
    if to not in DECKS:
        save_surface(path, arrays.part)
        return []
    return _write_deck(result, arrays, to, path)


def _write_deck(result: Result, arrays: ResultArrays, to: str, path: Path) -> list[str]:
    if path.resolve() == result.design.part.mesh_path:
        raise InputError(f"{path}: is the part's own file; choose another name")
    part, values = arrays.chamber.part.file, arrays.elements
    assert part is not None  # read_result_arrays refuses a result without it
    simulated, original = part.simulated, part.original
    own = (original or simulated).numbering.own
    number = values["element"] if own else np.arange(1, len(values["element"]) + 1)
    fields = fields_of_elements(values, number)
    remarks = []
    if own and original is not None:
        fields = fields_of_remeshed_elements(values, number, original, simulated)
        remarks.append(
            "the target was simulated in triangles of target.element_mm: each element gets the "
            "mean over the triangles whose centres it contains, and no sums"
        )
    if not own:
        remarks.append(
            f"{result.design.part.mesh_path.name} has no unique element numbers: its triangles "
            f"are written too, in {simulated.unit}, numbered from 1"
        )
    added = int((number == 0).sum())
    if added:
        remarks.append(
            f"left out {added} triangles that are in no element of the file: they close its holes"
        )
    remarks += _elements_left_out(fields)
    meanings = [f"{name.upper()}: {combination_of(name)[0]}" for name in fields.columns]
    decks = DECKS[to]([*_origin(result), *meanings], simulated, fields)
    files = {path.with_stem(path.stem + suffix): text for suffix, text in decks.items()}
    write_new_texts({check_new_file(file): text for file, text in files.items()})
    sets = "element sets by coverage, to be included in the deck's *Assembly"
    return [*remarks, *(f"{file.name}: {sets}" for file in files if file != path)]


def _elements_left_out(fields: ElementFields) -> list[str]:
    """Return remarks on elements that have no value.

    Columns that lack values for the same number of elements share a remark.
    """
    names: dict[int, list[str]] = {}
    for name, values in fields.columns.items():
        names.setdefault(int(np.isnan(values).sum()), []).append(name)
    return [
        f"left out {without} of {len(fields.numbers)} elements, not exposed or never hit: "
        f"{', '.join(columns)}"
        for without, columns in names.items()
        if without
    ]


def _origin(result: Result) -> list[str]:
    """Return the first lines of a deck.

    They name the program's version, the part's file, the peening time and the seed.
    """
    design, version = result.design, result.record.versions["chamberopt"]
    return [
        f"chamberopt {version}: simulated ultrasonic shot peening, values of each element",
        f"part file {design.part.mesh_path.name}, sha256 {result.record.part_sha256}",
        f"treatment time {design.process.treatment_time:g} s, seed {result.seeds[0]}",
    ]

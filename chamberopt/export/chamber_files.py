"""Write the chamber for the workshop, in mm, as one closed body or as its surfaces by name.

Normals point out of the cavity. The 3MF file holds one closed object. Its triangles have named base
materials, one for each surface. Programs without materials see one body.

Source: 3MF Core Specification 1.3, chapters 3.3, 4.1 and 5.1.
"""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from chamberopt.chamber.bores_and_deflectors import fitting_names
from chamberopt.common.errors import InputError
from chamberopt.common.files import make_output_folder, new_file
from chamberopt.design.shape_surface import TAG_PART, TAG_SONOTRODE, TAG_WALL, further_sonotrode_tag
from chamberopt.results.arrays_file import load_chamber
from chamberopt.results.load import load_result
from chamberopt.results.vtp_files import MM, write_stl

NAMES = {TAG_PART: "part", TAG_SONOTRODE: "sonotrode", TAG_WALL: "wall"}
PART_COLOUR, WALL_COLOUR, SONOTRODE_COLOUR = "#B9BEC4", "#9DB7CC", "#E08A2E"
ZIP_DATE = (1980, 1, 1, 0, 0, 0)  # fixed, so that the same chamber gives the same bytes
CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
MODEL = "3D/3dmodel.model"


class NamedSurfaces(NamedTuple):
    """The mesh of a cavity, and which of its triangles belong to which named surface.

    Args:
        vertices: vertices of the mesh [mm], shape (n, 3).
        triangles: a closed mesh with normals out of the cavity, shape (k, 3).
        surfaces: marks of the triangles of each surface, shape (k,) bool, by name of the surface.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    surfaces: dict[str, np.ndarray]


def read_cavity(folder: Path) -> NamedSurfaces:
    """Read the cavity of a results folder and return it with its named surfaces.

    The surfaces are named part, sonotrode and wall, and, as in the design, sonotrodes.0,
    chamber.holes.0, chamber.deflectors.0, holder, mask and so on.
    """
    result = load_result(folder)
    chamber = load_chamber(result)
    tags, fitting = chamber.tags, chamber.fitting
    if fitting is None:
        fitting = np.full(len(tags), -1)
    surfaces = {_name(int(tag)): (tags == tag) & (fitting < 0) for tag in np.unique(tags)}
    for number, name in enumerate(fitting_names(result.design)):
        surfaces[name] = fitting == number
    surfaces = {name: own for name, own in surfaces.items() if own.any()}
    return NamedSurfaces(chamber.vertices * MM, chamber.triangles, surfaces)


def write_cavity(folder: Path, file: Path) -> None:
    """Write the whole cavity of a chamber, from a results folder, as a binary STL file."""
    cavity = read_cavity(folder)
    write_stl(file, cavity.vertices, cavity.triangles)


def write_stl_per_surface(folder: Path, out: Path) -> None:
    """Write a binary STL of each surface of the cavity into a new folder."""
    cavity, out = read_cavity(folder), make_output_folder(out)
    for name, own in cavity.surfaces.items():
        write_stl(out / f"{name}.stl", cavity.vertices, cavity.triangles[own])


def write_fixtures(folder: Path, out: Path) -> list[str]:
    """Write holder and mask as closed bodies, each a binary STL in mm, into a new folder.

    They end at the part and at the wall of the chamber. Return a remark on each.
    """
    chamber = load_chamber(load_result(folder))
    if not chamber.fixtures:
        raise InputError(f"{folder}: its design has neither a [holder] nor a [mask] with a body")
    out = make_output_folder(out)
    for name, one in chamber.fixtures.items():
        write_stl(out / f"{name}.stl", one.vertices * MM, one.triangles)
    return ["holder and mask end at the chamber's wall: add what goes through it"]


def write_3mf(folder: Path, file: Path) -> None:
    cavity = read_cavity(folder)
    entries = {
        "[Content_Types].xml": '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
        '<Default Extension="rels" ContentType="application/'
        'vnd.openxmlformats-package.relationships+xml"/>'
        '<Default Extension="model" ContentType="application/'
        'vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>',
        "_rels/.rels": '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
        f'<Relationship Id="rel0" Target="/{MODEL}" '
        'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>',
        MODEL: _model(cavity),
    }
    with new_file(file) as content, zipfile.ZipFile(content, "w") as package:
        for name, text in entries.items():
            entry = zipfile.ZipInfo(name, ZIP_DATE)
            entry.compress_type = zipfile.ZIP_DEFLATED
            package.writestr(entry, f'<?xml version="1.0" encoding="UTF-8"?>\n{text}')


def _model(cavity: NamedSurfaces) -> str:
    surface = np.zeros(len(cavity.triangles), dtype=int)
    for number, own in enumerate(cavity.surfaces.values()):
        surface[own] = number
    bases = [f'<base name="{name}" displaycolor="{_colour(name)}"/>' for name in cavity.surfaces]
    vertices = [f'<vertex x="{x!r}" y="{y!r}" z="{z!r}"/>' for x, y, z in cavity.vertices.tolist()]
    triangles = [
        f'<triangle v1="{a}" v2="{b}" v3="{c}" pid="1" p1="{number}"/>'
        for (a, b, c), number in zip(cavity.triangles.tolist(), surface.tolist(), strict=True)
    ]
    return "\n".join(
        [
            f'<model unit="millimeter" xml:lang="en" xmlns="{CORE}">',
            f'<resources><basematerials id="1">{"".join(bases)}</basematerials>',
            '<object id="2" name="chamber" type="model" pid="1" pindex="0"><mesh><vertices>',
            *vertices,
            "</vertices><triangles>",
            *triangles,
            '</triangles></mesh></object></resources><build><item objectid="2"/></build></model>',
        ]
    )


def _name(tag: int) -> str:
    return NAMES.get(tag) or f"sonotrodes.{tag - further_sonotrode_tag(0)}"


def _colour(name: str) -> str:
    if name.startswith("sonotrode"):
        return SONOTRODE_COLOUR
    return PART_COLOUR if name == "part" else WALL_COLOUR

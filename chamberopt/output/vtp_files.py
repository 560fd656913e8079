"""Surfaces of a results folder: the part with what its triangles got, and the chamber. Both open in ParaView."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.files import atomic_write
from chamberopt.coverage.coverage_from_impacts import coverage_from_dent_density

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber

COVERAGE, CHAMBER = "coverage.vtp", "chamber.vtp"
COVERAGE_MODEL = "coverage_model"  # field data of coverage.vtp
MM = 1e3

Surface = Any
"""A pyvista.PolyData: pyvista's own annotations refuse numpy's."""


def pyvista() -> Any:
    """The library, imported when it is needed: half a second."""
    import pyvista

    return pyvista


def write_coverage(
    path: Path, chamber: Chamber, fields: dict[str, np.ndarray], coverage_model: str
) -> None:
    """Write the part, posed in the chamber [mm].

    Args:
        fields: cell data by name, (m,) each, from simulation.triangle_fields.
        coverage_model: how its coverage was computed, "avrami" or "dents".
    """
    part = chamber.part
    _write_surface(path, part.vertices, part.triangles, fields, {COVERAGE_MODEL: [coverage_model]})


def read_coverage_model(surface: Surface) -> str:
    """How the coverage of a coverage.vtp was computed, "avrami" or "dents"."""
    if COVERAGE_MODEL in surface.field_data:
        return str(surface.field_data[COVERAGE_MODEL][0])
    # Files of version 0.1.0 do not record the model, but only Avrami's follows from the density.
    expected = coverage_from_dent_density(np.asarray(surface["dent_density"]))
    same = np.allclose(surface["coverage"], expected, atol=1e-9, equal_nan=True)
    return "avrami" if same else "dents"


def write_chamber(folder: Path, chamber: Chamber) -> None:
    """The closed cavity [mm]: chamber.stl for CAD, chamber.vtp with tags (0 part, 1 sonotrode, 2 wall, 3 ... more),
    and which hole or deflector (fittings.fitting_names), -1: none.
    """
    fields = {"tag": chamber.tags, "source": chamber.source}
    if chamber.fitting is not None:
        fields["fitting"] = chamber.fitting
    _write_surface(folder / CHAMBER, chamber.vertices, chamber.triangles, fields)
    _write_surface(folder / "chamber.stl", chamber.vertices, chamber.triangles, {})


def _write_surface(
    path: Path,
    vertices: np.ndarray,
    triangles: np.ndarray,
    fields: dict[str, np.ndarray],
    properties: dict[str, list[str]] | None = None,
) -> None:
    surface = pyvista().PolyData.from_regular_faces(vertices * MM, triangles)
    for name, values in fields.items():
        surface.cell_data[name] = values
    for name, texts in (properties or {}).items():
        surface.field_data[name] = texts
    with atomic_write(path) as temporary:
        surface.save(temporary)


def read_surface(path: Path) -> Surface:
    """A .vtp of a results folder. VTK reads a damaged one as an empty mesh: here that is an InputError."""
    if not path.is_file():
        raise InputError(
            f"{path}: not there; give a results folder that simulate or run has finished"
        )
    with _quietly():
        surface = pyvista().read(path)
    if not isinstance(surface, pyvista().PolyData) or surface.n_cells == 0:
        raise InputError(f"{path}: damaged, no triangles could be read; simulate again")
    return surface


@contextmanager
def _quietly() -> Iterator[None]:
    """Without what VTK says of a damaged file, on three ways, in words nobody can act on."""
    disabled = logging.root.manager.disable
    with warnings.catch_warnings(), pyvista().vtk_verbosity("off"):
        warnings.simplefilter("ignore")
        logging.disable(logging.ERROR)
        try:
            yield
        finally:
            logging.disable(disabled)

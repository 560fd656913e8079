"""Write and read the surfaces of a results folder, which also open in ParaView.

coverage.vtp is the part with the fields of its triangles, chamber.vtp the closed cavity.
"""

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
"""A pyvista.PolyData; pyvista's own annotations do not fit numpy's."""


def pyvista() -> Any:
    """Import pyvista only where it is used, because that takes half a second."""
    import pyvista

    return pyvista


def write_coverage(
    path: Path, chamber: Chamber, fields: dict[str, np.ndarray], coverage_model: str = "avrami"
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
    """Write the closed cavity [mm] as chamber.stl for CAD and as chamber.vtp with cell data.

    tag: 0 part, 1 sonotrode, 2 wall, 3 and more further sonotrodes.
    source: triangle of the part, -1 elsewhere.
    fitting: number of the hole or deflector, -1 elsewhere; only in chambers that have some.
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
    """Read a .vtp of a results folder; InputError if it is missing or damaged."""
    if not path.is_file():
        raise InputError(
            f"{path}: not there; give a results folder that simulate or run has finished"
        )
    with _vtk_messages_off():
        surface = pyvista().read(path)
    # VTK reads a damaged file as an empty mesh.
    if not isinstance(surface, pyvista().PolyData) or surface.n_cells == 0:
        raise InputError(f"{path}: damaged, no triangles could be read; simulate again")
    return surface


@contextmanager
def _vtk_messages_off() -> Iterator[None]:
    """Suppress VTK's messages on a damaged file: warnings, its own log and Python's log."""
    disabled = logging.root.manager.disable
    with warnings.catch_warnings(), pyvista().vtk_verbosity("off"):
        warnings.simplefilter("ignore")
        logging.disable(logging.ERROR)
        try:
            yield
        finally:
            logging.disable(disabled)

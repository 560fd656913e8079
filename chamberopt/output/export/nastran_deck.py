"""Fields as Nastran pressures on shells: PLOAD4 in the large field format.

Each quantity is a load set.

Source: MSC Nastran Quick Reference Guide, PLOAD4. P1 alone is a pressure over the whole element,
for shells of first and second order. On a solid the entry needs the grids of the loaded face, which
are not stored.
"""

from __future__ import annotations

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io.part_mesh import PartMesh
from chamberopt.geometry.mesh_io.units import METRES_PER
from chamberopt.output.export.element_fields import ElementFields

FIRST_SID = 9001  # load set identifiers in a deck are usually smaller


def nastran_deck(header: list[str], mesh: PartMesh, fields: ElementFields) -> dict[str, str]:
    """Return the text of the one file, under the suffix ""; InputError for solid elements."""
    own = mesh.numbering.own
    if own and mesh.numbering.faces.any():
        raise InputError(
            "fields on solid elements are not supported as Nastran loads: coat the skin with "
            "shells (CTRIA3, CQUAD4), or export to abaqus or vtkhdf"
        )
    lines = [f"$ {line}\n" for line in header]
    lines.append(
        "$ These are values, not loads: the pressure of a PLOAD4 is the value. Load sets:\n"
    )
    sids = {name: FIRST_SID + k for k, name in enumerate(fields.columns)}
    lines += [f"$ SID {sid} {name.upper()}\n" for name, sid in sids.items()]
    if not own:
        lines += _mesh(mesh)
    for name, sid in sids.items():
        values = fields.columns[name]
        known = np.flatnonzero(~np.isnan(values))
        rows = zip(fields.numbers[known].tolist(), values[known].tolist(), strict=True)
        lines += [f"PLOAD4* {sid:>16}{number:>16}{_real(value):>16}\n*\n" for number, value in rows]
    return {"": "".join(lines)}


def _mesh(mesh: PartMesh) -> list[str]:
    positions = mesh.vertices / METRES_PER[mesh.unit]
    grids = [
        f"GRID*   {k:>16}{'':16}{_real(x):>16}{_real(y):>16}\n*       {_real(z):>16}\n"
        for k, (x, y, z) in enumerate(positions.tolist(), start=1)
    ]
    triangles = enumerate((mesh.triangles + 1).tolist(), start=1)
    return grids + [f"CTRIA3  {k:>8}{1:>8}{a:>8}{b:>8}{c:>8}\n" for k, (a, b, c) in triangles]


def _real(value: float) -> str:
    """A real number in at most 16 characters, with the decimal point that Nastran requires."""
    for digits in range(12, 0, -1):
        mantissa, exponent, power = f"{value:.{digits}g}".upper().partition("E")
        text = mantissa + ("" if "." in mantissa else ".") + exponent + power
        if len(text) <= 16:
            break
    return text

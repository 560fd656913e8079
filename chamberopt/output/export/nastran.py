"""Fields as Nastran pressures on shells: PLOAD4, one load set (SID) a quantity, in the large field format.

MSC Nastran Quick Reference Guide, PLOAD4: P1 alone is a pressure all over the element; shells of first and second
order take it. A solid's needs the grids of its loaded face, which mesh_io does not keep.
"""

from __future__ import annotations

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io import PartMesh
from chamberopt.geometry.mesh_io.units import METRES_PER
from chamberopt.output.export.elements import ElementFields

FIRST_SID = 9001  # above what decks usually have


def nastran_deck(about: list[str], mesh: PartMesh, fields: ElementFields) -> dict[str, str]:
    """What to write, as the file itself: "". Raises InputError for solid elements."""
    own = mesh.numbering.own
    if own and mesh.numbering.faces.any():
        raise InputError(
            "fields on solid elements are not supported as Nastran loads: coat the skin with shells (CTRIA3, CQUAD4), "
            "or export to abaqus or vtkhdf"
        )
    lines = [f"$ {line}\n" for line in about]
    lines.append("$ No loads: a PLOAD4's pressure is the number. Sets, one a quantity:\n")
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
    places = mesh.vertices / METRES_PER[mesh.unit]
    grids = [
        f"GRID*   {k:>16}{'':16}{_real(x):>16}{_real(y):>16}\n*       {_real(z):>16}\n"
        for k, (x, y, z) in enumerate(places.tolist(), start=1)
    ]
    triangles = enumerate((mesh.triangles + 1).tolist(), start=1)
    return grids + [f"CTRIA3  {k:>8}{1:>8}{a:>8}{b:>8}{c:>8}\n" for k, (a, b, c) in triangles]


def _real(value: float) -> str:
    """A real in at most 16 characters, with the point that makes it one."""
    for digits in range(12, 0, -1):
        mantissa, exponent, power = f"{value:.{digits}g}".upper().partition("E")
        text = mantissa + ("" if "." in mantissa else ".") + exponent + power
        if len(text) <= 16:
            break
    return text

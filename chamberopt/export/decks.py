"""Write the values of a part's elements as input decks of Abaqus and Nastran.

A deck for Abaqus has a *DISTRIBUTION on elements, with a RATIO for each element. A deck for Nastran
has pressures on shells, PLOAD4 in the large field format, with a load set for each quantity. The
field P1 alone is a pressure over the whole element, for shells of first and second order. On a
solid PLOAD4 needs the nodes of the loaded face, which are not stored.

Source: Abaqus Keywords Reference Guide, *DISTRIBUTION (levels: part, instance, assembly, model; its
first line is the default), *DISTRIBUTION TABLE (level: model) and *ELSET (levels: part, instance,
assembly). MSC Nastran Quick Reference Guide, PLOAD4.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.export.element_fields import ElementFields
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.meshes.units import METRES_PER

TABLE = "CHAMBEROPT_SCALAR"
COVERAGE_BANDS = (0.0, 0.5, 0.9, 0.98, 1.0)  # 98 % counts as full coverage (SAE J2277)
NUMBERS_PER_LINE = 16  # limit of Abaqus for the data lines of *ELSET


def abaqus_deck(header: list[str], mesh: PartMesh, fields: ElementFields) -> dict[str, str]:
    """Return the Abaqus deck of element values: the text of each file by the suffix of its name.

    The suffix is "" if there is one file. If the part's deck has an instance, a second file with
    the suffix "_sets" holds the element sets, because distributions belong to the model and sets to
    the assembly.
    """
    instance = mesh.numbering.instance
    head = "".join(f"** {line}\n" for line in header)
    sets = "".join(_sets(fields, f", instance={instance}" if instance else ""))
    level = (
        "** Include at the level of the model, outside of parts and assembly. "
        "Elements that are not listed get the default, 0.\n"
    )
    body = "" if mesh.numbering.own else "".join(_abaqus_mesh(mesh))
    body += f"*Distribution Table, name={TABLE}\nRATIO\n"
    prefix = f"{instance}." if instance else ""
    for name, values in fields.columns.items():
        known = np.flatnonzero(~np.isnan(values))
        rows = zip(fields.numbers[known].tolist(), values[known].tolist(), strict=True)
        body += f"*Distribution, name={name.upper()}, location=ELEMENT, table={TABLE}\n, 0.\n"
        body += "".join(f"{prefix}{number}, {value:.9g}\n" for number, value in rows)
    if instance:
        return {"": head + level + body, "_sets": head + "** Include in the assembly.\n" + sets}
    return {"": head + level + body + sets}


def _abaqus_mesh(mesh: PartMesh) -> list[str]:
    positions = mesh.vertices / METRES_PER[mesh.unit]
    return [
        "*Node\n",
        *(
            f"{k}, {x:.12g}, {y:.12g}, {z:.12g}\n"
            for k, (x, y, z) in enumerate(positions.tolist(), start=1)
        ),
        "*Element, type=S3, elset=PART\n",
        *(
            f"{k}, {a}, {b}, {c}\n"
            for k, (a, b, c) in enumerate((mesh.triangles + 1).tolist(), start=1)
        ),
    ]


def _sets(fields: ElementFields, instance: str) -> list[str]:
    """Return Abaqus lines that put elements into a set for each band of coverage.

    Bands without elements are left out. `instance` is text to add to the keyword *Elset.
    """
    lines = []
    coverage = fields.columns["coverage"]
    for low, high in pairwise(COVERAGE_BANDS):
        inside = (coverage >= low) & ((coverage < high) | (high == COVERAGE_BANDS[-1]))
        numbers = fields.numbers[inside].tolist()
        if numbers:
            lines.append(f"*Elset, elset=COVERAGE_{100 * low:.0f}_TO_{100 * high:.0f}{instance}\n")
        lines += [
            ", ".join(map(str, numbers[at : at + NUMBERS_PER_LINE])) + "\n"
            for at in range(0, len(numbers), NUMBERS_PER_LINE)
        ]
    return lines


FIRST_SID = 9001  # load set identifiers in a deck are usually smaller


def nastran_deck(header: list[str], mesh: PartMesh, fields: ElementFields) -> dict[str, str]:
    """Return the Nastran deck of element values: the text of its only file, with the suffix "".

    Raises InputError for solid elements.
    """
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
        lines += _nastran_mesh(mesh)
    for name, sid in sids.items():
        values = fields.columns[name]
        known = np.flatnonzero(~np.isnan(values))
        rows = zip(fields.numbers[known].tolist(), values[known].tolist(), strict=True)
        lines += [f"PLOAD4* {sid:>16}{number:>16}{_real(value):>16}\n*\n" for number, value in rows]
    return {"": "".join(lines)}


def _nastran_mesh(mesh: PartMesh) -> list[str]:
    positions = mesh.vertices / METRES_PER[mesh.unit]
    grids = [
        f"GRID*   {k:>16}{'':16}{_real(x):>16}{_real(y):>16}\n*       {_real(z):>16}\n"
        for k, (x, y, z) in enumerate(positions.tolist(), start=1)
    ]
    triangles = enumerate((mesh.triangles + 1).tolist(), start=1)
    return grids + [f"CTRIA3  {k:>8}{1:>8}{a:>8}{b:>8}{c:>8}\n" for k, (a, b, c) in triangles]


def _real(value: float) -> str:
    """Return a number in at most 16 characters, with the decimal point that Nastran requires."""
    for digits in range(12, 0, -1):
        mantissa, exponent, power = f"{value:.{digits}g}".upper().partition("E")
        text = mantissa + ("" if "." in mantissa else ".") + exponent + power
        if len(text) <= 16:
            break
    return text

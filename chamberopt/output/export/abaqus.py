"""Fields as Abaqus distributions: *DISTRIBUTION on elements, its one number a *DISTRIBUTION TABLE's RATIO.

Abaqus Keywords Reference Guide, *DISTRIBUTION (levels: part, instance, assembly, model; its first line the default),
*DISTRIBUTION TABLE (level: model) and *ELSET (levels: part, instance, assembly).
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from chamberopt.geometry.mesh_io import PartMesh
from chamberopt.geometry.mesh_io.units import METRES_PER
from chamberopt.output.export.elements import ElementFields

TABLE = "CHAMBEROPT_SCALAR"
BANDS = (0.0, 0.5, 0.9, 0.98, 1.0)  # of coverage: 98 % counts as all of it (SAE J443)
A_LINE = 16  # numbers on a data line of *ELSET, Abaqus's limit


def abaqus_deck(about: list[str], mesh: PartMesh, fields: ElementFields) -> dict[str, str]:
    """What to write, by what is added to the file's name: "" alone, or element sets in a file of their own, "_sets".

    The latter for a deck with an instance: distributions there are for the model, sets for its assembly.
    """
    instance = mesh.numbering.instance
    head = "".join(f"** {line}\n" for line in about)
    sets = "".join(_sets(fields, f", instance={instance}" if instance else ""))
    place = "** For the model's level, outside of parts and assembly. Elements not listed get the default, 0.\n"
    body = "" if mesh.numbering.own else "".join(_mesh(mesh))
    body += f"*Distribution Table, name={TABLE}\nRATIO\n"
    prefix = f"{instance}." if instance else ""
    for name, values in fields.columns.items():
        known = np.flatnonzero(~np.isnan(values))
        rows = zip(fields.numbers[known].tolist(), values[known].tolist(), strict=True)
        body += f"*Distribution, name={name.upper()}, location=ELEMENT, table={TABLE}\n, 0.\n"
        body += "".join(f"{prefix}{number}, {value:.9g}\n" for number, value in rows)
    if instance:
        return {"": head + place + body, "_sets": head + "** For the assembly's level.\n" + sets}
    return {"": head + place + body + sets}


def _mesh(mesh: PartMesh) -> list[str]:
    places = mesh.vertices / METRES_PER[mesh.unit]
    return [
        "*Node\n",
        *(
            f"{k}, {x:.12g}, {y:.12g}, {z:.12g}\n"
            for k, (x, y, z) in enumerate(places.tolist(), start=1)
        ),
        "*Element, type=S3, elset=PART\n",
        *(
            f"{k}, {a}, {b}, {c}\n"
            for k, (a, b, c) in enumerate((mesh.triangles + 1).tolist(), start=1)
        ),
    ]


def _sets(fields: ElementFields, instance: str) -> list[str]:
    """Elements by bands of coverage; bands without any are left out."""
    lines = []
    coverage = fields.columns["coverage"]
    for low, high in pairwise(BANDS):
        inside = (coverage >= low) & ((coverage < high) | (high == BANDS[-1]))
        numbers = fields.numbers[inside].tolist()
        if numbers:
            lines.append(f"*Elset, elset=COVERAGE_{100 * low:.0f}_TO_{100 * high:.0f}{instance}\n")
        lines += [
            ", ".join(map(str, numbers[at : at + A_LINE])) + "\n"
            for at in range(0, len(numbers), A_LINE)
        ]
    return lines

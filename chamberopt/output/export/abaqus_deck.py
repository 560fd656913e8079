"""Fields as Abaqus distributions: *DISTRIBUTION on elements, with one RATIO for each element.

Source: Abaqus Keywords Reference Guide, *DISTRIBUTION (levels: part, instance, assembly, model; its
first line is the default), *DISTRIBUTION TABLE (level: model) and *ELSET (levels: part, instance,
assembly).
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from chamberopt.geometry.mesh_io.part_mesh import PartMesh
from chamberopt.geometry.mesh_io.units import METRES_PER
from chamberopt.output.export.element_fields import ElementFields

TABLE = "CHAMBEROPT_SCALAR"
COVERAGE_BANDS = (0.0, 0.5, 0.9, 0.98, 1.0)  # 98 % counts as full coverage (SAE J2277)
NUMBERS_PER_LINE = 16  # limit of Abaqus for the data lines of *ELSET


def abaqus_deck(header: list[str], mesh: PartMesh, fields: ElementFields) -> dict[str, str]:
    """Return the text of each file, by the suffix of its name.

    There is one file, "", unless the part's deck has an instance. Then the element sets are in a
    second file, "_sets", because distributions belong to the model and sets to the assembly.
    """
    instance = mesh.numbering.instance
    head = "".join(f"** {line}\n" for line in header)
    sets = "".join(_sets(fields, f", instance={instance}" if instance else ""))
    level = (
        "** Include at the level of the model, outside of parts and assembly. "
        "Elements that are not listed get the default, 0.\n"
    )
    body = "" if mesh.numbering.own else "".join(_mesh(mesh))
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


def _mesh(mesh: PartMesh) -> list[str]:
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
    """Element sets by bands of coverage; empty bands are left out."""
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

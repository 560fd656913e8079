"""Write the residual stress of a result for another solver: a table, and layers of shells.

A composite shell has a material for each layer, whose thermal expansion is the mean eigenstrain of
the layer: heated by 1 K, the shell bends and stretches as the peened plate does. A shell has no
stress along its normal, so that one expansion in all directions is right. CalculiX makes solids of
shells, whose layers hinder each other's expansion along the normal: nu / (1 - nu) times the stress
s along it stands in those along the surface too. Bending is right, as the sum of s over the
thickness is 0. On a solid with a curved skin such an expansion is wrong by up to a third: solids
have initial stress (stress_solid.py).

Source: Abaqus Keywords Reference Guide and CalculiX CrunchiX user's manual, *SHELL SECTION with
COMPOSITE: a line for each layer, from the face at the negative side of the normal on, of its
thickness, number of section points (not used by CalculiX) and material. *EXPANSION, ZERO.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.build import TARGET
from chamberopt.common.errors import InputError
from chamberopt.common.files import csv_text, write_text
from chamberopt.coverage.stress_knowledge import band_of_profile
from chamberopt.coverage.stress_law import integrals
from chamberopt.design.flexure import plate_metals
from chamberopt.results.load import load_result

if TYPE_CHECKING:
    from chamberopt.results.load import Result
    from chamberopt.results.records import ProfileRecord, StressRecord

LAYERS = 16  # layers of the peened skin; the arc of a strip is then right to 0.1 %
COLUMNS = (
    "surface", "depth_um", "eigenstrain", "stress_MPa", "stress_pm_MPa", "law_low_MPa",
    "law_high_MPa",
)  # fmt: skip


class Layer(NamedTuple):
    """A layer of a shell: its thickness [mm] and its mean eigenstrain."""

    thickness: float
    eigenstrain: float


def write_stress_table(folder: Path, file: Path) -> None:
    """Write stress and eigenstrain by depth, under the target and each zone, as .csv.

    stress_pm_MPa is the 95 % half-width by the replicas, and law_low_MPa to law_high_MPa is what
    the law is good for.

    Raises InputError for a result without stress.
    """
    found = require_stress(load_result(folder))
    rows: list[dict[str, object]] = []
    for name, one in found.profiles.items():
        depth, stress = np.array(one.depth_um), np.array(one.stress_MPa)
        low, high = band_of_profile(depth, stress, found.bands)
        half_widths: list[float] | list[str] = one.half_width_MPa or [""] * len(depth)
        columns = (one.depth_um, one.eigenstrain, one.stress_MPa, half_widths, low, high)
        for values in zip(*columns, strict=True):
            texts = [f"{x:.6g}" if isinstance(x, float) else x for x in values]
            rows.append(dict(zip(COLUMNS, (name, *texts), strict=True)))
    write_text(file, csv_text(rows))


def write_shell_layers(folder: Path, file: Path) -> list[str]:
    """Write sections of composite shells for CalculiX and Abaqus, one for target and each zone.

    Return a remark on how to use them.

    Raises InputError for a result without stress, or of a thick part.
    """
    result = load_result(folder)
    found, metals = require_stress(result), plate_metals(result.design)
    assert metals is not None
    if found.thickness_mm is None:
        raise InputError(
            "stress.thickness_mm: not given, and shells have a thickness; give it in the design "
            "and simulate again, or export stress-csv"
        )
    if len({name.upper() for name in found.profiles}) < len(found.profiles):
        raise InputError("zones: names that differ only in case are one name in a deck; change one")
    poisson = metals.part.poisson
    lines = [
        "** Residual stress by chamberopt, as layers of composite shells. Units: mm, N, MPa, K.",
        "** Take an element set of each section from your own mesh, with normals out of the peened",
        "** face; in CalculiX of S8R or S6, and with *EL FILE, as *EL PRINT fails on many layers.",
        "** Initial temperature 0; a step without loads at 1 K, with *TEMPERATURE, balances.",
        "** What Abaqus then prints as stress is the answer. CalculiX makes solids of shells: from",
        "** the stresses along the surface take away that along the normal times",
        f"** nu / (1 - nu) = {poisson / (1.0 - poisson):.4g}. It is an estimate, see the CSV.",
    ]
    for name, profile in found.profiles.items():
        lines += _section(name, profile, found, (metals.part.modulus / 1e6, poisson))
    write_text(file, "".join(f"{line}\n" for line in lines))
    return ["heat the shells by 1 K in a step without loads: expansions are eigenstrains"]


def shell_layers(profile: ProfileRecord, found: StressRecord) -> list[Layer]:
    """Return the layers of a shell from its lower face to the peened upper face."""
    assert found.thickness_mm is not None
    depth, strain = 1e-3 * np.array(profile.depth_um), np.array(profile.eigenstrain)
    edges = np.linspace(0, len(depth) - 1, LAYERS + 1).astype(int)
    skin = []
    for first, last in pairwise(edges.tolist()):
        inside = slice(first, last + 1)
        thickness = float(depth[last] - depth[first])
        mean = float(integrals(depth[inside], strain[inside])[0]) / thickness
        skin.append(Layer(thickness, mean))
    skins = 2 if found.peened == "both_sides" else 1
    core = found.thickness_mm - skins * float(depth[-1])
    if core < 0.0:
        raise InputError(
            f"stress.thickness_mm: given {found.thickness_mm:g}, less than the compressed layer; "
            "give the thickness of the plate"
        )
    return [*(skin if skins > 1 else ()), Layer(core, 0.0), *reversed(skin)]


def _section(
    name: str, profile: ProfileRecord, found: StressRecord, elastic: tuple[float, float]
) -> Iterator[str]:
    """Yield the lines of the materials and the section of one surface.

    Args:
        elastic: Young's modulus [MPa] and Poisson's ratio.
    """
    title = "PEENED_" + ("TARGET" if name == TARGET else name.upper())
    layers = shell_layers(profile, found)
    for number, one in enumerate(layers, start=1):
        yield f"*MATERIAL, NAME={title}_{number}"
        yield "*ELASTIC"
        yield f"{elastic[0]:.9g}, {elastic[1]:.9g}"
        yield "*EXPANSION, ZERO=0."
        yield f"{one.eigenstrain:.9g}"
    yield f"*SHELL SECTION, ELSET={title}, COMPOSITE"
    for number, one in enumerate(layers, start=1):
        yield f"{one.thickness:.9g}, 3, {title}_{number}"


def require_stress(result: Result) -> StressRecord:
    """Return the stress of a result. Raise InputError if it has none, with the reason."""
    found = result.record.stress
    if found is None:
        raise InputError(
            f"{result.folder}: has no residual stress; add a table [stress] to the design and "
            "simulate again"
        )
    if not found.profiles:
        why = result.metrics["surface_stress_MPa"].in_words
        raise InputError(f"{result.folder}: its residual stress is not told: {why}")
    return found

"""List the formats that `chamberopt export` can write."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Literal

from chamberopt.common.errors import InputError

FrameName = Literal["part", "chamber"]


@dataclass(frozen=True)
class ExportFormat:
    """A format that `chamberopt export` can write, and the function that writes it.

    Args:
        file: name of the written file; a name without an ending is a folder.
        summary: a line for --help.
        endings: endings that a file name chosen by the user may have.
        writer: "module.function" in this package, called with (results folder, file, *arguments).
            It returns remarks or None. Its module is imported when it is needed. None for impacts,
            which are simulated again, once for all formats of impacts.
        arguments: further arguments of the writer.
        takes_mesh: True if its last argument is the user's own mesh.
    """

    file: str
    summary: str
    endings: tuple[str, ...] = ()
    writer: str | None = None
    arguments: tuple[str, ...] = ()
    takes_mesh: bool = False

    def write(self, folder: Path, file: Path, mesh: Path | None = None) -> list[str]:
        """Write a result in this format to a file and return remarks for the user.

        Args:
            mesh: the user's own mesh, for a format that takes one.
        """
        module, function = str(self.writer).split(".")
        write = getattr(import_module(f"chamberopt.export.{module}"), function)
        own = (mesh,) if self.takes_mesh else ()
        return write(folder, file, *self.arguments, *own) or []


STUDY = "study-csv"  # the only format for a study without a result, and for a sweep
FORMATS = {
    "impacts-parquet": ExportFormat(
        "impacts.parquet",
        "every impact: time, triangle, position, velocity, ball, dent",
        (".parquet",),
    ),
    "impacts-csv": ExportFormat(
        "impacts.csv", "the same as text; compressed with --out FILE.csv.gz", (".csv", ".csv.gz")
    ),
    "fields-vtp": ExportFormat(
        "fields.vtp",
        "the values of each triangle of the part, for ParaView",
        (".vtp",),
        "fields.write_fields",
        ("vtp",),
    ),
    "fields-vtkhdf": ExportFormat(
        "fields.vtkhdf", "the same as VTKHDF", (".vtkhdf",), "fields.write_fields", ("vtkhdf",)
    ),
    "fields-abaqus": ExportFormat(
        "fields.inp",
        "distributions on the elements of the part's file",
        (".inp", ".inc"),
        "fields.write_fields",
        ("abaqus",),
    ),
    "fields-nastran": ExportFormat(
        "fields.bdf",
        "PLOAD4 on the elements of the part's file",
        (".bdf", ".nas"),
        "fields.write_fields",
        ("nastran",),
    ),
    "chamber-stl": ExportFormat(
        "chamber.stl",
        "the cavity as one closed body, in mm",
        (".stl",),
        "chamber_files.write_cavity",
    ),
    "chamber-stl-per-tag": ExportFormat(
        "chamber-stl",
        "one STL for each surface of the cavity: part, sonotrode, wall ...",
        (),
        "chamber_files.write_stl_per_surface",
    ),
    "fixtures-stl": ExportFormat(
        "fixtures-stl",
        "holder and mask as closed bodies, an STL each, in mm",
        (),
        "chamber_files.write_fixtures",
    ),
    "chamber-3mf": ExportFormat(
        "chamber.3mf",
        "the closed cavity with named surfaces, in mm",
        (".3mf",),
        "chamber_files.write_3mf",
    ),
    "stress-csv": ExportFormat(
        "stress.csv",
        "residual stress and eigenstrain by depth, under target and zones",
        (".csv",),
        "stress.write_stress_table",
    ),
    "stress-shells": ExportFormat(
        "stress_shells.inp",
        "the same as layers of composite shells, for CalculiX and Abaqus",
        (".inp", ".inc"),
        "stress.write_shell_layers",
    ),
    "stress-solid": ExportFormat(
        "stress_solid.inp",
        "the same as initial stress in your own solids, for CalculiX; takes --mesh",
        (".inp", ".inc"),
        "stress_solid.write_solid_stress",
        takes_mesh=True,
    ),
    "tolerances-csv": ExportFormat(
        "tolerances.csv",
        "what each tolerance does to each figure",
        (".csv",),
        "tables.write_tolerance_table",
    ),
    STUDY: ExportFormat(
        "study.csv",
        "the evaluations of a study or sweep, finished or not",
        (".csv",),
        "tables.write_study_table",
    ),
}


def formats_by_name(names: Sequence[str]) -> dict[str, ExportFormat]:
    """Return the formats with these names, each format once.

    Raises:
        InputError: a name is unknown, or no name is given.
    """
    if not names:
        raise InputError(
            f"--to: give one or more of {', '.join(FORMATS)} (chamberopt export --help)"
        )
    for name in names:
        if name not in FORMATS:
            from chamberopt.common.toml_errors import did_you_mean  # imports pydantic

            raise InputError(
                f"--to: given {name!r}; {did_you_mean(name, FORMATS)} (chamberopt export --help)"
            )
    return {name: FORMATS[name] for name in dict.fromkeys(names)}


def is_file(out: Path, formats: dict[str, ExportFormat]) -> bool:
    """Return True if the option --out names a file, False if it names a folder.

    Raises:
        InputError: the option names a file, but several formats are to be written, or the file's
            ending belongs to another format.
    """
    if not _has_ending(out, [ending for one in FORMATS.values() for ending in one.endings]):
        return False
    name, single = next(iter(formats.items()))
    if len(formats) > 1:
        raise InputError(f"--out {out}: one file for {len(formats)} formats; give a folder")
    if not _has_ending(out, single.endings):
        names = f"a name in {' or '.join(single.endings)}, or " if single.endings else ""
        raise InputError(f"--out {out}: is not a file of {name}; give {names}a folder")
    return True


def _has_ending(path: Path, endings: Sequence[str]) -> bool:
    return path.name.lower().endswith(tuple(endings)) if endings else False
